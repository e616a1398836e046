//! Magnetic disturbance of a recording: is the field that of the Earth, and constant while the device rests?

use nalgebra::Vector3;

/// Weakest and strongest field on Earth, microtesla, and what is still let pass: sensors err.
const EARTH_UT: [f64; 2] = [22.0, 67.0];
const LET_PASS_UT: [f64; 2] = [18.0, 75.0];
/// What no magnetometer beside an inertial sensor can measure, microtesla.
const RANGE_UT: f64 = 5000.0;
/// Fewer samples say nothing.
const FEWEST: u64 = 50;
/// A device that turns slower than this rests, rad/s: biases are smaller.
const STILL_RAD_S: f64 = 0.1;
/// Samples of a mean, and how far one may lie from the first of the same rest, microtesla.
const PIECE: u32 = 10;
const STEADY_UT: f64 = 10.0;

/// The device turns faster than this where its field is judged, rad/s.
const TURNING_RAD_S: f64 = 0.5;
/// Time over which its strength is averaged there, s, and a longest time between samples.
const AVERAGE_S: f64 = 2.0;
const LONGEST_S: f64 = 0.2;
/// No sensor that is turned shows a strength that stays the same to this, microtesla: its noise, its axes and the
/// room see to that.
const MADE_CONSTANT_UT: f64 = 0.15;
/// So much of the turning, in seconds and as a share, must have such a field.
const MADE_CONSTANT_S: f64 = 5.0;
const MADE_CONSTANT_SHARE: f64 = 0.2;

/// Whether the strength of a field changes at all while the device turns. Some systems deliver a field
/// of constant strength, and in the wrong direction.
#[derive(Debug, Clone, Default)]
struct Constancy {
    turning: bool,
    last_s: Option<f64>,
    mean: f64,
    /// Mean square of the deviation, microtesla squared.
    spread: f64,
    turned_s: f64,
    constant_s: f64,
}

impl Constancy {
    fn field(&mut self, time_s: f64, strength: f64) {
        let Some(last_s) = self.last_s.replace(time_s) else {
            (self.mean, self.spread) = (strength, 1.0);
            return;
        };
        if !self.turning {
            return;
        }
        let dt = (time_s - last_s).clamp(0.0, LONGEST_S);
        let off = strength - self.mean;
        self.mean += off * dt / AVERAGE_S;
        self.spread += (off * off - self.spread) * dt / AVERAGE_S;
        self.turned_s += dt;
        if self.spread < MADE_CONSTANT_UT * MADE_CONSTANT_UT {
            self.constant_s += dt;
        }
    }

    fn sentence(&self) -> Option<String> {
        let most = MADE_CONSTANT_S.max(MADE_CONSTANT_SHARE * self.turned_s);
        (self.constant_s > most).then(|| {
            format!(
                "For {:.0} of the {:.0} s in which the device turned, the strength of its magnetic field was the same to \
                 {MADE_CONSTANT_UT} uT. No sensor shows that: the device's system makes it so, and such a field has pointed \
                 up to 30 deg off. Take the uncalibrated magnetometer if there is one, or use no heading.",
                self.constant_s, self.turned_s
            )
        })
    }
}

/// Looks at the strength of the field, in constant memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct FieldWatch {
    samples: u64,
    strength_sum: f64,
    still: bool,
    piece: (f64, u32),
    /// Strength at the beginning of the present rest.
    at_rest: Option<f64>,
    /// Largest change within one rest, and when.
    worst: Option<(f64, f64)>,
    constancy: Constancy,
}

impl FieldWatch {
    /// Takes an angular rate, rad/s.
    pub(crate) fn rate(&mut self, rate: &Vector3<f64>) {
        self.still = rate.norm() < STILL_RAD_S;
        self.constancy.turning = rate.norm() > TURNING_RAD_S;
        if !self.still {
            self.piece = (0.0, 0);
            self.at_rest = None;
        }
    }

    /// Takes a field, microtesla.
    pub(crate) fn field(&mut self, time_s: f64, field: &Vector3<f64>) {
        let strength = field.norm();
        if !(strength > 0.0 && strength.is_finite()) {
            return;
        }
        self.constancy.field(time_s, strength);
        self.samples += 1;
        self.strength_sum += strength;
        if !self.still {
            return;
        }
        self.piece = (self.piece.0 + strength, self.piece.1 + 1);
        if self.piece.1 < PIECE {
            return;
        }
        let mean = self.piece.0 / f64::from(PIECE);
        self.piece = (0.0, 0);
        let change = (mean - *self.at_rest.get_or_insert(mean)).abs();
        if self.worst.is_none_or(|(worst, _)| change > worst) {
            self.worst = Some((change, time_s));
        }
    }

