//! The paper's multiplicative extended Kalman filter: three states, no gyroscope bias.
//!
//! Read first: Utrera & Vazquez (2021), eqs 18-27, which this file implements line by line, and
//! `docs/derivations/mekf.md` for where the printed equations mislead. Use it to reproduce the
//! paper or to teach; for work use [`super::mekf::Mekf`], which also estimates the bias.
//!
//! With `process_noise = "paper-literal"` eq (21) is taken at its word; see
//! [`super::config::ProcessNoise`] for what that costs.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `q` | `state.attitude` (`ref_from_body`) | - |
//! | `P` | `state.covariance`, local error `a` of eq (18) | rad^2 |
//! | `w` | `angular_rate - gyroscope_bias`, the bias constant | rad/s |
//!
//! Cost: about a third of the six-state filter. Limits: what the calibration left of the bias is
//! not in `P`, so the covariance is overconfident.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::config::AttitudeConfig;
use super::measurement::{LinearMeasurement, VectorSensors};
use super::propagation::checked_rate;
use super::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty, propagation,
};
use crate::geometry::{rotation, so3};
use crate::kalman::Innovation;
use crate::kalman::covariance::{cap_attitude, symmetrize, undrown_attitude};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, covariance, finite, restorable, unit};
use crate::scalar::Scalar;

/// Everything the filter remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Mekf3State<T: Scalar> {
    /// `ref_from_body`.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub attitude: UnitQuaternion<T>,
    /// Gyroscope bias, rad/s: a constant from the calibration.
    pub gyroscope_bias: Vector3<T>,
    /// Covariance of the attitude error, rad^2, body axes.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix3<T>,
    /// References, gates and histories of accelerometer and magnetometer.
    pub sensors: VectorSensors<T>,
}

impl<T: Scalar> Mekf3State<T> {
    fn check(&self) -> Result<(), InvalidState> {
        unit("attitude", &self.attitude)?;
        finite("gyroscope bias", &self.gyroscope_bias)?;
        covariance("covariance", &self.covariance)?;
        self.sensors.check()
    }
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mekf3<T: Scalar> {
    config: AttitudeConfig<T>,
    state: Mekf3State<T>,
}

impl<T: Scalar> Mekf3<T> {
    /// A filter at the identity attitude without references.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(config: AttitudeConfig<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        let variance = config.maximum_attitude_std * config.maximum_attitude_std;
        let state = Mekf3State {
            attitude: UnitQuaternion::identity(),
            gyroscope_bias: Vector3::zeros(),
            covariance: Matrix3::identity() * variance,
            sensors: VectorSensors::new(&config),
        };
        Ok(Self { config, state })
    }

    /// The settings.
    pub fn config(&self) -> &AttitudeConfig<T> {
        &self.config
    }

    /// The state, to look at.
    pub fn state(&self) -> &Mekf3State<T> {
        &self.state
    }

    /// The paper's joint update: both sensors stacked and linearised at the same attitude
    /// (eqs 22-27). Either may be missing. The trait's methods update with one at a time, which
    /// differs by second order of the correction only.
    pub fn update_joint(
        &mut self,
        specific_force: Option<&Vector3<T>>,
        magnetic_field: Option<&Vector3<T>>,
    ) -> [Option<Innovation<T>>; 2] {
        let Mekf3State {
            attitude,
            covariance,
            sensors,
            ..
        } = &mut self.state;
        let acc = specific_force.map(|f| sensors.accelerometer(attitude, covariance, f));
        let mag = magnetic_field.map(|m| sensors.magnetometer(attitude, covariance, m));
        let fused = self.fuse([acc.as_ref(), mag.as_ref()]);
        [
            acc.map(|m| m.conclude(fused)),
            mag.map(|m| m.conclude(fused)),
        ]
    }

    /// (24)-(27) as scalar updates from one linearisation point, which equals the stacked form.
    fn fuse(&mut self, measurements: [Option<&LinearMeasurement<T>>; 2]) -> bool {
        let mut covariance = self.state.covariance;
        let mut a = Vector3::zeros();
        let mut fusable = measurements
            .iter()
            .flatten()
            .filter(|m| m.variance.is_some())
            .peekable();
        if fusable.peek().is_none() || !fusable.all(|m| m.fuse(&mut covariance, &mut a)) {
            return false;
        }
        if !a.norm_squared().is_finite() {
            return false;
        }
        // (26)
        let corrected = self.state.attitude * so3::from_gibbs(&a);
        self.state.attitude = rotation::renormalize(&corrected);
        undrown_attitude(&mut covariance);
        // (27), without re-centring, as printed.
        self.state.covariance = covariance;
        true
    }

    fn update(&mut self, measurement: LinearMeasurement<T>) -> Innovation<T> {
        let fused = self.fuse([Some(&measurement), None]);
        measurement.conclude(fused)
    }

    fn cap(&mut self) {
        let limit = self.config.maximum_attitude_std * self.config.maximum_attitude_std;
        cap_attitude(&mut self.state.covariance, limit);
    }
}

restorable!(Mekf3<T>, state: Mekf3State<T>);

