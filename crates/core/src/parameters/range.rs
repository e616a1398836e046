//! Permitted ranges as data.

use core::fmt;

use super::{ConfigError, Value};
use crate::scalar::{Scalar, lit};

/// What a parameter may be. Numbers are finite in every range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// A number from the first to the second. Both are far enough from the ends of single precision that variances and
    /// their products with gravity, fields and intervals keep a meaning.
    From(f64, f64),
    /// A number above the first, up to the second.
    Above(f64, f64),
    /// A whole number of this much or more.
    Count(u32),
    /// Yes or no.
    Flag,
    /// One of these words.
    Words(&'static [&'static str]),
    /// Three numbers, each within the range.
    Vector(&'static Self),
    /// Absent, or within the range.
    Optional(&'static Self),
    /// Two numbers: a value and its standard deviation.
    Pair(&'static Self, &'static Self),
    /// In words, where no interval describes it.
    Described(&'static str),
}

impl Range {
    /// Whether it permits a number.
    #[inline]
    pub fn permits<T: Scalar>(&self, x: T) -> bool {
        match *self {
            Self::From(least, most) => x >= lit(least) && x <= lit(most),
            Self::Above(limit, most) => x > lit(limit) && x <= lit(most),
            _ => false,
        }
    }

    /// Refuses a number that it does not permit, in the name of a field.
    ///
    /// # Errors
    /// The field and the range.
    #[inline]
    pub fn check<T: Scalar>(self, field: &'static str, x: T) -> Result<(), ConfigError> {
        if self.permits(x) {
            Ok(())
        } else {
            Err(ConfigError { field, range: self })
        }
    }

    /// The value that a text stands for: `0.3`, `true`, a word, `1,2,3`, or `none`. `None`: it is no value of this
    /// kind. Whether a number is permitted is found when it is set.
    pub fn read(&self, text: &str) -> Option<Value<f64>> {
        let text = text.trim();
        match self {
            Self::Count(_) => text.parse().ok().map(Value::Count),
            Self::Flag => text.parse().ok().map(Value::Flag),
            Self::Words(words) => words.iter().find(|w| **w == text).map(|w| Value::Word(w)),
            Self::Vector(_) => numbers(text).map(Value::Vector),
            Self::Pair(..) => numbers(text).map(Value::Pair),
            Self::Optional(_) if text == "none" => Some(Value::Absent),
            Self::Optional(range) => range.read(text),
            Self::Described(_) => None,
            _ => numbers(text).map(|[number]| Value::Number(number)),
        }
    }
}

/// So many finite numbers with commas between.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let mut values = [0.0; N];
    let mut parts = text.split(',');
    for value in &mut values {
        let number: f64 = parts.next()?.trim().parse().ok()?;
        *value = Some(number).filter(|x| x.is_finite())?;
    }
    parts.next().is_none().then_some(values)
}

/// A limit as it is read best: `0.05`, `1000`, `1e-6`.
struct Limit(f64);

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(limit) = *self;
        let size = limit.abs();
        if limit == 0.0 || (1e-3..1e6).contains(&size) {
            write!(f, "{limit}")
        } else {
            write!(f, "{limit:e}")
        }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::From(least, most) => write!(f, "from {} to {}", Limit(*least), Limit(*most)),
            Self::Above(limit, most) => {
                write!(f, "above {}, up to {}", Limit(*limit), Limit(*most))
            }
            Self::Count(least) => write!(f, "a whole number, {least} or above"),
            Self::Flag => f.write_str("true | false"),
            Self::Words(words) => {
                for (i, word) in words.iter().enumerate() {
                    write!(f, "{}{word}", if i > 0 { " | " } else { "" })?;
                }
                Ok(())
            }
            Self::Vector(range) => write!(f, "three numbers, each {range}"),
            Self::Optional(range) => write!(f, "none, or {range}"),
            Self::Pair(value, std) => write!(f, "a number {value} and its deviation {std}"),
            Self::Described(words) => f.write_str(words),
        }
    }
}
