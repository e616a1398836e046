//! A recording: its metadata and its events, one after the other in time order.

use std::fmt;

use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::false_stamps::FalseStamps;
use crate::gnss::GnssQuality;
use crate::instant::Instant;
use crate::issues::Issues;
use crate::metadata::{Metadata, WorldFrame};
use crate::options::OpenOptions;
use crate::plausibility::Plausibility;
use crate::timeline::Timeline;

/// What a reader hands over: events in the order of the file.
pub(crate) trait EventSource: Send {
    /// The next event; `issues` takes what only the reader sees.
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>>;

    /// Where the last event stands: file and line, of readers that know.
    fn place(&self) -> Option<String> {
        None
    }
}

impl EventSource for Box<dyn EventSource> {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        (**self).next_event(issues)
    }

    fn place(&self) -> Option<String> {
        (**self).place()
    }
}

/// A source that reads a piece (a line, a row, a block) at a time, of which come some events.
pub(crate) trait Pieces: Send {
    /// The next event that is ready.
    fn ready(&mut self) -> Option<Event>;

    /// Reads the next piece; false when nothing more comes.
    fn read(&mut self, issues: &mut Issues) -> Result<bool>;

    /// Where the piece stands, see [`EventSource::place`].
    fn place(&self) -> Option<String> {
        None
    }
}

impl<S: Pieces> EventSource for S {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        loop {
            let ready = self.ready();
            if ready.is_some() || !self.read(issues)? {
                return Ok(ready);
            }
        }
    }

    fn place(&self) -> Option<String> {
        Pieces::place(self)
    }
}

/// What a reader knows before the first event.
pub(crate) struct Opened {
    pub(crate) metadata: Metadata,
    /// The sensors the file promises, in [`SensorKind::ALL`] order.
    pub(crate) sensors: Vec<SensorKind>,
    pub(crate) source: Box<dyn EventSource>,
    /// Remarks for [`Issues::notes`].
    pub(crate) notes: Vec<String>,
    /// Whether the reader has applied the units of the options itself.
    pub(crate) units_applied: bool,
}

impl Opened {
    /// A recording as it is, without notes.
    pub(crate) fn new(
        metadata: Metadata,
        sensors: Vec<SensorKind>,
        source: Box<dyn EventSource>,
    ) -> Self {
        Self {
            metadata,
            sensors,
            source,
            notes: Vec::new(),
            units_applied: false,
        }
    }

    /// A recording in north, east, down, whose units are those of its format.
    pub(crate) fn ned(
        format: &str,
        metadata: Metadata,
        sensors: &[SensorKind],
        source: Box<dyn EventSource>,
    ) -> Self {
        let metadata = Metadata {
            format: format.to_owned(),
            world_frame: WorldFrame::Ned,
            ..metadata
        };
        Self {
            units_applied: true,
            ..Self::new(metadata, sensors.to_vec(), source)
        }
    }
}

/// An open recording: an iterator of events in time order, events of one instant in the order of
/// [`SensorKind::ALL`]. It streams: memory does not grow with the length of the recording.
///
/// After the first error the iterator ends. Iterate by reference (`for event in &mut recording`) to
/// ask for [`Recording::issues`] afterwards.
pub struct Recording {
    /// The file for messages.
    file: String,
    metadata: Metadata,
    sensors: Vec<SensorKind>,
    source: Box<dyn EventSource>,
    scale: Scale,
    timeline: Timeline,
    plausibility: Plausibility,
    issues: Issues,
    instant: Instant,
    /// The first admitted event after the current instant.
    pending: Option<Event>,
    /// An error or the end met while the current instant was gathered.
    ending: Option<Ending>,
    delivered: u64,
    /// Stamp of the last fix that stands for none.
    at_zero_ns: Option<i64>,
    /// A gyroscope or a satellite receiver has spoken: without either nothing can be estimated.
    can_be_estimated: bool,
}

/// Completes "Left out: 3 ...".
const AT_ZERO: &str = "position(s) whose latitude and longitude are both exactly 0, as is written where there is no fix";

enum Ending {
    End,
    Error(RecordingError),
    Over,
}

impl Recording {
    /// A recording of events that come from elsewhere (a simulation, another format), with the same
    /// checks as a file. `sensors` are the kinds that may come; give [`SensorKind::ALL`] if unknown.
    /// `metadata.name` stands for the file in messages.
    pub fn from_events<I>(
        metadata: Metadata,
        sensors: &[SensorKind],
        events: I,
        options: &OpenOptions,
    ) -> Self
    where
        I: Iterator<Item = Result<Event>> + Send + 'static,
    {
        let file = metadata.name.clone();
        let opened = Opened::new(metadata, sensors.to_vec(), Box::new(Events(events)));
        Self::new(file, opened, options)
    }

