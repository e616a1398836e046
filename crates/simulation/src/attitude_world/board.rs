//! Boards of the worlds: three-axis sensors with noise, bias, scale, rounding and limits, and what says where north is.
//!
//! What is drawn here is benign: what the parameters for hand-held devices are made for. One fault a world is laid over it
//! ([`super::fault`]).

use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::WorldMotion;
use crate::signals::Draws;

/// A sensor of three axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Triad {
    /// Samples a second.
    pub rate_hz: f64,
    /// Time of its first sample, s.
    pub first_s: f64,
    /// White noise, the sensor's unit/sqrt(Hz).
    pub noise_density: f64,
    /// Bias at the first sample, the sensor's unit.
    pub bias: [f64; 3],
    /// Random walk of the bias, unit/sqrt(s).
    pub bias_random_walk: f64,
    /// Relative scale error of each axis.
    pub scale_error: [f64; 3],
    /// From the body's axes to the sensor's: w, x, y, z.
    pub sensor_from_body: [f64; 4],
    /// One step of the output, the sensor's unit.
    pub step: f64,
    /// Largest value of an axis, the sensor's unit.
    pub full_scale: f64,
}

/// The device's own heading, of an orientation sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorldCompass {
    /// Headings a second.
    pub rate_hz: f64,
    /// Standard deviation of its error, rad.
    pub std_rad: f64,
    /// How long an error lasts, s.
    pub correlation_time_s: f64,
    /// How old a heading is, s.
    pub lag_s: f64,
    /// Standard deviation that it states, rad.
    pub stated_std_rad: f64,
}

/// What says where north is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeadingSource {
    /// A magnetometer; its unit is microtesla, its bias the hard iron.
    Magnetometer(Triad),
    /// A compass.
    Compass(WorldCompass),
    /// Nothing.
    None,
}

impl HeadingSource {
    /// Its name.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Magnetometer(_) => "magnetometer",
            Self::Compass(_) => "compass",
            Self::None => "none",
        }
    }
}

/// The sensors of a device. The axes of the body are those of the accelerometer: level is what it shows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Board {
    /// rad/s.
    pub gyroscope: Triad,
    /// m/s^2.
    pub accelerometer: Triad,
    /// What says where north is.
    pub heading: HeadingSource,
    /// How much later than they happen gyroscope and accelerometer show things, s.
    pub group_delay_s: f64,
}

impl Triad {
    /// One without any error.
    pub(super) fn ideal(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            first_s: 0.5 / rate_hz,
            noise_density: 0.0,
            bias: [0.0; 3],
            bias_random_walk: 0.0,
            scale_error: [0.0; 3],
            sensor_from_body: [1.0, 0.0, 0.0, 0.0],
            step: 0.0,
            full_scale: f64::INFINITY,
        }
    }

    /// The sensor's axes.
    #[must_use]
    pub fn turn(&self) -> UnitQuaternion<f64> {
        let [w, x, y, z] = self.sensor_from_body;
        UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z))
    }

    pub(super) fn set_turn(&mut self, turn: &UnitQuaternion<f64>) {
        self.sensor_from_body = [turn.w, turn.i, turn.j, turn.k];
    }

    /// Standard deviation of the noise of a sample: a sample is a mean over [`Self::window_s`].
    #[must_use]
    pub fn noise_std(&self) -> f64 {
        self.noise_density / self.window_s().sqrt()
    }

    /// Over how long a sample is a mean: the interval between samples, at most 20 ms, s.
    #[must_use]
    pub fn window_s(&self) -> f64 {
        (1.0 / self.rate_hz).min(0.02)
    }
}

