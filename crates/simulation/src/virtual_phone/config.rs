//! What a virtual phone can be asked for, and what it refuses.

use serde::{Deserialize, Serialize};

use crate::sensors::{AccelerometerConfig, GyroscopeConfig, MagnetometerConfig, Sampling};
use crate::settings::{named_values, settings};

settings! {
    /// A virtual phone and what happens to it. The default is the laboratory script in a gentle hand.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct VirtualPhoneConfig {
        /// Determines everything random. Default 1.
        seed: u64 = 1,
        /// Length of the recording, s: the script starts again until this has passed. Default: once
        /// through the script.
        #[serde(skip_serializing_if = "Option::is_none")]
        duration_s: Option<f64> = None,
        /// Time stamp of the start, ns. Default 0.
        start_time_ns: i64 = 0,
        /// How the phone is moved. Default gentle.
        motion: Motion = Motion::Gentle,
        /// What disturbs it while it is moved. Default nothing.
        disturbance: Disturbance = Disturbance::None,
        /// Rest in the reference pose before the motion, s. Default 10.
        rest_before_s: f64 = 10.0,
        /// Motion that ends in the reference pose, s. Default 60.
        motion_s: f64 = 60.0,
        /// Rest in the reference pose after the motion, s. Default 5.
        rest_after_s: f64 = 5.0,
        /// Strength of the magnetic field, microtesla. Default 43.
        magnetic_field_strength_ut: f64 = 43.0,
        /// How far the field points below the horizon, deg. Default 51.
        magnetic_dip_deg: f64 = 51.0,
        /// The gyroscope.
        gyroscope: GyroscopeConfig = GyroscopeConfig::default(),
        /// The accelerometer.
        accelerometer: AccelerometerConfig = AccelerometerConfig::default(),
        /// The magnetometer.
        magnetometer: MagnetometerConfig = MagnetometerConfig::default(),
        /// The orientation the phone itself reports.
        device_orientation: DeviceOrientationConfig = DeviceOrientationConfig::default(),
        /// The heading the phone itself reports. Default: none.
        compass: CompassConfig = CompassConfig::default(),
        /// Whether the truth is recorded, with every gyroscope sample. Default: it is.
        reference: ReferenceConfig = ReferenceConfig::default(),
    }
}

/// How the phone is moved between the rests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// Slow turns: about 0.4 rad and 0.5 rad/s RMS per axis.
    #[default]
    Gentle,
    /// Lively turns: about 0.6 rad and 1.3 rad/s RMS per axis.
    Brisk,
    /// Turned all over without haste, so that every side once points everywhere: what a calibration
    /// of the magnetometer wants.
    Tumble,
    /// None: it stays in the reference pose.
    Rest,
}

impl Motion {
    /// Every motion.
    pub const ALL: [Self; 4] = [Self::Gentle, Self::Brisk, Self::Tumble, Self::Rest];

    /// The name for people and for files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gentle => "gentle",
            Self::Brisk => "brisk",
            Self::Tumble => "tumble",
            Self::Rest => "rest",
        }
    }
}

/// What disturbs the sensors while the phone is moved; never while it rests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Disturbance {
    /// Nothing.
    #[default]
    None,
    /// Shaking with 2 m/s^2 at 0.8 Hz along each axis for 8 s of every 20 s.
    Acceleration,
    /// 20 microtesla towards the east for the last 6 s of every 20 s.
    Magnetic,
    /// Both.
    Both,
}

impl Disturbance {
    /// Every disturbance.
    pub const ALL: [Self; 4] = [Self::None, Self::Acceleration, Self::Magnetic, Self::Both];

    /// The name for people and for files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Acceleration => "acceleration",
            Self::Magnetic => "magnetic",
            Self::Both => "both",
        }
    }

    pub(super) const fn shakes(self) -> bool {
        matches!(self, Self::Acceleration | Self::Both)
    }

    pub(super) const fn is_magnetic(self) -> bool {
        matches!(self, Self::Magnetic | Self::Both)
    }
}

settings! {
    /// The orientation the phone reports: the truth of a moment ago, with an error that drifts.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct DeviceOrientationConfig {
        /// When it is reported. Default 50 Hz, first at 5 ms, 20 ms late.
        sampling: Sampling = Sampling {
                    start_offset_s: 0.005,
                    delay_s: 0.02,
                    ..Sampling::at_rate(50.0)
                },
        /// Standard deviation of the error about the vertical, deg. Default 3.
        heading_error_std_deg: f64 = 3.0,
        /// Standard deviation of the error about each horizontal axis, deg. Default 0.7.
        inclination_error_std_deg: f64 = 0.7,
        /// How long the error remembers itself, s. Default 20.
        correlation_time_s: f64 = 20.0,
    }
}

