//! The measurements of a GNSS/INS: checks, stamps, latency, gates.

use nalgebra::Vector3;

use super::stillness::{WINDOW_S, Window};
use super::{Aid, ERRORS, ErrorListener, GnssIns, ImuSamples, LONGEST_GAP_S, seconds};
use crate::kalman::feedback::ScaledState;
use crate::kalman::gate::CHI_SQUARE;
use crate::kalman::innovation::check_vector;
use crate::kalman::{CountedGate, Innovation, SkipReason};
use crate::navigation::aiding::gnss_position::{self, GnssPosition};
use crate::navigation::aiding::gnss_velocity::{self, GnssVelocity};
use crate::navigation::aiding::{barometer, body_velocity, heading, magnetic_field, zero_velocity};
use crate::navigation::augmented_states::{
    BAROMETER_OFFSET, GNSS_OFFSET, MAGNETIC_OFFSET, MOUNT_PITCH, MOUNT_YAW, TIME_OFFSET,
};
use crate::navigation::error_state::SparseMeasurement;
use crate::navigation::{STATES, VELOCITY};
use crate::scalar::{Scalar, lit};

/// Positions further than this from the origin (m) are not on this Earth, and with a larger standard deviation (m) no fixes.
const FURTHEST_M: f64 = 2e7;
const LARGEST_STD_M: f64 = 1e6;
/// Faster than this (m/s) nothing moves that this is for.
const FASTEST_M_S: f64 = 1e3;
/// Standard deviation of a standing body's velocity, m/s: an idling engine, a swaying boat.
const STANDING_STD: f64 = 0.03;
/// A window at rest is accepted when the estimate is slower than so many of its standard deviations, and ...
const STANDING_SIGMAS: f64 = 3.0;
/// ... this (m/s): what a receiver or dead reckoning may be off by.
const STANDING_SPEED: f64 = 0.5;
/// How much larger the floor of a height is: satellites are seen on one side only.
const VERTICAL_FLOOR: f64 = 2.5;
/// A receiver's velocity (m/s) below which it stands, beside its noise, and for how long after (ns).
const RECEIVER_STANDS_M_S: f64 = 0.1;
const RECEIVER_STANDS_NS: i64 = 700_000_000;
/// Least standard deviation of a gyroscope's bias from one window at rest, rad/s.
const STANDING_RATE_STD: f64 = 1e-3;
/// How often the non-holonomic constraint is taken, s.
const CONSTRAINT_INTERVAL_S: f64 = 0.2;
/// The velocity is damped when no receiver has measured it for so long, s.
const DAMPED_AFTER_S: f64 = 2.0;
/// Speed (m/s) that any vehicle may reach in an outage, however slow it was before.
const SLOWEST_M_S: f64 = 3.0;
/// Standard deviation of a barometer's offset before anything is known, m.
const UNKNOWN_OFFSET_STD_M: f64 = 100.0;

/// What a position told, horizontally and vertically: each has its own weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssPositionUpdate<T> {
    /// North and east, m.
    pub horizontal: Innovation<T>,
    /// Down, m.
    pub vertical: Innovation<T>,
}

/// How the stated standard deviation of a position divides: what changes from fix to fix, and what goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorShares<T> {
    /// Share that changes from fix to fix.
    pub white: T,
    /// Share that goes on, as errors of orbits, clocks and the air do.
    pub slow: T,
}

