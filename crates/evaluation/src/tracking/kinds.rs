//! The trackers of many targets by name.

/// What a tracker does about the uncertainty of its own ship.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TrackerKind {
    /// Nothing: the pose is taken for the truth.
    Uncompensated,
    /// It is added to the noise of every detection, as if it were new each time.
    Converted,
    /// It is carried along with its correlation to each target.
    #[default]
    Schmidt,
}

impl TrackerKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Uncompensated, Self::Converted, Self::Schmidt];

    /// The name for people and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Uncompensated => "uncompensated",
            Self::Converted => "converted",
            Self::Schmidt => "schmidt",
        }
    }
}

impl std::str::FromStr for TrackerKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|kind| kind.name() == text);
        known.ok_or_else(|| {
            format!("`{text}` is no tracker; there are uncompensated, converted, schmidt")
        })
    }
}
