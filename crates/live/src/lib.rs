//! The live lab: phones and virtual phones deliver samples, estimators run on them at once, and
//! calibrations, experiments and what-if follow the laboratory of the paper.
//!
//! | I look for | file |
//! |---|---|
//! | one device: events in, estimates, calibration, experiment out | [`session`] |

pub mod session;
