//! Vectors that the world holds still (gravity, the magnetic field), carried from one moment to the next by the gyroscope.
//!
//! Where the gyroscope turns the body by `C = now_from_then` between two moments, a vector that keeps its direction in the world
//! goes from `v1` to `C v1` in body axes. What is measured instead says which sensor errors there are; to first order, of an
//! offset `b` of the vector sensor in body axes, a bias `w` and relative scale errors `k` of the gyroscope's axes,
//!
//! ```text
//! v2 - C v1  =  (I - C) b  -  [C v1]x (B w + K k)                                              (1)
//! B = integral of C(now, t) dt,      K = integral of C(now, t) diag(rate) dt                   (2)
//! ```
//!
//! At most [`MOST`] pairs are kept; of more, every other one is given up, so that memory is bounded and all of a recording counts.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::geometry::so3;

/// Pairs that are kept.
pub const MOST: usize = 400;

/// A turn as the gyroscope says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// `C`.
    pub now_from_then: UnitQuaternion<f64>,
    /// `B` of (2), s.
    pub by_bias: Matrix3<f64>,
    /// `K` of (2), rad.
    pub by_scale: Matrix3<f64>,
    /// The angle gone through, rad: no less than that of `C`.
    pub turned_rad: f64,
}

impl Default for Turn {
    fn default() -> Self {
        Self {
            now_from_then: UnitQuaternion::identity(),
            by_bias: Matrix3::zeros(),
            by_scale: Matrix3::zeros(),
            turned_rad: 0.0,
        }
    }
}

impl Turn {
    /// At this rate (rad/s) for so long.
    fn at(rate: &Vector3<f64>, seconds: f64) -> Self {
        let angle = rate * seconds;
        Self {
            now_from_then: so3::exp(&angle).inverse(),
            by_bias: Matrix3::identity() * seconds,
            by_scale: Matrix3::from_diagonal(&angle),
            turned_rad: angle.norm(),
        }
    }

    /// This one, and another after it.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        if self.by_bias == Matrix3::zeros() {
            // No time has passed yet.
            return *next;
        }
        let c = next.matrix();
        Self {
            now_from_then: next.now_from_then * self.now_from_then,
            by_bias: c * self.by_bias + next.by_bias,
            by_scale: c * self.by_scale + next.by_scale,
            turned_rad: self.turned_rad + next.turned_rad,
        }
    }

    /// `C`.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        *self.now_from_then.to_rotation_matrix().matrix()
    }
}

/// Turns less than this (rad) say nothing of an offset in body axes: what a gyroscope's noise makes of them is as large as the
/// difference that the offset would make.
const LEAST_TURN_RAD: f64 = 0.1;

/// Two moments and the turn between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Stamps, ns.
    pub then_ns: i64,
    /// See [`Self::then_ns`].
    pub now_ns: i64,
    /// Measured then, in body axes.
    pub then: Vector3<f64>,
    /// Measured now, in body axes.
    pub now: Vector3<f64>,
    /// Between them.
    pub turn: Turn,
    /// Variance of the difference per axis as the moments themselves say, in the square of the vector's unit.
    pub variance: f64,
}

impl Pair {
    /// `C v1`.
    #[must_use]
    pub fn carried(&self) -> Vector3<f64> {
        self.turn.now_from_then * self.then
    }

    /// `v2 - C v1`.
    #[must_use]
    pub fn difference(&self) -> Vector3<f64> {
        self.now - self.carried()
    }

    /// Whether the turn is large enough to say something of errors in body axes.
    #[must_use]
    pub fn is_turned(&self) -> bool {
        self.turn.now_from_then.angle() > LEAST_TURN_RAD
    }

    /// What multiplies an offset in (1).
    #[must_use]
    pub fn by_offset(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.turn.matrix()
    }

    /// What multiplies the gyroscope's bias in (1).
    #[must_use]
    pub fn by_bias(&self) -> Matrix3<f64> {
        -so3::skew(&self.carried()) * self.turn.by_bias
    }

    /// What multiplies the gyroscope's scale errors in (1).
    #[must_use]
    pub fn by_scale(&self) -> Matrix3<f64> {
        -so3::skew(&self.carried()) * self.turn.by_scale
    }
}

/// The pairs of one sensor, in bounded memory.
#[derive(Debug, Clone, Default)]
pub struct Pairs {
    kept: Vec<Pair>,
    /// One pair in so many is kept, less one.
    left_out: u32,
    since: u32,
}

impl Pairs {
    /// Takes the next one.
    pub fn add(&mut self, pair: Pair) {
        self.since += 1;
        if self.since <= self.left_out {
            return;
        }
        self.since = 0;
        self.kept.push(pair);
        if self.kept.len() >= MOST {
            let mut keep = false;
            self.kept.retain(|_| {
                keep = !keep;
                keep
            });
            self.left_out = 2 * self.left_out + 1;
        }
    }

    /// Those that are kept, in time order.
    #[must_use]
    pub fn kept(&self) -> &[Pair] {
        &self.kept
    }
}