/// The 99.9 % bound of chi-square.
fn bound<T: Scalar>(degrees_of_freedom: usize) -> T {
    let row = CHI_SQUARE.get(degrees_of_freedom.saturating_sub(1));
    lit(row.map_or(16.3, |(_, [_, _, bound])| *bound))
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Takes a position.
    pub fn gnss_position(&mut self, time_ns: i64, fix: &GnssPosition<T>) -> GnssPositionUpdate<T> {
        let shares = ErrorShares {
            white: self.config.position_uncorrelated_fraction,
            slow: self.config.position_correlated_fraction,
        };
        self.gnss_position_with(time_ns, fix, shares)
    }

    /// Takes a position whose error has other shares than those of the settings.
    pub fn gnss_position_with(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
    ) -> GnssPositionUpdate<T> {
        let checked = check_fix(&fix.ned, &fix.std, [FURTHEST_M, LARGEST_STD_M])
            .and_then(|()| self.accept(Aid::GnssPosition, time_ns));
        let update = match checked.and_then(|()| self.use_position(time_ns, fix, shares)) {
            Ok(update) => update,
            Err(reason) => GnssPositionUpdate {
                horizontal: Innovation::skipped(reason),
                vertical: Innovation::skipped(reason),
            },
        };
        self.memory.counts[Aid::GnssPosition as usize].count(&update.horizontal);
        self.memory.counts[Aid::GnssHeight as usize].count(&update.vertical);
        if update.horizontal.outcome.is_fused() {
            self.memory.since_velocity = T::zero();
            self.note_speed(time_ns);
            self.memory.last_fix_ns = Some(time_ns);
        }
        update
    }

    fn use_position(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
    ) -> Result<GnssPositionUpdate<T>, SkipReason> {
        let has_imu = self.config.imu_samples != ImuSamples::None;
        // The very same digits again: a receiver that stands, or one that is frozen.
        let repeated = self.is_repeated(fix);
        self.memory.frozen = repeated && (self.memory.frozen || self.is_frozen());
        if self.memory.frozen && has_imu {
            return Err(SkipReason::NotNewer);
        }
        if self.memory.aligning && has_imu {
            return Ok(self.align_with_position(time_ns, fix, shares));
        }
        if self.memory.aligning {
            let course_std = self.config.course_std;
            self.memory.level.position(time_ns, fix, course_std);
            self.try_to_start_level();
        }
        self.make_ready()?;
        let update = self.fuse_position(time_ns, fix, shares, repeated);
        if has_imu && !repeated && self.judge(time_ns, &update) {
            self.align_again(time_ns, fix, shares);
        }
        Ok(update)
    }

    pub(super) fn fuse_position(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
        repeated: bool,
    ) -> GnssPositionUpdate<T> {
        let floor = self.config.position_std_floor_m;
        let floor = Vector3::new(floor, floor, floor * lit(VERTICAL_FLOOR));
        let [flat, high, _] = self.memory.noise_scale;
        let scale = Vector3::new(flat, flat, high);
        let std = fix.std.zip_map(&floor, |stated, floor| stated.max(floor));
        // What is correlated does not show from fix to fix: it may be larger than stated, never smaller.
        let slow = std.component_mul(&scale.map(|s| s.max(T::one()))) * shares.slow;
        self.follow_slow_error(&slow);
        let white = std.component_mul(&scale) * shares.white;
        let variance = self.uncorrelated_variance(&white);
        let horizontal = {
            let m = self.position_rows(time_ns, &fix.ned, &variance, [0, 1]);
            self.fuse_weighted(&m, Aid::GnssPosition, repeated)
        };
        let vertical = if fix.has_height {
            let m = self.position_rows(time_ns, &fix.ned, &variance, [2]);
            self.fuse_weighted(&m, Aid::GnssHeight, repeated)
        } else {
            Innovation::skipped(SkipReason::NotUsed)
        };
        GnssPositionUpdate {
            horizontal,
            vertical,
        }
    }

    fn position_rows<const M: usize>(
        &self,
        time_ns: i64,
        ned: &Vector3<T>,
        variance: &Vector3<T>,
        components: [usize; M],
    ) -> SparseMeasurement<T, M> {
        let latency = self.config.position_latency_s + self.memory.side.values[TIME_OFFSET];
        let then = self.instant(time_ns, latency);
        let arm = Vector3::from(self.config.lever_arm_m);
        let offset = self.memory.side.values.fixed_rows::<3>(GNSS_OFFSET);
        gnss_position::measurement(&then, &offset.into(), &arm, ned, variance, components)
    }

    /// Holds the receiver's slow error to the standard deviation that it states now. When that falls by half
    /// (a float solution that is fixed), the error of before is over.
    fn follow_slow_error(&mut self, slow_std: &Vector3<T>) {
        for i in 0..3 {
            let (variance, before) = (slow_std[i] * slow_std[i], self.memory.slow_variance[i]);
            // The first fix after a start from a known state, or an error that is over.
            let is_new = before <= T::zero() && variance > T::zero();
            if is_new || variance < before * lit(0.25) {
                self.start_side(GNSS_OFFSET + i, T::zero(), variance);
            } else if variance > before {
                self.memory.side.covariance[(GNSS_OFFSET + i, GNSS_OFFSET + i)] +=
                    variance - before;
            }
            self.memory.slow_variance[i] = variance;
        }
    }

    /// Takes a velocity.
    pub fn gnss_velocity(&mut self, time_ns: i64, fix: &GnssVelocity<T>) -> Innovation<T> {
        let checked = check_fix(&fix.ned, &fix.std, [FASTEST_M_S; 2])
            .and_then(|()| self.accept(Aid::GnssVelocity, time_ns));
        if checked.is_ok() {
            let slow = lit::<T>(RECEIVER_STANDS_M_S) + fix.std.max();
            let stands = fix.ned.norm() < slow;
            self.memory.stands_until_ns =
                stands.then(|| time_ns.saturating_add(RECEIVER_STANDS_NS));
        }
        let innovation = match checked.and_then(|()| self.use_velocity(time_ns, fix)) {
            Ok(innovation) => innovation,
            Err(reason) => Innovation::skipped(reason),
        };
        self.memory.counts[Aid::GnssVelocity as usize].count(&innovation);
        if innovation.outcome.is_fused() {
            self.memory.since_velocity = T::zero();
        }
        innovation
    }

    fn use_velocity(
        &mut self,
        time_ns: i64,
        fix: &GnssVelocity<T>,
    ) -> Result<Innovation<T>, SkipReason> {
        let has_imu = self.config.imu_samples != ImuSamples::None;
        let repeated = self.memory.last_velocity.replace(fix.ned) == Some(fix.ned);
        if repeated && has_imu && fix.ned.norm_squared() > T::zero() {
            return Err(SkipReason::NotNewer);
        }
        if self.memory.aligning && has_imu {
            return Ok(self.align_with_velocity(time_ns, fix));
        }
        if self.memory.aligning {
            let course_std = self.config.course_std;
            self.memory.level.velocity(time_ns, fix, course_std);
        }
        self.make_ready()?;
        Ok(self.fuse_velocity(time_ns, fix))
    }

    pub(super) fn fuse_velocity(&mut self, time_ns: i64, fix: &GnssVelocity<T>) -> Innovation<T> {
        let latency = self.config.velocity_latency_s + self.memory.side.values[TIME_OFFSET];
        let then = self.instant(time_ns, latency);
        let arm = Vector3::from(self.config.lever_arm_m);
        let floor = self.config.velocity_std_floor_m_s;
        let [.., scale] = self.memory.noise_scale;
        let std = fix.std.map(|s| s.max(floor)) * scale;
        let variance = std.component_mul(&std);
        if fix.has_vertical {
            let m = gnss_velocity::measurement(&then, &arm, &fix.ned, &variance, [0, 1, 2]);
            self.fuse_weighted(&m, Aid::GnssVelocity, false)
        } else {
            let m = gnss_velocity::measurement(&then, &arm, &fix.ned, &variance, [0, 1]);
            self.fuse_weighted(&m, Aid::GnssVelocity, false)
        }
    }

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

    fn use_mount(&mut self) {
        let variance = self.config.mount_std * self.config.mount_std;
        for state in [MOUNT_PITCH, MOUNT_YAW] {
            if !self.memory.side.is_used(state) {
                self.start_side(state, T::zero(), variance);
            }
        }
    }

    /// Starts an augmented state anew, on the way.
    fn start_side(&mut self, state: usize, value: T, variance: T) {
        self.memory.side.start(state, value, variance);
        self.listener.propagated(&ScaledState {
            state: STATES + state,
            factor: T::zero(),
        });
    }

    pub(super) fn is_constraint_due(&self) -> bool {
        self.config.non_holonomic && self.memory.since_constraint >= lit(CONSTRAINT_INTERVAL_S)
    }

    /// What the filter knows without being told: that it stands, that it does not slide, that it is no rocket.
    pub(super) fn constrain(&mut self) {
        if let Some(window) = self.memory.due_window.take() {
            // The first window at rest may have begun before the stop.
            let stands = self.config.zero_velocity && self.memory.still_windows > 1;
            if stands && self.memory.aligning {
                let least = lit(STANDING_RATE_STD * STANDING_RATE_STD);
                let variance = window.rate_variance.max(least);
                self.alignment.rate_at_rest(&window.mean_rate, variance);
            } else if stands {
                self.stand(&window);
            }
            self.damp(lit(WINDOW_S));
        }
        if self.is_constraint_due() && self.runs_alone() {
            self.memory.since_constraint = T::zero();
            self.use_mount();
            let state = self.filter.state();
            let then = self
                .memory
                .history
                .at(state, self.config.gravity, T::zero());
            let arm = Vector3::from(self.config.vehicle_arm_m);
            let std = self.config.non_holonomic_std_m_s;
            let m = body_velocity::non_holonomic(&then, &self.memory.side, &arm, std * std);
            let innovation = self.fuse(Aid::NonHolonomic, &m);
            self.memory.counts[Aid::NonHolonomic as usize].count(&innovation);
        }
    }

    /// Pulls the velocity towards zero as weakly as its prior says over `duration`, when nothing has measured it (E31).
    pub(super) fn damp(&mut self, duration: T) {
        let mut std = self.config.damping_speed_m_s;
        if self.memory.fastest > T::zero() {
            std = std.min(self.memory.fastest.max(lit(SLOWEST_M_S)));
        }
        let measured = self.memory.since_velocity <= lit(DAMPED_AFTER_S);
        if measured || std <= T::zero() || duration <= T::zero() || !self.memory.started {
            return;
        }
        let visits = self.config.damping_time_s / duration;
        let velocity = self.filter.state().velocity;
        let m = zero_velocity::damping(&velocity, std * std * visits);
        // It cannot be wrong by more than itself: no gate.
        let mut open = CountedGate::default();
        let (side, listener) = (&mut self.memory.side, &mut self.listener);
        self.filter
            .fuse_sparse(side, &m, &mut open, T::zero(), listener);
    }

    /// Fuses a window at rest, unless the estimate moves faster than it can be wrong.
    fn stand(&mut self, window: &Window<T>) {
        if !self.runs_alone() {
            return;
        }
        let state = self.filter.state();
        let variance =
            state.covariance[(VELOCITY, VELOCITY)] + state.covariance[(VELOCITY + 1, VELOCITY + 1)];
        let slow = lit::<T>(STANDING_SPEED) + variance.max(T::zero()).sqrt() * lit(STANDING_SIGMAS);
        if state.velocity.norm() > slow {
            return;
        }
        let then = self
            .memory
            .history
            .at(state, self.config.gravity, T::zero());
        let m = zero_velocity::velocity(&then, lit(STANDING_STD * STANDING_STD));
        let innovation = self.fuse(Aid::ZeroVelocity, &m);
        self.memory.counts[Aid::ZeroVelocity as usize].count(&innovation);
        if innovation.outcome.is_fused() {
            let bias = self.filter.state().gyroscope_bias;
            let least = lit(STANDING_RATE_STD * STANDING_RATE_STD);
            let m = zero_velocity::rate(&window.mean_rate, &bias, window.rate_variance.max(least));
            let (side, listener) = (&mut self.memory.side, &mut self.listener);
            let gate = &mut self.memory.standing_rate_gate;
            self.filter.fuse_sparse(side, &m, gate, bound(3), listener);
        }
    }

    pub(super) fn fuse<const M: usize>(
        &mut self,
        aid: Aid,
        measurement: &SparseMeasurement<T, M>,
    ) -> Innovation<T> {
        let (side, listener) = (&mut self.memory.side, &mut self.listener);
        let gate = &mut self.memory.gates[aid as usize];
        self.filter
            .fuse_sparse(side, measurement, gate, bound(M), listener)
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
    fn accept(&mut self, aid: Aid, time_ns: i64) -> Result<(), SkipReason> {
        let stamp = &mut self.memory.stamps[aid as usize];
        let ahead = |last: i64| seconds::<T>(time_ns, last) > lit(LONGEST_GAP_S);
        if stamp.is_some_and(|last| time_ns <= last && !ahead(last)) {
            return Err(SkipReason::NotNewer);
        }
        *stamp = Some(time_ns);
        if self.config.imu_samples == ImuSamples::None {
            self.go_on_without_samples(time_ns);
        }
        match self.memory.now_ns {
            None => Err(SkipReason::NotInitialized),
            Some(now) if seconds::<T>(now, time_ns).abs() > T::one() => Err(SkipReason::TooLate),
            Some(_) => Ok(()),
        }
    }

    /// Brings the covariance up to the state, if there is one.
    fn make_ready(&mut self) -> Result<(), SkipReason> {
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
    fn runs_alone(&self) -> bool {
        self.memory.started && !self.memory.aligning
    }
}

fn check_fix<T: Scalar>(
    ned: &Vector3<T>,
    std: &Vector3<T>,
    [furthest, largest]: [f64; 2],
) -> Result<(), SkipReason> {
    check_vector(ned, T::zero(), lit(furthest))?;
    check_vector(std, T::zero(), lit(largest))?;
    let positive = std.iter().all(|s| *s > T::zero());
    positive.then_some(()).ok_or(SkipReason::OutOfRange)
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
