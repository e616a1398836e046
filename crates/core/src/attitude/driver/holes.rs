//! Time without a rate: how the state goes on over it, and how the turn that it hid is made up.

use nalgebra::{SymmetricEigen, Vector3};

use super::{AttitudeDriver, AttitudeEstimator};
use crate::faults::sample_check::Checked;
use crate::faults::{Fault, FaultKind, FaultySensor};
use crate::scalar::{Scalar, greater, lit, seconds};

/// The last rate is held over so many usual intervals before it relaxes.
const HELD_INTERVALS: f64 = 3.0;
/// An interval longer than so many usual ones is a hole.
pub(super) const HOLE_INTERVALS: f64 = 1.5;
/// A turn that was not seen, or not used, is worth an event from here on (rad): a degree.
pub(super) const NOTABLE_RAD: f64 = 0.0175;
/// An attitude that may have turned by more without being seen (rad) is aligned again: too far for a linear update.
pub(super) const LOST_RAD: f64 = 0.5;

impl<T: Scalar, E: AttitudeEstimator<T>> AttitudeDriver<T, E> {
    /// Moves the state to `time_ns` with the last rate held, and relaxing where that is too old.
    pub(super) fn advance_to(&mut self, time_ns: i64) {
        let Some(now) = self.memory.now_ns else {
            self.memory.now_ns = Some(time_ns);
            return;
        };
        if time_ns <= now {
            return;
        }
        self.memory.now_ns = Some(time_ns);
        let Some((last_ns, rate)) = self.memory.last_rate else {
            let unseen = self.memory.checks.motion;
            let variance = unseen.since(&Vector3::zeros(), seconds(now, time_ns));
            let still = self.rate_at_rest();
            self.propagate_in_steps(&still, seconds(now, time_ns));
            self.widen(variance.variance);
            return;
        };
        let usual = self.memory.checks.gyroscope.interval_s();
        let held: T = usual.map_or(self.config.gap_limit_s, |usual| usual * lit(HELD_INTERVALS));
        let [before, after] = [now, time_ns].map(|t| seconds::<T>(last_ns, t).max(T::zero()));
        let held_until = held.min(self.config.gap_limit_s).max(before);
        if after <= held_until {
            self.turn_by(&rate, after - before);
            return;
        }
        self.turn_by(&rate, held_until - before);
        self.coast(&rate, held_until, after);
    }

    /// Goes on from one age of the last rate to another, s: it relaxes to rest, and its error grows (F4).
    fn coast(&mut self, rate: &Vector3<T>, from: T, to: T) {
        let motion = self.memory.checks.motion;
        let still = self.rate_at_rest();
        let moving = rate - still;
        let [before, after] = [from, to].map(|age| motion.since(&moving, age));
        let time = to - from;
        let mean = still + moving * ((after.held_s - before.held_s) / time);
        self.memory.checks.turned += mean * time;
        self.propagate_in_steps(&mean, time);
        self.memory.checks.bias.interrupt();
        self.widen_to(after.variance);
    }

    /// Brings the variance that was added in this hole up to what is due.
    fn widen_to(&mut self, variance: T) {
        let more = variance - self.memory.checks.hole_variance;
        if more > T::zero() {
            self.widen(more);
            self.memory.checks.hole_variance = variance;
        }
    }

    pub(super) fn widen(&mut self, variance: T) {
        if self.memory.started {
            self.estimator.add_attitude_variance(variance);
        }
    }

    fn turn_by(&mut self, rate: &Vector3<T>, dt: T) {
        if dt > T::zero() {
            self.memory.checks.turned += rate * dt;
            self.propagate(rate, dt);
        }
    }

    /// A day without samples is as blind as an hour: the number of steps is bounded.
    pub(super) fn propagate_in_steps(&mut self, rate: &Vector3<T>, total: T) {
        if total <= self.config.gap_limit_s {
            // Nearly always.
            self.propagate(rate, total);
            return;
        }
        let step = self.config.gap_limit_s.max(total * lit(1e-3));
        let mut left = total;
        while left > T::zero() {
            let dt = left.min(step);
            self.propagate(rate, dt);
            left -= dt;
        }
    }

