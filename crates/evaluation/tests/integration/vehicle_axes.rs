//! A vehicle's unit whose axes are taken for others: the course shows it, and the run says which they are.

#![allow(clippy::unwrap_used)]

use std::convert::Infallible;

use nalgebra::Vector3;
use northing_core::earth::Geodetic;
use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::{rotation, so3};
use northing_evaluation::navigation::{NavigationOptions, NavigationSummary, run_navigation};
use northing_recording::{BodyAxes, Event, Frames, GnssPosition, GnssQuality, Sample, WorldFrame};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const STEP_S: f64 = 0.02;
const DURATION_S: f64 = 180.0;

/// Velocity and attitude (yaw, pitch, roll) of a car in winding streets, and of a drone that flies sideways and anywhere.
type Motion = fn(f64) -> (Vector3<f64>, [f64; 3]);

fn car(t: f64) -> (Vector3<f64>, [f64; 3]) {
    let heading = 1.2 * (0.21 * t).sin() + 0.05 * t;
    let speed = 9.0 + 4.0 * (0.37 * t).sin() + 2.0 * (0.113 * t).cos();
    let velocity = Vector3::new(heading.cos(), heading.sin(), 0.0) * speed;
    (velocity, [heading, 0.0, 0.0])
}

fn drone(t: f64) -> (Vector3<f64>, [f64; 3]) {
    let velocity = Vector3::new(5.0 * (0.3 * t).sin(), 6.0 * (0.21 * t).sin(), 0.0);
    (velocity, [0.9 * (0.17 * t).sin() + 0.3, 0.0, 0.0])
}

/// The recording of a unit whose axes are `is`, told to have those that are `told`.
fn run(motion: Motion, is: BodyAxes, told: BodyAxes, seed: u64) -> NavigationSummary {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut noise = |std: f64| {
        let mut one = || -> f64 { StandardNormal.sample(&mut random) };
        Vector3::new(one(), one(), one()) * std
    };
    let home = LocalFrame::new(Geodetic {
        latitude_rad: 47.0_f64.to_radians(),
        longitude_rad: 8.0_f64.to_radians(),
        height_m: 400.0,
    });
    let [forward, right, down] = is.forward_right_down();
    let sensors = |v: Vector3<f64>| forward * v.x + right * v.y + down * v.z;
    let attitude = |t: f64| rotation::from_yaw_pitch_roll(motion(t).1);
    let mut place = Vector3::zeros();
    let mut events = Vec::new();
    for k in 0..(DURATION_S / STEP_S) as i64 {
        let (time_ns, t) = (k * 20_000_000, k as f64 * STEP_S);
        let gained = (motion(t + 0.5 * STEP_S).0 - motion(t - 0.5 * STEP_S).0) / STEP_S;
        let force = attitude(t).inverse() * (gained - Vector3::z() * 9.806_65);
        let turned = attitude(t - 0.5 * STEP_S).inverse() * attitude(t + 0.5 * STEP_S);
        let rate = so3::log(&turned) / STEP_S;
        let mut push = |sample| events.push(Event { time_ns, sample });
        push(Sample::AngularRate(sensors(rate) + noise(2e-3)));
        push(Sample::SpecificForce(sensors(force) + noise(0.05)));
        if k % 50 == 0 {
            let seen = home.geodetic(&(place + noise(0.5)));
            push(Sample::GnssPosition(GnssPosition {
                latitude_rad: seen.latitude_rad,
                longitude_rad: seen.longitude_rad,
                height_m: Some(seen.height_m),
                std_m: Some([0.5, 0.5, 0.5]),
                quality: GnssQuality::Autonomous,
                ..GnssPosition::default()
            }));
        }
        place += motion(t + 0.5 * STEP_S).0 * STEP_S;
    }
    let frames = Frames {
        world: WorldFrame::Enu,
        body: told,
    };
    let events = events.into_iter().map(Ok::<_, Infallible>);
    let options = NavigationOptions::default();
    run_navigation(events, "drive", frames, &options, &mut ()).unwrap()
}

fn said(summary: &NavigationSummary) -> Option<&String> {
    let is_of_axes = |issue: &&String| issue.contains("the vehicle moved");
    summary.issues.iter().find(is_of_axes)
}

#[test]
fn axes_of_a_vehicle_unit_that_are_taken_for_others_are_named() {
    const ALL: [BodyAxes; 3] = [BodyAxes::Phone, BodyAxes::Flu, BodyAxes::Frd];
    for (seed, is) in (1..).zip(ALL) {
        for told in ALL {
            let summary = run(car, is, told, seed);
            let said = said(&summary);
            // Upside down, forward is forward all the same.
            let points_ahead = is == told || is != BodyAxes::Phone && told != BodyAxes::Phone;
            assert_eq!(said.is_none(), points_ahead, "{is:?} as {told:?}: {said:?}");
            let named = format!("body_axes = \"{}\"", is.name());
            assert!(said.is_none_or(|said| said.contains(&named)), "{said:?}");
        }
    }
}

#[test]
fn a_vehicle_that_moves_anywhere_shows_no_axes() {
    for told in [BodyAxes::Phone, BodyAxes::Frd] {
        assert_eq!(said(&run(drone, BodyAxes::Frd, told, 5)), None);
    }
}
