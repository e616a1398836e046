//! Faults that were found in the samples of a run: which sensor, what, from when to when.

use northing_core::faults::{Fault, FaultKind, FaultySensor};
use serde::Serialize;

use crate::statistics::seconds_between;

/// So many are told in words.
const MOST_SENTENCES: usize = 5;
/// More than these (the latest are left out) are counted only.
const MOST: usize = 1000;

/// A fault of the samples, as a run tells it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct FaultRecord {
    /// Whose samples.
    #[cfg_attr(feature = "typescript", ts(type = "string"))]
    pub sensor: FaultySensor,
    /// What is wrong with them.
    #[cfg_attr(feature = "typescript", ts(type = "string"))]
    pub kind: FaultKind,
    /// Stamp of the last good sample before, s after the first sample of the recording.
    pub from_s: f64,
    /// When it was found, s.
    pub found_s: f64,
    /// Stamp of the first good sample after it, s; `None` where it lasted to the end.
    pub until_s: Option<f64>,
    /// How large: the jump of a spike and the full scale of a saturation in the unit of the sensor, the seconds that a stamp
    /// was ahead, how far a bias stepped in that unit, the seconds without a measurement of the others.
    pub size: f64,
}

/// A fault under way, or that has just been found, in one sentence.
#[must_use]
pub fn sentence_now(fault: &Fault<f64>) -> String {
    let name = sensor_name(fault.sensor);
    let what = match fault.kind {
        FaultKind::Spike => "delivered a sample far from those around it, which was left out",
        FaultKind::Stuck => "repeats the same numbers, which are not used",
        FaultKind::Noise => "delivers nothing but noise, which is not used",
        FaultKind::Saturated => "is clipped: what lies beyond is not seen",
        FaultKind::Missing => "paused: the turn between is estimated",
        FaultKind::Stamp => {
            "delivered a sample whose time stamp is far ahead of those around it, which was left out"
        }
        FaultKind::BiasStep => "has another bias than before, which is removed",
    };
    format!("The {name} {what}.")
}

fn sensor_name(sensor: FaultySensor) -> &'static str {
    match sensor {
        FaultySensor::Gyroscope => "gyroscope",
        FaultySensor::Accelerometer => "accelerometer",
        FaultySensor::Magnetometer => "magnetometer",
    }
}

impl FaultRecord {
    /// In words, with the sensor: `gyroscope: stuck from 12.30 s to 15.31 s`.
    #[must_use]
    pub fn sentence(&self) -> String {
        let unit = unit_of(self.sensor);
        let from = self.from_s;
        let until = match self.until_s {
            Some(until) => format!("to {until:.2} s"),
            None => "to the end".to_owned(),
        };
        let size = self.size;
        let what = match self.kind {
            FaultKind::Spike => {
                format!("spike of {size:.3} {unit} after {from:.2} s, left out")
            }
            FaultKind::Stuck => {
                format!("the same numbers from {from:.2} s {until}, not used as measurements")
            }
            FaultKind::Noise => {
                format!("nothing but noise from {from:.2} s {until}, not used as measurements")
            }
            FaultKind::Saturated => format!(
                "clipped ({size:.3} {unit}) from {from:.2} s {until}; what lies beyond was not seen"
            ),
            FaultKind::Stamp => {
                format!("a time stamp {size:.1} s ahead after {from:.2} s, sample left out")
            }
            FaultKind::BiasStep => {
                let found = self.found_s;
                format!(
                    "its bias changed by {size:.3} {unit}, found at {found:.2} s; the new one is removed"
                )
            }
            FaultKind::Missing => {
                format!("no samples from {from:.2} s {until}; the turn between is estimated")
            }
        };
        format!("{}: {what}.", sensor_name(self.sensor))
    }
}

/// So many changes of a bias, each so soon after the one before in the mean, s, are hardly the sensor's own.
const MANY_BIAS_STEPS: usize = 4;
const SOON_S: f64 = 120.0;

fn is_bias_step(record: &FaultRecord, sensor: FaultySensor) -> bool {
    record.kind == FaultKind::BiasStep && record.sensor == sensor
}

/// A bias of a sensor that changes again and again, as one sentence.
fn many_bias_steps(sensor: FaultySensor, steps: &[&FaultRecord]) -> Option<String> {
    let [first, .., last] = steps else {
        return None;
    };
    let each_s = (last.found_s - first.found_s) / (steps.len() - 1) as f64;
    if steps.len() < MANY_BIAS_STEPS || each_s >= SOON_S {
        return None;
    }
    let largest = steps.iter().map(|record| record.size).fold(0.0, f64::max);
    Some(format!(
        "{}: {} changes of its bias were found and removed from {:.2} s to {:.2} s, of up to {largest:.3} {}. Hardly any sensor does \
         that: its axes, units or clock may be wrong, or what it is compared with is (fixes, gravity, the field).",
        sensor_name(sensor),
        steps.len(),
        first.found_s,
        last.found_s,
        unit_of(sensor),
    ))
}

const fn unit_of(sensor: FaultySensor) -> &'static str {
    match sensor {
        FaultySensor::Gyroscope => "rad/s",
        FaultySensor::Accelerometer => "m/s^2",
        FaultySensor::Magnetometer => "uT",
    }
}

