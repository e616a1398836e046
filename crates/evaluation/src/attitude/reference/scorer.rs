//! The estimate at the instant of each reference sample, whatever clock the reference runs on.
//!
//! A reference is scored at its own instant, with the estimate interpolated (slerp) between the gyroscope samples around it.
//! The truth itself is never interpolated: references are often slower than the gyroscope, and what they do not show cannot
//! be made up. Between two gyroscope samples the rate is taken as constant by the estimators, too.
//!
//! The covariance is interpolated linearly. That is never too small: with weights `1 - s` and `s` the covariance of
//! `(1 - s) a + s b` is at most `(1 - s) P_a + s P_b`, however `a` and `b` are correlated.
//!
//! A reference in a pause of the estimates is not scored, because nothing says how the device turned there. A pause is an
//! interval above the limit of gaps, or above three usual ones unless it turned by less than a degree in all.

use std::collections::VecDeque;

use nalgebra::{Matrix3, UnitQuaternion};
use northing_recording::Reference;

use crate::attitude::EstimateRecord;

/// An interval of so many usual ones is no pause, however fast it turns.
const USUAL_INTERVALS: f64 = 3.0;
/// Turn within an interval, rad, up to which it may be longer: interpolation can be wrong by a part of it only.
const SMALL_TURN_RAD: f64 = 1.0 * std::f64::consts::PI / 180.0;
/// How long a reference waits for the next estimate, ns: the device's own orientation comes up to a second late.
const LONGEST_WAIT_NS: i64 = 2_000_000_000;

/// A reference sample with the estimate at its instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoredRecord {
    /// Time stamp of the reference, ns.
    pub time_ns: i64,
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// The estimate, `world_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Covariance (rad^2) of its local error in body axes.
    pub attitude_covariance: Option<Matrix3<f64>>,
    /// The reference.
    pub reference: Reference,
}

/// Brings references and estimates together; both come in time order, each on its own clock.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scorer {
    waiting: VecDeque<(i64, Reference)>,
    last: Option<Known>,
    gap_limit_s: f64,
    /// Estimates come after all references: a smoothed run.
    waits_for_ever: bool,
    /// Sum and number of the intervals between estimates that are no gaps.
    intervals: (f64, u64),
    in_gaps: u64,
}

#[derive(Debug, Clone, Copy)]
struct Known {
    time_ns: i64,
    time_s: f64,
    attitude: UnitQuaternion<f64>,
    covariance: Option<Matrix3<f64>>,
}

impl Scorer {
    pub(crate) fn new(gap_limit_s: f64, waits_for_ever: bool) -> Self {
        Self {
            gap_limit_s,
            waits_for_ever,
            ..Self::default()
        }
    }

    /// Takes a reference sample.
    pub(crate) fn reference(&mut self, time_ns: i64, reference: Reference) {
        let old = |t: i64| time_ns.saturating_sub(t) > LONGEST_WAIT_NS;
        while !self.waits_for_ever && self.waiting.front().is_some_and(|(t, _)| old(*t)) {
            let first = self.waiting.pop_front();
            self.missed(first.is_some_and(|(_, r)| r.scored));
        }
        self.waiting.push_back((time_ns, reference));
    }

    /// Takes an estimate, and gives that of each reference up to its instant.
    pub(crate) fn estimate(
        &mut self,
        record: &EstimateRecord,
        mut give: impl FnMut(&ScoredRecord),
    ) {
        let now = Known {
            time_ns: record.time_ns,
            time_s: record.time_s,
            attitude: record.attitude,
            covariance: record.attitude_covariance,
        };
        let interpolable = self.last.is_some_and(|last| self.joins(&last, &now));
        while let Some((time_ns, reference)) = self.waiting.front().copied()
            && time_ns <= now.time_ns
        {
            self.waiting.pop_front();
            let known = match self.last {
                _ if time_ns == now.time_ns => now,
                Some(last) if interpolable => between(&last, &now, time_ns),
                _ => {
                    self.missed(reference.scored);
                    continue;
                }
            };
            give(&ScoredRecord {
                time_ns,
                time_s: known.time_s,
                attitude: known.attitude,
                attitude_covariance: known.covariance,
                reference,
            });
        }
        self.last = Some(now);
    }

    /// References that count and fall between two estimates that are too far apart.
    pub(crate) fn in_gaps(&self) -> u64 {
        self.in_gaps
    }

    fn missed(&mut self, counts: bool) {
        // Before the first estimate there is no gap.
        self.in_gaps += u64::from(counts && self.last.is_some());
    }

