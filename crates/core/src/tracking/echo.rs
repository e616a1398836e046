//! Where on a target its echo comes from, and how much of that is still the same in the next scan.
//!
//! A detection's place on the target has a standard deviation ([`DetectionNoise::extent_std_m`]). Where the place is new in every scan
//! it averages out. Where it drifts over the body, as that of a laser scanner does on a walker, it does not: it looks like a motion of
//! the target, and a filter that takes it for white noise is overconfident. Nobody tells a tracker which of the two its sensor does;
//! the detections do. From one scan to the next a place that stays changes by less than one that is new ([`EchoMemory`]).
//!
//! A place that stays is a consider state of each target, as the own ship's pose is (Schmidt): it is never estimated, its covariance
//! with the target's error is kept. Equations: `docs/derivations/association.md`, section 9.

use nalgebra::SMatrix;

use super::coordinated_turn::STATES;
use super::detection::DetectionNoise;
use super::seen::{FARTHEST_APART, Seen};
use crate::scalar::{Scalar, lit};

/// Covariance of a target's error with where its echo comes from (north, east), m times the unit of the state.
pub type EchoCovariance<T> = SMatrix<T, STATES, 2>;

/// Shares of an echo's place that may be kept from scan to scan; the first is that of white noise.
const KEPT: [f64; 4] = [0.0, 0.7, 0.9, 0.97];
/// Log-likelihood by which a share has to surpass white noise before it is used: a thousand to one.
const CONVINCING: f64 = 7.0;
/// And below that of the likeliest share, by which one is refuted: twenty to one.
const POSSIBLE: f64 = 3.0;
/// Two differences in a row share one scan: each says about half as much as it would alone.
const OVERLAP: f64 = 0.5;
/// Pairs of scans that are remembered.
const MEMORY: f64 = 1000.0;
/// A pair that is so many usual intervals apart has a scan between.
const MISSED: f64 = 1.5;
/// Sensors that are learnt about: those beyond keep their white noise.
const SENSORS: usize = 4;

/// What is known of the echoes of one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Echo<T> {
    /// Variance on each axis of the place that stays, m^2; 0 where it is new in every scan.
    pub(super) lasting: T,
    /// The noise that is new in every scan.
    pub(super) noise: DetectionNoise<T>,
}

impl<T: Scalar> Echo<T> {
    /// One whose place is new in every scan.
    pub(super) fn white(noise: &DetectionNoise<T>) -> Self {
        Self {
            lasting: T::zero(),
            noise: *noise,
        }
    }
}

/// How much of an echo's place each sensor keeps from scan to scan, learnt from the targets that it sees twice in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct EchoMemory<T> {
    sensors: [Option<SensorEchoes<T>>; SENSORS],
}

/// The same of one sensor, which is known by its noise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct SensorEchoes<T> {
    /// Noise of the sensor.
    pub noise: DetectionNoise<T>,
    /// Time between two looks at a target, s; 0 before there was a pair.
    pub interval_s: T,
    /// Log-likelihood of each share over that of white noise, by component, never below zero.
    evidence: [[T; KEPT.len()]; 2],
}

impl<T: Scalar> Default for EchoMemory<T> {
    /// Every place is new in every scan.
    fn default() -> Self {
        Self {
            sensors: [None; SENSORS],
        }
    }
}

impl<T: Scalar> SensorEchoes<T> {
    /// Share of the place that is kept from one look to the next: the least that the detections do not refute; 0 unless they refute
    /// that. More than is true would make gates too narrow.
    pub fn kept(&self) -> T {
        let evidence = |i: usize| self.evidence[0][i] + self.evidence[1][i];
        let most = (1..KEPT.len()).map(evidence).fold(T::zero(), T::max);
        if most <= lit(CONVINCING) {
            return T::zero();
        }
        let possible = |i: &usize| evidence(*i) >= most - lit(POSSIBLE);
        (1..KEPT.len())
            .find(possible)
            .map_or(T::zero(), |i| lit(KEPT[i]))
    }

    /// Whether so many seconds are those between two scans, none missed.
    fn is_pair(&mut self, dt: T) -> bool {
        if dt <= T::zero() {
            return false;
        }
        if self.interval_s <= T::zero() || dt * lit(MISSED) < self.interval_s {
            self.interval_s = dt;
        }
        let is_pair = dt <= self.interval_s * lit(MISSED);
        if is_pair {
            self.interval_s += (dt - self.interval_s) * lit(1.0 / 64.0);
        }
        is_pair
    }

