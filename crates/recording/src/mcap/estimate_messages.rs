//! Estimates as messages of ROS 2, for files, the node and viewers: `Imu`, `TFMessage`, `Odometry`, `NavSatFix`.
//!
//! Frames: `map`, level, x east, y north, z up; `base_link`, the body. Read first: REP 103 and REP 105.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::cdr::CdrWriter;
use super::nav_sat_fix;
use super::output::{NO_FACTS, RosTopic};
use super::ros::{IMU, IMU_DEFINITION, Imu, header};
use crate::pose::{PoseEstimate, UNKNOWN_ANGLE_VARIANCE, UNKNOWN_VARIANCE};
use crate::writer::quaternion_to_file;

/// The messages that an estimate becomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum EstimateTopic {
    /// `/imu/data`: the orientation with its covariance, and what was measured if it is told.
    Imu,
    /// `/tf`.
    Transform,
    /// `/odometry`.
    Odometry,
    /// `/gps/filtered`: the place on the Earth.
    Fix,
}

/// The names of the frames in messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameNames {
    /// Level, x east, y north, z up. Default `map`.
    pub map: String,
    /// The body. Default `base_link`.
    pub body: String,
}

impl Default for FrameNames {
    fn default() -> Self {
        Self {
            map: "map".to_owned(),
            body: "base_link".to_owned(),
        }
    }
}

impl EstimateTopic {
    /// Every one.
    pub const ALL: [Self; 4] = [Self::Imu, Self::Transform, Self::Odometry, Self::Fix];

    /// Its usual name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.told().name
    }

    /// The type of its messages: `sensor_msgs/msg/Imu`.
    #[must_use]
    pub const fn schema(self) -> &'static str {
        self.told().schema
    }

    /// The definition of that type, with those of the messages in it, as MCAP and Foxglove take them.
    #[must_use]
    pub const fn definition(self) -> &'static str {
        self.told().definition
    }

    pub(crate) const fn told(self) -> RosTopic<'static> {
        let [name, schema, definition] = match self {
            Self::Imu => ["/imu/data", IMU, IMU_DEFINITION],
            Self::Transform => [
                "/tf",
                "tf2_msgs/msg/TFMessage",
                include_str!("tf_message.msg"),
            ],
            Self::Odometry => [
                "/odometry",
                super::pose_twist::ODOMETRY,
                include_str!("odometry.msg"),
            ],
            Self::Fix => ["/gps/filtered", nav_sat_fix::NAME, nav_sat_fix::DEFINITION],
        };
        RosTopic {
            name,
            schema,
            definition,
            facts: &NO_FACTS,
        }
    }
}

/// The messages of an estimate with their bytes as CDR behind its four bytes of encapsulation; without bytes where the stamp is
/// beyond the 68 years that ROS can hold.
pub fn messages<'a>(
    estimate: &'a PoseEstimate,
    frames: &'a FrameNames,
) -> impl Iterator<Item = (EstimateTopic, Option<Vec<u8>>)> + 'a {
    EstimateTopic::ALL.into_iter().filter_map(move |topic| {
        let bytes = match topic {
            EstimateTopic::Imu => imu(estimate)?.encode(&frames.body),
            EstimateTopic::Transform => {
                estimate.attitude?;
                transform(estimate, frames)
            }
            EstimateTopic::Odometry => {
                estimate.position?;
                odometry(estimate, frames)
            }
            EstimateTopic::Fix => nav_sat_fix::encode(estimate.place.as_ref()?),
        };
        Some((topic, bytes))
    })
}

fn imu(estimate: &PoseEstimate) -> Option<Imu> {
    Some(Imu {
        time_ns: estimate.time_ns,
        orientation: Some(estimate.attitude?),
        angular_rate: estimate.angular_rate,
        specific_force: estimate.specific_force,
    })
}

fn transform(estimate: &PoseEstimate, frames: &FrameNames) -> Option<Vec<u8>> {
    let mut out = CdrWriter::new();
    out.u32(1);
    header(&mut out, estimate.time_ns, &frames.map)?;
    out.string(&frames.body);
    pose(&mut out, estimate);
    Some(out.into_bytes())
}

/// Position and orientation; without one of them that of the frame `map`.
fn pose(out: &mut CdrWriter, estimate: &PoseEstimate) {
    let position = estimate.position.map_or(Vector3::zeros(), |(p, _)| p);
    let attitude = estimate
        .attitude
        .map_or(UnitQuaternion::identity(), |(q, _)| q);
    out.f64s(position.as_slice());
    let [w, x, y, z] = quaternion_to_file(&attitude);
    out.f64s(&[x, y, z, w]);
}

fn odometry(estimate: &PoseEstimate, frames: &FrameNames) -> Option<Vec<u8>> {
    let stated =
        |known: Option<Matrix3<f64>>, unknown: f64| known.unwrap_or(Matrix3::identity() * unknown);
    let mut out = CdrWriter::new();
    header(&mut out, estimate.time_ns, &frames.map)?;
    out.string(&frames.body);
    pose(&mut out, estimate);
    let place = estimate.position.and_then(|(_, covariance)| covariance);
    let turn = estimate.attitude.and_then(|(_, covariance)| covariance);
    out.f64s(&six(
        &stated(place, UNKNOWN_VARIANCE),
        &stated(turn, UNKNOWN_ANGLE_VARIANCE),
    ));
    // The velocity is told in the axes of the body; how fast it turns is not estimated here.
    let body = estimate
        .attitude
        .map_or(UnitQuaternion::identity(), |(q, _)| q.inverse());
    let velocity = estimate
        .velocity
        .map_or(Vector3::zeros(), |(v, _)| body * v);
    let axes = body.to_rotation_matrix().into_inner();
    let covariance = estimate.velocity.and_then(|(_, covariance)| covariance);
    let covariance = covariance.map(|p| axes * p * axes.transpose());
    out.f64s(velocity.as_slice());
    out.f64s(&[0.0; 3]);
    out.f64s(&six(
        &stated(covariance, UNKNOWN_VARIANCE),
        &(Matrix3::identity() * UNKNOWN_VARIANCE),
    ));
    Some(out.into_bytes())
}

/// Two covariances as one of six, row by row.
fn six(first: &Matrix3<f64>, second: &Matrix3<f64>) -> [f64; 36] {
    std::array::from_fn(|index| match (index / 6, index % 6) {
        (row @ 0..=2, column @ 0..=2) => first[(row, column)],
        (row @ 3..=5, column @ 3..=5) => second[(row - 3, column - 3)],
        _ => 0.0,
    })
}
