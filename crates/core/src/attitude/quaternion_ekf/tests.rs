//! Every Jacobian against dual numbers, the demands on every filter, agreement with the MEKF.

use approx::assert_relative_eq;
use nalgebra::ComplexField;
use num_dual::{DualSVec64, jacobian};

use super::*;
use crate::attitude::MagnetometerUse;
use crate::attitude::mekf::Mekf;
use crate::attitude::test_world::*;
use crate::geometry::rotation;
use crate::kalman::covariance::cholesky;
use crate::restorable::Restorable as _;

fn make<T: Scalar>(config: AttitudeConfig<T>) -> QuaternionEkf<T> {
    QuaternionEkf::new(config).unwrap()
}

const QUATERNIONS: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 0.6, 0.0, -0.8],
    [0.5, -0.5, 0.5, 0.5],
    [0.7, 0.1, -0.3, 0.4],
];

fn product<T: Scalar>(q: &Vector4<T>, p: &Vector4<T>) -> Vector4<T> {
    let q = Quaternion::new(q[0], q[1], q[2], q[3]) * Quaternion::new(p[0], p[1], p[2], p[3]);
    Vector4::new(q.w, q.i, q.j, q.k)
}

/// `F_q` and `F_qb`: the next quaternion as a function of quaternion and bias.
#[test]
fn transition_equals_dual_numbers() {
    for q in QUATERNIONS {
        for rate in [
            [0.0; 3],
            [1e-7, 0.0, 2e-7],
            [1.0, -2.0, 0.5],
            [-20.0, 9.0, 30.0],
        ] {
            let (rate, dt) = (Vector3::from(rate), 0.02);
            let x = Vector7::from_fn(|i, _| q.get(i).copied().unwrap_or(0.0));
            let next = |x: SVector<DualSVec64<7>, 7>| {
                let (q, b) = (
                    x.fixed_rows::<4>(0).into_owned(),
                    x.fixed_rows::<3>(4).into_owned(),
                );
                let r = (rate.map(constant::<7>) - b) * constant::<7>(dt);
                product(&q, &wxyz(&so3::exp(&r)))
            };
            let (value, j): (_, SMatrix<f64, 4, 7>) = jacobian(next, &x);
            let (f, moved) = transition(&Vector4::from(q), &rate, dt);
            assert_relative_eq!(moved, value, epsilon = 1e-14);
            assert_relative_eq!(f.fixed_rows::<4>(0).into_owned(), j, epsilon = 1e-13);
        }
    }
}

/// The form of the literature: cos I + sinc Omega.
#[test]
fn product_matrix_is_cosine_and_omega() {
    let r = Vector3::<f64>::new(0.3, -0.5, 0.9);
    let (half, n) = (r.norm() / 2.0, r.norm());
    let r4 = Vector4::new(0.0, r.x, r.y, r.z);
    let omega = Matrix4::from_fn(|i, j| product(&Vector4::ith(j, 1.0), &r4)[i]);
    let expected = Matrix4::identity() * half.cos() + omega * (half.sin() / n);
    assert_relative_eq!(
        product_matrix(&wxyz(&so3::exp(&r))),
        expected,
        epsilon = 1e-14
    );
}

#[test]
fn xi_is_the_product_with_a_pure_quaternion() {
    for q in QUATERNIONS.map(Vector4::from) {
        let r = Vector3::new(0.3, -0.7, 1.9);
        let expected = product(&q, &Vector4::new(0.0, r.x, r.y, r.z));
        assert_relative_eq!(xi(&q) * r, expected, epsilon = 1e-15);
        assert_relative_eq!(
            xi(&q).transpose() * xi(&q),
            Matrix3::identity() * q.norm_squared(),
            epsilon = 1e-15
        );
    }
}

