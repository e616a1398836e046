//! Writes estimates of a run as an MCAP file of ROS 2 messages, for Foxglove, `evo` and ROS itself.
//!
//! Topics: `/imu/data` (`Imu` with nothing but the orientation), `/tf` (`TFMessage`), `/odometry` (`Odometry`) where there is a
//! position, `/gps/filtered` (`NavSatFix`) where the place on the Earth is known. Frames: `map`, level, x east, y north, z up;
//! `base_link`, the body. Read first: REP 103 and REP 105.

use std::collections::BTreeMap;
use std::path::Path;

use ::mcap::McapError;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::cdr::CdrWriter;
use super::nav_sat_fix;
use super::output::{Output, io_error, options};
use super::ros::{IMU, IMU_DEFINITION, Imu, header};
use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::track::TrackPoint;
use crate::writer::quaternion_to_file;

const MAP: &str = "map";
const BODY: &str = "base_link";

/// Variance of an angle of which nothing is known, rad^2: that of one anywhere on the circle.
pub const UNKNOWN_ANGLE_VARIANCE: f64 = std::f64::consts::PI * std::f64::consts::PI / 3.0;
/// Variance of a position or velocity of which none is stated, m^2, (m/s)^2 and (rad/s)^2: `Odometry` has no way to say so.
pub const UNKNOWN_VARIANCE: f64 = 1e9;

/// An estimate of an instant.
#[derive(Debug, Clone, Copy, Default)]
pub struct PoseEstimate {
    /// Stamp, ns.
    pub time_ns: i64,
    /// `enu_from_body`, and the covariance of its error about east, north, up, rad^2, where it is stated.
    pub attitude: Option<(UnitQuaternion<f64>, Option<Matrix3<f64>>)>,
    /// East, north, up of the origin, m, and its covariance, m^2.
    pub position: Option<(Vector3<f64>, Option<Matrix3<f64>>)>,
    /// East, north, up, m/s, and its covariance, (m/s)^2.
    pub velocity: Option<(Vector3<f64>, Option<Matrix3<f64>>)>,
    /// The place on the Earth.
    pub place: Option<TrackPoint>,
}

/// Where messages go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Topic {
    Imu,
    Transform,
    Odometry,
    Fix,
}

impl Topic {
    /// The topic, its schema and that schema's definition.
    const fn told(self) -> [&'static str; 3] {
        match self {
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
        }
    }
}

/// A file of estimates.
pub struct EstimateWriter {
    output: Output<AtomicFile, Topic>,
    file: String,
}

impl EstimateWriter {
    /// Creates the file; it appears under its name at [`Self::finish`].
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        let file = path.display().to_string();
        let output = AtomicFile::create(path, force)?;
        let output = Output::new(output, options().profile("ros2"), BTreeMap::new())
            .map_err(|error| failed(&file, error))?;
        Ok(Self { output, file })
    }

    /// Adds an estimate.
    ///
    /// # Errors
    /// The output refuses, or the stamp is beyond the 68 years that ROS can hold.
    pub fn write(&mut self, estimate: &PoseEstimate) -> Result<()> {
        let time_ns = estimate.time_ns;
        if estimate.attitude.is_some() {
            let imu = Imu {
                time_ns,
                orientation: estimate.attitude,
                ..Imu::default()
            };
            self.message(Topic::Imu, time_ns, imu.encode(BODY))?;
            self.message(Topic::Transform, time_ns, transform(estimate))?;
        }
        if estimate.position.is_some() {
            self.message(Topic::Odometry, time_ns, odometry(estimate))?;
        }
        if let Some(place) = &estimate.place {
            self.message(Topic::Fix, time_ns, nav_sat_fix::encode(place))?;
        }
        Ok(())
    }

    fn message(&mut self, topic: Topic, time_ns: i64, bytes: Option<Vec<u8>>) -> Result<()> {
        let bytes = bytes.ok_or_else(|| {
            RecordingError::unsupported(
                &self.file,
                "a stamp is beyond the 68 years that ROS can hold; write .csv",
            )
        })?;
        let written = self.output.message(topic, time_ns, &bytes, |file| {
            let [name, schema, definition] = topic.told();
            let schema = file.add_schema(schema, "ros2msg", definition.as_bytes())?;
            file.add_channel(schema, name, "cdr", &BTreeMap::new())
        });
        written.map_err(|error| failed(&self.file, error))
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The output refuses.
    pub fn finish(mut self) -> Result<()> {
        let finished = self.output.finish();
        finished.map_err(|error| failed(&self.file, error))?;
        self.output.into_inner().commit()
    }
}

impl std::fmt::Debug for EstimateWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = f.debug_struct("EstimateWriter");
        text.field("file", &self.file).finish_non_exhaustive()
    }
}

fn failed(file: &str, error: McapError) -> RecordingError {
    RecordingError::io(file, "write it", io_error(error))
}

fn transform(estimate: &PoseEstimate) -> Option<Vec<u8>> {
    let mut out = CdrWriter::new();
    out.u32(1);
    header(&mut out, estimate.time_ns, MAP)?;
    out.string(BODY);
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

fn odometry(estimate: &PoseEstimate) -> Option<Vec<u8>> {
    let stated =
        |known: Option<Matrix3<f64>>, unknown: f64| known.unwrap_or(Matrix3::identity() * unknown);
    let mut out = CdrWriter::new();
    header(&mut out, estimate.time_ns, MAP)?;
    out.string(BODY);
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
