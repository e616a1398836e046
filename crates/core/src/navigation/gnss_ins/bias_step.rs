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
use crate::navigation::in_motion_alignment::bias_step::{LEAST_GAIN, STEP, WHEN};
use crate::navigation::{ACCELEROMETER_BIAS, GYROSCOPE_BIAS, POSITION};
use crate::scalar::{Scalar, lit};

/// A change may have begun at one of so many fixes.
const INSTANTS: usize = 6;
/// Fixes behind a step before another one is looked for: what steps again and again is no bias.
const PAUSE: u8 = 60;
/// What may change: the first of three states each.
const CHANGES: [usize; 3] = [GYROSCOPE_BIAS, ACCELEROMETER_BIAS, POSITION];
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
}

impl<T: Scalar> Default for BiasSteps<T> {
    fn default() -> Self {
        Self {
            instants: [None; INSTANTS],
            pause: 0,
        }
    }
}

/// What the rows of a measurement see of each change since each instant.
type Seen<T, const M: usize> = [Option<[SMatrix<T, M, 3>; CHANGES.len()]>; INSTANTS];

/// A step that explains the fixes.
#[derive(Debug, Clone, Copy)]
struct Step<T: Scalar> {
    sensor: FaultySensor,
    since_ns: i64,
    /// In the sensor's unit, body axes, with its covariance.
    size: Vector3<T>,
    covariance: Matrix3<T>,
    /// Log evidence for it.
    gain: T,
    /// What a unit of it has made of the errors, since its instant and since the next one.
    rows: SMatrix<T, ERRORS, 3>,
    rows_of_next: SMatrix<T, ERRORS, 3>,
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

    /// The change with its covariance, and its log evidence, where its prior has a standard deviation (F21).
    fn fit(&self, std: T) -> Option<(Vector3<T>, Matrix3<T>, T)> {
        let variance = std * std;
        let prior = Matrix3::identity() / variance;
        let covariance = (self.information + prior).try_inverse()?;
        let size = covariance * self.weighted;
        let spread = (Matrix3::identity() + self.information * variance).determinant();
        let gain = (self.weighted.dot(&size) - spread.ln()) * lit(0.5);
        gain.is_finite().then_some((size, covariance, gain))
    }
}

impl<T: Scalar> BiasSteps<T> {
    /// From now on nothing of before counts.
    pub(super) fn forget(&mut self) {
        self.instants = [None; INSTANTS];
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let responses = self.instants.iter().flatten();
        let responses = responses.flat_map(|instant| &instant.responses);
        responses.flat_map(|of| of.rows.iter().chain(&of.information).chain(&of.weighted))
    }

    /// Something may change from now on.
    fn begin(&mut self, time_ns: i64) {
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
            *place = Some(Since { time_ns, responses });
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

    /// The step that explains the innovations best, and better than fixes that jump by about `jump` (F22).
    fn likeliest(&self, stds: [T; 2], jump: T) -> Option<Step<T>> {
        let mut best: Option<Step<T>> = None;
        let mut jumped = T::zero();
        for (k, since) in self.instants.iter().enumerate() {
            let Some(since) = since else {
                continue;
            };
            let next = self.instants.get(k + 1).and_then(Option::as_ref);
            for (i, response) in since.responses.iter().enumerate() {
                let Some((size, covariance, gain)) =
                    response.fit(stds.get(i).copied().unwrap_or(jump))
                else {
                    continue;
                };
                if i == JUMP {
                    jumped = jumped.max(gain);
                } else if best.as_ref().is_none_or(|best| gain > best.gain) {
                    let from_now = Response::from_now(CHANGES[i]).rows;
                    best = Some(Step {
                        sensor: [FaultySensor::Gyroscope, FaultySensor::Accelerometer][i],
                        since_ns: since.time_ns,
                        size,
                        covariance,
                        gain,
                        rows: response.rows,
                        rows_of_next: next.map_or(from_now, |next| next.responses[i].rows),
                    });
                }
            }
        }
        best.filter(|best| best.gain > jumped && best.gain > lit(LEAST_GAIN))
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

impl<T: Scalar> Step<T> {
    /// What it has made of the errors, and what they may have beside it: the covariance of the step, and that it may have begun at
    /// any time up to the next instant.
    fn errors(&self) -> (SVector<T, ERRORS>, SMatrix<T, ERRORS, ERRORS>) {
        let late = (self.rows - self.rows_of_next) * self.size;
        let spread = self.rows * self.covariance * self.rows.transpose();
        let when = late * late.transpose() * lit::<T>(WHEN);
        (self.rows * self.size, spread + when)
    }
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Something may change behind a position that was judged.
    pub(super) fn begin_bias_step(&mut self, time_ns: i64) {
        let steps = &mut self.memory.bias_steps;
        steps.begin(time_ns);
        steps.pause = steps.pause.saturating_sub(1);
    }

    /// Looks for a step at a position that is off, and goes on with it. Whether there is one.
    pub(super) fn take_bias_step(&mut self, time_ns: i64, update: &GnssPositionUpdate<T>) -> bool {
        // Who does not agree after a step has another reason, and aligns again.
        if self.memory.bias_steps.pause > 0 {
            return false;
        }
        let c = &self.config;
        let prior = |std: T, drift: T| (std * std + drift * drift).sqrt() * lit(STEP);
        let stds = [
            prior(c.gyroscope_bias_std, c.gyroscope_gauss_markov_std),
            prior(c.accelerometer_bias_std, c.accelerometer_gauss_markov_std),
        ];
        let parts = [&update.horizontal, &update.vertical];
        let off = parts.map(|part| part.residual.norm_squared());
        let jump = (off[0] + off[1]).sqrt();
        let Some(step) = self.memory.bias_steps.likeliest(stds, jump) else {
            return false;
        };
        let (errors, covariance) = step.errors();
        if !(errors.norm_squared().is_finite() && covariance.norm_squared().is_finite()) {
            return false;
        }
        let side = &mut self.memory.side;
        self.filter
            .shift(side, &errors, &covariance, &mut self.listener);
        let sensor = usize::from(step.sensor == FaultySensor::Gyroscope);
        self.memory.at_rest[sensor].shift(&step.size, &step.covariance);
        self.memory.bias_steps = BiasSteps {
            pause: PAUSE,
            ..BiasSteps::default()
        };
        self.memory.faults.log.happened(Fault {
            sensor: step.sensor,
            kind: FaultKind::BiasStep,
            from_ns: step.since_ns,
            until_ns: time_ns,
            is_over: true,
            size: step.size.norm(),
        });
        true
    }
}
