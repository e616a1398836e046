//! Puts numbered messages back in order and drops duplicates.
//!
//! A gap is waited for until `longest_wait_ns` on the caller's clock or until `most_held` later
//! messages are there; then it counts as lost and the stream goes on. The clock is whatever the
//! caller passes: arrival time on a server, the messages' own stamps where a replay must give the
//! same result.

use std::collections::{BTreeMap, BTreeSet};

/// How many numbers of lost messages are remembered, to tell a late one from a duplicate.
const MOST_REMEMBERED: usize = 1024;
/// A number this far ahead is no gap but an invention of whoever sent it.
const FARTHEST_AHEAD: u64 = 1_000_000;

/// What became of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Placed<T> {
    /// These are next in order: the message and those that waited for it, or others whose wait is
    /// over. Empty while it waits for its predecessors.
    Ready(Vec<T>),
    /// It was seen before; it is dropped.
    Duplicate,
    /// It had been given up: it is handed back, but later ones are out already.
    Late(T),
}

/// Puts numbered messages back in order.
#[derive(Debug, Clone)]
pub struct Resequencer<T> {
    longest_wait_ns: i64,
    most_held: usize,
    /// The number that is next; `None` before the first message.
    next: Option<u64>,
    /// Messages ahead of `next`, with the time at which they came.
    held: BTreeMap<u64, (i64, T)>,
    given_up: BTreeSet<u64>,
    started: bool,
    lost: u64,
    duplicated: u64,
}

impl<T> Resequencer<T> {
    /// Waits for a gap at most `longest_wait_ns`, ns, and while at most `most_held` messages are held.
    #[must_use]
    pub const fn new(longest_wait_ns: i64, most_held: usize) -> Self {
        Self {
            longest_wait_ns,
            most_held,
            next: None,
            held: BTreeMap::new(),
            given_up: BTreeSet::new(),
            started: false,
            lost: 0,
            duplicated: 0,
        }
    }

    /// Places message `number` that came at `now_ns`.
    ///
    /// A stream is expected to start at 0; one that starts further on is taken up where it is
    /// after the wait, or at once when it is further on than `most_held`. A number absurdly far ahead
    /// is handed back as late and changes nothing.
    pub fn push(&mut self, number: u64, now_ns: i64, message: T) -> Placed<T> {
        if number == u64::MAX {
            return Placed::Late(message);
        }
        let next = *self.next.get_or_insert(if number > self.most_held as u64 {
            number
        } else {
            0
        });
        if number > next.saturating_add(FARTHEST_AHEAD) {
            return Placed::Late(message);
        }
        if number < next {
            if self.given_up.remove(&number) {
                self.lost = self.lost.saturating_sub(1);
                return Placed::Late(message);
            }
            self.duplicated += 1;
            return Placed::Duplicate;
        }
        if self.held.contains_key(&number) {
            self.duplicated += 1;
            return Placed::Duplicate;
        }
        self.held.insert(number, (now_ns, message));
        Placed::Ready(self.poll(now_ns))
    }

    /// The messages whose wait is over at `now_ns`.
    pub fn poll(&mut self, now_ns: i64) -> Vec<T> {
        let mut ready = self.in_order();
        while let Some(oldest_ns) = self.held.values().map(|(came_ns, _)| *came_ns).min() {
            let waited = now_ns.saturating_sub(oldest_ns) >= self.longest_wait_ns;
            if !waited && self.held.len() <= self.most_held {
                break;
            }
            self.skip_gap();
            ready.extend(self.in_order());
        }
        ready
    }

    /// All messages that are held, in order: the stream has ended.
    pub fn flush(&mut self) -> Vec<T> {
        let mut ready = self.in_order();
        while !self.held.is_empty() {
            self.skip_gap();
            ready.extend(self.in_order());
        }
        ready
    }

    /// Messages that never came, as far as known.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Messages that came more than once.
    #[must_use]
    pub const fn duplicated(&self) -> u64 {
        self.duplicated
    }

