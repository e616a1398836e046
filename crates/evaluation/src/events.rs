//! Events as runs take them: of one type whatever they come from, so that a run is compiled once and not by each of its callers.

use northing_recording::Event;

use crate::error::EvaluationError;

/// Events in time order, or what ended them.
pub(crate) type Events<'a> = dyn Iterator<Item = Result<Event, EvaluationError>> + 'a;

/// The events with the error of a run in place of their own.
pub(crate) fn of_one_error<I, X>(
    events: I,
) -> impl Iterator<Item = Result<Event, EvaluationError>> + use<I, X>
where
    I: IntoIterator<Item = Result<Event, X>>,
    X: std::error::Error + Send + Sync + 'static,
{
    let of_a_run = |error| EvaluationError::Recording(Box::new(error));
    let events = events.into_iter();
    events.map(move |event| event.map_err(of_a_run))
}
