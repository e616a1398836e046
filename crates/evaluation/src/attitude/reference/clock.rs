//! The clock of a reference against that of the gyroscope: one offset, another rate, a jump, or another motion.
//!
//! Every stretch of ten seconds with motion in it has the offset at which the norms of the two rates correlate best. Stretches
//! whose best correlation is low are not clear and do not count. What the clear ones agree on decides.

use crate::attitude::reference::alignment::{LEAST_MOTION_RAD_S, spread};
use crate::attitude::reference::rates::{Series, Window};
use crate::statistics::median;

/// Largest offset that is looked for, s.
const LARGEST_OFFSET_S: f64 = 60.0;
/// Steps of the offset in the first search, s.
const COARSE_S: f64 = 0.05;
/// Steps of the offset in the last search, s.
const FINE_S: f64 = 0.01;
/// Up to so many windows the first search looks at all of them at every offset.
const MANY_WINDOWS: usize = 300;
/// How much less than the best of all offsets the right one may correlate by chance where some windows are looked at, standard
/// deviations: the best is the luckiest of thousands.
const CHANCE_STD: f64 = 8.0;
/// Length of a stretch, s.
const STRETCH_S: f64 = 10.0;
/// Fewest windows of a stretch.
const FEWEST_WINDOWS: usize = 25;
/// Correlation from which on the offset of a stretch is clear.
const CLEAR: f64 = 0.8;
/// An offset near the common one is preferred to another that correlates better by no more than this.
const NEARLY_AS_GOOD: f64 = 0.05;
/// Offsets of stretches within this many seconds, or standard deviations, agree.
const AGREE_S: f64 = 0.03;
const AGREE_STD: f64 = 5.0;
/// Share of the clear stretches that must agree.
const MOST: f64 = 0.8;
/// Smallest change of the offset over a recording that is called another rate, s.
const LEAST_CHANGE_S: f64 = 0.06;
/// Fewest stretches that tell another rate or a jump.
const FEWEST_STRETCHES: usize = 3;
/// Fewest stretches on each side of a jump: the rates of one stretch of another motion may correlate somewhere by chance.
const FEWEST_A_SIDE: usize = 2;

/// Another rate, or a jump, must make the rates of the whole recording more likely by this: half the square of seven standard
/// deviations, because of many rates and jumps the best is tried. In slow turns and noise offsets of stretches scatter, and no rate follows.
const BORNE_OUT: f64 = 24.5;

/// What the rates say about the reference's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clock {
    /// Too little motion to say anything.
    Unknown,
    /// One offset, s: what is added to the reference's stamps.
    Offset(f64),
    /// The offset changes steadily.
    Rate { rate: f64, span_s: f64 },
    /// The offset changes at once.
    Jump { by_s: f64, at_s: f64 },
    /// The rates are of different motions.
    Different { correlation: f64 },
}

/// A stretch with its offset.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    middle_s: f64,
    offset_s: f64,
    std_s: f64,
    correlation: f64,
}

impl Stretch {
    fn agrees(&self, offset_s: f64) -> bool {
        (self.offset_s - offset_s).abs() <= AGREE_S.max(AGREE_STD * self.std_s)
    }
}

/// Compares the clocks.
pub(super) fn compare(series: &Series<'_>) -> Clock {
    let grid = Grid::new(series);
    let Some(whole) = best(series, &grid, series.windows, None) else {
        return Clock::Unknown;
    };
    let stretches = stretches(series, &grid, whole.offset_s);
    if stretches.is_empty() {
        return Clock::Unknown;
    }
    let clear: Vec<Stretch> = stretches
        .iter()
        .filter(|s| s.correlation >= CLEAR)
        .copied()
        .collect();
    let common = middle(clear.iter().map(|s| s.offset_s));
    let agree = |offsets: &dyn Fn(&Stretch) -> f64, of: &[Stretch]| {
        let count = of.iter().filter(|s| s.agrees(offsets(s))).count();
        count as f64 >= MOST * of.len() as f64
    };
    let is_clear = 2 * clear.len() > stretches.len();
    if let Some(common) = common.filter(|_| is_clear) {
        let changing = changing(&clear);
        if let Some(changing) = changing.filter(|found| found.is_borne_out(series, common)) {
            return changing.clock();
        }
        if agree(&|_| common, &clear) {
            return Clock::Offset(common);
        }
    }
    // Motions that are clear nowhere may still be one motion: a noisy reference, or a slow one.
    if whole.correlation >= CLEAR {
        return Clock::Offset(whole.offset_s);
    }
    Clock::Different {
        correlation: whole.correlation,
    }
}

