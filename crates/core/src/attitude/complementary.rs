//! Complementary filters on SO(3) with gyroscope bias: explicit, passive and direct (Mahony).
//!
//! Read first: `docs/derivations/complementary.md`; Mahony, Hamel & Pflimlin (2008), "Nonlinear
//! complementary filters on the special orthogonal group". They weigh by fixed gains instead of a
//! covariance: cheap, almost globally stable, and without a word about their own error.
//!
//! # Model
//!
//! `R` turns body into reference, `w_s = w + b + noise`, unit vectors `v_i = R^T r_i + noise`.
//!
//! ```text
//! explicit  e = sum k_i v_i x R^T r_i                                                        (O1)
//! passive   e = vex(P_a(R^T R_y)),  R_y from the vectors by TRIAD, gravity exact             (O2)
//! both      R <- R exp([(w_s - b) dt + sum k_P e tau]x),  b <- b - k_I e tau                 (O3)
//! direct    the passive error, but the rate is carried to the reference by R_y:
//!           R <- exp([R_y (w_s - b) dt]x) R                                                  (O4)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `k_P` | [`AttitudeConfig::complementary_attitude_gain`] | 1/s |
//! | `k_I` | [`AttitudeConfig::complementary_bias_gain`] | 1/s^2 |
//! | `k_i` | [`AttitudeConfig::complementary_accelerometer_weight`], ..`magnetometer_weight` | - |
//! | `tau` | time since the last sample of that sensor, at most [`LONGEST_STEP_S`] | s |
//!
//! Each sensor corrects for its own interval, so rates may differ and samples may be missing; what it
//! corrects is turned together with the next gyroscope sample, as in the continuous filter. The
//! frame is that of the references: NED or ENU. Per axis the error obeys `s^2 + k_P s + k_I`.
//!
//! Cost: one exponential per gyroscope sample, two cross products per vector; what a step calls is always
//! inlined, a tenth of its time. Limits:
//! accelerations enter with their full weight, a wrong field tilts the explicit form
//! (`magnetometer_use = heading` prevents it); without magnetometer heading and its bias stay as
//! they are.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::config::{AttitudeConfig, MagnetometerUse};
use super::propagation::checked_rate;
use super::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty, wahba,
};
use crate::geometry::{rotation, so3};
use crate::kalman::innovation::check_vector;
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable, finite, not_negative, unit};
use crate::scalar::{Scalar, lit};

/// A correction never stands for more than this, s: after a gap a sample is one sample.
pub const LONGEST_STEP_S: f64 = 0.1;
/// Below this share of gravity the device falls and says nothing about up.
pub const LEAST_GRAVITY: f64 = 0.1;
/// Below this share of the reference's square a vector has no direction.
const LEAST_SQUARE: f64 = 1e-6;
/// A field older than this is not put together with gravity, s.
const OLDEST_FIELD_S: f64 = 0.2;
/// Nearer to opposite than this the error has no direction: it is given one.
const OPPOSITE: f64 = -0.999;
/// How far the estimate is turned then, rad.
const NUDGE_RAD: f64 = 1e-3;

/// Where the correction comes from, and in which frame the rate is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum ComplementaryForm {
    /// Each vector by itself (O1): no attitude is put together, one vector is enough.
    Explicit,
    /// Against the attitude that TRIAD puts together from gravity and field (O2).
    Passive,
    /// As passive, with the rate carried by that attitude (O4).
    Direct,
}

/// One vector sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Vector<T: Scalar> {
    /// What it measures in the reference frame: direction and length.
    reference: Option<(Vector3<T>, T)>,
    weight: T,
    /// Lengths that are accepted, as shares of the reference's.
    shares: [T; 2],
    /// Their squares in the sensor's unit.
    squares: [T; 2],
    /// Seconds since its last sample.
    since: T,
}

/// Everything that a complementary filter remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ComplementaryState<T: Scalar> {
    /// `ref_from_body`.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub attitude: UnitQuaternion<T>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<T>,
    /// Rotation vector (rad, body axes) by which the vectors correct with the next gyroscope sample.
    pending: Vector3<T>,
    accelerometer: Vector<T>,
    magnetometer: Vector<T>,
    /// The last direction of the field, carried along with the body, for TRIAD.
    field_body: Option<Vector3<T>>,
    /// `R_y R^T`, reference frame: the direct form's rate is carried by it.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    measured_from_estimated: UnitQuaternion<T>,
    since_compass: T,
}

