//! In-motion alignment: level, heading, velocity and biases by a bank of headings, each a Gauss-Newton problem over a
//! sliding window of preintegrated intervals and fixes.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`.
//!
//! Use it where GNSS/INS has to begin on any vehicle in any motion: nothing is taken to stand still, to be mounted in
//! any way, or to point where it moves. What accelerations in the horizontal say of the heading, against the second
//! differences of the fixes, decides; until it has, the heading is stated as unknown, with the position already good. A
//! vehicle that never accelerates stays so, at constant cost. A compass or a second antenna is one more measurement of
//! every hypothesis.
//!
//! ```
//! use northing_core::nalgebra::Vector3;
//! use northing_core::navigation::GnssPosition;
//! use northing_core::navigation::in_motion_alignment::{
//!     AlignmentStatus, InMotionAlignment, InMotionAlignmentConfig,
//! };
//!
//! // A body that points east and is driven in circles of 4 m/s^2 without turning, seen at 100 Hz and 1 Hz.
//! let mut alignment = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default())?;
//! for k in 0..1500 {
//!     let t = f64::from(k) * 0.01;
//!     if k % 100 == 0 {
//!         let ned = Vector3::new(-t.cos(), -t.sin(), 0.0) * 4.0;
//!         let std = Vector3::repeat(0.02);
//!         alignment.gnss_position(&GnssPosition { ned, std, has_height: true });
//!     }
//!     let t = t + 0.005;
//!     let force = Vector3::new(4.0 * t.sin(), -4.0 * t.cos(), -9.806_65);
//!     alignment.propagate(&Vector3::zeros(), &force, 0.01)?;
//! }
//! let solution = alignment.solution().unwrap();
//! assert_eq!(alignment.status(), AlignmentStatus::Aligned);
//! assert!((solution.ned_from_body * Vector3::x() - Vector3::y()).norm() < 0.03);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Error states of a hypothesis: `[dpsi, dv, dp, db_a, db_g]` as in [`super::error_state`], then those
//! [augmented states](super::augmented_states) that a position sees, the receiver's correlated error and the time
//! offset: the first [`ALIGNMENT_ERRORS`] of [`super::ERRORS`]. Gravity is constant, and Earth's rotation is left out, which over
//! a window of seconds is below the noise.
//!
//! Samples and fixes come in the order of time: a fix is that of the instant up to which samples have been given. Every
//! fix returns its innovation. What is not finite, or is impossible, changes nothing.
//!
//! Cost: an inertial sample is one preintegration, about 320 multiplications, whatever the number of hypotheses; a fix
//! is at most `HYPOTHESES` times `WINDOW` steps of 19 states. Memory in single precision: 1.7 KB a hypothesis and 420
//! bytes an interval.

mod bank;
mod config;
mod estimate;
mod hypothesis;
mod memory;
mod robust_update;
mod window;

#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

pub use config::InMotionAlignmentConfig;
pub use memory::InMotionAlignmentState;

use self::bank::Bank;
use self::memory::Memory;
use self::window::{Interval, SeenHeading};
use super::augmented_states::{AUGMENTED_STATES, AugmentedStates, GNSS_OFFSET, TIME_OFFSET};
use super::preintegration::{Preintegration, SampleNoise, check_sample};
use super::{GnssPosition, GnssVelocity, NavigationState, STATES};
use crate::geometry::so3;
use crate::kalman::{Innovation, SkipReason};
use crate::parameters::ConfigError;
use crate::scalar::{Scalar, lit};

/// Number of error states of a hypothesis.
pub const ALIGNMENT_ERRORS: usize = LATE + 1;
/// First of the three correlated errors of the receiver's positions.
const CORRELATED: usize = STATES + GNSS_OFFSET;
/// The time offset.
const LATE: usize = STATES + TIME_OFFSET;

/// Covariance of a hypothesis's errors, and the errors.
type Covariance<T> = SMatrix<T, ALIGNMENT_ERRORS, ALIGNMENT_ERRORS>;
type ErrorVector<T> = SVector<T, ALIGNMENT_ERRORS>;

