//! What a calibration at rest changes in a run: noise, bias, references, and the start.
//!
//! A calibration from a file gives bias, noise, gravity's length, and strength and dip of the
//! field; the attitude is still found on the recording itself. A calibration from the recording's
//! own start also gives the start: TRIAD of the means, with the covariance of Wahba's problem.

use nalgebra::{Matrix3, UnitQuaternion};
use northing_core::attitude::driver::DriverConfig;
use northing_core::attitude::wahba::{self, MAXIMUM_STD, Observation};
use northing_core::attitude::{AttitudeConfig, InitialState, References};
use northing_core::calibration::{RestCalibration, RestCalibrator, RestLimits, Sensor};
use northing_core::parameters::Value;

use crate::attitude::{Instant, Profile, RunOptions, SensorSelection};
use crate::calibration::magnetometer::MagnetometerSource;
use crate::error::EvaluationError;
use crate::statistics::seconds_between;
use crate::used_parameters::Origin;

impl RunOptions {
    /// With the noise that a calibration measured, except in parameters that somebody set.
    ///
    /// The `lab` profile takes the rest noise as it is. The `hand-held` profile stands for errors that
    /// a device at rest does not show, so its noise is raised where the sensor is worse, never lowered;
    /// the bounded-velocity filter's noise stands for more than the sensors' at rest in any profile.
    #[must_use]
    pub fn calibrated_by(&self, calibration: &RestCalibration<f64>) -> Self {
        let raised = self.profile == Profile::HandHeld;
        let gyroscope = calibration.gyroscope_noise_density();
        let magnetometer = calibration.magnetometer_std_ut();
        let measured = [
            ("gyroscope_noise_density", gyroscope, raised),
            ("accelerometer_std", calibration.accelerometer_std(), raised),
            ("magnetometer_std_ut", magnetometer, raised),
            (
                "gyroscope_sample_interval_s",
                calibration.gyroscope_interval_s,
                false,
            ),
            ("bounded_gyroscope_noise_density", gyroscope, true),
            ("bounded_magnetometer_std_ut", magnetometer, true),
        ];
        let mut options = self.clone();
        for (name, value, only_raised) in measured {
            let Some(value) = value.filter(|v| *v > 0.0 && !self.is_explicit(name)) else {
                continue;
            };
            let stays = |own| matches!(own, Value::Number(own) if only_raised && own >= value);
            let own = self.config.value(name);
            // A value that the table does not permit is no noise.
            if !own.is_some_and(stays) && options.config.set(name, Value::Number(value)).is_ok() {
                options.origins.insert(name.to_owned(), Origin::Calibration);
            }
        }
        options
    }

    /// With what the calibration among them measured: as the estimator gets them.
    #[must_use]
    pub fn in_force(&self) -> Self {
        match &self.calibration {
            Some(calibration) => self.calibrated_by(calibration),
            None => self.clone(),
        }
    }
}

/// How far a gyroscope's bias of one rest is from that of another recording, rad/s (0.3 deg/s): it
/// changes with the temperature and from one switching on to the next.
const BIAS_OF_ANOTHER_RECORDING: f64 = 5.2e-3;

/// Whether a calibration was made at the place where a run begins. In a laboratory every calibration
/// is; a hand-held device has left the place, and its field, where a file was made.
#[must_use]
pub fn is_of_this_place(options: &RunOptions) -> bool {
    options.profile == Profile::Lab || options.calibration.is_none()
}

/// The driver's settings with what the calibration knows beforehand. From a file it says nothing about
/// the field around a hand-held device, and about its bias less than it did then.
#[must_use]
pub fn calibrated_driver(
    options: &RunOptions,
    calibration: &RestCalibration<f64>,
) -> DriverConfig<f64> {
    let mut driver = options.driver_config();
    driver.prior.gyroscope_bias = calibration.gyroscope_bias();
    let bias_std = calibration.gyroscope_bias_std();
    driver.prior.gyroscope_bias_std = Some(bias_std);
    if let Some(gravity) = calibration.gravity() {
        driver.prior.gravity = gravity;
    }
    if is_of_this_place(options) {
        driver.prior.field_horizontal_down_ut = calibration.field_horizontal_down();
    } else {
        let bias_std = bias_std.hypot(BIAS_OF_ANOTHER_RECORDING);
        driver.prior.gyroscope_bias_std = Some(bias_std);
    }
    driver
}

