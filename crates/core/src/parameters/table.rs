//! The macros that make configurations of tables, and enumerations of words.

/// Makes a configuration of a table of its parameters; see [the module](crate::parameters).
macro_rules! parameters {
    (
        $(#[$about:meta])*
        pub struct $config:ident
            $(, profiles { $( $(#[$profile_about:meta])* $profile:ident = $index:literal, )+ })?
            $(, groups { $(
                $group:ident: $group_type:ident, [$($group_default:expr),+], $group_meaning:literal;
            )+ })?;
        $(
            $(#[$attribute:meta])*
            $field:ident: $type:ty, $unit:literal, $range:expr, [$($default:expr),+],
                $(for $read_by:ident,)? $(was $old:literal,)? $meaning:literal $(, $note:literal)*;
        )+
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(
            feature = "serde",
            derive(serde::Serialize, serde::Deserialize),
            serde(
                default,
                deny_unknown_fields,
                bound(
                    serialize = "T: serde::Serialize",
                    deserialize = "T: crate::Scalar + serde::Deserialize<'de>"
                )
            )
        )]
        pub struct $config<T> {
            $(
                #[doc = concat!(
                    $meaning, ".\n\nUnit `", $unit, "`; permitted `", stringify!($range), "`; default `",
                    stringify!($($default),+), "`.\n\n" $(, " ", $note)*
                )]
                $(#[cfg_attr(feature = "serde", serde(alias = $old))])?
                $(#[$attribute])*
                pub $field: $type,
            )+
            $($(
                #[doc = concat!($group_meaning, ".")]
                pub $group: $group_type<T>,
            )+)?
        }

        impl<T: $crate::Scalar> $config<T> {
            /// The profile of that number; beyond the last one, and where all are alike, the first.
            fn of_profile(number: usize) -> Self {
                Self {
                    $( $field: {
                        let written = [$($default),+];
                        <$type as $crate::parameters::Field<T, _>>::from_table(
                            written.get(number).copied().unwrap_or(written[0]),
                        )
                    }, )+
                    $($( $group: {
                        let written = [$($group_default),+];
                        written.get(number).copied().unwrap_or(written[0])
                    }, )+)?
                }
            }

            $($(
                $(#[$profile_about])*
                #[must_use]
                pub fn $profile() -> Self {
                    Self::of_profile($index)
                }
            )+)?

            /// Checks every parameter.
            ///
            /// # Errors
            /// [`ConfigError`](crate::ConfigError) names the first one outside its permitted range, and the range.
            pub fn validate(&self) -> Result<(), $crate::ConfigError> {
                use $crate::parameters::{Field, Range::*};
                $(
                    if !<$type as Field<T, _>>::is_within(&self.$field, &$range) {
                        return Err($crate::ConfigError { field: stringify!($field), range: $range });
                    }
                )+
                $($(
                    self.$group.validate().map_err(|error| error.within::<Self>(stringify!($group)))?;
                )+)?
                Ok(())
            }
        }

        impl<T: $crate::Scalar> Default for $config<T> {
            fn default() -> Self {
                Self::of_profile(0)
            }
        }

        impl<T: $crate::Scalar> $crate::parameters::Table for $config<T> {
            type Number = T;

            const PARAMETERS: &'static [$crate::parameters::Parameter] = {
                use $crate::parameters::{Grouped, Parameter, Range::*, join};
                const OWN: &[Parameter] = &[$( Parameter {
                    name: stringify!($field),
                    formerly: $crate::parameters::table::or!((None) $((Some($old)))?),
                    unit: $unit,
                    range: $range,
                    meaning: $meaning,
                    note: concat!($($note, " "),*).trim_ascii_end(),
                    read_by: $crate::parameters::table::or!((&[]) $(($read_by))?),
                }, )+];
                const LISTS: &[(&str, &[Parameter])] = &[
                    ("", OWN)
                    $($(, (stringify!($group), <$group_type<f64> as $crate::parameters::Table>::PARAMETERS))+)?
                ];
                const COUNT: usize = OWN.len() $($(+ <$group_type<f64> as $crate::parameters::Table>::PARAMETERS.len())+)?;
                const NAMES: &Grouped<COUNT> = &Grouped::new(LISTS);
                const ALL: &[Parameter; COUNT] = &join(NAMES, LISTS);
                ALL
            };

            const PROFILES: &'static [(&'static str, fn() -> Self)] =
                $crate::parameters::table::or!(
                    (&[("default", Self::default)])
                    $((&[$((stringify!($profile), Self::$profile)),+]))?
                );

            fn parameter(&self, name: &str) -> Option<$crate::parameters::Value<T>> {
                use $crate::parameters::Field;
                match name {
                    $( stringify!($field) => Some(<$type as Field<T, _>>::value(&self.$field)), )+
                    _ => {
                        $($(
                            let inner = name.strip_prefix(concat!(stringify!($group), "."));
                            if let Some(name) = inner {
                                return self.$group.parameter(name);
                            }
                        )+)?
                        None
                    }
                }
            }

            fn set_parameter(
                &mut self,
                name: &str,
                value: $crate::parameters::Value<T>,
            ) -> Result<(), $crate::ConfigError> {
                use $crate::parameters::{Field, Range::*};
                match name {
                    $( stringify!($field) => {
                        let field = <$type as Field<T, _>>::from_value(value)
                            .filter(|field| <$type as Field<T, _>>::is_within(field, &$range));
                        let bad = $crate::ConfigError { field: stringify!($field), range: $range };
                        self.$field = field.ok_or(bad)?;
                        Ok(())
                    } )+
                    _ => {
                        $($(
                            let inner = name.strip_prefix(concat!(stringify!($group), "."));
                            if let Some(name) = inner {
                                let set = self.$group.set_parameter(name, value);
                                return set.map_err(|error| error.within::<Self>(stringify!($group)));
                            }
                        )+)?
                        Err($crate::ConfigError::UNKNOWN_NAME)
                    }
                }
            }

            fn check(&self) -> Result<(), $crate::ConfigError> {
                self.validate()
            }
        }
    };
}

/// The second where there is one, otherwise the first.
macro_rules! or {
    (($first:expr)) => {
        $first
    };
    (($first:expr) ($second:expr)) => {
        $second
    };
}

/// Makes an enumeration whose values have words: those of files and of the command line.
macro_rules! choices {
    (
        $(#[$about:meta])*
        pub enum $name:ident { $( $(#[$meaning:meta])* $value:ident = $word:literal, )+ }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub enum $name {
            $( $(#[$meaning])* #[cfg_attr(feature = "serde", serde(rename = $word))] $value, )+
        }

        impl $crate::parameters::Choice for $name {
            const ALL: &'static [(&'static str, Self)] = &[$(($word, Self::$value)),+];
            const WORDS: &'static [&'static str] = &[$($word),+];
        }
    };
}

pub(crate) use {choices, or, parameters};
