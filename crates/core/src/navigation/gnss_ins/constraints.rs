//! What a GNSS/INS knows without being told: that it stands, that it does not slide, that it is no rocket.

use nalgebra::Vector3;

use super::stillness::WINDOW_S;
use super::updates::bound;
use super::{Aid, ERRORS, ErrorListener, GnssIns};
use crate::kalman::CountedGate;
use crate::navigation::VELOCITY;
use crate::navigation::aiding::{body_velocity, zero_velocity};
use crate::scalar::{Scalar, lit};

/// Standard deviation of a standing body's velocity, m/s: an idling engine, a swaying boat.
pub const STANDING_STD: f64 = 0.03;
/// A window at rest is accepted when the estimate is slower than so many of its standard deviations, and ...
const STANDING_SIGMAS: f64 = 3.0;
/// ... this (m/s): what a receiver or dead reckoning may be off by.
const STANDING_SPEED: f64 = 0.5;
/// Least standard deviation of a gyroscope's bias from one window at rest, rad/s.
const STANDING_RATE_STD: f64 = 1e-3;
/// How often the non-holonomic constraint is taken, s.
pub const CONSTRAINT_INTERVAL_S: f64 = 0.2;
/// The velocity is damped when no receiver has measured it for so long, s.
const DAMPED_AFTER_S: f64 = 2.0;
/// The estimate is sure of a speed less so many standard deviations.
const SURE_SIGMAS: f64 = 2.0;

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    pub(super) fn is_constraint_due(&self) -> bool {
        self.config.non_holonomic && self.memory.since_constraint >= lit(CONSTRAINT_INTERVAL_S)
    }

    /// What the filter knows without being told: that it stands, that it does not slide, that it is no rocket.
    pub(super) fn constrain(&mut self) {
        let at_rest = self.rest_window();
        if self.memory.due_window.take().is_some() {
            match at_rest {
                Some((rate, variance)) if self.memory.aligning => {
                    self.alignment.rate_at_rest(&rate, variance);
                }
                Some(window) => self.stand(window),
                None => {}
            }
            self.damp(lit(WINDOW_S));
        }
        if self.is_constraint_due() && self.runs_alone() {
            self.memory.since_constraint = T::zero();
            self.use_mount();
            let state = self.filter.state();
            let then = self
                .memory
                .history
                .at(state, self.config.gravity, T::zero());
            let arm = Vector3::from(self.config.vehicle_arm_m);
            let std = self.config.non_holonomic_std_m_s;
            let m = body_velocity::non_holonomic(&then, &self.memory.side, &arm, std * std);
            let innovation = self.fuse(Aid::NonHolonomic, &m);
            self.memory.counts[Aid::NonHolonomic as usize].count(&innovation);
        }
    }

    /// Pulls the velocity towards zero as weakly as its prior says over `duration`, when nothing has measured it (E31).
    pub(super) fn damp(&mut self, duration: T) {
        self.note_speed_in_outage(duration);
        let Some(variance) = self.damping_variance(duration) else {
            return;
        };
        let velocity = self.filter.state().velocity;
        let m = zero_velocity::damping(&velocity, variance);
        // It cannot be wrong by more than itself: no gate.
        let mut open = CountedGate::default();
        let (side, mut listener) = self.memory.followed(&mut self.listener);
        self.filter
            .fuse_sparse(side, &m, &mut open, T::zero(), &mut listener);
    }

    /// How fast the vehicle may have been as an outage began, and may have become in it as far as the estimate is sure of that.
    fn note_speed_in_outage(&mut self, duration: T) {
        let since = self.memory.since_velocity - lit(DAMPED_AFTER_S);
        let was_seen = self.memory.started && self.memory.fastest > T::zero();
        if since <= T::zero() || !was_seen {
            return;
        }
        let state = self.filter.state();
        let (speed, std) = (state.velocity.xy().norm(), state.velocity_std().xy().norm());
        let seen = if since <= duration {
            speed + std
        } else {
            speed - std * lit(SURE_SIGMAS)
        };
        self.memory.fastest = self.memory.fastest.max(seen);
    }

    /// Variance ((m/s)^2) with which the velocity is taken to be zero for `duration` seconds; `None` where something measures it
    /// (E31).
    pub fn damping_variance(&self, duration: T) -> Option<T> {
        let mut std = self.config.damping_speed_m_s;
        if self.memory.fastest > T::zero() {
            std = std.min(self.memory.fastest);
        }
        let measured = self.memory.since_velocity <= lit(DAMPED_AFTER_S);
        let none = measured || std <= T::zero() || duration <= T::zero() || !self.memory.started;
        (!none).then(|| std * std * (self.config.damping_time_s / duration))
    }

    /// Mean angular rate (rad/s) and its variance of the window at rest that the last sample has ended, if any: such windows
    /// are fused as zero velocity where [`GnssInsConfig::zero_velocity`](super::GnssInsConfig::zero_velocity) is set.
    pub fn rest_window(&self) -> Option<(Vector3<T>, T)> {
        let window = self.memory.due_window.as_ref()?;
        // The first window at rest may have begun before the stop.
        let least = lit(STANDING_RATE_STD * STANDING_RATE_STD);
        let variance = window.rate_variance.max(least);
        let stands = self.config.zero_velocity && self.memory.still_windows > 1;
        stands.then_some((window.mean_rate, variance))
    }

    /// Fuses a window at rest, unless the estimate moves faster than it can be wrong.
    fn stand(&mut self, (mean_rate, rate_variance): (Vector3<T>, T)) {
        if !self.runs_alone() {
            return;
        }
        let state = self.filter.state();
        let variance =
            state.covariance[(VELOCITY, VELOCITY)] + state.covariance[(VELOCITY + 1, VELOCITY + 1)];
        let slow = lit::<T>(STANDING_SPEED) + variance.max(T::zero()).sqrt() * lit(STANDING_SIGMAS);
        if state.velocity.norm() > slow {
            return;
        }
        let then = self
            .memory
            .history
            .at(state, self.config.gravity, T::zero());
        let m = zero_velocity::velocity(&then, lit(STANDING_STD * STANDING_STD));
        let innovation = self.fuse(Aid::ZeroVelocity, &m);
        self.memory.counts[Aid::ZeroVelocity as usize].count(&innovation);
        if innovation.outcome.is_fused() {
            let bias = self.filter.state().gyroscope_bias;
            let m = zero_velocity::rate(&mean_rate, &bias, rate_variance);
            let mut gate = self.memory.standing_rate_gate;
            let (side, mut listener) = self.memory.followed(&mut self.listener);
            self.filter
                .fuse_sparse(side, &m, &mut gate, bound(3), &mut listener);
            self.memory.standing_rate_gate = gate;
        }
    }
}
