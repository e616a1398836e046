//! What a scalar measurement takes off a covariance, in place: off the lower triangle alone, as long as rows follow.

// Rows and columns are mirror images: indices say so, iterators would not.
#![allow(clippy::needless_range_loop)]

use nalgebra::SMatrix;

use super::expected::{Projected, Used};
use crate::kalman::covariance::rounding_reserve;
use crate::kalman::sparse_update::add_scaled;
use crate::navigation::STATES;
use crate::navigation::augmented_states::AugmentedStates;
use crate::scalar::{Scalar, lit};

/// Least variance of an augmented state in use.
const LEAST_SIDE_VARIANCE: f64 = 1e-14;

/// `P -= K (P H^T)^T` in the lower triangle.
#[inline]
pub(super) fn shrink<T: Scalar>(
    p: &mut SMatrix<T, STATES, STATES>,
    ph: &Projected<T>,
    gain: &Projected<T>,
) {
    let columns = &mut p.data.0;
    macro_rules! each_column {
        ($($j:literal)*) => {$(shrink_column::<T, $j>(&mut columns[$j], ph, gain);)*};
    }
    each_column!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14);
}

/// The same in column `J`: as many loops as columns, each of a length that the compiler knows.
#[inline]
fn shrink_column<T: Scalar, const J: usize>(
    column: &mut [T; STATES],
    ph: &Projected<T>,
    gain: &Projected<T>,
) {
    for i in J..STATES {
        column[i] -= ph.error[i] * gain.error[J];
    }
    column[J] += rounding_reserve(ph.error[J] * gain.error[J]);
}

/// The lower triangle mirrored into the upper.
#[inline]
pub(super) fn mirror_lower<T: Scalar>(p: &mut SMatrix<T, STATES, STATES>) {
    let columns = &mut p.data.0;
    for j in 1..STATES {
        for i in 0..j {
            columns[j][i] = columns[i][j];
        }
    }
}

/// A column of a symmetric matrix of which the lower triangle is kept up.
#[inline]
pub(super) fn column_of_lower<T: Scalar>(
    p: &SMatrix<T, STATES, STATES>,
    state: usize,
) -> [T; STATES] {
    let columns = &p.data.0;
    let mut column = columns.get(state).copied().unwrap_or([T::zero(); STATES]);
    for (value, column) in column.iter_mut().zip(columns).take(state) {
        *value = column.get(state).copied().unwrap_or_else(T::zero);
    }
    column
}

/// The same for the augmented states in use: their covariance with the errors, and their own.
pub(super) fn shrink_side<T: Scalar>(
    side: &mut AugmentedStates<T>,
    used: Used,
    ph: &Projected<T>,
    gain: &Projected<T>,
) {
    let columns = side.cross.data.0.iter_mut();
    for ((column, gain), used) in columns.zip(&gain.side).zip(used.each) {
        if used {
            add_scaled(column, &ph.error, -*gain);
        }
    }
    for (j, (gain, used)) in gain.side.iter().zip(used.each).enumerate() {
        if !used {
            continue;
        }
        for (i, ph) in ph.side.iter().enumerate().take(j + 1) {
            let Some(element) = side.covariance.get_mut((i, j)) else {
                continue;
            };
            *element -= *ph * *gain;
            let value = *element;
            if let Some(image) = side.covariance.get_mut((j, i)) {
                *image = value;
            }
        }
        // An augmented state does not go out of use by being known well.
        if let Some(variance) = side.covariance.get_mut((j, j)) {
            let removed = ph.side.get(j).map_or_else(T::zero, |ph| *ph * *gain);
            *variance += rounding_reserve(removed);
            *variance = variance.max(lit(LEAST_SIDE_VARIANCE));
        }
    }
}

/// `factor * column`; a factor of one, which most rows begin with, is free.
#[inline(always)]
pub(super) fn scaled<T: Scalar, const N: usize>(column: &[T; N], factor: T) -> [T; N] {
    if factor == T::one() {
        *column
    } else {
        column.map(|value| value * factor)
    }
}
