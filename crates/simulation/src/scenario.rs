//! Scenarios: a file that says everything about an experiment, and variants that change a few lines.
//!
//! | part | file |
//! |---|---|
//! | the tables and keys, with units and defaults | [`schema`] |
//! | reading a file: variants, inheritance, messages with lines | [`file`](mod@file) |
//! | what all runs share: the own ship's motion, the noises | [`world`] |
//! | one run: truth and measurements, drawn from file, seed and run number | [`run`] |
//! | flights for attitude observers: tables, and one run | [`flight_schema`], [`flight_run`] |

pub mod check;
pub mod file;
pub mod flight_run;
pub mod flight_schema;
pub mod run;
pub mod schema;
pub mod world;

pub use file::{FlightScenarioFile, ScenarioError, ScenarioFile, ScenarioTables};
pub use flight_run::FlightRun;
pub use flight_schema::FlightScenario;
pub use run::TrackingRun;
pub use schema::Scenario;
pub use world::TrackingWorld;
