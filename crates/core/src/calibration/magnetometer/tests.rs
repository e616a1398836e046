//! Tests of the magnetometer calibration: closed forms, noise, partial views, refusals.

use super::*;
use approx::assert_relative_eq;
use nalgebra::Matrix3;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use std::string::ToString;
use std::vec::Vec;

const HARD_IRON: Vector3<f64> = Vector3::new(-31.0, 12.0, 55.0);

/// A symmetric distortion of about ten percent.
fn distortion() -> Matrix3<f64> {
    Matrix3::new(1.08, 0.04, -0.02, 0.04, 0.95, 0.03, -0.02, 0.03, 1.01)
}

/// A field of 48 microtesla from `count` directions spread evenly over the part of the sphere
/// that lies above `from` (-1: all of it).
struct World {
    count: u32,
    from: f64,
    hard_iron: Vector3<f64>,
    distortion: Matrix3<f64>,
    noise_ut: f64,
    seed: u64,
}

impl Default for World {
    fn default() -> Self {
        Self {
            count: 1000,
            from: -1.0,
            hard_iron: HARD_IRON,
            distortion: distortion(),
            noise_ut: 0.0,
            seed: 0x0CA1_3A60,
        }
    }
}

impl World {
    fn samples(&self) -> Vec<Vector3<f64>> {
        let mut rng = Pcg64::seed_from_u64(self.seed);
        let n = f64::from(self.count);
        (0..self.count)
            .map(|k| {
                let z = self.from + (1.0 - self.from) * (f64::from(k) + 0.5) / n;
                let (sin, cos) = (2.399_963 * f64::from(k)).sin_cos();
                let across = (1.0 - z * z).sqrt();
                let field = Vector3::new(across * cos, z, across * sin) * 48.0;
                let noise = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
                self.distortion * field + self.hard_iron + noise * self.noise_ut
            })
            .collect()
    }

    fn finish(&self) -> Result<MagnetometerCalibration<f64>, MagnetometerError<f64>> {
        gathered(&self.samples()).finish(&MagnetometerLimits::default())
    }
}

fn gathered<T: Scalar>(samples: &[Vector3<T>]) -> MagnetometerCalibrator<T> {
    let mut calibrator = MagnetometerCalibrator::new();
    for sample in samples {
        assert!(calibrator.add(sample));
    }
    calibrator
}

/// Largest deviation of the calibrated lengths from the field's strength.
fn worst_residual(c: &MagnetometerCalibration<f64>, samples: &[Vector3<f64>]) -> f64 {
    samples
        .iter()
        .map(|s| c.residual(s).abs())
        .fold(0.0, f64::max)
}

#[test]
fn an_exact_ellipsoid_is_recovered() {
    for hard_iron in [
        Vector3::zeros(),
        HARD_IRON,
        Vector3::new(300.0, -450.0, 120.0),
    ] {
        let world = World {
            hard_iron,
            ..World::default()
        };
        let c = world.finish().unwrap();
        assert_eq!(c.model, MagnetometerModel::Ellipsoid);
        assert!(
            (c.hard_iron() - hard_iron).amax() < 1e-9,
            "{}",
            c.hard_iron() - hard_iron
        );
        // What takes the distortion away is its inverse, scaled to the mean radius.
        let scale = distortion().determinant().cbrt();
        assert_relative_eq!(
            c.soft_iron() / scale,
            distortion().try_inverse().unwrap(),
            epsilon = 1e-9
        );
        assert_relative_eq!(c.soft_iron().determinant(), 1.0, epsilon = 1e-9);
        assert_relative_eq!(c.radius_ut, 48.0 * scale, epsilon = 1e-9);
        assert!(worst_residual(&c, &world.samples()) < 1e-8 && c.residual_std_ut < 1e-5);
        assert!(c.coverage > 0.95, "{}", c.coverage);
    }
}