/// A complementary filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complementary<T: Scalar> {
    form: ComplementaryForm,
    attitude_gain: T,
    bias_gain: T,
    bias_limit: T,
    magnetometer_use: MagnetometerUse,
    start: StartUncertainty<T>,
    state: ComplementaryState<T>,
}

/// A sample that counts.
struct Taken<T: Scalar> {
    /// Unit vector, body axes.
    measured: Vector3<T>,
    /// What it should be, reference frame.
    reference: Vector3<T>,
    /// Length of the reference.
    norm: T,
    /// Seconds that the sample stands for.
    interval: T,
}

impl<T: Scalar> Vector<T> {
    fn numbers(&self) -> impl Iterator<Item = &T> {
        let reference = self
            .reference
            .iter()
            .flat_map(|(v, norm)| v.iter().chain([norm]));
        let bounds = self.shares.iter().chain(&self.squares);
        reference.chain(bounds).chain([&self.weight, &self.since])
    }

    fn new(weight: T, shortest: T, longest: T) -> Self {
        Self {
            reference: None,
            weight,
            shares: [shortest, longest],
            squares: [T::zero(); 2],
            since: T::zero(),
        }
    }

    fn start(&mut self, reference: Option<Vector3<T>>) {
        self.since = T::zero();
        self.reference = reference.and_then(|r| {
            let norm = r.norm();
            check_vector(&r, lit(1e-6), lit(1e6)).ok()?;
            let least = lit::<T>(LEAST_SQUARE);
            self.squares = self
                .shares
                .map(|share| (share * share).max(least) * norm * norm);
            Some((r / norm, norm))
        });
    }

    #[inline(always)]
    fn take(&mut self, measured: &Vector3<T>) -> Result<Taken<T>, SkipReason> {
        let (reference, norm) = self.reference.ok_or(SkipReason::NotInitialized)?;
        let square = measured.norm_squared();
        let [shortest, longest] = self.squares;
        // Both bounds are finite and the lower one is above zero: nothing else passes.
        if !(square >= shortest && square <= longest) {
            return Err(if !square.is_finite() {
                SkipReason::NotFinite
            } else if square < norm * norm * lit(LEAST_SQUARE) {
                SkipReason::ZeroNorm
            } else {
                SkipReason::OutOfRange
            });
        }
        let interval = self.since.min(lit(LONGEST_STEP_S));
        self.since = T::zero();
        Ok(Taken {
            measured: measured * (T::one() / square.sqrt()),
            reference,
            norm,
            interval,
        })
    }
}

impl<T: Scalar> Restorable for Complementary<T> {
    type State = ComplementaryState<T>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        unit("attitude", &state.attitude)?;
        unit("measured attitude", &state.measured_from_estimated)?;
        finite("gyroscope bias", &state.gyroscope_bias)?;
        finite("pending correction", &state.pending)?;
        finite("field", state.field_body.iter().flatten())?;
        finite("accelerometer", state.accelerometer.numbers())?;
        finite("magnetometer", state.magnetometer.numbers())?;
        not_negative("time since the compass", [&state.since_compass])?;
        self.state = state;
        Ok(())
    }
}

impl<T: Scalar> Complementary<T> {
    /// A filter at the identity, without references: it takes vectors after
    /// [`AttitudeEstimator::initialize`].
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(form: ComplementaryForm, config: AttitudeConfig<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        let tolerance = config.complementary_field_tolerance;
        let field = ((T::one() - tolerance).max(T::zero()), T::one() + tolerance);
        let weights = (
            config.complementary_accelerometer_weight,
            config.complementary_magnetometer_weight,
        );
        Ok(Self {
            form,
            attitude_gain: config.complementary_attitude_gain,
            bias_gain: config.complementary_bias_gain,
            bias_limit: config.complementary_bias_limit,
            magnetometer_use: config.magnetometer_use,
            start: StartUncertainty::of(&config),
            state: ComplementaryState {
                attitude: UnitQuaternion::identity(),
                gyroscope_bias: Vector3::zeros(),
                pending: Vector3::zeros(),
                accelerometer: Vector::new(
                    weights.0,
                    lit(LEAST_GRAVITY),
                    lit(super::vector_sensor::LONGEST),
                ),
                magnetometer: Vector::new(weights.1, field.0, field.1),
                field_body: None,
                measured_from_estimated: UnitQuaternion::identity(),
                since_compass: T::zero(),
            },
        })
    }

