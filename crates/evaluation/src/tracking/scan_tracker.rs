//! The tracker scan by scan, with as much room as the scans need: what runs over recordings and streams of scans have in common.

use northing_core::Restorable;
use northing_core::tracking::association::candidates::Association;
use northing_core::tracking::association::ipda::ExistenceModel;
use northing_core::tracking::detection::DetectionNoise;
use northing_core::tracking::echo::{EchoMemory, SensorEchoes};
use northing_core::tracking::multi_target::{
    EndedTrack, MultiTargetConfig, MultiTargetState, MultiTargetTracker, Scan, ScanError, Track,
    TrackStatus, TrackerCounts,
};
use northing_core::tracking::own_ship::PoseErrorCorrelation;
use serde_json::Value;

use super::epoch::{FollowedTrack, MODELS, TargetAssociation, TrackedTarget};
use super::outcome::{Learnt, LearntEcho};
use crate::error::EvaluationError;

/// Tracks at a time: all ships of a strait, everybody on a square.
const TRACKS: usize = 1024;
/// The same where scans hold so many detections that most of them are false: each begins a tentative track that lasts for some scans.
const CROWDED: usize = 12 * 1024;
/// From so many detections in a scan on.
const CROWDED_FROM: usize = TRACKS / 3;
/// Detections in the gate of one target.
const DETECTIONS: usize = 32;
/// Stack on which a tracker is made: several times its own size, which is some kilobytes a track.
const STACK_PER_TRACK: usize = 64 << 10;

type Config = MultiTargetConfig<f64, MODELS>;
type State<const N: usize> = MultiTargetState<f64, MODELS, N>;
type Tracker<const N: usize> = MultiTargetTracker<f64, MODELS, N, DETECTIONS>;
type EachTrack<'a> = &'a mut dyn FnMut(&Track<f64, MODELS>, &Association<f64, DETECTIONS>);

/// A tracker of many targets.
pub struct ScanTracker {
    config: Config,
    room: Box<dyn Room>,
}

impl ScanTracker {
    /// Without tracks, for scans of at most so many detections; [`Self::make_room`] is for more.
    ///
    /// # Errors
    /// A setting is outside its permitted range; the system has no thread to make it on.
    pub fn new(config: Config, detections: usize) -> Result<Self, EvaluationError> {
        let room: Box<dyn Room> = if detections > CROWDED_FROM {
            tracker::<CROWDED>(config)?
        } else {
            tracker::<TRACKS>(config)?
        };
        Ok(Self { config, room })
    }

    /// Grows, if a scan of so many detections needs more room; tracks stay as they are.
    ///
    /// # Errors
    /// The system has no thread to make the larger one on.
    pub fn make_room(&mut self, detections: usize) -> Result<(), EvaluationError> {
        if detections > CROWDED_FROM && self.room.places() < CROWDED {
            self.room = self.room.crowded(self.config)?;
        }
        Ok(())
    }

    /// Takes one scan.
    ///
    /// # Errors
    /// It is refused: nothing moves.
    pub fn scan(&mut self, scan: &Scan<'_, f64>) -> Result<(), ScanError> {
        self.room.scan(scan)
    }

    /// Every track, tentative ones too, with what the last scan was to it.
    #[must_use]
    pub fn tracks(&self) -> Vec<FollowedTrack> {
        let mut all = Vec::new();
        self.room.each(&mut |track, association| {
            let association = TargetAssociation::of(association);
            let settings = &self.config.settings;
            all.push(FollowedTrack::new(track, association, settings));
        });
        all
    }

    /// The targets of the confirmed ones: of those that are reported, then of those that are only kept.
    #[must_use]
    pub fn confirmed(&self) -> [Vec<TrackedTarget>; 2] {
        let [mut reported, mut doubtful] = [Vec::new(), Vec::new()];
        self.room.each(&mut |track, association| {
            if track.status == TrackStatus::Confirmed {
                let all = if track.is_reported(&self.config.settings) {
                    &mut reported
                } else {
                    &mut doubtful
                };
                let association = TargetAssociation::of(association);
                all.push(TrackedTarget::new(track, association));
            }
        });
        [reported, doubtful]
    }

    /// The tracks that ended in the last scan, tentative ones too.
    #[must_use]
    pub fn ended(&self) -> Vec<EndedTrack> {
        self.room.ended()
    }

    /// What was done and what was refused so far.
    #[must_use]
    pub fn counts(&self) -> &TrackerCounts {
        self.room.counts()
    }

    /// What was learnt so far, with these names of the sensors by their noise.
    #[must_use]
    pub fn learnt(&self, names: &[(String, DetectionNoise<f64>)]) -> Learnt {
        let usual = &self.config.settings.pose_error_correlation;
        let found = self.room.pose_error_correlation();
        let other = |found: f64, usual: f64| (found.to_bits() != usual.to_bits()).then_some(found);
        let echoes = self.room.echoes();
        let lasting = echoes.sensors().filter(|echo| echo.kept() > 0.0);
        let name = |echo: &SensorEchoes<f64>| LearntEcho {
            sensors: names
                .iter()
                .filter(|(_, noise)| *noise == echo.noise)
                .map(|(name, _)| name.clone())
                .collect(),
            kept: echo.kept(),
            interval_s: echo.interval_s,
        };
        let stays = self.room.existence_model().visible_s;
        Learnt {
            visible_s: other(stays, self.config.settings.existence.visible_s),
            position_error_s: other(found.position_s, usual.position_s),
            heading_error_s: other(found.heading_s, usual.heading_s),
            echoes: lasting.map(name).collect(),
        }
    }

