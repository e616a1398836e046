//! Which topics of a bag of ROS 2 are read, which are left out, and why.

use std::collections::BTreeMap;
use std::sync::Arc;

use ::mcap::Channel;

use super::file::Contents;
use super::fluid_pressure;
use super::measured::Role;
use super::named_topics::{by_name, local_position};
use super::nav_sat_fix;
use super::one_of;
use super::pose_twist::{
    ODOMETRY, POSE, POSE_WITH_COVARIANCE, QUATERNION, TWIST, TWIST_WITH_COVARIANCE,
};
use super::ros::{IMU, MAGNETIC_FIELD};
use super::ros_source::Read;
use super::ros_writer::{DEVICE_ORIENTATION, REFERENCE};
use super::tf_static::is_mounting;
use crate::error::{Result, join, shown};
use crate::event::SensorKind;
use crate::options::TopicChoice;

/// Topics that are told one by one as not read; the others are counted.
const MOST_TOLD: usize = 12;
/// Parts of the names of topics whose poses are the truth; other poses are estimates of another program.
const TRUTHS: [&str; 7] = [
    "reference",
    "ground_truth",
    "groundtruth",
    "mocap",
    "vicon",
    "optitrack",
    "vrpn",
];

/// The topics that are read.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Topics(pub(super) Vec<Read>);

impl Topics {
    pub(super) fn reads(&self) -> &[Read] {
        &self.0
    }

    /// The topic from which something is taken; the first one of several.
    pub(super) fn of(&self, role: Role) -> Option<&str> {
        let read = self.0.iter().find(|read| read.role == role);
        read.map(|read| read.topic.as_str())
    }

    /// The topic of the gyroscope, or of the accelerometer where there is none.
    pub(super) fn inertial(&self) -> Option<&str> {
        let gyroscope = self.0.iter().find(|read| {
            let only = read.only.as_ref();
            read.role == Role::Inertial
                && only.is_none_or(|only| only.contains(&SensorKind::Gyroscope))
        });
        gyroscope.map_or_else(|| self.of(Role::Inertial), |read| Some(&read.topic))
    }

    fn is_read(&self, topic: &str) -> bool {
        self.0.iter().any(|read| read.topic == topic)
    }
}

/// What a bag holds, by topic: the name of its schema.
pub(super) struct Bag<'a> {
    pub(super) kinds: BTreeMap<&'a str, &'a str>,
    frames: &'a BTreeMap<String, String>,
}

/// Chooses the topics: of several `Imu` the raw one or the `wanted` one; the field of the same namespace or frame, or the
/// only one beside the only `Imu`; the only fixes, or those of the namespace, with the velocity of the same receiver; the
/// pose of a reference system. With them the remarks: what is read, what is left out and why. `None` when there is
/// neither `Imu` nor `NavSatFix`. What is chosen by name goes before.
///
/// # Errors
/// There are several to choose from, or the one asked for is not there.
pub(crate) fn choose(
    contents: &Contents,
    wanted: Wanted<'_>,
    file: &str,
) -> Result<Option<(Topics, Vec<String>)>> {
    let bag = Bag::of(contents);
    if let Some(named) = wanted.topics
        && let Some(of_sensor) = &named.of_sensor
    {
        let topics = by_name(&bag, of_sensor, named.local_position.as_ref(), file)?;
        let notes = bag.notes(&topics, true);
        return Ok(Some((topics, notes)));
    }
    let local = wanted
        .topics
        .and_then(|named| named.local_position.as_ref())
        .map(|local| local_position(&bag, local, file))
        .transpose()?;
    let Some(topics) = bag.usual(wanted.device, local, file)? else {
        return Ok(None);
    };
    let notes = bag.notes(&topics, false);
    Ok(Some((topics, notes)))
}

/// What the user said of topics.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Wanted<'a> {
    /// The `Imu`, or a device of the lab.
    pub(crate) device: Option<&'a str>,
    /// By name.
    pub(crate) topics: Option<&'a TopicChoice>,
}

fn choose_imu(imus: &[String], wanted: Option<&str>, file: &str) -> Result<String> {
    let raw: Vec<&String> = imus.iter().filter(|t| t.ends_with("data_raw")).collect();
    if let (None, [raw]) = (wanted, &raw[..]) {
        return Ok((*raw).clone());
    }
    let words = ["topic", " of sensor_msgs/Imu; it has"];
    Ok(one_of(imus, wanted, words, file)?.clone())
}

