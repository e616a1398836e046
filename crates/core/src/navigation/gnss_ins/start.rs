//! The start: an in-motion alignment that is given all samples and fixes, and whose state is taken over at every fix
//! until the heading is known well.
//!
//! *Read first:* [`crate::navigation::in_motion_alignment`]; `docs/derivations/error_state.md`, section 12.
//!
//! The alignment works at the instants at which fixes were valid, so samples wait in the history until the next fix says
//! where to cut. Between fixes the filter carries its state on.

use nalgebra::{SMatrix, Vector3};

use super::{
    Aid, ERRORS, ErrorListener, ErrorShares, GnssIns, GnssInsConfig, GnssPositionUpdate, seconds,
};
use crate::faults::{Fault, FaultKind};
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::navigation::aiding::gnss_position::GnssPosition;
use crate::navigation::aiding::gnss_velocity::GnssVelocity;
use crate::navigation::augmented_states::{
    AugmentedStates, GNSS_OFFSET, MAGNETIC_OFFSET, MOUNT_PITCH, MOUNT_YAW, TIME_OFFSET,
};
use crate::navigation::gauss_markov_bias::BiasAtRest;
use crate::navigation::in_motion_alignment::{
    AlignmentStatus, AlignmentUpdate, InMotionAlignment, InMotionAlignmentConfig,
};
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, NavigationState};
use crate::parameters::ConfigError;
use crate::scalar::{Scalar, lit, to_f64};

/// Standard deviation of the heading (rad) from which one linearisation is enough, and ...
const HANDED_OVER_HEADING_STD: f64 = 0.035;
/// ... the time (s) after which the filter goes on alone even above it.
const WATCHED_FOR_S: f64 = 60.0;
/// The state is carried to the present in steps of this, s.
const CARRIED_BY_S: f64 = 0.1;
/// Weight below which a fix was not taken as stated.
const FULL_WEIGHT: f64 = 0.55;
/// Standard deviation of a lever arm that was measured, and of one of which nothing was said, m.
const MEASURED_ARM_STD_M: f64 = 0.02;
const UNKNOWN_ARM_STD_M: f64 = 0.1;

/// The alignment as a GNSS/INS uses it.
pub(super) type Alignment<T> = InMotionAlignment<T>;

/// An alignment with the settings of a GNSS/INS.
pub(super) fn alignment<T: Scalar>(c: &GnssInsConfig<T>) -> Result<Alignment<T>, ConfigError> {
    let with = |a: T, b: T| (a * a + b * b).sqrt();
    // A Gauss-Markov bias moves over a second as a random walk does.
    let walk = |walk: T, std: T, time: T| with(walk, std * (lit::<T>(2.0) / time).sqrt());
    InMotionAlignment::new(InMotionAlignmentConfig {
        accelerometer_noise_density: c.accelerometer_noise_density,
        gyroscope_noise_density: c.gyroscope_noise_density,
        accelerometer_bias_random_walk: walk(
            c.accelerometer_bias_random_walk,
            c.accelerometer_gauss_markov_std,
            c.accelerometer_gauss_markov_time_s,
        ),
        gyroscope_bias_random_walk: walk(
            c.gyroscope_bias_random_walk,
            c.gyroscope_gauss_markov_std,
            c.gyroscope_gauss_markov_time_s,
        ),
        accelerometer_bias_std: with(c.accelerometer_bias_std, c.accelerometer_gauss_markov_std),
        gyroscope_bias_std: with(c.gyroscope_bias_std, c.gyroscope_gauss_markov_std),
        gravity: c.gravity.max(T::one()),
        lever_arm_m: c.lever_arm_m,
        lever_arm_std_m: c.lever_arm_uncertainty_m(),
        // Samples are cut at the instant at which a fix was valid.
        position_latency_s: T::zero(),
        time_offset_std_s: c.time_offset_std_s,
        time_jitter_s: c.time_jitter_s,
        position_uncorrelated_fraction: c.position_uncorrelated_fraction,
        position_correlated_fraction: c.position_correlated_fraction,
        position_correlation_time_s: c.position_correlation_time_s,
        position_std_floor_m: c.position_std_floor_m,
        velocity_std_floor_m_s: c.velocity_std_floor_m_s,
        least_noise_scale: c.least_noise_scale,
        largest_noise_scale: c.largest_noise_scale,
        gap_attitude_random_walk: c.gap_attitude_random_walk,
        gap_velocity_random_walk: c.gap_velocity_random_walk,
        ..InMotionAlignmentConfig::default()
    })
}

