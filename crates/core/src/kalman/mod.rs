//! What every Kalman filter here shares: the innovation record, gates, in-place updates and
//! covariance hygiene.

pub mod covariance;
pub mod feedback;
pub mod gate;
pub mod innovation;
mod navigation_pose;
pub mod scalar_update;
pub(crate) mod shear;
pub mod sparse_update;

pub use feedback::{
    ErrorFeedback, ErrorListener, ErrorPropagation, OutsideCorrection, ScalarCorrection,
    ScaledState,
};
pub use gate::{CountedGate, Gate, GateDecision, GateState};
pub use innovation::{Innovation, Outcome, SkipReason};
pub use navigation_pose::NavigationPose;
