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
    /// As measured, microtesla, body axes.
    last: Vector3<T>,
}

impl<T: Scalar> Default for FieldMean<T> {
    fn default() -> Self {
        Self {
            sum: Vector3::zeros(),
            count: T::zero(),
            last: Vector3::zeros(),
        }
    }
}

impl<T: Scalar> FieldMean<T> {
    /// A field as measured (microtesla, body axes), and in level axes. A repeated one is no sample: it is held by a logger
    /// until the next one comes, and was not measured where the device is now.
    #[inline]
    pub(super) fn add(&mut self, measured: &Vector3<T>, level: &Vector3<T>) {
        if *measured != self.last {
            self.last = *measured;
            self.sum += level;
            self.count += T::one();
        }
    }

    /// The filter has turned its level axes.
    #[inline]
    pub(super) fn corrected(&mut self, turn: &UnitQuaternion<T>) {
        if self.count > T::zero() {
            self.sum = turn * self.sum;
        }
    }

    /// The mean, microtesla, level axes, or where all were repeated the present one; what follows begins anew.
    #[inline]
    pub(super) fn take(&mut self, present: &Vector3<T>) -> Vector3<T> {
        let (sum, count) = (self.sum, self.count);
        self.sum.fill(T::zero());
        self.count = T::zero();
        if count > T::zero() {
            sum * (T::one() / count)
        } else {
            *present
        }
    }

    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.sum.iter().chain([&self.count]).chain(&self.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;

    const PRESENT: Vector3<f64> = Vector3::new(0.0, 20.0, -40.0);

    #[test]
    fn each_sample_counts_once() {
        let mut mean = FieldMean::default();
        let [a, b] = [Vector3::new(1.0, 2.0, 3.0), Vector3::new(3.0, 6.0, 5.0)];
        // The second is held for two samples while the device turns on.
        mean.add(&a, &a);
        mean.add(&b, &b);
        mean.add(&b, &PRESENT);
        mean.add(&b, &PRESENT);
        assert_eq!(mean.take(&PRESENT), (a + b) * 0.5);
    }

    /// A magnetometer with coarse steps repeats itself at rest, and is right.
    #[test]
    fn where_all_are_repeated_the_present_one_counts() {
        let mut mean = FieldMean::default();
        mean.add(&PRESENT, &PRESENT);
        mean.take(&PRESENT);
        mean.add(&PRESENT, &PRESENT);
        assert_eq!(mean.take(&PRESENT), PRESENT);
    }

    #[test]
    fn a_correction_turns_what_was_summed() {
        let mut mean = FieldMean::default();
        let turn = so3::exp(&Vector3::new(0.01, -0.02, 0.03));
        mean.add(&PRESENT, &PRESENT);
        mean.corrected(&turn);
        assert!((mean.take(&PRESENT) - turn * PRESENT).norm() < 1e-12);
    }
}
