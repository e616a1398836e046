//! Estimates of a navigation run as a file: CSV with every number, or a track for maps, by extension.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::rotation;
use northing_evaluation::navigation::{NavigationEstimate, NavigationObserver};
use northing_evaluation::report::validity_word;
use northing_recording::AtomicFile;
use northing_recording::track::{TrackPoint, check_track_path, write_track};

use crate::commands::convert::has_extension;
use crate::output::check_free;

/// The columns of the CSV.
const COLUMNS: &str = "t_s,latitude_deg,longitude_deg,height_m,north_m,east_m,down_m,north_std_m,east_std_m,down_std_m,\
     velocity_north_m_s,velocity_east_m_s,velocity_down_m_s,qw,qx,qy,qz,heading_deg,heading_std_deg,validity";

/// A track has a point so often, ns.
const TRACK_INTERVAL_NS: i64 = 100_000_000;

/// A file of estimates being written. It watches a run; what goes wrong is told at the end.
pub(crate) struct NavigationFile {
    output: Output,
    frame: Option<LocalFrame>,
    failure: Option<anyhow::Error>,
}

enum Output {
    /// Every number of every sample.
    Csv(AtomicFile),
    /// A track for maps: written at the end.
    Track(PathBuf, bool, Vec<TrackPoint>),
}

impl NavigationFile {
    /// Starts the file.
    ///
    /// # Errors
    /// It exists, cannot be written, or has another extension.
    pub(crate) fn create(path: &Path, force: bool) -> Result<Self> {
        let output = if has_extension(path, "csv") {
            let mut file = AtomicFile::create(path, force)?;
            file.print(format_args!("{COLUMNS}\n"))?;
            Output::Csv(file)
        } else {
            check_track_path(path)
                .context("estimates of a navigation run are a .csv or a track")?;
            check_free(path, force)?;
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
            Output::Csv(file) => write_row(file, frame, estimate),
            Output::Track(_, _, points) => {
                points.push(track_point(frame, estimate));
                Ok(())
            }
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// Something went wrong on the way, or goes wrong now.
    pub(crate) fn finish(self, name: &str) -> Result<()> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        match self.output {
            Output::Csv(file) => file.commit()?,
            Output::Track(path, force, points) => write_track(&path, name, &points, force)?,
        }
        Ok(())
    }
}

fn track_point(frame: &LocalFrame, estimate: &NavigationEstimate) -> TrackPoint {
    let place = frame.geodetic(&estimate.position);
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

fn write_row(
    file: &mut AtomicFile,
    frame: &LocalFrame,
    estimate: &NavigationEstimate,
) -> Result<()> {
    let place = frame.geodetic(&estimate.position);
    let [latitude, longitude] = place.degrees();
    let [north, east, down] = estimate.position.into();
    let variances = estimate.position_covariance.diagonal();
    let [north_std, east_std, down_std] = variances.map(|v| v.max(0.0).sqrt()).into();
    let [v_north, v_east, v_down] = estimate.velocity.into();
    file.print(format_args!(
        "{:.6},{latitude:.9},{longitude:.9},{:.4},{north:.4},{east:.4},{down:.4},{north_std:.4},{east_std:.4},\
         {down_std:.4},{v_north:.4},{v_east:.4},{v_down:.4},",
        estimate.time_ns as f64 * 1e-9,
        place.height_m,
    ))?;
    match estimate.ned_from_body {
        Some(attitude) => {
            let [w, x, y, z] = rotation::to_wxyz(&attitude);
            file.print(format_args!("{w:.7},{x:.7},{y:.7},{z:.7},"))?;
        }
        None => file.print(format_args!(",,,,"))?,
    }
    for angle in [estimate.heading(), estimate.heading_std] {
        match angle {
            Some(angle) => file.print(format_args!("{:.4},", angle.to_degrees()))?,
            None => file.print(format_args!(","))?,
        }
    }
    file.print(format_args!("{}\n", validity_word(estimate.validity)))?;
    Ok(())
}

impl NavigationObserver for NavigationFile {
    /// Each sample, or what a map can show.
    fn interval_ns(&self) -> i64 {
        match self.output {
            Output::Csv(_) => 0,
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
