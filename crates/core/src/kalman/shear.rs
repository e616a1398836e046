//! Shears of a covariance, in place: three states take up multiples of others.
//!
//! A transition with few blocks is a product of shears, `S = I + X` with the rows of `X` zero but for three, which
//! do not read the three themselves. `S P S^T` then costs one product with `X` for each *other* row of `P`, whose
//! mirror image it is too; dense, it is two products of matrices.
//!
//! Rows are handled some at a time (`L`): a column of the covariance is contiguous, so what is done to each of them
//! is what a processor does to several numbers at once.

use nalgebra::{Matrix3, Vector3};

use crate::scalar::{Scalar, lit};

/// The elements of three states in `L` rows.
pub(crate) type Triple<T, const L: usize> = [[T; L]; 3];

/// The three rows of `X`.
pub(crate) trait Takes<T: Scalar> {
    /// What the three states take up in `L` rows; `part` gives the elements of the triple of states that begins at
    /// its argument.
    fn takes<const L: usize>(&self, part: impl Fn(usize) -> Triple<T, L>) -> Triple<T, L>;
}

/// What the three states take up in the rows `from..from + L`. Not inlined where code must be small: it is called
/// for some rows before, for some behind, and for the three themselves.
#[inline]
fn taken<T: Scalar, const N: usize, const L: usize>(
    columns: &[[T; N]; N],
    from: usize,
    x: &impl Takes<T>,
) -> Triple<T, L> {
    // Never out of range, and no panic where the optimiser does not see it.
    let rows = |state: usize| {
        let rows = columns[state]
            .get(from..)
            .and_then(|rows| rows.first_chunk());
        rows.copied().unwrap_or([T::zero(); L])
    };
    x.takes(|first| [rows(first), rows(first + 1), rows(first + 2)])
}

/// Adds what the three states from `to` on take up in the rows `from..from + L`, and gives it.
#[inline(always)]
pub(crate) fn add_rows<T: Scalar, const N: usize, const L: usize>(
    columns: &mut [[T; N]; N],
    to: usize,
    from: usize,
    x: &impl Takes<T>,
) -> Triple<T, L> {
    let added = taken(columns, from, x);
    add_known(columns, to, from, &added);
    added
}

/// Adds what is known.
#[inline(always)]
pub(crate) fn add_known<T: Scalar, const N: usize, const L: usize>(
    columns: &mut [[T; N]; N],
    to: usize,
    from: usize,
    [x, y, z]: &Triple<T, L>,
) {
    for (column, added) in columns.iter_mut().skip(to).zip([x, y, z]) {
        for (value, added) in column.iter_mut().skip(from).zip(added) {
            *value += *added;
        }
    }
}

/// The rest of a shear, when the rows of all other states have been added to: the block of the three states from
/// `TO` on itself, and the mirror image.
///
/// With `P' = S P S^T` that block is `P + (Y + Y^T) / 2` with `Y = (P' + P) X^T`: one product instead of two.
#[inline(always)]
pub(crate) fn finish<T: Scalar, const N: usize, const TO: usize, const B: usize>(
    columns: &mut [[T; N]; N],
    sources: [usize; B],
    x: &impl Takes<T>,
) {
    // The sum of old and new goes where the new will be.
    for first in sources {
        for (source, i) in (0..9).map(|n| (first + n / 3, TO + n % 3)) {
            let new = columns.get(i).and_then(|rows| rows.get(source)).copied();
            let new = new.unwrap_or_else(T::zero);
            if let Some(old) = columns.get_mut(source).and_then(|rows| rows.get_mut(i)) {
                *old += new;
            }
        }
    }
    let y: Triple<T, 3> = taken(columns, TO, x);
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = y;
    let half = lit::<T>(0.5);
    for (i, value) in [xx, yy, zz].into_iter().enumerate() {
        add_mirrored(columns, TO + i, TO + i, value);
    }
    for (i, j, sum) in [(1, 0, xy + yx), (2, 0, xz + zx), (2, 1, yz + zy)] {
        add_mirrored(columns, TO + i, TO + j, sum * half);
    }
    mirror(columns, TO);
}

