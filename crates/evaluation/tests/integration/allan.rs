//! Allan deviation of phones that lay on a table for some seconds.
//!
//! What was found: the Nexus 5 lay where something hummed (a hill in the curve of its y axis),
//! the iPhones show white noise, 3.1e-4 to 3.4e-4 (4S) and 2.0e-4 rad/s/sqrt(Hz) (5).

use std::path::{Path, PathBuf};

use northing_core::calibration::{RestCalibrator, RestLimits};
use northing_evaluation::calibration::allan::{
    AllanConfig, AllanError, AllanReport, RestSamples, analyze,
};
use northing_recording::test_data::data_dir;
use northing_recording::{OpenOptions, Recording, Sample, open};

fn path(test: &str, device: &str) -> Option<PathBuf> {
    let file = format!("attitude/smartphone/calib_gyr_{device}.parquet");
    Some(data_dir(test)?.join(file))
}

fn opened(path: &Path) -> Recording {
    open(path, &OpenOptions::default()).expect("a recording")
}

fn report(path: &Path) -> Result<AllanReport, AllanError> {
    let config = AllanConfig {
        minimum_duration_s: 5.0,
        ..AllanConfig::default()
    };
    analyzed(path, &config)
}

fn analyzed(path: &Path, config: &AllanConfig) -> Result<AllanReport, AllanError> {
    let mut samples = RestSamples::new(config.sensor);
    for event in opened(path) {
        samples.add_event(&event.expect("an event"));
    }
    analyze(&samples, config)
}

/// The density that the scatter of single samples gives, as a calibration at rest has it.
fn density_at_rest(path: &Path) -> f64 {
    let mut calibrator = RestCalibrator::<f64>::new();
    let mut last = None;
    for event in opened(path) {
        let event = event.expect("an event");
        if let Sample::AngularRate(rate) = event.sample {
            let dt = last.map(|last| (event.time_ns - last) as f64 * 1e-9);
            calibrator.add_gyroscope(&rate, dt);
            last = Some(event.time_ns);
        }
    }
    let calibration = calibrator.finish(&RestLimits::default()).expect("a rest");
    calibration.gyroscope_noise_density().expect("an interval")
}

#[test]
fn where_noise_is_white_the_curve_agrees_with_the_scatter() {
    let test = "where_noise_is_white_the_curve_agrees_with_the_scatter";
    for device in ["iPhone4S_d2", "iPhone4S_d3", "iPhone5_d3"] {
        let Some(path) = path(test, device) else {
            return;
        };
        let report = report(&path).unwrap();
        let density = report.coefficients.noise_density.unwrap().value;
        let ratio = density / density_at_rest(&path);
        assert!((0.85..1.15).contains(&ratio), "{device}: {density} {ratio}");
        assert!(
            report.worst_misfit < 1.3,
            "{device}: {}",
            report.worst_misfit
        );
    }
}

/// A hum makes a hill in the curve, which no sum of the four noises has.
#[test]
fn a_hum_calls_the_numbers_in_question() {
    let Some(path) = path("a_hum_calls_the_numbers_in_question", "Nexus5_d2") else {
        return;
    };
    let report = report(&path).unwrap();
    let density = report.coefficients.noise_density.unwrap();
    assert!(
        report.worst_misfit > 1.3 && density.std > 0.02 * density.value,
        "{density:?}"
    );
    let y_axis = |point: usize| report.curve[point].axis_deviations[1];
    assert!(y_axis(1) > 1.2 * y_axis(0), "the hill");
    let doubts = |s: &String| s.contains("departs from the four noises") && s.contains("vibration");
    assert!(
        report.sentences.iter().any(doubts),
        "{:?}",
        report.sentences
    );
}

#[test]
fn seconds_are_too_short_by_default() {
    let Some(path) = path("seconds_are_too_short_by_default", "Nexus5_d1") else {
        return;
    };
    let error = analyzed(&path, &AllanConfig::default()).unwrap_err();
    let text = error.to_string();
    assert!(text.starts_with("too short: 21."), "{text}");
}
