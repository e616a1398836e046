//! Structures of settings as tables: each row has a setting's meaning, name, type and default.

/// Makes the structure and its default values of one table.
macro_rules! settings {
    ($(#[$about:meta])* pub struct $name:ident {
        $($(#[$meaning:meta])* $field:ident: $type:ty = $default:expr,)+
    }) => {
        $(#[$about])*
        pub struct $name {
            $($(#[$meaning])* pub $field: $type,)+
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)+ }
            }
        }
    };
}

/// The values of some settings, each with its name as it stands in a file.
macro_rules! named_values {
    ($of:expr => $($first:ident $(.$rest:ident)*),+ $(,)?) => {
        [$((
            concat!(stringify!($first) $(, ".", stringify!($rest))*),
            f64::from($of.$first $(.$rest)*),
        )),+]
    };
}

/// Refuses a setting whose rule does not hold.
pub(crate) fn rule(holds: bool, key: &str, value: f64, expected: &str) -> Result<(), String> {
    if holds {
        return Ok(());
    }
    Err(format!("{key} is {value}, expected {expected}"))
}

/// Refuses the first of these settings that is not finite, or not `good`.
pub(crate) fn rules(
    settings: impl IntoIterator<Item = (&'static str, f64)>,
    expected: &str,
    good: fn(f64) -> bool,
) -> Result<(), String> {
    let mut settings = settings.into_iter();
    settings
        .try_for_each(|(key, value)| rule(value.is_finite() && good(value), key, value, expected))
}

pub(crate) use {named_values, settings};
