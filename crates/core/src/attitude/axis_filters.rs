//! Decoupled per-axis Kalman filters for roll, pitch and yaw, of two states each: angle and bias.
//!
//! Read first: `docs/derivations/axis_filters.md`; Romaniuk & Gosiewski (2014), "Kalman filter
//! realization for orientation and position estimation on dedicated processor", eqs 5-19 and 31-37.
//! Use it to make the paper again, or where nothing larger fits: it is the smallest filter there is.
//! Everywhere else [`super::mekf::Mekf`] is better: it knows nothing of poles, and its axes help
//! each other.
//!
//! # Model
//!
//! ```text
//! per axis  x = [angle, bias],  angle <- wrap(angle + (u - bias) T),  P <- A P A^T + Q      (A1)
//!           A = [[1, -T], [0, 1]],  Q = diag(T^2 s_w^2, T s_b^2),  R = s_a^2                (A2)
//! rates     u = (p + sin(roll) tan(pitch) q + cos(roll) tan(pitch) r,
//!                cos(roll) q - sin(roll) r,  (sin(roll) q + cos(roll) r) / cos(pitch))      (A3)
//! angles    roll = atan2(-f_y, -f_z),  pitch = atan2(f_x, sqrt(f_y^2 + f_z^2))              (A4)
//! heading   yaw = atan2(-Y_h, X_h) + declination, X_h and Y_h the levelled field            (A5)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `s_w` | [`AxisFiltersConfig::gyroscope_std`] | rad/s |
//! | `s_b` | [`AxisFiltersConfig::gyroscope_bias_random_walk`] | rad/s/sqrt(s) |
//! | `s_a` | [`AxisFiltersConfig::angle_std`] | rad |
//! | `f`, `p q r` | specific force, angular rate: body axes forward, right, down | m/s^2, rad/s |
//!
//! Frames: navigation is north, east, down; the angles are yaw, pitch, roll of `ned_from_body`.
//! What the paper prints otherwise is kept as an option: [`AxisNoise`], [`AxisAngles`],
//! [`AxisFiltersConfig::euler_rates`]. Cost: about 80 multiplications and nine trigonometric
//! functions a step: sines and cosines are shared. Limits: near the poles (pitch of 90 degrees) roll
//! and yaw are held.

mod angles;
mod config;

use nalgebra::{Matrix2, Matrix3, UnitQuaternion, Vector3};

use angles::Tilt;
pub use angles::{tilt_compensated_heading, tilt_of};
pub use config::{AxisAngles, AxisFiltersConfig, AxisNoise};

use crate::geometry::trigonometry::sin_cos;
pub use crate::geometry::trigonometry::wrap;
use crate::kalman::covariance::{resolvable_variance, rounding_reserve};
use crate::kalman::innovation::{check_within, checked_norm_squared};
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::parameters::{ConfigError, Range};
use crate::restorable::{InvalidState, Restorable, covariance, expect, finite};
use crate::scalar::{Scalar, lit};

/// Standard gravity, m/s^2: what the accelerometer's gate compares with.
const GRAVITY: f64 = 9.806_65;
/// Longest interval of a propagation, s.
const LONGEST_STEP_S: f64 = 10.0;
/// Largest variance of an angle, rad^2: beyond 1.8 rad nothing is known anyway.
const LARGEST_VARIANCE: f64 = 3.24;

/// One axis: angle (rad), bias (rad/s), and their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AngleFilter<T> {
    /// Angle in `[-pi, pi)`, rad.
    pub angle: T,
    /// Bias of the rate, rad/s.
    pub bias: T,
    /// Variance of the angle, covariance, variance of the bias: rad^2, rad^2/s, rad^2/s^2.
    pub covariance: [T; 3],
}

impl<T: Scalar> AngleFilter<T> {
    fn starting_at(angle: T) -> Self {
        Self {
            angle: wrap(angle),
            bias: T::zero(),
            covariance: [lit(0.03), T::zero(), lit(0.003)],
        }
    }

    /// (A1), as sums that share what they have in common.
    fn propagate(&mut self, rate: T, dt: T, [q_angle, q_bias]: [T; 2]) {
        self.angle = wrap(self.angle + (rate - self.bias) * dt);
        let [a, b, c] = self.covariance;
        let (cross, bias) = (b - c * dt, c + q_bias);
        let angle = a - (b + cross) * dt + q_angle;
        let limit: T = lit(LARGEST_VARIANCE);
        // What nothing measures grows until single precision fails: kept, with its correlation.
        self.covariance = if angle > limit {
            [limit, cross * (limit / angle).sqrt(), bias]
        } else {
            [angle, cross, bias]
        };
    }

