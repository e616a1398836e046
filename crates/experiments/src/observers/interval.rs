//! How much better one scheme is than another, with a confidence interval over flights.
//!
//! Both schemes fly the same flights, so the flights are drawn anew with replacement, in pairs
//! (bootstrap): nothing is assumed about how errors are distributed.

use northing_simulation::random::stream;
use rand::RngExt as _;

use super::tuning::Aggregate;

/// Times the flights are drawn anew.
const DRAWS: usize = 2000;

/// A gain in percent and its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// `100 (1 - new / old)`: above zero where the new one is better.
    pub percent: f64,
    /// Bounds that hold the gain over all flights of this kind in 95 % of the cases; with less than ten
    /// flights in fewer.
    pub ci95: [f64; 2],
}

impl Gain {
    /// The gain of `new` over `old`, errors of the same flights in the same order.
    #[must_use]
    pub fn between(old: &[f64], new: &[f64], aggregate: Aggregate) -> Self {
        let percent =
            |old: &[f64], new: &[f64]| 100.0 * (1.0 - aggregate.of(new) / aggregate.of(old));
        let count = old.len().min(new.len());
        let mut drawn = bootstrap(count, count, |picked| {
            let pick = |errors: &[f64]| -> Vec<f64> { picked.iter().map(|i| errors[*i]).collect() };
            percent(&pick(old), &pick(new))
        });
        Self {
            percent: percent(old, new),
            ci95: bounds(&mut drawn, 0.95),
        }
    }
}

/// Bounds that hold the aggregate error over all flights of this kind in 95 % of the cases.
#[must_use]
pub fn error_ci95(errors: &[f64], aggregate: Aggregate) -> [f64; 2] {
    let mut drawn = bootstrap(errors.len(), errors.len(), |picked| {
        let pick: Vec<f64> = picked.iter().map(|i| errors[*i]).collect();
        aggregate.of(&pick)
    });
    bounds(&mut drawn, 0.95)
}

/// Bounds that hold a value of `size` flights, out of `count`, in the share `coverage` of the cases;
/// `value` is asked for each drawing with the numbers of its flights.
#[must_use]
pub fn interval(
    count: usize,
    size: usize,
    coverage: f64,
    value: impl FnMut(&[usize]) -> f64,
) -> [f64; 2] {
    bounds(&mut bootstrap(count, size, value), coverage)
}

/// The value of `size` flights drawn from `count`, as often as [`DRAWS`].
fn bootstrap(count: usize, size: usize, mut value: impl FnMut(&[usize]) -> f64) -> Vec<f64> {
    if count == 0 {
        return Vec::new();
    }
    let mut random = stream(1, "bootstrap");
    let mut picked = vec![0; size];
    (0..DRAWS)
        .map(|_| {
            picked.fill_with(|| random.random_range(0..count));
            value(&picked)
        })
        .collect()
}

fn bounds(drawn: &mut [f64], coverage: f64) -> [f64; 2] {
    drawn.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * (drawn.len().saturating_sub(1)) as f64).round() as usize;
        drawn.get(index).copied().unwrap_or(f64::NAN)
    };
    let outside = 0.5 * (1.0 - coverage);
    [at(outside), at(1.0 - outside)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_simulation::random::standard_normal;

    #[test]
    fn the_interval_holds_the_truth_as_often_as_it_says() {
        let mut random = stream(7, "errors");
        let mut inside = 0;
        for _ in 0..200 {
            let draw = |mean: f64, random: &mut _| mean + 0.3 * standard_normal(random);
            let old: Vec<f64> = (0..40).map(|_| draw(2.0, &mut random)).collect();
            let new: Vec<f64> = (0..40).map(|_| draw(1.0, &mut random)).collect();
            let gain = Gain::between(&old, &new, Aggregate::Mean);
            inside += u32::from(gain.ci95[0] <= 50.0 && 50.0 <= gain.ci95[1]);
        }
        assert!((180..=198).contains(&inside), "{inside} of 200");
    }

    #[test]
    fn what_every_flight_agrees_on_has_no_spread() {
        let gain = Gain::between(&[2.0, 4.0], &[1.0, 2.0], Aggregate::RootMeanSquare);
        assert!((gain.percent - 50.0).abs() < 1e-12);
        assert!((gain.ci95[1] - gain.ci95[0]).abs() < 1e-9);
    }
}
