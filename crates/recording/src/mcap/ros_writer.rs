//! Writes a recording as an MCAP file of ROS 2 messages, for Foxglove, PlotJuggler and ROS itself.
//!
//! Topics: `/imu/data_raw` (rate and force, no orientation), `/imu/mag`, `/imu/data` (with an
//! estimate, when one is given), `/device/orientation` and `/reference/orientation` (an `Imu` with
//! nothing but the orientation), `/fix` (`NavSatFix`), `/fix_velocity` (`TwistWithCovarianceStamped`). Each sensor keeps its own stamps: a message without force says so as
//! the message definition wants it. Unscored instants of a reference, and sensors without a topic,
//! are left out.

use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::path::Path;

use ::mcap::McapError;
use nalgebra::{Matrix3, UnitQuaternion};
use northing_core::geometry::frames::{covariance_in_reference, enu_from_ned_rotation};

use super::nav_sat_fix;
use super::output::{Output, RosTopic, io_error, options};
use super::pose_twist::{self, TWIST_WITH_COVARIANCE, TWIST_WITH_COVARIANCE_DEFINITION};
use super::ros::{
    IMU, IMU_DEFINITION, Imu, MAGNETIC_FIELD, MAGNETIC_FIELD_DEFINITION, MagneticField,
};
use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::metadata::{BODY_AXES, Frames, Metadata, WorldFrame};
use crate::writer::{EventWriter, Row};

/// The frame of the sensors in every header.
const FRAME: &str = "imu";
/// Topic of the device's own orientation.
pub(crate) const DEVICE_ORIENTATION: &str = "/device/orientation";
/// Topic of the truth.
pub(crate) const REFERENCE: &str = "/reference/orientation";

/// Where messages go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Topic {
    Raw,
    Estimate,
    Field,
    Device,
    Reference,
    Fix,
    Velocity,
}

impl Topic {
    const fn name(self) -> &'static str {
        match self {
            Self::Raw => "/imu/data_raw",
            Self::Estimate => "/imu/data",
            Self::Field => "/imu/mag",
            Self::Device => DEVICE_ORIENTATION,
            Self::Reference => REFERENCE,
            Self::Fix => "/fix",
            Self::Velocity => "/fix_velocity",
        }
    }

    const fn schema(self) -> (&'static str, &'static str) {
        match self {
            Self::Field => (MAGNETIC_FIELD, MAGNETIC_FIELD_DEFINITION),
            Self::Fix => (nav_sat_fix::NAME, nav_sat_fix::DEFINITION),
            Self::Velocity => (TWIST_WITH_COVARIANCE, TWIST_WITH_COVARIANCE_DEFINITION),
            _ => (IMU, IMU_DEFINITION),
        }
    }
}

/// Whether a sensor has a topic; others are left out.
#[must_use]
pub const fn has_topic(kind: SensorKind) -> bool {
    matches!(
        kind,
        SensorKind::Gyroscope
            | SensorKind::Accelerometer
            | SensorKind::Magnetometer
            | SensorKind::DeviceOrientation
            | SensorKind::GnssPosition
            | SensorKind::GnssVelocity
            | SensorKind::Reference
    )
}

/// Writes events, and estimates beside them.
pub struct RosWriter<W: Write + Seek> {
    output: Output<W, Topic>,
    file: String,
    frames: Frames,
    row: Row,
}

impl RosWriter<AtomicFile> {
    /// Creates the file; it appears under its name at [`EventWriter::finish`].
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(path: &Path, metadata: &Metadata, force: bool) -> Result<Self> {
        let output = AtomicFile::create(path, force)?;
        let file = path.display().to_string();
        Self::new(output, metadata, &file)
    }
}

impl<W: Write + Seek> RosWriter<W> {
    /// Begins a file; `file` stands for it in messages.
    ///
    /// # Errors
    /// The output refuses.
    pub fn new(output: W, metadata: &Metadata, file: &str) -> Result<Self> {
        let mut facts = metadata.extra.clone();
        facts.insert("name".to_owned(), metadata.name.clone());
        facts.extend(
            metadata
                .device
                .iter()
                .map(|d| ("device".to_owned(), d.clone())),
        );
        let output = Output::new(output, options().profile("ros2"), facts)
            .map_err(|error| failed(file, error))?;
        Ok(Self {
            output,
            file: file.to_owned(),
            frames: metadata.frames(),
            row: Row::new(),
        })
    }

