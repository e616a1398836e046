//! Sensors that round: quiet is not dead, and no number of samples averages rounding away.

use std::string::ToString;

use approx::assert_relative_eq;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use super::*;

/// 0.1 deg/s, what browsers leave of an angular rate.
const STEP: f64 = 0.1 / 180.0 * core::f64::consts::PI;

/// A gyroscope at rest with this noise before rounding; its bias lies anywhere between two steps.
fn rounded_gyroscope(
    rng: &mut Pcg64,
    std: f64,
    samples: u32,
) -> (Vector3<f64>, RestCalibration<f64>) {
    let bias = Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0) * STEP);
    let mut calibrator = RestCalibrator::new();
    calibrator.know_resolution(Sensor::Gyroscope, STEP);
    for _ in 0..samples {
        let noise = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)) * std;
        let rounded = (bias + noise).map(|x| (x / STEP).round() * STEP);
        calibrator.add_gyroscope(&rounded, Some(0.016));
    }
    (bias, calibrator.finish(&RestLimits::default()).unwrap())
}

/// Noise of 0 to 2 steps: the error of the bias is as large as stated, or smaller, never larger.
#[test]
fn the_stated_std_of_the_bias_covers_its_error_whatever_the_noise() {
    let mut rng = Pcg64::seed_from_u64(0x0CA1_1B05);
    let ratios = [
        0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.6, 0.8, 1.0, 1.5, 2.0,
    ];
    for samples in [50, 600] {
        for ratio in ratios {
            let (mut squares, mut within, mut count) = (0.0, 0_u32, 0_u32);
            for _ in 0..120 {
                let (bias, c) = rounded_gyroscope(&mut rng, ratio * STEP, samples);
                let error = c.gyroscope_bias() - bias;
                for z in error
                    .component_div(&Vector3::from(c.gyroscope_bias_std_rad_s))
                    .iter()
                {
                    squares += z * z;
                    within += u32::from(z.abs() < 2.0);
                    count += 1;
                }
            }
            let (mean_square, share) = (
                squares / f64::from(count),
                f64::from(within) / f64::from(count),
            );
            // 360 squares of unit normals: mean 1 +- 0.075; 95.4 % are within two +- 1.1 %.
            let at = std::format!("noise {ratio} steps, {samples} samples: {mean_square}, {share}");
            assert!(mean_square < 1.3 && share > 0.915, "{at}");
            // Nor is it called unknown where noise shakes the rounding loose.
            assert!(ratio < 0.5 || mean_square > 0.7, "{at}");
        }
    }
}

/// The variance of one sample about the truth, as a filter needs it (decision 0005).
#[test]
fn the_variance_of_a_sample_is_that_about_the_truth() {
    let mut rng = Pcg64::seed_from_u64(0x0CA1_1B06);
    for ratio in [0.0, 0.3, 0.5, 1.0] {
        let (mut stated, mut count) = (0.0, 0.0);
        for _ in 0..100 {
            let (_, c) = rounded_gyroscope(&mut rng, ratio * STEP, 200);
            stated += c.gyroscope_covariance().trace() / (STEP * STEP);
            count += 3.0;
        }
        // Rounding is independent of the truth, which is uniform: noise^2 + 1/12.
        let truth = ratio * ratio + 1.0 / 12.0;
        assert!(
            (stated / count / truth - 1.0).abs() < 0.1,
            "{ratio}: {}",
            stated / count
        );
    }
}

#[test]
fn a_phone_whose_browser_rounds_may_repeat_one_value() {
    let force = Vector3::new(0.0, 0.1, 9.8);
    let add = |calibrator: &mut RestCalibrator<f64>, force: Vector3<f64>| {
        for _ in 0..600 {
            calibrator.add_gyroscope(&Vector3::zeros(), Some(0.016));
            calibrator.add_accelerometer(&force, Some(0.016));
        }
    };
    let mut unknown = RestCalibrator::new();
    add(&mut unknown, force);
    let error = unknown.finish(&RestLimits::default()).unwrap_err();
    assert!(error.to_string().contains("repeated one value 600 times"));

    let mut known = RestCalibrator::new();
    known.know_resolution(Sensor::Gyroscope, STEP);
    known.know_resolution(Sensor::Accelerometer, 0.1);
    let mut dead = known;
    add(&mut known, force);
    assert!(known.is_constant(Sensor::Gyroscope) && !known.is_constant(Sensor::Magnetometer));
    let c = known.finish(&RestLimits::default()).unwrap();
    let rounding = STEP / 12_f64.sqrt();
    assert_relative_eq!(c.gyroscope_bias_std(), rounding, max_relative = 1e-9);
    assert_relative_eq!(c.gyroscope_std_rad_s[1], rounding, max_relative = 1e-9);
    assert_relative_eq!(
        c.specific_force_rounding_std(),
        0.1 / 12_f64.sqrt(),
        max_relative = 1e-9
    );
    assert_relative_eq!(
        c.accelerometer_std().unwrap(),
        0.1 / 12_f64.sqrt(),
        max_relative = 1e-9
    );

    // Gravity is never rounded to zero.
    add(&mut dead, Vector3::zeros());
    assert_eq!(
        dead.finish(&RestLimits::default()).unwrap_err(),
        RestError::Constant {
            sensor: Sensor::Accelerometer,
            samples: 600
        }
    );
}

#[test]
fn finer_samples_refute_a_step_that_was_only_supposed() {
    let mut rng = Pcg64::seed_from_u64(0x0CA1_1B07);
    let mut plain = RestCalibrator::new();
    let mut told = RestCalibrator::new();
    told.know_resolution(Sensor::Gyroscope, STEP);
    told.know_resolution(Sensor::Accelerometer, f64::NAN);
    for _ in 0..200 {
        let rate = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal)) * 1e-4;
        plain.add_gyroscope(&rate, None);
        told.add_gyroscope(&rate, None);
    }
    let limits = RestLimits::default();
    assert_eq!(
        told.finish(&limits).unwrap(),
        plain.finish(&limits).unwrap()
    );
    assert!(told.finish(&limits).unwrap().gyroscope_bias_std() < 1e-5);
}
