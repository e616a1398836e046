//! The Python module `northing`: the estimators, readers and writers of the program over arrays and recordings.
//!
//! | file | what is in it |
//! |---|---|
//! | `samples.rs` | arrays of sensors as the events of a recording |
//! | `attitude.rs` | options of attitude runs, the run over arrays |
//! | `attitude_told.rs` | summary, verdicts and trace of a run, made when asked for |
//! | `attitude_run.rs` | what an attitude run gives: arrays, summary, report, file |
//! | `recordings.rs` | recordings in files: sensors, samples, runs |
//! | `calibrations.rs` | calibrations and fits of recordings |
//! | `navigation_arrays.rs` | navigation over arrays of samples and fixes |
//! | `navigation_run.rs` | what a navigation run gives |
//! | `streams.rs`, `configs.rs` | attitude estimators sample by sample, and their parameters |
//! | `navigation_stream.rs`, `tracking_stream.rs` | the GNSS/INS and trackers sample by sample |
//! | `multi_target.rs`, `scan_sensor.rs`, `target_tracks.rs` | the multi-target tracker scan by scan, its sensors, what a scan told |
//! | `arrow_stream.rs` | columns for whoever reads Arrow |
//! | `comparison.rs` | several estimators over several recordings |
//! | `own.rs` | estimators that somebody brings along, in this process or one of their own |
//! | `campaigns.rs` | one run of a tracking scenario, and Monte Carlo campaigns |
//! | `simulated.rs` | recordings of virtual phones and vehicles, with the truth |
//! | `errors.rs` | what is refused, in the words of the module |
//!
//! What people call is Python (`python/northing`), typed there; this crate gives it plain functions and classes. Every run
//! goes through `northing_evaluation` as the program's does, so that both give the same digits.

mod arrow_stream;
mod attitude;
mod attitude_run;
mod attitude_told;
mod calibrations;
mod campaigns;
mod comparison;
mod configs;
mod errors;
mod multi_target;
mod navigation_arrays;
mod navigation_run;
mod navigation_stream;
mod own;
mod recordings;
mod samples;
mod scan_sensor;
mod simulated;
mod streams;
mod target_tracks;
mod tracking_stream;

use pyo3::prelude::*;

/// What `import northing._northing` runs.
#[pymodule]
fn _northing(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(arrow_stream::arrow_stream, module)?)?;
    module.add_function(wrap_pyfunction!(attitude::attitude, module)?)?;
    module.add_function(wrap_pyfunction!(attitude::estimators, module)?)?;
    module.add_function(wrap_pyfunction!(navigation_arrays::navigation, module)?)?;
    module.add_function(wrap_pyfunction!(errors::in_words_of_the_module, module)?)?;
    module.add_function(wrap_pyfunction!(comparison::compare, module)?)?;
    module.add_function(wrap_pyfunction!(calibrations::calibrate_rest, module)?)?;
    module.add_function(wrap_pyfunction!(
        calibrations::calibrate_magnetometer,
        module
    )?)?;
    module.add_function(wrap_pyfunction!(calibrations::calibrate_allan, module)?)?;
    module.add_function(wrap_pyfunction!(calibrations::tune, module)?)?;
    module.add_function(wrap_pyfunction!(campaigns::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(campaigns::montecarlo, module)?)?;
    module.add_function(wrap_pyfunction!(own::register_class, module)?)?;
    module.add_function(wrap_pyfunction!(own::register_file, module)?)?;
    module.add_class::<campaigns::Part>()?;
    module.add_class::<simulated::VirtualRecording>()?;
    module.add_class::<attitude_run::AttitudeRun>()?;
    module.add_class::<navigation_run::NavigationRun>()?;
    module.add_class::<recordings::RecordingFile>()?;
    module.add_class::<configs::BoundedVelocityConfig>()?;
    module.add_class::<configs::AttitudeConfig>()?;
    module.add_class::<configs::GnssInsConfig>()?;
    module.add_class::<streams::Innovation>()?;
    module.add_class::<streams::BoundedVelocity>()?;
    module.add_class::<streams::Mekf>()?;
    module.add_class::<navigation_stream::GnssIns>()?;
    module.add_class::<tracking_stream::OwnShip>()?;
    module.add_class::<tracking_stream::SchmidtKalman>()?;
    module.add_class::<scan_sensor::ScanSensor>()?;
    module.add_class::<multi_target::MultiTarget>()?;
    module.add_class::<target_tracks::TargetTrack>()?;
    module.add_class::<target_tracks::EndedTrack>()?;
    module.add_class::<target_tracks::ScanRecord>()?;
    // What people may call is in the list of the package.
    module.delattr("__all__")
}
