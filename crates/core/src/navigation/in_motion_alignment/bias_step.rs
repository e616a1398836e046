//! Biases that step: where the fixes of a window say that a sensor has another bias from an interval on.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 7 (W25, W26).

use super::bank::Bank;
use super::estimate::{Estimate, Triangle};
use super::hypothesis::Hypothesis;
use super::memory::Memory;
use super::outlier;
use super::window::{Fit, Interval, Learnt, Linearization, Pass, pass};
use super::{InMotionAlignment, InMotionAlignmentConfig};
use crate::faults::FaultySensor;
use crate::kalman::Innovation;
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION};
use crate::scalar::{Scalar, lit};

/// Standard deviation of a step, in those of the bias at the start: less is learnt without being looked for.
pub(in crate::navigation) const STEP: f64 = 3.0;
/// Log evidence by which a step must explain the window better than none.
pub(in crate::navigation) const LEAST_GAIN: f64 = 8.0;
/// NIS of three components of the newest fix from which one is looked for: one in ten has it by chance.
const SUSPECT_NIS: f64 = 6.25;
/// A step is looked for in so many of the newest intervals, which costs no more than a fix at the start.
const LOOKED_AT: usize = 6;
/// Fixes after samples that were no measurements before one is looked for.
pub(super) const UNSEEN_FIXES: u32 = LOOKED_AT as u32;
/// Fixes before one is looked for.
const FEWEST_FIXES: u32 = 6;
/// Variance of a time within an interval at which it may have been, as a share of the squared interval.
const WHEN: f64 = 1.0 / 3.0;
/// Log evidence of a hypothesis whose numbers have failed.
const FAILED: f64 = -1e30;
/// The sensors that may have stepped.
const SENSORS: [FaultySensor; 2] = [FaultySensor::Gyroscope, FaultySensor::Accelerometer];

/// A bias that has stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AlignmentStep<T> {
    /// Whose, as the best hypothesis has it.
    pub sensor: FaultySensor,
    /// By how much, in the sensor's unit.
    pub size: T,
    /// How long before the newest position, s.
    pub age_s: T,
}

/// The step that explains a window best.
#[derive(Debug, Clone, Copy)]
struct Candidate<T> {
    sensor: FaultySensor,
    /// The first interval with the new bias.
    interval: usize,
    /// Log evidence for it.
    gain: T,
}

impl<T: Scalar> Fit<T> {
    /// Whether the newest fix is off as one in ten is by chance.
    fn is_suspect(&self) -> bool {
        let [(position, _), (velocity, _), _] = &self.newest;
        let off = |record: &Innovation<T>| is_suspect(record.nis, record.degrees_of_freedom);
        off(position) || off(velocity)
    }
}

/// Whether a NIS is one that one in ten has by chance.
pub(in crate::navigation) fn is_suspect<T: Scalar>(nis: T, degrees_of_freedom: u8) -> bool {
    nis > lit(SUSPECT_NIS * f64::from(degrees_of_freedom) / 3.0)
}

impl<T: Scalar> Estimate<T> {
    /// With fixes that jump in the interval that begins here, by a standard deviation (m).
    pub(super) fn with_jump(&self, std: T) -> Self {
        let mut p = self.covariance.full();
        for i in 0..3 {
            p[(POSITION + i, POSITION + i)] += std * std;
        }
        Self {
            covariance: Triangle::of(&p),
            ..*self
        }
    }