/// The state at the end of a rest: the pose in which the calibration was made. `config` is the
/// calibrated one; its noise, averaged over the rest, and what rounding hides say how well the means
/// point.
#[must_use]
pub fn state_at_rest(
    calibration: &RestCalibration<f64>,
    config: &AttitudeConfig<f64>,
    driver: &DriverConfig<f64>,
) -> InitialState<f64> {
    let frame = driver.prior.frame;
    let force = calibration.specific_force();
    let field = calibration.magnetic_field_ut().filter(|_| force.is_some());
    let field_ref = calibration
        .field_horizontal_down()
        .map(|[h, down]| frame.magnetic_field(h, down));
    let mut observations = Vec::new();
    if let Some(body) = force {
        let independent = independent_samples(
            calibration.accelerometer_samples,
            calibration.accelerometer_interval_s,
            config.accelerometer_correlation_time_s,
        );
        // Noise averages down, rounding does not.
        let noise = config.accelerometer_std / independent.sqrt();
        let std = noise.hypot(calibration.specific_force_rounding_std()) / body.norm();
        observations.push(Observation {
            body,
            reference: frame.up(),
            std,
        });
    }
    if let (Some(body), Some(reference)) = (field, field_ref) {
        let independent = independent_samples(
            calibration.magnetometer_samples,
            calibration.magnetometer_interval_s,
            config.magnetometer_correlation_time_s,
        );
        let noise = config.magnetometer_std_ut / independent.sqrt();
        let std = noise.hypot(calibration.magnetic_field_rounding_std_ut()) / body.norm();
        observations.push(Observation {
            body,
            reference,
            std,
        });
    }
    let wahba = wahba::davenport(&observations);
    let attitude = match (force, field) {
        // Gravity is much the better of the two: it is matched exactly.
        (Some(f), Some(m)) => wahba::triad(&f, &m, &frame.up(), &frame.north()),
        _ => None,
    };
    let attitude = attitude
        .or(wahba.map(|w| w.ref_from_body))
        .unwrap_or_else(UnitQuaternion::identity);
    let attitude_covariance = match (force, field) {
        (Some(_), Some(_)) => wahba.map(|w| w.covariance),
        // Without a field the heading is a matter of choice, and the start chooses it: it knows
        // its heading as well as its tilt, and what grows from there is the drift.
        (Some(_), None) => observations
            .first()
            .map(|o| Matrix3::identity() * o.std.powi(2)),
        _ => None,
    };
    let unknown = Matrix3::identity() * MAXIMUM_STD.powi(2);
    InitialState {
        attitude,
        attitude_covariance: attitude_covariance.unwrap_or(unknown),
        gyroscope_bias: calibration.gyroscope_bias(),
        gyroscope_bias_std: calibration.gyroscope_bias_std(),
        north_known: false,
        references: References {
            specific_force: frame.specific_force_at_rest(driver.prior.gravity),
            magnetic_field: field_ref,
        },
    }
}

/// How many independent samples a mean of `samples` is worth: one that comes sooner after the last
/// than errors forget themselves counts for that share, as in the filter.
fn independent_samples(samples: u32, interval_s: Option<f64>, correlation_time_s: f64) -> f64 {
    let share = match interval_s {
        Some(interval) if correlation_time_s > interval => interval / correlation_time_s,
        _ => 1.0,
    };
    (f64::from(samples) * share).max(1.0)
}

/// Feeds the first seconds of a recording to a [`RestCalibrator`].
#[derive(Debug, Clone)]
pub struct CalibrationPhase {
    calibrator: RestCalibrator<f64>,
    sensors: SensorSelection,
    seconds: f64,
    last_ns: [Option<i64>; 3],
}

impl CalibrationPhase {
    /// Takes the first `seconds` of the sensors chosen.
    #[must_use]
    pub fn new(seconds: f64, sensors: SensorSelection) -> Self {
        let calibrator = RestCalibrator::new();
        Self {
            calibrator,
            sensors,
            seconds,
            last_ns: [None; 3],
        }
    }

    /// Says to which step a sensor's samples are rounded; see [`RestCalibrator::know_resolution`].
    pub fn know_resolution(&mut self, sensor: Sensor, step: f64) {
        self.calibrator.know_resolution(sensor, step);
    }

