//! One instant of a tracking run: what was seen, the tracks, and the truth.

use std::collections::BTreeSet;

use nalgebra::{Matrix2, Vector2};
use northing_core::kalman::Innovation;
use northing_core::tracking::association::candidates::Association;
use northing_core::tracking::coordinated_turn::TargetCovariance;
use northing_core::tracking::multi_target::{
    EndedTrack, MultiTargetSettings, Track, TrackEnd, TrackStatus,
};
use serde::{Deserialize, Serialize};

use super::matching::Place;

/// Motion models of the tracker.
pub(super) const MODELS: usize = 3;

/// The target of a track at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackedTarget {
    /// Number of the track.
    pub id: u32,
    /// North and east, m.
    pub place: Place,
    /// North and east, m/s.
    pub velocity: [f64; 2],
    /// Clockwise, rad/s.
    pub turn_rate: f64,
    /// Of north, its velocity, east, its velocity, and the turn rate; m, m/s, rad/s.
    pub covariance: TargetCovariance<f64>,
    /// Probability that there is a target.
    pub existence: f64,
    /// Probability that the sensor can see it, if there is one.
    pub visibility: f64,
    /// Probabilities of the motion models: straight, turning, manoeuvring.
    pub models: [f64; MODELS],
    /// What the last scan of the instant was to it.
    pub association: TargetAssociation,
}

/// Which detections of a scan a target may have caused.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TargetAssociation {
    /// Detections in its gate.
    pub in_gate: usize,
    /// The likeliest of them, its index in the scan from 0, and the probability that the target caused it.
    pub likeliest: Option<(u32, f64)>,
    /// Probability that it caused none.
    pub missed: f64,
}

impl TargetAssociation {
    pub(super) fn of<const D: usize>(association: &Association<f64, D>) -> Self {
        let candidates = association.candidates();
        let likeliest = candidates
            .iter()
            .max_by(|a, b| a.weight.total_cmp(&b.weight));
        Self {
            in_gate: candidates.len(),
            likeliest: likeliest.map(|c| (c.detection, c.weight)),
            missed: association.missed,
        }
    }
}

/// A track, tentative or confirmed, after a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowedTrack {
    /// Identity, estimate, existence, and what the scan was to it.
    pub target: TrackedTarget,
    /// Whether it is confirmed.
    pub status: TrackStatus,
    /// Whether it is told as a target: see [`Track::is_reported`].
    pub is_reported: bool,
    /// Seconds since it began.
    pub age_s: f64,
    /// Seconds since a detection probably came from it.
    pub silent_s: f64,
    /// Of the likeliest detection under the likeliest model.
    pub innovation: Innovation<f64>,
}

impl FollowedTrack {
    pub(super) fn new(
        track: &Track<f64, MODELS>,
        association: TargetAssociation,
        settings: &MultiTargetSettings<f64>,
    ) -> Self {
        Self {
            target: TrackedTarget::new(track, association),
            status: track.status,
            is_reported: track.is_reported(settings),
            age_s: track.age_s,
            silent_s: track.silent_s,
            innovation: track.innovation,
        }
    }
}

#[cfg(test)]
impl TrackedTarget {
    /// One at rest at this place, 2 m known on each axis.
    pub(super) fn at(id: u32, place: Place) -> Self {
        Self {
            id,
            place,
            velocity: [0.0, 0.0],
            turn_rate: 0.0,
            covariance: TargetCovariance::from_diagonal(&[4.0, 1.0, 4.0, 1.0, 0.01].into()),
            existence: 1.0,
            visibility: 1.0,
            models: [1.0, 0.0, 0.0],
            association: TargetAssociation::default(),
        }
    }
}

impl TrackedTarget {
    pub(super) fn new(track: &Track<f64, MODELS>, association: TargetAssociation) -> Self {
        let mode = track.estimate();
        let x = mode.state;
        Self {
            id: track.id,
            place: [x[0], x[2]],
            velocity: [x[1], x[3]],
            turn_rate: x[4],
            covariance: mode.covariance,
            existence: track.existence.existence,
            visibility: track.existence.visibility,
            models: track.imm.modes.map(|mode| mode.probability),
            association,
        }
    }

    /// Squared distance of a place, which has this variance on each axis (m^2), in standard deviations; infinite when the covariance is
    /// none.
    #[must_use]
    pub fn normalised_square(&self, place: Place, variance: f64) -> f64 {
        let [nn, ne, ee] = self.place_covariance();
        let (nn, ee) = (nn + variance, ee + variance);
        let d = Vector2::new(place[0] - self.place[0], place[1] - self.place[1]);
        let inverse = Matrix2::new(nn, ne, ne, ee).try_inverse();
        inverse.map_or(f64::INFINITY, |inverse| d.dot(&(inverse * d)))
    }

    /// Variance of north, covariance, variance of east, m^2.
    #[must_use]
    pub fn place_covariance(&self) -> [f64; 3] {
        let p = &self.covariance;
        [p[(0, 0)], p[(0, 2)], p[(2, 2)]]
    }
}

/// Why a track ended, as tables say it.
#[must_use]
pub fn end_reason(end: TrackEnd) -> String {
    match end {
        TrackEnd::Existence => "existence".to_owned(),
        TrackEnd::Uncertain => "position-std".to_owned(),
        TrackEnd::Numerical => "numerical".to_owned(),
        TrackEnd::Merged { into } => format!("merged-into-{into}"),
    }
}

/// The scan behind an instant's tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EpochScan {
    /// Its sensor, by its place in the recording.
    pub sensor: usize,
    /// Its number in the recording; an AIS report has none.
    pub scan: Option<i64>,
}

impl TrackEpoch {
    /// The confirmed tracks of which the instant says something, each with whether it is reported.
    pub fn updated_tracks(&self) -> impl Iterator<Item = (&TrackedTarget, bool)> {
        let reported = self.tracks.iter().map(|track| (track, true));
        let all = reported.chain(self.doubtful.iter().map(|track| (track, false)));
        all.filter(|(track, _)| match &self.updated {
            Some(updated) => updated.contains(&track.id),
            None => true,
        })
    }
}

/// One instant of a run, for plots.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackEpoch {
    /// Stamp of the recording, ns.
    pub time_ns: i64,
    /// Seconds since the first event.
    pub time_s: f64,
    /// The own ship.
    pub own_ship: Place,
    /// Where the detections are, when they say it.
    pub detections: Vec<Place>,
    /// Reported tracks: confirmed, and their targets are there more likely than not.
    pub tracks: Vec<TrackedTarget>,
    /// Confirmed tracks whose targets have more likely left: kept, in case they are seen again, and neither shown nor scored.
    pub doubtful: Vec<TrackedTarget>,
    /// The last scan of the instant.
    pub scan: EpochScan,
    /// Numbers of the tracks with a detection in their gate, where every sensor of the instant sees only now and then (`covers_all = false`), as
    /// a report of AIS speaks of one ship: of the others the instant says nothing. `None` where a sensor looked at all.
    pub updated: Option<BTreeSet<u32>>,
    /// Confirmed tracks that ended since the last instant.
    pub ended: Vec<EndedTrack>,
    /// True positions by target.
    pub truth: Vec<(u32, Place)>,
}
