//! Where the sensors of a robot are, from `/tf_static`: the Imu turned into `base_link`, the way from it to the antenna.
//!
//! Read first: REP 105 (`base_link`), REP 103 (its axes: forward, left, up).

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::cdr::CdrReader;
use super::measured::Role;
use super::ros;
use super::ros_source::Read;
use super::topics::Topics;
use crate::event::{Event, Sample, quaternion_from_file};
use crate::metadata::BodyAxes;

/// The types of its messages, today's and that of older bags.
const TRANSFORMS: [&str; 2] = ["tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"];
/// The frame of the robot's body.
const BASE: &str = "base_link";
/// More frames than this no robot has.
const MOST_FRAMES: usize = 4096;
/// Turns by less are rounding, rad.
const NO_TURN: f64 = 1e-6;
/// Ways that are shorter are none, m.
const NO_WAY: f64 = 1e-6;

/// Whether a topic of this type tells how sensors are mounted.
pub(super) fn is_mounting(topic: &str, kind: &str) -> bool {
    topic.rsplit('/').next() == Some("tf_static") && TRANSFORMS.contains(&kind)
}

/// The tree of frames.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StaticTransforms {
    /// Of each frame its parent, and `parent_from_child`.
    parents: BTreeMap<String, (String, Isometry3<f64>)>,
}

impl StaticTransforms {
    /// Takes a message of `/tf_static`: CDR behind its four bytes of encapsulation; `None` when it is none. What a later message
    /// says of a frame counts.
    pub fn take(&mut self, bytes: &[u8]) -> Option<()> {
        let mut input = CdrReader::new(bytes)?;
        for _ in 0..input.u32()? {
            if self.parents.len() >= MOST_FRAMES {
                return None;
            }
            let parent = plain(ros::header_frame(&mut input)?);
            let child = plain(input.string()?);
            let [px, py, pz] = input.f64s()?;
            let [x, y, z, w] = input.f64s()?;
            let translation = Vector3::new(px, py, pz);
            let norm = Vector3::new(x, y, z).norm().hypot(w);
            if !(translation.norm().is_finite() && (0.9..1.1).contains(&norm)) {
                return None;
            }
            let turn = quaternion_from_file(w, x, y, z);
            let pose = Isometry3::from_parts(Translation3::from(translation), turn);
            self.parents.insert(child, (parent, pose));
        }
        Some(())
    }

    pub(super) fn extend(&mut self, other: Self) {
        self.parents.extend(other.parents);
    }

    /// The top frame above a frame, and `top_from_frame`.
    fn top<'a>(&'a self, frame: &'a str) -> Option<(&'a str, Isometry3<f64>)> {
        let (mut at, mut pose) = (frame, Isometry3::identity());
        // A circle has no top.
        for _ in 0..=self.parents.len() {
            let Some((parent, step)) = self.parents.get(at) else {
                return Some((at, pose));
            };
            pose = step * pose;
            at = parent;
        }
        None
    }

    /// `to_from_from`: where a frame is in another; `None` where no transforms lead from one to the other.
    fn between(&self, from: &str, to: &str) -> Option<Isometry3<f64>> {
        let ((top_from, from), (top_to, to)) = (self.top(from)?, self.top(to)?);
        (top_from == top_to).then(|| to.inverse() * from)
    }

    /// The frame of the body above a sensor: `base_link`, or that of the robot's namespace.
    fn base(&self, sensor: &str) -> Option<&str> {
        let parents = self.parents.values().map(|(parent, _)| parent);
        let mut frames = self.parents.keys().chain(parents);
        let is_base = |frame: &&String| frame.rsplit('/').next() == Some(BASE);
        let found = frames.find(|frame| is_base(frame) && self.between(sensor, frame).is_some());
        found.map(String::as_str)
    }
}

/// Frames of tf 1 begin with a slash.
fn plain(frame: &str) -> String {
    frame.trim_start_matches('/').to_owned()
}

/// How the sensors that are read are mounted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mounting {
    /// Of each topic whose sensor is turned, `base_from_sensor`.
    turns: BTreeMap<String, UnitQuaternion<f64>>,
    /// From the Imu to the antenna, m, in the axes that are handed out.
    lever_arm: Option<Vector3<f64>>,
    base: Option<String>,
    /// From the body's frame to the antenna, m, in its axes.
    antenna: Option<Vector3<f64>>,
    notes: Vec<String>,
}

impl Mounting {
    /// Of sensors, each known by what is taken of it, whose messages have these frames.
    #[must_use]
    pub fn of_sensors(transforms: &StaticTransforms, frames: &BTreeMap<Role, String>) -> Self {
        let reads = frames.keys().map(|role| Read::all(role.name(), *role));
        let named = frames
            .iter()
            .map(|(role, frame)| (role.name().to_owned(), frame.clone()));
        Self::of(transforms, &Topics(reads.collect()), &named.collect())
    }

