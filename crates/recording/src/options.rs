//! What the user may say about a recording: its format, its manifest, units that differ from what
//! the format promises.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// How to open a recording. The default detects everything and checks everything.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenOptions {
    /// The format; default: by content.
    pub format: Option<Format>,
    /// The device (in ROS 2 files the topic) where a file holds several; default: the only one.
    pub device: Option<String>,
    /// A manifest that describes the (text) file; default: `FILE.toml` beside it if needed.
    pub manifest: Option<PathBuf>,
    /// The folder in which the files that a manifest names are; default: the manifest's own.
    pub data: Option<PathBuf>,
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

impl Default for OpenOptions {
    fn default() -> Self {
        Self {
            format: None,
            device: None,
            manifest: None,
            data: None,
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
        named! {
            $(#[$meta])*
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
            pub enum $name {
                $($(#[$doc])* #[serde(rename = $text)] $variant = $text,)+
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }

        impl FromStr for $name {
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

pub(crate) use named;

named_values! {
    /// The formats that can be read.
    Format, "format" {
        /// Parquet with one row per instant (feature `parquet`).
        Parquet = "parquet",
        /// The documented CSV.
        Csv = "csv",
        /// Sensor Logger: folder of CSV files, zip of it, or JSON.
        SensorLogger = "sensor-logger",
        /// MCAP: recordings of the lab, ROS 2 messages (feature `mcap`).
        Mcap = "mcap",
        /// NMEA 0183: a log of sentences.
        Nmea = "nmea",
        /// UBX, the binary protocol of u-blox receivers.
        Ubx = "ubx",
        /// ULog: logs of PX4 autopilots (feature `ulog`).
        Ulog = "ulog",
        /// What a board with our firmware sends.
        NorthingSerial = "northing-serial",
        /// Text files of the program KF-GINS: inertial increments, positions, or a folder with both.
        KfGins = "kf-gins",
        /// Lines `$VNYMR` of VectorNav's sensors.
        VectorNav = "vectornav",
        /// Any other delimited text file, described by a TOML manifest.
        Manifest = "manifest",
    }
}

named_values! {
    /// Unit of angular rates in a file.
    RateUnit, "angular rate unit" {
        /// Radians per second.
        RadPerS = "rad-per-s",
        /// Degrees per second.
        DegPerS = "deg-per-s",
    }
}

named_values! {
    /// Unit of specific force in a file.
    ForceUnit, "specific force unit" {
        /// Metres per second squared.
        MPerS2 = "m-per-s2",
        /// Standard gravity, 9.80665 m/s^2.
        G = "g",
    }
}

named_values! {
    /// Unit of magnetic field in a file.
    FieldUnit, "magnetic field unit" {
        /// Microtesla.
        Microtesla = "microtesla",
        /// Nanotesla.
        Nanotesla = "nanotesla",
        /// Tesla.
        Tesla = "tesla",
        /// Gauss, 100 microtesla.
        Gauss = "gauss",
        /// Milligauss, 0.1 microtesla.
        Milligauss = "milligauss",
    }
}

/// Standard gravity, m/s^2: the exact unit `g` of accelerometers, not the local gravity.
pub(crate) const STANDARD_GRAVITY_M_S2: f64 = 9.80665;

impl RateUnit {
    /// What a number in this unit is multiplied by to become rad/s.
    #[must_use]
    pub const fn to_rad_per_s(self) -> f64 {
        match self {
            Self::RadPerS => 1.0,
            Self::DegPerS => std::f64::consts::PI / 180.0,
        }
    }
}

impl ForceUnit {
    /// What a number in this unit is multiplied by to become m/s^2.
    #[must_use]
    pub const fn to_m_per_s2(self) -> f64 {
        match self {
            Self::MPerS2 => 1.0,
            Self::G => STANDARD_GRAVITY_M_S2,
        }
    }
}

impl FieldUnit {
    /// What a number in this unit is multiplied by to become microtesla.
    #[must_use]
    pub const fn to_microtesla(self) -> f64 {
        match self {
            Self::Microtesla => 1.0,
            Self::Nanotesla => 1e-3,
            Self::Tesla => 1e6,
            Self::Gauss => 100.0,
            Self::Milligauss => 0.1,
        }
    }
}
