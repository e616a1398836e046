//! NMEA 0183: logs of sentences, one fix for each instant of UTC.
//!
//! GGA, GNS, RMC, GLL, VTG and GSA of one UTC time make one fix and one velocity; a sentence without a
//! time belongs to the one with a time before it. HDT and THS give the heading from true north, VHW the
//! speed through the water; `PSXN,23` (a Seapath's attitude) and `PUHAW,UVH` (a Doppler log) are read too.
//! A line may begin with its time of arrival (`2014-08-01T00:00:00.186Z $GPGGA,...`).
//!
//! A fix has the time that the receiver says it has, on the day that the arrival says, or else the
//! receiver; that day may be wrong by a roll-over of the week, so it only places the beginning.

mod content;
mod epoch;
mod line;

use std::collections::BTreeSet;
use std::io::BufReader;

use content::Content;
use epoch::{Calendar, Epoch};
use line::{Sentence, reason};

use crate::error::Result;
use crate::event::{Event, Sample, SensorKind};
use crate::hold::Hold;
use crate::issues::Issues;
use crate::limits::{LOG_LINE, WAITING};
use crate::metadata::Metadata;
use crate::recording::{Opened, Pieces};
use crate::text::{Input, read_line};

pub(crate) use line::{arrival, recognises};

/// What a log may have in it.
const SENSORS: [SensorKind; 5] = [
    SensorKind::DeviceOrientation,
    SensorKind::GnssPosition,
    SensorKind::GnssVelocity,
    SensorKind::WaterVelocity,
    SensorKind::TrueHeading,
];

/// How long events wait for earlier ones: a fix may be told a second late, in the same log as a
/// compass that is told at once.
const HOLD_NS: i64 = 3_000_000_000;

/// Opens a log.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Opened {
    let source = Box::new(NmeaSource {
        file: file.to_owned(),
        input: BufReader::with_capacity(1 << 16, input),
        line: Vec::new(),
        log: Log::default(),
        at_end: false,
    });
    Opened::ned("nmea", metadata, &SENSORS, source)
}

/// The log of a file as events.
struct NmeaSource {
    file: String,
    input: BufReader<Input>,
    line: Vec<u8>,
    log: Log,
    at_end: bool,
}

impl Pieces for NmeaSource {
    fn ready(&mut self) -> Option<Event> {
        self.log.hold.take(self.at_end)
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let was_at_end = self.at_end;
        if read_line(&mut self.input, LOG_LINE, &mut self.line, &self.file)? {
            self.log.take(&self.line, issues);
        } else if !was_at_end {
            self.log.close(issues);
            self.log.remark(issues);
            self.at_end = true;
        }
        Ok(!was_at_end)
    }
}

/// A log, line by line.
struct Log {
    calendar: Calendar,
    epoch: Option<Epoch>,
    /// Samples of the open epoch: when they arrived, and what they are.
    beside: Vec<(Option<i64>, Sample)>,
    /// The last time that was told without a fix.
    clock: Option<(i64, Option<chrono::NaiveDate>)>,
    /// Talkers that write checksums: what comes from them without one was cut off.
    summing: BTreeSet<[u8; 2]>,
    hold: Hold,
}

impl Default for Log {
    fn default() -> Self {
        Self {
            calendar: Calendar::default(),
            epoch: None,
            beside: Vec::new(),
            clock: None,
            summing: BTreeSet::new(),
            hold: Hold::new(HOLD_NS),
        }
    }
}

impl Log {
    /// Takes a line; what cannot be used is counted.
    fn take(&mut self, line: &[u8], issues: &mut Issues) {
        let sentence = match Sentence::of_line(line) {
            Ok(Some(sentence)) => sentence,
            Ok(None) => return,
            Err(reason) => return issues.reject(reason),
        };
        if !self.is_whole(&sentence) {
            return issues.reject(reason::CUT_OFF);
        }
        match content::read(&sentence) {
            Ok(Content::Part(part)) => self.part(part, sentence.arrival_ns, issues),
            Ok(Content::Clock {
                time_of_day_ns,
                date,
            }) => self.tell_time(time_of_day_ns, date),
            Ok(Content::Sample(sample)) => self.beside(sample, sentence.arrival_ns, issues),
            Ok(Content::Other) => {}
            Err(()) => issues.reject(reason::GARBLED),
        }
    }

