//! What every navigation estimator does, whatever is inside: takes inertial samples and aids, says where
//! the body is.

use std::str::FromStr;

use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
use northing_core::earth::{FrameChange, Geodetic, LocalFrame};
use northing_core::faults::Fault;
use northing_core::geometry::frames::{enu_from_ned, enu_from_ned_rotation, flu_from_frd_rotation};
use northing_core::kalman::Innovation;
use northing_core::navigation::Validity;
use northing_recording::pose::{PoseEstimate, UNKNOWN_ANGLE_VARIANCE};
use northing_recording::track::TrackPoint;
use serde::Serialize;

use super::batch_smoother::SmoothingSummary;
use crate::statistics::nis::UpdateCounts;

/// A measurement that aids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aid {
    /// Position of the antenna, m, north, east, down.
    Position {
        /// The position; down is not looked at without `vertical`.
        ned: Vector3<f64>,
        /// Standard deviations, m.
        std: Vector3<f64>,
        /// Whether the receiver observes the height.
        vertical: bool,
        /// Whether the receiver itself stated the standard deviations.
        stated: bool,
    },
    /// Velocity of the antenna over ground, m/s, north, east, down.
    Velocity {
        /// The velocity; down is not looked at without `vertical`.
        ned: Vector3<f64>,
        /// Standard deviations, m/s.
        std: Vector3<f64>,
        /// Whether the receiver observes the vertical part.
        vertical: bool,
    },
    /// Magnetic field, microtesla, body axes.
    MagneticField(Vector3<f64>),
    /// Heading from true north, rad.
    Heading {
        /// Clockwise from north.
        heading: f64,
        /// Standard deviation, rad.
        std: f64,
    },
    /// Static pressure, Pa.
    Pressure(f64),
    /// Speed over ground along the body's forward axis, m/s.
    ForwardSpeed(f64),
    /// Velocity through the water, forward and to starboard, m/s.
    WaterVelocity(Vector2<f64>),
}

crate::named! {
    /// Which aid, by the name in summaries.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum AidKind {
        /// [`Aid::Position`], horizontally
        GnssPosition = "gnss-position",
        /// Its height, where that has a gate of its own.
        GnssHeight = "gnss-height",
        /// [`Aid::Velocity`]
        GnssVelocity = "gnss-velocity",
        /// [`Aid::MagneticField`]
        Magnetometer = "magnetometer",
        /// [`Aid::Heading`]
        Heading = "heading",
        /// [`Aid::Pressure`]
        Barometer = "barometer",
        /// [`Aid::ForwardSpeed`]
        ForwardSpeed = "forward-speed",
        /// [`Aid::WaterVelocity`]
        WaterVelocity = "water-velocity",
        /// The accelerometer as a measurement of tilt.
        Accelerometer = "accelerometer",
        /// The vehicle stands still.
        ZeroVelocity = "zero-velocity",
        /// A vehicle on wheels moves neither sideways nor up.
        NonHolonomic = "non-holonomic",
    }
}

impl AidKind {
    /// Those that a recording can hold, and that can therefore be left out.
    pub const MEASURED: &'static [Self] = Self::ALL.split_at(8).0;
}

/// One of [`AidKind::MEASURED`] by its name.
impl FromStr for AidKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::named(text).filter(|kind| Self::MEASURED.contains(kind));
        found.ok_or_else(|| {
            let names: Vec<&str> = Self::MEASURED.iter().map(|kind| kind.name()).collect();
            let names = names.join(", ");
            format!("unknown aid `{text}`; expected one of: {names}")
        })
    }
}

impl Aid {
    /// Which it is.
    #[must_use]
    pub const fn kind(&self) -> AidKind {
        match self {
            Self::Position { .. } => AidKind::GnssPosition,
            Self::Velocity { .. } => AidKind::GnssVelocity,
            Self::MagneticField(_) => AidKind::Magnetometer,
            Self::Heading { .. } => AidKind::Heading,
            Self::Pressure(_) => AidKind::Barometer,
            Self::ForwardSpeed(_) => AidKind::ForwardSpeed,
            Self::WaterVelocity(_) => AidKind::WaterVelocity,
        }
    }
}

/// Where the body is, and how sure that is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavigationEstimate {
    /// Time stamp, ns.
    pub time_ns: i64,
    /// The local frame of all that follows: its origin is within a kilometre of the vehicle.
    pub frame: LocalFrame,
    /// `ned_from_body`; `None` from an estimator without attitude.
    pub ned_from_body: Option<UnitQuaternion<f64>>,
    /// Standard deviation of the heading, rad, if stated.
    pub heading_std: Option<f64>,
    /// Covariance of the attitude's error about north, east, down, rad^2, if stated.
    pub attitude_covariance: Option<Matrix3<f64>>,
    /// Position of the antenna, m, north, east, down.
    pub position: Vector3<f64>,
    /// Covariance of the position, m^2.
    pub position_covariance: Matrix3<f64>,
    /// Velocity of the antenna, m/s, north, east, down.
    pub velocity: Vector3<f64>,
    /// Its covariance, (m/s)^2, if stated: that of the inertial sensor's velocity, to which a lever arm adds little.
    pub velocity_covariance: Option<Matrix3<f64>>,
    /// What the position is worth.
    pub validity: Validity,
}

