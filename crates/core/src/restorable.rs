//! Saving a filter and continuing from what was saved, exactly.
//!
//! A [`Restorable`] filter hands out its state and takes it back: through memory that outlives a reset,
//! through a file (feature `serde`), or to try a step and undo it. Settings are no part of the state: a state belongs
//! into a filter with the same settings. What no filter can have left behind is refused, and the filter stays as it
//! was.
//!
//! ```
//! use northing_core::Restorable;
//! use northing_core::attitude::{AttitudeConfig, AttitudeEstimator, Mekf};
//! use northing_core::nalgebra::Vector3;
//!
//! let mut filter = Mekf::<f64>::new(AttitudeConfig::default())?;
//! let saved = filter.save();
//! assert!(filter.propagate(&Vector3::x(), 0.01).is_done());
//! filter.restore(saved)?;
//! assert_eq!(filter.save(), saved);
//!
//! let mut broken = saved;
//! broken.gyroscope_bias.x = f64::NAN;
//! assert!(filter.restore(broken).is_err());
//! assert_eq!(filter.save(), saved);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use nalgebra::{SMatrix, UnitQuaternion};

use crate::kalman::covariance::is_covariance;
use crate::scalar::{Scalar, lit};

/// How far the norm of a saved quaternion may be from one: single precision, written with few digits.
const NORM_TOLERANCE: f64 = 1e-3;
/// By how much a saved covariance may miss symmetry and sign, as a correlation: what rounding does in single precision.
const COVARIANCE_TOLERANCE: f64 = 1e-3;

/// A filter that can be saved, and continued from what was saved.
pub trait Restorable {
    /// Everything that the next step depends on, but for the settings.
    type State: Clone;

    /// The state as it is now.
    #[must_use]
    fn save(&self) -> Self::State;

    /// Continues from a saved state, exactly as the filter that was saved would have.
    ///
    /// # Errors
    /// [`InvalidState`] when the state is none that a filter can have; nothing has changed then.
    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState>;
}

/// Makes a filter [`Restorable`] whose state is one field that checks itself.
macro_rules! restorable {
    ($filter:ty, $field:ident: $state:ty) => {
        impl<T: $crate::Scalar> $crate::Restorable for $filter {
            type State = $state;

            fn save(&self) -> Self::State {
                self.$field
            }

            fn restore(&mut self, state: Self::State) -> Result<(), $crate::InvalidState> {
                state.check()?;
                self.$field = state;
                Ok(())
            }
        }
    };
}
pub(crate) use restorable;

/// Why a saved state was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InvalidState {
    /// Which part of it is invalid.
    pub part: &'static str,
    /// What that part must be.
    pub expected: &'static str,
}

impl core::fmt::Display for InvalidState {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "saved state: {} must be {}", self.part, self.expected)
    }
}

impl core::error::Error for InvalidState {}

/// `Ok` if `holds`.
pub(crate) fn expect(
    part: &'static str,
    holds: bool,
    expected: &'static str,
) -> Result<(), InvalidState> {
    if holds {
        Ok(())
    } else {
        Err(InvalidState { part, expected })
    }
}

/// All numbers are finite.
pub(crate) fn finite<'a, T: Scalar>(
    part: &'static str,
    values: impl IntoIterator<Item = &'a T>,
) -> Result<(), InvalidState> {
    expect(part, values.into_iter().all(|x| x.is_finite()), "finite")
}

/// All numbers are finite and not negative: variances, intervals.
pub(crate) fn not_negative<'a, T: Scalar>(
    part: &'static str,
    values: impl IntoIterator<Item = &'a T>,
) -> Result<(), InvalidState> {
    let good = |x: &T| x.is_finite() && *x >= T::zero();
    expect(
        part,
        values.into_iter().all(good),
        "finite and not negative",
    )
}

/// The quaternion has a norm of one.
pub(crate) fn unit<T: Scalar>(
    part: &'static str,
    q: &UnitQuaternion<T>,
) -> Result<(), InvalidState> {
    let off = (q.as_ref().norm_squared() - T::one()).abs();
    expect(part, off <= lit(2.0 * NORM_TOLERANCE), "a unit quaternion")
}

/// The matrix is finite, symmetric and not negative, up to rounding.
pub(crate) fn covariance<T: Scalar, const N: usize>(
    part: &'static str,
    p: &SMatrix<T, N, N>,
) -> Result<(), InvalidState> {
    let holds = is_covariance(p, lit(COVARIANCE_TOLERANCE));
    expect(part, holds, "finite, symmetric and positive semidefinite")
}
