//! What the rests of a recording say of the gyroscope: a bias that changed from one to the next.
//!
//! While a device rests the gyroscope shows its bias.

use nalgebra::Vector3;

/// Means are made over windows of this length, s, ...
const WINDOW_S: f64 = 0.5;
/// ... and so many in a row that agree are a rest: a hand that is steady for a moment, or pans, does not agree.
const WINDOWS: u32 = 4;
/// Means agree within so many standard deviations.
const AGREE: f64 = 3.5;
/// Fewer samples are no window.
const FEWEST: u32 = 10;
/// A window rests when its rates and forces vary by less than so many times the least that any window showed, ...
const QUIET: f64 = 3.0;
/// ... and turns by less than this (rad/s): no gyroscope of a device has a larger bias.
pub(super) const SLOWEST_RAD_S: f64 = 0.15;
/// Forces vary by less than this share of gravity in a rest: a hand is quieter.
const QUIET_SHARE: f64 = 0.03;
/// A change is named when it is so many times its standard deviation.
const SIGMAS: f64 = 6.0;

/// The mean of windows at rest.
#[derive(Debug, Clone, Copy)]
struct Rest {
    windows: u32,
    end_ns: i64,
    rate: Vector3<f64>,
    /// Variance of that mean, per axis.
    rate_variance: f64,
    force: Vector3<f64>,
    /// Variance of that mean, per axis.
    force_variance: f64,
}

impl Rest {
    /// Whether a window is of the same rest.
    fn agrees(&self, window: &Self) -> bool {
        let far = |difference: Vector3<f64>, a: f64, b: f64| {
            difference.norm_squared() > 3.0 * AGREE * AGREE * (a + b)
        };
        !far(
            self.rate - window.rate,
            self.rate_variance,
            window.rate_variance,
        ) && !far(
            self.force - window.force,
            self.force_variance,
            window.force_variance,
        )
    }

    fn and(&self, window: &Self) -> Self {
        let n = f64::from(self.windows);
        let mean = |a: Vector3<f64>, b: Vector3<f64>| (a * n + b) / (n + 1.0);
        let variance = |a: f64, b: f64| (a * n * n + b) / ((n + 1.0) * (n + 1.0));
        Self {
            windows: self.windows + 1,
            end_ns: window.end_ns,
            rate: mean(self.rate, window.rate),
            rate_variance: variance(self.rate_variance, window.rate_variance),
            force: mean(self.force, window.force),
            force_variance: variance(self.force_variance, window.force_variance),
        }
    }
}

/// A bias that changed from one rest to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasChange {
    /// The end of the rest before, ns.
    pub before_ns: i64,
    /// The end of the rest after, ns.
    pub after_ns: i64,
    /// By how much, rad/s.
    pub rad_s: f64,
    /// In its standard deviations.
    pub sigmas: f64,
}

/// Mean and spread of the samples of a window.
#[derive(Debug, Clone, Copy, Default)]
struct Window {
    count: u32,
    mean: Vector3<f64>,
    squares: f64,
}

impl Window {
    fn add(&mut self, v: &Vector3<f64>) {
        self.count += 1;
        let before = v - self.mean;
        self.mean += before / f64::from(self.count);
        self.squares += before.dot(&(v - self.mean));
    }

    /// Variance of a sample, per axis.
    fn variance(&self) -> f64 {
        self.squares / (3.0 * f64::from(self.count.max(2) - 1))
    }
}

/// Watches gyroscope and accelerometer. See the [module](self).
#[derive(Debug, Clone, Default)]
pub struct Rests {
    since_ns: Option<i64>,
    last_rate_ns: Option<i64>,
    rates: Window,
    forces: Window,
    /// Least variances of any window.
    least: Option<[f64; 2]>,
    /// Windows that agree so far.
    quiet: Option<Rest>,
    /// The last rest.
    rest: Option<Rest>,
    bias_change: Option<BiasChange>,
    /// Squared differences of the means of neighbouring windows of one rest, per axis, and how many: a hand's
    /// slow motion is in none of the windows' own variances.
    repeated: f64,
    repeats: u32,
}

