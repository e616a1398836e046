//! The magnetometer against the gyroscope: noise, hard iron, and fields that change while nothing turns.
//!
//! The Earth's field goes through the body's axes as the gyroscope says. An offset that turns with the device (hard iron) shows in
//! how the difference depends on the turn ([`pairs`](super::pairs), equation 1), whatever the field; a magnet that comes or goes
//! is a difference that neither a turn, nor an offset, nor a bias of the gyroscope explains.

use nalgebra::{SMatrix, SVector, Vector3};

use super::noise::{NoiseLevel, Quietest};
use super::pairs::{Pair, Pairs, Turn, Turning};

/// Neighbouring samples of a window.
const WINDOW: u32 = 20;
/// Pairs are so long, s, ...
const LONG_S: f64 = 2.0;
/// ... or the angle gone through is this large, rad: a gyroscope's scale is not better known.
const LARGE_RAD: f64 = 4.0;
/// Fewer pairs say nothing.
const FEWEST: usize = 12;
/// Offset, and bias and scale errors of the gyroscope.
const N: usize = 9;
/// What they may be before anything is known: microtesla, rad/s, 1.
const PRIOR: [f64; 3] = [30.0, 0.03, 0.005];
/// Magnetometers are so much later than gyroscopes, or earlier, s.
const LATE_S: f64 = 0.01;
/// Turns are off by this share of the angle, beside the scale errors of the axes; what is turned back and forth is off by less.
const TURN_SHARE: f64 = 0.006;
const BACK_AND_FORTH: f64 = 0.3;
/// Passes of the robust fit, and residuals beyond so many standard deviations count less.
const PASSES: usize = 6;
const FAR: f64 = 2.5;
/// The median of chi-square with three degrees of freedom.
const MEDIAN: f64 = 2.366;
/// Residuals are between a step of a good magnetometer and no magnetometer at all, microtesla.
const OWN_STD: [f64; 2] = [0.03, 100.0];
const BISECTIONS: u32 = 24;
/// A change that ends within so many pairs is one change.
const TOGETHER: usize = 2;
/// Changes are named from so many standard deviations on, and from this size (microtesla): in rooms the field differs by less
/// from one hand's reach to the next.
const SIGMAS: f64 = 6.0;
const LEAST_CHANGE_UT: f64 = 8.0;

/// An offset in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HardIron {
    /// microtesla.
    pub offset_ut: Vector3<f64>,
    /// One standard deviation along it, microtesla.
    pub std_ut: f64,
}

/// A field that changed while nothing turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldChange {
    /// When, ns.
    pub time_ns: i64,
    /// By how much, microtesla.
    pub change_ut: f64,
    /// In standard deviations.
    pub sigmas: f64,
}

/// What the pairs say together.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldFit {
    /// The offset that the turns show; along axes that nothing turned it is near zero.
    pub iron: HardIron,
    /// The largest change.
    pub change: Option<FieldChange>,
    /// Of a residual that the turn makes no worse, per axis, microtesla.
    pub residual_std_ut: f64,
    /// By how much the strength of the field varies as it is measured, and without the offset, microtesla: what turns with the
    /// device is taken out of it by the right offset, and put into it by one that is none.
    pub strength_std_ut: [f64; 2],
    /// Residuals of the pairs, and their variances, per axis.
    pub residuals: Vec<(Vector3<f64>, f64)>,
}

/// Watches magnetometer and gyroscope.
#[derive(Debug, Clone, Default)]
pub struct Iron {
    turning: Turning,
    last: Option<Vector3<f64>>,
    sum: (f64, u32),
    noise: Quietest<1>,
    /// Stamp, field, and rate of turn (rad/s) at the base.
    base: Option<(i64, Vector3<f64>, f64)>,
    /// From the base to the last sample.
    turn: Turn,
    pairs: Pairs,
}

impl Iron {
    /// Takes an angular rate; `lost` where the turn is not known.
    pub fn rate(&mut self, time_ns: i64, rate: &Vector3<f64>, lost: bool) {
        self.turning.rate(time_ns, rate, lost);
    }

