//! Estimates as a file: CSV, Parquet, a TUM trajectory, or messages of ROS 2 in MCAP, by extension.
//!
//! CSV and Parquet have the same columns, with a unit in every name. Where there is nothing to say
//! (an estimator without covariance or bias) CSV has empty cells and Parquet NaN.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use northing_core::geometry::rotation;
use northing_recording::fixed::push_seconds;
#[cfg(feature = "mcap")]
use northing_recording::mcap::EstimateWriter;
#[cfg(feature = "parquet")]
use northing_recording::parquet_table::ParquetTable;
use northing_recording::shortest::push_shortest;
use northing_recording::{AtomicFile, RecordingError, TumWriter, WorldFrame, has_extension};

use crate::attitude::{EstimateRecord, EstimatorKind, RunObserver};
use crate::statistics::attitude_std::AttitudeStd;

type Result<T> = std::result::Result<T, RecordingError>;

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

/// What every file ends with: standard deviations of tilt and heading, and the covariance of the attitude's local error in
/// body axes.
const UNCERTAINTY_COLUMNS: [&str; 8] = [
    "tilt_std_rad",
    "heading_std_rad",
    "attitude_cov_xx_rad2",
    "attitude_cov_xy_rad2",
    "attitude_cov_xz_rad2",
    "attitude_cov_yy_rad2",
    "attitude_cov_yz_rad2",
    "attitude_cov_zz_rad2",
];

/// All columns there can be.
const MOST: usize = COLUMNS.len() + PLACE_COLUMNS.len() + UNCERTAINTY_COLUMNS.len();

/// Room for a row of usual numbers.
const MOST_BYTES: usize = 24 * (MOST + 1);

/// A file of estimates being written. It watches a run; what goes wrong is told at the end.
pub struct EstimateFile {
    output: Output,
    /// Whether it has the columns of the place.
    has_place: bool,
    /// The world of the recording.
    world: WorldFrame,
    failure: Option<RecordingError>,
}

enum Output {
    Csv(AtomicFile),
    Tum(TumWriter),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetTable>),
    #[cfg(feature = "mcap")]
    Mcap(Box<EstimateWriter>),
}

impl EstimateFile {
    /// Starts the file of an estimator.
    ///
    /// # Errors
    /// It exists, cannot be written, or has another extension.
    pub fn create(path: &Path, estimator: EstimatorKind, force: bool) -> Result<Self> {
        let has_place = estimator.uses_positions();
        let place = if has_place { &PLACE_COLUMNS[..] } else { &[] };
        let names = [&COLUMNS[..], place, &UNCERTAINTY_COLUMNS].concat();
        let output = if has_extension(path, "csv") {
            let mut file = AtomicFile::create(path, force)?;
            file.print(format_args!("t_s,{}\n", names.join(",")))?;
            Output::Csv(file)
        } else if has_extension(path, "tum") {
            Output::Tum(TumWriter::create(path, WorldFrame::Enu, force)?)
        } else if has_extension(path, "parquet") {
            create_parquet(path, &names, force)?
        } else if has_extension(path, "mcap") {
            create_mcap(path, force)?
        } else {
            return Err(unsupported(
                path,
                "estimates are written as .csv, .parquet, .tum or .mcap; name the output so",
            ));
        };
        Ok(Self {
            output,
            has_place,
            world: WorldFrame::Enu,
            failure: None,
        })
    }

    /// Says what the world of the recording is; before, it is east, north, up.
    pub fn set_world(&mut self, world: WorldFrame) {
        self.world = world;
        if let Output::Tum(writer) = &mut self.output {
            writer.set_world(world);
        }
    }

