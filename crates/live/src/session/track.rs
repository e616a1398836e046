//! One estimator on a live stream: its driver, and changing its parameters while it runs.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::bounded_velocity::BoundedVelocityState;
use northing_core::attitude::driver::{AttitudeDriver, DriverConfig};
use northing_core::attitude::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty,
};
use northing_core::kalman::Innovation;
use northing_evaluation::EvaluationError;
use northing_evaluation::attitude::kinds::{AnyEstimator, EstimatorKind};
use northing_evaluation::attitude::parameters::Parameters;

/// An estimator that remembers its start, to be rebuilt with other parameters.
#[derive(Debug, Clone)]
pub struct Rebuildable {
    inner: AnyEstimator,
    start: Option<InitialState<f64>>,
}

impl Rebuildable {
    /// The state of the bounded-velocity filter, if it is one.
    #[must_use]
    pub fn bounded_velocity(&self) -> Option<&BoundedVelocityState<f64>> {
        match &self.inner {
            AnyEstimator::BoundedVelocity(filter) => Some(filter.state()),
            _ => None,
        }
    }
}

impl AttitudeEstimator<f64> for Rebuildable {
    fn initialize(&mut self, initial: &InitialState<f64>) {
        self.start = Some(*initial);
        self.inner.initialize(initial);
    }

    fn propagate(&mut self, angular_rate: &Vector3<f64>, dt: f64) -> Propagation {
        self.inner.propagate(angular_rate, dt)
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<f64>) -> Innovation<f64> {
        self.inner.update_accelerometer(specific_force)
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<f64>) -> Innovation<f64> {
        self.inner.update_magnetometer(magnetic_field)
    }

    fn update_compass(&mut self, heading: &CompassHeading<f64>) -> Innovation<f64> {
        self.inner.update_compass(heading)
    }

    fn add_attitude_variance(&mut self, variance: f64) {
        self.inner.add_attitude_variance(variance);
    }

    fn attitude(&self) -> UnitQuaternion<f64> {
        self.inner.attitude()
    }

    fn attitude_covariance(&self) -> Option<Matrix3<f64>> {
        self.inner.attitude_covariance()
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        self.inner.gyroscope_bias()
    }

    fn start_uncertainty(&self) -> StartUncertainty<f64> {
        self.inner.start_uncertainty()
    }

    fn rate_at_rest(&self) -> Vector3<f64> {
        self.inner.rate_at_rest()
    }
}

/// An estimator and its driver.
#[derive(Debug, Clone)]
pub struct Track {
    /// Which estimator.
    pub kind: EstimatorKind,
    /// What feeds it.
    pub driver: AttitudeDriver<f64, Rebuildable>,
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
        Ok(AnyEstimator::new(kind, config)?.map(|inner| {
            let estimator = Rebuildable { inner, start: None };
            Self {
                kind,
                driver: AttitudeDriver::new(estimator, driver),
            }
        }))
    }

    /// The state of now, to start from anew; `None` while it aligns itself.
    #[must_use]
    pub fn state(&self) -> Option<InitialState<f64>> {
        self.driver.is_started().then_some(())?;
        let estimator = &self.driver.estimator;
        let start = estimator.start?;
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
        let Some(mut inner) = AnyEstimator::new(self.kind, config)? else {
            return Ok(());
        };
        if let Some(state) = self.state() {
            inner.initialize(&state);
        }
        self.driver.estimator.inner = inner;
        Ok(())
    }
}
