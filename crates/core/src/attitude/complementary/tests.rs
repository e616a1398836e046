use super::super::test_world::{BIAS, compass, drive, references, start, step_all};
use super::*;
use approx::assert_relative_eq;
use nalgebra::Matrix3 as M3;
use proptest::prelude::*;

const FORMS: [ComplementaryForm; 3] = [
    ComplementaryForm::Explicit,
    ComplementaryForm::Passive,
    ComplementaryForm::Direct,
];

/// Gains that follow within seconds.
fn settings<T: Scalar>() -> AttitudeConfig<T> {
    AttitudeConfig::lab()
}

fn started(form: ComplementaryForm, attitude: UnitQuaternion<f64>) -> Complementary<f64> {
    let mut filter = Complementary::new(form, settings()).unwrap();
    filter.initialize(&start(&settings(), attitude));
    filter
}

fn degrees(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    rotation::angle_between(a, b).to_degrees()
}

/// A device at rest at the identity: one step of 10 ms with both vectors.
fn rest_step(filter: &mut Complementary<f64>, rate: &Vector3<f64>, with_field: bool) {
    let world = references::<f64>();
    filter.propagate(rate, 0.01);
    if with_field {
        filter.update_magnetometer(&world.magnetic_field.unwrap());
    }
    filter.update_accelerometer(&world.specific_force);
}

#[test]
fn attitude_and_bias_are_found_from_half_a_radian_off() {
    for form in FORMS {
        let mut filter = started(form, so3::exp(&Vector3::new(0.5, -0.5, 0.5)));
        let (mut sum, mut count) = (0.0, 0.0);
        drive(60, 5, |truth, samples| {
            step_all(&mut filter, &samples);
            count += 1.0;
            if count > 4000.0 {
                sum += degrees(truth, &filter.attitude()).powi(2);
            }
        });
        let rms = (sum / (count - 4000.0)).sqrt();
        assert!(rms < 0.5, "{form:?}: {rms} deg");
        let bias_error = (filter.rate_at_rest() - BIAS).norm();
        assert!(bias_error < 2e-3, "{form:?}: {bias_error} rad/s");
    }
}

/// Per axis `s^2 + k_P s + k_I`: a small error decays as the closed form says, in all forms.
#[test]
fn small_errors_decay_as_the_second_order_system_says() {
    let (k_p, k_i) = (1.0_f64, 0.3_f64);
    let damping = k_p / 2.0;
    let frequency = (k_i - damping * damping).sqrt();
    let expected = |t: f64| {
        (-damping * t).exp() * ((frequency * t).cos() - damping / frequency * (frequency * t).sin())
    };
    for form in [ComplementaryForm::Passive, ComplementaryForm::Direct] {
        let off = 1e-3;
        let mut filter = started(form, so3::exp(&Vector3::new(0.0, 0.0, off)));
        for k in 1..=1000 {
            rest_step(&mut filter, &Vector3::zeros(), true);
            let yaw = filter.attitude().scaled_axis().z;
            let t = f64::from(k) * 0.01;
            assert!(
                (yaw / off - expected(t)).abs() < 0.01,
                "{form:?} at {t} s: {} and {}",
                yaw / off,
                expected(t)
            );
        }
    }
}

/// Root mean square errors, deg, of the last 40 of 60 s.
fn rms_error(form: ComplementaryForm) -> f64 {
    let mut filter = started(form, UnitQuaternion::identity());
    let (mut sum, mut count) = (0.0, 0.0);
    drive(60, 9, |truth, samples| {
        step_all(&mut filter, &samples);
        count += 1.0;
        if count > 2000.0 {
            sum += degrees(truth, &filter.attitude()).powi(2);
        }
    });
    (sum / (count - 2000.0)).sqrt()
}

/// What the paper criticises: the noise of the reconstruction enters the rate as well. It is little.
#[test]
fn the_direct_form_is_a_little_noisier_than_the_passive_one() {
    let (passive, direct) = (
        rms_error(ComplementaryForm::Passive),
        rms_error(ComplementaryForm::Direct),
    );
    assert!(
        passive < direct && direct < passive + 0.03,
        "{passive} and {direct} deg"
    );
}

/// With the sign that the paper on the cascade prints, the observer runs to the opposite.
#[test]
fn the_printed_sign_runs_away_to_half_a_turn() {
    let mut filter = started(
        ComplementaryForm::Passive,
        so3::exp(&Vector3::new(0.01, 0.0, 0.0)),
    );
    (filter.attitude_gain, filter.bias_gain) = (-1.0, 0.0);
    for _ in 0..3000 {
        rest_step(&mut filter, &Vector3::zeros(), true);
    }
    let error = degrees(&filter.attitude(), &UnitQuaternion::identity());
    assert!(error > 170.0, "{error} deg");
}

