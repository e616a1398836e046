//! Augmented states: those beside the 15 errors that only some measurements see: a receiver's correlated position error and time
//! offset, a barometer's offset, the angles at which a unit is mounted in its vehicle, the iron around a magnetometer.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 7 (E14, E15).
//!
//! None of them drives the 15 errors and none is driven by them, so the joint covariance is the filter's own,
//! the block between (`cross`), and a small one here; each propagates by itself. An augmented state of variance zero
//! is not in use: it costs next to nothing and nothing changes it.
//!
//! Cost: 60 multiplications a catch-up for each state in use, 30 an update.

use nalgebra::{SMatrix, SVector, Vector3};

use super::{ErrorTransition, STATES};
use crate::kalman::ErrorPropagation;
use crate::kalman::feedback::reset_rows;
use crate::restorable::{InvalidState, covariance, finite};
use crate::scalar::Scalar;

/// Number of augmented states.
pub const AUGMENTED_STATES: usize = 10;
/// First of the three correlated errors of the receiver's positions (m, NED).
pub const GNSS_OFFSET: usize = 0;
/// How much later than its stamp says, less the latency of the settings, a fix is valid for (s): positive is late.
pub const TIME_OFFSET: usize = 3;
/// What the barometer's height is too high by (m).
pub const BAROMETER_OFFSET: usize = 4;
/// Pitch and yaw of the vehicle's axes as seen from the unit (rad).
pub const MOUNT_PITCH: usize = 5;
/// See [`MOUNT_PITCH`].
pub const MOUNT_YAW: usize = 6;
/// First of the three components of what the iron around a magnetometer adds to the field (microtesla, body axes).
pub const MAGNETIC_OFFSET: usize = 7;

/// Values and covariance of the augmented states.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AugmentedStates<T: Scalar> {
    /// Their estimates.
    pub values: SVector<T, AUGMENTED_STATES>,
    /// Covariance of the filter's errors with theirs.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub cross: SMatrix<T, STATES, AUGMENTED_STATES>,
    /// Their covariance.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: SMatrix<T, AUGMENTED_STATES, AUGMENTED_STATES>,
}

/// How an augmented state goes on over an interval: it shrinks by `decay` and `added` comes to its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AugmentedStep<T> {
    pub(super) decay: [T; AUGMENTED_STATES],
    pub(super) added: [T; AUGMENTED_STATES],
}

impl<T: Scalar> Default for AugmentedStates<T> {
    /// None is in use.
    fn default() -> Self {
        Self {
            values: SVector::zeros(),
            cross: SMatrix::zeros(),
            covariance: SMatrix::zeros(),
        }
    }
}

impl<T: Scalar> AugmentedStates<T> {
    /// Whether an augmented state is in use.
    #[inline]
    pub fn is_used(&self, state: usize) -> bool {
        self.covariance
            .get((state, state))
            .is_some_and(|variance| *variance > T::zero())
    }

    /// Starts one anew: correlated with nothing.
    pub fn start(&mut self, state: usize, value: T, variance: T) {
        if state >= AUGMENTED_STATES {
            return;
        }
        self.values[state] = value;
        self.cross.column_mut(state).fill(T::zero());
        self.covariance.column_mut(state).fill(T::zero());
        self.covariance.row_mut(state).fill(T::zero());
        self.covariance[(state, state)] = variance;
    }

    /// Whether every number is finite and no variance negative.
    pub fn is_usable(&self) -> bool {
        self.values.norm_squared().is_finite()
            && self.cross.norm_squared().is_finite()
            && self.covariance.norm_squared().is_finite()
            && self.covariance.diagonal().iter().all(|v| *v >= T::zero())
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        finite("augmented states", &self.values)?;
        finite("cross-covariance", &self.cross)?;
        covariance("covariance of the augmented states", &self.covariance)
    }

    /// Goes on over an interval (E14).
    pub(super) fn propagate(&mut self, transition: &ErrorTransition<T>, step: &AugmentedStep<T>) {
        for j in 0..AUGMENTED_STATES {
            if !self.is_used(j) {
                continue;
            }
            let mut column = SMatrix::<T, STATES, 1>::zeros();
            column.copy_from(&self.cross.column(j));
            transition.map_rows(&mut column);
            self.cross.set_column(j, &(column * step.decay[j]));
            self.values[j] *= step.decay[j];
        }
        for j in 0..AUGMENTED_STATES {
            for i in 0..AUGMENTED_STATES {
                self.covariance[(i, j)] *= step.decay[i] * step.decay[j];
            }
        }
        for j in 0..AUGMENTED_STATES {
            self.covariance[(j, j)] += step.added[j];
        }
    }

    /// Re-centres the cross-covariance at a corrected attitude (E12).
    pub(super) fn reset(&mut self, angle: &Vector3<T>) {
        reset_rows(&mut self.cross, angle);
    }
}
