//! Enumerations of names as tables, one row a value: names of the command line and of files, and the estimators.

/// Makes an enumeration whose values have a name each.
#[macro_export]
macro_rules! named {
    ($(#[$about:meta])* pub enum $kind:ident { $( $(#[$meaning:meta])* $value:ident = $name:literal, )+ }) => {
        $(#[$about])*
        pub enum $kind {
            $( $(#[$meaning])* $value, )+
        }

        impl $kind {
            /// Every one, in the order of the table.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Its name for people, on the command line and in files.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$value => $name,)+ }
            }

            /// The one of that name.
            #[must_use]
            pub fn named(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|kind| kind.name() == name)
            }

            /// Every name, for messages.
            #[must_use]
            pub fn names() -> String {
                Self::ALL.map(Self::name).join(", ")
            }
        }
    };
}

/// Makes the estimators of a question of their table: name, components of the error state, what it is, where to read
/// about it, when to use it. With `or Own(OwnKind)` there can also be some that people bring along, whose names are in a registry.
#[macro_export]
macro_rules! estimators {
    (
        $(#[$about:meta])*
        pub enum $kind:ident for $question:ident, $command:literal, $parameters:path {
            $(
                $(#[$meaning:meta])*
                $value:ident = $name:literal, $states:literal, $summary:literal, $paper:literal, $when:literal;
            )+
        }
    ) => {
        $crate::named! {
            $(#[$about])*
            pub enum $kind { $( $(#[$meaning])* $value = $name, )+ }
        }
        $crate::estimators! {
            @table $kind for $question, $command, $parameters, ()
            { $( $value = $name, $states, $summary, $paper, $when; )+ }
        }
    };
    (
        $(#[$about:meta])*
        pub enum $kind:ident for $question:ident, $command:literal, $parameters:path, or $own:ident($own_kind:ty) {
            $(
                $(#[$meaning:meta])*
                $value:ident = $name:literal, $states:literal, $summary:literal, $paper:literal, $when:literal;
            )+
        }
    ) => {
        $(#[$about])*
        pub enum $kind {
            $( $(#[$meaning])* $value, )+
            /// One that somebody brought along.
            #[cfg_attr(feature = "typescript", ts(skip))]
            $own($own_kind),
        }

        impl $kind {
            /// Every one of the project, in the order of the table.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Its name for people, on the command line and in files.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name,)+
                    Self::$own(own) => own.name(),
                }
            }

            /// The one of that name.
            #[must_use]
            pub fn named(name: &str) -> Option<Self> {
                let known = Self::ALL.into_iter().find(|kind| kind.name() == name);
                known.or_else(|| <$own_kind>::named(name).map(Self::$own))
            }

            /// Every name, for messages.
            #[must_use]
            pub fn names() -> String {
                let own = <$own_kind>::all().into_iter().map(Self::$own);
                let names: Vec<&str> = Self::ALL.into_iter().chain(own).map(Self::name).collect();
                names.join(", ")
            }
        }
        $crate::estimators! {
            @table $kind for $question, $command, $parameters, ($own)
            { $( $value = $name, $states, $summary, $paper, $when; )+ }
        }
    };
    (
        @table $kind:ident for $question:ident, $command:literal, $parameters:path, ($($own:ident)?)
        { $( $value:ident = $name:literal, $states:literal, $summary:literal, $paper:literal, $when:literal; )+ }
    ) => {
        impl $kind {
            /// What there is to know about it.
            #[must_use]
            pub fn info(self) -> $crate::registry::EstimatorInfo {
                let ([summary, paper, when], error_states): ([&str; 3], u8) = match self {
                    $(Self::$value => ([$summary, $paper, $when], $states),)+
                    $(Self::$own(own) => return own.info(),)?
                };
                $crate::registry::EstimatorInfo {
                    name: self.name(),
                    summary,
                    error_states,
                    has_covariance: error_states > 0,
                    paper,
                    when,
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl $crate::registry::Registered for $kind {
            const QUESTION: $crate::registry::Question = $crate::registry::Question::$question;
            const COMMAND: &'static str = $command;
            const EVERY: &'static [Self] = &Self::ALL;

            fn info(self) -> $crate::registry::EstimatorInfo {
                Self::info(self)
            }

            fn parameters(self) -> Vec<$crate::registry::ParameterInfo> {
                $parameters(self)
            }
        }
    };
}

pub(crate) use estimators;