#[test]
fn without_a_field_heading_and_the_bias_about_up_stay() {
    for form in FORMS {
        let mut filter = started(form, so3::exp(&Vector3::new(0.0, 0.0, 0.7)));
        let rate = Vector3::new(0.01, -0.02, 0.0);
        // Ten minutes at rest; the bias about up is not in the rate, so that nothing turns.
        for _ in 0..60_000 {
            rest_step(&mut filter, &rate, false);
        }
        let bias = filter.rate_at_rest();
        assert!(bias.z.abs() < 1e-12, "{form:?}: {bias}");
        assert!((bias.xy() - rate.xy()).norm() < 1e-6, "{form:?}: {bias}");
        let up = filter.attitude().inverse() * Vector3::z();
        assert!((up - Vector3::z()).norm() < 1e-6, "{form:?}: {up}");
    }
}

#[test]
fn half_a_turn_off_is_left_and_found_back() {
    for form in FORMS {
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let mut filter = started(form, so3::exp(&(axis * std::f64::consts::PI)));
            let mut error = 180.0;
            drive(120, 3, |truth, samples| {
                step_all(&mut filter, &samples);
                error = degrees(truth, &filter.attitude());
            });
            assert!(error < 2.0, "{form:?} about {axis}: {error} deg");
        }
    }
}

#[test]
fn a_wrong_field_tips_the_explicit_form_unless_only_its_heading_counts() {
    let tilt_with = |magnetometer_use| {
        let config = AttitudeConfig {
            magnetometer_use,
            ..settings()
        };
        let mut filter = Complementary::new(ComplementaryForm::Explicit, config).unwrap();
        filter.initialize(&start(&config, UnitQuaternion::identity()));
        let world = references::<f64>();
        // The same strength, another dip.
        let wrong = so3::exp(&Vector3::new(0.3, 0.0, 0.0)) * world.magnetic_field.unwrap();
        for _ in 0..3000 {
            filter.propagate(&Vector3::zeros(), 0.01);
            filter.update_magnetometer(&wrong);
            filter.update_accelerometer(&world.specific_force);
        }
        let up = filter.attitude().inverse() * Vector3::z();
        up.z.acos().to_degrees()
    };
    assert!(tilt_with(MagnetometerUse::Vector) > 1.0);
    assert!(tilt_with(MagnetometerUse::Heading) < 1e-6);
}

#[test]
fn the_devices_compass_turns_the_heading() {
    let mut world = references::<f64>();
    world.magnetic_field = None;
    let mut filter = Complementary::new(ComplementaryForm::Explicit, settings()).unwrap();
    let mut from = start(&settings(), so3::exp(&Vector3::new(0.0, 0.0, 0.5)));
    from.references = world;
    filter.initialize(&from);
    for _ in 0..3000 {
        filter.propagate(&Vector3::zeros(), 0.01);
        filter.update_accelerometer(&world.specific_force);
        assert!(filter.update_compass(&compass(0.0, 0.1)).outcome.is_fused());
    }
    assert!(filter.attitude().angle() < 1e-3, "{}", filter.attitude());
    assert!(
        started(ComplementaryForm::Explicit, UnitQuaternion::identity())
            .update_compass(&compass(0.0, 0.1))
            .outcome
            == Outcome::Skipped(SkipReason::NotUsed)
    );
}

/// `-` eq (1) of the cascade's paper gives half the explicit error, not a rotation.
#[test]
fn the_papers_reconstruction_is_the_explicit_filter_with_the_wrong_sign() {
    let r_hat = so3::exp(&Vector3::new(0.4, -1.1, 0.3));
    let r = so3::exp(&Vector3::new(0.6, -0.9, 0.1));
    let references = [Vector3::z(), Vector3::new(0.0, 0.6, -0.8)];
    let measured = references.map(|reference| r.inverse() * reference);
    let skew = |v: &Vector3<f64>| v.cross_matrix();
    let estimate: M3<f64> = r_hat.to_rotation_matrix().into_inner();
    let printed: M3<f64> = (references.iter().zip(&measured))
        .map(|(v0, v)| skew(v0) * estimate * skew(v))
        .sum();
    let m = estimate.transpose() * -printed;
    let half = (m - m.transpose()) * 0.5;
    let passive = Vector3::new(half[(2, 1)], half[(0, 2)], half[(1, 0)]);
    let explicit: Vector3<f64> = (references.iter().zip(&measured))
        .map(|(v0, v)| v.cross(&(r_hat.inverse() * v0)))
        .sum();
    assert_relative_eq!(passive, explicit * 0.5, epsilon = 1e-12);
    // With an orthonormal triple and the true attitude it is twice the rotation, sign apart.
    let truth: M3<f64> = r.to_rotation_matrix().into_inner();
    let triple = [Vector3::z(), Vector3::x(), Vector3::y()];
    let sum: M3<f64> = (triple.iter())
        .map(|v0| skew(v0) * truth * skew(&(r.inverse() * v0)))
        .sum();
    assert_relative_eq!(-sum, truth * 2.0, epsilon = 1e-12);
}

