//! Moments against brute force, the demands on every filter, agreement with the MEKF.

use approx::assert_relative_eq;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use super::*;
use crate::attitude::mekf::Mekf;
use crate::attitude::propagation;
use crate::attitude::test_world::*;
use crate::restorable::Restorable as _;

fn make<T: Scalar>(config: AttitudeConfig<T>) -> Usque<T> {
    Usque::new(config).unwrap()
}

fn with_covariance(scale: f64) -> Usque<f64> {
    let mut f = make(AttitudeConfig::lab());
    f.initialize(&start(f.config(), so3::exp(&Vector3::new(0.4, -1.0, 0.7))));
    let m = Matrix6::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin());
    f.state.covariance = (m * m.transpose() + Matrix6::identity() * 0.2) * scale;
    f.state.gyroscope_bias = Vector3::new(0.1, -0.2, 0.05);
    f
}

/// Small errors: the unscented moments are the linear ones, transition and measurement alike.
#[test]
fn for_small_covariances_the_moments_are_the_linear_ones() {
    let scale = 1e-8;
    let mut f = with_covariance(scale);
    let p = f.state.covariance;
    let reference = Vector3::new(3.0, -20.0, 40.0);
    let v = f.state.attitude.inverse() * reference;
    let predicted = f.predict(&reference);
    let mut h = SMatrix::<f64, 3, 6>::zeros();
    h.fixed_view_mut::<3, 3>(0, 0).copy_from(&so3::skew(&v));
    assert_relative_eq!(predicted.mean, v, epsilon = 1e-5);
    assert_relative_eq!(
        predicted.cross / scale,
        p * h.transpose() / scale,
        epsilon = 1e-4
    );
    assert_relative_eq!(
        predicted.covariance / scale,
        h * p * h.transpose() / scale,
        epsilon = 1e-2
    );

    let (rate, dt) = (Vector3::new(2.0, -1.0, 3.0), 0.1);
    let columns = f.sigma_columns(&Vector6::zeros());
    let (mean, moved) = f.moved_points(&columns, &rate, dt);
    let phi = propagation::transition(&rate, dt);
    assert!(mean.amax() < 1e-7);
    assert_relative_eq!(
        moved / scale,
        phi * p * phi.transpose() / scale,
        epsilon = 1e-6
    );
}

/// The short cut of seven turned vectors equals all thirteen points, at a large covariance.
#[test]
fn prediction_equals_all_thirteen_points() {
    let mut f = with_covariance(0.02);
    let reference = Vector3::new(0.0, 0.0, 9.81);
    let columns = f.sigma_columns(&Vector6::zeros());
    let predict = |x: &Vector6<f64>| {
        let p = x.fixed_rows::<3>(0).into_owned();
        (f.state.attitude * from_rodrigues(&p)).inverse() * reference
    };
    let mut points = vec_of_points(&columns);
    points.push((Vector6::zeros(), 1.0 / 7.0));
    let mean: Vector3<f64> = points.iter().map(|(x, w)| predict(x) * *w).sum();
    let mut covariance = Matrix3::zeros();
    let mut cross = SMatrix::<f64, 6, 3>::zeros();
    for (x, w) in &points {
        let d = predict(x) - mean;
        covariance += d * d.transpose() * *w;
        cross += x * d.transpose() * *w;
    }
    let ours = f.predict(&reference);
    assert_relative_eq!(ours.mean, mean, epsilon = 1e-12);
    assert_relative_eq!(ours.covariance, covariance, epsilon = 1e-12);
    assert_relative_eq!(ours.cross, cross, epsilon = 1e-12);
}

fn vec_of_points(columns: &Matrix6<f64>) -> std::vec::Vec<(Vector6<f64>, f64)> {
    let columns = columns.column_iter().map(|c| c.into_owned());
    columns
        .flat_map(|c| [(c, 1.0 / 14.0), (-c, 1.0 / 14.0)])
        .collect()
}

