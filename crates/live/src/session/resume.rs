//! Taking up settings, estimators and calibrations of an earlier start of the lab.

use northing_core::calibration::magnetometer::MagnetometerCalibration;
use northing_evaluation::{EstimatorKind, EvaluationError, RunOptions};

use super::DeviceSession;
use super::track::Track;

impl DeviceSession {
    /// Goes on with what was in force before; the estimators align themselves, as nobody knows where the device is.
    ///
    /// # Errors
    /// The options are invalid; nothing has changed then.
    pub fn resume(
        &mut self,
        options: RunOptions,
        kinds: &[EstimatorKind],
        subject: Option<EstimatorKind>,
        magnetometer: Option<MagnetometerCalibration<f64>>,
    ) -> Result<(), EvaluationError> {
        options.check()?;
        let before = std::mem::replace(&mut self.options, options);
        let (config, driver) = (self.config(), self.driver());
        let tracks = kinds.iter().map(|kind| Track::new(*kind, &config, driver));
        match tracks.collect::<Result<Vec<_>, _>>() {
            Ok(tracks) => self.tracks = tracks.into_iter().flatten().collect(),
            Err(error) => {
                self.options = before;
                return Err(error);
            }
        }
        self.magnetometer = magnetometer;
        self.expect_hard_iron();
        self.renew_subject();
        // One that does not run any more is not chosen.
        let _ = subject.map(|kind| self.use_subject(kind));
        Ok(())
    }
}
