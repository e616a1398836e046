//! What becomes of a recording whose sensors were worse: slower, coarser, late, with holes, bumped, near a magnet.
//!
//! Every alteration is a pure function of the samples: the same alteration of the same recording is the same recording, to
//! the bit. What is lost is drawn from a hash of each sample's stamp and not from a generator, so that losing more samples
//! loses those that fewer lose, too.

use nalgebra::Vector3;
use northing_recording::{Event, Sample, SensorKind};
use serde::{Deserialize, Serialize};

/// Most of what may be lost: an estimator needs something.
const MOST_LOST: f64 = 0.98;
/// Lowest rate, Hz.
const LOWEST_HZ: f64 = 0.5;
/// Longest delay, s.
const LONGEST_DELAY_S: f64 = 2.0;
/// Direction of a bump and of a magnet, body axes.
const DIRECTION: [f64; 3] = [0.8, 0.0, 0.6];

/// A disturbance of a while, of the form of half a sine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct Pulse {
    /// When it begins, seconds after the first sample.
    pub at_s: f64,
    /// How long it lasts, s.
    pub duration_s: f64,
    /// How large it is at its middle, in the sensor's unit.
    pub size: f64,
}

/// What is done to the samples before they are run. The default does nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(optional_fields))]
#[serde(default, deny_unknown_fields)]
pub struct Alterations {
    /// Samples a second of each sensor at most; as recorded when there is none. Samples between are left out, not averaged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// The gyroscope is rounded to multiples of this, deg/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyroscope_step_deg_s: Option<f64>,
    /// The accelerometer is rounded to multiples of this, m/s^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometer_step_m_s2: Option<f64>,
    /// Accelerometer, magnetometer and compass are stamped so much later than they measured, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
    /// Share of the samples that is lost, 0 to 0.98.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_share: Option<f64>,
    /// The device is bumped: specific force, m/s^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bump: Option<Pulse>,
    /// A magnet comes near: magnetic field, microtesla.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub magnet: Option<Pulse>,
}

impl Pulse {
    fn check(&self, what: &str) -> Result<(), String> {
        let fits = self.at_s.is_finite()
            && self.size.is_finite()
            && (1e-3..=3600.0).contains(&self.duration_s);
        if fits && self.size.abs() <= 1e4 {
            return Ok(());
        }
        Err(format!(
            "{what}: expected a time, a duration of 0.001 to 3600 s and a size"
        ))
    }

    /// What it adds at a time.
    fn at(&self, since_start_s: f64) -> Vector3<f64> {
        let phase = (since_start_s - self.at_s) / self.duration_s;
        if !(0.0..=1.0).contains(&phase) {
            return Vector3::zeros();
        }
        Vector3::from(DIRECTION) * (self.size * (std::f64::consts::PI * phase).sin())
    }
}

impl Alterations {
    /// Whether it leaves every sample as it is.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether its numbers are of use.
    ///
    /// # Errors
    /// One is not, in a sentence.
    pub fn check(&self) -> Result<(), String> {
        let within = |name: &str, value: Option<f64>, [low, high]: [f64; 2]| match value {
            Some(v) if !(low..=high).contains(&v) => {
                Err(format!("{name} = {v}: expected {low} to {high}"))
            }
            _ => Ok(()),
        };
        within("rate_hz", self.rate_hz, [LOWEST_HZ, 1e4])?;
        within(
            "gyroscope_step_deg_s",
            self.gyroscope_step_deg_s,
            [0.0, 1e3],
        )?;
        within(
            "accelerometer_step_m_s2",
            self.accelerometer_step_m_s2,
            [0.0, 1e2],
        )?;
        within("delay_s", self.delay_s, [0.0, LONGEST_DELAY_S])?;
        within("lost_share", self.lost_share, [0.0, MOST_LOST])?;
        self.bump.map_or(Ok(()), |pulse| pulse.check("bump"))?;
        self.magnet.map_or(Ok(()), |pulse| pulse.check("magnet"))
    }

