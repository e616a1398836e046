//! Biases that step while the filter goes on alone: a generalised likelihood ratio over the fixes of the last seconds.
//!
//! *Read first:* `docs/derivations/faults.md`, section 8 (F20-F22); Willsky and Jones, "A generalized likelihood ratio approach to the
//! detection and estimation of jumps in linear systems" (1976).
//!
//! At each of the last fixes one of the biases may have stepped, or the fixes may have jumped. What such a change makes of the
//! errors is followed through all that the filter does to them, and what it makes of the innovations is fitted to them.
//!
//! Cost: 225 multiplications an instant for each row that is fused.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::{ERRORS, ErrorListener, GnssIns, GnssPositionUpdate};
use crate::faults::{Fault, FaultKind, FaultySensor};
use crate::kalman::feedback::reset_rows;
use crate::kalman::{ErrorPropagation, Innovation, ScalarCorrection};
use crate::navigation::error_state::sparse::Row;
use crate::navigation::in_motion_alignment::bias_step::{LEAST_GAIN, STEP};
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION};
use crate::scalar::{Scalar, lit};

/// A change may have begun at one of so many fixes.
const INSTANTS: usize = 6;
/// Fixes behind a step before another one is looked for: what steps again and again is no bias.
const PAUSE: u8 = 60;
/// Variance of a time within half an interval of an instant, as a share of the squared interval.
const WHEN: f64 = 1.0 / 12.0;
/// Less likely by so much than the likeliest counts as none.
const LEAST_WEIGHT: f64 = 1e-6;
/// Log evidence by which a step must explain more than one fix that is off.
const MORE_THAN_ONE: f64 = 4.0;
/// A step that has turned the attitude further (rad) is for the alignment: one linearisation says nothing of it.
const LARGEST_TURN: f64 = 0.7;
/// What may change: the first of three states each.
const CHANGES: [usize; 3] = [GYROSCOPE_BIAS, ACCELEROMETER_BIAS, POSITION];
/// The sensors of the first two of them.
const SENSORS: [FaultySensor; 2] = [FaultySensor::Gyroscope, FaultySensor::Accelerometer];
/// Which of them is a jump of the fixes: as seen from there, one of the position.
const JUMP: usize = 2;

/// What a change since an instant makes of errors and innovations.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Response<T: Scalar> {
    /// Errors by unit of the change.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    rows: SMatrix<T, ERRORS, 3>,
    /// What the innovations since say of it: the inverse of its covariance, and that times it.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    information: Matrix3<T>,
    weighted: Vector3<T>,
}

/// A fix behind which something may have changed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Since<T: Scalar> {
    time_ns: i64,
    /// What the receiver's noise is multiplied by then.
    noise_scale: [T; 3],
    responses: [Response<T>; CHANGES.len()],
}

/// The instants at which something may have changed, and what would have come of it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct BiasSteps<T: Scalar> {
    /// The oldest first.
    instants: [Option<Since<T>>; INSTANTS],
    /// Fixes that are judged before the next one is looked for.
    pause: u8,
    /// The same, behind a heading of which no error is estimated.
    headed: u8,
}

impl<T: Scalar> Default for BiasSteps<T> {
    fn default() -> Self {
        Self {
            instants: [None; INSTANTS],
            pause: 0,
            headed: 0,
        }
    }
}

/// What the rows of a measurement see of each change since each instant.
type Seen<T, const M: usize> = [Option<[SMatrix<T, M, 3>; CHANGES.len()]>; INSTANTS];

/// A change of one kind since one instant, as the innovations have it.
#[derive(Debug, Clone, Copy)]
struct Fit<T: Scalar> {
    size: Vector3<T>,
    covariance: Matrix3<T>,
    /// Log evidence for it.
    gain: T,
}

/// The likeliest step, and what all changes together make of the errors, each as likely as its evidence says.
#[derive(Debug, Clone, Copy)]
struct Step<T: Scalar> {
    sensor: FaultySensor,
    since_ns: i64,
    size: T,
    /// What the receiver's noise was multiplied by before it.
    noise_scale: [T; 3],
    errors: SVector<T, ERRORS>,
    covariance: SMatrix<T, ERRORS, ERRORS>,
    /// Steps of gyroscope and accelerometer, with their variances.
    biases: [(Vector3<T>, Vector3<T>); 2],
}

impl<T: Scalar> Response<T> {
    /// Of a change that comes now.
    fn from_now(change: usize) -> Self {
        let mut rows = SMatrix::<T, ERRORS, 3>::zeros();
        rows.fixed_view_mut::<3, 3>(change, 0).fill_with_identity();
        Self {
            rows,
            information: Matrix3::zeros(),
            weighted: Vector3::zeros(),
        }
    }

