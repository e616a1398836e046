//! The number, its arithmetic, and the conversions and traits that generic code asks of a number.

use core::cmp::Ordering;
use core::fmt;
use core::ops::{
    Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign,
};

use num_traits::{FromPrimitive, Num, One, Signed, Zero};
use simba::scalar::SubsetOf;

use crate::count;

/// An `f64` whose operations are counted; see the [crate](crate).
#[derive(Debug, Clone, Copy, Default)]
pub struct Counting(pub(crate) f64);

impl Counting {
    /// From a value; costs nothing.
    pub const fn new(value: f64) -> Self {
        Self(value)
    }

    /// The value.
    pub const fn value(self) -> f64 {
        self.0
    }
}

impl fmt::Display for Counting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

macro_rules! arithmetic {
    ($($operator:ident $method:ident $assign:ident $assign_method:ident $counter:ident;)*) => {$(
        impl $operator for Counting {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                count(|done| done.$counter += 1);
                Self($operator::$method(self.0, other.0))
            }
        }

        impl $assign for Counting {
            fn $assign_method(&mut self, other: Self) {
                *self = $operator::$method(*self, other);
            }
        }
    )*};
}

arithmetic! {
    Add add AddAssign add_assign additions;
    Sub sub SubAssign sub_assign additions;
    Mul mul MulAssign mul_assign multiplications;
    Div div DivAssign div_assign divisions;
    Rem rem RemAssign rem_assign divisions;
}

impl Neg for Counting {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl PartialEq for Counting {
    fn eq(&self, other: &Self) -> bool {
        count(|done| done.comparisons += 1);
        self.0 == other.0
    }
}

impl PartialOrd for Counting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        count(|done| done.comparisons += 1);
        self.0.partial_cmp(&other.0)
    }
}

impl Zero for Counting {
    fn zero() -> Self {
        Self(0.0)
    }
    fn is_zero(&self) -> bool {
        *self == Self(0.0)
    }
}

impl One for Counting {
    fn one() -> Self {
        Self(1.0)
    }
}

impl Num for Counting {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;
    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Self)
    }
}

impl Signed for Counting {
    fn abs(&self) -> Self {
        Self(self.0.abs())
    }
    fn abs_sub(&self, other: &Self) -> Self {
        if *self <= *other {
            Self(0.0)
        } else {
            *self - *other
        }
    }
    fn signum(&self) -> Self {
        Self(self.0.signum())
    }
    fn is_positive(&self) -> bool {
        self.0.is_sign_positive()
    }
    fn is_negative(&self) -> bool {
        self.0.is_sign_negative()
    }
}

impl FromPrimitive for Counting {
    fn from_i64(n: i64) -> Option<Self> {
        f64::from_i64(n).map(Self)
    }
    fn from_u64(n: u64) -> Option<Self> {
        f64::from_u64(n).map(Self)
    }
    fn from_f64(n: f64) -> Option<Self> {
        Some(Self(n))
    }
}

impl SubsetOf<Self> for Counting {
    fn to_superset(&self) -> Self {
        *self
    }
    fn from_superset_unchecked(element: &Self) -> Self {
        *element
    }
    fn is_in_subset(_: &Self) -> bool {
        true
    }
}

impl SubsetOf<Counting> for f64 {
    fn to_superset(&self) -> Counting {
        Counting(*self)
    }
    fn from_superset_unchecked(element: &Counting) -> Self {
        element.0
    }
    fn is_in_subset(_: &Counting) -> bool {
        true
    }
}

impl SubsetOf<Counting> for f32 {
    fn to_superset(&self) -> Counting {
        Counting(f64::from(*self))
    }
    fn from_superset_unchecked(element: &Counting) -> Self {
        element.0 as f32
    }
    fn is_in_subset(_: &Counting) -> bool {
        true
    }
}