    /// The samples as they would have been; in the order of time, as those that are given.
    #[must_use]
    pub fn apply(&self, events: &[Event]) -> Vec<Event> {
        let first_ns = events.first().map_or(0, |event| event.time_ns);
        let mut due: Vec<(SensorKind, i64)> = Vec::new();
        let mut altered = Vec::with_capacity(events.len());
        for event in events {
            // What something else knows of the truth is no sensor of the device.
            if matches!(event.sample, Sample::Reference(_)) {
                altered.push(*event);
                continue;
            }
            if self.is_lost(event) || !self.is_due(event, &mut due) {
                continue;
            }
            let since_s = event.time_ns.saturating_sub(first_ns) as f64 * 1e-9;
            altered.push(self.altered(event, since_s));
        }
        if self.delay_s.is_some() {
            altered.sort_by_key(Event::place);
        }
        altered
    }

    fn altered(&self, event: &Event, since_s: f64) -> Event {
        let rounded = |v: Vector3<f64>, step: Option<f64>| match step.filter(|step| *step > 0.0) {
            Some(step) => v.map(|x| (x / step).round() * step),
            None => v,
        };
        let sample = match event.sample {
            Sample::AngularRate(v) => {
                Sample::AngularRate(rounded(v, self.gyroscope_step_deg_s.map(f64::to_radians)))
            }
            Sample::SpecificForce(v) => {
                let bumped = v + self
                    .bump
                    .map_or_else(Vector3::zeros, |pulse| pulse.at(since_s));
                Sample::SpecificForce(rounded(bumped, self.accelerometer_step_m_s2))
            }
            Sample::MagneticField(v) => Sample::MagneticField(
                v + self
                    .magnet
                    .map_or_else(Vector3::zeros, |pulse| pulse.at(since_s)),
            ),
            other => other,
        };
        let is_aid = matches!(
            event.sample.kind(),
            SensorKind::Accelerometer | SensorKind::Magnetometer | SensorKind::CompassHeading
        );
        let delay_ns = self
            .delay_s
            .filter(|_| is_aid)
            .map_or(0, |delay| (delay * 1e9) as i64);
        Event {
            time_ns: event.time_ns.saturating_add(delay_ns),
            sample,
        }
    }

    /// Whether a slower sensor would have measured this one.
    fn is_due(&self, event: &Event, due: &mut Vec<(SensorKind, i64)>) -> bool {
        let Some(rate_hz) = self.rate_hz else {
            return true;
        };
        let interval_ns = (1e9 / rate_hz) as i64;
        let kind = event.sample.kind();
        let Some((_, next_ns)) = due.iter_mut().find(|(of, _)| *of == kind) else {
            due.push((kind, event.time_ns.saturating_add(interval_ns)));
            return true;
        };
        // A little early is in time: stamps tremble.
        if event.time_ns < next_ns.saturating_sub(interval_ns / 8) {
            return false;
        }
        *next_ns = (*next_ns)
            .max(event.time_ns.saturating_sub(interval_ns / 2))
            .saturating_add(interval_ns);
        true
    }

    fn is_lost(&self, event: &Event) -> bool {
        let Some(share) = self.lost_share.filter(|share| *share > 0.0) else {
            return false;
        };
        let seed = (event.time_ns as u64) ^ ((event.sample.kind() as u64) << 56);
        unit(seed) < share
    }
}

