//! The program as its users meet it: arguments in, text, JSON and files out.

#![allow(clippy::unwrap_used)]

mod allan;
mod bad_input;
mod benchmark;
mod benchmark_navigation;
mod board;
mod calibrate;
mod campaign;
mod compare;
mod convert;
mod data;
mod demo;
mod describe;
mod exercises;
mod experiment;
mod introduction;
mod magnetometer;
mod magnetometer_choice;
mod navigation;
mod positions;
mod reference;
#[cfg(all(unix, feature = "parquet"))]
mod results;
mod run;
#[cfg(target_os = "linux")]
mod streaming;
#[cfg(feature = "parquet")]
mod study;
#[cfg(all(unix, feature = "parquet"))]
mod study_engines;
mod support;
mod track;
mod used_parameters;