    /// Which of the three it is.
    pub fn form(&self) -> ComplementaryForm {
        self.form
    }

    /// Follows an attitude `R_y` that something else reconstructed (`ref_from_body`) for `interval`
    /// seconds, at most [`LONGEST_STEP_S`]: the passive form (O2) without its TRIAD. An attitude or
    /// interval that is not finite changes nothing.
    pub fn follow(&mut self, measured: &UnitQuaternion<T>, interval: T) {
        let usable = measured.as_ref().norm_squared().is_finite() && interval.is_finite();
        if usable && interval > T::zero() {
            let error = self.error_against(measured);
            self.correct(&error, interval.min(lit(LONGEST_STEP_S)));
        }
    }

    /// Turns by `k_P e tau` (body axes) with the next gyroscope sample, and lets the bias follow (O3);
    /// `tau` is the interval (s) times the vector's weight.
    #[inline(always)]
    fn correct(&mut self, error: &Vector3<T>, interval: T) {
        self.state.pending += error * (self.attitude_gain * interval);
        let limit = self.bias_limit;
        self.state.gyroscope_bias -= error * (self.bias_gain * interval);
        if self.state.gyroscope_bias.iter().any(|b| b.abs() > limit) {
            self.state
                .gyroscope_bias
                .apply(|b| *b = b.max(-limit).min(limit));
        }
    }

    /// The attitude that gravity and a fresh field give; with gravity alone the estimate, levelled.
    fn reconstruct(&self, up_body: &Vector3<T>, up: &Vector3<T>) -> UnitQuaternion<T> {
        let fresh = self.state.magnetometer.since <= lit(OLDEST_FIELD_S);
        let field = self.state.field_body.filter(|_| fresh);
        let both = field.zip(self.state.magnetometer.reference);
        both.and_then(|(body, (reference, _))| wahba::triad(up_body, &body, up, &reference))
            .unwrap_or_else(|| {
                let predicted = self.state.attitude.inverse() * up;
                self.state.attitude * wahba::level(up_body, &predicted)
            })
    }

    /// The error of the passive and the direct form (O2), body axes.
    fn passive_error(&mut self, up_body: &Vector3<T>, up: &Vector3<T>) -> Vector3<T> {
        let measured = self.reconstruct(up_body, up);
        self.state.measured_from_estimated =
            rotation::renormalize(&(measured * self.state.attitude.inverse()));
        self.error_against(&measured)
    }

    /// `vex(P_a(R^T R_y))` (O2), body axes; half a turn away it leaves that place first.
    fn error_against(&mut self, measured: &UnitQuaternion<T>) -> Vector3<T> {
        let relative = self.state.attitude.inverse() * measured;
        let (cos_half, imaginary) = (relative.w, relative.imag());
        // The trace of a rotation by `a` is 1 + 2 cos a = 4 cos^2(a/2) - 1.
        if lit::<T>(4.0) * cos_half * cos_half - T::one() < lit(OPPOSITE) {
            self.nudge(&imaginary);
        }
        imaginary * (cos_half * lit(2.0))
    }

    /// The error of one vector (O1), body axes, where `predicted` is `R^T r`.
    #[inline(always)]
    fn vector_error(&mut self, measured: &Vector3<T>, predicted: &Vector3<T>) -> Vector3<T> {
        if measured.dot(predicted) < lit(OPPOSITE) {
            let axis = if predicted.x.abs() < predicted.y.abs() {
                Vector3::x()
            } else {
                Vector3::y()
            };
            self.nudge(&predicted.cross(&axis));
        }
        measured.cross(predicted)
    }

    /// Leaves an unstable rest half a turn away.
    fn nudge(&mut self, axis: &Vector3<T>) {
        if let Some(axis) = axis.try_normalize(lit(1e-6)) {
            self.state.attitude =
                rotation::turned(&self.state.attitude, &(axis * lit::<T>(NUDGE_RAD)));
        }
    }

