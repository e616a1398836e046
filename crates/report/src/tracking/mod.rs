//! The page of a tracking run.

pub mod followed_targets;
mod map;
