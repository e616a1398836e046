//! The sample model: one [`Event`] is one measurement of one sensor at one instant.
//!
//! All readers produce it and all consumers take it, so a new format is one file and a new
//! sensor is one variant here.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::device_navigation::DeviceNavigation;
use crate::gnss::{GnssPosition, GnssVelocity};

/// One measurement of one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Nanoseconds on the recording's own clock (sensor time, not arrival time). The origin is
    /// whatever the recording used; only differences matter.
    pub time_ns: i64,
    /// What was measured.
    pub sample: Sample,
}

impl Event {
    /// What events are sorted by: the stamp, then the place of the sensor in [`SensorKind::ALL`].
    #[must_use]
    pub const fn place(&self) -> (i64, usize) {
        (self.time_ns, self.sample.kind().order())
    }
}

/// Where the horizontal part of the body's y axis (a phone's top edge) points, as the device
/// reports it. It is not defined while that axis stands near the vertical (filters skip it above
/// 60 deg of elevation); screen up or down makes no difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompassHeading {
    /// Clockwise from magnetic north seen from above, rad.
    pub heading_rad: f64,
    /// Standard deviation that the device states, rad.
    pub std_rad: f64,
}

/// Where the bow (the body's x axis) points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueHeading {
    /// Clockwise from true north seen from above, rad.
    pub heading_rad: f64,
    /// Standard deviation as the sensor states it, rad.
    pub std_rad: Option<f64>,
}

/// Velocity through the water: over ground it differs by the current.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WaterVelocity {
    /// Along the bow, m/s.
    pub forward_m_s: f64,
    /// To starboard, m/s; `None` from a log with one axis.
    pub starboard_m_s: Option<f64>,
}

/// The truth, or the best known stand-in for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// `world_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Whether this instant counts in scores (data sets flag phases without movement as not scored).
    pub scored: bool,
}

