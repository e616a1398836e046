//! What a measurement of few states is expected to be off by: projections, their covariance, its factors, the NIS.

use nalgebra::{SMatrix, SVector};

use super::shrink::scaled;
use super::{Row, SIDE, SparseMeasurement};
use crate::kalman::covariance::resolvable_variance;
use crate::kalman::sparse_update::add_scaled;
use crate::navigation::augmented_states::{AUGMENTED_STATES, AugmentedStates};
use crate::navigation::{ERRORS, STATES};
use crate::scalar::Scalar;

/// `P H^T` for one row, or a gain, or a correction: over the errors and the augmented states.
#[derive(Clone, Copy)]
pub(super) struct Projected<T: Scalar> {
    pub(super) error: [T; STATES],
    pub(super) side: [T; AUGMENTED_STATES],
}

impl<T: Scalar> Projected<T> {
    pub(super) fn zeros() -> Self {
        Self {
            error: [T::zero(); STATES],
            side: [T::zero(); AUGMENTED_STATES],
        }
    }

    /// Of a row; augmented states that are not `used` cost nothing.
    pub(super) fn of(
        row: &Row<T>,
        p: &SMatrix<T, STATES, STATES>,
        side: &AugmentedStates<T>,
        used: Used,
    ) -> Self {
        let mut projected = Self::zeros();
        for (n, (state, h)) in row.elements().iter().enumerate() {
            if let Some(column) = p.data.0.get(*state) {
                if n == 0 {
                    projected.error = scaled(column, *h);
                } else {
                    add_scaled(&mut projected.error, column, *h);
                }
                for (j, sum) in used.of(&mut projected.side) {
                    let cross = side.cross.get((*state, j));
                    *sum += *h * cross.copied().unwrap_or_else(T::zero);
                }
            } else if let Some((cross, own)) = used.columns(side, *state) {
                add_scaled(&mut projected.error, cross, *h);
                add_scaled(&mut projected.side, own, *h);
            }
        }
        projected
    }

    /// `H (P H^T)`, or `H x` for a correction.
    pub(super) fn dot(&self, row: &Row<T>) -> T {
        let value = |state: usize| match self.error.get(state) {
            Some(value) => *value,
            None => self.side.get(state - SIDE).copied().unwrap_or_else(T::zero),
        };
        let products = row.elements().iter().map(|(state, h)| *h * value(*state));
        products
            .reduce(|sum, product| sum + product)
            .unwrap_or_else(T::zero)
    }

    /// Both in one.
    pub(super) fn joint(&self) -> SVector<T, ERRORS> {
        let mut joint = SVector::<T, ERRORS>::zeros();
        let parts = self.error.iter().chain(&self.side);
        joint
            .iter_mut()
            .zip(parts)
            .for_each(|(out, value)| *out = *value);
        joint
    }

    /// `factor self`.
    pub(super) fn times(&self, factor: T, used: Used) -> Self {
        let mut product = *self;
        product.error = self.error.map(|value| value * factor);
        if used.any {
            product.side = self.side.map(|value| value * factor);
        }
        product
    }

    /// `self += factor other`.
    pub(super) fn add_scaled(&mut self, other: &Self, factor: T, used: Used) {
        add_scaled(&mut self.error, &other.error, factor);
        if used.any {
            add_scaled(&mut self.side, &other.side, factor);
        }
    }
}

/// Which augmented states are in use.
#[derive(Clone, Copy)]
pub(super) struct Used {
    pub(super) each: [bool; AUGMENTED_STATES],
    pub(super) any: bool,
}

impl Used {
    pub(super) fn of_states<T: Scalar>(side: &AugmentedStates<T>) -> Self {
        let each = core::array::from_fn(|j| side.is_used(j));
        let any = each.contains(&true);
        Self { each, any }
    }

    /// The elements that belong to states in use.
    fn of<T>(self, elements: &mut [T; AUGMENTED_STATES]) -> impl Iterator<Item = (usize, &mut T)> {
        let all = elements.iter_mut().enumerate();
        all.take(if self.any { AUGMENTED_STATES } else { 0 })
            .filter(move |(j, _)| self.each.get(*j).is_some_and(|used| *used))
    }

