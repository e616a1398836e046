//! Rows and transitions of the batch smoother against finite differences, and a pass against the recursion of Rauch, Tung and
//! Striebel.

use nalgebra::{SMatrix, UnitQuaternion, Vector3};
use northing_core::geometry::{rotation, so3};
use northing_core::navigation::STATES;
use northing_core::navigation::gnss_ins::{ErrorShares, GnssInsConfig};
use northing_core::navigation::{GnssPosition, GnssVelocity};

use super::aids::Aids;
use super::motion::{History, SlowError, Strapdown};
use super::pass::{Attached, Linearization};
use super::recorder::{ImuSample, Measured, Measurement, Part, Segment};
use super::state::State;
use super::{ALL, Covariance, Errors};
use crate::statistics::rts_step::Link;

const SHARES: ErrorShares<f64> = ErrorShares {
    white: 0.8,
    slow: 0.7,
};
const SLOW: SlowError = SlowError {
    kept: Vector3::new(0.9, 0.9, 0.0),
    added: Vector3::new(0.1, 0.1, 0.2),
};

fn config() -> GnssInsConfig<f64> {
    GnssInsConfig {
        lever_arm_m: [0.4, -0.2, 0.1],
        vehicle_arm_m: [-1.0, 0.1, 0.3],
        ..GnssInsConfig::default()
    }
}

/// A second of a winding flight at 100 Hz.
fn segment() -> Segment {
    let sample = |k: i64| {
        let t = k as f64 * 0.01;
        ImuSample {
            time_ns: k * 10_000_000,
            rate: Vector3::new(0.4 * t.sin(), -0.3, 0.5 * (3.0 * t).cos()),
            force: Vector3::new(1.0 + t, 2.0 * (4.0 * t).sin(), -9.5),
        }
    };
    Segment {
        samples: (0..=100).map(sample).collect(),
        ..Segment::new(crate::navigation::navigator::no_frame())
    }
}

fn state() -> State {
    let mut side = nalgebra::SVector::<f64, 10>::zeros();
    side.copy_from_slice(&[0.3, -0.2, 0.1, 0.0, 5.0, 0.02, -0.04, 3.0, -2.0, 1.0]);
    State {
        ned_from_body: rotation::from_yaw_pitch_roll([0.7, 0.15, -0.2]),
        velocity: Vector3::new(6.0, 4.0, -0.5),
        position: Vector3::new(30.0, -20.0, 5.0),
        accelerometer_bias: Vector3::new(0.05, -0.02, 0.03),
        gyroscope_bias: Vector3::new(2e-3, -1e-3, 3e-3),
        side,
        bias_at_rest: [Vector3::new(0.02, 0.01, 0.0), Vector3::new(1e-3, 0.0, 2e-3)],
        lever_arm: Vector3::new(0.45, -0.15, 0.12),
        speed_scale: -0.01,
        velocity_offset_s: 0.0,
    }
}

fn unit(i: usize) -> Errors {
    let mut x = Errors::zeros();
    x[i] = 1e-6;
    x
}

#[test]
fn what_the_errors_become_is_the_derivative_of_what_the_state_becomes() {
    let (segment, config) = (segment(), config());
    let strapdown = Strapdown {
        segment: &segment,
        config: &config,
    };
    let span_ns = [203_000_000, 298_000_000];
    let moved = |state: &State| {
        let mut history = History::default();
        strapdown
            .advance(state, span_ns, &SLOW, &mut history)
            .unwrap()
    };
    let base = moved(&state());
    let mut transition = Covariance::identity();
    base.step.map(&mut transition);
    for j in 0..ALL {
        let ahead = moved(&state().corrected(&unit(j))).end.minus(&base.end);
        let behind = moved(&state().corrected(&-unit(j))).end.minus(&base.end);
        let slope = (ahead - behind) / 2e-6;
        // Curvature of the Earth and the bias within half a sample are left out.
        let off = (slope - transition.column(j)).amax();
        assert!(off < 2e-5, "state {j}: off by {off}");
    }
    let mut transposed = Covariance::identity();
    base.step.map_transposed(&mut transposed);
    assert!((transposed - transition.transpose()).amax() < 1e-12);
}

fn measured(axes: &UnitQuaternion<f64>) -> Vec<Measured> {
    let (ned, std) = (Vector3::new(29.0, -19.0, 5.5), Vector3::new(1.0, 1.0, 2.0));
    let position = GnssPosition::new(ned, std);
    let velocity = GnssVelocity::new(Vector3::new(6.1, 4.2, -0.4), std);
    // Where the magnetic heading agrees: the row looks along north, not along the sample.
    let iron = Vector3::new(3.0, -2.0, 1.0);
    let field = axes.inverse() * Vector3::new(20.0, 0.0, 42.0) + iron;
    vec![
        Measured::Position(position, SHARES, Part::Horizontal),
        Measured::Position(position, SHARES, Part::Vertical),
        Measured::Velocity(velocity),
        Measured::Heading(0.8, 0.1),
        Measured::MagneticField(field, 0.0),
        Measured::Height(3.0),
        Measured::Speed(7.0, 0.2),
        Measured::Rest,
        Measured::RateAtRest(Vector3::new(0.01, 0.0, 0.0), 1e-4),
        Measured::NonHolonomic,
        Measured::Damping(100.0),
    ]
}

