//! What explains a fix that is far off: an outlier among those before it, a bias that has stepped, or a receiver worse than it says.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, sections 7 and 8 (W26, W26a, W27).

use super::bank::Bank;
use super::bias_step::{AlignmentStep, Candidate, LEAST_GAIN};
use super::estimate::{Estimate, Triangle};
use super::hypothesis::Hypothesis;
use super::memory::Memory;
use super::window::{Fit, Interval, Learnt, Linearization, Pass, pass};
use super::{InMotionAlignment, InMotionAlignmentConfig};
use crate::faults::FaultySensor;
use crate::kalman::Innovation;
use crate::navigation::POSITION;
use crate::scalar::{Scalar, lit};

/// NIS of three components of the newest fix from which an explanation is looked for: one in ten has it by chance.
const SUSPECT_NIS: f64 = 6.25;
/// It is looked for in so many of the newest intervals: either costs no more than two fixes of eight hypotheses then.
pub(super) const LOOKED_AT: usize = 6;
/// Fixes after samples that were no measurements before a step is looked for.
pub(super) const UNSEEN_FIXES: u32 = LOOKED_AT as u32;
/// Fixes before a step is looked for.
const FEWEST_FOR_STEP: u32 = 6;
/// A receiver that is worse than it says may be so many times worse than was learnt.
const WORSE_BY: [f64; 3] = [2.0, 4.0, 8.0];
/// Fixes before an outlier is looked for: fewer cannot outvote it.
const FEWEST_FOR_OUTLIER: u32 = 4;

/// A window as it is, in which something is to be explained.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unexplained<T> {
    pub(super) learnt: Learnt<T>,
    /// What the newest position is off by, m.
    pub(super) newest: T,
    pub(super) log_evidence: T,
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

    /// A pass through one interval from here, linear about here.
    pub(super) fn after(
        &self,
        interval: &Interval<T>,
        learnt: Learnt<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Pass<T>> {
        let about = Linearization::at(&self.mean);
        pass(
            self,
            &about,
            core::slice::from_ref(interval),
            learnt,
            config,
        )
    }
}

