//! What the filter remembers between two samples, and how it is saved and restored.

use nalgebra::Vector3;

use super::bias_step::BiasSteps;
use super::counts::{Aid, AidCounts};
use super::sample_faults::SampleFaults;
use super::start_without_inertial::LevelStart;
use super::stillness::{Quiet, StillnessWindow, Window};
use super::vibration::Vibration;
use super::{CovarianceStep, ERRORS, GnssIns};
use crate::faults::leaping_stamp::LeapingStamp;
use crate::kalman::{CountedGate, ErrorListener};
use crate::navigation::augmented_states::{AUGMENTED_STATES, AugmentedStates};
use crate::navigation::gauss_markov_bias::BiasAtRest;
use crate::navigation::history::ImuHistory;
use crate::navigation::in_motion_alignment::InMotionAlignmentState;
use crate::navigation::{ErrorTransition, GnssVelocity, HeldFixes, NavigationState};
use crate::restorable::{InvalidState, Restorable, expect, finite};
use crate::scalar::{Scalar, lit};

/// Who follows the errors: the look for steps of biases, and the listener.
pub(super) type Followers<'a, T, L> = (&'a mut BiasSteps<T>, &'a mut L);

/// All that is neither a setting nor the state of the 15-state filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Memory<T: Scalar, const HISTORY: usize> {
    pub(super) side: AugmentedStates<T>,
    pub(super) history: ImuHistory<T, HISTORY>,
    /// Whether there is a state.
    pub(super) started: bool,
    /// Whether the alignment makes it.
    pub(super) aligning: bool,
    /// Seconds of samples that the alignment has not had yet (below zero: it is ahead), and how many.
    pub(super) unfed_s: T,
    pub(super) unfed: usize,
    /// Stamp of the newest position that the alignment has used.
    pub(super) aligned_fix_ns: Option<i64>,
    /// Since when the alignment knows the heading.
    pub(super) aligned_since_ns: Option<i64>,
    /// A velocity that waits for the position of its instant.
    pub(super) held_velocity: Option<(i64, GnssVelocity<T>)>,
    /// Whether the alignment has used the magnetometer.
    pub(super) magnetic_is_used: bool,
    /// The start without inertial unit.
    pub(super) level: LevelStart<T>,
    /// What the receiver's standard deviations are multiplied by: horizontal, vertical, velocity.
    pub(super) noise_scale: [T; 3],
    /// Positions that disagree, less twice those that agree, and the stamp of the last one that was judged.
    pub(super) disagreeing: u8,
    pub(super) judged_ns: Option<i64>,
    /// The instants at which a bias may have stepped.
    pub(super) bias_steps: BiasSteps<T>,
    /// The last position that was given, to see one that is repeated.
    pub(super) last_position: Option<Vector3<T>>,
    /// Its stamp, and whether a table tells it again in every row.
    pub(super) last_position_ns: Option<i64>,
    pub(super) held_fixes: HeldFixes<T>,
    /// What rounding has done to it since, m.
    pub(super) repeated_within: T,
    /// Whether the receiver repeats a position from which the body has gone.
    pub(super) frozen: bool,
    /// The same of a velocity.
    pub(super) last_velocity: Option<Vector3<T>>,
    /// The fastest that the vehicle was in the last minutes, m/s.
    pub(super) fastest: T,
    /// How often it aligned again, and how often a state was taken over from the alignment.
    pub(super) realignments: u32,
    pub(super) take_overs: u32,
    pub(super) window: StillnessWindow<T>,
    pub(super) quiet: Quiet<T>,
    pub(super) vibration: Vibration<T>,
    /// Checks of the inertial samples.
    pub(super) faults: SampleFaults<T>,
    /// Whether the last window may have been one at rest.
    pub(super) may_be_still: bool,
    /// Windows at rest in a row.
    pub(super) still_windows: u32,
    /// Until when the receiver's last velocity says that it stands.
    pub(super) stands_until_ns: Option<i64>,
    /// Time of the state.
    pub(super) now_ns: Option<i64>,
    pub(super) last_imu: Option<(i64, Vector3<T>, Vector3<T>)>,
    pub(super) last_fix_ns: Option<i64>,
    /// Stamp of the last magnetic field that was fused.
    pub(super) last_magnetic_ns: Option<i64>,
    /// Magnetic declination where the settings have none.
    pub(super) declination: T,
    /// Variance that the receiver's slow error is held to have, m^2.
    pub(super) slow_variance: Vector3<T>,
    /// Values at rest of the accelerometer's and the gyroscope's bias.
    pub(super) at_rest: [BiasAtRest<T>; 2],
    pub(super) last_step: CovarianceStep<T>,
    /// A finished window that has not been used yet.
    pub(super) due_window: Option<Window<T>>,
    pub(super) since_constraint: T,
    /// Seconds since something measured the velocity.
    pub(super) since_velocity: T,
    pub(super) gates: [CountedGate; Aid::ALL.len()],
    /// That of the angular rate at rest: its refusals are not those of the velocity.
    pub(super) standing_rate_gate: CountedGate,
    pub(super) counts: [AidCounts<T>; Aid::ALL.len()],
    pub(super) stamps: [Option<i64>; Aid::ALL.len()],
    pub(super) imu_skipped: u32,
    /// Stamps in a row that are of a time long past.
    pub(super) behind: u8,
    /// A stamp of the inertial unit that may be false.
    pub(super) leaping: LeapingStamp,
    pub(super) gaps: u32,
    /// Stamp of the last measurement since the last inertial sample that is behind a gap.
    pub(super) ahead_ns: Option<i64>,
    /// Whether inertial samples have come after fixes of a later time: what looks like a gap may be none.
    pub(super) samples_come_late: bool,
    pub(super) restarts: u32,
}