    /// Everything that the next scan depends on, but for the settings.
    ///
    /// # Errors
    /// A number is none of JSON; the system has no thread to save it on.
    pub fn save(&self) -> Result<Value, EvaluationError> {
        self.room.save()
    }

    /// One that continues from what [`Self::save`] gave.
    ///
    /// # Errors
    /// As [`Self::new`]; the state is none.
    pub fn restored(config: Config, state: Value) -> Result<Self, EvaluationError> {
        let places = state.get("tracks").and_then(Value::as_array).map(Vec::len);
        let room: Box<dyn Room> = if places == Some(CROWDED) {
            restored::<CROWDED>(config, state)?
        } else {
            restored::<TRACKS>(config, state)?
        };
        Ok(Self { config, room })
    }
}

/// A tracker with room for some number of targets.
trait Room: Send + Sync {
    fn places(&self) -> usize;
    fn scan(&mut self, scan: &Scan<'_, f64>) -> Result<(), ScanError>;
    fn each(&self, tell: EachTrack<'_>);
    fn ended(&self) -> Vec<EndedTrack>;
    fn counts(&self) -> &TrackerCounts;
    fn pose_error_correlation(&self) -> PoseErrorCorrelation<f64>;
    fn existence_model(&self) -> ExistenceModel<f64>;
    fn echoes(&self) -> &EchoMemory<f64>;
    fn save(&self) -> Result<Value, EvaluationError>;
    /// The same with the largest room.
    fn crowded(&self, config: Config) -> Result<Box<dyn Room>, EvaluationError>;
}

impl<const N: usize> Room for Tracker<N> {
    fn places(&self) -> usize {
        N
    }

    fn scan(&mut self, scan: &Scan<'_, f64>) -> Result<(), ScanError> {
        Self::scan(self, scan)
    }

    fn each(&self, tell: EachTrack<'_>) {
        for (track, association) in self.associations() {
            tell(track, association);
        }
    }

    fn ended(&self) -> Vec<EndedTrack> {
        Self::ended(self).copied().collect()
    }

    fn counts(&self) -> &TrackerCounts {
        Self::counts(self)
    }

    fn pose_error_correlation(&self) -> PoseErrorCorrelation<f64> {
        Self::pose_error_correlation(self)
    }

    fn existence_model(&self) -> ExistenceModel<f64> {
        Self::existence_model(self)
    }

    fn echoes(&self) -> &EchoMemory<f64> {
        Self::echoes(self)
    }

    fn save(&self) -> Result<Value, EvaluationError> {
        on_large_stack::<N, _>(|| serde_json::to_value(Restorable::save(self)))?.map_err(broken)
    }

    fn crowded(&self, config: Config) -> Result<Box<dyn Room>, EvaluationError> {
        let mut grown = tracker::<CROWDED>(config)?;
        let state = || Restorable::save(self).resized::<CROWDED>();
        on_large_stack::<CROWDED, _>(|| state().map(|state| grown.restore(state)))?
            .ok_or_else(|| broken("its tracks have no room"))?
            .map_err(broken)?;
        Ok(grown)
    }
}

/// A tracker on the heap.
fn tracker<const N: usize>(config: Config) -> Result<Box<Tracker<N>>, EvaluationError> {
    Ok(on_large_stack::<N, _>(|| {
        Tracker::<N>::new(config).map(Box::new)
    })??)
}

fn restored<const N: usize>(
    config: Config,
    state: Value,
) -> Result<Box<Tracker<N>>, EvaluationError> {
    let mut tracker = tracker::<N>(config)?;
    on_large_stack::<N, _>(|| {
        let state: State<N> = serde_json::from_value(state).map_err(broken)?;
        tracker.restore(state).map_err(broken)
    })??;
    Ok(tracker)
}

fn broken(problem: impl std::fmt::Display) -> EvaluationError {
    EvaluationError::BrokenState {
        problem: problem.to_string(),
    }
}

/// Work in which arrays for `N` tracks pass over the stack: that of a thread need not have room for them.
fn on_large_stack<const N: usize, T: Send>(
    work: impl FnOnce() -> T + Send,
) -> Result<T, EvaluationError> {
    let done = std::thread::scope(|scope| {
        let builder = std::thread::Builder::new().stack_size(N * STACK_PER_TRACK);
        let done = builder.spawn_scoped(scope, work);
        done.map(std::thread::ScopedJoinHandle::join)
    });
    match done {
        Ok(Ok(done)) => Ok(done),
        Ok(Err(panic)) => std::panic::resume_unwind(panic),
        Err(error) => Err(EvaluationError::NoThread {
            problem: error.to_string(),
        }),
    }
}
