//! The three sensors of a phone as a user configures them: units in the names, documented defaults.
//!
//! The defaults are those of a good phone that has just been calibrated: the noise the filters'
//! default settings expect, the resolution of common parts, a gyroscope bias, nothing else.

use serde::{Deserialize, Serialize};

use super::{ErrorModel, Sampling};

/// How the gyroscope is sampled and what is wrong with it. Zero switches an error off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GyroscopeConfig {
    /// When it samples. Default 100 Hz.
    pub sampling: Sampling,
    /// Whether a sample is the mean rate since the sampling instant before it, as parts with
    /// integration or a matched low-pass give it (a filter that averages neighbouring samples then
    /// lags by half a sample), rather than the rate of the instant itself. Default false.
    pub averages: bool,
    /// White noise of each sample, rad/s. Default 0.005.
    pub noise_std_rad_s: f64,
    /// White noise as a density, (rad/s)/sqrt(Hz), added in quadrature. Default 0.
    pub noise_density_rad_s_sqrt_hz: f64,
    /// Constant bias that is the same for every seed, rad/s. Default 0.
    pub bias_rad_s: [f64; 3],
    /// Standard deviation of the constant bias drawn per seed, rad/s. Default 0.02.
    pub bias_std_rad_s: f64,
    /// Random walk of the bias, (rad/s)/sqrt(s). Default 2e-5.
    pub bias_random_walk_rad_s_sqrt_s: f64,
    /// Standard deviation of the relative scale error per axis. Default 0.
    pub scale_error_std: f64,
    /// One step of the output, rad/s. Default 0.001065: 16 bits over +-2000 deg/s.
    pub resolution_rad_s: f64,
    /// Largest rate it can show, rad/s. Default 34.9: 2000 deg/s.
    pub range_rad_s: f64,
}

impl Default for GyroscopeConfig {
    fn default() -> Self {
        Self {
            sampling: Sampling::at_rate(100.0),
            averages: false,
            noise_std_rad_s: 0.005,
            noise_density_rad_s_sqrt_hz: 0.0,
            bias_rad_s: [0.0; 3],
            bias_std_rad_s: 0.02,
            bias_random_walk_rad_s_sqrt_s: 2e-5,
            scale_error_std: 0.0,
            resolution_rad_s: 0.001_065,
            range_rad_s: 34.9,
        }
    }
}

impl GyroscopeConfig {
    /// The errors, in rad/s.
    #[must_use]
    pub const fn error_model(&self) -> ErrorModel {
        ErrorModel {
            noise_std: self.noise_std_rad_s,
            noise_density: self.noise_density_rad_s_sqrt_hz,
            bias: self.bias_rad_s,
            bias_std: self.bias_std_rad_s,
            bias_random_walk: self.bias_random_walk_rad_s_sqrt_s,
            scale_error_std: self.scale_error_std,
            resolution: self.resolution_rad_s,
            range: self.range_rad_s,
        }
    }
}

/// How the accelerometer is sampled and what is wrong with it. Zero switches an error off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AccelerometerConfig {
    /// When it samples. Default 100 Hz.
    pub sampling: Sampling,
    /// White noise of each sample, m/s^2. Default 0.05.
    pub noise_std_m_s2: f64,
    /// White noise as a density, (m/s^2)/sqrt(Hz), added in quadrature. Default 0.
    pub noise_density_m_s2_sqrt_hz: f64,
    /// Constant bias that is the same for every seed, m/s^2. Default 0.
    pub bias_m_s2: [f64; 3],
    /// Standard deviation of the constant bias drawn per seed, m/s^2. Default 0; an uncalibrated
    /// phone has about 0.2.
    pub bias_std_m_s2: f64,
    /// Random walk of the bias, (m/s^2)/sqrt(s). Default 0.
    pub bias_random_walk_m_s2_sqrt_s: f64,
    /// Standard deviation of the relative scale error per axis. Default 0.
    pub scale_error_std: f64,
    /// One step of the output, m/s^2. Default 0.0023946: 16 bits over +-8 g.
    pub resolution_m_s2: f64,
    /// Largest specific force it can show, m/s^2. Default 78.45: 8 g.
    pub range_m_s2: f64,
}

impl Default for AccelerometerConfig {
    fn default() -> Self {
        Self {
            sampling: Sampling::at_rate(100.0),
            noise_std_m_s2: 0.05,
            noise_density_m_s2_sqrt_hz: 0.0,
            bias_m_s2: [0.0; 3],
            bias_std_m_s2: 0.0,
            bias_random_walk_m_s2_sqrt_s: 0.0,
            scale_error_std: 0.0,
            resolution_m_s2: 0.002_394_6,
            range_m_s2: 78.45,
        }
    }
}

impl AccelerometerConfig {
    /// The errors, in m/s^2.
    #[must_use]
    pub const fn error_model(&self) -> ErrorModel {
        ErrorModel {
            noise_std: self.noise_std_m_s2,
            noise_density: self.noise_density_m_s2_sqrt_hz,
            bias: self.bias_m_s2,
            bias_std: self.bias_std_m_s2,
            bias_random_walk: self.bias_random_walk_m_s2_sqrt_s,
            scale_error_std: self.scale_error_std,
            resolution: self.resolution_m_s2,
            range: self.range_m_s2,
        }
    }
}

/// How the magnetometer is sampled and what is wrong with it. Zero switches an error off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MagnetometerConfig {
    /// When it samples. Default 50 Hz, first 3 ms after the others: a chip of its own.
    pub sampling: Sampling,
    /// White noise of each sample, microtesla. Default 0.5.
    pub noise_std_ut: f64,
    /// White noise as a density, microtesla/sqrt(Hz), added in quadrature. Default 0.
    pub noise_density_ut_sqrt_hz: f64,
    /// Constant bias (hard iron) that is the same for every seed, microtesla. Default 0.
    pub bias_ut: [f64; 3],
    /// Standard deviation of the constant bias drawn per seed, microtesla. Default 0; a badly
    /// calibrated phone has 5 and more.
    pub bias_std_ut: f64,
    /// Random walk of the bias, microtesla/sqrt(s). Default 0.
    pub bias_random_walk_ut_sqrt_s: f64,
    /// Standard deviation of the relative scale error per axis. Default 0.
    pub scale_error_std: f64,
    /// One step of the output, microtesla. Default 0.15.
    pub resolution_ut: f64,
    /// Largest field it can show, microtesla. Default 4900.
    pub range_ut: f64,
}

impl Default for MagnetometerConfig {
    fn default() -> Self {
        Self {
            sampling: Sampling {
                start_offset_s: 0.003,
                ..Sampling::at_rate(50.0)
            },
            noise_std_ut: 0.5,
            noise_density_ut_sqrt_hz: 0.0,
            bias_ut: [0.0; 3],
            bias_std_ut: 0.0,
            bias_random_walk_ut_sqrt_s: 0.0,
            scale_error_std: 0.0,
            resolution_ut: 0.15,
            range_ut: 4900.0,
        }
    }
}

impl MagnetometerConfig {
    /// The errors, in microtesla.
    #[must_use]
    pub const fn error_model(&self) -> ErrorModel {
        ErrorModel {
            noise_std: self.noise_std_ut,
            noise_density: self.noise_density_ut_sqrt_hz,
            bias: self.bias_ut,
            bias_std: self.bias_std_ut,
            bias_random_walk: self.bias_random_walk_ut_sqrt_s,
            scale_error_std: self.scale_error_std,
            resolution: self.resolution_ut,
            range: self.range_ut,
        }
    }
}
