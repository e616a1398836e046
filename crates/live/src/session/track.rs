//! One estimator on a live stream: its driver, and changing its parameters while it runs.

use northing_core::attitude::driver::{AttitudeDriver, DriverConfig};
use northing_core::attitude::{AttitudeEstimator, InitialState};
use northing_evaluation::EvaluationError;
use northing_evaluation::attitude::kinds::{AnyEstimator, EstimatorKind};
use northing_evaluation::attitude::parameters::Parameters;

/// An estimator and its driver.
#[derive(Debug, Clone)]
pub struct Track {
    /// Which estimator.
    pub kind: EstimatorKind,
    /// What feeds it.
    pub driver: AttitudeDriver<f64, AnyEstimator>,
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
        let estimator = AnyEstimator::new(kind, config)?;
        let driver = estimator.map(|estimator| AttitudeDriver::new(estimator, driver));
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
        let (estimator, start) = (&self.driver.estimator, self.driver.start()?);
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

    /// Goes on from the present estimate with other parameters.
    ///
    /// # Errors
    /// A parameter is invalid; nothing has changed then.
    pub fn retune(&mut self, config: &Parameters) -> Result<(), EvaluationError> {
        let Some(mut estimator) = AnyEstimator::new(self.kind, config)? else {
            return Ok(());
        };
        if let Some(state) = self.state() {
            estimator.initialize(&state);
        }
        self.driver.estimator = estimator;
        Ok(())
    }
}
