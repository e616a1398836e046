//! Magnetic declination of a place: the World Magnetic Model, so that a magnetometer's north becomes the true one.

use northing_core::earth::wgs84::Geodetic;
use world_magnetic_model::GeomagneticField;
use world_magnetic_model::time::{Date, OffsetDateTime};
use world_magnetic_model::uom::si::angle::radian;
use world_magnetic_model::uom::si::f32::{Angle, Length};
use world_magnetic_model::uom::si::length::meter;

/// Years that the model has coefficients for; other dates take the nearest of them, a tenth of a degree a year off.
const YEARS: [i32; 2] = [2020, 2029];
/// Stamps before this (ns, the year 2000) count from somewhere else: the time of the model's last issue is taken.
const LEAST_UNIX_NS: i64 = 946_684_800_000_000_000;

/// Declination (rad, east positive) of a place at a stamp (ns; of Unix time where it can be that). `None` where a compass
/// is of no use: within some 1,500 km of the magnetic poles, or far above the ground.
#[must_use]
pub fn declination(place: &Geodetic, time_ns: i64) -> Option<f64> {
    let field = GeomagneticField::new(
        Length::new::<meter>(place.height_m as f32),
        Angle::new::<radian>(place.latitude_rad as f32),
        Angle::new::<radian>(place.longitude_rad as f32),
        date(time_ns)?,
    )
    .ok()?;
    let useless = field.declination_warning().is_some();
    (!useless).then(|| f64::from(field.declination().get::<radian>()))
}

fn date(time_ns: i64) -> Option<Date> {
    let [first, last] = YEARS;
    if time_ns < LEAST_UNIX_NS {
        return Date::from_ordinal_date(2025, 1).ok();
    }
    let date = OffsetDateTime::from_unix_timestamp_nanos(i128::from(time_ns))
        .ok()?
        .date();
    let nearest = date.year().clamp(first, last);
    if nearest == date.year() {
        return Some(date);
    }
    let day = if nearest == first { 1 } else { 365 };
    Date::from_ordinal_date(nearest, day).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees([latitude, longitude]: [f64; 2], time_ns: i64) -> Option<f64> {
        let place = Geodetic {
            latitude_rad: latitude.to_radians(),
            longitude_rad: longitude.to_radians(),
            height_m: 0.0,
        };
        declination(&place, time_ns).map(f64::to_degrees)
    }

    /// NOAA's test values of WMM2025 at 2025.0 on the ellipsoid.
    #[test]
    fn declinations_are_those_that_noaa_publishes() {
        let year_2025 = 1_735_689_600_000_000_000;
        for (place, published) in [
            ([80.0, 0.0], 1.28),
            ([0.0, 120.0], -0.16),
            ([-80.0, -120.0], 68.78),
        ] {
            let ours = degrees(place, year_2025).unwrap();
            assert!((ours - published).abs() < 0.01, "{ours} {published}");
        }
    }

    #[test]
    fn stamps_of_no_date_and_of_other_years_take_the_nearest() {
        let boston = |time_ns| degrees([42.34, -71.09], time_ns).unwrap();
        assert!((boston(0) + 14.0).abs() < 0.5, "{}", boston(0));
        // 2014 and 2040.
        for time_ns in [1_406_851_200_000_000_000, 2_208_988_800_000_000_000] {
            assert!((boston(time_ns) + 14.0).abs() < 1.0, "{}", boston(time_ns));
        }
        assert_eq!(degrees([86.0, 139.0], 0), None, "the pole itself");
    }
}
