//! Multi-target tracker in clutter: initiation, association, existence, confirmation, deletion,
//! with the own ship's uncertainty in every step.
//!
//! Read first: `docs/derivations/association.md`; Musicki and Evans (2004) for JIPDA; the Schmidt
//! update in every innovation is that of Schmidt, *Application of State-Space Methods to Navigation
//! Problems* (1966).
//!
//! When to use: unlabelled detections, several targets, false alarms. When not: one target and no
//! clutter, where a single Schmidt-Kalman filter says the same for less.
//!
//! Limits: the targets' errors are correlated through the own ship; each target carries its own
//! correlation with the ship, the blocks between targets are left out, so joint statements about
//! several targets are a little too confident. At most `N` tracks, each with at most `D` detections in its gate, of which the
//! likeliest are kept; a scan may be of any length. What does not fit is counted.

mod config;
mod counts;
mod sensor_scale;
mod starts;
mod track;
mod update;

pub use config::{MotionModels, MultiTargetConfig, MultiTargetSettings, ScanSensor};
pub use counts::{ScanError, TrackerCounts};
pub use sensor_scale::SensorScale;
pub use track::{EndedTrack, Track, TrackEnd, TrackStatus};

use starts::Starts;

use nalgebra::{Matrix3, Vector3};

use super::association::candidates::Association;
use super::association::clusters::Clusters;
use super::association::ipda::ExistenceModel;
use super::association::jipda::associate;
use super::detection::Detection;
use super::dwell_time::DwellTimes;
use super::echo::{Echo, EchoMemory};
use super::imm::Mode;
use super::own_ship::{OwnShip, PoseErrorCorrelation};
use super::pose_error::{PoseErrorMemory, SeenTogether};
use super::seen::Seen;
use super::visibility::VisibilityMemory;
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable, covariance, expect, finite, not_negative};
use crate::scalar::{Scalar, lit};

/// One scan: everything one sensor reports at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Scan<'a, T> {
    /// Seconds on the recording's clock; scans come in time order.
    pub time_s: T,
    /// What the sensor is like.
    pub sensor: &'a ScanSensor<T>,
    /// Pose of the own ship now.
    pub own_ship: &'a OwnShip<T>,
    /// The detections, unlabelled.
    pub detections: &'a [Detection<T>],
}

/// The tracker: `M` motion models a target, at most `N` targets, at most `D` detections in the gate of each.
///
/// ```
/// use northing_core::tracking::{Detection, DetectionNoise, MultiTargetConfig, MultiTargetTracker};
/// use northing_core::tracking::{OwnShip, Scan, ScanSensor, TrackStatus};
///
/// let radar = ScanSensor {
///     noise: DetectionNoise { range_std_m: 5.0, bearing_std_rad: 0.01, extent_std_m: 2.0 },
///     detection_probability: 0.9,
///     clutter_density: 1e-7, // false detections per square metre and scan
///     largest_range_m: 2000.0,
///     covers_all: true,
///     initiates: true,
/// };
/// // The own ship lies at the origin; its heading may be 0.02 rad off.
/// let own_ship = OwnShip::exact(0.0, 0.0, 0.0).with_std(3.0, 3.0, 0.02);
/// let mut tracker = MultiTargetTracker::<f64, 3, 8, 16>::new(MultiTargetConfig::default())?;
/// for k in 0..20 {
///     let time_s = 2.0 * f64::from(k);
///     let detections = [Detection::RangeBearing { range_m: 800.0 - 4.0 * time_s, bearing_rad: 0.3 }];
///     tracker.scan(&Scan { time_s, sensor: &radar, own_ship: &own_ship, detections: &detections }).unwrap();
/// }
/// let track = tracker.tracks().next().unwrap();
/// assert_eq!(track.status, TrackStatus::Confirmed);
/// let target = track.estimate();
/// assert!((target.state[0] - (800.0 - 4.0 * 38.0) * f64::cos(0.3)).abs() < 10.0);
/// assert!(target.covariance[(2, 2)].sqrt() > 0.02 * 600.0 * 0.9); // the heading error is in it
/// # Ok::<(), northing_core::ConfigError>(())
/// ```
#[derive(Debug, Clone)]
pub struct MultiTargetTracker<T, const M: usize, const N: usize, const D: usize> {
    config: MultiTargetConfig<T, M>,
    state: MultiTargetState<T, M, N>,
    /// No track has a place from here on: most trackers have room for many more targets than there are.
    reach: usize,
    weights: [Association<T, D>; N],
    marginals: [Association<T, D>; N],
    clusters: Clusters<T, N, D>,
    estimates: [Mode<T>; N],
    ended: [Option<EndedTrack>; N],
}