impl NavigationEstimate {
    /// Where it says that the antenna is a moment (s) later or earlier, with the velocity it has.
    #[must_use]
    pub fn position_after(&self, seconds: f64) -> Vector3<f64> {
        self.position + self.velocity * seconds
    }

    /// The same in another local frame.
    #[must_use]
    pub fn in_frame(&self, frame: &LocalFrame) -> Self {
        if self.frame.origin() == frame.origin() {
            return *self;
        }
        let change = FrameChange::between(&self.frame, frame);
        Self {
            frame: *frame,
            ned_from_body: self
                .ned_from_body
                .map(|attitude| change.attitude(&attitude)),
            position: change.position(&self.position),
            position_covariance: change.covariance(&self.position_covariance),
            attitude_covariance: self.attitude_covariance.map(|p| change.covariance(&p)),
            velocity: change.vector(&self.velocity),
            velocity_covariance: self.velocity_covariance.map(|p| change.covariance(&p)),
            ..*self
        }
    }

    /// Heading of the body's forward axis, rad, clockwise from north.
    #[must_use]
    pub fn heading(&self) -> Option<f64> {
        self.ned_from_body.map(|attitude| {
            let forward = attitude * Vector3::x();
            forward.y.atan2(forward.x)
        })
    }
}

impl NavigationEstimate {
    /// In the axes of ROS: metres east, north, up of the origin of `first`; the body forward, left, up.
    #[must_use]
    pub fn pose(&self, first: &LocalFrame) -> PoseEstimate {
        let here = self.in_frame(first);
        let turn = enu_from_ned_rotation::<f64>();
        let axes = turn.to_rotation_matrix().into_inner();
        let covariance = |p: Matrix3<f64>| axes * p * axes.transpose();
        let attitude = here.ned_from_body.map(|ned_from_frd| {
            let about = here.attitude_covariance.or_else(|| {
                let heading = self.heading_std?;
                let angles = [
                    UNKNOWN_ANGLE_VARIANCE,
                    UNKNOWN_ANGLE_VARIANCE,
                    heading * heading,
                ];
                Some(Matrix3::from_diagonal(&Vector3::from(angles)))
            });
            let enu_from_flu = turn * ned_from_frd * flu_from_frd_rotation();
            (enu_from_flu, about.map(covariance))
        });
        PoseEstimate {
            time_ns: self.time_ns,
            attitude,
            position: Some((
                enu_from_ned(&here.position),
                Some(covariance(here.position_covariance)),
            )),
            velocity: Some((
                enu_from_ned(&here.velocity),
                here.velocity_covariance.map(covariance),
            )),
            place: Some(self.track_point()),
            ..PoseEstimate::default()
        }
    }

    /// The place on the Earth.
    #[must_use]
    pub fn track_point(&self) -> TrackPoint {
        let place = self.frame.geodetic(&self.position);
        let variances = self.position_covariance.diagonal();
        TrackPoint {
            time_ns: self.time_ns,
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: place.height_m,
            std_m: Some(variances.map(|v| v.max(0.0).sqrt()).into()),
            attitude: self.ned_from_body,
        }
    }
}

/// An update and what it told.
pub type Told = (AidKind, Innovation<f64>);

/// The local frame of an estimator that has not been told the origin.
pub(crate) fn no_frame() -> LocalFrame {
    LocalFrame::new(Geodetic {
        latitude_rad: 0.0,
        longitude_rad: 0.0,
        height_m: 0.0,
    })
}

/// A navigation estimator.
pub(crate) trait Navigator {
    /// Takes an angular rate (rad/s) and a specific force (m/s^2), forward, right, down. What it then does by
    /// itself (standstill, vehicle constraint) goes to `told`.
    fn inertial(
        &mut self,
        time_ns: i64,
        rate: &Vector3<f64>,
        force: &Vector3<f64>,
        told: &mut Vec<Told>,
    );

    /// Takes a specific force (m/s^2) while the gyroscope pauses; estimators without a model of the unseen turn wait.
    fn force_without_rate(&mut self, _time_ns: i64, _force: &Vector3<f64>) {}

    /// The oldest fault of the inertial samples that was not taken yet.
    fn take_fault(&mut self) -> Option<Fault<f64>> {
        None
    }

