//! Time base of attitude estimators: stamps, mean rates, gaps, and the start from the first samples.
//!
//! An [`AttitudeDriver`] takes samples as sensors deliver them, each with its own integer
//! nanosecond stamp, at any rate and with any sensor missing, and calls an [`AttitudeEstimator`]
//! with intervals in seconds. The same driver runs on a chip, behind the lab and over recordings.
//!
//! - The rate of an interval between gyroscope samples is their mean (`docs/derivations/mekf.md`,
//!   M6): between them, the last one is held and the difference made good at the next.
//! - A sample not newer than its sensor's last is skipped; one older than the state, but new for
//!   its sensor, updates without propagation.
//! - Samples are checked beside those before them ([`crate::faults`]): a spike is left out, a stuck gyroscope is one
//!   without samples, and what a clipped one did not see becomes variance. Each is an event ([`AttitudeDriver::take_fault`]).
//! - Where gyroscope samples stay away for longer than usual the rate is unknown: it relaxes to rest, and the variance
//!   grows by what the motion before lets expect (`docs/derivations/faults.md`, F4). When they come again, the turn between
//!   is that of a rate with both ends known (F5), and an attitude that may have turned far is aligned again.
//! - A bias of the gyroscope that steps is found by what gravity and field do in the frame that it carries along
//!   ([`crate::faults::bias_step`]): the estimator goes on with the new bias from what it knew before the step, and is aligned
//!   again where the samples since contradict that.
//! - A stamp far ahead of all samples is not used before another one goes on from it ([`crate::faults::leaping_stamp`]): behind a pause
//!   that costs one sample, and a false stamp costs its own sample only.
//! - A stamp that moved the time further ahead of the gyroscope than a gap was false: the next
//!   gyroscope sample brings the time back, or nothing would be new until then. Where the gyroscope's own
//!   stamp was false, or its clock was set back, its samples behind it bring the time back once they go on for
//!   longer than a gap; their turn is made up for then.
//! - It starts by [`Alignment`], and aligns again, keeping the bias, when an accelerometer or
//!   magnetometer first appears later.
//! - Without a magnetometer the heading of the start is arbitrary: the first compass heading turns
//!   the estimate to its north, those after it are measurements.

mod checks;
mod holes;
mod realignment;
mod stamps;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use self::checks::Checks;
use self::stamps::Behind;
use super::alignment::{Alignment, Prior};
use super::propagation::checked_rate;
use super::{AttitudeEstimator, CompassHeading, InitialState, Propagation};
use crate::faults::FaultySensor;
use crate::faults::leaping_stamp::LeapingStamp;
use crate::geometry::{rotation, so3};
use crate::kalman::covariance::{symmetrize, undrown};
use crate::kalman::{Innovation, SkipReason};
use crate::restorable::{InvalidState, Restorable, expect, finite};
use crate::scalar::{Scalar, lit, seconds};

/// Settings of a driver.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriverConfig<T: Scalar> {
    /// Seconds of samples that are averaged for the start, default 0.5. Raising it averages noise
    /// and vibration, and starts later.
    pub alignment_s: T,
    /// Longest interval between gyroscope samples that counts as continuous, s, default 0.5: stamps further ahead are
    /// doubted, and before the usual interval is known the last rate is held for so long.
    pub gap_limit_s: T,
    /// How the attitude drifts while its rate is unknown and nothing is known of the motion yet, rad/sqrt(s), default 0.5.
    pub gap_angle_random_walk: T,
    /// What is known beforehand, among it the axes of the reference (east, north, up).
    pub prior: Prior<T>,
}

impl<T: Scalar> Default for DriverConfig<T> {
    fn default() -> Self {
        Self {
            alignment_s: lit(0.5),
            gap_limit_s: lit(0.5),
            gap_angle_random_walk: lit(0.5),
            prior: Prior::default(),
        }
    }
}

