//! Calibration at rest: gyroscope bias, sensor noise, gravity and magnetic field.
//!
//! Read first: `docs/derivations/mekf.md`, section on calibration at rest (M21); Utrera & Vazquez
//! (2021), section 3, where every run begins with it.
//!
//! Use it before a run, with the device lying still for five seconds or more. Do not use it on a
//! device in the hand, on a moving vehicle, or near iron: it refuses most of these, with a reason,
//! but a slow constant turn about the vertical looks like a gyroscope bias to everything except
//! the magnetometer.
//!
//! # Model
//!
//! At rest each sensor measures a constant and noise, so the mean is the constant:
//!
//! ```text
//! bias = mean(gyroscope),  g = mean(accelerometer),  m = mean(magnetometer)
//! cov = sum (y - mean)(y - mean)^T / (N - 1),  variance <- max(variance, step^2 / 12)      (M21)
//! var(mean) = variance / N + step^2 h(variance / step^2)                          (M21b), (M21c)
//! noise density = std * sqrt(sample interval)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `N` | `*_samples` | - |
//! | `step` | resolution: what the samples are known to be rounded to, else the smallest change between two | as sensor |
//! | `h` | what rounding hides in a mean, between 1/12 without noise and 0 | - |
//! | bias | `gyroscope_bias_rad_s` | rad/s |
//! | `g`, `m` | `specific_force_m_s2`, `magnetic_field_ut` (body axes at rest) | m/s^2, microtesla |
//!
//! Streaming: no sample is kept; about 20 additions and 10 multiplications each. Limits: the
//! standard deviation of the bias is that of white noise and rounding; the slow drift of a real gyroscope is
//! not seen in seconds. Rest noise is *not* the tuning of a filter on a hand-held device.

use nalgebra::{Matrix3, Vector3};

use crate::scalar::{Scalar, lit};

mod statistics;
mod verdict;

use statistics::Statistics;
pub use verdict::{RestError, RestLimits, Sensor};

/// Takes samples of a device at rest and sums them up.
///
/// ```
/// use northing_core::{calibration::{RestCalibrator, RestLimits}, nalgebra::Vector3};
/// let mut calibrator = RestCalibrator::<f64>::new();
/// for k in 0..500 {
///     let noise = f64::from(k % 7 - 3) * 1e-3;
///     calibrator.add_gyroscope(&Vector3::new(0.01 + noise, noise, -noise), Some(0.01));
/// }
/// let calibration = calibrator.finish(&RestLimits::default()).unwrap();
/// assert!((calibration.gyroscope_bias().x - 0.01).abs() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestCalibrator<T: Scalar> {
    gyroscope: Statistics<T>,
    accelerometer: Statistics<T>,
    magnetometer: Statistics<T>,
}

impl<T: Scalar> Default for RestCalibrator<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar> RestCalibrator<T> {
    /// Nothing seen yet.
    pub fn new() -> Self {
        let empty = Statistics::new();
        Self {
            gyroscope: empty,
            accelerometer: empty,
            magnetometer: empty,
        }
    }

    /// Adds an angular rate (rad/s). `dt` is the time (s) since the previous sample of this
    /// sensor, `None` where unknown (the first one); it is only needed for noise densities.
    ///
    /// Returns `false` and ignores the sample when it is not finite.
    pub fn add_gyroscope(&mut self, angular_rate: &Vector3<T>, dt: Option<T>) -> bool {
        self.gyroscope.add(angular_rate, dt)
    }

    /// Adds a specific force (m/s^2); as [`Self::add_gyroscope`].
    pub fn add_accelerometer(&mut self, specific_force: &Vector3<T>, dt: Option<T>) -> bool {
        self.accelerometer.add(specific_force, dt)
    }

    /// Adds a magnetic field (microtesla); as [`Self::add_gyroscope`].
    pub fn add_magnetometer(&mut self, magnetic_field: &Vector3<T>, dt: Option<T>) -> bool {
        self.magnetometer.add(magnetic_field, dt)
    }

    /// Forgets what the magnetometer said, to calibrate the rest where the field is disturbed.
    pub fn forget_magnetometer(&mut self) {
        self.magnetometer = Statistics::new();
    }

    /// Says to which step the samples of a sensor are rounded, in its [unit](Sensor::unit). A sensor
    /// that repeats one value is then quiet, not dead, and noise below the step is allowed for.
    /// Samples that change by less show the contrary, and the step is found from them instead.
    /// Anything but a positive number means that nothing is known, as at the start.
    pub fn know_resolution(&mut self, sensor: Sensor, step: T) {
        self.statistics_mut(sensor).know_step(step);
    }

    fn statistics_mut(&mut self, sensor: Sensor) -> &mut Statistics<T> {
        match sensor {
            Sensor::Gyroscope => &mut self.gyroscope,
            Sensor::Accelerometer => &mut self.accelerometer,
            Sensor::Magnetometer => &mut self.magnetometer,
        }
    }

