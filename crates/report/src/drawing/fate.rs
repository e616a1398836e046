//! What became of a measurement: its class and word in plots.

use northing_core::kalman::Outcome;

/// What was done with a measurement, as far as plots tell it apart, with its class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fate {
    Fused,
    Inflated,
    Gated,
}

impl Fate {
    pub(crate) const ALL: [Self; 3] = [Self::Fused, Self::Inflated, Self::Gated];

    pub(crate) const fn of(outcome: Outcome) -> Option<Self> {
        match outcome {
            Outcome::Fused => Some(Self::Fused),
            Outcome::Inflated => Some(Self::Inflated),
            Outcome::Gated => Some(Self::Gated),
            Outcome::Skipped(_) => None,
        }
    }

    pub(crate) const fn class(self) -> &'static str {
        match self {
            Self::Fused => "estimate soft",
            Self::Inflated => "inflated big",
            Self::Gated => "gated big",
        }
    }

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Fused => "used",
            Self::Inflated => "used with inflated noise",
            Self::Gated => "refused by the gate",
        }
    }
}
