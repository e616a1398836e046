//! How one run is judged: cost, recovery and consistency of an estimator after a fault, beside the same run without it.

use northing_core::faults::FaultySensor;
use northing_evaluation::registry::Question;
use northing_evaluation::statistics::faults::FaultRecord;
use northing_simulation::fault_injection::{InjectedFault, InjectionTarget};
use serde::{Serialize, Serializer};

use super::stream::{Origin, Stream};
use super::{MOST_COST, MOST_NEES, RECOVERED_DEG, RECOVERED_RATIO, RECOVERY_S, Subject};
use crate::scoring::{self, EVERY_S};

/// Stamps of recordings are rounded to microseconds.
pub(super) const STAMP_TOLERANCE_S: f64 = 1e-6;
/// The time after a fault that is judged, s.
const MINUTE_S: f64 = 60.0;
/// An estimator has recovered if it states something at so much of the instants of the clean run, at least.
const LEAST_PRESENT: f64 = 0.5;

/// An estimate against the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Instant {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// Error, deg or m.
    pub error: f64,
    /// NEES per degree of freedom, of what states a covariance.
    pub nees: Option<f64>,
}

/// A fault that a run found in its samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Detected {
    /// Whose samples.
    pub sensor: FaultySensor,
    /// When it was found, s.
    pub found_s: f64,
}

/// What an estimator made of a stream.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Track {
    /// Ten times a second.
    pub instants: Vec<Instant>,
    /// Faults that were found; `None` where nobody looks for them.
    pub detected: Option<Vec<Detected>>,
}

/// A run with a fault, judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judgement {
    /// The fault.
    pub fault: &'static str,
    /// The estimator.
    pub estimator: &'static str,
    /// What it estimates.
    pub question: Question,
    /// Where the stream comes from.
    pub origin: Origin,
    /// The stream's name.
    pub stream: String,
    /// The stream's number.
    pub number: u64,
    /// When the fault began, s.
    pub from_s: f64,
    /// When samples were normal again, s.
    pub until_s: f64,
    /// Root mean square of the error without the fault, deg or m; `None`: there was no estimate.
    pub clean_rms: Option<f64>,
    /// That of the run with the fault.
    #[serde(serialize_with = "finite")]
    pub rms: Option<f64>,
    /// The one over the other.
    #[serde(serialize_with = "finite")]
    pub cost: Option<f64>,
    /// Largest error in the minute after the fault, deg or m.
    #[serde(serialize_with = "finite")]
    pub largest: Option<f64>,
    /// How long after the fault the error was within the limit for good, s; `None`: not within the minute.
    pub recovery_s: Option<f64>,
    /// Mean NEES per degree of freedom in the minute from ten seconds after the fault on.
    #[serde(serialize_with = "finite")]
    pub nees: Option<f64>,
    /// The same without the fault.
    pub clean_nees: Option<f64>,
    /// Whether the fault was found, of the right sensor and within ten seconds; `None` where nobody looks for faults.
    pub detected: Option<bool>,
    /// Faults that were found without the fault: false alarms.
    pub clean_alarms: Option<usize>,
    /// How long the clean run was, s.
    pub clean_s: f64,
    /// Whether it meets the limits.
    pub meets: bool,
}

/// A number that is infinite or none is no number of JSON.
fn finite<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    value
        .filter(|value| value.is_finite())
        .serialize(serializer)
}

