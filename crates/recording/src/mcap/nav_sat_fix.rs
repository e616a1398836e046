//! The ROS 2 message `sensor_msgs/NavSatFix` as bytes.

use super::cdr::CdrWriter;
use super::ros::header;
use crate::track::TrackPoint;

/// The name of the schema.
pub(crate) const NAME: &str = "sensor_msgs/msg/NavSatFix";
/// What viewers need to read it, with the messages that it is made of.
pub(crate) const DEFINITION: &str = include_str!("nav_sat_fix.msg");

/// `STATUS_FIX`, `SERVICE_GPS`, and the kinds of covariance.
const STATUS_FIX: i8 = 0;
const SERVICE_GPS: u16 = 1;
const COVARIANCE_UNKNOWN: u8 = 0;
const COVARIANCE_DIAGONAL_KNOWN: u8 = 2;

/// The message of a point; `None` when its stamp is beyond what ROS can hold.
pub(crate) fn encode(point: &TrackPoint) -> Option<Vec<u8>> {
    let mut out = CdrWriter::new();
    header(&mut out, point.time_ns, "gps")?;
    out.bytes(&STATUS_FIX.to_le_bytes());
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
