//! Gyroscope integration alone: the baseline of every filter.
//!
//! Read first: Utrera & Vazquez (2021), section 4 ("direct integration method");
//! `docs/derivations/mekf.md`, M6. It propagates like the filters do, exactly for a rate held over
//! the interval, and never corrects: its error grows with the gyroscope's bias and noise. It says
//! nothing about its own uncertainty.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::StartUncertainty;
use super::propagation::checked_rate;
use super::{AttitudeConfig, AttitudeEstimator, CompassHeading, InitialState, Propagation};
use crate::geometry::{rotation, so3};
use crate::kalman::{Innovation, SkipReason};
use crate::restorable::{InvalidState, Restorable, finite, unit};
use crate::scalar::Scalar;

/// Everything that the integration remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct IntegrationState<T: Scalar> {
    /// `ref_from_body`.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub attitude: UnitQuaternion<T>,
    /// Gyroscope bias, rad/s, body axes: a constant of the start.
    pub gyroscope_bias: Vector3<T>,
}

/// Attitude by integration of the angular rate, less a constant bias.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Integration<T: Scalar> {
    start: StartUncertainty<T>,
    state: IntegrationState<T>,
}

impl<T: Scalar> Default for Integration<T> {
    fn default() -> Self {
        Self::new(StartUncertainty::of(&AttitudeConfig::default()))
    }
}

impl<T: Scalar> Integration<T> {
    /// At the identity. It makes no use of `start` but to tell a driver.
    pub fn new(start: StartUncertainty<T>) -> Self {
        let state = IntegrationState {
            attitude: UnitQuaternion::identity(),
            gyroscope_bias: Vector3::zeros(),
        };
        Self { start, state }
    }
}

impl<T: Scalar> Restorable for Integration<T> {
    type State = IntegrationState<T>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        unit("attitude", &state.attitude)?;
        finite("gyroscope bias", &state.gyroscope_bias)?;
        self.state = state;
        Ok(())
    }
}

impl<T: Scalar> AttitudeEstimator<T> for Integration<T> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() {
            return;
        }
        self.state.attitude = initial.attitude;
        self.state.gyroscope_bias = initial.gyroscope_bias;
    }

    #[inline]
    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        match checked_rate(angular_rate, &self.state.gyroscope_bias, dt) {
            Ok(Some(rate)) => {
                let turned = self.state.attitude * so3::exp(&(rate * dt));
                self.state.attitude = rotation::renormalize(&turned);
                Propagation::Done
            }
            Ok(None) => Propagation::Done,
            Err(reason) => Propagation::Skipped(reason),
        }
    }

    fn update_accelerometer(&mut self, _specific_force: &Vector3<T>) -> Innovation<T> {
        Innovation::skipped(SkipReason::NotUsed)
    }

    fn update_magnetometer(&mut self, _magnetic_field: &Vector3<T>) -> Innovation<T> {
        Innovation::skipped(SkipReason::NotUsed)
    }

    fn update_compass(&mut self, _heading: &CompassHeading<T>) -> Innovation<T> {
        Innovation::skipped(SkipReason::NotUsed)
    }

    fn add_attitude_variance(&mut self, _variance: T) {}

    fn attitude(&self) -> UnitQuaternion<T> {
        self.state.attitude
    }

    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        None
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        None
    }

    fn start_uncertainty(&self) -> StartUncertainty<T> {
        self.start
    }

    fn rate_at_rest(&self) -> Vector3<T> {
        self.state.gyroscope_bias
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Specification of the lab: 60 s of coning at 3 rad/s, 100 Hz; held at the start of each
    /// interval 1.5425 deg, with the mid-interval rate 0.7377 deg.
    #[test]
    fn coning_error_is_the_known_one_for_held_and_for_mid_interval_rate() {
        let rate = |t: f64| Vector3::new(3.0 * (7.0 * t).cos(), 3.0 * (7.0 * t).sin(), 1.0);
        let end = |steps_per_s: u32, offset: f64| {
            let dt = 1.0 / f64::from(steps_per_s);
            let mut filter = Integration::default();
            for k in 0..60 * steps_per_s {
                assert_eq!(
                    filter.propagate(&rate((f64::from(k) + offset) * dt), dt),
                    Propagation::Done
                );
            }
            filter.attitude()
        };
        let truth = end(4000, 0.5);
        let degrees = |q: &UnitQuaternion<f64>| rotation::angle_between(&truth, q).to_degrees();
        assert!((degrees(&end(100, 0.0)) - 1.5425).abs() < 0.005);
        assert!((degrees(&end(100, 0.5)) - 0.7377).abs() < 0.005);
        assert!((degrees(&end(50, 0.0)) - 4.0125).abs() < 0.02);
    }

    #[test]
    fn bad_samples_leave_the_state_untouched() {
        let mut filter = Integration::<f32>::default();
        let before = filter;
        let bad = Vector3::new(0.0, f32::NAN, 0.0);
        assert_eq!(
            filter.propagate(&bad, 0.01),
            Propagation::Skipped(SkipReason::NotFinite)
        );
        assert_eq!(
            filter.propagate(&Vector3::x(), f32::INFINITY),
            Propagation::Skipped(SkipReason::NotFinite)
        );
        assert_eq!(filter.propagate(&Vector3::x(), -0.01), Propagation::Done);
        assert_eq!(filter, before);
    }
}
