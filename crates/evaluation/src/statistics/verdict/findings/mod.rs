//! The causes in words, in the order in which a user should act, R last.
//!
//! | I look for | file |
//! |---|---|
//! | bias, axes, scale, hard iron, magnets | `calibration.rs` |
//! | white noise, rounding, R | `stated_noise.rs` |

mod calibration;
mod stated_noise;

use northing_recording::SensorKind;
use serde::Serialize;

use super::Diagnosis;
use super::excursions::Condition;
use crate::statistics::consistency::SensorVerdict;
use crate::statistics::seconds_between;

/// What is wrong, in the order in which a user should act.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// Numbers of a sensor are in another unit, or of other axes, than is said of them.
    Unit,
    /// A sensor shows the same value all the time, while the device turns.
    Stuck,
    /// Samples of the gyroscope are missing while the device turned.
    Hole,
    /// A sensor was at the end of its range.
    Saturation,
    /// Samples come in bunches.
    Bursts,
    /// Intervals between samples vary.
    Jitter,
    /// The gyroscope's bias changed.
    BiasChange,
    /// The accelerometer's axes are not those of the gyroscope.
    Misalignment,
    /// The measured gravity depends on the pose.
    Scale,
    /// An offset of the magnetometer turns with the device.
    HardIron,
    /// The magnetic field was not the Earth's alone.
    MagneticDisturbance,
    /// Values lie on a grid that is coarser than the noise stated.
    Rounding,
    /// White noise is not what is stated.
    Noise,
    /// The device was accelerated.
    Acceleration,
    /// Residuals are larger than stated and the sensor's noise is not: errors that last.
    LastingErrors,
}

impl Cause {
    /// Whether it is something other than the stated noise, which a verdict on its sensor is about.
    #[must_use]
    pub const fn is_mendable(self) -> bool {
        !matches!(self, Self::Noise | Self::LastingErrors)
    }
}

/// A cause, with its number and a confidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Finding {
    /// What is wrong.
    pub cause: Cause,
    /// The sensor.
    pub sensor: SensorKind,
    /// 0 to 1: the share of the samples beyond the 99 % bound that it explains, or one less the probability that it is
    /// chance.
    pub confidence: f64,
    /// In a sentence or two, with its number and what to do.
    pub sentence: String,
}

/// A hole in which the device may have turned this far (rad) is named even where no innovation shows it: a compass
/// is no better.
const LARGE_HOLE_RAD: f64 = 0.05;
/// A condition is named when it explains this share of the samples beyond their bound.
const EXPLAINS: f64 = 0.3;
/// A sensor is stuck when its values change in fewer than this share of at least so many samples, while the device turns by
/// this much in all (rad): rounded values do not stay the same through that.
const STUCK: f64 = 0.01;
const FEWEST_STUCK: u64 = 100;
const TURNED_RAD: f64 = 1.5;
/// No sensor's range ends within so many steps of its values: what stays there is a coarse value that repeats.
const STEPS_OF_A_RANGE: f64 = 10.0;

/// Confidence in what is so many standard deviations from chance.
fn beyond_chance(sigmas: f64) -> f64 {
    1.0 - (-0.5 * sigmas * sigmas).exp()
}

impl Diagnosis {
    /// The causes, the first to act on first; `verdicts` are those on the stated noise of this run.
    #[must_use]
    pub fn findings(&self, verdicts: &[SensorVerdict]) -> Vec<Finding> {
        let mut findings = Vec::new();
        self.stuck(&mut findings);
        findings.extend(self.hole());
        self.saturations(&mut findings);
        self.calibration(&mut findings);
        findings.extend(self.acceleration());
        self.stamps(&mut findings);
        self.stated_noise(verdicts, &mut findings);
        // Stable: of one cause the first found is the first to act on.
        findings.sort_by_key(|finding| finding.cause);
        findings.extend(self.conservative(verdicts));
        findings
    }

    fn explained(&self, condition: Condition) -> f64 {
        [
            &self.by_accelerometer,
            &self.by_magnetometer,
            &self.by_compass,
        ]
        .map(|updates| updates.excursions.share_explained_by(condition))
        .into_iter()
        .fold(0.0, f64::max)
    }

