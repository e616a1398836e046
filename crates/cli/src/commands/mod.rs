//! The commands, one file each.

pub(crate) mod calibrate;
pub(crate) mod compare;
pub(crate) mod convert;
pub(crate) mod demo;
pub(crate) mod estimators;
pub(crate) mod run;