    /// An event of a sensor in the axes of the body.
    #[must_use]
    pub fn turned_of(&self, role: Role, event: Event) -> Event {
        self.turned(role.name(), event)
    }

    /// The frame of the body, of which the axes are, where transforms lead to one.
    #[must_use]
    pub fn base(&self) -> Option<&str> {
        self.base.as_deref()
    }

    /// From the body's frame to the antenna, m: forward, left, up.
    #[must_use]
    pub fn antenna_m(&self) -> Option<Vector3<f64>> {
        self.antenna
    }

    /// Of the chosen topics, whose frames are these.
    pub(super) fn of(
        transforms: &StaticTransforms,
        topics: &Topics,
        frames: &BTreeMap<String, String>,
    ) -> Self {
        let frame = |topic: &str| {
            let frame = frames.get(topic)?;
            Some(plain(frame)).filter(|frame| !frame.is_empty())
        };
        let Some((imu_topic, imu)) = topics
            .inertial()
            .and_then(|topic| Some((topic, frame(topic)?)))
        else {
            return Self::default();
        };
        let base = transforms.base(&imu);
        let turn = |sensor: &str| {
            let turn = transforms.between(sensor, base?)?.rotation;
            (turn.angle() > NO_TURN).then_some(turn)
        };
        let of_imu = turn(&imu);
        let mut mounting = Self::default();
        let mut told = Vec::new();
        for read in topics.reads() {
            let name = match read.role {
                Role::Inertial if read.topic == imu_topic => "the Imu",
                Role::Inertial => "the other Imu",
                Role::Field => "the field",
                _ => continue,
            };
            // A sensor without a frame of its own, or with one that hangs nowhere, is the Imu's.
            let own = frame(&read.topic)
                .filter(|own| base.is_some_and(|base| transforms.between(own, base).is_some()));
            let turn = own.map_or(of_imu, |own| turn(&own));
            let angle_deg = turn.map_or(0.0, |turn| turn.angle().to_degrees());
            told.push(format!("{name} by {angle_deg:.1} deg"));
            if let Some(turn) = turn {
                mounting.turns.insert(read.topic.clone(), turn);
            }
        }
        if let (Some(base), false) = (base, mounting.turns.is_empty()) {
            mounting.notes.push(format!(
                "The samples are turned into {base}, as /tf_static has it: {}.",
                told.join(", ")
            ));
        }
        let fix = topics.of(Role::Fix).or(topics.of(Role::LocalPosition));
        let antenna = fix
            .and_then(frame)
            .and_then(|fix| transforms.between(&fix, &imu));
        mounting.base = base.map(str::to_owned);
        mounting.antenna = (fix.and_then(frame).zip(base))
            .and_then(|(fix, base)| transforms.between(&fix, base))
            .map(|antenna| antenna.translation.vector);
        let arm = antenna.map(|antenna| antenna.translation.vector);
        mounting.lever_arm = arm
            .filter(|arm| arm.norm() > NO_WAY)
            .map(|arm| of_imu.map_or(arm, |turn| turn * arm));
        mounting
    }

    /// The lever arm as metadata have it: forward, right, down, m. A note says it.
    pub fn lever_arm_m(&mut self, axes: BodyAxes) -> Option<[f64; 3]> {
        let arm = self.lever_arm?;
        let [forward, right, down] = match axes {
            BodyAxes::Flu => [arm.x, -arm.y, -arm.z],
            BodyAxes::Frd => [arm.x, arm.y, arm.z],
            BodyAxes::Phone => [arm.y, arm.x, -arm.z],
        };
        self.notes.push(format!(
            "From the Imu to the antenna, as /tf_static has it: {forward:.3} m forward, {right:.3} m right, {down:.3} m down."
        ));
        Some([forward, right, down])
    }

