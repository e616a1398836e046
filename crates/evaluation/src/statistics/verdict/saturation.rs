//! Saturation: an axis that stays at the largest value it ever shows while the other axes go on changing.

use nalgebra::Vector3;

/// Samples in a row at the end of the range that are no chance, ...
const RUN: usize = 3;
/// ... where the other axes change meanwhile by this share of the sensor's largest value, ...
const CHANGE: f64 = 0.05;
/// ... or that the axis has come to in one step of this share of it: no motion stands still from one sample to the next, ...
const ENTERED: f64 = 0.03;
/// ... or so many in a row, where the other axes have not once repeated a value: their noise is larger than the steps of
/// the values, so that of this axis would be, too.
const LONG_RUN: usize = 10;
/// The end of the range of an axis is no less than this share of the sensor's largest value.
const LEVEL: f64 = 0.5;

/// Values repeat at the end of the range more often than anywhere else by this factor.
const MORE: u64 = 2;

/// Whether a sensor has delivered the same number again, to the last bit.
fn is_same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits()
}

/// Watches the axes of one sensor.
#[derive(Debug, Clone, Default)]
pub struct Saturation {
    last: Option<Vector3<f64>>,
    /// From the one before the last to the last.
    step: Vector3<f64>,
    largest: [f64; 3],
    runs: [Run; 3],
    saturated: u64,
    /// Samples of such runs that are not at the end of the range: coarse values repeat wherever a motion turns round.
    elsewhere: u64,
    /// The end of the range, as found last.
    level: f64,
}

/// Samples of one axis that are alike, and the others meanwhile.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    length: usize,
    least: Vector3<f64>,
    most: Vector3<f64>,
    /// The step to its first sample.
    entered: f64,
    /// Whether another axis has repeated a value.
    others_repeat: bool,
    /// Whether its first samples are counted.
    counted: bool,
}

impl Run {
    fn go_on(&mut self, axis: usize, [last, sample]: [&Vector3<f64>; 2], step: f64) {
        if self.length == 0 {
            *self = Self {
                length: 1,
                least: *last,
                most: *last,
                entered: step,
                ..Self::default()
            };
        }
        self.length += 1;
        self.least = self.least.inf(sample);
        self.most = self.most.sup(sample);
        let repeats = |other: usize| other != axis && is_same(sample[other], last[other]);
        self.others_repeat |= (0..3).any(repeats);
    }

    fn is_saturated(&self, largest: f64) -> bool {
        if self.length < RUN {
            return false;
        }
        let changed = (self.most - self.least).amax() > CHANGE * largest;
        let entered = self.entered > ENTERED * largest;
        changed || entered || (self.length >= LONG_RUN && !self.others_repeat)
    }
}

impl Saturation {
    /// Takes the next sample; returns whether it is saturated. No range ends below `least`, in the sensor's unit: an axis that
    /// passes the direction of gravity or of the field has its largest value there, too, and rounded values repeat.
    pub fn add(&mut self, sample: &Vector3<f64>, least: f64) -> bool {
        let mut is_saturated = false;
        for axis in 0..3 {
            self.largest[axis] = self.largest[axis].max(sample[axis].abs());
        }
        let largest = self.largest.into_iter().fold(0.0, f64::max);
        if largest * LEVEL > self.level {
            // The range goes on beyond what looked like its end.
            self.saturated = 0;
        }
        for (axis, run) in self.runs.iter_mut().enumerate() {
            let size = sample[axis].abs();
            let at_end = size > least && size >= self.largest[axis].max(LEVEL * largest);
            match self.last.filter(|last| is_same(last[axis], sample[axis])) {
                Some(last) => run.go_on(axis, [&last, sample], self.step[axis]),
                None if run.length == 0 => continue,
                None => *run = Run::default(),
            }
            if !run.is_saturated(largest) {
                continue;
            }
            // The samples of the run before it was known to be one.
            let before = if run.counted {
                0
            } else {
                run.length as u64 - 1
            };
            run.counted = true;
            if at_end {
                self.saturated += before;
                (is_saturated, self.level) = (true, size);
            } else {
                self.elsewhere += before + 1;
            }
        }
        let last = self.last.replace(*sample);
        self.step = last.map_or_else(Vector3::zeros, |last| (sample - last).abs());
        self.saturated += u64::from(is_saturated);
        is_saturated
    }

    /// Saturated samples, and the end of the range in the sensor's unit.
    #[must_use]
    pub fn found(&self) -> Option<(u64, f64)> {
        (self.saturated > MORE * self.elsewhere).then_some((self.saturated, self.level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn swing(k: u32) -> Vector3<f64> {
        let t = 0.01 * f64::from(k);
        Vector3::new(
            12.0 * (3.0 * t).sin(),
            5.0 * (4.1 * t).cos(),
            2.0 * (2.3 * t).sin(),
        )
    }

    #[test]
    fn a_clipped_axis_is_found_with_its_limit() {
        let mut saturation = Saturation::default();
        (0..1000).for_each(|k| {
            saturation.add(&swing(k).map(|v| v.clamp(-8.73, 8.73)), 0.0);
        });
        let (count, level) = saturation.found().unwrap();
        assert!(
            count > 100 && (level - 8.73).abs() < 1e-12,
            "{count} {level}"
        );
    }

    #[test]
    fn a_sensor_within_its_range_and_one_at_rest_are_not_saturated() {
        let mut saturation = Saturation::default();
        (0..1000).for_each(|k| {
            saturation.add(&swing(k), 0.0);
        });
        assert_eq!(saturation.found(), None);
        // Values that repeat while nothing moves yet are the largest so far, and not the end of the range.
        let mut starting = Saturation::default();
        (0..50).for_each(|k| {
            let drift = 1e-5 * f64::from(k);
            starting.add(&Vector3::new(0.001, drift, 0.5 * drift), 0.0);
        });
        assert!(starting.found().is_some());
        (0..1000).for_each(|k| {
            starting.add(&swing(k), 0.0);
        });
        assert_eq!(starting.found(), None);
        // Coarse values repeat wherever the motion turns round.
        let mut coarse = Saturation::default();
        (0..3000).for_each(|k| {
            let slow = swing(k).map(|v| (v * 0.5).round() * 2.0);
            coarse.add(&slow, 0.0);
        });
        assert_eq!(coarse.found(), None);
        let mut resting = Saturation::default();
        (0..1000).for_each(|k| {
            // Rounded to 0.1 m/s^2.
            let noise = if k % 7 == 0 { 0.1 } else { 0.0 };
            resting.add(&Vector3::new(0.1, noise, 9.8), 0.0);
        });
        assert_eq!(resting.found(), None);
    }
}
