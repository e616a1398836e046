//! The three sensors of a phone as a user configures them: units in the names, documented defaults.
//!
//! The defaults are those of a good phone that has just been calibrated: the noise the filters'
//! default settings expect, the resolution of common parts, a gyroscope bias, nothing else.

use serde::{Deserialize, Serialize};

use super::{ErrorModel, Sampling};
use crate::settings::settings;

/// Makes the settings of a sensor and what they say of its errors: a row of an error names it behind the arrow.
macro_rules! sensor {
    ($(#[$about:meta])* pub struct $name:ident {
        $($(#[$meaning:meta])* $field:ident: $type:ty = $default:expr $(=> $error:ident)?,)+
    }) => {
        settings! {
            $(#[$about])*
            pub struct $name {
                $($(#[$meaning])* $field: $type = $default,)+
            }
        }

        impl $name {
            /// The errors, in the unit of the sensor.
            #[must_use]
            pub const fn error_model(&self) -> ErrorModel {
                ErrorModel { $($($error: self.$field,)?)+ }
            }
        }
    };
}

sensor! {
    /// How the gyroscope is sampled and what is wrong with it. Zero switches an error off.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct GyroscopeConfig {
        /// When it samples. Default 100 Hz.
        sampling: Sampling = Sampling::at_rate(100.0),
        /// Whether a sample is the mean rate since the sampling instant before it, as parts with
        /// integration or a matched low-pass give it (a filter that averages neighbouring samples then
        /// lags by half a sample), rather than the rate of the instant itself. Default false.
        averages: bool = false,
        /// White noise of each sample, rad/s. Default 0.005.
        noise_std_rad_s: f64 = 0.005 => noise_std,
        /// White noise as a density, (rad/s)/sqrt(Hz), added in quadrature. Default 0.
        noise_density_rad_s_sqrt_hz: f64 = 0.0 => noise_density,
        /// Constant bias that is the same for every seed, rad/s. Default 0.
        bias_rad_s: [f64; 3] = [0.0; 3] => bias,
        /// Standard deviation of the constant bias drawn per seed, rad/s. Default 0.02.
        bias_std_rad_s: f64 = 0.02 => bias_std,
        /// Random walk of the bias, (rad/s)/sqrt(s). Default 2e-5.
        bias_random_walk_rad_s_sqrt_s: f64 = 2e-5 => bias_random_walk,
        /// Standard deviation of the relative scale error per axis. Default 0.
        scale_error_std: f64 = 0.0 => scale_error_std,
        /// One step of the output, rad/s. Default 0.001065: 16 bits over +-2000 deg/s.
        resolution_rad_s: f64 = 0.001_065 => resolution,
        /// Largest rate it can show, rad/s. Default 34.9: 2000 deg/s.
        range_rad_s: f64 = 34.9 => range,
    }
}

sensor! {
    /// How the accelerometer is sampled and what is wrong with it. Zero switches an error off.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct AccelerometerConfig {
        /// When it samples. Default 100 Hz.
        sampling: Sampling = Sampling::at_rate(100.0),
        /// White noise of each sample, m/s^2. Default 0.05.
        noise_std_m_s2: f64 = 0.05 => noise_std,
        /// White noise as a density, (m/s^2)/sqrt(Hz), added in quadrature. Default 0.
        noise_density_m_s2_sqrt_hz: f64 = 0.0 => noise_density,
        /// Constant bias that is the same for every seed, m/s^2. Default 0.
        bias_m_s2: [f64; 3] = [0.0; 3] => bias,
        /// Standard deviation of the constant bias drawn per seed, m/s^2. Default 0; an uncalibrated
        /// phone has about 0.2.
        bias_std_m_s2: f64 = 0.0 => bias_std,
        /// Random walk of the bias, (m/s^2)/sqrt(s). Default 0.
        bias_random_walk_m_s2_sqrt_s: f64 = 0.0 => bias_random_walk,
        /// Standard deviation of the relative scale error per axis. Default 0.
        scale_error_std: f64 = 0.0 => scale_error_std,
        /// One step of the output, m/s^2. Default 0.0023946: 16 bits over +-8 g.
        resolution_m_s2: f64 = 0.002_394_6 => resolution,
        /// Largest specific force it can show, m/s^2. Default 78.45: 8 g.
        range_m_s2: f64 = 78.45 => range,
    }
}

sensor! {
    /// How the magnetometer is sampled and what is wrong with it. Zero switches an error off.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct MagnetometerConfig {
        /// When it samples. Default 50 Hz, first 3 ms after the others: a chip of its own.
        sampling: Sampling = Sampling {
                    start_offset_s: 0.003,
                    ..Sampling::at_rate(50.0)
                },
        /// White noise of each sample, microtesla. Default 0.5.
        noise_std_ut: f64 = 0.5 => noise_std,
        /// White noise as a density, microtesla/sqrt(Hz), added in quadrature. Default 0.
        noise_density_ut_sqrt_hz: f64 = 0.0 => noise_density,
        /// Constant bias (hard iron) that is the same for every seed, microtesla. Default 0.
        bias_ut: [f64; 3] = [0.0; 3] => bias,
        /// Standard deviation of the constant bias drawn per seed, microtesla. Default 0; a badly
        /// calibrated phone has 5 and more.
        bias_std_ut: f64 = 0.0 => bias_std,
        /// Random walk of the bias, microtesla/sqrt(s). Default 0.
        bias_random_walk_ut_sqrt_s: f64 = 0.0 => bias_random_walk,
        /// Standard deviation of the relative scale error per axis. Default 0.
        scale_error_std: f64 = 0.0 => scale_error_std,
        /// One step of the output, microtesla. Default 0.15.
        resolution_ut: f64 = 0.15 => resolution,
        /// Largest field it can show, microtesla. Default 4900.
        range_ut: f64 = 4900.0 => range,
    }
}
