//! Pages about experiments: Monte-Carlo campaigns, observers in cascade, attitude and GNSS/INS on random worlds, injected faults.

pub(crate) mod attitude_worlds;
pub(crate) mod campaign;
pub mod campaign_outcome;
mod elements;
pub(crate) mod faults;
pub(crate) mod navigation_worlds;
pub(crate) mod observers;
