//! Time without a rate, and what the checks of the samples found: how the state goes on, and which events tell it.

use nalgebra::{Matrix3, SymmetricEigen, UnitQuaternion, Vector3};

use super::{Aligning, AttitudeDriver, AttitudeEstimator};
use crate::attitude::InitialState;
use crate::attitude::alignment::{Alignment, Prior, level_covariance};
use crate::faults::bias_step::{BiasStep, BiasWatch, Known};
use crate::faults::clipping::{Clipped, Clipping};
use crate::faults::rate_noise::RateNoise;
use crate::faults::sample_check::{Checked, SampleCheck};
use crate::faults::unseen_rotation::UnseenRotation;
use crate::faults::{Fault, FaultKind, FaultLog, FaultySensor};
use crate::geometry::{rotation, so3};
use crate::kalman::SkipReason;
use crate::scalar::{Scalar, greater, lit, seconds, to_f64};

/// The last rate is held over so many usual intervals before it relaxes.
const HELD_INTERVALS: f64 = 3.0;
/// An interval longer than so many usual ones is a hole.
const HOLE_INTERVALS: f64 = 1.5;
/// A turn that was not seen, or not used, is worth an event from here on (rad): a degree.
const NOTABLE_RAD: f64 = 0.0175;
/// Longer samples are no measurements (m/s^2, microtesla).
const LONGEST_SAMPLE: f64 = 1e6;
/// An attitude that may have turned by more without being seen (rad) is aligned again: too far for a linear update.
const LOST_RAD: f64 = 0.5;
/// It aligns again over this time (s), in which a hand's velocity (m/s) changes by about this much: the mean force is off
/// from the vertical by as much as their quotient of gravity.
const REALIGNMENT_S: f64 = 2.0;
const HAND_SPEED: f64 = 1.0;
/// Square of the distance, in standard deviations, beyond which the alignment afterwards contradicts the estimator.
const CONTRADICTS2: f64 = 11.3;
/// A field that repeats itself counts as measured again after this time: loggers tell a slow magnetometer's last value again for less.
const HELD_FIELD_NS: i64 = 1_000_000_000;
/// A spike of the accelerometer is one from here on, m/s^2; one of the magnetometer, as a share of the field.
const NOTABLE_FORCE: f64 = 40.0;
const NOTABLE_FIELD_SHARE: f64 = 0.5;

/// Whether a field is the one before, told again: many a table repeats the last one until the next comes. One that stays the same for
/// longer, as coarse values do at rest, counts once in [`HELD_FIELD_NS`].
fn is_told_again<T: Scalar>(
    check: &SampleCheck<T>,
    sensor: FaultySensor,
    time_ns: i64,
    before_ns: Option<i64>,
) -> bool {
    let (Some(since_ns), Some(before_ns)) = (check.repeats_since_ns(), before_ns) else {
        return false;
    };
    let times = |ns: i64| ns.saturating_sub(since_ns) / HELD_FIELD_NS;
    sensor == FaultySensor::Magnetometer && times(time_ns) == times(before_ns)
}

/// What the checks remember, and the hole or the fault under way.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Checks<T: Scalar> {
    pub(super) gyroscope: SampleCheck<T>,
    pub(super) accelerometer: SampleCheck<T>,
    pub(super) magnetometer: SampleCheck<T>,
    /// Of the gyroscope.
    clipping: Clipping<T>,
    pub(super) noise: RateNoise<T>,
    pub(super) motion: UnseenRotation<T>,
    pub(super) bias: BiasWatch<T>,
    pub(super) log: FaultLog<T>,
    /// Turn (rad) since the last rate, and the variance that was added for what was not seen (rad^2).
    pub(super) turned: Vector3<T>,
    hole_variance: T,
    /// The gyroscope is at the end of its range.
    saturation: Option<Saturation<T>>,
}

/// Time at the end of the range, and the variance that was added for what was not seen (rad^2).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Saturation<T: Scalar> {
    since_ns: i64,
    variance: T,
}

