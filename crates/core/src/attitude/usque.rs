//! USQUE: the unscented quaternion estimator, attitude and gyroscope bias from sigma points.
//!
//! Read first: Crassidis & Markley, *Unscented filtering for spacecraft attitude estimation*
//! (2003); `docs/derivations/mekf.md`, section on the two relatives (M23, M23b, M23c).
//!
//! Use it where the start is poor, or to check the linearisation of [`super::mekf::Mekf`]: in
//! steady state it is the same filter at several times the cost. Simulated, RMS over 0.5 to 5 s
//! from a start off by `s` rad per axis (60 runs, no gates, median / 90 %, degrees):
//!
//! | `s` | MEKF | USQUE | USQUE as published |
//! |---|---|---|---|
//! | 0.5 | 0.26 / 1.3 | 0.14 / 0.21 | 0.14 / 0.30 |
//! | 1.0 | 1.7 / 13 | 0.18 / 3.7 | 0.22 / 13 |
//! | 1.7 | 6.3 / 22 | 2.1 / 22 | 13 / 52 |
//!
//! The difference to the published filter is the re-centring of the covariance at the corrected
//! attitude, which it leaves out. Without it the heading variance under gravity alone grows a
//! fifth too slowly as well. Better than any of them is a start from [`super::alignment`].
//!
//! # Model
//!
//! State and error are those of the MEKF: `q_true = q * dq(p)`, `b_true = b + db`, with `p` the
//! generalised Rodrigues parameters of `a = 1`, `f = 4` (four times the tangent of a quarter of
//! the angle: a rotation vector for small errors, singular only at a full turn).
//!
//! ```text
//! p = 4 v / (1 + w),   w = (16 - p^2)/(16 + p^2), v = 8 p/(16 + p^2)                (M23, M23b)
//! points 0, +-sqrt(6 + lambda) columns of chol(P + Qbar), lambda = 1
//! weights lambda/(6 + lambda) = 1/7 for the centre, 1/(2 (6 + lambda)) = 1/14 for the others
//! Qbar = dt/2 diag((v - u dt^2/6) I, u I), added before and after                      (M23c)
//! y_i = dq_i^-1 q^-1 ref;  K = Pxy S^-1,  x = K nu,  P <- G (P - K S K^T) G^T
//! G = ((1 - s^2) I - 2 [s]x + 2 s s^T)/(1 + s^2)^2,  s = x_p/4          re-centring
//! ```
//!
//! A propagation draws points, moves each with its own bias, and takes mean and covariance about
//! the moved centre; an update draws new points from the present covariance, so that sensors may
//! come in any order and at any rate. The factor is lower triangular with the attitude first: the
//! last three pairs of points differ from the centre in bias only and predict the same vector, so
//! an update turns seven vectors and not thirteen.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `q` | `state.attitude` (`ref_from_body`) | - |
//! | `b` | `state.gyroscope_bias` | rad/s |
//! | `P` | `state.covariance` of `[p, db]` | rad^2, rad^2/s, (rad/s)^2 |
//! | `v`, `u` | power of gyroscope noise and bias walk | (rad/s)^2/Hz, (rad/s)^2/s |
//!
//! Cost: one step with two vector sensors is about 3000 multiplications and 30 square roots.
//! Limits: needs a positive definite covariance; where rounding has taken that away it is mended,
//! and reset to its diagonal if that fails ([`UsqueState::covariance_resets`]).

use nalgebra::{Matrix3, Matrix6, SMatrix, UnitQuaternion, Vector3, Vector6};

use super::config::{AttitudeConfig, MagnetometerUse};
use super::measurement::{LinearMeasurement, VectorSensors};
use super::propagation::{checked_rate, is_possible_bias};
use super::vector_sensor::VectorSensor;
use super::{AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty};
use crate::geometry::{rotation, so3};
use crate::kalman::covariance::{
    cap_attitude, cholesky, is_resolved, mirror_upper, part, resolvable_variance, rounding_reserve,
};
use crate::kalman::innovation::Outcome;
use crate::kalman::scalar_update::update_leading3;
use crate::kalman::{Innovation, SkipReason};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, covariance, finite, restorable, unit};
use crate::scalar::{Scalar, lit};

mod rodrigues;

use rodrigues::{from_rodrigues, reset_jacobian, to_rodrigues};

/// `6 + lambda`: the spread of the sigma points, squared.
const SPREAD: f64 = 7.0;
/// Weight of each point but the centre.
const WEIGHT: f64 = 0.5 / SPREAD;
/// What a variance of zero counts as, rad^2 and rad^2/s^2: a factor needs some.
const LEAST_VARIANCE: f64 = 1e-24;
/// Weight of the centre.
const CENTRE: f64 = 1.0 / SPREAD;

