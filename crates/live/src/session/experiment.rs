//! An experiment: the events of so many seconds, in memory, to be run as often as one likes.

use northing_core::attitude::InitialState;
use northing_evaluation::EstimatorKind;
use northing_recording::{Event, SensorKind};

use super::span::Span;

/// Shortest and longest experiment, s.
const SECONDS: [f64; 2] = [1.0, 3600.0];
/// No experiment holds more events than this (one event is 56 bytes).
pub const MOST_EVENTS: usize = 4_000_000;

/// An experiment under way.
#[derive(Debug)]
pub struct ExperimentRun {
    /// How far it is.
    pub span: Span,
    made: Experiment,
}

/// The events of a finished experiment, in the order of time, each once.
#[derive(Debug, Clone, Default)]
pub struct Experiment {
    /// What people call it.
    pub name: String,
    /// How long it was meant to be, s.
    pub seconds: f64,
    /// What was measured; the magnetic field calibrated, where a calibration was in force.
    pub events: Vec<Event>,
    /// The state of each estimator at its first sample; one that is missing aligned itself.
    pub starts: Vec<(EstimatorKind, InitialState<f64>)>,
    /// What was changed while it ran.
    pub changed: Vec<String>,
}

impl ExperimentRun {
    /// Begins with the next gyroscope sample.
    ///
    /// # Errors
    /// The time is invalid, in a sentence.
    pub fn new(seconds: f64, name: &str) -> Result<Self, String> {
        let [shortest, longest] = SECONDS;
        if !(shortest..=longest).contains(&seconds) {
            return Err(format!(
                "experiment of {seconds} s: expected {shortest} to {longest} s"
            ));
        }
        Ok(Self {
            span: Span::new(seconds),
            made: Experiment {
                name: name.to_owned(),
                seconds,
                ..Experiment::default()
            },
        })
    }

    /// Whether its first sample has come.
    #[must_use]
    pub fn has_begun(&self) -> bool {
        self.span.since_ns().is_some()
    }

    /// Begins at this stamp, with the estimators in these states.
    pub fn begin(&mut self, time_ns: i64, starts: Vec<(EstimatorKind, InitialState<f64>)>) {
        self.span.begin(time_ns);
        self.made.starts = starts;
    }

    /// Remembers that something was changed while it runs.
    pub fn note_change(&mut self, what: &str) {
        if self.has_begun() && !self.made.changed.iter().any(|said| said == what) {
            self.made.changed.push(what.to_owned());
        }
    }

    /// Takes one event; what comes before it has begun is not part of it. Returns whether the
    /// experiment is over.
    pub fn add(&mut self, event: &Event) -> bool {
        let Some(since) = self.span.reach(event.time_ns) else {
            return false;
        };
        if event.time_ns >= since {
            self.made.events.push(*event);
        }
        self.span.elapsed_s() > self.span.seconds || self.made.events.len() >= MOST_EVENTS
    }

    /// Takes an event that came too late for the filters, if it belongs to the experiment. It does
    /// not move the experiment's clock.
    pub fn add_late(&mut self, event: &Event) {
        let belongs = self
            .span
            .since_ns()
            .is_some_and(|since| event.time_ns >= since);
        if belongs && self.made.events.len() < MOST_EVENTS {
            self.made.events.push(*event);
        }
    }

    /// The events so far, put in the order of time.
    #[must_use]
    pub fn finish(mut self) -> Experiment {
        self.made.events.sort_by_key(Event::place);
        self.made.events.dedup_by_key(|event| event.place());
        self.made
    }
}

impl Experiment {
    /// The state of an estimator at the first sample.
    #[must_use]
    pub fn start_of(&self, estimator: EstimatorKind) -> Option<InitialState<f64>> {
        let known = self.starts.iter().find(|(kind, _)| *kind == estimator);
        known.map(|(_, state)| *state)
    }

    /// From the first to the last sample, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        match (self.events.first(), self.events.last()) {
            (Some(a), Some(b)) => b.time_ns.saturating_sub(a.time_ns) as f64 * 1e-9,
            _ => 0.0,
        }
    }

    /// The sensors that delivered.
    #[must_use]
    pub fn sensors(&self) -> Vec<SensorKind> {
        let has = |kind: &SensorKind| self.events.iter().any(|e| e.sample.kind() == *kind);
        SensorKind::ALL.into_iter().filter(has).collect()
    }
}
