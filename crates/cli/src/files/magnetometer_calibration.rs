//! The file that `calibrate magnetometer` writes and `--magnetometer-calibration` reads.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use northing_evaluation::calibration::magnetometer::{
    MagnetometerReport, MagnetometerStreamCalibration,
};
use northing_evaluation::calibration::set::CalibrationSet;

use crate::files::toml_file::{self, in_comment};

/// The command that writes it.
const COMMAND: &str = "northing calibrate magnetometer";

/// The text of the file; `recording` is where it comes from.
pub(crate) fn to_toml(report: &MagnetometerReport, recording: &str) -> Result<String> {
    let values = toml::to_string(&report.field).context("calibration as TOML")?;
    let words: String = report
        .sentences
        .iter()
        .map(|sentence| format!("# {sentence}\n"))
        .collect();
    Ok(format!(
        "# Magnetometer calibration by `{COMMAND}`.\n\
         # Recording: {}\n{words}\
         # calibrated = soft_iron * (measured - hard_iron_ut), in the axes of the device, microtesla;\n\
         # `magnetometer` is the stream that it belongs to.\n\
         {values}",
        in_comment(recording)
    ))
}

/// Reads the file.
///
/// # Errors
/// It cannot be read, is no TOML, lacks something, or has numbers that no calibration can have.
pub(crate) fn read(path: &Path) -> Result<MagnetometerStreamCalibration> {
    checked(toml_file::read(path, COMMAND)?, &path.display().to_string())
}

/// Reads a folder of such files, for [`CalibrationSet`].
///
/// # Errors
/// As [`read`]; or there are none.
pub(crate) fn read_folder(folder: &Path) -> Result<CalibrationSet<MagnetometerStreamCalibration>> {
    toml_file::read_folder(folder, "magnetometer", COMMAND, read)
}

fn checked(
    field: MagnetometerStreamCalibration,
    file: &str,
) -> Result<MagnetometerStreamCalibration> {
    field
        .calibration
        .validate()
        .map_err(|error| anyhow!("{file}: {error}; calibrate again"))?;
    Ok(field)
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_core::calibration::MagnetometerLimits;
    use northing_core::nalgebra::Vector3;
    use northing_evaluation::calibration::magnetometer::FieldSamples;
    use northing_recording::{Event, Sample};

    fn report() -> MagnetometerReport {
        let mut samples = FieldSamples::default();
        for k in 0..1000_i64 {
            let z = 1.0 - 2.0 * (k as f64 + 0.5) / 1000.0;
            let (across, turn) = ((1.0 - z * z).sqrt(), 2.4 * k as f64);
            let field = Vector3::new(across * turn.cos(), across * turn.sin(), 1.1 * z) * 48.0;
            samples.add(&Event {
                time_ns: k * 20_000_000,
                sample: Sample::MagneticField(field + Vector3::new(30.0, -7.0, 2.0)),
            });
        }
        let limits = MagnetometerLimits::default();
        samples.calibrate(None, &limits).unwrap()
    }

    #[test]
    fn what_is_written_is_read_again() {
        let report = report();
        let text = to_toml(&report, "turned\n.csv").unwrap();
        assert!(text.contains("# Recording: turned?.csv\n"), "{text}");
        let read: MagnetometerStreamCalibration = toml_file::parse(&text, "f", COMMAND).unwrap();
        assert_eq!(checked(read, "f").unwrap(), report.field);
    }

    #[test]
    fn numbers_that_no_calibration_can_have_are_refused() {
        let mut field = report().field;
        field.calibration.soft_iron[0][1] = 0.5;
        let message = checked(field, "cal.toml").unwrap_err().to_string();
        let expected =
            "cal.toml: soft_iron must be a symmetric, positive definite matrix; calibrate again";
        assert_eq!(message, expected);
    }

    #[test]
    fn every_key_is_documented() {
        let formats = include_str!("../../../../docs/formats.md");
        let values = toml::Table::try_from(report().field).unwrap();
        let calibration = values["calibration"].as_table().unwrap();
        assert!(calibration.len() > 10);
        for key in calibration.keys().chain(values.keys()) {
            assert!(formats.contains(&format!("`{key}`")), "{key}");
        }
    }
}
