//! Estimates of a navigation run as a file: CSV with every number, or a track for maps, by extension.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::rotation;
use northing_evaluation::navigation::{NavigationEstimate, NavigationObserver};
use northing_recording::AtomicFile;
use northing_recording::fixed::{push_fixed, push_seconds};
use northing_recording::track::{TrackPoint, check_track_path, write_track};

use super::has_extension;
use crate::validity_word;

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
    failure: Option<anyhow::Error>,
}

enum Output {
    /// Every number of every sample; rows that wait to be written.
    Csv(AtomicFile, Vec<u8>),
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
        } else {
            check_track_path(path)
                .context("estimates of a navigation run are a .csv or a track")?;
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
            Output::Track(_, _, points) => {
                points.push(track_point(estimate));
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
            Output::Track(path, force, points) => write_track(&path, name, &points, force)?,
        }
        Ok(())
    }
}

fn track_point(estimate: &NavigationEstimate) -> TrackPoint {
    let place = estimate.frame.geodetic(&estimate.position);
    let variances = estimate.position_covariance.diagonal();
    TrackPoint {
        time_ns: estimate.time_ns,
        latitude_rad: place.latitude_rad,
        longitude_rad: place.longitude_rad,
        height_m: place.height_m,
        std_m: Some(variances.map(|v| v.max(0.0).sqrt()).into()),
        attitude: estimate.ned_from_body,
    }
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
            Output::Csv(..) => 0,
            Output::Track(..) => TRACK_INTERVAL_NS,
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
