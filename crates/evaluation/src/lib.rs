//! Run estimators over recordings and say how good they are, in numbers, words and pictures.

pub mod consistency;
pub mod error;
pub mod estimators;
pub mod metrics;
pub mod nis;
pub mod parameters;
pub mod report;
pub mod trace;

pub use error::EvaluationError;