/// An offset that is not one.
#[derive(Debug, Clone, Copy)]
enum Changing {
    Line { start: f64, rate: f64, span_s: f64 },
    Step { levels: [f64; 2], at_s: f64 },
}

impl Changing {
    fn offset_s(&self, t: f64) -> f64 {
        match *self {
            Self::Line { start, rate, .. } => start + rate * t,
            Self::Step { levels, at_s } => levels[usize::from(t > at_s)],
        }
    }

    fn clock(&self) -> Clock {
        match *self {
            Self::Line { rate, span_s, .. } => Clock::Rate { rate, span_s },
            Self::Step { levels, at_s } => Clock::Jump {
                by_s: levels[1] - levels[0],
                at_s,
            },
        }
    }

    /// Whether the rates are more likely than with one offset, by more than chance.
    fn is_borne_out(&self, series: &Series<'_>, common_s: f64) -> bool {
        let unexplained = |offset_s: &dyn Fn(f64) -> f64| {
            let r = correlation(series, series.windows, offset_s).unwrap_or(0.0);
            (1.0 - r * r.max(0.0)).max(1e-12)
        };
        let [one, changing] = [
            unexplained(&|_| common_s),
            unexplained(&|t| self.offset_s(t)),
        ];
        0.5 * series.windows.len() as f64 * (one / changing).ln() > BORNE_OUT
    }
}

/// Another rate, or a jump, where the offsets of the stretches show it.
fn changing(clear: &[Stretch]) -> Option<Changing> {
    let (first, last) = (clear.first()?, clear.last()?);
    let span_s = last.middle_s - first.middle_s;
    if clear.len() < FEWEST_STRETCHES || span_s <= 0.0 {
        return None;
    }
    let misfit = |model: &dyn Fn(f64) -> f64| {
        let misses = clear
            .iter()
            .map(|s| (s.offset_s - model(s.middle_s)).abs().min(1.0));
        misses.sum::<f64>() / clear.len() as f64
    };
    let fits = |model: &dyn Fn(f64) -> f64| {
        let count = clear.iter().filter(|s| s.agrees(model(s.middle_s))).count();
        count as f64 >= MOST * clear.len() as f64
    };
    // Theil-Sen: the median of the slopes between all pairs.
    let slopes = clear.iter().enumerate().flat_map(|(i, a)| {
        let later = clear[i + 1..].iter();
        later.map(move |b| (b.offset_s - a.offset_s) / (b.middle_s - a.middle_s))
    });
    let rate = middle(slopes)?;
    let start = middle(clear.iter().map(|s| s.offset_s - rate * s.middle_s))?;
    let line = |t: f64| start + rate * t;
    let runs = (rate * span_s).abs() > LEAST_CHANGE_S && fits(&line);
    let found = jump(clear).and_then(|(at_s, levels)| {
        let by_s = levels[1] - levels[0];
        let step = |t: f64| levels[usize::from(t > at_s)];
        let jumps = by_s.abs() > LEAST_CHANGE_S && fits(&step);
        let is_better = !runs || misfit(&step) < misfit(&line);
        (jumps && is_better).then_some(Changing::Step { levels, at_s })
    });
    found.or(runs.then_some(Changing::Line {
        start,
        rate,
        span_s,
    }))
}

/// Where two levels fit the offsets best, and the levels.
fn jump(clear: &[Stretch]) -> Option<(f64, [f64; 2])> {
    let split = |k: usize| {
        let (before, after) = clear.split_at(k);
        let levels = [before, after].map(|part| middle(part.iter().map(|s| s.offset_s)));
        let levels = [levels[0]?, levels[1]?];
        let cost = |part: &[Stretch], level: f64| -> f64 {
            part.iter().map(|s| (s.offset_s - level).abs()).sum()
        };
        let cost = cost(before, levels[0]) + cost(after, levels[1]);
        let at_s = 0.5 * (before.last()?.middle_s + after.first()?.middle_s);
        Some((cost, at_s, levels))
    };
    let best = (FEWEST_A_SIDE..=clear.len().saturating_sub(FEWEST_A_SIDE))
        .filter_map(split)
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((best.1, best.2))
}

