//! The commands, one file each.

pub(crate) mod benchmark;
pub(crate) mod calibrate;
pub(crate) mod compare;
mod comparison;
pub(crate) mod completions;
pub(crate) mod convert;
pub(crate) mod demo;
pub(crate) mod describe;
pub(crate) mod estimators;
pub(crate) mod exercises;
pub(crate) mod experiment;
pub(crate) mod grade;
pub(crate) mod hand_in;
pub(crate) mod info;
#[cfg(feature = "live")]
pub(crate) mod live;
pub(crate) mod man;
#[cfg(feature = "parquet")]
pub(crate) mod montecarlo;
#[cfg(feature = "ros")]
pub(crate) mod ros;
pub(crate) mod run;
pub(crate) mod simulate;
#[cfg(feature = "parquet")]
pub(crate) mod study;
pub(crate) mod track;
pub(crate) mod tune;