impl<T: Scalar> GnssInsConfig<T> {
    /// Standard deviation of what the lever arm is off by, m: as set, or by whether there is one.
    pub fn lever_arm_uncertainty_m(&self) -> T {
        let measured = Vector3::from(self.lever_arm_m).norm_squared() > T::zero();
        self.lever_arm_std_m.unwrap_or_else(|| {
            lit(if measured {
                MEASURED_ARM_STD_M
            } else {
                UNKNOWN_ARM_STD_M
            })
        })
    }
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Takes a sample for the alignment to have once a fix says where to cut.
    pub(super) fn keep_for_alignment(&mut self, dt: T) {
        let memory = &mut self.memory;
        memory.unfed_s += dt;
        memory.unfed = (memory.unfed + 1).min(HISTORY);
        if memory.unfed >= HISTORY {
            let newest = memory.history.duration_s(HISTORY - HISTORY.div_ceil(4));
            self.feed(newest);
        }
    }

    /// Gives the alignment the samples up to `age` seconds ago; ahead of the newest one, that one is held.
    pub(super) fn feed(&mut self, age: T) {
        let measured = self.measured_noise();
        let memory = &mut self.memory;
        let mut left = memory.unfed_s - age;
        if left <= T::zero() {
            return;
        }
        // What is refused was looked at before it came into the history.
        for sample in memory.history.since(memory.unfed_s) {
            let part = sample.dt.min(left);
            if part > T::zero() {
                let (rate, force) = (&sample.angular_rate, &sample.specific_force);
                let noise = larger(measured, sample.unseen);
                self.alignment.set_noise_densities(noise);
                let _ = self.alignment.propagate(rate, force, part);
            }
            left -= part;
        }
        if let Some((_, rate, force)) = &memory.last_imu
            && left > T::zero()
            && age < T::zero()
        {
            let _ = self.alignment.propagate(rate, force, left);
        }
        memory.unfed_s = age;
        memory.unfed = memory.history.since(age).count();
    }

    /// A position for the alignment; its state is taken over.
    pub(super) fn align_with_position(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
    ) -> GnssPositionUpdate<T> {
        let now = self.memory.now_ns.unwrap_or(time_ns);
        self.alignment
            .set_error_fractions(shares.white, shares.slow);
        self.feed(seconds::<T>(time_ns, now) + self.config.position_latency_s);
        if !self.alignment.is_due() && self.memory.started {
            // Between those that the alignment uses it keeps the state that was taken over on its way.
            self.catch_up();
            return self.fuse_position(time_ns, fix, shares, false);
        }
        let before = (self.alignment.status(), self.alignment.restarts());
        let update = self.alignment.gnss_position(fix);
        self.tell_bias_step(time_ns);
        let status = self.alignment.status();
        let begun = status != AlignmentStatus::Aligning
            && (before.0 == AlignmentStatus::Aligning || before.1 != self.alignment.restarts());
        let used = update.position.outcome.is_fused();
        if begun {
            self.tell_initial_heading();
            self.memory.magnetic_is_used = false;
        }
        if begun || used {
            self.memory.aligned_fix_ns = Some(time_ns);
            self.memory.last_fix_ns = Some(time_ns);
            let held = self.memory.held_velocity.take();
            let held = held.filter(|(stamp, _)| *stamp == time_ns);
            if let Some((_, velocity)) = &held {
                self.tell_velocity(time_ns, velocity);
            }
            self.take_over();
            if let (Some((_, velocity)), true) = (&held, self.memory.started) {
                self.fuse_velocity(time_ns, velocity);
            }
        }
        split(&update, fix.has_height)
    }

    /// A bias that has stepped is a fault of its sensor.
    fn tell_bias_step(&mut self, time_ns: i64) {
        if let Some(step) = self.alignment.take_step() {
            let age_ns = (to_f64(step.age_s) * 1e9) as i64;
            self.memory.faults.log.happened(Fault {
                sensor: step.sensor,
                kind: FaultKind::BiasStep,
                from_ns: time_ns.saturating_sub(age_ns),
                until_ns: time_ns,
                is_over: true,
                size: step.size,
            });
        }
    }

    fn tell_initial_heading(&mut self) {
        if let Some([heading, std]) = self.config.initial_heading {
            self.alignment.heading(heading, std);
        }
    }

