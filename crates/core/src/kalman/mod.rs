//! What every Kalman filter here shares: the innovation record, gates, in-place updates and
//! covariance hygiene.

pub mod covariance;
pub mod feedback;
pub mod gate;
pub mod innovation;
pub mod scalar_update;
pub(crate) mod shear;
pub mod sparse_update;

pub use feedback::{
    ErrorFeedback, ErrorPropagation, FollowedNavigation, FollowedUpdate, NavigationPose,
    OutsideCorrection, ScalarCorrection,
};
pub use gate::{CountedGate, Gate, GateDecision, GateState};
pub use innovation::{Innovation, Outcome, SkipReason};