/// Feeds an estimator with stamped samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeDriver<T: Scalar, E> {
    /// The estimator that is driven.
    pub estimator: E,
    config: DriverConfig<T>,
    memory: DriverMemory<T>,
}

/// What a driver remembers beside its estimator: times, the last rate, the alignment under way.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriverMemory<T: Scalar> {
    aligning: Option<Aligning<T>>,
    started: bool,
    has_force: bool,
    has_field: bool,
    /// Whether the alignment under way is one after a hole, of an estimator that runs.
    is_realigning: bool,
    /// Whether the compass has said where north is.
    has_heading: bool,
    /// What the estimator started from last.
    start: Option<InitialState<T>>,
    /// Time of the estimator's state.
    now_ns: Option<i64>,
    last_rate: Option<(i64, Vector3<T>)>,
    /// Samples of the gyroscope that go on further than a gap behind the last one.
    behind: Option<Behind<T>>,
    /// Turn (rad) that the last interval between gyroscope samples still owes.
    passed_on: Vector3<T>,
    last_force_ns: Option<i64>,
    last_field_ns: Option<i64>,
    last_heading_ns: Option<i64>,
    /// A stamp that may be false.
    leaping: LeapingStamp,
    /// What the samples are checked with, and what was found.
    checks: Checks<T>,
}

impl<T: Scalar> DriverMemory<T> {
    /// Nothing has been seen.
    fn new(config: &DriverConfig<T>) -> Self {
        Self {
            checks: Checks::new(config.gap_angle_random_walk),
            aligning: None,
            started: false,
            has_force: false,
            has_field: false,
            is_realigning: false,
            has_heading: false,
            start: None,
            now_ns: None,
            last_rate: None,
            behind: None,
            passed_on: Vector3::zeros(),
            last_force_ns: None,
            last_field_ns: None,
            last_heading_ns: None,
            leaping: LeapingStamp::default(),
        }
    }
}

/// State of a driver and of its estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize, S: serde::Serialize",
        deserialize = "T: serde::Deserialize<'de>, S: serde::Deserialize<'de>"
    ))
)]
pub struct DriverState<T: Scalar, S> {
    /// Of the estimator.
    pub estimator: S,
    /// Of the driver.
    pub driver: DriverMemory<T>,
}

impl<T: Scalar, E: AttitudeEstimator<T> + Restorable> Restorable for AttitudeDriver<T, E> {
    type State = DriverState<T, E::State>;

