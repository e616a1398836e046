//! Counts of each aid: measurements used, gated and skipped.

use crate::kalman::{Innovation, Outcome};
use crate::scalar::{Scalar, lit};

/// What aids the navigation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum Aid {
    /// Horizontal position of a receiver.
    GnssPosition,
    /// Its height.
    GnssHeight,
    /// Its velocity.
    GnssVelocity,
    /// A true heading.
    Heading,
    /// A magnetometer's heading.
    Magnetometer,
    /// A barometer's height.
    Barometer,
    /// Speed along the vehicle's forward axis.
    Speed,
    /// Standstill, found by the filter itself.
    ZeroVelocity,
    /// No motion sideways, assumed by the filter itself.
    NonHolonomic,
}

impl Aid {
    /// All of them, in the order of [`AidCounts`] in [`super::GnssIns::counts`].
    pub const ALL: [Self; 9] = [
        Self::GnssPosition,
        Self::GnssHeight,
        Self::GnssVelocity,
        Self::Heading,
        Self::Magnetometer,
        Self::Barometer,
        Self::Speed,
        Self::ZeroVelocity,
        Self::NonHolonomic,
    ];
}

/// What became of the measurements of one aid.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AidCounts<T> {
    /// Used with their stated noise.
    pub fused: u32,
    /// Used with more noise: a fix that was far off, or a measurement after too many refusals, with the state set free.
    pub inflated: u32,
    /// Refused by the gate; a fix so far off that it was left out.
    pub gated: u32,
    /// Not looked at: not finite, not newer, out of range, before the start.
    pub skipped: u32,
    /// Sum of the NIS of all that reached the gate, and of their degrees of freedom: near one another when the
    /// stated noises are consistent.
    pub nis_sum: T,
    /// See `nis_sum`.
    pub degrees_of_freedom: u32,
}

impl<T: Scalar> Default for AidCounts<T> {
    fn default() -> Self {
        Self {
            fused: 0,
            inflated: 0,
            gated: 0,
            skipped: 0,
            nis_sum: T::zero(),
            degrees_of_freedom: 0,
        }
    }
}

impl<T: Scalar> AidCounts<T> {
    pub(super) fn count(&mut self, innovation: &Innovation<T>) {
        let counter = match innovation.outcome {
            Outcome::Fused => &mut self.fused,
            Outcome::Inflated => &mut self.inflated,
            Outcome::Gated => &mut self.gated,
            Outcome::Skipped(_) => &mut self.skipped,
        };
        *counter = counter.saturating_add(1);
        if !matches!(innovation.outcome, Outcome::Skipped(_)) {
            // In single precision a sum stops growing at 2^24 times its parts: hours, and then it is stale.
            self.nis_sum += innovation.nis.min(lit(1e6));
            self.degrees_of_freedom = self
                .degrees_of_freedom
                .saturating_add(u32::from(innovation.degrees_of_freedom));
        }
    }
}
