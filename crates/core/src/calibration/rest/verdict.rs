//! When a calibration at rest is refused, and how the refusal reads.

use core::fmt;

use nalgebra::Vector3;

use super::statistics::Statistics;
use crate::parameters::{ConfigError, parameters};
use crate::scalar::{Scalar, lit};

/// Standard deviations of chance that a drift may show on top of its limit.
const DRIFT_CHANCE: f64 = 4.0;

/// A three-axis sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// Angular rate, rad/s.
    Gyroscope,
    /// Specific force, m/s^2.
    Accelerometer,
    /// Magnetic field, microtesla.
    Magnetometer,
}

impl Sensor {
    /// Its name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gyroscope => "gyroscope",
            Self::Accelerometer => "accelerometer",
            Self::Magnetometer => "magnetometer",
        }
    }

    /// The unit it measures in.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Gyroscope => "rad/s",
            Self::Accelerometer => "m/s^2",
            Self::Magnetometer => "uT",
        }
    }
}

impl fmt::Display for Sensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

parameters! {
    /// Limits beyond which a calibration at rest is refused.
    pub struct RestLimits;

    minimum_samples: u32, "-", Count(0), [50],
        "fewest samples of each sensor",
        "Raising it asks for longer recordings.";
    gyroscope_std_rad_s: T, "rad/s", From(0.0, 10.0), [0.05],
        "largest standard deviation of an axis of the gyroscope",
        "Raising it accepts noisier sensors and unsteadier tables; so for the next two.";
    accelerometer_std_m_s2: T, "m/s^2", From(0.0, 1e4), [0.3],
        "largest standard deviation of an axis of the accelerometer";
    magnetometer_std_ut: T, "microtesla", From(0.0, 1e6), [5.0],
        "largest standard deviation of an axis of the magnetometer";
    gyroscope_drift_rad_s: T, "rad/s", From(0.0, 10.0), [0.005],
        "largest change of the mean of an axis of the gyroscope from the first half to the second",
        "Noise is allowed for on top. Raising it accepts slower motion; so for the next two.";
    accelerometer_drift_m_s2: T, "m/s^2", From(0.0, 1e4), [0.1],
        "the same of the accelerometer",
        "0.6 degrees of tilt.";
    magnetometer_drift_ut: T, "microtesla", From(0.0, 1e6), [1.0],
        "the same of the magnetometer",
        "Some two degrees of turn.";
    gravity_m_s2: T, "m/s^2", From(0.1, 100.0), [9.81],
        "length of the specific force at rest";
    gravity_tolerance_m_s2: T, "m/s^2", From(0.0, 1e4), [0.5],
        "by how much the measured length may differ from it";
    field_minimum_ut: T, "microtesla", From(0.0, 1e6), [20.0],
        "weakest magnetic field",
        "The Earth's is 22 to 67.";
    field_maximum_ut: T, "microtesla", From(1e-4, 1e6), [70.0],
        "strongest magnetic field";
    field_gravity_angle_deg: T, "degrees", From(0.0, 90.0), [5.0],
        "smallest angle between gravity's line and the field's: below it there is no heading";
}

impl<T: Scalar> RestLimits<T> {
    fn std_and_drift(&self, sensor: Sensor) -> (T, T) {
        match sensor {
            Sensor::Gyroscope => (self.gyroscope_std_rad_s, self.gyroscope_drift_rad_s),
            Sensor::Accelerometer => (self.accelerometer_std_m_s2, self.accelerometer_drift_m_s2),
            Sensor::Magnetometer => (self.magnetometer_std_ut, self.magnetometer_drift_ut),
        }
    }

    /// Enough samples, alive, and at rest.
    pub(super) fn check_sensor(
        &self,
        sensor: Sensor,
        statistics: &Statistics<T>,
    ) -> Result<(), RestError<T>> {
        let samples = statistics.count();
        let required = self.minimum_samples.max(2);
        if samples < required {
            return Err(RestError::TooFewSamples {
                sensor,
                samples,
                required,
            });
        }
        if statistics.is_dead(sensor == Sensor::Gyroscope) {
            return Err(RestError::Constant { sensor, samples });
        }
        let (std_limit, drift_limit) = self.std_and_drift(sensor);
        let std = statistics.std().max();
        if std > std_limit || !std.is_finite() {
            return Err(RestError::Moved {
                sensor,
                std,
                limit: std_limit,
            });
        }
        let Some((drift, noise)) = statistics.drift() else {
            return Ok(());
        };
        for (drift, noise) in drift.iter().zip(noise.iter()) {
            let (drift, limit) = (drift.abs(), drift_limit + *noise * lit(DRIFT_CHANCE));
            if drift > limit || !drift.is_finite() {
                return Err(RestError::Drifted {
                    sensor,
                    drift,
                    limit,
                });
            }
        }
        Ok(())
    }

    /// The mean specific force is as long as gravity.
    pub(super) fn check_gravity(&self, mean: &Vector3<T>) -> Result<(), RestError<T>> {
        let (measured, expected) = (mean.norm(), self.gravity_m_s2);
        let tolerance = self.gravity_tolerance_m_s2;
        if (measured - expected).abs() <= tolerance {
            Ok(())
        } else {
            Err(RestError::NotGravity {
                measured,
                expected,
                tolerance,
            })
        }
    }