    fn save(&self) -> Self::State {
        DriverState {
            estimator: self.estimator.save(),
            driver: self.memory,
        }
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        let memory = &state.driver;
        let start = memory.start.as_ref();
        expect("start", start.is_none_or(InitialState::is_usable), "finite")?;
        let references = start.map(|start| &start.references);
        let field = references.iter().flat_map(|r| &r.magnetic_field).flatten();
        let force = references.iter().flat_map(|r| &r.specific_force);
        finite("references", force.chain(field))?;
        let rate = memory.last_rate.iter().flat_map(|(_, rate)| rate);
        let behind = memory.behind.iter().flat_map(|behind| &behind.rate);
        finite("rates", rate.chain(behind).chain(&memory.passed_on))?;
        finite("checks", memory.checks.numbers())?;
        if let Some(aligning) = &memory.aligning {
            aligning.alignment.check()?;
        }
        self.estimator.restore(state.estimator)?;
        self.memory = state.driver;
        Ok(())
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Aligning<T: Scalar> {
    alignment: Alignment<T>,
    since_ns: i64,
}

impl<T: Scalar, E: AttitudeEstimator<T>> AttitudeDriver<T, E> {
    /// Drives `estimator`, which says itself how uncertain a start is.
    pub fn new(estimator: E, config: DriverConfig<T>) -> Self {
        Self {
            estimator,
            config,
            memory: DriverMemory::new(&config),
        }
    }

    /// Starts from a known state instead of aligning; takes effect at once.
    pub fn start_from(&mut self, initial: &InitialState<T>) {
        self.start_at(initial);
        self.memory.has_force = true;
        self.memory.has_field = initial.references.magnetic_field.is_some();
        self.memory.aligning = None;
    }

    /// Whether the estimator has started.
    pub fn is_started(&self) -> bool {
        self.memory.started
    }

    /// What the estimator started from last.
    pub fn start(&self) -> Option<&InitialState<T>> {
        self.memory.start.as_ref()
    }

    /// Whether a compass has said where north is since the estimator started.
    pub fn knows_north(&self) -> bool {
        self.memory.has_heading
    }

    /// The estimate, once started.
    pub fn attitude(&self) -> Option<UnitQuaternion<T>> {
        self.memory.started.then(|| self.estimator.attitude())
    }

    /// Covariance (rad^2) of the local attitude error in body axes, once started; `None` also for estimators that
    /// make no statement about their error.
    pub fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        let started = self.memory.started.then_some(&self.estimator)?;
        started.attitude_covariance()
    }

    /// Yaw, pitch and roll (rad, [`rotation::to_yaw_pitch_roll`]) and their standard deviations, once started and where
    /// the estimator states them. Without a magnetometer or compass the yaw counts from where it began.
    pub fn yaw_pitch_roll(&self) -> Option<([T; 3], [T; 3])> {
        let (attitude, body) = (self.attitude()?, self.attitude_covariance()?);
        let axes = attitude.to_rotation_matrix();
        let reference = axes * body * axes.transpose();
        let std = rotation::yaw_pitch_roll_std(&attitude, &reference);
        Some((rotation::to_yaw_pitch_roll(&attitude), std))
    }

    /// Gyroscope bias (rad/s, body axes) and its covariance, once started; `None` when it is not estimated.
    pub fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        let started = self.memory.started.then_some(&self.estimator)?;
        started.gyroscope_bias()
    }

    /// Takes an angular rate (rad/s).
    pub fn gyroscope(&mut self, time_ns: i64, angular_rate: &Vector3<T>) -> Propagation {
        if let Err(reason) = checked_rate(angular_rate, &Vector3::zeros(), T::one()) {
            return Propagation::Skipped(reason);
        }
        let last_ns = self.memory.last_rate.map(|(last_ns, _)| last_ns);
        let last_ns = last_ns.max(self.memory.checks.gyroscope.last_ns());
        let is_behind = last_ns.is_some_and(|last_ns| time_ns <= last_ns);
        let run = is_behind.then(|| self.goes_on_behind(time_ns, angular_rate));
        if run == Some(None) {
            return Propagation::Skipped(SkipReason::NotNewer);
        }
        if self.leaps(Some(FaultySensor::Gyroscope), time_ns) {
            return Propagation::Skipped(SkipReason::Suspect);
        }
        self.forget_the_future(time_ns);
        match run {
            Some(Some(run)) => self.catch_up(&run),
            _ => self.leave_behind(time_ns),
        }
        let checked = self.memory.checks.gyroscope.check(time_ns, angular_rate);
        if self.memory.checks.gyroscope.may_be_clipped() {
            self.memory.checks.bias.interrupt();
        }
        if self.heed(time_ns, angular_rate, &checked) {
            match self.memory.last_rate {
                Some((last_ns, last)) => {
                    self.finish_interval((last_ns, &last), (time_ns, angular_rate), &checked);
                }
                None => self.advance_to(time_ns),
            }
            self.memory.last_rate = Some((time_ns, *angular_rate));
            if !self.memory.checks.is_saturated() {
                self.memory
                    .checks
                    .log
                    .ends(FaultySensor::Gyroscope, time_ns);
            }
        } else {
            self.advance_to(time_ns);
        }
        self.finish_alignment(time_ns);
        Propagation::Done
    }