impl<T: Scalar> Checks<T> {
    pub(super) fn new(angle_random_walk: T) -> Self {
        Self {
            gyroscope: SampleCheck::of_gyroscope(),
            accelerometer: SampleCheck::of_accelerometer(),
            magnetometer: SampleCheck::default(),
            clipping: Clipping::default(),
            noise: RateNoise::default(),
            motion: UnseenRotation::new(angle_random_walk),
            bias: BiasWatch::default(),
            log: FaultLog::default(),
            turned: Vector3::zeros(),
            hole_variance: T::zero(),
            saturation: None,
        }
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let checks = [&self.gyroscope, &self.accelerometer, &self.magnetometer];
        let checks = checks.into_iter().flat_map(SampleCheck::numbers);
        let saturation = self
            .saturation
            .iter()
            .map(|saturation| &saturation.variance);
        let own = self
            .turned
            .iter()
            .chain([&self.hole_variance])
            .chain(saturation)
            .chain(self.clipping.numbers());
        let motion = self.motion.numbers().chain(self.bias.numbers());
        let motion = motion.chain(self.noise.numbers());
        checks.chain(motion).chain(self.log.numbers()).chain(own)
    }

    /// Whether the gyroscope is at the end of its range.
    pub(super) const fn is_saturated(&self) -> bool {
        self.saturation.is_some()
    }

    /// Whether a sample of a vector sensor may be used; `NotNewer` is found before.
    pub(super) fn permits(
        &mut self,
        sensor: FaultySensor,
        time_ns: i64,
        sample: &Vector3<T>,
    ) -> Result<(), SkipReason> {
        // What no sensor measures is the estimator's to refuse, and no neighbour of a sample.
        let is_measured = sample.norm_squared() <= lit(LONGEST_SAMPLE * LONGEST_SAMPLE);
        if !is_measured {
            return Ok(());
        }
        let check = match sensor {
            FaultySensor::Magnetometer => &mut self.magnetometer,
            _ => &mut self.accelerometer,
        };
        let fault = |kind, from_ns, size| Fault {
            sensor,
            kind,
            from_ns,
            until_ns: time_ns,
            is_over: false,
            size,
        };
        let before_ns = check.last_ns();
        match check.check(time_ns, sample) {
            Checked::Good if is_told_again(check, sensor, time_ns, before_ns) => {
                return Err(SkipReason::Repeated);
            }
            Checked::Good | Checked::Step(_) => self.log.ends(sensor, time_ns),
            Checked::Suspect => return Err(SkipReason::Suspect),
            Checked::Spike { from_ns, size } => {
                self.log.ends(sensor, time_ns);
                let notable = match sensor {
                    FaultySensor::Magnetometer => sample.norm() * lit(NOTABLE_FIELD_SHARE),
                    _ => lit(NOTABLE_FORCE),
                };
                if size > notable {
                    self.log.happened(fault(FaultKind::Spike, from_ns, size));
                }
            }
            Checked::Stuck { from_ns } => {
                let size = seconds(from_ns, time_ns);
                self.log.lasts(fault(FaultKind::Stuck, from_ns, size));
                return Err(SkipReason::Repeated);
            }
            Checked::Noise { from_ns } => {
                let size = seconds(from_ns, time_ns);
                self.log.lasts(fault(FaultKind::Noise, from_ns, size));
                return Err(SkipReason::Suspect);
            }
            // It still shows where up is better than nothing does; gates and weights of the filter see the rest.
            Checked::Saturated { full_scale } => {
                let open = self.log.now(sensor);
                let open = open.filter(|open| open.kind == FaultKind::Saturated);
                let from_ns = open.map_or(time_ns, |open| open.from_ns);
                self.log
                    .lasts(fault(FaultKind::Saturated, from_ns, full_scale));
            }
        }
        Ok(())
    }
}

impl<T: Scalar, E: AttitudeEstimator<T>> AttitudeDriver<T, E> {
    /// The oldest fault of the samples that was not taken yet. A fault that lasts comes twice: when it is found, and when
    /// it is over.
    pub fn take_fault(&mut self) -> Option<Fault<T>> {
        self.memory.checks.log.take()
    }

    /// The fault of a sensor under way.
    pub fn fault_now(&self, sensor: FaultySensor) -> Option<&Fault<T>> {
        self.memory.checks.log.now(sensor)
    }

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

