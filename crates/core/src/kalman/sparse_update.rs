//! Kalman updates with rows of few elements, on the first states of a large covariance.
//!
//! For filters with many states of which a measurement sees few, and some of which are not in use.
//! Several rows are fused jointly: `S = H P H^T + R` is factored as `L L^T`, and the columns of
//! `W = P H^T L^-T` give correction and covariance, `x += W L^-1 nu`, `P -= W W^T`. With diagonal
//! `R` that is exactly the sequence of scalar updates, with one projection instead of one for each.
//! The covariance must be symmetric, and stays so to the bit: both halves are the same products.

use nalgebra::{SMatrix, SVector};

use super::covariance::{cholesky, resolvable_variance, rounding_reserve};
use crate::scalar::Scalar;

/// Most elements of a row, if nothing else is said: three of an attitude, three of an offset.
pub const MOST_ELEMENTS: usize = 6;

/// A measurement row of up to `E` elements: pairs of state and element; everything else is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SparseRow<T, const E: usize = MOST_ELEMENTS> {
    elements: [(usize, T); E],
    len: usize,
}

impl<T: Scalar, const E: usize> Default for SparseRow<T, E> {
    fn default() -> Self {
        let elements = [(0, T::zero()); E];
        Self { elements, len: 0 }
    }
}

impl<T: Scalar, const E: usize> SparseRow<T, E> {
    /// The row that sees one state as it is.
    #[inline]
    pub fn of_state(state: usize) -> Self {
        Self::default().with(state, T::one())
    }

    /// With one more element; beyond `E` there is none, and a zero is none.
    #[inline]
    #[must_use]
    pub fn with(mut self, state: usize, h: T) -> Self {
        if h.is_zero() {
            return self;
        }
        if let Some(place) = self.elements.get_mut(self.len) {
            *place = (state, h);
            self.len += 1;
        }
        self
    }

    /// The pairs of state and element.
    #[inline]
    pub fn elements(&self) -> &[(usize, T)] {
        self.elements.get(..self.len).unwrap_or_default()
    }

    /// The row times a vector; states that the vector does not have count as zero.
    #[inline]
    pub fn dot(&self, x: &[T]) -> T {
        let mut sum = T::zero();
        for (state, h) in self.elements() {
            if let Some(x) = x.get(*state) {
                sum += *h * *x;
            }
        }
        sum
    }
}

/// Rows that look at a covariance: their projections `P H^T`, and `H P H^T`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection<T: Scalar, const N: usize, const M: usize> {
    rows: [SparseRow<T>; M],
    active: usize,
    projected: [[T; N]; M],
    /// `H P H^T`: what the uncertainty of the state does to the measurement.
    pub predicted: SMatrix<T, M, M>,
}

impl<T: Scalar, const N: usize, const M: usize> Projection<T, N, M> {
    /// Looks at the first `active` states; those beyond cost nothing.
    #[inline]
    pub fn new(covariance: &SMatrix<T, N, N>, active: usize, rows: [SparseRow<T>; M]) -> Self {
        let active = active.min(N);
        let mut projected = [[T::zero(); N]; M];
        for (out, row) in projected.iter_mut().zip(&rows) {
            for (state, h) in row.elements() {
                // Symmetric: a row of it is a column.
                if let Some(column) = covariance.as_slice().as_chunks::<N>().0.get(*state) {
                    add_scaled_first(out, column, *h, active);
                }
            }
        }
        let mut predicted = SMatrix::zeros();
        for (j, column) in projected.iter().enumerate() {
            for (i, row) in rows.iter().enumerate().take(j + 1) {
                let value = row.dot(column);
                predicted[(i, j)] = value;
                predicted[(j, i)] = value;
            }
        }
        Self {
            rows,
            active,
            projected,
            predicted,
        }
    }

