//! Tables of parameters: one row a parameter, from which everything that knows it is made.
//!
//! Each configuration of an estimator stands in its file as a table of `parameters!`:
//!
//! ```text
//!     name: type, "unit", range, [default of each profile], "meaning", "what raising it does";
//! ```
//!
//! The macro makes of it the public structure with a documented field a row, [`Default`] (the first profile),
//! a constructor for each profile, `validate()`, and the [`Table`] by which programs list, read and set parameters by
//! name. Whoever adds a parameter adds a row. The fields are plain numbers: filters read them at no cost.
//!
//! - A row may say for whom it is (`for NAMES`, the estimators among those that share the configuration) and what it was
//!   called before (`was "old_name"`; files with the old key are still read).
//! - A configuration within another (`groups`) has dotted names: `validity.invalid_after_s`.
//! - A parameter that is one of some words has an enumeration of `choices!` as its type.

mod field;
mod names;
mod range;
pub(crate) mod table;
#[cfg(test)]
mod tests;

use core::fmt;

pub use field::{Choice, Field};
#[doc(hidden)]
pub use names::{Grouped, join};
pub use range::Range;
pub(crate) use table::{choices, parameters};

use crate::scalar::Scalar;

/// What is known of a parameter beside its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name, that of the field; within a group `group.field`.
    pub name: &'static str,
    /// Its name in earlier versions.
    pub formerly: Option<&'static str>,
    /// Its unit; `-` where it has none.
    pub unit: &'static str,
    /// What is permitted.
    pub range: Range,
    /// What it is, in a line.
    pub meaning: &'static str,
    /// What raising it does, and where the default comes from.
    pub note: &'static str,
    /// Names of the estimators that read it; empty: all that have the configuration.
    pub read_by: &'static [&'static str],
}

/// The value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value<T> {
    /// A number.
    Number(T),
    /// A whole number.
    Count(u32),
    /// Yes or no.
    Flag(bool),
    /// One of the words of [`Range::Words`].
    Word(&'static str),
    /// A vector.
    Vector([T; 3]),
    /// A value with its standard deviation.
    Pair([T; 2]),
    /// Not set.
    Absent,
}

/// A named set of defaults of a configuration.
pub type Profile<C> = (&'static str, fn() -> C);

/// A configuration whose parameters are known by name.
pub trait Table: Copy + Default + PartialEq + 'static {
    /// The type of its numbers.
    type Number: Scalar;
    /// Every parameter, in the order of the table.
    const PARAMETERS: &'static [Parameter];
    /// Every named set of defaults; the first is [`Default`].
    const PROFILES: &'static [Profile<Self>];

    /// The value of a parameter; `None`: there is none of that name.
    fn parameter(&self, name: &str) -> Option<Value<Self::Number>>;

    /// Sets a parameter; on an error nothing is changed.
    ///
    /// # Errors
    /// There is none of that name, or the value is of another kind or outside the permitted range.
    fn set_parameter(&mut self, name: &str, value: Value<Self::Number>) -> Result<(), ConfigError>;

    /// Checks every value.
    ///
    /// # Errors
    /// The first parameter, in the order of the table, that is outside its range.
    fn check(&self) -> Result<(), ConfigError>;
}

/// A value that is not permitted: the field, and what is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConfigError {
    /// Name of the parameter, or of the argument.
    pub field: &'static str,
    /// What is permitted.
    pub range: Range,
}

impl ConfigError {
    /// No parameter of the table has the name.
    pub const UNKNOWN_NAME: Self = Self {
        field: "name",
        range: Range::Described("the name of a parameter"),
    };

    /// The same error as the table `C` names it, which has the field in its group `group`.
    #[doc(hidden)]
    #[must_use]
    pub fn within<C: Table>(self, group: &str) -> Self {
        let is_it = |name: &str| {
            let rest = name.strip_prefix(group).and_then(|r| r.strip_prefix('.'));
            rest == Some(self.field)
        };
        let found = C::PARAMETERS.iter().find(|p| is_it(p.name));
        let field = found.map_or(self.field, |parameter| parameter.name);
        Self { field, ..self }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} must be {}", self.field, self.range)
    }
}

impl core::error::Error for ConfigError {}
