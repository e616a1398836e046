//! The ROS 2 messages that tell a velocity over ground or a pose: `geometry_msgs/TwistStamped`,
//! `TwistWithCovarianceStamped`, `QuaternionStamped`, `PoseStamped`, `PoseWithCovarianceStamped` and `nav_msgs/Odometry`, as far as they are read.
//!
//! Read first: REP 103 (axes: east, north, up).

use nalgebra::UnitQuaternion;

use super::cdr::CdrReader;
use super::ros::stamp;
use crate::event::quaternion_from_file;
use crate::gnss::GnssVelocity;

/// The name of the schema of a velocity.
pub(super) const TWIST: &str = "geometry_msgs/msg/TwistStamped";
/// The same with its covariance.
pub(super) const TWIST_WITH_COVARIANCE: &str = "geometry_msgs/msg/TwistWithCovarianceStamped";
/// The name of the schema of a pose.
pub(super) const POSE: &str = "geometry_msgs/msg/PoseStamped";
/// The same with its covariance.
pub(super) const POSE_WITH_COVARIANCE: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";
/// The name of the schema of an orientation.
pub(super) const QUATERNION: &str = "geometry_msgs/msg/QuaternionStamped";
/// The name of the schema of a pose with a velocity.
pub(super) const ODOMETRY: &str = "nav_msgs/msg/Odometry";

/// Reads the velocity of a satellite receiver; a stamp of zero is replaced by `log_time_ns`. Receivers that tell speed
/// and course only have an upward velocity of exactly 0, which is no measurement.
pub(super) fn velocity(
    bytes: &[u8],
    log_time_ns: i64,
    has_covariance: bool,
) -> Option<(i64, GnssVelocity)> {
    let mut input = CdrReader::new(bytes)?;
    let time_ns = stamp(&mut input, log_time_ns)?;
    let [east_m_s, north_m_s, up_m_s] = input.f64s()?;
    let _turn = input.f64s::<3>()?;
    let mut std_m_s = None;
    if has_covariance {
        let covariance = input.f64s::<36>()?;
        let std = [covariance[7], covariance[0], covariance[14]].map(f64::sqrt);
        std_m_s = std
            .iter()
            .all(|std| std.is_finite() && *std > 0.0)
            .then_some(std);
    }
    let velocity = GnssVelocity {
        north_m_s,
        east_m_s,
        down_m_s: (up_m_s.abs() > 0.0).then_some(-up_m_s),
        std_m_s,
    };
    Some((time_ns, velocity))
}

/// Reads the attitude of a pose or orientation, `enu_from_body`; a stamp of zero is replaced by `log_time_ns`.
pub(super) fn attitude(
    bytes: &[u8],
    log_time_ns: i64,
    schema: &str,
) -> Option<(i64, UnitQuaternion<f64>)> {
    let mut input = CdrReader::new(bytes)?;
    let time_ns = stamp(&mut input, log_time_ns)?;
    if schema == ODOMETRY {
        input.skip_string()?;
    }
    if schema != QUATERNION {
        let _position = input.f64s::<3>()?;
    }
    let [x, y, z, w] = input.f64s()?;
    Some((time_ns, quaternion_from_file(w, x, y, z)))
}
