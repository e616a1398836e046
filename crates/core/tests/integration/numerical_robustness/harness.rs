//! Runs a filter through sequences of garbage and checks what must hold after each operation.

use std::panic::{AssertUnwindSafe, catch_unwind};

use nalgebra::{RealField, SMatrix, UnitQuaternion};
use northing_core::Restorable;
use northing_core::kalman::Innovation;
use northing_core::kalman::covariance::is_covariance;

use super::garbage::{Garbage, number};

/// Operations of a sequence.
pub const OPERATIONS: usize = 300;
/// Sequences of each filter and precision where nothing else is said.
const SEQUENCES: u64 = 40;
/// Most violations that are described.
const DESCRIBED: usize = 5;

/// What must hold and does not.
pub type Check = Result<(), String>;

fn from_environment(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| {
        text.parse()
            .unwrap_or_else(|_| panic!("{name} must be a whole number"))
    })
}

/// Runs the sequences: each makes its filter, then operates on it and checks it, operation by operation.
pub fn run<F>(
    name: &str,
    make: impl Fn(&mut Garbage) -> F,
    operate: impl Fn(&mut F, &mut Garbage) -> Check,
    check: impl Fn(&F) -> Check,
) {
    let first = from_environment("NORTHING_FIRST_SEQUENCE", 0);
    let count = from_environment("NORTHING_SEQUENCES", SEQUENCES);
    let mut violations = Vec::new();
    for seed in first..first + count {
        let sequence = AssertUnwindSafe(|| {
            let mut garbage = Garbage::new(seed);
            let mut filter = make(&mut garbage);
            check(&filter).map_err(|what| format!("at its start, {what}"))?;
            for step in 0..OPERATIONS {
                operate(&mut filter, &mut garbage)
                    .and_then(|()| check(&filter))
                    .map_err(|what| format!("operation {step}, {what}"))?;
            }
            Ok(())
        });
        let outcome = catch_unwind(sequence).unwrap_or_else(|_| Err("panic".to_owned()));
        if let Err(what) = outcome {
            violations.push(format!("sequence {seed}, {what}"));
        }
    }
    assert!(
        violations.is_empty(),
        "{name}: {} of {count} sequences violate: {:#?}",
        violations.len(),
        &violations[..violations.len().min(DESCRIBED)]
    );
}

/// The state is one that the filter itself would continue from: all of it is checked there.
pub fn continuable<F: Restorable + Clone>(filter: &F) -> Check {
    let mut other = filter.clone();
    other.restore(filter.save()).map_err(|e| e.to_string())
}

/// Symmetric and positive semidefinite, within the square root of the rounding unit.
pub fn covariance<T: RealField + Copy, const N: usize>(what: &str, p: &SMatrix<T, N, N>) -> Check {
    if is_covariance(p, T::default_epsilon().sqrt()) {
        Ok(())
    } else {
        Err(format!("{what} is no covariance: {}", offence(p)))
    }
}

/// The standard deviations, and the correlation that is furthest from what one can be.
fn offence<T: RealField + Copy, const N: usize>(p: &SMatrix<T, N, N>) -> String {
    let std: Vec<_> = p.diagonal().iter().map(|v| v.abs().sqrt()).collect();
    let mut worst = (0, 0, T::zero());
    for (i, j) in (0..N).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let correlation = p[(i, j)] / (std[i] * std[j]);
        // What is not a number is the worst.
        let is_less = correlation.abs() <= worst.2.abs();
        if !is_less {
            worst = (i, j, correlation);
        }
    }
    format!(
        "deviations {std:?}, largest correlation {worst:?}, diagonal {:?}",
        p.diagonal()
    )
}

/// Finite and of unit length, within some hundred roundings.
pub fn unit<T: RealField + Copy>(what: &str, q: &UnitQuaternion<T>) -> Check {
    let off = (q.as_ref().norm_squared() - T::one()).abs();
    if off <= T::default_epsilon() * number(100.0) {
        Ok(())
    } else {
        Err(format!("{what} is no unit quaternion: {q:?}"))
    }
}

/// What an update returned: a record that can be plotted, whatever became of the measurement.
pub fn record<T: RealField + Copy>(what: &str, innovation: &Innovation<T>) -> Check {
    let numbers = innovation.residual.iter().chain(&innovation.covariance);
    if numbers.chain([&innovation.nis]).all(|x| x.is_finite()) && innovation.nis >= T::zero() {
        Ok(())
    } else {
        Err(format!("{what} returned {innovation:?}"))
    }
}