impl Board {
    /// A benign board for this motion.
    pub(super) fn draw(motion: WorldMotion, draws: &mut Draws) -> Self {
        let rates: &[f64] = if motion.is_violent() {
            &[60.0, 100.0, 100.0, 200.0, 285.7, 500.0]
        } else {
            &[20.0, 40.0, 50.0, 60.0, 100.0, 100.0, 200.0, 285.7, 500.0]
        };
        let rate_hz = draws.one_of(rates);
        let gyroscope = Self::gyroscope(rate_hz, draws);
        let accelerometer = Self::accelerometer(rate_hz, draws);
        let heading = match draws.uniform(0.0, 1.0) {
            x if x < 0.65 => HeadingSource::Magnetometer(Self::magnetometer(rate_hz, draws)),
            x if x < 0.85 => HeadingSource::Compass(WorldCompass::draw(draws)),
            _ => HeadingSource::None,
        };
        Self {
            gyroscope,
            accelerometer,
            heading,
            group_delay_s: draws.uniform(0.0, 0.005),
        }
    }

    fn gyroscope(rate_hz: f64, draws: &mut Draws) -> Triad {
        let bias_std = draws.log_uniform(1e-4, 0.02);
        let mut triad = Triad {
            noise_density: draws.log_uniform(1e-5, 1e-3),
            bias: (draws.normals() * bias_std).into(),
            bias_random_walk: draws.log_uniform(1e-7, 2e-5),
            scale_error: (draws.normals() * 0.003).into(),
            // 16 bits over 2000 deg/s.
            step: 0.001_065,
            full_scale: 34.9,
            ..Triad::ideal(rate_hz)
        };
        triad.set_turn(&draws.small_rotation(5e-4));
        triad
    }

    fn accelerometer(rate_hz: f64, draws: &mut Draws) -> Triad {
        // Mostly on one chip with the gyroscope; else a rate and a time of its own.
        let own = draws.chance(0.3);
        let rate_hz = rate_hz
            * if own {
                draws.one_of(&[0.5, 1.0, 1.0])
            } else {
                1.0
            };
        let shift = if own { draws.uniform(0.0, 1.0) } else { 0.5 };
        let bias_std = draws.log_uniform(0.01, 0.1);
        Triad {
            first_s: shift / rate_hz,
            noise_density: draws.log_uniform(2e-4, 2e-2),
            bias: (draws.normals() * bias_std).into(),
            bias_random_walk: draws.log_uniform(1e-6, 3e-4),
            scale_error: (draws.normals() * 0.002).into(),
            // 16 bits over 16 g, the half of which is sign.
            step: 0.004_79,
            full_scale: 156.9,
            ..Triad::ideal(rate_hz)
        }
    }

    pub(super) fn magnetometer(rate_hz: f64, draws: &mut Draws) -> Triad {
        let rate_hz = rate_hz.min(draws.one_of(&[10.0, 20.0, 50.0, 100.0]));
        let hard_iron = draws.log_uniform(0.1, 1.5);
        let noise_std = draws.log_uniform(0.05, 1.0);
        let mut triad = Triad {
            first_s: draws.uniform(0.0, 1.0) / rate_hz,
            bias: (draws.normals() * hard_iron).into(),
            scale_error: (draws.normals() * 0.005).into(),
            step: 0.15,
            full_scale: 4900.0,
            ..Triad::ideal(rate_hz)
        };
        triad.noise_density = noise_std * triad.window_s().sqrt();
        triad.set_turn(&draws.small_rotation(2e-3));
        triad
    }
}

impl WorldCompass {
    fn draw(draws: &mut Draws) -> Self {
        let std_rad = draws.log_uniform(3.0, 20.0).to_radians();
        Self {
            rate_hz: draws.one_of(&[5.0, 10.0, 20.0, 60.0]),
            std_rad,
            correlation_time_s: draws.log_uniform(1.0, 20.0),
            lag_s: draws.uniform(0.0, 0.3),
            stated_std_rad: std_rad * draws.log_uniform(0.6, 1.6),
        }
    }
}

/// A vector rounded to steps, within limits.
pub(super) fn digitised(vector: &Vector3<f64>, triad: &Triad) -> Vector3<f64> {
    vector.map(|v| {
        let v = v.clamp(-triad.full_scale, triad.full_scale);
        if triad.step > 0.0 {
            (v / triad.step).round() * triad.step
        } else {
            v
        }
    })
}
