//! From Sensor Logger's tables to events: which table is which sensor, signs and units by platform.

use std::collections::BTreeMap;

use nalgebra::{UnitQuaternion, Vector3};

use crate::error::{RecordingError, Result, join};
use crate::event::{Event, Sample, SensorKind};
use crate::issues::Issues;
use crate::merge::{Merged, Paired};
use crate::metadata::{Metadata, WorldFrame};
use crate::options::STANDARD_GRAVITY_M_S2;
use crate::recording::{EventSource, Opened};
use crate::wire::ForceSign;

/// The tables that are used, by plain name.
pub(crate) const TABLES: [&str; 11] = [
    "accelerometer",
    "accelerometeruncalibrated",
    "barometer",
    "gravity",
    "gyroscope",
    "gyroscopeuncalibrated",
    "magnetometer",
    "magnetometeruncalibrated",
    "metadata",
    "orientation",
    "totalacceleration",
];

/// The tables of an export.
pub(super) trait Export {
    fn has(&self, table: &str) -> bool;

    /// The names of all tables as they stand there.
    fn names(&self) -> Vec<String>;

    /// What the export says about itself.
    fn metadata(&self) -> Result<Option<BTreeMap<String, String>>>;

    /// The events of one table: of `columns` times `factor`.
    fn stream(
        &self,
        table: &str,
        columns: &[&str],
        kind: SensorKind,
        factor: f64,
    ) -> Result<Box<dyn EventSource>>;

    fn vectors(&self, table: &str, kind: SensorKind, factor: f64) -> Result<Box<dyn EventSource>> {
        self.stream(table, &["x", "y", "z"], kind, factor)
    }
}

/// Opens the tables of an export as one recording.
pub(super) fn open(export: &impl Export, file: &str, mut metadata: Metadata) -> Result<Opened> {
    if !TABLES.iter().any(|table| export.has(table)) {
        return Err(RecordingError::NotARecording {
            file: file.to_owned(),
            found: match export.names()[..] {
                [] => "none of Sensor Logger's tables, and nothing else".to_owned(),
                ref names => format!(
                    "none of Sensor Logger's tables, but {}",
                    join(names.iter().map(String::as_str))
                ),
            },
        });
    }
    "sensor-logger".clone_into(&mut metadata.format);
    metadata.world_frame = WorldFrame::Enu;
    let (convention, mut notes) = convention(export, &mut metadata)?;
    let streams = streams(export, convention, &mut notes)?;
    let mut sensors: Vec<_> = streams.iter().map(|(kind, _)| *kind).collect();
    sensors.sort_unstable_by_key(|kind| kind.order());
    if !sensors.contains(&SensorKind::Gyroscope) {
        return Err(RecordingError::no_gyroscope(file, &sensors));
    }
    let source = Merged::new(streams.into_iter().map(|(_, source)| source).collect());
    Ok(Opened {
        notes,
        ..Opened::new(metadata, sensors, Box::new(source))
    })
}

type Streams = Vec<(SensorKind, Box<dyn EventSource>)>;

/// The streams of all sensors that the export has.
fn streams(
    export: &impl Export,
    convention: ForceSign,
    notes: &mut Vec<String>,
) -> Result<Streams> {
    let mut streams = Streams::new();
    if export.has("gyroscope") {
        let rate = export.vectors("gyroscope", SensorKind::Gyroscope, 1.0)?;
        streams.push((SensorKind::Gyroscope, rate));
        if export.has("gyroscopeuncalibrated") {
            let kind = SensorKind::DeviceGyroscopeBias;
            let bias = Paired {
                first: export.vectors("gyroscopeuncalibrated", SensorKind::Gyroscope, 1.0)?,
                second: export.vectors("gyroscope", SensorKind::Gyroscope, 1.0)?,
                kind,
                sign: -1.0,
                // Many phones stamp the two differently; then there is simply no bias.
                count_incomplete: false,
            };
            streams.push((kind, Box::new(bias)));
        }
    } else if export.has("gyroscopeuncalibrated") {
        let rate = export.vectors("gyroscopeuncalibrated", SensorKind::Gyroscope, 1.0)?;
        streams.push((SensorKind::Gyroscope, rate));
        notes.push("Without a calibrated gyroscope the uncalibrated one is taken.".to_owned());
    }
    if let Some(force) = specific_force(export, convention, notes)? {
        streams.push((SensorKind::Accelerometer, force));
    }
    for (table, kind) in [
        ("magnetometer", SensorKind::Magnetometer),
        (
            "magnetometeruncalibrated",
            SensorKind::MagnetometerUncalibrated,
        ),
    ] {
        if export.has(table) {
            streams.push((kind, export.vectors(table, kind, 1.0)?));
        }
    }
    if export.has("orientation") {
        let source = orientation(export, convention)?;
        streams.push((SensorKind::DeviceOrientation, source));
    }
    if export.has("barometer") {
        // The app gives millibar.
        let kind = SensorKind::Pressure;
        streams.push((
            kind,
            export.stream("barometer", &["pressure"], kind, 100.0)?,
        ));
    }
    Ok(streams)
}