    /// Messages that wait for their predecessors.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.held.len()
    }

    fn in_order(&mut self) -> Vec<T> {
        let mut ready = Vec::new();
        let Some(mut next) = self.next else {
            return ready;
        };
        while let Some((_, message)) = self.held.remove(&next) {
            ready.push(message);
            self.started = true;
            // A number at the very end of its range has no successor; whatever follows is a duplicate.
            next = next.saturating_add(1);
        }
        self.next = Some(next);
        ready
    }

    /// Gives up what is missing before the first held message.
    fn skip_gap(&mut self) {
        let (Some(next), Some(&first)) = (self.next, self.held.keys().next()) else {
            return;
        };
        // Whoever comes late to a stream that ran already has lost nothing of it.
        if self.started {
            self.lost = self.lost.saturating_add(first - next);
            for number in (next..first).rev().take(MOST_REMEMBERED) {
                self.given_up.insert(number);
            }
            while self.given_up.len() > MOST_REMEMBERED {
                self.given_up.pop_first();
            }
        }
        self.next = Some(first);
    }
}

#[cfg(test)]
mod tests {
    use super::{Placed, Resequencer};
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn ready(numbers: &[u64]) -> Placed<u64> {
        Placed::Ready(numbers.to_vec())
    }

    #[test]
    fn messages_come_out_in_order_and_once() {
        let mut order = Resequencer::new(1_000, 8);
        assert_eq!(order.push(0, 0, 0), ready(&[0]));
        assert_eq!(order.push(2, 1, 2), ready(&[]));
        assert_eq!(order.push(2, 2, 2), Placed::Duplicate);
        assert_eq!(order.push(1, 3, 1), ready(&[1, 2]));
        assert_eq!(order.push(1, 4, 1), Placed::Duplicate);
        assert_eq!(order.push(3, 5, 3), ready(&[3]));
        assert_eq!((order.lost(), order.duplicated()), (0, 2));
    }

    #[test]
    fn a_gap_is_given_up_after_the_wait_and_its_message_handed_back_when_it_comes_after_all() {
        let mut order = Resequencer::new(1_000, 8);
        assert_eq!(order.push(0, 0, 0), ready(&[0]));
        assert_eq!(order.push(2, 10, 2), ready(&[]));
        assert!(order.poll(1_009).is_empty());
        assert_eq!(order.poll(1_010), [2]);
        assert_eq!(order.lost(), 1);
        assert_eq!(order.push(1, 1_020, 1), Placed::Late(1));
        assert_eq!(order.lost(), 0);
        assert_eq!(order.push(1, 1_030, 1), Placed::Duplicate);
    }

    #[test]
    fn a_gap_is_given_up_when_too_many_wait() {
        let mut order = Resequencer::new(i64::MAX, 2);
        assert_eq!(order.push(0, 0, 0), ready(&[0]));
        assert_eq!(order.push(5, 0, 5), ready(&[]));
        assert_eq!(order.push(7, 0, 7), ready(&[]));
        assert_eq!(order.push(6, 0, 6), ready(&[5, 6, 7]));
        assert_eq!(order.lost(), 4);
    }

    #[test]
    fn a_stream_that_runs_already_is_taken_up_where_it_is() {
        let mut order = Resequencer::new(1_000, 8);
        assert_eq!(order.push(100, 0, 100), ready(&[100]));
        assert_eq!((order.lost(), order.waiting()), (0, 0));
        let mut order = Resequencer::new(1_000, 8);
        assert_eq!(order.push(1, 0, 1), ready(&[]));
        assert_eq!(order.push(2, 1_000, 2), ready(&[1, 2]));
        assert_eq!(order.lost(), 0);
    }

    #[test]
    fn the_end_of_the_stream_gives_what_is_held() {
        let mut order = Resequencer::new(1_000, 8);
        for number in [0, 3, 2, 6] {
            order.push(number, 0, number);
        }
        assert_eq!(order.flush(), [2, 3, 6]);
        assert_eq!(order.waiting(), 0);
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(0x5e9),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn nothing_comes_out_twice_or_out_of_order(numbers in proptest::collection::vec(prop_oneof![0..40_u64, any::<u64>()], 0..200)) {
            let mut order = Resequencer::new(20, 4);
            let mut out = Vec::new();
            for (now, number) in numbers.iter().enumerate() {
                if let Placed::Ready(ready) = order.push(*number, now as i64, *number) {
                    out.extend(ready);
                }
                prop_assert!(order.waiting() <= 4);
            }
            out.extend(order.flush());
            prop_assert!(out.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}
