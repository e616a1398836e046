//! Magnetometer calibration of a recording: from its samples, in words, and applied to its events.
//!
//! Read first: [`northing_core::calibration::magnetometer`], which fits; here are the choice of the
//! stream, the explanation, and what a run does with the outcome.

use nalgebra::Vector3;
use northing_core::calibration::magnetometer::coverage::{CELLS, cell_of};
use northing_core::calibration::magnetometer::{MagnetometerModel, calibrate};
use northing_core::calibration::{MagnetometerCalibration, MagnetometerLimits};
use northing_recording::{Event, Sample};
use serde::{Deserialize, Serialize};

use crate::error::EvaluationError;
use crate::statistics::seconds_between;

/// Hard iron whose standard deviation is above this share of the field is called uncertain.
const UNCERTAIN: f64 = 0.02;

crate::named! {
    /// Which magnetometer stream is used.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
    #[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
    #[serde(rename_all = "kebab-case")]
    pub enum MagnetometerSource {
        /// As the device calibrated it.
        #[default]
        Device = "device",
        /// Without the device's calibration: hard iron of the device included.
        Uncalibrated = "uncalibrated",
    }
}

/// A magnetometer calibration and the stream that it belongs to: what a calibration file holds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MagnetometerStreamCalibration {
    /// The stream it was made from, and is applied to.
    pub magnetometer: MagnetometerSource,
    /// `calibrated = soft_iron * (measured - hard_iron)`.
    pub calibration: MagnetometerCalibration<f64>,
}

impl MagnetometerStreamCalibration {
    /// The event with its field calibrated; events of other sensors, and of the other
    /// magnetometer, stay as they are.
    #[must_use]
    pub fn apply(&self, mut event: Event) -> Event {
        match (&mut event.sample, self.magnetometer) {
            (Sample::MagneticField(field), MagnetometerSource::Device)
            | (Sample::MagneticFieldUncalibrated(field), MagnetometerSource::Uncalibrated) => {
                *field = self.calibration.apply(field);
            }
            _ => {}
        }
        event
    }
}

/// The field's samples of a recording, both streams, with their times.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FieldSamples {
    first_ns: Option<i64>,
    device: Vec<(f64, Vector3<f64>)>,
    uncalibrated: Vec<(f64, Vector3<f64>)>,
}

/// What a recording of a device that was turned about tells about its magnetometer.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnetometerReport {
    /// The calibration, ready to be applied.
    pub field: MagnetometerStreamCalibration,
    /// Time from the first to the last sample of the magnetometer, s.
    pub duration_s: f64,
    /// Samples that fell into each cell of the sphere, about the hard iron; the order is that of
    /// [`northing_core::calibration::magnetometer::coverage`].
    pub cells: [u32; CELLS],
    /// All of this in words, the most important first.
    pub sentences: Vec<String>,
    /// Seconds since the recording's first sample, and the field as measured, microtesla.
    pub samples: Vec<(f64, Vector3<f64>)>,
}

impl FieldSamples {
    /// Takes an event of any sensor.
    pub fn add(&mut self, event: &Event) {
        let first_ns = *self.first_ns.get_or_insert(event.time_ns);
        let time_s = seconds_between(first_ns, event.time_ns);
        match event.sample {
            Sample::MagneticField(field) => self.device.push((time_s, field)),
            Sample::MagneticFieldUncalibrated(field) => self.uncalibrated.push((time_s, field)),
            _ => {}
        }
    }

    /// The stream to calibrate: the one asked for, otherwise the uncalibrated one where there is one.
    fn chosen(&self, asked: Option<MagnetometerSource>) -> MagnetometerSource {
        asked.unwrap_or(match self.uncalibrated.is_empty() {
            true => MagnetometerSource::Device,
            false => MagnetometerSource::Uncalibrated,
        })
    }

