//! The events of one device in a recording of the lab, decoded as the lab decoded them.

use std::collections::BTreeMap;

use super::file::Messages;
use super::lab::{LabRecord, RecordKind};
use crate::error::Result;
use crate::event::Event;
use crate::issues::Issues;
use crate::limits::WAITING;
use crate::recording::Pieces;
use crate::wire::{Decoded, Tone, WireDecoder, WireFormat};

/// Batches overlap in time by less than this, ns; older events are handed out.
const OVERLAP_NS: i64 = 2_000_000_000;
/// A stamp that goes back further than this is another clock, ns.
const NEW_CLOCK_NS: i64 = 2_000_000_000;
/// Remarks of the decoder that are passed on.
const MOST_REMARKS: usize = 8;

/// The stream of one device.
pub(crate) struct LabSource {
    messages: Messages,
    device: String,
    decoder: Option<WireDecoder>,
    order: Order,
    remarks: Vec<String>,
    refused: u64,
    ended: bool,
}

impl LabSource {
    pub(crate) fn new(messages: Messages, device: &str) -> Self {
        Self {
            messages,
            device: device.to_owned(),
            decoder: None,
            order: Order::default(),
            remarks: Vec::new(),
            refused: 0,
            ended: false,
        }
    }

    fn take(&mut self, record: Option<LabRecord>) {
        let Some(record) = record.filter(|record| record.device == self.device) else {
            return;
        };
        match record.kind {
            RecordKind::Payload(format) => self.payload(format, &record),
            RecordKind::Control => self.control(&record),
            RecordKind::Refused => {}
        }
    }

    fn payload(&mut self, format: WireFormat, record: &LabRecord) {
        if self.decoder.as_ref().is_none_or(|d| d.format() != format) {
            self.begin(Some(WireDecoder::new(format)), record.arrival_ns);
        }
        let Some(decoder) = &mut self.decoder else {
            return;
        };
        match decoder.accept(&record.bytes, record.arrival_ns) {
            Ok(decoded) => self.keep(decoded, record.arrival_ns),
            Err(_) => self.refused += 1,
        }
    }

    fn control(&mut self, record: &LabRecord) {
        #[derive(serde::Deserialize)]
        struct Control {
            event: String,
        }
        let control = serde_json::from_slice(&record.bytes);
        match control.as_ref().map(|c: &Control| c.event.as_str()) {
            Ok("poll") => {
                let decoded = self
                    .decoder
                    .as_mut()
                    .and_then(|d| d.poll(record.arrival_ns));
                self.keep(decoded.unwrap_or_default(), record.arrival_ns);
            }
            // It went and came again: nothing is left of what it was.
            Ok("device" | "removed") => self.begin(None, record.arrival_ns),
            _ => {}
        }
    }

    fn begin(&mut self, decoder: Option<WireDecoder>, arrival_ns: i64) {
        let old = std::mem::replace(&mut self.decoder, decoder);
        if let Some(mut old) = old {
            self.keep(old.finish(), arrival_ns);
        }
    }

    fn keep(&mut self, decoded: Decoded, arrival_ns: i64) {
        for notice in decoded.notices {
            let matters = notice.tone != Tone::Info && self.remarks.len() < MOST_REMARKS;
            if matters && !self.remarks.contains(&notice.text) {
                self.remarks.push(notice.text);
            }
        }
        for event in decoded.events {
            self.order.push(event, arrival_ns);
        }
        for event in decoded.late {
            self.order.push_late(event);
        }
    }

    fn report(&mut self, issues: &mut Issues) {
        self.messages.report(issues);
        if self.refused > 0 {
            let refused = self.refused;
            let text = format!("Messages that could not be decoded: {refused}.");
            issues.notes.push(text);
        }
        if self.order.clocks > 1 {
            issues.notes.push(format!(
                "The device's clock began anew {} time(s) (the page was loaded again); the parts follow each other as they arrived.",
                self.order.clocks - 1
            ));
        }
        issues.notes.append(&mut self.remarks);
    }
}