/// Everything that the tracker remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct MultiTargetState<T, const M: usize, const N: usize> {
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    tracks: [Option<Track<T, M>>; N],
    /// Time of the last scan and the covariance of the pose then.
    last: Option<LastScan<T>>,
    /// The last pose that came with a good time, of a refused scan too, and its time.
    pose: Option<(T, OwnShip<T>)>,
    next_id: u32,
    counts: TrackerCounts,
    #[cfg_attr(feature = "serde", serde(default))]
    echoes: EchoMemory<T>,
    #[cfg_attr(feature = "serde", serde(default))]
    pose_error: PoseErrorMemory<T>,
    #[cfg_attr(feature = "serde", serde(default))]
    visibility: VisibilityMemory<T>,
    #[cfg_attr(feature = "serde", serde(default))]
    dwell: DwellTimes<T>,
}

/// Time of a scan (s), and the covariance of the pose then.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
struct LastScan<T> {
    time_s: T,
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    covariance: Matrix3<T>,
}

impl<T: Scalar, const M: usize, const N: usize> MultiTargetState<T, M, N> {
    /// The same for a tracker with room for `K` targets; `None` where a track would have no place in it.
    #[must_use]
    pub fn resized<const K: usize>(&self) -> Option<MultiTargetState<T, M, K>> {
        if self.tracks.iter().skip(K).any(Option::is_some) {
            return None;
        }
        let mut tracks = [None; K];
        for (place, track) in tracks.iter_mut().zip(&self.tracks) {
            *place = *track;
        }
        Some(MultiTargetState {
            tracks,
            last: self.last,
            pose: self.pose,
            next_id: self.next_id,
            counts: self.counts,
            echoes: self.echoes,
            pose_error: self.pose_error,
            visibility: self.visibility,
            dwell: self.dwell,
        })
    }
}

impl<T: Scalar, const M: usize, const N: usize, const D: usize> Restorable
    for MultiTargetTracker<T, M, N, D>
{
    type State = MultiTargetState<T, M, N>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        for track in state.tracks.iter().flatten() {
            track.check()?;
        }
        if let Some(last) = &state.last {
            finite("time of the last scan", [&last.time_s])?;
            covariance("covariance of the pose", &last.covariance)?;
        }
        if let Some((time_s, pose)) = &state.pose {
            finite("time of the last pose", [time_s])?;
            expect("pose", pose.is_valid(), "finite, with a covariance")?;
        }
        finite("echoes", state.echoes.numbers())?;
        finite("error of the pose", state.pose_error.numbers())?;
        not_negative("visibility of targets", state.visibility.numbers())?;
        not_negative("manoeuvres of targets", state.dwell.numbers())?;
        self.state = state;
        self.reach = N;
        self.shorten();
        Ok(())
    }
}

