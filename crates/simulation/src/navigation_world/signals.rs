//! Random draws and smooth random signals that motions, units and receivers of the worlds are made of.

use core::f64::consts::TAU;

use nalgebra::{ComplexField, UnitQuaternion, Vector3};
use rand::RngExt as _;

use crate::random::{Stream, standard_normal, stream};
use crate::rotation::{exp, sin_cos};

/// Draws from one named stream.
pub(super) struct Draws(pub(super) Stream);

impl Draws {
    pub(super) fn new(seed: u64, name: &str) -> Self {
        Self(stream(seed, name))
    }

    /// Uniform between two bounds.
    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random_range(0.0..1.0)
    }

    /// Uniform in the logarithm.
    pub(super) fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        low * exponential(self.uniform(0.0, 1.0) * logarithm(high / low))
    }

    /// True with this probability.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.uniform(0.0, 1.0) < probability
    }

    /// One of these, all alike.
    pub(super) fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.0.random_range(0..of.len())]
    }

    /// Plus or minus one.
    pub(super) fn sign(&mut self) -> f64 {
        self.one_of(&[-1.0, 1.0])
    }

    /// Standard normal.
    pub(super) fn normal(&mut self) -> f64 {
        standard_normal(&mut self.0)
    }

    /// Three of them.
    pub(super) fn normals(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }

    /// A direction, uniform on the sphere.
    pub(super) fn direction(&mut self) -> Vector3<f64> {
        let drawn = self.normals();
        // Three zeros at once do not happen; if they did, any direction would do.
        drawn.try_normalize(1e-9).unwrap_or_else(Vector3::x)
    }

    /// A horizontal direction, uniform on the circle.
    pub(super) fn level_direction(&mut self) -> Vector3<f64> {
        let (sin, cos) = sin_cos(self.uniform(0.0, TAU));
        Vector3::new(cos, sin, 0.0)
    }

    /// Any rotation, uniform over all: a unit quaternion uniform on its sphere.
    pub(super) fn rotation(&mut self) -> UnitQuaternion<f64> {
        let (vector, scalar) = (self.normals(), self.normal());
        let drawn = nalgebra::Quaternion::from_parts(scalar, vector);
        UnitQuaternion::try_new(drawn, 1e-9).unwrap_or_else(UnitQuaternion::identity)
    }

    /// A rotation about a random axis with this standard deviation an axis, rad.
    pub(super) fn small_rotation(&mut self, std: f64) -> UnitQuaternion<f64> {
        exp(&(self.normals() * std))
    }
}

/// `e^x`, from the same library on every machine.
pub(super) fn exponential(x: f64) -> f64 {
    ComplexField::exp(x)
}

/// The natural logarithm, likewise.
pub(super) fn logarithm(x: f64) -> f64 {
    ComplexField::ln(x)
}

/// A sum of sines.
pub(super) struct Waves(Vec<[f64; 3]>);

impl Waves {
    /// So many of them with frequencies (Hz, uniform in the logarithm) and a root mean square of the sum that is at most `rms`.
    pub(super) fn draw(draws: &mut Draws, count: usize, rms: f64, hz: [f64; 2]) -> Self {
        let amplitude = rms * (2.0 / count.max(1) as f64).sqrt();
        let one = |_| {
            let share = draws.uniform(0.5, 1.0);
            let frequency = draws.log_uniform(hz[0], hz[1]);
            [amplitude * share, frequency, draws.uniform(0.0, TAU)]
        };
        Self((0..count).map(one).collect())
    }

    pub(super) fn value(&self, t: f64) -> f64 {
        let one = |[amplitude, hz, phase]: &[f64; 3]| amplitude * sin_cos(TAU * hz * t + phase).0;
        self.0.iter().map(one).sum()
    }
}

/// A value that is held, goes smoothly to another, is held again: speed over a drive. Value, slope and curvature are
/// continuous.
pub(super) struct Schedule {
    first: f64,
    /// From when, until when, to which value.
    changes: Vec<[f64; 3]>,
}

