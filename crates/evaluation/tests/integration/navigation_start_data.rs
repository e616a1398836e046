//! `error-state` with all defaults and nothing given, on real recordings entered anywhere: flights that begin in the air,
//! a drive that begins while the car moves, turns or stands.

#![allow(clippy::unwrap_used)]

use std::cell::RefCell;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use northing_evaluation::navigation::{
    NavigationEstimate, NavigationKind, NavigationObserver, NavigationOptions, NavigationSummary,
    run_navigation,
};
use northing_evaluation::statistics::median;
use northing_recording::test_data::data_dir;
use northing_recording::{Event, OpenOptions, Sample, open};

/// Positions are scored from so long after the first fix, s.
const SCORED_FROM_S: f64 = 5.0;

/// Which part of a recording, and how.
#[derive(Clone, Copy)]
struct Part<'a> {
    path: &'a Path,
    data: &'a Path,
    from_s: f64,
    until_s: f64,
    /// Whether a low-pass takes the noise out of the inertial samples of the first 30 s.
    is_quiet: bool,
    gnss_every: u32,
    smooth: bool,
    /// Whether an axis of the inertial unit is reversed.
    is_mirrored: bool,
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
            is_mirrored: false,
        }
    }

    fn run(&self) -> NavigationSummary {
        self.watched(&mut Headings::default())
    }

    fn watched(&self, headings: &mut Headings) -> NavigationSummary {
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
        let references = RefCell::new(Vec::new());
        let events = (&mut recording).filter_map(|event| {
            let mut event = match event {
                Ok(event) => event,
                Err(error) => return Some(Err(error)),
            };
            if let Sample::Reference(reference) = &event.sample {
                let seen = (event.time_ns, reference.attitude);
                references.borrow_mut().push(seen);
            }
            if self.is_mirrored
                && let Sample::AngularRate(v) | Sample::SpecificForce(v) = &mut event.sample
            {
                v.y = -v.y;
            }
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
        let summary = run_navigation(events, "part", world, &options, headings).unwrap();
        headings.references = references.into_inner();
        summary
    }
}

/// The headings of a run, and those of the reference.
#[derive(Default)]
struct Headings {
    /// Time, attitude, and standard deviation of the heading, rad.
    estimates: Vec<(i64, UnitQuaternion<f64>, f64)>,
    references: Vec<(i64, UnitQuaternion<f64>)>,
}

impl Headings {
    /// Error and stated standard deviation, deg, of each instant of the reference.
    fn errors(&self) -> Vec<[f64; 2]> {
        let of = |(time_ns, truth): &(i64, UnitQuaternion<f64>)| {
            let after = self.estimates.partition_point(|e| e.0 <= *time_ns);
            let (at, attitude, std) = self.estimates.get(after.checked_sub(1)?)?;
            let d = (attitude * truth.inverse()).to_rotation_matrix();
            let off = (d[(1, 0)] - d[(0, 1)]).atan2(d[(0, 0)] + d[(1, 1)]);
            (time_ns - at < 30_000_000).then(|| [off.abs(), *std].map(f64::to_degrees))
        };
        self.references.iter().filter_map(of).collect()
    }
}

impl NavigationObserver for Headings {
    fn interval_ns(&self) -> i64 {
        0
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        let stated = estimate.ned_from_body.zip(estimate.heading_std);
        if let Some((attitude, std)) = stated {
            self.estimates.push((estimate.time_ns, attitude, std));
        }
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

/// The batch solution of GTSAM has 0.17 m in the median, and 0.15 m the filter as it goes.
#[test]
fn what_a_flight_holds_is_found_by_the_batch_smoother() {
    let Some(data) = data_dir("what_a_flight_holds_is_found_by_the_batch_smoother") else {
        return;
    };
    let mut errors = Vec::new();
    for path in flights(&data) {
        let summary = Part {
            smooth: true,
            ..Part::whole(&path, &data)
        }
        .run();
        let name = path.file_stem().unwrap().display().to_string();
        let position = summary.position.unwrap();
        let (error, inside) = (position.horizontal_rmse_m, position.inside_95);
        println!(
            "{name:16} {error:.3} m, {:.1} % inside, heading {:.2} deg; {:?}",
            inside * 100.0,
            summary.heading_rmse_deg.unwrap(),
            summary.smoothing.unwrap(),
        );
        assert!(error <= 0.08 && inside >= 0.95, "{name}: {position:?}");
        let smoothing = summary.smoothing.unwrap();
        assert!(smoothing.converged, "{name}: {smoothing:?}");
        errors.push(error);
    }
    let middle = middle(errors);
    println!("median {middle:.3} m");
    assert!(middle <= 0.06, "{middle} m");
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
            let part = Part {
                from_s,
                until_s: from_s + 80.0,
                is_quiet,
                gnss_every: 4,
                ..Part::whole(&path, &data)
            };
            let summary = part.run();
            let position = summary.position.unwrap();
            println!(
                "from {from_s:3.0} s, quiet {is_quiet:5}: {:.3} m, {:.1} % inside, extrapolation {:.3} m; {:?}",
                position.horizontal_rmse_m,
                position.inside_95 * 100.0,
                position.extrapolation_rmse_m.unwrap(),
                summary.validity,
            );
            let batch = Part {
                smooth: true,
                ..part
            }
            .run();
            let bound = batch.position.unwrap();
            println!(
                "  batch {:.3} m, {:.1} % inside; {:?}",
                bound.horizontal_rmse_m,
                bound.inside_95 * 100.0,
                batch.smoothing.unwrap()
            );
            assert!(batch.smoothing.unwrap().converged);
            assert!(
                bound.horizontal_rmse_m < position.horizontal_rmse_m && bound.inside_95 > 0.9,
                "{bound:?}"
            );
            if start == 0 && !is_quiet {
                standing = position.horizontal_rmse_m;
            }
            let most = 0.15_f64.min(1.3 * standing);
            assert!(position.horizontal_rmse_m <= most, "{position:?}");
        }
    }
}

/// A heading that is stated below 8 degrees is within 5 degrees, or three times what is stated.
#[test]
fn a_heading_that_is_known_is_one() {
    let Some(data) = data_dir("a_heading_that_is_known_is_one") else {
        return;
    };
    let mut counts = [0; 2];
    for path in flights(&data) {
        let name = path.file_stem().unwrap().display().to_string();
        let mut headings = Headings::default();
        Part::whole(&path, &data).watched(&mut headings);
        let errors = headings.errors();
        let known: Vec<_> = errors.iter().filter(|[_, std]| *std < 8.0).collect();
        let beyond = |[off, std]: &&&[f64; 2]| *off > 5_f64.max(3.0 * std);
        let outside = known.iter().filter(beyond).count();
        let [worst, sigmas] = known
            .iter()
            .fold([0.0_f64; 2], |[worst, sigmas], [off, std]| {
                [worst.max(*off), sigmas.max(off / std)]
            });
        println!(
            "{name:16} known {} of {}, outside {outside}, worst {worst:.1} deg, {sigmas:.1} sigma",
            known.len(),
            errors.len()
        );
        counts[0] += known.len();
        counts[1] += errors.len();
        assert_eq!(outside, 0, "{name}");
    }
    // Two flights hover so much that it is hardly ever known.
    let [known, all] = counts;
    assert!(10 * known > 6 * all, "{known} of {all}");
}

/// The flights turn faster than their fixes come, so nothing is said of them; above all nothing wrong.
#[test]
fn left_handed_axes_are_found_out_on_the_road() {
    let Some(data) = data_dir("left_handed_axes_are_found_out_on_the_road") else {
        return;
    };
    let issues = |path: &Path, is_mirrored: bool| {
        let part = Part {
            is_mirrored,
            ..Part::whole(path, &data)
        };
        part.run().issues.join(" ")
    };
    let road = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/recordings/car_rtk.toml");
    assert_eq!(issues(&road, false), "");
    let mirrored = issues(&road, true);
    assert!(mirrored.contains("are left-handed"), "{mirrored}");
    for path in flights(&data) {
        assert_eq!(issues(&path, false), "");
        let mirrored = issues(&path, true);
        assert!(!mirrored.contains("signs of"), "{mirrored}");
    }
}