    /// Whether the samples of a sensor were all the same.
    #[must_use]
    pub fn is_constant(&self, sensor: Sensor) -> bool {
        self.calibrator.is_constant(sensor)
    }

    /// How long it takes samples, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Adds what was measured at one instant.
    pub fn add(&mut self, instant: &Instant) {
        let t = instant.time_ns;
        if let Some(rate) = instant.angular_rate {
            let dt = since(&mut self.last_ns[0], t);
            self.calibrator.add_gyroscope(&rate, dt);
        }
        if let Some(force) = instant
            .specific_force
            .filter(|_| self.sensors.accelerometer)
        {
            let dt = since(&mut self.last_ns[1], t);
            self.calibrator.add_accelerometer(&force, dt);
        }
        if let Some(field) = chosen_field(instant, &self.sensors) {
            let dt = since(&mut self.last_ns[2], t);
            self.calibrator.add_magnetometer(&field, dt);
        }
    }

    /// The calibration.
    ///
    /// # Errors
    /// [`EvaluationError::CalibrationRejected`] with the reason.
    pub fn finish(&self) -> Result<RestCalibration<f64>, EvaluationError> {
        self.calibrator
            .finish(&RestLimits::default())
            .map_err(|reason| EvaluationError::CalibrationRejected {
                seconds: self.seconds,
                reason: reason.to_string(),
            })
    }
}

/// The magnetic field of the stream that was chosen.
pub(crate) fn chosen_field(
    instant: &Instant,
    sensors: &SensorSelection,
) -> Option<nalgebra::Vector3<f64>> {
    let field = match sensors.magnetometer_source {
        MagnetometerSource::Device => instant.magnetic_field,
        MagnetometerSource::Uncalibrated => instant.magnetic_field_uncalibrated,
    };
    field.filter(|_| sensors.magnetometer)
}

