//! Plots of a navigation run: the track on a map, the paper's figures, errors, outages, innovations.

use super::attitude_plots::{angle_axis, band_layer, error_limit, is_drawn, line};
use super::axis::Axis;
use super::innovation_plots::Fate;
use super::map::{self, Place, Scale};
use super::plot::{DOTS, Figure, Key, LINE_POINTS, Layer, Panel, Sign, TIME, WIDTH, key};
use super::series::{self, BandPoint, Point};
use crate::navigation::AidKind;
use crate::navigation::score::{CHI_SQUARE_95, OutageScore};
use crate::navigation::trace::{AidPoint, NavigationPoint, NavigationTrace};
use northing_core::navigation::Validity;

/// Room at the right of figures without names there.
const RIGHT: f64 = 14.0;
/// Room around a track, m.
const ROOM_M: f64 = 2.0;
/// Ellipses drawn along a track.
const ELLIPSES: usize = 40;
/// Corners of an ellipse.
const CORNERS: usize = 36;
/// The larger half axis of an ellipse worth drawing, in units of the picture.
const LARGEST_ELLIPSE: f64 = 0.12 * WIDTH;
/// Half width of bands, standard deviations.
const SIGMAS: f64 = 3.0;
/// Class of fixes that the estimator got.
const USED: &str = "dots soft device";
/// Class of fixes kept back, and of the reference.
const KEPT_BACK: &str = "dots soft reference";

fn place(position_m: [f64; 3]) -> Place {
    [position_m[0], position_m[1]]
}

/// Seen from above: fixes, reference and estimate with its 95 % ellipses; dead reckoning in the colour of what
/// was refused. `None` without estimates.
pub(super) fn track(trace: &NavigationTrace) -> Option<String> {
    let points = trace.points.items();
    let mut places: Vec<Place> = points.iter().map(|p| place(p.position_m)).collect();
    let fixes = |used: bool| -> Vec<Place> {
        let of = trace.fixes.items().iter().filter(move |f| f.used == used);
        of.map(|f| place(f.position_m)).collect()
    };
    let (used, withheld) = (fixes(true), fixes(false));
    let reference: Vec<Place> = trace
        .reference
        .items()
        .iter()
        .map(|f| place(f.position_m))
        .collect();
    if places.is_empty() {
        return None;
    }
    places.extend(&used);
    let scale = Scale::new(&places, ROOM_M)?;
    let dead = |p: &NavigationPoint| p.validity != Validity::Aided;
    let mut keys = vec![
        key(Sign::Line, "line estimate", "estimate"),
        key(Sign::Dot, &format!("{USED} big"), "fixes used"),
    ];
    if points.iter().any(dead) {
        keys.push(key(Sign::Line, "line gated", "dead reckoning"));
    }
    if !withheld.is_empty() {
        keys.push(key(
            Sign::Dot,
            &format!("{KEPT_BACK} big"),
            "fixes kept back",
        ));
    }
    if !reference.is_empty() {
        keys.push(key(Sign::Line, "line thin dash reference", "reference"));
    }
    let mut svg = map::open(&scale, "Map of the track with its fixes", &keys);
    let dots = |places: &[Place]| -> Vec<[f64; 2]> {
        let picked = series::pick(places, DOTS);
        picked.iter().map(|place| scale.at(*place)).collect()
    };
    svg.dots(&dots(&withheld), KEPT_BACK);
    svg.dots(&dots(&used), USED);
    svg.lines(&ellipses(&scale, points), "line thin soft estimate");
    svg.lines(&[scale.path(&reference)], "line thin dash reference");
    let pieces = |dead_reckoning: bool| -> Vec<Vec<[f64; 2]>> {
        let mut pieces = vec![Vec::new()];
        for p in points {
            if dead(p) == dead_reckoning {
                if let Some(piece) = pieces.last_mut() {
                    piece.push(place(p.position_m));
                }
            } else if pieces.last().is_some_and(|piece| !piece.is_empty()) {
                pieces.push(Vec::new());
            }
        }
        pieces.retain(|piece| piece.len() > 1);
        pieces.iter().map(|piece| scale.path(piece)).collect()
    };
    svg.lines(&pieces(false), "line estimate");
    svg.lines(&pieces(true), "line gated");
    Some(map::close(svg))
}

/// 95 % ellipses along the track.
fn ellipses(scale: &Scale, points: &[NavigationPoint]) -> Vec<Vec<[f64; 2]>> {
    let step = points.len().div_ceil(ELLIPSES).max(1);
    let drawn = points.iter().step_by(step);
    drawn.filter_map(|point| ellipse(scale, point)).collect()
}