    /// A velocity for the alignment: that of the instant of a position it has used, or is about to use.
    pub(super) fn align_with_velocity(
        &mut self,
        time_ns: i64,
        fix: &GnssVelocity<T>,
    ) -> Innovation<T> {
        if self.memory.aligned_fix_ns != Some(time_ns) {
            self.memory.held_velocity = Some((time_ns, *fix));
        } else {
            self.tell_velocity(time_ns, fix);
        }
        if !self.memory.started {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        // The alignment uses it with the next position: until then the state that was taken over has it.
        self.catch_up();
        self.fuse_velocity(time_ns, fix)
    }

    fn tell_velocity(&mut self, time_ns: i64, fix: &GnssVelocity<T>) {
        let mut fix = *fix;
        // A velocity of another instant than the position's: what the vehicle gained between them, which is known as a
        // vector when the heading is.
        let age = |latency: T| self.instant(time_ns, latency).velocity;
        let (position, velocity) = (
            self.config.position_latency_s,
            self.config.velocity_latency_s,
        );
        if self.memory.started && (position - velocity).abs() > T::zero() {
            let gained = age(position) - age(velocity);
            fix.ned += gained;
            if self.alignment.status() != AlignmentStatus::Aligned {
                fix.std += Vector3::repeat(gained.norm());
            }
        }
        self.alignment.gnss_velocity(&fix);
    }

    /// A magnetic field for the alignment: of one that carries iron the first after the start, since iron turns all alike.
    pub(super) fn align_with_magnetic_field(&mut self, time_ns: i64, field: &Vector3<T>) {
        let iron = self.config.magnetic_offset_std_ut;
        if self.memory.magnetic_is_used && iron > T::zero() {
            return;
        }
        let now = self.memory.now_ns.unwrap_or(time_ns);
        self.feed(seconds(time_ns, now));
        let Some(state) = self.state() else {
            return;
        };
        let horizontal = (state.ned_from_body * field).xy().norm_squared();
        if horizontal <= T::zero() {
            return;
        }
        let std = self.config.magnetic_heading_std;
        let std = (std * std + iron * iron / horizontal).sqrt();
        let declination = self.config.declination.unwrap_or(self.memory.declination);
        let seen = self.alignment.magnetic_field(field, declination, std);
        self.memory.magnetic_is_used = seen.outcome == Outcome::Skipped(SkipReason::Accumulated);
    }

    /// Takes over the state of the alignment and carries it to the present; the filter goes on alone once one
    /// linearisation is enough.
    fn take_over(&mut self) {
        let Some((mut state, side)) = self.alignment.hand_over() else {
            return;
        };
        state.skipped = self.filter.state().skipped;
        if !self.begin(&state) {
            return;
        }
        self.take_over_augmented(&side);
        self.memory.take_overs = self.memory.take_overs.wrapping_add(1);
        self.carry_to_the_present();
        if !self.memory.started {
            return;
        }
        let aligned = self.alignment.status() == AlignmentStatus::Aligned;
        let now = self.memory.now_ns;
        self.memory.aligned_since_ns = self.memory.aligned_since_ns.or(now).filter(|_| aligned);
        let heading = state.covariance[(ATTITUDE + 2, ATTITUDE + 2)];
        let known = heading < lit(HANDED_OVER_HEADING_STD * HANDED_OVER_HEADING_STD);
        let since = self.memory.aligned_since_ns.zip(now);
        let watched =
            since.is_some_and(|(since, now)| seconds::<T>(since, now) > lit(WATCHED_FOR_S));
        if aligned && (known || watched) {
            self.go_on_alone();
        }
    }

    /// From here on the filter fuses by itself.
    pub(super) fn go_on_alone(&mut self) {
        self.memory.aligning = false;
        self.memory.disagreeing = 0;
        let scale = self.alignment.noise_scale();
        // That of velocities begins anew: while the heading was not known it has learnt the filter's own errors.
        self.memory.noise_scale = [scale, scale, T::one()];
    }

    /// The states beside that the alignment estimates.
    fn take_over_augmented(&mut self, from: &AugmentedStates<T>) {
        let side = &mut self.memory.side;
        for i in GNSS_OFFSET..=TIME_OFFSET {
            side.values[i] = from.values[i];
            side.cross.set_column(i, &from.cross.column(i));
            for j in GNSS_OFFSET..=TIME_OFFSET {
                side.covariance[(i, j)] = from.covariance[(i, j)];
            }
        }
        let slow = self.alignment.correlated_std();
        self.memory.slow_variance = slow.component_mul(&slow);
    }

    /// Carries the state from the instant of the last fix to that of the newest sample.
    fn carry_to_the_present(&mut self) {
        let behind = self.memory.unfed_s;
        if behind < T::zero() {
            // The fix came just before the next sample.
            let state = self.filter.state();
            let mut state = *state;
            state.position += state.velocity * behind;
            let _ = self.filter.start(state);
            return;
        }
        let history = self.memory.history;
        let measured = self.measured_noise();
        let mut noise = measured;
        for sample in history.since(behind) {
            let (rate, force) = (&sample.angular_rate, &sample.specific_force);
            let own = larger(measured, sample.unseen);
            if own != noise {
                self.catch_up();
                noise = own;
                self.filter.set_noise_densities(noise);
            }
            if sample.dt > T::zero()
                && self.filter.propagate(rate, force, sample.dt).is_ok()
                && self.pending_s() >= lit(CARRIED_BY_S)
            {
                self.catch_up();
            }
        }
        self.catch_up();
        self.filter.set_noise_densities(measured);
    }

    /// Starts, or starts again, at `time_ns` from a state that is known otherwise: kept from before, or another system's.
    /// Nothing is aligned then. A state that is not [usable](NavigationState::is_usable) changes nothing and gives `false`.
    pub fn start_at(&mut self, time_ns: i64, state: &NavigationState<T>) -> bool {
        let started = self.begin(state);
        if started {
            self.memory.history.clear();
            self.memory.now_ns = Some(time_ns);
            self.memory.last_imu = None;
            self.memory.last_fix_ns = None;
            self.memory.aligning = false;
            self.memory.disagreeing = 0;
            self.memory.noise_scale = [T::one(); 3];
        }
        started
    }

    /// Goes on from a state of which the augmented states know nothing yet; those who listen begin with it.
    pub(super) fn begin(&mut self, state: &NavigationState<T>) -> bool {
        if !self.filter.start(*state) {
            return false;
        }
        self.memory.side = AugmentedStates::default();
        self.memory.slow_variance.fill(T::zero());
        let square = |x: T| x * x;
        let time_variance = square(self.config.time_offset_std_s);
        self.memory
            .side
            .start(TIME_OFFSET, T::zero(), time_variance);
        let iron_variance = square(self.config.magnetic_offset_std_ut);
        for i in 0..3 {
            self.memory
                .side
                .start(MAGNETIC_OFFSET + i, T::zero(), iron_variance);
        }
        if self.config.non_holonomic || self.memory.counts[Aid::Speed as usize].skipped > 0 {
            let variance = square(self.config.mount_std);
            self.memory.side.start(MOUNT_PITCH, T::zero(), variance);
            self.memory.side.start(MOUNT_YAW, T::zero(), variance);
        }
        let variances = |first: usize| {
            let diagonal = state.covariance.diagonal();
            diagonal.fixed_rows::<3>(first).into_owned()
        };
        let (force, rate) = (state.accelerometer_bias, state.gyroscope_bias);
        self.memory.at_rest = [
            BiasAtRest::new(force, variances(ACCELEROMETER_BIAS)),
            BiasAtRest::new(rate, variances(GYROSCOPE_BIAS)),
        ];
        self.memory.started = true;
        let (_, mut listener) = self.memory.followed(&mut self.listener);
        listener.restarted();
        true
    }
}

/// The larger of two, each.
fn larger<T: Scalar>(a: [T; 2], b: [T; 2]) -> [T; 2] {
    [a[0].max(b[0]), a[1].max(b[1])]
}

/// The record of a position as that of its horizontal and its vertical part.
fn split<T: Scalar>(update: &AlignmentUpdate<T>, has_height: bool) -> GnssPositionUpdate<T> {
    let whole = &update.position;
    if let Outcome::Skipped(reason) = whole.outcome {
        return GnssPositionUpdate {
            horizontal: Innovation::skipped(reason),
            vertical: Innovation::skipped(reason),
        };
    }
    let outcome = if update.weights[0] < lit(FULL_WEIGHT) {
        Outcome::Inflated
    } else {
        Outcome::Fused
    };
    let (r, s) = (&whole.residual, &whole.covariance);
    let determinant = s[(0, 0)] * s[(1, 1)] - s[(0, 1)] * s[(1, 0)];
    let nis = (r.x * r.x * s[(1, 1)] - r.x * r.y * (s[(0, 1)] + s[(1, 0)]) + r.y * r.y * s[(0, 0)])
        / determinant;
    let mut flat = SMatrix::<T, 3, 3>::zeros();
    flat.fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&s.fixed_view::<2, 2>(0, 0));
    let horizontal = Innovation {
        residual: Vector3::new(r.x, r.y, T::zero()),
        covariance: flat,
        nis,
        degrees_of_freedom: 2,
        outcome,
    };
    let vertical = if has_height {
        let mut high = SMatrix::<T, 3, 3>::zeros();
        high[(0, 0)] = s[(2, 2)];
        Innovation {
            residual: Vector3::new(r.z, T::zero(), T::zero()),
            covariance: high,
            nis: r.z * r.z / s[(2, 2)],
            degrees_of_freedom: 1,
            outcome,
        }
    } else {
        Innovation::skipped(SkipReason::NotUsed)
    };
    GnssPositionUpdate {
        horizontal,
        vertical,
    }
}
