//! Additive quaternion EKF: the four components of the quaternion as states, and gyroscope bias.
//!
//! Read first: Bar-Itzhack & Oshman (1985) for the filter, Markley (2003) for why one does not
//! choose it; `docs/derivations/mekf.md`, section on the two relatives (M24, M24b).
//!
//! Use it to compare, or to teach: it is the extended Kalman filter of the textbook, with the
//! quaternion treated as four numbers. Elsewhere use [`super::mekf::Mekf`]: with the exact
//! transition and the projection below the two are the same filter to rounding, at any error, since
//! adding `Xi a / 2` and normalising *is* the multiplication with the Gibbs-vector quaternion of
//! `a`, and `J` is the MEKF's re-centring. The MEKF is smaller, faster and never singular.
//!
//! # Model
//!
//! `q_true = q + dq`, `b_true = b + db`, state error `x = [dq (w, x, y, z), db]`; a unit
//! quaternion has `q . dq = 0`, so `dq = Xi(q) a / 2` with `a` the local error of the MEKF.
//!
//! ```text
//! q <- q * Exp(r) = F_q q,   r = (w - b) dt,   F_q = cos(|r|/2) I + sin(|r|/2)/|r| Omega(r)  (M24)
//! F_qb = -dt/2 Xi(q*Exp(r)) Jr(r)      exact; -dt/2 Xi(q) of the literature is its first order
//! Q_qq = 1/4 q11 Xi Xi^T, Q_qb = 1/2 q12 Xi, Q_bb = q22 I       q11, q12, q22: Farrenkopf
//! H = d C(q) ref / dq, C(q) = R(q)^T as a homogeneous quadratic in q
//! q <- q / |q|,   P <- J P J^T,   J = (I - q q^T)/|q|                                     (M24b)
//! P_a = 4 Xi^T P_qq Xi       the attitude covariance reported
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `q` | `state.attitude` (`ref_from_body`) | - |
//! | `b` | `state.gyroscope_bias` | rad/s |
//! | `P` | `state.covariance`, order w, x, y, z, bias | 1, rad/s, (rad/s)^2 |
//! | `Xi(q) r = q * (0, r)` | [`xi`] | - |
//!
//! Gates and the heading-only magnetometer are those of the MEKF: `P` has no part along `q`, so
//! `H P H^T` equals that of the local error.
//!
//! [`QuaternionNorm::Free`] leaves the projection out, as textbooks and Iporre & Améstegui do: each
//! scalar is linearised anew, the sum is normalised at the end, and `P` keeps a part along `q`. That
//! part swallows errors in a vector's length; while it lasts, a wrong field turns the attitude more.
//!
//! Cost: one step with two vector sensors is about 2500 multiplications. Limits: `P` is singular
//! along `q`; never invert it.

use nalgebra::{Matrix3, Matrix3x4, Matrix4, Matrix4x3, Matrix6, SMatrix, SVector};
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4, Vector6};

use super::config::{AttitudeConfig, QuaternionNorm};
use super::measurement::{LinearMeasurement, VectorSensors};
use super::propagation::{checked_rate, is_possible_bias};
use super::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty, propagation,
};
use crate::geometry::so3;
use crate::kalman::Innovation;
use crate::kalman::covariance::{
    cap_variance, forget_correlations_unless_resolved, is_resolved, part, semidefinite_factor,
    symmetrize, undrown,
};
use crate::kalman::scalar_update::update_full;
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, covariance, finite, restorable, unit};
use crate::scalar::{Scalar, lit};

/// A 7 by 7 matrix on `[w, x, y, z, bias]`.
pub type Matrix7<T> = SMatrix<T, 7, 7>;
type Vector7<T> = SVector<T, 7>;

/// Everything the filter remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct QuaternionEkfState<T: Scalar> {
    /// `ref_from_body`.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub attitude: UnitQuaternion<T>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<T>,
    /// Covariance of `[quaternion error (w, x, y, z), bias error (rad/s)]`; singular along the
    /// quaternion.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix7<T>,
    /// References, gates and histories of accelerometer and magnetometer.
    pub sensors: VectorSensors<T>,
}

