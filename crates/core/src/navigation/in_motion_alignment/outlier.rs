//! Outliers that only later fixes show: a fix that the samples could not contradict when it came.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 8 (W27).

use super::InMotionAlignmentConfig;
use super::bank::Bank;
use super::bias_step::solve;
use super::hypothesis::Hypothesis;
use super::window::{Interval, Linearization, pass};
use crate::scalar::{Scalar, lit};

/// Log odds of an outlier against any other fix.
const LOG_ODDS: f64 = -4.6;
/// Fixes before one is looked for: fewer cannot outvote it.
pub(super) const FEWEST_FIXES: u32 = 4;

/// The fix that is the likeliest outlier of a window.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outlier<T> {
    /// At the end of this interval; `None`: the first of all.
    interval: Option<usize>,
    /// What it is off by, as the samples before it had it, m.
    std: T,
    /// Log evidence for it, its odds included.
    pub(super) gain: T,
}

impl<T: Scalar> Hypothesis<T> {
    /// The fix among the newest `looked_at` without which the window is explained best (W27), and the first of all where
    /// `has_first`. The newest is none: its own weight is for that.
    pub(super) fn likeliest_outlier(
        &self,
        intervals: &[Interval<T>],
        looked_at: usize,
        has_first: bool,
        scale: T,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Outlier<T>> {
        let learnt = self.learnt(scale, config);
        let about = Linearization::carried_back(&self.end.mean, intervals);
        let without = pass(&self.anchor, &about, intervals, learnt, config)?;
        let newest = without.fit.newest[0].0.residual.norm();
        let without = without.fit.log_evidence;
        let mut best: Option<Outlier<T>> = None;
        if has_first && intervals.len() < looked_at {
            let jumped = self.anchor.with_jump(newest);
            if let Some(solved) = solve(&jumped, intervals, learnt, config) {
                best = Some(Outlier {
                    interval: None,
                    std: newest,
                    gain: solved.fit.log_evidence - without + lit(LOG_ODDS),
                });
            }
        }
        let (mut before, mut evidence) = (self.anchor, T::zero());
        for (i, interval) in intervals.iter().enumerate() {
            let rest = intervals.get(i + 1..).unwrap_or_default();
            let (after, more, off) = before.after(interval, learnt, config)?;
            if !rest.is_empty() && rest.len() < looked_at && off > interval.outlier_std {
                let doubted = Interval {
                    outlier_std: off,
                    ..*interval
                };
                let (skipped, own, _) = before.after(&doubted, learnt, config)?;
                if let Some(solved) = solve(&skipped, rest, learnt, config) {
                    let evident = evidence + own + solved.fit.log_evidence;
                    let gain = evident - without + lit(LOG_ODDS);
                    if best.is_none_or(|best| gain > best.gain) {
                        best = Some(Outlier {
                            interval: Some(i),
                            std: off,
                            gain,
                        });
                    }
                }
            }
            before = after;
            evidence += more;
        }
        best
    }

    /// Solved anew, since a fix of the window has another weight than before.
    fn solve_again(
        &mut self,
        intervals: &[Interval<T>],
        scale: T,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<()> {
        self.about = Linearization::at(&self.anchor.mean);
        self.step(intervals, false, scale, config)?;
        self.step(intervals, false, scale, config)?;
        Some(())
    }
}

impl<T: Scalar, const K: usize> Bank<T, K> {
    /// Goes on without what a fix said.
    // Not inlined: on a chip its memory is then free again for what follows.
    #[inline(never)]
    pub(super) fn leave_out(
        &mut self,
        outlier: &Outlier<T>,
        intervals: &mut [Interval<T>],
        config: &InMotionAlignmentConfig<T>,
    ) {
        match outlier.interval {
            Some(i) => {
                if let Some(interval) = intervals.get_mut(i) {
                    interval.outlier_std = outlier.std;
                }
            }
            None => {
                for hypothesis in self.in_use_mut() {
                    hypothesis.anchor = hypothesis.anchor.with_jump(outlier.std);
                }
            }
        }
        let scale = self.scale;
        let mut kept = 0;
        for i in 0..self.count {
            let Some(hypothesis) = self.hypotheses.get_mut(i) else {
                break;
            };
            if hypothesis.solve_again(intervals, scale, config).is_some() {
                self.hypotheses.swap(kept, i);
                kept += 1;
            }
        }
        if kept > 0 {
            self.count = kept;
            self.order();
        }
    }
}
