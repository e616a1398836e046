//! Where is the body: navigation estimators over recordings, and how good they are.
//!
//! Read first: [`run_navigation`], what it can be asked for in [`NavigationOptions`], what it says in
//! [`NavigationSummary`].
//!
//! | file | what is in it |
//! |---|---|
//! | `options.rs`, `parameters.rs` | names of the estimators, thinning and outages; parameters by name |
//! | `navigator.rs` | what every estimator does; the adapters of each are in `*_navigator.rs` |
//! | `runner.rs`, `observer.rs` | from events to estimates; what watches |
//! | `score.rs`, `summary.rs` | errors at withheld fixes, at a reference and in outages; the outcome |
//! | `hindsight.rs` | scores of estimates that look back |
//! | `trace.rs` | what plots need |
//! | `tune.rs` | noise parameters by innovation likelihood, with a part held back |

mod axis_navigator;
mod device_navigator;
mod hindsight;
mod ins_navigator;
mod magnetic_model;
pub mod navigator;
pub mod observer;
pub mod options;
pub mod parameters;
pub mod runner;
pub mod score;
mod ship_navigator;
pub mod summary;
pub mod trace;
pub mod tune;

pub use navigator::{Aid, AidKind, NavigationEstimate};
pub use observer::{NavigationObserver, ScoredPoint};
pub use options::{NavigationInfo, NavigationKind, NavigationOptions, Outage};
pub use parameters::NavigationParameters;
pub use runner::run_navigation;
pub use summary::NavigationSummary;
