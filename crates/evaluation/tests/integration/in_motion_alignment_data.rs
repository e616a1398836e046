//! The in-motion alignment on real flights and a real drive: already moving, sideways and backwards, with defaults and
//! nothing given.

#![allow(clippy::unwrap_used)]

use core::f64::consts::PI;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::earth::{Geodetic, wgs84::LocalFrame};
use northing_core::navigation::in_motion_alignment::{
    AlignmentSolution, AlignmentStatus, InMotionAlignment, InMotionAlignmentConfig,
};
use northing_core::navigation::{GnssPosition, GnssVelocity};
use northing_recording::test_data::data_dir;
use northing_recording::{OpenOptions, Sample, open};

/// Positions are scored from so long after the first sample, s.
const SCORED_FROM_S: f64 = 5.0;
/// Speed from which a car has a course, m/s.
const COURSE_FROM_M_S: f64 = 5.0;

/// What of a recording is used.
struct Part<'a> {
    path: &'a Path,
    options: OpenOptions,
    /// Seconds after the first sample from which and until which samples and fixes are used.
    from_s: f64,
    until_s: f64,
    /// Of so many fixes one is used; where there is no reference the others are scored against.
    every: usize,
    /// Whether the receiver's velocities are used, too.
    velocities: bool,
}

/// How it went.
#[derive(Debug, Default)]
struct Outcome {
    /// Seconds from the first sample used until it was aligned.
    aligned_s: Option<f64>,
    /// Squared horizontal errors, m^2, and whether the truth was inside the 95 % ellipse.
    horizontal: Vec<(f64, bool)>,
    /// Error of the heading against the reference and its stated standard deviation while aligned, deg.
    heading: Vec<(f64, f64)>,
    /// Heading less course while aligned and moving, deg.
    off_course: Vec<f64>,
}

struct Run {
    alignment: InMotionAlignment<f64>,
    frame: Option<LocalFrame>,
    first_ns: Option<i64>,
    now_ns: i64,
    attitude: Option<UnitQuaternion<f64>>,
    outcome: Outcome,
}

impl Run {
    /// Moves on to an instant with the mean of two samples.
    fn advance(&mut self, time_ns: i64, [rate, force]: &[Vector3<f64>; 2]) {
        let dt = (time_ns - self.now_ns) as f64 * 1e-9;
        if dt > 0.0 {
            self.alignment.propagate(rate, force, dt).unwrap();
            self.now_ns = time_ns;
        }
    }

    fn sample(&mut self, time_ns: i64, new: [Vector3<f64>; 2], last: Option<[Vector3<f64>; 2]>) {
        if let Some(last) = last {
            let mean = [0, 1].map(|i| (new[i] + last[i]) * 0.5);
            self.advance(time_ns, &mean);
        } else {
            self.first_ns = Some(time_ns);
            self.now_ns = time_ns;
        }
    }

    fn ned(&mut self, fix: &northing_recording::GnssPosition) -> Vector3<f64> {
        let place = Geodetic {
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
            height_m: fix.height_m.unwrap(),
        };
        let frame = self.frame.get_or_insert_with(|| LocalFrame::new(place));
        frame.ned(&place)
    }

    fn score(&mut self, time_ns: i64, truth: &Vector3<f64>) {
        let t = (time_ns - self.first_ns.unwrap_or(time_ns)) as f64 * 1e-9;
        let Some(solution) = self.alignment.solution() else {
            return;
        };
        if self.alignment.status() == AlignmentStatus::Aligned {
            self.outcome.aligned_s.get_or_insert(t);
            self.score_heading(&solution);
        }
        if t < SCORED_FROM_S {
            return;
        }
        // The reference is up to a sample away.
        let ahead = (time_ns - self.now_ns) as f64 * 1e-9;
        let off = (truth - solution.position - solution.velocity * ahead).xy();
        let covariance = solution.position_covariance.fixed_view::<2, 2>(0, 0);
        let nees = off.dot(&(covariance.try_inverse().unwrap() * off));
        let scored = (off.norm_squared(), nees < 5.991);
        self.outcome.horizontal.push(scored);
    }

    fn score_heading(&mut self, solution: &AlignmentSolution<f64>) {
        let forward = solution.ned_from_body * Vector3::x();
        let (heading, v) = (forward.y.atan2(forward.x), solution.velocity);
        if v.xy().norm() > COURSE_FROM_M_S {
            let off = heading - v.y.atan2(v.x);
            let off = off - 2.0 * PI * (off / (2.0 * PI)).round();
            self.outcome.off_course.push(off.to_degrees());
        }
        if let Some(attitude) = self.attitude {
            let d = (attitude * solution.ned_from_body.inverse()).to_rotation_matrix();
            let off = (d[(1, 0)] - d[(0, 1)]).atan2(d[(0, 0)] + d[(1, 1)]);
            let scored = (off.to_degrees(), solution.heading_std.to_degrees());
            self.outcome.heading.push(scored);
        }
    }
}

