//! The keys of a manifest for satellite receivers, speeds, headings and reference tracks.

use serde::Deserialize;

use super::schema::{Column, QuaternionDirection, QuaternionOrder};
use crate::options::{DEGREE, KNOT, units};

/// The columns of position fixes.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionColumns {
    /// Geodetic latitude, north positive.
    pub latitude: Column,
    /// Longitude, east positive.
    pub longitude: Column,
    /// Unit of the two. Default `deg`.
    #[serde(default)]
    pub unit: CoordinateUnit,
    /// Height above the ellipsoid, or above the geoid where that is all there is.
    pub height: Option<Column>,
    /// Unit of the height. Default `m`.
    #[serde(default)]
    pub height_unit: HeightUnit,
    /// Standard deviations north, east and vertical, m.
    pub std: Option<[Column; 3]>,
    /// In place of `std`: the radius that the fix is within with 68 %, and the vertical standard
    /// deviation, m. A standard deviation along one axis is the radius divided by the root of 2. Where
    /// the radius is alone, the vertical standard deviation is 1.7 times it.
    pub accuracy: Option<Vec<Column>>,
    /// Unit of `std` or `accuracy`. Default `m`.
    #[serde(default)]
    pub accuracy_unit: HeightUnit,
    /// Horizontal dilution of precision.
    pub hdop: Option<Column>,
    /// Satellites used.
    pub satellites: Option<Column>,
    /// Kind of fix.
    pub quality: Option<Column>,
    /// Whose numbers those of `quality` are. Default `gga`.
    #[serde(default)]
    pub quality_code: QualityCode,
}

units! {
    /// Unit of latitude and longitude in a file.
    #[derive(Default)]
    CoordinateUnit, "unit of coordinates", to_rad {
        /// Degrees.
        #[default]
        Degrees = "deg" => DEGREE,
        /// Radians.
        Radians = "rad" => 1.0,
        /// Ten-millionths of a degree, an integer.
        TenMillionths = "1e-7-deg" => DEGREE * 1e-7,
        /// A hundred times the degrees plus the minutes, as NMEA writes them: 4841.9998 is 48 degrees and 41.9998 minutes. What
        /// it is once it is taken apart, degrees, is multiplied.
        DegreesMinutes = "deg-min" => DEGREE,
    }
}

units! {
    /// Unit of heights in a file.
    #[derive(Default)]
    HeightUnit, "unit of heights", to_m {
        /// Metres.
        #[default]
        M = "m" => 1.0,
        /// Millimetres.
        Mm = "mm" => 1e-3,
        /// Feet.
        Ft = "ft" => 0.3048,
    }
}

/// Whose numbers tell the kind of a fix.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum QualityCode {
    /// NMEA's GGA: 0 invalid, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float, 6 estimated.
    #[default]
    Gga,
    /// RTKLIB: 1 fixed, 2 float, 3 satellite corrections, 4 differential, 5 single, 6 precise point.
    Rtklib,
}

/// The columns of a velocity over ground: `columns`, or `speed` and `course`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VelocityColumns {
    /// Three components in the order of `axes`, in `speed_unit`.
    pub columns: Option<[Column; 3]>,
    /// What they are. Default `ned`.
    #[serde(default)]
    pub axes: VelocityAxes,
    /// Their standard deviations in the same order, in `speed_unit`.
    pub std: Option<[Column; 3]>,
    /// Speed over ground.
    pub speed: Option<Column>,
    /// Unit of the speed or the components. Default `m-per-s`.
    #[serde(default)]
    pub speed_unit: SpeedUnit,
    /// Standard deviation of the speed, in the speed's unit.
    pub speed_std: Option<Column>,
    /// Course over ground, clockwise from true north.
    pub course: Option<Column>,
    /// Unit of the course. Default `deg`.
    #[serde(default)]
    pub course_unit: AngleUnit,
}

/// The order and sense of the components of a velocity or a position.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VelocityAxes {
    /// North, east, down.
    #[default]
    Ned,
    /// East, north, up.
    Enu,
    /// North, east, up.
    Neu,
}

