//! In-motion alignment: level, heading, velocity and biases by a bank of headings, each a Gauss-Newton problem over a
//! sliding window of preintegrated intervals and fixes.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`.
//!
//! Use it where GNSS/INS has to begin on any vehicle in any motion: nothing is taken to stand still, to be mounted in
//! any way, or to point where it moves. What accelerations in the horizontal say of the heading, against the second
//! differences of the fixes, decides; until it has, the heading is stated as unknown, with the position already good. A
//! vehicle that never accelerates stays so, at constant cost, for days: what noise feigns of an acceleration or a speed shows
//! nothing. A compass or a second antenna is one more measurement of
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
//! Cost: an inertial sample is one preintegration, about 400 multiplications, whatever the number of hypotheses; a fix
//! is at most `HYPOTHESES` times `WINDOW` steps of 19 states, and where one is far off and an outlier or a
//! step of a bias is looked for, up to 30 times `WINDOW` more, all hypotheses twice for the first fix while it is in the window,
//! and twice where an outlier is found. Memory in single
//! precision: 1.8 KB a hypothesis and 490 bytes an interval, 12 KB for four and eight.

mod bank;
pub(super) mod bias_step;
mod config;
mod estimate;
pub(super) mod explanation;
mod hypothesis;
mod measurements;
mod memory;
mod moved_origin;
mod outlier;
mod robust_update;
mod window;

#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

pub use bias_step::AlignmentStep;
pub use config::InMotionAlignmentConfig;
pub use memory::InMotionAlignmentState;

use self::explanation::UNSEEN_FIXES;
use self::memory::Memory;
use super::augmented_states::{AUGMENTED_STATES, AugmentedStates, GNSS_OFFSET, TIME_OFFSET};
use super::preintegration::{SampleNoise, check_sample};
use super::{ATTITUDE, NavigationState, STATES};
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
/// It begins again at so many that disagree, less those that agree; ...
const MOST_DISAGREEING: u32 = 5;
/// ... and from so many on the heading is in doubt.
const DOUBTED_FROM: u32 = 2;

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

    /// How often it began again: after a gap, where fixes disagreed with all that was before, where the tilt was lost, and from a filter's
    /// state.
    pub fn restarts(&self) -> u32 {
        self.memory.restarts
    }

    /// The last step of a bias that was found, once.
    pub fn take_step(&mut self) -> Option<AlignmentStep<T>> {
        self.memory.step.take()
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
        if dt > lit(GAP_S) {
            memory.untold = UNSEEN_FIXES;
        }
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

    /// The mixture for a filter that goes on from here, at this instant: mean of all states but the attitude, which is that
    /// of the best hypothesis, and the covariance about it (W21); `None` before the first position.
    pub fn hand_over(&self) -> Option<(NavigationState<T>, AugmentedStates<T>)> {
        let memory = &self.memory;
        let bank = memory.bank.as_ref()?;
        let (mean, mut p) = bank.moments(&memory.since, &self.slow_std()?, &self.config)?;
        p[(ATTITUDE + 2, ATTITUDE + 2)] += self.heading_doubt();
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

    /// What the receiver's stated standard deviations are multiplied by, as its positions have shown; from 1 on.
    pub fn noise_scale(&self) -> T {
        let memory = &self.memory;
        memory.bank.as_ref().map_or(memory.scale, |bank| bank.scale)
    }

    /// Whether it would use a position of this instant, and not wait for a later one.
    pub(super) fn is_due(&self) -> bool {
        let since = self.memory.since.duration_s();
        self.memory.bank.is_none() || since >= self.config.shortest_interval_s
    }

    /// Noise densities of gyroscope and accelerometer from now on.
    pub(super) fn set_noise_densities(&mut self, [gyroscope, accelerometer]: [T; 2]) {
        self.config.gyroscope_noise_density = gyroscope;
        self.config.accelerometer_noise_density = accelerometer;
    }

    /// Fractions of the stated standard deviations from now on: independent from fix to fix, and correlated.
    pub(super) fn set_error_fractions(&mut self, uncorrelated: T, correlated: T) {
        self.config.position_uncorrelated_fraction = uncorrelated;
        self.config.position_correlated_fraction = correlated;
    }

    /// Standard deviations of the receiver's correlated error, m.
    pub(super) fn correlated_std(&self) -> Vector3<T> {
        self.slow_std().unwrap_or_else(Vector3::zeros)
    }

    fn slow_std(&self) -> Option<Vector3<T>> {
        let bank = self.memory.bank.as_ref()?;
        let newest = self.memory.window.intervals().last();
        let std = newest.map_or(bank.first.std, |newest| {
            newest.position.std * bank.scale.max(T::one())
        });
        Some(std * self.config.position_correlated_fraction)
    }

    /// Forgets everything.
    pub(super) fn forget(&mut self) {
        self.memory = Memory::default();
    }

    /// Forgets everything, and counts it.
    fn restart(&mut self) {
        let memory = &mut self.memory;
        let restarts = u32::from(memory.bank.is_some());
        *memory = Memory {
            restarts: memory.restarts.saturating_add(restarts),
            ..Memory::default()
        };
    }
}
