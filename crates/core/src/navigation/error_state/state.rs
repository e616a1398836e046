//! State of the error-state filter: attitude, velocity, position and biases with their covariance.

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

use crate::geometry::rotation::is_unit;
use crate::kalman::covariance::{
    cap_variance, forget_correlations_unless_resolved, is_covariance, mirror_upper,
    shrink_correlations_unless_resolved,
};
use crate::navigation::{ErrorTransition, STATES};
use crate::restorable::{InvalidState, covariance, finite, unit};
use crate::scalar::{Scalar, lit};

/// Largest attitude error (rad), velocity (m/s), position (m), accelerometer (m/s^2) and gyroscope bias (rad/s).
/// as squares. Written out, so that a chip without double precision converts nothing.
fn largest_squares<T: Scalar>() -> [T; 5] {
    [lit(1e4), lit(1e10), lit(1e18), lit(1e8), lit(1e6)]
}

/// Everything the filter remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NavigationState<T: Scalar> {
    /// Attitude, `ned_from_body`.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub ned_from_body: UnitQuaternion<T>,
    /// Velocity, m/s, NED.
    pub velocity: Vector3<T>,
    /// Position, m, NED from the origin of the tangent plane.
    pub position: Vector3<T>,
    /// Accelerometer bias, m/s^2, body axes.
    pub accelerometer_bias: Vector3<T>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<T>,
    /// Covariance of `[dpsi, dv, dp, db_a, db_g]` at the last update or
    /// [`ErrorStateFilter::catch_up`](super::ErrorStateFilter::catch_up).
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: SMatrix<T, STATES, STATES>,
    /// Transition of the errors since then.
    pub pending: ErrorTransition<T>,
    /// Inertial samples and fixes that were refused.
    pub skipped: u32,
}

impl<T: Scalar> NavigationState<T> {
    /// Starts at an attitude (`ned_from_body`), a velocity (m/s, NED) and a position (m, NED), with biases of zero, all
    /// of it exactly known: say how uncertain it is by [`Self::with_std`].
    pub fn new(
        ned_from_body: UnitQuaternion<T>,
        velocity: Vector3<T>,
        position: Vector3<T>,
    ) -> Self {
        Self {
            ned_from_body,
            velocity,
            position,
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance: SMatrix::zeros(),
            pending: ErrorTransition::default(),
            skipped: 0,
        }
    }

    /// The same with independent errors of these standard deviations on each axis: attitude (rad), velocity (m/s),
    /// position (m), accelerometer bias (m/s^2), gyroscope bias (rad/s).
    #[must_use]
    pub fn with_std(mut self, std: [T; 5]) -> Self {
        let variance = |i: usize, _| std[i / 3] * std[i / 3];
        self.covariance = SMatrix::from_diagonal(&SVector::from_fn(variance));
        self
    }

    /// Whether the attitude is a rotation, the covariance one within a thousandth of a correlation, and each state and
    /// standard deviation at most what it can be: 100 rad, 1e5 m/s, 1e9 m, 1e4 m/s^2, 1e3 rad/s.
    pub fn is_usable(&self) -> bool {
        let variances = self.covariance.diagonal();
        let limits = largest_squares::<T>();
        let within = |(i, v): (usize, &T)| limits.get(i / 3).is_some_and(|limit| *v <= *limit);
        is_unit(&self.ned_from_body)
            && self.is_sound()
            && variances.iter().enumerate().all(within)
            && is_covariance(&self.covariance, lit(1e-3))
    }

    /// Keeps variances within what their states can be: beyond, nothing is known. Only an outage or garbage leads there.
    #[inline]
    pub(super) fn hold_covariance(&mut self) {
        let limits = largest_squares::<T>();
        let limit = |i: usize| limits[i / 3];
        if (0..STATES).all(|i| self.covariance[(i, i)] <= limit(i)) {
            return;
        }
        for i in 0..STATES {
            cap_variance(&mut self.covariance, i, limit(i));
        }
        let unknown = SVector::from_fn(|i, _| limit(i));
        forget_correlations_unless_resolved(&mut self.covariance, &unknown);
    }

    /// Whether every number is finite and within what it can be, and no variance negative: what is asked at each step.
    pub(in crate::navigation) fn is_sound(&self) -> bool {
        let vectors = [
            &self.velocity,
            &self.position,
            &self.accelerometer_bias,
            &self.gyroscope_bias,
        ];
        let variances = self.covariance.diagonal();
        let largest = largest_squares::<T>();
        let mut limits = vectors.iter().zip(largest.iter().skip(1));
        self.ned_from_body.as_ref().norm_squared().is_finite()
            && limits.all(|(v, limit)| v.norm_squared() <= *limit)
            && self.covariance.norm_squared().is_finite()
            && variances.iter().all(|v| *v >= T::zero())
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("attitude", &self.ned_from_body)?;
        finite("velocity", &self.velocity)?;
        finite("position", &self.position)?;
        finite("accelerometer bias", &self.accelerometer_bias)?;
        finite("gyroscope bias", &self.gyroscope_bias)?;
        finite("pending transition", self.pending.numbers())?;
        covariance("covariance", &self.covariance)
    }

    /// The covariance symmetric to the bit, as every step of the filter leaves it, and positive semidefinite; the upper
    /// triangle counts.
    pub(super) fn with_symmetric_covariance(mut self) -> Self {
        mirror_upper(&mut self.covariance);
        shrink_correlations_unless_resolved(&mut self.covariance);
        self
    }
}
