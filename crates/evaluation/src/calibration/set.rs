//! Calibrations of several devices and days, and which of them belongs to a recording.
//!
//! Hard iron changes with what lies in a pocket, a gyroscope's bias with the temperature: whoever records on many days
//! calibrates on each. A set holds one calibration a device and day by name, and a recording says its own two.

use northing_recording::Metadata;

use crate::error::EvaluationError;

/// Keys under which a recording names its device beside `device`, and its day.
const DEVICE_KEYS: [&str; 1] = ["phone"];
const DAY_KEYS: [&str; 2] = ["calibration_day", "day"];

/// Calibrations by name: anything that ends with the device, or with the device and the day.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationSet<C> {
    /// Where they are from, for messages: the folder.
    pub place: String,
    /// Each with its name, such as `magnetometer_iPhone5_d3`.
    pub named: Vec<(String, C)>,
}

impl<C> CalibrationSet<C> {
    /// The calibration of a recording's device and day, else one of its device that names no day; with
    /// its name.
    ///
    /// # Errors
    /// [`EvaluationError::NoCalibration`]: there is none, or the recording does not say its device.
    pub fn of(&self, metadata: &Metadata) -> Result<&(String, C), EvaluationError> {
        let extra = |key: &&str| metadata.extra.get(*key);
        let device = metadata.device.as_ref();
        let device = device.or_else(|| DEVICE_KEYS.iter().find_map(extra));
        let day = DAY_KEYS.iter().find_map(extra);
        let found = device.and_then(|device| {
            let of = |with_day: bool| {
                let mut named = self.named.iter();
                named.find(|(name, _)| belongs(name, device, day.filter(|_| with_day)))
            };
            day.and_then(|_| of(true)).or_else(|| of(false))
        });
        found.ok_or_else(|| self.missing(device, day))
    }

    fn missing(&self, device: Option<&String>, day: Option<&String>) -> EvaluationError {
        let wanted = match (device, day) {
            (None, _) => "a recording that does not say its device (key `device`)".to_owned(),
            (Some(device), None) => device.clone(),
            (Some(device), Some(day)) => format!("{device} on day {day}"),
        };
        let names: Vec<_> = self.named.iter().map(|(name, _)| name.as_str()).collect();
        EvaluationError::NoCalibration {
            wanted,
            place: self.place.clone(),
            named: names.join(", "),
        }
    }
}

/// Whether a name ends with the device and the day, upper and lower case being alike. The day in the
/// name may lack what the recording's day begins with: `d3` for `i5d3`.
fn belongs(name: &str, device: &str, day: Option<&String>) -> bool {
    let (name, device) = (name.to_lowercase(), device.to_lowercase());
    let Some((before, after)) = name.rsplit_once(device.as_str()) else {
        return false;
    };
    let is_word = !before.ends_with(char::is_alphanumeric) && !device.is_empty();
    let rest = after.trim_start_matches(|c: char| !c.is_alphanumeric());
    let fits = match day {
        None => after.is_empty(),
        Some(day) => {
            !rest.is_empty() && rest.len() < after.len() && day.to_lowercase().ends_with(rest)
        }
    };
    is_word && fits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(names: &[&str]) -> CalibrationSet<usize> {
        let named = names.iter().enumerate();
        CalibrationSet {
            place: "cal".to_owned(),
            named: named.map(|(k, name)| ((*name).to_owned(), k)).collect(),
        }
    }

    fn recording(device: Option<&str>, day: Option<&str>) -> Metadata {
        let mut metadata = Metadata::default();
        if let Some(device) = device {
            metadata.set("phone", device).unwrap();
        }
        if let Some(day) = day {
            metadata.set("calibration_day", day).unwrap();
        }
        metadata
    }

    #[test]
    fn device_and_day_choose_and_a_device_alone_stands_for_any_day() {
        let set = set(&[
            "calib_mag_iPhone5_d2",
            "calib_mag_iphone5_d3",
            "magnetometer-Pixel 7",
            "iPhone4S_d3",
        ]);
        let of = |device, day| set.of(&recording(Some(device), day)).ok().map(|c| c.1);
        assert_eq!(of("iPhone5", Some("i5d3")), Some(1));
        assert_eq!(of("iPhone5", Some("d2")), Some(0));
        assert_eq!(of("iPhone4S", Some("i4d3")), Some(3));
        assert_eq!(of("Pixel 7", Some("2026-05-01")), Some(2));
        assert_eq!(of("pixel 7", None), Some(2));
        for (device, day) in [
            ("iPhone5", Some("i5d1")),
            ("iPhone5", None),
            ("iPhone4", Some("i4d3")),
            ("Phone5", Some("d3")),
            ("", Some("d3")),
        ] {
            assert_eq!(of(device, day), None, "{device} {day:?}");
        }
        let mut named = recording(None, Some("d3"));
        named.set("device", "iPhone5").unwrap();
        assert_eq!(set.of(&named).unwrap().1, 1);
    }

    #[test]
    fn what_is_missing_is_named_with_what_there_is() {
        let set = set(&["a_iPhone5_d3", "b_Nexus5"]);
        let message = |device, day| set.of(&recording(device, day)).unwrap_err().to_string();
        let text = message(Some("iPhone5"), Some("i5d1"));
        assert!(
            text.contains("iPhone5 on day i5d1 in cal; there are a_iPhone5_d3, b_Nexus5"),
            "{text}"
        );
        assert!(message(None, None).contains("does not say its device"));
    }
}
