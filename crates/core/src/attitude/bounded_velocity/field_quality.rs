//! Magnetic disturbance: the variance of a measured field grows with what is wrong about strength and dip, and
//! with what does not fit.
//!
//! Strength and dip are seen without any heading: a wrong heading cannot make a good field look bad
//! and so lock itself in (B17). Student's t takes the rest (B18).

use nalgebra::{Vector2, Vector3};

use super::config::BoundedVelocityConfig;
use crate::scalar::{Scalar, lit};

/// The factor on the magnetometer's variance for a field in level axes (east, north, up;
/// microtesla) where `expected` horizontally and downward (B17): one for a perfect field.
#[inline]
pub(super) fn variance_factor<T: Scalar>(
    config: &BoundedVelocityConfig<T>,
    level: &Vector3<T>,
    expected: &Vector2<T>,
) -> T {
    let dip = |horizontal: T, down: T| down.atan2(horizontal);
    let horizontal = (level.x * level.x + level.y * level.y).sqrt();
    let strength = (level.norm() - expected.norm()) / config.field_strength_scale_ut;
    let angle = (dip(horizontal, -level.z) - dip(expected.x, expected.y)) / config.field_dip_scale;
    T::one() + strength * strength + angle * angle
}

/// The weight of an innovation of three components under Student's t (B18); one where `freedom` is
/// zero and errors are taken as normal.
#[inline]
pub(super) fn student_weight<T: Scalar>(freedom: T, nis: T) -> T {
    if freedom <= T::zero() {
        return T::one();
    }
    ((freedom + lit(3.0)) / (freedom + nis)).min(T::one())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn strength_and_dip_count_and_the_heading_does_not() {
        let config = BoundedVelocityConfig::<f64>::lab();
        let expected = Vector2::new(30.0, 40.0);
        let factor = |level| variance_factor(&config, &level, &expected);
        for heading in [0.0_f64, 1.0, -2.5] {
            let level = Vector3::new(30.0 * heading.sin(), 30.0 * heading.cos(), -40.0);
            assert_relative_eq!(factor(level), 1.0, epsilon = 1e-12);
            assert_relative_eq!(factor(level * (58.0 / 50.0)), 2.0, epsilon = 1e-9);
        }
        let dip = (40.0_f64 / 30.0).atan() + 0.14;
        let tilted = Vector3::new(0.0, 50.0 * dip.cos(), -50.0 * dip.sin());
        assert_relative_eq!(factor(tilted), 5.0, epsilon = 1e-9);
    }

    #[test]
    fn outliers_lose_weight_as_their_nis_grows() {
        assert_relative_eq!(student_weight(2.0_f64, 1.0), 1.0);
        assert_relative_eq!(student_weight(2.0_f64, 48.0), 0.1);
        assert_relative_eq!(student_weight(0.0_f64, 1e9), 1.0);
    }
}
