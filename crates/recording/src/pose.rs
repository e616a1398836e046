//! An estimate of pose and velocity in the axes of ROS (REP 103): the world east, north, up; what files and messages of ROS 2
//! are made of.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::track::TrackPoint;

/// Variance of an angle of which nothing is known, rad^2: that of one anywhere on the circle.
pub const UNKNOWN_ANGLE_VARIANCE: f64 = std::f64::consts::PI * std::f64::consts::PI / 3.0;
/// Variance of a position or velocity of which none is stated, m^2, (m/s)^2 and (rad/s)^2: `Odometry` has no way to say so.
pub const UNKNOWN_VARIANCE: f64 = 1e9;

/// An estimate of an instant.
#[derive(Debug, Clone, Copy, Default)]
pub struct PoseEstimate {
    /// Stamp, ns.
    pub time_ns: i64,
    /// `enu_from_body`, and the covariance of its error about east, north, up, rad^2, where it is stated.
    pub attitude: Option<(UnitQuaternion<f64>, Option<Matrix3<f64>>)>,
    /// East, north, up of the origin, m, and its covariance, m^2.
    pub position: Option<(Vector3<f64>, Option<Matrix3<f64>>)>,
    /// East, north, up, m/s, and its covariance, (m/s)^2.
    pub velocity: Option<(Vector3<f64>, Option<Matrix3<f64>>)>,
    /// The place on the Earth.
    pub place: Option<TrackPoint>,
    /// What the inertial sensor measured at the instant, where it is to be told beside the attitude: rad/s, m/s^2, body axes.
    pub angular_rate: Option<Vector3<f64>>,
    /// The same of the specific force.
    pub specific_force: Option<Vector3<f64>>,
}
