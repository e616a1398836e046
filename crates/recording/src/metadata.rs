//! What a recording says about itself: name, world frame, device.

use std::collections::BTreeMap;

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

/// Facts about a recording that hold for all of it.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Metadata {
    /// Short name: the file's stem unless the file says otherwise.
    pub name: String,
    /// The format it was read from, e.g. `parquet`, `csv`, `sensor-logger`.
    pub format: String,
    /// World frame of reference, device orientation and position.
    pub world_frame: WorldFrame,
    /// Device name if known.
    pub device: Option<String>,
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
    /// Takes one `key: value` of a file: `name`, `device` and `world_frame` have fields of their
    /// own, everything else goes to `extra`.
    ///
    /// # Errors
    /// A sentence when `world_frame` is not one of the known frames.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "name" => value.clone_into(&mut self.name),
            "device" => self.device = Some(value.to_owned()),
            "world_frame" => self.world_frame = value.parse()?,
            _ => {
                self.extra.insert(key.to_owned(), value.to_owned());
            }
        }
        Ok(())
    }
}
