//! Recordings of motion sensors: one event-stream sample model, and one file per format in and out.
//!
//! A recording is a stream of [`Event`]s in time order. Each sensor keeps its own time stamps;
//! nothing is resampled and nothing needs the whole file in memory.
//!
//! Units inside are SI and radians, with one exception named everywhere: magnetic field is in
//! microtesla. Quaternions are Hamilton, body to reference, order w, x, y, z.

pub mod event;
pub mod metadata;

pub use event::{Event, Reference, Sample, SensorKind};
pub use metadata::{Metadata, WorldFrame};

#[doc(hidden)]
pub mod test_data;