/// `d C(q) v / dq` at quaternions of any length; on the unit sphere it is `[C v]x 2 Xi^T` and a
/// part along `q`.
#[test]
fn measurement_jacobian_equals_dual_numbers() {
    let v = Vector3::new(3.0, -20.0, 40.0);
    for q in QUATERNIONS.map(Vector4::from) {
        let predict = |q: SVector<DualSVec64<4>, 4>| {
            let (w, u) = (q[0], Vector3::new(q[1], q[2], q[3]));
            let v = v.map(constant::<4>);
            let two = constant::<4>(2.0);
            v * (w * w - u.dot(&u)) + u * (two * u.dot(&v)) - u.cross(&v) * (two * w)
        };
        for scale in [1.0, 0.3, 2.0] {
            let (value, j) = jacobian(predict, &(q * scale));
            assert_relative_eq!(vector_jacobian(&(q * scale), &v), j, epsilon = 1e-12);
            let turned = from_wxyz(&q.normalize()).inverse() * v;
            assert_relative_eq!(value, turned * (q * scale).norm_squared(), epsilon = 1e-12);
        }
        let unit = q.normalize();
        let turned = from_wxyz(&unit).inverse() * v;
        let tangent = so3::skew(&turned) * xi(&unit).transpose() * 2.0;
        let along = turned * unit.transpose() * 2.0;
        assert_relative_eq!(vector_jacobian(&unit, &v), tangent + along, epsilon = 1e-12);
    }
}

#[test]
fn normalization_jacobian_equals_dual_numbers() {
    for q in QUATERNIONS.map(|q| Vector4::from(q) * 1.3) {
        let (_, j) = jacobian(
            |q: SVector<DualSVec64<4>, 4>| q / ComplexField::sqrt(q.dot(&q)),
            &q,
        );
        assert_relative_eq!(normalization_jacobian(&q), j, epsilon = 1e-13);
    }
}

#[test]
fn lift_and_reduce_are_inverse_and_leave_nothing_along_the_quaternion() {
    let q = so3::exp(&Vector3::new(0.5, 1.0, -2.0));
    let m = Matrix6::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin());
    let p = m * m.transpose();
    let lifted = lift(&q, &p);
    assert_relative_eq!(reduce(&q, &lifted), p, epsilon = 1e-13);
    let along = quaternion_block(&lifted) * wxyz(&q);
    assert!(along.amax() < 1e-14);
}