    /// Whether the samples of a sensor were all the same.
    pub fn is_constant(&self, sensor: Sensor) -> bool {
        let statistics = match sensor {
            Sensor::Gyroscope => &self.gyroscope,
            Sensor::Accelerometer => &self.accelerometer,
            Sensor::Magnetometer => &self.magnetometer,
        };
        statistics.count() > 0 && statistics.is_constant()
    }

    /// Samples used of gyroscope, accelerometer and magnetometer.
    pub fn samples(&self) -> [u32; 3] {
        [
            self.gyroscope.count(),
            self.accelerometer.count(),
            self.magnetometer.count(),
        ]
    }

    /// The calibration, if the device was at rest and the sensors make sense.
    ///
    /// Accelerometer and magnetometer are optional: a sensor without a sample is left out.
    ///
    /// # Errors
    /// [`RestError`] says what was wrong, by how much, and what to do.
    pub fn finish(&self, limits: &RestLimits<T>) -> Result<RestCalibration<T>, RestError<T>> {
        limits.validate().map_err(RestError::Limits)?;
        limits.check_sensor(Sensor::Gyroscope, &self.gyroscope)?;
        let accelerometer = self.optional(limits, Sensor::Accelerometer, &self.accelerometer)?;
        let magnetometer = self.optional(limits, Sensor::Magnetometer, &self.magnetometer)?;
        if let Some(s) = accelerometer {
            limits.check_gravity(&s.mean())?;
        }
        if let Some(s) = magnetometer {
            limits.check_field(&s.mean())?;
        }
        if let (Some(a), Some(m)) = (accelerometer, magnetometer) {
            limits.check_angle(&a.mean(), &m.mean())?;
        }
        Ok(self.summary(accelerometer, magnetometer))
    }

    fn optional<'a>(
        &self,
        limits: &RestLimits<T>,
        sensor: Sensor,
        statistics: &'a Statistics<T>,
    ) -> Result<Option<&'a Statistics<T>>, RestError<T>> {
        if statistics.count() == 0 {
            return Ok(None);
        }
        limits.check_sensor(sensor, statistics)?;
        Ok(Some(statistics))
    }

    fn summary(
        &self,
        accelerometer: Option<&Statistics<T>>,
        magnetometer: Option<&Statistics<T>>,
    ) -> RestCalibration<T> {
        let gyroscope = &self.gyroscope;
        RestCalibration {
            gyroscope_samples: gyroscope.count(),
            gyroscope_interval_s: gyroscope.interval(),
            gyroscope_bias_rad_s: gyroscope.mean().into(),
            gyroscope_bias_std_rad_s: gyroscope.mean_std().into(),
            gyroscope_std_rad_s: gyroscope.std().into(),
            gyroscope_covariance_rad2_s2: gyroscope.covariance().into(),
            accelerometer_samples: self.accelerometer.count(),
            accelerometer_interval_s: self.accelerometer.interval(),
            specific_force_m_s2: accelerometer.map(|s| s.mean().into()),
            accelerometer_std_m_s2: accelerometer.map(|s| s.std().into()),
            accelerometer_covariance_m2_s4: accelerometer.map(|s| s.covariance().into()),
            specific_force_rounding_std_m_s2: accelerometer.map(|s| s.mean_rounding_std().into()),
            magnetometer_samples: self.magnetometer.count(),
            magnetometer_interval_s: self.magnetometer.interval(),
            magnetic_field_ut: magnetometer.map(|s| s.mean().into()),
            magnetometer_std_ut: magnetometer.map(|s| s.std().into()),
            magnetometer_covariance_ut2: magnetometer.map(|s| s.covariance().into()),
            magnetic_field_rounding_std_ut: magnetometer.map(|s| s.mean_rounding_std().into()),
        }
    }
}

/// A calibration at rest. Flat and of plain arrays, to be written to a file as it stands; vectors
/// are x, y, z in body axes, matrices symmetric.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        deny_unknown_fields,
        bound(
            serialize = "T: serde::Serialize",
            deserialize = "T: serde::Deserialize<'de>"
        )
    )
)]
pub struct RestCalibration<T> {
    /// Gyroscope samples used.
    pub gyroscope_samples: u32,
    /// Mean time between them, s, where known.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub gyroscope_interval_s: Option<T>,
    /// Mean angular rate at rest, rad/s: the bias, `measured = true + bias`.
    pub gyroscope_bias_rad_s: [T; 3],
    /// Standard deviation of that mean, rad/s (M21b).
    pub gyroscope_bias_std_rad_s: [T; 3],
    /// Standard deviation of one sample, rad/s.
    pub gyroscope_std_rad_s: [T; 3],
    /// Covariance of one sample, (rad/s)^2.
    pub gyroscope_covariance_rad2_s2: [[T; 3]; 3],
    /// Accelerometer samples used.
    pub accelerometer_samples: u32,
    /// Mean time between them, s, where known.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub accelerometer_interval_s: Option<T>,
    /// Mean specific force, m/s^2; it points up. `None` without accelerometer.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub specific_force_m_s2: Option<[T; 3]>,
    /// Standard deviation of one sample, m/s^2.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub accelerometer_std_m_s2: Option<[T; 3]>,
    /// Covariance of one sample, (m/s^2)^2.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub accelerometer_covariance_m2_s4: Option<[[T; 3]; 3]>,
    /// Standard deviation of what rounding hides in the mean, m/s^2 (M21c).
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub specific_force_rounding_std_m_s2: Option<[T; 3]>,
    /// Magnetometer samples used.
    pub magnetometer_samples: u32,
    /// Mean time between them, s, where known.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub magnetometer_interval_s: Option<T>,
    /// Mean magnetic field, microtesla. `None` without magnetometer.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub magnetic_field_ut: Option<[T; 3]>,
    /// Standard deviation of one sample, microtesla.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub magnetometer_std_ut: Option<[T; 3]>,
    /// Covariance of one sample, microtesla^2.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub magnetometer_covariance_ut2: Option<[[T; 3]; 3]>,
    /// Standard deviation of what rounding hides in the mean, microtesla (M21c).
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub magnetic_field_rounding_std_ut: Option<[T; 3]>,
}

