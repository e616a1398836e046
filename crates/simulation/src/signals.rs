//! Random draws and smooth random signals that motions and sensors of random worlds are made of.

use core::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{ComplexField, UnitQuaternion, Vector3};
use rand::RngExt as _;

use crate::random::{Stream, standard_normal, stream};
use crate::rotation::{exp, sin_cos};

/// Draws from one named stream.
pub(crate) struct Draws(pub(crate) Stream);

impl Draws {
    pub(crate) fn new(seed: u64, name: &str) -> Self {
        Self(stream(seed, name))
    }

    /// Uniform between two bounds.
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random_range(0.0..1.0)
    }

    /// Uniform in the logarithm.
    pub(crate) fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        low * exponential(self.uniform(0.0, 1.0) * logarithm(high / low))
    }

    /// True with this probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform(0.0, 1.0) < probability
    }

    /// One of these, all alike.
    pub(crate) fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.0.random_range(0..of.len())]
    }

    /// In any order.
    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.0.random_range(0..=last));
        }
    }

    /// Plus or minus one.
    pub(crate) fn sign(&mut self) -> f64 {
        self.one_of(&[-1.0, 1.0])
    }

    /// Standard normal.
    pub(crate) fn normal(&mut self) -> f64 {
        standard_normal(&mut self.0)
    }

    /// Three of them.
    pub(crate) fn normals(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }

    /// A direction, uniform on the sphere.
    pub(crate) fn direction(&mut self) -> Vector3<f64> {
        let drawn = self.normals();
        // Three zeros at once do not happen; if they did, any direction would do.
        drawn.try_normalize(1e-9).unwrap_or_else(Vector3::x)
    }

    /// A horizontal direction, uniform on the circle.
    pub(crate) fn level_direction(&mut self) -> Vector3<f64> {
        let (sin, cos) = sin_cos(self.uniform(0.0, TAU));
        Vector3::new(cos, sin, 0.0)
    }

    /// Any rotation, uniform over all: a unit quaternion uniform on its sphere.
    pub(crate) fn rotation(&mut self) -> UnitQuaternion<f64> {
        let (vector, scalar) = (self.normals(), self.normal());
        let drawn = nalgebra::Quaternion::from_parts(scalar, vector);
        UnitQuaternion::try_new(drawn, 1e-9).unwrap_or_else(UnitQuaternion::identity)
    }

    /// A rotation about a random axis with this standard deviation an axis, rad.
    pub(crate) fn small_rotation(&mut self, std: f64) -> UnitQuaternion<f64> {
        exp(&(self.normals() * std))
    }
}

/// `e^x`, from the same library on every machine.
pub(crate) fn exponential(x: f64) -> f64 {
    ComplexField::exp(x)
}

/// The natural logarithm, likewise.
pub(crate) fn logarithm(x: f64) -> f64 {
    ComplexField::ln(x)
}

/// A value with its first and second derivative in time.
pub(crate) type Jet = [f64; 3];

/// A sum of sines: amplitude, frequency (Hz), phase (rad).
#[derive(Debug, Clone, Default)]
pub(crate) struct Waves(pub(crate) Vec<[f64; 3]>);

impl Waves {
    /// So many of them with frequencies (Hz, uniform in the logarithm) and a root mean square of the sum that is at most `rms`.
    pub(crate) fn draw(draws: &mut Draws, count: usize, rms: f64, hz: [f64; 2]) -> Self {
        let amplitude = rms * (2.0 / count.max(1) as f64).sqrt();
        let one = |_| {
            let share = draws.uniform(0.5, 1.0);
            let frequency = draws.log_uniform(hz[0], hz[1]);
            [amplitude * share, frequency, draws.uniform(0.0, TAU)]
        };
        Self((0..count).map(one).collect())
    }

    pub(crate) fn value(&self, t: f64) -> f64 {
        let one = |[amplitude, hz, phase]: &[f64; 3]| amplitude * sin_cos(TAU * hz * t + phase).0;
        self.0.iter().map(one).sum()
    }

