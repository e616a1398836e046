//! Magnetometer calibration on phones that people turned by hand, uncalibrated stream.
//!
//! What was found on three phones, six recordings: ellipsoids everywhere, 94 to 100 % of the sphere
//! seen, residuals of 0.67 to 0.75 microtesla (Nexus 5, iPhone 5) and 1.5 (iPhone 4S), where the
//! length of the raw samples varies by 19 to 32.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use northing_core::calibration::magnetometer::{self, MagnetometerCalibrator, MagnetometerModel};
use northing_core::calibration::{MagnetometerCalibration, MagnetometerLimits};
use northing_recording::test_data::data_dir;
use northing_recording::{OpenOptions, Sample, open};

/// The recordings in which a phone was turned for its magnetometer, or none after saying so.
fn recordings(test: &str) -> Vec<PathBuf> {
    let Some(data) = data_dir(test) else {
        return Vec::new();
    };
    let days = [
        "Nexus5_d1",
        "Nexus5_d2",
        "Nexus5_d3",
        "iPhone4S_d2",
        "iPhone4S_d3",
        "iPhone5_d3",
    ];
    let file = |day| format!("attitude/smartphone/calib_mag_{day}.parquet");
    days.into_iter().map(|day| data.join(file(day))).collect()
}

/// The samples of the uncalibrated magnetometer, microtesla.
fn uncalibrated(path: &Path) -> Vec<Vector3<f64>> {
    let recording = open(path, &OpenOptions::default()).expect("a recording");
    recording
        .filter_map(|event| match event.expect("an event").sample {
            Sample::MagneticFieldUncalibrated(field) => Some(field),
            _ => None,
        })
        .collect()
}

fn calibrated(samples: &[Vector3<f64>]) -> MagnetometerCalibration<f64> {
    let mut calibrator = MagnetometerCalibrator::new();
    for sample in samples {
        calibrator.add(sample);
    }
    let limits = MagnetometerLimits::default();
    calibrator.finish(&limits).expect("a calibration")
}

fn std(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (values.map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

#[test]
fn phones_are_calibrated_to_a_microtesla() {
    for path in recordings("phones_are_calibrated_to_a_microtesla") {
        let name = path.display();
        let samples = uncalibrated(&path);
        let c = calibrated(&samples);
        assert_eq!(c.model, MagnetometerModel::Ellipsoid, "{name}");
        assert!(c.coverage > 0.9, "{name}: coverage {}", c.coverage);
        assert!(
            c.hard_iron().norm() > 250.0,
            "{name}: hundreds of microtesla"
        );
        let limit = if c.hard_iron_ut[2] < -500.0 { 1.6 } else { 0.8 };
        assert!(c.residual_std_ut < limit, "{name}: {}", c.residual_std_ut);
        // The Earth's field is about 47 microtesla at that place; phones scale it well.
        assert!(
            (c.radius_ut / 47.0 - 1.0).abs() < 0.02,
            "{name}: {}",
            c.radius_ut
        );
        let before = std(samples.iter().map(|s| s.norm()));
        let after = std(samples.iter().map(|s| c.apply(s).norm()));
        assert!(
            (before / c.uncalibrated_norm_std_ut - 1.0).abs() < 0.05,
            "{name}: {before}"
        );
        assert!(
            (after / c.residual_std_ut - 1.0).abs() < 0.05,
            "{name}: {after}"
        );
        assert!(after < 0.06 * before, "{name}: {before} to {after}");
    }
}

/// What was fitted to every other second or so holds in between.
#[test]
fn a_calibration_holds_on_samples_it_has_not_seen() {
    for path in recordings("a_calibration_holds_on_samples_it_has_not_seen") {
        let samples = uncalibrated(&path);
        let (mut fitted, mut held_out) = (Vec::new(), Vec::new());
        for (index, part) in samples.chunks(40).enumerate() {
            let side = if index % 2 == 0 {
                &mut fitted
            } else {
                &mut held_out
            };
            side.extend_from_slice(part);
        }
        let c = calibrated(&fitted);
        let square = |s: &Vector3<f64>| c.residual(s).powi(2);
        let rms = (held_out.iter().map(square).sum::<f64>() / held_out.len() as f64).sqrt();
        assert!(rms < 1.25 * c.residual_std_ut, "{}: {rms}", path.display());
    }
}

#[test]
fn single_precision_and_later_passes_agree_with_the_stream() {
    for path in recordings("single_precision_and_later_passes_agree_with_the_stream") {
        let samples = uncalibrated(&path);
        let c = calibrated(&samples);
        let mut single = MagnetometerCalibrator::<f32>::new();
        for sample in &samples {
            single.add(&sample.map(|x| x as f32));
        }
        let single = single.finish(&MagnetometerLimits::default()).unwrap();
        let difference = single.hard_iron().cast::<f64>() - c.hard_iron();
        assert!(difference.amax() < 2e-3, "{}: {difference}", path.display());
        let limits = MagnetometerLimits::default();
        let later = magnetometer::calibrate(&samples.iter().copied(), &limits).unwrap();
        assert!((later.hard_iron() - c.hard_iron()).amax() < 0.1);
        assert!(f64::from(later.rejected_samples) < 0.01 * samples.len() as f64);
    }
}
