//! A calibration at rest under way: the samples of so many seconds, and what plots need of them.

use std::collections::BTreeMap;

use northing_core::calibration::{RestCalibration, Sensor};
use northing_core::nalgebra::Vector3;
use northing_evaluation::EvaluationError;
use northing_evaluation::attitude::calibrated_start::CalibrationPhase;
use northing_evaluation::attitude::instants::Instant;
use northing_evaluation::attitude::options::SensorSelection;
use northing_evaluation::statistics::thinned::Thinned;
use northing_recording::{Event, SensorKind};

use super::span::Span;
use crate::to_page::{self, Calibration, CalibrationState, ToPage};
use northing_evaluation::statistics::lamp::{Remark, Tone};

/// Points kept for the plot of one sensor.
const PLOT_POINTS: usize = 600;
/// Shortest and longest calibration, s.
pub const SECONDS: [f64; 2] = [1.0, 600.0];

/// The sensors of a calibration, in the order of [`CalibrationRun`]'s lists.
const SENSORS: [(SensorKind, Sensor); 3] = [
    (SensorKind::Gyroscope, Sensor::Gyroscope),
    (SensorKind::Accelerometer, Sensor::Accelerometer),
    (SensorKind::Magnetometer, Sensor::Magnetometer),
];
/// The steps to which browsers round: rad/s (0.1 deg/s), m/s^2, microtesla.
pub const BROWSER_STEPS: [(SensorKind, f64); 3] = [
    (SensorKind::Gyroscope, 0.1 / 180.0 * std::f64::consts::PI),
    (SensorKind::Accelerometer, 0.1),
    (SensorKind::Magnetometer, 0.01),
];

type Series = (SensorKind, Thinned<(f64, Vector3<f64>)>);

/// A calibration under way.
#[derive(Debug)]
pub struct CalibrationRun {
    phase: CalibrationPhase,
    /// How far it is.
    pub span: Span,
    series: [Series; 3],
    /// Known steps of gyroscope, accelerometer and magnetometer; zero where nothing is known.
    steps: [f64; 3],
}

impl CalibrationRun {
    /// Begins with the next sample.
    #[must_use]
    pub fn new(seconds: f64, sensors: SensorSelection) -> Self {
        let series = |kind| (kind, Thinned::new(PLOT_POINTS));
        Self {
            phase: CalibrationPhase::new(seconds, sensors),
            span: Span::new(seconds),
            steps: [0.0; 3],
            series: SENSORS.map(|(kind, _)| series(kind)),
        }
    }

    /// Takes one event. Returns whether it has seen enough.
    pub fn add(&mut self, event: &Event) -> bool {
        let time_ns = event.time_ns;
        self.span.begin(time_ns);
        let since = self.span.reach(time_ns).unwrap_or(time_ns);
        let (kind, vector) = (event.sample.kind(), event.sample.vector());
        let series = self.series.iter_mut().find(|(k, _)| *k == kind);
        if let (Some((_, series)), Some(vector)) = (series, vector) {
            let of = |wanted| (kind == wanted).then_some(vector);
            self.phase.add(&Instant {
                time_ns,
                angular_rate: of(SensorKind::Gyroscope),
                specific_force: of(SensorKind::Accelerometer),
                magnetic_field: of(SensorKind::Magnetometer),
                ..Instant::default()
            });
            let t_s = time_ns.saturating_sub(since) as f64 * 1e-9;
            series.push(|| (t_s, vector));
        }
        self.span.elapsed_s() >= self.span.seconds
    }

    /// How it is, or, once it is `made`, what it came to.
    #[must_use]
    pub fn message(
        &self,
        device: &str,
        made: Option<&Result<Box<RestCalibration<f64>>, String>>,
    ) -> ToPage {
        let (state, verdict) = match made {
            None => (CalibrationState::Running, None),
            Some(Ok(rest)) => (CalibrationState::Done, Some(self.accepted(rest))),
            Some(Err(reason)) => {
                let verdict = Remark::new(Tone::Bad, reason.as_str());
                (CalibrationState::Refused, Some(verdict))
            }
        };
        ToPage::Calibration(Box::new(Calibration {
            device: device.to_owned(),
            state,
            progress: self.span.progress(),
            remaining_s: self.span.remaining_s(),
            verdict,
            result: made.and_then(|made| made.as_deref().ok()).map(Into::into),
            samples: made.map(|_| self.samples()),
        }))
    }

    /// Says to which steps the sensors are known to be rounded; of several the coarsest counts.
    pub fn know_resolutions(&mut self, steps: &[(SensorKind, f64)]) {
        for (kind, step) in steps {
            let Some(index) = SENSORS.iter().position(|(k, _)| k == kind) else {
                continue;
            };
            self.steps[index] = self.steps[index].max(*step);
            self.phase
                .know_resolution(SENSORS[index].1, self.steps[index]);
        }
    }

    /// Says that the calibration is accepted, how well it is known, and what rounding hides.
    #[must_use]
    pub fn accepted(&self, calibration: &RestCalibration<f64>) -> Remark {
        let bias = calibration.gyroscope_bias().map(f64::to_degrees);
        let std = calibration.gyroscope_bias_std();
        let mut text = format!(
            "Accepted: the device was at rest. Gyroscope bias {:.3}, {:.3}, {:.3} deg/s, known to {:.4} deg/s.",
            bias.x,
            bias.y,
            bias.z,
            std.to_degrees()
        );
        let noise = calibration
            .gyroscope_std_rad_s
            .iter()
            .fold(0.0, |a: f64, b| a.max(*b))
            / f64::from(calibration.gyroscope_samples.max(1)).sqrt();
        let [gyroscope, accelerometer, _] = self.steps;
        if std > 2.0 * noise && gyroscope > 0.0 {
            let step = gyroscope.to_degrees();
            text.push_str(&format!(
                " The phone rounds to {step:.1} deg/s and lay stiller than that: a smaller bias cannot be seen, however long it rests."
            ));
            if self.phase.is_constant(Sensor::Gyroscope) {
                text.push_str(
                    " If its gyroscope still says the same when you turn it, it does not run.",
                );
            }
        }
        let hidden = calibration.specific_force_rounding_std();
        if let Some(gravity) = calibration.gravity().filter(|g| *g > 0.0)
            && hidden > 0.2 * accelerometer
            && accelerometer > 0.0
        {
            let tilt = (hidden / gravity).to_degrees();
            text.push_str(&format!(
                " It rounds accelerations to {accelerometer:.1} m/s^2: the tilt at the start is known to {tilt:.1} deg."
            ));
        }
        Remark::new(Tone::Good, text)
    }

    /// The calibration, or why there is none.
    ///
    /// # Errors
    /// The reason in a sentence.
    pub fn finish(&self) -> Result<RestCalibration<f64>, String> {
        self.phase.finish().map_err(|error| match error {
            EvaluationError::CalibrationRejected { reason, .. } => reason,
            other => other.to_string(),
        })
    }

    /// The samples, thinned, by sensor.
    #[must_use]
    pub fn samples(&self) -> BTreeMap<&'static str, to_page::Series> {
        let series = self.series.iter().map(|(kind, series)| {
            let items = series.items();
            let column = |of: fn(&(f64, Vector3<f64>)) -> f64| items.iter().map(of).collect();
            let columns = to_page::Series {
                t_s: column(|p| p.0),
                x: column(|p| p.1.x),
                y: column(|p| p.1.y),
                z: column(|p| p.1.z),
            };
            (kind.name(), columns)
        });
        series.filter(|(_, s)| !s.t_s.is_empty()).collect()
    }
}
