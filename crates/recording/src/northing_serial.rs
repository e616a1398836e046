//! A log of what a board with Northing's firmware has sent, or the line itself as a stream.
//!
//! Axes are the board's: forward, right, down, in north, east, down.

use std::collections::VecDeque;

use crate::error::{RecordingError, Result};
use crate::event::{Event, SensorKind};
use crate::issues::Issues;
use crate::metadata::Metadata;
use crate::recording::{Opened, Pieces};
use crate::text::{Input, read_piece};
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
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Opened {
    let source = Box::new(Source {
        file: file.to_owned(),
        input,
        decoder: NorthingSerial::new(Axes::Board),
        waiting: VecDeque::new(),
        notes: Vec::new(),
    });
    Opened::ned("northing-serial", metadata, &SENSORS, source)
}

struct Source {
    file: String,
    input: Input,
    decoder: NorthingSerial,
    waiting: VecDeque<Event>,
    /// Remarks and how often they applied, told at the end.
    notes: Vec<(String, u64)>,
}

impl Pieces for Source {
    fn ready(&mut self) -> Option<Event> {
        self.waiting.pop_front()
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
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
                None if room => self.notes.push((notice.text, notice.count)),
                None => {}
            }
        }
        if length == 0 {
            let notes = self.notes.drain(..).map(|(text, count)| match count {
                1 => text,
                _ => format!("{text} ({count} times)"),
            });
            issues.notes.extend(notes);
        }
        Ok(length > 0)
    }
}
