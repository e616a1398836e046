//! Biases that step within the window.

use super::*;
use crate::faults::FaultySensor;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Circles without turning with noise, `seconds` long, and from 20 s on biases of gyroscope and accelerometer. Gives the alignment,
/// and the first step that it found with its time.
fn with_biases(
    seconds: u32,
    biases: [Vector3<f64>; 2],
) -> (InMotionAlignment<f64>, Option<(f64, AlignmentStep<f64>)>) {
    with_biases_and_fixes(seconds, biases, [0.02; 2])
}

/// The same with a receiver that states so much, m, and is off by so much.
fn with_biases_and_fixes(
    seconds: u32,
    [rate_bias, force_bias]: [Vector3<f64>; 2],
    [stated_m, off_m]: [f64; 2],
) -> (InMotionAlignment<f64>, Option<(f64, AlignmentStep<f64>)>) {
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let mut noise =
        |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
    let mut made = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
    let mut found = None;
    for k in 0..seconds * 100 {
        let t = f64::from(k) * 0.01;
        if k % 100 == 0 {
            let fix = GnssPosition {
                ned: Vector3::new(-t.cos(), -t.sin(), 0.0) * 4.0 + noise(off_m),
                std: Vector3::repeat(stated_m),
                has_height: true,
            };
            made.gnss_position(&fix);
            found = found.or(made.take_step().map(|step| (t, step)));
        }
        let stepped = if t >= 20.0 { 1.0 } else { 0.0 };
        let t = t + 0.005;
        let force = Vector3::new(4.0 * t.cos(), 4.0 * t.sin(), -9.806_65);
        let rate = noise(2e-3) + rate_bias * stepped;
        let force = force + noise(0.05) + force_bias * stepped;
        made.propagate(&rate, &force, 0.01).unwrap();
    }
    (made, found)
}

#[test]
fn without_a_step_none_is_found() {
    let (made, found) = with_biases(120, [Vector3::zeros(); 2]);
    assert_eq!(found, None);
    assert_eq!((made.restarts(), made.hypotheses()), (0, 1));
}

/// GIVEN a receiver that is much worse than it says THEN its noise is what is learnt, at once, and no bias steps.
#[test]
fn a_receiver_that_is_worse_than_it_says_is_no_step() {
    for worse in [3.0, 5.0, 10.0] {
        let (made, found) = with_biases_and_fixes(120, [Vector3::zeros(); 2], [0.1, 0.1 * worse]);
        assert_eq!(found, None, "{worse}");
        let scale = made.noise_scale() / worse;
        assert!((0.5..2.0).contains(&scale), "{worse}: {scale}");
        let (state, _) = made.hand_over().unwrap();
        let off = crate::geometry::so3::log(&state.ned_from_body);
        assert!(off.norm() < 0.15, "{worse}: {off}");
    }
}

#[test]
fn a_step_of_the_gyroscope_is_found_within_seconds_and_learnt() {
    let bias = Vector3::new(0.03, -0.03, 0.026);
    let (made, found) = with_biases(30, [bias, Vector3::zeros()]);
    let (time, step) = found.unwrap();
    assert!(time <= 24.0, "{time}");
    assert!((time - step.age_s - 20.0).abs() <= 1.0, "{time} {step:?}");
    let (state, _) = made.hand_over().unwrap();
    assert!((state.gyroscope_bias - bias).norm() < 0.01);
    // Ten seconds of it, unnoticed, are half a radian.
    let off = crate::geometry::so3::log(&state.ned_from_body);
    assert!(off.xy().norm() < 0.02 && off.z.abs() < 0.15, "{off}");
    assert_eq!(made.restarts(), 0);
}

#[test]
fn a_step_of_the_accelerometer_is_one_of_the_accelerometer_in_the_end() {
    let bias = Vector3::new(0.3, 0.4, 0.0);
    let (made, found) = with_biases(40, [Vector3::zeros(), bias]);
    let (time, step) = found.unwrap();
    assert!(time <= 25.0, "{time} {step:?}");
    let best = made.memory.bank.as_ref().unwrap().best().unwrap();
    assert_eq!(best.stepped_sensor(), Some(FaultySensor::Accelerometer));
    let (state, _) = made.hand_over().unwrap();
    assert!((state.accelerometer_bias - bias).norm() < 0.15);
    assert!(state.gyroscope_bias.norm() < 0.01);
    assert_eq!(made.restarts(), 0);
}
