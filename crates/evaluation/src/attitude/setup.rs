//! Everything a run depends on beside its recording, as text: whoever has both gets the same digits.
//!
//! A lab report carries it; `northing run RECORDING --setup REPORT` reads it from there.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use northing_core::attitude::{InitialState, References};
use northing_core::calibration::RestCalibration;
use serde::{Deserialize, Serialize};

use crate::attitude::parameters;
use crate::attitude::{EstimatorKind, Parameters, Profile, RunOptions, SensorSelection};
use crate::calibration::magnetometer::MagnetometerStreamCalibration;
use crate::error::EvaluationError;
use crate::used_parameters::{Origin, Origins, PROGRAM};

/// The options of a run as plain data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSetup {
    /// The program that wrote it, and its version.
    pub program: String,
    /// The estimator.
    pub estimator: EstimatorKind,
    /// The profile that the parameters started from.
    pub profile: Profile,
    /// Every parameter.
    pub config: Parameters,
    /// Names of the parameters that somebody set.
    pub explicit_settings: BTreeSet<String>,
    /// The sensors in use.
    pub sensors: SensorSelection,
    /// Seconds that are averaged for the start.
    pub alignment_s: f64,
    /// Longest pause of the gyroscope that is no gap, s.
    pub gap_limit_s: f64,
    /// Seconds at the start that are not scored.
    pub skip_s: f64,
    /// Calibration at rest.
    pub calibration: Option<RestCalibration<f64>>,
    /// Calibration of the magnetometer.
    #[serde(alias = "field_calibration")]
    pub magnetometer_calibration: Option<MagnetometerStreamCalibration>,
    /// Seconds at the recording's start that a calibration is taken from.
    pub calibrate_first_s: Option<f64>,
    /// The state at the first sample, where it is known.
    pub start: Option<Start>,
    /// Whether the estimates are smoothed.
    pub smooth: bool,
}

/// An [`InitialState`] as plain arrays, rows first; quaternion w, x, y, z.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// `ref_from_body`.
    pub attitude_wxyz: [f64; 4],
    /// Covariance of the attitude error, body axes, rad^2.
    pub attitude_covariance_rad2: [[f64; 3]; 3],
    /// Gyroscope bias, rad/s.
    pub gyroscope_bias_rad_s: [f64; 3],
    /// Its standard deviation, rad/s.
    pub gyroscope_bias_std_rad_s: f64,
    /// Whether a compass has said where north is.
    #[serde(default)]
    pub north_known: bool,
    /// Specific force at rest in the reference frame, m/s^2.
    pub specific_force_m_s2: [f64; 3],
    /// Magnetic field in the reference frame, microtesla.
    pub magnetic_field_ut: Option<[f64; 3]>,
}

impl Start {
    /// Of a state.
    #[must_use]
    pub fn of(state: &InitialState<f64>) -> Self {
        let (q, p) = (&state.attitude, &state.attitude_covariance);
        Self {
            // As it is: another sign or length would change the last digit of what follows.
            attitude_wxyz: [q.w, q.i, q.j, q.k],
            attitude_covariance_rad2: [0, 1, 2].map(|i| [0, 1, 2].map(|j| p[(i, j)])),
            gyroscope_bias_rad_s: state.gyroscope_bias.into(),
            gyroscope_bias_std_rad_s: state.gyroscope_bias_std,
            north_known: state.north_known,
            specific_force_m_s2: state.references.specific_force.into(),
            magnetic_field_ut: state.references.magnetic_field.map(Into::into),
        }
    }

    /// The state; `None` when its numbers are none of a state.
    #[must_use]
    pub fn state(&self) -> Option<InitialState<f64>> {
        let [w, x, y, z] = self.attitude_wxyz;
        let q = Quaternion::new(w, x, y, z);
        let p = &self.attitude_covariance_rad2;
        let state = InitialState {
            attitude: UnitQuaternion::new_unchecked(q),
            attitude_covariance: Matrix3::from_fn(|i, j| p[i][j]),
            gyroscope_bias: self.gyroscope_bias_rad_s.into(),
            gyroscope_bias_std: self.gyroscope_bias_std_rad_s,
            north_known: self.north_known,
            references: References {
                specific_force: self.specific_force_m_s2.into(),
                magnetic_field: self.magnetic_field_ut.map(Vector3::from),
            },
        };
        let is_unit = (q.norm() - 1.0).abs() < 1e-9;
        (is_unit && state.is_usable()).then_some(state)
    }
}

