//! Events of a recording while somebody looks on, who shows how far it is and may end it.

use std::fmt;

use crate::error::{RecordingError, Result};
use crate::event::Event;
use crate::recording::Recording;

/// Made by [`Recording::watched`].
pub struct Watched<'a> {
    recording: &'a mut Recording,
    goes_on: Box<dyn FnMut() -> bool + 'a>,
}

impl Recording {
    /// The events that are still to come. `goes_on` is asked before each; once it says no, they end with an error.
    pub fn watched<'a>(&'a mut self, goes_on: impl FnMut() -> bool + 'a) -> Watched<'a> {
        Watched {
            recording: self,
            goes_on: Box::new(goes_on),
        }
    }
}

impl Iterator for Watched<'_> {
    type Item = Result<Event>;

    fn next(&mut self) -> Option<Self::Item> {
        if (self.goes_on)() {
            return self.recording.next();
        }
        Some(Err(RecordingError::interrupted()))
    }
}

impl fmt::Debug for Watched<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watched").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Event, Metadata, OpenOptions, Recording, Sample, SensorKind};
    use nalgebra::Vector3;

    #[test]
    fn it_ends_with_an_error_once_nobody_wants_more() {
        let events = (0..10).map(|time_ns| {
            let sample = Sample::AngularRate(Vector3::x());
            Ok(Event { time_ns, sample })
        });
        let (metadata, options) = (Metadata::default(), OpenOptions::default());
        let mut recording = Recording::from_events(metadata, &SensorKind::ALL, events, &options);
        let mut left = 3;
        let mut watched = recording.watched(|| {
            left -= 1;
            left >= 0
        });
        let stamps: Vec<_> = (0..3)
            .map(|_| watched.next().unwrap().unwrap().time_ns)
            .collect();
        assert_eq!(stamps, [0, 1, 2]);
        let error = watched.next().unwrap().unwrap_err().to_string();
        assert!(error.starts_with("recording: cannot finish it"), "{error}");
    }
}
