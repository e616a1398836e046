//! Pose of a navigation filter with the covariance of its errors: what a tracker sees of it.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::innovation::SkipReason;
use crate::scalar::{Scalar, lit};

/// A pose further away (m), or with a heading beyond (rad), is none.
const FURTHEST_M: f64 = 1e8;
const MOST_HEADING_RAD: f64 = 1e4;

/// Where a navigation filter says that the own ship is, and the error that it says so with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavigationPose<'a, T: Scalar, const N: usize> {
    /// `[north, east, heading]`, m and rad.
    pub pose: Vector3<T>,
    /// Covariance of the navigation filter's error states.
    pub covariance: &'a SMatrix<T, N, N>,
    /// The rows that make the pose error from those states.
    pub pose_from_error: SMatrix<T, 3, N>,
}

impl<'a, T: Scalar> NavigationPose<'a, T, 3> {
    /// Of a navigation that is known by its pose alone: `[north, east, heading]` (m, rad) and their covariance.
    pub fn new(pose: Vector3<T>, covariance: &'a Matrix3<T>) -> Self {
        let pose_from_error = Matrix3::identity();
        Self {
            pose,
            covariance,
            pose_from_error,
        }
    }
}

impl<T: Scalar, const N: usize> NavigationPose<'_, T, N> {
    /// Covariance of the pose.
    pub fn pose_covariance(&self) -> Matrix3<T> {
        self.pose_from_error * self.covariance * self.pose_from_error.transpose()
    }

    /// Refuses what cannot be a pose with its covariance.
    pub(crate) fn check(&self) -> Result<(), SkipReason> {
        let finite =
            self.pose.norm_squared().is_finite() && self.covariance.norm_squared().is_finite();
        let place = self.pose.xy();
        if !finite {
            Err(SkipReason::NotFinite)
        } else if self.covariance.diagonal().iter().any(|v| *v < T::zero()) {
            Err(SkipReason::Numerical)
        } else if place.amax() > lit(FURTHEST_M) || self.pose.z.abs() > lit(MOST_HEADING_RAD) {
            Err(SkipReason::OutOfRange)
        } else {
            Ok(())
        }
    }
}
