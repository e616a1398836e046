//! The map of a tracking run: north up, equal scales, everything that was true, seen and estimated.

use std::collections::BTreeMap;

use crate::drawing::map::{self, Scale};
use crate::drawing::plot::{Sign, WIDTH, key};
use crate::drawing::style::SERIES;
use crate::drawing::svg::Svg;
use northing_evaluation::tracking::matching::Place;
use northing_evaluation::tracking::{TrackEpoch, TrackedTarget};

/// Detections drawn at most.
const DOTS: usize = 6000;
/// Colours of tracks: one less than there are, because the last looks like the truth's.
const COLOURS: usize = SERIES - 1;
/// Ellipses drawn of each track.
const ELLIPSES: usize = 12;
/// Radius of the largest ellipse drawn, as a share of the map's width: a track that has lost its target
/// would cover all others.
const LARGEST_ELLIPSE: f64 = 0.08;
/// Corners of an ellipse.
const CORNERS: usize = 40;
/// Standard deviations of an ellipse that holds 95 %.
const SIGMAS_95: f64 = 2.447_746_830_680_816;

/// Room around what is drawn, m.
const ROOM_M: f64 = 10.0;

/// The larger half axis of a track's 95 % ellipse, in units of the picture.
fn radius(scale: &Scale, track: &TrackedTarget) -> f64 {
    let [nn, ne, ee] = track.place_covariance();
    let largest = 0.5 * (nn + ee) + (0.5 * (nn - ee)).hypot(ne);
    SIGMAS_95 * largest.sqrt() * scale.units_per_m
}

/// The map; `None` when nothing has a place.
pub(crate) fn render(epochs: &[TrackEpoch]) -> Option<String> {
    let mut places: Vec<Place> = epochs.iter().map(|e| e.own_ship).collect();
    places.extend(epochs.iter().flat_map(|e| e.truth.iter().map(|(_, p)| *p)));
    places.extend(epochs.iter().flat_map(|e| e.tracks.iter().map(|t| t.place)));
    let scale = Scale::new(&places, ROOM_M)?;
    let mut keys = vec![
        key(Sign::Line, "line s0", "a track (each its colour)"),
        key(Sign::Line, "line bold reference", "own ship"),
        key(Sign::Dot, "dots soft s5", "detections"),
    ];
    if epochs.iter().any(|e| !e.truth.is_empty()) {
        let dashed = "line thin dash reference";
        keys.push(key(Sign::Line, dashed, "a target's true path"));
    }
    let label = "Map of tracks, truth, detections and own ship";
    let mut svg = map::open(&scale, label, &keys);
    let detections: Vec<Place> = epochs.iter().flat_map(|e| e.detections.clone()).collect();
    svg.dots(&scale.dots(&detections, DOTS), "dots soft s5");
    svg.lines(&[own_ship(&scale, epochs)], "line bold reference");
    tracks(&mut svg, &scale, epochs);
    truth(&mut svg, &scale, epochs);
    Some(map::close(svg))
}

/// The own ship's path, without the points where it waits.
fn own_ship(scale: &Scale, epochs: &[TrackEpoch]) -> Vec<[f64; 2]> {
    let mut places: Vec<Place> = epochs.iter().map(|e| e.own_ship).collect();
    places.dedup();
    scale.path(&places)
}

fn tracks(svg: &mut Svg, scale: &Scale, epochs: &[TrackEpoch]) {
    let mut by_id = BTreeMap::<u32, Vec<TrackedTarget>>::new();
    for track in epochs.iter().flat_map(|e| &e.tracks) {
        by_id.entry(track.id).or_default().push(*track);
    }
    for (i, track) in by_id.values().enumerate() {
        let class = format!("s{}", i % COLOURS);
        let step = track.len().div_ceil(ELLIPSES).max(1);
        let ellipses: Vec<_> = track
            .iter()
            .step_by(step)
            .filter(|t| radius(scale, t) < LARGEST_ELLIPSE * WIDTH)
            .map(|t| scale.ellipse(t.place, t.place_covariance(), SIGMAS_95, CORNERS))
            .collect();
        svg.lines(&ellipses, &format!("line thin soft {class}"));
        let places: Vec<Place> = track.iter().map(|t| t.place).collect();
        svg.lines(&[scale.path(&places)], &format!("line {class}"));
    }
}

fn truth(svg: &mut Svg, scale: &Scale, epochs: &[TrackEpoch]) {
    let mut by_target = BTreeMap::<u32, Vec<Place>>::new();
    for (target, place) in epochs.iter().flat_map(|e| &e.truth) {
        by_target.entry(*target).or_default().push(*place);
    }
    for (target, places) in &by_target {
        let path = scale.path(places);
        if let Some([x, y]) = path.last() {
            svg.text(
                [x + 8.0, *y],
                "tag reference-fill",
                &format!("target {target}"),
            );
        }
        svg.lines(&[path], "line thin dash reference");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_core::nalgebra::SMatrix;
    use northing_evaluation::tracking::{EpochScan, TargetAssociation};

    fn covariance() -> SMatrix<f64, 5, 5> {
        let mut out = SMatrix::from_diagonal(&[4.0, 1.0, 9.0, 1.0, 0.01].into());
        (out[(0, 2)], out[(2, 0)]) = (1.0, 1.0);
        out
    }

    fn epoch(time_s: f64) -> TrackEpoch {
        TrackEpoch {
            time_ns: 0,
            time_s,
            own_ship: [0.0, 0.0],
            detections: vec![[100.0 + time_s, 50.0], [1e9, 0.0]],
            doubtful: Vec::new(),
            tracks: vec![TrackedTarget {
                id: 3,
                place: [101.0 + time_s, 50.0],
                velocity: [1.0, 0.0],
                turn_rate: 0.0,
                covariance: covariance(),
                existence: 1.0,
                visibility: 1.0,
                models: [1.0, 0.0, 0.0],
                association: TargetAssociation::default(),
            }],
            scan: EpochScan {
                sensor: 0,
                scan: Some(0),
            },
            updated: None,
            ended: Vec::new(),
            truth: vec![(1, [100.0 + time_s, 50.0])],
        }
    }

    #[test]
    fn the_ellipse_has_the_extent_of_its_covariance() {
        let scale = Scale {
            west: 0.0,
            north: 0.0,
            units_per_m: 1.0,
        };
        let seen = epoch(0.0);
        let track = &seen.tracks[0];
        let outline = scale.ellipse(track.place, track.place_covariance(), SIGMAS_95, CORNERS);
        let reach = |axis: usize| {
            let values = outline.iter().map(|p| p[axis]);
            0.5 * (values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min))
        };
        let ends = outline.iter().map(|p| (p[0] - 50.0).hypot(p[1] + 101.0));
        let longest = ends.fold(0.0, f64::max);
        approx::assert_relative_eq!(
            radius(&scale, &epoch(0.0).tracks[0]),
            longest,
            max_relative = 5e-3
        );
        // to the corners of a polygon
        approx::assert_relative_eq!(reach(0), 3.0 * SIGMAS_95, max_relative = 5e-3);
        approx::assert_relative_eq!(reach(1), 2.0 * SIGMAS_95, max_relative = 5e-3);
    }

    #[test]
    fn a_map_shows_truth_tracks_and_detections_and_nothing_makes_none() {
        let epochs: Vec<_> = (0..20).map(|k| epoch(f64::from(k))).collect();
        let svg = render(&epochs).unwrap();
        for part in ["target 1", "thin soft s0", "dots soft", "own ship"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("NaN") && render(&[]).is_none());
    }
}