fn middle(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    median(&values)
}

/// The stretches with motion in them, each with its offset.
fn stretches(series: &Series<'_>, grid: &Grid, common_s: f64) -> Vec<Stretch> {
    let index = |w: &Window| (w.from_s / STRETCH_S) as usize;
    let parts = series.windows.chunk_by(|a, b| index(a) == index(b));
    let moving = parts.filter(|part| {
        part.len() >= FEWEST_WINDOWS
            && spread(part.iter().map(|w| w.rate.norm())) > LEAST_MOTION_RAD_S
    });
    moving
        .filter_map(|part| best(series, grid, part, Some(common_s)))
        .collect()
}

/// Norms of the gyroscope's rate on a grid, for the first search: NaN where there is none.
struct Grid(Vec<f64>);

impl Grid {
    fn new(series: &Series<'_>) -> Self {
        let length_s = middle(series.windows.iter().map(|w| w.to_s - w.from_s)).unwrap_or(COARSE_S);
        let points = (0..).map(|k| f64::from(k) * COARSE_S);
        let points = points.take_while(|t| *t < series.duration_s());
        let norm = |t: f64| {
            series
                .gyroscope(t, t + length_s)
                .map_or(f64::NAN, |v| v.norm())
        };
        Self(points.map(norm).collect())
    }

    /// The windows' places on the grid, with the norms of their rates: once for all offsets that are tried.
    fn places(windows: &[Window]) -> Vec<(i64, f64)> {
        let place = |window: &Window| (window.from_s / COARSE_S).round() as i64;
        windows
            .iter()
            .map(|window| (place(window), window.rate.norm()))
            .collect()
    }

    /// The offset of at most so many steps at which the windows correlate best. Where they are many, some of them, spread over
    /// the recording, say first which offsets cannot be it.
    fn best(&self, windows: &[Window], reach: i64) -> Option<i64> {
        let places = Self::places(windows);
        let highest = |a: &(i64, f64), b: &(i64, f64)| a.1.total_cmp(&b.1);
        let with_all = |k: i64| Some((k, self.correlation(&places, places.len(), k)?));
        if places.len() <= MANY_WINDOWS {
            let found = (-reach..=reach).filter_map(with_all).max_by(highest)?;
            return Some(found.0);
        }
        let every = places.len().div_ceil(MANY_WINDOWS);
        let some: Vec<_> = places.iter().step_by(every).copied().collect();
        // Where just half of all have a pair, a few less than half of some may have one.
        let needed = some.len() * 9 / 10;
        let rough: Vec<_> = (-reach..=reach)
            .filter_map(|k| Some((k, self.correlation(&some, needed, k)?)))
            .collect();
        let chance = CHANCE_STD / (some.len() as f64).sqrt();
        let least = rough.iter().copied().max_by(highest)?.1 - chance;
        let possible = rough.iter().filter(|(_, found)| *found >= least);
        let found = possible.filter_map(|(k, _)| with_all(*k)).max_by(highest)?;
        Some(found.0)
    }

    /// As [`correlation`] at an offset of so many steps; `None` where fewer than half of `needed` windows have a pair.
    fn correlation(&self, places: &[(i64, f64)], needed: usize, steps: i64) -> Option<f64> {
        let pairs = places.iter().filter_map(|(place, norm)| {
            let place = usize::try_from(place + steps).ok()?;
            let found = self.0.get(place).filter(|found| found.is_finite())?;
            Some([*found, *norm])
        });
        of_pairs(pairs, needed)
    }
}