impl Pieces for LabSource {
    fn ready(&mut self) -> Option<Event> {
        self.order.ready(self.ended)
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let was_ended = self.ended;
        match self.messages.next() {
            Some(message) => self.take(LabRecord::of(message)),
            None if !was_ended => {
                self.ended = true;
                let rest = self.decoder.as_mut().map(WireDecoder::finish);
                self.keep(rest.unwrap_or_default(), i64::MAX);
                self.report(issues);
            }
            None => {}
        }
        Ok(!was_ended)
    }
}

/// Puts the events of overlapping batches in the order of time, clock after clock.
#[derive(Debug, Default)]
struct Order {
    /// By stamp, sensor, and what came first.
    waiting: BTreeMap<(i64, usize, u64), Event>,
    /// Of a clock that is over: they come before everything that waits.
    done: std::collections::VecDeque<Event>,
    count: u64,
    clocks: u64,
    newest_ns: i64,
    /// What the stamps of the present clock are moved by, ns.
    offset_ns: i64,
    last_arrival_ns: i64,
}

impl Order {
    fn push(&mut self, mut event: Event, arrival_ns: i64) {
        let moved = moved_by(event.time_ns, self.offset_ns);
        let first = self.clocks == 0;
        if first || moved < self.newest_ns.saturating_sub(NEW_CLOCK_NS) {
            if !first {
                self.end_clock();
                let pause = arrival_ns
                    .saturating_sub(self.last_arrival_ns)
                    .max(1_000_000);
                let start = self.newest_ns.saturating_add(pause);
                self.offset_ns = start.saturating_sub(event.time_ns);
            }
            self.clocks += 1;
            self.newest_ns = moved_by(event.time_ns, self.offset_ns);
        }
        if arrival_ns != i64::MAX {
            self.last_arrival_ns = arrival_ns;
        }
        event.time_ns = moved_by(event.time_ns, self.offset_ns);
        self.newest_ns = self.newest_ns.max(event.time_ns);
        self.insert(event);
    }

    /// Of the present clock, however old.
    fn push_late(&mut self, mut event: Event) {
        event.time_ns = moved_by(event.time_ns, self.offset_ns);
        self.insert(event);
    }

    fn insert(&mut self, event: Event) {
        self.count += 1;
        let key = (event.time_ns, event.sample.kind().order(), self.count);
        self.waiting.insert(key, event);
    }

    fn end_clock(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        self.done.extend(waiting.into_values());
    }

    fn ready(&mut self, all: bool) -> Option<Event> {
        if let Some(event) = self.done.pop_front() {
            return Some(event);
        }
        let ((next_ns, ..), _) = self.waiting.first_key_value()?;
        let old = *next_ns < self.newest_ns.saturating_sub(OVERLAP_NS);
        if !(all || old || self.waiting.len() > WAITING) {
            return None;
        }
        self.waiting.pop_first().map(|(_, event)| event)
    }
}

fn moved_by(time_ns: i64, offset_ns: i64) -> i64 {
    time_ns.saturating_add(offset_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Sample;

    fn pushed(stamps_s: &[(i64, i64)]) -> Vec<i64> {
        let mut order = Order::default();
        let mut out = Vec::new();
        for (time_s, arrival_s) in stamps_s {
            let event = Event {
                time_ns: time_s * 1_000_000_000,
                sample: Sample::Pressure(0.0),
            };
            order.push(event, arrival_s * 1_000_000_000);
            while let Some(event) = order.ready(false) {
                out.push(event.time_ns / 1_000_000_000);
            }
        }
        while let Some(event) = order.ready(true) {
            out.push(event.time_ns / 1_000_000_000);
        }
        out
    }

    #[test]
    fn overlapping_batches_come_out_in_order() {
        assert_eq!(
            pushed(&[(5, 0), (7, 0), (6, 1), (8, 1), (7, 2)]),
            [5, 6, 7, 7, 8]
        );
    }

    #[test]
    fn another_clock_follows_after_the_pause_of_arrival() {
        let order = pushed(&[(100, 1000), (101, 1001), (1, 1011), (2, 1012)]);
        assert_eq!(order, [100, 101, 111, 112]);
    }
}