    pub(crate) fn new(file: String, opened: Opened, options: &OpenOptions) -> Self {
        let scale = if opened.units_applied {
            Scale::NONE
        } else {
            Scale::new(options)
        };
        let timeline = Timeline::new(options.gap_limit_s).of_format(&opened.metadata.format);
        Self {
            file,
            metadata: opened.metadata,
            sensors: opened.sensors,
            source: Box::new(FalseStamps::new(opened.source)),
            scale,
            timeline,
            plausibility: Plausibility::new(options),
            issues: Issues {
                gap_limit_s: options.gap_limit_s,
                notes: opened.notes,
                ..Issues::default()
            },
            instant: Instant::default(),
            pending: None,
            ending: None,
            delivered: 0,
            at_zero_ns: None,
            can_be_estimated: false,
        }
    }

    /// What the recording says about itself.
    #[must_use]
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// What was odd so far; complete once the iterator has ended.
    #[must_use]
    pub fn issues(&self) -> &Issues {
        &self.issues
    }

    /// The sensors which the file's columns promise. A promised sensor may still stay silent.
    #[must_use]
    pub fn sensors(&self) -> &[SensorKind] {
        &self.sensors
    }

    /// Gathers the admitted events of the next instant, or says how the recording ended.
    fn gather_instant(&mut self) {
        if let Some(event) = self.pending.take() {
            self.instant.put(event);
        }
        loop {
            let mut event = match self.source.next_event(&mut self.issues) {
                Ok(Some(event)) => event,
                Ok(None) => return self.ending = Some(Ending::End),
                Err(error) => return self.ending = Some(Ending::Error(error)),
            };
            self.scale.apply(&mut event.sample);
            if self.is_no_fix(&event) {
                continue;
            }
            match self.timeline.admit(&event, &mut self.issues, &self.file) {
                Ok(true) if self.instant.accepts(event.time_ns) => self.instant.put(event),
                Ok(true) => return self.pending = Some(event),
                Ok(false) => {}
                Err(error) => return self.ending = Some(Ending::Error(error)),
            }
        }
    }

    /// Whether it is a fix that the receiver itself calls invalid, or one that stands for none, or the velocity that comes with
    /// that; counted, and nobody gets to see it.
    fn is_no_fix(&mut self, event: &Event) -> bool {
        match &event.sample {
            Sample::GnssPosition(fix) | Sample::ReferencePosition(fix) => {
                if fix.quality == GnssQuality::Invalid {
                    Issues::count(&mut self.issues.invalid_fixes, event.sample.kind());
                    return true;
                }
                if fix.is_at_zero() {
                    self.issues.reject(AT_ZERO);
                    self.at_zero_ns = Some(event.time_ns);
                }
                fix.is_at_zero()
            }
            Sample::GnssVelocity(velocity) => {
                self.at_zero_ns == Some(event.time_ns) && velocity.is_zero()
            }
            _ => false,
        }
    }

    fn deliver(&mut self, event: Event) -> Result<Event> {
        if let Err(error) = self.plausibility.check(&event, &self.file) {
            self.stop();
            return Err(error);
        }
        self.delivered += 1;
        self.can_be_estimated |= matches!(
            event.sample,
            Sample::AngularRate(_) | Sample::GnssPosition(_)
        );
        Ok(event)
    }

    /// What is wrong with the recording as a whole, known at its end.
    fn verdict(&mut self) -> Result<()> {
        if self.delivered == 0 {
            return Err(RecordingError::empty(
                &self.file,
                "no sample with a time stamp",
                "at least one sample",
            ));
        }
        self.plausibility.tell(&mut self.issues);
        self.timeline.finish(&self.file)?;
        if !self.can_be_estimated {
            let others: Vec<_> = self
                .sensors
                .iter()
                .copied()
                .filter(|kind| *kind != SensorKind::Gyroscope)
                .collect();
            return Err(RecordingError::no_gyroscope(&self.file, &others));
        }
        self.plausibility.finish(&self.file)
    }

    fn stop(&mut self) {
        self.instant = Instant::default();
        self.pending = None;
        self.ending = Some(Ending::Over);
    }
}

impl Iterator for Recording {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(event) = self.instant.take() {
                return Some(self.deliver(event));
            }
            match self.ending.take() {
                None => self.gather_instant(),
                Some(Ending::Over) => {
                    self.ending = Some(Ending::Over);
                    return None;
                }
                Some(Ending::Error(error)) => {
                    self.stop();
                    return Some(Err(error));
                }
                Some(Ending::End) => {
                    let verdict = self.verdict();
                    self.stop();
                    return verdict.err().map(Err);
                }
            }
        }
    }
}

impl std::iter::FusedIterator for Recording {}

impl fmt::Debug for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recording")
            .field("metadata", &self.metadata)
            .field("sensors", &self.sensors)
            .field("issues", &self.issues)
            .finish_non_exhaustive()
    }
}

/// Factors from the units the user named to those inside.
#[derive(Clone, Copy)]
pub(crate) struct Scale {
    rate: Option<f64>,
    force: Option<f64>,
    field: Option<f64>,
}

