//! A log of what a board with Northing's firmware has sent, or the line itself as a stream.
//!
//! Axes are the board's: forward, right, down, in north, east, down.

use std::collections::VecDeque;
use std::io::Read;

use crate::error::{RecordingError, Result};
use crate::event::{Event, SensorKind};
use crate::issues::Issues;
use crate::metadata::Metadata;
use crate::recording::{EventSource, Opened};
use crate::text::read_piece;
use crate::wire::northing_serial::{Axes, NorthingSerial};

pub(crate) use crate::wire::northing_serial::recognises;

/// What a board may send.
const SENSORS: [SensorKind; 7] = [
    SensorKind::Gyroscope,
    SensorKind::Accelerometer,
    SensorKind::Magnetometer,
    SensorKind::DeviceOrientation,
    SensorKind::GnssPosition,
    SensorKind::GnssVelocity,
    SensorKind::DeviceNavigation,
];

/// Bytes read at once: few, so that a live line is not waited for.
const CHUNK: usize = 1024;

/// Opens a log or a stream.
pub(crate) fn open(input: impl Read + Send + 'static, file: &str, metadata: Metadata) -> Opened {
    let source = Box::new(Source {
        file: file.to_owned(),
        input,
        decoder: NorthingSerial::new(Axes::Board),
        waiting: VecDeque::new(),
        notes: Vec::new(),
    });
    Opened::ned("northing-serial", metadata, &SENSORS, source)
}

struct Source<R> {
    file: String,
    input: R,
    decoder: NorthingSerial,
    waiting: VecDeque<Event>,
    /// Remarks and how often they applied, told at the end.
    notes: Vec<(String, u64)>,
}

impl<R: Read + Send> Source<R> {
    /// Reads on; false at the end.
    fn fill(&mut self) -> Result<bool> {
        let mut chunk = [0; CHUNK];
        let length = read_piece(&mut self.input, &mut chunk)
            .map_err(|error| RecordingError::io(&self.file, "read it", error))?;
        let decoded = self.decoder.push(&chunk[..length]);
        self.waiting.extend(decoded.events);
        for notice in decoded.notices {
            let room = self.notes.len() < crate::wire::MOST_NOTICES;
            let known = self.notes.iter_mut().find(|(text, _)| *text == notice.text);
            match known {
                Some((_, count)) => *count += notice.count,
                None if room => {
                    self.notes.push((notice.text, notice.count));
                }
                None => {}
            }
        }
        Ok(length > 0)
    }
}

impl<R: Read + Send> EventSource for Source<R> {
    fn next_event(&mut self, issues: &mut Issues) -> Option<Result<Event>> {
        loop {
            if let Some(event) = self.waiting.pop_front() {
                return Some(Ok(event));
            }
            match self.fill() {
                Ok(true) => {}
                Ok(false) if self.waiting.is_empty() => {
                    let notes = std::mem::take(&mut self.notes);
                    issues
                        .notes
                        .extend(notes.into_iter().map(|(text, count)| match count {
                            1 => text,
                            _ => format!("{text} ({count} times)"),
                        }));
                    return None;
                }
                Ok(false) => {}
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
