//! Options of a run: estimator, parameters, sensors, calibration, scoring.

use std::str::FromStr;

use northing_core::attitude::InitialState;
use northing_core::attitude::driver::DriverConfig;
use northing_core::calibration::RestCalibration;
use northing_core::geometry::frames::TangentFrame;
use northing_recording::{Event, SensorKind, WorldFrame};
use serde::{Deserialize, Serialize};

use crate::attitude::parameters;
use crate::attitude::reference::ReferenceUse;
use crate::attitude::{EstimatorKind, Parameters, Profile};
use crate::by_name;
use crate::calibration::magnetometer::{MagnetometerSource, MagnetometerStreamCalibration};
use crate::error::EvaluationError;
use crate::used_parameters::{Origin, Origins, UsedParameter};

/// Everything a run is asked for. [`RunOptions::default`] is `bounded-velocity` with the hand-held profile and
/// all sensors.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// Name of the recording, for the summary.
    pub recording: String,
    /// The estimator, default the first choice for the profile ([`Profile::estimator`]).
    pub estimator: EstimatorKind,
    /// The profile that `config` started from; it is named in the summary.
    pub profile: Profile,
    /// The parameters.
    pub config: Parameters,
    /// Origins of the parameters that are not their profile's: a calibration does not change what somebody set.
    pub origins: Origins,
    /// Alignment and gaps. Its prior's frame is replaced by `world_frame`.
    pub driver: DriverConfig<f64>,
    /// The sensors to use.
    pub sensors: SensorSelection,
    /// Choose the magnetometer's stream by what the recording has and the estimator can do, in place of
    /// the one in `sensors`, default false.
    pub choose_magnetometer: bool,
    /// A calibration made before.
    pub calibration: Option<RestCalibration<f64>>,
    /// Calibration of the magnetometer, applied to every sample of its stream before anything else.
    pub magnetometer_calibration: Option<MagnetometerStreamCalibration>,
    /// Names of the two calibrations, at rest and of the magnetometer, for the summary.
    pub calibration_names: [Option<String>; 2],
    /// Take the calibration from the first so many seconds of the recording, at rest.
    pub calibrate_first_s: Option<f64>,
    /// The state at the first sample, where it is known: nothing is aligned then. It comes from a
    /// filter that was running when the recording began.
    pub start: Option<InitialState<f64>>,
    /// Seconds at the start that are not scored, default 5.
    pub skip_s: f64,
    /// What becomes of the reference, default scored as it is.
    pub reference: ReferenceUse,
    /// The frame of the estimate and of the reference; recordings say theirs.
    pub world_frame: WorldFrame,
    /// Smooth backwards over the whole recording (`mekf` and `bounded-velocity`; memory grows with its length).
    pub smooth: bool,
}

impl Default for RunOptions {
    fn default() -> Self {
        let profile = Profile::default();
        Self::new(profile.estimator(), profile)
    }
}

impl RunOptions {
    /// The options of an estimator and a profile.
    #[must_use]
    pub fn new(estimator: EstimatorKind, profile: Profile) -> Self {
        Self {
            recording: String::new(),
            estimator,
            profile,
            config: profile.config(),
            origins: Origins::new(),
            driver: DriverConfig::default(),
            sensors: SensorSelection::default(),
            choose_magnetometer: false,
            calibration: None,
            magnetometer_calibration: None,
            calibration_names: [None, None],
            calibrate_first_s: None,
            start: None,
            skip_s: 5.0,
            reference: ReferenceUse::AsIs,
            world_frame: WorldFrame::Enu,
            smooth: false,
        }
    }

    /// Applies one setting such as `accelerometer_std=0.3` and remembers that the user wanted it.
    ///
    /// # Errors
    /// As [`parameters::apply_setting`].
    pub fn set(&mut self, setting: &str) -> Result<(), EvaluationError> {
        self.set_from(setting, Origin::Set)
    }

    /// As [`Self::set`], of another origin.
    ///
    /// # Errors
    /// As [`Self::set`].
    pub fn set_from(&mut self, setting: &str, origin: Origin) -> Result<(), EvaluationError> {
        let name = parameters::apply_setting(&mut self.config, setting)?;
        self.origins.insert(name, origin);
        Ok(())
    }