    /// Corrects with an angle of variance `r`.
    fn update(&mut self, measured: T, r: T) -> Correction<T> {
        let [a, b, c] = self.covariance;
        let r = resolvable_variance(r, a).unwrap_or(r);
        let variance = a + r;
        let innovation = wrap(measured - self.angle);
        let inverse = T::one() / variance;
        let (gain_angle, gain_bias) = (a * inverse, b * inverse);
        self.angle = wrap(self.angle + gain_angle * innovation);
        self.bias += gain_bias * innovation;
        // (1 - a / (a + r)) of a and b, without the difference.
        let removed = gain_bias * b;
        self.covariance = [
            r * gain_angle,
            r * gain_bias,
            c - removed + rounding_reserve(removed),
        ];
        Correction {
            innovation,
            variance,
            inverse,
        }
    }
}

/// What an angle told its filter.
#[derive(Debug, Clone, Copy)]
struct Correction<T> {
    innovation: T,
    /// Of the innovation, and one over it.
    variance: T,
    inverse: T,
}

impl<T: Scalar> Correction<T> {
    #[inline(always)]
    fn nis(&self) -> T {
        self.innovation * self.innovation * self.inverse
    }
}

/// The three filters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisFilters<T> {
    config: AxisFiltersConfig<T>,
    /// Roll, pitch, yaw.
    axes: [AngleFilter<T>; 3],
    /// Interval of the last propagation (s), and the noise that belongs to it.
    last_dt: T,
    noise: [T; 3],
    /// Of the roll and pitch as they are, once somebody has asked.
    tilt: Option<Tilt<T>>,
}

/// Everything that the filters remember.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AxisFiltersState<T> {
    /// Roll, pitch, yaw.
    pub axes: [AngleFilter<T>; 3],
    /// Interval of the last propagation, s.
    pub last_dt: T,
}

impl<T: Scalar> Restorable for AxisFilters<T> {
    type State = AxisFiltersState<T>;

    fn save(&self) -> Self::State {
        AxisFiltersState {
            axes: self.axes,
            last_dt: self.last_dt,
        }
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        for axis in &state.axes {
            finite("angle and bias", [&axis.angle, &axis.bias])?;
            let [angle, cross, bias] = axis.covariance;
            covariance("covariance", &Matrix2::new(angle, cross, cross, bias))?;
        }
        let usual = state.last_dt > T::zero() && state.last_dt <= lit(LONGEST_STEP_S);
        expect(
            "last interval",
            usual,
            "above zero and at most the longest step",
        )?;
        self.axes = state.axes;
        self.last_dt = state.last_dt;
        self.noise = self.config.noise(state.last_dt);
        self.tilt = None;
        Ok(())
    }
}

impl<T: Scalar> AxisFilters<T> {
    /// Filters that start at roll, pitch and yaw (rad).
    ///
    /// # Errors
    /// The first parameter outside its permitted range, or `"start"`.
    pub fn new(config: AxisFiltersConfig<T>, start: [T; 3]) -> Result<Self, ConfigError> {
        config.validate()?;
        if !start.iter().all(|angle| angle.abs() <= lit(100.0)) {
            return Err(ConfigError {
                field: "start",
                range: Range::Described("three angles of at most 100 rad"),
            });
        }
        let last_dt = lit(0.02);
        Ok(Self {
            config,
            axes: start.map(AngleFilter::starting_at),
            last_dt,
            noise: config.noise(last_dt),
            tilt: None,
        })
    }

    /// Roll, pitch and yaw with their biases and covariances.
    pub fn axes(&self) -> &[AngleFilter<T>; 3] {
        &self.axes
    }

