//! The accelerometer against gravity and the gyroscope: bias, scale, and axes that are not those of the gyroscope.
//!
//! A **moment** is a short window in which the specific force, turned back by the gyroscope, hardly changes: what is felt is gravity
//! alone, or nearly. From one moment to the next the gyroscope carries it ([`pairs`](super::pairs)). With a bias `b` and a scale
//! `1 + s` of each axis of the accelerometer, a rotation `m` from its axes to those of the gyroscope, a bias `w` and scale errors
//! `k` of the gyroscope, to first order
//!
//! ```text
//! f2 - C f1  =  (I - C) b + (S C - C S) f1 + ([C f1]x - C [f1]x) m - [C f1]x (B w + K k)          (1)
//! |f| - g    =  u' b + u' S f + d                                                                       (2)
//! ```
//!
//! where `u` is the direction of `f`, and `d` what gravity here differs from the usual `g`. All is
//! linear, so one weighted least-squares fit over the whole recording has every error with its covariance, and what the motion
//! does not show stays at its prior.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use northing_core::geometry::so3;

use super::pairs::{Pair, Pairs, Turn, Turning};

/// Length of a window, s, and samples in it at least.
const WINDOW_S: f64 = 0.4;
const FEWEST_SAMPLES: u32 = 6;
/// A mean that is no better known than this is no moment, m/s^2: a degree.
const CALM: f64 = 0.17;
/// What a mean is not better than, m/s^2: time constants and rounding of sensors.
const FLOOR: f64 = 0.01;
/// Pairs turn by this much, rad, or last so long, s, ...
const TURN_RAD: f64 = 0.35;
const LONG_S: f64 = 2.0;
/// ... and no longer than this, s.
const LONGEST_S: f64 = 15.0;
/// Fewer pairs say nothing.
const FEWEST: usize = 8;
/// Turns are off by this share of the angle gone through, beside the scale errors of the axes.
const TURN_SHARE: f64 = 0.002;
const BACK_AND_FORTH: f64 = 0.2;
/// Passes of the robust fit; whitened residuals beyond count less.
const PASSES: usize = 8;
const FAR: f64 = 2.0;
/// The median of chi-square with three degrees of freedom.
const MEDIAN: f64 = 2.366;
/// The middle of gravity on Earth, m/s^2; it differs by less than 0.02 where people live at the sea, by 0.03 on mountains.
const GRAVITY: f64 = 9.805;

/// `b`, `s`, `m`, `w`, `k`, `d`.
const N: usize = 16;
type Estimate = SVector<f64, N>;
type Covariance = SMatrix<f64, N, N>;
/// Standard deviations before anything is known: m/s^2, 1, rad, rad/s, 1, m/s^2.
const PRIOR: [f64; N] = [
    0.1, 0.1, 0.1, 0.02, 0.02, 0.02, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03, 0.005, 0.005, 0.005, 0.02,
];

/// Three numbers with their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// The numbers.
    pub value: Vector3<f64>,
    /// Their covariance.
    pub covariance: Matrix3<f64>,
}

impl Estimated {
    /// How many standard deviations from zero, all three together.
    #[must_use]
    pub fn sigmas(&self) -> f64 {
        let inverse = self.covariance.try_inverse();
        inverse.map_or(0.0, |p| self.value.dot(&(p * self.value)).max(0.0).sqrt())
    }

    /// One standard deviation along the value.
    #[must_use]
    pub fn std(&self) -> f64 {
        let along = self.value.try_normalize(1e-12).unwrap_or_else(Vector3::x);
        along.dot(&(self.covariance * along)).max(0.0).sqrt()
    }
}

/// What the moments say together.
#[derive(Debug, Clone, PartialEq)]
pub struct AxesFit {
    /// Bias of the accelerometer, m/s^2.
    pub bias: Estimated,
    /// Scale errors of its axes.
    pub scale: Estimated,
    /// Rotation vector from its axes to those of the gyroscope, rad.
    pub misalignment: Estimated,
    /// Turns it was found by.
    pub turns: usize,
    /// By how much residuals are larger than the moments themselves say: much more than 1 where the device was accelerated all the
    /// time.
    pub residual_factor: f64,
    /// Residuals of the pairs, and their variances as the whole fit shows them, per axis.
    pub residuals: Vec<(Vector3<f64>, f64)>,
}

/// A short window, or the moment it was.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Moment {
    time_ns: i64,
    force: Vector3<f64>,
    /// Of the mean, per axis.
    variance: f64,
}