    /// Takes a specific force (m/s^2).
    pub fn accelerometer(&mut self, time_ns: i64, specific_force: &Vector3<T>) -> Innovation<T> {
        if self
            .memory
            .last_force_ns
            .is_some_and(|last| time_ns <= last)
        {
            return Innovation::skipped(SkipReason::NotNewer);
        }
        if self.leaps(Some(FaultySensor::Accelerometer), time_ns) {
            return Innovation::skipped(SkipReason::Suspect);
        }
        self.memory.last_force_ns = Some(time_ns);
        self.advance_to(time_ns);
        let checks = &mut self.memory.checks;
        let permitted = checks.permits(FaultySensor::Accelerometer, time_ns, specific_force);
        let appeared =
            self.memory.started && !self.memory.has_force && Alignment::is_force(specific_force);
        if let Some(aligning) = self.alignment_at(time_ns, appeared)
            && permitted.is_ok()
            && aligning.alignment.add_specific_force(specific_force)
        {
            self.memory.has_force = true;
        }
        if !self.memory.started {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        match permitted {
            Ok(()) => {
                self.memory.checks.bias.force(specific_force);
                self.estimator.update_accelerometer(specific_force)
            }
            Err(reason) => Innovation::skipped(reason),
        }
    }

    /// Takes a magnetic field (microtesla).
    pub fn magnetometer(&mut self, time_ns: i64, magnetic_field: &Vector3<T>) -> Innovation<T> {
        if self
            .memory
            .last_field_ns
            .is_some_and(|last| time_ns <= last)
        {
            return Innovation::skipped(SkipReason::NotNewer);
        }
        if self.leaps(Some(FaultySensor::Magnetometer), time_ns) {
            return Innovation::skipped(SkipReason::Suspect);
        }
        self.memory.last_field_ns = Some(time_ns);
        self.advance_to(time_ns);
        let checks = &mut self.memory.checks;
        let permitted = checks.permits(FaultySensor::Magnetometer, time_ns, magnetic_field);
        let iron = if self.memory.is_realigning {
            self.estimator.hard_iron()
        } else {
            Vector3::zeros()
        };
        let appeared = self.memory.started
            && !self.memory.has_field
            && self.memory.has_force
            && Alignment::is_field(magnetic_field);
        if let Some(aligning) = self.alignment_at(time_ns, appeared) {
            let alignment = &mut aligning.alignment;
            // Behind a pause it begins with one that is told again, if that is all there is.
            let is_first = permitted == Err(SkipReason::Repeated) && !alignment.has_field();
            if (permitted.is_ok() || is_first)
                && alignment.add_magnetic_field(&(magnetic_field - iron))
            {
                self.memory.has_field = true;
            }
        }
        if !self.memory.started {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        match permitted {
            Ok(()) => {
                self.memory.checks.bias.field(magnetic_field);
                self.estimator.update_magnetometer(magnetic_field)
            }
            Err(reason) => Innovation::skipped(reason),
        }
    }

    /// Takes a heading of the device's top axis, clockwise from north, with its standard deviation
    /// (rad). See [`CompassHeading`].
    pub fn compass(&mut self, time_ns: i64, heading: T, std: T) -> Innovation<T> {
        if self
            .memory
            .last_heading_ns
            .is_some_and(|last| time_ns <= last)
        {
            return Innovation::skipped(SkipReason::NotNewer);
        }
        if self.leaps(None, time_ns) {
            return Innovation::skipped(SkipReason::Suspect);
        }
        self.memory.last_heading_ns = Some(time_ns);
        self.advance_to(time_ns);
        if !self.memory.started {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        if !self.memory.has_force {
            // Without up there is no horizon on which to measure it.
            return Innovation::skipped(SkipReason::Unobservable);
        }
        let frame = self.config.prior.frame;
        let measured = CompassHeading {
            frame,
            heading,
            std,
        };
        if self.memory.has_field || self.memory.has_heading {
            return self.estimator.update_compass(&measured);
        }
        Innovation::skipped(match self.turn_to(&measured) {
            Ok(()) => SkipReason::NotInitialized,
            Err(reason) => reason,
        })
    }

    /// Turns the estimate about up until it agrees with the compass. Tilt and bias stay as they
    /// are; what is said about the heading is the compass's uncertainty (M17h).
    fn turn_to(&mut self, measured: &CompassHeading<T>) -> Result<(), SkipReason> {
        let Some(start) = self.memory.start else {
            return Err(SkipReason::NotInitialized);
        };
        let before = self.estimator.attitude();
        let residual = measured.measure(&before)?.residual;
        let up = measured.frame.up::<T>();
        let up_body = before.inverse() * up;
        let covariance = self.estimator.attitude_covariance();
        let level = Matrix3::identity() - up_body * up_body.transpose();
        let std = measured
            .std
            .max(self.estimator.start_uncertainty().compass_std);
        let mut covariance = level * covariance.unwrap_or(start.attitude_covariance) * level
            + up_body * up_body.transpose() * (std * std);
        symmetrize(&mut covariance);
        undrown(&mut covariance);
        let (bias, bias_std) = match self.estimator.gyroscope_bias() {
            Some((bias, p)) => (bias, p.diagonal().max().max(T::zero()).sqrt()),
            None => (start.gyroscope_bias, start.gyroscope_bias_std),
        };
        self.start_at(&InitialState {
            attitude: rotation::renormalize(&(so3::exp(&(up * residual)) * before)),
            attitude_covariance: covariance,
            gyroscope_bias: bias,
            gyroscope_bias_std: bias_std,
            north_known: true,
            references: start.references,
        });
        Ok(())
    }

    fn start_at(&mut self, initial: &InitialState<T>) {
        if !initial.is_usable() {
            return;
        }
        self.estimator.initialize(initial);
        // What was known before has nothing to do with this start.
        self.memory.checks.bias.interrupt();
        self.memory.start = Some(*initial);
        self.memory.started = true;
        self.memory.has_heading = initial.north_known;
    }

    /// The alignment under way; begins one at the very start, and again when a sensor `appeared`.
    fn alignment_at(&mut self, time_ns: i64, appeared: bool) -> Option<&mut Aligning<T>> {
        if self.memory.aligning.is_none() && (!self.memory.started || appeared) {
            let alignment = Alignment::new(self.config.prior);
            self.memory.aligning = Some(Aligning {
                alignment,
                since_ns: time_ns,
            });
        }
        self.memory.aligning.as_mut()
    }

    /// Starts the estimator once the alignment has gathered for long enough. Without any
    /// accelerometer sample it waits four times as long before it starts blind.
    fn finish_alignment(&mut self, time_ns: i64) {
        let Some(Aligning {
            alignment,
            since_ns,
        }) = *self.alignment_or_begin(time_ns)
        else {
            return;
        };
        if self.memory.is_realigning {
            self.go_on_realigning(&alignment, seconds(since_ns, time_ns));
            return;
        }
        let patience = if self.memory.has_force {
            lit(1.0)
        } else {
            lit::<T>(4.0)
        };
        if seconds::<T>(since_ns, time_ns) < self.config.alignment_s * patience {
            return;
        }
        let mut initial = alignment.finish(&self.estimator.start_uncertainty());
        if self.memory.started
            && let Some((bias, covariance)) = self.estimator.gyroscope_bias()
        {
            initial.gyroscope_bias = bias;
            initial.gyroscope_bias_std = covariance.diagonal().max().max(T::zero()).sqrt();
        }
        self.start_at(&initial);
        self.memory.aligning = None;
    }

    fn alignment_or_begin(&mut self, time_ns: i64) -> &Option<Aligning<T>> {
        self.alignment_at(time_ns, false);
        &self.memory.aligning
    }

    fn propagate(&mut self, rate: &Vector3<T>, dt: T) {
        if dt <= T::zero() {
            return;
        }
        if let Some(aligning) = &mut self.memory.aligning {
            aligning.alignment.propagate(rate, dt);
        }
        if self.memory.started {
            self.estimator.propagate(rate, dt);
        }
        self.watch_bias(rate, dt);
    }
}

#[cfg(test)]
mod tests;
