//! Bad samples, absurd samples, single precision.

use super::*;

#[test]
fn bad_samples_leave_the_state_untouched_and_say_why() {
    let make = |_: AttitudeConfig<f64>| BoundedVelocity::new(full()).unwrap();
    test_world::check_bad_samples(make);
    test_world::check_reproducible(make, |f| {
        let mut copy = BoundedVelocity::new(*f.config()).unwrap();
        copy.restore(f.save()).unwrap();
        copy
    });
    let mut f = filter(full::<f64>());
    let before = f;
    let far = f.update_accelerometer(&Vector3::new(1e3, 0.0, 0.0)).outcome;
    assert_eq!(far, Outcome::Skipped(SkipReason::OutOfRange));
    let far = f.update_magnetometer(&Vector3::new(1e5, 0.0, 0.0)).outcome;
    assert_eq!(far, Outcome::Skipped(SkipReason::OutOfRange));
    let spin = f.propagate(&Vector3::new(1e5, 0.0, 0.0), 0.01);
    assert_eq!(spin, Propagation::Skipped(SkipReason::OutOfRange));
    let mut nonsense = initial(TangentFrame::Enu, UnitQuaternion::identity());
    nonsense.references.specific_force = Vector3::zeros();
    f.initialize(&nonsense);
    assert_eq!(f, before);
}

#[test]
fn absurd_but_finite_samples_never_break_it() {
    let mut f = filter(full::<f32>());
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    for k in 0..20_000 {
        let mut any = |most: f32| {
            let size = most.powf(rng.random_range(-1.0..1.0_f32));
            Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f32) * size)
        };
        let (w, a, m) = (any(9e3), any(400.0), any(2e3));
        let dt = 1e3_f32.powf(rng.random_range(-1.5..0.6));
        f.propagate(&w, dt);
        f.update_accelerometer(&a);
        f.update_magnetometer(&m);
        let state = f.state();
        let finite = state.covariance.norm_squared().is_finite()
            && state.level_from_body.as_ref().norm().is_finite()
            && state.velocity.norm().is_finite()
            && (state.scale.norm() + state.hard_iron_ut.norm()).is_finite()
            && state.gyroscope_bias.norm().is_finite();
        assert!(finite, "step {k}");
    }
}

#[test]
fn a_compass_finds_and_keeps_the_heading() {
    test_world::check_compass(|_| {
        let config = BoundedVelocityConfig {
            compass_std: 0.1,
            compass_correlation_time_s: 0.0,
            ..BoundedVelocityConfig::lab()
        };
        BoundedVelocity::new(config).unwrap()
    });
}

/// Acceptance test (b).
#[test]
fn single_and_double_precision_agree() {
    let (mut f64s, mut f32s) = (filter(full::<f64>()), filter(full::<f32>()));
    let errors = Errors {
        bias: test_world::BIAS,
        hard_iron: Vector3::new(5.0, 3.0, -4.0),
        ..Errors::default()
    };
    let mut apart = 0.0_f64;
    hand(60, 11, &errors, |_, samples| {
        step_all(&mut f64s, samples);
        step_all(&mut f32s, samples);
        let single = f32s.attitude().cast::<f64>();
        apart = apart.max(rotation::angle_between(&f64s.attitude(), &single).to_degrees());
    });
    assert!(apart < 0.01, "{apart} deg");
}

/// A million samples in single precision, half of them without heading.
#[test]
fn single_precision_stays_positive_over_a_million_samples() {
    let mut f = filter(full::<f32>());
    let up = Vector3::new(0.0, 0.0, 9.81_f32);
    let field = Vector3::new(0.0, FIELD[0] as f32, -FIELD[1] as f32);
    let mut truth = UnitQuaternion::<f32>::identity();
    for k in 0..1_000_000_u32 {
        let t = (k % 100_000) as f32 * 0.01;
        let rate = Vector3::new((0.7 * t).sin(), 0.8 * (1.1 * t).cos(), 0.2);
        truth = rotation::renormalize(&(truth * so3::exp(&(rate * 0.01))));
        f.propagate(&rate, 0.01);
        f.update_accelerometer(&(truth.inverse() * up));
        if (k / 50_000).is_multiple_of(2) {
            f.update_magnetometer(&(truth.inverse() * field));
        }
        if k.is_multiple_of(5000) {
            assert!(is_sound(&f), "step {k}: {}", f.state.covariance);
        }
    }
    let error = rotation::angle_between(&truth, &f.attitude()).to_degrees();
    assert!(error < 1.5, "{error} deg");
    assert!(f.state.covariance[(SCALE, SCALE)] > 0.0);
}