#[test]
fn correction_equals_the_gain_with_an_inverse() {
    let mut f = with_covariance(1e-3);
    let p = f.state.covariance;
    let predicted = f.predict(&Vector3::new(0.0, 0.0, 9.81));
    let (residual, r) = (Vector3::new(0.1, -0.2, 0.05), 0.04);
    let s = predicted.covariance + Matrix3::identity() * r;
    let k = predicted.cross * s.try_inverse().unwrap();
    let (q, b) = (f.state.attitude, f.state.gyroscope_bias);
    assert!(f.correct(&predicted, &residual, r));
    let x = k * residual;
    let turned = q * from_rodrigues(&x.fixed_rows::<3>(0).into_owned());
    let mut g = Matrix6::identity();
    g.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&reset_jacobian(&x.fixed_rows::<3>(0).into_owned()));
    let expected = g * (p - k * s * k.transpose()) * g.transpose();
    assert_relative_eq!(f.state.covariance, expected, epsilon = 1e-12);
    assert!(rotation::angle_between(&turned, &f.state.attitude) < 1e-12);
    assert_relative_eq!(
        f.state.gyroscope_bias,
        b + x.fixed_rows::<3>(3),
        epsilon = 1e-14
    );
}

#[test]
fn converges_from_half_a_radian_and_learns_the_bias() {
    check_convergence(make);
}

#[test]
fn bad_samples_leave_the_state_untouched_and_say_why() {
    check_bad_samples(make);
}

#[test]
fn a_saved_state_continues_exactly() {
    check_reproducible(make, |f| {
        let mut other = make(*f.config());
        other.restore(f.save()).unwrap();
        other
    });
}

#[test]
fn with_one_sensor_the_variance_about_its_vector_grows() {
    check_unobservable_grows(make);
}

#[test]
fn heading_update_never_tips_the_tilt() {
    check_heading_update(make);
}

#[test]
fn a_compass_finds_and_keeps_the_heading() {
    check_compass(make);
}

#[test]
fn gate_does_not_lock_out_for_ever() {
    check_gate_opens(make);
}

#[test]
fn single_precision_stays_positive_and_symmetric() {
    check_single_precision(make);
}

/// In steady state it is the MEKF.
#[test]
fn agrees_with_the_mekf_in_steady_state() {
    let config = AttitudeConfig::<f64>::lab();
    let (mut usque, mut mekf) = (make(config), Mekf::new(config).unwrap());
    usque.initialize(&start(&config, UnitQuaternion::identity()));
    mekf.initialize(&start(&config, UnitQuaternion::identity()));
    let mut count = 0;
    drive(20, 5, |_, samples| {
        step_all(&mut usque, &samples);
        step_all(&mut mekf, &samples);
        count += 1;
        if count > 500 {
            let apart = rotation::angle_between(&usque.attitude(), &mekf.attitude());
            assert!(apart.to_degrees() < 0.01, "{} deg", apart.to_degrees());
        }
    });
    let (u, m) = (usque.state.covariance, mekf.state().covariance);
    assert_relative_eq!(u, m, epsilon = m.amax() * 0.02);
    assert_eq!(usque.state.covariance_resets, 0);
}

/// Starts off by 0.5 rad per axis: nine of ten runs are three times better than the MEKF's.
#[test]
fn a_poor_start_hurts_it_less_than_the_mekf() {
    let config = AttitudeConfig {
        initial_tilt_std: 0.5,
        accelerometer_gate_nis: 0.0,
        magnetometer_gate_nis: 0.0,
        ..AttitudeConfig::<f64>::lab()
    };
    let mut rng = Pcg64::seed_from_u64(0x0A5C_ED01);
    let (mut ours, mut theirs) = (std::vec::Vec::new(), std::vec::Vec::new());
    for seed in 0..40 {
        let off = Vector3::from_fn(|_, _| 0.5 * rng.sample::<f64, _>(StandardNormal));
        let (mut usque, mut mekf) = (make(config), Mekf::new(config).unwrap());
        usque.initialize(&start(&config, so3::exp(&off)));
        mekf.initialize(&start(&config, so3::exp(&off)));
        let (mut sums, mut count) = ([0.0; 2], 0);
        drive(5, 5000 + seed, |truth, samples| {
            step_all(&mut usque, &samples);
            step_all(&mut mekf, &samples);
            count += 1;
            if count > 50 {
                sums[0] += rotation::angle_between(truth, &usque.attitude()).powi(2);
                sums[1] += rotation::angle_between(truth, &mekf.attitude()).powi(2);
            }
        });
        ours.push((sums[0] / 450.0).sqrt().to_degrees());
        theirs.push((sums[1] / 450.0).sqrt().to_degrees());
    }
    let ninth_decile = |v: &mut std::vec::Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v[36]
    };
    let (ours, theirs) = (ninth_decile(&mut ours), ninth_decile(&mut theirs));
    assert!(
        ours < 0.35 && theirs > 3.0 * ours,
        "USQUE {ours} deg, MEKF {theirs} deg"
    );
}

