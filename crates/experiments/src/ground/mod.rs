//! GNSS/INS on simulated walks and drives: axis filters as printed and as they must be, the error-state filter, and
//! no filter at all, over the same sensors.
//!
//! Romaniuk & Gosiewski (2014) show one walk; here are many, with known truth. [`Experiment::tracking`] scores
//! five minutes with a fix a second, [`Experiment::outages`] what is left after 10, 30 and 60 s without,
//! [`Experiment::consistency`] whether the error-state filter knows its own error.
//! Example `ground_results` makes the tables of `docs/results/navigation.md`.

mod experiment;
mod schemes;

pub use experiment::{Consistency, Experiment, OUTAGES_S, OutageScore, TrackingScore};
pub use schemes::{Estimate, Scheme};
