//! Events whose references are put on the sensors' clock and into the sensor's body axes.

use std::collections::VecDeque;

use nalgebra::UnitQuaternion;
use northing_recording::{Event, Reference, Sample};

use crate::attitude::reference::ReferenceAlignment;

/// Gives the events in time order, references at their corrected time; what waits in memory is as long as the offset.
#[derive(Debug)]
pub(crate) struct Aligned<I> {
    events: I,
    /// Nothing is done where there is none.
    alignment: Option<Correction>,
    sensors: VecDeque<Event>,
    references: VecDeque<Event>,
    /// Stamp of the newest event read; `None` at the end.
    read_ns: Option<i64>,
    over: bool,
}

#[derive(Debug, Clone, Copy)]
struct Correction {
    offset_ns: i64,
    reference_body_from_sensor: UnitQuaternion<f64>,
}

impl<I> Aligned<I> {
    pub(crate) fn new(events: I, alignment: Option<&ReferenceAlignment>) -> Self {
        Self {
            events,
            alignment: alignment.map(|found| Correction {
                offset_ns: (found.clock_offset_s * 1e9).round() as i64,
                reference_body_from_sensor: found.misalignment().inverse(),
            }),
            sensors: VecDeque::new(),
            references: VecDeque::new(),
            read_ns: None,
            over: false,
        }
    }

    fn take(&mut self, mut event: Event, correction: &Correction) {
        self.read_ns = Some(event.time_ns);
        if let Sample::Reference(reference) = event.sample {
            event.time_ns = event.time_ns.saturating_add(correction.offset_ns);
            event.sample = Sample::Reference(Reference {
                attitude: reference.attitude * correction.reference_body_from_sensor,
                ..reference
            });
            self.references.push_back(event);
        } else {
            self.sensors.push_back(event);
        }
    }

    /// The next event of both queues, if nothing that is still to come can be before it.
    fn ready(&mut self, correction: &Correction) -> Option<Event> {
        let sensor = self.sensors.front().map(|event| event.time_ns);
        let reference = self.references.front().map(|event| event.time_ns);
        // Of one instant the sensors come first.
        let sensors_first = match (sensor, reference) {
            (Some(sensor), Some(reference)) => sensor <= reference,
            (sensor, _) => sensor.is_some(),
        };
        let next_ns = if sensors_first { sensor } else { reference }?;
        let read_ns = self.read_ns.unwrap_or(i64::MAX);
        let other_ns = match sensors_first {
            true => read_ns.saturating_add(correction.offset_ns),
            false => read_ns,
        };
        // A sensor of the same stamp may still come before a reference.
        if !self.over && (next_ns > other_ns || (!sensors_first && next_ns >= other_ns)) {
            return None;
        }
        match sensors_first {
            true => self.sensors.pop_front(),
            false => self.references.pop_front(),
        }
    }
}

impl<I, X> Iterator for Aligned<I>
where
    I: Iterator<Item = Result<Event, X>>,
{
    type Item = Result<Event, X>;

    fn next(&mut self) -> Option<Self::Item> {
        let Some(correction) = self.alignment else {
            return self.events.next();
        };
        loop {
            if let Some(event) = self.ready(&correction) {
                return Some(Ok(event));
            }
            if self.over {
                return None;
            }
            match self.events.next() {
                Some(Ok(event)) => self.take(event, &correction),
                Some(Err(error)) => return Some(Err(error)),
                None => self.over = true,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::reference::simulated::Turned;
    use northing_recording::SensorKind;

    fn alignment(offset_s: f64) -> ReferenceAlignment {
        ReferenceAlignment {
            clock_offset_s: offset_s,
            clock_offset_std_s: 0.0,
            misalignment_deg: [0.0, 0.0, 90.0],
            misalignment_std_deg: [0.0; 3],
            correlation: 1.0,
            rate_rms_deg_s: 60.0,
            windows: 1000,
        }
    }

    /// Early and late references come in order, none is lost, and what waits in memory is as long as the offset.
    #[test]
    fn references_come_at_their_corrected_time() {
        let turned = Turned {
            duration_s: 20.0,
            ..Turned::default()
        };
        for offset_s in [-2.5, 0.0, 2.5] {
            let alignment = alignment(offset_s);
            let mut aligned = Aligned::new(turned.events().into_iter(), Some(&alignment));
            let mut got = Vec::new();
            let mut held = 0;
            while let Some(event) = aligned.next() {
                got.push(event.unwrap());
                held = held.max(aligned.sensors.len() + aligned.references.len());
            }
            assert!(got.is_sorted_by_key(|event| event.time_ns), "{offset_s}");
            let all: Vec<Event> = turned.events().into_iter().map(Result::unwrap).collect();
            assert_eq!(got.len(), all.len());
            let references = |events: &[Event]| -> Vec<Event> {
                let of = |event: &&Event| event.sample.kind() == SensorKind::Reference;
                events.iter().filter(of).copied().collect()
            };
            for (before, after) in references(&all).iter().zip(references(&got)) {
                assert_eq!(after.time_ns - before.time_ns, (offset_s * 1e9) as i64);
                let (Sample::Reference(a), Sample::Reference(b)) = (before.sample, after.sample)
                else {
                    unreachable!("references")
                };
                let angle = a.attitude.angle_to(&b.attitude).to_degrees();
                assert!((angle - 90.0).abs() < 1e-9);
            }
            // 330 events a second.
            assert!(
                held <= (330.0 * offset_s.abs()) as usize + 20,
                "{held} for {offset_s} s"
            );
        }
    }
}