impl<T: Scalar> Hypothesis<T> {
    /// The window as it is.
    fn unexplained(
        &self,
        intervals: &[Interval<T>],
        scale: T,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Unexplained<T>> {
        let learnt = self.learnt(scale, config);
        let about = Linearization::carried_back(&self.end.mean, intervals);
        let fit = pass(&self.anchor, &about, intervals, learnt, config)?.fit;
        Some(Unexplained {
            learnt,
            newest: fit.newest[0].0.residual.norm(),
            log_evidence: fit.log_evidence,
        })
    }

    /// Log evidence for a receiver whose noise is larger than was learnt until now, and its scale (W26a).
    fn gain_of_noise(
        &self,
        intervals: &[Interval<T>],
        unexplained: &Unexplained<T>,
        scale: T,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<(T, T)> {
        let about = Linearization::carried_back(&self.end.mean, intervals);
        let mut best: Option<(T, T)> = None;
        for factor in WORSE_BY {
            let scale = (scale * lit(factor)).min(config.largest_noise_scale);
            let learnt = self.learnt(scale, config);
            let Some(pass) = pass(&self.anchor, &about, intervals, learnt, config) else {
                continue;
            };
            let gain = pass.fit.log_evidence - unexplained.log_evidence;
            if best.is_none_or(|(most, _)| gain > most) {
                best = Some((gain, scale));
            }
        }
        best
    }

    /// Log evidence for fixes that jump in one of the newest [`LOOKED_AT`] intervals, and stay there. With `has_first` not in the first of
    /// them: that is a first fix that is an outlier.
    fn gain_of_jump(
        &self,
        intervals: &[Interval<T>],
        unexplained: &Unexplained<T>,
        has_first: bool,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<T> {
        let learnt = unexplained.learnt;
        let mut gain = T::zero();
        let (mut before, mut evidence) = (self.anchor, T::zero());
        for (i, interval) in intervals.iter().enumerate() {
            let rest = intervals.get(i..).unwrap_or_default();
            if rest.len() <= LOOKED_AT && !(has_first && i == 0) {
                let about = Linearization::at(&before.mean);
                let jumped = before.with_jump(unexplained.newest);
                if let Some(jumped) = pass(&jumped, &about, rest, learnt, config) {
                    let evident = evidence + jumped.fit.log_evidence;
                    gain = gain.max(evident - unexplained.log_evidence);
                }
            }
            let after = before.after(interval, learnt, config)?;
            before = after.end;
            evidence += after.fit.log_evidence;
        }
        Some(gain)
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

impl<T: Scalar, const K: usize, const N: usize> InMotionAlignment<T, K, N> {
    /// Tells that samples of now stand for measurements: what their noise does not explain is no step of a bias.
    pub(in crate::navigation) fn samples_are_unseen(&mut self) {
        self.memory.unseen = UNSEEN_FIXES;
    }
}

impl<T: Scalar, const K: usize, const N: usize> Memory<T, K, N> {
    /// Where the newest fix is far off the best hypothesis: looks for what explains it, and goes on with that. The window
    /// has room then.
    pub(super) fn explain(&mut self, fit: &Fit<T>, config: &InMotionAlignmentConfig<T>) {
        let Some(bank) = &mut self.bank else {
            return;
        };
        let unseen = self.unseen;
        self.unseen = unseen.saturating_sub(1);
        let is_told = self.untold == 0;
        self.untold = self.untold.saturating_sub(1);
        if bank.fixes < FEWEST_FOR_OUTLIER || !fit.is_suspect() {
            return;
        }
        let intervals = self.window.intervals_mut();
        let has_first = bank.is_whole(intervals);
        let best = bank.best();
        let Some((best, unexplained)) =
            best.and_then(|best| Some((best, best.unexplained(intervals, bank.scale, config)?)))
        else {
            return;
        };
        let outlier = bank
            .likeliest_outlier(intervals, &unexplained, has_first, config)
            .filter(|outlier| outlier.gain > T::zero());
        let may_have_stepped = bank.fixes >= FEWEST_FOR_STEP && unseen == 0;
        let step = may_have_stepped
            .then(|| best.likeliest_step(intervals, &unexplained, config))
            .flatten()
            .filter(|step| step.gain >= lit(LEAST_GAIN));
        if outlier.is_none() && step.is_none() {
            return;
        }
        let Some(jump) = best.gain_of_jump(intervals, &unexplained, has_first, config) else {
            return;
        };
        let noise = may_have_stepped
            .then(|| best.gain_of_noise(intervals, &unexplained, bank.scale, config))
            .flatten();
        if let Some((gain, scale)) = noise
            && gain > jump.max(lit(LEAST_GAIN))
            && outlier.as_ref().is_none_or(|outlier| gain > outlier.gain)
            && step.as_ref().is_none_or(|step| gain > step.gain)
        {
            // Many fixes are off, and each in its own way.
            bank.scale = scale;
            return;
        }
        let outlier = outlier.filter(|outlier| outlier.gain > jump);
        let step = step.filter(|step| step.gain > jump);
        match (outlier, step) {
            (Some(outlier), step) if step.is_none_or(|step| outlier.gain > step.gain) => {
                bank.leave_out(&outlier, intervals, config);
                self.disagreeing = 0;
            }
            (_, Some(step)) => self.go_on_with_step(&step, is_told, config),
            _ => {}
        }
    }

    /// Goes on with a step of a bias, and tells it.
    fn go_on_with_step(
        &mut self,
        step: &Candidate<T>,
        is_told: bool,
        config: &InMotionAlignmentConfig<T>,
    ) {
        let Some(bank) = &mut self.bank else {
            return;
        };
        let biases = |bank: &Bank<T, K>| {
            let mean = bank.best().map(|best| best.end.mean);
            mean.map(|mean| (mean.gyroscope_bias, mean.accelerometer_bias))
        };
        let before = biases(bank);
        bank.take_step(step, self.window.intervals(), config);
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
