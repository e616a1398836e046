//! White noise and rounding against what the configuration states, and what is left to R.

use northing_recording::SensorKind;

use super::super::noise::NoiseLevel;
use super::super::{Channel, Diagnosis};
use super::{Cause, Finding, beyond_chance};
use crate::statistics::consistency::{NoiseVerdict, SensorVerdict};

/// Noise this many times what is stated is named, ...
const MORE: f64 = 1.5;
/// ... and R, where deviations are this many times smaller than it states.
const LESS: f64 = 2.0;
/// Rounding is named where its noise is this share of what the filter expects of a residual: a calibration at rest
/// states no less than it is.
const ROUNDING_SHARE: f64 = 1.1;
/// Of noise above 0.35 steps an average of rounded values is within a thirtieth of a step; together with the rounding's own noise
/// that is this share of a step.
const HIDDEN: f64 = 0.45;
/// Half a step is an error that no average removes: of the tilt, rad (a quarter of a degree), ...
const LEAST_TILT_RAD: f64 = 0.0043;
/// ... and of the rate, rad/s (0.05 deg/s).
const LEAST_RATE_RAD_S: f64 = 8.7e-4;

impl Diagnosis {
    /// Everything of this file.
    pub(super) fn stated_noise(&self, verdicts: &[SensorVerdict], findings: &mut Vec<Finding>) {
        self.steps(findings);
        self.rounding(verdicts, findings);
        let direct = [
            self.gyroscope_noise(),
            self.accelerometer_noise(),
            self.magnetometer_noise(),
        ];
        let direct: Vec<_> = direct.into_iter().flatten().collect();
        for verdict in verdicts {
            if direct
                .iter()
                .all(|finding| finding.sensor != verdict.sensor)
            {
                findings.extend(self.left_to_r(verdict));
            }
        }
        findings.splice(0..0, direct);
    }

    fn gyroscope_noise(&self) -> Option<Finding> {
        let stated = self.stated.gyroscope_noise_density?;
        noise_beyond(
            SensorKind::Gyroscope,
            self.gyroscope.density()?,
            1.0,
            stated,
            "rad/s/\u{221a}Hz",
        )
    }

    fn accelerometer_noise(&self) -> Option<Finding> {
        let (kind, unit) = (SensorKind::Accelerometer, "m/s\u{00b2}");
        if let Some(stated) = self.stated.accelerometer_std {
            return noise_beyond(kind, self.accelerometer.noise.level()?, 1.0, stated, unit);
        }
        let stated = self.stated.accelerometer_noise_density?;
        let unit = format!("{unit}/\u{221a}Hz");
        noise_beyond(kind, self.accelerometer.density()?, 1.0, stated, &unit)
    }

    fn magnetometer_noise(&self) -> Option<Finding> {
        let stated = self.stated.magnetometer_std_ut?;
        noise_beyond(
            SensorKind::Magnetometer,
            self.iron.noise()?,
            self.fields_of_a_look(),
            stated,
            "\u{00b5}T",
        )
    }

    /// Samples of the magnetometer of which the filter takes the mean; those that a logger holds are none.
    fn fields_of_a_look(&self) -> f64 {
        let Channel {
            timing,
            samples,
            repeated,
            ..
        } = &self.magnetometer;
        let interval_s = timing.summary().interval_s;
        let mean_s = self.stated.magnetometer_mean_s.unwrap_or_default();
        let new = 1.0 - *repeated as f64 / (*samples).max(1) as f64;
        if interval_s > 0.0 {
            (mean_s / interval_s * new).round().max(1.0)
        } else {
            1.0
        }
    }

    /// Steps that hide the noise, whatever a filter expects.
    fn steps(&self, findings: &mut Vec<Finding>) {
        let gravity = self.gravity.mean;
        let channels = [
            (
                SensorKind::Gyroscope,
                &self.gyroscope,
                LEAST_RATE_RAD_S,
                "deg/s",
                1.0_f64.to_degrees(),
            ),
            (
                SensorKind::Accelerometer,
                &self.accelerometer,
                LEAST_TILT_RAD * gravity,
                "m/s\u{00b2}",
                1.0,
            ),
        ];
        for (sensor, channel, least, unit, of_unit) in channels {
            let Some(step) = channel.resolution.step(sensor) else {
                continue;
            };
            let is_hidden = channel
                .noise
                .most()
                .is_some_and(|noise| noise < HIDDEN * step);
            if 0.5 * step < least || !is_hidden {
                continue;
            }
            findings.push(Finding {
                cause: Cause::Rounding,
                sensor,
                confidence: 0.97,
                sentence: format!(
                    "The {} comes in steps of {:.2} {unit}, larger than its noise: values repeat, and an error of up to half a step \
                     stays, which no average removes. Take the sensor's full resolution.",
                    sensor.name(),
                    step * of_unit,
                ),
            });
        }
    }

