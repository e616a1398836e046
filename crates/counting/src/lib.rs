//! A number that counts what is done with it, to state and to assert what an algorithm costs.
//!
//! [`Counting`] is an `f64` that linear algebra takes for a real number; whatever is computed with it comes out as
//! with `f64`, and is counted for the thread that computes. Only tests use it.
//!
//! ```
//! use counting_scalar::{Counting, counted};
//! use nalgebra::Vector3;
//!
//! let (a, b) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(-2.0, 0.5, 1.0));
//! let (a, b) = (a.map(Counting::new), b.map(Counting::new));
//! let (cross, operations) = counted(|| a.cross(&b));
//! assert_eq!((operations.multiplications, operations.additions), (6, 3));
//! assert_eq!(cross.x.value(), 0.5);
//! ```
//!
//! What counts: multiplications; additions and subtractions; divisions; square roots; calls of trigonometric,
//! exponential and logarithmic functions (sine and cosine of one angle at once are two); comparisons. What does not:
//! negation, absolute value, copies, conversion of literals, tests for being finite. A product by a one or a
//! zero that only the compiler could see is counted like any other, so a count is an upper bound of what a chip does.

#![warn(missing_docs)]

mod number;
mod real;

use core::cell::Cell;
use core::ops::{Add, Sub};

pub use number::Counting;

/// How many operations of each kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Operations {
    /// Multiplications.
    pub multiplications: u32,
    /// Additions and subtractions.
    pub additions: u32,
    /// Divisions and remainders.
    pub divisions: u32,
    /// Square roots.
    pub square_roots: u32,
    /// Sines, cosines, arc tangents, exponentials, logarithms and powers.
    pub functions: u32,
    /// Comparisons, of equality too.
    pub comparisons: u32,
}

impl Operations {
    const NONE: Self = Self {
        multiplications: 0,
        additions: 0,
        divisions: 0,
        square_roots: 0,
        functions: 0,
        comparisons: 0,
    };

    fn combined(self, other: Self, combine: impl Fn(u32, u32) -> u32) -> Self {
        Self {
            multiplications: combine(self.multiplications, other.multiplications),
            additions: combine(self.additions, other.additions),
            divisions: combine(self.divisions, other.divisions),
            square_roots: combine(self.square_roots, other.square_roots),
            functions: combine(self.functions, other.functions),
            comparisons: combine(self.comparisons, other.comparisons),
        }
    }
}

impl Add for Operations {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.combined(other, u32::saturating_add)
    }
}

impl Sub for Operations {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.combined(other, u32::saturating_sub)
    }
}

thread_local! {
    static DONE: Cell<Operations> = const { Cell::new(Operations::NONE) };
}

/// Adds to what this thread has done.
pub(crate) fn count(change: impl FnOnce(&mut Operations)) {
    let mut done = DONE.get();
    change(&mut done);
    DONE.set(done);
}

/// The result of `work` and the operations on [`Counting`] that it took, on this thread.
pub fn counted<R>(work: impl FnOnce() -> R) -> (R, Operations) {
    let before = DONE.get();
    let result = work();
    (result, DONE.get() - before)
}