impl<T: Scalar> QuaternionEkfState<T> {
    fn check(&self) -> Result<(), InvalidState> {
        unit("attitude", &self.attitude)?;
        finite("gyroscope bias", &self.gyroscope_bias)?;
        finite("covariance", &self.covariance)?;
        // Singular along the quaternion, and rounding there has any sign.
        let reduced = reduce(&self.attitude, &self.covariance);
        covariance("covariance", &reduced)?;
        self.sensors.check()
    }
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuaternionEkf<T: Scalar> {
    config: AttitudeConfig<T>,
    state: QuaternionEkfState<T>,
}

impl<T: Scalar> QuaternionEkf<T> {
    /// A filter at the identity attitude without references: it integrates until
    /// [`AttitudeEstimator::initialize`] gives it a start.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(config: AttitudeConfig<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        let attitude = UnitQuaternion::identity();
        let variance = config.maximum_attitude_std * config.maximum_attitude_std;
        let bias_variance = config.initial_gyroscope_bias_std * config.initial_gyroscope_bias_std;
        let covariance = initial_covariance(
            &attitude,
            &Matrix3::from_diagonal_element(variance),
            bias_variance,
        );
        let state = QuaternionEkfState {
            attitude,
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
    pub fn state(&self) -> &QuaternionEkfState<T> {
        &self.state
    }

    /// Covariance of `[attitude error (rad, body axes), bias error (rad/s)]`: what the other
    /// filters keep, for NEES.
    pub fn error_covariance(&self) -> Matrix6<T> {
        reduce(&self.state.attitude, &self.state.covariance)
    }

    fn attitude_block(&self) -> Matrix3<T> {
        let two_xi = xi(&wxyz(&self.state.attitude)) * lit::<T>(2.0);
        two_xi.transpose() * quaternion_block(&self.state.covariance) * two_xi
    }

    /// Fuses a vector (three rows) through `d C(q) ref / dq`, a heading (one row) through its row
    /// on the local error, `h dq = 2 (Xi row) . dq`.
    fn update(
        &mut self,
        measurement: LinearMeasurement<T>,
        reference: Option<Vector3<T>>,
    ) -> Innovation<T> {
        let q = wxyz(&self.state.attitude);
        let free = self.config.quaternion_norm == QuaternionNorm::Free;
        if let (true, Some(reference), 3) =
            (free, reference, measurement.innovation.degrees_of_freedom)
        {
            return self.update_free(&measurement, &reference);
        }
        let vector_rows = match reference {
            Some(r) if measurement.innovation.degrees_of_freedom == 3 => {
                Some(vector_jacobian(&q, &r))
            }
            _ => None,
        };
        let mut covariance = self.state.covariance;
        let mut correction = Vector7::zeros();
        let mut fused = measurement.variance.is_some();
        for (i, (row, z, r)) in measurement.scalars().enumerate() {
            let on_quaternion: Vector4<T> = match &vector_rows {
                Some(rows) => rows.row(i).transpose(),
                None => xi(&q) * row * lit::<T>(2.0),
            };
            let mut h = Vector7::zeros();
            h.fixed_rows_mut::<4>(0).copy_from(&on_quaternion);
            fused = fused && update_full(&mut covariance, &mut correction, &h, z, r);
        }
        fused = fused && self.inject(&correction, covariance);
        measurement.conclude(fused)
    }

    /// Fuses a vector component by component, each linearised where the last one led.
    fn update_free(
        &mut self,
        measurement: &LinearMeasurement<T>,
        reference: &Vector3<T>,
    ) -> Innovation<T> {
        let start = wxyz(&self.state.attitude);
        let predicted = vector_jacobian(&start, reference) * start * lit::<T>(0.5);
        let mut covariance = self.state.covariance;
        let mut sum = Vector7::zeros();
        let mut fused = measurement.variance.is_some();
        for (i, ((_, z, r), predicted)) in measurement.scalars().zip(&predicted).enumerate() {
            let q = start + sum.fixed_rows::<4>(0);
            let row: Vector4<T> = vector_jacobian(&q, reference).row(i).transpose();
            // The prediction is a homogeneous quadratic: half its gradient times the quaternion.
            let residual = z + *predicted - row.dot(&q) * lit(0.5);
            let mut h = Vector7::zeros();
            h.fixed_rows_mut::<4>(0).copy_from(&row);
            let mut step = Vector7::zeros();
            fused = fused && update_full(&mut covariance, &mut step, &h, residual, r);
            sum += step;
        }
        fused = fused && self.inject(&sum, covariance);
        measurement.conclude(fused)
    }

    /// Adds a correction, normalises the quaternion and projects the covariance (M24b), unless
    /// something in them is not finite.
    fn inject(&mut self, correction: &Vector7<T>, mut covariance: Matrix7<T>) -> bool {
        let sum = wxyz(&self.state.attitude) + correction.fixed_rows::<4>(0);
        let norm = sum.norm();
        let bias = self.state.gyroscope_bias + correction.fixed_rows::<3>(4);
        let finite =
            norm.is_finite() && is_possible_bias(&bias) && covariance.norm_squared().is_finite();
        if !finite || norm < lit(0.1) {
            return false;
        }
        if self.config.quaternion_norm == QuaternionNorm::Projected {
            project(&mut covariance, &sum);
        }
        symmetrize(&mut covariance);
        self.state.attitude = from_wxyz(&(sum / norm));
        self.state.gyroscope_bias = bias;
        self.state.covariance = covariance;
        self.settle();
        true
    }

    /// Keeps the covariance positive semidefinite: its direction without variance, along the quaternion, shows rounding
    /// first. It then goes through the local error and comes back as a product of a factor with itself.
    fn settle(&mut self) {
        let mut p = self.error_covariance();
        if is_resolved(&p) && is_resolved(&self.state.covariance) {
            return;
        }
        // Four components show no variance that is so much smaller than the largest one.
        let drowned = p.diagonal().fixed_rows::<3>(0).amax() * T::default_epsilon() * lit(64.0);
        for i in 0..3 {
            p[(i, i)] += drowned;
        }
        forget_correlations_unless_resolved(&mut p, &largest_variances(&self.config));
        let q = wxyz(&self.state.attitude);
        let along = match self.config.quaternion_norm {
            QuaternionNorm::Projected => T::zero(),
            QuaternionNorm::Free => q.dot(&(quaternion_block(&self.state.covariance) * q)),
        };
        let mut rows = Matrix7::zeros();
        rows.fixed_columns_mut::<6>(0)
            .copy_from(&lifted_factor(&self.state.attitude, &p));
        let std = along.min(T::one()).max(T::zero()).sqrt();
        rows.fixed_view_mut::<4, 1>(0, 6).copy_from(&(q * std));
        self.state.covariance = rows * rows.transpose();
        symmetrize(&mut self.state.covariance);
    }

    /// Keeps each axis' variance below its limit. The 7 by 7 matrix has no axes to cap, so it goes
    /// through the local error and back; rare, and exact since `P` has nothing along `q`.
    ///
    /// A free norm is not capped: the way through the local error would lose the part along `q`.
    fn cap_attitude(&mut self) {
        if self.config.quaternion_norm == QuaternionNorm::Free {
            return;
        }
        let limit = self.config.maximum_attitude_std * self.config.maximum_attitude_std;
        if self.attitude_block().diagonal().max() <= limit {
            return;
        }
        let mut p = self.error_covariance();
        for i in 0..3 {
            cap_variance(&mut p, i, limit);
        }
        self.state.covariance = lift(&self.state.attitude, &p);
        symmetrize(&mut self.state.covariance);
    }
}

/// The largest variances of attitude error and bias: what is known where nothing is.
fn largest_variances<T: Scalar>(config: &AttitudeConfig<T>) -> Vector6<T> {
    let attitude = config.maximum_attitude_std * config.maximum_attitude_std;
    let bias = config.initial_gyroscope_bias_std * config.initial_gyroscope_bias_std;
    Vector6::new(attitude, attitude, attitude, bias, bias, bias)
}

/// The components in the order w, x, y, z.
fn wxyz<T: Scalar>(q: &UnitQuaternion<T>) -> Vector4<T> {
    Vector4::new(q.w, q.i, q.j, q.k)
}

fn from_wxyz<T: Scalar>(q: &Vector4<T>) -> UnitQuaternion<T> {
    UnitQuaternion::new_unchecked(Quaternion::new(q[0], q[1], q[2], q[3]))
}

fn quaternion_block<T: Scalar>(p: &Matrix7<T>) -> Matrix4<T> {
    part(p, 0, 0)
}

/// `Xi(q) r = q * (0, r)`, with `q` as w, x, y, z.
#[rustfmt::skip]
pub fn xi<T: Scalar>(q: &Vector4<T>) -> Matrix4x3<T> {
    let (w, x, y, z) = (q[0], q[1], q[2], q[3]);
    Matrix4x3::new(
        -x, -y, -z,
         w, -z,  y,
         z,  w, -x,
        -y,  x,  w,
    )
}

/// `F_q`: the matrix of the product with a unit quaternion on the right, `F_q q = q * turn`.
#[rustfmt::skip]
fn product_matrix<T: Scalar>(turn: &Vector4<T>) -> Matrix4<T> {
    let (w, x, y, z) = (turn[0], turn[1], turn[2], turn[3]);
    Matrix4::new(
        w, -x, -y, -z,
        x,  w,  z, -y,
        y, -z,  w,  x,
        z,  y, -x,  w,
    )
}

/// `d C(q) v / dq` for any `q`, where `C(q) v = (w^2 - u.u) v + 2 u (u.v) - 2 w u x v` and `u` is
/// the vector part.
fn vector_jacobian<T: Scalar>(q: &Vector4<T>, v: &Vector3<T>) -> Matrix3x4<T> {
    let (w, u) = (q[0], Vector3::new(q[1], q[2], q[3]));
    let along_w = v * w - u.cross(v);
    let along_u = Matrix3::from_diagonal_element(u.dot(v)) + u * v.transpose() - v * u.transpose()
        + so3::skew(v) * w;
    let mut j = Matrix3x4::zeros();
    j.set_column(0, &along_w);
    j.fixed_view_mut::<3, 3>(0, 1).copy_from(&along_u);
    j * lit::<T>(2.0)
}

/// `d (q/|q|) / dq = (I - n n^T)/|q|` with `n = q/|q|` (M24b).
fn normalization_jacobian<T: Scalar>(q: &Vector4<T>) -> Matrix4<T> {
    let norm = q.norm();
    let n = q / norm;
    (Matrix4::identity() - n * n.transpose()) / norm
}

/// `P <- J P J^T` for the normalisation of `sum` (M24b).
fn project<T: Scalar>(covariance: &mut Matrix7<T>, sum: &Vector4<T>) {
    let j = normalization_jacobian(sum);
    let quaternion = j * quaternion_block(covariance) * j.transpose();
    let cross: Matrix4x3<T> = j * covariance.fixed_view::<4, 3>(0, 4);
    covariance
        .fixed_view_mut::<4, 4>(0, 0)
        .copy_from(&quaternion);
    covariance.fixed_view_mut::<4, 3>(0, 4).copy_from(&cross);
    covariance
        .fixed_view_mut::<3, 4>(4, 0)
        .copy_from(&cross.transpose());
}

/// 7 by 7 to 6 by 6 with `a = 2 Xi^T dq`.
fn reduce<T: Scalar>(q: &UnitQuaternion<T>, p: &Matrix7<T>) -> Matrix6<T> {
    let mut map = SMatrix::<T, 6, 7>::zeros();
    let two_xi = xi(&wxyz(q)) * lit::<T>(2.0);
    map.fixed_view_mut::<3, 4>(0, 0)
        .copy_from(&two_xi.transpose());
    map.fixed_view_mut::<3, 3>(3, 4).fill_with_identity();
    let mut reduced = map * p * map.transpose();
    symmetrize(&mut reduced);
    reduced
}

/// 6 by 6 to 7 by 7 with `dq = Xi a / 2`.
fn lift<T: Scalar>(q: &UnitQuaternion<T>, p: &Matrix6<T>) -> Matrix7<T> {
    let rows = lifted_factor(q, p);
    rows * rows.transpose()
}

/// The factor of the lifted covariance: of a product with itself, no two rows can have more covariance than variance.
fn lifted_factor<T: Scalar>(q: &UnitQuaternion<T>, p: &Matrix6<T>) -> SMatrix<T, 7, 6> {
    let mut map = SMatrix::<T, 7, 6>::zeros();
    map.fixed_view_mut::<4, 3>(0, 0)
        .copy_from(&(xi(&wxyz(q)) * lit::<T>(0.5)));
    map.fixed_view_mut::<3, 3>(4, 3).fill_with_identity();
    map * semidefinite_factor(p)
}

fn initial_covariance<T: Scalar>(
    attitude: &UnitQuaternion<T>,
    attitude_covariance: &Matrix3<T>,
    bias_variance: T,
) -> Matrix7<T> {
    let mut p = Matrix6::from_diagonal_element(bias_variance);
    p.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(attitude_covariance);
    let mut lifted = lift(attitude, &p);
    symmetrize(&mut lifted);
    lifted
}

/// The transition over one interval and the quaternion after it (M24).
fn transition<T: Scalar>(q: &Vector4<T>, rate: &Vector3<T>, dt: T) -> (Matrix7<T>, Vector4<T>) {
    let r = rate * dt;
    let f_q = product_matrix(&wxyz(&so3::exp(&r)));
    let next = f_q * q;
    let mut f = Matrix7::identity();
    f.fixed_view_mut::<4, 4>(0, 0).copy_from(&f_q);
    let f_qb = xi(&next) * so3::right_jacobian(&r) * (dt * lit(-0.5));
    f.fixed_view_mut::<4, 3>(0, 4).copy_from(&f_qb);
    (f, next)
}

/// `P <- P + Q` at the quaternion after the interval.
fn add_process_noise<T: Scalar>(p: &mut Matrix7<T>, q: &Vector4<T>, [q11, q12, q22]: [T; 3]) {
    let xi = xi(q);
    let mut block = p.fixed_view_mut::<4, 4>(0, 0);
    block += xi * xi.transpose() * (q11 * lit(0.25));
    let cross = xi * (q12 * lit(0.5));
    let mut block = p.fixed_view_mut::<4, 3>(0, 4);
    block += cross;
    let mut block = p.fixed_view_mut::<3, 4>(4, 0);
    block += cross.transpose();
    for i in 4..7 {
        p[(i, i)] += q22;
    }
}

restorable!(QuaternionEkf<T>, state: QuaternionEkfState<T>);

impl<T: Scalar> AttitudeEstimator<T> for QuaternionEkf<T> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() {
            return;
        }
        let bias_variance = initial.gyroscope_bias_std * initial.gyroscope_bias_std;
        let state = &mut self.state;
        state.attitude = initial.attitude;
        state.gyroscope_bias = initial.gyroscope_bias;
        state.covariance = initial_covariance(
            &initial.attitude,
            &initial.attitude_covariance,
            bias_variance,
        );
        if self.config.quaternion_norm == QuaternionNorm::Free {
            let q = wxyz(&initial.attitude);
            let mean = initial.attitude_covariance.trace() / lit(12.0);
            let mut block = state.covariance.fixed_view_mut::<4, 4>(0, 0);
            block += q * q.transpose() * mean;
        }
        state.sensors.start(&initial.references);
        self.settle();
    }

    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        let rate = match checked_rate(angular_rate, &self.state.gyroscope_bias, dt) {
            Ok(Some(rate)) => rate,
            Ok(None) => return Propagation::Done,
            Err(reason) => return Propagation::Skipped(reason),
        };
        let (f, next) = transition(&wxyz(&self.state.attitude), &rate, dt);
        let next = next / next.norm();
        let mut p = f * self.state.covariance * f.transpose();
        let (v, u) = (
            self.config.angle_noise_psd(&rate),
            self.config.bias_walk_psd(),
        );
        add_process_noise(&mut p, &next, propagation::process_noise(v, u, dt));
        symmetrize(&mut p);
        self.state.attitude = from_wxyz(&next);
        self.state.covariance = p;
        self.cap_attitude();
        self.settle();
        self.state.sensors.advance(dt);
        Propagation::Done
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        let p = self.attitude_block();
        let sensors = &mut self.state.sensors;
        let reference = sensors.accelerometer.reference_for(specific_force).ok();
        let measurement = sensors.accelerometer(&self.state.attitude, &p, specific_force);
        self.update(measurement, reference)
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        let p = self.attitude_block();
        let sensors = &mut self.state.sensors;
        let reference = sensors.magnetometer.reference_for(magnetic_field).ok();
        let measurement = sensors.magnetometer(&self.state.attitude, &p, magnetic_field);
        self.update(measurement, reference)
    }

    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        let p = self.attitude_block();
        let sensors = &mut self.state.sensors;
        let measurement = sensors.compass(&self.state.attitude, &p, heading);
        self.update(measurement, None)
    }

    fn add_attitude_variance(&mut self, variance: T) {
        if variance > T::zero() && variance.is_finite() {
            let q = wxyz(&self.state.attitude);
            let added = [variance, T::zero(), T::zero()];
            add_process_noise(&mut self.state.covariance, &q, added);
            self.cap_attitude();
            self.settle();
        }
    }

    fn attitude(&self) -> UnitQuaternion<T> {
        self.state.attitude
    }

    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        let mut p = self.attitude_block();
        symmetrize(&mut p);
        undrown(&mut p);
        Some(p)
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        let p = self.state.covariance.fixed_view::<3, 3>(4, 4).into_owned();
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
