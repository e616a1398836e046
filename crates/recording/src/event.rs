//! The sample model: one [`Event`] is one measurement of one sensor at one instant.
//!
//! All readers produce it and all consumers take it, so a new format is one file and a new
//! sensor is one variant here.

use nalgebra::{UnitQuaternion, Vector3};

/// One measurement of one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Nanoseconds on the recording's own clock (sensor time, not arrival time). The origin is
    /// whatever the recording used; only differences matter.
    pub time_ns: i64,
    /// What was measured.
    pub sample: Sample,
}

/// What a sensor measured. Vectors are in body axes unless the variant says otherwise; a value
/// may be non-finite (readers pass it on, filters refuse and count it).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Sample {
    /// Gyroscope: angular rate of the body with respect to the world, rad/s.
    AngularRate(Vector3<f64>),
    /// Accelerometer: specific force, m/s^2 (at rest +9.81 on the axis that points up).
    SpecificForce(Vector3<f64>),
    /// Magnetometer as the device calibrated it, microtesla.
    MagneticField(Vector3<f64>),
    /// Magnetometer without the device's hard-iron calibration, microtesla.
    MagneticFieldUncalibrated(Vector3<f64>),
    /// The device's own estimate of its gyroscope bias, rad/s (uncalibrated rate = rate + bias).
    DeviceGyroscopeBias(Vector3<f64>),
    /// The device's own orientation, `world_from_body`.
    DeviceOrientation(UnitQuaternion<f64>),
    /// A reference track to score against (motion capture, simulation truth).
    Reference(Reference),
    /// Position in the recording's world frame, m.
    Position(Vector3<f64>),
    /// Velocity in the recording's world frame, m/s.
    Velocity(Vector3<f64>),
    /// Static pressure, Pa.
    Pressure(f64),
}

/// The truth, or the best known stand-in for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// `world_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Whether this instant counts in scores (data sets flag phases without movement as not scored).
    pub scored: bool,
}

/// Which sensor an event belongs to.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SensorKind {
    /// [`Sample::AngularRate`]
    Gyroscope,
    /// [`Sample::SpecificForce`]
    Accelerometer,
    /// [`Sample::MagneticField`]
    Magnetometer,
    /// [`Sample::MagneticFieldUncalibrated`]
    MagnetometerUncalibrated,
    /// [`Sample::DeviceGyroscopeBias`]
    DeviceGyroscopeBias,
    /// [`Sample::DeviceOrientation`]
    DeviceOrientation,
    /// [`Sample::Reference`]
    Reference,
    /// [`Sample::Position`]
    Position,
    /// [`Sample::Velocity`]
    Velocity,
    /// [`Sample::Pressure`]
    Pressure,
}

impl SensorKind {
    /// Every kind, in the order in which events of one instant are delivered: sensors first, the
    /// reference last, so that an estimate is scored after it has seen everything of that instant.
    pub const ALL: [Self; 10] = [
        Self::Gyroscope,
        Self::Accelerometer,
        Self::Magnetometer,
        Self::MagnetometerUncalibrated,
        Self::DeviceGyroscopeBias,
        Self::DeviceOrientation,
        Self::Position,
        Self::Velocity,
        Self::Pressure,
        Self::Reference,
    ];

    /// The name for people and for files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gyroscope => "gyroscope",
            Self::Accelerometer => "accelerometer",
            Self::Magnetometer => "magnetometer",
            Self::MagnetometerUncalibrated => "magnetometer-uncalibrated",
            Self::DeviceGyroscopeBias => "device-gyroscope-bias",
            Self::DeviceOrientation => "device-orientation",
            Self::Reference => "reference",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Pressure => "pressure",
        }
    }
}

impl Sample {
    /// The sensor this sample belongs to.
    #[must_use]
    pub const fn kind(&self) -> SensorKind {
        match self {
            Self::AngularRate(_) => SensorKind::Gyroscope,
            Self::SpecificForce(_) => SensorKind::Accelerometer,
            Self::MagneticField(_) => SensorKind::Magnetometer,
            Self::MagneticFieldUncalibrated(_) => SensorKind::MagnetometerUncalibrated,
            Self::DeviceGyroscopeBias(_) => SensorKind::DeviceGyroscopeBias,
            Self::DeviceOrientation(_) => SensorKind::DeviceOrientation,
            Self::Reference(_) => SensorKind::Reference,
            Self::Position(_) => SensorKind::Position,
            Self::Velocity(_) => SensorKind::Velocity,
            Self::Pressure(_) => SensorKind::Pressure,
        }
    }
}