    /// Whether the sentence has its checksum, or comes from a talker that never writes one.
    fn is_whole(&mut self, sentence: &Sentence<'_>) -> bool {
        let Some(talker) = sentence.address().as_bytes().first_chunk::<2>() else {
            return true;
        };
        if sentence.has_checksum {
            self.summing.insert(*talker);
        }
        sentence.has_checksum || !self.summing.contains(talker)
    }

    fn part(&mut self, part: content::Part, arrival_ns: Option<i64>, issues: &mut Issues) {
        // A position without a time has that of the receiver's clock, told just before.
        let clock = self.clock.filter(|_| part.position_rad.is_some());
        let time = part
            .time_of_day_ns
            .or(clock.map(|(time_of_day_ns, _)| time_of_day_ns));
        let is_open = |epoch: &Epoch| time.is_none_or(|time| time == epoch.time_of_day_ns);
        if !self.epoch.as_ref().is_some_and(is_open) {
            self.close(issues);
            let Some(time) = time else {
                return issues.reject(reason::NO_TIME);
            };
            let mut epoch = Epoch::new(time, arrival_ns);
            epoch.date = self.clock.and_then(|(_, date)| date);
            self.epoch = Some(epoch);
        }
        if let Some(epoch) = &mut self.epoch {
            epoch.add(&part);
        }
    }

    fn tell_time(&mut self, time_of_day_ns: i64, date: Option<chrono::NaiveDate>) {
        self.clock = Some((time_of_day_ns, date));
        if let Some(epoch) = &mut self.epoch
            && epoch.time_of_day_ns == time_of_day_ns
        {
            epoch.date = epoch.date.or(date);
        }
    }

    /// Takes a sample that comes without a time of its own.
    fn beside(&mut self, sample: Sample, arrival_ns: Option<i64>, issues: &mut Issues) {
        match (&self.epoch, arrival_ns) {
            (Some(_), _) if self.beside.len() >= WAITING => issues.reject(reason::NO_TIME),
            (Some(_), _) => self.beside.push((arrival_ns, sample)),
            (None, Some(time_ns)) => self.hold.put(time_ns, sample),
            (None, None) => issues.reject(reason::NO_TIME),
        }
    }

    /// Ends the open epoch: its samples get their times.
    fn close(&mut self, issues: &mut Issues) {
        let Some(epoch) = self.epoch.take() else {
            return;
        };
        let time_ns = self
            .calendar
            .place(epoch.time_of_day_ns, epoch.date, epoch.arrival_ns);
        match epoch.samples() {
            Some(samples) => samples.for_each(|sample| self.hold.put(time_ns, sample)),
            None => issues.reject(reason::NO_POSITION),
        }
        // The first of a kind was measured with the fix; further ones by so much later as they arrived.
        let beside = std::mem::take(&mut self.beside);
        for (index, (arrival, sample)) in beside.iter().enumerate() {
            let mut earlier = beside[..index].iter();
            let first = earlier.find(|(_, s)| s.kind() == sample.kind());
            let later_ns = match (arrival, first) {
                (Some(arrival), Some((Some(first), _))) => arrival.saturating_sub(*first),
                _ => 0,
            };
            self.hold.put(time_ns.saturating_add(later_ns), *sample);
        }
    }

    /// Tells what was odd about the dates.
    fn remark(&self, issues: &mut Issues) {
        let Some([told, known]) = self.calendar.contradiction else {
            return;
        };
        let weeks = (known - told).num_weeks();
        let roll_over = if weeks.abs() == 1024 {
            " (a week number that rolled over)"
        } else {
            ""
        };
        issues.notes.push(format!(
            "The receiver's date {told} is {weeks} weeks from that of the log, {known}{roll_over}; its times of \
             day are used and its dates are not."
        ));
    }
}

#[cfg(test)]
mod tests;
