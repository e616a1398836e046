//! What a message of ROS 2 measures, as our samples: for bags and for the node.

use super::fluid_pressure;
use super::nav_sat_fix;
use super::pose_twist::{
    self, ODOMETRY, POSE, POSE_WITH_COVARIANCE, QUATERNION, TWIST, TWIST_WITH_COVARIANCE,
};
use super::ros::{IMU, Imu, MAGNETIC_FIELD, MagneticField};
use crate::event::{Event, Reference, Sample};
use crate::local_place::LocalPlace;

/// What is taken from a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Angular rate and specific force of `Imu`, and its orientation as the device's own.
    Inertial,
    /// `MagneticField`.
    Field,
    /// `NavSatFix`.
    Fix,
    /// `TwistStamped` or `TwistWithCovarianceStamped`: the velocity of a satellite receiver, east, north, up.
    Velocity,
    /// `FluidPressure`: static pressure of the air.
    Pressure,
    /// The orientation of `Imu`, `QuaternionStamped`, `PoseStamped`, `PoseWithCovarianceStamped` or `Odometry`, to score
    /// against.
    Reference,
    /// The same as the device's own.
    DeviceOrientation,
    /// The position of `PoseStamped`, `PoseWithCovarianceStamped` or `Odometry` as a fix, in metres from a place.
    LocalPosition,
    /// The same as a position in the world frame.
    Position,
    /// The velocity along the body's x axis of `Odometry`, `TwistStamped` or `TwistWithCovarianceStamped`: wheels.
    ForwardSpeed,
}

impl Role {
    /// A name for messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inertial => "inertial",
            Self::Field => "field",
            Self::Fix => "fix",
            Self::Velocity => "velocity",
            Self::Pressure => "pressure",
            Self::Reference => "reference",
            Self::DeviceOrientation => "device-orientation",
            Self::LocalPosition => "local-position",
            Self::Position => "position",
            Self::ForwardSpeed => "forward-speed",
        }
    }

    /// The types of messages that it is read from.
    #[must_use]
    pub const fn schemas(self) -> &'static [&'static str] {
        match self {
            Self::Inertial => &[IMU],
            Self::Field => &[MAGNETIC_FIELD],
            Self::Fix => &[nav_sat_fix::NAME],
            Self::Velocity => &[TWIST, TWIST_WITH_COVARIANCE],
            Self::Pressure => &[fluid_pressure::NAME],
            Self::Reference | Self::DeviceOrientation => {
                &[IMU, QUATERNION, POSE, POSE_WITH_COVARIANCE, ODOMETRY]
            }
            Self::LocalPosition | Self::Position => &[POSE, POSE_WITH_COVARIANCE, ODOMETRY],
            Self::ForwardSpeed => &[ODOMETRY, TWIST, TWIST_WITH_COVARIANCE],
        }
    }

    pub(super) fn takes(self, schema: &str) -> bool {
        self.schemas().contains(&schema)
    }
}

/// The samples in a message of the type `schema`, one of [`Role::schemas`]: CDR behind its four bytes of encapsulation. A stamp
/// of zero is replaced by `log_time_ns`; of [`Role::LocalPosition`] positions count from `place`. `None` when the bytes are not
/// such a message.
#[must_use]
pub fn measured(
    role: Role,
    schema: &str,
    bytes: &[u8],
    log_time_ns: i64,
    place: Option<&LocalPlace>,
) -> Option<impl Iterator<Item = Event> + use<>> {
    let (time_ns, samples) = match role {
        Role::Inertial => inertial(bytes, log_time_ns)?,
        Role::Field => {
            let field = MagneticField::decode(bytes, log_time_ns)?;
            (field.time_ns, one(Sample::MagneticField(field.field_ut)))
        }
        Role::Fix => {
            let (time_ns, fix) = nav_sat_fix::decode(bytes, log_time_ns)?;
            (time_ns, one(Sample::GnssPosition(fix)))
        }
        Role::Velocity => {
            let has_covariance = schema == TWIST_WITH_COVARIANCE;
            let (time_ns, velocity) = pose_twist::velocity(bytes, log_time_ns, has_covariance)?;
            (time_ns, one(Sample::GnssVelocity(velocity)))
        }
        Role::Pressure => {
            let (time_ns, pressure) = fluid_pressure::decode(bytes, log_time_ns)?;
            (time_ns, one(Sample::Pressure(pressure)))
        }
        Role::LocalPosition => {
            let (time_ns, pose) = pose_twist::position(bytes, log_time_ns, schema)?;
            let fix = place?.fix(pose.position_m, pose.std_m);
            (time_ns, one(Sample::GnssPosition(fix)))
        }
        Role::Position => {
            let (time_ns, pose) = pose_twist::position(bytes, log_time_ns, schema)?;
            (time_ns, one(Sample::Position(pose.position_m.into())))
        }
        Role::ForwardSpeed => {
            let (time_ns, speed) = pose_twist::forward_speed(bytes, log_time_ns, schema)?;
            (time_ns, one(Sample::ForwardSpeed(speed)))
        }
        Role::Reference | Role::DeviceOrientation => {
            let (time_ns, attitude) = match schema {
                IMU => {
                    let imu = Imu::decode(bytes, log_time_ns)?;
                    (imu.time_ns, imu.orientation.map(|(attitude, _)| attitude))
                }
                _ => {
                    let (time_ns, attitude) = pose_twist::attitude(bytes, log_time_ns, schema)?;
                    (time_ns, Some(attitude))
                }
            };
            let sample = attitude.map(|attitude| match role {
                Role::Reference => Sample::Reference(scored(attitude)),
                _ => Sample::DeviceOrientation(attitude),
            });
            (time_ns, [sample, None, None])
        }
    };
    let samples = samples.into_iter().flatten();
    Some(samples.map(move |sample| Event { time_ns, sample }))
}

fn inertial(bytes: &[u8], log_time_ns: i64) -> Option<(i64, [Option<Sample>; 3])> {
    let imu = Imu::decode(bytes, log_time_ns)?;
    let orientation = imu.orientation.map(|(attitude, _)| attitude);
    let samples = [
        imu.angular_rate.map(Sample::AngularRate),
        imu.specific_force.map(Sample::SpecificForce),
        orientation.map(Sample::DeviceOrientation),
    ];
    Some((imu.time_ns, samples))
}

const fn one(sample: Sample) -> [Option<Sample>; 3] {
    [Some(sample), None, None]
}

const fn scored(attitude: nalgebra::UnitQuaternion<f64>) -> Reference {
    Reference {
        attitude,
        scored: true,
    }
}