/// Everything that a [`GnssIns`] remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GnssInsState<T: Scalar, const HISTORY: usize = 32> {
    /// Position, velocity, attitude, biases and their covariance.
    pub navigation: NavigationState<T>,
    /// What the alignment has.
    pub alignment: InMotionAlignmentState<T>,
    memory: Memory<T, HISTORY>,
}

impl<T: Scalar, const HISTORY: usize> Default for Memory<T, HISTORY> {
    /// That of a filter that waits for its first samples.
    fn default() -> Self {
        Self {
            side: AugmentedStates::default(),
            history: ImuHistory::default(),
            started: false,
            aligning: true,
            unfed_s: T::zero(),
            unfed: 0,
            aligned_fix_ns: None,
            aligned_since_ns: None,
            held_velocity: None,
            magnetic_is_used: false,
            level: LevelStart::default(),
            noise_scale: [T::one(); 3],
            disagreeing: 0,
            judged_ns: None,
            bias_steps: BiasSteps::default(),
            last_position: None,
            last_position_ns: None,
            held_fixes: HeldFixes::default(),
            repeated_within: T::zero(),
            frozen: false,
            last_velocity: None,
            fastest: T::zero(),
            realignments: 0,
            take_overs: 0,
            window: StillnessWindow::default(),
            quiet: Quiet::default(),
            vibration: Vibration::default(),
            faults: SampleFaults::new(lit(0.3)),
            may_be_still: false,
            still_windows: 0,
            stands_until_ns: None,
            now_ns: None,
            last_imu: None,
            last_fix_ns: None,
            last_magnetic_ns: None,
            declination: T::zero(),
            slow_variance: Vector3::zeros(),
            at_rest: [BiasAtRest::new(Vector3::zeros(), Vector3::zeros()); 2],
            last_step: CovarianceStep {
                transition: ErrorTransition::default(),
                bias_kept: [T::one(); 2],
                side_kept: [T::one(); AUGMENTED_STATES],
            },
            due_window: None,
            since_constraint: T::zero(),
            since_velocity: T::zero(),
            gates: [CountedGate::default(); Aid::ALL.len()],
            standing_rate_gate: CountedGate::default(),
            counts: [AidCounts::default(); Aid::ALL.len()],
            stamps: [None; Aid::ALL.len()],
            imu_skipped: 0,
            behind: 0,
            leaping: LeapingStamp::default(),
            gaps: 0,
            ahead_ns: None,
            samples_come_late: false,
            restarts: 0,
        }
    }
}

impl<T: Scalar, const HISTORY: usize> Memory<T, HISTORY> {
    /// The augmented states, and all who follow the errors.
    pub(super) fn followed<'a, L>(
        &'a mut self,
        listener: &'a mut L,
    ) -> (&'a mut AugmentedStates<T>, Followers<'a, T, L>) {
        (&mut self.side, (&mut self.bias_steps, listener))
    }

    /// Whether it can be continued from.
    fn check(&self) -> Result<(), InvalidState> {
        self.side.check()?;
        self.history.check()?;
        finite("fixes seen", self.level.numbers())?;
        let held = self.held_velocity.iter();
        let held = held.flat_map(|(_, fix)| fix.ned.iter().chain(&fix.std));
        let held = held.chain(self.last_position.iter().flatten());
        let held = held.chain(self.last_velocity.iter().flatten());
        let start = held.chain(&self.noise_scale).chain([
            &self.unfed_s,
            &self.fastest,
            &self.repeated_within,
        ]);
        finite("start", start)?;
        self.held_fixes.check()?;
        expect("start", self.unfed <= HISTORY, "within the history")?;
        finite("standstill", self.window.numbers())?;
        finite("standstill", self.quiet.numbers())?;
        finite("vibration", self.vibration.numbers())?;
        finite("checks of samples", self.faults.numbers())?;
        finite("steps of biases", self.bias_steps.numbers())?;
        finite(
            "standstill",
            self.due_window.iter().flat_map(Window::numbers),
        )?;
        let sample = self.last_imu.iter();
        let sample = sample.flat_map(|(_, rate, force)| rate.iter().chain(force));
        finite("last inertial sample", sample)?;
        finite(
            "biases at rest",
            self.at_rest.iter().flat_map(BiasAtRest::numbers),
        )?;
        let step = &self.last_step;
        finite("last step", step.bias_kept.iter().chain(&step.side_kept))?;
        finite("last step", step.transition.numbers())?;
        finite("counts", self.counts.iter().map(|count| &count.nis_sum))?;
        let times = [&self.since_constraint, &self.since_velocity];
        let slow = self.slow_variance.iter().chain([&self.declination]);
        finite("variances and times", slow.chain(times))
    }
}

/// The listener is no part of the state: restoring calls its [`ErrorListener::restarted`], for its covariance with the
/// errors is not with those of the saved state. Who saves the listener too restores it afterwards, by
/// [`GnssIns::listener_mut`].
impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> Restorable
    for GnssIns<T, HISTORY, L>
{
    type State = GnssInsState<T, HISTORY>;

    fn save(&self) -> Self::State {
        GnssInsState {
            navigation: self.filter.save(),
            alignment: self.alignment.save(),
            memory: self.memory,
        }
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        state.memory.check()?;
        let timeless = state.memory.started && state.memory.now_ns.is_none();
        expect("time", !timeless, "there once it has started")?;
        let mut alignment = self.alignment;
        alignment.restore(state.alignment)?;
        self.filter.restore(state.navigation)?;
        self.alignment = alignment;
        self.memory = state.memory;
        self.listener.restarted();
        Ok(())
    }
}
