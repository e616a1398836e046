//! Where is the body: position, velocity and attitude from an inertial measurement unit and
//! whatever aids it.
//!
//! | estimator | file | error states | when |
//! |---|---|---|---|
//! | [`ErrorStateFilter`] | `error_state.rs` | attitude, velocity, position, two biases | GNSS compass, tangent plane |
//! | [`GnssIns`] | `gnss_ins.rs` | the same, and up to seven beside | an inertial unit and a receiver, stamped, start to outage |
//! | [`InMotionAlignment`] | `in_motion_alignment.rs` | the same and four of the receiver, a hypothesis | attitude to begin with, in any motion |
//! | [`Cascade`] | `cascade.rs` | none | positions behind any attitude estimator; fixed gains |
//! | [`DeadReckoning`] | `dead_reckoning.rs` | position and current | a ship's compass, log and fixes, no inertial sensors |
//! | [`axis_filters::PositionAxisFilters`] | `axis_filters.rs` | three an axis | the smallest there is, on a chip |
//!
//! Frames of the error-state filter: local north, east, down (NED) tangent plane; body forward, right, down (FRD). Gravity is
//! constant and points down; Earth's rotation is left out. Both are small against the noise of the
//! sensors this is meant for within some tens of kilometres.

pub mod aiding;
pub mod augmented_states;
pub mod axis_filters;
pub mod cascade;
pub mod dead_reckoning;
pub mod error_state;
mod gauss_markov_bias;
pub mod gnss_ins;
pub mod held_fixes;
pub mod history;
pub mod in_motion_alignment;
mod moved_origin;
pub mod preintegration;
pub mod transition;
pub mod validity;

pub use aiding::gnss_position::GnssPosition;
pub use aiding::gnss_velocity::GnssVelocity;
pub use augmented_states::AugmentedStates;
pub use axis_filters::{PositionAxisConfig, PositionAxisFilters};
pub use cascade::{Cascade, CascadeConfig, CascadeState};
pub use dead_reckoning::{DeadReckoning, DeadReckoningConfig, DeadReckoningState};
pub use error_state::{
    ErrorStateConfig, ErrorStateFilter, GnssCompassFix, GnssCompassUpdate, NavigationState,
};
pub use gnss_ins::{Aid, GnssIns, GnssInsConfig, GnssInsState, GnssPositionUpdate};
pub use held_fixes::HeldFixes;
pub use in_motion_alignment::{InMotionAlignment, InMotionAlignmentConfig};
pub use preintegration::Preintegration;
pub use transition::ErrorTransition;
pub use validity::{Validity, ValidityLimits};

/// Number of error states: `[dpsi, dv, dp, db_a, db_g]`, three each.
pub const STATES: usize = 15;
/// The same and the [`AugmentedStates`] behind them: all that a [`GnssIns`] estimates.
pub const ERRORS: usize = STATES + augmented_states::AUGMENTED_STATES;
/// First of the three attitude errors (rad, NED axes).
pub const ATTITUDE: usize = 0;
/// First of the three velocity errors (m/s, NED).
pub const VELOCITY: usize = 3;
/// First of the three position errors (m, NED).
pub const POSITION: usize = 6;
/// First of the three accelerometer bias errors (m/s^2, body axes).
pub const ACCELEROMETER_BIAS: usize = 9;
/// First of the three gyroscope bias errors (rad/s, body axes).
pub const GYROSCOPE_BIAS: usize = 12;
