//! The world around the simulated body: gravity and the magnetic field, in east, north, up.

use nalgebra::Vector3;

use crate::rotation::sin_cos;

/// Standard gravity, m/s^2: what an accelerometer at rest shows on the axis that points up.
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// The specific force at rest, m/s^2: standard gravity on the axis that points up.
#[must_use]
pub fn specific_force_at_rest() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, STANDARD_GRAVITY_M_S2)
}

/// A field of this strength that points to magnetic north and `dip_deg` degrees below the horizon,
/// microtesla.
#[must_use]
pub fn magnetic_field_ut(strength_ut: f64, dip_deg: f64) -> Vector3<f64> {
    let (sin_dip, cos_dip) = sin_cos(dip_deg.to_radians());
    Vector3::new(0.0, strength_ut * cos_dip, -strength_ut * sin_dip)
}

/// The field unless something else is asked for: 43 microtesla, 51 degrees below the horizon, as in
/// the mid latitudes of the north.
#[must_use]
pub fn default_magnetic_field_ut() -> Vector3<f64> {
    magnetic_field_ut(43.0, 51.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_points_north_and_down_with_its_strength() {
        let field = default_magnetic_field_ut();
        assert!((field.norm() - 43.0).abs() < 1e-12);
        // 43 cos 51 deg and 43 sin 51 deg.
        assert!((field - Vector3::new(0.0, 27.060_78, -33.417_28)).norm() < 1e-4);
        let south = magnetic_field_ut(50.0, -90.0);
        assert!((south - Vector3::new(0.0, 0.0, 50.0)).norm() < 1e-12);
    }
}
