//! Axes: from values to a range that shows them, ticks at round numbers, positions from 0 to 1.

/// One axis of a plot.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
    ticks: Vec<f64>,
}

/// Steps between ticks of ordinary quantities, for each power of ten.
const ROUND_STEPS: [f64; 3] = [1.0, 2.0, 5.0];
/// Steps between ticks of angles, deg; below them the ordinary ones.
const ANGLE_STEPS: [f64; 8] = [1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0];

impl Axis {
    /// A linear axis over `low..high` with at most `count` ticks. A range without extent, or one
    /// that is not finite, becomes one of extent 1.
    pub(crate) fn linear(low: f64, high: f64, count: usize) -> Self {
        let (low, high) = proper(low, high);
        let step = round_step((high - low) / count.max(1) as f64);
        Self::with_step(low, high, step)
    }

    /// A linear axis of time: like [`Self::linear`], and it goes on to the next tick when that is
    /// less than one percent away, so that 119.99 s of data end at a tick that says 120.
    pub(crate) fn time(low: f64, high: f64, count: usize) -> Self {
        let (low, high) = proper(low, high);
        let step = round_step((high - low) / count.max(1) as f64);
        let next = (high / step).ceil() * step;
        let near = next - high < 0.01 * (high - low);
        Self::with_step(low, if near { next } else { high }, step)
    }

    /// A linear axis of an angle in degrees: ticks at 15, 30, 45 or 90 deg when it is wide.
    pub(crate) fn degrees(low: f64, high: f64, count: usize) -> Self {
        let (low, high) = proper(low, high);
        let least = (high - low) / count.max(1) as f64;
        let step = if least <= ANGLE_STEPS[0] {
            round_step(least)
        } else {
            let wide = ANGLE_STEPS[ANGLE_STEPS.len() - 1];
            ANGLE_STEPS
                .into_iter()
                .find(|s| *s >= least)
                .unwrap_or(wide)
        };
        Self::with_step(low, high, step)
    }

    /// A logarithmic axis with ticks at powers of ten; `low` and `high` are positive.
    pub(crate) fn logarithmic(low: f64, high: f64) -> Self {
        let low = if low > 0.0 && low.is_finite() {
            low
        } else {
            0.01
        };
        let high = if high.is_finite() {
            high.max(low * 10.0)
        } else {
            low * 1e4
        };
        let (first, last) = (low.log10().ceil() as i32, high.log10().floor() as i32);
        Self {
            low,
            high,
            logarithmic: true,
            ticks: (first..=last).take(50).map(power_of_ten).collect(),
        }
    }

    /// Adds ticks at 2 and 5 times the powers of ten of a logarithmic axis.
    pub(crate) fn with_fine_ticks(mut self) -> Self {
        let (low, high) = (self.low, self.high);
        let first = low.log10().floor() as i32;
        let decades = (first..=high.log10().floor() as i32).take(50);
        let steps = decades.flat_map(|e| ROUND_STEPS.map(|s| (s, e)));
        let value = |(s, e): (f64, i32)| {
            if e < 0 {
                s / 10_f64.powi(-e)
            } else {
                s * 10_f64.powi(e)
            }
        };
        self.ticks = steps
            .map(value)
            .filter(|v| *v >= low && *v <= high)
            .collect();
        self
    }

    fn with_step(low: f64, high: f64, step: f64) -> Self {
        let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
        Self {
            low,
            high,
            logarithmic: false,
            ticks: (first..=last).take(50).map(|i| i as f64 * step).collect(),
        }
    }

