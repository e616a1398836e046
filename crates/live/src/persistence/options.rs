//! The options of a run as they are kept: everything that it depends on, and where each value came from.

use std::collections::BTreeMap;

use northing_evaluation::attitude::setup::RunSetup;
use northing_evaluation::{EstimatorKind, EvaluationError, Origin, RunOptions};
use northing_recording::WorldFrame;
use serde::{Deserialize, Serialize};

const ORIGINS: [Origin; 9] = [
    Origin::Default,
    Origin::Profile,
    Origin::File,
    Origin::Set,
    Origin::Setup,
    Origin::SetupDefault,
    Origin::Recording,
    Origin::Calibration,
    Origin::Learnt,
];

/// Options without their estimator, which is said beside them: it may be one that somebody brought along.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedOptions {
    /// Profile, parameters, sensors, calibration at rest.
    pub setup: RunSetup,
    /// Names of the origins of parameters that are not their profile's.
    origins: BTreeMap<String, String>,
    /// The frame of the attitudes.
    world_frame: WorldFrame,
}

impl SavedOptions {
    /// Of these options.
    #[must_use]
    pub fn of(options: &RunOptions) -> Self {
        let origins = options.origins.iter();
        Self {
            setup: RunSetup::of(&RunOptions {
                estimator: EstimatorKind::Mekf,
                ..options.clone()
            }),
            origins: origins
                .map(|(name, origin)| (name.clone(), origin.name().to_owned()))
                .collect(),
            world_frame: options.world_frame,
        }
    }

    /// The options.
    ///
    /// # Errors
    /// They are not permitted.
    pub fn options(&self) -> Result<RunOptions, EvaluationError> {
        let mut options = self.setup.clone().options()?;
        options.world_frame = self.world_frame;
        options.origins = self
            .origins
            .iter()
            .filter_map(|(name, said)| {
                let origin = ORIGINS.iter().find(|origin| origin.name() == said)?;
                Some((name.clone(), *origin))
            })
            .collect();
        Ok(options)
    }
}