    /// Completes the interval between two gyroscope samples so that its turn was that of their mean, or, over a hole, of a
    /// rate that lies between them (F5). Samples that had waited are no hole where they were good.
    pub(super) fn finish_interval(
        &mut self,
        (last_ns, last): (i64, &Vector3<T>),
        (time_ns, rate): (i64, &Vector3<T>),
        checked: &Checked<T>,
    ) {
        let whole: T = seconds(last_ns, time_ns);
        let usual = self.memory.checks.gyroscope.interval_s();
        let is_long = usual.is_some_and(|usual| whole > usual * lit(HOLE_INTERVALS))
            || whole > self.config.gap_limit_s;
        let is_hole = is_long && !matches!(checked, Checked::Step(_));
        let due = if is_hole {
            self.turn_over_hole((last_ns, last), (time_ns, rate), whole)
        } else {
            self.memory.checks.motion.learn(last, rate, whole);
            if is_long {
                self.memory.checks.noise.interrupt();
            } else {
                self.learn_noise(rate);
            }
            (rate + last) * (whole * lit(0.5))
        };
        let mut missing = due + self.memory.passed_on - self.memory.checks.turned;
        if is_hole {
            missing = self.still_missing(&missing);
        }
        let checks = &mut self.memory.checks;
        checks.turned = Vector3::zeros();
        checks.hole_variance = T::zero();
        let now = self.memory.now_ns.unwrap_or(last_ns).max(last_ns);
        let remaining: T = seconds(now, time_ns);
        if remaining <= T::zero() {
            // The state is ahead of the sample: the next interval makes it good.
            self.memory.passed_on = missing;
            return;
        }
        self.memory.now_ns = Some(time_ns);
        // What is missing is applied over what is left of the interval; a sliver of it is not asked to turn at an absurd
        // rate, it passes the rest on to the next interval.
        let extra = (missing - last * remaining) / greater(remaining, whole * lit(0.25));
        let applied = last + extra;
        self.memory.passed_on = missing - applied * remaining;
        self.propagate_in_steps(&applied, remaining);
    }

    /// Learns how much white noise the gyroscope has, and tells the estimator.
    fn learn_noise(&mut self, rate: &Vector3<T>) {
        let checks = &mut self.memory.checks;
        let Some(interval) = checks.gyroscope.interval_s() else {
            return;
        };
        if checks.noise.add(rate, interval) && self.memory.started {
            self.estimator.learn_gyroscope_noise(checks.noise.psd());
        }
    }

    /// The turn between two samples with nothing between them, whose error becomes variance.
    fn turn_over_hole(
        &mut self,
        (last_ns, last): (i64, &Vector3<T>),
        (time_ns, rate): (i64, &Vector3<T>),
        whole: T,
    ) -> Vector3<T> {
        self.memory.checks.bias.interrupt();
        self.memory.checks.noise.interrupt();
        let still = self.rate_at_rest();
        let [before, after] = [last, rate].map(|rate| rate - still);
        let unseen = self.memory.checks.motion.between(&before, &after, whole);
        self.widen_to(unseen.variance);
        if self.memory.checks.hole_variance > lit(LOST_RAD * LOST_RAD) {
            self.realign(time_ns, whole);
        }
        let checks = &mut self.memory.checks;
        let was_told = checks.log.now(FaultySensor::Gyroscope).is_some();
        let notable = checks.hole_variance > lit(NOTABLE_RAD * NOTABLE_RAD);
        if !was_told && (notable || whole > self.config.gap_limit_s) {
            checks.log.happened(Fault {
                sensor: FaultySensor::Gyroscope,
                kind: FaultKind::Missing,
                from_ns: last_ns,
                until_ns: time_ns,
                is_over: true,
                size: whole,
            });
        }
        still * whole + (before + after) * unseen.held_s
    }

    /// What is left of the turn that a hole hid, where other sensors have shown a part of it since: as much as is left of
    /// the variance that was added for it (F5a). Applied in full it would turn what is right already.
    fn still_missing(&self, turn: &Vector3<T>) -> Vector3<T> {
        let added = self.memory.checks.hole_variance;
        let known = self.estimator.attitude_covariance();
        let known = known.filter(|_| self.memory.started && added > T::zero());
        let eigen = known.and_then(|p| SymmetricEigen::try_new(p, T::default_epsilon(), 50));
        let Some(eigen) = eigen else {
            return *turn;
        };
        let left = eigen.eigenvalues.map(|own| (own / added).min(T::one()));
        let left = eigen.eigenvectors.tr_mul(turn).component_mul(&left);
        eigen.eigenvectors * left
    }

    /// What the gyroscope shows at rest, as far as it is known (rad/s).
    pub(super) fn rate_at_rest(&self) -> Vector3<T> {
        if self.memory.started {
            self.estimator.rate_at_rest()
        } else {
            self.config.prior.gyroscope_bias
        }
    }
}
