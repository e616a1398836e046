//! Estimates of a navigation run as a file: CSV with every number, or a track for maps, by extension.

use std::path::Path;

use anyhow::{Result, bail};
use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::rotation;
use northing_evaluation::navigation::{NavigationEstimate, NavigationObserver};
use northing_evaluation::report::validity_word;
use northing_recording::AtomicFile;

use crate::commands::convert::has_extension;

/// The columns of the CSV.
const COLUMNS: &str = "t_s,latitude_deg,longitude_deg,height_m,north_m,east_m,down_m,north_std_m,east_std_m,down_std_m,\
     velocity_north_m_s,velocity_east_m_s,velocity_down_m_s,qw,qx,qy,qz,heading_deg,heading_std_deg,validity";

/// A file of estimates being written. It watches a run; what goes wrong is told at the end.
pub(crate) struct NavigationFile {
    file: AtomicFile,
    frame: Option<LocalFrame>,
    failure: Option<anyhow::Error>,
}

impl NavigationFile {
    /// Starts the file.
    ///
    /// # Errors
    /// It exists, cannot be written, or has another extension.
    pub(crate) fn create(path: &Path, force: bool) -> Result<Self> {
        if !has_extension(path, "csv") {
            bail!(
                "{}: estimates of a navigation run are written as .csv; name the output so",
                path.display()
            );
        }
        let mut file = AtomicFile::create(path, force)?;
        file.print(format_args!("{COLUMNS}\n"))?;
        Ok(Self {
            file,
            frame: None,
            failure: None,
        })
    }

    fn write(&mut self, estimate: &NavigationEstimate) -> Result<()> {
        let Some(frame) = &self.frame else {
            return Ok(());
        };
        let place = frame.geodetic(&estimate.position);
        let [latitude, longitude] = place.degrees();
        let [north, east, down] = estimate.position.into();
        let variances = estimate.position_covariance.diagonal();
        let [north_std, east_std, down_std] = variances.map(|v| v.max(0.0).sqrt()).into();
        let [v_north, v_east, v_down] = estimate.velocity.into();
        self.file.print(format_args!(
            "{:.6},{latitude:.9},{longitude:.9},{:.4},{north:.4},{east:.4},{down:.4},{north_std:.4},{east_std:.4},\
             {down_std:.4},{v_north:.4},{v_east:.4},{v_down:.4},",
            estimate.time_ns as f64 * 1e-9,
            place.height_m,
        ))?;
        match estimate.ned_from_body {
            Some(attitude) => {
                let [w, x, y, z] = rotation::to_wxyz(&attitude);
                self.file
                    .print(format_args!("{w:.7},{x:.7},{y:.7},{z:.7},"))?;
            }
            None => self.file.print(format_args!(",,,,"))?,
        }
        for angle in [estimate.heading(), estimate.heading_std] {
            match angle {
                Some(angle) => self
                    .file
                    .print(format_args!("{:.4},", angle.to_degrees()))?,
                None => self.file.print(format_args!(","))?,
            }
        }
        self.file
            .print(format_args!("{}\n", validity_word(estimate.validity)))?;
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// Something went wrong on the way, or goes wrong now.
    pub(crate) fn finish(self) -> Result<()> {
        match self.failure {
            Some(failure) => Err(failure),
            None => Ok(self.file.commit()?),
        }
    }
}

impl NavigationObserver for NavigationFile {
    /// Each sample.
    fn interval_ns(&self) -> i64 {
        0
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
