//! Position, velocity and accelerometer bias behind an attitude observer: the outer loop of the
//! cascade (Scandaroli type), with the rotation-rate term.
//!
//! *Read first:* `docs/derivations/complementary.md`, section on the cascade; Scandaroli & Morin
//! (2011), "Nonlinear filter design for pose and IMU bias estimation"; Iporre & Améstegui. Use it
//! where an attitude estimator runs anyway and positions come now and then; one number, the pole,
//! tunes it. It says nothing about its own error: [`super::ErrorStateFilter`] does.
//!
//! # Model
//!
//! ```text
//! inertial sample   a = R (a_s - b) - f_0,  p <- p + dt v + dt^2/2 a,  v <- v + dt a         (O9)
//! position p_y      e = p_y - p(then),  theta = exp(-lambda T),  T the time since the last one
//!                   p <- p + (1 - theta^3) e
//!                   v <- v + 3/2 (1 - theta^2)(1 - theta)/T e
//!                   b <- b - (1 - theta)^3/T^2 (I + [w]x/(3 lambda)) R^T e                   (O10)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `R` | `ref_from_body`, from any attitude estimator | - |
//! | `f_0` | specific force at rest, reference frame: its direction says NED or ENU | m/s^2 |
//! | `w` | angular rate without bias, body axes | rad/s |
//! | `lambda` | [`CascadeConfig::pole`] | 1/s |
//! | `p, v, b` | [`CascadeState`] | m, m/s (reference), m/s^2 (body) |
//!
//! A position that was true some time ago is compared with the estimate of that time. Cost: a
//! rotation per inertial sample. Limits: tilt errors look like an accelerometer bias, and cannot be
//! told apart from it while the attitude stays the same.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::kalman::innovation::check_vector;
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::parameters::{ConfigError, Range, parameters};
use crate::restorable::{InvalidState, Restorable, expect, finite};
use crate::scalar::{Scalar, lit};

/// A shorter interval between positions counts as this, s: rates of change over nearly no time are
/// noise. A longer one counts as it is, because gains have their poles where they should for the real
/// interval only: at a pole of 1/s, four seconds that counted as two would make the loop unstable.
pub const SHORTEST_INTERVAL_S: f64 = 0.02;
/// A position this many standard deviations off is an outlier ...
pub const OUTLIER_STDS: f64 = 5.0;
/// ... unless so many came in a row: then the estimate is what is wrong.
pub const OUTLIERS_ACCEPTED: u8 = 5;
/// Largest specific force (m/s^2), position (m) and interval (s) that can have been measured.
const LARGEST_FORCE: f64 = 1e4;
const LARGEST_POSITION: f64 = 1e8;
const LONGEST_STEP_S: f64 = 10.0;
/// The past is kept in so many steps of at least so long, s: three seconds and more.
const PAST: usize = 64;
const PAST_STEP_S: f64 = 0.05;

parameters! {
    /// Parameters of the observer. [`Default`] is [`Self::hand_held`].
    pub struct CascadeConfig, profiles {
        /// Positions of a satellite receiver: one a second, good to a few metres.
        hand_held = 0,
        /// Positions good to a decimetre ten times a second, as a laboratory has them.
        lab = 1,
    };

    pole: T, "1/s", From(1e-3, 100.0), [0.25, 1.0],
        "how fast the position observer of a cascade follows positions (its triple pole)",
        "1 for 10 Hz positions good to 0.1 m; 0.5 for 5 Hz and 1 m; 0.2 to 0.3 for GNSS at 1 Hz and 3 m. Raising it",
        "follows positions faster, with their noise.";
    position_std_m: T, "m", From(1e-6, 1e6), [3.0, 0.1], was "position_std",
        "position error per sample and axis; five times as much is an outlier",
        "Only for telling outliers.";
    rotation_rate_term: bool, "-", Flag, [true],
        "whether the rotation-rate term is used",
        "Without it the loop is unstable above 1.54 times the pole in rad/s; it is there to show that.";
    bias_limit: T, "m/s^2", From(0.0, 1e4), [0.5],
        "largest accelerometer bias per axis",
        "What winds up beyond is no bias.";
}

/// What is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CascadeState<T: Scalar> {
    /// Position in the reference frame, m.
    pub position: Vector3<T>,
    /// Velocity in the reference frame, m/s.
    pub velocity: Vector3<T>,
    /// Accelerometer bias in body axes, m/s^2.
    pub accelerometer_bias: Vector3<T>,
}

/// Everything that the observer remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CascadeMemory<T: Scalar> {
    state: CascadeState<T>,
    past: Past<T>,
    /// Seconds from the instant of the last position that was used to now; `None` before the first one.
    since_position: Option<T>,
    /// Seconds from the latest instant of which a position was looked at, outliers included.
    since_seen: T,
    outliers: u8,
}

/// The observer. See the [module](self).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cascade<T: Scalar> {
    config: CascadeConfig<T>,
    force_at_rest: Vector3<T>,
    memory: CascadeMemory<T>,
}