settings! {
    /// The heading the phone reports, as phones without a magnetometer for programs do: the truth with
    /// an error that drifts and whose size it states.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct CompassConfig {
        /// When it is reported. Default never (0 Hz).
        sampling: Sampling = Sampling::at_rate(0.0),
        /// Standard deviation of the error, deg, which the phone states. Default 5.
        error_std_deg: f64 = 5.0,
        /// How long the error remembers itself, s. Default 2.
        correlation_time_s: f64 = 2.0,
    }
}

settings! {
    /// The truth track of the recording.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct ReferenceConfig {
        /// Whether it is recorded. Default true.
        recorded: bool = true,
    }
}

/// A configuration that is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("virtual phone: {field} is {value}, expected {expected}")]
pub struct ConfigError {
    field: String,
    value: f64,
    expected: &'static str,
}

impl VirtualPhoneConfig {
    /// Length of one pass through the script, s.
    #[must_use]
    pub fn script_s(&self) -> f64 {
        self.rest_before_s + self.motion_s + self.rest_after_s
    }

    /// Length of the recording, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s.unwrap_or_else(|| self.script_s())
    }

    /// Amplitude (rad) and highest frequency (Hz) of the motion, if there is one.
    pub(super) const fn motion_settings(&self) -> Option<(f64, f64)> {
        match self.motion {
            Motion::Gentle => Some((0.8, 0.35)),
            Motion::Brisk => Some((1.2, 0.6)),
            Motion::Tumble => Some((4.0, 0.15)),
            Motion::Rest => None,
        }
    }

    /// Refuses what is invalid.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let fields = named_values![self =>
            rest_before_s,
            motion_s,
            rest_after_s,
            magnetic_field_strength_ut,
            device_orientation.heading_error_std_deg,
            device_orientation.inclination_error_std_deg,
            compass.error_std_deg,
        ];
        for (field, value) in fields {
            not_negative(field, value)?;
        }
        positive("rest_before_s + motion_s + rest_after_s", self.script_s())?;
        not_negative("duration_s", self.duration_s())?;
        // Time stamps are 64-bit nanoseconds.
        within("duration_s", self.duration_s(), 0.0..=4e9, "at most 4e9 s")?;
        within(
            "magnetic_dip_deg",
            self.magnetic_dip_deg,
            -90.0..=90.0,
            "-90 to 90 deg",
        )?;
        for (field, value) in named_values![self =>
            device_orientation.correlation_time_s,
            compass.correlation_time_s,
        ] {
            positive(field, value)?;
        }
        self.check_sensors()
    }

    fn check_sensors(&self) -> Result<(), ConfigError> {
        let (gyroscope, accelerometer) = (&self.gyroscope, &self.accelerometer);
        for (name, sampling, model) in [
            ("gyroscope", &gyroscope.sampling, gyroscope.error_model()),
            (
                "accelerometer",
                &accelerometer.sampling,
                accelerometer.error_model(),
            ),
            (
                "magnetometer",
                &self.magnetometer.sampling,
                self.magnetometer.error_model(),
            ),
        ] {
            check_sampling(name, sampling)?;
            for (what, value) in [
                ("noise std", model.noise_std),
                ("noise density", model.noise_density),
                ("bias std", model.bias_std),
                ("bias random walk", model.bias_random_walk),
                ("scale error std", model.scale_error_std),
                ("resolution", model.resolution),
                ("range", model.range),
            ] {
                not_negative(&format!("{name} {what}"), value)?;
            }
            for value in model.bias {
                within(
                    &format!("{name} bias"),
                    value,
                    f64::MIN..=f64::MAX,
                    "a finite number",
                )?;
            }
        }
        check_sampling("device_orientation", &self.device_orientation.sampling)?;
        check_sampling("compass", &self.compass.sampling)
    }
}

fn check_sampling(name: &str, sampling: &Sampling) -> Result<(), ConfigError> {
    for (what, value) in [
        ("start_offset_s", sampling.start_offset_s),
        ("jitter_std_s", sampling.jitter_std_s),
        ("delay_s", sampling.delay_s),
    ] {
        not_negative(&format!("{name}.sampling.{what}"), value)?;
    }
    within(
        &format!("{name}.sampling.rate_hz"),
        sampling.rate_hz,
        0.0..=1e6,
        "0 (off) to 1e6 Hz",
    )?;
    within(
        &format!("{name}.sampling.dropout_probability"),
        sampling.dropout_probability,
        0.0..=1.0,
        "0 to 1",
    )
}

fn not_negative(field: &str, value: f64) -> Result<(), ConfigError> {
    within(
        field,
        value,
        0.0..=f64::MAX,
        "a finite number, zero or more",
    )
}

fn positive(field: &str, value: f64) -> Result<(), ConfigError> {
    within(
        field,
        value,
        f64::MIN_POSITIVE..=f64::MAX,
        "a finite number above zero",
    )
}

fn within(
    field: &str,
    value: f64,
    allowed: std::ops::RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), ConfigError> {
    if allowed.contains(&value) {
        return Ok(());
    }
    Err(ConfigError {
        field: field.to_owned(),
        value,
        expected,
    })
}