/// Adds to an element and to its mirror image. Without a panic where the optimiser does not see that it lies within.
#[inline]
pub(crate) fn add_mirrored<T: Scalar, const N: usize>(
    columns: &mut [[T; N]; N],
    row: usize,
    column: usize,
    value: T,
) {
    let element = columns.get_mut(column).and_then(|rows| rows.get_mut(row));
    let Some(element) = element else { return };
    *element += value;
    let sum = *element;
    if let Some(image) = columns.get_mut(row).and_then(|rows| rows.get_mut(column)) {
        *image = sum;
    }
}

/// Copies the columns of the three states from `to` on to their rows of all other columns.
#[inline]
pub(super) fn mirror<T: Scalar, const N: usize>(columns: &mut [[T; N]; N], to: usize) {
    let Some((before, [x, y, z, behind @ ..])) = columns.split_at_mut_checked(to) else {
        return;
    };
    let rows = |from: usize| {
        let rows = x.iter().zip(y.iter()).zip(z.iter());
        rows.skip(from)
    };
    let copy = |(column, ((x, y), z)): (&mut [T; N], ((&T, &T), &T))| {
        if let Some([a, b, c, ..]) = column.get_mut(to..) {
            (*a, *b, *c) = (*x, *y, *z);
        }
    };
    before.iter_mut().zip(rows(0)).for_each(copy);
    behind.iter_mut().zip(rows(to + 3)).for_each(copy);
}

/// `P <- S P S^T` of a symmetric matrix given by its columns, for the three states that have `BEFORE` others before
/// and `AFTER` behind them. What they take up belongs to the triples of states that begin at `sources`, which leave
/// the three out. The result is symmetric to the bit.
#[inline(always)]
pub(crate) fn shear<
    T: Scalar,
    const N: usize,
    const BEFORE: usize,
    const AFTER: usize,
    const B: usize,
>(
    columns: &mut [[T; N]; N],
    sources: [usize; B],
    x: &impl Takes<T>,
) {
    const { assert!(BEFORE + 3 + AFTER == N) };
    add_rows::<T, N, BEFORE>(columns, BEFORE, 0, x);
    add_rows::<T, N, AFTER>(columns, BEFORE, BEFORE + 3, x);
    finish::<T, N, BEFORE, B>(columns, sources, x);
}

/// `m` times each of `L` vectors.
#[inline(always)]
pub(crate) fn times<T: Scalar, const L: usize>(
    m: &Matrix3<T>,
    [x, y, z]: Triple<T, L>,
) -> Triple<T, L> {
    let [a, b, c] = m.data.0;
    let row = |a: T, b: T, c: T| {
        let mut row = [T::zero(); L];
        for l in 0..L {
            row[l] = a * x[l] + b * y[l] + c * z[l];
        }
        row
    };
    [
        row(a[0], b[0], c[0]),
        row(a[1], b[1], c[1]),
        row(a[2], b[2], c[2]),
    ]
}

/// `v` times, as a cross product, each of `L` vectors.
#[inline(always)]
pub(crate) fn cross<T: Scalar, const L: usize>(
    v: &Vector3<T>,
    [x, y, z]: Triple<T, L>,
) -> Triple<T, L> {
    let row = |a: T, x: &[T; L], b: T, y: &[T; L]| {
        let mut row = [T::zero(); L];
        for l in 0..L {
            row[l] = a * x[l] - b * y[l];
        }
        row
    };
    [
        row(v.y, &z, v.z, &y),
        row(v.z, &x, v.x, &z),
        row(v.x, &y, v.y, &x),
    ]
}

/// The sum of two triples.
#[inline(always)]
pub(crate) fn plus<T: Scalar, const L: usize>(
    mut a: Triple<T, L>,
    b: Triple<T, L>,
) -> Triple<T, L> {
    for (a, b) in a.iter_mut().zip(&b) {
        for (a, b) in a.iter_mut().zip(b) {
            *a += *b;
        }
    }
    a
}