/// Everything the filter remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UsqueState<T: Scalar> {
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
    /// How often the covariance had lost its positivity and was reset to its diagonal.
    pub covariance_resets: u32,
}

impl<T: Scalar> UsqueState<T> {
    fn check(&self) -> Result<(), InvalidState> {
        unit("attitude", &self.attitude)?;
        finite("gyroscope bias", &self.gyroscope_bias)?;
        covariance("covariance", &self.covariance)?;
        self.sensors.check()
    }
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Usque<T: Scalar> {
    config: AttitudeConfig<T>,
    state: UsqueState<T>,
}

/// What the sigma points predict of a vector.
struct Predicted<T: Scalar> {
    mean: Vector3<T>,
    covariance: Matrix3<T>,
    /// Covariance of state and prediction.
    cross: SMatrix<T, 6, 3>,
}

impl<T: Scalar> Usque<T> {
    /// A filter at the identity attitude without references: it integrates until
    /// [`AttitudeEstimator::initialize`] gives it a start.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(config: AttitudeConfig<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        let state = UsqueState {
            attitude: UnitQuaternion::identity(),
            gyroscope_bias: Vector3::zeros(),
            covariance: Matrix6::from_diagonal(&largest_variances(&config)),
            sensors: VectorSensors::new(&config),
            covariance_resets: 0,
        };
        Ok(Self { config, state })
    }

    /// The settings.
    pub fn config(&self) -> &AttitudeConfig<T> {
        &self.config
    }

    /// The state, to look at.
    pub fn state(&self) -> &UsqueState<T> {
        &self.state
    }

    /// The factor of the covariance plus `added` on its diagonal, times `sqrt(6 + lambda)`.
    ///
    /// Where there is none, the diagonal grows by rounding's share, and by next to nothing where a
    /// state is known exactly; where that does not help, the covariance is reset to its capped
    /// diagonal.
    fn sigma_columns(&mut self, added: &Vector6<T>) -> Matrix6<T> {
        let spread = lit::<T>(SPREAD).sqrt();
        let mut p = self.state.covariance;
        for i in 0..6 {
            p[(i, i)] += added[i];
        }
        if let Some(l) = cholesky(&p) {
            return l * spread;
        }
        let share = lit::<T>(1e-12).max(T::default_epsilon() * lit(4.0));
        for block in [0, 3] {
            let largest = p[(block, block)]
                .max(p[(block + 1, block + 1)])
                .max(p[(block + 2, block + 2)]);
            for i in block..block + 3 {
                p[(i, i)] += share * largest + lit(LEAST_VARIANCE);
            }
        }
        if let Some(l) = cholesky(&p) {
            return l * spread;
        }
        self.reset_covariance();
        let least = Vector6::from_element(lit(LEAST_VARIANCE));
        let diagonal = self.state.covariance.diagonal() + added + least;
        Matrix6::from_diagonal(&diagonal.map(|v| v.sqrt() * spread))
    }

    /// Keeps what is usable of the variances and forgets the correlations.
    fn reset_covariance(&mut self) {
        let mut variances = largest_variances(&self.config);
        for (limit, own) in variances
            .iter_mut()
            .zip(self.state.covariance.diagonal().iter())
        {
            if *own > T::zero() && *own < *limit {
                *limit = *own;
            }
        }
        self.state.covariance = Matrix6::from_diagonal(&variances);
        self.state.covariance_resets = self.state.covariance_resets.saturating_add(1);
    }

    /// Moves the points over one interval: mean and covariance about the moved centre.
    fn moved_points(
        &self,
        columns: &Matrix6<T>,
        rate: &Vector3<T>,
        dt: T,
    ) -> (Vector6<T>, Matrix6<T>) {
        let back = so3::exp(&(rate * -dt));
        let mut points = [Vector6::zeros(); 12];
        for (k, point) in points.iter_mut().enumerate() {
            let sign = if k < 6 { T::one() } else { -T::one() };
            let x = columns.column(k % 6) * sign;
            let p: Vector3<T> = x.fixed_rows::<3>(0).into_owned();
            let db: Vector3<T> = x.fixed_rows::<3>(3).into_owned();
            let moved = back * from_rodrigues(&p) * so3::exp(&((rate - db) * dt));
            point
                .fixed_rows_mut::<3>(0)
                .copy_from(&to_rodrigues(&moved));
            point.fixed_rows_mut::<3>(3).copy_from(&db);
        }
        let weight = lit::<T>(WEIGHT);
        let mean = points.iter().fold(Vector6::zeros(), |sum, x| sum + x) * weight;
        let mut covariance = mean * mean.transpose() * lit::<T>(CENTRE);
        for point in &points {
            let d = point - mean;
            covariance += d * d.transpose() * weight;
        }
        mirror_upper(&mut covariance);
        (mean, covariance)
    }

    /// The vector that the points predict for a reference (M3b through each of them).
    fn predict(&mut self, reference: &Vector3<T>) -> Predicted<T> {
        let columns = self.sigma_columns(&Vector6::zeros());
        let centre = self.state.attitude.inverse() * reference;
        let weight = lit::<T>(WEIGHT);
        let mut pairs = [[Vector3::zeros(); 2]; 3];
        let mut mean = centre * lit::<T>(CENTRE + 6.0 * WEIGHT);
        let mut cross = SMatrix::<T, 6, 3>::zeros();
        for (j, pair) in pairs.iter_mut().enumerate() {
            let column = columns.column(j).into_owned();
            let turn = from_rodrigues(&column.fixed_rows::<3>(0).into_owned());
            *pair = [turn.inverse() * centre, turn * centre];
            let [plus, minus] = *pair;
            mean += (plus + minus) * weight;
            cross += column * (plus - minus).transpose() * weight;
        }
        let d = centre - mean;
        let mut covariance = d * d.transpose() * lit::<T>(CENTRE + 6.0 * WEIGHT);
        for y in pairs.iter().flatten() {
            let d = y - mean;
            covariance += d * d.transpose() * weight;
        }
        Predicted {
            mean,
            covariance,
            cross,
        }
    }

    /// Updates with all three components of a vector; `sensor` says which one it is.
    fn update_vector(
        &mut self,
        measured: &Vector3<T>,
        sensor: fn(&mut VectorSensors<T>) -> &mut VectorSensor<T>,
    ) -> Innovation<T> {
        let reference = match sensor(&mut self.state.sensors).reference_for(measured) {
            Ok(reference) => reference,
            Err(reason) => return Innovation::skipped(reason),
        };
        let predicted = self.predict(&reference);
        let sensor = sensor(&mut self.state.sensors);
        let sample_variance = sensor.sample_variance(measured);
        let weighed = sensor.weigh(
            measured - predicted.mean,
            &predicted.covariance,
            sample_variance,
        );
        let mut innovation = weighed.innovation;
        if let Some(variance) = weighed.variance
            && !self.correct(&predicted, &innovation.residual, variance)
        {
            innovation.outcome = Outcome::Skipped(SkipReason::Numerical);
        }
        innovation
    }

    /// `K = Pxy S^-1`, `x = K nu`, `P <- P - K S K^T`, through the factor of `S`.
    fn correct(&mut self, predicted: &Predicted<T>, residual: &Vector3<T>, variance: T) -> bool {
        let spread = predicted.covariance.diagonal().max();
        let Some(variance) = resolvable_variance(variance, spread) else {
            return false;
        };
        let s = predicted.covariance + Matrix3::from_diagonal_element(variance);
        let Some(l) = cholesky(&s) else {
            return false;
        };
        let half_gain = l.solve_lower_triangular(&predicted.cross.transpose());
        let (Some(half_gain), Some(whitened)) = (half_gain, l.solve_lower_triangular(residual))
        else {
            return false;
        };
        let mut covariance = self.state.covariance - half_gain.transpose() * half_gain;
        for (i, column) in half_gain.column_iter().enumerate() {
            covariance[(i, i)] += rounding_reserve(column.norm_squared());
        }
        mirror_upper(&mut covariance);
        self.inject(&(half_gain.transpose() * whitened), covariance)
    }

    /// Takes over a correction and its covariance, unless something in them is not finite.
    fn inject(&mut self, correction: &Vector6<T>, covariance: Matrix6<T>) -> bool {
        let bias = self.state.gyroscope_bias + correction.fixed_rows::<3>(3);
        let finite = correction.norm_squared().is_finite() && covariance.norm_squared().is_finite();
        if !(finite && is_possible_bias(&bias)) {
            return false;
        }
        let p: Vector3<T> = correction.fixed_rows::<3>(0).into_owned();
        let corrected = self.state.attitude * from_rodrigues(&p);
        self.state.attitude = rotation::renormalize(&corrected);
        self.state.gyroscope_bias = bias;
        self.state.covariance = recentred(&covariance, &p);
        if !is_resolved(&self.state.covariance) {
            self.reset_covariance();
        }
        true
    }

    /// A heading is one linear number: a Kalman update as in the MEKF.
    fn update_scalar(&mut self, measurement: &LinearMeasurement<T>) -> Innovation<T> {
        let (mut covariance, mut correction) = (self.state.covariance, Vector6::zeros());
        let fused = measurement.variance.is_some()
            && measurement
                .scalars()
                .all(|(h, z, r)| update_leading3(&mut covariance, &mut correction, h, z, r))
            && self.inject(&correction, covariance);
        measurement.conclude(fused)
    }

    fn cap_attitude(&mut self) {
        let limit = self.config.maximum_attitude_std * self.config.maximum_attitude_std;
        cap_attitude(&mut self.state.covariance, limit);
    }
}