    /// Fits the calibration; `asked` names the stream.
    ///
    /// # Errors
    /// [`EvaluationError::NoMagnetometer`] without samples of it,
    /// [`EvaluationError::MagnetometerStreamCalibration`] with the reason and what to do.
    pub fn calibrate(
        self,
        asked: Option<MagnetometerSource>,
        limits: &MagnetometerLimits<f64>,
    ) -> Result<MagnetometerReport, EvaluationError> {
        let magnetometer = self.chosen(asked);
        let has_both = !self.device.is_empty() && !self.uncalibrated.is_empty();
        let samples = match magnetometer {
            MagnetometerSource::Device => self.device,
            MagnetometerSource::Uncalibrated => self.uncalibrated,
        };
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
            return Err(EvaluationError::NoMagnetometer {
                stream: magnetometer.name(),
            });
        };
        let duration_s = last.0 - first.0;
        let calibration = calibrate(&samples.iter().map(|(_, field)| *field), limits)
            .map_err(|reason| EvaluationError::MagnetometerStreamCalibration(reason.to_string()))?;
        let mut cells = [0_u32; CELLS];
        for (_, field) in &samples {
            let cell = cell_of(&(field - calibration.hard_iron()));
            if let Some(count) = cell.and_then(|cell| cells.get_mut(cell)) {
                *count += 1;
            }
        }
        let mut sentences = sentences(&calibration, duration_s);
        if has_both && magnetometer == MagnetometerSource::Device {
            sentences.push(
                "The device calibrates this stream itself, perhaps while you turned it; the recording has an \
                 uncalibrated one, which is the better choice."
                    .to_owned(),
            );
        }
        Ok(MagnetometerReport {
            field: MagnetometerStreamCalibration {
                magnetometer,
                calibration,
            },
            duration_s,
            cells,
            sentences,
            samples,
        })
    }
}

