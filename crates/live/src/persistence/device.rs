//! What a device is known by and was set to, from one start of the lab to the next.

use northing_core::calibration::magnetometer::MagnetometerCalibration;
use northing_evaluation::{EstimatorKind, EvaluationError};
use serde::{Deserialize, Serialize};

use super::options::SavedOptions;
use crate::session::DeviceSession;

/// What the file says of itself.
pub(super) const FORMAT: &str = "northing-lab-device";
/// The version that this program writes.
pub(super) const VERSION: u64 = 1;

/// A device's name, settings and calibrations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedDevice {
    format: String,
    version: u64,
    /// What it is addressed by.
    pub id: String,
    /// The name that it was given in the lab; `None`: its own.
    pub name: Option<String>,
    /// Profile, parameters, sensors, calibration at rest.
    pub options: SavedOptions,
    /// The estimators that run; those that somebody brought along are not among them.
    pub estimators: Vec<EstimatorKind>,
    /// The one of them that was chosen as the subject.
    pub subject: Option<EstimatorKind>,
    /// The magnetometer calibration.
    pub magnetometer: Option<MagnetometerCalibration<f64>>,
    /// When the calibrations were made.
    pub calibrated: CalibrationTimes,
}

/// When the calibrations in force were made, UTC.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct CalibrationTimes {
    /// The one at rest.
    pub rest: Option<String>,
    /// The magnetometer's.
    pub magnetometer: Option<String>,
}

impl SavedDevice {
    /// Of a device as it is now.
    #[must_use]
    pub fn of(
        id: &str,
        name: Option<String>,
        session: &DeviceSession,
        calibrated: CalibrationTimes,
    ) -> Self {
        let is_ours = |kind: &EstimatorKind| !matches!(kind, EstimatorKind::Own(_));
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            id: id.to_owned(),
            name,
            options: SavedOptions::of(session.options()),
            estimators: session.estimators().into_iter().filter(is_ours).collect(),
            subject: session.chosen().filter(is_ours),
            magnetometer: session.magnetometer().copied(),
            calibrated,
        }
    }

    /// Puts a new session into the state that was saved; estimators that somebody brought along stay beside the saved ones.
    ///
    /// # Errors
    /// A parameter is not permitted, or a calibration is none; nothing has changed then.
    pub fn restore(&self, session: &mut DeviceSession) -> Result<(), EvaluationError> {
        let options = self.options.options()?;
        let mut kinds = self.estimators.clone();
        let own = |kind: &EstimatorKind| matches!(kind, EstimatorKind::Own(_));
        kinds.extend(session.estimators().into_iter().filter(own));
        session.resume(options, &kinds, self.subject, self.magnetometer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::{Profile, RunOptions};
    use serde_json::json;

    #[test]
    fn a_device_comes_back_as_it_was() {
        let start = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        let mut session = DeviceSession::new(start.clone()).unwrap();
        let settings = json!({"accelerometer_std": 0.1 / 3.0});
        let settings = settings.as_object().unwrap();
        session.set(Some(Profile::HandHeld), settings).unwrap();
        let kinds = [EstimatorKind::Mekf3, EstimatorKind::Usque];
        session.use_estimators(&kinds).unwrap();
        session.use_subject(EstimatorKind::Mekf3).unwrap();
        let times = CalibrationTimes {
            rest: Some("then".to_owned()),
            magnetometer: None,
        };
        let saved = SavedDevice::of("anna", Some("Anna".to_owned()), &session, times);
        let read: SavedDevice = serde_json::from_value(json!(saved)).unwrap();
        assert_eq!(read, saved);
        let mut again = DeviceSession::new(start).unwrap();
        read.restore(&mut again).unwrap();
        assert_eq!(again.config(), session.config());
        assert_eq!(again.estimators(), kinds);
        assert_eq!(again.subject(), Some(EstimatorKind::Mekf3));
        let once_more = SavedDevice::of("anna", read.name.clone(), &again, read.calibrated.clone());
        assert_eq!(once_more, saved);
    }

    #[test]
    fn what_no_device_can_be_is_refused_and_changes_nothing() {
        let mut session = DeviceSession::new(RunOptions::default()).unwrap();
        let mut saved = SavedDevice::of("anna", None, &session, CalibrationTimes::default());
        saved.options.setup.config.attitude.accelerometer_std = -1.0;
        let before = session.config();
        saved.restore(&mut session).unwrap_err();
        assert_eq!(session.config(), before);
    }
}