    /// The mean field is as strong as the Earth's.
    pub(super) fn check_field(&self, mean: &Vector3<T>) -> Result<(), RestError<T>> {
        let measured_ut = mean.norm();
        let (minimum_ut, maximum_ut) = (self.field_minimum_ut, self.field_maximum_ut);
        if measured_ut >= minimum_ut && measured_ut <= maximum_ut {
            Ok(())
        } else {
            Err(RestError::NotTheEarthsField {
                measured_ut,
                minimum_ut,
                maximum_ut,
            })
        }
    }

    /// Gravity and field are far enough from parallel for a heading.
    pub(super) fn check_angle(
        &self,
        up: &Vector3<T>,
        field: &Vector3<T>,
    ) -> Result<(), RestError<T>> {
        let angle = up.cross(field).norm().atan2(up.dot(field).abs());
        let (angle_deg, minimum_deg) = (angle * lit(180.0) / T::pi(), self.field_gravity_angle_deg);
        if angle_deg >= minimum_deg {
            Ok(())
        } else {
            Err(RestError::FieldVertical {
                angle_deg,
                minimum_deg,
            })
        }
    }
}

/// Why a calibration at rest is refused. The text is one line that ends with what to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RestError<T> {
    /// The recording is too short.
    TooFewSamples {
        /// The sensor.
        sensor: Sensor,
        /// Samples seen.
        samples: u32,
        /// Samples needed.
        required: u32,
    },
    /// The sensor repeats one value: it does not run.
    Constant {
        /// The sensor.
        sensor: Sensor,
        /// Samples seen.
        samples: u32,
    },
    /// The standard deviation of an axis is too large.
    Moved {
        /// The sensor.
        sensor: Sensor,
        /// Standard deviation of the worst axis, unit of the sensor.
        std: T,
        /// The limit, same unit.
        limit: T,
    },
    /// The mean changed between the halves of the recording.
    Drifted {
        /// The sensor.
        sensor: Sensor,
        /// Change of an axis' mean, unit of the sensor.
        drift: T,
        /// The limit and four standard deviations of chance, same unit.
        limit: T,
    },
    /// The specific force at rest is not as long as gravity.
    NotGravity {
        /// Its length, m/s^2.
        measured: T,
        /// Gravity, m/s^2.
        expected: T,
        /// Allowed difference, m/s^2.
        tolerance: T,
    },
    /// The field is weaker or stronger than the Earth's.
    NotTheEarthsField {
        /// Its strength, microtesla.
        measured_ut: T,
        /// Weakest allowed, microtesla.
        minimum_ut: T,
        /// Strongest allowed, microtesla.
        maximum_ut: T,
    },
    /// The field stands along gravity.
    FieldVertical {
        /// Angle between the two lines, degrees.
        angle_deg: T,
        /// Smallest allowed, degrees.
        minimum_deg: T,
    },
    /// A limit is outside its permitted range.
    Limits(ConfigError),
}

impl<T: fmt::Display> fmt::Display for RestError<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewSamples {
                sensor,
                samples,
                required,
            } => write!(
                f,
                "too short: {samples} {sensor} samples, at least {required} needed; record longer, five seconds or more"
            ),
            Self::Constant { sensor, samples } => write!(
                f,
                "the {sensor} repeated one value {samples} times; check that it is connected and running"
            ),
            Self::Moved { sensor, std, limit } => write!(
                f,
                "the device moved: {sensor} std {std:.3} {}, limit {limit:.3}; put it on a table and try again",
                sensor.unit()
            ),
            Self::Drifted {
                sensor,
                drift,
                limit,
            } => write!(
                f,
                "the device was not at rest: {sensor} mean changed by {drift:.4} {} from the first half to the \
                 second, limit {limit:.4}; let it lie still (and warm up) and try again",
                sensor.unit()
            ),
            Self::NotGravity {
                measured,
                expected,
                tolerance,
            } => write!(
                f,
                "the accelerometer measures {measured:.2} m/s^2 at rest, expected {expected:.2} +- {tolerance:.2}; \
                 check its unit (m/s^2, gravity included) and its calibration"
            ),
            Self::NotTheEarthsField {
                measured_ut,
                minimum_ut,
                maximum_ut,
            } => write!(
                f,
                "the magnetic field is {measured_ut:.1} uT, expected {minimum_ut:.0} to {maximum_ut:.0}; move away \
                 from iron and magnets, check the unit (uT), or calibrate the magnetometer"
            ),
            Self::FieldVertical {
                angle_deg,
                minimum_deg,
            } => write!(
                f,
                "the magnetic field is {angle_deg:.1} deg from vertical, at least {minimum_deg:.1} needed for a \
                 heading; move away from iron, or leave the magnetometer out"
            ),
            Self::Limits(error) => write!(f, "limits of the calibration: {error}"),
        }
    }
}

impl<T: fmt::Debug + fmt::Display> core::error::Error for RestError<T> {}