/// An interval of inertial samples longer than this is a gap, s.
const GAP_S: f64 = 0.1;
/// A longer time without a position that is used is the end of the window (s): it begins again with the next one.
pub const LONGEST_INTERVAL_S: f64 = 30.0;
/// Where a position may be, m from the origin in each direction.
const FARTHEST_M: f64 = 2e7;
/// A position that states more says nothing, m; a velocity, m/s.
const LARGEST_STD: f64 = 1e3;
/// Speed (m/s) that no fix's distance from the last can have been travelled with.
const FASTEST_M_S: f64 = 1e3;
/// So many impossible positions in a row are where it begins again.
const IMPOSSIBLE_IN_A_ROW: u32 = 3;
/// NIS of three components beyond which a position disagrees: one in thirty does by chance.
const DISAGREEING_NIS: f64 = 8.7;
/// It begins again at so many that disagree, less those that agree; ...
const MOST_DISAGREEING: u32 = 5;
/// ... and from so many on the heading is in doubt.
const DOUBTED_FROM: u32 = 2;
/// How much more uncertain than accepted the heading may become before it counts as unknown again.
const HYSTERESIS: f64 = 1.5;
/// Least specific force that shows where down is, as a fraction of gravity.
const LEAST_FORCE: f64 = 0.2;

/// What is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum AlignmentStatus {
    /// No position has been used yet.
    Aligning,
    /// Position and velocity are valid; the heading is as uncertain as stated, up to unknown.
    HeadingUnknown,
    /// All is known.
    Aligned,
}

/// The mixture of all hypotheses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignmentSolution<T: Scalar> {
    /// Attitude of the best hypothesis, `ned_from_body`.
    pub ned_from_body: UnitQuaternion<T>,
    /// Mean velocity, m/s, NED.
    pub velocity: Vector3<T>,
    /// Mean position of the unit, m, NED, at the receiver's time: the estimated time offset is taken out.
    pub position: Vector3<T>,
    /// Covariance of the position, m^2, differences between the hypotheses included.
    pub position_covariance: Matrix3<T>,
    /// The same of the velocity, (m/s)^2.
    pub velocity_covariance: Matrix3<T>,
    /// Standard deviation of the attitude about the vertical, rad: that of the heading.
    pub heading_std: T,
    /// Standard deviation of the attitude about the worse of the two horizontal axes, rad.
    pub tilt_std: T,
}

/// What a fix did, as the best hypothesis saw it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignmentUpdate<T: Scalar> {
    /// That of the position.
    pub position: Innovation<T>,
    /// That of the newest velocity before it; skipped as not used where the window has none.
    pub velocity: Innovation<T>,
    /// That of the newest heading before it, likewise.
    pub heading: Innovation<T>,
    /// Weights of the three, from 0 to 1: their noise was divided by them.
    pub weights: [T; 3],
}

impl<T: Scalar> AlignmentUpdate<T> {
    fn skipped(reason: SkipReason) -> Self {
        let none = Innovation::skipped(SkipReason::NotUsed);
        Self {
            position: Innovation::skipped(reason),
            velocity: none,
            heading: none,
            weights: [T::zero(); 3],
        }
    }
}

/// The alignment: a bank of at most `HYPOTHESES` headings over a window of at most `WINDOW` intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InMotionAlignment<T: Scalar, const HYPOTHESES: usize = 8, const WINDOW: usize = 12> {
    config: InMotionAlignmentConfig<T>,
    memory: Memory<T, HYPOTHESES, WINDOW>,
}

