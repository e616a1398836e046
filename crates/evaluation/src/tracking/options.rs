//! What a tracking run can be asked for.

use northing_core::parameters::{Table, Value};
use northing_core::tracking::multi_target::{MotionModels, MultiTargetConfig, MultiTargetSettings};
use northing_core::tracking::own_ship::PoseErrorCorrelation;

use super::kinds::TrackerKind;
use crate::by_name::{self, Row};
use crate::error::EvaluationError;
use crate::used_parameters::{Origin, Origins, UsedParameter};

/// Standard deviations of the own ship's pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OwnShipStd {
    /// Position on each axis, m.
    pub position_m: f64,
    /// Heading, rad.
    pub heading_rad: f64,
}

/// How to run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrackOptions {
    /// What to do about the own ship's uncertainty.
    pub tracker: TrackerKind,
    /// Standard deviations of the own ship's pose, instead of those of the recording (and zero when
    /// that has none).
    pub own_ship_std: Option<OwnShipStd>,
    /// Names of the sensors to use, instead of those that the recording marks.
    pub sensors: Option<Vec<String>>,
    /// Added to the own ship's heading, rad: an error that is known exactly.
    pub heading_error_rad: f64,
    /// How targets move.
    pub motion: MotionModels<f64>,
    /// Settings of the tracker beside.
    pub settings: MultiTargetSettings<f64>,
    /// Origins of those that are not the defaults.
    pub origins: Origins,
}

impl TrackOptions {
    /// Sets one parameter of the tracker from `NAME=VALUE` and remembers where it comes from.
    ///
    /// # Errors
    /// It is no setting, the name is unknown, or the value does not fit.
    pub fn set_from(&mut self, setting: &str, origin: Origin) -> Result<(), EvaluationError> {
        let (mut motion, mut settings) = (self.motion, self.settings);
        let name = by_name::set(setting, rows(), |name, value| {
            match name.strip_prefix(MOTION) {
                Some(name) => motion.set_parameter(name, value),
                None => settings.set_parameter(name, value),
            }
        })?;
        let lasts = name.starts_with("pose_error_correlation.")
            && settings.parameter(&name) != Some(Value::Number(0.0));
        if self.tracker == TrackerKind::Converted && lasts {
            return Err(EvaluationError::BadValue {
                name,
                value: setting.to_owned(),
                problem: "`converted` takes pose errors as new at every scan; choose `schmidt`"
                    .to_owned(),
            });
        }
        (self.motion, self.settings) = (motion, settings);
        self.origins.insert(name, origin);
        Ok(())
    }

    /// The configuration as the tracker takes it: pose errors of `converted` are new at every scan.
    #[must_use]
    pub fn config(&self) -> MultiTargetConfig<f64, 3> {
        let mut settings = self.settings;
        if self.tracker == TrackerKind::Converted {
            settings.pose_error_correlation = NEW_AT_EVERY_SCAN;
        }
        MultiTargetConfig {
            models: self.motion.into(),
            settings,
        }
    }

    /// The value of a parameter as the tracker takes it.
    fn value(&self, name: &str) -> Option<Value<f64>> {
        match name.strip_prefix(MOTION) {
            Some(name) => self.motion.parameter(name),
            None => self.config().settings.parameter(name),
        }
    }

    /// Every parameter with its value and origin.
    #[must_use]
    pub fn parameters(&self) -> Vec<UsedParameter> {
        // What makes the tracker what it is counts as its default.
        let usual = Self {
            tracker: self.tracker,
            ..Self::default()
        };
        let used = rows().map(|row| {
            let name = row.name();
            let value = self.value(&name)?;
            let origin = match self.origins.get(&name) {
                Some(origin) => *origin,
                None if usual.value(&name) == Some(value) => Origin::Default,
                None => Origin::Set,
            };
            Some(UsedParameter::new(name, row.parameter, value, origin))
        });
        used.flatten().collect()
    }
}

/// Names of the motion models' parameters begin so.
pub(super) const MOTION: &str = "motion.";

/// What `converted` takes the errors of the own pose for.
const NEW_AT_EVERY_SCAN: PoseErrorCorrelation<f64> = PoseErrorCorrelation {
    position_s: 0.0,
    heading_s: 0.0,
};

fn rows() -> impl Iterator<Item = Row> {
    let motion = Row::of(MOTION, MotionModels::<f64>::PARAMETERS);
    motion.chain(Row::of("", MultiTargetSettings::<f64>::PARAMETERS))
}