#[test]
fn bad_samples_leave_the_state_untouched() {
    for form in FORMS {
        let mut filter = Complementary::new(form, settings()).unwrap();
        let unknown = filter.update_accelerometer(&Vector3::z()).outcome;
        assert_eq!(unknown, Outcome::Skipped(SkipReason::NotInitialized));
        filter.initialize(&start(&settings(), so3::exp(&Vector3::new(0.1, 0.2, 0.3))));
        let before = filter;
        for bad in [
            Vector3::zeros(),
            Vector3::new(f64::NAN, 0.0, 0.0),
            Vector3::new(f64::MAX, 0.0, 0.0),
            Vector3::new(0.0, 0.0, 0.5),
        ] {
            let of = |record: Innovation<f64>| matches!(record.outcome, Outcome::Skipped(_));
            assert!(of(filter.update_accelerometer(&bad)), "{bad}");
            assert!(of(filter.update_magnetometer(&bad)), "{bad}");
        }
        // A field half as strong again is disturbed.
        let strong = references::<f64>().magnetic_field.unwrap() * 1.5;
        let outcome = filter.update_magnetometer(&strong).outcome;
        assert_eq!(outcome, Outcome::Skipped(SkipReason::OutOfRange));
        assert_eq!(filter.propagate(&Vector3::x(), 0.0), Propagation::Done);
        assert_eq!(filter.propagate(&Vector3::x(), -0.1), Propagation::Done);
        assert_eq!(filter, before);
    }
}

/// A tolerance that lets everything in still takes no vector without a direction.
#[test]
fn no_tolerance_lets_a_zero_or_an_infinite_field_in() {
    for form in FORMS {
        let config = AttitudeConfig {
            complementary_field_tolerance: 1e3,
            ..settings()
        };
        let mut filter = Complementary::new(form, config).unwrap();
        filter.initialize(&start(&config, UnitQuaternion::identity()));
        let before = filter;
        for bad in [
            Vector3::zeros(),
            Vector3::repeat(1e-9),
            Vector3::repeat(f64::MAX),
        ] {
            let outcome = filter.update_magnetometer(&bad).outcome;
            assert!(matches!(outcome, Outcome::Skipped(_)), "{bad}");
        }
        assert_eq!(filter, before);
    }
    let config = AttitudeConfig {
        complementary_field_tolerance: 1e160,
        ..AttitudeConfig::<f64>::lab()
    };
    assert_eq!(
        config.validate().unwrap_err().field,
        "complementary_field_tolerance"
    );
}

#[test]
fn gains_that_would_overshoot_are_refused() {
    for (field, gain) in [
        ("complementary_attitude_gain", 11.0),
        ("complementary_bias_gain", -1.0),
    ] {
        let mut config = settings();
        if field.contains("attitude") {
            config.complementary_attitude_gain = gain;
        } else {
            config.complementary_bias_gain = gain;
        }
        let error = Complementary::<f64>::new(ComplementaryForm::Explicit, config).unwrap_err();
        assert_eq!(
            (error.field, error.range),
            (field, crate::parameters::Range::From(0.0, 10.0))
        );
    }
}

/// Whatever comes, the state is finite, a rotation, and its bias within bounds.
fn stays_sane<T: Scalar>(form: ComplementaryForm, samples: &[(u8, [f64; 3], f64)], tolerance: f64) {
    let mut filter = Complementary::<T>::new(form, settings()).unwrap();
    filter.initialize(&start(&settings(), UnitQuaternion::identity()));
    for (sensor, v, dt) in samples {
        let v = Vector3::from(v.map(lit::<T>));
        match sensor % 3 {
            0 => {
                filter.propagate(&v, lit(*dt));
            }
            1 => {
                filter.update_accelerometer(&v);
            }
            _ => {
                filter.update_magnetometer(&v);
            }
        }
        let norm = filter.attitude().as_ref().norm();
        assert!((norm - T::one()).abs() < lit(tolerance));
        assert!(filter.rate_at_rest().amax() <= lit(0.2 * 1.0001));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(4), ..ProptestConfig::default() })]
    #[test]
    fn any_samples_leave_a_rotation(
        form in 0_usize..3,
        samples in prop::collection::vec((any::<u8>(), prop::array::uniform3(prop_oneof![-60.0..60.0, any::<f64>()]), prop_oneof![0.0..1.0, any::<f64>()]), 0..60)
    ) {
        stays_sane::<f64>(FORMS[form], &samples, 1e-12);
        stays_sane::<f32>(FORMS[form], &samples, 1e-6);
    }
}

#[test]
fn ten_million_steps_keep_it_a_rotation() {
    let mut double = started(ComplementaryForm::Explicit, UnitQuaternion::identity());
    let mut single = Complementary::<f32>::new(ComplementaryForm::Explicit, settings()).unwrap();
    single.initialize(&start(&settings(), UnitQuaternion::identity()));
    let up = references::<f64>().specific_force;
    for k in 0..10_000_000 {
        let t = f64::from(k) * 0.01;
        let rate = Vector3::new((0.7 * t).sin(), 0.8 * (1.1 * t).cos(), 0.5);
        double.propagate(&rate, 0.01);
        double.update_accelerometer(&up);
        single.propagate(&rate.cast(), 0.01);
        single.update_accelerometer(&up.cast());
    }
    assert!((double.attitude().as_ref().norm() - 1.0).abs() < 1e-12);
    assert!((single.attitude().as_ref().norm() - 1.0).abs() < 1e-6);
}
