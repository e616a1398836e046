//! Puts events of a log in order that come up to a few seconds late.

use std::collections::BTreeMap;

use crate::event::{Event, Sample};
use crate::limits::WAITING;

/// Events that wait for earlier ones, [`WAITING`] at most; those of one stamp come out as they went in.
pub(crate) struct Hold {
    /// By stamp and by what went in first.
    waiting: BTreeMap<(i64, u64), Sample>,
    /// How long an event waits, ns of the log's own time.
    longest_ns: i64,
    sequence: u64,
    latest_ns: i64,
}

impl Hold {
    pub(crate) fn new(longest_ns: i64) -> Self {
        Self {
            waiting: BTreeMap::new(),
            longest_ns,
            sequence: 0,
            latest_ns: i64::MIN,
        }
    }

    pub(crate) fn put(&mut self, time_ns: i64, sample: Sample) {
        self.sequence += 1;
        self.latest_ns = self.latest_ns.max(time_ns);
        self.waiting.insert((time_ns, self.sequence), sample);
    }

    /// The next event for which nothing earlier is expected any more.
    pub(crate) fn take(&mut self, at_end: bool) -> Option<Event> {
        let is_full = self.waiting.len() > WAITING;
        let first = self.waiting.first_entry()?;
        let (time_ns, _) = *first.key();
        let is_waiting = self.latest_ns.saturating_sub(time_ns) < self.longest_ns;
        if !at_end && is_waiting && !is_full {
            return None;
        }
        let sample = first.remove();
        Some(Event { time_ns, sample })
    }
}

#[cfg(test)]
mod tests {
    use super::Hold;
    use crate::event::Sample;

    #[test]
    fn late_events_come_in_order_and_early_ones_wait() {
        let mut hold = Hold::new(10);
        for (order, time_ns) in [5, 3, 12, 3, 14].into_iter().enumerate() {
            hold.put(time_ns, Sample::Pressure(order as f64));
        }
        let mut taken = Vec::new();
        while let Some(event) = hold.take(false) {
            taken.push((event.time_ns, event.sample));
        }
        let of = |time_ns, order| (time_ns, Sample::Pressure(order));
        assert_eq!(taken, [of(3, 1.0), of(3, 3.0)]);
        let rest = std::iter::from_fn(|| hold.take(true));
        assert_eq!(
            rest.map(|event| event.time_ns).collect::<Vec<_>>(),
            [5, 12, 14]
        );
    }
}