/// Positions of the last seconds, newest first.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Past<T: Scalar> {
    /// Each with the seconds from the entry before it.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    entries: [(Vector3<T>, T); PAST],
    count: usize,
    /// Seconds since the newest entry.
    since: T,
}

impl<T: Scalar> Past<T> {
    fn starting_at(position: Vector3<T>) -> Self {
        Self {
            entries: [(position, T::zero()); PAST],
            count: 1,
            since: T::zero(),
        }
    }

    fn advance(&mut self, dt: T, position: &Vector3<T>) {
        self.since += dt;
        if self.since < lit(PAST_STEP_S) {
            return;
        }
        self.entries.rotate_right(1);
        if let Some(newest) = self.entries.first_mut() {
            *newest = (*position, self.since);
        }
        self.count = (self.count + 1).min(PAST);
        self.since = T::zero();
    }

    /// The position `age` seconds ago, between two entries; `None` beyond what is kept.
    fn before(&self, age: T, now: &Vector3<T>) -> Option<Vector3<T>> {
        let mut newer = (T::zero(), *now);
        let mut entry_age = self.since;
        for (entry, after_the_one_before) in self.entries.iter().take(self.count) {
            if age <= entry_age {
                let span = entry_age - newer.0;
                let share = if span > T::zero() {
                    (age - newer.0) / span
                } else {
                    T::zero()
                };
                return Some(newer.1 + (entry - newer.1) * share);
            }
            newer = (entry_age, *entry);
            entry_age += *after_the_one_before;
        }
        None
    }

    /// A correction moves the whole past: an error that is found was there before.
    fn shift(&mut self, by: &Vector3<T>) {
        for (entry, _) in &mut self.entries {
            *entry += by;
        }
    }
}

impl<T: Scalar> Restorable for Cascade<T> {
    type State = CascadeMemory<T>;

    fn save(&self) -> Self::State {
        self.memory
    }

    fn restore(&mut self, memory: Self::State) -> Result<(), InvalidState> {
        let (state, past) = (&memory.state, &memory.past);
        finite("position", &state.position)?;
        finite("velocity", &state.velocity)?;
        finite("accelerometer bias", &state.accelerometer_bias)?;
        let entries = past.entries.iter();
        finite(
            "past",
            entries.flat_map(|(position, dt)| position.iter().chain([dt])),
        )?;
        expect(
            "past",
            past.count <= PAST,
            "of the length of the observer's",
        )?;
        let times = [&past.since, &memory.since_seen];
        finite("times", memory.since_position.iter().chain(times))?;
        self.memory = memory;
        Ok(())
    }
}

impl<T: Scalar> Cascade<T> {
    /// An observer that waits for its first position. `force_at_rest` is the specific force of a
    /// body at rest in the reference frame (m/s^2): `[0, 0, g]` in ENU, `[0, 0, -g]` in NED.
    ///
    /// # Errors
    /// The first parameter outside its range, or `"force_at_rest"`.
    pub fn new(config: CascadeConfig<T>, force_at_rest: Vector3<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        if check_vector(&force_at_rest, lit(1e-3), lit(1e3)).is_err() {
            return Err(ConfigError {
                field: "force_at_rest",
                range: Range::Described("finite, of a length from 0.001 to 1000"),
            });
        }
        Ok(Self {
            config,
            force_at_rest,
            memory: CascadeMemory {
                state: CascadeState {
                    position: Vector3::zeros(),
                    velocity: Vector3::zeros(),
                    accelerometer_bias: Vector3::zeros(),
                },
                past: Past::starting_at(Vector3::zeros()),
                since_position: None,
                since_seen: T::zero(),
                outliers: 0,
            },
        })
    }

    /// The estimate; `None` before the first position.
    pub fn state(&self) -> Option<&CascadeState<T>> {
        self.memory.since_position.map(|_| &self.memory.state)
    }

    /// Moves on by `dt` seconds with the specific force (m/s^2, body axes) that held over them, at
    /// the attitude `ref_from_body` (O9). Before the first position, and for `dt <= 0`, it does nothing.
    ///
    /// # Errors
    /// Why the sample is refused; the state is then untouched.
    pub fn propagate(
        &mut self,
        ref_from_body: &UnitQuaternion<T>,
        specific_force: &Vector3<T>,
        dt: T,
    ) -> Result<(), SkipReason> {
        check_inertial(ref_from_body, specific_force, dt)?;
        let Some(since) = self.memory.since_position.filter(|_| dt > T::zero()) else {
            return Ok(());
        };
        let felt = specific_force - self.memory.state.accelerometer_bias;
        let acceleration = ref_from_body * felt - self.force_at_rest;
        self.memory.state.position +=
            self.memory.state.velocity * dt + acceleration * (dt * dt * lit::<T>(0.5));
        self.memory.state.velocity += acceleration * dt;
        self.memory.past.advance(dt, &self.memory.state.position);
        self.memory.since_position = Some(since + dt);
        self.memory.since_seen += dt;
        Ok(())
    }

