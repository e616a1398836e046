//! States and covariances in another local frame: the origin of the tangent plane moves with the vehicle.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 13 (E41, E42).

use nalgebra::SMatrix;

use super::augmented_states::{AugmentedStates, GNSS_OFFSET};
use super::{ATTITUDE, NavigationState, POSITION, STATES, VELOCITY};
use crate::earth::FrameChange;
use crate::kalman::ErrorPropagation;
use crate::kalman::covariance::mirror_upper;
use crate::scalar::Scalar;

/// The errors that are vectors in north, east, down, three components each.
const VECTORS: [usize; 4] = [ATTITUDE, VELOCITY, POSITION, STATES + GNSS_OFFSET];

/// The 15 errors, and those of the augmented states behind them, seen from another frame (E42).
impl<T: Scalar, const N: usize> ErrorPropagation<T, N> for FrameChange<T> {
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>) {
        const { assert!(N >= STATES) };
        for first in VECTORS.into_iter().filter(|first| first + 3 <= N) {
            let turned = rows.fixed_rows::<3>(first).into_owned();
            for (j, column) in turned.column_iter().enumerate() {
                let turned = self.vector(&column.into_owned());
                rows.fixed_view_mut::<3, 1>(first, j).copy_from(&turned);
            }
        }
    }
}

/// The covariance of those errors in the new frame.
pub(super) fn move_covariance<T: Scalar, const N: usize>(
    covariance: &mut SMatrix<T, N, N>,
    change: &FrameChange<T>,
) {
    change.map_rows(covariance);
    covariance.transpose_mut();
    change.map_rows(covariance);
    mirror_upper(covariance);
}

impl<T: Scalar> NavigationState<T> {
    /// The same in another local frame (E41, E42). The covariance must be that of now: nothing
    /// [pending](Self::pending).
    pub fn move_origin(&mut self, change: &FrameChange<T>) {
        self.ned_from_body = change.attitude(&self.ned_from_body);
        self.velocity = change.vector(&self.velocity);
        self.position = change.position(&self.position);
        move_covariance(&mut self.covariance, change);
    }
}

impl<T: Scalar> AugmentedStates<T> {
    /// The same in another local frame (E42): the receiver's correlated error is a vector.
    pub fn move_origin(&mut self, change: &FrameChange<T>) {
        let turned = change.vector(&self.values.fixed_rows::<3>(GNSS_OFFSET).into_owned());
        self.values
            .fixed_rows_mut::<3>(GNSS_OFFSET)
            .copy_from(&turned);
        change.map_rows(&mut self.cross);
        for mut row in self.cross.row_iter_mut() {
            let turned = change.vector(&row.fixed_columns::<3>(GNSS_OFFSET).transpose());
            row.fixed_columns_mut::<3>(GNSS_OFFSET)
                .tr_copy_from(&turned);
        }
        for _ in 0..2 {
            for mut column in self.covariance.column_iter_mut() {
                let turned = change.vector(&column.fixed_rows::<3>(GNSS_OFFSET).into_owned());
                column.fixed_rows_mut::<3>(GNSS_OFFSET).copy_from(&turned);
            }
            self.covariance.transpose_mut();
        }
        mirror_upper(&mut self.covariance);
    }
}