impl Scale {
    pub(crate) const NONE: Self = Self {
        rate: None,
        force: None,
        field: None,
    };

    pub(crate) fn new(options: &OpenOptions) -> Self {
        Self {
            rate: options.gyroscope_unit.map(|unit| unit.to_rad_per_s()),
            force: options.accelerometer_unit.map(|unit| unit.to_m_per_s2()),
            field: options.magnetometer_unit.map(|unit| unit.to_microtesla()),
        }
    }

    pub(crate) fn apply(&self, sample: &mut Sample) {
        let (vector, factor) = match sample {
            Sample::AngularRate(v) | Sample::DeviceGyroscopeBias(v) => (v, self.rate),
            Sample::SpecificForce(v) => (v, self.force),
            Sample::MagneticField(v) | Sample::MagneticFieldUncalibrated(v) => (v, self.field),
            _ => return,
        };
        if let Some(factor) = factor {
            *vector *= factor;
        }
    }
}

pub(crate) struct Events<I>(pub(crate) I);

impl<I: Iterator<Item = Result<Event>> + Send> EventSource for Events<I> {
    fn next_event(&mut self, _: &mut Issues) -> Result<Option<Event>> {
        self.0.next().transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::Recording;
    use crate::error::RecordingError;
    use crate::event::{Event, Sample, SensorKind};
    use crate::metadata::Metadata;
    use crate::options::{ForceUnit, OpenOptions, RateUnit};
    use nalgebra::Vector3;

    fn event(time_ns: i64, sample: Sample) -> Event {
        Event { time_ns, sample }
    }

    fn rate(time_ns: i64) -> Event {
        event(time_ns, Sample::AngularRate(Vector3::x()))
    }

    fn open(events: Vec<Event>, options: &OpenOptions) -> Recording {
        let metadata = Metadata {
            name: "test".to_owned(),
            ..Metadata::default()
        };
        Recording::from_events(
            metadata,
            &SensorKind::ALL,
            events.into_iter().map(Ok),
            options,
        )
    }

    #[test]
    fn events_of_one_instant_come_in_the_order_of_all() {
        let force = Sample::SpecificForce(Vector3::z() * 9.81);
        let pressure = Sample::Pressure(101_325.0);
        let events = vec![
            event(5, pressure),
            event(5, force),
            rate(5),
            event(6, force),
            rate(7),
            rate(7),
        ];
        let mut recording = open(events, &OpenOptions::default());
        let read: Vec<_> = recording.by_ref().map(Result::unwrap).collect();
        assert_eq!(
            read,
            [
                rate(5),
                event(5, force),
                event(5, pressure),
                event(6, force),
                rate(7)
            ]
        );
        assert_eq!(
            recording.issues().duplicate_stamps[&SensorKind::Gyroscope],
            1
        );
        assert!(recording.next().is_none());
    }

    #[test]
    fn units_named_by_the_user_are_applied() {
        let options = OpenOptions {
            gyroscope_unit: Some(RateUnit::DegPerS),
            accelerometer_unit: Some(ForceUnit::G),
            ..OpenOptions::default()
        };
        let events = vec![rate(0), event(0, Sample::SpecificForce(Vector3::z()))];
        let read: Vec<_> = open(events, &options).map(|e| e.unwrap().sample).collect();
        assert_eq!(
            read,
            [
                Sample::AngularRate(Vector3::x() * 1_f64.to_radians()),
                Sample::SpecificForce(Vector3::z() * 9.80665)
            ]
        );
    }

    #[test]
    fn nothing_or_no_gyroscope_is_an_error_at_the_end() {
        let mut nothing = open(vec![], &OpenOptions::default());
        assert!(matches!(
            nothing.next(),
            Some(Err(RecordingError::Empty { .. }))
        ));
        assert!(nothing.next().is_none());

        let force = event(0, Sample::SpecificForce(Vector3::z() * 9.81));
        let mut no_gyroscope = open(vec![force], &OpenOptions::default());
        assert_eq!(no_gyroscope.next().unwrap().unwrap(), force);
        let error = no_gyroscope.next().unwrap().unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("test: no gyroscope: it has accelerometer")
        );
        assert!(no_gyroscope.next().is_none());
    }

    #[test]
    fn events_before_an_error_are_delivered_and_none_after_it() {
        let broken = || {
            Err(RecordingError::Damaged {
                file: "test".to_owned(),
                detail: "made up".to_owned(),
            })
        };
        let events = [Ok(rate(0)), broken(), Ok(rate(1))];
        let mut recording = Recording::from_events(
            Metadata::default(),
            &[SensorKind::Gyroscope],
            events.into_iter(),
            &OpenOptions::default(),
        );
        assert_eq!(recording.next().unwrap().unwrap(), rate(0));
        assert!(matches!(
            recording.next(),
            Some(Err(RecordingError::Damaged { .. }))
        ));
        assert!(recording.next().is_none());
    }
}
