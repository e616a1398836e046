//! Positions on the WGS-84 ellipsoid: geodetic, Earth-centred Earth-fixed (ECEF), local north-east-down.
//!
//! *Read first:* NGA.STND.0036 (2014), *World Geodetic System 1984*, chapters 3 and 4; Groves (2013),
//! *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, section 2.4.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `a`, `f`, `e^2` | [`SEMI_MAJOR_AXIS_M`], [`FLATTENING`], [`ECCENTRICITY_SQUARED`] | m, -, - |
//! | `M`, `N` | [`Radii`] | m |
//!
//! A [`LocalFrame`] is the plane that touches the ellipsoid's normal at its origin. Its conversion goes
//! through ECEF and is exact at any distance; the usual short form `n = dlat (M + h)` is off by 0.2 m at
//! 1 km and 20 m at 10 km.

use nalgebra::{Matrix3, Vector3};

/// Equatorial radius, m.
pub const SEMI_MAJOR_AXIS_M: f64 = 6_378_137.0;
/// Flattening.
pub const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared, `f (2 - f)`.
pub const ECCENTRICITY_SQUARED: f64 = FLATTENING * (2.0 - FLATTENING);

/// Heights beyond these (m) are no position of a vehicle: the deepest trench, and far above any orbit used here.
const HEIGHTS_M: [f64; 2] = [-2e4, 1e8];

/// A place on or above the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geodetic {
    /// Latitude, rad, north positive.
    pub latitude_rad: f64,
    /// Longitude, rad, east positive.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

/// Radii of curvature of the ellipsoid at a latitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radii {
    /// `M`: along the meridian, m.
    pub meridian_m: f64,
    /// `N`: across it (prime vertical), m.
    pub prime_vertical_m: f64,
}

impl Radii {
    /// At a latitude (rad).
    pub fn at(latitude_rad: f64) -> Self {
        let sin = libm::sin(latitude_rad);
        let w2 = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
        let prime_vertical_m = SEMI_MAJOR_AXIS_M / libm::sqrt(w2);
        Self {
            meridian_m: prime_vertical_m * (1.0 - ECCENTRICITY_SQUARED) / w2,
            prime_vertical_m,
        }
    }
}

impl Geodetic {
    /// The place at a latitude and longitude in degrees and a height above the ellipsoid in metres.
    ///
    /// `None` unless the numbers are finite, the latitude within 90 degrees, the longitude within 360
    /// and the height between -20 km and 100,000 km.
    pub fn from_degrees(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Option<Self> {
        let [lowest, highest] = HEIGHTS_M;
        let sensible = latitude_deg.abs() <= 90.0
            && longitude_deg.abs() <= 360.0
            && (lowest..=highest).contains(&height_m);
        sensible.then(|| Self {
            latitude_rad: latitude_deg.to_radians(),
            longitude_rad: longitude_deg.to_radians(),
            height_m,
        })
    }

    /// Latitude and longitude in degrees.
    pub fn degrees(&self) -> [f64; 2] {
        [
            self.latitude_rad.to_degrees(),
            self.longitude_rad.to_degrees(),
        ]
    }

    /// Earth-centred, Earth-fixed coordinates, m.
    pub fn to_ecef(&self) -> Vector3<f64> {
        let (sin, cos) = libm::sincos(self.latitude_rad);
        let (sin_lon, cos_lon) = libm::sincos(self.longitude_rad);
        let n = Radii::at(self.latitude_rad).prime_vertical_m;
        let level = (n + self.height_m) * cos;
        Vector3::new(
            level * cos_lon,
            level * sin_lon,
            (n * (1.0 - ECCENTRICITY_SQUARED) + self.height_m) * sin,
        )
    }

    /// The place of Earth-centred, Earth-fixed coordinates (m), exact to rounding from the deepest trench
    /// to beyond geostationary orbits: Bowring's formula, iterated on the parametric latitude.
    pub fn from_ecef(ecef: &Vector3<f64>) -> Self {
        let level = libm::hypot(ecef.x, ecef.y);
        let minor = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING);
        let second = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED);
        // Angles as sine and cosine, from roots: the poles are nothing special, and trigonometry costs six times as much.
        let mut parametric = direction(ecef.z, (1.0 - FLATTENING) * level);
        let normal = |[sin, cos]: [f64; 2]| {
            direction(
                ecef.z + second * minor * sin * sin * sin,
                level - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M * cos * cos * cos,
            )
        };
        for _ in 0..2 {
            let [sin, cos] = normal(parametric);
            parametric = direction((1.0 - FLATTENING) * sin, cos);
        }
        let latitude = normal(parametric);
        let [sin, cos] = latitude;
        let latitude_rad = libm::atan2(sin, cos);
        let n = SEMI_MAJOR_AXIS_M / libm::sqrt(1.0 - ECCENTRICITY_SQUARED * sin * sin);
        // Along the normal; unlike level / cos - N it holds at the poles.
        let height_m = level * cos + ecef.z * sin - n * (1.0 - ECCENTRICITY_SQUARED * sin * sin);
        Self {
            latitude_rad,
            longitude_rad: libm::atan2(ecef.y, ecef.x),
            height_m,
        }
    }

    /// The rotation `ned_from_ecef` here.
    pub fn ned_from_ecef(&self) -> Matrix3<f64> {
        let (sin, cos) = libm::sincos(self.latitude_rad);
        let (sin_lon, cos_lon) = libm::sincos(self.longitude_rad);
        Matrix3::new(
            -sin * cos_lon,
            -sin * sin_lon,
            cos,
            -sin_lon,
            cos_lon,
            0.0,
            -cos * cos_lon,
            -cos * sin_lon,
            -sin,
        )
    }
}