    /// Corrects with a position (m, reference frame) that was true `age` seconds ago (O10), at the
    /// attitude and the bias-free angular rate (rad/s, body axes) of now. The first one starts the
    /// observer. A position of the same instant as the last one, or an earlier instant, is refused:
    /// a receiver that repeats a held position gives no new information.
    pub fn update_position(
        &mut self,
        position: &Vector3<T>,
        age: T,
        ref_from_body: &UnitQuaternion<T>,
        angular_rate: &Vector3<T>,
    ) -> Innovation<T> {
        if let Err(reason) = check_fix(position, age, ref_from_body, angular_rate) {
            return Innovation::skipped(reason);
        }
        let Some(since) = self.memory.since_position else {
            self.start(position, age);
            return unweighed(Vector3::zeros(), Outcome::Fused);
        };
        // Rounding of two clocks is no progress; an outlier that is held counts once, too.
        if self.memory.since_seen - age < lit(1e-3) {
            return Innovation::skipped(SkipReason::NotNewer);
        }
        let interval = since - age;
        let Some(then) = self.memory.past.before(age, &self.memory.state.position) else {
            return Innovation::skipped(SkipReason::OutOfRange);
        };
        self.memory.since_seen = age;
        let error = position - then;
        let is_outlier = error.norm() > self.config.position_std_m * lit(OUTLIER_STDS);
        if is_outlier && self.memory.outliers < OUTLIERS_ACCEPTED {
            self.memory.outliers += 1;
            return unweighed(error, Outcome::Gated);
        }
        let outcome = if is_outlier {
            Outcome::Inflated
        } else {
            Outcome::Fused
        };
        self.memory.outliers = 0;
        self.memory.since_position = Some(age);
        self.correct(&error, interval, ref_from_body, angular_rate);
        unweighed(error, outcome)
    }

    fn start(&mut self, position: &Vector3<T>, age: T) {
        self.memory.state.position = *position;
        self.memory.state.velocity = Vector3::zeros();
        self.memory.past = Past::starting_at(*position);
        self.memory.since_position = Some(age);
        self.memory.since_seen = age;
        self.memory.outliers = 0;
    }

    /// All three discrete poles at `theta` (O10).
    fn correct(
        &mut self,
        error: &Vector3<T>,
        interval: T,
        ref_from_body: &UnitQuaternion<T>,
        angular_rate: &Vector3<T>,
    ) {
        let interval = interval.max(lit(SHORTEST_INTERVAL_S));
        let theta = (-self.config.pole * interval).exp();
        let rest = T::one() - theta;
        let shift = error * (T::one() - theta * theta * theta);
        self.memory.state.position += shift;
        self.memory.past.shift(&shift);
        let velocity_gain = lit::<T>(1.5) * (T::one() - theta * theta) * rest / interval;
        self.memory.state.velocity += error * velocity_gain;
        let bias_gain = rest * rest * rest / (interval * interval);
        let mut body = ref_from_body.inverse() * error;
        if self.config.rotation_rate_term {
            body += angular_rate.cross(&body) / (self.config.pole * lit(3.0));
        }
        let limit = self.config.bias_limit;
        let bias = self.memory.state.accelerometer_bias - body * bias_gain;
        self.memory.state.accelerometer_bias = bias.map(|b| b.max(-limit).min(limit));
    }
}

/// A residual without a statement about its covariance.
fn unweighed<T: Scalar>(residual: Vector3<T>, outcome: Outcome) -> Innovation<T> {
    Innovation {
        residual,
        covariance: Matrix3::zeros(),
        nis: T::zero(),
        degrees_of_freedom: 0,
        outcome,
    }
}

fn is_rotation<T: Scalar>(q: &UnitQuaternion<T>) -> bool {
    (q.as_ref().norm_squared() - T::one()).abs() < lit(1e-3)
}

fn check_inertial<T: Scalar>(
    ref_from_body: &UnitQuaternion<T>,
    specific_force: &Vector3<T>,
    dt: T,
) -> Result<(), SkipReason> {
    if !(dt.is_finite() && is_rotation(ref_from_body)) {
        return Err(SkipReason::NotFinite);
    }
    check_vector(specific_force, T::zero(), lit(LARGEST_FORCE))?;
    if dt > lit(LONGEST_STEP_S) {
        return Err(SkipReason::OutOfRange);
    }
    Ok(())
}

fn check_fix<T: Scalar>(
    position: &Vector3<T>,
    age: T,
    ref_from_body: &UnitQuaternion<T>,
    angular_rate: &Vector3<T>,
) -> Result<(), SkipReason> {
    if !(age.is_finite() && is_rotation(ref_from_body)) {
        return Err(SkipReason::NotFinite);
    }
    check_vector(position, T::zero(), lit(LARGEST_POSITION))?;
    check_vector(angular_rate, T::zero(), lit(1e4))?;
    if age < T::zero() {
        return Err(SkipReason::OutOfRange);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