    /// Takes the residuals of one target in two looks in a row (N1, N2).
    fn learn(&mut self, before: &Seen<T>, now: &Seen<T>) {
        let spread = (before.spread + now.spread) * lit::<T>(0.5);
        let change = now.kind.difference(&now.residual, &before.residual);
        for (i, change) in change.iter().enumerate() {
            let change = *change;
            let square = change * change * lit(0.5);
            let density = |kept: f64| {
                let variance = spread[i] + now.extent[i] * lit(1.0 - kept);
                (variance.ln() + square / variance) * lit(-0.5)
            };
            let white = density(0.0);
            if !(spread[i] > T::zero() && now.extent[i] > T::zero() && white.is_finite()) {
                continue;
            }
            for (evidence, kept) in self.evidence[i].iter_mut().zip(KEPT).skip(1) {
                let more = (density(kept) - white) * lit(OVERLAP);
                *evidence = (*evidence * lit(1.0 - 1.0 / MEMORY) + more).max(T::zero());
            }
        }
    }
}

impl<T: Scalar> EchoMemory<T> {
    /// The sensors that targets were seen with, at most four.
    pub fn sensors(&self) -> impl Iterator<Item = &SensorEchoes<T>> {
        self.sensors.iter().flatten()
    }

    /// What the echoes of a sensor with this noise are.
    pub(super) fn of(&self, noise: &DetectionNoise<T>) -> Echo<T> {
        let kept = self.sensors().find(|sensor| sensor.noise == *noise);
        if kept.is_none_or(|sensor| sensor.kept() <= T::zero()) {
            return Echo::white(noise);
        }
        Echo {
            lasting: noise.extent_std_m * noise.extent_std_m,
            noise: DetectionNoise {
                extent_std_m: T::zero(),
                ..*noise
            },
        }
    }

    /// Share of a place that stays which is still the same after `dt` seconds (N3).
    pub(super) fn kept(&self, dt: T) -> T {
        let each = self.sensors().map(|sensor| {
            let kept = sensor.kept();
            match kept > T::zero() && sensor.interval_s > T::zero() {
                true => kept.powf(dt / sensor.interval_s),
                false => T::zero(),
            }
        });
        each.fold(T::zero(), T::max)
    }

    /// Place of the sensor with this noise, which it gets when it has none; `None` when four others have them all.
    pub(super) fn place(&mut self, noise: &DetectionNoise<T>) -> Option<u8> {
        let is_own =
            |place: &Option<SensorEchoes<T>>| place.is_none_or(|sensor| sensor.noise == *noise);
        let place = self.sensors.iter().position(is_own)?;
        self.sensors[place].get_or_insert(SensorEchoes {
            noise: *noise,
            interval_s: T::zero(),
            evidence: [[T::zero(); KEPT.len()]; 2],
        });
        u8::try_from(place).ok()
    }

    /// Seconds from one scan of a sensor to the next; `None` before a target was seen twice in a row.
    pub(super) fn interval_s(&self, sensor: u8) -> Option<T> {
        let sensor = self.sensors.get(usize::from(sensor))?.as_ref()?;
        (sensor.interval_s > T::zero()).then_some(sensor.interval_s)
    }

    /// Takes a target that was seen twice by a sensor; from how many scans before, where they are few.
    pub(super) fn learn(&mut self, before: &Seen<T>, now: &Seen<T>) -> Option<u8> {
        let place = self.sensors.get_mut(usize::from(now.sensor))?;
        if (before.sensor, before.kind) != (now.sensor, now.kind) {
            return None;
        }
        let sensor = place.as_mut()?;
        let dt = now.time_s - before.time_s;
        if sensor.is_pair(dt) {
            sensor.learn(before, now);
        }
        let apart = dt / sensor.interval_s;
        let nearest = |scans: &u8| (apart - lit(f64::from(*scans))).abs() <= lit(0.5);
        (1..=FARTHEST_APART).find(nearest)
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.sensors().flat_map(|sensor| {
            let noise = &sensor.noise;
            let own = [
                &noise.range_std_m,
                &noise.bearing_std_rad,
                &noise.extent_std_m,
                &sensor.interval_s,
            ];
            own.into_iter().chain(sensor.evidence.iter().flatten())
        })
    }
}

#[cfg(test)]
mod tests;
