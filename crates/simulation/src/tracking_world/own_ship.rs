//! The own ship of a scene, and the error of the pose that is told of it.

use std::f64::consts::{PI, TAU};

use northing_recording::tracking::OwnShipPose;
use serde::Serialize;

use super::{SceneClass, SceneSensor, motion};
use crate::rotation::sin_cos;
use crate::signals::{Draws, exponential};

/// How the own ship moves: on a line, with its bow swinging about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OwnShip {
    speed_m_s: f64,
    course_rad: f64,
    swing_rad: f64,
    swing_s: f64,
}

impl OwnShip {
    pub(super) fn draw(class: SceneClass, sensor: &SceneSensor, draws: &mut Draws) -> Self {
        let top = match class {
            SceneClass::Aircraft => 0.0,
            class => 0.5 * motion::top_speed_m_s(class),
        };
        let moves = draws.chance(0.7);
        let speed_m_s = draws.uniform(0.0, top);
        Self {
            speed_m_s: if moves { speed_m_s } else { 0.0 },
            course_rad: draws.uniform(-PI, PI),
            swing_rad: draws.uniform(0.0, 0.3),
            swing_s: sensor.scan_interval_s * draws.log_uniform(20.0, 200.0),
        }
    }

    /// Its true pose.
    pub(super) fn pose(&self, time_s: f64) -> OwnShipPose {
        let [north_m, east_m] = motion::polar(self.speed_m_s * time_s, self.course_rad);
        let (swing, _) = sin_cos(TAU * time_s / self.swing_s);
        OwnShipPose {
            north_m,
            east_m,
            heading_rad: self.course_rad + self.swing_rad * swing,
            std: None,
        }
    }
}

/// The error of the own ship's pose: first-order Gauss-Markov on both axes of the position and on the heading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OwnShipError {
    /// Standard deviation of the position on each axis, m.
    pub position_std_m: f64,
    /// Of the heading, deg.
    pub heading_std_deg: f64,
    /// Correlation time of both, scans.
    pub correlation_scans: f64,
    /// Whether the tracker is told the standard deviations; it is never told the correlation time.
    pub is_told: bool,
}

impl OwnShipError {
    pub(super) fn draw(class: SceneClass, sensor: &SceneSensor, draws: &mut Draws) -> Option<Self> {
        let largest_deg = match class {
            SceneClass::Pedestrians | SceneClass::Boats => 10.0,
            SceneClass::Ships => 3.0,
            SceneClass::Aircraft => 1.0,
        };
        let is_wrong = draws.chance(0.5);
        let place_std = sensor.range_std_m.hypot(sensor.extent_std_m);
        let error = Self {
            position_std_m: place_std * draws.log_uniform(0.1, 2.0),
            heading_std_deg: draws.log_uniform(0.02 * largest_deg, largest_deg),
            correlation_scans: draws.log_uniform(10.0, 300.0),
            is_told: !draws.chance(0.15),
        };
        is_wrong.then_some(error)
    }

    pub(super) fn walk(self, mut draws: Draws) -> PoseWalk {
        PoseWalk {
            error: self,
            now: std::array::from_fn(|_| draws.normal()),
            kept: exponential(-1.0 / self.correlation_scans),
            draws,
        }
    }
}

/// The error as it changes from scan to scan.
pub(super) struct PoseWalk {
    error: OwnShipError,
    /// North, east, heading, in standard deviations.
    now: [f64; 3],
    kept: f64,
    draws: Draws,
}

impl PoseWalk {
    /// The pose that is told at the next scan.
    pub(super) fn next(&mut self, pose: OwnShipPose) -> OwnShipPose {
        for sigmas in &mut self.now {
            let fresh = (1.0 - self.kept * self.kept).sqrt();
            *sigmas = self.kept * *sigmas + fresh * self.draws.normal();
        }
        let position = self.error.position_std_m;
        let heading = self.error.heading_std_deg.to_radians();
        let told = [position, position, heading];
        OwnShipPose {
            north_m: pose.north_m + position * self.now[0],
            east_m: pose.east_m + position * self.now[1],
            heading_rad: pose.heading_rad + heading * self.now[2],
            // Who does not know better states an exact pose.
            std: self.error.is_told.then_some(told),
        }
    }
}
