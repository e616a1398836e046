//! Normal gravity of WGS-84 and the rotation of the Earth, in north-east-down axes.
//!
//! *Read first:* NGA.STND.0036 (2014), eq. 4-1 (Somigliana's closed form on the ellipsoid) and eq. 4-3 (its
//! change with height). Real gravity differs by up to some 0.0005 m/s^2 (anomalies) and by some 0.005 degrees in
//! direction, far below the bias of the sensors this serves.

use nalgebra::Vector3;

use super::wgs84::{ECCENTRICITY_SQUARED, FLATTENING, SEMI_MAJOR_AXIS_M};

/// Normal gravity at the equator, m/s^2.
const EQUATOR_M_S2: f64 = 9.780_325_335_9;
/// `k = (b g_pole)/(a g_equator) - 1`.
const SOMIGLIANA: f64 = 0.001_931_852_652_41;
/// `m = omega^2 a^2 b / GM`.
const CENTRIFUGAL_RATIO: f64 = 0.003_449_786_506_84;
/// Angular rate of the Earth, rad/s.
pub const EARTH_RATE_RAD_S: f64 = 7.292_115e-5;

/// Gravity (m/s^2, centrifugal part included) at a latitude (rad) and height above the ellipsoid (m), down along
/// the ellipsoid's normal. Good to 1e-6 m/s^2 up to 10 km, usable to 100 km.
pub fn normal_gravity(latitude_rad: f64, height_m: f64) -> f64 {
    let sin = libm::sin(latitude_rad);
    let sin2 = sin * sin;
    let on_ellipsoid =
        EQUATOR_M_S2 * (1.0 + SOMIGLIANA * sin2) / libm::sqrt(1.0 - ECCENTRICITY_SQUARED * sin2);
    let h = height_m / SEMI_MAJOR_AXIS_M;
    let slope = 1.0 + FLATTENING + CENTRIFUGAL_RATIO - 2.0 * FLATTENING * sin2;
    on_ellipsoid * (1.0 - 2.0 * slope * h + 3.0 * h * h)
}

/// The Earth's angular rate (rad/s) in north, east and down axes at a latitude (rad).
pub fn earth_rate_ned(latitude_rad: f64) -> Vector3<f64> {
    let (sin, cos) = libm::sincos(latitude_rad);
    Vector3::new(EARTH_RATE_RAD_S * cos, 0.0, -EARTH_RATE_RAD_S * sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn gravity_has_the_published_values() {
        // NGA.STND.0036, tables 3.6 and 4.1: equator, pole, and the value at 45 degrees.
        let pole = core::f64::consts::FRAC_PI_2;
        assert_relative_eq!(normal_gravity(0.0, 0.0), 9.780_325_335_9, epsilon = 1e-10);
        assert_relative_eq!(normal_gravity(pole, 0.0), 9.832_184_937_9, epsilon = 1e-8);
        assert_relative_eq!(
            normal_gravity(pole / 2.0, 0.0),
            9.806_197_769,
            epsilon = 1e-7
        );
    }

    #[test]
    fn gravity_falls_by_three_micrometres_a_second_squared_each_metre() {
        let slope = (normal_gravity(0.8, 1000.0) - normal_gravity(0.8, 0.0)) / 1000.0;
        assert_relative_eq!(slope, -3.086e-6, epsilon = 2e-9);
    }

    #[test]
    fn the_earth_turns_once_in_a_sidereal_day() {
        let rate = earth_rate_ned(0.7);
        let day_s = core::f64::consts::TAU / rate.norm();
        assert_relative_eq!(day_s, 86_164.1, epsilon = 0.1);
        assert!(rate.x > 0.0 && rate.z < 0.0, "north and up in the north");
        assert!(earth_rate_ned(-0.7).z > 0.0);
    }
}
