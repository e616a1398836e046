//! Monte Carlo experiments on trackers: many runs of a scenario, on all processors.
//!
//! | I look for | file |
//! |---|---|
//! | the trackers by name, and any of them behind one type | [`trackers`] |
//! | one run: navigation and trackers on the same measurements | [`experiment`] |
//! | the paper's navigation filter and the product's, and the trackers beside them | `navigators` |
//! | one run as columns: what `simulate` prints and writes | [`single_run`] |
//! | sums that do not depend on the order of adding | [`crate::exact_sum`] |
//! | what is summed over runs, and its split into parts | [`sums`] |
//! | many runs, and merging what others ran | [`campaign`] |
//! | RMSE, NEES and bands from the sums: what `montecarlo --json` prints | [`outcome`] |

pub mod campaign;
pub mod experiment;
mod navigators;
pub mod outcome;
pub mod single_run;
pub mod sums;
pub mod trackers;

pub use crate::shard::Shard;
pub use campaign::{Campaign, CampaignError, Part};
pub use outcome::CampaignOutcome;
pub use single_run::SingleRun;
pub use trackers::TrackerKind;
