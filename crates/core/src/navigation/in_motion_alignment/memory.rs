//! What the in-motion alignment remembers between two samples, and how it is saved and restored.

use nalgebra::Vector3;

use super::InMotionAlignment;
use super::bank::Bank;
use super::bias_step::AlignmentStep;
use super::hypothesis::AttitudePrior;
use super::window::{Interval, SeenHeading};
use crate::navigation::GnssPosition;
use crate::navigation::preintegration::Preintegration;
use crate::restorable::{InvalidState, Restorable, expect, finite};
use crate::scalar::Scalar;

/// The last intervals, oldest first.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Window<T: Scalar, const N: usize> {
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    intervals: [Interval<T>; N],
    len: usize,
}

/// All that is no setting.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Memory<T: Scalar, const K: usize, const N: usize> {
    /// Mean specific force of the levelling time, in the body axes of now.
    pub(super) force: Vector3<T>,
    /// Seconds that are in it, up to the levelling time.
    pub(super) levelled_s: T,
    /// The last sample's.
    pub(super) angular_rate: Vector3<T>,
    /// The samples since the newest position used.
    pub(super) since: Preintegration<T>,
    pub(super) heading: Option<SeenHeading<T>>,
    pub(super) rate_at_rest: Option<(Vector3<T>, T)>,
    pub(super) window: Window<T, N>,
    pub(super) bank: Option<Bank<T, K>>,
    pub(super) is_aligned: bool,
    /// What the next bank begins with besides.
    pub(super) prior: Option<AttitudePrior<T>>,
    /// What the receiver's standard deviations are multiplied by in it.
    pub(super) scale: T,
    /// Positions to come before a step is looked for: samples of the window were no measurements.
    pub(super) unseen: u32,
    /// Positions to come before a step is told: there was a gap, and what it hid looks like one.
    pub(super) untold: u32,
    /// Impossible positions in a row that lie together, and ...
    pub(super) impossible: u32,
    /// ... the last of them, m, NED.
    pub(super) impossible_ned: Vector3<T>,
    /// Positions that disagree, less those that agree.
    pub(super) disagreeing: u32,
    pub(super) restarts: u32,
    /// A step of a bias that nobody has asked for yet.
    pub(super) step: Option<AlignmentStep<T>>,
}

/// Everything that an [`InMotionAlignment`] remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct InMotionAlignmentState<T: Scalar, const HYPOTHESES: usize = 8, const WINDOW: usize = 12>
{
    memory: Memory<T, HYPOTHESES, WINDOW>,
}

impl<T: Scalar, const N: usize> Default for Window<T, N> {
    fn default() -> Self {
        let none = Interval {
            inertial: Preintegration::new(Vector3::zeros(), Vector3::zeros()),
            angular_rate: Vector3::zeros(),
            heading: None,
            rate_at_rest: None,
            position: GnssPosition {
                ned: Vector3::zeros(),
                std: Vector3::zeros(),
                has_height: false,
            },
            velocity: None,
            outlier_std: T::zero(),
        };
        Self {
            intervals: [none; N],
            len: 0,
        }
    }
}

impl<T: Scalar, const N: usize> Window<T, N> {
    pub(super) fn intervals(&self) -> &[Interval<T>] {
        self.intervals.get(..self.len).unwrap_or_default()
    }

    pub(super) fn intervals_mut(&mut self) -> &mut [Interval<T>] {
        self.intervals.get_mut(..self.len).unwrap_or_default()
    }

    pub(super) fn newest_mut(&mut self) -> Option<&mut Interval<T>> {
        let used = self.intervals.get_mut(..self.len)?;
        used.last_mut()
    }

    pub(super) fn is_full(&self) -> bool {
        self.len >= N
    }

    /// One more; there must be room.
    pub(super) fn push(&mut self, interval: Interval<T>) {
        if let Some(place) = self.intervals.get_mut(self.len) {
            *place = interval;
            self.len += 1;
        }
    }

    pub(super) fn drop_first(&mut self, count: usize) {
        let count = count.min(self.len);
        self.intervals.rotate_left(count);
        self.len = self.len.saturating_sub(count);
    }
}

impl<T: Scalar, const K: usize, const N: usize> Default for Memory<T, K, N> {
    fn default() -> Self {
        Self {
            force: Vector3::zeros(),
            levelled_s: T::zero(),
            angular_rate: Vector3::zeros(),
            since: Preintegration::new(Vector3::zeros(), Vector3::zeros()),
            heading: None,
            rate_at_rest: None,
            window: Window::default(),
            bank: None,
            is_aligned: false,
            prior: None,
            scale: T::one(),
            unseen: 0,
            untold: 0,
            impossible: 0,
            impossible_ned: Vector3::zeros(),
            disagreeing: 0,
            restarts: 0,
            step: None,
        }
    }
}

impl<T: Scalar, const K: usize, const N: usize> Memory<T, K, N> {
    /// Forgets bank and window, and keeps the level.
    pub(super) fn forget_window(&mut self) {
        self.since = Preintegration::new(Vector3::zeros(), Vector3::zeros());
        self.heading = None;
        self.rate_at_rest = None;
        self.window.len = 0;
        self.bank = None;
        self.is_aligned = false;
        self.impossible = 0;
        self.disagreeing = 0;
    }

    fn check(&self) -> Result<(), InvalidState> {
        let force = self.force.iter().chain(&self.angular_rate);
        let force = force.chain(&self.impossible_ned);
        finite("level", force.chain([&self.levelled_s]))?;
        self.since.check()?;
        if let Some(heading) = &self.heading {
            heading.check()?;
        }
        if let Some(prior) = &self.prior {
            prior.check()?;
        }
        finite("scale", [&self.scale])?;
        let step = self.step.iter();
        finite("step", step.flat_map(|step| [&step.size, &step.age_s]))?;
        let rest = self.rate_at_rest.iter();
        let rest = rest.flat_map(|(rate, variance)| rate.iter().chain([variance]));
        finite("rate at rest", rest)?;
        // After a fix there is always room for the next.
        expect("window", self.window.len < N, "shorter than its room")?;
        let all = &self.window.intervals;
        all.iter().try_for_each(Interval::check)?;
        self.bank.as_ref().map_or(Ok(()), Bank::check)
    }
}

impl<T: Scalar, const K: usize, const N: usize> Restorable for InMotionAlignment<T, K, N> {
    type State = InMotionAlignmentState<T, K, N>;

    fn save(&self) -> Self::State {
        InMotionAlignmentState {
            memory: self.memory,
        }
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        state.memory.check()?;
        self.memory = state.memory;
        Ok(())
    }
}
