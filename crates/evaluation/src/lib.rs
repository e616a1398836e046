//! Run estimators over recordings and say how good they are, in numbers, words and pictures.

pub mod calibration;
pub mod consistency;
mod device;
pub mod error;
pub mod estimators;
pub mod final_test;
pub mod instants;
pub mod metrics;
pub mod nis;
pub mod observability;
pub mod observer;
pub mod options;
pub mod parameters;
pub mod report;
pub mod rts_smoother;
pub mod runner;
pub mod summary;
mod tally;
pub mod trace;

pub use error::EvaluationError;
pub use estimators::EstimatorKind;
pub use observer::{EstimateRecord, InnovationRecord, RunObserver, TraceObserver};
pub use options::{RunOptions, SensorSelection};
pub use parameters::Profile;
pub use runner::{run, run_recording};
pub use summary::RunSummary;