    /// What is wrong with the field.
    pub(crate) fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        if self.samples < FEWEST {
            return sentences;
        }
        let mean = self.strength_sum / self.samples as f64;
        if mean > RANGE_UT {
            // Nothing that its numbers say of magnets is of use.
            sentences.push(format!(
                "The magnetic field is {mean:.0} microtesla strong on average; on Earth it is {:.0} to {:.0}, and magnetometers of \
                 phones and inertial units end at {RANGE_UT:.0}: the numbers are of another unit.",
                EARTH_UT[0], EARTH_UT[1]
            ));
            return sentences;
        }
        if !(LET_PASS_UT[0]..=LET_PASS_UT[1]).contains(&mean) {
            let is_milligauss = (10.0 * EARTH_UT[0]..=10.0 * EARTH_UT[1]).contains(&mean);
            let unit = if is_milligauss {
                ", or the numbers are milligauss (--magnetometer-unit milligauss)"
            } else {
                ""
            };
            sentences.push(format!(
                "The magnetic field is {mean:.0} microtesla strong on average; on Earth it is {:.0} to {:.0}: a magnet \
                 or iron is near, or in the device{unit}. Calibrate the magnetometer (`northing calibrate \
                 magnetometer`), or leave it out (--sensors gyro,acc).",
                EARTH_UT[0], EARTH_UT[1]
            ));
        }
        if let Some((change, time_s)) = self.worst.filter(|(change, _)| *change > STEADY_UT) {
            sentences.push(format!(
                "The strength of the magnetic field changes by {change:.0} microtesla while the device rests, most \
                 at {time_s:.1} s: something magnetic moves nearby, and the heading follows it."
            ));
        }
        sentences.extend(self.constancy.sentence());
        sentences
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watched(field: impl Fn(u32) -> f64, rate: f64) -> Vec<String> {
        watched_for(10, field, rate)
    }

    fn watched_for(seconds: u32, field: impl Fn(u32) -> f64, rate: f64) -> Vec<String> {
        let mut watch = FieldWatch::default();
        for k in 0..seconds * 100 {
            let t = 0.01 * f64::from(k);
            watch.rate(&Vector3::new(0.0, rate, 0.0));
            watch.field(t, &Vector3::new(0.0, 0.0, field(k)));
        }
        watch.sentences()
    }

    #[test]
    fn a_field_that_no_sensor_measures_is_of_another_unit_and_no_magnet() {
        let [said] = &watched(|_| 4.8e7, 1.0)[..] else {
            panic!("one sentence");
        };
        assert!(
            said.contains("another unit") && !said.contains("magnet or iron"),
            "{said}"
        );
    }

    #[test]
    fn the_field_of_the_earth_is_no_remark() {
        assert!(watched(|_| 45.0, 0.0).is_empty());
        assert!(watched(|k| 45.0 + 0.3 * f64::from(k % 3), 1.0).is_empty());
        assert!(
            watched(|k| 45.0 + f64::from(k % 7), 0.0).is_empty(),
            "noise"
        );
        let passing = |k: u32| f64::from(k % 5) * 0.2 + if k > 500 { 65.0 } else { 45.0 };
        assert!(watched(passing, 1.0).is_empty(), "while it is turned");
    }

    #[test]
    fn a_strength_that_a_system_makes_constant_is_told_of() {
        let made = watched_for(30, |k| 42.2 + 0.05 * f64::from(k % 2), 1.0);
        assert_eq!(made.len(), 1, "{made:?}");
        assert!(
            made[0].contains("of the 30 s in which the device turned"),
            "{made:?}"
        );
        assert!(made[0].contains("uncalibrated magnetometer"), "{made:?}");
    }

    #[test]
    fn a_magnet_and_one_that_comes_near_are_told() {
        let near = watched(|_| 150.0, 1.0);
        assert!(
            near[0].contains("150 microtesla strong") && near[0].contains("22 to 67"),
            "{near:?}"
        );
        assert!(watched(|_| 5.0, 1.0)[0].contains("5 microtesla strong"));
        let comes = watched(|k| if k > 500 { 65.0 } else { 45.0 }, 0.0);
        assert_eq!(comes.len(), 1, "{comes:?}");
        assert!(
            comes[0].contains("changes by 20 microtesla while the device rests, most at 5."),
            "{comes:?}"
        );
    }
}
