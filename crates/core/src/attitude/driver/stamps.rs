//! Stamps that go back or leap ahead: which samples are refused, and how the time finds back.

use nalgebra::{UnitQuaternion, Vector3};

use super::holes::{HOLE_INTERVALS, LOST_RAD};
use super::{AttitudeDriver, AttitudeEstimator};
use crate::faults::leaping_stamp::Stamp;
use crate::faults::{Fault, FaultKind, FaultySensor};
use crate::geometry::{rotation, so3};
use crate::scalar::{Scalar, lit, seconds};

/// A stamp that is ahead of all samples by more than so many times the longest continuous interval waits until another
/// one goes on from it.
const LEAP_GAPS: f64 = 10.0;

/// A run of gyroscope samples behind a stamp that may be false, or of a clock that may have been set back.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Behind<T: Scalar> {
    pub(super) first_ns: i64,
    pub(super) last_ns: i64,
    /// The last rate, rad/s.
    pub(super) rate: Vector3<T>,
    /// The turn from the first to the last.
    pub(super) turn: UnitQuaternion<T>,
}

impl<T: Scalar, E: AttitudeEstimator<T>> AttitudeDriver<T, E> {
    /// Notes a sample that is not newer than the last one. The samples up to this one once they have gone on for longer than a gap:
    /// the stamp of the last one was false then, or the clock was set back.
    pub(super) fn goes_on_behind(&mut self, time_ns: i64, rate: &Vector3<T>) -> Option<Behind<T>> {
        if self.memory.last_rate == Some((time_ns, *rate)) {
            // The last one again, at the end of some that were sent twice.
            self.memory.behind = None;
            return None;
        }
        let before = self.memory.behind;
        let before =
            before.filter(|run| time_ns > run.last_ns && !self.is_gap(run.last_ns, time_ns));
        self.memory.behind = Some(Behind {
            first_ns: before.map_or(time_ns, |run| run.first_ns),
            last_ns: time_ns,
            rate: *rate,
            turn: before.map_or_else(UnitQuaternion::identity, |run| {
                let mean = (run.rate + rate) * lit::<T>(0.5);
                let turn = so3::exp(&(mean * seconds::<T>(run.last_ns, time_ns)));
                rotation::renormalize(&(run.turn * turn))
            }),
        });
        before.filter(|before| self.is_gap(before.first_ns, time_ns))
    }

    /// A newer sample, which may go on from some that were refused: a clock that was set back by less than a gap. Or they came late,
    /// and their turn has been made up for: it is not applied, but may be missing.
    pub(super) fn leave_behind(&mut self, time_ns: i64) {
        let Some(run) = self.memory.behind.take() else {
            return;
        };
        let usual = self.memory.checks.gyroscope.interval_s();
        let joint: T = seconds(run.last_ns, time_ns);
        if usual.is_some_and(|usual| joint > usual * lit(HOLE_INTERVALS)) {
            return;
        }
        let time: T = seconds(run.first_ns, run.last_ns);
        let turn = so3::log(&run.turn) - self.rate_at_rest() * time;
        self.widen(turn.norm_squared());
    }

    /// Goes through samples that were refused, up to the last of them. How long the clock stood before the first of them nobody
    /// knows: that is a hole of the length of a gap.
    pub(super) fn catch_up(&mut self, run: &Behind<T>) {
        self.memory.behind = None;
        let before = self.memory.last_rate.map_or(run.rate, |(_, rate)| rate);
        let checks = &mut self.memory.checks;
        for check in [
            &mut checks.gyroscope,
            &mut checks.accelerometer,
            &mut checks.magnetometer,
        ] {
            check.interrupt();
        }
        checks.noise.interrupt();
        self.memory.last_rate = Some((run.last_ns, run.rate));
        self.memory.now_ns = Some(run.last_ns);
        self.forget_stamps_ahead_of(run.last_ns, T::zero());
        let still = self.rate_at_rest();
        let [before, after] = [before, run.rate].map(|rate| rate - still);
        let gap = self.config.gap_limit_s;
        let motion = &self.memory.checks.motion;
        let variance = motion.between(&before, &after, gap).variance;
        self.widen(variance);
        let time: T = seconds(run.first_ns, run.last_ns);
        self.propagate_in_steps(&(so3::log(&run.turn) / time), time);
        self.memory.checks.bias.interrupt();
        self.memory.checks.log.happened(Fault {
            sensor: FaultySensor::Gyroscope,
            kind: FaultKind::Missing,
            from_ns: run.first_ns,
            until_ns: run.last_ns,
            is_over: true,
            size: time,
        });
        if variance > lit(LOST_RAD * LOST_RAD) {
            self.realign(run.last_ns, gap);
        }
    }

    /// Whether a stamp is so far ahead of all samples that it is not used before another one goes on from it.
    #[inline]
    pub(super) fn leaps(&mut self, sensor: Option<FaultySensor>, time_ns: i64) -> bool {
        // One that is not ahead never does: of sensors with one clock only the first is looked at.
        self.memory.now_ns.is_some_and(|now| now < time_ns) && self.leaps_ahead(sensor, time_ns)
    }

    fn leaps_ahead(&mut self, sensor: Option<FaultySensor>, time_ns: i64) -> bool {
        let limit = self.config.gap_limit_s * lit(LEAP_GAPS);
        let memory = &mut self.memory;
        match (memory.leaping).look(sensor, memory.now_ns, time_ns, limit) {
            Stamp::GoesOn | Stamp::Refutes(None) => false,
            Stamp::Refutes(Some(fault)) => {
                memory.checks.log.happened(fault);
                false
            }
            Stamp::Doubted => true,
        }
    }

    /// Takes back stamps that lie further ahead of a gyroscope sample than a gap.
    pub(super) fn forget_the_future(&mut self, time_ns: i64) {
        if self
            .memory
            .now_ns
            .is_some_and(|now| self.is_gap(time_ns, now))
        {
            self.memory.now_ns = Some(
                self.memory
                    .last_rate
                    .map_or(time_ns, |(last_ns, _)| last_ns),
            );
            self.memory.passed_on = Vector3::zeros();
            self.memory.checks.turned = Vector3::zeros();
        }
        self.forget_stamps_ahead_of(time_ns, self.config.gap_limit_s);
        let aligning = self.memory.aligning.as_ref();
        let since = aligning.map(|aligning| aligning.since_ns);
        if since.is_some_and(|since| self.is_gap(time_ns, since)) {
            self.memory.aligning = None;
            self.memory.is_realigning = false;
        }
    }

    /// Takes back stamps of other sensors that lie further ahead than a limit (s).
    fn forget_stamps_ahead_of(&mut self, time_ns: i64, limit: T) {
        for last in [
            &mut self.memory.last_force_ns,
            &mut self.memory.last_field_ns,
            &mut self.memory.last_heading_ns,
        ] {
            if last.is_some_and(|last| is_gap(time_ns, last, limit)) {
                *last = None;
            }
        }
    }

    #[inline]
    fn is_gap(&self, from_ns: i64, to_ns: i64) -> bool {
        is_gap(from_ns, to_ns, self.config.gap_limit_s)
    }
}

/// Whether a stamp is further ahead of another than a limit (s). Nearly always it is not ahead at all.
#[inline]
fn is_gap<T: Scalar>(from_ns: i64, to_ns: i64, limit: T) -> bool {
    to_ns > from_ns && seconds::<T>(from_ns, to_ns) > limit
}
