//! One step back of the Rauch-Tung-Striebel recursion, whatever the states are.

use nalgebra::{SMatrix, SVector};

/// Added to the diagonal of the predicted covariance, scaled to ones, before it is factored: states
/// that have become one by exact updates still have a factor.
const RIDGE: f64 = 1e-10;

/// The covariances on both sides of one step, and how the error moves along it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link<'a, const N: usize> {
    /// `P^+` before the step.
    pub(crate) filtered: &'a SMatrix<f64, N, N>,
    /// `Phi`.
    pub(crate) transition: &'a SMatrix<f64, N, N>,
    /// `P^-` after it.
    pub(crate) predicted: &'a SMatrix<f64, N, N>,
}

impl<const N: usize> Link<'_, N> {
    /// What smoothing changes before the step: correction and covariance, given by how much the
    /// smoothed state after it differs from the prediction, and its covariance. States that are
    /// not in use have a variance of zero and stay as they are. `None` where the prediction has no
    /// inverse.
    pub(crate) fn back(
        &self,
        difference: &SVector<f64, N>,
        next: &SMatrix<f64, N, N>,
    ) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)> {
        let gain = self.gain()?;
        // (M22c, B26)
        let change = next - self.predicted;
        let covariance = self.filtered + gain * change * gain.transpose();
        let covariance = (covariance + covariance.transpose()) * 0.5;
        Some((gain * difference, covariance))
    }

    /// (M22, B23), transposed: `G^T = (P^-)^-1 Phi P^+`, as `P^+` and `P^-` are symmetric.
    fn gain(&self) -> Option<SMatrix<f64, N, N>> {
        let scale = self.predicted.diagonal().map(|variance| {
            if variance > 0.0 {
                variance.sqrt().recip()
            } else {
                1.0
            }
        });
        let mut scaled =
            SMatrix::<f64, N, N>::from_fn(|i, j| self.predicted[(i, j)] * scale[i] * scale[j]);
        for i in 0..N {
            scaled[(i, i)] = 1.0 + RIDGE;
        }
        let mut moved = self.transition * self.filtered;
        for (mut row, scale) in moved.row_iter_mut().zip(&scale) {
            row *= *scale;
        }
        let mut solved = scaled.cholesky()?.solve(&moved);
        for (mut row, scale) in solved.row_iter_mut().zip(&scale) {
            row *= *scale;
        }
        Some(solved.transpose())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Matrix3, Vector3};

    /// Two looks at a random walk, against the joint normal distribution; the third state is not in
    /// use.
    #[test]
    fn one_step_equals_conditioning_and_leaves_unused_states_alone() {
        let (walk, noise) = (0.7, 0.3);
        let filtered = Matrix3::new(2.0, 0.4, 0.0, 0.4, 1.0, 0.0, 0.0, 0.0, 0.0);
        let transition = Matrix3::new(1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let mut predicted = transition * filtered * transition.transpose();
        predicted[(0, 0)] += walk;
        // A look at the first state, off by one.
        let h = Vector3::x();
        let variance = predicted[(0, 0)] + noise;
        let gain = predicted * h / variance;
        let (difference, next) = (gain, predicted - gain * gain.transpose() * variance);
        let link = Link {
            filtered: &filtered,
            transition: &transition,
            predicted: &predicted,
        };
        let (x, covariance) = link.back(&difference, &next).unwrap();
        // The same look at the state before.
        let cross = filtered * transition.transpose() * h;
        assert_relative_eq!(x, cross / variance, epsilon = 1e-8);
        let expected = filtered - cross * cross.transpose() / variance;
        assert_relative_eq!(covariance, expected, epsilon = 1e-8);
    }

    #[test]
    fn a_prediction_that_is_no_covariance_carries_nothing_back() {
        let (unit, bad) = (Matrix3::identity(), Matrix3::from_element(f64::NAN));
        let link = Link {
            filtered: &unit,
            transition: &unit,
            predicted: &bad,
        };
        assert!(link.back(&Vector3::zeros(), &unit).is_none());
    }
}