    /// Whether what lies between these estimates can be interpolated.
    fn joins(&mut self, last: &Known, now: &Known) -> bool {
        let interval_s = now.time_s - last.time_s;
        if !(interval_s > 0.0 && interval_s <= self.gap_limit_s) {
            return false;
        }
        let (sum, count) = self.intervals;
        let usual = count == 0 || interval_s <= USUAL_INTERVALS * sum / count as f64;
        self.intervals = (sum + interval_s, count + 1);
        usual || last.attitude.angle_to(&now.attitude) <= SMALL_TURN_RAD
    }
}

/// The estimate at an instant between two.
fn between(last: &Known, now: &Known, time_ns: i64) -> Known {
    let whole = now.time_ns.saturating_sub(last.time_ns) as f64;
    let share = (time_ns - last.time_ns) as f64 / whole;
    let nearer = if share < 0.5 { last } else { now };
    let attitude = last.attitude.try_slerp(&now.attitude, share, 1e-9);
    let covariances = last.covariance.zip(now.covariance);
    Known {
        time_ns,
        time_s: last.time_s + share * (now.time_s - last.time_s),
        attitude: attitude.unwrap_or(nearer.attitude),
        covariance: covariances.map(|(a, b)| a * (1.0 - share) + b * share),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const MS: i64 = 1_000_000;

    fn heading(angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::z() * angle)
    }

    fn estimate(time_ns: i64, angle: f64) -> EstimateRecord {
        EstimateRecord {
            time_ns,
            time_s: time_ns as f64 * 1e-9,
            attitude: heading(angle),
            attitude_covariance: Some(Matrix3::identity() * angle),
            gyroscope_bias: None,
            position: None,
            velocity: None,
            reference: None,
            device: None,
        }
    }

    fn truth(angle: f64) -> Reference {
        Reference {
            attitude: heading(angle),
            scored: true,
        }
    }

    /// Estimates turn by 1 rad/s, references come between them: each meets the estimate of its own instant.
    #[test]
    fn references_meet_the_estimate_of_their_own_instant() {
        let mut scorer = Scorer::new(0.5, false);
        let mut given = Vec::new();
        for k in 0..100 {
            let time_ns = 25 * MS * k;
            scorer.estimate(&estimate(time_ns, time_ns as f64 * 1e-9), |r| {
                given.push(*r);
            });
            for other in [time_ns + 7 * MS, time_ns + 19 * MS] {
                scorer.reference(other, truth(other as f64 * 1e-9));
            }
        }
        assert_eq!((given.len(), scorer.in_gaps()), (198, 0));
        for record in given {
            let angle = record.attitude.angle_to(&record.reference.attitude);
            assert!(angle < 1e-9, "{angle} at {} s", record.time_s);
            assert!((record.time_s - record.time_ns as f64 * 1e-9).abs() < 1e-12);
            let variance = record.attitude_covariance.unwrap()[(0, 0)];
            assert!((variance - record.time_s).abs() < 1e-9);
        }
    }

    /// A hole of 0.2 s at 40 Hz in a turn of 60 deg/s is not bridged; one at rest is, up to the limit of gaps.
    #[test]
    fn references_in_a_pause_are_counted_and_not_scored() {
        let run = |angle: f64, pause_ms: i64| {
            let mut scorer = Scorer::new(0.5, false);
            let mut scored = 0;
            for k in 0..40 {
                scorer.estimate(&estimate(25 * MS * k, 0.0), |_| scored += 1);
            }
            let after = 25 * MS * 39 + pause_ms * MS;
            for k in 1..4 {
                scorer.reference(after - pause_ms * MS + k * 10 * MS, truth(0.0));
            }
            scorer.estimate(&estimate(after, angle), |_| scored += 1);
            (scored, scorer.in_gaps())
        };
        assert_eq!(run(0.2, 200), (0, 3));
        assert_eq!(run(0.01, 200), (3, 0));
        assert_eq!(run(0.01, 600), (0, 3));
        assert_eq!(run(0.2, 60), (3, 0));
    }

    #[test]
    fn before_the_first_estimate_nothing_is_scored_and_nothing_is_a_gap() {
        let mut scorer = Scorer::new(0.5, false);
        for k in 0..1000 {
            scorer.reference(10 * MS * k, truth(0.0));
        }
        assert!(scorer.waiting.len() <= 201, "{}", scorer.waiting.len());
        let mut scored = Vec::new();
        scorer.estimate(&estimate(9990 * MS, 0.1), |r| scored.push(r.time_ns));
        assert_eq!((scored, scorer.in_gaps()), (vec![9990 * MS], 0));
    }
}
