//! Estimates of a navigation run as a file: CSV or Parquet with every number, messages of ROS 2 in MCAP, or a track for maps,
//! by extension.

use std::path::{Path, PathBuf};

use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::rotation;
#[cfg(feature = "parquet")]
use northing_recording::device_navigation::validity_number;
use northing_recording::device_navigation::validity_word;
use northing_recording::fixed::{push_fixed, push_seconds};
#[cfg(feature = "mcap")]
use northing_recording::mcap::EstimateWriter;
#[cfg(feature = "parquet")]
use northing_recording::parquet_table::ParquetTable;
use northing_recording::track::{TrackPoint, check_track_path, write_track};
use northing_recording::{AtomicFile, RecordingError, has_extension};

use crate::navigation::{NavigationEstimate, NavigationObserver};

type Result<T> = std::result::Result<T, RecordingError>;

/// The columns of the CSV.
const COLUMNS: &str = "t_s,latitude_deg,longitude_deg,height_m,north_m,east_m,down_m,north_std_m,east_std_m,down_std_m,\
     velocity_north_m_s,velocity_east_m_s,velocity_down_m_s,qw,qx,qy,qz,heading_deg,heading_std_deg,validity";

/// Rows are written when there are so many bytes of them.
const ROWS_BYTES: usize = 1 << 16;

/// A track has a point so often, ns.
const TRACK_INTERVAL_NS: i64 = 100_000_000;

/// A file of estimates being written. It watches a run; what goes wrong is told at the end.
pub struct NavigationFile {
    output: Output,
    frame: Option<LocalFrame>,
    failure: Option<RecordingError>,
}

enum Output {
    /// Every number of every sample; rows that wait to be written.
    Csv(AtomicFile, Vec<u8>),
    /// The same as numbers alone.
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetTable>),
    /// Messages of every sample.
    #[cfg(feature = "mcap")]
    Mcap(Box<EstimateWriter>),
    /// A track for maps: written at the end.
    Track(PathBuf, bool, Vec<TrackPoint>),
}

impl NavigationFile {
    /// Starts the file.
    ///
    /// # Errors
    /// It exists, cannot be written, or has another extension.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        let output = if has_extension(path, "csv") {
            let mut file = AtomicFile::create(path, force)?;
            file.print(format_args!("{COLUMNS}\n"))?;
            Output::Csv(file, Vec::new())
        } else if has_extension(path, "parquet") {
            create_parquet(path, force)?
        } else if cfg!(feature = "mcap") && has_extension(path, "mcap") {
            create_mcap(path, force)?
        } else {
            check_track_path(path).map_err(of_estimates)?;
            // Starting the file is the test whether it can be written; dropped, it leaves nothing behind.
            AtomicFile::create(path, force)?;
            Output::Track(path.to_owned(), force, Vec::new())
        };
        Ok(Self {
            output,
            frame: None,
            failure: None,
        })
    }

    fn write(&mut self, estimate: &NavigationEstimate) -> Result<()> {
        let Some(frame) = &self.frame else {
            return Ok(());
        };
        match &mut self.output {
            Output::Csv(file, rows) => {
                push_row(rows, frame, estimate);
                if rows.len() >= ROWS_BYTES {
                    file.bytes(rows)?;
                    rows.clear();
                }
                Ok(())
            }
            #[cfg(feature = "parquet")]
            Output::Parquet(table) => table.row(&numbers(frame, estimate)),
            #[cfg(feature = "mcap")]
            Output::Mcap(writer) => writer.write(&estimate.pose(frame)),
            Output::Track(_, _, points) => {
                points.push(estimate.track_point());
                Ok(())
            }
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// Something went wrong on the way, or goes wrong now.
    pub fn finish(self, name: &str) -> Result<()> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        match self.output {
            Output::Csv(mut file, rows) => {
                file.bytes(&rows)?;
                file.commit()?;
            }
            #[cfg(feature = "parquet")]
            Output::Parquet(table) => table.finish()?,
            #[cfg(feature = "mcap")]
            Output::Mcap(writer) => writer.finish()?,
            Output::Track(path, force, points) => write_track(&path, name, &points, force)?,
        }
        Ok(())
    }
}

/// What is no track may be meant for something else.
fn of_estimates(error: RecordingError) -> RecordingError {
    match error {
        RecordingError::Unsupported { file, problem } => RecordingError::Unsupported {
            file,
            problem: format!(
                "estimates of a navigation run are a .csv, a .parquet or a track; {problem}"
            ),
        },
        other => other,
    }
}

#[cfg(feature = "parquet")]
fn create_parquet(path: &Path, force: bool) -> Result<Output> {
    let table = ParquetTable::create(path, COLUMNS.split(','), force)?;
    Ok(Output::Parquet(Box::new(table)))
}

