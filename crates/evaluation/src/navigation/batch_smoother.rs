//! Batch smoother of the GNSS/INS: the trajectory that a whole recording makes most probable, by an iterated Kalman smoother.
//!
//! *Read first:* Bell (1994), *The iterated Kalman smoother as a Gauss-Newton method*; `docs/derivations/error_state.md`,
//! section 11 (E34, E35, E43-E49).
//!
//! A [`BatchRecorder`] keeps what a [`GnssIns`](northing_core::navigation::GnssIns) was given, and its states as a first guess.
//! [`BatchRecorder::smooth`] then solves for all states at once: start, biases and their values at rest, the receiver's
//! correlated error, time offsets and lever arm, the scale of a wheel speed. Each pass is one linear Kalman filter about the trajectory so far and one
//! backward recursion, which together are a Gauss-Newton step; fixes are weighed anew after each, by Student's t distribution.
//!
//! ```
//! use northing_core::navigation::gnss_ins::{GnssIns, GnssInsConfig};
//! use northing_core::nalgebra::Vector3;
//! use northing_evaluation::navigation::batch_smoother::BatchRecorder;
//!
//! let mut ins = GnssIns::<f64>::new(GnssInsConfig::default()).unwrap();
//! let mut recorder = BatchRecorder::default();
//! for k in 0..10_i64 {
//!     let (rate, force) = (Vector3::zeros(), Vector3::new(0.0, 0.0, -9.8));
//!     ins.imu(k * 10_000_000, &rate, &force).unwrap();
//!     recorder.imu(k * 10_000_000, &rate, &force, &ins);
//! }
//! assert!(recorder.smooth(ins.config()).nodes.is_empty(), "there was no fix");
//! ```
//!
//! | file | what is in it |
//! |---|---|
//! | `recorder.rs` | what is kept of a run |
//! | `state.rs` | the states, and what an error is |
//! | `timeline.rs`, `prior.rs` | nodes and their measurements; what is known before any of them |
//! | `nominal.rs` | the first trajectory, from the filter's states |
//! | `motion.rs` | from one node to the next: strapdown, transition, process noise |
//! | `aids.rs` | what each measurement sees |
//! | `pass.rs` | the linear filter forward and the recursion backward |
//! | `solver.rs` | passes until nothing changes, weights and noise scales |
//!
//! It goes across realignments, and across gaps between inertial samples of up to 10 s as the filter does; a longer gap, a clock
//! that goes back, or an origin more than 100 km from where the batch began, begins a new one. Nodes are at most 0.1 s apart and one at each fix. Memory: 8.5 KB a node and 56 bytes an
//! inertial sample, which is 370 MB an hour at 100 Hz and one fix a second. Time: about 0.1 ms a node and pass.

mod aids;
mod motion;
mod nominal;
mod pass;
#[cfg(test)]
mod pass_tests;
mod prior;
mod recorder;
mod solver;
mod state;
mod timeline;

#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use northing_core::earth::LocalFrame;
use northing_core::navigation::{ERRORS, STATES};
use serde::Serialize;

pub use recorder::{BatchRecorder, Measured, Part};

/// First of the errors of the accelerometer's and of the gyroscope's bias at rest.
const BIAS_AT_REST: usize = ERRORS;
/// First of the three errors of the lever arm.
const LEVER_ARM: usize = BIAS_AT_REST + 6;
/// The error of the scale of a wheel speed.
const SPEED_SCALE: usize = LEVER_ARM + 3;
/// The error of how much later the receiver's velocities are than its positions.
const VELOCITY_OFFSET: usize = SPEED_SCALE + 1;
/// All errors: those of the filter, the biases at rest, the lever arm, the scale of a wheel speed, and the time offset of
/// velocities.
const ALL: usize = VELOCITY_OFFSET + 1;

type Errors = SVector<f64, ALL>;
type Covariance = SMatrix<f64, ALL, ALL>;

/// What the smoother says about an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothedNavigation {
    /// When, ns.
    pub time_ns: i64,
    /// The local frame of all that follows: that of the beginning of its batch.
    pub frame: LocalFrame,
    /// Position, m, NED.
    pub position: Vector3<f64>,
    /// Velocity, m/s, NED.
    pub velocity: Vector3<f64>,
    /// Attitude, `ned_from_body`.
    pub ned_from_body: UnitQuaternion<f64>,
    /// Angular rate less the bias, rad/s, body axes.
    pub angular_rate: Vector3<f64>,
    /// Bias of the accelerometer, m/s^2.
    pub accelerometer_bias: Vector3<f64>,
    /// Bias of the gyroscope, rad/s.
    pub gyroscope_bias: Vector3<f64>,
    /// From the unit to the antenna, m, body axes, as far as it was found.
    pub lever_arm: Vector3<f64>,
    /// Position of the antenna as the receiver dates it, m, NED.
    pub antenna: Vector3<f64>,
    /// Covariance of that, m^2.
    pub antenna_covariance: Matrix3<f64>,
    /// Covariance of the errors of attitude, velocity, position, accelerometer and gyroscope bias.
    pub covariance: SMatrix<f64, STATES, STATES>,
    /// Time to the nearest fix that was not rejected, before or after, s; `None` without any.
    pub since_fix_s: Option<f64>,
}

/// How the passes went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SmoothingSummary {
    /// Passes forward and backward; of several batches the most.
    pub iterations: u32,
    /// Whether the last pass moved no state by more than a tenth of a standard deviation, in every batch.
    pub converged: bool,
    /// Batches: one, and one more for each gap of more than 10 s and each 100 km.
    pub batches: u32,
    /// Positions used.
    pub fixes: u64,
    /// Those of them that count less than others, because they are further off than 97 of 100.
    pub fixes_down_weighted: u64,
    /// What the receiver's stated standard deviations were multiplied by: of horizontal positions, heights, velocities; of the
    /// last batch.
    pub noise_scales: [f64; 3],
    /// Time offset of the receiver's positions beyond the latency of the settings, s; of the last batch.
    pub time_offset_s: f64,
    /// Lever arm, m, body axes; of the last batch.
    pub lever_arm_m: [f64; 3],
}

/// A smoothed recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BatchSolution {
    /// Every node in time order, from the first fix on.
    pub nodes: Vec<SmoothedNavigation>,
    /// How the passes went; `None` where there was nothing to smooth.
    pub summary: Option<SmoothingSummary>,
}
