//! Tables with a row for every inertial sample, which tell each fix again in every row until the next comes.
//!
//! A receiver that stands tells the same digits again, too, but as seldom as it tells others: a fix that repeats itself much sooner is
//! one of a table (F23 in `docs/derivations/faults.md`).

use crate::restorable::{InvalidState, not_negative};
use crate::scalar::{Scalar, lit};

/// A position that repeats itself sooner than after this share of the usual time between two that differ is told again by a table, ...
const HELD_SHARE: f64 = 0.5;
/// ... which tells every position again; one that repeats itself after this share may be one of a receiver that stands: more than the one
/// fix that is due, less than two.
const HELD_SHARE_OF_A_TABLE: f64 = 1.5;
/// Weight of a longer time between two positions in the usual one; a shorter one is the usual one at once.
const LONGER: f64 = 0.1;
/// Longer times are all the same, s.
const LONGEST_S: f64 = 1e6;

/// Tells positions that a table tells again from those of a receiver that stands.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HeldFixes<T> {
    /// Seconds since a position counted; `None` before the first.
    since_told_s: Option<T>,
    /// Seconds since one that differed from the one before; `None` before the first.
    since_changed_s: Option<T>,
    /// The usual time between two positions that differ, s.
    interval_s: T,
    /// How often it was seen, up to two: the first may be an outage.
    intervals: u8,
    /// Whether positions are told again between.
    is_held: bool,
    /// Whether the last position that counted was.
    is_copied: bool,
}

impl<T: Scalar> Default for HeldFixes<T> {
    fn default() -> Self {
        Self {
            since_told_s: None,
            since_changed_s: None,
            interval_s: T::zero(),
            intervals: 0,
            is_held: false,
            is_copied: false,
        }
    }
}

impl<T: Scalar> HeldFixes<T> {
    /// Time goes on by `dt` seconds; what is not positive is none.
    pub fn advance(&mut self, dt: T) {
        if dt > T::zero() {
            for since in [&mut self.since_told_s, &mut self.since_changed_s] {
                *since = since.map(|since| (since + dt).min(lit(LONGEST_S)));
            }
        }
    }

    /// Whether a position that comes now, with the digits of the one before it or not, is told again by a table.
    pub fn is_told_again(&mut self, repeated: bool) -> bool {
        let told = self.since_told_s.unwrap_or_else(T::zero);
        let usual = self.interval_s;
        let is_known = repeated && self.intervals > 1;
        let is_sooner = |share: f64| is_known && told > T::zero() && told < usual * lit(share);
        self.is_copied |= is_sooner(HELD_SHARE);
        self.is_held |= self.is_copied;
        if self.is_held && is_sooner(HELD_SHARE_OF_A_TABLE) {
            return true;
        }
        self.since_told_s = Some(T::zero());
        // A position that none repeated: the table has ended.
        self.is_held &= self.is_copied;
        self.is_copied = false;
        if !repeated {
            self.learn_interval();
        }
        false
    }

    /// What a restored one has to be.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        not_negative("time since a position", &self.since_told_s)?;
        not_negative("time since a new position", &self.since_changed_s)?;
        not_negative("usual time between positions", &Some(self.interval_s))
    }

    fn learn_interval(&mut self) {
        let Some(changed) = self.since_changed_s.replace(T::zero()) else {
            return;
        };
        let usual = self.interval_s;
        let longer = usual + (changed.min(usual + usual) - usual) * lit(LONGER);
        self.interval_s = match self.intervals {
            0 => changed,
            _ => longer.min(changed),
        };
        self.intervals = (self.intervals + 1).min(2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many of so many positions count, `interval` seconds apart, each told so often.
    fn counted(held: &mut HeldFixes<f64>, positions: u32, interval: f64, told: u32) -> u32 {
        let mut count = 0;
        for k in 0..positions * told {
            count += u32::from(!held.is_told_again(k % told != 0));
            held.advance(interval / f64::from(told));
        }
        count
    }

    #[test]
    fn each_position_of_a_table_counts_once_from_the_third_on() {
        let mut held = HeldFixes::default();
        assert_eq!(counted(&mut held, 2, 1.0, 50), 100);
        assert_eq!(counted(&mut held, 100, 1.0, 50), 100);
    }

    #[test]
    fn a_receiver_that_stands_is_heard() {
        let mut held = HeldFixes::default();
        assert_eq!(counted(&mut held, 50, 1.0, 1), 50);
        held.is_told_again(false);
        held.advance(1.0);
        for _ in 0..500 {
            assert!(!held.is_told_again(true));
            held.advance(1.0);
        }
    }

    /// One position, hours without any, and then a receiver that stands: how often it tells is not known by the hours.
    #[test]
    fn an_outage_is_no_usual_time() {
        let mut held = HeldFixes::default();
        held.is_told_again(false);
        held.advance(7200.0);
        held.is_told_again(false);
        held.advance(1.0);
        for _ in 0..500 {
            assert!(!held.is_told_again(true));
            held.advance(1.0);
        }
    }
}
