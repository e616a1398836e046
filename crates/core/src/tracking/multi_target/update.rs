//! Weights of a track's detections, and the update of all its models with them.

use nalgebra::{Matrix3, Vector3};

use super::{MultiTargetConfig, Scan, Track, TrackerCounts};
use crate::kalman::innovation::{Innovation, Outcome, SkipReason};
use crate::scalar::{Scalar, lit};
use crate::tracking::association::candidates::Association;
use crate::tracking::association::gate::AssociationGate;
use crate::tracking::association::pda::PdaUpdate;
use crate::tracking::detection::{Detection, DetectionKind, SchmidtInnovation};
use crate::tracking::echo::Echo;
use crate::tracking::expected_detection::ExpectedDetection;
use crate::tracking::imm::Imm;

/// A detection is surely a target's own with this probability.
const SURE: f64 = 0.9;

/// What the scan should show of the target under each model, for one kind of detection at a time: nearly all scans have one.
struct Expectations<'a, T, const M: usize> {
    imm: &'a Imm<T, M>,
    scan: &'a Scan<'a, T>,
    echo: &'a Echo<T>,
    kind: Option<DetectionKind>,
    models: [Result<ExpectedDetection<T>, SkipReason>; M],
}

impl<'a, T: Scalar, const M: usize> Expectations<'a, T, M> {
    fn new(imm: &'a Imm<T, M>, (scan, echo): (&'a Scan<'a, T>, &'a Echo<T>)) -> Self {
        Self {
            imm,
            scan,
            echo,
            kind: None,
            models: [Err(SkipReason::NotUsed); M],
        }
    }

    /// Of each model, or why one has none.
    fn of(&mut self, detection: &Detection<T>) -> &[Result<ExpectedDetection<T>, SkipReason>; M] {
        let kind = detection.kind();
        if self.kind != Some(kind) {
            self.kind = Some(kind);
            self.models = core::array::from_fn(|m| {
                ExpectedDetection::new(kind, &self.imm.modes[m], self.scan, self.echo)
            });
        }
        &self.models
    }
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
            scan.sensor.clutter_density * range_m.max(scan.sensor.noise.range_std_m)
        }
        _ => scan.sensor.clutter_density,
    }
}

/// Weights of a track (J1, J2).
pub(super) fn weigh<T: Scalar, const M: usize, const D: usize>(
    track: &Track<T, M>,
    (scan, echo): (&Scan<'_, T>, &Echo<T>),
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
    let mut expectations = Expectations::new(&track.imm, (scan, echo));
    for (index, detection) in (0..).zip(scan.detections) {
        if !detection.is_valid() {
            continue;
        }
        let models = expectations.of(detection);
        let Some(likelihood) = likelihood(detection, &track.imm, models, &gate, counts) else {
            continue;
        };
        let weight = caused * likelihood / clutter(detection, scan).max(lit(1e-30));
        let room = weights.add(index, weight);
        counts.detections_beyond_capacity += u64::from(!room);
    }
    weights
}

/// Density of a detection over all models; `None` outside the gates of all.
fn likelihood<T: Scalar, const M: usize>(
    detection: &Detection<T>,
    imm: &Imm<T, M>,
    models: &[Result<ExpectedDetection<T>, SkipReason>; M],
    gate: &AssociationGate<T>,
    counts: &mut TrackerCounts,
) -> Option<T> {
    let mut possible = models.iter().flatten();
    if models.iter().all(Result::is_ok) && !possible.any(|m| m.can_contain(detection, gate)) {
        return None;
    }
    let mut likelihood = T::zero();
    let mut inside = false;
    for (mode, expected) in imm.modes.iter().zip(models) {
        match expected.and_then(|expected| expected.weigh(detection)) {
            Ok((nis, density)) => {
                inside |= gate.contains(nis);
                likelihood += mode.probability * density;
            }
            Err(SkipReason::Unobservable) => counts.bearing_undefined += 1,
            Err(_) => counts.numerical += 1,
        }
    }
    inside.then_some(likelihood)
}

/// Updates models, existence and record of a track with the marginal probabilities of the scan; what it was probably updated with.
pub(super) fn update<T: Scalar, const M: usize, const D: usize>(
    track: &mut Track<T, M>,
    (scan, echo): (&Scan<'_, T>, &Echo<T>),
    marginal: &Association<T, D>,
    config: &MultiTargetConfig<T, M>,
) -> Option<Likeliest<T>> {
    let pd = detection_probability(track, scan, config);
    let pd_missed = if scan.sensor.covers_all {
        pd
    } else {
        T::zero()
    };
    track.existence.update(pd_missed, marginal.missed);
    if marginal.is_seen() {
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
    let mut expectations = Expectations::new(&before, (scan, echo));
    for candidate in marginal.candidates() {
        let Some(detection) = scan.detections.get(candidate.detection as usize) else {
            continue;
        };
        if candidate.weight > T::zero() {
            let models = expectations.of(detection);
            gathered.add(candidate.weight, detection, models, &before, &mut track.imm);
        }
    }
    let total = (track.imm.modes.iter()).fold(T::zero(), |sum, m| sum + m.probability);
    for (mode, update) in track.imm.modes.iter_mut().zip(&gathered.updates) {
        update.apply(mode, mode.probability);
        mode.probability /= total;
    }
    track.learn_manoeuvres(config, &before);
    track.innovation = record(gathered.best.as_ref().map(|best| best.innovation));
    gathered.best
}

/// What the detections of a scan do to each model, and the likeliest of them.
struct Gathered<T, const M: usize> {
    updates: [PdaUpdate<T>; M],
    best: Option<Likeliest<T>>,
}

/// The likeliest detection under the likeliest model.
pub(super) struct Likeliest<T> {
    /// Its share of all that the track was updated with.
    share: T,
    /// Probability that the target caused it.
    probability: T,
    detection: Detection<T>,
    innovation: SchmidtInnovation<T>,
}

impl<T: Scalar> Likeliest<T> {
    /// It, if it is surely that of the target.
    pub(super) fn surely(&self) -> Option<(&Detection<T>, &SchmidtInnovation<T>)> {
        (self.probability > lit(SURE)).then_some((&self.detection, &self.innovation))
    }
}

impl<T: Scalar, const M: usize> Gathered<T, M> {
    /// Shares the probability `beta` of a detection among the models (M2): in proportion to how well
    /// each had predicted it.
    fn add(
        &mut self,
        beta: T,
        detection: &Detection<T>,
        models: &[Result<ExpectedDetection<T>, SkipReason>; M],
        before: &Imm<T, M>,
        after: &mut Imm<T, M>,
    ) {
        let seen: [Option<SchmidtInnovation<T>>; M] = core::array::from_fn(|m| {
            let expected = models[m].as_ref().ok()?;
            expected.innovation(detection)
        });
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
            if self.best.as_ref().is_none_or(|best| share > best.share) {
                self.best = Some(Likeliest {
                    share,
                    probability: beta,
                    detection: *detection,
                    innovation: *i,
                });
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