    fn hole(&self) -> Option<Finding> {
        let count = self.gyroscope.timing.summary().holes;
        // What looked like holes may have turned out to be a new rate.
        let worst = self.worst_hole.filter(|_| count > 0)?;
        let explains = self.explained(Condition::Hole);
        let angle = worst.angle_rad();
        if angle < LARGE_HOLE_RAD && explains < EXPLAINS {
            return None;
        }
        let others = match count {
            0 | 1 => String::new(),
            n => format!(" It is the worst of {n}."),
        };
        Some(Finding {
            cause: Cause::Hole,
            sensor: SensorKind::Gyroscope,
            confidence: explains.max(angle / (angle + LARGE_HOLE_RAD)),
            sentence: format!(
                "The gyroscope has a hole of {:.2} s at {:.1} s, while the device turned at {:.0} deg/s: it may have turned by \
                 {:.0} deg that nobody measured.{others} Look for what interrupts the samples: power saving, the network, \
                 a busy phone.",
                worst.hole.seconds,
                self.time_s(worst.hole.start_ns),
                worst.rate_rad_s.to_degrees(),
                angle.to_degrees(),
            ),
        })
    }

    fn stuck(&self, findings: &mut Vec<Finding>) {
        let channels = [
            (SensorKind::Accelerometer, &self.accelerometer),
            (SensorKind::Magnetometer, &self.magnetometer),
        ];
        for (sensor, channel) in channels {
            let moved = channel.samples - channel.repeated;
            let share = moved as f64 / channel.samples.max(1) as f64;
            if channel.samples < FEWEST_STUCK || share > STUCK || self.turned_rad < TURNED_RAD {
                continue;
            }
            findings.push(Finding {
                cause: Cause::Stuck,
                sensor,
                confidence: 1.0 - share,
                sentence: format!(
                    "The {} shows the same value in {} of {} samples, while the device turned by {:.0} deg in all: it is off \
                     or stuck. Leave it out (--sensors).",
                    sensor.name(),
                    channel.repeated,
                    channel.samples,
                    self.turned_rad.to_degrees(),
                ),
            });
        }
    }

    fn saturations(&self, findings: &mut Vec<Finding>) {
        let channels = [
            (
                SensorKind::Gyroscope,
                &self.gyroscope,
                180.0 / std::f64::consts::PI,
                "deg/s",
            ),
            (
                SensorKind::Accelerometer,
                &self.accelerometer,
                1.0,
                "m/s\u{00b2}",
            ),
            (
                SensorKind::Magnetometer,
                &self.magnetometer,
                1.0,
                "\u{00b5}T",
            ),
        ];
        for (sensor, channel, unit, name) in channels {
            let Some((count, level)) = channel.saturation.found() else {
                continue;
            };
            let step = channel.resolution.step(sensor).unwrap_or_default();
            if level < STEPS_OF_A_RANGE * step {
                continue;
            }
            findings.push(Finding {
                cause: Cause::Saturation,
                sensor,
                confidence: 1.0 - 0.5_f64.powi(count.min(50) as i32),
                sentence: format!(
                    "The {} was at the end of its range, {:.0} {name}, in {count} samples: what was beyond is lost. Choose a \
                     larger range, or move more slowly.",
                    sensor.name(),
                    level * unit,
                ),
            });
        }
    }

    fn acceleration(&self) -> Option<Finding> {
        let explains = self.explained(Condition::Accelerated);
        let explained = self
            .by_accelerometer
            .excursions
            .explained_by(Condition::Accelerated);
        (explains > EXPLAINS).then(|| Finding {
            cause: Cause::Acceleration,
            sensor: SensorKind::Accelerometer,
            confidence: explains,
            sentence: format!(
                "The device was accelerated{}: {} accelerometer samples are not gravity alone, and R of a device at rest does not \
                 fit them. State how long accelerations last (accelerometer_correlation_time_s), or take an estimator that \
                 expects them (bounded-velocity).",
                self.from(explained.first_ns),
                explained.beyond,
            ),
        })
    }

    fn from(&self, first_ns: Option<i64>) -> String {
        match (first_ns, self.first_ns) {
            (Some(first), Some(start)) => {
                format!(", first at {:.1} s", seconds_between(start, first))
            }
            _ => String::new(),
        }
    }

    fn stamps(&self, findings: &mut Vec<Finding>) {
        let timing = self.gyroscope.timing.summary();
        let Some(sentence) = timing.in_words() else {
            return;
        };
        let (cause, doubt) = if timing.is_bunched() {
            (
                Cause::Bursts,
                1.0 / timing.bursts.max(timing.together) as f64,
            )
        } else {
            (Cause::Jitter, 1.0 / (timing.intervals.max(1) as f64).sqrt())
        };
        findings.push(Finding {
            cause,
            sensor: SensorKind::Gyroscope,
            confidence: 1.0 - doubt,
            sentence,
        });
    }
}