#[test]
fn rows_are_the_derivatives_of_residuals() {
    let (segment, config) = (segment(), config());
    let strapdown = Strapdown {
        segment: &segment,
        config: &config,
    };
    let aids = Aids {
        config: &config,
        noise_scales: [1.0; 3],
    };
    let mut history = History::default();
    let span_ns = [200_000_000, 300_000_000];
    strapdown
        .advance(&state(), span_ns, &SLOW, &mut history)
        .unwrap();
    for measured in measured(&state().ned_from_body) {
        let seen = |state: &State| aids.components(&measured, state, &history, 0.0);
        let base = seen(&state());
        assert!(base[0].is_some(), "{measured:?}");
        for j in 0..ALL {
            let ahead = seen(&state().corrected(&unit(j)));
            let behind = seen(&state().corrected(&-unit(j)));
            for (i, component) in base.iter().enumerate() {
                let Some(component) = component else { continue };
                let [a, b] = [ahead[i], behind[i]].map(|c| c.unwrap().residual);
                let slope = (b - a) / 2e-6;
                let off = (slope - component.row[j]).abs();
                assert!(off < 1e-5, "{measured:?} {i}, state {j}: off by {off}");
            }
        }
    }
}

/// A linear problem is solved by one pass: states and covariances are those of Rauch, Tung and Striebel.
#[test]
fn a_pass_is_what_rauch_tung_and_striebel_have() {
    let (segment, config) = (segment(), config());
    let strapdown = Strapdown {
        segment: &segment,
        config: &config,
    };
    let aids = Aids {
        config: &config,
        noise_scales: [1.0; 3],
    };
    let times_ns: Vec<i64> = (0..=10).map(|k| k * 100_000_000).collect();
    // Nodes that do not lie on one trajectory.
    let states: Vec<State> = (0..=10)
        .map(|k| {
            let mut x = Errors::zeros();
            for i in 0..ALL {
                x[i] = 1e-2 * f64::sin(f64::from(k) + i as f64);
            }
            state().corrected(&x)
        })
        .collect();
    let attached: Vec<Attached> = (0..=10)
        .flat_map(|node| {
            let all = measured(&state().ned_from_body).into_iter();
            all.skip(node % 3).step_by(2).map(move |measured| Attached {
                node,
                age_s: 0.0,
                measurement: Measurement {
                    time_ns: 0,
                    measured,
                    weight: 1.0,
                },
                weight: if node == 4 { 0.3 } else { 1.0 },
            })
        })
        .collect();
    let prior = Covariance::from_diagonal(&Errors::from_fn(|i, _| 0.1 + 0.01 * i as f64));
    let slow = vec![SLOW; 10];
    let linearization = Linearization {
        strapdown: &strapdown,
        aids: &aids,
        times_ns: &times_ns,
        states: &states,
        attached: &attached,
        slow: &slow,
        prior: (Errors::zeros(), prior),
    };
    let forward = linearization.forward().unwrap().unwrap();
    let filtered = forward.filtered();
    let mut bryson_frazier = Vec::new();
    let all = SMatrix::<f64, ALL, ALL>::identity();
    let squares = linearization.backward(forward, |node| {
        bryson_frazier.push((node.error, node.covariance_of(&all)));
    });
    assert!(
        squares
            .iter()
            .all(|(square, count)| *square > 0.0 && *count > 0)
    );

    let (mut error, mut covariance) = *filtered.last().unwrap();
    let mut history = History::default();
    for k in (0..=10).rev() {
        if k < 10 {
            let span_ns = [times_ns[k], times_ns[k + 1]];
            let motion = strapdown
                .advance(&states[k], span_ns, &SLOW, &mut history)
                .unwrap();
            let mut transition = all;
            motion.step.map(&mut transition);
            let (before, known) = &filtered[k];
            let mut predicted = transition * known * transition.transpose()
                + Covariance::from_diagonal(&motion.added);
            let mut errors = predicted.fixed_view_mut::<STATES, STATES>(0, 0);
            errors += motion.noise;
            let prediction = transition * before + motion.end.minus(&states[k + 1]);
            let link = Link {
                filtered: known,
                transition: &transition,
                predicted: &predicted,
            };
            let (x, smoothed) = link.back(&(error - prediction), &covariance).unwrap();
            (error, covariance) = (before + x, smoothed);
        }
        let (x, p) = &bryson_frazier[10 - k];
        for i in 0..ALL {
            let std = covariance[(i, i)].sqrt();
            assert!((x[i] - error[i]).abs() < 1e-5 * std, "node {k}, state {i}");
            let share = p[(i, i)] / covariance[(i, i)];
            assert!((share - 1.0).abs() < 1e-5, "node {k}, state {i}: {share}");
        }
    }
}

#[test]
fn an_error_is_what_a_state_is_off_by() {
    let x = Errors::from_fn(|i, _| 0.01 * (i as f64 + 1.0));
    let back = state().corrected(&x).minus(&state());
    assert!((back - x).amax() < 1e-12);
    let turn = so3::exp(&Vector3::new(0.01, 0.02, 0.03)) * state().ned_from_body;
    assert!(state().corrected(&x).ned_from_body.angle_to(&turn) < 1e-9);
}
