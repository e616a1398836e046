//! How fields of each type read their row of the table, and are read and set by name.

use super::{Range, Value};
use crate::scalar::{Scalar, lit};

/// An enumeration whose values have names: those of files and of the command line.
pub trait Choice: Copy + PartialEq + 'static {
    /// Every value with its name.
    const ALL: &'static [(&'static str, Self)];
    /// The names alone.
    const WORDS: &'static [&'static str];

    /// Its name.
    fn word(self) -> &'static str {
        let named = Self::ALL.iter().find(|(_, value)| *value == self);
        named.map_or("", |(word, _)| word)
    }

    /// The value of that name.
    fn from_word(word: &str) -> Option<Self> {
        let named = Self::ALL.iter().find(|(name, _)| *name == word);
        named.map(|(_, value)| *value)
    }
}

/// A type that a parameter can have, in a configuration whose numbers are `T`. `Kind` only tells the
/// implementations apart; the compiler finds it.
pub trait Field<T, Kind>: Copy {
    /// How a value is written in the table.
    type Written: Copy;

    /// The field of what is written.
    fn from_table(written: Self::Written) -> Self;

    /// Its value.
    fn value(&self) -> Value<T>;

    /// The field of a value; `None`: it is of another kind.
    fn from_value(value: Value<T>) -> Option<Self>;

    /// Whether the range permits it.
    fn is_within(&self, range: &Range) -> bool;
}

macro_rules! kinds {
    ($($kind:ident),*) => { $(
        #[derive(Debug)]
        #[doc(hidden)]
        pub enum $kind {}
    )* };
}
kinds!(
    Number,
    Count,
    Flag,
    Word,
    Vector,
    OptionalNumber,
    OptionalPair
);

impl<T: Scalar> Field<T, Number> for T {
    type Written = f64;

    #[inline]
    fn from_table(written: f64) -> Self {
        lit(written)
    }

    fn value(&self) -> Value<T> {
        Value::Number(*self)
    }

    fn from_value(value: Value<T>) -> Option<Self> {
        match value {
            Value::Number(number) => Some(number),
            _ => None,
        }
    }

    #[inline]
    fn is_within(&self, range: &Range) -> bool {
        range.permits(*self)
    }
}

impl<T: Scalar> Field<T, Count> for u32 {
    type Written = Self;

    fn from_table(written: Self) -> Self {
        written
    }

    fn value(&self) -> Value<T> {
        Value::Count(*self)
    }

    fn from_value(value: Value<T>) -> Option<Self> {
        match value {
            Value::Count(count) => Some(count),
            _ => None,
        }
    }

    fn is_within(&self, range: &Range) -> bool {
        matches!(range, Range::Count(least) if self >= least)
    }
}

impl<T: Scalar> Field<T, Flag> for bool {
    type Written = Self;

    #[inline]
    fn from_table(written: Self) -> Self {
        written
    }

    fn value(&self) -> Value<T> {
        Value::Flag(*self)
    }

    fn from_value(value: Value<T>) -> Option<Self> {
        match value {
            Value::Flag(flag) => Some(flag),
            _ => None,
        }
    }

    #[inline]
    fn is_within(&self, _: &Range) -> bool {
        true
    }
}

impl<T: Scalar, C: Choice> Field<T, Word> for C {
    type Written = Self;

    #[inline]
    fn from_table(written: Self) -> Self {
        written
    }

    fn value(&self) -> Value<T> {
        Value::Word(self.word())
    }

    fn from_value(value: Value<T>) -> Option<Self> {
        match value {
            Value::Word(word) => Self::from_word(word),
            _ => None,
        }
    }

    #[inline]
    fn is_within(&self, _: &Range) -> bool {
        true
    }
}

impl<T: Scalar> Field<T, Vector> for [T; 3] {
    type Written = [f64; 3];

    #[inline]
    fn from_table(written: [f64; 3]) -> Self {
        written.map(lit)
    }

    fn value(&self) -> Value<T> {
        Value::Vector(*self)
    }

    fn from_value(value: Value<T>) -> Option<Self> {
        match value {
            Value::Vector(vector) => Some(vector),
            _ => None,
        }
    }

    fn is_within(&self, range: &Range) -> bool {
        matches!(range, Range::Vector(each) if self.iter().all(|x| each.permits(*x)))
    }
}

impl<T: Scalar> Field<T, OptionalNumber> for Option<T> {
    type Written = Option<f64>;

    #[inline]
    fn from_table(written: Option<f64>) -> Self {
        written.map(lit)
    }

    fn value(&self) -> Value<T> {
        self.map_or(Value::Absent, Value::Number)
    }

    fn from_value(value: Value<T>) -> Option<Self> {
        match value {
            Value::Number(number) => Some(Some(number)),
            Value::Absent => Some(None),
            _ => None,
        }
    }

    fn is_within(&self, range: &Range) -> bool {
        matches!(range, Range::Optional(inner) if self.is_none_or(|x| inner.permits(x)))
    }
}

impl<T: Scalar> Field<T, OptionalPair> for Option<[T; 2]> {
    type Written = Option<[f64; 2]>;

    #[inline]
    fn from_table(written: Option<[f64; 2]>) -> Self {
        written.map(|pair| pair.map(lit))
    }

    fn value(&self) -> Value<T> {
        self.map_or(Value::Absent, Value::Pair)
    }

    fn from_value(value: Value<T>) -> Option<Self> {
        match value {
            Value::Pair(pair) => Some(Some(pair)),
            Value::Absent => Some(None),
            _ => None,
        }
    }

    fn is_within(&self, range: &Range) -> bool {
        match (self, range) {
            (None, Range::Optional(_)) => true,
            (Some([value, std]), Range::Optional(Range::Pair(of_value, of_std))) => {
                of_value.permits(*value) && of_std.permits(*std)
            }
            _ => false,
        }
    }
}
