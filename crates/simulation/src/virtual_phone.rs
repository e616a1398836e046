//! The virtual phone: a recording with known truth, as long as wanted, from a seed.
//!
//! It plays the laboratory script of a smart-device attitude experiment: the phone rests (the filter
//! calibrates), is turned about by hand, is put back exactly where it lay, and rests again (the
//! final test). Its sensors have their own rates, offsets and errors; it reports an orientation of
//! its own, a little wrong and late, as phones do; and the truth comes with every gyroscope sample.
//! The world is east, north, up.
//!
//! ```
//! use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
//!
//! let phone = VirtualPhone::new(VirtualPhoneConfig::default())?;
//! let last = phone.events().last().expect("it records for 75 s");
//! assert_eq!(last.time_ns, 75_000_000_000);
//! # Ok::<(), northing_simulation::virtual_phone::ConfigError>(())
//! ```

mod compass;
mod config;
mod device_orientation;
mod events;
mod slow_error;

use nalgebra::Vector3;
use northing_recording::{Metadata, WorldFrame};

pub use config::{
    CompassConfig, ConfigError, DeviceOrientationConfig, Disturbance, Motion, ReferenceConfig,
    VirtualPhoneConfig,
};
pub use events::VirtualPhoneEvents;

use crate::random::stream;
use crate::sensors::SensorErrors;
use crate::trajectory::{
    AccelerationBursts, MultiSine, MultiSineConfig, Repeated, Rest, Sequence, Shaken, Trajectory,
};
use crate::world::magnetic_field_ut;

/// Amplitude of the acceleration bursts, m/s^2.
const ACCELERATION_BURST_M_S2: f64 = 2.0;
/// Strength of the magnetic bursts, microtesla.
const MAGNETIC_BURST_UT: f64 = 20.0;

/// A phone that never existed. See the [module](self).
#[derive(Debug, Clone, PartialEq)]
pub struct VirtualPhone {
    config: VirtualPhoneConfig,
}

impl VirtualPhone {
    /// A phone of this configuration.
    ///
    /// # Errors
    /// A field has a value that is invalid; the message names it and says what was expected.
    pub fn new(config: VirtualPhoneConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self { config })
    }

    /// What it was made from.
    #[must_use]
    pub fn config(&self) -> &VirtualPhoneConfig {
        &self.config
    }

    /// The events in time order, within one instant in the order of
    /// [`SensorKind::ALL`](northing_recording::SensorKind::ALL). Every call starts the same
    /// recording anew. Memory does not grow with the duration.
    #[must_use]
    pub fn events(&self) -> VirtualPhoneEvents {
        VirtualPhoneEvents::new(self)
    }

    /// What the recording says about itself; `extra` holds the settings and the drawn truth.
    #[must_use]
    pub fn metadata(&self) -> Metadata {
        let config = &self.config;
        let bias = self.gyroscope_errors().bias();
        let field = self.magnetic_field_world_ut();
        let vector = |v: Vector3<f64>| format!("{} {} {}", v.x, v.y, v.z);
        let extra = [
            ("seed", config.seed.to_string()),
            ("motion", config.motion.name().to_owned()),
            ("disturbance", config.disturbance.name().to_owned()),
            ("duration_s", config.duration_s().to_string()),
            ("rest_before_s", config.rest_before_s.to_string()),
            ("motion_s", config.motion_s.to_string()),
            ("rest_after_s", config.rest_after_s.to_string()),
            ("magnetic_field_world_ut", vector(field)),
            ("true_initial_gyroscope_bias_rad_s", vector(bias)),
        ];
        Metadata {
            name: "virtual-phone".to_owned(),
            format: "simulation".to_owned(),
            world_frame: WorldFrame::Enu,
            device: Some("virtual phone".to_owned()),
            extra: extra.map(|(key, value)| (key.to_owned(), value)).into(),
            ..Metadata::default()
        }
    }

    /// The undisturbed magnetic field in the world (east, north, up), microtesla.
    #[must_use]
    pub fn magnetic_field_world_ut(&self) -> Vector3<f64> {
        magnetic_field_ut(
            self.config.magnetic_field_strength_ut,
            self.config.magnetic_dip_deg,
        )
    }

    /// The true motion: the script, over and over. Time zero is the start of the recording.
    #[must_use]
    pub fn trajectory(&self) -> Box<dyn Trajectory> {
        let config = &self.config;
        let script = match config.motion_settings() {
            None => self.script(Rest::default()),
            Some((amplitude_rad, frequency_max_hz)) => self.script(MultiSine::random(
                &mut stream(config.seed, "motion"),
                &MultiSineConfig {
                    amplitude_rad,
                    frequency_max_hz,
                    duration_s: config.motion_s,
                    ..MultiSineConfig::default()
                },
            )),
        };
        Box::new(Repeated {
            motion: script,
            period_s: config.script_s(),
        })
    }

    /// Rest, motion (which ends in the pose it started in), rest.
    fn script(&self, motion: impl Trajectory + 'static) -> Sequence {
        let config = &self.config;
        let rest = Sequence::new().rest(config.rest_before_s);
        let moved = if config.disturbance.shakes() {
            let bursts = AccelerationBursts::random(
                &mut stream(config.seed, "disturbance"),
                ACCELERATION_BURST_M_S2,
                config.motion_s,
            );
            rest.then(config.motion_s, Shaken { motion, bursts })
        } else {
            rest.then(config.motion_s, motion)
        };
        moved.rest(config.rest_after_s)
    }

    fn gyroscope_errors(&self) -> SensorErrors {
        let gyroscope = &self.config.gyroscope;
        SensorErrors::new(
            self.config.seed,
            "gyroscope",
            &gyroscope.error_model(),
            gyroscope.sampling.rate_hz,
        )
    }
}

#[cfg(test)]
mod tests;
