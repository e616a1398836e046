//! The microcontroller paper's six filters behind the interface of all navigation estimators.
//!
//! The start is a mean over the first second. Without a magnetometer the heading is the course over
//! ground once the vehicle moves; until then the yaw filter has nothing to hold on to.

use nalgebra::{Matrix3, Vector3};
use northing_core::ConfigError;
use northing_core::attitude::axis_filters::{
    AxisFilters, AxisFiltersConfig, tilt_compensated_heading, tilt_of,
};
use northing_core::earth::{FrameChange, LocalFrame};
use northing_core::faults::leaping_stamp::{LeapingStamp, Stamp};
use northing_core::faults::sample_check::SampleCheck;
use northing_core::faults::{Fault, FaultySensor};
use northing_core::kalman::{Innovation, SkipReason};
use northing_core::navigation::Validity;
use northing_core::navigation::axis_filters::{PositionAxisConfig, PositionAxisFilters};

use super::navigator::{Aid, AidKind, NavigationEstimate, Navigator, Told, no_frame};
use crate::statistics::seconds_between;

/// Gravity, m/s^2.
const STANDARD_GRAVITY: f64 = 9.806_65;
/// Seconds of samples that make the start.
const ALIGNMENT_S: f64 = 1.0;
/// Rates below this while aligning are the bias of a device at rest, rad/s.
const REST_RATE: f64 = 0.1;
/// Above this speed the course is the heading, m/s.
const COURSE_ABOVE: f64 = 3.0;
/// Longest interval between samples that is integrated, s.
const LONGEST_STEP_S: f64 = 1.0;
/// Stamps further ahead (s) are doubted until another goes on from them.
const LONGEST_LEAP_S: f64 = 10.0;

/// Sums over the first samples.
#[derive(Debug, Clone, Copy, Default)]
struct Start {
    since_ns: Option<i64>,
    rate: Vector3<f64>,
    fastest: f64,
    force: Vector3<f64>,
    samples: f64,
    field: Vector3<f64>,
    fields: f64,
}

/// Samples of a sensor, and the last good one, which stands for false ones.
#[derive(Debug, Clone, Copy, Default)]
struct Checked {
    check: SampleCheck<f64>,
    good: Option<Vector3<f64>>,
}

impl Checked {
    /// The sample, or what stands for it.
    fn usable(&mut self, time_ns: i64, sample: &Vector3<f64>) -> Vector3<f64> {
        if !sample.norm_squared().is_finite() || self.check.last_ns() >= Some(time_ns) {
            return *sample;
        }
        if !self.check.check(time_ns, sample).is_measured() {
            return self.good.unwrap_or(*sample);
        }
        self.good = Some(*sample);
        *sample
    }
}

/// The six filters.
pub(crate) struct AxisNavigator {
    config: AxisFiltersConfig<f64>,
    start: Start,
    attitude: Option<AxisFilters<f64>>,
    /// Mean rate of the rest at the start, rad/s.
    rest_rate: Vector3<f64>,
    position: PositionAxisFilters<f64>,
    /// Of angular rate and specific force.
    checks: [Checked; 2],
    stamps: LeapingStamp,
    /// A stamp that was false.
    fault: Option<Fault<f64>>,
    frame: LocalFrame,
    fixes: u64,
    time_ns: Option<i64>,
    has_field: bool,
    has_heading: bool,
}

impl AxisNavigator {
    pub(crate) fn new(
        attitude: AxisFiltersConfig<f64>,
        position: PositionAxisConfig<f64>,
    ) -> Result<Self, ConfigError> {
        // Settings are refused now, not after the start.
        AxisFilters::new(attitude, [0.0; 3])?;
        Ok(Self {
            config: attitude,
            start: Start::default(),
            attitude: None,
            rest_rate: Vector3::zeros(),
            position: PositionAxisFilters::new(position)?,
            checks: [Checked::default(); 2],
            stamps: LeapingStamp::default(),
            fault: None,
            frame: no_frame(),
            fixes: 0,
            time_ns: None,
            has_field: false,
            has_heading: false,
        })
    }

    /// Whether a stamp is far ahead, and no other sample has gone on from it.
    fn leaps(&mut self, time_ns: i64) -> bool {
        let sensor = Some(FaultySensor::Gyroscope);
        let stamp = (self.stamps).look(sensor, self.time_ns, time_ns, LONGEST_LEAP_S);
        if let Stamp::Refutes(fault) = stamp {
            self.fault = fault;
        }
        matches!(stamp, Stamp::Doubted)
    }

    /// Gathers the start; ready once it is long enough.
    fn gather(&mut self, time_ns: i64, rate: &Vector3<f64>, force: &Vector3<f64>) {
        if !(rate.norm_squared().is_finite() && force.norm_squared().is_finite()) {
            return;
        }
        let start = &mut self.start;
        let since = *start.since_ns.get_or_insert(time_ns);
        start.rate += rate;
        start.fastest = start.fastest.max(rate.norm());
        start.force += force;
        start.samples += 1.0;
        if seconds_between(since, time_ns) >= ALIGNMENT_S {
            self.align();
        }
    }

