//! Samples as they were measured, kept between two frames for pages that plot them.

use std::collections::BTreeMap;

use northing_recording::{Event, Sample, SensorKind};

/// Samples kept of one sensor: two seconds of fast ones. Nobody looks where there are more.
const MOST: usize = 1000;
/// The sensors that are plotted.
const SENSORS: [SensorKind; 3] = [
    SensorKind::Gyroscope,
    SensorKind::Accelerometer,
    SensorKind::Magnetometer,
];

/// Seconds since the device's first sample, x, y, z, by the sensor's name.
pub type Series = BTreeMap<&'static str, Vec<[f64; 4]>>;

/// The samples since they were last asked for.
#[derive(Debug, Default)]
pub struct Raw([Vec<[f64; 4]>; 3]);

impl Raw {
    /// Takes a sample that came `t_s` seconds after the device's first one.
    pub fn add(&mut self, t_s: f64, event: &Event) {
        let v = match &event.sample {
            Sample::AngularRate(v) | Sample::SpecificForce(v) | Sample::MagneticField(v) => v,
            _ => return,
        };
        let place = SENSORS.iter().position(|s| *s == event.sample.kind());
        let Some(kept) = place.and_then(|place| self.0.get_mut(place)) else {
            return;
        };
        if kept.len() >= MOST {
            kept.drain(..MOST / 2);
        }
        kept.push([t_s, v.x, v.y, v.z]);
    }

    /// Hands them out.
    pub fn take(&mut self) -> Series {
        let taken = SENSORS.iter().zip(&mut self.0);
        taken
            .filter(|(_, kept)| !kept.is_empty())
            .map(|(sensor, kept)| (sensor.name(), std::mem::take(kept)))
            .collect()
    }

    /// Forgets them: the device's clock began anew.
    pub fn clear(&mut self) {
        self.0 = Default::default();
    }
}