/// The north-east-down frame at an origin: a plane, fixed to the Earth.
///
/// ```
/// use northing_core::earth::{Geodetic, LocalFrame};
/// let origin = Geodetic::from_degrees(47.3769, 8.5417, 450.0).unwrap();
/// let frame = LocalFrame::new(origin);
/// let ned = frame.ned(&Geodetic::from_degrees(47.3779, 8.5417, 440.0).unwrap());
/// assert!((ned.x - 111.2).abs() < 0.1 && ned.y.abs() < 1e-6 && (ned.z - 10.0).abs() < 0.01);
/// let back = frame.geodetic(&ned).degrees();
/// assert!((back[0] - 47.3779).abs() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalFrame {
    origin: Geodetic,
    origin_ecef: Vector3<f64>,
    ned_from_ecef: Matrix3<f64>,
}

impl LocalFrame {
    /// The frame at `origin`.
    pub fn new(origin: Geodetic) -> Self {
        Self {
            origin,
            origin_ecef: origin.to_ecef(),
            ned_from_ecef: origin.ned_from_ecef(),
        }
    }

    /// Where it touches.
    pub fn origin(&self) -> &Geodetic {
        &self.origin
    }

    /// North, east and down (m) of a place.
    pub fn ned(&self, place: &Geodetic) -> Vector3<f64> {
        self.ned_from_ecef * (place.to_ecef() - self.origin_ecef)
    }

    /// The place at so many metres north, east and down.
    pub fn geodetic(&self, ned: &Vector3<f64>) -> Geodetic {
        Geodetic::from_ecef(&(self.origin_ecef + self.ned_from_ecef.transpose() * ned))
    }

    /// The rotation from the north-east-down axes of another place into those of this frame: for
    /// velocities that a receiver gives in the axes of where it is. 10 km away it turns by 0.09 degrees.
    pub fn from_axes_at(&self, place: &Geodetic) -> Matrix3<f64> {
        self.ned_from_ecef * place.ned_from_ecef().transpose()
    }
}