    /// The attitude `ned_from_body`.
    pub fn attitude(&self) -> UnitQuaternion<T> {
        let [roll, pitch, yaw] = self.axes.map(|axis| axis.angle);
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    /// A vector of the body (forward, right, down) in north, east, down: turned by [`Self::attitude`], with the
    /// sines and cosines that the filters share.
    pub fn turned_to_ned(&mut self, body: &Vector3<T>) -> Vector3<T> {
        let level = self.tilt().levelled(body);
        let [_, _, yaw] = &self.axes;
        let (sin, cos) = sin_cos(yaw.angle);
        Vector3::new(
            level.x * cos - level.y * sin,
            level.x * sin + level.y * cos,
            level.z,
        )
    }

    /// Sines and cosines of the roll and pitch as they are.
    fn tilt(&mut self) -> Tilt<T> {
        let [roll, pitch, _] = &self.axes;
        *self
            .tilt
            .get_or_insert_with(|| Tilt::at(roll.angle, pitch.angle))
    }

    /// Moves on by `dt` seconds with the angular rate (rad/s, forward, right, down).
    ///
    /// # Errors
    /// Why the sample is refused; the state is then untouched.
    pub fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Result<(), SkipReason> {
        check_within(angular_rate, lit(1e4))?;
        // One that was good for the last step is good for this one.
        if dt != self.last_dt {
            if !dt.is_finite() {
                return Err(SkipReason::NotFinite);
            }
            if dt > lit(LONGEST_STEP_S) {
                return Err(SkipReason::OutOfRange);
            }
            if dt <= T::zero() {
                return Ok(());
            }
            self.last_dt = dt;
            self.noise = self.config.noise(dt);
        }
        let [q_angle, q_bias, _] = self.noise;
        let rates = self.rates(angular_rate);
        for (axis, rate) in self.axes.iter_mut().zip(rates) {
            // Held: the bias is what its rate is taken for, so that nothing turns.
            axis.propagate(rate.unwrap_or(axis.bias), dt, [q_angle, q_bias]);
        }
        self.tilt = None;
        Ok(())
    }

    /// Rates of roll, pitch and yaw (A3), or the body's as they are; `None` at the poles.
    fn rates(&mut self, body: &Vector3<T>) -> [Option<T>; 3] {
        if !self.config.euler_rates {
            return [Some(body.x), Some(body.y), Some(body.z)];
        }
        let tilt = self.tilt();
        let pitch_rate = tilt.cos_roll * body.y - tilt.sin_roll * body.z;
        if tilt.is_at_a_pole() {
            return [None, Some(pitch_rate), None];
        }
        let turning = (tilt.sin_roll * body.y + tilt.cos_roll * body.z) / tilt.cos_pitch;
        [
            Some(body.x + tilt.sin_pitch * turning),
            Some(pitch_rate),
            Some(turning),
        ]
    }

    /// Corrects roll and pitch with a specific force (m/s^2, forward, right, down). The record has
    /// the residuals of roll and pitch (rad), or of the pitch alone where the roll is not defined.
    pub fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        let g: T = lit(GRAVITY);
        let range = [lit(0.1 * GRAVITY), lit(50.0 * GRAVITY)];
        let squared = match checked_norm_squared(specific_force, range) {
            Ok(squared) => squared,
            Err(reason) => return Innovation::skipped(reason),
        };
        let [_, _, mut r] = self.noise;
        if self.config.norm_gain > T::zero() {
            let excess = squared.sqrt() - g;
            r += r * self.config.norm_gain * (excess * excess);
        }
        let (roll, pitch) = tilt_of(specific_force, self.config.angles);
        self.tilt = None;
        let [roll_axis, pitch_axis, _] = &mut self.axes;
        let of_pitch = pitch_axis.update(pitch, r);
        match roll {
            Some(roll) => record(&roll_axis.update(roll, r), Some(&of_pitch)),
            None => record(&of_pitch, None),
        }
    }

    /// Corrects the yaw with a magnetic field (any unit, forward, right, down), levelled by the
    /// estimated roll and pitch. The record has its residual (rad).
    pub fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        let squared = match checked_norm_squared(magnetic_field, [lit(1e-6), lit(1e6)]) {
            Ok(squared) => squared,
            Err(reason) => return Innovation::skipped(reason),
        };
        let tilt = self.tilt();
        if tilt.is_at_a_pole() {
            return Innovation::skipped(SkipReason::Unobservable);
        }
        match tilt.heading(magnetic_field, squared) {
            Some(heading) => self.correct_yaw(heading + self.config.declination),
            None => Innovation::skipped(SkipReason::Unobservable),
        }
    }

    /// Corrects the yaw with a heading from true north (rad) that is not a magnetometer's: a course over
    /// ground, a gyrocompass. The record has its residual (rad).
    pub fn update_heading(&mut self, heading: T) -> Innovation<T> {
        if !heading.is_finite() {
            return Innovation::skipped(SkipReason::NotFinite);
        }
        // A few turns are a matter of taste, more are no heading.
        if heading.abs() > lit(100.0) {
            return Innovation::skipped(SkipReason::OutOfRange);
        }
        if self.tilt().is_at_a_pole() {
            return Innovation::skipped(SkipReason::Unobservable);
        }
        self.correct_yaw(heading)
    }

    fn correct_yaw(&mut self, heading: T) -> Innovation<T> {
        let [_, _, r] = self.noise;
        let [_, _, yaw] = &mut self.axes;
        record(&yaw.update(heading, r), None)
    }
}

/// The record of one or two independent scalar updates. In line, so that a chip that does not look at it does not
/// make it.
#[inline(always)]
fn record<T: Scalar>(first: &Correction<T>, second: Option<&Correction<T>>) -> Innovation<T> {
    let zero = T::zero();
    let (residual, variance, nis) = second.map_or((zero, zero, zero), |update| {
        (update.innovation, update.variance, update.nis())
    });
    Innovation {
        residual: Vector3::new(first.innovation, residual, zero),
        covariance: Matrix3::from_diagonal(&Vector3::new(first.variance, variance, zero)),
        nis: first.nis() + nis,
        degrees_of_freedom: 1 + u8::from(second.is_some()),
        outcome: Outcome::Fused,
    }
}

#[cfg(test)]
mod tests;