/// The samples of a window, turned into the body's axes at its start.
#[derive(Debug, Clone, Copy, Default)]
struct Window {
    start_ns: Option<i64>,
    sums: [(Vector3<f64>, u32); 2],
    squares: f64,
    turn: Turn,
}

impl Window {
    fn seconds(&self, now_ns: i64) -> f64 {
        let start_ns = self.start_ns.unwrap_or(now_ns);
        now_ns.saturating_sub(start_ns) as f64 * 1e-9
    }

    fn add(&mut self, now_ns: i64, force: &Vector3<f64>) {
        let half = usize::from(self.seconds(now_ns) > 0.5 * WINDOW_S);
        self.start_ns.get_or_insert(now_ns);
        let still = self.turn.now_from_then.inverse() * force;
        self.sums[half].0 += still;
        self.sums[half].1 += 1;
        self.squares += still.norm_squared();
    }

    fn moment(&self, now_ns: i64) -> Option<Moment> {
        let [(first, n1), (second, n2)] = self.sums;
        if n1 + n2 < FEWEST_SAMPLES || n1.min(n2) < 2 {
            return None;
        }
        let n = f64::from(n1 + n2);
        let mean = (first + second) / n;
        let spread = (self.squares / n - mean.norm_squared()).max(0.0) / 3.0;
        let change = second / f64::from(n2) - first / f64::from(n1);
        let variance = spread / n + change.norm_squared() / 12.0 + FLOOR * FLOOR;
        (variance < CALM * CALM).then(|| Moment {
            time_ns: now_ns,
            force: self.turn.now_from_then * mean,
            variance,
        })
    }
}

/// Watches gyroscope and accelerometer.
#[derive(Debug, Clone, Default)]
pub struct Axes {
    turning: Turning,
    window: Window,
    base: Option<Moment>,
    /// Since the base.
    turn: Turn,
    pairs: Pairs,
}

impl Axes {
    /// Takes an angular rate; `lost` where the turn is not known.
    pub fn rate(&mut self, time_ns: i64, rate: &Vector3<f64>, lost: bool) {
        self.turning.rate(time_ns, rate, lost);
    }

    /// Takes a specific force, m/s^2; `saturated` where it is not what was felt.
    pub fn force(&mut self, time_ns: i64, force: &Vector3<f64>, saturated: bool) {
        let turn = self.turning.until(time_ns);
        let Some(turn) = turn.filter(|_| !saturated) else {
            (self.window, self.base) = (Window::default(), None);
            return;
        };
        self.turn = self.turn.then(&turn);
        self.window.turn = self.window.turn.then(&turn);
        self.window.add(time_ns, force);
        if self.window.seconds(time_ns) >= WINDOW_S {
            let moment = self.window.moment(time_ns);
            self.window = Window::default();
            if let Some(moment) = moment {
                self.arrive(moment);
            }
        }
    }

    fn arrive(&mut self, now: Moment) {
        if let Some(base) = self.base {
            let seconds = now.time_ns.saturating_sub(base.time_ns) as f64 * 1e-9;
            if seconds < LONGEST_S {
                if seconds < LONG_S && self.turn.turned_rad < TURN_RAD {
                    return;
                }
                self.pairs.add(Pair {
                    then_ns: base.time_ns,
                    now_ns: now.time_ns,
                    then: base.force,
                    now: now.force,
                    turn: self.turn,
                    variance: base.variance + now.variance,
                });
            }
        }
        self.base = Some(now);
        self.turn = Turn::default();
    }

    /// The pairs.
    #[must_use]
    pub fn pairs(&self) -> &[Pair] {
        self.pairs.kept()
    }

    /// What the moments say.
    #[must_use]
    pub fn fit(&self) -> Option<AxesFit> {
        let pairs = self.pairs.kept();
        if pairs.len() < FEWEST {
            return None;
        }
        let rows: Vec<_> = pairs.iter().map(Row::of).collect();
        let mut fitted = Fitted::of(&rows, &vec![1.0; rows.len()]);
        for _ in 0..PASSES {
            let weights: Vec<_> = rows.iter().map(|row| fitted.weight(row)).collect();
            fitted = Fitted::of(&rows, &weights);
        }
        let three = |from: usize| Estimated {
            value: fitted.estimate.fixed_rows::<3>(from).into_owned(),
            covariance: fitted
                .covariance
                .fixed_view::<3, 3>(from, from)
                .into_owned(),
        };
        let large = pairs
            .iter()
            .filter(|p| p.turn.now_from_then.angle() > TURN_RAD);
        Some(AxesFit {
            bias: three(0),
            scale: three(3),
            misalignment: three(6),
            turns: large.count(),
            residual_factor: fitted.factor.sqrt(),
            residuals: rows
                .iter()
                .map(|row| {
                    (
                        row.residual(&fitted.estimate),
                        row.variance / fitted.weight(row),
                    )
                })
                .collect(),
        })
    }
}

