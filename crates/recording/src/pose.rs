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

impl PoseEstimate {
    /// Moves position and velocity from the antenna to the origin of the body's frame, in which the antenna is at `antenna` (body axes,
    /// m). The position's covariance takes the attitude's with it; how the two correlate is not known here and left out.
    pub fn move_from_antenna(&mut self, antenna: &Vector3<f64>) {
        let Some((attitude, covariance)) = &self.attitude else {
            return;
        };
        let way = attitude * antenna;
        if let Some((position, of_position)) = &mut self.position {
            *position -= way;
            if let (Some(p), Some(turn)) = (of_position, covariance) {
                let cross = way.cross_matrix();
                *p += cross * turn * cross.transpose();
            }
        }
        if let (Some((velocity, _)), Some(rate)) = (&mut self.velocity, &self.angular_rate) {
            *velocity -= attitude * rate.cross(antenna);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    /// The body looks north and turns left; the antenna is 2 m ahead of it.
    #[test]
    fn the_body_is_behind_its_antenna() {
        let mut pose = PoseEstimate {
            attitude: Some((
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2),
                Some(Matrix3::identity() * 0.01),
            )),
            position: Some((Vector3::new(5.0, 7.0, 1.0), Some(Matrix3::identity()))),
            velocity: Some((Vector3::zeros(), None)),
            angular_rate: Some(Vector3::new(0.0, 0.0, 0.5)),
            ..PoseEstimate::default()
        };
        pose.move_from_antenna(&Vector3::new(2.0, 0.0, 0.0));
        let (position, covariance) = pose.position.unwrap();
        approx::assert_relative_eq!(position, Vector3::new(5.0, 5.0, 1.0), epsilon = 1e-12);
        // A heading error moves it east, a pitch error up; along the way nothing does.
        let expected = Matrix3::from_diagonal(&Vector3::new(1.04, 1.0, 1.04));
        approx::assert_relative_eq!(covariance.unwrap(), expected, epsilon = 1e-12);
        // The antenna goes west by 1 m/s where the body stands; one that stands moves the body east.
        let (velocity, _) = pose.velocity.unwrap();
        approx::assert_relative_eq!(velocity, Vector3::new(1.0, 0.0, 0.0), epsilon = 1e-12);
    }
}
