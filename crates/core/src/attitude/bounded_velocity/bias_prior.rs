//! How large the biases of this gyroscope are, learnt from the axes that show theirs (B12c, B12d).
//!
//! Without a magnetometer only a rest shows the bias about the vertical; what is assumed of it decides how far the heading
//! drifts. The three axes of a gyroscope are made alike.

use nalgebra::{Matrix3, Vector3};

use super::config::BoundedVelocityConfig;
use crate::scalar::{Scalar, lit};

/// So often it is looked at, s.
const INTERVAL_S: f64 = 1.0;

/// The prior of a gyroscope bias of which nothing is known but about how large it is: zero, with a variance.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct BiasPrior<T: Scalar> {
    /// Variance of an axis that was assumed at the start, (rad/s)^2; zero where the bias is known otherwise.
    initial: T,
    /// The one that is in the covariance now, or will be with all three axes, (rad/s)^2.
    held: T,
    /// Time since it was looked at, s.
    since: T,
    /// Variance of the measurement that is under way, (rad/s)^2, and the axes that it has yet to come to.
    measurement: T,
    axes_left: u8,
}

/// The bias about one axis is zero: a measurement for the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Narrowing<T: Scalar> {
    pub(super) axis: usize,
    /// What the bias is off from zero, rad/s.
    pub(super) residual: T,
    /// (rad/s)^2
    pub(super) variance: T,
}

impl<T: Scalar> BiasPrior<T> {
    /// Zero, with this variance of an axis.
    pub(super) fn assumed(variance: T) -> Self {
        Self {
            initial: variance,
            held: variance,
            since: T::zero(),
            measurement: T::zero(),
            axes_left: 0,
        }
    }

    /// Of a bias that was measured, learnt before a new start, or has stepped.
    pub(super) fn none() -> Self {
        Self::assumed(T::zero())
    }

    pub(super) fn numbers(&self) -> [&T; 4] {
        [&self.initial, &self.held, &self.since, &self.measurement]
    }

    /// What makes the prior as narrow as the estimates say (B12d), one axis a step: a chip has time for no more. `None` where
    /// they do not say that it is narrower, or it was looked at not long ago. `bias` is the estimate, `dt` since the last call.
    #[inline]
    pub(super) fn narrow(
        &mut self,
        config: &BoundedVelocityConfig<T>,
        bias: &Vector3<T>,
        covariance: &Matrix3<T>,
        dt: T,
    ) -> Option<Narrowing<T>> {
        self.since += dt;
        if self.axes_left == 0 {
            self.look(config, bias, covariance, dt);
        }
        self.axes_left = self.axes_left.checked_sub(1)?;
        let axis = usize::from(self.axes_left);
        Some(Narrowing {
            axis,
            residual: -*bias.as_slice().get(axis)?,
            variance: self.measurement,
        })
    }

    /// How large the biases are (B12c), where it is time to look.
    fn look(
        &mut self,
        config: &BoundedVelocityConfig<T>,
        bias: &Vector3<T>,
        covariance: &Matrix3<T>,
        dt: T,
    ) {
        let freedom = config.gyroscope_bias_freedom;
        // To the nearest step, however it is rounded.
        let due = self.since + dt * lit(0.5) >= lit(INTERVAL_S);
        if !due || self.initial <= T::zero() || freedom <= T::zero() {
            return;
        }
        self.since = T::zero();
        let squares = bias.norm_squared() + covariance.trace();
        let variance = (freedom * self.initial + squares) / (freedom + lit(3.0));
        if !(variance > T::zero() && variance < self.held) {
            return;
        }
        let measurement = variance * self.held / (self.held - variance);
        if measurement.is_finite() {
            self.held = variance;
            self.measurement = measurement;
            self.axes_left = 3;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INITIAL: f64 = 1e-4;

    /// The variance in the end, of biases of which the first `seen` show.
    fn learnt(bias: [f64; 3], seen: usize) -> f64 {
        let config = BoundedVelocityConfig::<f64>::hand_held();
        let mut prior = BiasPrior::assumed(INITIAL);
        let mut precision = 1.0 / INITIAL;
        for _ in 0..50 {
            assert_eq!(prior.axes_left, 0);
            let unseen = 1.0 / precision;
            let of = |i: usize| if i < seen { 0.0 } else { unseen };
            let covariance = Matrix3::from_diagonal(&Vector3::new(of(0), of(1), of(2)));
            let shown = Vector3::from_fn(|i, _| if i < seen { bias[i] } else { 0.0 });
            if let Some(first) = prior.narrow(&config, &shown, &covariance, 1.0) {
                precision += 1.0 / first.variance;
                for axis in [1, 0] {
                    let next = prior.narrow(&config, &shown, &covariance, 0.02).unwrap();
                    let residual = -shown[axis];
                    assert_eq!(
                        next,
                        Narrowing {
                            axis,
                            residual,
                            ..first
                        }
                    );
                }
            }
            assert!((precision * prior.held - 1.0).abs() < 1e-9);
        }
        1.0 / precision
    }

    #[test]
    fn what_two_axes_show_is_what_the_third_is_expected_to_be() {
        assert!((learnt([0.0; 3], 0) / INITIAL - 1.0).abs() < 1e-9);
        let freedom = BoundedVelocityConfig::<f64>::hand_held().gyroscope_bias_freedom;
        let bias = [1e-3, -3e-3, 5e-3];
        let expected = (freedom * INITIAL + 1e-5) / (freedom + 2.0);
        let found = learnt(bias, 2);
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        // Larger than assumed: the prior stays.
        assert!((learnt([0.03, 0.0, 0.0], 2) / INITIAL - 1.0).abs() < 1e-9);
    }

    #[test]
    fn what_was_measured_has_no_prior() {
        let config = BoundedVelocityConfig::<f64>::hand_held();
        let zero = Vector3::zeros();
        let covariance = Matrix3::identity() * 1e-8;
        for mut prior in [BiasPrior::none(), BiasPrior::assumed(INITIAL)] {
            let variance = prior.narrow(&config, &zero, &covariance, 2.0);
            assert_eq!(variance.is_some(), prior.initial > 0.0);
        }
    }
}
