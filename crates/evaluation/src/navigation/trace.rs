//! Trace of a navigation run for plots, thinned as it grows so that memory stays bounded.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use northing_core::attitude::axis_filters::{AxisAngles, tilt_compensated_heading, tilt_of};
use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::rotation::to_yaw_pitch_roll;
use northing_core::kalman::{Innovation, Outcome};
use northing_core::navigation::Validity;

use super::navigator::{AidKind, NavigationEstimate};
use super::observer::{NavigationObserver, ScoredPoint};
use crate::statistics::seconds_between;
use crate::statistics::thinned::Thinned;

/// Estimates are taken at 50 Hz.
const INTERVAL_NS: i64 = 20_000_000;
/// Length of the close look, s.
pub const CLOSE_LOOK_S: f64 = 6.0;
/// The close look waits until the filter has settled, s after the first estimate ...
const CLOSE_LOOK_AFTER_S: f64 = 30.0;
/// ... and the vehicle moves, m/s.
const MOVING: f64 = 1.0;

/// The estimate at one instant; position and velocity north, east, down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavigationPoint {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// Position of the antenna, m from the first fix.
    pub position_m: [f64; 3],
    /// Variances north, east, down and covariance north-east, m^2.
    pub covariance_m2: [f64; 4],
    /// Velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Yaw, pitch, roll, deg.
    pub angles_deg: Option<[f64; 3]>,
    /// Standard deviation of the heading, deg.
    pub heading_std_deg: Option<f64>,
    /// What the position is worth.
    pub validity: Validity,
}

/// A fix, or a place of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixPoint {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// Position, m from the first fix, north, east, down.
    pub position_m: [f64; 3],
    /// Whether the estimator got it.
    pub used: bool,
}

/// An innovation of an aid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AidPoint {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// Measured minus predicted.
    pub residual: [f64; 3],
    /// What was expected of it.
    pub std: [f64; 3],
    /// Components measured.
    pub degrees_of_freedom: u8,
    /// What was done with it.
    pub outcome: Outcome,
}

/// What plots need of one navigation run; watches the run itself.
#[derive(Debug, Clone)]
pub struct NavigationTrace {
    first_ns: Option<i64>,
    first_estimate_s: Option<f64>,
    /// Estimates over time.
    pub points: Thinned<NavigationPoint>,
    /// What the device itself said over time.
    pub device: Thinned<NavigationPoint>,
    /// Time, roll and pitch that the accelerometer gives without a filter, s and deg.
    pub raw_tilt: Thinned<[f64; 3]>,
    /// Time and heading that the magnetometer gives with them, s and deg from magnetic north.
    pub raw_heading: Thinned<[f64; 2]>,
    /// Roll and pitch of the last accelerometer sample, rad.
    last_tilt: Option<(f64, f64)>,
    /// Every estimate of a few seconds.
    pub close_look: Vec<NavigationPoint>,
    /// [`Self::raw_tilt`] in those seconds, every sample.
    pub close_tilt: Vec<[f64; 3]>,
    /// [`Self::raw_heading`] in those seconds.
    pub close_heading: Vec<[f64; 2]>,
    /// Fixes.
    pub fixes: Thinned<FixPoint>,
    /// The reference, if there is one.
    pub reference: Thinned<FixPoint>,
    /// Errors where they were scored.
    pub scored: Thinned<(f64, ScoredPoint)>,
    /// Innovations of each aid.
    pub aids: BTreeMap<AidKind, Thinned<AidPoint>>,
    /// The local frame.
    pub frame: Option<LocalFrame>,
    capacity: usize,
}