/// The offset at which the norms of the rates of these windows correlate best. One near `prefer_s` is taken where it is
/// nearly as good.
fn best(
    series: &Series<'_>,
    grid: &Grid,
    windows: &[Window],
    prefer_s: Option<f64>,
) -> Option<Stretch> {
    let reach = (LARGEST_OFFSET_S / COARSE_S) as i64;
    let at = |offset_s: f64| correlation(series, windows, &|_| offset_s);
    let highest = |a: &(f64, f64), b: &(f64, f64)| a.1.total_cmp(&b.1);
    let around = |middle_s: f64, step_s: f64, steps: i32| {
        let tried = (-steps..=steps).filter_map(|k| {
            let offset_s = middle_s + f64::from(k) * step_s;
            Some((offset_s, at(offset_s)?))
        });
        tried.max_by(highest)
    };
    let anywhere = || {
        let coarse = grid.best(windows, reach)?;
        around(coarse as f64 * COARSE_S, FINE_S, 6)
    };
    let near = prefer_s.and_then(|common_s| around(common_s, FINE_S, 10));
    let (offset_s, peak) = match near {
        // No other can be better by more: none correlates beyond 1.
        Some(near) if near.1 > 1.0 - NEARLY_AS_GOOD => near,
        near => {
            let best = anywhere()?;
            near.filter(|near| near.1 > best.1 - NEARLY_AS_GOOD)
                .unwrap_or(best)
        }
    };
    let (before, after) = (at(offset_s - FINE_S)?, at(offset_s + FINE_S)?);
    // The peak of the parabola through three values, and what its curvature and the noise leave open.
    let curvature = (before - 2.0 * peak + after).min(-1e-12);
    let shift = (0.5 * (before - after) / curvature).clamp(-1.0, 1.0);
    let noise = (1.0 - peak * peak).max(1e-6) / windows.len() as f64;
    Some(Stretch {
        middle_s: 0.5 * (windows.first()?.middle_s() + windows.last()?.middle_s()),
        offset_s: offset_s + shift * FINE_S,
        std_s: FINE_S * (noise / -curvature).sqrt(),
        correlation: peak,
    })
}

/// Correlation of the norms of the rates at an offset, which may change with time.
fn correlation(
    series: &Series<'_>,
    windows: &[Window],
    offset_s: &dyn Fn(f64) -> f64,
) -> Option<f64> {
    let pairs = windows.iter().filter_map(|window| {
        let offset_s = offset_s(window.middle_s());
        let rate = series.gyroscope(window.from_s + offset_s, window.to_s + offset_s)?;
        Some([rate.norm(), window.rate.norm()])
    });
    of_pairs(pairs, windows.len())
}

/// Correlation of pairs of norms; `None` where fewer than half of the windows have both.
fn of_pairs(pairs: impl Iterator<Item = [f64; 2]>, windows: usize) -> Option<f64> {
    let (mut count, mut sums, mut squares, mut product) = (0_usize, [0.0; 2], [0.0; 2], 0.0);
    for norms in pairs {
        count += 1;
        product += norms[0] * norms[1];
        for i in 0..2 {
            sums[i] += norms[i];
            squares[i] += norms[i] * norms[i];
        }
    }
    if 2 * count < windows || count < FEWEST_WINDOWS {
        return None;
    }
    let n = count as f64;
    let variance = |i: usize| squares[i] / n - (sums[i] / n).powi(2);
    let both = (variance(0) * variance(1)).sqrt();
    let covariance = product / n - sums[0] * sums[1] / (n * n);
    (both > 0.0).then(|| covariance / both)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Instants;
    use crate::attitude::reference::rates::Rates;
    use crate::attitude::reference::simulated::Turned;

    /// Offsets that some windows rule out are none at which all correlate best: of a clear, a noisy and another motion.
    #[test]
    fn the_search_by_some_windows_finds_what_all_find() {
        let reach = (LARGEST_OFFSET_S / COARSE_S) as i64;
        for (reference_std, other, axes) in [
            (1e-3, 0, 3),
            (0.03, 0, 3),
            (0.2, 0, 3),
            (1e-3, 7, 3),
            (0.01, 0, 1),
        ] {
            for (seed, duration_s) in (1..=8).flat_map(|seed| [(seed, 40.0), (seed, 150.0)]) {
                let turned = Turned {
                    seed,
                    reference_seed: seed + other,
                    duration_s,
                    stamp: |t| t + 3.3,
                    reference_std,
                    axes,
                    ..Turned::default()
                };
                let mut rates = Rates::new(600.0);
                Instants::new(turned.events()).for_each(|instant| rates.add(&instant.unwrap()));
                let series = rates.series();
                assert!(series.windows.len() > MANY_WINDOWS);
                let (grid, places) = (Grid::new(&series), Grid::places(series.windows));
                let with_all = |k: i64| Some((k, grid.correlation(&places, places.len(), k)?));
                let expected = (-reach..=reach)
                    .filter_map(with_all)
                    .max_by(|a, b| a.1.total_cmp(&b.1))
                    .map(|(k, _)| k);
                assert_eq!(grid.best(series.windows, reach), expected, "{turned:?}");
            }
        }
    }
}
