//! Aids of a GNSS/INS beside the receiver, heading, magnetometer, barometer, speed; and the stamps and gates of all.

use nalgebra::Vector3;

use super::{Aid, ERRORS, ErrorListener, GnssIns, ImuSamples, LONGEST_GAP_S, seconds};
use crate::kalman::feedback::ScaledState;
use crate::kalman::gate::CHI_SQUARE;
use crate::kalman::innovation::check_vector;
use crate::kalman::{Innovation, SkipReason};
use crate::navigation::STATES;
use crate::navigation::aiding::{barometer, body_velocity, heading, magnetic_field};
use crate::navigation::augmented_states::{
    BAROMETER_OFFSET, MAGNETIC_OFFSET, MOUNT_PITCH, MOUNT_YAW,
};
use crate::navigation::error_state::SparseMeasurement;
use crate::scalar::{Scalar, lit};

/// Faster than this (m/s) nothing moves that this is for.
pub(super) const FASTEST_M_S: f64 = 1e3;
/// Standard deviation of a barometer's offset before anything is known, m.
const UNKNOWN_OFFSET_STD_M: f64 = 100.0;

/// The 99.9 % bound of chi-square.
pub(super) fn bound<T: Scalar>(degrees_of_freedom: usize) -> T {
    let row = CHI_SQUARE.get(degrees_of_freedom.saturating_sub(1));
    lit(row.map_or(16.3, |(_, [_, _, bound])| *bound))
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Takes a true heading of the forward axis (rad, clockwise from north) with its standard deviation.
    pub fn heading(&mut self, time_ns: i64, heading: T, std: T) -> Innovation<T> {
        let checked =
            check_scalar(heading, std, 100.0).and_then(|()| self.accept(Aid::Heading, time_ns));
        if checked.is_ok() && self.memory.aligning {
            self.memory.level.heading(heading, std);
            let now = self.memory.now_ns.unwrap_or(time_ns);
            self.feed(seconds(time_ns, now));
            self.alignment.heading(heading, std);
        }
        let innovation = match checked.and_then(|()| self.make_ready()) {
            Ok(()) => {
                let then = self.instant(time_ns, T::zero());
                let made = heading::measurement(&then, heading, std * std);
                self.fuse_or_skip(Aid::Heading, made)
            }
            Err(reason) => Innovation::skipped(reason),
        };
        if innovation.outcome.is_fused() {
            self.memory.bias_steps.headed();
        }
        self.memory.counts[Aid::Heading as usize].count(&innovation);
        innovation
    }

    /// Takes a magnetic field (microtesla, body axes): its heading alone is used, and at most one an interval.
    /// What iron the body carries is learnt on the way.
    pub fn magnetometer(&mut self, time_ns: i64, magnetic_field: &Vector3<T>) -> Innovation<T> {
        let checked = check_vector(magnetic_field, lit(1e-6), lit(1e6))
            .and_then(|()| self.accept(Aid::Magnetometer, time_ns));
        if checked.is_ok() && self.memory.aligning {
            let (std, iron) = (
                self.config.magnetic_heading_std,
                self.config.magnetic_offset_std_ut,
            );
            self.memory.level.magnetic_field(magnetic_field, std, iron);
            self.align_with_magnetic_field(time_ns, magnetic_field);
        }
        let due = self.magnetic_is_due(time_ns);
        let ready = checked.and(if due { Ok(()) } else { Err(SkipReason::NotDue) });
        let innovation = match ready.and_then(|()| self.make_ready()) {
            Ok(()) => self.fuse_magnetic_field(time_ns, magnetic_field),
            Err(reason) => Innovation::skipped(reason),
        };
        self.memory.counts[Aid::Magnetometer as usize].count(&innovation);
        innovation
    }

    fn magnetic_is_due(&self, time_ns: i64) -> bool {
        // What carries the heading from one to the next is the gyroscope.
        if self.config.imu_samples == ImuSamples::None {
            return true;
        }
        let interval = self.config.magnetic_interval_s;
        // Half a millisecond early is in time: stamps jitter.
        let due = |last: i64| seconds::<T>(last, time_ns).abs() + lit(5e-4) >= interval;
        self.memory.last_magnetic_ns.is_none_or(due)
    }

    fn fuse_magnetic_field(&mut self, time_ns: i64, field: &Vector3<T>) -> Innovation<T> {
        let then = self.instant(time_ns, T::zero());
        let declination = self.config.declination.unwrap_or(self.memory.declination);
        let std = self.config.magnetic_heading_std;
        let made = if self.memory.side.is_used(MAGNETIC_OFFSET) {
            magnetic_field::measurement(&then, &self.memory.side, field, declination, std)
        } else {
            self.memory.bias_steps.headed();
            heading::magnetic(&then, field, declination, std * std)
        };
        if made.is_ok() {
            self.memory.last_magnetic_ns = Some(time_ns);
        }
        self.fuse_or_skip(Aid::Magnetometer, made)
    }

    /// Takes a barometric height (m, up, of any zero; [`barometer::pressure_height`] of a pressure).
    pub fn barometer(&mut self, time_ns: i64, height: T) -> Innovation<T> {
        let std = self.config.barometer_std_m;
        let ready = check_scalar(height, std, 1e5)
            .and_then(|()| self.accept(Aid::Barometer, time_ns))
            .and_then(|()| self.make_ready());
        let innovation = match ready {
            Ok(()) => {
                let then = self.instant(time_ns, T::zero());
                if !self.memory.side.is_used(BAROMETER_OFFSET) {
                    let offset = height + then.position.z;
                    let unknown = lit::<T>(UNKNOWN_OFFSET_STD_M);
                    self.start_side(BAROMETER_OFFSET, offset, unknown * unknown);
                }
                let m = barometer::measurement(&then, &self.memory.side, height, std * std);
                self.fuse(Aid::Barometer, &m)
            }
            Err(reason) => Innovation::skipped(reason),
        };
        self.memory.counts[Aid::Barometer as usize].count(&innovation);
        innovation
    }

    /// Takes a speed (m/s) along the vehicle's forward axis with its standard deviation, negative backwards: from
    /// wheels, or a ship's log in still water.
    pub fn speed(&mut self, time_ns: i64, forward: T, std: T) -> Innovation<T> {
        let ready = check_scalar(forward, std, FASTEST_M_S)
            .and_then(|()| self.accept(Aid::Speed, time_ns))
            .and_then(|()| self.make_ready());
        let innovation = match ready {
            Ok(()) => {
                self.use_mount();
                let then = self.instant(time_ns, T::zero());
                let arm = Vector3::from(self.config.vehicle_arm_m);
                let m = body_velocity::speed(&then, &self.memory.side, &arm, forward, std * std);
                self.fuse(Aid::Speed, &m)
            }
            Err(reason) => Innovation::skipped(reason),
        };
        self.memory.counts[Aid::Speed as usize].count(&innovation);
        if innovation.outcome.is_fused() {
            self.memory.since_velocity = T::zero();
        }
        innovation
    }

    pub(super) fn use_mount(&mut self) {
        let variance = self.config.mount_std * self.config.mount_std;
        for state in [MOUNT_PITCH, MOUNT_YAW] {
            if !self.memory.side.is_used(state) {
                self.start_side(state, T::zero(), variance);
            }
        }
    }

    /// Starts an augmented state anew, on the way.
    pub(super) fn start_side(&mut self, state: usize, value: T, variance: T) {
        let (side, mut listener) = self.memory.followed(&mut self.listener);
        side.start(state, value, variance);
        listener.propagated(&ScaledState {
            state: STATES + state,
            factor: T::zero(),
        });
    }

    pub(super) fn fuse<const M: usize>(
        &mut self,
        aid: Aid,
        measurement: &SparseMeasurement<T, M>,
    ) -> Innovation<T> {
        let mut gate = self.memory.gates[aid as usize];
        let (side, mut listener) = self.memory.followed(&mut self.listener);
        let record =
            (self.filter).fuse_sparse(side, measurement, &mut gate, bound(M), &mut listener);
        self.memory.gates[aid as usize] = gate;
        record
    }

    fn fuse_or_skip<const M: usize>(
        &mut self,
        aid: Aid,
        made: Result<SparseMeasurement<T, M>, SkipReason>,
    ) -> Innovation<T> {
        match made {
            Ok(measurement) => self.fuse(aid, &measurement),
            Err(reason) => Innovation::skipped(reason),
        }
    }

    /// Takes the stamp of a measurement: it must be newer than its sensor's last and near the present.
    pub(super) fn accept(&mut self, aid: Aid, time_ns: i64) -> Result<(), SkipReason> {
        let stamp = self.memory.stamps[aid as usize];
        let ahead = |last: i64| seconds::<T>(time_ns, last) > lit(LONGEST_GAP_S);
        if stamp.is_some_and(|last| time_ns <= last && !ahead(last)) {
            return Err(SkipReason::NotNewer);
        }
        if self.config.imu_samples == ImuSamples::None {
            self.go_on_without_samples(time_ns);
        } else {
            self.go_on_in_a_gap(time_ns);
        }
        // One that is not used shall not make the next ones old.
        let ahead_s = self.memory.now_ns.map(|now| seconds::<T>(now, time_ns));
        match ahead_s {
            Some(ahead_s) if ahead_s > T::one() => return Err(SkipReason::TooLate),
            Some(ahead_s) if ahead_s < -T::one() => return Err(SkipReason::NotNewer),
            _ => self.memory.stamps[aid as usize] = Some(time_ns),
        }
        match ahead_s {
            None => Err(SkipReason::NotInitialized),
            Some(_) => Ok(()),
        }
    }

    /// Brings the covariance up to the state, if there is one.
    pub(super) fn make_ready(&mut self) -> Result<(), SkipReason> {
        if !self.runs_alone() {
            return Err(SkipReason::NotInitialized);
        }
        self.catch_up();
        // Catching up may have shown that the covariance is none.
        if self.runs_alone() {
            Ok(())
        } else {
            Err(SkipReason::NotInitialized)
        }
    }

    /// Whether there is a state and the alignment does not make it.
    pub(super) fn runs_alone(&self) -> bool {
        self.memory.started && !self.memory.aligning
    }
}

fn check_scalar<T: Scalar>(value: T, std: T, limit: f64) -> Result<(), SkipReason> {
    if !(value.is_finite() && std.is_finite()) {
        Err(SkipReason::NotFinite)
    } else if value.abs() > lit(limit) || std <= T::zero() {
        Err(SkipReason::OutOfRange)
    } else {
        Ok(())
    }
}
