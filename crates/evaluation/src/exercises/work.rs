//! A student's work as a check sees it.

use std::collections::BTreeMap;
use std::convert::Infallible;

use northing_core::attitude::InitialState;
use northing_core::calibration::RestCalibration;
use northing_recording::Event;

use crate::attitude::alterations::Alterations;
use crate::attitude::{EstimatorKind, RunOptions};
use crate::calibration::rest::{Span, calibrate};
use crate::{EvaluationError, RunObserver, RunSummary, run};

/// Answers by the name of their question, as they were typed.
pub type Answers = BTreeMap<String, String>;
/// The state of an estimator at the first sample.
pub type Start = (EstimatorKind, InitialState<f64>);

/// A number as people type it: a decimal comma and a typographical minus are understood.
#[must_use]
pub fn number(text: &str) -> Option<f64> {
    let plain = text.trim().replace(',', ".").replace('\u{2212}', "-");
    plain.parse().ok().filter(|v: &f64| v.is_finite())
}

/// What a check looks at.
#[derive(Debug, Clone, Copy)]
pub struct Work<'a> {
    /// What was measured, in the order of time.
    pub events: &'a [Event],
    /// What the experiment is run with: the estimator is the subject.
    pub options: &'a RunOptions,
    /// The states at the first sample.
    pub starts: &'a [Start],
    /// What was done to the samples in a what-if.
    pub alterations: &'a Alterations,
    /// What was answered.
    pub answers: &'a Answers,
}

impl<'a> Work<'a> {
    /// A number that was answered.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        number(self.answers.get(name)?)
    }

    /// A choice that was made.
    pub(super) fn choice(&self, name: &str) -> &'a str {
        self.answers.get(name).map_or("", |text| text.trim())
    }

    /// The calibration at rest that is in force: the given one, or that of the recording's first seconds, made anew.
    pub(super) fn calibration(&self) -> Result<Option<RestCalibration<f64>>, EvaluationError> {
        let Some(seconds) = self.options.calibrate_first_s else {
            return Ok(self.options.calibration);
        };
        let span = Span {
            from_s: Some(0.0),
            to_s: Some(seconds),
        };
        let sensors = &self.options.sensors;
        let magnetometer = sensors.magnetometer.then_some(sensors.magnetometer_source);
        let events = self.events.iter().map(|event| Ok(*event));
        Ok(Some(calibrate(events, span, magnetometer)?.calibration))
    }

    /// Runs an estimator over samples, from the state that it had at the first one.
    pub(super) fn run(
        &self,
        events: &[Event],
        estimator: EstimatorKind,
        observer: &mut dyn RunObserver,
    ) -> Result<RunSummary, EvaluationError> {
        let known = self.starts.iter().find(|(kind, _)| *kind == estimator);
        let known = known.map(|(_, state)| *state);
        let options = RunOptions {
            estimator,
            // The subject's state is as good a start for another.
            start: known.or(self.options.start),
            skip_s: known.map_or(self.options.skip_s, |_| 0.0),
            smooth: self.options.smooth && estimator.has_smoother(),
            ..self.options.clone()
        };
        run(
            events.iter().map(|event| Ok::<_, Infallible>(*event)),
            &options,
            observer,
        )
    }

    /// The samples as the hand-in has them: altered, where they were.
    pub(super) fn altered(&self) -> Vec<Event> {
        match self.alterations.is_none() {
            true => self.events.to_vec(),
            false => self.alterations.apply(self.events),
        }
    }
}
