//! What a tracking run can be asked for.

use northing_core::parameters::{Table as _, Value};
use northing_core::tracking::SensorScale;
use northing_core::tracking::multi_target::{MotionModels, MultiTargetConfig, MultiTargetSettings};
use northing_core::tracking::own_ship::PoseErrorCorrelation;

use super::kinds::TrackerKind;
use crate::by_name::{self, Tables};
use crate::error::EvaluationError;
use crate::used_parameters::{Origin, Origins, UsedParameter, used};

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
    /// Distance beyond which a track is no track of a target, m: the cut-off of GOSPA. Default: from the sensor's noise and the targets'
    /// spacing. A target is covered by a track within half of it.
    pub cutoff_m: Option<f64>,
    /// How targets move.
    pub motion: MotionModels<f64>,
    /// Settings of the tracker beside.
    pub settings: MultiTargetSettings<f64>,
    /// Origins of those that are not the defaults.
    pub origins: Origins,
}

/// Names of the motion models' parameters begin so.
pub(super) const MOTION: &str = "motion.";
const LEARN_CORRELATION: &str = "learn_pose_error_correlation";
const LEARN_VISIBILITY: &str = "learn_visibility";
const LEARN_MANOEUVRES: &str = "learn_manoeuvres";

impl TrackOptions {
    fn tables(&mut self) -> Tables<'_> {
        vec![(MOTION, &mut self.motion), ("", &mut self.settings)]
    }

    /// Sets one parameter of the tracker from `NAME=VALUE` and remembers where it comes from.
    ///
    /// # Errors
    /// It is no setting, the name is unknown, or the value does not fit.
    pub fn set_from(&mut self, setting: &str, origin: Origin) -> Result<(), EvaluationError> {
        let before = self.settings;
        let name = by_name::set(self.tables(), setting)?;
        let lasts = name.starts_with("pose_error_correlation.")
            && self.settings.parameter(&name) != Some(Value::Number(0.0));
        if self.tracker == TrackerKind::Converted && lasts {
            self.settings = before;
            return Err(EvaluationError::BadValue {
                name,
                value: setting.to_owned(),
                problem: "`converted` takes pose errors as new at every scan; choose `schmidt`"
                    .to_owned(),
            });
        }
        if lasts {
            self.keep(LEARN_CORRELATION, origin, |settings| {
                &mut settings.learn_pose_error_correlation
            });
        }
        match name.as_str() {
            "existence.visible_s" => {
                self.keep(LEARN_VISIBILITY, origin, |s| &mut s.learn_visibility);
            }
            "motion.straight_dwell_s" => {
                self.keep(LEARN_MANOEUVRES, origin, |s| &mut s.learn_manoeuvres);
            }
            _ => {}
        }
        self.origins.insert(name, origin);
        Ok(())
    }

    /// Whoever says how long something lasts means it: unless somebody said otherwise, it is not learnt.
    fn keep(
        &mut self,
        learns: &str,
        origin: Origin,
        setting: fn(&mut MultiTargetSettings<f64>) -> &mut bool,
    ) {
        if !self.origins.contains_key(learns) {
            *setting(&mut self.settings) = false;
            self.origins.insert(learns.to_owned(), origin);
        }
    }

    /// The same with what follows from a sensor in place of what nobody asked for.
    #[must_use]
    pub fn derived(&self, scale: Option<SensorScale<f64>>) -> Self {
        let mut options = self.clone();
        let derived = scale.and_then(|scale| Some((scale.motion()?, scale.settings()?)));
        let Some((motion, settings)) = derived else {
            return options;
        };
        let mut whole = Self {
            motion,
            settings,
            ..Self::default()
        };
        let rows = by_name::rows(&whole.tables());
        let usual = by_name::rows(&Self::default().tables());
        let own = by_name::rows(&options.tables());
        for ((row, usual), own) in rows.iter().zip(&usual).zip(&own) {
            let name = row.name();
            let asked = options.origins.contains_key(&name) || own.value != usual.value;
            // Of a row of the same tables, within its range: it is never refused.
            if !asked
                && row.value != usual.value
                && by_name::put(options.tables(), &name, row.value).is_ok()
            {
                options.origins.insert(name, Origin::Learnt);
            }
        }
        options
    }

    /// As the tracker takes them: pose errors of `converted` are new at every scan.
    fn in_force(&self) -> Self {
        let mut options = self.clone();
        if self.tracker == TrackerKind::Converted {
            options.settings.pose_error_correlation = PoseErrorCorrelation {
                position_s: 0.0,
                heading_s: 0.0,
            };
            options.settings.learn_pose_error_correlation = false;
        }
        options
    }

    /// The configuration of the tracker.
    #[must_use]
    pub fn config(&self) -> MultiTargetConfig<f64, 3> {
        MultiTargetConfig {
            models: self.motion.into(),
            settings: self.in_force().settings,
        }
    }

    /// Every parameter with its value and origin.
    #[must_use]
    pub fn parameters(&self) -> Vec<UsedParameter> {
        let usual = Self {
            tracker: self.tracker,
            ..Self::default()
        };
        let [rows, usual] =
            [self, &usual].map(|options| by_name::rows(&options.in_force().tables()));
        used(rows, &usual, &self.origins)
    }
}