    /// Fuses `residual = H x + noise` of one variance for all rows into the covariance that was
    /// looked at and into `correction`, which holds corrections that are still pending: `residual`
    /// is relative to the state before them. Returns `false` and changes nothing when the innovation
    /// covariance is not positive or a residual not finite.
    #[inline]
    pub fn fuse(
        mut self,
        covariance: &mut SMatrix<T, N, N>,
        correction: &mut SVector<T, N>,
        residual: &SVector<T, M>,
        variance: T,
    ) -> bool {
        let mut nu = *residual;
        let mut s = self.predicted;
        for (i, row) in self.rows.iter().enumerate() {
            nu[i] -= row.dot(correction.as_slice());
            let spread = row.elements().iter().fold(T::zero(), |sum, (state, h)| {
                let own = covariance.get((*state, *state)).copied();
                sum + *h * *h * own.unwrap_or_else(T::zero)
            });
            let Some(variance) = resolvable_variance(variance, spread) else {
                return false;
            };
            s[(i, i)] += variance;
        }
        let Some(l) = cholesky(&s).filter(|_| nu.norm_squared().is_finite()) else {
            return false;
        };
        for i in 0..M {
            let (before, rest) = self.projected.split_at_mut(i);
            let Some(w) = rest.first_mut() else {
                return false;
            };
            for (k, done) in before.iter().enumerate() {
                add_scaled_first(w, done, -l[(i, k)], self.active);
                let known = l[(i, k)] * nu[k];
                nu[i] -= known;
            }
            let inverse = T::one() / l[(i, i)];
            nu[i] *= inverse;
            for value in w.iter_mut() {
                *value *= inverse;
            }
        }
        for (w, nu) in self.projected.iter().zip(nu.iter()) {
            for (x, w) in correction.as_mut_slice().iter_mut().zip(w) {
                *x += *w * *nu;
            }
        }
        subtract_squares(covariance, &self.projected, self.active);
        true
    }
}

/// Whether the processor computes several numbers at once.
const HAS_VECTORS: bool = cfg!(any(
    target_feature = "sse2",
    target_feature = "neon",
    target_feature = "simd128"
));

/// `P -= W W^T` for columns `w`, on the first `active` states, of a symmetric `P`. Either way gives the same numbers.
#[inline(always)]
fn subtract_squares<T: Scalar, const N: usize, const M: usize>(
    covariance: &mut SMatrix<T, N, N>,
    w: &[[T; N]; M],
    active: usize,
) {
    if HAS_VECTORS {
        subtract_squares_whole(covariance, w, active);
    } else {
        subtract_squares_by_half(covariance, w, active);
    }
}

/// Whole columns, whose length the compiler knows: with vectors that is less than to find half of them and to copy it.
#[inline(always)]
fn subtract_squares_whole<T: Scalar, const N: usize, const M: usize>(
    covariance: &mut SMatrix<T, N, N>,
    w: &[[T; N]; M],
    active: usize,
) {
    let columns = covariance.as_mut_slice().as_chunks_mut::<N>().0;
    for (j, column) in columns.iter_mut().enumerate().take(active) {
        let factors = w.each_ref().map(|w| -w[j]);
        for i in 0..N {
            let mut value = column[i];
            for k in 0..M {
                value += factors[k] * w[k][i];
            }
            column[i] = value;
        }
        let removed = factors.iter().fold(T::zero(), |sum, f| sum + *f * *f);
        column[j] += rounding_reserve(removed);
    }
}

/// Half of it is computed, and the other half is the same numbers: on a chip without floating point that is most of an update.
#[inline(always)]
fn subtract_squares_by_half<T: Scalar, const N: usize, const M: usize>(
    covariance: &mut SMatrix<T, N, N>,
    w: &[[T; N]; M],
    active: usize,
) {
    let active = active.min(N);
    for j in 0..active {
        let mut removed = T::zero();
        let mut factors = [T::zero(); M];
        for (factor, w) in factors.iter_mut().zip(w) {
            *factor = -w[j];
            removed += w[j] * w[j];
        }
        let own = covariance.as_mut_slice().chunks_exact_mut(N).nth(j);
        if let Some(column) = own.and_then(<[T]>::first_chunk_mut::<N>) {
            for i in j..active {
                let mut value = column[i];
                for k in 0..M {
                    value += factors[k] * w[k][i];
                }
                column[i] = value;
            }
        }
        for i in j + 1..active {
            covariance[(j, i)] = covariance[(i, j)];
        }
        covariance[(j, j)] += rounding_reserve(removed);
    }
}

/// `out += factor * column`.
#[inline(always)]
pub(crate) fn add_scaled<T: Scalar, const N: usize>(out: &mut [T; N], column: &[T; N], factor: T) {
    for (out, value) in out.iter_mut().zip(column) {
        *out += factor * *value;
    }
}

