//! Bounded-velocity Kalman filter: attitude for hand-held and worn devices, with bias, scale, hard
//! iron and field.
//!
//! Read first: `docs/derivations/bounded_velocity.md`, whose equation numbers (B..) stand at the
//! lines below and in the files of this folder.
//!
//! Use it for what people carry: accelerations that last, fields that are disturbed, magnetometers
//! that nobody calibrated. A hand does not stay fast for long, so the integral of its acceleration
//! is bounded: "velocity is near zero" replaces "the accelerometer shows gravity". Vehicles are found by
//! their speed, some seconds late. Do not feed it a field whose strength a system has made constant:
//! its errors then cannot be seen.
//!
//! # Model
//!
//! Level axes are east, north (magnetic) and up. The error is on the **left**, in level axes:
//! `q_true = Exp(theta) q` (B1), so that heading is a component; at the border the covariance is
//! turned into the body axes of all attitude filters.
//!
//! ```text
//! w = w_m + M w_m - b,  v' = horizontal(R f),  m = R^T B + h          (B2, B4, B15)
//! x = [theta, v, b, M, B, h]   3 + 2 + 3 + (0 | 3 | 9) + (0 | 2) + (0 | 3) states
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `q` | `state.level_from_body` | - |
//! | `v` | `state.velocity` (east, north) | m/s |
//! | `b` | `state.gyroscope_bias` | rad/s |
//! | `M` | `state.scale` | - |
//! | `B` | `state.field_ut` (north, down) | microtesla |
//! | `h` | `state.hard_iron_ut` | microtesla |
//! | `P` | `state.covariance` | squares of these |
//!
//! | idea | file |
//! |---|---|
//! | settings | `config.rs` |
//! | which states there are | `layout.rs` |
//! | sums over samples, step of the covariance | `propagation.rs` |
//! | residuals, rows, injection | `updates.rs` |
//! | is it at rest | `rest.rs` |
//! | how far from zero is the velocity | `velocity_noise.rs` |
//! | is it a hand or a vehicle | `speed_hypotheses.rs` |
//! | what a smoother records | `steps.rs` |
//! | how good is a field | `field_quality.rs` |
//!
//! The attitude follows every gyroscope sample; covariance and updates run every
//! [`BoundedVelocityConfig::update_interval_s`], so between updates the covariance is that of the
//! last one. An accelerometer sample stands for the time since the one before.
//!
//! Cost: about 250 multiplications per sample of each sensor, about 3000 per update interval with
//! all 22 states. Limits: it starts with the field that it finds; without magnetometer the heading
//! drifts with what is not known of the bias.

mod bias_prior;
pub mod config;
mod field_mean;
mod field_quality;
mod hard_iron;
pub mod layout;
pub mod propagation;
pub mod rest;
mod schmidt;
pub mod speed_hypotheses;
mod state;
pub mod steps;
pub mod updates;
pub mod velocity_noise;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::propagation::checked_rate;
use super::{AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty};
use crate::faults::bias_step::{Learnt, Resumed};
use crate::geometry::{rotation, so3};
use crate::kalman::Innovation;
use crate::kalman::covariance::{cap_variance, part, turned3, undrown};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable};
use crate::scalar::{Scalar, lit};
pub use config::{BoundedVelocityConfig, ScaleStates};
use layout::{ATTITUDE, BIAS};
pub use state::BoundedVelocityState;
use steps::{Moment, Step, StepObserver};

/// The covariance is propagated without an update after so many update intervals.
const MOST_INTERVALS: f64 = 2.5;

/// The filter. `O` watches its steps; without one, `()`, it costs nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundedVelocity<T: Scalar, O = ()> {
    config: BoundedVelocityConfig<T>,
    state: BoundedVelocityState<T>,
    observer: O,
}

impl<T: Scalar> BoundedVelocity<T> {
    /// A filter at the identity attitude without references: it integrates until
    /// [`AttitudeEstimator::initialize`] gives it a start.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(config: BoundedVelocityConfig<T>) -> Result<Self, ConfigError> {
        Self::observed(config, ())
    }
}

