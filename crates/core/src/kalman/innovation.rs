//! The innovation record: what every update of every estimator returns.
//!
//! Plots, logs, NIS statistics, verdicts and the lab all feed on this one record.

use nalgebra::{Matrix3, Vector3};

use crate::scalar::{Scalar, lit};

/// What one measurement of up to three components told the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct Innovation<T> {
    /// Measured minus predicted, in the unit of the sensor (rad for a heading). Components beyond
    /// [`Self::degrees_of_freedom`] are zero.
    pub residual: Vector3<T>,
    /// Covariance `S = H P H^T + R` that the filter expected of the residual; components beyond
    /// the degrees of freedom are zero.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix3<T>,
    /// Normalised innovation squared, `residual^T S^-1 residual`: chi-square distributed with
    /// [`Self::degrees_of_freedom`] when the tuning is consistent.
    pub nis: T,
    /// Number of components measured: 3 for a vector, 1 for a heading; 0 when skipped, and from
    /// filters that state no covariance (the covariance and the NIS are then zero and mean nothing).
    pub degrees_of_freedom: u8,
    /// What was done with the measurement.
    pub outcome: Outcome,
}

/// What a filter did with a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Outcome {
    /// Used with its stated noise.
    Fused,
    /// Used with inflated noise: it is further off than nearly all are, or the gate had refused everything for its time-out.
    Inflated,
    /// Refused: the NIS was above the gate.
    Gated,
    /// Not fused, for the reason given: it corrected nothing.
    Skipped(SkipReason),
}

impl Outcome {
    /// Whether the measurement changed the state.
    #[inline]
    pub const fn is_fused(self) -> bool {
        matches!(self, Self::Fused | Self::Inflated)
    }

    /// Its name in messages to viewers: `fused`, `inflated`, `gated` or `skipped`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fused => "fused",
            Self::Inflated => "inflated",
            Self::Gated => "gated",
            Self::Skipped(_) => "skipped",
        }
    }
}

/// Why a measurement was not looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum SkipReason {
    /// A component is NaN or infinite.
    NotFinite,
    /// The vector has no direction: all zero, or too short to carry one.
    ZeroNorm,
    /// Finite, but far beyond what the sensor can have measured.
    OutOfRange,
    /// Its time stamp is not after the sensor's last: repeated, or out of order.
    NotNewer,
    /// Far from the samples before it: the next one shows what it was.
    Suspect,
    /// The same numbers as before: a sensor that holds its last value has not measured again.
    Repeated,
    /// Sooner after the last update than the estimator updates: a later sample stands for it.
    NotDue,
    /// Accumulated (pre-integrated): it takes effect with a later sample.
    Accumulated,
    /// So long after the last one of its sensor that nothing is known of the time between.
    TooLate,
    /// The estimator does not use this sensor.
    NotUsed,
    /// The estimator has no attitude or no reference for this sensor yet.
    NotInitialized,
    /// The sensor is blind to the state right now (field vertical: no heading).
    Unobservable,
    /// Numerics refused it: the innovation covariance was not positive.
    Numerical,
}

impl SkipReason {
    /// The reason in words.
    pub const fn description(self) -> &'static str {
        match self {
            Self::NotFinite => "not a finite number",
            Self::ZeroNorm => "zero vector",
            Self::OutOfRange => "far out of range",
            Self::NotNewer => "time stamp repeated or going back",
            Self::Suspect => "far from the samples before it",
            Self::Repeated => "the same numbers again",
            Self::NotDue => "sooner than the update interval",
            Self::Accumulated => "accumulated for a later update",
            Self::TooLate => "too long after the one before",
            Self::NotUsed => "sensor not used",
            Self::NotInitialized => "not initialised",
            Self::Unobservable => "direction gives no information",
            Self::Numerical => "innovation covariance not positive",
        }
    }
}

impl core::fmt::Display for SkipReason {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.description())
    }
}

impl core::error::Error for SkipReason {}

impl<T: Scalar> Innovation<T> {
    /// A measurement that was not looked at.
    #[inline]
    pub fn skipped(reason: SkipReason) -> Self {
        Self {
            residual: Vector3::zeros(),
            covariance: Matrix3::zeros(),
            nis: T::zero(),
            degrees_of_freedom: 0,
            outcome: Outcome::Skipped(reason),
        }
    }

    /// Standard deviations of the residual's components, the square roots of the diagonal of `S`.
    #[inline]
    pub fn residual_std(&self) -> Vector3<T> {
        self.covariance.diagonal().map(|v| v.max(T::zero()).sqrt())
    }
}

/// Refuses vectors that carry no direction, or cannot be a measurement, before they reach a state.
#[inline]
pub(crate) fn check_vector<T: Scalar>(
    v: &Vector3<T>,
    shortest: T,
    longest: T,
) -> Result<(), SkipReason> {
    checked_norm_squared(v, [shortest, longest]).map(|_| ())
}

/// The squared norm of a vector that [`check_vector`] would let pass.
#[inline]
pub(crate) fn checked_norm_squared<T: Scalar>(
    v: &Vector3<T>,
    [shortest, longest]: [T; 2],
) -> Result<T, SkipReason> {
    let n2 = v.norm_squared();
    if !n2.is_finite() {
        Err(SkipReason::NotFinite)
    } else if n2 < shortest * shortest {
        Err(SkipReason::ZeroNorm)
    } else if n2 > longest * longest {
        Err(SkipReason::OutOfRange)
    } else {
        Ok(n2)
    }
}

/// [`check_vector`] for vectors that may be zero: no multiplication where every component is small.
#[inline]
pub(crate) fn check_within<T: Scalar>(v: &Vector3<T>, longest: T) -> Result<(), SkipReason> {
    // Three halves of it are within it; what is not a number is not.
    let half = longest * lit(0.5);
    if v.x.abs() <= half && v.y.abs() <= half && v.z.abs() <= half {
        return Ok(());
    }
    check_vector(v, T::zero(), longest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The short way says what the long one says, on both sides of each limit.
    #[test]
    fn vectors_within_a_length_are_those_that_are_not_longer() {
        for x in [0.0, 4.99, 5.0, 5.01, 9.9, 10.1, f64::NAN, f64::INFINITY] {
            for y in [0.0, -5.0, -8.0] {
                for z in [0.0, 5.0, f64::NEG_INFINITY] {
                    let v = Vector3::new(x, y, z);
                    assert_eq!(check_within(&v, 10.0), check_vector(&v, 0.0, 10.0), "{v}");
                }
            }
        }
    }
}
