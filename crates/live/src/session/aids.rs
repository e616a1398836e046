//! The sensors that correct the attitude, in one table: a lamp, a slider and a switch come with a row.

use northing_core::attitude::AttitudeConfig;
use northing_evaluation::attitude::options::SensorSelection;
use northing_evaluation::attitude::outcome::NisOf;
use northing_recording::SensorKind;
use serde::Serialize;

use super::DeviceSession;
use super::intake::Intake;

/// A sensor is called stopped when the newest sample of the device is this much newer, s.
pub const STOPPED_S: f64 = 2.0;

/// A sensor that corrects the attitude.
#[derive(Debug)]
pub struct Aid {
    /// The sensor.
    pub sensor: SensorKind,
    /// What people call it.
    pub title: &'static str,
    /// Its name in [`SensorUse`](crate::messages::SensorUse).
    pub switch: &'static str,
    /// Standard deviations that make up its `R`; an estimator reads at most one of them.
    pub noise: &'static [&'static str],
    /// Its gate.
    pub gate: &'static str,
    /// Unit of its innovations.
    pub unit: &'static str,
    /// Whether it is missed where it is missing; another is shown once it has delivered.
    pub is_usual: bool,
    /// How long its errors are taken to last, s.
    pub correlation_time_s: fn(&AttitudeConfig<f64>) -> f64,
    /// Its part of what a run tells of each sensor.
    pub nis_mean: fn(&NisOf<f64>) -> Option<f64>,
    is_selected: fn(&SensorSelection, &Intake) -> bool,
}

/// Every one. A further sensor is a further row.
pub static AIDS: [Aid; 3] = [
    Aid {
        sensor: SensorKind::Accelerometer,
        title: "Accelerometer",
        switch: "accelerometer",
        noise: &["accelerometer_std"],
        gate: "accelerometer_gate_nis",
        unit: "m/s^2",
        is_usual: true,
        correlation_time_s: |config| config.accelerometer_correlation_time_s,
        nis_mean: |nis| nis.accelerometer,
        is_selected: |sensors, _| sensors.accelerometer,
    },
    Aid {
        sensor: SensorKind::Magnetometer,
        title: "Magnetometer",
        switch: "magnetometer",
        noise: &["magnetometer_std_ut", "bounded_magnetometer_std_ut"],
        gate: "magnetometer_gate_nis",
        unit: "microtesla",
        is_usual: true,
        correlation_time_s: |config| config.magnetometer_correlation_time_s,
        nis_mean: |nis| nis.magnetometer,
        is_selected: |sensors, _| sensors.magnetometer,
    },
    Aid {
        sensor: SensorKind::CompassHeading,
        title: "Compass",
        switch: "compass",
        noise: &["compass_std", "bounded_compass_std"],
        gate: "compass_gate_nis",
        unit: "rad",
        is_usual: false,
        correlation_time_s: |config| config.compass_correlation_time_s,
        nis_mean: |nis| nis.compass,
        is_selected: |sensors, intake| sensors.compass.applies(has_magnetometer(intake)),
    },
];

fn has_magnetometer(intake: &Intake) -> bool {
    use SensorKind::{Magnetometer, MagnetometerUncalibrated};
    [Magnetometer, MagnetometerUncalibrated]
        .iter()
        .any(|kind| intake.received_of(*kind) > 0)
}

/// Whether a sensor delivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Delivery {
    /// It does.
    Delivers,
    /// It did; the device's other sensors have gone on without it.
    Stopped,
    /// Nothing has ever come from it.
    Missing,
}

/// A sensor that estimators can use, as it is now.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SensorStatus {
    /// The sensor.
    pub sensor: SensorKind,
    /// Whether it delivers.
    pub delivery: Delivery,
    /// Whether its samples go to the estimators.
    pub is_used: bool,
    /// Why it does not deliver or is not used, in a sentence; empty when there is nothing to say.
    pub text: String,
}

impl DeviceSession {
    /// Whether samples of a sensor are measurements: by choice, or because there is nothing better.
    pub(super) fn uses(&self, aid: &Aid) -> bool {
        (aid.is_selected)(&self.options.sensors, &self.intake)
    }

    /// Whether a sensor delivers, by the device's time.
    pub(super) fn delivery(&self, sensor: SensorKind) -> Delivery {
        if self.intake.received_of(sensor) == 0 {
            Delivery::Missing
        } else if self.silence_s(sensor) > STOPPED_S {
            Delivery::Stopped
        } else {
            Delivery::Delivers
        }
    }

    /// How much newer the device's newest sample is than that of a sensor, s.
    pub(super) fn silence_s(&self, sensor: SensorKind) -> f64 {
        let last = self.intake.last_ns(sensor);
        last.map_or(0.0, |last| self.now_ns.saturating_sub(last) as f64 * 1e-9)
    }

    /// The gyroscope, which every estimator needs, and the sensors that correct it.
    pub(super) fn sensors(&self) -> Vec<SensorStatus> {
        let aids = AIDS
            .iter()
            .map(|aid| (aid.sensor, aid.title, self.uses(aid)));
        let gyroscope = (SensorKind::Gyroscope, "Gyroscope", true);
        std::iter::once(gyroscope)
            .chain(aids)
            .map(|(sensor, title, is_used)| SensorStatus {
                sensor,
                delivery: self.delivery(sensor),
                is_used,
                text: self.sensor_in_words(sensor, title, is_used),
            })
            .collect()
    }

    fn sensor_in_words(&self, sensor: SensorKind, title: &str, is_used: bool) -> String {
        match self.delivery(sensor) {
            Delivery::Missing if sensor == SensorKind::Magnetometer && self.browser => {
                "Magnetometer: this browser gives none; an app such as Sensor Logger does."
                    .to_owned()
            }
            Delivery::Missing => format!("{title}: this device sends no samples of it."),
            Delivery::Stopped => {
                let seconds = self.silence_s(sensor);
                format!("{title}: no sample for {seconds:.0} s.")
            }
            Delivery::Delivers if !is_used && self.is_automatic(sensor) => {
                format!("{title}: not used, as the magnetometer gives the heading.")
            }
            Delivery::Delivers if !is_used => format!("{title}: switched off."),
            Delivery::Delivers => String::new(),
        }
    }

    /// Whether nobody has chosen to use a sensor or to leave it out.
    fn is_automatic(&self, sensor: SensorKind) -> bool {
        use northing_evaluation::attitude::options::CompassUse;
        sensor == SensorKind::CompassHeading
            && self.options.sensors.compass == CompassUse::WithoutMagnetometer
    }
}