/// The calibration explained, the most important first.
fn sentences(c: &MagnetometerCalibration<f64>, duration_s: f64) -> Vec<String> {
    let model = match c.model {
        MagnetometerModel::Ellipsoid => "hard and soft iron, an ellipsoid",
        MagnetometerModel::Sphere => "hard iron alone, a sphere",
    };
    let mut sentences = vec![
        format!(
            "Accepted: {model}, from {} samples in {duration_s:.0} s; {:.0} % of all directions were seen.",
            c.samples,
            100.0 * c.coverage
        ),
        format!(
            "The strength of the field scattered by {:.2} uT before and scatters by {:.2} uT after it: \
             {:.1} % of its {:.1} uT.",
            c.uncalibrated_norm_std_ut,
            c.residual_std_ut,
            100.0 * c.residual_std_ut / c.radius_ut,
            c.radius_ut
        ),
    ];
    let worst = c.hard_iron_std_ut.iter().copied().fold(0.0, f64::max);
    let remark = if worst > UNCERTAIN * c.radius_ut {
        "; turn the device through more directions to know it better"
    } else {
        ""
    };
    sentences.push(format!(
        "The hard iron is {:.1} uT, known to {worst:.2} uT in its worst axis{remark}.",
        c.hard_iron().norm()
    ));
    if c.model == MagnetometerModel::Sphere {
        sentences.push(
            "Soft iron is not calibrated: for that, turn the device until the coverage has no large gap."
                .to_owned(),
        );
    }
    if c.rejected_samples > 0 {
        sentences.push(format!(
            "{} samples lay far off the surface and are left out.",
            c.rejected_samples
        ));
    }
    if c.ignored_samples > 0 {
        sentences.push(format!(
            "{} samples repeated the one before or were no measurement.",
            c.ignored_samples
        ));
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use northing_simulation::random::{normal_vector, stream};

    const HARD_IRON: Vector3<f64> = Vector3::new(120.0, -40.0, 15.0);

    fn soft_iron() -> Matrix3<f64> {
        Matrix3::new(1.06, 0.03, 0.0, 0.03, 0.95, -0.02, 0.0, -0.02, 1.0)
    }

    /// Directions spread evenly over the sphere, 48 microtesla, noise of 0.3.
    fn events(share: f64, make: fn(Vector3<f64>) -> Sample) -> impl Iterator<Item = Event> {
        let mut noise = stream(5, "field");
        (0..2000_i64).map(move |k| {
            let z = 1.0 - 2.0 * share * (k as f64 + 0.5) / 2000.0;
            let (across, turn) = ((1.0 - z * z).sqrt(), 2.4 * k as f64);
            let field = Vector3::new(across * turn.cos(), across * turn.sin(), z) * 48.0;
            let measured = soft_iron() * field + HARD_IRON + normal_vector(&mut noise, 0.3);
            Event {
                time_ns: k * 20_000_000,
                sample: make(measured),
            }
        })
    }

    fn gathered(share: f64) -> FieldSamples {
        let mut samples = FieldSamples::default();
        events(share, Sample::MagneticFieldUncalibrated).for_each(|event| samples.add(&event));
        samples
    }

    fn report(
        share: f64,
        asked: Option<MagnetometerSource>,
    ) -> Result<MagnetometerReport, EvaluationError> {
        gathered(share).calibrate(asked, &MagnetometerLimits::default())
    }

    #[test]
    fn iron_is_found_and_taken_away() {
        let report = report(1.0, None).unwrap();
        assert_eq!(report.field.magnetometer, MagnetometerSource::Uncalibrated);
        let c = &report.field.calibration;
        assert!((c.hard_iron() - HARD_IRON).norm() < 0.1, "{c:?}");
        // Up to a rotation and the scale: the product is orthogonal.
        let product = c.soft_iron() * soft_iron();
        let scale = product.determinant().cbrt();
        let orthogonal = product * product.transpose() / (scale * scale);
        assert!(
            (orthogonal - Matrix3::identity()).amax() < 5e-3,
            "{orthogonal}"
        );
        assert!((report.duration_s - 39.98).abs() < 1e-9);
        assert_eq!(report.cells.iter().sum::<u32>(), 2000);
        let raw = events(1.0, Sample::MagneticFieldUncalibrated)
            .next()
            .unwrap();
        let other = events(1.0, Sample::MagneticField).next().unwrap();
        let Sample::MagneticFieldUncalibrated(field) = report.field.apply(raw).sample else {
            panic!("another sensor");
        };
        assert!((field.norm() - c.field_strength_ut).abs() < 1.5);
        assert_eq!(report.field.apply(other), other, "the other stream");
    }

    #[test]
    fn words_say_what_was_found_and_what_was_not() {
        let whole = report(1.0, None).unwrap().sentences.join(" ");
        assert!(
            whole.starts_with(
                "Accepted: hard and soft iron, an ellipsoid, from 2000 samples in 40 s; "
            ),
            "{whole}"
        );
        assert!(whole.contains("The hard iron is 127."), "{whole}");
        assert!(!whole.contains("Soft iron is not"), "{whole}");
        // More than half is asked for here before soft iron is accepted.
        let limits = MagnetometerLimits {
            ellipsoid_coverage: 0.9,
            ..MagnetometerLimits::default()
        };
        let part = gathered(0.6).calibrate(None, &limits).unwrap();
        let part = part.sentences.join(" ");
        assert!(part.contains("hard iron alone, a sphere"), "{part}");
        assert!(part.contains("Soft iron is not calibrated"), "{part}");
    }

    #[test]
    fn a_stream_that_is_not_there_and_half_a_view_are_refused() {
        let missing = report(1.0, Some(MagnetometerSource::Device));
        let text = missing.unwrap_err().to_string();
        assert!(
            text.contains("no samples of the magnetometer `device`"),
            "{text}"
        );
        let text = report(0.2, None).unwrap_err().to_string();
        assert!(
            text.contains("turn the device through more directions"),
            "{text}"
        );
    }
}
