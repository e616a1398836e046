//! The mean of the fields since the last update, in level axes: samples between updates lower the noise of the next one (B15b).

use nalgebra::{UnitQuaternion, Vector3};

use crate::scalar::Scalar;

/// Sums fields, each turned by the attitude of its own instant.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct FieldMean<T: Scalar> {
    /// microtesla, level axes, without hard iron.
    sum: Vector3<T>,
    count: T,
}

impl<T: Scalar> Default for FieldMean<T> {
    fn default() -> Self {
        Self {
            sum: Vector3::zeros(),
            count: T::zero(),
        }
    }
}

impl<T: Scalar> FieldMean<T> {
    /// A field, microtesla, level axes.
    #[inline]
    pub(super) fn add(&mut self, level: &Vector3<T>) {
        self.sum += level;
        self.count += T::one();
    }

    /// The filter has turned its level axes.
    #[inline]
    pub(super) fn corrected(&mut self, turn: &UnitQuaternion<T>) {
        if self.count > T::zero() {
            self.sum = turn * self.sum;
        }
    }

    /// The mean, microtesla, level axes, of one or more; what follows begins anew.
    #[inline]
    pub(super) fn take(&mut self) -> Vector3<T> {
        let mean = self.sum * (T::one() / self.count.max(T::one()));
        self.sum.fill(T::zero());
        self.count = T::zero();
        mean
    }

    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.sum.iter().chain([&self.count])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;

    const PRESENT: Vector3<f64> = Vector3::new(0.0, 20.0, -40.0);

    #[test]
    fn it_is_the_mean_and_begins_anew() {
        let mut mean = FieldMean::default();
        let [a, b] = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(3.0, 6.0, 5.0)];
        mean.add(&a);
        mean.add(&b);
        assert_eq!(mean.take(), (a + b) * 0.5);
        mean.add(&b);
        assert_eq!(mean.take(), b);
    }

    #[test]
    fn a_correction_turns_what_was_summed() {
        let mut mean = FieldMean::default();
        let turn = so3::exp(&Vector3::new(0.01, -0.02, 0.03));
        mean.add(&PRESENT);
        mean.corrected(&turn);
        assert!((mean.take() - turn * PRESENT).norm() < 1e-12);
    }
}