impl VelocityAxes {
    /// Which of north, east, down each component is.
    pub(crate) const fn order(self) -> [usize; 3] {
        match self {
            Self::Ned | Self::Neu => [0, 1, 2],
            Self::Enu => [1, 0, 2],
        }
    }

    /// What the vertical component is multiplied by to point down.
    pub(crate) const fn down(self) -> f64 {
        match self {
            Self::Ned => 1.0,
            Self::Neu | Self::Enu => -1.0,
        }
    }

    /// Components in the order north, east, down, the third one times `vertical`.
    pub(crate) fn to_ned(self, components: [f64; 3], vertical: f64) -> [f64; 3] {
        let [north, east, down] = self.order();
        // Both orders are their own inverse.
        [
            components[north],
            components[east],
            components[down] * vertical,
        ]
    }
}

units! {
    /// Unit of speeds in a file.
    #[derive(Default)]
    SpeedUnit, "unit of speeds", to_m_per_s {
        /// Metres per second.
        #[default]
        MPerS = "m-per-s" => 1.0,
        /// Knots, 1852 m in an hour.
        Knots = "knots" => KNOT,
        /// Kilometres per hour.
        KmPerH = "km-per-h" => 1000.0 / 3600.0,
        /// Centimetres per second.
        CmPerS = "cm-per-s" => 1e-2,
        /// Millimetres per second.
        MmPerS = "mm-per-s" => 1e-3,
    }
}

units! {
    /// Unit of angles in a file.
    #[derive(Default)]
    AngleUnit, "unit of angles", to_rad {
        /// Degrees.
        #[default]
        Deg = "deg" => DEGREE,
        /// Radians.
        Rad = "rad" => 1.0,
    }
}

/// The columns of positions in metres from a place: of motion capture, a total station or a local grid.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LocalColumns {
    /// Of a table: three components in the order of `axes`, m, along the level axes at the origin.
    pub columns: Option<[Column; 3]>,
    /// Of a bag, in place of `columns`: the topic of poses (`PoseStamped`, `PoseWithCovarianceStamped`, `Odometry`).
    pub topic: Option<String>,
    /// What they are. Default `enu`.
    #[serde(default = "enu")]
    pub axes: VelocityAxes,
    /// Where they count from.
    pub origin: Origin,
    /// Their standard deviations in the same order, m: columns.
    pub std: Option<[Column; 3]>,
    /// In place of `std`, or of what the messages state: numbers that hold for all of them.
    pub std_m: Option<[f64; 3]>,
}

const fn enu() -> VelocityAxes {
    VelocityAxes::Enu
}

/// A place on the Earth.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Geodetic latitude, north positive.
    pub latitude_deg: f64,
    /// Longitude, east positive.
    pub longitude_deg: f64,
    /// Height above the ellipsoid.
    pub height_m: f64,
}

/// The columns of a ship's log.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaterColumns {
    /// Speed through the water along the bow.
    pub forward: Column,
    /// Speed to starboard.
    pub starboard: Option<Column>,
    /// Unit of both. Default `m-per-s`.
    #[serde(default)]
    pub unit: SpeedUnit,
}

/// The columns of a heading.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeadingColumn {
    /// Which column.
    pub column: Column,
    /// Its standard deviation.
    pub std: Option<Column>,
    /// Unit of both. Default `deg`.
    #[serde(default)]
    pub unit: AngleUnit,
}

/// The columns of a reference track in Earth-centred, Earth-fixed coordinates.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EcefColumns {
    /// Position, m.
    pub position_m: [Column; 3],
    /// Velocity, m/s.
    pub velocity_m_s: Option<[Column; 3]>,
    /// Attitude: a quaternion between the body (forward, right, down) and the Earth-centred axes.
    pub attitude: Option<[Column; 4]>,
    /// Order of the quaternion's numbers. Default `wxyz`.
    #[serde(default)]
    pub order: QuaternionOrder,
    /// What it does to a vector; "world" are the Earth-centred axes. Default `body-to-world`.
    #[serde(default)]
    pub direction: QuaternionDirection,
}
