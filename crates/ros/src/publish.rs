//! What is published of each estimate: `/imu/data`, `/tf`, `/odometry`, `/gps/filtered`.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;
use northing_core::earth::LocalFrame;
use northing_core::kalman::Innovation;
use northing_evaluation::navigation::{AidKind, NavigationEstimate, NavigationObserver};
use northing_evaluation::{EstimateRecord, InnovationRecord, RunObserver};
use northing_recording::mcap::{EstimateTopic, FrameNames, messages};
use northing_recording::{PoseEstimate, WorldFrame};

use crate::diagnostics::Diagnostics;
use crate::node::{Node, Publishers};

/// The frames in what is published.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Frames {
    /// The level frame. `None`: `map`.
    pub map: Option<String>,
    /// The body. `None`: `base_link` where static transforms lead to it, otherwise the frame of the inertial sensor's messages; that is
    /// what is estimated.
    pub body: Option<String>,
    /// Whether transforms are published.
    pub no_transforms: bool,
}

/// Publishes poses and counts them.
struct Poses {
    publishers: Publishers,
    diagnostics: Arc<Mutex<Diagnostics>>,
    frames: Frames,
    names: FrameNames,
    /// Whether the body's name is settled.
    is_named: bool,
    /// From the body's frame to the antenna, m.
    antenna_m: Option<Vector3<f64>>,
}

impl Poses {
    fn new(node: &Node, frames: &Frames) -> Self {
        let usual = FrameNames::default();
        let mounting = node.mounting();
        let body = frames.body.clone().or(mounting.base().map(str::to_owned));
        Self {
            publishers: node.publishers.clone(),
            diagnostics: node.diagnostics(),
            frames: frames.clone(),
            names: FrameNames {
                map: frames.map.clone().unwrap_or(usual.map),
                body: body.clone().unwrap_or(usual.body),
            },
            is_named: body.is_some(),
            antenna_m: mounting.antenna_m(),
        }
    }

    fn publish(&mut self, mut pose: PoseEstimate) {
        {
            let mut diagnostics = self
                .diagnostics
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            diagnostics.estimated();
            if let Some(measured) = diagnostics.measured_at(pose.time_ns) {
                pose.angular_rate = measured.angular_rate;
                pose.specific_force = measured.specific_force;
            }
            if let (false, Some(frame)) = (self.is_named, diagnostics.frame())
                && self.names.body != frame
            {
                frame.clone_into(&mut self.names.body);
            }
        }
        if let Some(antenna) = &self.antenna_m {
            pose.move_from_antenna(antenna);
        }
        for (topic, bytes) in messages(&pose, &self.names) {
            let is_wanted = !(self.frames.no_transforms && topic == EstimateTopic::Transform);
            if let Some(bytes) = bytes.filter(|_| is_wanted)
                && !self.publishers.publish(topic, bytes)
            {
                let mut diagnostics =
                    (self.diagnostics.lock()).unwrap_or_else(PoisonError::into_inner);
                diagnostics.refused(topic);
            }
        }
    }

    fn updated(&self, sensor: &'static str, innovation: &Innovation<f64>) {
        let mut diagnostics = self
            .diagnostics
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        diagnostics.updated(sensor, innovation);
    }
}

/// Publishes the attitude at every sample of the gyroscope.
pub struct AttitudePublisher(Poses);

impl AttitudePublisher {
    /// Through this node.
    #[must_use]
    pub fn new(node: &Node, frames: &Frames) -> Self {
        Self(Poses::new(node, frames))
    }
}

impl std::fmt::Debug for AttitudePublisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AttitudePublisher").finish_non_exhaustive()
    }
}

impl RunObserver for AttitudePublisher {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.0.publish(record.pose(WorldFrame::Enu));
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        self.0.updated(record.sensor.name(), &record.innovation);
    }
}

/// Publishes position, velocity and attitude.
pub struct NavigationPublisher {
    poses: Poses,
    interval_ns: i64,
    origin: Option<LocalFrame>,
}

impl NavigationPublisher {
    /// Through this node, at most `rate_hz` times a second.
    #[must_use]
    pub fn new(node: &Node, frames: &Frames, rate_hz: f64) -> Self {
        Self {
            poses: Poses::new(node, frames),
            // Half a sample less, so that a rate near that of the sensor is met.
            interval_ns: (0.9e9 / rate_hz) as i64,
            origin: None,
        }
    }
}

impl std::fmt::Debug for NavigationPublisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NavigationPublisher")
            .finish_non_exhaustive()
    }
}

impl NavigationObserver for NavigationPublisher {
    fn interval_ns(&self) -> i64 {
        self.interval_ns
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        let mut diagnostics =
            (self.poses.diagnostics.lock()).unwrap_or_else(PoisonError::into_inner);
        diagnostics.validity(estimate.validity);
        drop(diagnostics);
        let origin = self.origin.unwrap_or(estimate.frame);
        self.poses.publish(estimate.pose(&origin));
    }

    fn innovation(&mut self, _: i64, aid: AidKind, innovation: &Innovation<f64>) {
        self.poses.updated(aid.name(), innovation);
    }

    fn origin(&mut self, frame: &LocalFrame) {
        self.origin = Some(*frame);
    }
}
