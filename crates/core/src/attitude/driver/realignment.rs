//! Beginning anew on the way: behind a hole that hid too much of a turn, and behind a step of the gyroscope's bias.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::holes::{HOLE_INTERVALS, LOST_RAD};
use super::{Aligning, AttitudeDriver, AttitudeEstimator};
use crate::attitude::InitialState;
use crate::attitude::alignment::{Alignment, Prior, level_covariance};
use crate::faults::bias_step::{BiasStep, Known};
use crate::faults::{Fault, FaultKind, FaultySensor};
use crate::geometry::{rotation, so3};
use crate::scalar::{Scalar, lit, to_f64};

/// It aligns again over this time (s), in which a hand's velocity (m/s) changes by about this much: the mean force is off
/// from the vertical by as much as their quotient of gravity.
const REALIGNMENT_S: f64 = 2.0;
const HAND_SPEED: f64 = 1.0;
/// Square of the distance, in standard deviations, beyond which the alignment afterwards contradicts the estimator.
const CONTRADICTS2: f64 = 11.3;

impl<T: Scalar, E: AttitudeEstimator<T>> AttitudeDriver<T, E> {
    /// Looks for a step of the gyroscope's bias in a rotation (rad/s, as measured, over `dt` seconds).
    pub(super) fn watch_bias(&mut self, rate: &Vector3<T>, dt: T) {
        let (estimator, start) = (&self.estimator, &self.memory.start);
        let known = || Known {
            attitude: estimator.attitude(),
            covariance: (estimator.attitude_covariance())
                .or(start.map(|start| start.attitude_covariance))
                .unwrap_or_else(Matrix3::zeros),
            learnt: estimator.learnt(),
        };
        if let Some(step) = self.memory.checks.bias.rotate(rate, dt, known)
            && self.memory.started
            && let Some(now_ns) = self.memory.now_ns
        {
            self.take_bias(&step, now_ns);
        }
    }

    /// Goes on with a bias that stepped, from what was known before the step: what was learnt since is wrong by it. What the window
    /// says of the attitude by itself is compared with that, as behind a hole.
    fn take_bias(&mut self, step: &BiasStep<T>, now_ns: i64) {
        let Some(start) = self.memory.start else {
            return;
        };
        let window_ns = (to_f64(step.window_s) * 1e9) as i64;
        self.memory.checks.log.happened(Fault {
            sensor: FaultySensor::Gyroscope,
            kind: FaultKind::BiasStep,
            from_ns: now_ns.saturating_sub(window_ns),
            until_ns: now_ns,
            is_over: true,
            size: step.size,
        });
        let initial = InitialState {
            attitude: step.resumed.attitude,
            attitude_covariance: step.resumed.attitude_covariance,
            gyroscope_bias: step.bias,
            gyroscope_bias_std: step.std,
            ..start
        };
        self.estimator.resume(&initial, &step.resumed);
        if self.memory.aligning.is_none() {
            let iron = step.mean.axes * self.estimator.hard_iron();
            let mean = &step.mean;
            let field = mean.field.filter(|_| self.memory.has_field);
            let field = field.map(|field| field - iron);
            let prior = self.realignment_prior();
            let alignment = Alignment::gathered(prior, mean.frame_from_body, mean.force, field);
            let drifted = step.std * step.window_s * lit(0.5);
            self.finish_realignment(&alignment, step.window_s, drifted);
        }
    }

    /// Begins to align again behind a hole of some length (s).
    pub(super) fn realign(&mut self, time_ns: i64, whole: T) {
        if !self.memory.started {
            self.begin_anew(whole);
            return;
        }
        if !self.memory.has_force {
            return;
        }
        self.memory.aligning = Some(Aligning {
            alignment: Alignment::new(self.realignment_prior()),
            since_ns: time_ns,
        });
        self.memory.is_realigning = true;
    }

    /// What was gathered for the start before a hole says nothing of the attitude behind it. Where every interval is as long,
    /// there is nothing better to start from.
    pub(super) fn begin_anew(&mut self, whole: T) {
        let usual = self.memory.checks.gyroscope.interval_s();
        if usual.is_none_or(|usual| whole > usual * lit(HOLE_INTERVALS)) {
            self.memory.aligning = None;
            self.memory.has_force = false;
            self.memory.has_field = false;
        }
    }

    fn realignment_prior(&self) -> Prior<T> {
        Prior {
            gyroscope_bias: self.estimator.rate_at_rest(),
            ..self.config.prior
        }
    }

    /// Ends the alignment behind a hole once it has gathered for long enough.
    pub(super) fn go_on_realigning(&mut self, alignment: &Alignment<T>, seconds: T) {
        if seconds >= lit(REALIGNMENT_S) {
            self.finish_realignment(alignment, lit(REALIGNMENT_S), T::zero());
        }
    }

    /// Compares what the samples behind a hole say by themselves with the estimator, which has seen them too, and takes
    /// it over where they contradict each other, or where it is better known.
    ///
    /// It has gathered for some `seconds`, and its frame may have `drifted` (rad).
    fn finish_realignment(&mut self, alignment: &Alignment<T>, seconds: T, drifted: T) {
        if !alignment.has_force() {
            return;
        }
        self.memory.aligning = None;
        self.memory.is_realigning = false;
        let Some(start) = self.memory.start else {
            return;
        };
        let mut start_uncertainty = self.estimator.start_uncertainty();
        let tilt = lit::<T>(HAND_SPEED / 9.81) / seconds + drifted;
        start_uncertainty.tilt_std = start_uncertainty.tilt_std.max(tilt);
        start_uncertainty.heading_std = start_uncertainty.heading_std.max(tilt);
        let mut initial = alignment.finish(&start_uncertainty);
        let now = self.estimator.attitude();
        let covariance = self.estimator.attitude_covariance();
        if !(self.memory.has_field && alignment.has_field()) {
            // The samples show where up is; the heading stays what it was, with its variance.
            let up = self.config.prior.frame.up::<T>();
            let up_now = now * (initial.attitude.inverse() * up);
            let level = UnitQuaternion::rotation_between(&up_now, &up);
            initial.attitude = rotation::renormalize(&(level.unwrap_or_default() * now));
            let up_body = initial.attitude.inverse() * up;
            let heading = covariance.map_or(T::zero(), |p| up_body.dot(&(p * up_body)));
            let tilt = start_uncertainty.tilt_std;
            let std = heading.max(T::zero()).sqrt();
            initial.attitude_covariance = level_covariance(&initial.attitude, &up, tilt, std);
        }
        if let Some(covariance) = covariance {
            let off = so3::log(&(now.inverse() * initial.attitude));
            let both = covariance + initial.attitude_covariance;
            let distance2 = both.cholesky().map(|c| off.dot(&c.solve(&off)));
            // So far apart a linear update did not find the way, whatever its covariance says.
            let is_near = off.norm_squared() < lit(0.25 * LOST_RAD * LOST_RAD);
            let agrees = is_near && distance2.is_some_and(|d2| d2 < lit(CONTRADICTS2));
            if agrees && covariance.trace() < initial.attitude_covariance.trace() {
                return;
            }
        }
        if let Some((bias, covariance)) = self.estimator.gyroscope_bias() {
            initial.gyroscope_bias = bias;
            initial.gyroscope_bias_std = covariance.diagonal().max().max(T::zero()).sqrt();
        }
        initial.references = start.references;
        initial.north_known = start.north_known;
        self.memory.checks.bias.interrupt();
        self.estimator.restart(&initial);
    }
}
