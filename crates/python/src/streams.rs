//! Attitude estimators sample by sample: every update returns its innovation; the state is pickled and goes on to the bit.

use nalgebra::Vector3;
use northing_core::Restorable;
use northing_core::attitude::driver::{AttitudeDriver, DriverConfig, DriverState};
use northing_core::attitude::{Propagation, bounded_velocity, mekf};
use northing_core::geometry::rotation;
use northing_core::kalman::{self as core_innovation, Outcome};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::attitude_run::{OUTCOMES, outcome_number};
use crate::configs::{AttitudeConfig, BoundedVelocityConfig};
use crate::errors::refused;

/// What one measurement told a filter.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct Innovation(pub(crate) core_innovation::Innovation<f64>);

#[pymethods]
impl Innovation {
    /// Measured less predicted, in the unit of the sensor.
    #[getter]
    fn residual<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.residual.as_slice())
    }

    /// What the filter expected of it, S.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        PyArray1::from_slice(py, self.0.covariance.transpose().as_slice()).reshape([3, 3])
    }

    /// Normalised innovation squared.
    #[getter]
    fn nis(&self) -> f64 {
        self.0.nis
    }

    /// Components measured; 0 where nothing was, and of filters without covariance.
    #[getter]
    fn degrees_of_freedom(&self) -> u8 {
        self.0.degrees_of_freedom
    }

    /// `fused`, `inflated`, `gated` or `skipped`.
    #[getter]
    fn outcome(&self) -> &'static str {
        OUTCOMES[usize::from(outcome_number(self.0.outcome))]
    }

    /// Why it was skipped.
    #[getter]
    fn reason(&self) -> Option<&'static str> {
        match self.0.outcome {
            Outcome::Skipped(reason) => Some(reason.description()),
            _ => None,
        }
    }

    fn __repr__(&self) -> String {
        let own = &self.0;
        match self.reason() {
            Some(reason) => format!("Innovation(skipped: {reason})"),
            None => format!(
                "Innovation({}, nis={:.3}, degrees_of_freedom={})",
                self.outcome(),
                own.nis,
                own.degrees_of_freedom
            ),
        }
    }
}

fn settings(alignment_s: f64, gap_limit_s: f64) -> PyResult<DriverConfig<f64>> {
    for (name, seconds) in [("alignment_s", alignment_s), ("gap_limit_s", gap_limit_s)] {
        if !(seconds >= 0.0 && seconds.is_finite()) {
            return Err(refused(format!(
                "{name}={seconds}: expected seconds, 0 or above"
            )));
        }
    }
    Ok(DriverConfig {
        alignment_s,
        gap_limit_s,
        ..DriverConfig::default()
    })
}

/// A class of an estimator behind the driver that the runs over recordings use.
macro_rules! stream {
    ($(#[$meaning:meta])* $name:ident: $filter:ty, $config:ty, $state:ty) => {
        $(#[$meaning])*
        #[pyclass(module = "northing._northing")]
        pub(crate) struct $name {
            driver: AttitudeDriver<f64, $filter>,
            config: $config,
            settings: DriverConfig<f64>,
        }

        #[pymethods]
        impl $name {
            #[new]
            #[pyo3(signature = (config=None, *, alignment_s=0.5, gap_limit_s=0.5))]
            fn new(config: Option<$config>, alignment_s: f64, gap_limit_s: f64) -> PyResult<Self> {
                let config = config.unwrap_or_default();
                let filter = <$filter>::new(config.0).map_err(|error| refused(error.to_string()))?;
                let settings = settings(alignment_s, gap_limit_s)?;
                let driver = AttitudeDriver::new(filter, settings);
                Ok(Self { driver, config, settings })
            }

            /// Takes an angular rate, rad/s; why it was skipped, if it was.
            fn gyroscope(&mut self, time_ns: i64, angular_rate: [f64; 3]) -> Option<&'static str> {
                match self.driver.gyroscope(time_ns, &Vector3::from(angular_rate)) {
                    Propagation::Skipped(reason) => Some(reason.description()),
                    _ => None,
                }
            }

            /// Takes a specific force, m/s^2.
            fn accelerometer(&mut self, time_ns: i64, specific_force: [f64; 3]) -> Innovation {
                Innovation(self.driver.accelerometer(time_ns, &Vector3::from(specific_force)))
            }

            /// Takes a magnetic field, microtesla.
            fn magnetometer(&mut self, time_ns: i64, magnetic_field: [f64; 3]) -> Innovation {
                Innovation(self.driver.magnetometer(time_ns, &Vector3::from(magnetic_field)))
            }

            /// Takes a heading clockwise from north and its standard deviation, rad.
            fn compass(&mut self, time_ns: i64, heading: f64, std: f64) -> Innovation {
                Innovation(self.driver.compass(time_ns, heading, std))
            }

            /// Whether there is an estimate.
            #[getter]
            fn is_started(&self) -> bool {
                self.driver.is_started()
            }

            /// `world_from_body`, w, x, y, z.
            #[getter]
            fn quat<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
                let attitude = self.driver.attitude()?;
                Some(PyArray1::from_slice(py, &rotation::to_wxyz(&attitude)))
            }

            /// Of the local attitude error in body axes, rad^2.
            #[getter]
            fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
                let covariance = self.driver.attitude_covariance();
                let array = |p: nalgebra::Matrix3<f64>| PyArray1::from_slice(py, p.transpose().as_slice()).reshape([3, 3]);
                covariance.map(array).transpose()
            }

            /// Gyroscope bias, rad/s.
            #[getter]
            fn gyro_bias<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
                let (bias, _) = self.driver.gyroscope_bias()?;
                Some(PyArray1::from_slice(py, bias.as_slice()))
            }

            /// Its parameters.
            #[getter]
            fn config(&self) -> $config {
                self.config.clone()
            }

            /// Everything that the next step depends on, but for the parameters.
            #[getter]
            fn state(&self) -> PyResult<String> {
                serde_json::to_string(&self.driver.save()).map_err(|error| refused(error.to_string()))
            }

            /// Continues from a saved state.
            #[setter]
            fn set_state(&mut self, state: &str) -> PyResult<()> {
                let state: DriverState<f64, $state> =
                    serde_json::from_str(state).map_err(|error| refused(format!("state: {error}")))?;
                self.driver.restore(state).map_err(|error| refused(format!("state: {error}")))
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (($config, f64, f64), String))> {
                let own = slf.borrow();
                let settings = &own.settings;
                let made_of = (own.config.clone(), settings.alignment_s, settings.gap_limit_s);
                Ok((slf.get_type().getattr("_continued")?, (made_of, own.state()?)))
            }

            #[staticmethod]
            fn _continued(made_of: ($config, f64, f64), state: &str) -> PyResult<Self> {
                let (config, alignment_s, gap_limit_s) = made_of;
                let mut stream = Self::new(Some(config), alignment_s, gap_limit_s)?;
                stream.set_state(state)?;
                Ok(stream)
            }
        }
    };
}
stream! {
    /// The bounded-velocity filter.
    BoundedVelocity: bounded_velocity::BoundedVelocity<f64>, BoundedVelocityConfig, <bounded_velocity::BoundedVelocity<f64> as Restorable>::State
}
stream! {
    /// The multiplicative extended Kalman filter with gyroscope bias.
    Mekf: mekf::Mekf<f64>, AttitudeConfig, <mekf::Mekf<f64> as Restorable>::State
}