fn ellipse(scale: &Scale, point: &NavigationPoint) -> Option<Vec<[f64; 2]>> {
    let [nn, ee, _, ne] = point.covariance_m2;
    let root = nn.max(0.0).sqrt();
    let along = if root > 0.0 { ne / root } else { 0.0 };
    let across = (ee - along * along).max(0.0).sqrt();
    let size = CHI_SQUARE_95.sqrt();
    if size * root.max(ee.max(0.0).sqrt()) * scale.units_per_m > LARGEST_ELLIPSE {
        return None;
    }
    let corner = |k: usize| {
        let (s, c) = (std::f64::consts::TAU * k as f64 / CORNERS as f64).sin_cos();
        scale.at([
            point.position_m[0] + size * root * c,
            point.position_m[1] + size * (along * c + across * s),
        ])
    };
    Some((0..=CORNERS).map(corner).collect())
}

fn time_of(trace: &NavigationTrace) -> Axis {
    let points = trace.points.items();
    let range = points.first().zip(points.last());
    let (low, high) = range.map_or((0.0, 1.0), |(a, b)| (a.time_s, b.time_s));
    Axis::time(low, high, 10)
}

fn figure(label: &str, time: Axis, legend: Vec<Key>, panels: Vec<Panel>) -> Figure {
    Figure {
        label: label.to_owned(),
        time,
        legend,
        panels,
        right: RIGHT,
        line_points: LINE_POINTS,
        across: TIME,
    }
}

/// The paper's figure 3: roll, pitch and yaw of the filter over what the accelerometer gives alone.
pub(super) fn orientation(trace: &NavigationTrace) -> Option<Figure> {
    let points = trace.points.items();
    let angle = |i: usize| -> Vec<Point> {
        let value = move |p: &NavigationPoint| p.angles_deg.map_or(f64::NAN, |a| a[i]);
        points.iter().map(|p| [p.time_s, value(p)]).collect()
    };
    let raw = |i: usize| -> Vec<Point> {
        let tilt = trace.raw_tilt.items().iter();
        tilt.map(|t| [t[0], t[i]]).collect()
    };
    if !is_drawn(&angle(0)) {
        return None;
    }
    let heading_band: Vec<BandPoint> = points
        .iter()
        .map(|p| match (p.angles_deg, p.heading_std_deg) {
            (Some([yaw, ..]), Some(std)) => [p.time_s, yaw - SIGMAS * std, yaw + SIGMAS * std],
            _ => [p.time_s, f64::NAN, f64::NAN],
        })
        .collect();
    let panel = |name: &str, i: usize, raw: Vec<Point>, band: Vec<BandPoint>| {
        let curve = angle(i);
        let axis = angle_axis(&[&curve]);
        let raw = Layer::Dots {
            points: raw,
            class: "dots soft device".to_owned(),
        };
        let layers = vec![raw, band_layer(band, true), line(curve, "estimate", true)];
        Panel::new(name, "deg", axis, layers)
    };
    let panels = vec![
        panel("Roll", 2, raw(1), Vec::new()),
        panel("Pitch", 1, raw(2), Vec::new()),
        panel("Heading", 0, Vec::new(), heading_band),
    ];
    let legend = vec![
        key(Sign::Line, "line estimate", "estimate"),
        key(Sign::Dot, "dots big soft device", "accelerometer alone"),
        key(Sign::Band, "band estimate-fill", "\u{00b1}3\u{03c3}"),
    ];
    Some(figure(
        "Roll, pitch and heading over time",
        time_of(trace),
        legend,
        panels,
    ))
}

/// The paper's figure 4: position north, east and up over the fixes.
pub(super) fn position(trace: &NavigationTrace) -> Option<Figure> {
    let points = trace.points.items();
    if points.is_empty() {
        return None;
    }
    let panels =
        coordinates().map(|(name, axis, sign)| position_panel(trace, points, name, axis, sign));
    Some(figure(
        "Position north, east and up over time, with fixes",
        time_of(trace),
        position_keys(trace),
        panels.into(),
    ))
}