/// Equations (1) and (2) of a pair.
struct Row {
    design: SMatrix<f64, 3, N>,
    difference: Vector3<f64>,
    length_design: SMatrix<f64, 1, N>,
    length: f64,
    variance: f64,
    length_variance: f64,
}

impl Row {
    fn of(pair: &Pair) -> Self {
        let (c, f1, carried) = (pair.turn.matrix(), pair.then, pair.carried());
        let mut design = SMatrix::<f64, 3, N>::zeros();
        let mut put = |column: usize, block: &Matrix3<f64>| {
            design.fixed_columns_mut::<3>(column).copy_from(block);
        };
        let by_rotation = so3::skew(&carried) - c * so3::skew(&f1);
        if pair.is_turned() {
            put(0, &pair.by_offset());
            let by_scale = Matrix3::from_diagonal(&carried) - c * Matrix3::from_diagonal(&f1);
            put(3, &by_scale);
            put(6, &by_rotation);
        }
        // The forces of a moment are carried to its end by the gyroscope as well, half a window in the mean.
        put(9, &(pair.by_bias() + by_rotation * (0.5 * WINDOW_S)));
        put(12, &pair.by_scale());
        let (u, f) = (pair.now.normalize(), pair.now);
        let mut length_design = SMatrix::<f64, 1, N>::zeros();
        for k in 0..3 {
            length_design[k] = u[k];
            length_design[3 + k] = u[k] * f[k];
        }
        length_design[15] = 1.0;
        // What is turned back and forth is off by less than what is turned on and on.
        let net = pair.turn.now_from_then.angle();
        let by_turn = TURN_SHARE * GRAVITY * net.max(BACK_AND_FORTH * pair.turn.turned_rad);
        Self {
            design,
            difference: pair.difference(),
            length_design,
            length: f.norm() - GRAVITY,
            variance: pair.variance + by_turn * by_turn,
            length_variance: 0.5 * pair.variance,
        }
    }

    fn residual(&self, estimate: &Estimate) -> Vector3<f64> {
        self.difference - self.design * estimate
    }

    /// Whitened square of all four.
    fn square(&self, estimate: &Estimate) -> f64 {
        let length = self.length - (self.length_design * estimate)[0];
        self.residual(estimate).norm_squared() / self.variance
            + length * length / self.length_variance
    }
}

/// The weighted least-squares fit.
struct Fitted {
    estimate: Estimate,
    covariance: Covariance,
    /// By how much residuals are larger than the moments say, as a variance.
    factor: f64,
}

impl Fitted {
    fn of(rows: &[Row], weights: &[f64]) -> Self {
        let prior = Estimate::from(PRIOR).map(|std| std.powi(-2));
        let mut normal = Covariance::from_diagonal(&prior);
        let mut right = Estimate::zeros();
        for (row, weight) in rows.iter().zip(weights) {
            let (w, l) = (weight / row.variance, weight / row.length_variance);
            normal += row.design.transpose() * row.design * w;
            right += row.design.transpose() * row.difference * w;
            normal += row.length_design.transpose() * row.length_design * l;
            right += row.length_design.transpose() * (row.length * l);
        }
        let covariance = normal.try_inverse().unwrap_or_else(Covariance::zeros);
        let estimate = covariance * right;
        let mut squares: Vec<_> = rows.iter().map(|row| row.square(&estimate)).collect();
        squares.sort_by(f64::total_cmp);
        // Four rows, of which the median of the square is 3.36; the unknowns make them smaller.
        let free = (1.0 - N as f64 / (4.0 * rows.len() as f64)).max(0.25);
        let factor = (squares[squares.len() / 2] / (MEDIAN + 0.99) / free).max(1.0);
        Self {
            estimate,
            covariance,
            factor,
        }
    }

    /// Of a row in the next pass: its variance is larger by the factor, and far ones count less.
    fn weight(&self, row: &Row) -> f64 {
        let sigmas = (row.square(&self.estimate) / (4.0 * self.factor)).sqrt();
        (FAR / sigmas.max(FAR)).powi(2) / self.factor
    }
}
