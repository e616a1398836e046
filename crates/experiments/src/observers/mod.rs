//! The experiment that judges nonlinear observers in cascade: original, modified, and the EKF alone.
//!
//! "Original" is Mahony's explicit complementary filter, "modified" the passive one behind a quaternion
//! EKF that reconstructs the rotation (Iporre & Améstegui), "EKF" that filter by itself; each feeds the
//! same position observer. All three are tuned on one half of the data and scored on the other.
//!
//! | I look for | file |
//! |---|---|
//! | what an observer is run over: a simulated flight or a recording | [`data`] |
//! | running the three, and their errors | [`schemes`] |
//! | gains that are tried, and the choice among them | [`tuning`] |
//! | gains with confidence intervals | [`interval`] |
//! | one condition, and all of them: what `experiment observers --json` prints | [`experiment`] |
//! | nanoseconds per step | [`cost`] |

pub mod cost;
pub mod data;
pub mod experiment;
pub mod interval;
pub mod schemes;
pub mod tuning;

pub use data::ObserverData;
pub use experiment::{Comparison, Condition, Experiment, ExperimentOutcome};
pub use schemes::{Form, Gains, Score};
