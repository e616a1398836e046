//! A jump of the gyroscope's bias, from everything that gravity and the field say of turns.
//!
//! The residuals of the pairs are explained by a bias that is one before an instant and another after it; the instant
//! where that explains most is taken. Rests are not needed.
//!
//! A vehicle that speeds up and brakes leaves residuals that look like another bias for as long as it does. A bias that jumped is the
//! same in both halves of the time before and of the time after; where the halves differ by more than chance, the jump counts for
//! less by as much.

use nalgebra::{Matrix3, Vector3};

use super::pairs::Pair;

/// A pair: what its residual says of the bias.
#[derive(Debug, Clone, Copy)]
pub(super) struct Witness {
    pub(super) then_ns: i64,
    pub(super) now_ns: i64,
    information: Matrix3<f64>,
    weighted: Vector3<f64>,
}

impl Witness {
    pub(super) fn of(pair: &Pair, residual: &Vector3<f64>, variance: f64) -> Self {
        let design = pair.by_bias();
        Self {
            then_ns: pair.then_ns,
            now_ns: pair.now_ns,
            information: design.transpose() * design / variance,
            weighted: design.transpose() * residual / variance,
        }
    }
}

/// A bias that jumped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasJump {
    /// The last moment before, and the first after, ns.
    pub between_ns: [i64; 2],
    /// By how much, rad/s.
    pub rad_s: f64,
    /// One standard deviation of that.
    pub std_rad_s: f64,
    /// In standard deviations, all axes together; those of the halves' differences where they are larger.
    pub sigmas: f64,
}

/// Witnesses on each side of a jump at least.
const FEWEST: usize = 4;
/// What a bias may be before anything is known, rad/s.
const PRIOR_STD: f64 = 0.03;

/// Information, and what it is the information of.
fn sum(of: &[Witness]) -> (Matrix3<f64>, Vector3<f64>) {
    of.iter()
        .fold((Matrix3::zeros(), Vector3::zeros()), |sum, w| {
            (sum.0 + w.information, sum.1 + w.weighted)
        })
}

/// By how much the biases of both halves differ more than chance, in standard deviations of an axis; 1 or more.
fn unsteadiness(witnesses: &[Witness]) -> f64 {
    let prior = Matrix3::identity() * PRIOR_STD.powi(-2);
    let (first, second) = witnesses.split_at(witnesses.len() / 2);
    let square = || {
        let [(p, u), (q, v)] = [sum(first), sum(second)];
        let (p, q) = ((p + prior).try_inverse()?, (q + prior).try_inverse()?);
        let apart = q * v - p * u;
        Some(apart.dot(&((p + q).try_inverse()? * apart)))
    };
    (square().unwrap_or(0.0) / 3.0).sqrt().max(1.0)
}

/// The jump that explains most.
pub(super) fn largest_jump(mut witnesses: Vec<Witness>) -> Option<BiasJump> {
    witnesses.sort_by_key(|witness| witness.now_ns);
    let (all, all_weighted) = sum(&witnesses);
    let prior = Matrix3::identity() * PRIOR_STD.powi(-2);
    let (mut before, mut before_weighted) = (Matrix3::zeros(), Vector3::zeros());
    let mut best: Option<(usize, BiasJump)> = None;
    for at in 0..witnesses.len().saturating_sub(FEWEST) {
        before += witnesses[at].information;
        before_weighted += witnesses[at].weighted;
        if at + 1 < FEWEST {
            continue;
        }
        let first = (before + prior).try_inverse()?;
        let second = (all - before + prior).try_inverse()?;
        let jump = second * (all_weighted - before_weighted) - first * before_weighted;
        let covariance = first + second;
        let square = jump.dot(&(covariance.try_inverse()? * jump));
        let sigmas = square.max(0.0).sqrt();
        if best.is_none_or(|(_, best)| sigmas > best.sigmas) {
            let along = jump.try_normalize(1e-12).unwrap_or_else(Vector3::x);
            let jump = BiasJump {
                between_ns: [witnesses[at].then_ns, witnesses[at + 1].now_ns],
                rad_s: jump.norm(),
                std_rad_s: along.dot(&(covariance * along)).max(0.0).sqrt(),
                sigmas,
            };
            best = Some((at, jump));
        }
    }
    let (at, jump) = best?;
    let (before, after) = witnesses.split_at(at + 1);
    let unsteady = unsteadiness(before).max(unsteadiness(after));
    Some(BiasJump {
        std_rad_s: jump.std_rad_s * unsteady,
        sigmas: jump.sigmas / unsteady,
        ..jump
    })
}
