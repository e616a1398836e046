//! NIS gate with a time-out: refuse outliers, but never lock out for ever.
//!
//! Rejecting is best while the state is good, and fatal once it is not: a filter that is wrong
//! refuses exactly the measurements that would mend it. After [`Gate::timeout_s`] of nothing but
//! rejections the gate therefore lets measurements through with their noise variance scaled by
//! NIS / threshold, until one passes on its own.
//! Derivation: `docs/derivations/mekf.md`, section on gates.

use crate::scalar::Scalar;

/// A gate's settings.
///
/// ```
/// use northing_core::kalman::{Gate, GateDecision, GateState};
///
/// let gate = Gate { nis_threshold: 11.34, timeout_s: 2.0 }; // 99 % of chi-square, three degrees of freedom
/// let mut state = GateState::default();
/// assert_eq!(gate.decide(&mut state, 3.0), GateDecision::Accept);
/// assert_eq!(gate.decide(&mut state, 34.02), GateDecision::Reject);
/// state.advance(2.5);
/// assert!(matches!(gate.decide(&mut state, 34.02), GateDecision::Inflate(factor) if factor > 2.9));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gate<T> {
    /// NIS above which a measurement is refused; zero turns the gate off.
    pub nis_threshold: T,
    /// Seconds of uninterrupted rejection after which measurements are inflated instead.
    pub timeout_s: T,
}

/// How long a gate has been refusing.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GateState<T> {
    rejecting: bool,
    rejecting_for_s: T,
}

/// What to do with one measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GateDecision<T> {
    /// Use it as it is.
    Accept,
    /// Use it with its noise variance scaled by this factor (above one).
    Inflate(T),
    /// Refuse it.
    Reject,
}

impl<T: Scalar> Default for GateState<T> {
    fn default() -> Self {
        Self {
            rejecting: false,
            rejecting_for_s: T::zero(),
        }
    }
}

impl<T: Scalar> GateState<T> {
    /// Lets `dt` seconds pass.
    #[inline]
    pub fn advance(&mut self, dt: T) {
        if self.rejecting {
            self.rejecting_for_s += dt;
        }
    }

    /// Seconds since the rejections began; zero while measurements pass.
    #[inline]
    pub fn rejecting_for_s(&self) -> T {
        self.rejecting_for_s
    }
}

impl<T: Scalar> Gate<T> {
    /// Decides about a measurement with normalised innovation squared `nis` (M15); after the
    /// time-out it is taken with its noise inflated by the factor (M15b).
    #[inline]
    pub fn decide(&self, state: &mut GateState<T>, nis: T) -> GateDecision<T> {
        if self.nis_threshold <= T::zero() || nis <= self.nis_threshold {
            *state = GateState::default();
            GateDecision::Accept
        } else if state.rejecting && state.rejecting_for_s >= self.timeout_s {
            GateDecision::Inflate(nis / self.nis_threshold)
        } else {
            state.rejecting = true;
            GateDecision::Reject
        }
    }
}

/// A gate for measurements that come seldom: it refuses a number of them in a row, and then believes
/// them instead of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CountedGate {
    rejected: u8,
}

impl CountedGate {
    /// Decides about a measurement with normalised innovation squared `nis`. Above `threshold` (zero: no
    /// gate) it is refused, `most` times in a row; the next one is let in with `Inflate(nis / threshold)`,
    /// and what is to be inflated is the caller's choice.
    #[inline]
    pub fn decide<T: Scalar>(&mut self, nis: T, threshold: T, most: u8) -> GateDecision<T> {
        if threshold <= T::zero() || nis <= threshold {
            self.rejected = 0;
            GateDecision::Accept
        } else if self.rejected >= most {
            self.rejected = 0;
            GateDecision::Inflate(nis / threshold)
        } else {
            self.rejected += 1;
            GateDecision::Reject
        }
    }
}

/// Chi-square quantiles for gates and bands, by degrees of freedom: 95 %, 99 %, 99.9 %.
pub const CHI_SQUARE: [(u8, [f64; 3]); 3] = [
    (1, [3.841_459, 6.634_897, 10.827_566]),
    (2, [5.991_465, 9.210_340, 13.815_511]),
    (3, [7.814_728, 11.344_867, 16.266_236]),
];

#[cfg(test)]
mod tests {
    use super::*;

    const GATE: Gate<f64> = Gate {
        nis_threshold: 11.34,
        timeout_s: 3.0,
    };

    #[test]
    fn outlier_is_refused_and_the_next_good_one_passes() {
        let mut state = GateState::default();
        assert_eq!(GATE.decide(&mut state, 20.0), GateDecision::Reject);
        state.advance(1.0);
        assert_eq!(GATE.decide(&mut state, 2.0), GateDecision::Accept);
        assert!(state.rejecting_for_s() <= 0.0);
    }

    #[test]
    fn after_the_timeout_measurements_are_inflated_until_one_passes() {
        let mut state = GateState::default();
        for _ in 0..30 {
            assert_eq!(GATE.decide(&mut state, 22.68), GateDecision::Reject);
            state.advance(0.1 + 1e-9);
        }
        assert_eq!(GATE.decide(&mut state, 22.68), GateDecision::Inflate(2.0));
        assert_eq!(GATE.decide(&mut state, 11.0), GateDecision::Accept);
        assert_eq!(
            GATE.decide(&mut state, 22.68),
            GateDecision::Reject,
            "the clock starts again"
        );
    }

    #[test]
    fn a_counted_gate_refuses_so_many_in_a_row_and_then_believes() {
        let mut gate = CountedGate::default();
        for _ in 0..3 {
            assert_eq!(gate.decide(28.0, 14.0, 3), GateDecision::Reject);
        }
        assert_eq!(gate.decide(28.0, 14.0, 3), GateDecision::Inflate(2.0));
        assert_eq!(gate.decide(28.0, 14.0, 3), GateDecision::Reject);
        assert_eq!(gate.decide(1.0, 14.0, 3), GateDecision::Accept);
        for _ in 0..3 {
            assert_eq!(gate.decide(28.0, 14.0, 3), GateDecision::Reject);
        }
        assert_eq!(gate.decide(28.0, 0.0, 3), GateDecision::Accept, "no gate");
    }

    #[test]
    fn zero_threshold_is_no_gate() {
        let open = Gate {
            nis_threshold: 0.0,
            timeout_s: 3.0,
        };
        assert_eq!(
            open.decide(&mut GateState::default(), 1e9),
            GateDecision::Accept
        );
    }
}
