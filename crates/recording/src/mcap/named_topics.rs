//! The topics that a manifest names, sensor by sensor, and poses whose positions are fixes.

use std::collections::BTreeMap;

use super::measured::Role;
use super::pose_twist::{ODOMETRY, POSE, POSE_WITH_COVARIANCE};
use super::ros_source::Read;
use super::topics::{Bag, Topics};
use crate::error::{RecordingError, Result, join, shown};
use crate::event::SensorKind;
use crate::local_place::LocalPlace;

/// Sensors that a topic can be named for, and what is taken from it.
const ROLES: [(SensorKind, Role); 10] = [
    (SensorKind::Gyroscope, Role::Inertial),
    (SensorKind::Accelerometer, Role::Inertial),
    (SensorKind::Magnetometer, Role::Field),
    (SensorKind::GnssPosition, Role::Fix),
    (SensorKind::GnssVelocity, Role::Velocity),
    (SensorKind::ForwardSpeed, Role::ForwardSpeed),
    (SensorKind::Pressure, Role::Pressure),
    (SensorKind::Position, Role::Position),
    (SensorKind::DeviceOrientation, Role::DeviceOrientation),
    (SensorKind::Reference, Role::Reference),
];

/// The topics of a manifest's `use`, and of its `[local_position]`.
pub(super) fn by_name(
    bag: &Bag<'_>,
    of_sensor: &BTreeMap<SensorKind, String>,
    local: Option<&(String, LocalPlace)>,
    file: &str,
) -> Result<Topics> {
    let mut reads: Vec<Read> = Vec::new();
    for (kind, topic) in of_sensor {
        let Some((_, role)) = ROLES.iter().find(|(of, _)| of == kind) else {
            let names = join(ROLES.iter().map(|(kind, _)| kind.name()));
            let problem = format!("no topic is read as {}; expected {names}", kind.name());
            return Err(RecordingError::unsupported(file, problem));
        };
        check(bag, topic, *role, kind.name(), file)?;
        let same = |read: &&mut Read| read.topic == *topic && read.role == *role;
        match reads.iter_mut().find(same) {
            Some(read) => read.only.get_or_insert_default().push(*kind),
            None => reads.push(Read {
                only: Some(vec![*kind]),
                ..Read::all(topic, *role)
            }),
        }
    }
    if let Some(local) = local {
        if of_sensor.contains_key(&SensorKind::GnssPosition) {
            let problem =
                "both [local_position] and gnss-position are named; there is one position";
            return Err(RecordingError::unsupported(file, problem));
        }
        reads.push(local_position(bag, local, file)?);
    }
    Ok(Topics(reads))
}

/// The topic of poses whose positions are fixes.
pub(super) fn local_position(
    bag: &Bag<'_>,
    (topic, place): &(String, LocalPlace),
    file: &str,
) -> Result<Read> {
    check(bag, topic, Role::LocalPosition, "[local_position]", file)?;
    Ok(Read {
        place: Some(*place),
        ..Read::all(topic, Role::LocalPosition)
    })
}

/// Refuses a topic that is not there, or of which this is not read.
fn check(bag: &Bag<'_>, topic: &str, role: Role, what: &str, file: &str) -> Result<()> {
    let refused = |problem: String| Err(RecordingError::unsupported(file, problem));
    let Some(kind) = bag.kinds.get(topic) else {
        let topics = join(bag.kinds.keys().copied());
        return refused(format!(
            "{what}: there is no topic `{}`; it has {topics}",
            shown(topic)
        ));
    };
    if role.takes(kind) {
        return Ok(());
    }
    let poses = [POSE, POSE_WITH_COVARIANCE, ODOMETRY];
    if role == Role::Fix && poses.contains(kind) {
        return refused(format!(
            "{what}: `{}` is {kind}, whose positions are metres from a place: name it in [local_position] with its `origin`",
            shown(topic)
        ));
    }
    refused(format!(
        "{what}: `{}` is {}; expected {}",
        shown(topic),
        shown(kind),
        join(role.schemas().iter().copied())
    ))
}
