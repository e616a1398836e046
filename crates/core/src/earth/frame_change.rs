//! Change of local frame: positions, velocities and attitudes of one tangent plane in the axes of another.
//!
//! A tangent plane is right near its origin only, so a vehicle that travels takes the origin along
//! (`docs/derivations/error_state.md`, section 13).

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::LocalFrame;
use crate::geometry::rotation;
use crate::scalar::{Scalar, lit};

/// From a local frame to another one.
///
/// ```
/// use northing_core::earth::{FrameChange, Geodetic, LocalFrame};
/// let place = |latitude, longitude| Geodetic::from_degrees(latitude, longitude, 0.0).unwrap();
/// let (oslo, bergen) = (LocalFrame::new(place(59.91, 10.75)), LocalFrame::new(place(60.39, 5.32)));
/// let change = FrameChange::<f64>::between(&oslo, &bergen);
/// let voss = place(60.63, 6.42);
/// assert!((change.position(&oslo.ned(&voss)) - bergen.ned(&voss)).norm() < 1e-6);
/// // North of Oslo, seen from Bergen, points 4.7 degrees to the west of north.
/// assert!((change.heading().to_degrees() + 4.7).abs() < 0.1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameChange<T: Scalar> {
    axes: Matrix3<T>,
    rotation: UnitQuaternion<T>,
    /// The new origin, in the old frame, m.
    origin: Vector3<T>,
}

impl<T: Scalar> FrameChange<T> {
    /// From the frame `old` to the frame `new`.
    pub fn between(old: &LocalFrame, new: &LocalFrame) -> Self {
        let axes = new.from_axes_at(old.origin());
        Self {
            axes: axes.map(lit),
            rotation: rotation::from_matrix(&axes.map(lit)),
            origin: old.ned(new.origin()).map(lit),
        }
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            axes: self.axes.transpose(),
            rotation: self.rotation.inverse(),
            origin: -(self.axes * self.origin),
        }
    }

    /// A position, m.
    pub fn position(&self, position: &Vector3<T>) -> Vector3<T> {
        self.axes * (position - self.origin)
    }

    /// A velocity, or any other vector.
    pub fn vector(&self, vector: &Vector3<T>) -> Vector3<T> {
        self.axes * vector
    }

    /// An attitude, `ned_from_body`.
    pub fn attitude(&self, attitude: &UnitQuaternion<T>) -> UnitQuaternion<T> {
        rotation::renormalize(&(self.rotation * attitude))
    }

    /// A covariance of three components.
    pub fn covariance(&self, covariance: &Matrix3<T>) -> Matrix3<T> {
        self.axes * covariance * self.axes.transpose()
    }

    /// What is added to a heading, rad: the convergence of the meridians.
    pub fn heading(&self) -> T {
        let m = &self.axes;
        (m.m21 - m.m12).atan2(m.m11 + m.m22)
    }

    /// How far the origin moves, m.
    pub fn distance(&self) -> T {
        self.origin.norm()
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.axes.norm_squared().is_finite() && self.origin.norm_squared().is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::Geodetic;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn frame(latitude: f64, longitude: f64) -> LocalFrame {
        LocalFrame::new(Geodetic::from_degrees(latitude, longitude, 120.0).unwrap())
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(62), ..ProptestConfig::default() })]
        #[test]
        fn places_are_the_same_in_every_frame(
            latitudes in prop::array::uniform3(-90.0..90.0f64),
            longitudes in prop::array::uniform3(-180.0..180.0f64),
        ) {
            let [a, b, c] = [0, 1, 2].map(|i| frame(latitudes[i], longitudes[i]));
            let change = FrameChange::<f64>::between(&a, &b);
            let (before, after) = (a.ned(c.origin()), b.ned(c.origin()));
            prop_assert!((change.position(&before) - after).norm() < 1e-6);
            prop_assert!((change.inverse().position(&after) - before).norm() < 1e-6);
            // A body that stands level and points north at the third place.
            let level = |frame: &LocalFrame| rotation::from_matrix(&frame.from_axes_at(c.origin()));
            let turned = change.attitude(&level(&a));
            prop_assert!(rotation::angle_between(&turned, &level(&b)) < 1e-7);
            let east = level(&a) * Vector3::y();
            prop_assert!((change.vector(&east) - level(&b) * Vector3::y()).norm() < 1e-9);
        }
    }

    #[test]
    fn a_kilometre_east_turns_north_by_the_convergence_of_the_meridians() {
        let home = frame(60.0, 10.0);
        let east = home.geodetic(&Vector3::new(0.0, 1000.0, 0.0));
        let change = FrameChange::<f64>::between(&home, &LocalFrame::new(east));
        let expected = 1000.0 / 6.39e6 * 60f64.to_radians().tan();
        assert_relative_eq!(change.heading(), expected, max_relative = 2e-3);
        assert_relative_eq!(change.distance(), 1000.0, epsilon = 1e-6);
    }
}
