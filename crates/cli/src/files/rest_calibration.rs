//! The file that `calibrate rest` writes and `--calibration` reads: TOML, one value a line, units in
//! the names.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use northing_core::calibration::RestCalibration;
use northing_evaluation::calibration::set::CalibrationSet;

use crate::files::toml_file::{self, in_comment};
use northing_evaluation::calibration::rest::Calibrated;

/// The command that writes it.
const COMMAND: &str = "northing calibrate rest";

/// The text of a calibration file; `recording` is where it comes from.
pub(crate) fn to_toml(calibrated: &Calibrated, recording: &str) -> Result<String> {
    let [from_s, to_s] = calibrated.span_s;
    let values = toml::to_string(&calibrated.calibration).context("calibration as TOML")?;
    Ok(format!(
        "# Calibration at rest by `{COMMAND}`.\n\
         # Recording: {}\n\
         # Span: {from_s:.3} s to {to_s:.3} s after its first sample.\n\
         # Vectors are x, y, z in the axes of the device. `std` is the standard deviation of one sample,\n\
         # `bias_std` that of the bias; measured = true + bias + noise.\n\
         {values}",
        in_comment(recording)
    ))
}

/// Reads a calibration file.
///
/// # Errors
/// It cannot be read, is no TOML, or lacks something; the message names the line.
pub(crate) fn read(path: &Path) -> Result<RestCalibration<f64>> {
    let calibration = toml_file::read(path, COMMAND)?;
    checked(calibration, &path.display().to_string())
}

/// Reads a folder of such files, for [`CalibrationSet`].
///
/// # Errors
/// As [`read`]; or there are none.
pub(crate) fn read_folder(folder: &Path) -> Result<CalibrationSet<RestCalibration<f64>>> {
    toml_file::read_folder(folder, "gyroscope_bias_rad_s", COMMAND, read)
}

fn checked(calibration: RestCalibration<f64>, file: &str) -> Result<RestCalibration<f64>> {
    check(&calibration).map_err(|name| {
        anyhow!("{file}: `{name}` is not a finite number that makes sense; calibrate again")
    })?;
    Ok(calibration)
}

/// Refuses numbers that no calibration can have.
fn check(calibration: &RestCalibration<f64>) -> Result<(), &'static str> {
    let finite = |v: &[f64; 3]| v.iter().all(|x| x.is_finite());
    let std = |v: &[f64; 3]| v.iter().all(|x| x.is_finite() && *x >= 0.0);
    let c = calibration;
    let vectors = [
        ("gyroscope_bias_rad_s", Some(c.gyroscope_bias_rad_s)),
        ("specific_force_m_s2", c.specific_force_m_s2),
        ("magnetic_field_ut", c.magnetic_field_ut),
    ];
    let stds = [
        ("gyroscope_bias_std_rad_s", Some(c.gyroscope_bias_std_rad_s)),
        ("gyroscope_std_rad_s", Some(c.gyroscope_std_rad_s)),
        ("accelerometer_std_m_s2", c.accelerometer_std_m_s2),
        ("magnetometer_std_ut", c.magnetometer_std_ut),
        (
            "specific_force_rounding_std_m_s2",
            c.specific_force_rounding_std_m_s2,
        ),
        (
            "magnetic_field_rounding_std_ut",
            c.magnetic_field_rounding_std_ut,
        ),
    ];
    let bad_vector = vectors
        .iter()
        .find(|(_, v)| v.as_ref().is_some_and(|v| !finite(v)));
    let bad_std = stds
        .iter()
        .find(|(_, v)| v.as_ref().is_some_and(|v| !std(v)));
    bad_vector.or(bad_std).map_or(Ok(()), |(name, _)| Err(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::calibration::magnetometer::MagnetometerSource;
    use northing_evaluation::calibration::rest::{Span, calibrate};
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    fn calibrated() -> Calibrated {
        let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
        calibrate(
            phone.events().map(Ok),
            Span::default(),
            Some(MagnetometerSource::Device),
        )
        .unwrap()
    }

    fn parse(text: &str, file: &str) -> Result<RestCalibration<f64>> {
        checked(toml_file::parse(text, file, COMMAND)?, file)
    }

    #[test]
    fn what_is_written_is_read_again() {
        let calibrated = calibrated();
        let text = to_toml(&calibrated, "lab.csv").unwrap();
        assert_eq!(parse(&text, "f").unwrap(), calibrated.calibration);
    }

    #[test]
    fn errors_name_the_line_and_what_was_expected() {
        let text = to_toml(&calibrated(), "lab.csv").unwrap();
        let message = |text: &str| parse(text, "f.toml").unwrap_err().to_string();
        let unknown = message(&format!("bias = 1\n{text}"));
        assert!(
            unknown.starts_with("f.toml, line 1: unknown field `bias`"),
            "{unknown}"
        );
        assert!(message("").contains("missing field"));
        assert!(message("a b").contains("northing calibrate rest"));
        let bad = text.replace(
            "gyroscope_bias_rad_s = [",
            "gyroscope_bias_rad_s = [nan, 0, 0] #",
        );
        assert!(
            message(&bad).contains("`gyroscope_bias_rad_s`"),
            "{}",
            message(&bad)
        );
    }

    #[test]
    fn every_key_is_documented() {
        let formats = include_str!("../../../../docs/formats.md");
        let values = toml::Table::try_from(calibrated().calibration).unwrap();
        assert!(values.len() > 10);
        for key in values.keys() {
            assert!(formats.contains(&format!("`{key}`")), "{key}");
        }
    }
}
