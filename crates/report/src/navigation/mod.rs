//! The page of a navigation run: track, outages, the figures of the GPS/INS paper.

pub(crate) mod page;
mod picture;
mod plots;
