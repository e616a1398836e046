//! A phone on a table is accepted and measured right; each way of not being at rest is named.

use std::string::ToString;

use approx::assert_relative_eq;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use super::*;

const BIAS: Vector3<f64> = Vector3::new(0.012, -0.007, 0.003);
const FORCE: Vector3<f64> = Vector3::new(0.3, -0.2, 9.79);
const FIELD: Vector3<f64> = Vector3::new(4.0, 21.0, -42.0);

/// A device that would be at rest; tests disturb one thing at a time.
struct World {
    samples: u32,
    dt: f64,
    gyroscope_std: f64,
    accelerometer_std: f64,
    magnetometer_std: f64,
    force: fn(f64) -> Vector3<f64>,
    field: fn(f64) -> Vector3<f64>,
    rate: fn(f64) -> Vector3<f64>,
    seed: u64,
}

impl Default for World {
    fn default() -> Self {
        Self {
            samples: 1000,
            dt: 0.01,
            gyroscope_std: 0.005,
            accelerometer_std: 0.05,
            magnetometer_std: 0.5,
            force: |_| FORCE,
            field: |_| FIELD,
            rate: |_| BIAS,
            seed: 0x0CA1_1B02,
        }
    }
}

impl World {
    fn calibrator(&self) -> RestCalibrator<f64> {
        let mut rng = Pcg64::seed_from_u64(self.seed);
        let mut noise =
            |std: f64| Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)) * std;
        let mut calibrator = RestCalibrator::new();
        for k in 0..self.samples {
            let (t, dt) = (f64::from(k) * self.dt, (k > 0).then_some(self.dt));
            calibrator.add_gyroscope(&((self.rate)(t) + noise(self.gyroscope_std)), dt);
            calibrator.add_accelerometer(&((self.force)(t) + noise(self.accelerometer_std)), dt);
            calibrator.add_magnetometer(&((self.field)(t) + noise(self.magnetometer_std)), dt);
        }
        calibrator
    }

    fn finish(&self) -> Result<RestCalibration<f64>, RestError<f64>> {
        self.calibrator().finish(&RestLimits::default())
    }
}

#[test]
fn a_phone_on_a_table_is_measured_right() {
    let c = World::default().finish().unwrap();
    assert!((c.gyroscope_bias() - BIAS).amax() < 4.0 * c.gyroscope_bias_std());
    assert_relative_eq!(
        c.gyroscope_bias_std(),
        0.005 / 1000_f64.sqrt(),
        max_relative = 0.1
    );
    assert_relative_eq!(
        c.gyroscope_noise_density().unwrap(),
        5e-4,
        max_relative = 0.05
    );
    assert_relative_eq!(c.accelerometer_std().unwrap(), 0.05, max_relative = 0.05);
    assert_relative_eq!(c.magnetometer_std_ut().unwrap(), 0.5, max_relative = 0.05);
    assert_relative_eq!(c.gravity().unwrap(), FORCE.norm(), epsilon = 0.01);
    let up = FORCE.normalize();
    let [horizontal, down] = c.field_horizontal_down().unwrap();
    assert_relative_eq!(down, -FIELD.dot(&up), epsilon = 0.1);
    assert_relative_eq!(horizontal, FIELD.cross(&up).norm(), epsilon = 0.1);
    assert_relative_eq!(c.dip().unwrap(), down.atan2(horizontal));
    assert_eq!(
        [
            c.gyroscope_samples,
            c.accelerometer_samples,
            c.magnetometer_samples
        ],
        [1000; 3]
    );
}

/// The bias is as uncertain as it says: mean of (error / std)^2 over 200 calibrations, 3 axes.
#[test]
fn the_uncertainty_of_the_bias_is_consistent() {
    let mut sum = 0.0;
    for seed in 0..200 {
        let c = World {
            seed,
            samples: 200,
            ..World::default()
        }
        .finish()
        .unwrap();
        let error = c.gyroscope_bias() - BIAS;
        sum += error
            .component_div(&Vector3::from(c.gyroscope_bias_std_rad_s))
            .norm_squared();
    }
    // 600 squares: standard deviation of the mean 0.058.
    assert!((sum / 600.0 - 1.0).abs() < 0.2, "{}", sum / 600.0);
}

