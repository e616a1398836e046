//! Samples whose stamps are seconds off, kept until it is clear what they are.

use std::collections::BTreeSet;

use northing_recording::Event;

/// So many different stamps that agree are accepted.
const STAMPS: usize = 5;
/// Stamps that agree are this close to the one before, ns.
const NEAR_NS: u64 = 10_000_000_000;
/// A clock that started again goes on for so long before it is accepted, ns: a late batch does not.
const NEW_START_NS: u64 = 1_000_000_000;
/// So many samples are a clock that started again, however close their stamps.
const MOST: usize = 2000;

/// Samples that were put aside; all ahead of the device's time, or all behind it.
#[derive(Debug, Clone, Default)]
pub(super) struct Aside {
    pub(super) events: Vec<Event>,
    pub(super) ahead: bool,
    stamps: BTreeSet<i64>,
}

impl Aside {
    /// Whether a sample goes with those that are here already.
    pub(super) fn agrees(&self, event: &Event, ahead: bool) -> bool {
        self.events.last().is_none_or(|last| {
            self.ahead == ahead && last.time_ns.abs_diff(event.time_ns) <= NEAR_NS
        })
    }

    /// Adds a sample. Returns whether there are enough to be accepted.
    pub(super) fn add(&mut self, event: &Event, ahead: bool) -> bool {
        self.ahead = ahead;
        self.events.push(*event);
        self.stamps.insert(event.time_ns);
        let span_ns = match (self.stamps.first(), self.stamps.last()) {
            (Some(first), Some(last)) => last.abs_diff(*first),
            _ => 0,
        };
        let several = self.stamps.len() >= STAMPS && (ahead || span_ns >= NEW_START_NS);
        several || self.events.len() >= MOST
    }
}