/// One step, propagation and update, keeps the covariance free of a part along the quaternion.
#[test]
fn covariance_stays_tangent() {
    let mut f = make(AttitudeConfig::<f64>::lab());
    f.initialize(&start(f.config(), UnitQuaternion::identity()));
    drive(5, 21, |_, samples| {
        step_all(&mut f, &samples);
        let along = f.state.covariance.fixed_view::<7, 4>(0, 0) * wxyz(&f.state.attitude);
        assert!(along.amax() < 1e-12, "{along}");
    });
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

/// It is the MEKF, from a poor start and with gates: same attitude, bias, covariance and records.
#[test]
fn equals_the_mekf_to_rounding() {
    // A heading update from a poor start leaves out a large tilt coupling and magnifies rounding.
    let modes = [
        (MagnetometerUse::Vector, 1e-12),
        (MagnetometerUse::Heading, 1e-6),
    ];
    for (magnetometer_use, tolerance) in modes {
        let config = AttitudeConfig {
            initial_tilt_std: 0.5,
            magnetometer_use,
            ..AttitudeConfig::<f64>::lab()
        };
        let (mut additive, mut mekf) = (make(config), Mekf::new(config).unwrap());
        let off = so3::exp(&Vector3::new(0.6, -0.5, 0.4));
        additive.initialize(&start(&config, off));
        mekf.initialize(&start(&config, off));
        drive(20, 5, |_, samples| {
            step_all(&mut additive, &samples);
            step_all(&mut mekf, &samples);
            assert!(rotation::angle_between(&additive.attitude(), &mekf.attitude()) < tolerance);
        });
        let (a, m) = (additive.error_covariance(), mekf.state().covariance);
        assert_relative_eq!(a, m, epsilon = m.amax() * tolerance * 10.0);
        assert!(cholesky(&a).is_some());
        let (b, m) = (additive.state().gyroscope_bias, mekf.state().gyroscope_bias);
        assert_relative_eq!(b, m, epsilon = tolerance);
        let field = Vector3::new(5.0, 20.0, -30.0);
        let (a, m) = (
            additive.update_magnetometer(&field),
            mekf.update_magnetometer(&field),
        );
        assert_eq!(a.outcome, m.outcome);
        assert_relative_eq!(a.nis, m.nis, max_relative = 1e-6);
    }
}

#[test]
fn attitude_variance_is_capped() {
    let mut f = make(AttitudeConfig::<f64>::lab());
    f.initialize(&start(f.config(), so3::exp(&Vector3::new(0.5, 1.0, -2.0))));
    f.add_attitude_variance(100.0);
    let p = f.attitude_covariance().unwrap();
    assert_relative_eq!(p.diagonal(), Vector3::repeat(1.8 * 1.8), epsilon = 1e-9);
}

/// The paper on the cascade prints the rate matrix twice (its eq 5): by elements, and in blocks with the
/// sign of `[w]x` turned. Only the elements are the quaternion's derivative.
#[test]
fn the_papers_block_form_of_the_rate_matrix_has_the_wrong_sign() {
    let q = UnitQuaternion::from_euler_angles(0.4, -0.8, 1.9);
    let (rate, q4) = (Vector3::new(0.3, -1.2, 0.7), wxyz(&q));
    let blocks = |sign: f64| {
        let mut m = Matrix4::zeros();
        m.fixed_view_mut::<1, 3>(0, 1).copy_from(&-rate.transpose());
        m.fixed_view_mut::<3, 1>(1, 0).copy_from(&rate);
        m.fixed_view_mut::<3, 3>(1, 1)
            .copy_from(&(so3::skew(&rate) * sign));
        m
    };
    let derivative = xi(&q4) * rate;
    assert!((blocks(-1.0) * q4 - derivative).norm() < 1e-15);
    assert!((blocks(1.0) * q4 - derivative).norm() > 0.5);
}

/// Its eqs 7 and 8 with their misprints mended: `R(q)^T g` and the elements of `R^T`.
#[test]
fn the_papers_gravity_and_field_predictions_are_the_inverse_rotation() {
    let q = UnitQuaternion::from_euler_angles(0.4, -0.8, 1.9);
    let [q0, q1, q2, q3] = [q.w, q.i, q.j, q.k];
    let gravity = Vector3::new(
        2.0 * (q1 * q3 - q0 * q2),
        2.0 * (q2 * q3 + q0 * q1),
        q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3,
    );
    assert!((gravity - q.inverse() * Vector3::z()).norm() < 1e-15);
    let inverse = q.inverse().to_rotation_matrix().into_inner();
    assert!((inverse[(2, 1)] - 2.0 * (q2 * q3 - q0 * q1)).abs() < 1e-15);
}

/// A free norm: the same filter while vectors have the length they should; the uncertainty along the
/// quaternion is only there.
#[test]
fn a_free_norm_keeps_a_variance_along_the_quaternion() {
    for (norm, expected) in [
        (QuaternionNorm::Projected, 0.0),
        (QuaternionNorm::Free, 0.1),
    ] {
        let config = AttitudeConfig::<f64> {
            quaternion_norm: norm,
            initial_tilt_std: 0.4_f64.sqrt(),
            ..AttitudeConfig::lab()
        };
        let mut filter = QuaternionEkf::new(config).unwrap();
        let truth = UnitQuaternion::from_euler_angles(0.4, -0.8, 1.9);
        filter.initialize(&start(&config, truth));
        let q = wxyz(&truth);
        let along = (q.transpose() * quaternion_block(&filter.state.covariance) * q)[0];
        assert!((along - expected).abs() < 1e-12, "{norm:?}: {along}");
        let force = truth.inverse() * start::<f64>(&config, truth).references.specific_force;
        for _ in 0..100 {
            filter.propagate(&Vector3::zeros(), 0.01);
            assert!(filter.update_accelerometer(&force).outcome.is_fused());
        }
        assert!(filter.attitude().angle_to(&truth) < 1e-9, "{norm:?}");
        let covariance = filter.state.covariance;
        assert!((covariance - covariance.transpose()).norm() < 1e-15);
    }
}