/// The largest variances that make sense: attitude at its cap, bias as at the start.
fn largest_variances<T: Scalar>(config: &AttitudeConfig<T>) -> Vector6<T> {
    let attitude = config.maximum_attitude_std * config.maximum_attitude_std;
    let bias = config.initial_gyroscope_bias_std * config.initial_gyroscope_bias_std;
    Vector6::new(attitude, attitude, attitude, bias, bias, bias)
}

/// The attitude block of the covariance.
fn attitude_block<T: Scalar>(p: &Matrix6<T>) -> Matrix3<T> {
    part(p, 0, 0)
}

/// `P <- G P G^T` with `G = blockdiag(reset_jacobian(p), I)`.
fn recentred<T: Scalar>(covariance: &Matrix6<T>, p: &Vector3<T>) -> Matrix6<T> {
    let g = reset_jacobian(p);
    let cross: Matrix3<T> = g * covariance.fixed_view::<3, 3>(0, 3);
    let mut result = *covariance;
    let block = g * attitude_block(covariance) * g.transpose();
    result.fixed_view_mut::<3, 3>(0, 0).copy_from(&block);
    result.fixed_view_mut::<3, 3>(0, 3).copy_from(&cross);
    mirror_upper(&mut result);
    result
}

restorable!(Usque<T>, state: UsqueState<T>);