impl Schedule {
    /// One that begins with this value.
    pub(super) const fn starting_at(first: f64) -> Self {
        Self {
            first,
            changes: Vec::new(),
        }
    }

    /// When the last change is over, s.
    pub(super) fn end(&self) -> f64 {
        self.changes.last().map_or(0.0, |change| change[1])
    }

    /// Its last value.
    pub(super) fn last(&self) -> f64 {
        self.changes.last().map_or(self.first, |change| change[2])
    }

    /// Holds for `hold` seconds, then goes to `value` in `ramp` seconds.
    pub(super) fn then(&mut self, hold: f64, ramp: f64, value: f64) {
        let from = self.end() + hold.max(0.0);
        self.changes.push([from, from + ramp.max(1e-3), value]);
    }

    /// The same, no steeper than `slope`.
    pub(super) fn then_no_steeper(&mut self, hold: f64, slope: f64, value: f64) {
        // The quintic is 15/8 times as steep in the middle as on average.
        let ramp = 1.875 * (value - self.last()).abs() / slope;
        self.then(hold, ramp.max(1.0), value);
    }

    pub(super) fn value(&self, t: f64) -> f64 {
        let next = self.changes.partition_point(|change| change[1] <= t);
        let before = match next {
            0 => self.first,
            n => self.changes[n - 1][2],
        };
        let Some([from, until, after]) = self.changes.get(next) else {
            return before;
        };
        let x = ((t - from) / (until - from)).clamp(0.0, 1.0);
        before + (after - before) * x * x * x * (10.0 + x * (6.0 * x - 15.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_holds_its_values_and_is_no_steeper_than_it_says() {
        let mut speed = Schedule::starting_at(3.0);
        speed.then_no_steeper(2.0, 1.5, 12.0);
        speed.then_no_steeper(4.0, 2.0, 0.0);
        assert!((speed.value(1.9) - 3.0).abs() < 1e-12 && (speed.last()).abs() < 1e-12);
        assert!((speed.value(speed.end() + 5.0)).abs() < 1e-12);
        let first_end = 2.0 + 1.875 * 9.0 / 1.5;
        assert!((speed.value(first_end + 2.0) - 12.0).abs() < 1e-12);
        let slope = |t: f64| (speed.value(t + 1e-4) - speed.value(t - 1e-4)) / 2e-4;
        let slopes = (0..4000).map(|k| slope(f64::from(k) * 0.01));
        let (low, high) = slopes.fold((0.0, 0.0), |(l, h): (f64, f64), s| (l.min(s), h.max(s)));
        assert!(
            (high - 1.5).abs() < 1e-3 && (low + 2.0).abs() < 1e-3,
            "{low} {high}"
        );
    }

    #[test]
    fn draws_keep_their_bounds_and_fill_them() {
        let mut draws = Draws::new(1, "test");
        let drawn: Vec<f64> = (0..4000).map(|_| draws.log_uniform(0.02, 5.0)).collect();
        assert!(drawn.iter().all(|v| (0.02..=5.0).contains(v)));
        let below = drawn.iter().filter(|v| **v < 0.316).count();
        assert!(
            (1850..2150).contains(&below),
            "half of them below the geometric mean: {below}"
        );
        // The mean of rotated axes is zero when all rotations are alike.
        let mean: Vector3<f64> = (0..4000)
            .map(|_| draws.rotation() * Vector3::x())
            .sum::<Vector3<f64>>()
            / 4000.0;
        assert!(mean.norm() < 0.05, "{mean}");
    }

    #[test]
    fn waves_have_the_size_asked_for() {
        let mut draws = Draws::new(2, "test");
        let waves = Waves::draw(&mut draws, 4, 0.5, [0.1, 1.0]);
        let square: f64 = (0..60_000)
            .map(|k| waves.value(f64::from(k) * 0.01).powi(2))
            .sum();
        let rms = (square / 60_000.0).sqrt();
        assert!(rms > 0.25 && rms < 0.51, "{rms}");
    }
}