    /// Up in body axes as estimated; `None` before the start.
    fn up_body(&self) -> Option<Vector3<T>> {
        let (up, _) = self.state.accelerometer.reference?;
        Some(self.state.attitude.inverse() * up)
    }
}

/// A residual that was used, without a statement about its covariance: a filter without covariance
/// expects nothing of it.
#[inline(always)]
fn unweighed<T: Scalar>(residual: Vector3<T>) -> Innovation<T> {
    Innovation {
        residual,
        covariance: Matrix3::zeros(),
        nis: T::zero(),
        degrees_of_freedom: 0,
        outcome: Outcome::Fused,
    }
}

impl<T: Scalar> AttitudeEstimator<T> for Complementary<T> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() {
            return;
        }
        self.state.attitude = initial.attitude;
        self.state.gyroscope_bias = initial.gyroscope_bias;
        self.state.pending = Vector3::zeros();
        self.state
            .accelerometer
            .start(Some(initial.references.specific_force));
        self.state
            .magnetometer
            .start(initial.references.magnetic_field);
        self.state.field_body = None;
        self.state.measured_from_estimated = UnitQuaternion::identity();
        self.state.since_compass = T::zero();
    }

    #[inline(always)]
    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        let rate = match checked_rate(angular_rate, &self.state.gyroscope_bias, dt) {
            Ok(Some(rate)) => rate,
            Ok(None) => return Propagation::Done,
            Err(reason) => return Propagation::Skipped(reason),
        };
        let turn = rate * dt;
        let carried = if self.form == ComplementaryForm::Direct {
            let by_measured = self.state.measured_from_estimated * (self.state.attitude * turn);
            self.state.attitude.inverse() * by_measured
        } else {
            turn
        };
        self.state.attitude =
            rotation::turned(&self.state.attitude, &(carried + self.state.pending));
        self.state.pending = Vector3::zeros();
        if let Some(field) = &mut self.state.field_body {
            *field = so3::exp(&-turn) * *field;
        }
        self.state.accelerometer.since += dt;
        self.state.magnetometer.since += dt;
        self.state.since_compass += dt;
        Propagation::Done
    }

    #[inline(always)]
    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        let taken = match self.state.accelerometer.take(specific_force) {
            Ok(taken) => taken,
            Err(reason) => return Innovation::skipped(reason),
        };
        let predicted = self.state.attitude.inverse() * taken.reference;
        if self.form == ComplementaryForm::Explicit {
            let error = self.vector_error(&taken.measured, &predicted);
            self.correct(&error, taken.interval * self.state.accelerometer.weight);
        } else {
            let error = self.passive_error(&taken.measured, &taken.reference);
            self.correct(&error, taken.interval);
        }
        unweighed(specific_force - predicted * taken.norm)
    }

    #[inline(always)]
    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        let taken = match self.state.magnetometer.take(magnetic_field) {
            Ok(taken) => taken,
            Err(reason) => return Innovation::skipped(reason),
        };
        let predicted = self.state.attitude.inverse() * taken.reference;
        let record = unweighed(magnetic_field - predicted * taken.norm);
        if self.form != ComplementaryForm::Explicit {
            self.state.field_body = Some(taken.measured);
            return record;
        }
        let mut error = self.vector_error(&taken.measured, &predicted);
        if self.magnetometer_use == MagnetometerUse::Heading
            && let Some(up) = self.up_body()
        {
            error = up * error.dot(&up);
        }
        self.correct(&error, taken.interval * self.state.magnetometer.weight);
        record
    }

    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        // A magnetic reference says where north is; two norths would pull against each other.
        if self.state.magnetometer.reference.is_some() {
            return Innovation::skipped(SkipReason::NotUsed);
        }
        let Some(up) = self.up_body() else {
            return Innovation::skipped(SkipReason::NotInitialized);
        };
        let measured = match heading.measure(&self.state.attitude) {
            Ok(measured) => measured,
            Err(reason) => return Innovation::skipped(reason),
        };
        let interval = self.state.since_compass.min(lit(LONGEST_STEP_S));
        self.state.since_compass = T::zero();
        let error = up * (measured.residual.sin() * self.state.magnetometer.weight);
        self.correct(&error, interval);
        unweighed(Vector3::new(measured.residual, T::zero(), T::zero()))
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
mod tests;