    /// What was found, in sentences.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The event of a topic in the axes of the body.
    pub(super) fn turned(&self, topic: &str, event: Event) -> Event {
        let Some(turn) = self.turns.get(topic) else {
            return event;
        };
        let sample = match event.sample {
            Sample::AngularRate(v) => Sample::AngularRate(turn * v),
            Sample::SpecificForce(v) => Sample::SpecificForce(turn * v),
            Sample::MagneticField(v) => Sample::MagneticField(turn * v),
            Sample::DeviceOrientation(q) => Sample::DeviceOrientation(q * turn.inverse()),
            other => other,
        };
        Event { sample, ..event }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mcap::cdr::CdrWriter;
    use std::f64::consts::FRAC_PI_2;

    fn message(transforms: &[(&str, &str, [f64; 3], [f64; 4])]) -> Vec<u8> {
        let mut out = CdrWriter::new();
        out.u32(transforms.len() as u32);
        for (parent, child, translation, [x, y, z, w]) in transforms {
            ros::header(&mut out, 5, parent).unwrap();
            out.string(child);
            out.f64s(translation);
            out.f64s(&[*x, *y, *z, *w]);
        }
        out.into_bytes()
    }

    const LEVEL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

    fn yaw(angle: f64) -> [f64; 4] {
        [0.0, 0.0, (0.5 * angle).sin(), (0.5 * angle).cos()]
    }

    fn tree(transforms: &[(&str, &str, [f64; 3], [f64; 4])]) -> StaticTransforms {
        let mut tree = StaticTransforms::default();
        tree.take(&message(transforms)).unwrap();
        tree
    }

    fn topics() -> (Topics, BTreeMap<String, String>) {
        let topics = Topics(vec![
            Read::all("/imu", Role::Inertial),
            Read::all("/mag", Role::Field),
            Read::all("/fix", Role::Fix),
        ]);
        let frames = [("/imu", "imu"), ("/mag", "compass"), ("/fix", "/gps")];
        let frames = frames.map(|(topic, frame)| (topic.to_owned(), frame.to_owned()));
        (topics, BTreeMap::from(frames))
    }

    /// The Imu looks left and sits 1 m ahead; the antenna is 2 m behind and 1.5 m above `base_link`, 0.5 m left.
    #[test]
    fn samples_and_lever_arm_are_those_of_the_body() {
        let tree = tree(&[
            ("base_link", "plate", [1.0, 0.0, 0.0], LEVEL),
            ("plate", "imu", [0.0; 3], yaw(FRAC_PI_2)),
            ("base_link", "compass", [9.0; 3], LEVEL),
            ("base_link", "/gps", [-2.0, 0.5, 1.5], LEVEL),
        ]);
        let (topics, frames) = topics();
        let mut mounting = Mounting::of(&tree, &topics, &frames);
        let arm = mounting.lever_arm_m(BodyAxes::Flu).unwrap();
        for (got, expected) in arm.iter().zip([-3.0, -0.5, -1.5]) {
            approx::assert_relative_eq!(*got, expected, epsilon = 1e-12);
        }
        let of = |topic, sample| mounting.turned(topic, Event { time_ns: 1, sample }).sample;
        // Along the Imu's x axis is to the left of the body.
        let Sample::SpecificForce(force) = of("/imu", Sample::SpecificForce(Vector3::x())) else {
            panic!();
        };
        approx::assert_relative_eq!(force, Vector3::y(), epsilon = 1e-12);
        let field = Sample::MagneticField(Vector3::x());
        assert_eq!(of("/mag", field), field, "the compass looks ahead");
        // The Imu says that it looks north (yaw 90 deg); then the body looks east.
        let north = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
        let Sample::DeviceOrientation(body) = of("/imu", Sample::DeviceOrientation(north)) else {
            panic!();
        };
        assert!(body.angle() < 1e-12);
        let notes = mounting.notes().join(" ");
        assert!(
            notes.contains("the Imu by 90.0 deg, the field by 0.0 deg"),
            "{notes}"
        );
        assert!(
            notes.contains("-3.000 m forward, -0.500 m right, -1.500 m down"),
            "{notes}"
        );
    }

    #[test]
    fn without_a_way_between_them_nothing_is_assumed() {
        let (topics, frames) = topics();
        let apart = tree(&[
            ("base_link", "imu", [1.0, 0.0, 0.0], LEVEL),
            ("mast", "gps", [0.0, 0.0, 5.0], LEVEL),
        ]);
        let circle = tree(&[
            ("imu", "base_link", [1.0, 0.0, 0.0], yaw(0.3)),
            ("base_link", "imu", [1.0, 0.0, 0.0], yaw(0.3)),
        ]);
        for tree in [StaticTransforms::default(), apart, circle] {
            let mut mounting = Mounting::of(&tree, &topics, &frames);
            assert_eq!(mounting.lever_arm_m(BodyAxes::Flu), None);
            let event = Event {
                time_ns: 0,
                sample: Sample::AngularRate(Vector3::new(0.1, 0.2, 0.3)),
            };
            assert_eq!(mounting.turned("/imu", event), event);
            assert!(mounting.notes().is_empty());
        }
    }

    #[test]
    fn what_is_no_transform_is_refused() {
        let mut tree = StaticTransforms::default();
        let good = message(&[("a", "b", [0.0; 3], LEVEL)]);
        assert_eq!(tree.take(&good[..good.len() - 1]), None);
        for (way, turn) in [([f64::NAN, 0.0, 0.0], LEVEL), ([0.0; 3], [0.0; 4])] {
            assert_eq!(tree.take(&message(&[("a", "b", way, turn)])), None);
        }
        let mut endless = vec![0, 1, 0, 0];
        endless.extend(u32::MAX.to_le_bytes());
        assert_eq!(tree.take(&endless), None);
        assert_eq!(tree.take(&good), Some(()));
    }
}