    /// Takes a magnetic field, microtesla.
    pub fn field(&mut self, time_ns: i64, field: &Vector3<f64>) {
        let turn = self.turning.until(time_ns);
        let last = self.last.replace(*field);
        let (Some(turn), Some(last)) = (turn, last) else {
            self.begin(time_ns, field);
            return;
        };
        self.sum.0 += (field - turn.now_from_then * last).norm_squared() / 6.0;
        self.sum.1 += 1;
        if self.sum.1 >= WINDOW {
            self.noise.add([self.sum.0 / f64::from(self.sum.1)]);
            self.sum = (0.0, 0);
        }
        self.turn = self.turn.then(&turn);
        let Some((then_ns, then, rate)) = self.base else {
            self.begin(time_ns, field);
            return;
        };
        let seconds = time_ns.saturating_sub(then_ns) as f64 * 1e-9;
        if seconds < LONG_S && self.turn.turned_rad < LARGE_RAD {
            return;
        }
        let fastest = rate.max(self.turning.rate_rad_s());
        let late = fastest * LATE_S * field.norm();
        self.pairs.add(Pair {
            then_ns,
            now_ns: time_ns,
            then,
            now: *field,
            turn: self.turn,
            variance: late * late,
        });
        self.begin(time_ns, field);
    }

    fn begin(&mut self, time_ns: i64, field: &Vector3<f64>) {
        self.base = Some((time_ns, *field, self.turning.rate_rad_s()));
        self.turn = Turn::default();
    }

    /// White noise of a sample, per axis, microtesla.
    #[must_use]
    pub fn noise(&self) -> Option<NoiseLevel> {
        let (windows, [variance]) = self.noise.mean()?;
        Some(NoiseLevel::of(variance, windows, f64::from(WINDOW)))
    }

    /// The pairs.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        self.pairs.kept()
    }

    /// What the pairs say.
    #[must_use]
    pub fn fit(&self) -> Option<FieldFit> {
        let pairs = self.pairs.kept();
        if pairs.len() < FEWEST {
            return None;
        }
        let mut weights = vec![1.0; pairs.len()];
        let least = self
            .noise()
            .map_or(0.0, |noise| 2.0 * noise.std * noise.std);
        let mut fitted = Fitted::of(pairs, &weights, least);
        for _ in 0..PASSES {
            weights = (fitted.residuals.iter().zip(pairs))
                .map(|(r, pair)| {
                    let own = turn_variance(pair);
                    let sigmas = (r.norm_squared() / (3.0 * (fitted.variance + own))).sqrt();
                    fitted.variance / (fitted.variance + own) * (FAR / sigmas.max(FAR)).powi(2)
                })
                .collect();
            fitted = Fitted::of(pairs, &weights, least);
        }
        Some(FieldFit {
            iron: fitted.iron(),
            change: fitted.change(pairs),
            residual_std_ut: fitted.variance.sqrt(),
            strength_std_ut: [Vector3::zeros(), fitted.iron().offset_ut]
                .map(|offset_ut| strength_std(pairs, &offset_ut)),
            residuals: fitted
                .residuals
                .iter()
                .zip(&weights)
                .map(|(r, weight)| (*r, fitted.variance / weight))
                .collect(),
        })
    }
}

/// Standard deviation of the field's strength without an offset, microtesla.
fn strength_std(pairs: &[Pair], offset_ut: &Vector3<f64>) -> f64 {
    let length = |pair: &Pair| (pair.now - offset_ut).norm();
    let n = pairs.len().max(1) as f64;
    let mean = pairs.iter().map(length).sum::<f64>() / n;
    let square = |pair: &Pair| (length(pair) - mean).powi(2);
    (pairs.iter().map(square).sum::<f64>() / n).sqrt()
}

fn turn_variance(pair: &Pair) -> f64 {
    let net = pair.turn.now_from_then.angle();
    let off = TURN_SHARE * net.max(BACK_AND_FORTH * pair.turn.turned_rad);
    off * off * pair.then.norm_squared() + pair.variance
}

