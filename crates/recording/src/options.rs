//! What the user may say about a recording: its format, its manifest, units that differ from what
//! the format promises.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::event::SensorKind;
use crate::local_place::LocalPlace;

/// How to open a recording. The default detects everything and checks everything.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenOptions {
    /// The format; default: by content.
    pub format: Option<Format>,
    /// The device (in ROS 2 files the topic) where a file holds several; default: the only one.
    pub device: Option<String>,
    /// Of bags: which topics are read; default: by their types and names.
    pub topics: Option<TopicChoice>,
    /// A manifest that describes the (text) file; default: `FILE.toml` beside it if needed.
    pub manifest: Option<PathBuf>,
    /// The folder in which the files that a manifest names are; default: the manifest's own.
    pub data: Option<PathBuf>,
    /// Whether a table that has no manifest is read as [`crate::describe`] guesses. Default false.
    pub describe: bool,
    /// Another file with the truth: its attitudes, or those that a device told, and its positions become the reference.
    pub reference: Option<PathBuf>,
    /// The unit in which the file's angular rates are, where it is not what the format promises.
    /// Giving it also turns the plausibility check of the gyroscope off.
    pub gyroscope_unit: Option<RateUnit>,
    /// The unit of the file's specific force; giving it turns the plausibility check off.
    pub accelerometer_unit: Option<ForceUnit>,
    /// The unit of the file's magnetic field; giving it turns the plausibility check off.
    pub magnetometer_unit: Option<FieldUnit>,
    /// A pause of the gyroscope longer than this is counted as a gap, s. Default 0.5.
    pub gap_limit_s: f64,
    /// Whether to look for degrees in place of radians, g in place of m/s^2 and the like. Default true.
    pub plausibility: bool,
}

/// Which topics of a bag are read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TopicChoice {
    /// The topic of each sensor, and then no other one. Default: by their types and names.
    pub of_sensor: Option<BTreeMap<SensorKind, String>>,
    /// The topic of poses whose positions are fixes, and where they count from.
    pub local_position: Option<(String, LocalPlace)>,
}

impl Default for OpenOptions {
    fn default() -> Self {
        Self {
            format: None,
            device: None,
            topics: None,
            manifest: None,
            data: None,
            describe: false,
            reference: None,
            gyroscope_unit: None,
            accelerometer_unit: None,
            magnetometer_unit: None,
            gap_limit_s: 0.5,
            plausibility: true,
        }
    }
}

/// Makes an enum whose values have one name each.
macro_rules! named {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[$doc:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$meta])*
        #[non_exhaustive]
        pub enum $name {
            $($(#[$doc])* $variant,)+
        }

        impl $name {
            /// Every value.
            pub const ALL: [Self; [$($text),+].len()] = [$(Self::$variant),+];

            /// The name on the command line and in files.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)+ }
            }
        }
    };
}

/// The same for the command line, for TOML and for people.
macro_rules! named_values {
    ($(#[$meta:meta])* $name:ident, $what:literal { $($(#[$doc:meta])* $variant:ident = $text:literal,)+ }) => {
        $crate::options::named! {
            $(#[$meta])*
            #[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
            pub enum $name {
                $($(#[$doc])* #[serde(rename = $text)] $variant = $text,)+
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $name {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                match text {
                    $($text => Ok(Self::$variant),)+
                    _ => Err(format!(
                        concat!("unknown ", $what, " `{}`; expected one of: {}"),
                        text,
                        [$($text),+].join(", "),
                    )),
                }
            }
        }
    };
}

named_values! {
    /// The formats that can be read.
    Format, "format" {
        /// Parquet with one row per instant (feature `parquet`).
        Parquet = "parquet",
        /// The documented CSV.
        Csv = "csv",
        /// Sensor Logger: folder of CSV files, zip of it, or JSON.
        SensorLogger = "sensor-logger",
        /// A table of phyphox; its zips and folders are told by content.
        Phyphox = "phyphox",
        /// MCAP: recordings of the lab, ROS 2 messages; and bags of ROS 1 and in SQLite (feature `mcap`).
        Mcap = "mcap",
        /// NMEA 0183: a log of sentences.
        Nmea = "nmea",
        /// UBX, the binary protocol of u-blox receivers.
        Ubx = "ubx",
        /// ULog: logs of PX4 autopilots (feature `ulog`).
        Ulog = "ulog",
        /// DataFlash: logs of ArduPilot (feature `ardupilot`).
        ArduPilot = "ardupilot",
        /// What a board with our firmware sends.
        NorthingSerial = "northing-serial",
        /// Text files of the program KF-GINS: inertial increments, positions, or a folder with both.
        KfGins = "kf-gins",
        /// Solutions of RTKLIB (`.pos`).
        Rtklib = "rtklib",
        /// A trajectory in TUM form: attitudes to score against.
        Tum = "tum",
        /// Tracks in GPX.
        Gpx = "gpx",
        /// A table of EuRoC; its folders are told by content.
        Euroc = "euroc",
        /// Lines `$VNYMR` of VectorNav's sensors.
        VectorNav = "vectornav",
        /// A file of the x-IMU3's data logger, or a table of its software; its folders are told by content.
        XImu3 = "x-imu3",
        /// Any other delimited text file, described by a TOML manifest.
        Manifest = "manifest",
    }
}

/// A unit in files: a named value, with what a number in it is multiplied by.
macro_rules! units {
    ($(#[$meta:meta])* $name:ident, $what:literal, $to:ident { $($(#[$doc:meta])* $variant:ident = $text:literal => $factor:expr,)+ }) => {
        $crate::options::named_values! {
            $(#[$meta])*
            $name, $what { $($(#[$doc])* $variant = $text,)+ }
        }

        impl $name {
            /// What a number in this unit is multiplied by.
            #[must_use]
            pub const fn $to(self) -> f64 {
                match self { $(Self::$variant => $factor,)+ }
            }
        }
    };
}

pub(crate) use {named, named_values, units};

/// One knot, m/s.
pub(crate) const KNOT: f64 = 1852.0 / 3600.0;
/// Degrees as radians.
pub(crate) const DEGREE: f64 = std::f64::consts::PI / 180.0;

units! {
    /// Unit of angular rates in a file.
    RateUnit, "angular rate unit", to_rad_per_s {
        /// Radians per second.
        RadPerS = "rad-per-s" => 1.0,
        /// Degrees per second.
        DegPerS = "deg-per-s" => DEGREE,
    }
}

units! {
    /// Unit of specific force in a file.
    ForceUnit, "specific force unit", to_m_per_s2 {
        /// Metres per second squared.
        MPerS2 = "m-per-s2" => 1.0,
        /// Standard gravity, 9.80665 m/s^2.
        G = "g" => STANDARD_GRAVITY_M_S2,
    }
}

units! {
    /// Unit of magnetic field in a file.
    FieldUnit, "magnetic field unit", to_microtesla {
        /// Microtesla.
        Microtesla = "microtesla" => 1.0,
        /// Nanotesla.
        Nanotesla = "nanotesla" => 1e-3,
        /// Tesla.
        Tesla = "tesla" => 1e6,
        /// Millitesla, 1000 microtesla.
        Millitesla = "millitesla" => 1e3,
        /// Gauss, 100 microtesla.
        Gauss = "gauss" => 100.0,
        /// Milligauss, 0.1 microtesla.
        Milligauss = "milligauss" => 0.1,
    }
}

/// Standard gravity, m/s^2: the exact unit `g` of accelerometers, not the local gravity.
pub(crate) const STANDARD_GRAVITY_M_S2: f64 = 9.80665;
