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

pub(crate) use {named_values, settings};
