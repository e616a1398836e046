//! How arrays and matrices of any size are written and read: without allocation, matrices as rows.
//!
//! Vectors are written by nalgebra, as a list. Quaternions go through
//! [`rotation::wxyz`](crate::geometry::rotation::wxyz).

use core::fmt;
use core::marker::PhantomData;

use serde::de::{Error, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// An array of any length; serde itself knows those up to 32 elements.
#[derive(Clone, Copy)]
struct Fixed<T, const N: usize>([T; N]);

impl<T: Serialize, const N: usize> Serialize for Fixed<T, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        array::serialize(&self.0, serializer)
    }
}

impl<'de, T: Deserialize<'de> + Copy, const N: usize> Deserialize<'de> for Fixed<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_tuple(N, FixedVisitor(PhantomData))
    }
}

struct FixedVisitor<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de> + Copy, const N: usize> Visitor<'de> for FixedVisitor<T, N> {
    type Value = Fixed<T, N>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{N} elements")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Self::Value, A::Error> {
        let first = elements.next_element()?;
        let first: T = first.ok_or_else(|| A::Error::invalid_length(0, &self))?;
        let mut all = [first; N];
        for (i, place) in all.iter_mut().enumerate().skip(1) {
            let next = elements.next_element()?;
            *place = next.ok_or_else(|| A::Error::invalid_length(i, &self))?;
        }
        Ok(Fixed(all))
    }
}

/// `serde(with)` for an array of at least one element.
pub(crate) mod array {
    use super::{Deserialize, Deserializer, Fixed, Serialize, SerializeTuple, Serializer};

    pub(crate) fn serialize<T: Serialize, S: Serializer, const N: usize>(
        array: &[T; N],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(N)?;
        for element in array {
            tuple.serialize_element(element)?;
        }
        tuple.end()
    }

    pub(crate) fn deserialize<'de, T, D, const N: usize>(
        deserializer: D,
    ) -> Result<[T; N], D::Error>
    where
        T: Deserialize<'de> + Copy,
        D: Deserializer<'de>,
    {
        Fixed::deserialize(deserializer).map(|fixed| fixed.0)
    }
}

/// `serde(with)` for a matrix: a list of its rows.
pub(crate) mod rows {
    use nalgebra::SMatrix;

    use super::{Deserialize, Deserializer, Fixed, Serialize, Serializer};
    use crate::scalar::Scalar;

    pub(crate) fn serialize<T, S, const R: usize, const C: usize>(
        matrix: &SMatrix<T, R, C>,
        serializer: S,
    ) -> Result<S::Ok, S::Error>
    where
        T: Scalar + Serialize,
        S: Serializer,
    {
        let row = |i| Fixed::<T, C>(core::array::from_fn(|j| matrix[(i, j)]));
        Fixed::<_, R>(core::array::from_fn(row)).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, T, D, const R: usize, const C: usize>(
        deserializer: D,
    ) -> Result<SMatrix<T, R, C>, D::Error>
    where
        T: Scalar + Deserialize<'de>,
        D: Deserializer<'de>,
    {
        let Fixed(rows) = Fixed::<Fixed<T, C>, R>::deserialize(deserializer)?;
        Ok(SMatrix::from_fn(|i, j| rows[i].0[j]))
    }
}