impl<T: Scalar, O: StepObserver<T>> BoundedVelocity<T, O> {
    /// As [`BoundedVelocity::new`], with `observer` watching its steps.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn observed(config: BoundedVelocityConfig<T>, observer: O) -> Result<Self, ConfigError> {
        config.validate()?;
        let state = BoundedVelocityState::blank(&config);
        Ok(Self {
            config,
            state,
            observer,
        })
    }

    /// Who watches its steps.
    pub fn observer(&self) -> &O {
        &self.observer
    }

    /// The settings.
    pub fn config(&self) -> &BoundedVelocityConfig<T> {
        &self.config
    }

    /// The state, to look at.
    pub fn state(&self) -> &BoundedVelocityState<T> {
        &self.state
    }

    fn begin(&mut self, state: BoundedVelocityState<T>) {
        self.state = state;
        self.tell(Moment::Started);
    }

    #[inline(always)]
    fn tell(&mut self, moment: Moment<'_, T>) {
        self.observer.observe(moment, &self.state);
    }

    /// `ref_from_body` at the last sample, without prediction.
    fn attitude_in_reference(&self) -> UnitQuaternion<T> {
        self.state.ref_from_level * self.state.level_from_body
    }

    /// What a bias of the accelerometer adds to the covariance of the attitude error, level axes, rad^2 (B22b).
    pub fn unseen_tilt(&self) -> Matrix3<T> {
        if self.state.gravity <= T::zero() {
            return Matrix3::zeros();
        }
        let tilt = self.config.accelerometer_bias_std / self.state.gravity;
        let tilt = tilt.min(self.config.maximum_attitude_std);
        Matrix3::from_diagonal(&Vector3::new(tilt * tilt, tilt * tilt, T::zero()))
    }

    /// Brings the covariance up to the attitude (B8).
    #[inline]
    fn propagate_covariance(&mut self) {
        let time = self.state.sums.time;
        if time <= T::zero() {
            return;
        }
        let step = Step::Propagation(self.state.sums);
        self.tell(Moment::Leaving(&step));
        let (config, state) = (&self.config, &mut self.state);
        let walk = |std: T| std * std * time;
        let variances = [
            walk(config.gyroscope_bias_random_walk),
            walk(config.field_random_walk_ut),
            walk(config.hard_iron_random_walk_ut),
        ];
        let (sums, p) = (&state.sums, &mut state.covariance);
        state.speed_hypotheses.advance(sums);
        sums.propagate_covariance(p, &state.layout, variances);
        let limit = config.maximum_attitude_std * config.maximum_attitude_std;
        state.cap_variances(limit);
        state.sums = propagation::Sums::default();
        self.tell(Moment::Predicted);
    }

    /// Turns by the rate over `dt` (B3) and sums what the covariance needs.
    #[inline]
    fn integrate(&mut self, measured: &Vector3<T>, dt: T) {
        let (config, state) = (&self.config, &mut self.state);
        let rate = measured + state.scale * measured - state.gyroscope_bias;
        let half_turn = so3::exp(&(rate * (dt * lit(0.5))));
        let middle = state.level_from_body * half_turn;
        state.level_from_body = rotation::renormalize(&(middle * half_turn));
        state.angular_rate = rate;
        let middle = middle.to_rotation_matrix().into_inner();
        let psd = config.angle_noise_psd(&rate, measured, state.gyroscope_noise_psd);
        let scale = state.layout.scale();
        state.sums.add_rate(scale, &middle, measured, dt, psd);
        state.rate_sum += measured * dt;
        state.rest.rate(config, &state.initial_bias, measured, dt);
        state.since_force += dt;
        state.since_velocity_update += dt;
        state.since_field += dt;
        state.since_field_update += dt;
        state.compass.advance(dt);
    }
}

impl<T: Scalar, O: StepObserver<T>> Restorable for BoundedVelocity<T, O> {
    type State = BoundedVelocityState<T>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        state.check()?;
        self.begin(state);
        Ok(())
    }
}