/// A number from 0 to 1 that looks like chance (SplitMix64, Steele, Lea and Flood 2014).
fn unit(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    fn events() -> Vec<Event> {
        VirtualPhone::new(VirtualPhoneConfig::default())
            .unwrap()
            .events()
            .collect()
    }

    fn of(events: &[Event], kind: SensorKind) -> Vec<Event> {
        events
            .iter()
            .filter(|e| e.sample.kind() == kind)
            .copied()
            .collect()
    }

    #[test]
    fn nothing_changes_nothing() {
        let events = events();
        assert!(Alterations::default().is_none());
        assert_eq!(Alterations::default().apply(&events), events);
    }

    #[test]
    fn a_rate_is_kept_to_and_what_is_left_is_as_it_was() {
        let events = events();
        let seconds = (events.last().unwrap().time_ns - events[0].time_ns) as f64 * 1e-9;
        for rate_hz in [2.0, 10.0, 37.0] {
            let altered = Alterations {
                rate_hz: Some(rate_hz),
                ..Default::default()
            }
            .apply(&events);
            let rate = of(&altered, SensorKind::Gyroscope).len() as f64 / seconds;
            assert!((rate / rate_hz - 1.0).abs() < 0.05, "{rate} for {rate_hz}");
            assert!(altered.iter().all(|e| events.contains(e)));
            assert_eq!(
                of(&altered, SensorKind::Reference),
                of(&events, SensorKind::Reference)
            );
        }
    }

    #[test]
    fn losses_are_as_many_as_asked_and_more_of_them_contain_fewer() {
        let events = of(&events(), SensorKind::Gyroscope);
        let lose = |share| {
            Alterations {
                lost_share: Some(share),
                ..Default::default()
            }
            .apply(&events)
        };
        let (few, many) = (lose(0.1), lose(0.5));
        assert!((few.len() as f64 / events.len() as f64 - 0.9).abs() < 0.02);
        assert!((many.len() as f64 / events.len() as f64 - 0.5).abs() < 0.02);
        assert!(many.iter().all(|e| few.contains(e)));
        assert_eq!(lose(0.5), many);
    }

    #[test]
    fn steps_delays_and_pulses_are_as_large_as_asked() {
        let events = events();
        let altered = Alterations {
            gyroscope_step_deg_s: Some(0.1),
            delay_s: Some(0.05),
            bump: Some(Pulse {
                at_s: 5.0,
                duration_s: 1.0,
                size: 4.0,
            }),
            ..Default::default()
        }
        .apply(&events);
        assert!(altered.is_sorted_by_key(Event::place));
        for event in of(&altered, SensorKind::Gyroscope) {
            let Sample::AngularRate(v) = event.sample else {
                unreachable!()
            };
            let steps = v.map(|x| x.to_degrees() / 0.1);
            assert!((steps - steps.map(f64::round)).amax() < 1e-9);
        }
        let (before, after) = (
            of(&events, SensorKind::Accelerometer),
            of(&altered, SensorKind::Accelerometer),
        );
        assert_eq!(before.len(), after.len());
        let mut largest: f64 = 0.0;
        for (a, b) in before.iter().zip(&after) {
            assert_eq!(b.time_ns - a.time_ns, 50_000_000);
            let (Sample::SpecificForce(a_v), Sample::SpecificForce(b_v)) = (a.sample, b.sample)
            else {
                unreachable!()
            };
            let since_s = (a.time_ns - events[0].time_ns) as f64 * 1e-9;
            assert!((5.0..=6.0).contains(&since_s) || a_v == b_v);
            largest = largest.max((b_v - a_v).norm());
        }
        assert!((largest - 4.0).abs() < 0.05, "{largest}");
    }

    #[test]
    fn what_is_of_no_use_is_refused_by_name() {
        let refused = |alterations: Alterations| alterations.check().unwrap_err();
        assert!(
            refused(Alterations {
                rate_hz: Some(0.0),
                ..Default::default()
            })
            .starts_with("rate_hz = 0")
        );
        assert!(
            refused(Alterations {
                lost_share: Some(1.0),
                ..Default::default()
            })
            .contains("0.98")
        );
        assert!(
            refused(Alterations {
                delay_s: Some(f64::NAN),
                ..Default::default()
            })
            .starts_with("delay_s")
        );
        let pulse = Pulse {
            at_s: 0.0,
            duration_s: 0.0,
            size: 1.0,
        };
        assert!(
            refused(Alterations {
                magnet: Some(pulse),
                ..Default::default()
            })
            .starts_with("magnet")
        );
        assert!(Alterations::default().check().is_ok());
    }
}