/// The variance of residuals, per axis, that is not the turns': with it their median is that of chi-square.
fn own_variance(residuals: &[Vector3<f64>], pairs: &[Pair]) -> f64 {
    let below = |variance: f64| {
        let is_below = |(r, pair): &(&Vector3<f64>, &Pair)| {
            r.norm_squared() < MEDIAN * (variance + turn_variance(pair))
        };
        residuals.iter().zip(pairs).filter(is_below).count()
    };
    let [mut low, mut high] = OWN_STD.map(|std| std * std);
    for _ in 0..BISECTIONS {
        let middle = (low * high).sqrt();
        if 2 * below(middle) < residuals.len() {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Offset and bias by weighted least squares.
struct Fitted {
    estimate: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    residuals: Vec<Vector3<f64>>,
    variance: f64,
}

impl Fitted {
    fn of(pairs: &[Pair], weights: &[f64], least: f64) -> Self {
        let (mut normal, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
        let designs: Vec<_> = pairs
            .iter()
            .map(|pair| {
                let mut design = SMatrix::<f64, 3, N>::zeros();
                if pair.is_turned() {
                    let by_offset = pair.by_offset();
                    design.fixed_columns_mut::<3>(0).copy_from(&by_offset);
                }
                design.fixed_columns_mut::<3>(3).copy_from(&pair.by_bias());
                let by_scale = pair.by_scale();
                design.fixed_columns_mut::<3>(6).copy_from(&by_scale);
                design
            })
            .collect();
        for ((pair, design), weight) in pairs.iter().zip(&designs).zip(weights) {
            normal += design.transpose() * design * *weight;
            right += design.transpose() * pair.difference() * *weight;
        }
        let prior = SVector::<f64, N>::from_fn(|k, _| PRIOR[k / 3].powi(-2));
        // As much as against a residual of one microtesla.
        normal += SMatrix::from_diagonal(&prior);
        let covariance = normal.try_inverse().unwrap_or_else(SMatrix::zeros);
        let estimate = covariance * right;
        let residuals: Vec<_> = pairs
            .iter()
            .zip(&designs)
            .map(|(pair, design)| pair.difference() - design * estimate)
            .collect();
        let variance = own_variance(&residuals, pairs).max(least);
        Self {
            covariance: covariance * variance,
            estimate,
            residuals,
            variance,
        }
    }

    fn iron(&self) -> HardIron {
        let offset_ut = self.estimate.fixed_rows::<3>(0).into_owned();
        let along = offset_ut.try_normalize(1e-9).unwrap_or_else(Vector3::x);
        let covariance = self.covariance.fixed_view::<3, 3>(0, 0);
        HardIron {
            offset_ut,
            std_ut: along.dot(&(covariance * along)).max(0.0).sqrt(),
        }
    }

    /// The largest change over up to [`TOGETHER`] pairs that follow one another.
    fn change(&self, pairs: &[Pair]) -> Option<FieldChange> {
        let mut worst: Option<FieldChange> = None;
        for from in 0..pairs.len() {
            let (mut sum, mut variance) = (Vector3::zeros(), 0.0);
            for at in from..pairs.len().min(from + TOGETHER) {
                if at > from && pairs[at].then_ns != pairs[at - 1].now_ns {
                    break;
                }
                sum = pairs[at].turn.now_from_then * sum + self.residuals[at];
                variance += self.variance + turn_variance(&pairs[at]);
                let change_ut = sum.norm();
                let sigmas = change_ut / variance.sqrt();
                let is_change = sigmas > SIGMAS && change_ut > LEAST_CHANGE_UT;
                if is_change && worst.is_none_or(|w| change_ut > w.change_ut) {
                    worst = Some(FieldChange {
                        time_ns: pairs[from].then_ns,
                        change_ut,
                        sigmas,
                    });
                }
            }
        }
        worst
    }
}