impl RunSetup {
    /// Of these options.
    #[must_use]
    pub fn of(options: &RunOptions) -> Self {
        Self {
            program: PROGRAM.to_owned(),
            estimator: options.estimator,
            profile: options.profile,
            config: options.config,
            explicit_settings: {
                let explicit = options.origins.iter().filter(|(_, o)| o.is_explicit());
                explicit.map(|(name, _)| name.clone()).collect()
            },
            sensors: options.sensors,
            alignment_s: options.driver.alignment_s,
            gap_limit_s: options.driver.gap_limit_s,
            skip_s: options.skip_s,
            calibration: options.calibration,
            magnetometer_calibration: options.magnetometer_calibration,
            calibrate_first_s: options.calibrate_first_s,
            start: options.start.as_ref().map(Start::of),
            smooth: options.smooth,
        }
    }

    /// The options. Name and world frame are the recording's.
    ///
    /// # Errors
    /// As [`RunOptions::check`].
    pub fn options(self) -> Result<RunOptions, EvaluationError> {
        let start =
            match &self.start {
                None => None,
                Some(start) => Some(
                    start.state().ok_or(EvaluationError::UnusableCalibration {
                        problem: "the state that it starts from has numbers that no state can have"
                            .to_owned(),
                    })?,
                ),
            };
        // What nobody had set may change again, by a calibration or by what the recording shows.
        let (profile, mut origins) = (self.profile.config(), Origins::new());
        for row in parameters::rows() {
            let name = row.name();
            if self.explicit_settings.contains(&name) {
                origins.insert(name, Origin::Setup);
            } else if self.config.value(&name) != profile.value(&name) {
                origins.insert(name, Origin::SetupDefault);
            }
        }
        let mut options = RunOptions {
            start,
            config: self.config,
            origins,
            sensors: self.sensors,
            skip_s: self.skip_s,
            calibration: self.calibration,
            magnetometer_calibration: self.magnetometer_calibration,
            calibrate_first_s: self.calibrate_first_s,
            smooth: self.smooth,
            ..RunOptions::new(self.estimator, self.profile)
        };
        options.driver.alignment_s = self.alignment_s;
        options.driver.gap_limit_s = self.gap_limit_s;
        options.check()?;
        Ok(options)
    }

    /// As text, JSON with a line for each value.
    #[must_use]
    pub fn to_text(&self) -> String {
        // Plain data with names as keys: it can always be written.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// From its text, as [`Self::to_text`] wrote it.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| format!("its setup: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options() -> RunOptions {
        let mut options = RunOptions::new(EstimatorKind::Usque, Profile::Lab);
        options.set("accelerometer_std=0.1234567890123456").unwrap();
        options.set("cascade_pole=0.1234567890123456").unwrap();
        options.sensors.magnetometer = false;
        options.skip_s = 1.0 / 3.0;
        options.start = Some(InitialState {
            attitude: UnitQuaternion::from_euler_angles(0.1, 0.2, 3.0),
            attitude_covariance: Matrix3::identity() * 1e-4,
            gyroscope_bias: Vector3::new(0.1, 0.2, 1.0 / 3.0),
            gyroscope_bias_std: 1e-3,
            north_known: true,
            references: References {
                specific_force: Vector3::z() * 9.81,
                magnetic_field: None,
            },
        });
        options
    }

    #[test]
    fn its_text_keeps_it_to_the_last_digit() {
        let setup = RunSetup::of(&options());
        let read = RunSetup::parse(&setup.to_text()).unwrap();
        assert_eq!(read, setup);
        let (made, expected) = (read.options().unwrap(), options());
        assert_eq!(made.config, expected.config);
        assert!(made.origins.keys().eq(expected.origins.keys()));
        assert!(made.origins.values().all(|o| *o == Origin::Setup));
        assert_eq!(
            (made.sensors, made.estimator),
            (expected.sensors, expected.estimator)
        );
        assert_eq!(made.start, expected.start);
        assert_eq!(made.skip_s.to_bits(), expected.skip_s.to_bits());
    }

    #[test]
    fn a_value_that_nobody_set_is_not_called_learnt() {
        // As a report of a program whose profile had another value.
        let mut setup = RunSetup::of(&options());
        setup.config.attitude.magnetometer_std_ut *= 2.0;
        let (name, written) = (
            "magnetometer_std_ut",
            setup.config.attitude.magnetometer_std_ut,
        );
        let options = setup.options().unwrap();
        let used = options.parameters();
        let used = used.iter().find(|used| used.name == name).unwrap();
        assert_eq!(used.value, written);
        assert_eq!(used.origin, Origin::SetupDefault);
        assert!(!options.is_explicit(name), "a calibration may replace it");
        assert_eq!(options.origins["accelerometer_std"], Origin::Setup);
        assert!(options.is_explicit("accelerometer_std"));
    }

    #[test]
    fn what_is_no_setup_is_named() {
        let message = |text: &str| RunSetup::parse(text).unwrap_err();
        assert!(message("<html></html>").contains("its setup"));
        assert!(message("{}").contains("missing field `program`"));
        let mut setup = RunSetup::of(&options());
        setup.skip_s = -1.0;
        assert!(setup.options().unwrap_err().to_string().contains("skip_s"));
    }
}
