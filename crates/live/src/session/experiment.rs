//! An experiment: the events of so many seconds, in memory, to be run as often as one likes.

use northing_recording::{Event, SensorKind};

/// Shortest and longest experiment, s.
const SECONDS: [f64; 2] = [1.0, 3600.0];
/// No experiment holds more events than this (one event is 56 bytes).
pub const MOST_EVENTS: usize = 4_000_000;

/// An experiment under way.
#[derive(Debug)]
pub struct ExperimentRun {
    name: String,
    seconds: f64,
    since_ns: Option<i64>,
    now_ns: i64,
    events: Vec<Event>,
}

/// The events of a finished experiment, in the order of time, each once.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// What people call it.
    pub name: String,
    /// How long it was meant to be, s.
    pub seconds: f64,
    /// What was measured.
    pub events: Vec<Event>,
}

impl ExperimentRun {
    /// Begins with the next sample.
    ///
    /// # Errors
    /// The time makes no sense, in a sentence.
    pub fn new(seconds: f64, name: &str) -> Result<Self, String> {
        let [shortest, longest] = SECONDS;
        if !(shortest..=longest).contains(&seconds) {
            return Err(format!(
                "experiment of {seconds} s: expected {shortest} to {longest} s"
            ));
        }
        Ok(Self {
            name: name.to_owned(),
            seconds,
            since_ns: None,
            now_ns: i64::MIN,
            events: Vec::new(),
        })
    }

    /// Takes one event. Returns whether the experiment is over.
    pub fn add(&mut self, event: &Event) -> bool {
        let since = *self.since_ns.get_or_insert(event.time_ns);
        self.now_ns = self.now_ns.max(event.time_ns);
        if event.time_ns >= since {
            self.events.push(*event);
        }
        self.elapsed_s() > self.seconds || self.events.len() >= MOST_EVENTS
    }

    /// How far it is: 0 to 1.
    #[must_use]
    pub fn progress(&self) -> f64 {
        (self.elapsed_s() / self.seconds).clamp(0.0, 1.0)
    }

    /// Seconds still to come.
    #[must_use]
    pub fn remaining_s(&self) -> f64 {
        (self.seconds - self.elapsed_s()).max(0.0)
    }

    /// What people call it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The events so far, put in the order of time.
    #[must_use]
    pub fn finish(mut self) -> Experiment {
        let key = |event: &Event| (event.time_ns, event.sample.kind().order());
        self.events.sort_by_key(key);
        self.events.dedup_by_key(|event| key(event));
        Experiment {
            name: self.name,
            seconds: self.seconds,
            events: self.events,
        }
    }

    fn elapsed_s(&self) -> f64 {
        let since = self.since_ns.unwrap_or(self.now_ns);
        self.now_ns.saturating_sub(since) as f64 * 1e-9
    }
}

impl Experiment {
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
