//! Where a device itself says that it is: the estimate of a navigation filter that ran on the device.

use northing_core::navigation::Validity;

/// The device's own position and velocity, and how sure it says that they are. Its orientation at the same
/// instant is a sample of its own. Geodetic, WGS-84.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceNavigation {
    /// Geodetic latitude, north positive, rad.
    pub latitude_rad: f64,
    /// Longitude, east positive, rad.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
    /// Standard deviations north, east and down as the device states them, m.
    pub std_m: [f64; 3],
    /// Velocity north, east and down, m/s.
    pub velocity_m_s: [f64; 3],
    /// Standard deviation of the heading as the device states it, rad.
    pub heading_std_rad: f64,
    /// What the device says that the position is worth.
    pub validity: Validity,
}

impl DeviceNavigation {
    /// How many numbers it is made of.
    pub(crate) const NUMBERS: usize = 11;

    /// As a row of numbers: in the order of the fields, the validity last (0 aligning, 1 aided, 2 dead
    /// reckoning, 3 invalid, 4 aided with the heading unknown).
    pub(crate) fn row(&self) -> [f64; Self::NUMBERS] {
        let place = [self.latitude_rad, self.longitude_rad, self.height_m];
        let mut row = [0.0; Self::NUMBERS];
        row[..3].copy_from_slice(&place);
        row[3..6].copy_from_slice(&self.std_m);
        row[6..9].copy_from_slice(&self.velocity_m_s);
        row[9..].copy_from_slice(&[
            self.heading_std_rad,
            f64::from(validity_number(self.validity)),
        ]);
        row
    }

    /// From such a row; a validity that is none of those is invalid.
    pub(crate) fn from_row(row: [f64; Self::NUMBERS]) -> Self {
        let three = |first| std::array::from_fn(|i| row[first + i]);
        let [latitude_rad, longitude_rad, height_m] = three(0);
        Self {
            latitude_rad,
            longitude_rad,
            height_m,
            std_m: three(3),
            velocity_m_s: three(6),
            heading_std_rad: row[9],
            validity: (0..=4)
                .find(|number| (f64::from(*number) - row[10]).abs() < 1e-6)
                .map_or(Validity::Invalid, validity_of),
        }
    }

    /// Whether every number is finite and the place is one on the Earth.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        use std::f64::consts::{FRAC_PI_2, TAU};
        self.row().iter().all(|x| x.is_finite())
            && self.latitude_rad.abs() <= FRAC_PI_2
            && self.longitude_rad.abs() <= TAU
    }
}

/// The states of a solution by their number in files and on the wire.
const VALIDITIES: [Validity; 5] = [
    Validity::Aligning,
    Validity::Aided,
    Validity::DeadReckoning,
    Validity::Invalid,
    Validity::HeadingUnknown,
];

/// The number of a state: 0 aligning, 1 aided, 2 dead reckoning, 3 invalid, 4 aided with the heading unknown.
#[must_use]
pub fn validity_number(validity: Validity) -> u8 {
    let place = VALIDITIES.iter().position(|known| *known == validity);
    place
        .and_then(|place| u8::try_from(place).ok())
        .unwrap_or(3)
}

/// What a position is worth, in a word.
#[must_use]
pub fn validity_word(validity: Validity) -> &'static str {
    match validity {
        Validity::Aligning => "aligning",
        Validity::HeadingUnknown => "heading-unknown",
        Validity::Aided => "aided",
        Validity::DeadReckoning => "dead-reckoning",
        Validity::Invalid => "invalid",
    }
}

/// What a number stands for; any other is invalid.
pub(crate) fn validity_of(number: u8) -> Validity {
    let known = VALIDITIES.get(usize::from(number));
    known.copied().unwrap_or(Validity::Invalid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_comes_back_from_its_row_with_every_validity() {
        for number in 0..5 {
            let estimate = DeviceNavigation {
                latitude_rad: 0.9,
                longitude_rad: -0.4,
                height_m: 176.5,
                std_m: [1.0, 2.0, 3.0],
                velocity_m_s: [0.1, -0.2, 0.3],
                heading_std_rad: 0.05,
                validity: validity_of(number),
            };
            assert_eq!(DeviceNavigation::from_row(estimate.row()), estimate);
            assert!(estimate.is_usable());
            let row = estimate.row();
            assert_eq!(row[10] as u8, number);
            for place in 0..row.len() {
                let mut bad = row;
                bad[place] = f64::NAN;
                let usable = DeviceNavigation::from_row(bad).is_usable();
                assert_eq!(usable, place == 10, "{place}");
            }
        }
        assert_eq!(validity_of(9), Validity::Invalid);
    }
}