#[test]
fn single_precision_bears_hundreds_of_microtesla() {
    for (count, hard_iron) in [
        (400, HARD_IRON),
        (400, Vector3::new(300.0, -450.0, 120.0)),
        (50_000, Vector3::new(300.0, -450.0, 120.0)),
    ] {
        let world = World {
            count,
            hard_iron,
            ..World::default()
        };
        let samples: Vec<_> = world
            .samples()
            .iter()
            .map(|s| s.map(|x| x as f32))
            .collect();
        let c = gathered(&samples)
            .finish(&MagnetometerLimits::default())
            .unwrap();
        let error = c.hard_iron().cast::<f64>() - hard_iron;
        assert!(error.amax() < 1e-3, "{count} samples: {error}");
        let scale = distortion().determinant().cbrt();
        let expected = distortion().try_inverse().unwrap() * scale;
        assert_relative_eq!(c.soft_iron().cast::<f64>(), expected, epsilon = 1e-4);
    }
}

#[test]
fn a_known_field_strength_sets_the_scale() {
    let limits = MagnetometerLimits {
        field_strength_ut: Some(48.0),
        ..MagnetometerLimits::default()
    };
    let samples = World::default().samples();
    let c = gathered(&samples).finish(&limits).unwrap();
    assert_relative_eq!(
        c.soft_iron(),
        distortion().try_inverse().unwrap(),
        epsilon = 1e-9
    );
    let world_field = distortion().try_inverse().unwrap() * (samples[17] - HARD_IRON);
    assert_relative_eq!(c.apply(&samples[17]), world_field, epsilon = 1e-8);
    for wrong in [0.0, -48.0, f64::NAN, f64::INFINITY] {
        let limits = MagnetometerLimits {
            field_strength_ut: Some(wrong),
            ..limits
        };
        let error = gathered(&samples).finish(&limits).unwrap_err();
        assert!(matches!(error, MagnetometerError::Limits(e) if e.field == "field_strength_ut"));
    }
}

/// A full view by hand: the design matrix has eigenvalues 4/3 (centre), 1/3, 4/15 and 2/15 (shape);
/// the variance of the centre is 3 sigma^2 / n.
#[test]
fn a_full_view_has_the_precision_of_the_closed_form() {
    let world = World {
        count: 20_000,
        distortion: Matrix3::identity(),
        noise_ut: 0.5,
        ..World::default()
    };
    let c = world.finish().unwrap();
    assert_relative_eq!(c.condition_number, 10_f64.sqrt(), max_relative = 0.02);
    assert_relative_eq!(c.residual_std_ut, 0.5, max_relative = 0.02);
    for std in c.hard_iron_std_ut {
        assert_relative_eq!(std, 0.5 * (3.0 / 20_000_f64).sqrt(), max_relative = 0.02);
    }
}

/// Mean of (error / std)^2 over 200 calibrations and three axes, where all and where a good half
/// of the sphere is seen.
#[test]
fn the_uncertainty_of_the_hard_iron_is_consistent() {
    for from in [-1.0, -0.2] {
        let mut sum = 0.0;
        for seed in 0..200 {
            let world = World {
                count: 300,
                from,
                noise_ut: 0.7,
                seed,
                ..World::default()
            };
            let c = world.finish().unwrap();
            assert_eq!(c.model, MagnetometerModel::Ellipsoid);
            let error = c.hard_iron() - HARD_IRON;
            sum += error
                .component_div(&Vector3::from(c.hard_iron_std_ut))
                .norm_squared();
        }
        // 600 squares: standard deviation of the mean 0.058; the distortion of ten percent is not
        // in the prediction.
        assert!(
            (sum / 600.0 - 1.0).abs() < 0.25,
            "from {from}: {}",
            sum / 600.0
        );
    }
}

#[test]
fn a_third_of_the_sphere_gives_a_sphere_and_less_is_refused() {
    let world = |from| World {
        from,
        distortion: Matrix3::identity(),
        noise_ut: 0.2,
        ..World::default()
    };
    let c = world(0.35).finish().unwrap();
    assert_eq!(c.model, MagnetometerModel::Sphere);
    assert!((c.hard_iron() - HARD_IRON).amax() < 5.0 * Vector3::from(c.hard_iron_std_ut).max());
    assert_relative_eq!(c.soft_iron(), Matrix3::identity(), epsilon = 1e-9);
    assert!(c.coverage > 0.35 && c.coverage < 0.5, "{}", c.coverage);
    let error = world(0.7).finish().unwrap_err();
    assert!(
        matches!(error, MagnetometerError::NotEnoughCoverage { .. }),
        "{error:?}"
    );
    let text = error.to_string();
    assert!(
        text.starts_with("turn the device through more directions: only "),
        "{text}"
    );
}