    /// With a bias that steps in the interval that begins here (W25).
    fn with_step(
        &self,
        sensor: FaultySensor,
        interval: &Interval<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Self {
        let mut p = self.covariance.full();
        let variance = |std: T| std * std * lit(STEP * STEP);
        let time = interval.inertial.duration_s();
        for i in 0..3 {
            // Indices that are constant: on a chip they are checked when it is built.
            if sensor == FaultySensor::Gyroscope {
                let rate = variance(config.gyroscope_bias_std);
                p[(GYROSCOPE_BIAS + i, GYROSCOPE_BIAS + i)] += rate;
                p[(ATTITUDE + i, ATTITUDE + i)] += rate * time * time * lit(WHEN);
            } else {
                let force = variance(config.accelerometer_bias_std);
                p[(ACCELEROMETER_BIAS + i, ACCELEROMETER_BIAS + i)] += force;
            }
        }
        Self {
            covariance: Triangle::of(&p),
            ..*self
        }
    }

    /// What it is an interval later, with the log evidence of that and what the position was off by.
    pub(super) fn after(
        &self,
        interval: &Interval<T>,
        learnt: Learnt<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<(Self, T, T)> {
        let about = Linearization::at(&self.mean);
        let one = core::slice::from_ref(interval);
        let passed = pass(self, &about, one, learnt, config)?;
        let off = passed.fit.newest[0].0.residual.norm();
        Some((passed.end, passed.fit.log_evidence, off))
    }
}

impl<T: Scalar> Hypothesis<T> {
    /// The step that explains the window best, better than fixes that jump (W26).
    fn likeliest_step(
        &self,
        intervals: &[Interval<T>],
        scale: T,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Candidate<T>> {
        let learnt = self.learnt(scale, config);
        let about = Linearization::carried_back(&self.end.mean, intervals);
        let without = pass(&self.anchor, &about, intervals, learnt, config)?;
        let newest = without.fit.newest[0].0.residual.norm();
        let without = without.fit.log_evidence;
        let (mut best, mut jump): (Option<Candidate<T>>, _) = (None, T::zero());
        let (mut before, mut evidence) = (self.anchor, T::zero());
        for (i, interval) in intervals.iter().enumerate() {
            let rest = intervals.get(i..).unwrap_or_default();
            let looked_at = rest.len() <= LOOKED_AT;
            for sensor in SENSORS.into_iter().filter(|_| looked_at) {
                let stepped = before.with_step(sensor, interval, config);
                let Some(solved) = solve(&stepped, rest, learnt, config) else {
                    continue;
                };
                let gain = evidence + solved.fit.log_evidence - without;
                if best.is_none_or(|best| gain > best.gain) {
                    best = Some(Candidate {
                        sensor,
                        interval: i,
                        gain,
                    });
                }
            }
            if looked_at {
                let about = Linearization::at(&before.mean);
                let jumped = pass(&before.with_jump(newest), &about, rest, learnt, config);
                let evident = jumped.map_or(without, |p| evidence + p.fit.log_evidence);
                jump = jump.max(evident - without);
            }
            let (after, more, _) = before.after(interval, learnt, config)?;
            before = after;
            evidence += more;
        }
        best.filter(|best| best.gain > jump)
    }

    /// The same with a step: the window begins with it, and what was before is part of the anchor.
    fn with_step(
        &self,
        step: &Candidate<T>,
        intervals: &[Interval<T>],
        scale: T,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Self> {
        let learnt = self.learnt(scale, config);
        let (mut before, mut departed) = (self.anchor, self.departed);
        for interval in intervals.get(..step.interval)? {
            let (after, more, _) = before.after(interval, learnt, config)?;
            before = after;
            departed += more;
        }
        let rest = intervals.get(step.interval..)?;
        let anchor = before.with_step(step.sensor, rest.first()?, config);
        let solved = solve(&anchor, rest, learnt, config)?;
        let branch = u8::from(step.sensor == FaultySensor::Gyroscope) + 1;
        Some(Self {
            anchor,
            about: Linearization::carried_back(&solved.end.mean, rest),
            departed,
            log_evidence: departed + solved.fit.log_evidence,
            end: solved.end,
            nis: solved.fit.nis,
            steps: self.steps.wrapping_mul(4).wrapping_add(branch),
        })
    }

    /// Whose bias the last step was of.
    pub(super) fn stepped_sensor(&self) -> Option<FaultySensor> {
        match self.steps % 4 {
            0 => None,
            1 => Some(FaultySensor::Accelerometer),
            _ => Some(FaultySensor::Gyroscope),
        }
    }
}

/// A window solved anew: twice, since the first time is linear about the bias of before.
pub(super) fn solve<T: Scalar>(
    anchor: &Estimate<T>,
    intervals: &[Interval<T>],
    learnt: Learnt<T>,
    config: &InMotionAlignmentConfig<T>,
) -> Option<Pass<T>> {
    let about = Linearization::at(&anchor.mean);
    let first = pass(anchor, &about, intervals, learnt, config)?;
    let about = Linearization::carried_back(&first.end.mean, intervals);
    pass(anchor, &about, intervals, learnt, config)
}

impl<T: Scalar, const K: usize> Bank<T, K> {
    /// Goes on with a step where one explains the window: every hypothesis has one of either sensor then, as far as there is
    /// room, and later fixes choose.
    // Not inlined: on a chip its memory is then free again for what follows.
    #[inline(never)]
    fn take_step(
        &mut self,
        likeliest: &Candidate<T>,
        intervals: &[Interval<T>],
        config: &InMotionAlignmentConfig<T>,
    ) {
        let scale = self.scale;
        let with = |hypothesis: Option<&Hypothesis<T>>, sensor| {
            let step = Candidate {
                sensor,
                ..*likeliest
            };
            hypothesis?.with_step(&step, intervals, scale, config)
        };
        let other = match likeliest.sensor {
            FaultySensor::Gyroscope => FaultySensor::Accelerometer,
            _ => FaultySensor::Gyroscope,
        };
        let count = self.count;
        let (mut end, mut failed) = (count, 0);
        for i in 0..count {
            if 2 * count <= K
                && let Some(second) = with(self.hypotheses.get(i), other)
                && let Some(place) = self.hypotheses.get_mut(end)
            {
                *place = second;
                end += 1;
            }
            let first = with(self.hypotheses.get(i), likeliest.sensor);
            if let Some(place) = self.hypotheses.get_mut(i) {
                if let Some(first) = first {
                    *place = first;
                } else {
                    // Ordered, it is the last.
                    place.log_evidence = lit(FAILED);
                    failed += 1;
                }
            }
        }
        self.count = end;
        self.order();
        self.count = end - failed;
    }
}

impl<T: Scalar, const K: usize, const N: usize> InMotionAlignment<T, K, N> {
    /// Tells that samples of now stand for measurements: what their noise does not explain is no step of a bias.
    pub(in crate::navigation) fn samples_are_unseen(&mut self) {
        self.memory.unseen = UNSEEN_FIXES;
    }
}

impl<T: Scalar, const K: usize, const N: usize> Memory<T, K, N> {
    /// Looks for a step where the newest fix is far off the best hypothesis, and goes on with it. The window has room then.
    pub(super) fn look_for_step(&mut self, fit: &Fit<T>, config: &InMotionAlignmentConfig<T>) {
        let Some(bank) = &mut self.bank else {
            return;
        };
        let unseen = self.unseen;
        self.unseen = unseen.saturating_sub(1);
        let is_told = self.untold == 0;
        self.untold = self.untold.saturating_sub(1);
        if bank.fixes < outlier::FEWEST_FIXES || !fit.is_suspect() {
            return;
        }
        let intervals = self.window.intervals_mut();
        let best = bank.best();
        let has_first = bank.fixes as usize == intervals.len();
        let outlier = best
            .and_then(|best| {
                best.likeliest_outlier(intervals, LOOKED_AT, has_first, bank.scale, config)
            })
            .filter(|outlier| outlier.gain > T::zero());
        let is_step_possible = bank.fixes >= FEWEST_FIXES && unseen == 0;
        let step = best
            .filter(|_| is_step_possible)
            .and_then(|best| best.likeliest_step(intervals, bank.scale, config))
            .filter(|step| step.gain >= lit(LEAST_GAIN));
        if let Some(outlier) = outlier
            && step.is_none_or(|step| outlier.gain > step.gain)
        {
            bank.leave_out(&outlier, intervals, config);
            self.disagreeing = 0;
            return;
        }
        let Some(step) = step else {
            return;
        };
        let biases = |bank: &Bank<T, K>| {
            let mean = bank.best().map(|best| best.end.mean);
            mean.map(|mean| (mean.gyroscope_bias, mean.accelerometer_bias))
        };
        let before = biases(bank);
        bank.take_step(&step, self.window.intervals(), config);
        self.window.drop_first(step.interval);
        self.disagreeing = 0;
        let sensor = bank.best().and_then(Hypothesis::stepped_sensor);
        let sensor = sensor.filter(|_| is_told);
        if let (Some(sensor), Some(before), Some(after)) = (sensor, before, biases(bank)) {
            let moved = match sensor {
                FaultySensor::Gyroscope => after.0 - before.0,
                _ => after.1 - before.1,
            };
            let ages = self.window.intervals().iter();
            self.step = Some(AlignmentStep {
                sensor,
                size: moved.norm(),
                age_s: ages.fold(T::zero(), |age, one| age + one.inertial.duration_s()),
            });
        }
    }
}
