//! Tracks as messages of ROS 2 in MCAP: of track 17 `/track_17/odometry` (`Odometry`, in the level frame `map`: x east, y north)
//! and, where the place on the Earth is known, `/track_17/fix` (`NavSatFix`).

use std::collections::BTreeMap;
use std::path::Path;

use ::mcap::McapError;
use nalgebra::{Matrix3, Vector3};

use super::super::LocalPlane;
use super::{TargetInstant, TargetOutput, TargetPoint};
use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::mcap::estimate_messages::{EstimateTopic, FrameNames, messages};
use crate::mcap::output::{Output, RosTopic, io_error, options};
use crate::pose::{PoseEstimate, UNKNOWN_VARIANCE};
use crate::track::TrackPoint;

pub(super) struct Messages {
    file: String,
    output: Output<AtomicFile, (u32, EstimateTopic)>,
    plane: Option<LocalPlane>,
}

impl Messages {
    pub(super) fn create(path: &Path, plane: Option<LocalPlane>, force: bool) -> Result<Self> {
        let file = path.display().to_string();
        let output = AtomicFile::create(path, force)?;
        let output = Output::new(output, options().profile("ros2"), BTreeMap::new())
            .map_err(|error| failed(&file, error))?;
        Ok(Self {
            file,
            output,
            plane,
        })
    }

    fn target(&mut self, time_ns: i64, target: &TargetPoint) -> Result<()> {
        let estimate = estimate(time_ns, target, self.plane.as_ref());
        let frames = FrameNames {
            body: format!("track_{}", target.track),
            ..FrameNames::default()
        };
        for (topic, bytes) in messages(&estimate, &frames) {
            let bytes = bytes.ok_or_else(|| {
                let problem = "a stamp is beyond the 68 years that ROS can hold; write .csv";
                RecordingError::unsupported(&self.file, problem)
            })?;
            let last = match topic {
                EstimateTopic::Fix => "fix",
                _ => "odometry",
            };
            let told = RosTopic {
                name: &format!("/track_{}/{last}", target.track),
                ..topic.told()
            };
            let key = (target.track, topic);
            let written = self.output.ros_message(key, time_ns, &bytes, &told);
            written.map_err(|error| failed(&self.file, error))?;
        }
        Ok(())
    }
}

/// Without attitude: messages of place and velocity alone, in axes that look east and north.
fn estimate(time_ns: i64, target: &TargetPoint, plane: Option<&LocalPlane>) -> PoseEstimate {
    let level = |[north, east]: [f64; 2]| Vector3::new(east, north, 0.0);
    let covariance = |[n, e]: [usize; 2]| {
        let p = &target.covariance;
        let mut out = Matrix3::identity() * UNKNOWN_VARIANCE;
        (out[(0, 0)], out[(1, 1)]) = (p[e][e], p[n][n]);
        (out[(0, 1)], out[(1, 0)]) = (p[n][e], p[n][e]);
        out
    };
    PoseEstimate {
        time_ns,
        position: Some((level(target.place_m), Some(covariance([0, 2])))),
        velocity: Some((level(target.velocity_m_s), Some(covariance([1, 3])))),
        place: plane.map(|plane| fix(time_ns, target, plane)),
        ..PoseEstimate::default()
    }
}

fn fix(time_ns: i64, target: &TargetPoint, plane: &LocalPlane) -> TrackPoint {
    let [latitude, longitude] = plane.degrees(target.place_m[0], target.place_m[1]);
    let [nn, _, ee] = target.place_covariance();
    TrackPoint {
        time_ns,
        latitude_rad: latitude.to_radians(),
        longitude_rad: longitude.to_radians(),
        height_m: f64::NAN,
        std_m: Some([nn.sqrt(), ee.sqrt(), UNKNOWN_VARIANCE.sqrt()]),
        attitude: None,
    }
}

impl TargetOutput for Messages {
    fn instant(&mut self, instant: &TargetInstant) -> Result<()> {
        let mut each = instant.targets.iter().filter(|target| target.is_reported);
        each.try_for_each(|target| self.target(instant.time_ns, target))
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        let finished = self.output.finish();
        finished.map_err(|error| failed(&self.file, error))?;
        self.output.into_inner().commit()
    }
}

fn failed(file: &str, error: McapError) -> RecordingError {
    RecordingError::io(file, "write it", io_error(error))
}