impl<T: Scalar> AttitudeEstimator<T> for Mekf3<T> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() {
            return;
        }
        self.state.attitude = initial.attitude;
        self.state.gyroscope_bias = initial.gyroscope_bias;
        self.state.covariance = initial.attitude_covariance;
        self.state.sensors.start(&initial.references);
    }

    #[inline]
    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        let rate = match checked_rate(angular_rate, &self.state.gyroscope_bias, dt) {
            Ok(Some(rate)) => rate,
            Ok(None) => return Propagation::Done,
            Err(reason) => return Propagation::Skipped(reason),
        };
        // (20) in closed form
        let turned = self.state.attitude * so3::exp(&(rate * dt));
        self.state.attitude = rotation::renormalize(&turned);
        // (21) in closed form
        let phi = propagation::attitude_transition(&rate, dt);
        let q = self.config.angle_noise_psd(&rate) * dt;
        let mut p = phi * self.state.covariance * phi.transpose();
        for i in 0..3 {
            p[(i, i)] += q;
        }
        symmetrize(&mut p);
        undrown_attitude(&mut p);
        self.state.covariance = p;
        self.cap();
        self.state.sensors.advance(dt);
        Propagation::Done
    }

    #[inline]
    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        let Mekf3State {
            attitude,
            covariance,
            sensors,
            ..
        } = &mut self.state;
        let m = sensors.accelerometer(attitude, covariance, specific_force);
        self.update(m)
    }

    #[inline]
    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        let Mekf3State {
            attitude,
            covariance,
            sensors,
            ..
        } = &mut self.state;
        let m = sensors.magnetometer(attitude, covariance, magnetic_field);
        self.update(m)
    }

    #[inline]
    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        let Mekf3State {
            attitude,
            covariance,
            sensors,
            ..
        } = &mut self.state;
        let m = sensors.compass(attitude, covariance, heading);
        self.update(m)
    }

    fn add_attitude_variance(&mut self, variance: T) {
        if variance > T::zero() && variance.is_finite() {
            for i in 0..3 {
                self.state.covariance[(i, i)] += variance;
            }
            self.cap();
        }
    }

    fn attitude(&self) -> UnitQuaternion<T> {
        self.state.attitude
    }

    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        Some(self.state.covariance)
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        None
    }

    fn start_uncertainty(&self) -> StartUncertainty<T> {
        StartUncertainty::of(&self.config)
    }

    fn rate_at_rest(&self) -> Vector3<T> {
        self.state.gyroscope_bias
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::{InitialState, References};
    use approx::assert_relative_eq;

    fn filter() -> Mekf3<f64> {
        let mut filter = Mekf3::new(AttitudeConfig::lab()).unwrap();
        filter.initialize(&InitialState {
            attitude: UnitQuaternion::identity(),
            attitude_covariance: Matrix3::identity() * 0.01,
            gyroscope_bias: Vector3::zeros(),
            gyroscope_bias_std: 0.0,
            north_known: false,
            references: References {
                specific_force: Vector3::new(0.0, 0.0, 9.81),
                magnetic_field: Some(Vector3::new(0.0, 22.0, -42.0)),
            },
        });
        filter
    }

    /// The joint update written with the paper's matrices, as the oracle of the scalar form.
    #[test]
    fn joint_update_is_the_paper_s_stacked_form() {
        let mut filter = filter();
        let p = filter.state.covariance;
        let (f, m) = (Vector3::new(0.2, -0.3, 9.7), Vector3::new(1.0, 22.5, -41.0));
        let (g, b) = (Vector3::new(0.0, 0.0, 9.81), Vector3::new(0.0, 22.0, -42.0));
        let mut h = nalgebra::SMatrix::<f64, 6, 3>::zeros();
        h.fixed_rows_mut::<3>(0).copy_from(&so3::skew(&g));
        h.fixed_rows_mut::<3>(3).copy_from(&so3::skew(&b));
        let mut dz = nalgebra::SVector::<f64, 6>::zeros();
        dz.fixed_rows_mut::<3>(0).copy_from(&(f - g));
        dz.fixed_rows_mut::<3>(3).copy_from(&(m - b));
        let r = nalgebra::SMatrix::<f64, 6, 6>::from_diagonal(&nalgebra::SVector::from([
            0.0025, 0.0025, 0.0025, 0.25, 0.25, 0.25,
        ]));
        let k = p * h.transpose() * (h * p * h.transpose() + r).try_inverse().unwrap();
        let expected_p = p - k * h * p;
        let expected_q = so3::from_gibbs(&(k * dz));

        let [acc, mag] = filter.update_joint(Some(&f), Some(&m));
        assert!(acc.unwrap().outcome.is_fused() && mag.unwrap().outcome.is_fused());
        assert_relative_eq!(filter.state.covariance, expected_p, epsilon = 1e-14);
        assert!(rotation::angle_between(&filter.attitude(), &expected_q) < 1e-9);
    }

    #[test]
    fn paper_literal_adds_a_hundred_times_the_noise_at_100_hz() {
        let growth = |process_noise| {
            let config = AttitudeConfig {
                process_noise,
                ..AttitudeConfig::lab()
            };
            let mut filter = Mekf3::<f64>::new(config).unwrap();
            filter.state.covariance = Matrix3::identity() * 1e-6;
            assert_eq!(filter.propagate(&Vector3::x(), 0.01), Propagation::Done);
            filter.state.covariance[(0, 0)] - 1e-6
        };
        use crate::attitude::ProcessNoise::{Discrete, PaperLiteral};
        assert_relative_eq!(
            growth(PaperLiteral) / growth(Discrete),
            100.0,
            epsilon = 1e-3
        );
    }
}