    /// Every parameter of the estimator with its value and origin.
    #[must_use]
    pub fn parameters(&self) -> Vec<UsedParameter> {
        let [usual, profile] = [Profile::default(), self.profile].map(Profile::config);
        let used = |row: by_name::Row| {
            let name = row.name();
            let value = self.config.value(&name)?;
            let origin = match self.origins.get(&name) {
                Some(origin) => *origin,
                None if usual.value(&name) == Some(value) => Origin::Default,
                None if profile.value(&name) == Some(value) => Origin::Profile,
                // Written into `config` by whoever made the options.
                None => Origin::Set,
            };
            Some(UsedParameter::new(name, row.parameter, value, origin))
        };
        let rows = parameters::rows().filter(|row| row.is_read_by(self.estimator));
        rows.filter_map(used).collect()
    }

    /// Checks what can be checked before a recording is read.
    ///
    /// # Errors
    /// A configuration without sense, two calibrations, smoothing of something that has no smoother.
    pub fn check(&self) -> Result<(), EvaluationError> {
        self.config.validate()?;
        if self.calibration.is_some() && self.calibrate_first_s.is_some() {
            return Err(EvaluationError::TwoCalibrations);
        }
        if self.smooth && !self.estimator.has_smoother() {
            return Err(EvaluationError::NoSmoother {
                estimator: self.estimator.name(),
            });
        }
        let source = self.sensors.magnetometer_source;
        if let Some(field) = &self.magnetometer_calibration
            && field.magnetometer != source
        {
            return Err(EvaluationError::OtherMagnetometer {
                calibrated: field.magnetometer.name(),
                used: source.name(),
            });
        }
        let times = [
            ("alignment_s", self.driver.alignment_s),
            ("gap_limit_s", self.driver.gap_limit_s),
            ("skip_s", self.skip_s),
            ("calibrate_first_s", self.calibrate_first_s.unwrap_or(0.0)),
        ];
        for (name, value) in times {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(EvaluationError::BadValue {
                    name: name.to_owned(),
                    value: value.to_string(),
                    problem: "expected a time in seconds, 0 or above".to_owned(),
                });
            }
        }
        Ok(())
    }

    /// The driver's settings with the frame of this run.
    #[must_use]
    pub(crate) fn driver_config(&self) -> DriverConfig<f64> {
        let mut driver = self.driver;
        driver.prior.frame = tangent_frame(self.world_frame);
        driver
    }

    /// The event with its field calibrated, where a calibration is given.
    pub(crate) fn calibrated(&self, event: Event) -> Event {
        match &self.magnetometer_calibration {
            Some(field) => field.apply(event),
            None => event,
        }
    }

    /// How long the errors of a sensor that corrects the attitude are taken to last, s; `None` where the estimator has no
    /// noise of it that innovations could judge.
    #[must_use]
    pub fn correlation_time_s(&self, sensor: SensorKind) -> Option<f64> {
        let bounded = self.estimator == EstimatorKind::BoundedVelocity;
        let config = self.config.alignment(self.estimator);
        match sensor {
            // A bounded velocity is no noise of the accelerometer: there is no R to judge.
            SensorKind::Accelerometer if bounded => None,
            SensorKind::Accelerometer => Some(config.accelerometer_correlation_time_s),
            SensorKind::Magnetometer if bounded => {
                Some(self.config.bounded_velocity.magnetometer_correlation_time_s)
            }
            SensorKind::Magnetometer => Some(config.magnetometer_correlation_time_s),
            SensorKind::CompassHeading => Some(config.compass_correlation_time_s),
            _ => None,
        }
    }

    /// Whether somebody set this parameter.
    #[must_use]
    pub fn is_explicit(&self, name: &str) -> bool {
        self.origins.get(name).is_some_and(|o| o.is_explicit())
    }
}

/// The frame of core that a recording's frame is.
pub(crate) const fn tangent_frame(frame: WorldFrame) -> TangentFrame {
    match frame {
        WorldFrame::Enu => TangentFrame::Enu,
        WorldFrame::Ned => TangentFrame::Ned,
    }
}

/// The sensors a run uses beside the gyroscope, which every estimator needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSelection {
    /// Whether the accelerometer is used, default true.
    pub accelerometer: bool,
    /// Whether the magnetometer is used, default true.
    pub magnetometer: bool,
    /// Which magnetometer stream, default the device's.
    pub magnetometer_source: MagnetometerSource,
    /// Whether compass headings of the device are used, default where it has no magnetometer.
    #[serde(default)]
    pub compass: CompassUse,
}

