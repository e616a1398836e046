//! Papers made again: the only crate, tests aside, where simulated worlds meet estimators.
//!
//! | folder | paper | what is in it |
//! |---|---|---|
//! | [`radar`] | Wilthil & Brekke (2018) | Monte-Carlo campaigns of trackers on a ship whose own pose is uncertain |
//! | [`observers`] | Iporre & Améstegui | attitude observers in cascade with position, against a quaternion EKF |
//! | [`ground`] | Romaniuk & Gosiewski (2014) | GNSS/INS on simulated walks and drives |
//! | [`attitude_worlds`] | none | attitude on random boards and motions: accuracy, coverage, verdicts |
//! | [`navigation_worlds`] | none | GNSS/INS on random worlds: lost, worse than extrapolation, coverage, heading |
//! | [`tracking_worlds`] | none | trackers of many targets on random scenes: GOSPA, coverage, consistency |
//! | [`faults`] | none | a campaign of injected faults: cost, recovery, consistency afterwards, for every estimator |
//! | [`studies`] | none | estimators x parameters x seeds over recordings and worlds, a row a run, split over machines |

pub mod attitude_worlds;
pub mod exact_sum;
pub mod faults;
pub mod ground;
pub mod navigation_worlds;
pub mod observers;
pub mod radar;
mod scoring;
pub mod shard;
pub mod studies;
pub mod tracking_worlds;
