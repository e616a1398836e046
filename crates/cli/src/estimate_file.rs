//! Estimates as a file: CSV, Parquet, or a TUM trajectory, by extension.
//!
//! CSV and Parquet have the same columns, with a unit in every name. Where there is nothing to say
//! (an estimator without covariance or bias) CSV has empty cells and Parquet NaN.

use std::path::Path;

use anyhow::{Result, bail};
use northing_core::geometry::rotation;
use northing_core::nalgebra::{Matrix3, Vector3};
use northing_evaluation::observer::{EstimateRecord, RunObserver};
use northing_recording::{AtomicFile, TumWriter};

use crate::commands::convert::has_extension;
#[cfg(feature = "parquet")]
use crate::parquet_table::ParquetTable;

/// The numbers of a row after the time: attitude (body to world), its standard deviation in body
/// axes, the same attitude as angles, gyroscope bias and its standard deviation in body axes.
const COLUMNS: [&str; 16] = [
    "qw",
    "qx",
    "qy",
    "qz",
    "attitude_std_x_rad",
    "attitude_std_y_rad",
    "attitude_std_z_rad",
    "yaw_deg",
    "pitch_deg",
    "roll_deg",
    "gyro_bias_x_rad_s",
    "gyro_bias_y_rad_s",
    "gyro_bias_z_rad_s",
    "gyro_bias_std_x_rad_s",
    "gyro_bias_std_y_rad_s",
    "gyro_bias_std_z_rad_s",
];

/// A file of estimates being written. It watches a run; what goes wrong is told at the end.
pub(crate) struct EstimateFile {
    output: Output,
    failure: Option<anyhow::Error>,
}

enum Output {
    Csv(AtomicFile),
    Tum(TumWriter),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetTable>),
}

impl EstimateFile {
    /// Starts the file.
    ///
    /// # Errors
    /// It exists, cannot be written, or has another extension.
    pub(crate) fn create(path: &Path, force: bool) -> Result<Self> {
        let output = if has_extension(path, "csv") {
            let mut file = AtomicFile::create(path, force)?;
            file.print(format_args!("t_s,{}\n", COLUMNS.join(",")))?;
            Output::Csv(file)
        } else if has_extension(path, "tum") {
            Output::Tum(TumWriter::create(path, force)?)
        } else if has_extension(path, "parquet") {
            create_parquet(path, force)?
        } else {
            bail!(
                "{}: estimates are written as .csv, .parquet or .tum; name the output so",
                path.display()
            )
        };
        Ok(Self {
            output,
            failure: None,
        })
    }

    fn write(&mut self, record: &EstimateRecord) -> Result<()> {
        match &mut self.output {
            Output::Csv(file) => write_csv(file, record),
            Output::Tum(writer) => {
                Ok(writer.write(record.time_ns, &Vector3::zeros(), &record.attitude)?)
            }
            #[cfg(feature = "parquet")]
            Output::Parquet(table) => {
                let mut row = [0.0; COLUMNS.len() + 1];
                row[0] = record.time_ns as f64 * 1e-9;
                row[1..].copy_from_slice(&numbers(record));
                table.row(&row)
            }
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The first thing that went wrong while it was written.
    pub(crate) fn finish(self) -> Result<()> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        match self.output {
            Output::Csv(file) => Ok(file.commit()?),
            Output::Tum(writer) => Ok(writer.finish()?),
            #[cfg(feature = "parquet")]
            Output::Parquet(table) => table.finish(),
        }
    }
}

#[cfg(feature = "parquet")]
fn create_parquet(path: &Path, force: bool) -> Result<Output> {
    let names = std::iter::once("t_s").chain(COLUMNS);
    Ok(Output::Parquet(Box::new(ParquetTable::create(
        path, names, force,
    )?)))
}

#[cfg(not(feature = "parquet"))]
fn create_parquet(path: &Path, _: bool) -> Result<Output> {
    bail!(
        "{}: this build cannot write Parquet; write .csv, or build with its default features",
        path.display()
    )
}

impl RunObserver for EstimateFile {
    fn estimate(&mut self, record: &EstimateRecord) {
        if self.failure.is_none() {
            self.failure = self.write(record).err();
        }
    }
}

fn write_csv(file: &mut AtomicFile, record: &EstimateRecord) -> Result<()> {
    let sign = if record.time_ns < 0 { "-" } else { "" };
    let ns = record.time_ns.unsigned_abs();
    file.print(format_args!(
        "{sign}{}.{:09}",
        ns / 1_000_000_000,
        ns % 1_000_000_000
    ))?;
    for value in numbers(record) {
        if value.is_nan() {
            file.print(format_args!(","))?;
        } else {
            file.print(format_args!(",{value}"))?;
        }
    }
    Ok(file.print(format_args!("\n"))?)
}

/// The values of [`COLUMNS`], NaN where there are none.
fn numbers(record: &EstimateRecord) -> [f64; COLUMNS.len()] {
    let unknown = [f64::NAN; 3];
    let std = |p: &Matrix3<f64>| -> [f64; 3] { p.diagonal().map(|v| v.max(0.0).sqrt()).into() };
    let q = record.attitude;
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let attitude_std = record.attitude_covariance.as_ref().map_or(unknown, std);
    let angles = rotation::to_yaw_pitch_roll(&q).map(f64::to_degrees);
    let bias = record
        .gyroscope_bias
        .map_or(unknown, |(bias, _)| bias.into());
    let bias_std = record.gyroscope_bias.map_or(unknown, |(_, p)| std(&p));
    let mut row = [0.0; COLUMNS.len()];
    row[..4].copy_from_slice(&[q.w * sign, q.i * sign, q.j * sign, q.k * sign]);
    for (place, part) in row[4..]
        .chunks_exact_mut(3)
        .zip([attitude_std, angles, bias, bias_std])
    {
        place.copy_from_slice(&part);
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(time_ns: i64) -> EstimateRecord {
        EstimateRecord {
            time_ns,
            time_s: 0.0,
            attitude: rotation::from_yaw_pitch_roll([0.5, 0.1, -0.2]),
            attitude_covariance: Some(Matrix3::identity() * 1e-4),
            gyroscope_bias: None,
            reference: None,
            device: None,
        }
    }

    #[test]
    fn csv_has_every_column_and_empty_cells_for_what_is_unknown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("e.csv");
        let mut file = EstimateFile::create(&path, false).unwrap();
        file.estimate(&record(-1_500_000_000));
        file.finish().unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(lines[0].len(), COLUMNS.len() + 1);
        assert_eq!(lines[1].len(), lines[0].len());
        assert_eq!(lines[1][0], "-1.500000000");
        let yaw: f64 = lines[1][8].parse().unwrap();
        assert!((yaw - 0.5_f64.to_degrees()).abs() < 1e-9);
        assert_eq!((lines[1][5], lines[1][11]), ("0.01", ""));
    }

    #[test]
    fn other_extensions_are_refused() {
        let error = EstimateFile::create(Path::new("e.txt"), false)
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains(".csv, .parquet or .tum"), "{error}");
    }

    #[test]
    fn every_column_is_documented() {
        let formats = include_str!("../../../docs/formats.md");
        for column in COLUMNS {
            assert!(formats.contains(&format!("`{column}`")), "{column}");
        }
    }
}
