//! From one reading of Sensor Logger to events: which name is which sensor, signs and units.

use std::collections::BTreeMap;

use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

use super::{Reading, SensorLoggerPush};
use crate::error::shown;
use crate::event::{SensorKind, quaternion_from_file};
use crate::options::STANDARD_GRAVITY_M_S2;
use crate::sensor_logger::TABLES;
use crate::wire::force_sign::ForceSign;
use crate::wire::{Decoded, json};

/// Readings that wait for their partner.
const MOST_WAITING: usize = 512;

impl SensorLoggerPush {
    /// Decodes one reading.
    pub(super) fn reading(
        &mut self,
        reading: &Reading<'_>,
        time_ns: i64,
        sign: ForceSign,
        out: &mut Decoded,
    ) {
        let v = json::xyz(reading.values);
        let factor = sign.factor();
        match reading.name {
            "totalacceleration" => out.vector(time_ns, SensorKind::Accelerometer, v * factor),
            "accelerometer" | "gravity" if !self.has("totalacceleration") => {
                if let Some(sum) = self.pairs.force(time_ns, reading.name == "gravity", v) {
                    out.vector(time_ns, SensorKind::Accelerometer, sum * factor);
                }
            }
            "accelerometeruncalibrated"
                if !self.has("totalacceleration") && !self.has("gravity") =>
            {
                let unit = if self.in_g {
                    STANDARD_GRAVITY_M_S2
                } else {
                    1.0
                };
                out.vector(time_ns, SensorKind::Accelerometer, v * unit * factor);
            }
            "gyroscope" => {
                out.vector(time_ns, SensorKind::Gyroscope, v);
                self.bias(time_ns, false, v, out);
            }
            "gyroscopeuncalibrated" if self.has("gyroscope") => self.bias(time_ns, true, v, out),
            "gyroscopeuncalibrated" => out.vector(time_ns, SensorKind::Gyroscope, v),
            "magnetometer" => out.vector(time_ns, SensorKind::Magnetometer, v),
            "magnetometeruncalibrated" => {
                out.vector(time_ns, SensorKind::MagnetometerUncalibrated, v);
            }
            "orientation" => orientation(time_ns, reading.values, sign, out),
            // The app gives millibar.
            "barometer" => {
                out.pressure(
                    time_ns,
                    100.0 * json::number(reading.values.get("pressure")),
                );
            }
            "annotation" => {
                let text = json::text(reading.values.get("text"));
                out.info(format!("Annotation: {text}"));
            }
            _ => {}
        }
    }

    /// The device's own bias is what its calibration took away.
    fn bias(&mut self, time_ns: i64, uncalibrated: bool, v: Vector3<f64>, out: &mut Decoded) {
        if !self.has("gyroscopeuncalibrated") {
            return;
        }
        if let Some(bias) = self.pairs.bias(time_ns, uncalibrated, v) {
            out.vector(time_ns, SensorKind::DeviceGyroscopeBias, bias);
        }
    }
}

/// The quaternion of an orientation, w, x, y, z.
pub(super) fn quaternion(values: &Value) -> [f64; 4] {
    ["qw", "qx", "qy", "qz"].map(|key| json::number(values.get(key)))
}

fn orientation(time_ns: i64, values: &Value, sign: ForceSign, out: &mut Decoded) {
    let [w, x, y, z] = quaternion(values);
    let q = quaternion_from_file(w, x, y, z);
    out.attitude(
        time_ns,
        match sign {
            ForceSign::Standard => q,
            // World axes x north, y west: a quarter turn about the vertical makes them east, north.
            ForceSign::Opposite => {
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2) * q
            }
        },
    );
}

/// Says once that a sensor is not used, or what is missing beside it.
pub(super) fn remark_on(name: &str, out: &mut Decoded) {
    match name {
        "annotation" => {}
        _ if name != "metadata" && TABLES.contains(&name) => {}
        "" => out.bad("An entry of the payload has no `name`; it is left out."),
        _ => out.info(format!("The sensor {} is not used.", shown(name))),
    }
}

/// Readings that belong together by their stamp and wait for each other.
#[derive(Debug, Clone, Default)]
pub(super) struct Pairs {
    linear: Waiting,
    gravity: Waiting,
    calibrated: Waiting,
    uncalibrated: Waiting,
    left_alone: u64,
}

type Waiting = BTreeMap<i64, Vector3<f64>>;

impl Pairs {
    /// The sum of acceleration and gravity once both are there.
    fn force(&mut self, time_ns: i64, is_gravity: bool, v: Vector3<f64>) -> Option<Vector3<f64>> {
        let (own, other) = if is_gravity {
            (&mut self.gravity, &mut self.linear)
        } else {
            (&mut self.linear, &mut self.gravity)
        };
        let (partner, left_alone) = partner(own, other, time_ns, v);
        self.left_alone += u64::from(left_alone);
        partner.map(|partner| v + partner)
    }

    /// Uncalibrated minus calibrated rate once both are there. Many phones stamp the two
    /// differently; then there is simply no bias.
    fn bias(&mut self, time_ns: i64, uncalibrated: bool, v: Vector3<f64>) -> Option<Vector3<f64>> {
        let (own, other, sign) = if uncalibrated {
            (&mut self.uncalibrated, &mut self.calibrated, 1.0)
        } else {
            (&mut self.calibrated, &mut self.uncalibrated, -1.0)
        };
        let (partner, _) = partner(own, other, time_ns, v);
        partner.map(|partner| (v - partner) * sign)
    }

    /// Says how many accelerations found no gravity of their stamp, or the other way round.
    pub(super) fn report(&mut self, out: &mut Decoded) {
        out.bad_many("An acceleration or a gravity was left out: the other of the same time is missing. Switch both on in the app.",
                self.left_alone,
            );
        self.left_alone = 0;
    }
}

/// What waits among the others for `v` of its stamp; without it `v` waits among its own, and the oldest of
/// too many is left alone.
fn partner(
    own: &mut Waiting,
    other: &mut Waiting,
    time_ns: i64,
    v: Vector3<f64>,
) -> (Option<Vector3<f64>>, bool) {
    let partner = other.remove(&time_ns);
    if partner.is_none() {
        own.insert(time_ns, v);
    }
    let too_many = own.len() > MOST_WAITING;
    if too_many {
        own.pop_first();
    }
    (partner, too_many)
}
