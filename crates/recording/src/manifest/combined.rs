//! Several sources as one recording: shifted in time, taken in part, made references, and merged.

use nalgebra::UnitQuaternion;
use northing_core::geometry::frames::enu_from_ned_rotation;

use super::schema::{Role, Source, Use};
use crate::error::{RecordingError, Result, join, shown};
use crate::event::{Event, Reference, Sample, SensorKind};
use crate::false_stamps::FalseStamps;
use crate::issues::Issues;
use crate::merge::Merged;
use crate::recording::{EventSource, Opened, Scale};

/// The opened sources as one stream. Remarks and sensors are put together; `scale` is for those that
/// have not applied the units of the options themselves.
pub(super) fn combine(parts: Vec<(&Source, Opened)>, scale: Scale) -> Opened {
    let mut sensors = Vec::new();
    let mut notes = Vec::new();
    let mut streams: Vec<Box<dyn EventSource>> = Vec::new();
    for (source, opened) in parts {
        let adapted = Adapted {
            offset_ns: (source.time_offset_s * 1e9).round() as i64,
            role: source.role,
            only: match &source.taken {
                Some(Use::Sensors(sensors)) => Some(sensors.clone()),
                _ => None,
            },
            scale: if opened.units_applied {
                Scale::NONE
            } else {
                scale
            },
            source: Box::new(FalseStamps::new(opened.source)),
        };
        sensors.extend(opened.sensors.iter().filter_map(|kind| adapted.kind(*kind)));
        notes.extend(opened.notes);
        streams.push(Box::new(adapted));
    }
    sensors.sort_unstable_by_key(|kind| kind.order());
    sensors.dedup();
    let source = match streams.len() {
        1 => streams.swap_remove(0),
        _ => Box::new(Merged::new(streams)),
    };
    Opened {
        notes,
        units_applied: true,
        ..Opened::new(Default::default(), sensors, source)
    }
}

/// A recording whose reference is another file's: orientations that it has as references or of a device, and positions and
/// velocities, turned into the recording's world.
///
/// # Errors
/// The other file has neither.
pub(crate) fn with_reference(opened: Opened, truth: Opened, file: &str) -> Result<Opened> {
    let reference = Adapted {
        source: Box::new(FalseStamps::new(truth.source)),
        offset_ns: 0,
        role: Role::Reference,
        only: None,
        scale: Scale::NONE,
    };
    let told: Vec<SensorKind> = (truth.sensors.iter())
        .filter_map(|kind| reference.kind(*kind))
        .collect();
    if told.is_empty() {
        return Err(RecordingError::unsupported(
            file,
            "it has neither orientations nor positions, so it is no reference",
        ));
    }
    let turn =
        (truth.metadata.world_frame != opened.metadata.world_frame).then(enu_from_ned_rotation);
    let own = opened.sensors.iter().any(|kind| kind.is_reference());
    let names = join(told.iter().map(|kind| kind.name()));
    let mut notes = opened.notes;
    notes.push(format!("The reference is of {}: {names}.", shown(file)));
    if own {
        notes.push("The recording's own reference is left out.".to_owned());
    }
    notes.extend(truth.notes);
    let mut sensors: Vec<SensorKind> = opened.sensors;
    sensors.retain(|kind| !kind.is_reference());
    sensors.extend(told);
    sensors.sort_unstable_by_key(|kind| kind.order());
    let streams: Vec<Box<dyn EventSource>> = vec![
        Box::new(Without(opened.source)),
        Box::new(Turned(reference, turn)),
    ];
    Ok(Opened {
        sensors,
        source: Box::new(Merged::new(streams)),
        notes,
        ..opened
    })
}

/// A recording without its own reference.
struct Without(Box<dyn EventSource>);

impl EventSource for Without {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        while let Some(event) = self.0.next_event(issues)? {
            if !event.sample.kind().is_reference() {
                return Ok(Some(event));
            }
        }
        Ok(None)
    }

    fn place(&self) -> Option<String> {
        self.0.place()
    }
}

/// A reference whose attitudes are turned into another world: from north, east, down to east, north, up and back are the same.
struct Turned(Adapted, Option<UnitQuaternion<f64>>);

impl EventSource for Turned {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        let mut event = self.0.next_event(issues)?;
        if let (
            Some(turn),
            Some(Event {
                sample: Sample::Reference(reference),
                ..
            }),
        ) = (&self.1, &mut event)
        {
            reference.attitude = turn * reference.attitude;
        }
        Ok(event)
    }

    fn place(&self) -> Option<String> {
        self.0.place()
    }
}

/// A source as the manifest wants it.
struct Adapted {
    source: Box<dyn EventSource>,
    offset_ns: i64,
    role: Role,
    only: Option<Vec<SensorKind>>,
    scale: Scale,
}

impl Adapted {
    /// What becomes of a sensor; `None` when it is not taken.
    fn kind(&self, kind: SensorKind) -> Option<SensorKind> {
        if self.only.as_ref().is_some_and(|only| !only.contains(&kind)) {
            return None;
        }
        if self.role == Role::Sensors {
            return Some(kind);
        }
        match kind {
            SensorKind::GnssPosition => Some(SensorKind::ReferencePosition),
            SensorKind::GnssVelocity => Some(SensorKind::ReferenceVelocity),
            SensorKind::DeviceOrientation => Some(SensorKind::Reference),
            kind if kind.is_reference() => Some(kind),
            _ => None,
        }
    }

    /// The sample as the manifest wants it; `None` when it is not taken.
    fn sample(&self, sample: Sample) -> Option<Sample> {
        self.kind(sample.kind())?;
        if self.role == Role::Sensors {
            return Some(sample);
        }
        Some(match sample {
            Sample::GnssPosition(fix) => Sample::ReferencePosition(fix),
            Sample::GnssVelocity(v) => Sample::ReferenceVelocity(nalgebra::Vector3::new(
                v.north_m_s,
                v.east_m_s,
                v.down_m_s.unwrap_or(f64::NAN),
            )),
            Sample::DeviceOrientation(attitude) => Sample::Reference(Reference {
                attitude,
                scored: true,
            }),
            other => other,
        })
    }
}

impl EventSource for Adapted {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        while let Some(event) = self.source.next_event(issues)? {
            if let Some(mut sample) = self.sample(event.sample) {
                let time_ns = event.time_ns.saturating_add(self.offset_ns);
                self.scale.apply(&mut sample);
                return Ok(Some(Event { time_ns, sample }));
            }
        }
        Ok(None)
    }

    fn place(&self) -> Option<String> {
        self.source.place()
    }
}
