//! `error-state` with all defaults and nothing given, on real recordings entered anywhere: flights that begin in the air,
//! a drive that begins while the car moves, turns or stands.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use nalgebra::Vector3;
use northing_evaluation::navigation::{
    NavigationKind, NavigationOptions, NavigationSummary, run_navigation,
};
use northing_evaluation::statistics::median;
use northing_recording::test_data::data_dir;
use northing_recording::{Event, OpenOptions, Sample, open};

/// Positions are scored from so long after the first fix, s.
const SCORED_FROM_S: f64 = 5.0;

/// Which part of a recording, and how.
struct Part<'a> {
    path: &'a Path,
    data: &'a Path,
    from_s: f64,
    until_s: f64,
    /// Whether a low-pass takes the noise out of the inertial samples of the first 30 s.
    is_quiet: bool,
    gnss_every: u32,
    smooth: bool,
}

impl<'a> Part<'a> {
    fn whole(path: &'a Path, data: &'a Path) -> Self {
        Self {
            path,
            data,
            from_s: 0.0,
            until_s: f64::MAX,
            is_quiet: false,
            gnss_every: 1,
            smooth: false,
        }
    }

    fn run(&self) -> NavigationSummary {
        let options = OpenOptions {
            data: Some(self.data.to_owned()),
            ..OpenOptions::default()
        };
        let mut recording = open(self.path, &options).unwrap();
        let metadata = recording.metadata().clone();
        let mut options = NavigationOptions::of_recording(NavigationKind::ErrorState, &metadata);
        options.gnss_every = self.gnss_every;
        options.score_from_s = SCORED_FROM_S;
        options.smooth = self.smooth;
        let mut begins_ns = None;
        let mut means = [None; 2];
        let events = (&mut recording).filter_map(|event| {
            let event = match event {
                Ok(event) => event,
                Err(error) => return Some(Err(error)),
            };
            let begins_ns = *begins_ns.get_or_insert(event.time_ns);
            let t = (event.time_ns - begins_ns) as f64 * 1e-9;
            let used = t >= self.from_s && t <= self.until_s;
            let quiet = self.is_quiet && t < self.from_s + 30.0;
            used.then(|| {
                Ok(if quiet {
                    calmed(event, &mut means)
                } else {
                    event
                })
            })
        });
        let world = metadata.world_frame;
        run_navigation(events, "part", world, &options, &mut ()).unwrap()
    }
}

/// A first-order low-pass over a fifth of a second of samples at 100 Hz.
fn calmed(mut event: Event, means: &mut [Option<Vector3<f64>>; 2]) -> Event {
    let smooth = |value: &mut Vector3<f64>, mean: &mut Option<Vector3<f64>>| {
        let before = mean.unwrap_or(*value);
        *value = before + (*value - before) * 0.05;
        *mean = Some(*value);
    };
    match &mut event.sample {
        Sample::AngularRate(rate) => smooth(rate, &mut means[0]),
        Sample::SpecificForce(force) => smooth(force, &mut means[1]),
        _ => {}
    }
    event
}

fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    median(&values).unwrap()
}

fn flights(data: &Path) -> Vec<std::path::PathBuf> {
    let folder = std::fs::read_dir(data.join("nav/quad")).unwrap();
    let mut files: Vec<_> = folder
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 18);
    files
}

/// Extrapolation of the last two fixes has 1.3 m in the median.
#[test]
fn every_flight_is_followed_with_defaults() {
    let Some(data) = data_dir("every_flight_is_followed_with_defaults") else {
        return;
    };
    let mut errors = Vec::new();
    for path in flights(&data) {
        let summary = Part::whole(&path, &data).run();
        let name = path.file_stem().unwrap().display().to_string();
        let position = summary.position.unwrap();
        let (error, inside) = (position.horizontal_rmse_m, position.inside_95);
        println!(
            "{name:16} {error:.3} m, {:.1} % inside, heading {:.2} deg",
            inside * 100.0,
            summary.heading_rmse_deg.unwrap()
        );
        assert!(error <= 0.30 && inside >= 0.9, "{name}: {position:?}");
        errors.push(error);
    }
    let middle = middle(errors);
    println!("median {middle:.3} m");
    assert!(middle <= 0.20, "{middle} m");
}

/// Moving, turning and standing; with the noise of the samples, and with that of the first 30 s taken out, which makes a
/// smooth drive look like a standstill.
#[test]
fn a_drive_is_entered_anywhere() {
    let Some(data) = data_dir("a_drive_is_entered_anywhere") else {
        return;
    };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/recordings/car_rtk.toml");
    let mut standing = f64::INFINITY;
    for is_quiet in [false, true] {
        for start in 0..10 {
            let from_s = 32.0 * f64::from(start);
            let summary = Part {
                from_s,
                until_s: from_s + 80.0,
                is_quiet,
                gnss_every: 4,
                ..Part::whole(&path, &data)
            }
            .run();
            let position = summary.position.unwrap();
            println!(
                "from {from_s:3.0} s, quiet {is_quiet:5}: {:.3} m, {:.1} % inside, extrapolation {:.3} m; {:?}",
                position.horizontal_rmse_m,
                position.inside_95 * 100.0,
                position.extrapolation_rmse_m.unwrap(),
                summary.validity,
            );
            if start == 0 && !is_quiet {
                standing = position.horizontal_rmse_m;
            }
            let most = 0.15_f64.min(1.3 * standing);
            assert!(position.horizontal_rmse_m <= most, "{position:?}");
        }
    }
}
