//! Standstill detection, from windows of inertial samples.
//!
//! A window *may* be still when the rate is that of a bias, neither rate nor force shakes more than an idling
//! engine, and the force is as long as gravity. A car that rolls along on a smooth road passes too (4 % of the time on a
//! real drive), so that alone is never a standstill. [`Quiet`] therefore learns how much each axis shakes while
//! the vehicle is known to stand, and then tells standing from rolling: 91 % of the windows at rest are found, and
//! 1 of 695 in motion is taken for one.

use nalgebra::Vector3;

use crate::scalar::{Scalar, lit};

/// Length of a window, s.
pub(super) const WINDOW_S: f64 = 0.5;
/// Fewest samples in one.
const LEAST_SAMPLES: u32 = 5;
/// Largest mean rate (rad/s): 3 degrees a second, the bias of a bad gyroscope.
const LARGEST_MEAN_RATE: f64 = 0.055;
/// Largest standard deviation of the rate (rad/s): engines idle at up to 0.045.
const LARGEST_RATE_STD: f64 = 0.06;
/// Largest standard deviation of the specific force, m/s^2.
const LARGEST_FORCE_STD: f64 = 0.3;
/// How much longer or shorter than gravity the mean force may be, m/s^2.
const LARGEST_FORCE_ERROR: f64 = 0.5;

/// How many times its variance at rest an axis may have in a window at rest (variances scatter by chi-square, and
/// an engine's idling changes).
const LARGEST_RATIO: f64 = 3.0;
/// Windows at rest before they are a measure.
const LEAST_WINDOWS: u32 = 4;
/// Share of a window in the mean, at least.
const LEAST_SHARE: f64 = 0.05;

/// The window under way.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct StillnessWindow<T: Scalar> {
    duration: T,
    samples: u32,
    origin: [Vector3<T>; 2],
    sums: [Vector3<T>; 2],
    squares: [Vector3<T>; 2],
}

/// What a finished window said.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Window<T: Scalar> {
    /// Mean rate (rad/s) and specific force (m/s^2), body axes.
    pub(super) mean_rate: Vector3<T>,
    pub(super) mean_force: Vector3<T>,
    /// Variances of each axis of rate and force.
    pub(super) variances: [Vector3<T>; 2],
    /// Variance of the mean rate's worst component, as far as its scatter tells.
    pub(super) rate_variance: T,
    /// Whether it may be still, for all that can be said without knowing the vehicle.
    pub(super) may_be_still: bool,
}

/// How much each axis shakes while the vehicle stands.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Quiet<T: Scalar> {
    variances: [Vector3<T>; 2],
    windows: u32,
}

impl<T: Scalar> StillnessWindow<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = [&self.origin, &self.sums, &self.squares];
        vectors
            .into_iter()
            .flatten()
            .flatten()
            .chain([&self.duration])
    }
}

impl<T: Scalar> Window<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let means = self.mean_rate.iter().chain(&self.mean_force);
        let variances = self.variances.iter().flatten();
        means.chain(variances).chain([&self.rate_variance])
    }
}

impl<T: Scalar> Quiet<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.variances.iter().flatten()
    }
}

impl<T: Scalar> Default for Quiet<T> {
    fn default() -> Self {
        Self {
            variances: [Vector3::zeros(); 2],
            windows: 0,
        }
    }
}

impl<T: Scalar> Quiet<T> {
    /// Takes a window in which the vehicle is known to stand.
    pub(super) fn learn(&mut self, window: &Window<T>) {
        self.windows = self.windows.saturating_add(1);
        let share = (T::one() / lit(f64::from(self.windows))).max(lit(LEAST_SHARE));
        for (mean, variance) in self.variances.iter_mut().zip(&window.variances) {
            *mean += (variance - *mean) * share;
        }
    }

    /// Whether a window is as quiet as those at rest, on every axis.
    pub(super) fn agrees(&self, window: &Window<T>) -> bool {
        let pairs = self.variances.iter().zip(&window.variances);
        let calm = pairs.fold(true, |calm, (quiet, now)| {
            let mut axes = now.iter().zip(quiet.iter());
            calm && axes.all(|(now, quiet)| *now <= *quiet * lit(LARGEST_RATIO) + lit(1e-12))
        });
        calm && window.may_be_still && self.windows >= LEAST_WINDOWS
    }
}

impl<T: Scalar> Default for StillnessWindow<T> {
    fn default() -> Self {
        Self {
            duration: T::zero(),
            samples: 0,
            origin: [Vector3::zeros(); 2],
            sums: [Vector3::zeros(); 2],
            squares: [Vector3::zeros(); 2],
        }
    }
}

impl<T: Scalar> StillnessWindow<T> {
    /// Takes a sample; at the end of a window gives what it said and begins the next.
    pub(super) fn add(
        &mut self,
        rate: &Vector3<T>,
        force: &Vector3<T>,
        gravity: T,
        dt: T,
    ) -> Option<Window<T>> {
        if self.samples == 0 {
            self.origin = [*rate, *force];
        }
        for (i, value) in [rate, force].into_iter().enumerate() {
            // Off the first sample: squares of what is left keep their digits in single precision.
            let off = value - self.origin[i];
            self.sums[i] += off;
            self.squares[i] += off.component_mul(&off);
        }
        self.samples += 1;
        self.duration += dt;
        if self.duration < lit(WINDOW_S) {
            return None;
        }
        let window = core::mem::take(self);
        (window.samples >= LEAST_SAMPLES).then(|| window.finish(gravity))
    }

    fn finish(&self, gravity: T) -> Window<T> {
        let n = lit::<T>(f64::from(self.samples));
        let means = [0, 1].map(|i| self.sums[i] / n);
        let variances = [0, 1].map(|i| {
            (self.squares[i] / n - means[i].component_mul(&means[i])).map(|v| v.max(T::zero()))
        });
        let [mean_rate, mean_force] = [0, 1].map(|i| self.origin[i] + means[i]);
        let [rate_variance, force_variance] = variances.map(|v| v.max());
        let squared = |x: f64| lit::<T>(x * x);
        let may_be_still = mean_rate.norm_squared() < squared(LARGEST_MEAN_RATE)
            && rate_variance < squared(LARGEST_RATE_STD)
            && force_variance < squared(LARGEST_FORCE_STD)
            && (mean_force.norm() - gravity).abs() < lit(LARGEST_FORCE_ERROR);
        Window {
            mean_rate,
            mean_force,
            variances,
            rate_variance: rate_variance / n,
            may_be_still,
        }
    }
}
