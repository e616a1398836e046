//! Arguments that commands share, and what they mean.

#[cfg(feature = "foxglove")]
pub(crate) mod address;
pub(crate) mod estimation;
pub(crate) mod exercise;
pub(crate) mod input;
pub(crate) mod navigation;
pub(crate) mod quantity;
pub(crate) mod recordings;
pub(crate) mod scenario;
pub(crate) mod settings;
pub(crate) mod span;
pub(crate) mod virtual_recording;
