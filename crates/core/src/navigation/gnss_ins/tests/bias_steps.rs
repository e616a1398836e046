//! Biases that step while the filter goes on alone.

use super::faults::{with_faults, with_faults_and_headings};
use super::*;
use crate::faults::{Fault, FaultKind, FaultySensor};

const STEPPED_S: f64 = 80.0;

/// Biases of gyroscope and accelerometer from 80 s on: the horizontal errors at each second, and the steps that were found.
fn with_biases(
    [rate_bias, force_bias]: [Vector3<f64>; 2],
) -> (
    std::vec::Vec<f64>,
    GnssIns<f64, 64>,
    std::vec::Vec<Fault<f64>>,
) {
    let (errors, mut ins) = with_faults(|t, rate, force| {
        if t >= STEPPED_S {
            *rate += rate_bias;
            *force += force_bias;
        }
    });
    let found = core::iter::from_fn(|| ins.take_fault());
    let found = found.filter(|fault| fault.kind == FaultKind::BiasStep);
    let found = found.collect();
    (errors, ins, found)
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// From this second on the errors are at most so many times those without a step.
fn assert_recovered(errors: &[f64], second: usize, most: f64) {
    let (clean, ..) = with_biases([Vector3::zeros(); 2]);
    let [with, without] = [errors, &clean].map(|errors| rms(&errors[second..]));
    assert!(with < most * without, "{with} {without}");
}

#[test]
fn a_step_of_the_gyroscope_is_found_and_learnt_without_aligning_again() {
    let bias = Vector3::new(0.03, -0.03, 0.026);
    let (errors, ins, found) = with_biases([bias, Vector3::zeros()]);
    let step = found.first().unwrap();
    assert_eq!(step.sensor, FaultySensor::Gyroscope);
    assert!(step.until_ns <= 84_000_000_000, "{step:?}");
    let off_ns = step.from_ns - (STEPPED_S * 1e9) as i64;
    assert!(off_ns.abs() <= 1_000_000_000, "{step:?}");
    assert!((step.size - bias.norm()).abs() < 0.02, "{step:?}");
    assert_eq!(ins.realignments(), 0);
    let state = ins.state().unwrap();
    let off = state.gyroscope_bias - bias;
    let std = state
        .covariance
        .diagonal()
        .fixed_rows::<3>(12)
        .map(f64::sqrt);
    assert!(off.component_div(&std).amax() < 2.0, "{off} {std}");
    assert!(off.norm() < 0.012, "{off}");
    assert_recovered(&errors, 88, 1.5);
}

#[test]
fn a_step_of_the_accelerometer_is_found_and_learnt() {
    let bias = Vector3::new(0.3, 0.4, 0.0);
    let (errors, ins, found) = with_biases([Vector3::zeros(), bias]);
    assert!(found.first().unwrap().until_ns <= 86_000_000_000);
    let state = ins.state().unwrap();
    assert!((state.accelerometer_bias - bias).xy().norm() < 0.1);
    assert!(state.gyroscope_bias.norm() < 0.003);
    assert_recovered(&errors, 90, 1.3);
}

#[test]
fn without_a_step_none_is_found() {
    let (_, _, found) = with_biases([Vector3::zeros(); 2]);
    assert_eq!(found, []);
}

/// Where a heading is used as it is told, what disagrees may be the heading (iron beside a magnetometer): no step is claimed, not even a true one,
/// which the heading makes known by itself.
#[test]
fn beside_a_heading_that_is_used_as_told_no_step_is_claimed() {
    let bias = Vector3::new(0.03, -0.03, 0.026);
    let stepped = |t: f64, rate: &mut Vector3<f64>, _: &mut Vector3<f64>| {
        if t >= STEPPED_S {
            *rate += bias;
        }
    };
    let (_, mut ins) = with_faults_and_headings(stepped, Some(0.05));
    let found = core::iter::from_fn(|| ins.take_fault());
    let kinds: std::vec::Vec<_> = found.map(|fault| fault.kind).collect();
    assert!(!kinds.contains(&FaultKind::BiasStep), "{kinds:?}");
    let off = ins.state().unwrap().gyroscope_bias - bias;
    assert!(off.norm() < 0.02, "{off}");
}