fn run(part: &Part<'_>) -> Outcome {
    let config = InMotionAlignmentConfig::default();
    let mut run = Run {
        alignment: InMotionAlignment::new(config).unwrap(),
        frame: None,
        first_ns: None,
        now_ns: 0,
        attitude: None,
        outcome: Outcome::default(),
    };
    let (mut last, mut rate, mut begins_ns) = (None, Vector3::zeros(), None);
    let (mut fixes, mut has_reference, mut uses_fix) = (0, false, false);
    for event in open(part.path, &part.options).unwrap() {
        let event = event.unwrap();
        let t = (event.time_ns - *begins_ns.get_or_insert(event.time_ns)) as f64 * 1e-9;
        if t < part.from_s || t > part.until_s {
            continue;
        }
        match event.sample {
            Sample::AngularRate(w) => rate = w,
            Sample::SpecificForce(f) => {
                run.sample(event.time_ns, [rate, f], last);
                last = Some([rate, f]);
            }
            Sample::Reference(reference) => run.attitude = Some(reference.attitude),
            Sample::ReferencePosition(truth) => {
                has_reference = true;
                let ned = run.ned(&truth);
                run.score(event.time_ns, &ned);
            }
            Sample::GnssPosition(fix) => {
                let Some(last) = &last else { continue };
                let ned = run.ned(&fix);
                run.advance(event.time_ns, last);
                uses_fix = fixes % part.every == 0;
                fixes += 1;
                if !uses_fix {
                    if !has_reference {
                        run.score(event.time_ns, &ned);
                    }
                    continue;
                }
                let std = fix.std_m.unwrap().into();
                let has_height = true;
                run.alignment.gnss_position(&GnssPosition {
                    ned,
                    std,
                    has_height,
                });
            }
            Sample::GnssVelocity(fix) if uses_fix && part.velocities => {
                if let (Some(down), Some(std)) = (fix.down_m_s, fix.std_m_s) {
                    let ned = Vector3::new(fix.north_m_s, fix.east_m_s, down);
                    run.alignment
                        .gnss_velocity(&GnssVelocity::new(ned, std.into()));
                }
            }
            _ => {}
        }
    }
    run.outcome
}

impl Outcome {
    /// Horizontal RMS, m, and share inside the 95 % ellipse.
    fn position(&self) -> (f64, f64) {
        let n = self.horizontal.len() as f64;
        let squares: f64 = self.horizontal.iter().map(|(square, _)| square).sum();
        let inside = self.horizontal.iter().filter(|(_, inside)| *inside).count();
        (f64::sqrt(squares / n), inside as f64 / n)
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    northing_evaluation::statistics::median(&values).expect("a value")
}

/// Extrapolation of the last two fixes has 1.3 m in the median.
#[test]
fn every_flight_finds_its_heading_in_motion() {
    let Some(data) = data_dir("every_flight_finds_its_heading_in_motion") else {
        return;
    };
    let mut files: Vec<_> = std::fs::read_dir(data.join("nav/quad"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    files.sort();
    assert_eq!(files.len(), 18);
    let (mut times, mut positions, mut headings) = (Vec::new(), Vec::new(), Vec::new());
    for path in &files {
        let name = path.file_stem().unwrap().display();
        let outcome = run(&Part {
            path,
            options: OpenOptions::default(),
            from_s: 0.0,
            until_s: f64::MAX,
            every: 1,
            velocities: false,
        });
        let (position, inside) = outcome.position();
        let square: f64 = outcome.heading.iter().map(|(off, _)| off * off).sum();
        let heading = f64::sqrt(square / outcome.heading.len() as f64);
        times.push(outcome.aligned_s.unwrap());
        assert!(position < 0.25 && inside >= 0.9, "{name}: {position} m");
        assert!(heading < 5.0, "{name}: {heading} deg");
        for (off, std) in &outcome.heading {
            let wrong = *std < 8.0 && off.abs() > (3.0 * std).max(5.0);
            assert!(!wrong, "{name}: {off} deg, stated {std}");
        }
        positions.push(position);
        headings.push(heading);
    }
    assert!(median(times) < 7.0);
    assert!(median(positions) < 0.18 && median(headings) < 1.6);
}

/// The mount is some 5 degrees to the right of the car's axis.
#[test]
fn a_drive_that_is_entered_anywhere_finds_its_heading() {
    let Some(data) = data_dir("a_drive_that_is_entered_anywhere_finds_its_heading") else {
        return;
    };
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/recordings");
    for (number, velocities) in (0..9).flat_map(|n| [(n, false), (n, true)]) {
        let from_s = 40.0 * f64::from(number);
        let outcome = run(&Part {
            path: &examples.join("car_rtk.toml"),
            options: OpenOptions {
                data: Some(data.clone()),
                ..OpenOptions::default()
            },
            from_s,
            until_s: from_s + 80.0,
            every: 4,
            velocities,
        });
        let (position, inside) = outcome.position();
        let at = format!("from {from_s} s, velocities {velocities}: {position} m");
        assert!(outcome.aligned_s.unwrap() < 45.0, "{at}");
        // The receiver's velocities are late by 0.12 s, which nothing here is told of.
        let most = if velocities { 0.2 } else { 0.15 };
        assert!(position < most && inside > 0.95, "{at}");
        let mount = median(outcome.off_course);
        assert!((0.0..10.0).contains(&mount), "{at}, {mount} deg");
    }
}
