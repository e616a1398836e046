//! Where is the body: navigation estimators over recordings, and how good they are.
//!
//! Read first: [`run_navigation`], what it can be asked for in [`NavigationOptions`], what it says in
//! [`NavigationSummary`].
//!
//! | file | what is in it |
//! |---|---|
//! | `kinds.rs`, `parameters.rs` | the estimators by name; their parameters by name |
//! | `options.rs` | what a run can be asked for: thinned fixes, outages, aids left out |
//! | `navigator.rs` | what every estimator does; the adapters of each are in `*_navigator.rs` |
//! | `runner.rs`, `observer.rs` | from events to estimates; what watches |
//! | `score.rs`, `outcome.rs` | errors at held-out fixes, at a reference and in outages; the outcome |
//! | `batch_smoother.rs`, `smoothed.rs` | the smoother of the GNSS/INS; scores of smoothed estimates |
//! | `benchmark.rs` | one rule over many recordings, beside answers that need no filter |
//! | `moving_frame.rs`, `magnetic_model.rs` | the local frame moves with the vehicle; the declination of a place |
//! | `trace.rs` | what plots need |

mod axis_navigator;
pub mod batch_smoother;
pub mod benchmark;
mod device_navigator;
mod ins_navigator;
pub mod kinds;
pub mod magnetic_model;
pub mod moving_frame;
mod navigation_file;
pub mod navigator;
pub mod observer;
pub mod options;
pub mod outcome;
pub mod parameters;
pub mod runner;
pub mod score;
mod ship_navigator;
mod smoothed;
pub mod trace;

pub use kinds::NavigationKind;
pub use navigation_file::NavigationFile;
pub use navigator::{Aid, AidKind, NavigationEstimate};
pub use observer::{NavigationObserver, ScoredPoint};
pub use options::{NavigationOptions, Outage};
pub use outcome::NavigationSummary;
pub use parameters::NavigationParameters;
pub use runner::run_navigation;
