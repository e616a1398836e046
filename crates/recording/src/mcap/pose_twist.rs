//! The ROS 2 messages of a velocity over ground or a pose: `geometry_msgs/TwistStamped`,
//! `TwistWithCovarianceStamped`, `QuaternionStamped`, `PoseStamped`, `PoseWithCovarianceStamped` and `nav_msgs/Odometry`, as far as they are read,
//! and the velocity as it is written.
//!
//! Read first: REP 103 (axes: east, north, up).

use nalgebra::UnitQuaternion;

use super::cdr::{CdrReader, CdrWriter};
use super::ros::{header, header_frame, stamp};
use crate::event::quaternion_from_file;
use crate::gnss::GnssVelocity;

/// The name of the schema of a velocity.
pub(super) const TWIST: &str = "geometry_msgs/msg/TwistStamped";
/// The same with its covariance.
pub(super) const TWIST_WITH_COVARIANCE: &str = "geometry_msgs/msg/TwistWithCovarianceStamped";
/// What viewers need to read it, with the messages that it is made of.
pub(super) const TWIST_WITH_COVARIANCE_DEFINITION: &str =
    include_str!("twist_with_covariance_stamped.msg");
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

/// Far less than any receiver tells.
const NEARLY_REST_M_S: f64 = 1e-9;

/// The message of such a velocity, with its covariance; `None` when its stamp is beyond what ROS can hold.
pub(super) fn encode_velocity(time_ns: i64, velocity: &GnssVelocity) -> Option<Vec<u8>> {
    let mut out = CdrWriter::new();
    header(&mut out, time_ns, "gps")?;
    let up_m_s = match velocity.down_m_s {
        None => 0.0,
        // So that a zero that was measured is not read as one that was not.
        Some(down) if down.abs() <= 0.0 => NEARLY_REST_M_S,
        Some(down) => -down,
    };
    out.f64s(&[velocity.east_m_s, velocity.north_m_s, up_m_s]);
    out.f64s(&[0.0; 3]);
    let mut covariance = [0.0; 36];
    if let Some([north, east, down]) = velocity.std_m_s {
        (covariance[0], covariance[7], covariance[14]) = (east * east, north * north, down * down);
    }
    out.f64s(&covariance);
    Some(out.into_bytes())
}

/// A position of a pose, as its message states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Position {
    /// Along the axes of the pose's frame, m; the third is NaN where the pose is one in the plane.
    pub(super) position_m: [f64; 3],
    /// Standard deviations along them, m.
    pub(super) std_m: Option<[f64; 3]>,
}

/// Reads the position of a pose; a stamp of zero is replaced by `log_time_ns`. A pose in the plane, of which the variances along
/// the ground are stated and that of the height is exactly 0, has no height.
pub(super) fn position(bytes: &[u8], log_time_ns: i64, schema: &str) -> Option<(i64, Position)> {
    let mut input = CdrReader::new(bytes)?;
    let time_ns = stamp(&mut input, log_time_ns)?;
    if schema == ODOMETRY {
        input.skip_string()?;
    }
    let mut position_m = input.f64s::<3>()?;
    let _attitude = input.f64s::<4>()?;
    let mut std_m = None;
    if schema != POSE {
        let covariance = input.f64s::<36>()?;
        let [x, y, mut z] = [covariance[0], covariance[7], covariance[14]].map(f64::sqrt);
        let is_stated = |std: f64| std.is_finite() && std > 0.0;
        if is_stated(x) && is_stated(y) && z.abs() <= 0.0 {
            position_m[2] = f64::NAN;
            // Of a height that is not there nothing is used.
            z = x.max(y);
        }
        std_m = [x, y, z].into_iter().all(is_stated).then_some([x, y, z]);
    }
    let position = Position { position_m, std_m };
    Some((time_ns, position))
}

/// Reads the velocity along the body's x axis; a stamp of zero is replaced by `log_time_ns`.
pub(super) fn forward_speed(bytes: &[u8], log_time_ns: i64, schema: &str) -> Option<(i64, f64)> {
    let mut input = CdrReader::new(bytes)?;
    let time_ns = stamp(&mut input, log_time_ns)?;
    if schema == ODOMETRY {
        input.skip_string()?;
        let _pose = input.f64s::<7>()?;
        let _covariance = input.f64s::<36>()?;
    }
    let [forward] = input.f64s()?;
    Some((time_ns, forward))
}

/// The frame of which an `Odometry` is the pose.
pub(super) fn child_frame(bytes: &[u8]) -> Option<&str> {
    let mut input = CdrReader::new(bytes)?;
    let _map = header_frame(&mut input)?;
    input.string()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_velocity_comes_back_with_its_standard_deviations() {
        let velocity = |down_m_s, std_m_s| GnssVelocity {
            north_m_s: 12.3,
            east_m_s: -0.7,
            down_m_s,
            std_m_s,
        };
        for told in [
            velocity(Some(-0.123), Some([0.05, 0.07, 0.11])),
            velocity(Some(0.3), None),
            velocity(None, Some([0.05, 0.07, 0.11])),
            velocity(None, None),
        ] {
            let bytes = encode_velocity(1_500_000_000, &told).unwrap();
            // Header 4; stamp 8; string 4 + 4; 6 + 36 numbers.
            assert_eq!(bytes.len(), 4 + 16 + 42 * 8);
            assert_eq!(velocity_of(&bytes), (1_500_000_000, told));
        }
        let rest = encode_velocity(0, &velocity(Some(0.0), None)).unwrap();
        let read = velocity_of(&rest).1.down_m_s;
        assert!(
            read.is_some_and(|down| down.abs() <= NEARLY_REST_M_S),
            "{read:?}"
        );
        assert_eq!(encode_velocity(i64::MAX, &velocity(None, None)), None);
    }

    fn velocity_of(bytes: &[u8]) -> (i64, GnssVelocity) {
        super::velocity(bytes, 0, true).unwrap()
    }
}
