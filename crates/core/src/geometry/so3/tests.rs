//! Closed forms, axioms on nasty values, and every Jacobian against dual numbers.

use std::vec::Vec;

use approx::assert_relative_eq;
use core::f64::consts::PI;
use nalgebra::{Matrix3, SVector, Vector3};
use num_dual::{DualSVec64, jacobian};
use proptest::prelude::*;

use super::*;

/// Rotation vectors where implementations break: zero, tiny, around the series limit, near pi.
fn nasty() -> Vec<Vector3<f64>> {
    let mut out = Vec::from([Vector3::zeros()]);
    let axes = [
        Vector3::x(),
        -Vector3::y(),
        Vector3::z(),
        Vector3::new(0.36, -0.48, 0.8),
    ];
    let angles = [
        1e-300,
        1e-12,
        1e-8,
        1e-5,
        1e-3,
        0.2499999,
        0.25,
        0.2500001,
        0.499_999,
        0.500_001,
        1.0,
        PI - 1e-9,
    ];
    for axis in axes {
        for angle in angles {
            out.push(axis * angle);
        }
    }
    out
}

#[test]
fn exp_and_log_are_inverse_on_nasty_values() {
    for r in nasty() {
        let back = log(&exp(&r));
        assert!(
            (back - r).norm() <= 4e-15 * (1.0 + r.norm()),
            "{r} -> {back}"
        );
        assert!((exp(&r).norm() - 1.0).abs() < 1e-15);
        let r32 = r.map(|x| x as f32);
        // In single precision the largest angles round to more than a half turn.
        if r.norm() < 3.1 {
            assert!((log(&exp(&r32)) - r32).norm() <= 3e-6, "f32 {r32}");
        }
    }
}

#[test]
fn log_of_both_signs_of_a_quaternion_is_the_same_rotation() {
    for r in nasty() {
        let q = exp(&r);
        let minus = UnitQuaternion::new_unchecked(-q.into_inner());
        assert!((log(&minus) - log(&q)).norm() < 1e-12);
    }
}

#[test]
fn exp_matrix_is_the_quaternion_s_matrix_and_orthogonal() {
    for r in nasty() {
        let m = exp_matrix(&r);
        assert_relative_eq!(
            m,
            exp(&r).to_rotation_matrix().into_inner(),
            epsilon = 1e-14
        );
        assert_relative_eq!(m * m.transpose(), Matrix3::identity(), epsilon = 1e-14);
    }
}

#[test]
fn right_jacobian_inverse_is_its_inverse() {
    for r in nasty() {
        assert_relative_eq!(
            right_jacobian(&r) * right_jacobian_inverse(&r),
            Matrix3::identity(),
            epsilon = 1e-11
        );
    }
}

#[test]
fn series_meets_closed_form_at_the_limit() {
    let below = Coefficients::<f64>::of_squared_angle(SERIES_LIMIT * (1.0 - 1e-12));
    let above = Coefficients::<f64>::of_squared_angle(SERIES_LIMIT * (1.0 + 1e-12));
    assert_relative_eq!(below.sine, above.sine, max_relative = 1e-12);
    assert_relative_eq!(below.cosine, above.cosine, max_relative = 1e-12);
    assert_relative_eq!(below.cubic, above.cubic, max_relative = 1e-12);
}

#[test]
fn right_jacobian_equals_dual_numbers() {
    for r in nasty().into_iter().filter(|r| r.norm() < 3.0) {
        let q0 = exp(&r).inverse();
        let (_, j) = jacobian(
            |d: SVector<DualSVec64<3>, 3>| {
                log(&(q0.cast::<DualSVec64<3>>() * exp(&(r.map(DualSVec64::from) + d))))
            },
            &Vector3::zeros(),
        );
        assert_relative_eq!(j, right_jacobian(&r), epsilon = 1e-9);
    }
}

#[test]
fn gibbs_reset_jacobian_equals_dual_numbers() {
    for a in [
        Vector3::zeros(),
        Vector3::new(0.3, -0.2, 0.1),
        Vector3::new(-1.5, 0.7, 2.0),
    ] {
        let q0 = from_gibbs(&a).inverse();
        let (_, g) = jacobian(
            |d: SVector<DualSVec64<3>, 3>| to_gibbs(&(q0.cast::<DualSVec64<3>>() * from_gibbs(&d))),
            &a,
        );
        assert_relative_eq!(g, gibbs_reset_jacobian(&a), epsilon = 1e-12);
    }
}

#[test]
fn gibbs_vector_is_the_rotation_vector_when_small() {
    let a = Vector3::new(1e-5, -2e-5, 3e-5);
    assert!((log(&from_gibbs(&a)) - a).norm() < 1e-14);
    assert!((to_gibbs(&from_gibbs(&(a * 1e5))) - a * 1e5).norm() < 1e-14);
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(25), ..ProptestConfig::default() })]
    #[test]
    fn rotating_by_exp_preserves_length_and_composes(
        a in prop::array::uniform3(-3.0..3.0f64), b in prop::array::uniform3(-3.0..3.0f64), v in prop::array::uniform3(-10.0..10.0f64)
    ) {
        let (a, b, v) = (Vector3::from(a), Vector3::from(b), Vector3::from(v));
        prop_assert!(((exp(&a) * v).norm() - v.norm()).abs() < 1e-12);
        prop_assert!(((exp(&a) * exp(&b)) * v - exp(&a) * (exp(&b) * v)).norm() < 1e-12);
        prop_assert!((exp_matrix(&a) * v - exp(&a) * v).norm() < 1e-12);
        prop_assert!((skew(&a) * v - a.cross(&v)).norm() < 1e-12);
    }
}
