//! Biases that step: where the fixes of a window say that a sensor has another bias from an interval on.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 7 (W25, W26).

use super::InMotionAlignmentConfig;
use super::bank::Bank;
use super::estimate::{Estimate, Triangle};
use super::explanation::{LOOKED_AT, Unexplained, solve};
use super::hypothesis::Hypothesis;
use super::window::{Interval, Linearization};
use crate::faults::FaultySensor;
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS};
use crate::scalar::{Scalar, lit};

/// Standard deviation of a step, in those of the bias at the start: less is learnt without being looked for.
pub(in crate::navigation) const STEP: f64 = 3.0;
/// Log evidence by which a step must explain the window better than none.
pub(in crate::navigation) const LEAST_GAIN: f64 = 8.0;
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
pub(super) struct Candidate<T> {
    sensor: FaultySensor,
    /// The first interval with the new bias.
    pub(super) interval: usize,
    /// Log evidence for it.
    pub(super) gain: T,
}

impl<T: Scalar> Estimate<T> {
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
}

impl<T: Scalar> Hypothesis<T> {
    /// The step that explains the window best (W26).
    pub(super) fn likeliest_step(
        &self,
        intervals: &[Interval<T>],
        unexplained: &Unexplained<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Candidate<T>> {
        let learnt = unexplained.learnt;
        let mut best: Option<Candidate<T>> = None;
        let (mut before, mut evidence) = (self.anchor, T::zero());
        for (i, interval) in intervals.iter().enumerate() {
            let rest = intervals.get(i..).unwrap_or_default();
            let looked_at = rest.len() <= LOOKED_AT;
            for sensor in SENSORS.into_iter().filter(|_| looked_at) {
                let stepped = before.with_step(sensor, interval, config);
                let Some(solved) = solve(&stepped, rest, learnt, config) else {
                    continue;
                };
                let gain = evidence + solved.fit.log_evidence - unexplained.log_evidence;
                if best.is_none_or(|best| gain > best.gain) {
                    best = Some(Candidate {
                        sensor,
                        interval: i,
                        gain,
                    });
                }
            }
            let after = before.after(interval, learnt, config)?;
            before = after.end;
            evidence += after.fit.log_evidence;
        }
        best
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
            let after = before.after(interval, learnt, config)?;
            before = after.end;
            departed += after.fit.log_evidence;
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

impl<T: Scalar, const K: usize> Bank<T, K> {
    /// Goes on with a step where one explains the window: every hypothesis has one of either sensor then, as far as there is
    /// room, and later fixes choose.
    // Not inlined: on a chip its memory is then free again for what follows.
    #[inline(never)]
    pub(super) fn take_step(
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
