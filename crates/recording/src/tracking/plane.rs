//! Latitude and longitude to north and east of a local plane.

/// A local plane that touches the WGS-84 ellipsoid at its origin; good to a metre within 10 km.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields)]
pub struct LocalPlane {
    /// Latitude of the origin, deg.
    pub latitude_deg: f64,
    /// Longitude of the origin, deg.
    pub longitude_deg: f64,
}

impl LocalPlane {
    /// North and east of a position, m.
    #[must_use]
    pub fn place(&self, latitude_deg: f64, longitude_deg: f64) -> (f64, f64) {
        let [meridian, parallel] = self.radii();
        let dlon = (longitude_deg - self.longitude_deg + 540.0).rem_euclid(360.0) - 180.0;
        let dlat = (latitude_deg - self.latitude_deg).to_radians();
        (meridian * dlat, parallel * dlon.to_radians())
    }

    /// Latitude and longitude (deg, within 180) of north and east, m.
    #[must_use]
    pub fn degrees(&self, north_m: f64, east_m: f64) -> [f64; 2] {
        let [meridian, parallel] = self.radii();
        let longitude = self.longitude_deg + (east_m / parallel).to_degrees();
        [
            self.latitude_deg + (north_m / meridian).to_degrees(),
            (longitude + 180.0).rem_euclid(360.0) - 180.0,
        ]
    }

    /// Metres of a radian of latitude and of longitude.
    fn radii(&self) -> [f64; 2] {
        /// WGS-84 semi-major axis, m, and first eccentricity squared.
        const A: f64 = 6_378_137.0;
        const E2: f64 = 6.694_379_990_14e-3;
        let (sin, cos) = self.latitude_deg.to_radians().sin_cos();
        let w2 = 1.0 - E2 * sin * sin;
        [A * (1.0 - E2) / (w2 * w2.sqrt()), A / w2.sqrt() * cos]
    }

    /// Whether the origin is a place on Earth where east exists.
    pub(super) fn is_valid(&self) -> bool {
        self.latitude_deg.abs() < 89.0 && self.longitude_deg.abs() <= 360.0
    }
}

#[cfg(test)]
mod tests {
    use super::LocalPlane;

    #[test]
    fn a_minute_of_latitude_is_a_nautical_mile_and_the_date_line_is_no_wall() {
        let plane = LocalPlane {
            latitude_deg: 45.0,
            longitude_deg: 179.99,
        };
        let (north, east) = plane.place(45.0 + 1.0 / 60.0, -179.99);
        assert!((north - 1852.0).abs() < 1.0, "{north}");
        // one degree of longitude at 45 degrees is 78 846.8 m
        assert!((east - 0.02 * 78_846.8).abs() < 0.1, "{east}");
        let [latitude, longitude] = plane.degrees(north, east);
        assert!((latitude - 45.0 - 1.0 / 60.0).abs() < 1e-12, "{latitude}");
        assert!((longitude + 179.99).abs() < 1e-12, "{longitude}");
    }
}