impl Rests {
    /// Takes an angular rate, rad/s.
    pub fn rate(&mut self, time_ns: i64, rate: &Vector3<f64>) {
        if let Some(last_ns) = self.last_rate_ns.replace(time_ns) {
            let dt = time_ns.saturating_sub(last_ns) as f64 * 1e-9;
            if !(0.0..1.0).contains(&dt) {
                self.rest = None;
            }
        }
        let since = *self.since_ns.get_or_insert(time_ns);
        self.rates.add(rate);
        if time_ns.saturating_sub(since) as f64 * 1e-9 >= WINDOW_S {
            self.end_window(time_ns);
        }
    }

    /// What was gathered is of no rest: something else says that the device moves.
    pub fn interrupt(&mut self) {
        (self.since_ns, self.quiet) = (None, None);
        (self.rates, self.forces) = Default::default();
    }

    /// Takes a specific force, m/s^2.
    pub fn force(&mut self, force: &Vector3<f64>) {
        if self.since_ns.is_some() {
            self.forces.add(force);
        }
    }

    fn end_window(&mut self, time_ns: i64) {
        let (rates, forces) = (self.rates, self.forces);
        self.since_ns = None;
        (self.rates, self.forces) = Default::default();
        if rates.count < FEWEST || forces.count < FEWEST {
            return;
        }
        let spread = [rates.variance(), forces.variance()];
        let least = self
            .least
            .map_or(spread, |least| [0, 1].map(|i| spread[i].min(least[i])));
        self.least = Some(least);
        // A sensor that is rounded so coarsely that it does not move at all has still half a step of noise.
        let quiet = [0, 1]
            .iter()
            .all(|i| spread[*i] <= QUIET * QUIET * least[*i].max(1e-12))
            && spread[1] < (QUIET_SHARE * forces.mean.norm()).powi(2)
            && spread[0] < SLOWEST_RAD_S * SLOWEST_RAD_S;
        if !quiet || rates.mean.norm() > SLOWEST_RAD_S {
            self.quiet = None;
            return;
        }
        let now = Rest {
            windows: 1,
            end_ns: time_ns,
            rate: rates.mean,
            rate_variance: (spread[0] / f64::from(rates.count)).max(1e-10),
            force: forces.mean,
            force_variance: (spread[1] / f64::from(forces.count)).max(1e-8),
        };
        let chain = self.quiet.filter(|chain| chain.agrees(&now));
        let Some(before) = chain else {
            self.quiet = Some(now);
            return;
        };
        self.repeats += 1;
        self.repeated += (now.rate - before.rate).norm_squared() / 3.0;
        let longer = before.and(&now);
        self.quiet = Some(longer);
        if longer.windows < WINDOWS {
            return;
        }
        if let Some(last) = self.rest.replace(longer)
            && longer.windows == WINDOWS
        {
            self.compare(&last, &longer);
        }
    }

    fn compare(&mut self, before: &Rest, now: &Rest) {
        let change = (now.rate - before.rate).norm();
        let rate_variance = self
            .repeatability()
            .max(now.rate_variance + before.rate_variance);
        let sigmas = change / rate_variance.sqrt();
        if sigmas > SIGMAS && self.bias_change.is_none_or(|worst| change > worst.rad_s) {
            self.bias_change = Some(BiasChange {
                before_ns: before.end_ns,
                after_ns: now.end_ns,
                rad_s: change,
                sigmas,
            });
        }
    }

    /// Variance of the difference of two windows' means, per axis, as the windows of one rest show it.
    fn repeatability(&self) -> f64 {
        self.repeated / f64::from(self.repeats.max(1))
    }

    /// The largest change of the gyroscope's bias from one rest to the next, where it is no chance.
    #[must_use]
    pub fn bias_change(&self) -> Option<BiasChange> {
        self.bias_change
    }
}
