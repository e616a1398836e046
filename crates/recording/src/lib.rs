//! Recordings of motion sensors: one event-stream sample model, and one file per format in and out.
//!
//! A recording is a stream of [`Event`]s in time order. Each sensor keeps its own time stamps;
//! nothing is resampled and nothing needs the whole file in memory.
//!
//! Units inside are SI and radians, with one exception named everywhere: magnetic field is in
//! microtesla. Quaternions are Hamilton, body to reference, order w, x, y, z.
//!
//! [`open()`] tells the format by content and returns a [`Recording`]: an iterator of events, checked
//! on the way ([`timeline`], [`plausibility`]), with [`Metadata`] and counted [`Issues`].

#[cfg(feature = "ardupilot")]
mod ardupilot;
pub mod atomic_file;
pub mod contents;
mod csv;
mod csv_writer;
mod delimited;
pub mod describe;
pub mod device_navigation;
pub mod error;
mod euroc;
pub mod event;
mod false_stamps;
pub mod fixed;
mod foreign;
pub mod gnss;
mod gpx;
mod hold;
mod instant;
pub mod issues;
mod kf_gins;
mod kitti;
pub mod lab_session;
pub mod limits;
mod local_place;
pub mod manifest;
#[cfg(feature = "mcap")]
pub mod mcap;
mod merge;
pub mod metadata;
mod nmea;
mod northing_serial;
mod numbers;
mod numpy;
mod open;
pub mod options;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "parquet")]
pub mod parquet_table;
#[cfg(feature = "parquet")]
mod parquet_writer;
mod phyphox;
pub mod plausibility;
pub mod pose;
mod recording;
mod rtklib;
mod sensor_logger;
pub mod shortest;
mod signed_axes;
mod stamp;
pub mod text;
pub mod timeline;
pub mod track;
pub mod tracking;
mod tum;
mod tum_writer;
mod ubx;
#[cfg(feature = "ulog")]
mod ulog;
mod vectornav;
mod watched;
pub mod wire;
mod writer;
mod ximu3;

pub use atomic_file::AtomicFile;
pub use contents::{Contents, SensorContents};
pub use csv_writer::CsvWriter;
pub use device_navigation::DeviceNavigation;
pub use error::RecordingError;
pub use event::{CompassHeading, Event, Reference, Sample, SensorKind, TrueHeading, WaterVelocity};
pub use gnss::{GnssPosition, GnssQuality, GnssVelocity, VERTICAL_OF_HORIZONTAL};
pub use issues::Issues;
pub use local_place::LocalPlace;
pub use metadata::{BodyAxes, Frames, Metadata, WorldFrame};
pub use open::{has_extension, open, read_bytes, read_from};
pub use options::{FieldUnit, ForceUnit, Format, OpenOptions, RateUnit, TopicChoice};
#[cfg(feature = "parquet")]
pub use parquet_writer::ParquetWriter;
pub use pose::PoseEstimate;
pub use recording::Recording;
pub use track::{TrackPoint, check_track_path, write_track};
pub use tum_writer::TumWriter;
pub use watched::Watched;
pub use writer::{EventWriter, create, write_events};

#[doc(hidden)]
pub mod test_data;