    fn align(&mut self) {
        let start = self.start;
        if start.fastest < REST_RATE {
            self.rest_rate = start.rate / start.samples;
        }
        let (roll, pitch) = tilt_of(&(start.force / start.samples), self.config.angles);
        let roll = roll.unwrap_or(0.0);
        let heading = (start.fields > 0.0)
            .then(|| tilt_compensated_heading(&(start.field / start.fields), roll, pitch))
            .flatten();
        self.has_heading = heading.is_some();
        let yaw = heading.map_or(0.0, |heading| heading + self.config.declination);
        self.attitude = AxisFilters::new(self.config, [roll, pitch, yaw]).ok();
    }

    /// Turns the yaw to a heading: at once the first time, then as a measurement.
    fn head(&mut self, heading: f64) -> Innovation<f64> {
        let Some(filters) = &mut self.attitude else {
            return Innovation::skipped(SkipReason::NotInitialized);
        };
        if !self.has_heading && heading.is_finite() {
            let [roll, pitch, _] = filters.axes().map(|axis| axis.angle);
            if let Ok(turned) = AxisFilters::new(self.config, [roll, pitch, heading]) {
                *filters = turned;
                self.has_heading = true;
            }
        }
        filters.update_heading(heading)
    }

    fn field(&mut self, field: &Vector3<f64>) -> Innovation<f64> {
        self.has_field = true;
        match &mut self.attitude {
            Some(filters) => filters.update_magnetometer(field),
            None => {
                if field.norm_squared().is_finite() {
                    self.start.field += field;
                    self.start.fields += 1.0;
                }
                Innovation::skipped(SkipReason::NotInitialized)
            }
        }
    }

    fn fuse(&mut self, aid: &Aid) -> Innovation<f64> {
        match *aid {
            Aid::Position { ned, vertical, .. } => {
                if self.attitude.is_none() {
                    return Innovation::skipped(SkipReason::NotInitialized);
                }
                self.fixes += 1;
                // Without a height the estimate's own says nothing new downwards.
                let down = if vertical {
                    ned.z
                } else {
                    self.position.position().z
                };
                let place = Vector3::new(ned.x, ned.y, down);
                self.position.update_position(self.fixes, &place)
            }
            Aid::Velocity { ned, .. } => {
                if self.has_field || ned.xy().norm() < COURSE_ABOVE {
                    return Innovation::skipped(SkipReason::NotUsed);
                }
                self.head(ned.y.atan2(ned.x))
            }
            Aid::MagneticField(field) => self.field(&field),
            Aid::Heading { heading, .. } => self.head(heading),
            _ => Innovation::skipped(SkipReason::NotUsed),
        }
    }
}

impl Navigator for AxisNavigator {
    fn take_fault(&mut self) -> Option<Fault<f64>> {
        self.fault.take()
    }

    fn inertial(
        &mut self,
        time_ns: i64,
        rate: &Vector3<f64>,
        force: &Vector3<f64>,
        told: &mut Vec<Told>,
    ) {
        if self.leaps(time_ns) {
            return;
        }
        let last = self.time_ns.replace(time_ns);
        let [rates, forces] = &mut self.checks;
        let (rate, force) = (&rates.usable(time_ns, rate), &forces.usable(time_ns, force));
        let Some(filters) = &mut self.attitude else {
            self.gather(time_ns, rate, force);
            return;
        };
        let passed = last.map_or(0.0, |last| seconds_between(last, time_ns));
        let dt = passed.min(LONGEST_STEP_S);
        if filters.propagate(&(rate - self.rest_rate), dt).is_ok() {
            told.push((AidKind::Accelerometer, filters.update_accelerometer(force)));
            // A force that is refused leaves the position where it is; the next one moves it on.
            let _ = self
                .position
                .propagate(&filters.attitude(), force, STANDARD_GRAVITY, dt);
        }
    }

    fn origin(&mut self, frame: &LocalFrame, _: i64) -> Option<f64> {
        self.frame = *frame;
        None
    }

    /// The angles stay: accelerometer and compass are those of the place.
    fn move_origin(&mut self, frame: &LocalFrame, change: &FrameChange<f64>, _: i64) {
        self.frame = *frame;
        self.position.move_origin(change);
    }

    fn aid(&mut self, _: i64, aid: &Aid, told: &mut Vec<Told>) {
        told.push((aid.kind(), self.fuse(aid)));
    }

    fn estimate(&mut self) -> Option<NavigationEstimate> {
        let filters = self.attitude.as_ref()?;
        if self.position.validity() == Validity::Aligning {
            return None;
        }
        let variances = self.position.axes().map(|axis| axis.covariance.m11);
        let [_, _, yaw] = filters.axes();
        Some(NavigationEstimate {
            time_ns: self.time_ns?,
            frame: self.frame,
            ned_from_body: Some(filters.attitude()),
            attitude_covariance: None,
            velocity_covariance: None,
            heading_std: Some(yaw.covariance[0].max(0.0).sqrt()),
            position: self.position.position(),
            position_covariance: Matrix3::from_diagonal(&Vector3::from(variances)),
            velocity: self.position.velocity(),
            validity: self.position.validity(),
        })
    }

    fn validity(&self) -> Validity {
        self.position.validity()
    }
}
