//! Positions in metres from a place, as fixes: motion capture, a total station, the map of a robot.

use nalgebra::Vector3;
use northing_core::earth::{Geodetic, LocalFrame};

use crate::error::{RecordingError, Result};
use crate::gnss::GnssPosition;
use crate::manifest::{Origin, VelocityAxes};

/// Where positions count from, and along which level axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalPlace {
    frame: LocalFrame,
    axes: VelocityAxes,
    /// Standard deviations north, east, down, m, which hold for all positions.
    std_m: Option<[f64; 3]>,
}

impl LocalPlace {
    /// Positions along these axes from `origin`; `std_m` holds for all of them, in the order of the axes, m. `what` stands for it
    /// in messages.
    ///
    /// # Errors
    /// The origin is no place on the Earth, or a standard deviation is not above zero.
    pub fn new(
        origin: &Origin,
        axes: VelocityAxes,
        std_m: Option<[f64; 3]>,
        what: &str,
    ) -> Result<Self> {
        let wrong = |problem: &str| Err(RecordingError::manifest(what, problem));
        let Origin {
            latitude_deg,
            longitude_deg,
            height_m,
        } = *origin;
        let Some(origin) = Geodetic::from_degrees(latitude_deg, longitude_deg, height_m) else {
            return wrong(
                "[local_position] origin: expected latitude_deg from -90 to 90, longitude_deg from -180 to 180 and height_m",
            );
        };
        if let Some(std) = std_m
            && !std.iter().all(|std| *std > 0.0 && std.is_finite())
        {
            return wrong("[local_position] std_m: expected metres above 0");
        }
        Ok(Self {
            frame: LocalFrame::new(origin),
            axes,
            std_m: std_m.map(|std| axes.to_ned(std, 1.0)),
        })
    }

    /// The fix at a position along the axes, m; `std_m` is its own, in their order. Where a number is NaN it is not known.
    #[must_use]
    pub fn fix(&self, position: [f64; 3], std_m: Option<[f64; 3]>) -> GnssPosition {
        let ned = self.axes.to_ned(position, self.axes.down());
        let own = std_m.map(|std| self.axes.to_ned(std, 1.0));
        self.fix_ned(
            ned,
            GnssPosition {
                std_m: own,
                ..GnssPosition::default()
            },
        )
    }

    /// The same of north, east, down; of `fix` what is told beside the position.
    pub(crate) fn fix_ned(&self, ned: [f64; 3], fix: GnssPosition) -> GnssPosition {
        let has_height = !ned[2].is_nan();
        let mut ned = Vector3::from(ned);
        if !has_height {
            ned.z = 0.0;
        }
        let place = self.frame.geodetic(&ned);
        GnssPosition {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: has_height.then_some(place.height_m),
            std_m: self.std_m.or(fix.std_m),
            ..fix
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORIGIN: Origin = Origin {
        latitude_deg: 48.0,
        longitude_deg: 9.0,
        height_m: 300.0,
    };

    #[test]
    fn axes_and_standard_deviations_go_where_they_belong() {
        let at = |axes, position, std| {
            let place = LocalPlace::new(&ORIGIN, axes, None, "test").unwrap();
            place.fix(position, std)
        };
        let enu = at(VelocityAxes::Enu, [10.0, 20.0, 3.0], Some([0.1, 0.2, 0.3]));
        let ned = at(VelocityAxes::Ned, [20.0, 10.0, -3.0], Some([0.2, 0.1, 0.3]));
        assert_eq!(enu, ned);
        assert_eq!(enu.std_m, Some([0.2, 0.1, 0.3]));
        // One second of arc in latitude is 30.9 m.
        let north_m = (enu.latitude_rad.to_degrees() - 48.0) * 3600.0 * 30.883;
        assert!((north_m - 20.0).abs() < 0.01, "{north_m}");
        assert!((enu.height_m.unwrap() - 303.0).abs() < 1e-3);
        let flat = at(VelocityAxes::Enu, [10.0, 20.0, f64::NAN], None);
        assert_eq!(flat.height_m, None);
        assert!(flat.is_usable());
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let nowhere = Origin {
            latitude_deg: 91.0,
            ..ORIGIN
        };
        let refused = |origin: &Origin, std| {
            LocalPlace::new(origin, VelocityAxes::Enu, std, "x.toml")
                .unwrap_err()
                .to_string()
        };
        assert!(refused(&nowhere, None).starts_with("x.toml: [local_position] origin"));
        assert!(refused(&ORIGIN, Some([0.1, 0.0, 0.1])).contains("std_m"));
    }
}