impl<T: Scalar, const M: usize, const N: usize, const D: usize> MultiTargetTracker<T, M, N, D> {
    /// A tracker without tracks.
    ///
    /// # Errors
    /// The first setting outside its permitted range.
    pub fn new(config: MultiTargetConfig<T, M>) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self {
            config,
            state: MultiTargetState {
                tracks: [None; N],
                last: None,
                pose: None,
                next_id: 1,
                counts: TrackerCounts::default(),
                echoes: EchoMemory::default(),
                pose_error: PoseErrorMemory::default(),
                visibility: VisibilityMemory::default(),
                dwell: DwellTimes::default(),
            },
            reach: 0,
            weights: [Association::missed(T::one()); N],
            marginals: [Association::missed(T::one()); N],
            clusters: Clusters::default(),
            estimates: [Mode::unknown(); N],
            ended: [None; N],
        })
    }

    /// Every track, tentative ones too.
    pub fn tracks(&self) -> impl Iterator<Item = &Track<T, M>> {
        self.state.tracks[..self.reach].iter().flatten()
    }

    /// Every track with the detections of the last scan that lie in its gate, each with the probability that it caused it. A
    /// track that began with that scan has the detection it began from. Nothing of it is kept by [`Restorable::save`].
    pub fn associations(&self) -> impl Iterator<Item = (&Track<T, M>, &Association<T, D>)> {
        let each = self.state.tracks[..self.reach].iter().zip(&self.marginals);
        each.filter_map(|(track, marginal)| Some((track.as_ref()?, marginal)))
    }

    /// The tracks that ended in the last scan, tentative ones too.
    pub fn ended(&self) -> impl Iterator<Item = &EndedTrack> {
        self.ended.iter().flatten()
    }

    /// What was done and what was refused so far.
    pub fn counts(&self) -> &TrackerCounts {
        &self.state.counts
    }

    /// How long echoes stay where they are on their targets, as learnt so far.
    pub fn echoes(&self) -> &EchoMemory<T> {
        &self.state.echoes
    }

    /// How long errors of the own ship's pose last: the setting, or what was learnt where that is refuted.
    pub fn pose_error_correlation(&self) -> PoseErrorCorrelation<T> {
        let usual = &self.config.settings.pose_error_correlation;
        if self.config.settings.learn_pose_error_correlation {
            self.state.pose_error.correlation(usual)
        } else {
            *usual
        }
    }

    /// How targets appear, hide and disappear: the setting, with how often they hide as learnt so far.
    pub fn existence_model(&self) -> ExistenceModel<T> {
        let usual = &self.config.settings.existence;
        if self.config.settings.learn_visibility {
            self.state.visibility.model(usual)
        } else {
            *usual
        }
    }

    /// Takes one scan.
    ///
    /// # Errors
    /// A scan whose time is not finite or before the last, or whose pose is not finite, has no
    /// covariance or has jumped, moves no track and is counted. Single bad detections are skipped and counted.
    pub fn scan(&mut self, scan: &Scan<'_, T>) -> Result<(), ScanError> {
        let dt = self
            .admit(scan)
            .inspect_err(|e| self.state.counts.refuse(*e))?;
        self.state.counts.scans += 1;
        self.predict(scan, dt);
        let invalid = scan.detections.iter().filter(|d| !d.is_valid()).count();
        self.state.counts.detections_invalid += invalid as u64;
        let echo = self.state.echoes.of(&scan.sensor.noise);
        self.weigh(scan, &echo);
        let weights = &self.weights[..self.reach];
        let effort = associate(weights, &mut self.marginals, &mut self.clusters);
        self.state.counts.approximate_clusters += u64::from(effort.approximate_clusters);
        self.update(scan, &echo);
        self.remove(scan.own_ship);
        if scan.sensor.initiates {
            self.initiate(scan, &echo);
        }
        self.shorten();
        Ok(())
    }

    /// Forgets the places behind the last track.
    fn shorten(&mut self) {
        let last = self.state.tracks[..self.reach]
            .iter()
            .rposition(Option::is_some);
        self.reach = last.map_or(0, |last| last + 1);
    }

    /// Seconds since the last scan, or why this one cannot be used.
    fn admit(&mut self, scan: &Scan<'_, T>) -> Result<T, ScanError> {
        if !scan.time_s.is_finite() {
            return Err(ScanError::TimeNotFinite);
        }
        if !scan.own_ship.is_valid() {
            return Err(ScanError::PoseInvalid);
        }
        if !scan.sensor.is_valid() {
            return Err(ScanError::SensorInvalid);
        }
        let dt = self
            .state
            .last
            .map_or(T::zero(), |last| scan.time_s - last.time_s);
        if dt < T::zero() {
            return Err(ScanError::TimeGoesBack);
        }
        if dt > self.config.settings.longest_gap_s {
            return Err(ScanError::TimeInFuture);
        }
        let came_from = self.state.pose.replace((scan.time_s, *scan.own_ship));
        let limits = &self.config.settings.pose_limits;
        if came_from.is_some_and(|(t, from)| {
            !limits.allow(&from, scan.own_ship, (scan.time_s - t).max(T::zero()))
        }) {
            // A navigation filter that was set anew has errors of its own: no target shares them.
            self.state.last = self.state.last.map(|last| LastScan {
                covariance: Matrix3::zeros(),
                ..last
            });
            return Err(ScanError::PoseJumps);
        }
        Ok(dt)
    }

    fn predict(&mut self, scan: &Scan<'_, T>, dt: T) {
        let kept = self.state.last.map_or_else(Vector3::zeros, |last| {
            let correlation = self.pose_error_correlation();
            correlation.factors(&last.covariance, &scan.own_ship.covariance, dt)
        });
        let echo_kept = self.state.echoes.kept(dt);
        let existence = self.existence_model();
        let confirmed = self.tracks().filter(|t| t.status == TrackStatus::Confirmed);
        let mut dwell = self.state.dwell;
        dwell.learn(confirmed.map(|track| &track.dwell));
        self.state.dwell = dwell;
        for track in self.state.tracks[..self.reach].iter_mut().flatten() {
            track.predict(&self.config, (&existence, &dwell), dt, (&kept, echo_kept));
        }
        self.state.last = Some(LastScan {
            time_s: scan.time_s,
            covariance: scan.own_ship.covariance,
        });
    }

    fn weigh(&mut self, scan: &Scan<'_, T>, echo: &Echo<T>) {
        let tracks = self.state.tracks[..self.reach].iter();
        for (track, weight) in tracks.zip(&mut self.weights) {
            match track {
                Some(track) => {
                    let counts = &mut self.state.counts;
                    *weight = update::weigh(track, (scan, echo), &self.config, counts);
                }
                None => weight.reset(T::one()),
            }
        }
    }

    fn update(&mut self, scan: &Scan<'_, T>, echo: &Echo<T>) {
        let sensor = self.state.echoes.place(&scan.sensor.noise);
        let learns = self.config.settings.learn_pose_error_correlation;
        let mut together = sensor.filter(|_| learns).and_then(|sensor| {
            let interval_s = self.state.echoes.interval_s(sensor)?;
            SeenTogether::new(&scan.own_ship.covariance, interval_s)
        });
        let tracks = self.state.tracks[..self.reach].iter_mut();
        for (slot, marginal) in tracks.zip(&self.marginals) {
            let Some(track) = slot else { continue };
            let before = together.is_some().then_some(track.imm);
            if scan.sensor.covers_all
                && marginal.is_seen()
                && track.status == TrackStatus::Confirmed
            {
                self.state.visibility.seen(track.silent_s, &track.existence);
            }
            let likeliest = update::update(track, (scan, echo), marginal, &self.config);
            track.confirm(&self.config);
            let Some((detection, innovation)) = likeliest.as_ref().and_then(|l| l.surely()) else {
                continue;
            };
            let is_own = track.status == TrackStatus::Confirmed;
            let Some(sensor) = sensor.filter(|_| is_own) else {
                continue;
            };
            let place = (sensor, track.range_m(scan.own_ship));
            let seen = Seen::new((detection.kind(), innovation), (scan, echo), place);
            let Some(mut seen) = seen else { continue };
            let last = track.seen.as_ref();
            let last = last.and_then(|last| Some((last, self.state.echoes.learn(last, &seen)?)));
            if let (Some(together), Some(before)) = (&mut together, before) {
                let states = [&before.estimate().state, &track.estimate().state];
                let changes = seen.compare(last, (detection, scan), states);
                changes.iter().for_each(|changes| together.add(changes));
            }
            track.seen = Some(seen);
        }
        if let Some(together) = together {
            self.state.pose_error.learn(&together);
        }
    }

    /// Removes what does not exist any more, what has grown meaningless, and duplicates.
    fn remove(&mut self, own_ship: &OwnShip<T>) {
        self.ended.fill(None);
        for place in 0..self.reach {
            let track = &self.state.tracks[place];
            if let Some(end) = track.as_ref().and_then(|t| t.end(&self.config, own_ship)) {
                self.end(place, end);
            }
        }
        self.merge();
    }

    fn end(&mut self, place: usize, end: TrackEnd) {
        let Some(track) = self.state.tracks[place].take() else {
            return;
        };
        let merged = matches!(end, TrackEnd::Merged { .. });
        let counts = track.status == TrackStatus::Confirmed && !merged;
        if counts {
            self.state.dwell.end(&track.dwell);
        }
        self.state.counts.deleted_confirmed += u64::from(counts);
        self.ended[place] = Some(EndedTrack {
            id: track.id,
            status: track.status,
            end,
        });
    }

    /// Removes the younger of two tracks that have become one.
    fn merge(&mut self) {
        for i in 0..self.reach {
            let Some(track) = &self.state.tracks[i] else {
                continue;
            };
            self.estimates[i] = track.estimate();
            for j in 0..i {
                let (Some(a), Some(b)) = (&self.state.tracks[i], &self.state.tracks[j]) else {
                    continue;
                };
                let limit = self.config.settings.merge_sigmas;
                if track::is_same_target(&self.estimates[i], &self.estimates[j], limit) {
                    let (loser, into) = if a.is_senior_to(b) {
                        (j, a.id)
                    } else {
                        (i, b.id)
                    };
                    self.end(loser, TrackEnd::Merged { into });
                    self.state.counts.merged += 1;
                }
            }
        }
    }

    /// A tentative track for every detection that no track is likely to have caused.
    fn initiate(&mut self, scan: &Scan<'_, T>, echo: &Echo<T>) {
        let mut edges = self.clusters.edges().iter().peekable();
        let mut starts = Starts::new(self.state.counts.scans);
        for (j, detection) in (0..).zip(scan.detections) {
            let mut taken = T::zero();
            while let Some(edge) = edges.next_if(|edge| edge.detection <= j) {
                let target = edge.target as usize;
                // A track that has been removed since has taken nothing, nor has one that began where it was.
                if edge.detection == j && self.state.tracks[target].is_some() {
                    let candidate = self.marginals[target].candidates().get(edge.place as usize);
                    taken += candidate
                        .filter(|candidate| candidate.detection == j)
                        .map_or(T::zero(), |candidate| candidate.weight);
                }
            }
            if taken > lit(0.5) {
                continue;
            }
            let id = self.state.next_id;
            let Some(track) = track::initiate(detection, (scan, echo), &self.config, id) else {
                continue;
            };
            match starts.room(&self.state.tracks, &self.config) {
                (Some(place), left_out) => {
                    self.state.tracks[place] = Some(track);
                    self.reach = self.reach.max(place + 1);
                    self.marginals[place].reset(T::zero());
                    self.marginals[place].add(j, T::one());
                    self.state.next_id = self.state.next_id.wrapping_add(1);
                    self.state.counts.initiated += 1;
                    self.state.counts.tracks_beyond_capacity += u64::from(left_out);
                }
                (None, _) => self.state.counts.tracks_beyond_capacity += 1,
            }
        }
    }
}

#[cfg(test)]
mod tests;