/// Sine and cosine of `atan2(y, x)`; at the origin those of 0.
fn direction(y: f64, x: f64) -> [f64; 2] {
    let length = libm::sqrt(x * x + y * y);
    if length > 0.0 {
        let scale = 1.0 / length;
        [y * scale, x * scale]
    } else {
        [0.0, 1.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(61), ..ProptestConfig::default() })]
        #[test]
        fn a_local_frame_there_and_back_is_exact_within_100_km(
            latitude in -90.0..90.0f64, longitude in -180.0..180.0f64, height in -400.0..9000.0f64,
            ned in prop::array::uniform3(-1e5..1e5f64),
        ) {
            let frame = LocalFrame::new(Geodetic::from_degrees(latitude, longitude, height).unwrap());
            let ned = Vector3::from(ned);
            let back = frame.ned(&frame.geodetic(&ned));
            prop_assert!((back - ned).norm() < 1e-6, "{}", (back - ned).norm());
        }

        #[test]
        fn ecef_there_and_back_is_exact_at_any_height(
            latitude in -90.0..=90.0f64, longitude in -180.0..180.0f64, height in -1e4..5e7f64,
        ) {
            let place = Geodetic::from_degrees(latitude, longitude, height).unwrap();
            let back = Geodetic::from_ecef(&place.to_ecef());
            prop_assert!((back.to_ecef() - place.to_ecef()).norm() < 1e-6);
            prop_assert!((back.latitude_rad - place.latitude_rad).abs() < 1e-13);
            prop_assert!((back.height_m - place.height_m).abs() < 1e-6);
        }

        #[test]
        fn ecef_equals_another_implementation(
            latitude in -90.0..=90.0f64, longitude in -180.0..180.0f64, height in -1e3..1e5f64,
        ) {
            let place = Geodetic::from_degrees(latitude, longitude, height).unwrap();
            let ellipsoid = map_3d::Ellipsoid::WGS84;
            let (x, y, z) =
                map_3d::geodetic2ecef(place.latitude_rad, place.longitude_rad, height, ellipsoid);
            prop_assert!((place.to_ecef() - Vector3::new(x, y, z)).norm() < 1e-6);
            let origin = Geodetic::from_degrees(47.0, 8.0, 400.0).unwrap();
            let (e, n, u) = map_3d::geodetic2enu(
                place.latitude_rad, place.longitude_rad, height,
                origin.latitude_rad, origin.longitude_rad, origin.height_m, ellipsoid,
            );
            let ned = LocalFrame::new(origin).ned(&place);
            prop_assert!((ned - Vector3::new(n, e, -u)).norm() < 1e-6);
        }
    }

    #[test]
    fn the_axes_and_poles_are_where_they_are() {
        let equator = Geodetic::from_degrees(0.0, 90.0, 0.0).unwrap().to_ecef();
        assert_relative_eq!(
            equator,
            Vector3::new(0.0, SEMI_MAJOR_AXIS_M, 0.0),
            epsilon = 1e-8
        );
        let pole = Geodetic::from_degrees(90.0, 0.0, 100.0).unwrap();
        // Polar radius: NGA.STND.0036, table 3.3.
        assert_relative_eq!(pole.to_ecef().z, 6_356_752.314_2 + 100.0, epsilon = 1e-4);
        let back = Geodetic::from_ecef(&pole.to_ecef());
        assert_relative_eq!(back.height_m, 100.0, epsilon = 1e-8);
    }

    #[test]
    fn radii_at_the_equator_and_poles_have_closed_forms() {
        let equator = Radii::at(0.0);
        let pole = Radii::at(core::f64::consts::FRAC_PI_2);
        let (a, f) = (SEMI_MAJOR_AXIS_M, FLATTENING);
        assert_relative_eq!(equator.prime_vertical_m, a, epsilon = 1e-6);
        assert_relative_eq!(
            equator.meridian_m,
            a * (1.0 - f) * (1.0 - f),
            epsilon = 1e-6
        );
        assert_relative_eq!(pole.meridian_m, a / (1.0 - f), epsilon = 1e-6);
        assert_relative_eq!(pole.prime_vertical_m, a / (1.0 - f), epsilon = 1e-6);
    }

    #[test]
    fn radii_are_what_a_small_step_moves() {
        let origin = Geodetic::from_degrees(40.0, -105.0, 1600.0).unwrap();
        let radii = Radii::at(origin.latitude_rad);
        let step = Geodetic {
            latitude_rad: origin.latitude_rad + 1e-6,
            longitude_rad: origin.longitude_rad + 1e-6,
            ..origin
        };
        let ned = LocalFrame::new(origin).ned(&step);
        assert_relative_eq!(ned.x, 1e-6 * (radii.meridian_m + 1600.0), epsilon = 1e-5);
        let east = 1e-6 * (radii.prime_vertical_m + 1600.0) * libm::cos(origin.latitude_rad);
        assert_relative_eq!(ned.y, east, epsilon = 1e-5);
    }

    #[test]
    fn velocities_elsewhere_turn_into_the_axes_of_the_origin() {
        let origin = Geodetic::from_degrees(47.0, 8.0, 0.0).unwrap();
        let place = Geodetic::from_degrees(47.2, 8.3, 0.0).unwrap();
        let north_there = Geodetic {
            latitude_rad: place.latitude_rad + 1e-7,
            ..place
        };
        let frame = LocalFrame::new(origin);
        let moved = (frame.ned(&north_there) - frame.ned(&place)).normalize();
        let turned = frame.from_axes_at(&place) * Vector3::x();
        assert_relative_eq!(moved, turned, epsilon = 1e-7);
    }

    #[test]
    fn no_place_is_made_of_nonsense() {
        for [latitude, longitude, height] in [
            [91.0, 0.0, 0.0],
            [f64::NAN, 0.0, 0.0],
            [0.0, f64::INFINITY, 0.0],
            [0.0, 400.0, 0.0],
            [0.0, 0.0, f64::NAN],
            [0.0, 0.0, -3e4],
        ] {
            assert!(Geodetic::from_degrees(latitude, longitude, height).is_none());
        }
    }
}
