//! What the turns of gravity in the accelerometer say of the gyroscope: the unit of its numbers, its axes, and the rate
//! of rows that have no time stamps.
//!
//! In body axes the specific force `f` of a device that turns with the rate `w` changes by `-w x f` a second, but for
//! what its accelerations add. Over many short steps the least-squares factor between what was seen and what the
//! gyroscope says is 1 where unit, axes and time are right. Degrees taken for radians make it 1/57; rows taken for
//! seconds make it the time of a row.

use nalgebra::Vector3;

use crate::signed_axes::SignedAxes;

/// A vector sensor's numbers: time and value.
pub(super) type Series = Vec<(f64, Vector3<f64>)>;

/// Steps that are looked at.
const MOST_STEPS: usize = 100_000;
/// Fewer tell nothing.
const LEAST_STEPS: usize = 30;
/// Numbers that are averaged in a step: that many are taken with which most is explained. More of them beat the noise
/// down, until a turn within a step is no longer short.
const AVERAGED: [usize; 5] = [2, 4, 8, 16, 32];

/// The gyroscope's rate, the force in the middle, and how the force changed in a time.
struct Step {
    rate: Vector3<f64>,
    force: Vector3<f64>,
    change: Vector3<f64>,
    time: f64,
}

/// How the gyroscope's numbers fit the turns that the accelerometer shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    /// Seen by said.
    pub(super) factor: f64,
    /// How much of what is seen is explained, -1 to 1.
    pub(super) correlation: f64,
    /// The factor's standard deviation.
    pub(super) std: f64,
}

impl Fit {
    /// Whether there are turns enough to use it: the factor differs from none by ten of its deviations.
    pub(super) fn tells(&self) -> bool {
        self.factor.is_finite() && self.factor.abs() > 10.0 * self.std && self.correlation > 0.2
    }
}

/// The turns of a recording.
pub(super) struct Turns {
    steps: Vec<Step>,
}

impl Turns {
    /// From the two sensors on one clock, in any units.
    pub(super) fn of(gyroscope: &Series, accelerometer: &Series) -> Self {
        let made = AVERAGED.map(|rows| Self::averaged(gyroscope, accelerometer, rows));
        let explained = |turns: &Self| {
            turns
                .fits()
                .iter()
                .map(|(_, fit)| fit.correlation)
                .fold(-1.0, f64::max)
        };
        let best = made
            .into_iter()
            .max_by(|a, b| explained(a).total_cmp(&explained(b)));
        best.unwrap_or(Self { steps: Vec::new() })
    }

    fn averaged(gyroscope: &Series, accelerometer: &Series, rows: usize) -> Self {
        let forces = averaged(accelerometer, rows);
        let rates = averaged_between(gyroscope, &forces);
        let mut norms: Vec<f64> = forces.iter().map(|(_, force)| force.norm()).collect();
        let gravity = median(&mut norms);
        let is_calm = |force: &Vector3<f64>| (force.norm() / gravity - 1.0).abs() < 0.3;
        let steps = forces.windows(2).zip(rates).filter_map(|(pair, rate)| {
            let ((from, first), (to, second)) = (pair[0], pair[1]);
            let is_used = to > from && is_calm(&first) && is_calm(&second);
            is_used.then_some(Step {
                rate: rate?,
                force: (first + second) / 2.0,
                change: second - first,
                time: to - from,
            })
        });
        Self {
            steps: steps.take(MOST_STEPS).collect(),
        }
    }

    /// The fit with the gyroscope's axes put so.
    pub(super) fn fit(&self, axes: SignedAxes) -> Option<Fit> {
        if self.steps.len() < LEAST_STEPS {
            return None;
        }
        let (mut said2, mut seen2, mut both) = (0.0, 0.0, 0.0);
        for step in &self.steps {
            let said = -axes.of(&step.rate).cross(&step.force) * step.time;
            said2 += said.norm_squared();
            seen2 += step.change.norm_squared();
            both += said.dot(&step.change);
        }
        let factor = both / said2;
        let left = (seen2 - factor * both).max(0.0);
        Some(Fit {
            factor,
            correlation: both / (said2 * seen2).sqrt(),
            std: (left / said2 / (2 * self.steps.len()) as f64).sqrt(),
        })
    }

    /// The axes that fit best of all 48, if none other fits nearly as well.
    pub(super) fn best_axes(&self) -> Option<(SignedAxes, Fit)> {
        let mut fits = self.fits();
        fits.sort_by(|(_, a), (_, b)| b.correlation.total_cmp(&a.correlation));
        let (best, next) = (*fits.first()?, fits.get(1)?.1);
        (best.1.tells() && next.correlation < 0.9 * best.1.correlation).then_some(best)
    }