/// A sphere fitted to a part of an ellipsoid is wrong by what it cannot see, and says so: mean of
/// (error / std)^2 over 200 soft irons of three percent.
#[test]
fn a_sphere_counts_the_soft_iron_that_it_cannot_see() {
    let mut sum = 0.0;
    for seed in 0..200 {
        let mut rng = Pcg64::seed_from_u64(5000 + seed);
        let mut entry = || 0.03 * rng.sample::<f64, _>(StandardNormal);
        let (d, o) = ([entry(), entry(), entry()], [entry(), entry(), entry()]);
        let shape = Matrix3::new(d[0], o[0], o[1], o[0], d[1], o[2], o[1], o[2], d[2]);
        let world = World {
            count: 300,
            from: 0.4,
            distortion: Matrix3::identity() + shape,
            noise_ut: 0.3,
            seed,
            ..World::default()
        };
        let limits = MagnetometerLimits {
            ellipsoid_coverage: 1.1,
            sphere_coverage: 0.2,
            ..MagnetometerLimits::default()
        };
        let c = gathered(&world.samples()).finish(&limits).unwrap();
        assert_eq!(c.model, MagnetometerModel::Sphere);
        let error = c.hard_iron() - HARD_IRON;
        sum += error
            .component_div(&Vector3::from(c.hard_iron_std_ut))
            .norm_squared();
    }
    assert!((sum / 600.0 - 1.0).abs() < 0.3, "{}", sum / 600.0);
}

#[test]
fn a_turn_about_one_axis_is_refused() {
    for noise_ut in [0.0, 0.5] {
        for axis in [Vector3::z(), Vector3::new(0.3, -0.5, 0.8)] {
            let mut rng = Pcg64::seed_from_u64(7);
            let axis = nalgebra::Unit::new_normalize(axis);
            let start = axis.cross(&Vector3::x()).normalize() * 22.0 + axis.into_inner() * 40.0;
            let mut calibrator = MagnetometerCalibrator::<f64>::new();
            for k in 0..2000 {
                let turn = nalgebra::Rotation3::from_axis_angle(&axis, f64::from(k) * 0.01);
                let noise = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
                calibrator.add(&(turn * start + HARD_IRON + noise * noise_ut));
            }
            let error = calibrator
                .finish(&MagnetometerLimits::default())
                .unwrap_err();
            let text = error.to_string();
            assert!(
                text.contains("turn the") && text.contains("device"),
                "{text}"
            );
        }
    }
}

#[test]
fn useless_samples_are_ignored_and_counted() {
    let mut calibrator = gathered(&World::default().samples());
    let before = calibrator.finish(&MagnetometerLimits::default()).unwrap();
    for bad in [f64::NAN, f64::INFINITY, 0.0, 1e30, 2e4] {
        assert!(!calibrator.add(&Vector3::repeat(bad)));
    }
    let last = *World::default().samples().last().unwrap();
    assert!(!calibrator.add(&last), "a repetition says nothing new");
    let after = calibrator.finish(&MagnetometerLimits::default()).unwrap();
    assert_eq!((before.ignored_samples, after.ignored_samples), (0, 6));
    assert_relative_eq!(after.hard_iron(), before.hard_iron());
}

#[test]
fn what_is_no_calibration_is_refused_with_what_to_do() {
    let limits = MagnetometerLimits::default();
    let empty = MagnetometerCalibrator::<f64>::new()
        .finish(&limits)
        .unwrap_err();
    assert!(matches!(
        empty,
        MagnetometerError::TooFewSamples { samples: 0, .. }
    ));
    assert!(empty.to_string().ends_with("for 20 seconds or more"));
    let mut constant = MagnetometerCalibrator::<f64>::new();
    for k in 0..500 {
        assert_eq!(constant.add(&HARD_IRON), k == 0);
    }
    let error = constant.finish(&limits).unwrap_err();
    assert_eq!(error, MagnetometerError::Constant { samples: 500 });
    let at_rest = World {
        distortion: Matrix3::zeros(),
        noise_ut: 0.3,
        ..World::default()
    };
    let error = at_rest.finish().unwrap_err();
    assert!(
        matches!(error, MagnetometerError::NotTheEarthsField { .. }),
        "{error:?}"
    );
    let gauss = World {
        distortion: Matrix3::identity() * 0.01,
        hard_iron: Vector3::zeros(),
        ..World::default()
    };
    assert!(
        gauss
            .finish()
            .unwrap_err()
            .to_string()
            .contains("check the unit (uT)")
    );
    let noisy = World {
        noise_ut: 6.0,
        ..World::default()
    };
    let text = noisy.finish().unwrap_err().to_string();
    assert!(text.contains("a magnet or a moving car nearby"), "{text}");
}

