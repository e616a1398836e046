//! Watches a run for the navigation benchmark: points without an estimate, and whether the estimator was lost.

use nalgebra::Vector3;

use super::SCORE_FROM_S;
use crate::navigation::observer::{NavigationObserver, ScoredPoint};
use crate::navigation::score::CHI_SQUARE_95;
use crate::statistics::seconds_between;

/// Beyond so many times the stated radius of 95 % ...
const LOST_TIMES: f64 = 5.0;
/// ... for so long is lost, s.
const LOST_FOR_S: f64 = 10.0;

/// Counts while a run goes on.
#[derive(Debug, Default)]
pub(super) struct Watch {
    first_fix_ns: Option<i64>,
    has_reference: bool,
    /// Points to score at, and those for which there was an estimate.
    due: u64,
    scored: u64,
    beyond_since_ns: Option<i64>,
    lost: bool,
}

impl Watch {
    /// Share of the points to score at for which there was an estimate; `None` without points.
    pub(super) fn answered(&self) -> Option<f64> {
        (self.due > 0).then(|| self.scored.min(self.due) as f64 / self.due as f64)
    }

    pub(super) fn is_lost(&self) -> bool {
        self.lost
    }

    fn counts(&self, time_ns: i64) -> bool {
        let first = self.first_fix_ns;
        first.is_some_and(|first| seconds_between(first, time_ns) >= SCORE_FROM_S)
    }
}

impl NavigationObserver for Watch {
    fn interval_ns(&self) -> i64 {
        i64::MAX
    }

    fn fix(&mut self, time_ns: i64, _ned: &Vector3<f64>, used: bool) {
        self.first_fix_ns.get_or_insert(time_ns);
        self.due += u64::from(!used && !self.has_reference && self.counts(time_ns));
    }

    fn reference(&mut self, time_ns: i64, _ned: &Vector3<f64>) {
        self.has_reference = true;
        self.due += u64::from(self.counts(time_ns));
    }

    fn scored(&mut self, point: &ScoredPoint) {
        if !self.counts(point.time_ns) {
            return;
        }
        self.scored += 1;
        // The radius of a circle with the same mean variance, that of the truth included.
        let variance = 0.5 * point.horizontal_std.powi(2) + point.truth_std.powi(2);
        let radius = (variance * CHI_SQUARE_95).sqrt();
        if point.error.xy().norm() <= LOST_TIMES * radius {
            self.beyond_since_ns = None;
            return;
        }
        let since = *self.beyond_since_ns.get_or_insert(point.time_ns);
        self.lost |= seconds_between(since, point.time_ns) >= LOST_FOR_S;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch(points: impl Iterator<Item = (f64, f64)>) -> Watch {
        let mut watch = Watch::default();
        watch.fix(0, &Vector3::zeros(), true);
        for (time_s, error) in points {
            let time_ns = (time_s * 1e9) as i64;
            watch.reference(time_ns, &Vector3::zeros());
            watch.scored(&ScoredPoint {
                time_ns,
                error: Vector3::new(error, 0.0, 0.0),
                horizontal_std: 2f64.sqrt(),
                vertical_std: 1.0,
                truth_std: 0.0,
                vertical: true,
            });
        }
        watch
    }

    #[test]
    fn ten_seconds_beyond_five_times_what_is_stated_is_lost() {
        // 2.448 m hold 95 %, 12.24 m are five times that.
        let errors = |error: f64, until: i32| {
            (0..30).map(move |t| {
                (
                    f64::from(t),
                    if (8..until).contains(&t) { error } else { 0.5 },
                )
            })
        };
        assert!(watch(errors(12.3, 19)).is_lost());
        assert!(!watch(errors(12.2, 19)).is_lost());
        assert!(!watch(errors(1e6, 18)).is_lost());
        // Before scores count nothing is lost.
        assert!(!watch((0..5).map(|t| (f64::from(t), 1e6))).is_lost());
    }

    #[test]
    fn points_without_an_estimate_are_counted() {
        let mut watch = watch((0..15).map(|t| (f64::from(t), 0.0)));
        for t in 15..25_i64 {
            watch.reference(t * 1_000_000_000, &Vector3::zeros());
        }
        assert_eq!(watch.answered(), Some(0.5));
        assert_eq!(Watch::default().answered(), None);
    }
}