    /// The fits with all axes.
    fn fits(&self) -> Vec<(SignedAxes, Fit)> {
        let fit = |axes: SignedAxes| self.fit(axes).map(|fit| (axes, fit));
        SignedAxes::all().filter_map(fit).collect()
    }
}

/// Means of so many numbers each.
fn averaged(series: &Series, rows: usize) -> Series {
    let mean = |piece: &[(f64, Vector3<f64>)]| {
        let n = piece.len() as f64;
        let time = piece.iter().map(|(t, _)| t).sum::<f64>() / n;
        (time, piece.iter().map(|(_, v)| v).sum::<Vector3<f64>>() / n)
    };
    series.chunks_exact(rows).map(mean).collect()
}

/// Means of a series between each two of the times of another; none where it has no numbers.
fn averaged_between(series: &Series, times: &Series) -> Vec<Option<Vector3<f64>>> {
    let mut place = 0;
    let mut means = Vec::with_capacity(times.len());
    for pair in times.windows(2) {
        while series.get(place).is_some_and(|(t, _)| *t < pair[0].0) {
            place += 1;
        }
        let within = series[place..].iter().take_while(|(t, _)| *t <= pair[1].0);
        let (sum, count) = within.fold((Vector3::zeros(), 0_usize), |(sum, count), (_, v)| {
            (sum + v, count + 1)
        });
        means.push((count > 0).then(|| sum / count as f64));
    }
    means
}

/// The median; NaN of none.
pub(super) fn median(values: &mut Vec<f64>) -> f64 {
    values.retain(|value| value.is_finite());
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// A device that turns to and fro about all axes, 100 rows a second, with noise of a phone.
    fn made(seconds: f64, turning: f64) -> (Series, Series) {
        let mut attitude = UnitQuaternion::identity();
        let (mut gyroscope, mut accelerometer) = (Vec::new(), Vec::new());
        let mut noise = 1_u64;
        let mut random = || {
            noise = noise
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (noise >> 33) as f64 / f64::from(u32::MAX >> 1) - 1.0
        };
        for k in 0..(seconds * 100.0) as u32 {
            let t = f64::from(k) * 0.01;
            let rate = turning * Vector3::new((1.1 * t).sin(), (0.7 * t).cos(), (0.5 * t).sin());
            let force = attitude.inverse() * Vector3::new(0.0, 0.0, 9.81);
            gyroscope.push((t, rate));
            accelerometer.push((t, force + 0.3 * Vector3::new(random(), random(), random())));
            attitude *= UnitQuaternion::new(rate * 0.01);
        }
        (gyroscope, accelerometer)
    }

    fn turned(series: &Series, by: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Series {
        series.iter().map(|(t, v)| (*t, by(*v))).collect()
    }

    #[test]
    fn radians_degrees_and_rows_are_told_apart() {
        let (rates, forces) = made(60.0, 0.8);
        let fit = Turns::of(&rates, &forces)
            .fit(SignedAxes::AS_THEY_ARE)
            .unwrap();
        assert!(fit.tells() && (fit.factor - 1.0).abs() < 0.03, "{fit:?}");
        let degrees = turned(&rates, |v| v * 180.0 / std::f64::consts::PI);
        let fit = Turns::of(&degrees, &forces)
            .fit(SignedAxes::AS_THEY_ARE)
            .unwrap();
        assert!((fit.factor * 57.3 - 1.0).abs() < 0.03, "{fit:?}");
        let rows = |series: &Series| -> Series {
            let counted = series.iter().enumerate();
            counted.map(|(k, (_, v))| (k as f64, *v)).collect()
        };
        let fit = Turns::of(&rows(&rates), &rows(&forces))
            .fit(SignedAxes::AS_THEY_ARE)
            .unwrap();
        assert!((fit.factor * 100.0 - 1.0).abs() < 0.03, "{fit:?}");
    }

    #[test]
    fn exchanged_and_mirrored_axes_are_found() {
        let (rates, forces) = made(60.0, 0.8);
        let other = turned(&rates, |v| Vector3::new(v.y, v.x, -v.z));
        let (axes, fit) = Turns::of(&other, &forces).best_axes().unwrap();
        assert_eq!(axes.to_string(), "y,x,-z");
        assert!(fit.tells());
        let (axes, _) = Turns::of(&rates, &forces).best_axes().unwrap();
        assert_eq!(axes, SignedAxes::AS_THEY_ARE);
    }

    #[test]
    fn at_rest_nothing_is_told() {
        let (rates, forces) = made(60.0, 0.0);
        let fit = Turns::of(&rates, &forces).fit(SignedAxes::AS_THEY_ARE);
        assert!(!fit.unwrap().tells());
        assert!(
            Turns::of(&rates, &Vec::new())
                .fit(SignedAxes::AS_THEY_ARE)
                .is_none()
        );
    }
}
