//! debug
#![allow(clippy::print_stdout)]
use northing_evaluation::attitude::compare::{CompareOptions, compare};
use northing_evaluation::attitude::{Calibrations, CompassUse};
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::{EstimatorKind, Profile, RunOptions, SensorSelection};
use northing_recording::OpenOptions;
fn main() {
    let data = std::env::var("NORTHING_DATA").unwrap();
    let sets: Vec<String> = std::env::args().skip(1).collect();
    for (folder, source, inertial) in [
        ("broad", MagnetometerSource::Device, false),
        ("broad", MagnetometerSource::Device, true),
        ("smartphone", MagnetometerSource::Uncalibrated, false),
        ("smartphone", MagnetometerSource::Device, false),
        ("smartphone", MagnetometerSource::Device, true),
    ] {
        let dir = std::path::Path::new(&data).join("attitude").join(folder);
        let mut paths: Vec<_> = std::fs::read_dir(dir)
            .unwrap()
            .map(|e| e.unwrap().path())
            .filter(|p| {
                let n = p.file_name().unwrap().to_string_lossy().into_owned();
                n.ends_with(".parquet") && !n.starts_with("calib_")
            })
            .collect();
        paths.sort();
        let mut run = RunOptions::new(EstimatorKind::BoundedVelocity, Profile::HandHeld);
        run.sensors.magnetometer_source = source;
        if inertial {
            run.sensors = SensorSelection {
                magnetometer: false,
                compass: CompassUse::Never,
                ..run.sensors
            };
        }
        for s in &sets {
            run.set(s).unwrap();
        }
        let options = CompareOptions {
            estimators: vec![EstimatorKind::BoundedVelocity],
            run,
            calibrations: Calibrations::default(),
            align_reference: false,
            open: OpenOptions::default(),
        };
        let out = compare(&paths, &options, &|| ());
        let mut cols: Vec<Vec<f64>> = vec![vec![]; 7];
        for c in &out {
            if let Ok(s) = &c.outcome {
                if let Some(e) = &s.error_deg {
                    let n = s.nees.as_ref();
                    for (k, v) in [
                        e.total_rmse,
                        e.heading_rmse,
                        e.heading_drift_rmse,
                        e.heading_aligned_rmse,
                        e.inclination_rmse,
                        n.map_or(f64::NAN, |n| n.mean / f64::from(n.degrees_of_freedom)),
                        n.map_or(f64::NAN, |n| n.tilt_mean / 2.0),
                    ]
                    .into_iter()
                    .enumerate()
                    {
                        cols[k].push(v);
                    }
                    if std::env::var("EACH").is_ok() {
                        println!(
                            "{:40} total {:6.2} incl {:5.2} nees {:.2}",
                            c.path.file_stem().unwrap().to_string_lossy(),
                            e.total_rmse,
                            e.inclination_rmse,
                            n.map_or(f64::NAN, |n| n.mean / f64::from(n.degrees_of_freedom))
                        );
                    }
                }
            }
        }
        let mm = |v: &mut Vec<f64>| {
            v.sort_by(f64::total_cmp);
            format!(
                "{:6.2}/{:5.2}",
                v.iter().sum::<f64>() / v.len() as f64,
                v[v.len() / 2]
            )
        };
        let text: Vec<String> = cols
            .iter_mut()
            .zip([
                "total",
                "head",
                "drift",
                "align",
                "incl",
                "nees",
                "tilt nees",
            ])
            .map(|(v, n)| format!("{n} {}", mm(v)))
            .collect();
        println!(
            "{folder:10} {source:?} {} n {} {}",
            if inertial { "inertial" } else { "all" },
            cols[0].len(),
            text.join("  ")
        );
    }
}
