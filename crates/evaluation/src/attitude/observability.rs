//! Observability: what a choice of sensors cannot determine, in words.

use crate::attitude::SensorSelection;
use crate::calibration::magnetometer::MagnetometerSource;

/// Which sensors gave samples that were usable, among those chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Present {
    /// At least one accelerometer sample.
    pub accelerometer: bool,
    /// At least one magnetometer sample.
    pub magnetometer: bool,
    /// At least one sample of the magnetometer stream that was not chosen.
    pub other_magnetometer: bool,
    /// At least one compass heading that was used.
    pub compass: bool,
}

/// What cannot be observed, one sentence each; empty when all can.
#[must_use]
pub fn unobservable(present: Present, chosen: &SensorSelection) -> Vec<String> {
    let mut sentences = Vec::new();
    let why = |chosen: bool, sensor: &str| {
        if chosen {
            format!("The recording has no usable {sensor}")
        } else {
            format!("The {sensor} is left out")
        }
    };
    if !present.accelerometer {
        let reason = why(chosen.accelerometer, "accelerometer");
        sentences.push(format!(
            "{reason}: nothing says where up is, so the tilt is unknown at the start and drifts, \
             and the whole attitude is relative to the first instant."
        ));
    }
    if !present.magnetometer && !present.compass {
        let reason = if chosen.magnetometer && present.other_magnetometer {
            other_stream(chosen.magnetometer_source).to_owned()
        } else {
            why(chosen.magnetometer, "magnetometer")
        };
        sentences.push(format!(
            "{reason}: nothing says where north is, so the heading is arbitrary at the start and \
             drifts with the gyroscope bias about the vertical, which is not observable either \
             unless the device is tilted in turn."
        ));
    }
    if present.magnetometer && !present.accelerometer {
        sentences.push(
            "The magnetometer alone is not used without an accelerometer: the direction of the \
             field in the world is only known from gravity."
                .to_owned(),
        );
    }
    sentences
}

/// The stream that was asked for is not there, the other one is: what to do.
const fn other_stream(chosen: MagnetometerSource) -> &'static str {
    match chosen {
        MagnetometerSource::Device => {
            "The recording has an uncalibrated magnetometer alone, whose offset nobody knows, and it is \
             not used (calibrate it with `northing calibrate magnetometer`, or take it as it is with \
             --magnetometer uncalibrated)"
        }
        MagnetometerSource::Uncalibrated => {
            "The recording has no usable uncalibrated magnetometer (it has the device's own: \
             --magnetometer device)"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_missing_sensor_is_named_with_what_it_takes_along() {
        let chosen = SensorSelection::default();
        let all = Present {
            accelerometer: true,
            magnetometer: true,
            other_magnetometer: false,
            compass: false,
        };
        assert!(unobservable(all, &chosen).is_empty());
        let no_field = Present {
            magnetometer: false,
            ..all
        };
        let sentences = unobservable(no_field, &chosen);
        assert_eq!(sentences.len(), 1);
        assert!(sentences[0].starts_with("The recording has no usable magnetometer: nothing says"));
        let other = Present {
            other_magnetometer: true,
            ..no_field
        };
        assert!(unobservable(other, &chosen)[0].contains("uncalibrated magnetometer alone"));
        let raw = SensorSelection {
            magnetometer_source: MagnetometerSource::Uncalibrated,
            ..chosen
        };
        let sentences = unobservable(other, &raw);
        assert!(
            sentences[0].contains("--magnetometer device): nothing says"),
            "{sentences:?}"
        );
        let with_compass = Present {
            compass: true,
            ..no_field
        };
        assert!(unobservable(with_compass, &chosen).is_empty());
        let left_out = SensorSelection {
            magnetometer: false,
            ..chosen
        };
        assert!(unobservable(no_field, &left_out)[0].starts_with("The magnetometer is left out"));
        assert_eq!(unobservable(Present::default(), &chosen).len(), 2);
        let only_field = Present {
            magnetometer: true,
            ..Present::default()
        };
        assert!(unobservable(only_field, &chosen)[1].contains("not used without"));
    }
}
