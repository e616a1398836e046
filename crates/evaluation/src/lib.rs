//! Run estimators over recordings and say how good they are, in numbers, words and pictures.
//!
//! | I look for | file |
//! |---|---|
//! | names of the estimators, and any of them behind one type | [`estimators`] |
//! | parameters: units, defaults, profiles, `NAME=VALUE` | [`parameters`] |
//! | what a run can be asked for | [`options`] |
//! | running over a stream of events | [`runner`] |
//! | watching a run: estimates, innovations, traces for plots | [`observer`], [`trace`] |
//! | the outcome: what `run --json` prints | [`summary`] |
//! | error metrics and NEES | [`metrics`] |
//! | NIS and "your accelerometer R is about 9 times too small" | [`nis`], [`consistency`] |
//! | the paper's final test | [`final_test`] |
//! | what the sensors used cannot tell | [`observability`] |
//! | calibration from a file or from the recording's start | [`calibration`] |
//! | magnetometer calibration of a recording | [`field_calibration`] |
//! | everything a run depends on, to be run again | [`setup`] |
//! | the smoother | [`rts_smoother`] |
//! | many recordings, several estimators, one table | [`compare`] |
//! | HTML reports | [`report`] |
//! | Monte Carlo campaigns on trackers | [`tracking`] |
//! | the experiment on observers in cascade | [`observers`] |
//! | where is the body: GNSS/INS over recordings, outages, scores | [`navigation`] |
//!
//! # Example
//!
//! The lab on a virtual phone: calibrate at rest, estimate, judge.
//!
//! ```
//! use northing_evaluation::{EstimatorKind, Profile, RunOptions, run};
//! use northing_recording::RecordingError;
//! use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
//!
//! let phone = VirtualPhone::new(VirtualPhoneConfig::default())?;
//! let events = phone.events().map(Ok::<_, RecordingError>);
//! let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
//! options.calibrate_first_s = Some(9.0);
//! options.set("gate_timeout_s=5")?;
//! // `&mut ()` watches nothing; a `TraceObserver` keeps what plots need.
//! let summary = run(events, &options, &mut ())?;
//! let error = summary.error_deg.expect("a virtual phone knows the truth");
//! assert!(error.total_rmse < 2.0);
//! for verdict in &summary.verdicts {
//!     assert!(!verdict.sentences.is_empty());
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A file is run with [`run_recording`] on what `northing_recording::open` gives; it takes name,
//! world frame and issues from there. [`compare::compare`] does many files on all processors.

pub mod allan;
pub mod calibration;
pub mod calibration_set;
pub mod compare;
pub mod consistency;
mod device;
pub mod error;
pub mod estimators;
pub mod field_calibration;
mod field_watch;
pub mod final_test;
pub mod first_look;
pub mod ground;
pub mod instants;
pub mod metrics;
pub mod multi_target;
pub mod navigation;
pub mod nis;
pub mod observability;
pub mod observer;
pub mod observers;
pub mod options;
pub mod parameters;
pub mod report;
pub mod rts_smoother;
pub mod runner;
pub mod setup;
pub mod summary;
mod tally;
pub mod trace;
pub mod tracking;

pub use error::EvaluationError;
pub use estimators::EstimatorKind;
pub use observer::{EstimateRecord, InnovationRecord, RunObserver, TraceObserver};
pub use options::{RunOptions, SensorSelection};
pub use parameters::Profile;
pub use runner::{run, run_recording};
pub use summary::RunSummary;
