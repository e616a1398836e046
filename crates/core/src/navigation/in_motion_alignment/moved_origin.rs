//! The alignment in another local frame: the origin moves on while the heading is not known yet.
//!
//! Samples stay as they are, so gravity in the window is that of the old frame's plane: a kilometre turns it by
//! 0.16 mrad, which is below the noise.

use super::InMotionAlignment;
use super::bank::Bank;
use super::estimate::{Estimate, Triangle};
use super::hypothesis::{AttitudePrior, Hypothesis};
use super::window::Interval;
use crate::earth::FrameChange;
use crate::navigation::moved_origin::move_covariance;
use crate::scalar::Scalar;

impl<T: Scalar, const HYPOTHESES: usize, const WINDOW: usize>
    InMotionAlignment<T, HYPOTHESES, WINDOW>
{
    /// Goes on in another local frame: positions count from its origin from now on.
    ///
    /// For moves of some kilometres. After a longer one it must begin again: its window has felt another gravity.
    pub fn move_origin(&mut self, change: &FrameChange<T>) {
        if !change.is_finite() {
            return;
        }
        let memory = &mut self.memory;
        if let Some(bank) = &mut memory.bank {
            bank.move_origin(change);
        }
        for interval in memory.window.intervals_mut() {
            interval.move_origin(change);
        }
        memory.impossible_ned = change.position(&memory.impossible_ned);
        if let Some(prior) = &mut memory.prior {
            prior.move_origin(change);
        }
    }
}

impl<T: Scalar, const K: usize> Bank<T, K> {
    fn move_origin(&mut self, change: &FrameChange<T>) {
        self.origin = change.position(&self.origin);
        self.first.ned = change.vector(&self.first.ned);
        for hypothesis in self.in_use_mut() {
            hypothesis.move_origin(change);
        }
    }
}

impl<T: Scalar> Hypothesis<T> {
    fn move_origin(&mut self, change: &FrameChange<T>) {
        self.anchor.move_origin(change);
        self.end.move_origin(change);
        self.about.ned_from_body = change.attitude(&self.about.ned_from_body);
    }
}

impl<T: Scalar> Estimate<T> {
    /// Positions are relative to the bank's origin, which moves by itself.
    fn move_origin(&mut self, change: &FrameChange<T>) {
        let mean = &mut self.mean;
        mean.ned_from_body = change.attitude(&mean.ned_from_body);
        mean.velocity = change.vector(&mean.velocity);
        mean.position = change.vector(&mean.position);
        mean.gnss_offset = change.vector(&mean.gnss_offset);
        let mut full = self.covariance.full();
        move_covariance(&mut full, change);
        self.covariance = Triangle::of(&full);
    }
}

impl<T: Scalar> AttitudePrior<T> {
    fn move_origin(&mut self, change: &FrameChange<T>) {
        self.ned_from_body = change.attitude(&self.ned_from_body);
        for _ in 0..2 {
            for mut column in self.covariance.column_iter_mut() {
                let turned = change.vector(&column.fixed_rows::<3>(0).into_owned());
                column.fixed_rows_mut::<3>(0).copy_from(&turned);
            }
            self.covariance.transpose_mut();
        }
    }
}

impl<T: Scalar> Interval<T> {
    fn move_origin(&mut self, change: &FrameChange<T>) {
        self.position.ned = change.vector(&self.position.ned);
        if let Some(velocity) = &mut self.velocity {
            velocity.ned = change.vector(&velocity.ned);
        }
    }
}
