//! Which topics of a bag of ROS 2 are read, which are left out, and why.

use std::collections::BTreeMap;
use std::sync::Arc;

use ::mcap::Channel;

use super::file::Contents;
use super::fluid_pressure;
use super::measured::Role;
use super::nav_sat_fix;
use super::one_of;
use super::pose_twist::{
    ODOMETRY, POSE, POSE_WITH_COVARIANCE, QUATERNION, TWIST, TWIST_WITH_COVARIANCE,
};
use super::ros::{IMU, MAGNETIC_FIELD};
use super::ros_writer::{DEVICE_ORIENTATION, REFERENCE};
use super::tf_static::is_mounting;
use crate::error::{Result, join, shown};

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
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Topics {
    pub(super) imu: Option<String>,
    pub(super) field: Option<String>,
    pub(super) fix: Option<String>,
    /// Of the receiver of [`Self::fix`].
    pub(super) velocity: Option<String>,
    /// Of the air around the sensors.
    pub(super) pressure: Option<String>,
    /// A pose to score against.
    pub(super) pose: Option<String>,
}

impl Topics {
    /// What is taken from a topic.
    pub(super) fn role(&self, topic: &str) -> Option<Role> {
        let roles = [
            (&self.imu, Role::Inertial),
            (&self.field, Role::Field),
            (&self.fix, Role::Fix),
            (&self.velocity, Role::Velocity),
            (&self.pressure, Role::Pressure),
            (&self.pose, Role::Reference),
        ];
        let mut roles = roles.into_iter();
        let chosen = roles.find(|(chosen, _)| chosen.as_deref() == Some(topic));
        match topic {
            _ if chosen.is_some() => chosen.map(|(_, role)| role),
            DEVICE_ORIENTATION => Some(Role::DeviceOrientation),
            REFERENCE => Some(Role::Reference),
            _ => None,
        }
    }
}

/// What a bag holds, by topic: the name of its schema.
struct Bag<'a> {
    kinds: BTreeMap<&'a str, &'a str>,
    frames: &'a BTreeMap<String, String>,
}

/// Chooses the topics: of several `Imu` the raw one or the `wanted` one; the field of the same namespace or frame, or the
/// only one beside the only `Imu`; the only fixes, or those of the namespace, with the velocity of the same receiver; the
/// pose of a reference system. With them the remarks: what is read, what is left out and why. `None` when there is
/// neither `Imu` nor `NavSatFix`.
///
/// # Errors
/// There are several to choose from, or the one asked for is not there.
pub(crate) fn choose(
    contents: &Contents,
    wanted: Option<&str>,
    file: &str,
) -> Result<Option<(Topics, Vec<String>)>> {
    let bag = Bag::of(contents);
    let (imus, fixes) = (bag.topics(&[IMU]), bag.topics(&[nav_sat_fix::NAME]));
    let imu = match (imus.is_empty(), fixes.is_empty()) {
        (true, true) => return Ok(None),
        (true, false) => None,
        (false, _) => Some(choose_imu(&imus, wanted, file)?),
    };
    let fix = match &imu {
        None => {
            let words = ["topic", " of sensor_msgs/NavSatFix; it has"];
            Some(one_of(&fixes, wanted, words, file)?.clone())
        }
        Some(imu) => match &fixes[..] {
            [only] => Some(only.clone()),
            _ => fixes.iter().find(|fix| near(fix, imu)).cloned(),
        },
    };
    let fields = bag.topics(&[MAGNETIC_FIELD]);
    let field = imu.as_ref().and_then(|imu| {
        let of_namespace = fields.iter().find(|field| near(field, imu));
        let of_frame = || fields.iter().find(|field| bag.share_frame(field, imu));
        let only = || (imus.len() == 1 && fields.len() == 1).then(|| &fields[0]);
        of_namespace.or_else(of_frame).or_else(only).cloned()
    });
    let velocities = bag.topics(&[TWIST, TWIST_WITH_COVARIANCE]);
    let velocity = fix.as_ref().and_then(|fix| {
        let mut velocities = velocities.iter();
        velocities.find(|topic| is_velocity_of(topic, fix)).cloned()
    });
    let has_reference = bag.kinds.contains_key(REFERENCE);
    let pressures = bag.topics(&[fluid_pressure::NAME]);
    let beside = imu.as_ref().or(fix.as_ref());
    let pressure = match &pressures[..] {
        [only] => Some(only.clone()),
        several => {
            let near = |topic: &&String| beside.is_some_and(|beside| near(topic, beside));
            several.iter().find(near).cloned()
        }
    };
    let poses = bag.topics(&[QUATERNION, POSE, POSE_WITH_COVARIANCE, ODOMETRY]);
    let pose = poses.into_iter().find(|topic| {
        let topic = topic.to_ascii_lowercase();
        imu.is_some() && !has_reference && TRUTHS.iter().any(|truth| topic.contains(truth))
    });
    let topics = Topics {
        imu,
        field,
        fix,
        velocity,
        pressure,
        pose,
    };
    let notes = bag.notes(&topics);
    Ok(Some((topics, notes)))
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

    /// What is read and what is left out, a sentence each.
    fn notes(&self, topics: &Topics) -> Vec<String> {
        let own = |topic: &str| [DEVICE_ORIENTATION, REFERENCE].contains(&topic);
        let chosen = [
            &topics.imu,
            &topics.field,
            &topics.fix,
            &topics.velocity,
            &topics.pressure,
            &topics.pose,
        ];
        let is_used = |topic: &str, kind: &str| {
            let chosen = chosen.iter().any(|chosen| chosen.as_deref() == Some(topic));
            chosen || own(topic) || is_mounting(topic, kind)
        };
        let (used, left): (Vec<_>, Vec<_>) = self
            .kinds
            .iter()
            .partition(|(topic, kind)| is_used(topic, kind));
        let used = join(used.iter().map(|(topic, _)| **topic));
        let mut notes = vec![format!("Topics that are read: {used}.")];
        if !left.is_empty() {
            let told = left.iter().take(MOST_TOLD);
            let told = told.map(|(topic, kind)| {
                format!("{} ({})", shown(topic), self.why_left(topics, topic, kind))
            });
            let mut told = told.collect::<Vec<_>>().join(", ");
            if let more @ 1.. = left.len().saturating_sub(MOST_TOLD) {
                told.push_str(&format!(" and {more} more"));
            }
            notes.push(format!("Topics that are left out: {told}."));
        }
        notes
    }

    fn why_left(&self, topics: &Topics, topic: &str, kind: &str) -> String {
        match kind {
            IMU => format!("another Imu; choose it with --device {}", shown(topic)),
            MAGNETIC_FIELD if topics.imu.is_none() => "a field without an Imu".to_owned(),
            MAGNETIC_FIELD if topics.field.is_some() => "another field".to_owned(),
            MAGNETIC_FIELD => "a field of another namespace and frame than the Imu".to_owned(),
            nav_sat_fix::NAME if topics.fix.is_some() => "another receiver".to_owned(),
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