fn specific_force(
    export: &impl Export,
    convention: ForceSign,
    notes: &mut Vec<String>,
) -> Result<Option<Box<dyn EventSource>>> {
    let kind = SensorKind::Accelerometer;
    let sign = convention.factor();
    if export.has("totalacceleration") {
        return export.vectors("totalacceleration", kind, sign).map(Some);
    }
    if export.has("accelerometer") && export.has("gravity") {
        return Ok(Some(Box::new(Paired {
            first: export.vectors("accelerometer", kind, sign)?,
            second: export.vectors("gravity", kind, sign)?,
            kind,
            sign: 1.0,
            count_incomplete: true,
        })));
    }
    if export.has("accelerometeruncalibrated") {
        let unit = match convention {
            ForceSign::Standard => 1.0,
            ForceSign::Opposite => STANDARD_GRAVITY_M_S2,
        };
        return export
            .vectors("accelerometeruncalibrated", kind, sign * unit)
            .map(Some);
    }
    if export.has("accelerometer") {
        notes.push(
            "Accelerometer.csv is without gravity and there is no Gravity.csv: no specific force can be made of it."
                .to_owned(),
        );
    }
    Ok(None)
}

fn orientation(export: &impl Export, convention: ForceSign) -> Result<Box<dyn EventSource>> {
    let (kind, columns) = (SensorKind::DeviceOrientation, ["qw", "qx", "qy", "qz"]);
    let source = export.stream("orientation", &columns, kind, 1.0)?;
    Ok(match convention {
        ForceSign::Standard => source,
        // World axes x north, y west: a quarter turn about the vertical makes them east, north.
        ForceSign::Opposite => Box::new(Turned {
            source,
            turn: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2),
        }),
    })
}

/// Orientations in another world frame.
struct Turned {
    source: Box<dyn EventSource>,
    turn: UnitQuaternion<f64>,
}

impl EventSource for Turned {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        let mut event = self.source.next_event(issues)?;
        if let Some(Sample::DeviceOrientation(q)) = event.as_mut().map(|e| &mut e.sample) {
            *q = self.turn * *q;
        }
        Ok(event)
    }
}

/// The convention by the export's metadata, checked against the phone's own orientation; also
/// fills our metadata. Notes tell what is doubtful.
fn convention(export: &impl Export, metadata: &mut Metadata) -> Result<(ForceSign, Vec<String>)> {
    let mut notes = Vec::new();
    let pairs = export.metadata()?;
    for (key, value) in pairs.iter().flatten() {
        if key == "device name" {
            metadata.device = Some(value.clone());
        } else {
            metadata.extra.insert(key.clone(), value.clone());
        }
    }
    let said = |key: &str| {
        pairs
            .as_ref()
            .and_then(|pairs| pairs.get(key))
            .map(|v| v.to_lowercase())
    };
    let up = force_is_up(export)?;
    let convention = match (
        said("platform").as_deref(),
        said("standardisation").as_deref(),
    ) {
        (Some("ios"), standardised) if standardised != Some("true") => ForceSign::Opposite,
        (Some(_), _) => ForceSign::Standard,
        (None, _) => {
            let (convention, reason) = match up {
                Some(false) => (
                    ForceSign::Opposite,
                    "the phone's own orientation says that it is an iPhone's",
                ),
                Some(true) => (
                    ForceSign::Standard,
                    "the phone's own orientation confirms it",
                ),
                None => (
                    ForceSign::Standard,
                    "on an iPhone without \"Standardise Units & Frames\" it would be the opposite",
                ),
            };
            notes.push(format!(
                "The export does not name its platform; the sign of its accelerations is taken as {}: {reason}.",
                if convention == ForceSign::Opposite { "inverted" } else { "it is" }
            ));
            return Ok((convention, notes));
        }
    };
    if up == Some(convention == ForceSign::Opposite) {
        notes.push(
            "By the phone's own orientation the accelerations have the wrong sign for the platform that the export names."
                .to_owned(),
        );
    }
    Ok((convention, notes))
}

/// Whether the accelerations as written point up in the phone's own orientation, from the first
/// samples; `None` when they do not tell.
fn force_is_up(export: &impl Export) -> Result<Option<bool>> {
    const SAMPLES: u32 = 200;
    let mut unused_notes = Vec::new();
    if !export.has("orientation") {
        return Ok(None);
    }
    let Some(force) = specific_force(export, ForceSign::Standard, &mut unused_notes)? else {
        return Ok(None);
    };
    let mut merged = Merged::new(vec![force, orientation(export, ForceSign::Standard)?]);
    let mut issues = Issues::default();
    let (mut latest, mut sum, mut count) = (None, 0.0, 0);
    while count < SAMPLES {
        // A broken row is told when the recording is read.
        let Ok(Some(event)) = merged.next_event(&mut issues) else {
            break;
        };
        match event.sample {
            Sample::DeviceOrientation(q) => {
                if let Some(force) = latest {
                    let up: Vector3<f64> = q * force;
                    let cosine = up.z / up.norm();
                    if cosine.is_finite() {
                        sum += cosine;
                        count += 1;
                    }
                }
            }
            sample => latest = sample.vector(),
        }
    }
    let mean = sum / f64::from(count.max(1));
    Ok((mean.abs() > 0.5).then_some(mean > 0.0))
}
