//! Fixes weighed, not locked out: weights, the learnt scale of the receiver's noise, and the way out when fixes disagree
//! for long.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 12 (E37, E38).

use nalgebra::Vector3;

use super::inertial::STANDING_SPEED;
use super::{
    Aid, ERRORS, ErrorListener, ErrorShares, GnssIns, GnssPositionUpdate, ImuSamples, seconds,
};
use crate::kalman::Innovation;
use crate::navigation::aiding::gnss_position::GnssPosition;
use crate::navigation::error_state::SparseMeasurement;
use crate::navigation::error_state::sparse::{NOMINAL_NIS, Weighting};
use crate::navigation::in_motion_alignment::explanation::is_suspect;
use crate::scalar::{Scalar, lit};

/// Fixes that disagree, less twice those that agree, at which it aligns again, and ...
const MOST_DISAGREEING: u8 = 5;
/// ... from which on the solution is in doubt.
pub(super) const DOUBTED_FROM: u8 = 2;
/// Fixes nearer to each other (s) count as one.
const JUDGED_EVERY_S: f64 = 0.9;
/// A body moves when its speed is so many standard deviations.
const MOVING_SIGMAS: f64 = 3.0;
/// How long a speed is remembered, s.
const FASTEST_FORGOTTEN_S: f64 = 300.0;
/// How much of a NIS's excess goes into the logarithm of the scale.
const SCALE_GAIN: f64 = 0.05;

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Fuses what a receiver measured, weighed by how far it is off, or left out where its weight is not full; learns the
    /// scale of its aid. Without inertial unit nothing could align it again: there the gate decides, which lets in what insists.
    pub(super) fn fuse_weighted<const M: usize>(
        &mut self,
        measurement: &SparseMeasurement<T, M>,
        aid: Aid,
        all_or_nothing: bool,
    ) -> Innovation<T> {
        if self.config.imu_samples == ImuSamples::None {
            return self.fuse(aid, measurement);
        }
        let how = if all_or_nothing {
            Weighting::AllOrNothing
        } else if self.config.robust_weights {
            Weighting::Robust
        } else {
            Weighting::None
        };
        let seen = self.memory.bias_steps.seen(&measurement.rows);
        let (side, mut listener) = self.memory.followed(&mut self.listener);
        let record = self
            .filter
            .fuse_weighted(side, measurement, how, &mut listener);
        self.memory.bias_steps.learn(&seen, &record);
        self.learn_scale(measurement, &record, aid);
        record
    }

    /// Learns what the stated standard deviations are to be multiplied by (E38), as far as they are what is uncertain.
    fn learn_scale<const M: usize>(
        &mut self,
        measurement: &SparseMeasurement<T, M>,
        record: &Innovation<T>,
        aid: Aid,
    ) {
        if !record.outcome.is_fused() {
            return;
        }
        let m = lit::<T>(M as f64);
        let mut share = T::zero();
        for i in 0..M {
            share += measurement.variance[i] / record.covariance[(i, i)];
        }
        let excess = (record.nis / m).min(lit(4.0)) - T::one();
        if let Some(scale) = self.memory.noise_scale.get_mut(aid as usize) {
            *scale *= (excess * share / m * lit(SCALE_GAIN)).exp();
            let (least, largest) = (
                self.config.least_noise_scale,
                self.config.largest_noise_scale,
            );
            *scale = scale.max(least).min(largest);
        }
    }

    /// Whether a position with the very same digits as the last one comes from a receiver that is frozen: it does not where
    /// the body seems to stand.
    pub(super) fn is_frozen(&self) -> bool {
        let Some(state) = self.state() else {
            return false;
        };
        let std = state.velocity_std().xy().norm() * lit(MOVING_SIGMAS);
        let is_slow = std < lit(STANDING_SPEED);
        state.velocity.xy().norm() > std || !(is_slow || self.memory.may_be_still)
    }

    /// Remembers the fastest that the vehicle was, and forgets it slowly.
    pub(super) fn note_speed(&mut self, time_ns: i64) {
        let Some(state) = self.state() else {
            return;
        };
        let speed = state.velocity.xy().norm();
        let since = self
            .memory
            .last_fix_ns
            .map(|last| seconds::<T>(last, time_ns));
        let since = since.unwrap_or_else(T::zero).max(T::zero());
        let kept = (-since / lit(FASTEST_FORGOTTEN_S)).exp();
        self.memory.fastest = (self.memory.fastest * kept).max(speed);
    }

    /// Counts whether a position agrees; at so many that do not it aligns again from this one. Whether it does.
    pub(super) fn judge(&mut self, time_ns: i64, update: &GnssPositionUpdate<T>) -> bool {
        let due = |last: i64| seconds::<T>(last, time_ns).abs() >= lit(JUDGED_EVERY_S);
        if !self.memory.judged_ns.is_none_or(due) {
            return false;
        }
        self.memory.judged_ns = Some(time_ns);
        let parts = [&update.horizontal, &update.vertical];
        let degrees: u8 = parts.iter().map(|part| part.degrees_of_freedom).sum();
        let nis = parts.iter().fold(T::zero(), |sum, part| sum + part.nis);
        let row = usize::from(degrees).saturating_sub(1);
        let nominal = NOMINAL_NIS.get(row).copied().unwrap_or(NOMINAL_NIS[2]);
        let disagrees = nis > lit(nominal);
        self.memory.disagreeing = if disagrees {
            self.memory.disagreeing.saturating_add(1)
        } else {
            self.memory.disagreeing.saturating_sub(2)
        };
        if is_suspect(nis, degrees) && self.take_bias_step(time_ns, update) {
            // Whether it was the reason the next fixes say.
            self.memory.disagreeing = 1;
        }
        self.begin_bias_step(time_ns);
        self.memory.disagreeing >= MOST_DISAGREEING
    }

    /// Aligns again, from a position with which the state disagrees for long. The attitude of now stays one hypothesis.
    pub(super) fn align_again(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
    ) {
        self.memory.realignments = self.memory.realignments.saturating_add(1);
        self.memory.bias_steps.refuted();
        self.alignment.forget();
        self.alignment
            .begin_from(self.filter.state(), self.memory.noise_scale[0]);
        self.memory.unfed = self.memory.history.len();
        self.memory.unfed_s = self.memory.history.duration_s(HISTORY);
        self.memory.aligning = true;
        self.memory.aligned_since_ns = None;
        self.memory.disagreeing = 0;
        self.align_with_position(time_ns, fix, shares);
    }

    /// Variance of what changes from fix to fix: the receiver's own noise, the jitter of stamps, and what the lever arm is off
    /// by.
    pub(super) fn uncorrelated_variance(&self, white: &Vector3<T>) -> Vector3<T> {
        let jitter = self.filter.state().velocity * self.config.time_jitter_s;
        let arm = self.config.lever_arm_uncertainty_m();
        white.component_mul(white) + jitter.component_mul(&jitter) + Vector3::repeat(arm * arm)
    }
}