/// Collects the faults of a run; what is told twice, when found and when over, becomes one record.
#[derive(Debug, Clone, Default)]
pub(crate) struct FaultTally {
    faults: Vec<(Fault<f64>, FaultRecord)>,
    /// Those beyond the most that are kept.
    more: u64,
}

impl FaultTally {
    /// Takes a fault; `first_ns` is the stamp of the recording's first sample.
    pub(crate) fn add(&mut self, first_ns: i64, fault: &Fault<f64>) {
        let at = |ns: i64| seconds_between(first_ns, ns);
        let until_s = fault.is_over.then(|| at(fault.until_ns));
        let open = self.faults.iter_mut().rev().find(|(known, record)| {
            record.until_s.is_none()
                && (known.sensor, known.kind, known.from_ns)
                    == (fault.sensor, fault.kind, fault.from_ns)
        });
        if let Some((_, record)) = open {
            record.until_s = until_s;
            record.size = fault.size;
        } else if self.faults.len() < MOST {
            let record = FaultRecord {
                sensor: fault.sensor,
                kind: fault.kind,
                from_s: at(fault.from_ns),
                found_s: at(fault.until_ns),
                until_s,
                size: fault.size,
            };
            self.faults.push((*fault, record));
        } else {
            self.more += 1;
        }
    }

    /// The first of them in words, and how many there are besides.
    pub(crate) fn sentences(&self) -> Vec<String> {
        let mut single: Vec<&FaultRecord> = self.faults.iter().map(|(_, record)| record).collect();
        let mut sentences = Vec::new();
        for sensor in [FaultySensor::Gyroscope, FaultySensor::Accelerometer] {
            let (steps, others) = single
                .iter()
                .partition::<Vec<_>, _>(|record| is_bias_step(record, sensor));
            if let Some(sentence) = many_bias_steps(sensor, &steps) {
                sentences.push(sentence);
                single = others;
            }
        }
        let told = single.iter().take(MOST_SENTENCES);
        sentences.extend(told.map(|record| record.sentence()));
        let more = single.len().saturating_sub(MOST_SENTENCES) as u64 + self.more;
        if more > 0 {
            sentences.push(format!("{more} more faults of the samples like these."));
        }
        sentences
    }

    pub(crate) fn records(&self) -> Vec<FaultRecord> {
        self.faults.iter().map(|(_, record)| *record).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_that_is_told_twice_is_one_record() {
        let mut tally = FaultTally::default();
        let found = Fault {
            sensor: FaultySensor::Gyroscope,
            kind: FaultKind::Stuck,
            from_ns: 12_300_000_000,
            until_ns: 12_350_000_000,
            is_over: false,
            size: 0.05,
        };
        tally.add(1_000_000_000, &found);
        let [open] = tally.records()[..] else {
            panic!("one")
        };
        assert_eq!(
            open.sentence(),
            "gyroscope: the same numbers from 11.30 s to the end, not used as measurements."
        );
        let over = Fault {
            until_ns: 15_300_000_000,
            is_over: true,
            size: 3.0,
            ..found
        };
        tally.add(1_000_000_000, &over);
        let [record] = tally.records()[..] else {
            panic!("one")
        };
        assert!((record.found_s - 11.35).abs() < 1e-9 && (record.size - 3.0).abs() < 1e-9);
        assert_eq!(
            tally.sentences(),
            ["gyroscope: the same numbers from 11.30 s to 14.30 s, not used as measurements."]
        );
        (0..7).for_each(|k| {
            let from_ns = 20_000_000_000 + k;
            tally.add(0, &Fault { from_ns, ..over });
        });
        assert_eq!(
            tally.sentences()[5],
            "3 more faults of the samples like these."
        );
    }

    #[test]
    fn a_bias_that_changes_again_and_again_is_not_called_the_gyroscopes() {
        let step_of = |sensor: FaultySensor, found_s: i64| Fault {
            sensor,
            kind: FaultKind::BiasStep,
            from_ns: found_s * 1_000_000_000,
            until_ns: found_s * 1_000_000_000,
            is_over: true,
            size: 0.1 + 0.001 * found_s as f64,
        };
        let step = |found_s| step_of(FaultySensor::Gyroscope, found_s);
        let said = |times: &[i64]| {
            let mut tally = FaultTally::default();
            times.iter().for_each(|at| tally.add(0, &step(*at)));
            tally.sentences()
        };
        let often = said(&[10, 30, 40, 70]);
        assert!(
            often.len() == 1 && often[0].contains("4 changes of its bias were found and removed from 10.00 s to 70.00 s, of up to 0.170"),
            "{often:?}"
        );
        // Each sensor by itself, with its name and unit.
        let mut both = FaultTally::default();
        for found_s in [10, 20, 30, 40] {
            both.add(0, &step_of(FaultySensor::Accelerometer, found_s));
        }
        both.add(0, &step(50));
        let both = both.sentences();
        assert!(
            both.len() == 2
                && both[0].starts_with("accelerometer: 4 changes of its bias")
                && both[0].contains("of up to 0.140 m/s^2.")
                && both[1].starts_with("gyroscope: its bias changed by 0.150 rad/s"),
            "{both:?}"
        );
        for few in [&[10, 30, 40][..], &[10, 1000, 3000, 9000]] {
            let said = said(few);
            assert!(
                said.len() == few.len() && said[0].contains("its bias changed by"),
                "{said:?}"
            );
        }
    }
}
