//! Scoring that experiments share: which instants count, root mean squares, medians, the band of a consistent coverage.

use northing_evaluation::statistics;

/// Between two instants that are scored, s.
pub(crate) const EVERY_S: f64 = 0.1;
/// So long nothing is scored, s: an attitude estimator finds its start.
const SKIP_S: f64 = 5.0;
/// Coverage of a stated 95 % in one world that is called consistent.
pub(crate) const CONSISTENT: [f64; 2] = [0.90, 0.99];

/// Takes ten instants a second, from five seconds on.
#[derive(Debug)]
pub(crate) struct Thinned {
    next_s: f64,
    tolerance_s: f64,
}

impl Thinned {
    /// An instant may come this much too early, s: as much as its stamps are rounded.
    pub(crate) const fn new(tolerance_s: f64) -> Self {
        Self {
            next_s: SKIP_S,
            tolerance_s,
        }
    }

    /// Whether the instant at this time is one of those.
    pub(crate) fn takes(&mut self, time_s: f64) -> bool {
        let takes = time_s + self.tolerance_s >= self.next_s;
        if takes {
            self.next_s = (self.next_s + EVERY_S).max(time_s + 0.5 * EVERY_S);
        }
        takes
    }
}

/// Whether such a coverage is that of a consistent estimator.
pub(crate) fn is_consistent(coverage: f64) -> bool {
    let [low, high] = CONSISTENT;
    (low..=high).contains(&coverage)
}

/// Root mean square; `None` without any error.
pub(crate) fn rms(errors: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = errors.fold((0_usize, 0.0), |(n, sum), e| (n + 1, sum + e * e));
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// The middle value, or the mean of the two middle ones; `None` without any.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    statistics::median(&values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_are_a_tenth_of_a_second_apart_whatever_the_rate() {
        let taken = |rate: u32| -> Vec<f64> {
            let mut thinned = Thinned::new(1e-9);
            let times = (0..7 * rate).map(|k| f64::from(k) / f64::from(rate));
            times.filter(|time_s| thinned.takes(*time_s)).collect()
        };
        for rate in [10, 50, 1000] {
            let taken = taken(rate);
            assert_eq!(taken.len(), 20, "{rate}");
            assert!((taken[0] - 5.0).abs() < 1e-9 && (taken[19] - 6.9).abs() < 1e-9);
        }
        // Slower than that, every one counts.
        assert_eq!(taken(4).len(), 8);
        let mut thinned = Thinned::new(1e-6);
        let taken = (0..10_000).filter(|k| thinned.takes(f64::from(*k) * 0.002));
        assert_eq!(taken.count(), 150);
    }

    #[test]
    fn a_median_of_two_is_their_mean_and_of_none_is_none() {
        assert_eq!(median(vec![3.0, 1.0]), Some(2.0));
        assert_eq!(median(vec![9.0, 1.0, 4.0]), Some(4.0));
        assert_eq!((median(Vec::new()), rms([].into_iter())), (None, None));
        assert_eq!(rms([3.0, -3.0].into_iter()), Some(3.0));
    }
}
