//! Multiplicative extended Kalman filter with gyroscope bias: six error states.
//!
//! Read first: Markley, *Attitude error representations for Kalman filtering* (2003); Utrera &
//! Vazquez (2021), eqs 18-27; `docs/derivations/mekf.md`, whose equation numbers (M..) stand at
//! the lines below.
//!
//! Use it when there is a gyroscope and any of accelerometer and magnetometer, and the estimate
//! has to say how sure it is. Do not use it without a gyroscope.
//!
//! # Model
//!
//! `q_true = q * dq(a)`, local error in body axes (M4); `b_true = b + db`; `w_measured = w + b +
//! noise`. Error state `x = [a, db]`.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `q` | `state.attitude` (`ref_from_body`) | - |
//! | `b` | `state.gyroscope_bias` | rad/s |
//! | `P` | `state.covariance` | rad^2, rad^2/s, (rad/s)^2 |
//! | `v` | predicted vector `q^-1 ref` | as sensor |
//! | `H = [[v]x 0]` | rows of `so3::skew(v)` | |
//!
//! Cost: one step with two vector sensors is about 900 multiplications. Limits: errors above half
//! a radian converge, but not optimally (start from alignment instead).

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};

use super::config::AttitudeConfig;
use super::measurement::{LinearMeasurement, VectorSensors};
use super::propagation::{checked_rate, is_possible_bias};
use super::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty, propagation,
};
use crate::faults::bias_step::Resumed;
use crate::geometry::{rotation, so3};
use crate::kalman::Innovation;
use crate::kalman::covariance::{cap_attitude, part, undrown_attitude};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, covariance, finite, restorable, unit};
use crate::scalar::Scalar;

/// Everything the filter remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MekfState<T: Scalar> {
    /// `ref_from_body`.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub attitude: UnitQuaternion<T>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<T>,
    /// Covariance of `[attitude error (rad, body axes), bias error (rad/s)]`.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix6<T>,
    /// References, gates and histories of accelerometer and magnetometer.
    pub sensors: VectorSensors<T>,
}

impl<T: Scalar> MekfState<T> {
    fn check(&self) -> Result<(), InvalidState> {
        unit("attitude", &self.attitude)?;
        finite("gyroscope bias", &self.gyroscope_bias)?;
        covariance("covariance", &self.covariance)?;
        self.sensors.check()
    }
}

/// The filter. Stamped samples are best given to it by an [`AttitudeDriver`](super::AttitudeDriver), which also starts it.
///
/// ```
/// use northing_core::attitude::{AttitudeConfig, AttitudeEstimator as _, InitialState, Mekf, References};
/// use northing_core::nalgebra::{Matrix3, UnitQuaternion, Vector3};
///
/// let mut filter = Mekf::<f64>::new(AttitudeConfig::lab())?;
/// filter.initialize(&InitialState {
///     attitude: UnitQuaternion::identity(),
///     attitude_covariance: Matrix3::identity() * 0.01, // rad^2
///     gyroscope_bias: Vector3::zeros(),
///     gyroscope_bias_std: 1e-3,
///     north_known: true,
///     references: References { specific_force: Vector3::z() * 9.81, magnetic_field: None },
/// });
/// for _ in 0..100 {
///     filter.propagate(&Vector3::new(0.0, 0.0, 0.1), 0.01); // rad/s, s
///     let innovation = filter.update_accelerometer(&Vector3::new(0.0, 0.0, 9.81)); // m/s^2
///     assert!(innovation.outcome.is_fused() && innovation.nis < 1.0);
/// }
/// assert!((filter.attitude().angle() - 0.1).abs() < 1e-6);
/// // Gravity says nothing of the heading: only roll and pitch have become sharper.
/// let std = filter.attitude_covariance().unwrap().diagonal().map(f64::sqrt);
/// assert!(std.x < 0.02 && std.z > std.x);
/// # Ok::<(), northing_core::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mekf<T: Scalar> {
    config: AttitudeConfig<T>,
    state: MekfState<T>,
}

impl<T: Scalar> Mekf<T> {
    /// A filter at the identity attitude without references: it integrates until
    /// [`AttitudeEstimator::initialize`] gives it a start.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(config: AttitudeConfig<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        let variance = config.maximum_attitude_std * config.maximum_attitude_std;
        let bias_variance = config.initial_gyroscope_bias_std * config.initial_gyroscope_bias_std;
        let mut covariance = Matrix6::zeros();
        for i in 0..3 {
            covariance[(i, i)] = variance;
            covariance[(i + 3, i + 3)] = bias_variance;
        }
        let state = MekfState {
            attitude: UnitQuaternion::identity(),
            gyroscope_bias: Vector3::zeros(),
            covariance,
            sensors: VectorSensors::new(&config),
        };
        Ok(Self { config, state })
    }

    /// The settings.
    pub fn config(&self) -> &AttitudeConfig<T> {
        &self.config
    }

    /// The state, to look at.
    pub fn state(&self) -> &MekfState<T> {
        &self.state
    }

    /// The error-state transition over `dt` from the present state: what a smoother needs.
    pub fn transition(&self, angular_rate: &Vector3<T>, dt: T) -> Matrix6<T> {
        propagation::transition(&(angular_rate - self.state.gyroscope_bias), dt)
    }

    /// Fuses one linearised measurement (M12), injects the correction (M13) and re-centres the
    /// covariance at the corrected attitude (M14).
    #[inline]
    fn update(&mut self, measurement: &LinearMeasurement<T>) -> Innovation<T> {
        if measurement.variance.is_none() {
            return measurement.innovation;
        }
        let before = self.state.covariance;
        let mut correction = Vector6::zeros();
        if !measurement.fuse(&mut self.state.covariance, &mut correction) {
            self.state.covariance = before;
            return measurement.conclude(false);
        }
        let a: Vector3<T> = part(&correction, 0, 0);
        let bias = self.state.gyroscope_bias + correction.fixed_rows::<3>(3);
        if !(a.norm_squared().is_finite() && is_possible_bias(&bias)) {
            self.state.covariance = before;
            return measurement.conclude(false);
        }
        let corrected = self.state.attitude * so3::from_gibbs(&a);
        self.state.attitude = rotation::renormalize(&corrected);
        self.state.gyroscope_bias = bias;
        reset(&mut self.state.covariance, &a);
        undrown_attitude(&mut self.state.covariance);
        measurement.innovation
    }
}

