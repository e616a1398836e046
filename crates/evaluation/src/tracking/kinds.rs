//! The trackers of many targets by name.

use northing_core::tracking::multi_target::{MotionModels, MultiTargetSettings};

use super::options::MOTION;
use crate::registry::ParameterInfo;

crate::named::estimators! {
    /// What a tracker does about the uncertainty of its own ship.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum TrackerKind for Tracking, "track --tracker", parameters_of {
        /// Nothing: the pose is taken for the truth.
        Uncompensated = "uncompensated", 5,
            "many targets in clutter, JIPDA and IMM; takes the own ship's pose as true",
            "docs/derivations/association.md", "the baseline";
        /// It is added to the noise of every detection, as if it were new each time.
        Converted = "converted", 5, "the same, the own pose's covariance added to each detection's noise",
            "docs/derivations/association.md", "to compare with";
        /// It is carried along with its correlation to each target.
        #[default]
        Schmidt = "schmidt", 5,
            "the same, Schmidt-Kalman: the own pose's correlation with each target is carried along",
            "docs/derivations/association.md", "targets seen from a ship whose pose is uncertain; the default";
    }
}

/// All of them have the same parameters.
fn parameters_of(_: TrackerKind) -> Vec<ParameterInfo> {
    let mut all = ParameterInfo::of_table::<MotionModels<f64>>(MOTION);
    all.extend(ParameterInfo::of_table::<MultiTargetSettings<f64>>(""));
    all
}

impl std::str::FromStr for TrackerKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text)
            .ok_or_else(|| format!("`{text}` is no tracker; there are {}", Self::names()))
    }
}