    /// Takes what the device itself said; estimators that measure do not look at it.
    fn device(&mut self, _estimate: &NavigationEstimate) {}

    /// Lets the time go on, where nothing else does that.
    fn advance_to(&mut self, _time_ns: i64) {}

    /// Learns the local frame, with the stamp of the fix that is its origin; returns the magnetic
    /// declination (rad) that follows, where it is used.
    fn origin(&mut self, frame: &LocalFrame, time_ns: i64) -> Option<f64>;

    /// Goes on in another local frame, whose origin is near the vehicle; positions and velocities that come now are in it.
    fn move_origin(&mut self, frame: &LocalFrame, change: &FrameChange<f64>, time_ns: i64);

    /// Takes an aid; what it told goes to `told`.
    fn aid(&mut self, time_ns: i64, aid: &Aid, told: &mut Vec<Told>);

    /// Where the body is at the last sample; `None` before the start.
    fn estimate(&mut self) -> Option<NavigationEstimate>;

    /// Every smoothed estimate, in time order, and how that went; empty unless it was told to remember.
    fn smoothed(&mut self) -> (Vec<NavigationEstimate>, Option<SmoothingSummary>) {
        (Vec::new(), None)
    }

    /// What the position is worth now.
    fn validity(&self) -> Validity;

    /// Updates that it made by itself, of which nobody was told.
    fn own_counts(&self) -> Vec<(AidKind, UpdateCounts)> {
        Vec::new()
    }

    /// What was odd, one sentence each.
    fn issues(&self) -> Vec<String> {
        Vec::new()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use northing_core::geometry::rotation;

    pub(crate) fn estimate(frame: LocalFrame) -> NavigationEstimate {
        NavigationEstimate {
            time_ns: 1_500_000_000,
            frame,
            // Bow to the east, and 10 degrees up.
            ned_from_body: Some(rotation::from_yaw_pitch_roll([
                std::f64::consts::FRAC_PI_2,
                10_f64.to_radians(),
                0.0,
            ])),
            heading_std: Some(0.3),
            attitude_covariance: Some(Matrix3::new(
                0.01, 0.001, 0.0, 0.001, 0.02, 0.002, 0.0, 0.002, 0.09,
            )),
            position: Vector3::new(10.0, 20.0, -5.0),
            position_covariance: Matrix3::new(1.0, 0.5, 0.1, 0.5, 4.0, 0.2, 0.1, 0.2, 9.0),
            velocity: Vector3::new(0.0, 3.0, 0.0),
            velocity_covariance: None,
            validity: Validity::HeadingUnknown,
        }
    }

    pub(crate) fn frame() -> LocalFrame {
        LocalFrame::new(Geodetic::from_degrees(47.0, 8.0, 400.0).unwrap())
    }

    #[test]
    fn a_pose_of_ros_is_east_north_up_and_forward_left_up() {
        let said = estimate(frame()).pose(&frame());
        let (attitude, about) = said.attitude.unwrap();
        let (position, covariance) = said.position.unwrap();
        let near = |a: Vector3<f64>, b: [f64; 3]| (a - Vector3::from(b)).norm() < 1e-9;
        assert!(near(position, [20.0, 10.0, 5.0]));
        let (sin, cos) = 10_f64.to_radians().sin_cos();
        assert!(near(attitude * Vector3::x(), [cos, 0.0, sin]), "forward");
        assert!(
            near(attitude * Vector3::y(), [0.0, 1.0, 0.0]),
            "left is north"
        );
        assert!(near(attitude * Vector3::z(), [-sin, 0.0, cos]), "up");
        let expected = Matrix3::new(4.0, 0.5, -0.2, 0.5, 1.0, -0.1, -0.2, -0.1, 9.0);
        assert!((covariance.unwrap() - expected).norm() < 1e-12);
        let expected = Matrix3::new(0.02, 0.001, -0.002, 0.001, 0.01, 0.0, -0.002, 0.0, 0.09);
        assert!((about.unwrap() - expected).norm() < 1e-12);
        assert!(near(said.velocity.unwrap().0, [3.0, 0.0, 0.0]));
        // Where only the heading's deviation is stated, nothing is known of roll and pitch.
        let heading_alone = NavigationEstimate {
            attitude_covariance: None,
            ..estimate(frame())
        };
        let about = heading_alone.pose(&frame()).attitude.unwrap().1.unwrap();
        assert!((about.m33 - 0.09).abs() < 1e-12 && about.m11 > 3.0 && about.m22 > 3.0);
        let without = NavigationEstimate {
            ned_from_body: None,
            ..heading_alone
        };
        assert!(without.pose(&frame()).attitude.is_none());
    }
}