impl<T: Scalar, O: StepObserver<T>> AttitudeEstimator<T> for BoundedVelocity<T, O> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        if initial.is_usable()
            && let Some(state) = BoundedVelocityState::start(&self.config, initial)
        {
            self.begin(state);
        }
    }

    fn restart(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() || self.state.gravity <= T::zero() {
            self.initialize(initial);
            return;
        }
        self.propagate_covariance();
        let mut state = self.state;
        state.turn_to(&self.config, initial);
        self.begin(state);
    }

    fn learnt(&self) -> Learnt<T> {
        self.state.learnt()
    }

    fn resume(&mut self, initial: &InitialState<T>, resumed: &Resumed<T>) {
        if !initial.is_usable() || self.state.gravity <= T::zero() {
            self.initialize(initial);
            return;
        }
        self.propagate_covariance();
        let mut state = self.state;
        state.resume(&self.config, initial, resumed);
        match state.check() {
            Ok(()) => self.begin(state),
            Err(_) => self.restart(initial),
        }
    }

    fn hard_iron(&self) -> Vector3<T> {
        self.state.hard_iron_ut
    }

    fn unexpected_hard_iron_std(&self) -> Option<Vector3<T>> {
        let is_expected = self.config.initial_hard_iron_std_ut > T::zero();
        self.state.hard_iron_std_ut().filter(|_| !is_expected)
    }

    #[inline]
    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        match checked_rate(angular_rate, &Vector3::zeros(), dt) {
            Ok(Some(rate)) => self.integrate(&rate, dt),
            Ok(None) => return Propagation::Done,
            Err(reason) => return Propagation::Skipped(reason),
        }
        if self.state.sums.time > self.config.update_interval_s * lit(MOST_INTERVALS) {
            self.propagate_covariance();
        }
        Propagation::Done
    }

    /// The record has two components: the horizontal velocity, m/s, which should be near zero.
    #[inline]
    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        self.take_force(specific_force)
    }

    /// The record is in level axes: east, north, up.
    #[inline]
    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        self.take_field(magnetic_field)
    }

    #[inline]
    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        self.take_compass(heading)
    }

    fn add_attitude_variance(&mut self, variance: T) {
        if !(variance > T::zero() && variance.is_finite()) {
            return;
        }
        // What was summed so far belongs to the time before.
        self.propagate_covariance();
        self.state.speed_hypotheses.widen(variance);
        self.state.hard_iron_watch.interrupt();
        self.tell(Moment::Leaving(&Step::Widening));
        let limit = self.config.maximum_attitude_std * self.config.maximum_attitude_std;
        for i in ATTITUDE..ATTITUDE + 3 {
            self.state.covariance[(i, i)] += variance;
            cap_variance(&mut self.state.covariance, i, limit);
        }
        self.tell(Moment::Predicted);
    }

    fn learn_gyroscope_noise(&mut self, psd: T) {
        let gain = self.config.gyroscope_noise_gain;
        let psd = psd * gain * gain;
        if psd >= T::zero() && psd.is_finite() {
            self.state.gyroscope_noise_psd = psd;
        }
    }

    fn attitude(&self) -> UnitQuaternion<T> {
        let now = self.attitude_in_reference();
        if self.config.prediction_s == T::zero() {
            return now;
        }
        now * so3::exp(&(self.state.angular_rate * self.config.prediction_s))
    }

    /// `R^T P R` of the attitude block, with the tilt that an accelerometer's bias hides (B22, B22b).
    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        let p: Matrix3<T> = part(&self.state.covariance, ATTITUDE, ATTITUDE);
        let p = p + self.unseen_tilt();
        let r = self.state.level_from_body.to_rotation_matrix().into_inner();
        let mut turned = turned3(&p, &r);
        undrown(&mut turned);
        Some(turned)
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        let p = part(&self.state.covariance, BIAS, BIAS);
        Some((self.state.gyroscope_bias, p))
    }

    fn start_uncertainty(&self) -> StartUncertainty<T> {
        StartUncertainty::of(&self.config.alignment_settings())
    }

    /// The rate whose corrected value is zero, to first order in the scale.
    fn rate_at_rest(&self) -> Vector3<T> {
        let bias = &self.state.gyroscope_bias;
        bias - self.state.scale * bias
    }
}

#[cfg(test)]
mod tests;
