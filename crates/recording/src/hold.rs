//! Puts events of a log in order that come up to a few seconds late.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::event::{Event, Sample};

/// Events that wait for earlier ones; those of one stamp come out as they went in.
pub(crate) struct Hold {
    waiting: BinaryHeap<Reverse<Waiting>>,
    /// How long an event waits, ns of the log's own time.
    longest_ns: i64,
    sequence: u64,
    latest_ns: i64,
}

/// An event that waits for its turn.
struct Waiting {
    time_ns: i64,
    sequence: u64,
    sample: Sample,
}

impl Hold {
    pub(crate) fn new(longest_ns: i64) -> Self {
        Self {
            waiting: BinaryHeap::new(),
            longest_ns,
            sequence: 0,
            latest_ns: i64::MIN,
        }
    }

    pub(crate) fn put(&mut self, time_ns: i64, sample: Sample) {
        self.sequence += 1;
        self.latest_ns = self.latest_ns.max(time_ns);
        self.waiting.push(Reverse(Waiting {
            time_ns,
            sequence: self.sequence,
            sample,
        }));
    }

    /// The next event for which nothing earlier is expected any more.
    pub(crate) fn take(&mut self, at_end: bool) -> Option<Event> {
        let Reverse(first) = self.waiting.peek()?;
        if !at_end && self.latest_ns.saturating_sub(first.time_ns) < self.longest_ns {
            return None;
        }
        self.waiting.pop().map(|Reverse(first)| Event {
            time_ns: first.time_ns,
            sample: first.sample,
        })
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.time_ns, self.sequence).cmp(&(other.time_ns, other.sequence))
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
