//! Which way does it point: attitude estimators over recordings, and how good they are.
//!
//! | I look for | file |
//! |---|---|
//! | the estimators by name, and any of them behind one type | [`kinds`] |
//! | estimators that somebody brings along | [`own`] |
//! | parameters: units, defaults, profiles, `NAME=VALUE` | [`parameters`] |
//! | what a run can be asked for | [`options`] |
//! | running over a stream of events | [`runner`] |
//! | watching a run: estimates, innovations, traces for plots | [`observer`], [`trace`] |
//! | the outcome: what `run --json` prints | [`outcome`] |
//! | the paper's final test | [`final_test`] |
//! | references on their own clock: scoring, clock offset, misalignment | [`mod@reference`] |
//! | what the sensors used cannot tell | [`observability`] |
//! | a calibration at rest in a run: noise, bias and start | [`calibrated_start`] |
//! | calibrations of many devices and days | [`calibrations`] |
//! | everything a run depends on, to be run again | [`setup`] |
//! | what worse sensors would have measured | [`alterations`] |
//! | the smoothers | [`rts_smoother`] |
//! | many recordings, several estimators, one table | [`compare`] |

pub mod alterations;
pub mod any_driver;
pub mod calibrated_start;
pub mod calibrations;
pub mod compare;
mod device;
mod estimate_file;
mod field_watch;
pub mod final_test;
pub mod first_look;
pub mod instants;
pub mod kinds;
pub mod observability;
pub mod observer;
pub mod options;
pub mod outcome;
pub mod own;
pub mod parameters;
pub mod reference;
pub mod rts_smoother;
pub mod runner;
mod sampling_times;
pub mod setup;
mod tally;
pub mod trace;

pub use any_driver::AnyDriver;
pub use calibrations::Calibrations;
pub use estimate_file::EstimateFile;
pub use instants::{Instant, InstantSource, Instants};
pub use kinds::{AnyEstimator, EstimatorKind};
pub use observer::{EstimateRecord, InnovationRecord, PositionRecord, RunObserver, TraceObserver};
pub use options::{CompassUse, RunOptions, SensorSelection};
pub use outcome::{
    Gaps, NisOf, PerSensor, PositionRms, PositionSummary, ReferenceSummary, RunSummary,
};
pub use parameters::{CascadeRotation, Parameters, Profile};
pub use reference::ScoredRecord;
pub use trace::{InnovationPoint, PositionPoint, Trace, TracePoint};