impl<T: Scalar> RestCalibration<T> {
    /// Gyroscope bias, rad/s, body axes.
    pub fn gyroscope_bias(&self) -> Vector3<T> {
        self.gyroscope_bias_rad_s.into()
    }

    /// Standard deviation (rad/s) of the worst axis of that bias.
    pub fn gyroscope_bias_std(&self) -> T {
        Vector3::from(self.gyroscope_bias_std_rad_s).max()
    }

    /// Covariance of one gyroscope sample, (rad/s)^2.
    pub fn gyroscope_covariance(&self) -> Matrix3<T> {
        self.gyroscope_covariance_rad2_s2.into()
    }

    /// Standard deviation of a gyroscope's sample (rad/s), root mean square of the axes.
    pub fn gyroscope_std(&self) -> T {
        rms(&self.gyroscope_std_rad_s)
    }

    /// White noise of the gyroscope (rad/s/sqrt(Hz)), root mean square of the axes: the standard
    /// deviation of a sample times the square root of the sample interval. `None` where the
    /// interval is unknown.
    pub fn gyroscope_noise_density(&self) -> Option<T> {
        let interval = self.gyroscope_interval_s?;
        Some(self.gyroscope_std() * interval.sqrt())
    }

    /// Standard deviation (m/s^2) of one accelerometer sample, root mean square of the axes.
    pub fn accelerometer_std(&self) -> Option<T> {
        self.accelerometer_std_m_s2.as_ref().map(rms)
    }

    /// Standard deviation (microtesla) of one magnetometer sample, root mean square of the axes.
    pub fn magnetometer_std_ut(&self) -> Option<T> {
        self.magnetometer_std_ut.as_ref().map(rms)
    }

    /// Standard deviation (m/s^2) of what rounding hides in the mean specific force, root mean
    /// square of the axes; zero where nothing is known of it.
    pub fn specific_force_rounding_std(&self) -> T {
        let axes = self.specific_force_rounding_std_m_s2.as_ref();
        axes.map_or(T::zero(), rms)
    }

    /// Standard deviation (microtesla) of what rounding hides in the mean field; as
    /// [`Self::specific_force_rounding_std`].
    pub fn magnetic_field_rounding_std_ut(&self) -> T {
        let axes = self.magnetic_field_rounding_std_ut.as_ref();
        axes.map_or(T::zero(), rms)
    }

    /// Mean specific force, m/s^2, body axes: up, as long as gravity.
    pub fn specific_force(&self) -> Option<Vector3<T>> {
        self.specific_force_m_s2.map(Vector3::from)
    }

    /// Mean magnetic field, microtesla, body axes.
    pub fn magnetic_field_ut(&self) -> Option<Vector3<T>> {
        self.magnetic_field_ut.map(Vector3::from)
    }

    /// Length of the specific force at rest, m/s^2, as this accelerometer measures it.
    pub fn gravity(&self) -> Option<T> {
        self.specific_force().map(|f| f.norm())
    }

    /// Horizontal and downward strength of the magnetic field, microtesla; needs both sensors.
    pub fn field_horizontal_down(&self) -> Option<[T; 2]> {
        let (force, field) = (self.specific_force()?, self.magnetic_field_ut()?);
        let up = force.try_normalize(T::default_epsilon())?;
        let upward = field.dot(&up);
        Some([(field - up * upward).norm(), -upward])
    }

    /// Angle (rad) by which the magnetic field dips below the horizon; needs both sensors.
    pub fn dip(&self) -> Option<T> {
        let [horizontal, down] = self.field_horizontal_down()?;
        Some(down.atan2(horizontal))
    }
}

fn rms<T: Scalar>(axes: &[T; 3]) -> T {
    let [x, y, z] = *axes;
    ((x * x + y * y + z * z) * lit(1.0 / 3.0)).sqrt()
}

#[cfg(test)]
mod rounding_tests;
#[cfg(test)]
mod tests;
