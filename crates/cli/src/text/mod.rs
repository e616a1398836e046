//! Outcomes as text for people.

pub(crate) mod attitude;
pub(crate) mod navigation;
pub(crate) mod rest_calibration;
pub(crate) mod sheet;
pub(crate) mod table;