fn namespace(topic: &str) -> &str {
    topic.rsplit_once('/').map_or("", |(name, _)| name)
}

/// Whether two topics are of one namespace, or one of them of a part of the other's.
fn near(one: &str, other: &str) -> bool {
    let (one, other) = (namespace(one), namespace(other));
    let is_part = |part: &str, whole: &str| {
        !whole.is_empty()
            && part
                .strip_prefix(whole)
                .is_some_and(|rest| rest.starts_with('/'))
    };
    one == other || is_part(one, other) || is_part(other, one)
}

/// Whether a twist is what the receiver of these fixes measures, and no command to wheels: `/fix_velocity` of `/fix`,
/// `/gps/vel` of `/gps/fix`.
fn is_velocity_of(topic: &str, fix: &str) -> bool {
    let last = topic.rsplit('/').next().unwrap_or_default();
    let is_velocity = last.contains("vel") && !last.contains("cmd");
    let of_name = topic.starts_with(fix);
    let of_namespace = !namespace(fix).is_empty() && namespace(topic) == namespace(fix);
    is_velocity && (of_name || of_namespace)
}

/// The type of a channel's messages, of ROS 2 or of ROS 1 from a bag (`ros_1.rs` names them so).
pub(super) fn schema<'a>(channel: &'a Channel<'_>) -> Option<&'a str> {
    let schema = channel.schema.as_ref().map(|schema| schema.name.as_str());
    schema.filter(|_| channel.message_encoding == "cdr")
}

impl<'a> Bag<'a> {
    /// The topics by their types and names; `local` are positions of poses, in place of fixes.
    fn usual(
        &self,
        wanted: Option<&str>,
        local: Option<Read>,
        file: &str,
    ) -> Result<Option<Topics>> {
        let (imus, fixes) = (self.topics(&[IMU]), self.topics(&[nav_sat_fix::NAME]));
        let imu = match (imus.is_empty(), fixes.is_empty() && local.is_none()) {
            (true, true) => return Ok(None),
            (true, false) => None,
            (false, _) => Some(choose_imu(&imus, wanted, file)?),
        };
        let fix = match (&imu, &local) {
            (_, Some(_)) => None,
            (None, None) => {
                let words = ["topic", " of sensor_msgs/NavSatFix; it has"];
                Some(one_of(&fixes, wanted, words, file)?.clone())
            }
            (Some(imu), None) => match &fixes[..] {
                [only] => Some(only.clone()),
                _ => fixes.iter().find(|fix| near(fix, imu)).cloned(),
            },
        };
        let field = imu
            .as_deref()
            .and_then(|imu| self.field_of(imu, imus.len()));
        let velocities = self.topics(&[TWIST, TWIST_WITH_COVARIANCE]);
        let velocity = fix.as_ref().and_then(|fix| {
            let mut velocities = velocities.iter();
            velocities.find(|topic| is_velocity_of(topic, fix)).cloned()
        });
        let pressure = self.pressure(imu.as_deref().or(fix.as_deref()));
        let pose = self.pose().filter(|topic| {
            let is_fix = local.as_ref().is_some_and(|local| local.topic == *topic);
            imu.is_some() && !is_fix
        });
        let roles = [
            (imu, Role::Inertial),
            (field, Role::Field),
            (fix, Role::Fix),
            (velocity, Role::Velocity),
            (pressure, Role::Pressure),
            (pose, Role::Reference),
            (self.own(DEVICE_ORIENTATION), Role::DeviceOrientation),
            (self.own(REFERENCE), Role::Reference),
        ];
        let chosen = roles.into_iter();
        let chosen = chosen.filter_map(|(topic, role)| Some(Read::all(&topic?, role)));
        Ok(Some(Topics(chosen.chain(local).collect())))
    }

    fn field_of(&self, imu: &str, imus: usize) -> Option<String> {
        let fields = self.topics(&[MAGNETIC_FIELD]);
        let of_namespace = fields.iter().find(|field| near(field, imu));
        let of_frame = || fields.iter().find(|field| self.share_frame(field, imu));
        let only = || (imus == 1 && fields.len() == 1).then(|| &fields[0]);
        of_namespace.or_else(of_frame).or_else(only).cloned()
    }

