//! Exactness on clean data, the predicted error on noisy data, and everything unusable.

use core::f64::consts::PI;

use approx::assert_relative_eq;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::vec::Vec;

use super::*;
use crate::geometry::{rotation::angle_between, so3};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, 9.806_65);

/// The reference field of the specification: 43 microtesla, dip 51 degrees, x north, z up.
fn field() -> Vector3<f64> {
    let dip = 51_f64.to_radians();
    Vector3::new(43.0 * dip.cos(), 0.0, -43.0 * dip.sin())
}

fn gauss(rng: &mut Pcg64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

/// Random attitudes, with the half turns about the axes and about a slanted one.
fn attitudes(rng: &mut Pcg64, count: usize) -> Vec<UnitQuaternion<f64>> {
    let mut out = Vec::from([UnitQuaternion::identity()]);
    for axis in [
        Vector3::x(),
        Vector3::y(),
        Vector3::z(),
        Vector3::new(0.36, -0.48, 0.8),
    ] {
        out.push(so3::exp(&(axis * PI)));
        out.push(so3::exp(&(axis * (PI - 1e-9))));
    }
    for _ in 0..count {
        out.push(so3::exp(&(gauss(rng) * 2.0)));
    }
    out
}

fn observation(q: &UnitQuaternion<f64>, reference: Vector3<f64>, std: f64) -> Observation<f64> {
    Observation {
        body: q.inverse() * reference,
        reference,
        std,
    }
}

#[test]
fn both_are_exact_on_clean_data_for_any_attitude() {
    let mut rng = Pcg64::seed_from_u64(0x07EA_D001);
    for q in attitudes(&mut rng, 500) {
        let (g, m) = (q.inverse() * GRAVITY, q.inverse() * field());
        let t = triad(&g, &m, &GRAVITY, &field()).unwrap();
        assert!(angle_between(&q, &t) < 1e-14 && t.w >= 0.0, "TRIAD at {q}");
        let d = davenport(&[
            observation(&q, GRAVITY, 0.005),
            observation(&q, field(), 0.011),
        ]);
        let d = d.unwrap().ref_from_body;
        assert!(
            angle_between(&q, &d) < 1e-14 && d.w >= 0.0,
            "Davenport at {q}"
        );
    }
}

/// GIVEN a second vector that is wrong WHEN TRIAD runs THEN the first pair still matches exactly.
#[test]
fn triad_matches_the_first_pair_whatever_the_second_says() {
    let mut rng = Pcg64::seed_from_u64(0x07EA_D002);
    for q in attitudes(&mut rng, 50) {
        let (g, m) = (
            q.inverse() * GRAVITY,
            q.inverse() * field() + gauss(&mut rng) * 8.0,
        );
        let t = triad(&g, &m, &GRAVITY, &field()).unwrap();
        assert_relative_eq!(t * g, GRAVITY, epsilon = 1e-13);
    }
}

/// The specification: RMS over 2000 trials TRIAD 1.172, Davenport 1.166, predicted 1.187 degrees.
#[test]
fn errors_are_as_large_as_the_covariance_says() {
    let mut rng = Pcg64::seed_from_u64(0x07EA_D003);
    let truth = so3::exp(&Vector3::new(0.7, -1.4, 2.0));
    let (sa, sm) = (0.05 / GRAVITY.norm(), 0.5 / 43.0);
    let (g, m) = (
        observation(&truth, GRAVITY, sa),
        observation(&truth, field(), sm),
    );
    let predicted = davenport(&[g, m]).unwrap().covariance;
    let (mut triad_sum, mut davenport_sum, mut nees) = (0.0, 0.0, 0.0);
    let trials = 2000;
    for _ in 0..trials {
        let noisy = |o: Observation<f64>, rng: &mut Pcg64| Observation {
            body: o.body.normalize() + gauss(rng) * o.std,
            ..o
        };
        let (g, m) = (noisy(g, &mut rng), noisy(m, &mut rng));
        let t = triad(&g.body, &m.body, &GRAVITY, &field()).unwrap();
        let d = davenport(&[g, m]).unwrap();
        triad_sum += angle_between(&truth, &t).powi(2);
        davenport_sum += angle_between(&truth, &d.ref_from_body).powi(2);
        let error = so3::log(&(d.ref_from_body.inverse() * truth));
        nees += error.dot(&(d.covariance.try_inverse().unwrap() * error));
    }
    let rms = |sum: f64| (sum / f64::from(trials)).sqrt().to_degrees();
    assert_relative_eq!(
        predicted.trace().sqrt().to_degrees(),
        1.187,
        max_relative = 0.001
    );
    assert_relative_eq!(rms(triad_sum), 1.187, max_relative = 0.05);
    assert_relative_eq!(rms(davenport_sum), 1.187, max_relative = 0.05);
    assert!(
        davenport_sum <= triad_sum * 1.001,
        "optimal is never much worse"
    );
    // Chi-square with 3 * 2000 degrees of freedom, 99.9 % band.
    assert!(
        (nees / f64::from(trials) - 3.0).abs() < 0.18,
        "NEES {}",
        nees / f64::from(trials)
    );
}

#[test]
fn more_and_better_vectors_shrink_the_covariance_as_predicted() {
    let q = so3::exp(&Vector3::new(0.1, 0.2, 0.3));
    let g = observation(&q, GRAVITY, 0.01);
    let m = observation(&q, Vector3::x(), 0.01);
    let once = davenport(&[g, m]).unwrap();
    let four = davenport(&[g, m, g, m, m, g, m, g]).unwrap();
    assert_relative_eq!(once.covariance, four.covariance * 4.0, max_relative = 1e-3);
    assert!(angle_between(&q, &four.ref_from_body) < 1e-14);
}

#[test]
fn single_precision_is_good_to_its_rounding() {
    let mut rng = Pcg64::seed_from_u64(0x07EA_D004);
    let (g_ref, m_ref) = (GRAVITY.map(|x| x as f32), field().map(|x| x as f32));
    for q in attitudes(&mut rng, 200) {
        let (g, m) = (q.inverse() * GRAVITY, q.inverse() * field());
        let (g, m) = (g.map(|x| x as f32), m.map(|x| x as f32));
        let q32 = UnitQuaternion::new_normalize(Quaternion::from(q.coords.map(|x| x as f32)));
        assert!(angle_between(&q32, &triad(&g, &m, &g_ref, &m_ref).unwrap()) < 2e-6);
        let observations = [
            Observation {
                body: g,
                reference: g_ref,
                std: 0.005_f32,
            },
            Observation {
                body: m,
                reference: m_ref,
                std: 0.011,
            },
        ];
        let d = davenport(&observations).unwrap();
        assert!(angle_between(&q32, &d.ref_from_body) < 2e-6);
        let [precise, poor] = observations;
        let d = davenport(&[precise, Observation { std: 0.05, ..poor }]).unwrap();
        assert!(angle_between(&q32, &d.ref_from_body) < 2e-5);
        assert!((level(&g, &g_ref) * g - g_ref).norm() < 2e-5);
    }
}

#[test]
fn one_direction_gives_tilt_and_says_that_heading_is_unknown() {
    let q = so3::exp(&Vector3::new(0.5, -0.4, 0.9));
    let tilted = observation(&q, GRAVITY, 0.01);
    let nearly_parallel = Observation {
        body: tilted.body + Vector3::x() * 0.1,
        ..tilted
    };
    for observations in [&[tilted][..], &[tilted, nearly_parallel], &[tilted; 4]] {
        let d = davenport(observations).unwrap();
        assert_relative_eq!(d.ref_from_body * tilted.body, GRAVITY, epsilon = 1e-12);
        let up = tilted.body.normalize();
        assert_relative_eq!(
            up.dot(&(d.covariance * up)),
            MAXIMUM_STD.powi(2),
            epsilon = 1e-9
        );
        let across = up.cross(&Vector3::x()).normalize();
        assert_relative_eq!(
            across.dot(&(d.covariance * across)),
            1e-4,
            max_relative = 1e-3
        );
    }
}

#[test]
fn level_is_the_shortest_rotation_and_survives_upside_down() {
    let mut rng = Pcg64::seed_from_u64(0x07EA_D005);
    for _ in 0..500 {
        let (u, v) = (gauss(&mut rng), gauss(&mut rng));
        let q = level(&u, &v);
        assert_relative_eq!((q * u).normalize(), v.normalize(), epsilon = 1e-13);
        assert!(q.w >= 0.0);
        if u.normalize().dot(&v.normalize()) > -0.998 {
            assert_relative_eq!(q.angle(), u.angle(&v), epsilon = 1e-7);
        }
    }
    for up in [
        Vector3::x(),
        Vector3::y(),
        Vector3::z(),
        Vector3::new(1.0, 2.0, -3.0),
    ] {
        for nudge in [0.0, 1e-12, 1e-7, 1e-3, 0.04] {
            let body = -up + Vector3::new(0.5, 1.0, 0.7) * nudge;
            assert_relative_eq!(
                (level(&body, &up) * body).normalize(),
                up.normalize(),
                epsilon = 1e-13
            );
        }
    }
}

#[test]
fn a_nearly_level_body_keeps_its_heading() {
    let q = level(&Vector3::new(0.05, -0.03, 9.8), &GRAVITY);
    let nose = q * Vector3::x();
    assert!(nose.y.atan2(nose.x).abs() < 1e-4);
}

#[test]
fn parallel_zero_and_non_finite_vectors_are_refused() {
    let (g, m) = (GRAVITY, field());
    let tilted = |degrees: f64| so3::exp(&(Vector3::x() * degrees.to_radians())) * g;
    assert!(triad(&g, &tilted(5.0), &g, &m).is_none());
    assert!(triad(&g, &tilted(175.0), &g, &m).is_none());
    assert!(triad(&g, &m, &g, &tilted(5.0)).is_none());
    assert!(triad(&g, &tilted(6.0), &g, &m).is_some());
    for bad in [
        Vector3::zeros(),
        Vector3::new(f64::NAN, 0.0, 1.0),
        g * f64::INFINITY,
    ] {
        assert!(triad(&bad, &m, &g, &m).is_none() && triad(&g, &bad, &g, &m).is_none());
        assert!(triad(&g, &m, &bad, &m).is_none() && triad(&g, &m, &g, &bad).is_none());
        assert_eq!(level(&bad, &g), UnitQuaternion::identity());
        let good = Observation {
            body: m,
            reference: m,
            std: 0.1,
        };
        let broken = Observation {
            body: bad,
            reference: g,
            std: 0.1,
        };
        assert!(davenport(&[good, broken]).is_none());
    }
    for std in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            davenport(&[Observation {
                body: g,
                reference: g,
                std
            }])
            .is_none()
        );
    }
    assert!(davenport::<f64>(&[]).is_none());
}

#[test]
fn tiny_and_huge_vectors_are_directions_too() {
    for scale in [1e-200, 1e200] {
        let q = triad(&(GRAVITY * scale), &(field() * scale), &GRAVITY, &field()).unwrap();
        assert!(q.angle() < 1e-14);
    }
}
