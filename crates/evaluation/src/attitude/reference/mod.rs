//! References of an attitude: scoring at their instants, and whether their clock and mounting are the sensor's.
//!
//! | I look for | file |
//! |---|---|
//! | the estimate at the instant of a reference sample | `scorer.rs` |
//! | clock offset and misalignment by angular rates, in words | `alignment.rs` |
//! | another rate of the clock, a jump, another motion | `clock.rs` |
//! | the rates that these are found by | `rates.rs` |
//! | quaternions that were read in another order, or the other way | `reading.rs` |
//! | references put on the sensors' clock | `aligned.rs` |
//! | all of it beside a run, and in words | `watch.rs` |

mod aligned;
mod alignment;
mod clock;
mod rates;
mod reading;
mod scorer;
#[cfg(test)]
pub(crate) mod simulated;
#[cfg(test)]
mod tests;
mod watch;

use northing_recording::{Event, Recording};

use crate::attitude::Instants;
use crate::error::EvaluationError;
use crate::events::{Events, of_one_error};

pub(crate) use aligned::Aligned;
use alignment::find;
pub use alignment::{ReferenceAlignment, ReferenceProblem};
use rates::Rates;
pub use reading::{Order, Reading};
pub use scorer::ScoredRecord;
use scorer::Scorer;
pub(crate) use watch::ReferenceWatch;

/// What is looked at of a recording when the alignment is asked for, s.
const LONGEST_FIT_S: f64 = 3600.0;
/// What is looked at beside a run, s: memory stays bounded.
const LONGEST_WATCH_S: f64 = 600.0;

/// What becomes of the reference of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum ReferenceUse {
    /// It is scored as it is. What its rates say against that is said, and a reference that cannot be that of the
    /// sensors is an error.
    #[default]
    AsIs,
    /// It is put on the sensors' clock and into the sensor's axes first ([`fit`]).
    Aligned(ReferenceAlignment),
    /// It is neither scored nor looked at.
    Ignored,
}

impl ReferenceUse {
    /// The alignment to apply.
    #[must_use]
    pub const fn alignment(&self) -> Option<&ReferenceAlignment> {
        match self {
            Self::Aligned(found) => Some(found),
            _ => None,
        }
    }
}

/// Finds the clock offset and the misalignment of the reference over the first hour of a recording, for
/// [`ReferenceUse::Aligned`].
///
/// # Errors
/// The events end in an error; there is no reference, or too little motion; the reference's clock runs at another rate or
/// jumps, or it shows another motion.
pub fn fit<I, X>(events: I) -> Result<ReferenceAlignment, EvaluationError>
where
    I: IntoIterator<Item = Result<Event, X>>,
    X: std::error::Error + Send + Sync + 'static,
{
    fit_whole(&mut of_one_error(events))
}

/// As [`fit`], of a recording: compiled here, and not by each generic caller.
pub(crate) fn fit_recording(
    recording: &mut Recording,
) -> Result<ReferenceAlignment, EvaluationError> {
    fit(recording)
}

fn fit_whole(events: &mut Events<'_>) -> Result<ReferenceAlignment, EvaluationError> {
    let mut rates = Rates::new(LONGEST_FIT_S);
    for instant in Instants::new(events) {
        rates.add(&instant?);
    }
    find(&rates.series())
        .map_err(|problem| EvaluationError::Reference(Box::new(problem)))?
        .ok_or(EvaluationError::ReferenceAtRest)
}