impl NavigationTrace {
    /// An empty trace that keeps at most `capacity` points a series.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self {
            first_ns: None,
            first_estimate_s: None,
            points: Thinned::new(capacity),
            device: Thinned::new(capacity),
            raw_tilt: Thinned::new(capacity),
            raw_heading: Thinned::new(capacity),
            last_tilt: None,
            close_look: Vec::new(),
            close_tilt: Vec::new(),
            close_heading: Vec::new(),
            fixes: Thinned::new(capacity),
            reference: Thinned::new(capacity),
            scored: Thinned::new(capacity),
            aids: BTreeMap::new(),
            frame: None,
            capacity,
        }
    }

    fn time_s(&mut self, time_ns: i64) -> f64 {
        let first = *self.first_ns.get_or_insert(time_ns);
        seconds_between(first, time_ns)
    }

    fn place_from_the_first_origin(&self, estimate: &NavigationEstimate) -> Vector3<f64> {
        match &self.frame {
            Some(first) => estimate.in_frame(first).position,
            None => estimate.position,
        }
    }

    fn point(&mut self, estimate: &NavigationEstimate) -> NavigationPoint {
        let c = &estimate.position_covariance;
        let angles = estimate
            .ned_from_body
            .map(|attitude| to_yaw_pitch_roll(&attitude).map(f64::to_degrees));
        NavigationPoint {
            time_s: self.time_s(estimate.time_ns),
            position_m: self.place_from_the_first_origin(estimate).into(),
            covariance_m2: [c.m11, c.m22, c.m33, c.m12],
            velocity_m_s: estimate.velocity.into(),
            angles_deg: angles,
            heading_std_deg: estimate.heading_std.map(f64::to_degrees),
            validity: estimate.validity,
        }
    }

    /// Whether a time is in the close look, which has begun.
    fn is_close(&self, time_s: f64) -> bool {
        let first = self.close_look.first();
        first.is_some_and(|first| time_s <= first.time_s + CLOSE_LOOK_S)
    }

    /// Whether an estimate belongs to the close look: from the first moment at which the vehicle moves
    /// and the filter has settled.
    fn looks_closely(&self, point: &NavigationPoint) -> bool {
        let settled = self
            .first_estimate_s
            .is_some_and(|first| point.time_s > first + CLOSE_LOOK_AFTER_S);
        match self.close_look.first() {
            Some(first) => point.time_s <= first.time_s + CLOSE_LOOK_S,
            None => settled && Vector3::from(point.velocity_m_s).norm() > MOVING,
        }
    }
}

impl NavigationObserver for NavigationTrace {
    fn interval_ns(&self) -> i64 {
        INTERVAL_NS
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        let point = self.point(estimate);
        self.first_estimate_s.get_or_insert(point.time_s);
        if self.looks_closely(&point) {
            self.close_look.push(point);
        }
        self.points.push(|| point);
    }

    fn inertial(&mut self, time_ns: i64, _rate: &Vector3<f64>, force: &Vector3<f64>) {
        let time_s = self.time_s(time_ns);
        let (roll, pitch) = tilt_of(force, AxisAngles::Exact);
        self.last_tilt = roll.map(|roll| (roll, pitch));
        let degrees = |angle: f64| angle.to_degrees();
        let tilt = [time_s, roll.map_or(f64::NAN, degrees), degrees(pitch)];
        if self.is_close(time_s) {
            self.close_tilt.push(tilt);
        }
        self.raw_tilt.push(|| tilt);
    }

    fn magnetic_field(&mut self, time_ns: i64, field: &Vector3<f64>) {
        let time_s = self.time_s(time_ns);
        let tilt = self.last_tilt;
        let heading = tilt.and_then(|(roll, pitch)| tilt_compensated_heading(field, roll, pitch));
        if let Some(heading) = heading {
            let heading = [time_s, heading.to_degrees()];
            if self.is_close(time_s) {
                self.close_heading.push(heading);
            }
            self.raw_heading.push(|| heading);
        }
    }

    fn device(&mut self, estimate: &NavigationEstimate) {
        let point = self.point(estimate);
        self.device.push(|| point);
    }

    fn fix(&mut self, time_ns: i64, ned: &Vector3<f64>, used: bool) {
        let time_s = self.time_s(time_ns);
        let position_m = (*ned).into();
        self.fixes.push(|| FixPoint {
            time_s,
            position_m,
            used,
        });
    }

    fn reference(&mut self, time_ns: i64, ned: &Vector3<f64>) {
        let time_s = self.time_s(time_ns);
        let position_m = (*ned).into();
        self.reference.push(|| FixPoint {
            time_s,
            position_m,
            used: false,
        });
    }

    fn scored(&mut self, point: &ScoredPoint) {
        let time_s = self.time_s(point.time_ns);
        self.scored.push(|| (time_s, *point));
    }

    fn innovation(&mut self, time_ns: i64, aid: AidKind, innovation: &Innovation<f64>) {
        if matches!(innovation.outcome, Outcome::Skipped(_)) {
            return;
        }
        let time_s = self.time_s(time_ns);
        let capacity = self.capacity;
        let series = self.aids.entry(aid);
        series
            .or_insert_with(|| Thinned::new(capacity))
            .push(|| AidPoint {
                time_s,
                residual: innovation.residual.into(),
                std: innovation.residual_std().into(),
                degrees_of_freedom: innovation.degrees_of_freedom,
                outcome: innovation.outcome,
            });
    }

    fn origin(&mut self, frame: &LocalFrame) {
        self.frame = Some(*frame);
    }
}