    /// Adds an estimate of an instant with the covariance of its local error in body axes, rad^2.
    ///
    /// # Errors
    /// The output refuses.
    pub fn estimate(
        &mut self,
        time_ns: i64,
        attitude: &UnitQuaternion<f64>,
        covariance: Option<&Matrix3<f64>>,
        measured: [Option<&Sample>; 2],
    ) -> Result<()> {
        let enu_from_body = self.to_enu(attitude);
        // ROS means the error about the axes of the world.
        let about_world = covariance.map(|p| covariance_in_reference(&enu_from_body, p));
        let mut imu = Imu {
            time_ns,
            orientation: Some((enu_from_body, about_world)),
            ..Imu::default()
        };
        for sample in measured.into_iter().flatten() {
            match sample {
                Sample::AngularRate(v) => imu.angular_rate = Some(*v),
                Sample::SpecificForce(v) => imu.specific_force = Some(*v),
                _ => {}
            }
        }
        self.message(Topic::Estimate, time_ns, imu.encode(FRAME))
    }

    fn to_enu(&self, world_from_body: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        match self.frames.world {
            WorldFrame::Enu => *world_from_body,
            WorldFrame::Ned => enu_from_ned_rotation() * world_from_body,
        }
    }

    fn write_row(&mut self) -> Result<()> {
        if self.row.is_empty() {
            return Ok(());
        }
        let row = std::mem::replace(&mut self.row, Row::new());
        let time_ns = row.time_ns;
        let vector = |kind| row.get(kind).and_then(Sample::vector);
        let raw = Imu {
            time_ns,
            angular_rate: vector(SensorKind::Gyroscope),
            specific_force: vector(SensorKind::Accelerometer),
            ..Imu::default()
        };
        if raw.angular_rate.is_some() || raw.specific_force.is_some() {
            self.message(Topic::Raw, time_ns, raw.encode(FRAME))?;
        }
        if let Some(field_ut) = vector(SensorKind::Magnetometer) {
            let field = MagneticField { time_ns, field_ut };
            self.message(Topic::Field, time_ns, field.encode(FRAME))?;
        }
        if let Some(Sample::GnssPosition(fix)) = row.get(SensorKind::GnssPosition) {
            let bytes = nav_sat_fix::encode_fix(time_ns, fix);
            self.message(Topic::Fix, time_ns, bytes)?;
        }
        if let Some(Sample::GnssVelocity(velocity)) = row.get(SensorKind::GnssVelocity) {
            let bytes = pose_twist::encode_velocity(time_ns, velocity);
            self.message(Topic::Velocity, time_ns, bytes)?;
        }
        if let Some(Sample::DeviceOrientation(q)) = row.get(SensorKind::DeviceOrientation) {
            self.orientation(Topic::Device, time_ns, q)?;
        }
        if let Some(Sample::Reference(reference)) = row.get(SensorKind::Reference)
            && reference.scored
        {
            self.orientation(Topic::Reference, time_ns, &reference.attitude)?;
        }
        Ok(())
    }

    fn orientation(&mut self, topic: Topic, time_ns: i64, q: &UnitQuaternion<f64>) -> Result<()> {
        let imu = Imu {
            time_ns,
            orientation: Some((self.to_enu(q), None)),
            ..Imu::default()
        };
        self.message(topic, time_ns, imu.encode(FRAME))
    }

    fn message(&mut self, topic: Topic, time_ns: i64, bytes: Option<Vec<u8>>) -> Result<()> {
        let bytes = bytes.ok_or_else(|| {
            RecordingError::unsupported(
                &self.file,
                "a stamp is beyond the 68 years that ROS can hold; write .csv or .parquet",
            )
        })?;
        // Our sensors keep their axes, which need not be those of REP 103.
        let axes = BTreeMap::from([(BODY_AXES.to_owned(), self.frames.body.name().to_owned())]);
        let (schema, definition) = topic.schema();
        let told = RosTopic {
            name: topic.name(),
            schema,
            definition,
            facts: &axes,
        };
        let written = self.output.ros_message(topic, time_ns, &bytes, &told);
        written.map_err(|error| failed(&self.file, error))
    }

    /// Writes the index and hands back the output.
    ///
    /// # Errors
    /// The output refuses.
    pub fn complete(mut self) -> Result<W> {
        self.write_row()?;
        self.output
            .finish()
            .map_err(|error| failed(&self.file, error))?;
        Ok(self.output.into_inner())
    }
}

impl EventWriter for RosWriter<AtomicFile> {
    fn write(&mut self, event: &Event) -> Result<()> {
        self.add(event)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.complete()?.commit()
    }
}

impl<W: Write + Seek> RosWriter<W> {
    /// Adds an event; those of equal stamps that follow each other share a message.
    ///
    /// # Errors
    /// The output refuses.
    pub fn add(&mut self, event: &Event) -> Result<()> {
        if !self.row.takes(event) {
            self.write_row()?;
        }
        self.row.put(event);
        Ok(())
    }
}

impl<W: Write + Seek> std::fmt::Debug for RosWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RosWriter")
            .field("file", &self.file)
            .finish_non_exhaustive()
    }
}

fn failed(file: &str, error: McapError) -> RecordingError {
    RecordingError::io(file, "write it", io_error(error))
}