/// GIVEN a covariance that is not positive WHEN the filter goes on THEN it mends it and says so.
#[test]
fn a_broken_covariance_is_mended_and_counted() {
    let broken = |p: Matrix6<f64>| {
        let mut f = with_covariance(1e-3);
        f.state.covariance = p;
        f
    };
    // Singular by rounding: mended in place.
    let mut singular = Matrix6::<f64>::identity() * 1e-4;
    singular[(0, 1)] = 1e-4;
    singular[(1, 0)] = 1e-4;
    let mut f = broken(singular);
    assert_eq!(f.propagate(&Vector3::x(), 0.01), Propagation::Done);
    assert!(
        f.update_accelerometer(&Vector3::new(0.0, 0.0, 9.8))
            .nis
            .is_finite()
    );
    assert_eq!(f.state.covariance_resets, 0);
    // Indefinite, or not a number at all: reset to a diagonal within the caps.
    let mut indefinite = singular;
    indefinite[(2, 2)] = -1.0;
    for p in [indefinite, Matrix6::repeat(f64::NAN)] {
        let mut f = broken(p);
        assert_eq!(f.propagate(&Vector3::x(), 0.01), Propagation::Done);
        assert_eq!(f.state.covariance_resets, 1);
        assert!(cholesky(&f.state.covariance).is_some());
        assert!(f.state.covariance.diagonal().max() <= 1.8 * 1.8 + 1e-9);
    }
}

/// An uncertainty at its cap puts sigma points beyond half a turn; the covariance must survive.
#[test]
fn points_beyond_half_a_turn_do_not_jump() {
    let mut f = make(AttitudeConfig::<f64>::lab());
    let before = f.state.covariance;
    assert_eq!(
        f.propagate(&Vector3::new(0.5, -0.2, 0.1), 1e-3),
        Propagation::Done
    );
    let apart = (f.state.covariance - before).amax();
    assert!(apart < 0.01, "{}", f.state.covariance);
    assert_eq!(f.state.covariance_resets, 0);
}

/// A bias that is known exactly and does not walk leaves the covariance no factor: it must not be
/// forgotten at every step for that. The MEKF, which needs no factor, says what is right.
#[test]
fn a_bias_that_is_known_exactly_resets_nothing() {
    let config = AttitudeConfig {
        initial_gyroscope_bias_std: 0.0,
        gyroscope_bias_random_walk: 0.0,
        ..AttitudeConfig::lab()
    };
    let mut initial = start(&config, so3::exp(&Vector3::new(0.2, 0.1, -0.4)));
    initial.gyroscope_bias_std = 0.0;
    // Errors about x and y that belong together.
    let m = Matrix3::new(0.02, 0.015, 0.0, 0.015, 0.02, 0.0, 0.0, 0.0, 0.01);
    initial.attitude_covariance = m * m;
    let (mut f, mut mekf) = (make(config), Mekf::new(config).unwrap());
    f.initialize(&initial);
    mekf.initialize(&initial);
    for _ in 0..500 {
        for filter in [&mut f as &mut dyn AttitudeEstimator<f64>, &mut mekf] {
            filter.propagate(&Vector3::new(0.1, -0.2, 0.05), 0.01);
        }
    }
    assert_eq!(f.state.covariance_resets, 0);
    let (p, expected) = (
        f.attitude_covariance().unwrap(),
        mekf.attitude_covariance().unwrap(),
    );
    assert_relative_eq!(p, expected, max_relative = 0.02, epsilon = 1e-7);
    assert!(
        p[(0, 1)].abs() > 1e-4,
        "what belongs together stays so: {p}"
    );
    assert!(f.gyroscope_bias().unwrap().1.amax() < 1e-18);
    let seen = f.state.attitude.inverse() * Vector3::new(0.0, 0.0, 9.81);
    assert_eq!(f.update_accelerometer(&seen).outcome, Outcome::Fused);
}
