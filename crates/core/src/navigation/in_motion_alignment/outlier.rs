//! Outliers that only later fixes show: a fix that the samples could not contradict when it came.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 8 (W27).

use super::InMotionAlignmentConfig;
use super::bank::Bank;
use super::explanation::{LOOKED_AT, Unexplained, solve};
use super::hypothesis::Hypothesis;
use super::robust_update::GROSS_LOG_ODDS;
use super::window::{Interval, Linearization, Pass};
use crate::scalar::{Scalar, lit};

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

impl<T: Scalar> Outlier<T> {
    /// The likelier of two.
    fn likelier(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        match (one, other) {
            (Some(one), Some(other)) if other.gain > one.gain => Some(other),
            (None, other) => other,
            (one, _) => one,
        }
    }
}

impl<T: Scalar> Hypothesis<T> {
    /// The fix among the newest [`LOOKED_AT`] without which the window is explained best (W27), but the first of all. The newest is none:
    /// its own weight is for that. `without` is the log evidence of the window as it is. The intervals are the same afterwards.
    fn likeliest_outlier(
        &self,
        intervals: &mut [Interval<T>],
        unexplained: &Unexplained<T>,
        (has_first, without): (bool, T),
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Outlier<T>> {
        let learnt = unexplained.learnt;
        let mut best: Option<Outlier<T>> = None;
        let mut before = self.anchor;
        for i in 0..intervals.len().saturating_sub(1) {
            let after = before.after(intervals.get(i)?, learnt, config)?;
            before = after.end;
            // The first velocity was made of the first two fixes: the second agrees with it whatever it is.
            let off = if has_first && i == 0 {
                unexplained.newest
            } else {
                after.fit.newest[0].0.residual.norm()
            };
            if intervals.len() - i > LOOKED_AT {
                continue;
            }
            let known = core::mem::replace(&mut intervals.get_mut(i)?.outlier_std, off);
            if off > known {
                let solved = solve(&self.anchor, intervals, learnt, config);
                let found = solved.map(|solved| self.outlier(Some(i), off, &solved, without));
                best = Outlier::likelier(best, found);
            }
            intervals.get_mut(i)?.outlier_std = known;
        }
        best
    }

    /// The first of all as an outlier.
    fn first_as_outlier(
        &self,
        intervals: &[Interval<T>],
        scale: T,
        (std, without): (T, T),
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Outlier<T>> {
        let jumped = self.anchor.with_jump(std);
        let solved = solve(&jumped, intervals, self.learnt(scale, config), config)?;
        Some(self.outlier(None, std, &solved, without))
    }

    /// What a window solved with it says.
    fn outlier(&self, interval: Option<usize>, std: T, solved: &Pass<T>, without: T) -> Outlier<T> {
        Outlier {
            interval,
            std,
            gain: self.departed + solved.fit.log_evidence - without + lit(GROSS_LOG_ODDS),
        }
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
    /// The likeliest outlier of the window: of its fixes under the best hypothesis, and of the first of all, where the window begins with
    /// that, under any: it may have chosen the best.
    pub(super) fn likeliest_outlier(
        &self,
        intervals: &mut [Interval<T>],
        unexplained: &Unexplained<T>,
        has_first: bool,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Outlier<T>> {
        let best = self.best()?;
        // What comes of solving anew is no evidence for an outlier.
        let anew = solve(&best.anchor, intervals, unexplained.learnt, config)?;
        let without = best.departed + unexplained.log_evidence.max(anew.fit.log_evidence);
        let mut found =
            best.likeliest_outlier(intervals, unexplained, (has_first, without), config);
        if has_first {
            let off = (unexplained.newest, without);
            for hypothesis in self.in_use() {
                let first = hypothesis.first_as_outlier(intervals, self.scale, off, config);
                found = Outlier::likelier(found, first);
            }
        }
        found
    }

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
        if self.is_whole(intervals) {
            self.refill(intervals);
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
