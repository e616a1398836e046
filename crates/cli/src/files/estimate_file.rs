//! Estimates as a file: CSV, Parquet, or a TUM trajectory, by extension.
//!
//! CSV and Parquet have the same columns, with a unit in every name. Where there is nothing to say
//! (an estimator without covariance or bias) CSV has empty cells and Parquet NaN.

use std::path::Path;

use anyhow::{Result, bail};
use northing_core::geometry::rotation;
use northing_core::nalgebra::{Matrix3, Vector3};
use northing_evaluation::attitude::{EstimateRecord, EstimatorKind, RunObserver};
use northing_recording::{AtomicFile, TumWriter};

use crate::files::has_extension;
#[cfg(feature = "parquet")]
use crate::files::parquet_table::ParquetTable;

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

/// What follows for estimators that use positions: position and velocity, world frame.
const PLACE_COLUMNS: [&str; 6] = [
    "pos_x_m",
    "pos_y_m",
    "pos_z_m",
    "vel_x_m_s",
    "vel_y_m_s",
    "vel_z_m_s",
];

/// All columns there can be.
const MOST: usize = COLUMNS.len() + PLACE_COLUMNS.len();

/// A file of estimates being written. It watches a run; what goes wrong is told at the end.
pub(crate) struct EstimateFile {
    output: Output,
    /// How many of the columns there can be it has.
    columns: usize,
    failure: Option<anyhow::Error>,
}

enum Output {
    Csv(AtomicFile),
    Tum(TumWriter),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetTable>),
}

impl EstimateFile {
    /// Starts the file of an estimator.
    ///
    /// # Errors
    /// It exists, cannot be written, or has another extension.
    pub(crate) fn create(path: &Path, estimator: EstimatorKind, force: bool) -> Result<Self> {
        let place = if estimator.uses_positions() {
            &PLACE_COLUMNS[..]
        } else {
            &[]
        };
        let names = [&COLUMNS[..], place].concat();
        let output = if has_extension(path, "csv") {
            let mut file = AtomicFile::create(path, force)?;
            file.print(format_args!("t_s,{}\n", names.join(",")))?;
            Output::Csv(file)
        } else if has_extension(path, "tum") {
            Output::Tum(TumWriter::create(path, force)?)
        } else if has_extension(path, "parquet") {
            create_parquet(path, &names, force)?
        } else {
            bail!(
                "{}: estimates are written as .csv, .parquet or .tum; name the output so",
                path.display()
            )
        };
        Ok(Self {
            output,
            columns: names.len(),
            failure: None,
        })
    }

    fn write(&mut self, record: &EstimateRecord) -> Result<()> {
        match &mut self.output {
            Output::Csv(file) => write_csv(file, record, self.columns),
            Output::Tum(writer) => {
                let position = record.position.unwrap_or_else(Vector3::zeros);
                Ok(writer.write(record.time_ns, &position, &record.attitude)?)
            }
            #[cfg(feature = "parquet")]
            Output::Parquet(table) => {
                let mut row = [0.0; MOST + 1];
                row[0] = record.time_ns as f64 * 1e-9;
                row[1..].copy_from_slice(&numbers(record));
                table.row(&row[..=self.columns])
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
fn create_parquet(path: &Path, names: &[&str], force: bool) -> Result<Output> {
    let names = std::iter::once("t_s").chain(names.iter().copied());
    Ok(Output::Parquet(Box::new(ParquetTable::create(
        path, names, force,
    )?)))
}

#[cfg(not(feature = "parquet"))]
fn create_parquet(path: &Path, _: &[&str], _: bool) -> Result<Output> {
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

fn write_csv(file: &mut AtomicFile, record: &EstimateRecord, columns: usize) -> Result<()> {
    let sign = if record.time_ns < 0 { "-" } else { "" };
    let ns = record.time_ns.unsigned_abs();
    file.print(format_args!(
        "{sign}{}.{:09}",
        ns / 1_000_000_000,
        ns % 1_000_000_000
    ))?;
    for value in &numbers(record)[..columns] {
        if value.is_nan() {
            file.print(format_args!(","))?;
        } else {
            file.print(format_args!(",{value}"))?;
        }
    }
    Ok(file.print(format_args!("\n"))?)
}

/// The values of all columns, NaN where there are none.
fn numbers(record: &EstimateRecord) -> [f64; MOST] {
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
    let place = [record.position, record.velocity].map(|v| v.map_or(unknown, Into::into));
    let mut row = [0.0; MOST];
    row[..4].copy_from_slice(&[q.w * sign, q.i * sign, q.j * sign, q.k * sign]);
    for (place, part) in
        row[4..]
            .chunks_exact_mut(3)
            .zip([attitude_std, angles, bias, bias_std, place[0], place[1]])
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
            position: None,
            velocity: None,
            reference: None,
            device: None,
        }
    }

    #[test]
    fn csv_has_every_column_and_empty_cells_for_what_is_unknown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("e.csv");
        let mut file = EstimateFile::create(&path, EstimatorKind::Mekf, false).unwrap();
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
    fn position_and_velocity_have_columns_where_the_estimator_has_them() {
        let folder = tempfile::tempdir().unwrap();
        let with_place = EstimateRecord {
            position: Some(Vector3::new(1.0, -2.0, 3.5)),
            velocity: Some(Vector3::new(0.1, 0.2, 0.3)),
            ..record(500_000_000)
        };
        let written = |name: &str| {
            let path = folder.path().join(name);
            let mut file = EstimateFile::create(&path, EstimatorKind::Cascade, false).unwrap();
            file.estimate(&record(0));
            file.estimate(&with_place);
            file.finish().unwrap();
            std::fs::read_to_string(path).unwrap()
        };
        let text = written("e.csv");
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].ends_with(&PLACE_COLUMNS.join(",")), "{text}");
        assert!(lines[1].ends_with(",,,,,,"), "{text}");
        assert!(lines[2].ends_with(",1,-2,3.5,0.1,0.2,0.3"), "{text}");
        let text = written("e.tum");
        assert!(
            text.lines().nth(1).unwrap().starts_with("0.0 0 0 0 "),
            "{text}"
        );
        assert!(
            text.lines().nth(2).unwrap().starts_with("0.5 1 -2 3.5 "),
            "{text}"
        );
    }

    #[test]
    fn other_extensions_are_refused() {
        let error = EstimateFile::create(Path::new("e.txt"), EstimatorKind::Mekf, false)
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains(".csv, .parquet or .tum"), "{error}");
    }

    #[test]
    fn every_column_is_documented() {
        let formats = include_str!("../../../../docs/formats.md");
        for column in COLUMNS.iter().chain(&PLACE_COLUMNS) {
            assert!(formats.contains(&format!("`{column}`")), "{column}");
        }
    }
}