impl<T: Scalar> AttitudeEstimator<T> for Usque<T> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() {
            return;
        }
        let bias_variance = initial.gyroscope_bias_std * initial.gyroscope_bias_std;
        let state = &mut self.state;
        state.attitude = initial.attitude;
        state.gyroscope_bias = initial.gyroscope_bias;
        state.covariance = Matrix6::from_diagonal_element(bias_variance);
        let mut block = state.covariance.fixed_view_mut::<3, 3>(0, 0);
        block.copy_from(&initial.attitude_covariance);
        state.sensors.start(&initial.references);
        state.covariance_resets = 0;
    }

    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        let rate = match checked_rate(angular_rate, &self.state.gyroscope_bias, dt) {
            Ok(Some(rate)) => rate,
            Ok(None) => return Propagation::Done,
            Err(reason) => return Propagation::Skipped(reason),
        };
        let (v, u) = (
            self.config.angle_noise_psd(&rate),
            self.config.bias_walk_psd(),
        );
        // (M23c)
        let angle = (v - u * dt * dt * lit(1.0 / 6.0)).max(T::zero()) * dt * lit(0.5);
        let walk = u * dt * lit(0.5);
        let half_noise = Vector6::new(angle, angle, angle, walk, walk, walk);

        let columns = self.sigma_columns(&half_noise);
        let (mean, mut covariance) = self.moved_points(&columns, &rate, dt);
        for i in 0..6 {
            covariance[(i, i)] += half_noise[i];
        }
        self.state.attitude = rotation::turned(&self.state.attitude, &(rate * dt));
        if !self.inject(&mean, covariance) {
            self.reset_covariance();
        }
        self.cap_attitude();
        self.state.sensors.advance(dt);
        Propagation::Done
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        self.update_vector(specific_force, |sensors| &mut sensors.accelerometer)
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        match self.config.magnetometer_use {
            MagnetometerUse::Vector => {
                self.update_vector(magnetic_field, |sensors| &mut sensors.magnetometer)
            }
            MagnetometerUse::Heading => {
                let p = attitude_block(&self.state.covariance);
                let state = &mut self.state;
                let m = state
                    .sensors
                    .magnetometer(&state.attitude, &p, magnetic_field);
                self.update_scalar(&m)
            }
        }
    }

    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        let p = attitude_block(&self.state.covariance);
        let state = &mut self.state;
        let m = state.sensors.compass(&state.attitude, &p, heading);
        self.update_scalar(&m)
    }

    fn add_attitude_variance(&mut self, variance: T) {
        if variance > T::zero() && variance.is_finite() {
            for i in 0..3 {
                self.state.covariance[(i, i)] += variance;
            }
            self.cap_attitude();
        }
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