/// The turn of the body as the gyroscope says, up to the stamps of other sensors.
#[derive(Debug, Clone, Default)]
pub struct Turning {
    last: Option<(i64, Vector3<f64>)>,
    /// Stamp of the gyroscope's own last sample, and of the first that had its rate.
    sampled_ns: i64,
    same_since_ns: i64,
    /// Usual interval of the gyroscope, s.
    interval_s: f64,
    since: Turn,
    /// Samples were missing since.
    broken: bool,
}

/// Longer without a sample, or with one that repeats itself while the body turns, nobody knows the turn, s; of a slow gyroscope longer than
/// so many usual intervals.
const BREAK_S: f64 = 0.1;
const BREAK_INTERVALS: f64 = 3.0;
/// A rate beyond this (rad/s) is never the same twice; a slower one may be, of a sensor with coarse values.
const TURNING_RAD_S: f64 = 0.1;

impl Turning {
    /// Takes an angular rate, rad/s; `lost` where it cannot be trusted.
    pub fn rate(&mut self, time_ns: i64, rate: &Vector3<f64>, lost: bool) {
        if let Some((last_ns, last)) = self.last {
            self.go_on(last_ns, time_ns, &((last + rate) * 0.5));
            let is_frozen = last == *rate && rate.norm() > TURNING_RAD_S;
            if !is_frozen {
                self.same_since_ns = time_ns;
            }
            self.broken |=
                self.is_long(self.sampled_ns, time_ns) || self.is_long(self.same_since_ns, time_ns);
            self.learn_interval(time_ns);
        } else {
            self.same_since_ns = time_ns;
        }
        self.broken |= lost;
        self.sampled_ns = time_ns;
        self.last = Some((time_ns, *rate));
    }

    /// The turn up to a stamp since the last time it was asked for; none where samples were missing.
    pub fn until(&mut self, time_ns: i64) -> Option<Turn> {
        let (last_ns, last) = self.last?;
        // Of when the gyroscope spoke last, however often the others have since.
        self.broken |= self.is_long(self.sampled_ns, time_ns);
        self.go_on(last_ns, time_ns, &last);
        self.last = Some((last_ns.max(time_ns), last));
        let turn = core::mem::take(&mut self.since);
        (!core::mem::take(&mut self.broken)).then_some(turn)
    }

    /// The rate of the last sample, rad/s.
    #[must_use]
    pub fn rate_rad_s(&self) -> f64 {
        self.last.map_or(0.0, |(_, rate)| rate.norm())
    }

    fn is_long(&self, from_ns: i64, to_ns: i64) -> bool {
        let dt = to_ns.saturating_sub(from_ns) as f64 * 1e-9;
        dt > BREAK_S.max(BREAK_INTERVALS * self.interval_s)
    }

    fn learn_interval(&mut self, time_ns: i64) {
        let dt = time_ns.saturating_sub(self.sampled_ns) as f64 * 1e-9;
        if self.interval_s > 0.0 {
            // A hole counts as two intervals: a rate that changes is learnt all the same.
            self.interval_s += (dt.clamp(0.0, 2.0 * self.interval_s) - self.interval_s) / 16.0;
        } else {
            self.interval_s = dt.clamp(0.0, BREAK_S * 2.0);
        }
    }

    fn go_on(&mut self, from_ns: i64, to_ns: i64, rate: &Vector3<f64>) {
        let dt = to_ns.saturating_sub(from_ns) as f64 * 1e-9;
        if dt > 0.0 {
            self.since = self.since.then(&Turn::at(rate, dt));
        }
    }
}

#[cfg(test)]
mod turning_tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// The magnetometer goes on at 50 Hz while the gyroscope is silent, or repeats itself, for a second: of these turns nothing is known.
    #[test]
    fn a_gyroscope_that_is_silent_or_frozen_breaks_the_turn_though_others_go_on() {
        for is_frozen in [false, true] {
            let mut turning = Turning::default();
            let mut known = Vec::new();
            for k in 0..300 {
                let in_fault = (100..200).contains(&k);
                let rate = if in_fault {
                    1.0
                } else {
                    1.0 + 0.01 * f64::from(k)
                };
                if !in_fault || is_frozen {
                    turning.rate(i64::from(k) * 10 * MS, &(Vector3::z() * rate), false);
                }
                if k % 2 == 0 {
                    known.push((k, turning.until(i64::from(k) * 10 * MS + MS).is_some()));
                }
            }
            let unknown: Vec<_> = known.iter().filter(|(_, is_known)| !is_known).collect();
            assert!(
                unknown.iter().all(|(k, _)| (100..=202).contains(k)),
                "{unknown:?}"
            );
            assert!(unknown.len() >= 40, "{unknown:?}");
            assert!(!known[100].1 || is_frozen, "the first behind the hole");
        }
    }

    /// A gyroscope of five a second beside a magnetometer of fifty has no holes.
    #[test]
    fn a_slow_gyroscope_is_no_hole() {
        let mut turning = Turning::default();
        let mut unknown = 0;
        for k in 0..500_i64 {
            if k % 10 == 0 {
                turning.rate(
                    k * 20 * MS,
                    &(Vector3::z() * (0.5 + 0.001 * k as f64)),
                    false,
                );
            }
            unknown += i32::from(turning.until(k * 20 * MS + MS).is_none());
        }
        assert!(unknown <= 10, "{unknown}");
    }
}
