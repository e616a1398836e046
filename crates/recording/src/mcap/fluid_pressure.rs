//! The ROS 2 message of a barometer, `sensor_msgs/FluidPressure`, as far as it is read.

use super::cdr::CdrReader;
use super::ros::stamp;

/// The name of its schema.
pub(super) const NAME: &str = "sensor_msgs/msg/FluidPressure";

/// Reads the static pressure, Pa; a stamp of zero is replaced by `log_time_ns`.
pub(super) fn decode(bytes: &[u8], log_time_ns: i64) -> Option<(i64, f64)> {
    let mut input = CdrReader::new(bytes)?;
    let time_ns = stamp(&mut input, log_time_ns)?;
    let [pressure_pa] = input.f64s()?;
    Some((time_ns, pressure_pa))
}