/// When headings that the device itself reports are measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CompassUse {
    /// While no magnetometer has delivered: its field is the better north, and the compass is made
    /// of the same field.
    #[default]
    WithoutMagnetometer,
    /// Always.
    Always,
    /// Never.
    Never,
}

impl CompassUse {
    /// Whether a heading is used, given whether the device's magnetometer has delivered.
    #[must_use]
    pub const fn applies(self, has_magnetometer: bool) -> bool {
        match self {
            Self::WithoutMagnetometer => !has_magnetometer,
            Self::Always => true,
            Self::Never => false,
        }
    }
}

impl Default for SensorSelection {
    fn default() -> Self {
        Self {
            accelerometer: true,
            magnetometer: true,
            magnetometer_source: MagnetometerSource::Device,
            compass: CompassUse::WithoutMagnetometer,
        }
    }
}

impl SensorSelection {
    /// The names that a list of sensors can hold.
    pub const NAMES: &'static str =
        "gyro (gyroscope), acc (accelerometer), mag (magnetometer), mag-uncalibrated, compass";
}

/// A list such as `gyro,acc`.
impl FromStr for SensorSelection {
    type Err = EvaluationError;

    fn from_str(text: &str) -> Result<Self, EvaluationError> {
        let mut gyroscope = false;
        let mut selection = Self {
            accelerometer: false,
            magnetometer: false,
            compass: CompassUse::Never,
            ..Self::default()
        };
        for name in text.split(',').map(str::trim) {
            match name {
                "gyro" | "gyroscope" => gyroscope = true,
                "acc" | "accelerometer" => selection.accelerometer = true,
                "compass" => selection.compass = CompassUse::Always,
                "mag" | "magnetometer" => selection.magnetometer = true,
                "mag-uncalibrated" | "magnetometer-uncalibrated" => {
                    selection.magnetometer = true;
                    selection.magnetometer_source = MagnetometerSource::Uncalibrated;
                }
                _ => {
                    return Err(EvaluationError::UnknownSensor {
                        name: name.to_owned(),
                        valid: Self::NAMES.to_owned(),
                    });
                }
            }
        }
        if gyroscope {
            Ok(selection)
        } else {
            Err(EvaluationError::GyroscopeNotChosen {
                text: text.to_owned(),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_sensors_are_read() {
        let chosen: SensorSelection = "gyro, acc".parse().unwrap();
        assert!(chosen.accelerometer && !chosen.magnetometer);
        assert_eq!(chosen.compass, CompassUse::Never);
        let compass: SensorSelection = "gyro,compass".parse().unwrap();
        assert_eq!(compass.compass, CompassUse::Always);
        let raw: SensorSelection = "gyroscope,mag-uncalibrated".parse().unwrap();
        assert!(!raw.accelerometer && raw.magnetometer);
        assert_eq!(raw.magnetometer_source, MagnetometerSource::Uncalibrated);
        let error = |text: &str| text.parse::<SensorSelection>().unwrap_err().to_string();
        assert!(error("acc,mag").contains("gyroscope is missing in `acc,mag`"));
        assert!(error("gyro,baro").contains("unknown sensor `baro`; expected a list of: gyro"));
    }

    #[test]
    fn contradictions_are_refused_before_anything_is_read() {
        let mut options = RunOptions {
            smooth: true,
            ..RunOptions::default()
        };
        assert!(options.check().is_ok());
        options.estimator = EstimatorKind::BoundedVelocity;
        assert!(options.check().is_ok());
        options.estimator = EstimatorKind::Usque;
        assert!(
            options
                .check()
                .unwrap_err()
                .to_string()
                .contains("no smoother for `usque`")
        );
        let options = RunOptions {
            skip_s: f64::NAN,
            ..RunOptions::default()
        };
        assert!(
            options
                .check()
                .unwrap_err()
                .to_string()
                .starts_with("parameter `skip_s`")
        );
    }

    #[test]
    fn settings_of_the_user_are_remembered() {
        let mut options = RunOptions::default();
        options.set("accelerometer_std=0.3").unwrap();
        assert!(options.is_explicit("accelerometer_std"));
        assert!(!options.is_explicit("magnetometer_std_ut"));
    }
}