/// Seconds since `last`, which becomes `now`.
fn since(last: &mut Option<i64>, now: i64) -> Option<f64> {
    last.replace(now).map(|before| seconds_between(before, now))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::kinds::EstimatorKind;
    use approx::assert_relative_eq;
    use nalgebra::Vector3;
    use northing_core::geometry::{rotation, so3};
    use northing_simulation::random::{normal_vector, stream};

    const BIAS: Vector3<f64> = Vector3::new(0.01, -0.02, 0.005);

    fn truth() -> UnitQuaternion<f64> {
        so3::exp(&Vector3::new(0.1, -0.2, 1.0))
    }

    /// Ten seconds at rest in the pose [`truth`], 100 Hz.
    fn phase() -> CalibrationPhase {
        let mut phase = CalibrationPhase::new(10.0, SensorSelection::default());
        let mut noise = stream(3, "rest");
        for k in 0..1000_i64 {
            let body = |world: Vector3<f64>| truth().inverse() * world;
            phase.add(&Instant {
                time_ns: k * 10_000_000,
                angular_rate: Some(BIAS + normal_vector(&mut noise, 0.005)),
                specific_force: Some(
                    body(Vector3::new(0.0, 0.0, 9.81)) + normal_vector(&mut noise, 0.05),
                ),
                magnetic_field: Some(
                    body(Vector3::new(0.0, 22.0, -42.0)) + normal_vector(&mut noise, 0.5),
                ),
                ..Instant::default()
            });
        }
        phase
    }

    /// Standard errors: 0.005 / sqrt(1000) rad/s; 0.05 / 9.81 / sqrt(1000) rad in tilt; in heading
    /// 0.5 / 22 / sqrt(1000) rad.
    #[test]
    fn the_start_is_the_pose_of_the_rest() {
        let options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        let calibration = phase().finish().unwrap();
        let config = options.calibrated_by(&calibration).config.attitude;
        let driver = calibrated_driver(&options, &calibration);
        let start = state_at_rest(&calibration, &config, &driver);
        assert!(rotation::angle_between(&start.attitude, &truth()) < 4.0 * 0.023 / 1000_f64.sqrt());
        assert!((start.gyroscope_bias - BIAS).norm() < 4.0 * 0.005 * (3.0 / 1000_f64).sqrt());
        let field = start.references.magnetic_field.unwrap();
        assert!(
            (field - Vector3::new(0.0, 22.0, -42.0)).norm() < 0.1,
            "{field}"
        );
        assert!((config.gyroscope_noise_density / 5e-4 - 1.0).abs() < 0.05);
        assert!((config.accelerometer_std / 0.05 - 1.0).abs() < 0.05);
        assert!((config.gyroscope_sample_interval_s - 0.01).abs() < 1e-9);
        // A thousand samples of gravity point to 0.05 / 9.81 / sqrt(1000) rad.
        let up = start.attitude.inverse() * Vector3::z();
        let across = up.cross(&Vector3::x()).normalize();
        let tilt_std = across.dot(&(start.attitude_covariance * across)).sqrt();
        let expected = 0.05 / 9.81 / 1000_f64.sqrt();
        assert!((tilt_std / expected - 1.0).abs() < 0.2, "{tilt_std}");
    }

    #[test]
    fn errors_that_last_make_fewer_independent_samples() {
        assert_relative_eq!(independent_samples(1000, Some(0.01), 0.0), 1000.0);
        assert_relative_eq!(independent_samples(1000, Some(0.01), 0.5), 20.0);
        assert_relative_eq!(independent_samples(1000, None, 0.5), 1000.0);
        assert_relative_eq!(independent_samples(10, Some(0.01), 100.0), 1.0);
    }

    #[test]
    fn a_hand_held_device_and_the_user_keep_their_noise() {
        let calibration = phase().finish().unwrap();
        let hand_held = RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld);
        let config = hand_held.calibrated_by(&calibration).config.attitude;
        let profile = hand_held.config.attitude.accelerometer_std;
        assert_relative_eq!(config.accelerometer_std, profile);
        let mut lab = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        lab.set("accelerometer_std=0.7").unwrap();
        let config = lab.calibrated_by(&calibration).config.attitude;
        assert_relative_eq!(config.accelerometer_std, 0.7);
        assert!(config.magnetometer_std_ut < 0.6);
        // What is less than the filter's own stays: it stands for more than the sensor's.
        let own = lab.config.bounded_velocity;
        let bounded = lab.calibrated_by(&calibration).config.bounded_velocity;
        assert_eq!(bounded, own);
        lab.config.bounded_velocity.magnetometer_std_ut = 0.1;
        let bounded = lab.calibrated_by(&calibration).config.bounded_velocity;
        assert!((bounded.magnetometer_std_ut / 0.5 - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_hand_held_device_has_left_the_field_and_the_bias_of_a_file() {
        let calibration = phase().finish().unwrap();
        let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld);
        let here = calibrated_driver(&options, &calibration).prior;
        assert!(here.field_horizontal_down_ut.is_some());
        assert!(here.gyroscope_bias_std.unwrap() < 1e-3);
        options.calibration = Some(calibration);
        let away = calibrated_driver(&options, &calibration).prior;
        assert_eq!(away.field_horizontal_down_ut, None);
        assert!((away.gyroscope_bias_std.unwrap() / 5.2e-3 - 1.0).abs() < 0.01);
        assert_eq!(away.gyroscope_bias, here.gyroscope_bias);
        options.profile = Profile::Lab;
        assert_eq!(calibrated_driver(&options, &calibration).prior, here);
    }

    #[test]
    fn without_a_magnetometer_the_start_defines_the_heading() {
        let mut phase = phase();
        phase.calibrator.forget_magnetometer();
        let options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        let calibration = phase.finish().unwrap();
        let config = options.calibrated_by(&calibration).config.attitude;
        let start = state_at_rest(
            &calibration,
            &config,
            &calibrated_driver(&options, &calibration),
        );
        let up = truth().inverse() * Vector3::z();
        assert!((start.attitude.inverse() * Vector3::z()).angle(&up) < 1e-3);
        // Known as well as the tilt: the same in every direction, and small.
        let about_up = up.dot(&(start.attitude_covariance * up));
        assert!((about_up - start.attitude_covariance[(0, 0)]).abs() < 1e-12);
        assert!(about_up > 0.0 && about_up.sqrt() < 0.01, "{about_up}");
        assert_eq!(start.references.magnetic_field, None);
    }

    #[test]
    fn too_short_a_rest_is_refused_with_its_length() {
        let phase = CalibrationPhase::new(0.1, SensorSelection::default());
        let error = phase.finish().unwrap_err().to_string();
        assert!(
            error.starts_with("calibration from the first 0.1 s: too short"),
            "{error}"
        );
    }
}