/// The attitude block of the covariance.
#[inline]
fn attitude_block<T: Scalar>(p: &Matrix6<T>) -> Matrix3<T> {
    part(p, 0, 0)
}

/// `P <- G P G^T` with `G = blockdiag(gibbs_reset_jacobian(a), I)`, in place.
#[inline]
fn reset<T: Scalar>(p: &mut Matrix6<T>, a: &Vector3<T>) {
    let g = so3::gibbs_reset_jacobian(a);
    let p11 = attitude_block(p);
    let p12: Matrix3<T> = part(p, 0, 3);
    let left = g * p11;
    let cross = g * p12;
    for j in 0..3 {
        for i in 0..=j {
            let mut value = T::zero();
            for k in 0..3 {
                value += left[(i, k)] * g[(j, k)];
            }
            p[(i, j)] = value;
            p[(j, i)] = value;
        }
        for i in 0..3 {
            p[(i, j + 3)] = cross[(i, j)];
            p[(j + 3, i)] = cross[(i, j)];
        }
    }
}

restorable!(Mekf<T>, state: MekfState<T>);

impl<T: Scalar> AttitudeEstimator<T> for Mekf<T> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() {
            return;
        }
        let state = &mut self.state;
        state.attitude = initial.attitude;
        state.gyroscope_bias = initial.gyroscope_bias;
        state.covariance = Matrix6::zeros();
        state
            .covariance
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&initial.attitude_covariance);
        let bias_variance = initial.gyroscope_bias_std * initial.gyroscope_bias_std;
        for i in 3..6 {
            state.covariance[(i, i)] = bias_variance;
        }
        state.sensors.start(&initial.references);
    }

    fn resume(&mut self, initial: &InitialState<T>, resumed: &Resumed<T>) {
        if !initial.is_usable() {
            return;
        }
        self.initialize(initial);
        let (p, cross) = (&mut self.state.covariance, resumed.cross_covariance());
        p.fixed_view_mut::<3, 3>(0, 3).copy_from(&cross);
        p.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross.transpose());
        p.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&resumed.bias_covariance);
    }

    #[inline]
    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        let rate = match checked_rate(angular_rate, &self.state.gyroscope_bias, dt) {
            Ok(Some(rate)) => rate,
            Ok(None) => return Propagation::Done,
            Err(reason) => return Propagation::Skipped(reason),
        };
        // (M6) closed form of the kinematics, (M7, M8) of the covariance.
        let turned = self.state.attitude * so3::exp(&(rate * dt));
        self.state.attitude = rotation::renormalize(&turned);
        let psd = self.config.angle_noise_psd(&rate);
        let p = &mut self.state.covariance;
        propagation::propagate_covariance(p, &rate, dt, psd, self.config.bias_walk_psd());
        let limit = self.config.maximum_attitude_std * self.config.maximum_attitude_std;
        cap_attitude(p, limit);
        undrown_attitude(p);
        self.state.sensors.advance(dt);
        Propagation::Done
    }

    #[inline]
    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        let p = attitude_block(&self.state.covariance);
        let m = self
            .state
            .sensors
            .accelerometer(&self.state.attitude, &p, specific_force);
        self.update(&m)
    }

    #[inline]
    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        let p = attitude_block(&self.state.covariance);
        let m = self
            .state
            .sensors
            .magnetometer(&self.state.attitude, &p, magnetic_field);
        self.update(&m)
    }

    #[inline]
    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        let p = attitude_block(&self.state.covariance);
        let m = self
            .state
            .sensors
            .compass(&self.state.attitude, &p, heading);
        self.update(&m)
    }

    fn add_attitude_variance(&mut self, variance: T) {
        if !(variance > T::zero() && variance.is_finite()) {
            return;
        }
        let limit = self.config.maximum_attitude_std * self.config.maximum_attitude_std;
        for i in 0..3 {
            self.state.covariance[(i, i)] += variance;
        }
        cap_attitude(&mut self.state.covariance, limit);
    }

    fn attitude(&self) -> UnitQuaternion<T> {
        self.state.attitude
    }

    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        Some(attitude_block(&self.state.covariance))
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        let p = part(&self.state.covariance, 3, 3);
        Some((self.state.gyroscope_bias, p))
    }

    fn start_uncertainty(&self) -> StartUncertainty<T> {
        StartUncertainty::of(&self.config)
    }

    fn rate_at_rest(&self) -> Vector3<T> {
        self.state.gyroscope_bias
    }
}

#[cfg(test)]
mod tests;