/// Samples inside a ball: no surface at all.
#[test]
fn a_cloud_without_a_surface_is_refused() {
    let mut rng = Pcg64::seed_from_u64(11);
    let mut calibrator = MagnetometerCalibrator::<f64>::new();
    for _ in 0..3000 {
        let direction = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        calibrator.add(&(direction.normalize() * rng.random_range(10.0..70.0)));
    }
    let error = calibrator
        .finish(&MagnetometerLimits::default())
        .unwrap_err();
    let refused = matches!(
        error,
        MagnetometerError::ResidualTooLarge { .. } | MagnetometerError::NotAnEllipsoid { .. }
    );
    assert!(refused, "{error:?}");
}

#[test]
fn a_passing_magnet_is_rejected_by_the_later_passes() {
    let mut samples = World {
        noise_ut: 0.4,
        ..World::default()
    }
    .samples();
    for sample in samples.iter_mut().skip(300).take(40) {
        *sample += Vector3::new(12.0, -9.0, 4.0);
    }
    let limits = MagnetometerLimits::default();
    let streamed = gathered(&samples).finish(&limits).unwrap();
    let rejecting = calibrate(&samples.iter().copied(), &limits).unwrap();
    let error = |c: &MagnetometerCalibration<f64>| (c.hard_iron() - HARD_IRON).norm();
    assert!(
        rejecting.rejected_samples >= 30,
        "{}",
        rejecting.rejected_samples
    );
    assert!(error(&rejecting) < 0.15 && error(&rejecting) < 0.3 * error(&streamed));
    assert!(rejecting.residual_std_ut < 0.5 && streamed.residual_std_ut > 0.8);
}

#[test]
fn the_live_picture_follows_the_centre() {
    let samples = World {
        hard_iron: Vector3::new(250.0, 40.0, -130.0),
        ..World::default()
    }
    .samples();
    let mut calibrator = MagnetometerCalibrator::<f64>::new();
    assert_eq!(calibrator.coverage().covered(), 0);
    let mut halfway = 0;
    for (k, sample) in samples.iter().enumerate() {
        calibrator.add(sample);
        if k == 500 {
            halfway = calibrator.coverage().covered();
        }
    }
    // The spiral goes from one end of the sphere to the other.
    assert!((30..=48).contains(&halfway), "{halfway}");
    assert!(calibrator.coverage().covered() >= 70);
    let (centre, radius) = calibrator.sphere_ut().unwrap();
    assert!((centre - Vector3::new(250.0, 40.0, -130.0)).norm() < 3.0);
    assert!((radius - 48.0).abs() < 3.0);
}

#[test]
fn bad_numbers_of_a_file_are_named() {
    let good = World::default().finish().unwrap();
    assert_eq!(good.validate(), Ok(()));
    let mut bad = good;
    bad.hard_iron_ut[1] = f64::NAN;
    assert_eq!(bad.validate().unwrap_err().field, "hard_iron_ut");
    for soft_iron in [
        [[0.0; 3]; 3],
        [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]],
    ] {
        let bad = MagnetometerCalibration { soft_iron, ..good };
        assert_eq!(bad.validate().unwrap_err().field, "soft_iron");
    }
    bad = good;
    bad.field_strength_ut = 0.0;
    assert_eq!(bad.validate().unwrap_err().field, "field_strength_ut");
}

