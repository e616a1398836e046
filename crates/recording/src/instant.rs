//! The events of one instant, put into their order.

use crate::event::{Event, SensorKind};

/// The events of one stamp, at most one a sensor, taken out in [`SensorKind::ALL`] order.
#[derive(Default)]
pub(crate) struct Instant {
    slots: [Option<Event>; SensorKind::ALL.len()],
    /// Bit `i` is set while slot `i` is full.
    full: u32,
    time_ns: i64,
}

impl Instant {
    pub(crate) fn accepts(&self, time_ns: i64) -> bool {
        self.full == 0 || self.time_ns == time_ns
    }

    pub(crate) fn put(&mut self, event: Event) {
        let slot = event.sample.kind().order();
        self.slots[slot] = Some(event);
        self.full |= 1 << slot;
        self.time_ns = event.time_ns;
    }

    pub(crate) fn take(&mut self) -> Option<Event> {
        if self.full == 0 {
            return None;
        }
        let slot = self.full.trailing_zeros() as usize;
        self.full &= self.full - 1;
        self.slots[slot].take()
    }
}