    /// The change and its evidence, where its prior has a standard deviation (F21).
    fn fit(&self, std: T) -> Option<Fit<T>> {
        let variance = std * std;
        let prior = Matrix3::identity() / variance;
        let covariance = (self.information + prior).try_inverse()?;
        let size = covariance * self.weighted;
        let spread = (Matrix3::identity() + self.information * variance).determinant();
        let gain = (self.weighted.dot(&size) - spread.ln()) * lit(0.5);
        let fit = Fit {
            size,
            covariance,
            gain,
        };
        gain.is_finite().then_some(fit)
    }
}

impl<T: Scalar> BiasSteps<T> {
    /// A heading was used as it was told: what disagrees may be the heading.
    pub(super) fn headed(&mut self) {
        self.headed = INSTANTS as u8;
    }

    /// Whether what disagrees now has another reason: it does so soon after a step, or a heading is told.
    fn has_another_reason(&self) -> bool {
        self.pause > 0 || self.headed > 0
    }

    /// The fixes have gone on to disagree: if a step was taken before, it was not the reason, and the next one would not be either.
    pub(super) fn refuted(&mut self) {
        if self.pause > 0 {
            self.pause = u8::MAX;
        }
    }

    /// From now on nothing of before counts.
    pub(super) fn forget(&mut self) {
        self.instants = [None; INSTANTS];
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.instants.iter().flatten().flat_map(|since| {
            let of = since.responses.iter();
            let of = of.flat_map(|of| of.rows.iter().chain(&of.information).chain(&of.weighted));
            of.chain(&since.noise_scale)
        })
    }

    /// Something may change from now on.
    fn begin(&mut self, time_ns: i64, noise_scale: [T; 3]) {
        let full = self.instants.iter().all(Option::is_some);
        if full {
            self.instants.rotate_left(1);
        }
        let free = if full {
            self.instants.last_mut()
        } else {
            self.instants.iter_mut().find(|instant| instant.is_none())
        };
        if let Some(place) = free {
            let responses = CHANGES.map(Response::from_now);
            *place = Some(Since {
                time_ns,
                noise_scale,
                responses,
            });
        }
    }

    /// What rows see of each change: to be asked before they are fused.
    pub(super) fn seen<const M: usize>(&self, rows: &[Row<T>; M]) -> Seen<T, M> {
        let of = |response: &Response<T>| {
            SMatrix::from_fn(|i, j| rows[i].dot(response.rows.data.0[j].as_slice()))
        };
        self.instants.each_ref().map(|since| {
            since
                .as_ref()
                .map(|since| since.responses.each_ref().map(of))
        })
    }

    /// Takes the innovation of these rows, with the noise as stated, whether it was fused or left out (F21).
    pub(super) fn learn<const M: usize>(&mut self, seen: &Seen<T, M>, record: &Innovation<T>) {
        let expected = record.covariance.fixed_view::<M, M>(0, 0).into_owned();
        let residual = record.residual.fixed_rows::<M>(0).into_owned();
        let Some(weight) = expected.try_inverse() else {
            return;
        };
        let instants = self
            .instants
            .iter_mut()
            .flatten()
            .zip(seen.iter().flatten());
        for (since, seen) in instants {
            for (response, seen) in since.responses.iter_mut().zip(seen) {
                let weighted = seen.transpose() * weight;
                response.information += weighted * seen;
                response.weighted += weighted * residual;
            }
        }
    }

    /// The step that explains the innovations best, and better than fixes that jump (F22); `stds` of the priors of all changes.
    fn likeliest(&self, stds: &[T; CHANGES.len()]) -> Option<Step<T>> {
        let fits = self.instants.each_ref().map(|since| {
            let responses = since.as_ref().map(|since| &since.responses);
            core::array::from_fn(|i| responses.and_then(|of| of[i].fit(stds[i])))
        });
        let (mut best, mut jumped, mut alone) = (None, T::zero(), T::zero());
        for (k, of) in fits.iter().enumerate() {
            // One position may be off by itself: a step is seen by two.
            let seen_once = !self.instants.get(k + 1).is_some_and(Option::is_some);
            for (i, fit) in of.iter().enumerate() {
                let Some(fit) = fit else { continue };
                if i == JUMP {
                    jumped = jumped.max(fit.gain);
                    if seen_once {
                        alone = fit.gain;
                    }
                } else if !seen_once
                    && best.is_none_or(|(.., before): (_, _, Fit<T>)| fit.gain > before.gain)
                {
                    best = Some((k, i, *fit));
                }
            }
        }
        let (k, i, best) = best.filter(|(.., best)| best.gain > jumped)?;
        // Where one fix that is off would explain it nearly as well, the next fix decides.
        (best.gain > lit::<T>(LEAST_GAIN).max(alone + lit(MORE_THAN_ONE))).then_some(())?;
        let since = self.instants[k].as_ref()?;
        let mut step = Step {
            sensor: SENSORS[i],
            since_ns: since.time_ns,
            size: best.size.norm(),
            noise_scale: since.noise_scale,
            errors: since.responses[i].rows * best.size,
            covariance: SMatrix::zeros(),
            biases: [(Vector3::zeros(), Vector3::zeros()); 2],
        };
        self.merge(&mut step, &fits, best.gain);
        Some(step)
    }