    fn widen(&mut self, variance: T) {
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
    fn propagate_in_steps(&mut self, rate: &Vector3<T>, total: T) {
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
    fn rate_at_rest(&self) -> Vector3<T> {
        if self.memory.started {
            self.estimator.rate_at_rest()
        } else {
            self.config.prior.gyroscope_bias
        }
    }

    /// Begins to align again behind a hole of some length (s).
    fn realign(&mut self, time_ns: i64, whole: T) {
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
    fn begin_anew(&mut self, whole: T) {
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

    /// Takes what the check says of a gyroscope sample; whether the sample is a measurement.
    pub(super) fn heed(&mut self, time_ns: i64, sample: &Vector3<T>, checked: &Checked<T>) -> bool {
        let sensor = FaultySensor::Gyroscope;
        let interval = self.memory.checks.gyroscope.interval_s();
        match *checked {
            Checked::Good => {
                let checks = &mut self.memory.checks;
                let clipped = checks.clipping.look(&checks.gyroscope, time_ns, sample);
                if let Some(Clipped { level, from_ns }) = clipped {
                    self.saturated(time_ns, from_ns, level);
                    return true;
                }
            }
            Checked::Suspect => return false,
            Checked::Step(integral) => {
                if let Some((last_ns, last)) = self.memory.last_rate {
                    let whole: T = seconds(last_ns, time_ns);
                    let direct = (last + sample) * (whole * lit(0.5));
                    self.memory.passed_on += integral - direct;
                }
            }
            Checked::Spike { from_ns, size } => {
                if interval.is_some_and(|dt| size * dt > lit(NOTABLE_RAD)) {
                    self.memory.checks.log.happened(Fault {
                        sensor,
                        kind: FaultKind::Spike,
                        from_ns,
                        until_ns: time_ns,
                        is_over: true,
                        size,
                    });
                }
            }
            Checked::Stuck { from_ns } | Checked::Noise { from_ns } => {
                if let Some((last_ns, _)) = &mut self.memory.last_rate {
                    *last_ns = from_ns.min(*last_ns);
                }
                let size = seconds(from_ns, time_ns);
                let is_noise = matches!(checked, Checked::Noise { .. });
                self.memory.checks.log.lasts(Fault {
                    sensor,
                    kind: if is_noise {
                        FaultKind::Noise
                    } else {
                        FaultKind::Stuck
                    },
                    from_ns,
                    until_ns: time_ns,
                    is_over: false,
                    size,
                });
                return false;
            }
            Checked::Saturated { full_scale } => {
                let last = self.memory.last_rate;
                let from_ns = last.map_or(time_ns, |(last_ns, _)| last_ns);
                self.saturated(time_ns, from_ns, full_scale);
                return true;
            }
        }
        self.leave_saturation(time_ns);
        true
    }

    /// Back from the end of the range: where it may have turned too far for a linear update it is aligned again.
    fn leave_saturation(&mut self, time_ns: i64) {
        let checks = &mut self.memory.checks;
        let Some(saturation) = checks.saturation.take() else {
            return;
        };
        if saturation.variance > lit(LOST_RAD * LOST_RAD) {
            self.realign(time_ns, seconds(saturation.since_ns, time_ns));
        }
    }

    /// At the end of the range: what lies beyond is unknown, and as large as the range may be (F6).
    fn saturated(&mut self, time_ns: i64, from_ns: i64, full_scale: T) {
        let checks = &mut self.memory.checks;
        checks.bias.interrupt();
        let saturation = checks.saturation.get_or_insert(Saturation {
            since_ns: from_ns,
            variance: T::zero(),
        });
        let since_ns = saturation.since_ns;
        checks.log.lasts(Fault {
            sensor: FaultySensor::Gyroscope,
            kind: FaultKind::Saturated,
            from_ns: since_ns,
            until_ns: time_ns,
            is_over: false,
            size: full_scale,
        });
        let end = Vector3::repeat(full_scale);
        let unseen = (checks.motion).between(&end, &end, seconds(since_ns, time_ns));
        let more = unseen.variance - saturation.variance;
        saturation.variance = unseen.variance;
        self.widen(more);
    }
}