    /// Value and derivatives.
    pub(crate) fn jet(&self, t: f64) -> Jet {
        let mut jet = [0.0; 3];
        for [amplitude, hz, phase] in &self.0 {
            let omega = TAU * hz;
            let (sin, cos) = sin_cos(omega * t + phase);
            jet[0] += amplitude * sin;
            jet[1] += amplitude * omega * cos;
            jet[2] -= amplitude * omega * omega * sin;
        }
        jet
    }

    /// The first derivative times a factor, which is a sum of sines, too.
    pub(crate) fn derivative(&self, factor: f64) -> Self {
        let one = |[amplitude, hz, phase]: &[f64; 3]| {
            [factor * amplitude * TAU * hz, *hz, phase + FRAC_PI_2]
        };
        Self(self.0.iter().map(one).collect())
    }
}

/// A value that is held, goes smoothly to another, is held again: speed over a drive. Value, slope and curvature are
/// continuous.
#[derive(Debug, Clone)]
pub(crate) struct Schedule {
    first: f64,
    /// From when, until when, to which value.
    changes: Vec<[f64; 3]>,
}

impl Schedule {
    /// One that begins with this value.
    pub(crate) const fn starting_at(first: f64) -> Self {
        Self {
            first,
            changes: Vec::new(),
        }
    }

    /// When the last change is over, s.
    pub(crate) fn end(&self) -> f64 {
        self.changes.last().map_or(0.0, |change| change[1])
    }

    /// Its last value.
    pub(crate) fn last(&self) -> f64 {
        self.changes.last().map_or(self.first, |change| change[2])
    }

    /// Holds for `hold` seconds, then goes to `value` in `ramp` seconds.
    pub(crate) fn then(&mut self, hold: f64, ramp: f64, value: f64) {
        let from = self.end() + hold.max(0.0);
        self.changes.push([from, from + ramp.max(1e-3), value]);
    }

    /// The same, no steeper than `slope`.
    pub(crate) fn then_no_steeper(&mut self, hold: f64, slope: f64, value: f64) {
        // The quintic is 15/8 times as steep in the middle as on average.
        let ramp = 1.875 * (value - self.last()).abs() / slope;
        self.then(hold, ramp.max(1.0), value);
    }

    /// Multiplies all its values.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.first *= factor;
        self.changes
            .iter_mut()
            .for_each(|change| change[2] *= factor);
    }

    /// Value and derivatives.
    pub(crate) fn jet(&self, t: f64) -> Jet {
        let next = self.changes.partition_point(|change| change[1] <= t);
        let before = match next {
            0 => self.first,
            n => self.changes[n - 1][2],
        };
        let Some([from, until, after]) = self.changes.get(next) else {
            return [before, 0.0, 0.0];
        };
        let (span, step) = (until - from, after - before);
        let x = ((t - from) / span).clamp(0.0, 1.0);
        let rest = 1.0 - x;
        [
            before + step * x * x * x * (10.0 + x * (6.0 * x - 15.0)),
            step * 30.0 * x * x * rest * rest / span,
            step * 60.0 * x * rest * (rest - x) / (span * span),
        ]
    }

    pub(crate) fn value(&self, t: f64) -> f64 {
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
    fn derivatives_are_those_of_the_values() {
        let mut held = Schedule::starting_at(-1.0);
        held.then(1.0, 2.0, 4.0);
        held.then(0.5, 1.0, 0.0);
        let waves = Waves::draw(&mut Draws::new(4, "test"), 3, 1.0, [0.1, 2.0]);
        let slope = waves.derivative(2.0);
        let h = 1e-4;
        for k in 0..600 {
            let t = 0.01 * f64::from(k) + 0.003;
            for jet in [&|t| held.jet(t), &|t| waves.jet(t)] as [&dyn Fn(f64) -> Jet; 2] {
                let (before, now, after) = (jet(t - h), jet(t), jet(t + h));
                assert!(
                    ((after[0] - before[0]) / (2.0 * h) - now[1]).abs() < 1e-5,
                    "{t}"
                );
                assert!(
                    ((after[1] - before[1]) / (2.0 * h) - now[2]).abs() < 1e-3,
                    "{t}"
                );
            }
            assert!((held.jet(t)[0] - held.value(t)).abs() < 1e-12);
            assert!((slope.value(t) - 2.0 * waves.jet(t)[1]).abs() < 1e-9);
        }
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
