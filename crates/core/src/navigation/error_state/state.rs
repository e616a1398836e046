//! State of the error-state filter: attitude, velocity, position and biases with their covariance.

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

use crate::kalman::covariance::mirror_upper;
use crate::navigation::{ErrorTransition, STATES};
use crate::restorable::{InvalidState, covariance, finite, unit};
use crate::scalar::Scalar;

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

    /// Whether every number is finite and no variance negative.
    pub fn is_usable(&self) -> bool {
        let variances = self.covariance.diagonal();
        let vectors = [
            &self.velocity,
            &self.position,
            &self.accelerometer_bias,
            &self.gyroscope_bias,
        ];
        self.ned_from_body.as_ref().norm_squared().is_finite()
            && vectors.iter().all(|v| v.norm_squared().is_finite())
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

    /// The covariance symmetric to the bit, as every step of the filter leaves it; the upper triangle counts.
    pub(super) fn with_symmetric_covariance(mut self) -> Self {
        mirror_upper(&mut self.covariance);
        self
    }
}
