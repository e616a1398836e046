//! Standard deviations of an attitude: tilt, heading and body axes, from its covariance.
//!
//! The covariance is of the local error in body axes, `q_true = q * Exp(dtheta)`. Turned into world axes, `R P R^T`, its
//! vertical part is that of the heading and its horizontal part that of the tilt.

use nalgebra::{Matrix2, Matrix3, UnitQuaternion};
use northing_core::geometry::frames::covariance_in_reference;

/// Standard deviations of the error of one attitude, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeStd {
    /// RMS that the whole error is expected to have: the root of the trace of the covariance.
    pub total: f64,
    /// RMS that the tilt (inclination) error is expected to have: the root of the sum of the variances about the two
    /// horizontal axes.
    pub tilt: f64,
    /// About the vertical.
    pub heading: f64,
    /// About each body axis.
    pub body: [f64; 3],
}

impl AttitudeStd {
    /// Of the covariance (rad^2) of the local error in body axes of `world_from_body`; the third axis of the world is
    /// vertical.
    #[must_use]
    pub fn of(world_from_body: &UnitQuaternion<f64>, covariance: &Matrix3<f64>) -> Self {
        let world = covariance_in_reference(world_from_body, covariance);
        let std = |variance: f64| variance.max(0.0).sqrt();
        Self {
            total: std(covariance.trace()),
            tilt: std(world[(0, 0)] + world[(1, 1)]),
            heading: std(world[(2, 2)]),
            body: covariance.diagonal().map(std).into(),
        }
    }
}

/// Covariance (rad^2) of the error about the two horizontal axes of the world.
#[must_use]
pub fn tilt_covariance(
    world_from_body: &UnitQuaternion<f64>,
    covariance: &Matrix3<f64>,
) -> Matrix2<f64> {
    covariance_in_reference(world_from_body, covariance)
        .fixed_view::<2, 2>(0, 0)
        .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::metrics::AttitudeError;
    use nalgebra::Vector3;
    use northing_core::geometry::so3;
    use northing_simulation::random::{normal_vector, stream};

    /// Errors drawn from a covariance with correlations have the RMS that is stated for each part.
    #[test]
    fn stated_deviations_are_those_of_errors_drawn_from_the_covariance() {
        let attitude = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.1, 2.0));
        let root = Matrix3::new(0.01, 0.0, 0.0, 0.012, 0.02, 0.0, -0.004, 0.01, 0.03);
        let stated = AttitudeStd::of(&attitude, &(root * root.transpose()));
        let mut random = stream(7, "attitude");
        let count = 200_000;
        let mut squares = [0.0; 6];
        for _ in 0..count {
            let local = root * normal_vector(&mut random, 1.0);
            let truth = attitude * so3::exp(&local);
            let error = AttitudeError::between(&attitude, &truth);
            let parts = [error.total, error.inclination, error.heading];
            for (sum, part) in squares.iter_mut().zip(parts.iter().chain(&local)) {
                *sum += part * part;
            }
        }
        let [x, y, z] = stated.body;
        let expected = [stated.total, stated.tilt, stated.heading, x, y, z];
        for (sum, std) in squares.into_iter().zip(expected) {
            let drawn = (sum / f64::from(count)).sqrt();
            assert!((drawn / std - 1.0).abs() < 0.01, "{drawn} for {std}");
        }
        let tilt = tilt_covariance(&attitude, &(root * root.transpose()));
        assert!((tilt.trace().sqrt() / stated.tilt - 1.0).abs() < 1e-12);
    }
}
