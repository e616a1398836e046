//! The ROS 2 message `sensor_msgs/NavSatFix` as bytes.

use super::cdr::{CdrReader, CdrWriter};
use super::ros::{header, stamp};
use crate::gnss::{GnssPosition, GnssQuality};
use crate::track::TrackPoint;

/// The name of the schema.
pub(crate) const NAME: &str = "sensor_msgs/msg/NavSatFix";
/// What viewers need to read it, with the messages that it is made of.
pub(crate) const DEFINITION: &str = include_str!("nav_sat_fix.msg");

/// `STATUS_NO_FIX` and those of a fix: without corrections, with those of satellites, of ground stations.
const STATUS_NO_FIX: i8 = -1;
const STATUS_FIX: i8 = 0;
const STATUS_SBAS_FIX: i8 = 1;
const STATUS_GBAS_FIX: i8 = 2;
/// `SERVICE_GPS`, and the kinds of covariance.
const SERVICE_GPS: u16 = 1;
const COVARIANCE_UNKNOWN: u8 = 0;
const COVARIANCE_DIAGONAL_KNOWN: u8 = 2;

/// The message of a point; `None` when its stamp is beyond what ROS can hold.
pub(crate) fn encode(point: &TrackPoint) -> Option<Vec<u8>> {
    encode_with(point, STATUS_FIX)
}

/// The message of a fix. A height that is not known is NaN, as the definition of the message wants it.
pub(crate) fn encode_fix(time_ns: i64, fix: &GnssPosition) -> Option<Vec<u8>> {
    let point = TrackPoint {
        time_ns,
        latitude_rad: fix.latitude_rad,
        longitude_rad: fix.longitude_rad,
        height_m: fix.height_m.unwrap_or(f64::NAN),
        std_m: fix.std_m,
        attitude: None,
    };
    encode_with(&point, status(fix.quality))
}

const fn status(quality: GnssQuality) -> i8 {
    match quality {
        // Of an estimate nobody shall take that it was measured.
        GnssQuality::Invalid | GnssQuality::Estimated => STATUS_NO_FIX,
        GnssQuality::Autonomous | GnssQuality::Unknown => STATUS_FIX,
        GnssQuality::Differential => STATUS_SBAS_FIX,
        GnssQuality::RtkFixed | GnssQuality::RtkFloat => STATUS_GBAS_FIX,
    }
}

/// Reads a message; a stamp of zero is replaced by `log_time_ns`. Which of the corrected kinds a fix is, the message
/// does not say: it is differential.
pub(crate) fn decode(bytes: &[u8], log_time_ns: i64) -> Option<(i64, GnssPosition)> {
    let mut input = CdrReader::new(bytes)?;
    let time_ns = stamp(&mut input, log_time_ns)?;
    let status = input.take().map(i8::from_le_bytes)?;
    let _service: [u8; 2] = input.take()?;
    let [latitude_deg, longitude_deg, height_m] = input.f64s()?;
    let covariance = input.f64s::<9>()?;
    let [kind] = input.take()?;
    let (east, north, down) = (covariance[0], covariance[4], covariance[8]);
    let std = [north, east, down].map(f64::sqrt);
    let is_stated = |std: &f64| std.is_finite() && *std > 0.0;
    let is_known = kind != COVARIANCE_UNKNOWN && std.iter().all(is_stated);
    let fix = GnssPosition {
        latitude_rad: latitude_deg.to_radians(),
        longitude_rad: longitude_deg.to_radians(),
        height_m: height_m.is_finite().then_some(height_m),
        std_m: is_known.then_some(std),
        hdop: None,
        satellites: None,
        quality: match status {
            STATUS_FIX => GnssQuality::Autonomous,
            STATUS_SBAS_FIX | STATUS_GBAS_FIX => GnssQuality::Differential,
            _ => GnssQuality::Invalid,
        },
    };
    Some((time_ns, fix))
}

fn encode_with(point: &TrackPoint, status: i8) -> Option<Vec<u8>> {
    let mut out = CdrWriter::new();
    header(&mut out, point.time_ns, "gps")?;
    out.bytes(&status.to_le_bytes());
    out.bytes(&SERVICE_GPS.to_le_bytes());
    out.f64s(&[
        point.latitude_rad.to_degrees(),
        point.longitude_rad.to_degrees(),
        point.height_m,
    ]);
    let mut covariance = [0.0; 9];
    if let Some([north, east, down]) = point.std_m {
        (covariance[0], covariance[4], covariance[8]) = (east * east, north * north, down * down);
    }
    out.f64s(&covariance);
    let kind = match point.std_m {
        Some(_) => COVARIANCE_DIAGONAL_KNOWN,
        None => COVARIANCE_UNKNOWN,
    };
    out.bytes(&[kind]);
    Some(out.into_bytes())
}