impl Judgement {
    /// An estimator with a fault in `span` of a stream, without it and with it.
    pub(super) fn of(
        stream: &Stream,
        subject: Subject,
        fault: &InjectedFault,
        span: [i64; 2],
        [clean, faulty]: [&Track; 2],
    ) -> Self {
        let [from_s, until_s] = span.map(|ns| stream.seconds(ns));
        let (clean_rms, rms) = (clean.rms(), faulty.rms());
        let cost = rms.zip(clean_rms).map(|(rms, clean)| rms / clean.max(1e-9));
        let calm_s = until_s + RECOVERY_S;
        let after = |track: &Track| track.mean_nees(calm_s, calm_s + MINUTE_S);
        let (nees, clean_nees) = (after(faulty), after(clean));
        let limit = match stream.question {
            Question::Attitude => RECOVERED_DEG,
            _ => clean_rms.map_or(0.0, |rms| RECOVERED_RATIO * rms),
        };
        let recovery_s = recovery(clean, faulty, until_s, limit);
        let is_sound =
            nees.is_none_or(|nees| nees < MOST_NEES.max(MOST_COST * clean_nees.unwrap_or(0.0)));
        let meets = if fault.is_one_sample() {
            cost.is_some_and(|cost| cost <= MOST_COST)
        } else {
            recovery_s.is_some_and(|time| time <= RECOVERY_S) && is_sound
        };
        Self {
            fault: fault.name,
            estimator: subject.name(),
            question: stream.question,
            origin: stream.origin,
            stream: stream.name.clone(),
            number: stream.number,
            from_s,
            until_s,
            clean_rms,
            rms,
            cost,
            largest: faulty.largest(from_s, until_s + MINUTE_S),
            recovery_s,
            nees,
            clean_nees,
            detected: detected(faulty, fault.target, from_s),
            clean_alarms: clean.detected.as_ref().map(Vec::len),
            clean_s: clean.instants.last().map_or(0.0, |last| last.time_s),
            meets,
        }
    }
}

/// Whether a run found a fault of these sensors in time.
fn detected(track: &Track, target: InjectionTarget, from_s: f64) -> Option<bool> {
    let is_it = |found: &Detected| {
        is_of(target, found.sensor) && (from_s..=from_s + RECOVERY_S).contains(&found.found_s)
    };
    let found = track.detected.as_ref()?;
    // A receiver's faults are nobody's here: those of the samples are looked for.
    (target != InjectionTarget::Receiver).then(|| found.iter().any(is_it))
}

const fn is_of(target: InjectionTarget, sensor: FaultySensor) -> bool {
    match target {
        InjectionTarget::Gyroscope => matches!(sensor, FaultySensor::Gyroscope),
        InjectionTarget::Accelerometer => matches!(sensor, FaultySensor::Accelerometer),
        InjectionTarget::Magnetometer => matches!(sensor, FaultySensor::Magnetometer),
        InjectionTarget::All => true,
        InjectionTarget::Receiver => false,
    }
}

impl Track {
    /// What a watch noted, and the faults that the run found where it looks for them.
    pub(super) fn of(instants: Vec<Instant>, found: Option<&[FaultRecord]>) -> Self {
        let one = |record: &FaultRecord| Detected {
            sensor: record.sensor,
            found_s: record.found_s,
        };
        Self {
            instants,
            detected: found.map(|records| records.iter().map(one).collect()),
        }
    }

    fn within(&self, from_s: f64, until_s: f64) -> &[Instant] {
        let place = |time_s: f64| self.instants.partition_point(|i| i.time_s < time_s);
        self.instants
            .get(place(from_s)..place(until_s))
            .unwrap_or_default()
    }

    fn rms(&self) -> Option<f64> {
        scoring::rms(self.instants.iter().map(|i| i.error))
    }

    fn mean_nees(&self, from_s: f64, until_s: f64) -> Option<f64> {
        let stated = self.within(from_s, until_s).iter().filter_map(|i| i.nees);
        let (count, sum) = stated.fold((0_usize, 0.0), |(n, sum), nees| (n + 1, sum + nees));
        (count > 0).then(|| sum / count as f64)
    }

    fn largest(&self, from_s: f64, until_s: f64) -> Option<f64> {
        let errors = self.within(from_s, until_s).iter().map(|i| i.error);
        errors.reduce(f64::max)
    }

    /// The error at an instant, or at the next.
    fn error_at(&self, time_s: f64) -> Option<f64> {
        let place = self
            .instants
            .partition_point(|i| i.time_s < time_s - 0.5 * EVERY_S);
        self.instants.get(place).map(|i| i.error)
    }
}

