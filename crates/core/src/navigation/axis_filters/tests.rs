use super::*;
use proptest::prelude::*;
use rand::SeedableRng as _;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::vec::Vec;

const G: f64 = 9.806_65;
const DT: f64 = 0.02;

fn filters(config: PositionAxisConfig<f64>) -> PositionAxisFilters<f64> {
    PositionAxisFilters::new(config).unwrap()
}

/// A vehicle that swings to and fro along north for `seconds`; the fixes come once a second until
/// `silent_from`. Gives the root mean square position error after the first 20 s, and the filters.
fn swing(
    config: PositionAxisConfig<f64>,
    seconds: u32,
    silent_from: u32,
) -> (f64, PositionAxisFilters<f64>) {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut noise = |std: f64| std * rng.sample::<f64, _>(StandardNormal);
    let mut f = filters(config);
    let (amplitude, w) = (40.0, 0.2);
    let (mut squares, mut count) = (0.0, 0.0);
    for k in 0..seconds * 50 {
        let t = f64::from(k) * DT;
        let truth = Vector3::new(amplitude * (w * t).sin(), 0.0, 0.0);
        if k % 50 == 0 && k < silent_from * 50 {
            let fix = truth + Vector3::new(noise(2.55), noise(2.55), noise(6.0));
            f.update_position(u64::from(k), &fix);
        }
        let error = (f.position() - truth).xy().norm_squared();
        if t > 20.0 {
            squares += error;
            count += 1.0;
        }
        // The acceleration that holds until the next sample, with a constant bias.
        let middle = t + DT / 2.0;
        let north = -amplitude * w * w * (w * middle).sin() + 0.1 + noise(0.05);
        let force = Vector3::new(north, noise(0.05), noise(0.05) - G);
        f.propagate(&UnitQuaternion::identity(), &force, G, DT)
            .unwrap();
    }
    ((squares / count).sqrt(), f)
}

#[test]
fn physical_noise_beats_the_fixes_and_the_printed_one_does_not() {
    let run = |noise| {
        let config = PositionAxisConfig {
            acceleration_std: 0.2,
            noise,
            ..PositionAxisConfig::default()
        };
        swing(config, 300, 300).0
    };
    // A held fix would be off by 3.6 m of its noise, and by up to 8 m of motion.
    let physical = run(PositionNoise::Physical);
    let printed = run(PositionNoise::Printed);
    assert!(physical < 2.5, "{physical} m");
    assert!(printed > 1.2 * physical, "{printed} against {physical} m");
}

#[test]
fn the_bias_is_found() {
    let config = PositionAxisConfig {
        acceleration_std: 0.2,
        bias_random_walk: 1e-3,
        ..PositionAxisConfig::default()
    };
    let (_, f) = swing(config, 600, 600);
    let [north, east, _] = f.axes().map(|axis| axis.state.z);
    assert!(
        (north - 0.1).abs() < 0.05 && east.abs() < 0.05,
        "{north} {east}"
    );
}

#[test]
fn a_fix_counts_once_however_often_it_is_held() {
    let mut f = filters(PositionAxisConfig::default());
    f.update_position(1, &Vector3::zeros());
    f.propagate(
        &UnitQuaternion::identity(),
        &Vector3::new(0.0, 0.0, -G),
        G,
        DT,
    )
    .unwrap();
    assert_eq!(f.update_position(2, &Vector3::x()).outcome, Outcome::Fused);
    let before = f;
    for number in [2, 1, 0] {
        let again = f.update_position(number, &Vector3::x());
        assert_eq!(again.outcome, Outcome::Skipped(SkipReason::NotNewer));
    }
    assert_eq!(f, before);
}

#[test]
fn silence_makes_it_dead_reckoning_and_then_nothing() {
    let level = Vector3::new(0.0, 0.0, -G);
    let mut f = filters(PositionAxisConfig::default());
    assert_eq!(f.validity(), Validity::Aligning);
    f.propagate(&UnitQuaternion::identity(), &level, G, DT)
        .unwrap();
    assert_eq!(f.validity(), Validity::Aligning);
    f.update_position(1, &Vector3::zeros());
    assert_eq!(f.validity(), Validity::Aided);
    let mut before = f.axes()[0].covariance.m11;
    let mut seen = Vec::new();
    for _ in 0..2500 {
        f.propagate(&UnitQuaternion::identity(), &level, G, DT)
            .unwrap();
        let now = f.axes()[0].covariance.m11;
        assert!(now >= before);
        before = now;
        if seen.last() != Some(&f.validity()) {
            seen.push(f.validity());
        }
    }
    assert_eq!(
        seen,
        [Validity::Aided, Validity::DeadReckoning, Validity::Invalid]
    );
}

