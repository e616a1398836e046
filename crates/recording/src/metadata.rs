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
