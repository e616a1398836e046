//! One estimator on a live stream: its driver, and changing its parameters while it runs.

use northing_core::attitude::driver::DriverConfig;
use northing_core::attitude::{AttitudeEstimator, InitialState};
use northing_evaluation::EvaluationError;
use northing_evaluation::attitude::AnyDriver;
use northing_evaluation::attitude::kinds::{AnyEstimator, EstimatorKind};
use northing_evaluation::attitude::parameters::Parameters;

/// An estimator and its driver.
#[derive(Debug)]
pub struct Track {
    /// Which estimator.
    pub kind: EstimatorKind,
    /// What feeds it.
    pub driver: AnyDriver,
    /// Whether a magnetic field has said where north is.
    pub has_field: bool,
}

impl Track {
    /// A track that aligns itself; `None` for the device's own orientation, which needs no driver.
    ///
    /// # Errors
    /// A parameter is invalid.
    pub fn new(
        kind: EstimatorKind,
        config: &Parameters,
        driver: DriverConfig<f64>,
    ) -> Result<Option<Self>, EvaluationError> {
        let estimator = AnyEstimator::live(kind, config)?;
        let driver = estimator.map(|estimator| AnyDriver::new(estimator, driver));
        Ok(driver.map(|driver| Self {
            kind,
            driver,
            has_field: false,
        }))
    }

    /// Whether magnetometer or compass have said where north is.
    #[must_use]
    pub fn knows_north(&self) -> bool {
        self.has_field || self.driver.knows_north()
    }

    /// The state of now, to start from anew; `None` while it aligns itself.
    #[must_use]
    pub fn state(&self) -> Option<InitialState<f64>> {
        let (estimator, start) = (self.driver.estimator(), self.driver.start()?);
        // Filters without a bias state keep the bias they started with.
        let (bias, bias_std) = match estimator.gyroscope_bias() {
            Some((bias, p)) => (bias, p.diagonal().max().max(0.0).sqrt()),
            None => (start.gyroscope_bias, start.gyroscope_bias_std),
        };
        Some(InitialState {
            attitude: estimator.attitude(),
            attitude_covariance: estimator
                .attitude_covariance()
                .unwrap_or(start.attitude_covariance),
            gyroscope_bias: bias,
            gyroscope_bias_std: bias_std,
            north_known: self.driver.knows_north(),
            references: start.references,
        })
    }

    /// The estimator that goes on from the present estimate with other parameters; `None`: the one that runs goes on, for one that
    /// was brought along has none of these parameters.
    ///
    /// # Errors
    /// A parameter is invalid.
    pub fn retuned(&self, config: &Parameters) -> Result<Option<AnyEstimator>, EvaluationError> {
        if matches!(self.kind, EstimatorKind::Own(_)) {
            return Ok(None);
        }
        let mut estimator = AnyEstimator::live(self.kind, config)?;
        if let (Some(estimator), Some(state)) = (&mut estimator, self.state()) {
            estimator.initialize(&state);
        }
        Ok(estimator)
    }

    /// Goes on from the present estimate with other parameters.
    ///
    /// # Errors
    /// A parameter is invalid; nothing has changed then.
    pub fn retune(&mut self, config: &Parameters) -> Result<(), EvaluationError> {
        if let Some(estimator) = self.retuned(config)? {
            self.driver.replace_estimator(estimator);
        }
        Ok(())
    }

    /// Why the estimator has failed, in a sentence.
    #[must_use]
    pub fn failure(&self) -> Option<String> {
        self.driver.estimator().failure()
    }
}