/// The same over the first `active` elements.
#[inline(always)]
pub(crate) fn add_scaled_first<T: Scalar, const N: usize>(
    out: &mut [T; N],
    column: &[T; N],
    factor: T,
    active: usize,
) {
    // Slices of one length: nothing but the sum is left in the loop.
    if let (Some(out), Some(column)) = (out.get_mut(..active), column.get(..active)) {
        for (out, value) in out.iter_mut().zip(column) {
            *out += factor * *value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kalman::scalar_update::update_full;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    type M6 = SMatrix<f64, 6, 6>;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(24), ..ProptestConfig::default() })]
        #[test]
        fn the_joint_update_equals_the_sequence_of_scalar_ones_on_the_states_in_use(
            a in prop::collection::vec(-1.0..1.0f64, 36), h in prop::collection::vec(-5.0..5.0f64, 9),
            r in 0.01..2.0f64, z in prop::array::uniform3(-3.0..3.0f64),
        ) {
            let a = M6::from_column_slice(&a);
            let p = a * a.transpose() + M6::identity() * 0.01;
            let rows = [0, 1, 2].map(|i| {
                SparseRow::default().with(i + 2, h[i]).with(0, h[i + 3]).with(1, h[i + 6])
            });
            let pending = SVector::<f64, 6>::from_fn(|i, _| if i < 5 { 0.1 * i as f64 } else { 0.0 });
            let (mut pj, mut xj) = (p, pending);
            let projection = Projection::new(&pj, 5, rows);
            prop_assert!(projection.fuse(&mut pj, &mut xj, &Vector3::from(z), r));

            let mut pf = p.fixed_view::<5, 5>(0, 0).into_owned();
            let mut xf = pending.fixed_rows::<5>(0).into_owned();
            for (row, z) in rows.iter().zip(z) {
                let mut full = SVector::<f64, 5>::zeros();
                for (state, h) in row.elements() {
                    full[*state] += h;
                }
                prop_assert!(update_full(&mut pf, &mut xf, &full, z, r));
            }
            prop_assert!((pj.fixed_view::<5, 5>(0, 0) - pf).abs().max() < 1e-9);
            prop_assert!((xj.fixed_rows::<5>(0) - xf).abs().max() < 1e-9);
            prop_assert_eq!((pj.column(5), xj[5]), (p.column(5), 0.0));
            prop_assert_eq!(pj, pj.transpose());
        }

        /// A processor with vectors and a chip without give the same numbers.
        #[test]
        fn whole_columns_and_halves_of_them_are_the_same_to_the_bit(
            a in prop::collection::vec(-1.0..1.0f64, 36), w in prop::collection::vec(-0.1..0.1f64, 12), active in 3..=6_usize,
        ) {
            let a = M6::from_column_slice(&a);
            // Symmetric to the bit, which the product need not be.
            let p = M6::from_fn(|i, j| (0..6).map(|k| a[(i, k)] * a[(j, k)]).sum());
            let mut both = [[0.0; 6]; 2];
            for (column, w) in both.iter_mut().zip(w.chunks(6)) {
                column[..active].copy_from_slice(&w[..active]);
            }
            let (mut whole, mut by_half) = (p, p);
            subtract_squares_whole(&mut whole, &both, active);
            subtract_squares_by_half(&mut by_half, &both, active);
            prop_assert_eq!(whole, by_half);
        }
    }

    #[test]
    fn what_cannot_be_fused_changes_nothing() {
        let (mut p, mut x) = (M6::identity(), SVector::<f64, 6>::zeros());
        let rows = [SparseRow::of_state(0), SparseRow::of_state(3)];
        for (residual, variance) in [(1.0, -5.0), (1.0, f64::NAN), (f64::NAN, 1.0)] {
            let projection = Projection::new(&p, 6, rows);
            let residual = SVector::<f64, 2>::repeat(residual);
            assert!(!projection.fuse(&mut p, &mut x, &residual, variance));
        }
        assert_eq!((p, x), (M6::identity(), SVector::zeros()));
    }

    #[test]
    fn a_row_holds_six_elements() {
        let mut row = SparseRow::<f64>::default();
        for state in 0..8 {
            row = row.with(state, 1.0);
        }
        assert_eq!(row.elements().len(), MOST_ELEMENTS);
        let four = row.dot(&[1.0, 1.0, 1.0, 1.0]);
        assert!((four - 4.0_f64).abs() < 1e-15, "beyond the vector is zero");
    }
}
