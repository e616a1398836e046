//! Run estimators over recordings and say how good they are, in numbers and words.
//!
//! | folder | what is in it |
//! |---|---|
//! | [`attitude`] | which way does it point |
//! | [`navigation`] | where is it |
//! | [`tracking`] | where are the others |
//! | [`calibration`] | at rest, of the magnetometer, Allan deviation |
//! | [`statistics`] | errors, NEES, NIS, verdicts |
//! | [`tune`] | noise parameters by the likelihood of innovations |
//! | [`exercises`] | cards of the laboratory course, checked on recordings and settings |
//!
//! The three questions have the same files: `kinds` (the estimators by name), `options`, `runner`, `outcome`.
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
//! world frame and issues from there. [`attitude::compare::compare`] does many files on all processors.

pub mod attitude;
pub mod by_name;
pub mod calibration;
pub mod error;
mod events;
pub mod exercises;
mod named;
pub mod navigation;
pub(crate) mod observers;
pub mod registry;
mod run_estimator;
pub mod statistics;
pub mod tracking;
pub mod tune;
pub mod used_parameters;

pub use attitude::runner::{estimate, estimate_instants, run, run_live, run_recording};
pub use attitude::{
    EstimateRecord, EstimatorKind, InnovationRecord, Profile, RunObserver, RunOptions, RunSummary,
    SensorSelection, TraceObserver,
};
pub use error::EvaluationError;
pub use run_estimator::RunEstimator;
pub use used_parameters::{Origin, PROGRAM, UsedParameter};