    /// The only barometer, or the one in the namespace of another sensor.
    fn pressure(&self, beside: Option<&str>) -> Option<String> {
        match &self.topics(&[fluid_pressure::NAME])[..] {
            [only] => Some(only.clone()),
            several => {
                let near = |topic: &&String| beside.is_some_and(|beside| near(topic, beside));
                several.iter().find(near).cloned()
            }
        }
    }

    /// The pose of a reference system, unless the bag has a reference of ours.
    fn pose(&self) -> Option<String> {
        let poses = self.topics(&[QUATERNION, POSE, POSE_WITH_COVARIANCE, ODOMETRY]);
        let has_reference = self.kinds.contains_key(REFERENCE);
        let found = poses.into_iter().find(|topic| {
            let topic = topic.to_ascii_lowercase();
            TRUTHS.iter().any(|truth| topic.contains(truth))
        });
        found.filter(|_| !has_reference)
    }

    /// A topic of ours, if it is there.
    fn own(&self, topic: &str) -> Option<String> {
        let kind = self.kinds.get(topic);
        kind.filter(|kind| **kind == IMU).map(|_| topic.to_owned())
    }

    fn of(contents: &'a Contents) -> Self {
        let kind = |channel: &'a Arc<Channel<'static>>| {
            let kind = schema(channel).unwrap_or("no message of ROS 2");
            (channel.topic.as_str(), kind)
        };
        Self {
            kinds: contents.channels.iter().map(kind).collect(),
            frames: &contents.frames,
        }
    }

    fn topics(&self, kinds: &[&str]) -> Vec<String> {
        let of_kind = self.kinds.iter().filter(|(topic, kind)| {
            kinds.contains(kind) && ![DEVICE_ORIENTATION, REFERENCE].contains(topic)
        });
        of_kind.map(|(topic, _)| (*topic).to_owned()).collect()
    }

    fn share_frame(&self, one: &str, other: &str) -> bool {
        let frame = self.frames.get(one).filter(|frame| !frame.is_empty());
        frame.is_some() && frame == self.frames.get(other)
    }

    /// What is read and what is left out, a sentence each; whether topics were chosen `by_name`.
    fn notes(&self, topics: &Topics, by_name: bool) -> Vec<String> {
        let is_used = |topic: &str, kind: &str| topics.is_read(topic) || is_mounting(topic, kind);
        let (used, left): (Vec<_>, Vec<_>) = self
            .kinds
            .iter()
            .partition(|(topic, kind)| is_used(topic, kind));
        let used = join(used.iter().map(|(topic, _)| **topic));
        let mut notes = vec![format!("Topics that are read: {used}.")];
        if !left.is_empty() {
            let why = |topic: &str, kind: &str| match by_name {
                true => format!("{}, not named in `use`", shown(kind)),
                false => self.why_left(topics, topic, kind),
            };
            let told = left.iter().take(MOST_TOLD);
            let told = told.map(|(topic, kind)| format!("{} ({})", shown(topic), why(topic, kind)));
            let mut told = told.collect::<Vec<_>>().join(", ");
            if let more @ 1.. = left.len().saturating_sub(MOST_TOLD) {
                told.push_str(&format!(" and {more} more"));
            }
            notes.push(format!("Topics that are left out: {told}."));
        }
        notes
    }

    fn why_left(&self, topics: &Topics, topic: &str, kind: &str) -> String {
        let has = |role| topics.of(role).is_some();
        match kind {
            IMU => format!("another Imu; choose it with --device {}", shown(topic)),
            MAGNETIC_FIELD if !has(Role::Inertial) => "a field without an Imu".to_owned(),
            MAGNETIC_FIELD if has(Role::Field) => "another field".to_owned(),
            MAGNETIC_FIELD => "a field of another namespace and frame than the Imu".to_owned(),
            nav_sat_fix::NAME if has(Role::LocalPosition) => {
                "the fixes are those of [local_position]".to_owned()
            }
            nav_sat_fix::NAME if has(Role::Fix) => "another receiver".to_owned(),
            nav_sat_fix::NAME => "one of several receivers, none in the Imu's namespace".to_owned(),
            TWIST | TWIST_WITH_COVARIANCE => {
                "not the velocity of the receiver that is read".to_owned()
            }
            fluid_pressure::NAME => "one of several barometers".to_owned(),
            QUATERNION | POSE | POSE_WITH_COVARIANCE | ODOMETRY => {
                "a pose whose topic does not say that it is a reference".to_owned()
            }
            other => format!("{}: not read", shown(other)),
        }
    }
}
