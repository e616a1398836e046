//! What a recording says about itself: name, world frame, device.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The world frame in which a recording's reference, device orientation and positions stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WorldFrame {
    /// East, north, up; north is magnetic north (phones, motion-capture sets).
    #[default]
    Enu,
    /// North, east, down; north is magnetic north.
    Ned,
}

/// What the axes of the sensors are, with the body level and looking ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BodyAxes {
    /// Right, forward, up: a phone that is held level.
    Phone,
    /// Forward, left, up (REP 103).
    Flu,
    /// Forward, right, down.
    Frd,
}

/// World and body of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frames {
    /// The world frame.
    pub world: WorldFrame,
    /// The axes of the sensors.
    pub body: BodyAxes,
}

impl From<WorldFrame> for Frames {
    /// With the body that belongs to a world: forward, right, down to north, east, down; a phone's to east, north, up.
    fn from(world: WorldFrame) -> Self {
        let body = match world {
            WorldFrame::Enu => BodyAxes::Phone,
            WorldFrame::Ned => BodyAxes::Frd,
        };
        Self { world, body }
    }
}

impl BodyAxes {
    /// The name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Phone => "phone",
            Self::Flu => "flu",
            Self::Frd => "frd",
        }
    }

    /// In words.
    #[must_use]
    pub const fn in_words(self) -> &'static str {
        match self {
            Self::Phone => "right, forward, up (a phone's)",
            Self::Flu => "forward, left, up",
            Self::Frd => "forward, right, down",
        }
    }

    /// Forward, right and down of the body, each in x, y, z of the sensors.
    #[must_use]
    pub fn forward_right_down(self) -> [Vector3<f64>; 3] {
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
        match self {
            Self::Phone => [y, x, -z],
            Self::Flu => [x, -y, -z],
            Self::Frd => [x, y, z],
        }
    }
}

impl std::str::FromStr for BodyAxes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = [Self::Phone, Self::Flu, Self::Frd];
        let found = all.into_iter().find(|axes| axes.name() == text);
        found.ok_or_else(|| format!("unknown body_axes `{text}`; expected phone, flu or frd"))
    }
}

/// Facts about a recording that hold for all of it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Metadata {
    /// Short name: the file's stem unless the file says otherwise.
    pub name: String,
    /// The format it was read from, e.g. `parquet`, `csv`, `sensor-logger`.
    pub format: String,
    /// World frame of reference, device orientation and position.
    pub world_frame: WorldFrame,
    /// The axes of the sensors, where the recording says them; otherwise those that belong to its world ([`Frames`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_axes: Option<BodyAxes>,
    /// Device name if known.
    pub device: Option<String>,
    /// From the inertial sensor to the antenna of the satellite receiver: forward, right, down in body
    /// axes, m.
    #[serde(default)]
    pub gnss_lever_arm_m: Option<[f64; 3]>,
    /// How long before its stamp a position of the receiver was true, s.
    #[serde(default)]
    pub gnss_position_latency_s: f64,
    /// How long before its stamp a velocity of the receiver was true, s.
    #[serde(default)]
    pub gnss_velocity_latency_s: f64,
    /// Everything else the file says, key by key.
    pub extra: BTreeMap<String, String>,
}

impl WorldFrame {
    /// The name in files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Enu => "enu",
            Self::Ned => "ned",
        }
    }
}

impl std::str::FromStr for WorldFrame {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "enu" => Ok(Self::Enu),
            "ned" => Ok(Self::Ned),
            _ => Err(format!("unknown world_frame `{text}`; expected enu or ned")),
        }
    }
}

impl Metadata {
    /// Takes one `key: value` of a file: `name`, `device`, `world_frame` and what is told of the satellite
    /// receiver have fields of their own, everything else goes to `extra`.
    ///
    /// # Errors
    /// A sentence when `world_frame` is not one of the known frames, or a number is none.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "name" => value.clone_into(&mut self.name),
            "device" => self.device = Some(value.to_owned()),
            "world_frame" => self.world_frame = value.parse()?,
            BODY_AXES => self.body_axes = Some(value.parse()?),
            LEVER_ARM => self.gnss_lever_arm_m = Some(lever_arm(value)?),
            POSITION_LATENCY => self.gnss_position_latency_s = seconds(key, value)?,
            VELOCITY_LATENCY => self.gnss_velocity_latency_s = seconds(key, value)?,
            _ => {
                self.extra.insert(key.to_owned(), value.to_owned());
            }
        }
        Ok(())
    }

    /// World and body.
    #[must_use]
    pub fn frames(&self) -> Frames {
        let usual = Frames::from(self.world_frame);
        let body = self.body_axes.unwrap_or(usual.body);
        Frames { body, ..usual }
    }

    /// What is told of the body and of the satellite receiver, as keys and values that [`Self::set`] takes.
    pub(crate) fn body_and_receiver(&self) -> Vec<(&'static str, String)> {
        let mut pairs = Vec::new();
        pairs.extend(
            self.body_axes
                .map(|axes| (BODY_AXES, axes.name().to_owned())),
        );
        if let Some([forward, right, down]) = self.gnss_lever_arm_m {
            pairs.push((LEVER_ARM, format!("{forward} {right} {down}")));
        }
        let latencies = [
            (POSITION_LATENCY, self.gnss_position_latency_s),
            (VELOCITY_LATENCY, self.gnss_velocity_latency_s),
        ];
        for (key, latency) in latencies {
            if latency.abs() > 0.0 {
                pairs.push((key, latency.to_string()));
            }
        }
        pairs
    }
}

/// The key of the axes of the sensors.
pub(crate) const BODY_AXES: &str = "body_axes";
const LEVER_ARM: &str = "gnss_lever_arm_m";
const POSITION_LATENCY: &str = "gnss_position_latency_s";
const VELOCITY_LATENCY: &str = "gnss_velocity_latency_s";

fn lever_arm(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text
        .split_ascii_whitespace()
        .map(|number| number.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("{LEVER_ARM} `{text}`: expected forward, right and down in metres"))
}

fn seconds(key: &str, text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| format!("{key} `{text}`: expected seconds"))
}
