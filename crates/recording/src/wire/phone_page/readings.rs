//! One row of DeviceMotion and of DeviceOrientation, as the browser wrote it.

use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

use crate::event::{CompassHeading, quaternion_from_file};
use crate::wire::json;

/// One DeviceMotion reading as written.
pub(super) struct Motion {
    pub(super) time_ns: Option<i64>,
    pub(super) with_gravity: Vector3<f64>,
    pub(super) rate_deg_s: Vector3<f64>,
}

impl Motion {
    pub(super) fn read(row: &Value) -> Self {
        let row = json::array(Some(row));
        Self {
            time_ns: json::stamp_ms(row.first()),
            with_gravity: json::vector(row, 4),
            rate_deg_s: json::vector(row, 7),
        }
    }
}

/// One DeviceOrientation reading as written.
pub(super) struct Orientation {
    pub(super) time_ns: i64,
    /// alpha, beta, gamma about z, x, y.
    angles_deg: [f64; 3],
    pub(super) absolute: bool,
    heading_deg: f64,
    heading_std_deg: f64,
}

impl Orientation {
    pub(super) fn read(row: &Value) -> Option<Self> {
        let row = json::array(Some(row));
        let angles_deg = json::numbers::<3>(row, 1);
        let absolute = match row.get(4) {
            Some(Value::Bool(absolute)) => *absolute,
            other => json::number(other) > 0.5,
        };
        angles_deg.iter().all(|x| x.is_finite()).then_some(())?;
        Some(Self {
            time_ns: json::stamp_ms(row.first())?,
            angles_deg,
            absolute,
            heading_deg: json::number(row.get(5)),
            heading_std_deg: json::number(row.get(6)),
        })
    }

    /// `Rz(alpha) Rx(beta) Ry(gamma)`.
    pub(super) fn world_from_body(&self) -> UnitQuaternion<f64> {
        let [alpha, beta, gamma] = self.angles_deg.map(f64::to_radians);
        let q = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), alpha)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), beta)
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), gamma);
        quaternion_from_file(q.w, q.i, q.j, q.k)
    }

    /// The heading of the top edge with its standard deviation: the compass with the accuracy it
    /// states, else that of an absolute orientation. `None` where the top edge stands too steeply.
    pub(super) fn compass(&self) -> Option<CompassHeading> {
        let top = self.world_from_body();
        let absolute = || heading_of(&top).filter(|_| self.absolute);
        let Some(heading_rad) = self.heading_rad() else {
            return absolute();
        };
        heading_of(&top).map(|_| CompassHeading {
            heading_rad,
            std_rad: self.heading_std_deg.to_radians(),
        })
    }

    /// The compass, unless the phone says that it is not to be trusted (a negative accuracy).
    pub(super) fn heading_rad(&self) -> Option<f64> {
        let trusted = (0.0..=360.0).contains(&self.heading_deg) && self.heading_std_deg >= 0.0;
        trusted.then(|| self.heading_deg.to_radians())
    }

    /// The turn about the vertical after which the top edge points where the compass says.
    pub(super) fn north_from_arbitrary(&self) -> Option<UnitQuaternion<f64>> {
        /// With the top edge nearer to the vertical than this (cosine), it has no heading.
        const LEAST_HORIZONTAL: f64 = 0.3;
        let top = self.world_from_body() * Vector3::y();
        let horizontal = top.x.hypot(top.y);
        let heading = self.heading_rad()?;
        (horizontal > LEAST_HORIZONTAL).then(|| {
            // Heading runs clockwise from north, angles about the vertical the other way.
            let turn = top.x.atan2(top.y) - heading;
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn)
        })
    }
}

/// Where the top edge points in an absolute orientation, unless it stands steeper than 60 deg.
pub(super) fn heading_of(enu_from_body: &UnitQuaternion<f64>) -> Option<CompassHeading> {
    /// Cosine of the steepest elevation.
    const LEAST_HORIZONTAL: f64 = 0.5;
    /// Browsers do not say how good their north is; phones indoors are seldom better, rad (10 deg).
    const STD_RAD: f64 = 0.175;
    let top = enu_from_body * Vector3::y();
    (top.x.hypot(top.y) > LEAST_HORIZONTAL).then(|| CompassHeading {
        heading_rad: top.x.atan2(top.y).rem_euclid(std::f64::consts::TAU),
        std_rad: STD_RAD,
    })
}