/// 300 good calibrations of several lengths: none may be refused by chance.
#[test]
fn a_device_at_rest_is_not_refused() {
    for seed in 0..300 {
        let samples = 50 + 13 * u32::try_from(seed).unwrap();
        let world = World {
            seed: 7000 + seed,
            samples,
            ..World::default()
        };
        assert!(world.finish().is_ok(), "{:?}", world.finish());
    }
}

#[test]
fn accelerometer_and_magnetometer_are_optional() {
    let mut calibrator = World::default().calibrator();
    calibrator.forget_magnetometer();
    let c = calibrator.finish(&RestLimits::default()).unwrap();
    assert!(c.gravity().is_some() && c.dip().is_none() && c.magnetic_field_ut().is_none());
    calibrator.accelerometer = Statistics::new();
    let c = calibrator.finish(&RestLimits::default()).unwrap();
    assert!(c.gravity().is_none() && c.gyroscope_noise_density().is_some());
    assert!(
        RestCalibrator::<f64>::new()
            .finish(&RestLimits::default())
            .is_err()
    );
}

#[test]
fn each_refusal_has_its_reason_and_numbers() {
    type Is = fn(&RestError<f64>) -> bool;
    let rest = World::default;
    let cases: [(World, Is, &str); 11] = [
        (
            World {
                samples: 49,
                ..rest()
            },
            |e| {
                matches!(
                    e,
                    RestError::TooFewSamples {
                        samples: 49,
                        required: 50,
                        ..
                    }
                )
            },
            "too short: 49 gyroscope samples, at least 50 needed",
        ),
        (
            World {
                gyroscope_std: 0.12,
                ..rest()
            },
            |e| matches!(e, RestError::Moved { sensor: Sensor::Gyroscope, std, .. } if *std > 0.1),
            "the device moved: gyroscope std 0.12",
        ),
        (
            World {
                accelerometer_std: 0.5,
                ..rest()
            },
            |e| {
                matches!(
                    e,
                    RestError::Moved {
                        sensor: Sensor::Accelerometer,
                        ..
                    }
                )
            },
            "the device moved: accelerometer std 0.5",
        ),
        (
            World {
                magnetometer_std: 8.0,
                ..rest()
            },
            |e| {
                matches!(
                    e,
                    RestError::Moved {
                        sensor: Sensor::Magnetometer,
                        ..
                    }
                )
            },
            "uT, limit 5.000; put it on a table and try again",
        ),
        (
            World {
                rate: |t| BIAS * (1.0 + 0.2 * t),
                ..rest()
            },
            |e| {
                matches!(
                    e,
                    RestError::Drifted {
                        sensor: Sensor::Gyroscope,
                        ..
                    }
                )
            },
            "gyroscope mean changed by 0.01",
        ),
        (
            World {
                force: |t| Vector3::new(0.03 * t, 0.0, 9.79),
                ..rest()
            },
            |e| {
                matches!(
                    e,
                    RestError::Drifted {
                        sensor: Sensor::Accelerometer,
                        ..
                    }
                )
            },
            "accelerometer mean changed by 0.1",
        ),
        // A slow turn about the vertical, which only the magnetometer sees.
        (
            World {
                field: |t| crate::geometry::so3::exp(&(Vector3::z() * 0.02 * t)) * FIELD,
                ..rest()
            },
            |e| {
                matches!(
                    e,
                    RestError::Drifted {
                        sensor: Sensor::Magnetometer,
                        ..
                    }
                )
            },
            "magnetometer mean changed by 2.",
        ),
        (
            World {
                force: |_| FORCE * 1.06,
                ..rest()
            },
            |e| matches!(e, RestError::NotGravity { measured, .. } if *measured > 10.31),
            "the accelerometer measures 10.39 m/s^2 at rest, expected 9.81 +- 0.50",
        ),
        (
            World {
                field: |_| FIELD * 2.0,
                ..rest()
            },
            |e| matches!(e, RestError::NotTheEarthsField { .. }),
            "the magnetic field is 94.3 uT, expected 20 to 70",
        ),
        (
            World {
                field: |_| FIELD * 0.4,
                ..rest()
            },
            |e| matches!(e, RestError::NotTheEarthsField { .. }),
            "the magnetic field is 18.9 uT",
        ),
        (
            World {
                field: |_| FORCE * -4.5 + Vector3::x() * 2.0,
                ..rest()
            },
            |e| matches!(e, RestError::FieldVertical { angle_deg, .. } if *angle_deg < 5.0),
            "the magnetic field is 2.6 deg from vertical, at least 5.0 needed",
        ),
    ];
    for (world, is, text) in cases {
        let error = world.finish().unwrap_err();
        assert!(is(&error), "{error:?}");
        let line = error.to_string();
        assert!(
            line.contains(text) && !line.contains('\n') && !line.contains("  "),
            "{line}"
        );
    }
}

