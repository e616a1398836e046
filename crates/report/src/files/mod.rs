//! Estimates of a run as files: CSV, Parquet, trajectories and tracks, by extension; parts of campaigns and studies.
//!
//! Program and Python module write the same files through these observers.

#[cfg(feature = "parquet")]
pub mod campaign_part;
mod estimate_file;
mod navigation_file;
#[cfg(feature = "parquet")]
mod parquet_table;
#[cfg(feature = "parquet")]
pub mod study_part;

use std::path::Path;

pub use estimate_file::EstimateFile;
pub use navigation_file::NavigationFile;
#[cfg(feature = "parquet")]
pub use parquet_table::write_group;

/// Whether a path ends in `.extension`, in any case.
fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(extension))
}