#[test]
fn a_jump_is_left_out_and_a_receiver_that_insists_is_accepted() {
    let level = Vector3::new(0.0, 0.0, -G);
    let mut f = filters(PositionAxisConfig::default());
    for number in 0..100_u64 {
        f.update_position(number, &Vector3::zeros());
        for _ in 0..50 {
            f.propagate(&UnitQuaternion::identity(), &level, G, DT)
                .unwrap();
        }
    }
    let far = Vector3::new(1000.0, 0.0, 0.0);
    for number in 100..105 {
        assert_eq!(f.update_position(number, &far).outcome, Outcome::Gated);
    }
    assert!(f.position().norm() < 1.0);
    assert_eq!(f.update_position(105, &far).outcome, Outcome::Inflated);
    assert_eq!(f.position(), far);
    // One outlier among good fixes leaves no trace in the next.
    assert_eq!(
        f.update_position(106, &Vector3::zeros()).outcome,
        Outcome::Gated
    );
    assert_eq!(f.update_position(107, &far).outcome, Outcome::Fused);
}

#[test]
fn one_wild_fix_is_not_followed_and_nothing_is_locked_out_for_good() {
    let level = Vector3::new(0.0, 0.0, -G);
    let mut f = filters(PositionAxisConfig::default());
    let mut number = 0;
    let mut fix = |f: &mut PositionAxisFilters<f64>, north: f64| {
        for _ in 0..50 {
            let attitude = UnitQuaternion::identity();
            f.propagate(&attitude, &level, G, DT).unwrap();
        }
        number += 1;
        let place = Vector3::new(north, 0.0, 0.0);
        f.update_position(number, &place).outcome
    };
    for _ in 0..100 {
        fix(&mut f, 0.0);
    }
    // The state is wrong by 500 m, and the fix that is due to be accepted is a wild one.
    for _ in 0..5 {
        assert_eq!(fix(&mut f, 500.0), Outcome::Gated);
    }
    assert_eq!(fix(&mut f, 10_000.0), Outcome::Gated);
    assert_eq!(fix(&mut f, 500.0), Outcome::Gated);
    assert_eq!(fix(&mut f, 503.0), Outcome::Inflated);
    assert!((f.position().x - 503.0).abs() < 1e-9);
    // Two receivers that contradict each other and the state.
    let sides = [-20_000.0, 20_000.0];
    let outcomes: Vec<Outcome> = (0..21).map(|k| fix(&mut f, sides[k % 2])).collect();
    assert!(outcomes[..20].iter().all(|o| *o == Outcome::Gated));
    assert_eq!(outcomes[20], Outcome::Inflated);
}

#[test]
fn bad_samples_leave_the_state_untouched_and_bad_settings_are_named() {
    let mut f = filters(PositionAxisConfig::default());
    f.update_position(1, &Vector3::x());
    let before = f;
    let nan = Vector3::new(f64::NAN, 0.0, 0.0);
    let level = UnitQuaternion::identity();
    assert_eq!(f.propagate(&level, &nan, G, DT), Err(SkipReason::NotFinite));
    assert_eq!(
        f.propagate(&level, &Vector3::z(), G, f64::NAN),
        Err(SkipReason::NotFinite)
    );
    assert_eq!(
        f.propagate(&level, &Vector3::z(), G, 1e3),
        Err(SkipReason::OutOfRange)
    );
    assert_eq!(f.propagate(&level, &Vector3::z(), G, 0.0), Ok(()));
    assert!(matches!(
        f.update_position(2, &nan).outcome,
        Outcome::Skipped(_)
    ));
    assert_eq!(f, before);
    let config = PositionAxisConfig {
        position_std: -1.0,
        ..PositionAxisConfig::<f64>::default()
    };
    let refused = PositionAxisFilters::new(config).unwrap_err();
    assert_eq!(refused.field, "position_std");
}

/// A day without fixes, and a day of them, in single precision.
#[test]
fn a_day_in_single_precision_stays_positive() {
    for fixes in [false, true] {
        let mut f = PositionAxisFilters::<f32>::new(PositionAxisConfig::default()).unwrap();
        let level = Vector3::new(0.0, 0.0, -9.8_f32);
        f.update_position(0, &Vector3::zeros());
        for k in 1..4_320_000_u64 {
            f.propagate(&UnitQuaternion::identity(), &level, 9.8, 0.02)
                .unwrap();
            if fixes && k % 50 == 0 {
                f.update_position(k, &Vector3::new(1.0, -1.0, 0.5));
            }
        }
        for axis in f.axes() {
            let p = axis.covariance;
            assert!(p.diagonal().min() > 0.0, "{p}");
            assert!(p.m11 * p.m22 >= p.m12 * p.m12 * 0.999, "{p}");
            assert!(axis.state.norm().is_finite());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(6), ..ProptestConfig::default() })]
    #[test]
    fn any_samples_leave_a_finite_state(
        samples in prop::collection::vec((any::<bool>(), any::<u64>(), prop::array::uniform3(prop_oneof![-60.0..60.0, any::<f64>()]), prop_oneof![0.0..1.0, any::<f64>()]), 0..80)
    ) {
        let mut f = filters(PositionAxisConfig::default());
        for (is_fix, number, v, dt) in samples {
            let v = Vector3::from(v);
            if is_fix {
                f.update_position(number % 1000, &v);
            } else {
                let _ = f.propagate(&UnitQuaternion::identity(), &v, G, dt);
            }
            for axis in f.axes() {
                prop_assert!(axis.state.iter().chain(axis.covariance.iter()).all(|x| x.is_finite()));
                prop_assert!(axis.covariance.diagonal().min() >= 0.0);
            }
        }
    }
}