/// Makes [`Sample`] and [`SensorKind`] of one table: a row for each sensor, with its place among the events of one
/// instant (sensors first, the reference last, so that an estimate is scored after it has seen everything of that
/// instant), its byte in stored payloads (new kinds are appended), its name for people and files, and what it measures.
macro_rules! sensors {
    ($($(#[$meaning:meta])* $kind:ident = $place:literal, $code:literal, $name:literal: $sample:ident($value:ty),)+) => {
        /// What a sensor measured. Vectors are in body axes unless the variant says otherwise; a value
        /// may be non-finite (readers pass it on, filters refuse and count it).
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[non_exhaustive]
        pub enum Sample {
            $($(#[$meaning])* $sample($value),)+
        }

        /// Which sensor an event belongs to.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[derive(serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
        #[serde(rename_all = "kebab-case")]
        #[non_exhaustive]
        pub enum SensorKind {
            $(#[doc = concat!("[`Sample::", stringify!($sample), "`]")] $kind,)+
        }

        impl SensorKind {
            /// Every kind, in the order in which events of one instant are delivered.
            pub const ALL: [Self; [$($name),+].len()] = {
                let mut all = [Self::Gyroscope; [$($name),+].len()];
                $(all[$place] = Self::$kind;)+
                all
            };

            /// The place of this kind in [`SensorKind::ALL`].
            #[must_use]
            pub const fn order(self) -> usize {
                match self { $(Self::$kind => $place,)+ }
            }

            /// Its byte in stored payloads.
            pub(crate) const fn code(self) -> u8 {
                match self { $(Self::$kind => $code,)+ }
            }

            /// The kind with that byte.
            pub(crate) const fn of_code(code: u8) -> Option<Self> {
                match code { $($code => Some(Self::$kind),)+ _ => None }
            }

            /// The name for people and for files.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name,)+ }
            }
        }

        impl Sample {
            /// The sensor this sample belongs to.
            #[must_use]
            pub const fn kind(&self) -> SensorKind {
                match self { $(Self::$sample(_) => SensorKind::$kind,)+ }
            }
        }
    };
}

sensors! {
    /// Gyroscope: angular rate of the body with respect to the world, rad/s.
    Gyroscope = 0, 0, "gyroscope": AngularRate(Vector3<f64>),
    /// Accelerometer: specific force, m/s^2 (at rest +9.81 on the axis that points up).
    Accelerometer = 1, 1, "accelerometer": SpecificForce(Vector3<f64>),
    /// Magnetometer as the device calibrated it, microtesla.
    Magnetometer = 2, 2, "magnetometer": MagneticField(Vector3<f64>),
    /// Magnetometer without the device's hard-iron calibration, microtesla.
    MagnetometerUncalibrated = 3, 3, "magnetometer-uncalibrated": MagneticFieldUncalibrated(Vector3<f64>),
    /// The device's own estimate of its gyroscope bias, rad/s (uncalibrated rate = rate + bias).
    DeviceGyroscopeBias = 4, 4, "device-gyroscope-bias": DeviceGyroscopeBias(Vector3<f64>),
    /// The device's own orientation, `world_from_body`.
    DeviceOrientation = 5, 5, "device-orientation": DeviceOrientation(UnitQuaternion<f64>),
    /// A reference track to score against (motion capture, simulation truth).
    Reference = 18, 10, "reference": Reference(Reference),
    /// Position in the recording's world frame, m.
    Position = 6, 6, "position": Position(Vector3<f64>),
    /// Velocity in the recording's world frame, m/s.
    Velocity = 7, 7, "velocity": Velocity(Vector3<f64>),
    /// Static pressure, Pa.
    Pressure = 8, 8, "pressure": Pressure(f64),
    /// Heading as the device reports it.
    CompassHeading = 9, 9, "compass-heading": CompassHeading(CompassHeading),
    /// A fix of a satellite navigation receiver.
    GnssPosition = 10, 11, "gnss-position": GnssPosition(GnssPosition),
    /// Velocity over ground of a satellite navigation receiver.
    GnssVelocity = 11, 12, "gnss-velocity": GnssVelocity(GnssVelocity),
    /// Speed over ground along the body's x axis (wheels), m/s; backwards is negative.
    ForwardSpeed = 12, 13, "forward-speed": ForwardSpeed(f64),
    /// Velocity through the water (a ship's log).
    WaterVelocity = 13, 14, "water-velocity": WaterVelocity(WaterVelocity),
    /// Heading from true north (a gyrocompass, two antennas).
    TrueHeading = 14, 15, "true-heading": TrueHeading(TrueHeading),
    /// Where the device itself says that it is. Never fed to a filter.
    DeviceNavigation = 15, 18, "device-navigation": DeviceNavigation(DeviceNavigation),
    /// A position to score against. Never fed to a filter.
    ReferencePosition = 16, 16, "reference-position": ReferencePosition(GnssPosition),
    /// A velocity to score against, north-east-down, m/s; down is NaN where it is not known. Never
    /// fed to a filter.
    ReferenceVelocity = 17, 17, "reference-velocity": ReferenceVelocity(Vector3<f64>),
}

impl SensorKind {
    /// Whether it is something to score against and not a sensor.
    #[must_use]
    pub const fn is_reference(self) -> bool {
        matches!(
            self,
            Self::Reference | Self::ReferencePosition | Self::ReferenceVelocity
        )
    }
}

impl Sample {
    /// Whether every number of the sample is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        match self {
            // A reference may know the horizontal velocity alone.
            Self::ReferenceVelocity(v) => v.x.is_finite() && v.y.is_finite() && !v.z.is_infinite(),
            Self::DeviceOrientation(q) => q.coords.iter().all(|x| x.is_finite()),
            Self::Reference(reference) => reference.attitude.coords.iter().all(|x| x.is_finite()),
            Self::Pressure(x) | Self::ForwardSpeed(x) => x.is_finite(),
            Self::CompassHeading(c) => c.heading_rad.is_finite() && c.std_rad.is_finite(),
            Self::GnssPosition(fix) | Self::ReferencePosition(fix) => fix.is_finite(),
            Self::GnssVelocity(velocity) => velocity.is_finite(),
            Self::DeviceNavigation(estimate) => estimate.row().iter().all(|x| x.is_finite()),
            Self::TrueHeading(h) => {
                h.heading_rad.is_finite() && h.std_rad.is_none_or(f64::is_finite)
            }
            Self::WaterVelocity(w) => {
                w.forward_m_s.is_finite() && w.starboard_m_s.is_none_or(f64::is_finite)
            }
            vector => vector
                .vector()
                .is_some_and(|v| v.iter().all(|x| x.is_finite())),
        }
    }

    /// The vector of a vector sensor; `None` for the other kinds.
    #[must_use]
    pub const fn vector(&self) -> Option<Vector3<f64>> {
        match self {
            Self::AngularRate(v)
            | Self::SpecificForce(v)
            | Self::MagneticField(v)
            | Self::MagneticFieldUncalibrated(v)
            | Self::DeviceGyroscopeBias(v)
            | Self::Position(v)
            | Self::Velocity(v)
            | Self::ReferenceVelocity(v) => Some(*v),
            _ => None,
        }
    }

    /// The sample of a vector sensor; `None` for the kinds that are not vectors.
    pub(crate) const fn from_vector(kind: SensorKind, v: Vector3<f64>) -> Option<Self> {
        Some(match kind {
            SensorKind::Gyroscope => Self::AngularRate(v),
            SensorKind::Accelerometer => Self::SpecificForce(v),
            SensorKind::Magnetometer => Self::MagneticField(v),
            SensorKind::MagnetometerUncalibrated => Self::MagneticFieldUncalibrated(v),
            SensorKind::DeviceGyroscopeBias => Self::DeviceGyroscopeBias(v),
            SensorKind::Position => Self::Position(v),
            SensorKind::Velocity => Self::Velocity(v),
            SensorKind::ReferenceVelocity => Self::ReferenceVelocity(v),
            _ => return None,
        })
    }
}

/// The unit quaternion of four numbers of a file. Numbers that are no rotation (zero, NaN,
/// infinity) give a quaternion of NaN, which counts as a non-finite sample.
pub(crate) fn quaternion_from_file(w: f64, x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
    /// Below this norm the four numbers are no direction but a placeholder.
    const SMALLEST_NORM: f64 = 1e-3;
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    if norm.is_finite() && norm > SMALLEST_NORM {
        UnitQuaternion::new_unchecked(q / norm)
    } else {
        UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, f64::NAN, f64::NAN, f64::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::{Sample, SensorKind, quaternion_from_file};

    #[test]
    fn order_is_the_place_in_all() {
        for (index, kind) in SensorKind::ALL.into_iter().enumerate() {
            assert_eq!(kind.order(), index);
        }
    }

    #[test]
    fn a_quaternion_is_normalised_or_not_finite() {
        let q = quaternion_from_file(2.0, 0.0, 0.0, 0.0);
        approx::assert_relative_eq!(q.angle(), 0.0);
        approx::assert_relative_eq!(q.w, 1.0);
        for bad in [0.0, f64::NAN, f64::INFINITY, 1e300] {
            let sample = Sample::DeviceOrientation(quaternion_from_file(bad, bad, bad, bad));
            assert!(!sample.is_finite(), "{bad}");
        }
    }
}