#[cfg(not(feature = "parquet"))]
fn create_parquet(path: &Path, _: bool) -> Result<Output> {
    Err(RecordingError::Unsupported {
        file: path.display().to_string(),
        problem: "this build cannot write Parquet; write .csv, or build with its default features"
            .to_owned(),
    })
}

#[cfg(feature = "mcap")]
fn create_mcap(path: &Path, force: bool) -> Result<Output> {
    Ok(Output::Mcap(Box::new(EstimateWriter::create(path, force)?)))
}

#[cfg(not(feature = "mcap"))]
fn create_mcap(path: &Path, _: bool) -> Result<Output> {
    check_track_path(path)?;
    Err(RecordingError::Unsupported {
        file: path.display().to_string(),
        problem: "this build cannot write MCAP".to_owned(),
    })
}

/// The row of an estimate as numbers in the order of the columns; NaN where there is none.
#[cfg(feature = "parquet")]
fn numbers(first: &LocalFrame, estimate: &NavigationEstimate) -> Vec<f64> {
    let place = estimate.frame.geodetic(&estimate.position);
    let mut row = vec![estimate.time_ns as f64 * 1e-9];
    row.extend(place.degrees());
    row.push(place.height_m);
    row.extend(&estimate.in_frame(first).position);
    let variances = estimate.position_covariance.diagonal();
    row.extend(variances.iter().map(|variance| variance.max(0.0).sqrt()));
    row.extend(&estimate.velocity);
    let attitude = estimate.ned_from_body.as_ref().map(rotation::to_wxyz);
    row.extend(attitude.unwrap_or([f64::NAN; 4]));
    for angle in [estimate.heading(), estimate.heading_std] {
        row.push(angle.map_or(f64::NAN, f64::to_degrees));
    }
    row.push(f64::from(validity_number(estimate.validity)));
    row
}

/// Appends the row of an estimate: metres from the first origin, all else in the axes of where it is.
fn push_row(row: &mut Vec<u8>, first: &LocalFrame, estimate: &NavigationEstimate) {
    let place = estimate.frame.geodetic(&estimate.position);
    let variances = estimate.position_covariance.diagonal();
    push_seconds(row, estimate.time_ns);
    for degrees in place.degrees() {
        push_cell(row, degrees, 9);
    }
    push_cell(row, place.height_m, 4);
    for value in &estimate.in_frame(first).position {
        push_cell(row, *value, 4);
    }
    for variance in &variances {
        push_cell(row, variance.max(0.0).sqrt(), 4);
    }
    for value in &estimate.velocity {
        push_cell(row, *value, 4);
    }
    match estimate.ned_from_body {
        Some(attitude) => {
            for number in rotation::to_wxyz(&attitude) {
                push_cell(row, number, 7);
            }
        }
        None => row.extend_from_slice(b",,,,"),
    }
    for angle in [estimate.heading(), estimate.heading_std] {
        match angle {
            Some(angle) => push_cell(row, angle.to_degrees(), 4),
            None => row.push(b','),
        }
    }
    row.push(b',');
    row.extend_from_slice(validity_word(estimate.validity).as_bytes());
    row.push(b'\n');
}

/// A number after a comma.
fn push_cell(row: &mut Vec<u8>, value: f64, digits: usize) {
    row.push(b',');
    push_fixed(row, value, digits);
}

impl NavigationObserver for NavigationFile {
    /// Each sample, or what a map can show.
    fn interval_ns(&self) -> i64 {
        match self.output {
            Output::Track(..) => TRACK_INTERVAL_NS,
            _ => 0,
        }
    }

    fn origin(&mut self, frame: &LocalFrame) {
        self.frame = Some(*frame);
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        if self.failure.is_none() {
            self.failure = self.write(estimate).err();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_is_documented() {
        let formats = include_str!("../../../../docs/formats.md");
        for column in COLUMNS.split(',') {
            assert!(formats.contains(&format!("`{column}`")), "{column}");
        }
    }

    #[cfg(feature = "parquet")]
    #[test]
    fn the_numbers_are_those_of_the_rows_of_text() {
        use crate::navigation::navigator::tests::{estimate, frame};

        let mut row = Vec::new();
        push_row(&mut row, &frame(), &estimate(frame()));
        let text = String::from_utf8(row).unwrap();
        let cells: Vec<&str> = text.trim().split(',').collect();
        let numbers = numbers(&frame(), &estimate(frame()));
        assert_eq!(
            (cells.len(), numbers.len()),
            (20, COLUMNS.split(',').count())
        );
        for (cell, number) in cells.iter().zip(&numbers).take(19) {
            let cell: f64 = cell.parse().unwrap();
            assert!((cell - number).abs() < 1e-4, "{cell} {number}");
        }
        assert!((numbers[19] - 4.0).abs() < 1e-12);
    }
}