impl<T: Scalar, const HYPOTHESES: usize, const WINDOW: usize>
    InMotionAlignment<T, HYPOTHESES, WINDOW>
{
    /// One that waits for its first samples.
    ///
    /// # Errors
    /// The first parameter outside its permitted range.
    pub fn new(config: InMotionAlignmentConfig<T>) -> Result<Self, ConfigError> {
        const { assert!(HYPOTHESES >= 2 && WINDOW >= 4) };
        config.validate()?;
        Ok(Self {
            config,
            memory: Memory::default(),
        })
    }

    /// The settings.
    pub fn config(&self) -> &InMotionAlignmentConfig<T> {
        &self.config
    }

    /// What is known.
    pub fn status(&self) -> AlignmentStatus {
        match (&self.memory.bank, self.memory.is_aligned) {
            (None, _) => AlignmentStatus::Aligning,
            (Some(_), false) => AlignmentStatus::HeadingUnknown,
            (Some(_), true) => AlignmentStatus::Aligned,
        }
    }

    /// Hypotheses that are left.
    pub fn hypotheses(&self) -> usize {
        self.memory.bank.as_ref().map_or(0, |b| b.in_use().len())
    }

    /// How often it began again: after a gap, and where fixes disagreed with all that was before.
    pub fn restarts(&self) -> u32 {
        self.memory.restarts
    }

    /// Integrates an angular rate (rad/s) and a specific force (m/s^2), body axes, that held on average over the `dt`
    /// seconds up to now. An interval of more than 0.1 s is a gap and makes everything less certain.
    ///
    /// # Errors
    /// Why the sample was refused; nothing has changed then, but for a gap of more than 10 s, after which it begins again.
    pub fn propagate(
        &mut self,
        angular_rate: &Vector3<T>,
        specific_force: &Vector3<T>,
        dt: T,
    ) -> Result<(), SkipReason> {
        if let Err(reason) = check_sample(angular_rate, specific_force, dt) {
            if reason == SkipReason::TooLate {
                self.restart();
            }
            return Err(reason);
        }
        self.level(angular_rate, specific_force, dt);
        let noise = self.sample_noise(dt);
        let memory = &mut self.memory;
        memory.angular_rate = *angular_rate;
        if memory.bank.is_some() {
            memory.since.add(angular_rate, specific_force, dt, &noise)?;
            if memory.since.duration_s() > lit(LONGEST_INTERVAL_S) {
                self.restart();
            }
        }
        Ok(())
    }

    /// Keeps the mean specific force of the last second, turned along with the body.
    fn level(&mut self, angular_rate: &Vector3<T>, specific_force: &Vector3<T>, dt: T) {
        let (memory, time) = (&mut self.memory, self.config.levelling_time_s);
        let share = if memory.levelled_s < time {
            memory.levelled_s += dt;
            dt / memory.levelled_s
        } else {
            (dt / time).min(T::one())
        };
        let turned = so3::exp(&(angular_rate * -dt)) * memory.force;
        memory.force = turned + (specific_force - turned) * share;
    }

    fn sample_noise(&self, dt: T) -> SampleNoise<T> {
        let c = &self.config;
        let mut noise = SampleNoise {
            gyroscope_noise_density: c.gyroscope_noise_density,
            accelerometer_noise_density: c.accelerometer_noise_density,
        };
        if dt > lit(GAP_S) {
            let with = |a: T, b: T| (a * a + b * b).sqrt();
            let (rate, force) = (c.gap_attitude_random_walk, c.gap_velocity_random_walk);
            noise.gyroscope_noise_density = with(noise.gyroscope_noise_density, rate);
            noise.accelerometer_noise_density = with(noise.accelerometer_noise_density, force);
        }
        noise
    }

    /// Uses a position of this instant. The first one, once level is known, begins the bank and is skipped as not
    /// initialised; one sooner after the last than [`InMotionAlignmentConfig::shortest_interval_s`] is skipped as not due.
    pub fn gnss_position(&mut self, fix: &GnssPosition<T>) -> AlignmentUpdate<T> {
        let fix = match self.checked_position(fix) {
            Ok(fix) => fix,
            Err(reason) => return AlignmentUpdate::skipped(reason),
        };
        let Some(bank) = &self.memory.bank else {
            self.begin(&fix);
            return AlignmentUpdate::skipped(SkipReason::NotInitialized);
        };
        let t = self.memory.since.duration_s();
        if t < self.config.shortest_interval_s || t <= T::zero() {
            return AlignmentUpdate::skipped(SkipReason::NotDue);
        }
        // Nothing can have travelled there: no noise, another place. Student's weight would do, but for the first fix.
        let from = bank
            .best()
            .map_or(bank.origin, |best| best.end.mean.position + bank.origin);
        let off = if fix.has_height {
            fix.ned - from
        } else {
            (fix.ned - from).xy().push(T::zero())
        };
        if off.norm() > t.max(T::one()) * lit(FASTEST_M_S) {
            self.memory.impossible = self.memory.impossible.saturating_add(1);
            if self.memory.impossible >= IMPOSSIBLE_IN_A_ROW {
                self.begin_again(&fix);
            }
            return AlignmentUpdate::skipped(SkipReason::OutOfRange);
        }
        self.memory.impossible = 0;
        self.use_position(&fix)
    }

    /// The position with its standard deviations held to the floor, and without what was not measured.
    fn checked_position(&self, fix: &GnssPosition<T>) -> Result<GnssPosition<T>, SkipReason> {
        let mut made = *fix;
        if !fix.has_height {
            made.ned.z = T::zero();
            made.std.z = T::one();
        }
        check_measured(&made.ned, &made.std, lit(FARTHEST_M))?;
        let floor = self.config.position_std_floor_m;
        made.std = made.std.map(|s| s.max(floor));
        Ok(made)
    }

    fn use_position(&mut self, fix: &GnssPosition<T>) -> AlignmentUpdate<T> {
        let memory = &mut self.memory;
        let Some(bank) = &mut memory.bank else {
            return AlignmentUpdate::skipped(SkipReason::NotInitialized);
        };
        let mut position = *fix;
        position.ned -= bank.origin;
        if !fix.has_height {
            position.ned.z = T::zero();
        }
        memory.window.push(Interval {
            inertial: memory.since,
            angular_rate: memory.angular_rate,
            heading: memory.heading.take(),
            position,
            velocity: None,
        });
        let full = memory.window.is_full();
        let fit = bank.run(memory.window.intervals(), full, &self.config);
        let (Some(fit), Some(best)) = (fit, bank.best()) else {
            self.begin_again(fix);
            return AlignmentUpdate::skipped(SkipReason::Numerical);
        };
        let end = &best.end.mean;
        memory.since = Preintegration::new(end.accelerometer_bias, end.gyroscope_bias);
        if full {
            memory.window.drop_first();
        }
        let loose = if memory.is_aligned {
            lit(HYSTERESIS)
        } else {
            T::one()
        };
        memory.is_aligned = bank.is_aligned(loose, &self.config);
        let [(position, p), (velocity, v), (heading, h)] = fit.newest;
        let components = lit::<T>(f64::from(position.degrees_of_freedom) / 3.0);
        memory.disagreeing = if position.nis > components * lit(DISAGREEING_NIS) {
            memory.disagreeing.saturating_add(1)
        } else {
            memory.disagreeing.saturating_sub(1)
        };
        memory.is_aligned &= memory.disagreeing < DOUBTED_FROM;
        if memory.disagreeing >= MOST_DISAGREEING {
            self.begin_again(fix);
        }
        AlignmentUpdate {
            position,
            velocity,
            heading,
            weights: [p, v, h],
        }
    }

    /// Uses a velocity of this instant: it is fused with the position of the same instant, and is refused as not due
    /// where there is none. Give it after the position.
    pub fn gnss_velocity(&mut self, fix: &GnssVelocity<T>) -> Innovation<T> {
        let mut fix = *fix;
        if !fix.has_vertical {
            fix.ned.z = T::zero();
            fix.std.z = T::one();
        }
        if let Err(reason) = check_measured(&fix.ned, &fix.std, lit(FASTEST_M_S)) {
            return Innovation::skipped(reason);
        }
        let floor = self.config.velocity_std_floor_m_s;
        fix.std = fix.std.map(|s| s.max(floor));
        let memory = &mut self.memory;
        let Some(bank) = &mut memory.bank else {
            return Innovation::skipped(SkipReason::NotInitialized);
        };
        if memory.since.duration_s() > T::zero() {
            return Innovation::skipped(SkipReason::NotDue);
        }
        if bank.fixes == 0 {
            bank.begin_with_velocity(&fix, &self.config);
        } else if let Some(newest) = memory.window.newest_mut() {
            newest.velocity = Some(fix);
        }
        Innovation::skipped(SkipReason::Accumulated)
    }

    /// Uses a true heading (rad, clockwise from north) of the body's forward axis, of this instant, with its standard
    /// deviation: one more measurement of every hypothesis, that takes effect with the next position. Of several in an
    /// interval the last counts.
    pub fn heading(&mut self, heading: T, std: T) -> Innovation<T> {
        let known = Vector3::new(heading, T::zero(), T::zero());
        if let Err(reason) = check_measured(&known, &Vector3::repeat(std), lit(10.0)) {
            return Innovation::skipped(reason);
        }
        let memory = &mut self.memory;
        if memory.bank.is_none() {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        if !(std > T::zero()) {
            return Innovation::skipped(SkipReason::OutOfRange);
        }
        // What the bias is off by has turned it since the interval began.
        let turned = memory.since.duration_s() * self.config.gyroscope_bias_std;
        memory.heading = Some(SeenHeading {
            turned: memory.since.increment().rotation,
            heading,
            variance: std * std + turned * turned,
        });
        Innovation::skipped(SkipReason::Accumulated)
    }

    /// Position, velocity and attitude with covariance, of this instant; `None` before the first position.
    pub fn solution(&self) -> Option<AlignmentSolution<T>> {
        let memory = &self.memory;
        let bank = memory.bank.as_ref()?;
        let mut solution = bank.solution(&memory.since, &self.slow_std()?, &self.config)?;
        let doubt = self.heading_doubt();
        solution.heading_std = (solution.heading_std * solution.heading_std + doubt).sqrt();
        Some(solution)
    }

    /// Variance of the heading for fixes that disagree (W20): the more they are, the more probable it is that the
    /// hypotheses are wrong, and that it points anywhere.
    fn heading_doubt(&self) -> T {
        let doubted = (self.memory.disagreeing + 1).saturating_sub(DOUBTED_FROM);
        let most = MOST_DISAGREEING + 1 - DOUBTED_FROM;
        let anywhere = T::pi() * T::pi() / lit(3.0);
        anywhere * lit(f64::from(doubted) / f64::from(most))
    }

    /// The state of the best hypothesis for a filter that goes on from here, at this instant, with the heading as
    /// uncertain as that of the mixture; `None` unless [`AlignmentStatus::Aligned`].
    pub fn hand_over(&self) -> Option<(NavigationState<T>, AugmentedStates<T>)> {
        let memory = &self.memory;
        let bank = memory.bank.as_ref().filter(|_| memory.is_aligned)?;
        let estimate = bank.hand_over(&memory.since, &self.slow_std()?, &self.config)?;
        let (mean, p) = (&estimate.mean, estimate.covariance.full());
        let mut state = NavigationState::new(mean.ned_from_body, mean.velocity, mean.position);
        state.accelerometer_bias = mean.accelerometer_bias;
        state.gyroscope_bias = mean.gyroscope_bias;
        state.covariance = p.fixed_view::<STATES, STATES>(0, 0).into_owned();
        let mut side = AugmentedStates::default();
        const SEEN: usize = ALIGNMENT_ERRORS - STATES;
        const { assert!(SEEN <= AUGMENTED_STATES && GNSS_OFFSET == 0) };
        side.values
            .fixed_rows_mut::<3>(GNSS_OFFSET)
            .copy_from(&mean.gnss_offset);
        side.values[TIME_OFFSET] = mean.lateness - self.config.position_latency_s;
        side.cross
            .fixed_view_mut::<STATES, SEEN>(0, 0)
            .copy_from(&p.fixed_view::<STATES, SEEN>(0, STATES));
        side.covariance
            .fixed_view_mut::<SEEN, SEEN>(0, 0)
            .copy_from(&p.fixed_view::<SEEN, SEEN>(STATES, STATES));
        Some((state, side))
    }

    /// Standard deviations of the receiver's correlated error.
    fn slow_std(&self) -> Option<Vector3<T>> {
        let bank = self.memory.bank.as_ref()?;
        let newest = self.memory.window.intervals().last();
        let std = newest.map_or(bank.first.std, |interval| interval.position.std);
        Some(std * self.config.position_correlated_fraction)
    }

    /// Begins a bank at a position, if level is known; what has been learnt of the receiver's noise stays.
    fn begin(&mut self, fix: &GnssPosition<T>) {
        let memory = &mut self.memory;
        let force = memory.force.norm();
        if memory.levelled_s < self.config.levelling_time_s
            || !(force > self.config.gravity * lit(LEAST_FORCE))
        {
            memory.forget_window();
            return;
        }
        let scale = memory.bank.as_ref().map_or(T::one(), |bank| bank.scale);
        memory.forget_window();
        memory.bank = Some(Bank::new(&memory.force, fix, scale, &self.config));
    }

    fn begin_again(&mut self, fix: &GnssPosition<T>) {
        self.memory.restarts = self.memory.restarts.saturating_add(1);
        self.begin(fix);
    }

    /// Forgets everything.
    fn restart(&mut self) {
        let memory = &mut self.memory;
        let restarts = u32::from(memory.bank.is_some());
        *memory = Memory {
            restarts: memory.restarts.saturating_add(restarts),
            ..Memory::default()
        };
    }
}

/// Refuses what cannot have been measured.
fn check_measured<T: Scalar>(
    value: &Vector3<T>,
    std: &Vector3<T>,
    largest: T,
) -> Result<(), SkipReason> {
    if !value.iter().chain(std).all(|x| x.is_finite()) {
        return Err(SkipReason::NotFinite);
    }
    let possible = value.iter().all(|x| x.abs() <= largest)
        && std
            .iter()
            .all(|s| *s >= T::zero() && *s <= lit(LARGEST_STD));
    possible.then_some(()).ok_or(SkipReason::OutOfRange)
}
