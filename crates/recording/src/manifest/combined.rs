//! Several sources as one recording: shifted in time, taken in part, made references, and merged.

use super::schema::{Role, Source};
use crate::error::Result;
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
            only: source.only.clone(),
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
