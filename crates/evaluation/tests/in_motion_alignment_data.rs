//! The in-motion alignment on real flights and a real drive: already moving, sideways and backwards, with defaults and
//! nothing given.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::earth::{Geodetic, wgs84::LocalFrame};
use northing_core::navigation::GnssPosition;
use northing_core::navigation::in_motion_alignment::{
    AlignmentStatus, InMotionAlignment, InMotionAlignmentConfig,
};
use northing_recording::test_data::data_dir;
use northing_recording::{OpenOptions, Sample, open};

/// Position and attitude are scored from so long after the first sample, s.
const SCORED_FROM_S: f64 = 5.0;

/// How it went.
#[derive(Debug, Default)]
struct Outcome {
    /// Seconds from the first sample until it was aligned.
    aligned_s: Option<f64>,
    /// Squared horizontal errors, m^2, and whether the truth was inside the 95 % ellipse.
    horizontal: Vec<(f64, bool)>,
    /// Error of the heading and its stated standard deviation while aligned, deg.
    heading: Vec<(f64, f64)>,
    /// Fixes that were used.
    fixes: usize,
}

struct Run {
    alignment: InMotionAlignment<f64>,
    frame: Option<LocalFrame>,
    first_ns: Option<i64>,
    now_ns: i64,
    rate: Option<Vector3<f64>>,
    force: Option<Vector3<f64>>,
    attitude: Option<UnitQuaternion<f64>>,
    outcome: Outcome,
}

impl Run {
    fn seconds(&self, time_ns: i64) -> f64 {
        (time_ns - self.first_ns.unwrap_or(time_ns)) as f64 * 1e-9
    }

    /// Moves on to an instant with the mean of two samples.
    fn advance(&mut self, time_ns: i64, [rate, force]: &[Vector3<f64>; 2]) {
        let dt = (time_ns - self.now_ns) as f64 * 1e-9;
        if dt > 0.0 {
            self.alignment.propagate(rate, force, dt).unwrap();
            self.now_ns = time_ns;
        }
    }

    fn force(&mut self, time_ns: i64, new: [Vector3<f64>; 2], last: Option<[Vector3<f64>; 2]>) {
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
        self.frame
            .get_or_insert_with(|| LocalFrame::new(place))
            .ned(&place)
    }

    fn score(&mut self, time_ns: i64, truth: &Vector3<f64>) {
        let t = self.seconds(time_ns);
        let Some(solution) = self.alignment.solution().filter(|_| t >= SCORED_FROM_S) else {
            return;
        };
        // The reference is up to a sample away.
        let ahead = (time_ns - self.now_ns) as f64 * 1e-9;
        let off = (truth - solution.position - solution.velocity * ahead).xy();
        let covariance = solution
            .position_covariance
            .fixed_view::<2, 2>(0, 0)
            .into_owned();
        let nees = off.dot(&(covariance.try_inverse().unwrap() * off));
        self.outcome
            .horizontal
            .push((off.norm_squared(), nees < 5.991));
        if self.alignment.status() != AlignmentStatus::Aligned {
            return;
        }
        self.outcome.aligned_s.get_or_insert(t);
        if let Some(attitude) = self.attitude {
            let d = (attitude * solution.ned_from_body.inverse()).to_rotation_matrix();
            let off = (d[(1, 0)] - d[(0, 1)]).atan2(d[(0, 0)] + d[(1, 1)]);
            let deg = f64::to_degrees;
            self.outcome
                .heading
                .push((deg(off), deg(solution.heading_std)));
        }
    }
}

fn run(path: &Path, config: InMotionAlignmentConfig<f64>) -> Outcome {
    let mut run = Run {
        alignment: InMotionAlignment::new(config).unwrap(),
        frame: None,
        first_ns: None,
        now_ns: 0,
        rate: None,
        force: None,
        attitude: None,
        outcome: Outcome::default(),
    };
    let (mut last, mut rate) = (None, Vector3::zeros());
    for event in open(path, &OpenOptions::default()).unwrap() {
        let event = event.unwrap();
        match event.sample {
            Sample::AngularRate(w) => rate = w,
            Sample::SpecificForce(f) => {
                run.force(event.time_ns, [rate, f], last);
                last = Some([rate, f]);
            }
            Sample::Reference(reference) => run.attitude = Some(reference.attitude),
            Sample::ReferencePosition(truth) => {
                let ned = run.ned(&truth);
                run.score(event.time_ns, &ned);
            }
            Sample::GnssPosition(fix) => {
                if let Some(last) = &last {
                    run.advance(event.time_ns, last);
                }
                let ned = run.ned(&fix);
                let fix = GnssPosition {
                    ned,
                    std: fix.std_m.unwrap().into(),
                    has_height: true,
                };
                let update = run.alignment.gnss_position(&fix);
                run.outcome.fixes += usize::from(update.position.outcome.is_fused());
            }
            _ => {}
        }
    }
    run.outcome
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    0.5 * (values[middle] + values[(values.len() - 1) / 2])
}

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
        let outcome = run(path, InMotionAlignmentConfig::default());
        let n = outcome.horizontal.len() as f64;
        let (squares, inside) = outcome
            .horizontal
            .iter()
            .fold((0.0, 0.0), |(s, i), (square, inside)| {
                (s + square, i + f64::from(u8::from(*inside)))
            });
        let position = f64::sqrt(squares / n);
        let square: f64 = outcome.heading.iter().map(|(off, _)| off * off).sum();
        let heading = f64::sqrt(square / outcome.heading.len() as f64);
        let first = outcome.heading.first();
        println!(
            "{name}: aligned {:?} {position:.3} m {:.3} heading {heading:.2} first {first:.2?} last {:.2?}",
            outcome.aligned_s,
            inside / n,
            outcome.heading.last()
        );
        times.push(outcome.aligned_s.unwrap());
        assert!(position < 0.35 && inside / n >= 0.9, "{name}: {position} m");
        assert!(heading < 5.0, "{name}: {heading} deg");
        for (off, std) in &outcome.heading {
            assert!(
                *std > 8.0 || off.abs() < (3.0 * std).max(5.0),
                "{name}: {off} deg, stated {std}"
            );
        }
        positions.push(position);
        headings.push(heading);
    }
    println!(
        "median {} s, {} m, {} deg",
        median(times.clone()),
        median(positions.clone()),
        median(headings.clone())
    );
    assert!(median(times) < 7.0);
    assert!(median(positions) < 0.2 && median(headings) < 2.0);
}
