//! Transitions of the filter's errors as a smoother needs them, for whoever records them.
//!
//! Read first: `docs/derivations/bounded_velocity.md`, section on the smoother. The filter itself
//! watches with `()`, which is nothing and costs nothing.

use super::layout::{Covariance, Layout, VELOCITY};
use super::propagation::Sums;
use super::state::BoundedVelocityState;
use crate::scalar::Scalar;

/// How the errors move from one node to the next, before any update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step<T: Scalar> {
    /// With what was summed over the samples (B8).
    Propagation(Sums<T>),
    /// The velocity starts again, after a pause of the accelerometer.
    VelocityForgotten,
    /// The attitude becomes less certain, as over a gap, or the bias, as where a rest contradicts it.
    Widening,
}

impl<T: Scalar> Step<T> {
    /// `Phi` in full: the error after is `Phi` times the one before, plus noise.
    pub fn transition(&self, layout: &Layout) -> Covariance<T> {
        match self {
            Self::Propagation(sums) => sums.transition(layout),
            Self::VelocityForgotten => {
                let mut phi = Covariance::identity();
                phi[(VELOCITY, VELOCITY)] = T::zero();
                phi[(VELOCITY + 1, VELOCITY + 1)] = T::zero();
                phi
            }
            Self::Widening => Covariance::identity(),
        }
    }
}

/// A moment in the life of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Moment<'a, T: Scalar> {
    /// A new start, or a restored state: nothing before it matters.
    Started,
    /// The covariance is about to take this step. It is still the one after the last update; the
    /// attitude and the velocity have already followed the samples.
    Leaving(&'a Step<T>),
    /// It has taken it: the state is the prediction.
    Predicted,
    /// An update has corrected the state.
    Corrected,
}

/// Watches the steps of a filter.
pub trait StepObserver<T: Scalar> {
    /// Called at each [`Moment`] with the state as it is then.
    fn observe(&mut self, moment: Moment<'_, T>, state: &BoundedVelocityState<T>);
}

/// Nobody watches.
impl<T: Scalar> StepObserver<T> for () {
    #[inline(always)]
    fn observe(&mut self, _: Moment<'_, T>, _: &BoundedVelocityState<T>) {}
}