    /// Makes of the likeliest step alone the mean and the covariance over all changes, by their evidence.
    fn merge(&self, step: &mut Step<T>, fits: &[[Option<Fit<T>>; 3]; INSTANTS], largest: T) {
        let mut total = T::zero();
        let mut mean = SVector::<T, ERRORS>::zeros();
        let of_all = self.instants.iter().zip(fits).enumerate();
        for (k, (since, fits)) in of_all {
            let Some(since) = since else { continue };
            let next = self.instants.get(k + 1).and_then(Option::as_ref);
            for (i, (response, fit)) in since.responses.iter().zip(fits).enumerate() {
                let weight = fit.map_or(T::zero(), |fit| (fit.gain - largest).exp());
                let (Some(fit), true) = (fit, weight > lit(LEAST_WEIGHT)) else {
                    continue;
                };
                let from_now = Response::from_now(CHANGES[i]).rows;
                let rows_of_next = next.map_or(from_now, |next| next.responses[i].rows);
                // It may have begun at any time up to half an interval from there.
                let late = (response.rows - rows_of_next) * fit.size;
                let off = response.rows * fit.size - step.errors;
                let spread = response.rows * fit.covariance * response.rows.transpose();
                total += weight;
                mean += off * weight;
                step.covariance +=
                    (spread + late * late.transpose() * lit::<T>(WHEN) + off * off.transpose())
                        * weight;
                if let Some((size, variance)) = step.biases.get_mut(i) {
                    *size += fit.size * weight;
                    *variance += fit.covariance.diagonal() * weight;
                }
            }
        }
        mean /= total;
        step.errors += mean;
        step.covariance /= total;
        step.covariance -= mean * mean.transpose();
        for (size, variance) in &mut step.biases {
            *size /= total;
            *variance /= total;
        }
    }

    fn responses(&mut self) -> impl Iterator<Item = &mut Response<T>> {
        let instants = self.instants.iter_mut().flatten();
        instants.flat_map(|instant| &mut instant.responses)
    }
}

/// It follows the errors as whoever is correlated with them does.
impl<T: Scalar> ErrorListener<T, ERRORS> for BiasSteps<T> {
    fn propagated(&mut self, transition: &impl ErrorPropagation<T, ERRORS>) {
        self.responses()
            .for_each(|of| transition.map_rows(&mut of.rows));
    }

    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, ERRORS, E>) {
        self.responses()
            .for_each(|of| correction.map_rows(&mut of.rows));
    }

    fn recentred(&mut self, angle: &Vector3<T>) {
        self.responses()
            .for_each(|of| reset_rows(&mut of.rows, angle));
    }

    fn restarted(&mut self) {
        self.forget();
    }
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Something may change behind a position that was judged.
    pub(super) fn begin_bias_step(&mut self, time_ns: i64) {
        let steps = &mut self.memory.bias_steps;
        steps.begin(time_ns, self.memory.noise_scale);
        steps.pause = steps.pause.saturating_sub(1);
        steps.headed = steps.headed.saturating_sub(1);
    }

    /// Looks for a step at a position that is off, and goes on with it. Whether there is one.
    pub(super) fn take_bias_step(&mut self, time_ns: i64, update: &GnssPositionUpdate<T>) -> bool {
        let parts = [&update.horizontal, &update.vertical];
        if self.memory.bias_steps.has_another_reason() {
            return false;
        }
        let c = &self.config;
        let prior = |std: T, drift: T| (std * std + drift * drift).sqrt() * lit(STEP);
        let off = parts.map(|part| part.residual.norm_squared());
        let stds = [
            prior(c.gyroscope_bias_std, c.gyroscope_gauss_markov_std),
            prior(c.accelerometer_bias_std, c.accelerometer_gauss_markov_std),
            (off[0] + off[1]).sqrt(),
        ];
        let Some(step) = self.memory.bias_steps.likeliest(&stds) else {
            return false;
        };
        let sizes = step.errors.norm_squared() + step.covariance.norm_squared();
        let turned = step.errors.fixed_rows::<3>(ATTITUDE).norm();
        if !(sizes.is_finite() && turned < lit(LARGEST_TURN)) {
            return false;
        }
        let side = &mut self.memory.side;
        self.filter
            .shift(side, &step.errors, &step.covariance, &mut self.listener);
        let [rate, force] = &step.biases;
        for (at_rest, (size, variance)) in self.memory.at_rest.iter_mut().zip([force, rate]) {
            at_rest.shift(size, variance);
        }
        // What was learnt of the receiver since was the step.
        self.memory.noise_scale = step.noise_scale;
        self.memory.bias_steps = BiasSteps {
            pause: PAUSE,
            headed: 0,
            instants: [None; INSTANTS],
        };
        self.memory.faults.log.happened(Fault {
            sensor: step.sensor,
            kind: FaultKind::BiasStep,
            from_ns: step.since_ns,
            until_ns: time_ns,
            is_over: true,
            size: step.size,
        });
        true
    }
}