/// Name, index and sign of what is drawn of north, east, down.
fn coordinates() -> [(&'static str, usize, f64); 3] {
    [("North", 0, 1.0), ("East", 1, 1.0), ("Up", 2, -1.0)]
}

fn position_keys(trace: &NavigationTrace) -> Vec<Key> {
    let mut keys = vec![
        key(Sign::Line, "line estimate", "estimate"),
        key(Sign::Band, "band estimate-fill", "\u{00b1}3\u{03c3}"),
        key(Sign::Dot, &format!("{USED} big"), "fixes used"),
    ];
    if trace.fixes.items().iter().any(|fix| !fix.used) {
        keys.push(key(
            Sign::Dot,
            &format!("{KEPT_BACK} big"),
            "fixes kept back",
        ));
    }
    keys
}

fn position_panel(
    trace: &NavigationTrace,
    points: &[NavigationPoint],
    name: &str,
    i: usize,
    sign: f64,
) -> Panel {
    let curve: Vec<Point> = points
        .iter()
        .map(|p| [p.time_s, sign * p.position_m[i]])
        .collect();
    let band: Vec<BandPoint> = points
        .iter()
        .map(|p| {
            let half = SIGMAS * p.covariance_m2[i].max(0.0).sqrt();
            let centre = sign * p.position_m[i];
            [p.time_s, centre - half, centre + half]
        })
        .collect();
    let (first, last) = (points[0].time_s, points[points.len() - 1].time_s);
    let dots = |used: bool, class: &str| Layer::Dots {
        points: trace
            .fixes
            .items()
            .iter()
            .filter(|f| f.used == used && (first..=last).contains(&f.time_s))
            .map(|f| [f.time_s, sign * f.position_m[i]])
            .collect(),
        class: class.to_owned(),
    };
    let layers = vec![
        band_layer(band, false),
        dots(false, KEPT_BACK),
        dots(true, USED),
        line(curve.clone(), "estimate", false),
    ];
    Panel::new(name, "m", extent(&curve), layers)
}

/// An axis around a curve.
fn extent(curve: &[Point]) -> Axis {
    let values = || curve.iter().map(|p| p[1]).filter(|v| v.is_finite());
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let room = (0.08 * (high - low)).max(0.5);
    Axis::linear(low - room, high + room, 5)
}

/// The paper's figure 5: a few seconds, every estimate, between the fixes of a slow receiver.
pub(super) fn close_look(trace: &NavigationTrace) -> Option<Figure> {
    let points = &trace.close_look[..];
    let (first, last) = points.first().zip(points.last())?;
    let panels = coordinates()
        .map(|(name, axis, sign)| {
            let mut panel = position_panel(trace, points, name, axis, sign);
            // So few fixes shall be seen: on top, and large.
            panel.layers.rotate_right(1);
            for layer in &mut panel.layers {
                if let Layer::Dots { class, .. } = layer {
                    class.push_str(" big");
                }
            }
            panel
        })
        .into_iter()
        .take(2);
    Some(figure(
        "Position over a few seconds: every estimate, and the fixes between which it goes on",
        Axis::time(first.time_s, last.time_s, 8),
        position_keys(trace),
        panels.collect(),
    ))
}

/// Errors where they were scored, and what was predicted of them; `None` without scores.
pub(super) fn errors(trace: &NavigationTrace) -> Option<Figure> {
    let scored = trace.scored.items();
    if scored.is_empty() {
        return None;
    }
    let error: Vec<Point> = scored
        .iter()
        .map(|(t, p)| [*t, p.error.xy().norm()])
        .collect();
    let half = CHI_SQUARE_95.sqrt() * std::f64::consts::FRAC_1_SQRT_2;
    let bound: Vec<BandPoint> = scored
        .iter()
        .map(|(t, p)| [*t, 0.0, half * p.horizontal_std])
        .collect();
    let (limit, note) = error_limit(&error, &[], "m");
    let mut horizontal = Panel::new(
        "Horizontal error",
        "m",
        Axis::linear(0.0, limit, 5),
        vec![band_layer(bound, false), dots_of(error)],
    );
    (horizontal.note, horizontal.height) = (note, 220.0);
    let mut panels = vec![horizontal];
    let vertical: Vec<Point> = scored
        .iter()
        .filter(|(_, p)| p.vertical)
        .map(|(t, p)| [*t, -p.error.z])
        .collect();
    if is_drawn(&vertical) {
        let bound = scored.iter().map(|(t, p)| {
            let half = 1.96 * p.vertical_std;
            [*t, -half, half]
        });
        let (limit, note) = error_limit(&vertical, &[], "m");
        let layers = vec![band_layer(bound.collect(), false), dots_of(vertical)];
        let mut panel = Panel::new("Error upwards", "m", Axis::linear(-limit, limit, 5), layers);
        panel.note = note;
        panels.push(panel);
    }
    let legend = vec![
        key(Sign::Dot, "dots big estimate", "error"),
        key(Sign::Band, "band estimate-fill", "predicted, 95 %"),
    ];
    Some(figure(
        "Position error over time",
        time_of(trace),
        legend,
        panels,
    ))
}

fn dots_of(points: Vec<Point>) -> Layer {
    Layer::Dots {
        points,
        class: "dots estimate".to_owned(),
    }
}

/// Each outage from its start: error, and what was predicted of it; `None` without outages.
pub(super) fn outages(trace: &NavigationTrace, outages: &[OutageScore]) -> Option<Figure> {
    let first_fix_s = trace.fixes.items().first()?.time_s;
    let mut panels = Vec::new();
    for outage in outages.iter().filter(|o| o.horizontal_error_m.is_some()) {
        let start = first_fix_s + outage.start_s;
        let inside = trace.scored.items().iter();
        let inside: Vec<_> = inside
            .filter(|(t, _)| (start..start + outage.duration_s).contains(t))
            .collect();
        let error: Vec<Point> = inside
            .iter()
            .map(|(t, p)| [t - start, p.error.xy().norm()])
            .collect();
        let half = CHI_SQUARE_95.sqrt() * std::f64::consts::FRAC_1_SQRT_2;
        let bound: Vec<BandPoint> = inside
            .iter()
            .map(|(t, p)| [t - start, 0.0, half * p.horizontal_std])
            .collect();
        let highest = error.iter().map(|p| p[1]);
        let highest = highest
            .chain(bound.iter().map(|b| b[2]))
            .fold(0.1, f64::max);
        let layers = vec![band_layer(bound, false), dots_of(error)];
        let name = format!("{:.0} s after the first fix", outage.start_s);
        let mut panel = Panel::new(&name, "m", Axis::linear(0.0, 1.05 * highest, 4), layers);
        panel.height = 96.0;
        panels.push(panel);
    }
    let longest = outages.iter().map(|o| o.duration_s).fold(1.0, f64::max);
    let legend = vec![
        key(Sign::Dot, "dots big estimate", "horizontal error"),
        key(Sign::Band, "band estimate-fill", "predicted, 95 %"),
    ];
    let time = Axis::time(0.0, longest, 8);
    let label = "Horizontal error in each outage, over the time since its start";
    (!panels.is_empty()).then(|| figure(label, time, legend, panels))
}

/// Unit of an aid's residual as drawn, and the factor from what the trace has.
const fn unit(aid: AidKind) -> (&'static str, f64) {
    match aid {
        AidKind::GnssPosition | AidKind::GnssHeight | AidKind::Barometer => ("m", 1.0),
        AidKind::GnssVelocity
        | AidKind::ForwardSpeed
        | AidKind::WaterVelocity
        | AidKind::ZeroVelocity
        | AidKind::NonHolonomic => ("m/s", 1.0),
        AidKind::Magnetometer | AidKind::Heading | AidKind::Accelerometer => {
            ("deg", 180.0 / std::f64::consts::PI)
        }
    }
}

/// Innovations of one aid, component by component, with what was expected of them.
pub(super) fn innovations(trace: &NavigationTrace, aid: AidKind) -> Option<Figure> {
    let points = trace.aids.get(&aid)?.items();
    let components = points.iter().map(|p| p.degrees_of_freedom).max()?;
    let names: &[&str] = match (aid, components) {
        (AidKind::Accelerometer, _) => &["Roll", "Pitch"],
        (AidKind::GnssHeight, _) => &["Down"],
        (_, 1) => &["Residual"],
        _ => &["North", "East", "Down"],
    };
    let panels = names.iter().take(usize::from(components)).enumerate();
    let panels = panels.map(|(i, name)| innovation_panel(points, aid, i, name));
    let mut legend: Vec<Key> = Fate::ALL
        .into_iter()
        .filter(|fate| points.iter().any(|p| Fate::of(p.outcome) == Some(*fate)))
        .map(|fate| {
            key(
                Sign::Dot,
                &format!("dots big {}", fate.class()),
                fate.name(),
            )
        })
        .collect();
    legend.push(key(
        Sign::Band,
        "band estimate-fill",
        "\u{00b1}3\u{03c3} expected",
    ));
    let label = format!("Innovations of {} over time", aid.name());
    Some(figure(&label, time_of(trace), legend, panels.collect()))
}

fn innovation_panel(points: &[AidPoint], aid: AidKind, i: usize, name: &str) -> Panel {
    let (unit, factor) = unit(aid);
    let residuals = |fate: Fate| -> Vec<Point> {
        let of = points.iter().filter(|p| Fate::of(p.outcome) == Some(fate));
        of.map(|p| [p.time_s, factor * p.residual[i]]).collect()
    };
    let bound: Vec<BandPoint> = points
        .iter()
        .map(|p| {
            let half = SIGMAS * factor * p.std[i];
            [p.time_s, -half, half]
        })
        .collect();
    let all: Vec<Point> = Fate::ALL.into_iter().flat_map(residuals).collect();
    let (limit, note) = error_limit(&all, &bound, unit);
    let mut layers = vec![band_layer(bound, false)];
    layers.extend(Fate::ALL.map(|fate| Layer::Dots {
        points: residuals(fate),
        class: format!("dots {}", fate.class()),
    }));
    let mut panel = Panel::new(name, unit, Axis::linear(-limit, limit, 5), layers);
    (panel.note, panel.height) = (note, 110.0);
    panel
}
