//! Pages about papers made again: Monte-Carlo campaigns, observers in cascade.

pub(crate) mod campaign;
pub mod campaign_outcome;
pub(crate) mod observers;