#[test]
fn limits_outside_their_range_are_refused() {
    let limits = RestLimits {
        gravity_m_s2: -9.81,
        ..RestLimits::default()
    };
    let error = World::default().calibrator().finish(&limits).unwrap_err();
    let message = "limits of the calibration: gravity_m_s2 must be from 0.1 to 100";
    assert_eq!(error.to_string(), message);
}

#[test]
fn a_sensor_that_repeats_itself_is_dead_not_quiet() {
    let mut calibrator = RestCalibrator::<f64>::new();
    for _ in 0..100 {
        assert!(calibrator.add_gyroscope(&Vector3::new(0.01, 0.0, 0.0), None));
    }
    let error = calibrator.finish(&RestLimits::default()).unwrap_err();
    assert_eq!(
        error,
        RestError::Constant {
            sensor: Sensor::Gyroscope,
            samples: 100
        }
    );
    assert!(error.to_string().contains("repeated one value 100 times"));
}

#[test]
fn unknown_intervals_give_no_density() {
    let mut calibrator = RestCalibrator::<f32>::new();
    for k in 0..100_u8 {
        let noise = f32::from(k % 5) * 1e-3;
        assert!(calibrator.add_gyroscope(&Vector3::repeat(noise), None));
    }
    let c = calibrator.finish(&RestLimits::default()).unwrap();
    assert!(c.gyroscope_noise_density().is_none() && c.gyroscope_interval_s.is_none());
    assert!((c.gyroscope_bias().x - 2e-3).abs() < 1e-6);
}

#[test]
fn a_bad_sample_is_reported_and_ignored() {
    let mut calibrator = World::default().calibrator();
    let before = calibrator;
    let bad = Vector3::new(0.0, f64::NAN, 0.0);
    assert!(!calibrator.add_gyroscope(&bad, Some(0.01)));
    assert!(!calibrator.add_accelerometer(&bad, None));
    assert!(!calibrator.add_magnetometer(&(bad * f64::INFINITY), None));
    assert_eq!(calibrator, before);
}

#[cfg(feature = "serde")]
#[test]
fn a_calibration_survives_its_file() {
    let c = World::default().finish().unwrap();
    let json = serde_json::to_string(&c).unwrap();
    assert!(
        json.contains("\"gyroscope_bias_rad_s\":[") && json.contains("\"magnetic_field_ut\":[")
    );
    let back: RestCalibration<f64> = serde_json::from_str(&json).unwrap();
    assert_relative_eq!(
        back.gyroscope_bias(),
        c.gyroscope_bias(),
        max_relative = 1e-14
    );
    assert_relative_eq!(
        back.gyroscope_covariance(),
        c.gyroscope_covariance(),
        max_relative = 1e-14
    );
    assert_relative_eq!(back.dip().unwrap(), c.dip().unwrap(), max_relative = 1e-14);
    assert_eq!(back.magnetometer_samples, 1000);
    calibration_without_magnetometer_has_no_such_keys();
    let limits: RestLimits<f64> = serde_json::from_str("{\"gyroscope_std_rad_s\":0.1}").unwrap();
    assert_relative_eq!(limits.gyroscope_std_rad_s, 0.1);
    assert_relative_eq!(limits.accelerometer_std_m_s2, 0.3);
}

#[cfg(feature = "serde")]
fn calibration_without_magnetometer_has_no_such_keys() {
    let mut calibrator = World::default().calibrator();
    calibrator.forget_magnetometer();
    let c = calibrator.finish(&RestLimits::default()).unwrap();
    let json = serde_json::to_string(&c).unwrap();
    assert!(!json.contains("null") && !json.contains("magnetic_field_ut"));
    let back: RestCalibration<f64> = serde_json::from_str(&json).unwrap();
    assert_eq!(back.magnetic_field_ut, None);
}
