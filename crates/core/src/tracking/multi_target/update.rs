//! Weights of a track's detections, and the update of all its models with them.

use nalgebra::{Matrix3, Vector3};

use super::{MultiTargetConfig, Scan, Track, TrackerCounts};
use crate::kalman::innovation::{Innovation, Outcome, SkipReason};
use crate::scalar::{Scalar, lit};
use crate::tracking::association::gate::AssociationGate;
use crate::tracking::association::jipda::Association;
use crate::tracking::association::pda::PdaUpdate;
use crate::tracking::detection::{Detection, SchmidtInnovation};
use crate::tracking::imm::{Imm, Mode};

/// What a detection is under one model, or why it cannot be weighed.
fn innovation<T: Scalar>(
    detection: &Detection<T>,
    mode: &Mode<T>,
    scan: &Scan<'_, T>,
) -> Result<SchmidtInnovation<T>, SkipReason> {
    detection
        .predict(&mode.state, scan.own_ship, &scan.sensor.noise)
        .ok_or(SkipReason::Unobservable)?
        .weigh(&mode.covariance, &mode.cross, scan.own_ship)
        .ok_or(SkipReason::Numerical)
}

/// Probability that the sensor detects this target when it is visible, gate included.
fn detection_probability<T: Scalar, const M: usize>(
    track: &Track<T, M>,
    scan: &Scan<'_, T>,
    config: &MultiTargetConfig<T, M>,
) -> T {
    let gate = AssociationGate {
        sigmas: config.settings.gate_sigmas,
    };
    let x = track.estimate().state;
    let (dn, de) = (x[0] - scan.own_ship.north_m, x[2] - scan.own_ship.east_m);
    let dof = match scan.detections.first() {
        Some(Detection::Bearing { .. }) => 1,
        _ => 2,
    };
    let limit = scan.sensor.largest_range_m;
    if dn * dn + de * de > limit * limit {
        T::zero()
    } else {
        scan.sensor.detection_probability * gate.probability(dof)
    }
}

/// Clutter density in the coordinates of the measurement: square metres become metres times radians.
fn clutter<T: Scalar>(detection: &Detection<T>, scan: &Scan<'_, T>) -> T {
    match *detection {
        Detection::RangeBearing { range_m, .. } => {
            scan.sensor.clutter_density * range_m.max(T::one())
        }
        _ => scan.sensor.clutter_density,
    }
}

/// Weights of a track (J1, J2).
pub(super) fn weigh<T: Scalar, const M: usize, const D: usize>(
    track: &Track<T, M>,
    scan: &Scan<'_, T>,
    detections: &[Detection<T>],
    config: &MultiTargetConfig<T, M>,
    counts: &mut TrackerCounts,
) -> Association<T, D> {
    let gate = AssociationGate {
        sigmas: config.settings.gate_sigmas,
    };
    let pd = detection_probability(track, scan, config);
    let caused = track.existence.detection(pd);
    let silent = if scan.sensor.covers_all {
        T::one() - caused
    } else {
        T::one()
    };
    let mut weights = Association::missed(silent);
    for (weight, detection) in weights.detections.iter_mut().zip(detections) {
        if !detection.is_valid() {
            continue;
        }
        let mut likelihood = T::zero();
        let mut inside = false;
        for mode in &track.imm.modes {
            match innovation(detection, mode, scan) {
                Ok(i) => {
                    inside |= gate.contains(i.nis);
                    likelihood += mode.probability * i.likelihood;
                }
                Err(SkipReason::Unobservable) => counts.bearing_undefined += 1,
                Err(_) => counts.numerical += 1,
            }
        }
        if inside {
            *weight = caused * likelihood / clutter(detection, scan).max(lit(1e-30));
        }
    }
    weights
}

/// Updates models, existence and record of a track with the marginal probabilities of the scan.
pub(super) fn update<T: Scalar, const M: usize, const D: usize>(
    track: &mut Track<T, M>,
    scan: &Scan<'_, T>,
    detections: &[Detection<T>],
    marginal: &Association<T, D>,
    config: &MultiTargetConfig<T, M>,
) {
    let pd = detection_probability(track, scan, config);
    let pd_missed = if scan.sensor.covers_all {
        pd
    } else {
        T::zero()
    };
    track.existence.update(pd_missed, marginal.missed);
    if marginal.missed < lit(0.5) {
        track.silent_s = T::zero();
    }
    let before = track.imm;
    for mode in &mut track.imm.modes {
        mode.probability *= marginal.missed;
    }
    let mut gathered = Gathered {
        updates: [PdaUpdate::default(); M],
        best: None,
    };
    let pairs = marginal.detections.iter().zip(detections);
    for (beta, detection) in pairs.filter(|(beta, _)| **beta > T::zero()) {
        gathered.add(*beta, detection, scan, &before, &mut track.imm);
    }
    let total = (track.imm.modes.iter()).fold(T::zero(), |sum, m| sum + m.probability);
    for (mode, update) in track.imm.modes.iter_mut().zip(&gathered.updates) {
        update.apply(mode, mode.probability);
        mode.probability /= total;
    }
    track.innovation = record(gathered.best.map(|(_, i)| i));
}

/// What the detections of a scan do to each model, and the likeliest of them.
struct Gathered<T, const M: usize> {
    updates: [PdaUpdate<T>; M],
    best: Option<(T, SchmidtInnovation<T>)>,
}

impl<T: Scalar, const M: usize> Gathered<T, M> {
    /// Shares the probability `beta` of a detection among the models (M2): in proportion to how well
    /// each had predicted it.
    fn add(
        &mut self,
        beta: T,
        detection: &Detection<T>,
        scan: &Scan<'_, T>,
        before: &Imm<T, M>,
        after: &mut Imm<T, M>,
    ) {
        let seen: [Option<SchmidtInnovation<T>>; M] =
            core::array::from_fn(|m| innovation(detection, &before.modes[m], scan).ok());
        let weights: [T; M] = core::array::from_fn(|m| {
            seen[m].map_or(T::zero(), |i| before.modes[m].probability * i.likelihood)
        });
        let sum = weights.iter().fold(T::zero(), |sum, w| sum + *w);
        if sum <= T::zero() {
            return;
        }
        for (m, weighed) in seen.iter().enumerate() {
            let Some(i) = weighed else { continue };
            let share = beta * weights[m] / sum;
            after.modes[m].probability += share;
            self.updates[m].add(share, i);
            if self.best.is_none_or(|(most, _)| share > most) {
                self.best = Some((share, *i));
            }
        }
    }
}

/// The innovation record of a track's update.
fn record<T: Scalar>(best: Option<SchmidtInnovation<T>>) -> Innovation<T> {
    let Some(i) = best else {
        return Innovation::skipped(SkipReason::NotUsed);
    };
    let mut covariance = Matrix3::zeros();
    covariance
        .fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&i.covariance);
    Innovation {
        residual: Vector3::new(i.residual.x, i.residual.y, T::zero()),
        covariance,
        nis: i.nis,
        degrees_of_freedom: i.degrees_of_freedom,
        outcome: Outcome::Fused,
    }
}
