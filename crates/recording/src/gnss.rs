//! Satellite navigation as samples: a position on the ellipsoid, a velocity over ground, and how far
//! the receiver itself trusts them.

/// The standard deviation of a height over the radius that the fix is within with 68 %, where only that is known: satellites
/// are seen on one side only.
pub const VERTICAL_OF_HORIZONTAL: f64 = 1.7;

/// A position fix. Geodetic, WGS-84.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GnssPosition {
    /// Geodetic latitude, north positive, rad.
    pub latitude_rad: f64,
    /// Longitude, east positive, rad.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m; above the geoid where the receiver does not tell the
    /// difference of the two. `None` when the receiver does not observe it (a 2-D fix).
    pub height_m: Option<f64>,
    /// Standard deviations north, east and down as the receiver states them, m.
    pub std_m: Option<[f64; 3]>,
    /// Horizontal dilution of precision.
    pub hdop: Option<f64>,
    /// Satellites used.
    pub satellites: Option<u8>,
    /// What kind of fix it is.
    pub quality: GnssQuality,
}

/// A velocity over ground, north-east-down.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GnssVelocity {
    /// Towards true north, m/s.
    pub north_m_s: f64,
    /// Towards east, m/s.
    pub east_m_s: f64,
    /// Downwards, m/s; `None` when the receiver tells only speed and course.
    pub down_m_s: Option<f64>,
    /// Standard deviations north, east and down as the receiver states them, m/s.
    pub std_m_s: Option<[f64; 3]>,
}

/// The kind of a fix. The numbers are those of the quality field of NMEA's GGA where it has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum GnssQuality {
    /// The receiver calls it invalid, or it was typed in by hand. Never to be used.
    Invalid,
    /// One receiver alone.
    Autonomous,
    /// With corrections of a reference station or of satellites.
    Differential,
    /// Carrier phase, ambiguities fixed: centimetres.
    RtkFixed,
    /// Carrier phase, ambiguities not fixed: decimetres.
    RtkFloat,
    /// Dead reckoning of the receiver, without enough satellites: not a measurement of its own.
    Estimated,
    /// The source does not say.
    #[default]
    Unknown,
}

impl GnssQuality {
    /// The quality of a number in GGA: 0 invalid, 1 autonomous, 2 differential, 3 precise (as
    /// autonomous), 4 RTK fixed, 5 RTK float, 6 estimated, 7 typed in by hand (as invalid);
    /// anything else unknown.
    #[must_use]
    pub const fn from_gga(number: u8) -> Self {
        match number {
            0 | 7 => Self::Invalid,
            1 | 3 => Self::Autonomous,
            2 => Self::Differential,
            4 => Self::RtkFixed,
            5 => Self::RtkFloat,
            6 => Self::Estimated,
            _ => Self::Unknown,
        }
    }

    /// The number of GGA; `None` for [`Self::Unknown`].
    #[must_use]
    pub const fn to_gga(self) -> Option<u8> {
        match self {
            Self::Invalid => Some(0),
            Self::Autonomous => Some(1),
            Self::Differential => Some(2),
            Self::RtkFixed => Some(4),
            Self::RtkFloat => Some(5),
            Self::Estimated => Some(6),
            Self::Unknown => None,
        }
    }
}

impl GnssPosition {
    /// Whether latitude and longitude are both exactly 0, as tables and receivers write where they have no fix. (A receiver that
    /// crosses the place on the equator would have to hit it to all digits.)
    #[must_use]
    pub fn is_at_zero(&self) -> bool {
        self.latitude_rad == 0.0 && self.longitude_rad == 0.0
    }

    /// Whether it may be used as a measurement: not [`GnssQuality::Invalid`] nor
    /// [`GnssQuality::Estimated`], on the Earth and not [at zero](Self::is_at_zero), and every number that is there is finite.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        use std::f64::consts::{FRAC_PI_2, TAU};
        !matches!(self.quality, GnssQuality::Invalid | GnssQuality::Estimated)
            && self.is_finite()
            && !self.is_at_zero()
            && self.latitude_rad.abs() <= FRAC_PI_2
            && self.longitude_rad.abs() <= TAU
    }

    /// Whether every number that is there is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.latitude_rad.is_finite()
            && self.longitude_rad.is_finite()
            && self.height_m.is_none_or(f64::is_finite)
            && self
                .std_m
                .is_none_or(|std| std.iter().all(|x| x.is_finite()))
            && self.hdop.is_none_or(f64::is_finite)
    }
}

impl GnssVelocity {
    /// The velocity of a speed over ground (m/s) and a course (rad, clockwise from true north).
    #[must_use]
    pub fn from_course(speed_m_s: f64, course_rad: f64) -> Self {
        let (sin, cos) = course_rad.sin_cos();
        Self {
            north_m_s: speed_m_s * cos,
            east_m_s: speed_m_s * sin,
            down_m_s: None,
            std_m_s: None,
        }
    }

    /// Whether every component that is there is exactly 0.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        let down = self.down_m_s.unwrap_or(0.0);
        [self.north_m_s, self.east_m_s, down]
            .iter()
            .all(|x| *x == 0.0)
    }

    /// Whether every number that is there is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.north_m_s.is_finite()
            && self.east_m_s.is_finite()
            && self.down_m_s.is_none_or(f64::is_finite)
            && self
                .std_m_s
                .is_none_or(|std| std.iter().all(|x| x.is_finite()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fix(quality: GnssQuality) -> GnssPosition {
        GnssPosition {
            latitude_rad: 0.7,
            longitude_rad: -1.8,
            height_m: None,
            std_m: None,
            hdop: None,
            satellites: None,
            quality,
        }
    }

    #[test]
    fn what_the_receiver_calls_invalid_is_never_usable() {
        for number in 0..=u8::MAX {
            let usable = fix(GnssQuality::from_gga(number)).is_usable();
            assert_eq!(usable, !matches!(number, 0 | 6 | 7), "{number}");
        }
        let good = fix(GnssQuality::Autonomous);
        let bad = [
            GnssPosition {
                latitude_rad: 1.6,
                ..good
            },
            GnssPosition {
                longitude_rad: 6.3,
                ..good
            },
            GnssPosition {
                latitude_rad: 0.0,
                longitude_rad: -0.0,
                ..good
            },
            GnssPosition {
                latitude_rad: f64::NAN,
                ..good
            },
            GnssPosition {
                height_m: Some(f64::INFINITY),
                ..good
            },
            GnssPosition {
                std_m: Some([1.0, f64::NAN, 1.0]),
                ..good
            },
        ];
        assert!(bad.iter().all(|fix| !fix.is_usable()));
    }

    #[test]
    fn the_numbers_of_gga_come_back() {
        for number in [0, 1, 2, 4, 5, 6] {
            assert_eq!(GnssQuality::from_gga(number).to_gga(), Some(number));
        }
        assert_eq!(GnssQuality::from_gga(9).to_gga(), None);
    }

    #[test]
    fn a_course_is_clockwise_from_north() {
        let east = GnssVelocity::from_course(2.0, std::f64::consts::FRAC_PI_2);
        approx::assert_abs_diff_eq!(east.north_m_s, 0.0, epsilon = 1e-12);
        approx::assert_relative_eq!(east.east_m_s, 2.0);
    }
}