/// How long after a fault the error came within a limit, or near that of the clean run, and stayed there for the minute and ten
/// seconds that are judged.
fn recovery(clean: &Track, faulty: &Track, until_s: f64, limit: f64) -> Option<f64> {
    let end_s = until_s + RECOVERY_S + MINUTE_S;
    let (expected, present) = (clean.within(until_s, end_s), faulty.within(until_s, end_s));
    if present.is_empty() || (present.len() as f64) < LEAST_PRESENT * expected.len() as f64 {
        return None;
    }
    let is_off = |instant: &&Instant| {
        let without = clean.error_at(instant.time_s).unwrap_or(0.0);
        let within = instant.error <= limit.max(MOST_COST * without);
        !within
    };
    let last_off = present.iter().rev().find(is_off);
    match (last_off, present.last()) {
        (None, _) => Some(present.first().map_or(0.0, |i| i.time_s - until_s)),
        (Some(off), Some(last)) if off.time_s < last.time_s => Some(off.time_s - until_s),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use InjectionTarget::{All, Gyroscope};

    #[test]
    fn a_fault_is_found_in_its_sensor_and_in_time_or_not_at_all() {
        let found = |sensor, found_s| Track {
            detected: Some(vec![Detected { sensor, found_s }]),
            ..Track::default()
        };
        assert_eq!(
            detected(&found(FaultySensor::Gyroscope, 41.0), Gyroscope, 40.0),
            Some(true)
        );
        assert_eq!(
            detected(&found(FaultySensor::Gyroscope, 41.0), All, 40.0),
            Some(true)
        );
        assert_eq!(
            detected(&found(FaultySensor::Gyroscope, 39.0), Gyroscope, 40.0),
            Some(false)
        );
        assert_eq!(
            detected(&found(FaultySensor::Gyroscope, 50.5), Gyroscope, 40.0),
            Some(false)
        );
        assert_eq!(
            detected(&found(FaultySensor::Accelerometer, 41.0), Gyroscope, 40.0),
            Some(false)
        );
        assert_eq!(detected(&Track::default(), Gyroscope, 40.0), None);
    }

    fn track(error: impl Fn(f64) -> f64) -> Track {
        let at = |k: u32| {
            let time_s = 5.0 + 0.1 * f64::from(k);
            let error = error(time_s);
            Instant {
                time_s,
                error,
                nees: Some(error),
            }
        };
        Track {
            instants: (0..1150).map(at).collect(),
            ..Track::default()
        }
    }

    #[test]
    fn recovery_is_the_last_time_beyond_the_limit() {
        let clean = track(|_| 1.0);
        let back = track(|t| if t > 30.0 && t < 47.0 { 20.0 } else { 1.0 });
        let time = recovery(&clean, &back, 40.0, 5.0).unwrap();
        assert!((time - 7.0).abs() < 0.15, "{time}");
        assert!(recovery(&clean, &clean, 40.0, 5.0).unwrap() < 0.2);
        let again = track(|t| {
            if (40.0..41.0).contains(&t) || t > 90.0 {
                20.0
            } else {
                1.0
            }
        });
        assert_eq!(recovery(&clean, &again, 40.0, 5.0), None);
        let silent = Track {
            instants: clean.within(5.0, 50.0).to_vec(),
            ..Track::default()
        };
        assert_eq!(recovery(&clean, &silent, 40.0, 5.0), None);
        // What is so without the fault is no fault.
        let poor = track(|_| 30.0);
        assert!(recovery(&poor, &poor, 40.0, 5.0).is_some());
        let lost = track(|t| if t > 40.0 { f64::NAN } else { 1.0 });
        assert_eq!(recovery(&clean, &lost, 40.0, 5.0), None);
    }

    #[test]
    fn means_are_those_of_their_minute() {
        let steps = track(|t| if t < 50.0 { 9.0 } else { 2.0 });
        assert!((steps.mean_nees(50.0, 110.0).unwrap() - 2.0).abs() < 1e-9);
        assert_eq!(steps.mean_nees(200.0, 260.0), None);
        assert_eq!(steps.largest(40.0, 60.0), Some(9.0));
    }
}
