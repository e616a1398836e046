//! Dead reckoning behind the interface of all navigation estimators: compass and log make a velocity
//! through the water.

use nalgebra::{Matrix3, Rotation2, UnitQuaternion, Vector2, Vector3};
use northing_core::ConfigError;
use northing_core::earth::{FrameChange, LocalFrame};
use northing_core::faults::leaping_stamp::{LeapingStamp, Stamp};
use northing_core::kalman::{Innovation, SkipReason};
use northing_core::navigation::{DeadReckoning, DeadReckoningConfig, Validity};

use super::navigator::{Aid, NavigationEstimate, Navigator, Told, no_frame};
use crate::statistics::seconds_between;

/// Longest step of the filter, s ...
const STEP_S: f64 = 1.0;
/// ... and that of gaps longer than ten minutes.
const COARSE_STEP_S: f64 = 10.0;
const FINE_S: f64 = 600.0;
/// Stamps further ahead (s) are doubted until another goes on from them.
const LONGEST_LEAP_S: f64 = 10.0;
/// After ten days nothing becomes less certain, s.
const LONGEST_GAP_S: f64 = 864_000.0;
/// Variance of what is not estimated: the height, m^2.
const HEIGHT_VARIANCE: f64 = 1e4;

/// Dead reckoning with its last heading and log.
pub(crate) struct ShipNavigator {
    filter: DeadReckoning<f64>,
    frame: LocalFrame,
    time_ns: Option<i64>,
    stamps: LeapingStamp,
    /// Whether the newest stamp is doubted.
    is_doubted: bool,
    heading: Option<f64>,
    heading_std: f64,
    log: Option<Vector2<f64>>,
    height: f64,
}

impl ShipNavigator {
    pub(crate) fn new(config: DeadReckoningConfig<f64>) -> Result<Self, ConfigError> {
        Ok(Self {
            filter: DeadReckoning::new(config)?,
            frame: no_frame(),
            time_ns: None,
            stamps: LeapingStamp::default(),
            is_doubted: false,
            heading: None,
            heading_std: 0.0,
            log: None,
            height: 0.0,
        })
    }

    /// The velocity through the water where compass and log have both spoken.
    fn set_water_velocity(&mut self) -> Result<(), SkipReason> {
        match (self.heading, self.log) {
            (Some(heading), Some(log)) => {
                let north_east = Rotation2::new(heading) * log;
                self.filter.water_velocity(&north_east)
            }
            _ => Err(SkipReason::NotInitialized),
        }
    }

    fn fuse(&mut self, aid: &Aid) -> Innovation<f64> {
        match *aid {
            Aid::Position {
                ned, std, vertical, ..
            } => {
                if vertical && ned.z.is_finite() {
                    self.height = ned.z;
                }
                self.filter.update_position(&ned.xy(), std.x.max(std.y))
            }
            Aid::Velocity { ned, std, .. } => {
                self.filter.update_velocity(&ned.xy(), std.x.max(std.y))
            }
            Aid::Heading { heading, std } if heading.is_finite() => {
                (self.heading, self.heading_std) = (Some(heading), std);
                taken(self.set_water_velocity())
            }
            Aid::WaterVelocity(log) if log.norm_squared().is_finite() => {
                self.log = Some(log);
                taken(self.set_water_velocity())
            }
            Aid::Heading { .. } | Aid::WaterVelocity(_) => {
                Innovation::skipped(SkipReason::NotFinite)
            }
            _ => Innovation::skipped(SkipReason::NotUsed),
        }
    }
}

/// A measurement that moves no state by itself: taken in, or why not.
fn taken(result: Result<(), SkipReason>) -> Innovation<f64> {
    Innovation::skipped(result.err().unwrap_or(SkipReason::Accumulated))
}

impl Navigator for ShipNavigator {
    fn advance_to(&mut self, time_ns: i64) {
        let stamp = (self.stamps).look(None, self.time_ns, time_ns, LONGEST_LEAP_S);
        self.is_doubted = matches!(stamp, Stamp::Doubted);
        if self.is_doubted {
            return;
        }
        let last = self.time_ns.unwrap_or(time_ns);
        let mut left = seconds_between(last, time_ns).min(LONGEST_GAP_S);
        while left > 0.0 {
            let step = if left > FINE_S { COARSE_STEP_S } else { STEP_S };
            // Steps of this length are never refused.
            let _ = self.filter.propagate(left.min(step));
            left -= step;
        }
        self.time_ns = Some(last.max(time_ns));
    }

    fn origin(&mut self, frame: &LocalFrame, _: i64) -> Option<f64> {
        self.frame = *frame;
        None
    }

    fn move_origin(&mut self, frame: &LocalFrame, change: &FrameChange<f64>, _: i64) {
        self.frame = *frame;
        self.height = self.filter.move_origin(change, self.height);
    }

    fn inertial(&mut self, _: i64, _: &Vector3<f64>, _: &Vector3<f64>, _: &mut Vec<Told>) {}

    /// The time has gone on to it before.
    fn aid(&mut self, _: i64, aid: &Aid, told: &mut Vec<Told>) {
        let done = match self.is_doubted {
            true => Innovation::skipped(SkipReason::Suspect),
            false => self.fuse(aid),
        };
        told.push((aid.kind(), done));
    }

    fn estimate(&mut self) -> Option<NavigationEstimate> {
        let time_ns = self.time_ns?;
        self.filter.state().since_fix_s?;
        let (place, velocity) = (self.filter.position(), self.filter.velocity());
        let mut position_covariance = Matrix3::zeros();
        position_covariance
            .fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&self.filter.position_covariance());
        position_covariance.m33 = HEIGHT_VARIANCE;
        let level = |heading| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
        Some(NavigationEstimate {
            time_ns,
            frame: self.frame,
            ned_from_body: self.heading.map(level),
            attitude_covariance: None,
            velocity_covariance: None,
            heading_std: self.heading.map(|_| self.heading_std),
            position: Vector3::new(place.x, place.y, self.height),
            position_covariance,
            velocity: Vector3::new(velocity.x, velocity.y, 0.0),
            validity: self.filter.validity(),
        })
    }

    fn validity(&self) -> Validity {
        self.filter.validity()
    }
}