    fn rounding(&self, verdicts: &[SensorVerdict], findings: &mut Vec<Finding>) {
        for verdict in verdicts {
            let is_new = findings
                .iter()
                .all(|f| (f.cause, f.sensor) != (Cause::Rounding, verdict.sensor));
            let Some((step, std)) = self.coarse_step(verdict.sensor).filter(|_| is_new) else {
                continue;
            };
            let noise = step / 12.0_f64.sqrt();
            if noise < ROUNDING_SHARE * std {
                continue;
            }
            let unit = match verdict.sensor {
                SensorKind::Accelerometer => "m/s\u{00b2}",
                _ => "\u{00b5}T",
            };
            findings.push(Finding {
                cause: Cause::Rounding,
                sensor: verdict.sensor,
                confidence: 0.97,
                sentence: format!(
                    "The {} comes in steps of {step:.3} {unit}: they alone are a noise of {noise:.3} {unit}, and R should not be \
                     less than its square.",
                    verdict.sensor.name(),
                ),
            });
        }
    }

    /// What is left to the stated noise, where the samples themselves do not say otherwise.
    fn left_to_r(&self, verdict: &SensorVerdict) -> Option<Finding> {
        let sensor = verdict.sensor;
        let cause = match verdict.verdict {
            // What cannot be judged is no cause.
            NoiseVerdict::Consistent
            | NoiseVerdict::TooFew
            | NoiseVerdict::Undetermined
            | NoiseVerdict::TooLarge => return None,
            _ if sensor == SensorKind::CompassHeading => {
                // A compass is late, and is off for seconds: its residuals are no noise, and are far off before R is.
                let factor = verdict.variance_factor.unwrap_or(1.0);
                (factor > LESS * LESS).then_some(Cause::Noise)?
            }
            NoiseVerdict::TooSmall | NoiseVerdict::Outliers => match self.is_quiet(sensor) {
                // The sensor is quieter than that: what is too large is no noise.
                true if sensor == SensorKind::Accelerometer => Cause::Acceleration,
                true => Cause::LastingErrors,
                false => Cause::Noise,
            },
        };
        Some(Finding {
            cause,
            sensor,
            confidence: verdict.confidence,
            sentence: verdict.sentences.join(" "),
        })
    }

    /// An R that is too large: the last thing to act on.
    pub(super) fn conservative(&self, verdicts: &[SensorVerdict]) -> Vec<Finding> {
        let is_so = |v: &&SensorVerdict| {
            v.verdict == NoiseVerdict::TooLarge && self.is_conservative(v.sensor)
        };
        let finding = |v: &SensorVerdict| Finding {
            cause: Cause::Noise,
            sensor: v.sensor,
            confidence: v.confidence,
            sentence: v.sentences.join(" "),
        };
        verdicts.iter().filter(is_so).map(finding).collect()
    }

    /// Whether the samples have less noise than is stated.
    fn is_quiet(&self, sensor: SensorKind) -> bool {
        let (noise, stated) = match sensor {
            SensorKind::Accelerometer => (
                self.accelerometer.noise.most(),
                self.stated.accelerometer_std,
            ),
            SensorKind::Magnetometer => {
                let noise = self.iron.noise().map(|noise| noise.std);
                (noise, self.stated.magnetometer_std_ut)
            }
            _ => (None, None),
        };
        noise
            .zip(stated)
            .is_some_and(|(noise, stated)| noise < stated)
    }

    /// Whether an R that the innovations say is too large is so: errors that last are followed by a filter, so innovations
    /// do not show them. Those of a compass last.
    fn is_conservative(&self, sensor: SensorKind) -> bool {
        match sensor {
            SensorKind::CompassHeading => false,
            SensorKind::Magnetometer => {
                let iron = self
                    .iron
                    .fit()
                    .map_or(0.0, |fit| fit.iron.offset_ut.norm_squared() / 3.0);
                let (noise, stated) = (self.iron.noise(), self.stated.magnetometer_std_ut);
                let deviation = noise.map(|noise| (noise.std * noise.std + iron).sqrt());
                deviation
                    .zip(stated)
                    .is_none_or(|(deviation, stated)| LESS * deviation < stated)
            }
            // Most samples of a motion that starts and stops are quiet: the mean has the others, too.
            _ => self
                .unexplained(sensor)
                .summary()
                .is_some_and(|nis| LESS * LESS * nis.mean < f64::from(nis.degrees_of_freedom)),
        }
    }
}

impl Channel {
    /// Noise density: what the samples' noise makes of their integral, in the sensor's unit by the root of Hz.
    fn density(&self) -> Option<NoiseLevel> {
        let level = self.noise.level()?;
        let root = self.timing.summary().interval_s.sqrt();
        Some(NoiseLevel {
            std: level.std * root,
            ..level
        })
    }
}

/// White noise of a sensor that is more than is stated of the mean of so many samples.
fn noise_beyond(
    sensor: SensorKind,
    level: NoiseLevel,
    samples: f64,
    stated: f64,
    unit: &str,
) -> Option<Finding> {
    let std = level.std / samples.sqrt();
    let times = std / stated;
    let of_mean = if samples > 1.0 {
        format!(" in the mean of the {samples} samples that the filter takes at a time")
    } else {
        String::new()
    };
    (times > MORE).then(|| Finding {
        cause: Cause::Noise,
        sensor,
        confidence: beyond_chance((times - 1.0) / (times * level.relative_std)),
        sentence: format!(
            "The {}'s white noise is {std:.2e} {unit}{of_mean} even in the quietest moments, {times:.1} times what is stated ({stated:.2e}). \
             State it, or calibrate at rest.",
            sensor.name(),
        ),
    })
}
