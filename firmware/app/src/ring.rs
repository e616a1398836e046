//! A queue of bytes between an interrupt and the main loop: one side pushes, the other pops.

use core::sync::atomic::{AtomicU8, AtomicU32, AtomicUsize, Ordering};

/// Holds up to `N` bytes, a power of two. One context may push and one may pop at a time, which an
/// interrupt and the main loop do; more would mix up bytes, but never read or write elsewhere.
#[derive(Debug)]
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Bytes ever pushed and popped, wrapping.
    pushed: AtomicUsize,
    popped: AtomicUsize,
    lost: AtomicU32,
}

impl<const N: usize> Ring<N> {
    /// An empty queue.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two()) };
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            pushed: AtomicUsize::new(0),
            popped: AtomicUsize::new(0),
            lost: AtomicU32::new(0),
        }
    }

    /// Puts a byte at the end; when the queue is full the byte is lost and counted, `false`.
    pub fn push(&self, byte: u8) -> bool {
        let pushed = self.pushed.load(Ordering::Relaxed);
        let popped = self.popped.load(Ordering::Acquire);
        let free = pushed.wrapping_sub(popped) < N;
        if let Some(slot) = self.bytes.get(pushed % N).filter(|_| free) {
            slot.store(byte, Ordering::Relaxed);
            self.pushed.store(pushed.wrapping_add(1), Ordering::Release);
        } else {
            self.count_lost();
        }
        free
    }

    /// Takes the byte at the front.
    pub fn pop(&self) -> Option<u8> {
        let popped = self.popped.load(Ordering::Relaxed);
        let pushed = self.pushed.load(Ordering::Acquire);
        if pushed == popped {
            return None;
        }
        let byte = self.bytes.get(popped % N)?.load(Ordering::Relaxed);
        self.popped.store(popped.wrapping_add(1), Ordering::Release);
        Some(byte)
    }

    /// Bytes for which there is room.
    #[must_use]
    pub fn free(&self) -> usize {
        let pushed = self.pushed.load(Ordering::Relaxed);
        let popped = self.popped.load(Ordering::Acquire);
        N - pushed.wrapping_sub(popped).min(N)
    }

    /// Counts a byte that was lost before it came here: the line's receiver overran.
    pub fn count_lost(&self) {
        let lost = self.lost.load(Ordering::Relaxed);
        self.lost.store(lost.wrapping_add(1), Ordering::Relaxed);
    }

    /// Bytes lost since the start, wrapping.
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_out_in_order_round_after_round() {
        let ring = Ring::<8>::new();
        for round in 0..100_u8 {
            for byte in 0..5 {
                assert!(ring.push(round.wrapping_mul(5).wrapping_add(byte)));
            }
            for byte in 0..5 {
                assert_eq!(ring.pop(), Some(round.wrapping_mul(5).wrapping_add(byte)));
            }
            assert_eq!(ring.pop(), None);
        }
        assert_eq!(ring.lost(), 0);
    }

    #[test]
    fn a_full_queue_loses_the_newest_and_counts_it() {
        let ring = Ring::<4>::new();
        for byte in 0..7 {
            assert_eq!(ring.push(byte), byte < 4);
        }
        assert_eq!((ring.lost(), ring.free()), (3, 0));
        assert_eq!([ring.pop(), ring.pop()], [Some(0), Some(1)]);
        assert_eq!(ring.free(), 2);
    }
}