    /// Covariance of the errors and of the augmented states with the augmented state at place `state` of a row.
    fn columns<T: Scalar>(
        self,
        side: &AugmentedStates<T>,
        state: usize,
    ) -> Option<(&[T; STATES], &[T; AUGMENTED_STATES])> {
        let j = state.checked_sub(SIDE)?;
        let used = self.each.get(j).is_some_and(|used| *used);
        let columns = side.cross.data.0.get(j).zip(side.covariance.data.0.get(j));
        columns.filter(|_| used)
    }
}

/// What a measurement is expected to be off by, and what it then tells.
pub(super) struct Expected<T: Scalar, const M: usize> {
    /// `S = H P H^T + R`.
    pub(super) covariance: SMatrix<T, M, M>,
    /// The residual's normalised square.
    pub(super) nis: T,
    /// What is known of each row when those before it are.
    pub(super) rows: [Known<T, M>; M],
}

/// A row after those before it.
#[derive(Clone, Copy)]
pub(super) struct Known<T: Scalar, const M: usize> {
    /// `P H^T` of the row, before any of them.
    pub(super) projected: Projected<T>,
    /// Row of `L` in `S = L D L^T`: how much of each row before it is in this one.
    pub(super) factor: [T; M],
    /// The same unscaled: row of `L D`.
    scaled: [T; M],
    /// The inverse of its element of `D`.
    pub(super) weight: T,
    /// Its element of `L^-1` times the residual.
    pub(super) residual: T,
}

impl<T: Scalar, const M: usize> Expected<T, M> {
    /// (E15); `None` when the covariance of the residual is none, or the residual not finite.
    pub(super) fn of(
        p: &SMatrix<T, STATES, STATES>,
        side: &AugmentedStates<T>,
        used: Used,
        measurement: &SparseMeasurement<T, M>,
    ) -> Option<Self> {
        let mut covariance = [[T::zero(); M]; M];
        let mut nis = T::zero();
        let mut rows = measurement.rows.each_ref().map(|row| Known {
            projected: Projected::of(row, p, side, used),
            factor: [T::zero(); M],
            scaled: [T::zero(); M],
            weight: T::zero(),
            residual: T::zero(),
        });
        let measured = measurement.rows.iter().zip(measurement.residual.iter());
        for (i, ((row, residual), variance)) in
            measured.zip(measurement.variance.iter()).enumerate()
        {
            let (before, rest) = rows.split_at_mut_checked(i)?;
            let known = rest.first_mut()?;
            let elements = covariance.get_mut(i)?;
            let spread = spread(row, p, side);
            let own = known.projected.dot(row) + resolvable_variance(*variance, spread)?;
            *elements.get_mut(i)? = own;
            known.residual = *residual;
            let mut d = own;
            for (k, before) in before.iter().enumerate() {
                let element = before.projected.dot(row);
                *elements.get_mut(k)? = element;
                let already = known.factor.iter().zip(&before.scaled).take(k);
                let scaled = already.fold(element, |rest, (l, s)| rest - *l * *s);
                let l = scaled * before.weight;
                *known.scaled.get_mut(k)? = scaled;
                *known.factor.get_mut(k)? = l;
                d -= l * scaled;
                known.residual -= l * before.residual;
            }
            if !(*variance > T::zero() && d > T::zero() && d.is_finite()) {
                return None;
            }
            known.weight = T::one() / d;
            nis += known.residual * known.residual * known.weight;
        }
        nis.is_finite().then_some(Self {
            covariance: symmetric(&covariance),
            nis,
            rows,
        })
    }
}

/// Sum of the squares of a row's elements times the variances they see.
fn spread<T: Scalar>(row: &Row<T>, p: &SMatrix<T, STATES, STATES>, side: &AugmentedStates<T>) -> T {
    row.elements().iter().fold(T::zero(), |sum, (state, h)| {
        let variance = match state.checked_sub(SIDE) {
            None => p.get((*state, *state)),
            Some(j) => side.covariance.get((j, j)),
        };
        sum + *h * *h * variance.copied().unwrap_or_else(T::zero)
    })
}

/// The symmetric matrix whose lower triangle is given by rows.
fn symmetric<T: Scalar, const M: usize>(rows: &[[T; M]; M]) -> SMatrix<T, M, M> {
    SMatrix::from_fn(|i, j| {
        let row = rows.get(i.max(j));
        let element = row.and_then(|row| row.get(i.min(j)));
        element.copied().unwrap_or_else(T::zero)
    })
}
