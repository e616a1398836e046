//! The trackers of many targets by name.

use northing_core::tracking::multi_target::{MotionModels, MultiTargetSettings};

use super::options::MOTION;
use crate::registry::{EstimatorInfo, ParameterInfo, Question, Registered};

/// What a tracker does about the uncertainty of its own ship.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TrackerKind {
    /// Nothing: the pose is taken for the truth.
    Uncompensated,
    /// It is added to the noise of every detection, as if it were new each time.
    Converted,
    /// It is carried along with its correlation to each target.
    #[default]
    Schmidt,
}

impl TrackerKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Uncompensated, Self::Converted, Self::Schmidt];

    /// What there is to know about it.
    #[must_use]
    pub const fn info(self) -> EstimatorInfo {
        let [name, summary, when] = match self {
            Self::Uncompensated => [
                "uncompensated",
                "many targets in clutter, JIPDA and IMM; takes the own ship's pose as true",
                "the baseline",
            ],
            Self::Converted => [
                "converted",
                "the same, the own pose's covariance added to each detection's noise",
                "to compare with",
            ],
            Self::Schmidt => [
                "schmidt",
                "the same, Schmidt-Kalman: the own pose's correlation with each target is carried along",
                "targets seen from a ship whose pose is uncertain; the default",
            ],
        };
        EstimatorInfo {
            name,
            summary,
            error_states: 5,
            has_covariance: true,
            paper: "docs/derivations/association.md",
            when,
        }
    }

    /// The name for people and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.info().name
    }
}

impl Registered for TrackerKind {
    const QUESTION: Question = Question::Tracking;
    const COMMAND: &'static str = "track --tracker";
    const EVERY: &'static [Self] = &Self::ALL;

    fn info(self) -> EstimatorInfo {
        Self::info(self)
    }

    fn parameters(self) -> Vec<ParameterInfo> {
        let mut all = ParameterInfo::of_table::<MotionModels<f64>>(MOTION);
        all.extend(ParameterInfo::of_table::<MultiTargetSettings<f64>>(""));
        all
    }
}

impl std::str::FromStr for TrackerKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|kind| kind.name() == text);
        known.ok_or_else(|| {
            format!("`{text}` is no tracker; there are uncompensated, converted, schmidt")
        })
    }
}