    /// Where a value lies: 0 at the low end, 1 at the high end; beyond, outside of 0..1.
    pub(crate) fn position(&self, value: f64) -> f64 {
        if self.logarithmic {
            // What is zero or negative lies far below.
            let value = value.max(self.low * 1e-3);
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Whether a value lies on the axis.
    pub(crate) fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Lowest and highest value.
    #[cfg(any(test, feature = "interactive"))]
    pub(crate) const fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Whether equal factors are equally far apart.
    #[cfg(any(test, feature = "interactive"))]
    pub(crate) const fn is_logarithmic(&self) -> bool {
        self.logarithmic
    }

    /// Values at the ticks with their text.
    pub(crate) fn ticks(&self) -> Vec<(f64, String)> {
        let step = match self.ticks[..] {
            [a, b, ..] => (b - a).abs(),
            _ => 1.0,
        };
        let label = |value: f64| {
            if self.logarithmic {
                return format!("{value}");
            }
            let decimals = (-(step * 1.000_001).log10().floor()).clamp(0.0, 9.0) as usize;
            let text = format!("{value:.decimals$}");
            // A typographic minus is as wide as a digit; zero has no sign.
            let text = text.strip_prefix('-').map(|t| format!("\u{2212}{t}"));
            match text {
                Some(t) if t.chars().any(|c| ('1'..='9').contains(&c)) => t,
                Some(t) => t.trim_start_matches('\u{2212}').to_owned(),
                None => format!("{value:.decimals$}"),
            }
        };
        self.ticks.iter().map(|v| (*v, label(*v))).collect()
    }
}

/// Divides below one, so that the text is short: 1 / 100 is 0.01 to the last digit.
fn power_of_ten(exponent: i32) -> f64 {
    match exponent {
        0.. => 10_f64.powi(exponent),
        _ => 1.0 / 10_f64.powi(-exponent),
    }
}

fn proper(low: f64, high: f64) -> (f64, f64) {
    if !(low.is_finite() && high.is_finite()) {
        return (0.0, 1.0);
    }
    let (low, high) = (low.min(high), low.max(high));
    if high - low > 1e-9 * low.abs().max(high.abs()).max(1e-9) {
        (low, high)
    } else {
        (low - 0.5, high + 0.5)
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `least`.
fn round_step(least: f64) -> f64 {
    let decade = 10_f64.powf(least.log10().floor());
    ROUND_STEPS
        .into_iter()
        .map(|s| s * decade)
        .find(|s| *s >= least * 0.999_999)
        .unwrap_or(decade * 10.0)
}

/// The range that shows a curve: everything, unless a few per mille of it tower over the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reach {
    /// Largest absolute value to show.
    pub(crate) limit: f64,
    /// Largest absolute value there is, when it is not shown.
    pub(crate) beyond: Option<f64>,
}

/// Chooses how far an axis of errors must reach. A start far off the rest would flatten everything
/// that follows, so an extreme above four times the 99.5 % quantile is cut off (and told about).
pub(crate) fn reach(values: impl Iterator<Item = f64>) -> Option<Reach> {
    let sorted = sorted(values.map(f64::abs));
    let max = *sorted.last()?;
    let high = quantile(&sorted, 0.995);
    Some(if high > 0.0 && max > 4.0 * high {
        Reach {
            limit: high * 1.6,
            beyond: Some(max),
        }
    } else {
        Reach {
            limit: max,
            beyond: None,
        }
    })
}

/// The finite ones, from the lowest to the highest.
pub(crate) fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// The lowest and the highest of the finite ones.
pub(crate) fn extent(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let finite = values.filter(|v| v.is_finite());
    let low = finite.clone().fold(f64::INFINITY, f64::min);
    (low, finite.fold(f64::NEG_INFINITY, f64::max))
}

/// The value below which a share of sorted values lies; the values are not empty.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    let at = (share * last as f64).round() as usize;
    sorted.get(at.min(last)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks().into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_stand_at_round_numbers_and_show_the_decimals_they_need() {
        assert_eq!(
            labels(&Axis::linear(0.0, 60.0, 6)),
            ["0", "10", "20", "30", "40", "50", "60"]
        );
        assert_eq!(
            labels(&Axis::linear(-0.13, 0.13, 4)),
            ["\u{2212}0.1", "0.0", "0.1"]
        );
        assert_eq!(
            labels(&Axis::linear(0.0, 0.004, 5)),
            ["0.000", "0.001", "0.002", "0.003", "0.004"]
        );
    }

    #[test]
    fn time_ends_at_a_tick_that_is_close() {
        let last = |high| labels(&Axis::time(0.0, high, 10)).pop();
        assert_eq!(last(119.99).as_deref(), Some("120"));
        assert_eq!(last(131.0).as_deref(), Some("120"));
    }

    #[test]
    fn angles_tick_at_quarters_of_the_circle() {
        assert_eq!(
            labels(&Axis::degrees(-180.0, 180.0, 5)),
            ["\u{2212}180", "\u{2212}90", "0", "90", "180"]
        );
        assert_eq!(
            labels(&Axis::degrees(-40.0, 31.0, 5)),
            ["\u{2212}30", "\u{2212}15", "0", "15", "30"]
        );
    }

    #[test]
    fn logarithmic_axis_has_a_tick_at_each_power_of_ten() {
        let axis = Axis::logarithmic(0.05, 200.0);
        assert_eq!(labels(&axis), ["0.1", "1", "10", "100"]);
        let fine = Axis::logarithmic(0.04, 3.0).with_fine_ticks();
        assert_eq!(labels(&fine), ["0.05", "0.1", "0.2", "0.5", "1", "2"]);
        assert!(axis.position(0.0) < 0.0 && axis.position(0.05).abs() < 1e-12);
    }

    #[test]
    fn ranges_without_extent_or_not_finite_still_make_an_axis() {
        for axis in [
            Axis::linear(3.0, 3.0, 5),
            Axis::linear(f64::NAN, 1.0, 5),
            Axis::degrees(0.0, f64::INFINITY, 5),
            Axis::logarithmic(f64::NAN, f64::NAN),
            Axis::linear(1e300, 1e300, 4),
        ] {
            let (low, high) = axis.range();
            assert!(low < high || low.abs() > 1e200, "{axis:?}");
            assert!(axis.ticks().len() <= 50);
        }
    }

    #[test]
    fn axis_reaches_everything_but_a_towering_start() {
        let calm = reach((0..1000).map(|i| f64::from(i) / 1000.0));
        assert_eq!(calm.map(|r| (r.limit > 0.99, r.beyond)), Some((true, None)));
        let start = reach((0..1000).map(|i| if i < 2 { -170.0 } else { 1.0 }));
        assert_eq!(
            start,
            Some(Reach {
                limit: 1.6,
                beyond: Some(170.0)
            })
        );
        assert_eq!(reach([f64::NAN].into_iter()), None);
    }
}