#[test]
#[cfg(feature = "serde")]
fn a_calibration_survives_serialisation() {
    let calibration = World::default().finish().unwrap();
    let json = serde_json::to_string(&calibration).unwrap();
    assert!(
        json.starts_with("{\"model\":\"ellipsoid\",\"samples\":1000,"),
        "{json}"
    );
    let back: MagnetometerCalibration<f64> = serde_json::from_str(&json).unwrap();
    assert_relative_eq!(back.hard_iron(), calibration.hard_iron(), epsilon = 1e-12);
    assert_relative_eq!(back.soft_iron(), calibration.soft_iron(), epsilon = 1e-12);
    let limits: MagnetometerLimits<f64> =
        serde_json::from_str("{\"field_strength_ut\":48.5}").unwrap();
    assert_eq!(limits.field_strength_ut, Some(48.5));
    assert_eq!(limits.minimum_samples, 100);
}

/// The table of `docs/derivations/magnetometer_calibration.md`: 1000 samples, noise 0.7
/// microtesla, the sphere seen above a height. Worst axis of the hard iron: what an ellipsoid and
/// a sphere state, and by how much each is wrong where soft iron reaches ten percent.
#[test]
fn a_smaller_view_costs_what_the_table_says() {
    let any = MagnetometerLimits {
        sphere_coverage: 0.0,
        condition_number: 1e9,
        residual_std_ut: 50.0,
        ..MagnetometerLimits::default()
    };
    let world = |from, distortion| World {
        from,
        distortion,
        noise_ut: 0.7,
        ..World::default()
    };
    for (from, condition, stated, wrong) in [
        (-1.0, [3.2, 1.2], [0.04, 0.04], [0.05, 0.04]),
        (-0.5, [7.0, 1.7], [0.08, 0.89], [0.05, 2.6]),
        (0.0, [22.0, 3.8], [0.30, 1.8], [0.11, 5.2]),
        (0.35, [76.0, 7.8], [0.88, 2.4], [0.24, 7.2]),
    ] {
        for (k, ellipsoid_coverage) in [0.0, 2.0].into_iter().enumerate() {
            let limits = MagnetometerLimits {
                ellipsoid_coverage,
                ..any
            };
            let round = world(from, Matrix3::identity()).samples();
            let c = gathered(&round).finish(&limits).unwrap();
            let std = Vector3::from(c.hard_iron_std_ut).max();
            let bent = world(from, distortion()).samples();
            let bent = gathered(&bent).finish(&limits).unwrap();
            let error = (bent.hard_iron() - HARD_IRON).amax();
            assert_relative_eq!(c.condition_number, condition[k], max_relative = 0.05);
            assert_relative_eq!(std, stated[k], max_relative = 0.1);
            assert_relative_eq!(error, wrong[k], max_relative = 0.1);
        }
    }
}

proptest::proptest! {
#![proptest_config(proptest::prelude::ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(28), ..proptest::prelude::ProptestConfig::default() })]
    /// Whatever comes in, an answer comes out, and one that is given is usable: few points, points
    /// on lines and planes, tiny and huge ones.
    #[test]
    fn no_samples_make_it_panic(
        points in proptest::collection::vec(proptest::array::uniform3(-1.0_f32..1.0), 0..60),
        scale in -30.0_f32..5.0,
        flatten in proptest::array::uniform3(0_u8..2),
        centre in -2000.0_f32..2000.0,
    ) {
        let mut calibrator = MagnetometerCalibrator::<f32>::new();
        let squeeze = Vector3::from(flatten).map(f32::from) * 10_f32.powf(scale);
        for point in points.iter().cycle().take(points.len() * 3) {
            calibrator.add(&(Vector3::from(*point).component_mul(&squeeze).add_scalar(centre)));
        }
        let limits = MagnetometerLimits {
            minimum_samples: 10,
            ellipsoid_coverage: 0.0,
            sphere_coverage: 0.0,
            condition_number: f32::MAX,
            axis_ratio: f32::MAX,
            residual_std_ut: f32::MAX,
            field_minimum_ut: 0.0,
            field_maximum_ut: f32::MAX,
            ..MagnetometerLimits::default()
        };
        if let Ok(c) = calibrator.finish(&limits) {
            proptest::prop_assert!(c.hard_iron().iter().all(|x| x.is_finite()));
            proptest::prop_assert!(c.soft_iron().iter().all(|x| x.is_finite()));
        }
        let _ = (calibrator.coverage().share(), calibrator.sphere_ut());
    }
}
