//! The driver of an estimator that is known by its name only while the program runs: compiled here, once for all who run one.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::driver::{AttitudeDriver, DriverConfig};
use northing_core::attitude::{InitialState, Propagation};
use northing_core::faults::{Fault, FaultySensor};
use northing_core::kalman::Innovation;

use crate::attitude::AnyEstimator;

/// As [`AttitudeDriver`], of an [`AnyEstimator`].
#[derive(Debug)]
pub struct AnyDriver(AttitudeDriver<f64, AnyEstimator>);

impl AnyDriver {
    /// A driver that waits for its first samples.
    #[must_use]
    pub fn new(estimator: AnyEstimator, config: DriverConfig<f64>) -> Self {
        Self(AttitudeDriver::new(estimator, config))
    }

    /// The estimator.
    #[must_use]
    pub fn estimator(&self) -> &AnyEstimator {
        &self.0.estimator
    }

    /// Another estimator goes on where this one is.
    pub fn replace_estimator(&mut self, estimator: AnyEstimator) {
        self.0.estimator = estimator;
    }

    /// As [`AttitudeDriver::start_from`].
    pub fn start_from(&mut self, initial: &InitialState<f64>) {
        self.0.start_from(initial);
    }

    /// As [`AttitudeDriver::is_started`].
    #[must_use]
    pub fn is_started(&self) -> bool {
        self.0.is_started()
    }

    /// As [`AttitudeDriver::start`].
    #[must_use]
    pub fn start(&self) -> Option<&InitialState<f64>> {
        self.0.start()
    }

    /// As [`AttitudeDriver::knows_north`].
    #[must_use]
    pub fn knows_north(&self) -> bool {
        self.0.knows_north()
    }

    /// As [`AttitudeDriver::attitude`].
    #[must_use]
    pub fn attitude(&self) -> Option<UnitQuaternion<f64>> {
        self.0.attitude()
    }

    /// As [`AttitudeDriver::attitude_covariance`].
    #[must_use]
    pub fn attitude_covariance(&self) -> Option<Matrix3<f64>> {
        self.0.attitude_covariance()
    }

    /// As [`AttitudeDriver::gyroscope`].
    pub fn gyroscope(&mut self, time_ns: i64, angular_rate: &Vector3<f64>) -> Propagation {
        self.0.gyroscope(time_ns, angular_rate)
    }

    /// As [`AttitudeDriver::accelerometer`].
    pub fn accelerometer(&mut self, time_ns: i64, force: &Vector3<f64>) -> Innovation<f64> {
        self.0.accelerometer(time_ns, force)
    }

    /// As [`AttitudeDriver::magnetometer`].
    pub fn magnetometer(&mut self, time_ns: i64, field: &Vector3<f64>) -> Innovation<f64> {
        self.0.magnetometer(time_ns, field)
    }

    /// As [`AttitudeDriver::compass`].
    pub fn compass(&mut self, time_ns: i64, heading_rad: f64, std_rad: f64) -> Innovation<f64> {
        self.0.compass(time_ns, heading_rad, std_rad)
    }

    /// As [`AttitudeDriver::take_fault`].
    pub fn take_fault(&mut self) -> Option<Fault<f64>> {
        self.0.take_fault()
    }

    /// As [`AttitudeDriver::fault_now`].
    #[must_use]
    pub fn fault_now(&self, sensor: FaultySensor) -> Option<&Fault<f64>> {
        self.0.fault_now(sensor)
    }
}