    fn write(&mut self, record: &EstimateRecord) -> Result<()> {
        match &mut self.output {
            Output::Csv(file) => write_csv(file, record, self.has_place),
            Output::Tum(writer) => {
                let position = record.position.unwrap_or_else(Vector3::zeros);
                writer.write(record.time_ns, &position, &record.attitude)
            }
            #[cfg(feature = "parquet")]
            Output::Parquet(table) => {
                let mut row = vec![record.time_ns as f64 * 1e-9];
                row.extend(numbers(record, self.has_place));
                table.row(&row)
            }
            #[cfg(feature = "mcap")]
            Output::Mcap(writer) => writer.write(&record.pose(self.world)),
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The first thing that went wrong while it was written.
    pub fn finish(self) -> Result<()> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        match self.output {
            Output::Csv(file) => file.commit(),
            Output::Tum(writer) => writer.finish(),
            #[cfg(feature = "parquet")]
            Output::Parquet(table) => table.finish(),
            #[cfg(feature = "mcap")]
            Output::Mcap(writer) => writer.finish(),
        }
    }
}

#[cfg(feature = "mcap")]
fn create_mcap(path: &Path, force: bool) -> Result<Output> {
    Ok(Output::Mcap(Box::new(EstimateWriter::create(path, force)?)))
}

#[cfg(not(feature = "mcap"))]
fn create_mcap(path: &Path, _: bool) -> Result<Output> {
    let problem = "this build cannot write MCAP; write .csv, or build with its default features";
    Err(unsupported(path, problem))
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
    let problem = "this build cannot write Parquet; write .csv, or build with its default features";
    Err(unsupported(path, problem))
}

/// An output that is none of those.
fn unsupported(path: &Path, problem: &str) -> RecordingError {
    RecordingError::Unsupported {
        file: path.display().to_string(),
        problem: problem.to_owned(),
    }
}

impl RunObserver for EstimateFile {
    fn estimate(&mut self, record: &EstimateRecord) {
        if self.failure.is_none() {
            self.failure = self.write(record).err();
        }
    }
}

fn write_csv(file: &mut AtomicFile, record: &EstimateRecord, has_place: bool) -> Result<()> {
    let mut row = Vec::with_capacity(MOST_BYTES);
    push_seconds(&mut row, record.time_ns);
    for value in numbers(record, has_place) {
        row.push(b',');
        if !value.is_nan() {
            push_shortest(&mut row, value);
        }
    }
    row.push(b'\n');
    file.bytes(&row)
}

/// The values of all columns, NaN where there are none.
fn numbers(record: &EstimateRecord, has_place: bool) -> Vec<f64> {
    let unknown = [f64::NAN; 3];
    let std = |p: &Matrix3<f64>| -> [f64; 3] { p.diagonal().map(|v| v.max(0.0).sqrt()).into() };
    let q = record.attitude;
    let covariance = record.attitude_covariance.as_ref();
    let attitude_std = covariance.map(|p| AttitudeStd::of(&q, p));
    let angles = rotation::to_yaw_pitch_roll(&q).map(f64::to_degrees);
    let bias = record.gyroscope_bias.map(|(bias, _)| bias.into());
    let bias_std = record.gyroscope_bias.map(|(_, p)| std(&p));
    let mut row = Vec::with_capacity(MOST);
    row.extend(rotation::to_wxyz(&q));
    for part in [attitude_std.map(|s| s.body), Some(angles), bias, bias_std] {
        row.extend(part.unwrap_or(unknown));
    }
    if has_place {
        let place = [record.position, record.velocity];
        row.extend(
            place
                .into_iter()
                .flat_map(|v| v.map_or(unknown, Into::into)),
        );
    }
    row.extend(attitude_std.map_or([f64::NAN; 2], |s| [s.tilt, s.heading]));
    let upper = |p: &Matrix3<f64>| [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|i| p[i]);
    row.extend(covariance.map_or([f64::NAN; 6], upper));
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
        assert_eq!(
            lines[0].len(),
            COLUMNS.len() + UNCERTAINTY_COLUMNS.len() + 1
        );
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
        let names = [PLACE_COLUMNS.join(","), UNCERTAINTY_COLUMNS.join(",")].join(",");
        assert!(lines[0].ends_with(&names), "{text}");
        let cells =
            |line: usize| -> Vec<&str> { lines[line].split(',').skip(17).take(6).collect() };
        assert_eq!(cells(0), PLACE_COLUMNS);
        assert_eq!(cells(1), [""; 6]);
        assert_eq!(cells(2), ["1", "-2", "3.5", "0.1", "0.2", "0.3"]);
        let text = written("e.tum");
        assert!(
            text.lines().nth(2).unwrap().starts_with("0.0 0 0 0 "),
            "{text}"
        );
        assert!(
            text.lines().nth(3).unwrap().starts_with("0.5 1 -2 3.5 "),
            "{text}"
        );
    }

    /// From the covariance of a row the standard deviations beside it follow, for a reader with the convention
    /// alone: body axes, turned into the world by the row's quaternion.
    #[test]
    fn tilt_and_heading_follow_from_the_covariance_of_the_row() {
        let root = Matrix3::new(0.01, 0.0, 0.0, 0.012, 0.02, 0.0, -0.004, 0.01, 0.03);
        let uncertain = EstimateRecord {
            attitude_covariance: Some(root * root.transpose()),
            ..record(0)
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("e.csv");
        let mut file = EstimateFile::create(&path, EstimatorKind::Mekf, false).unwrap();
        file.estimate(&uncertain);
        file.finish().unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let of = |name: &str| -> f64 {
            let column = lines[0].split(',').position(|n| n == name).unwrap();
            lines[1].split(',').nth(column).unwrap().parse().unwrap()
        };
        let cov = |axes: &str| of(&format!("attitude_cov_{axes}_rad2"));
        let p = Matrix3::new(
            cov("xx"),
            cov("xy"),
            cov("xz"),
            cov("xy"),
            cov("yy"),
            cov("yz"),
            cov("xz"),
            cov("yz"),
            cov("zz"),
        );
        let [w, x, y, z] = ["qw", "qx", "qy", "qz"].map(of);
        let q = rotation::from_wxyz([w, x, y, z]).unwrap();
        let r = q.to_rotation_matrix().into_inner();
        let world = r * p * r.transpose();
        assert!((of("heading_std_rad") - world[(2, 2)].sqrt()).abs() < 1e-12);
        let tilt = (world[(0, 0)] + world[(1, 1)]).sqrt();
        assert!((of("tilt_std_rad") - tilt).abs() < 1e-12);
        assert!((of("attitude_std_y_rad") - p[(1, 1)].sqrt()).abs() < 1e-12);
    }

    #[test]
    fn other_extensions_are_refused() {
        let error = EstimateFile::create(Path::new("e.txt"), EstimatorKind::Mekf, false)
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains(".csv, .parquet, .tum or .mcap"), "{error}");
    }

    #[test]
    fn every_column_is_documented() {
        let formats = include_str!("../../../../docs/formats.md");
        let names = COLUMNS.iter().chain(&PLACE_COLUMNS);
        for column in names.chain(&UNCERTAINTY_COLUMNS) {
            assert!(formats.contains(&format!("`{column}`")), "{column}");
        }
    }
}
