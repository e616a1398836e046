//! The in-motion alignment in simulated worlds: what it finds, what it states, and that it never states a heading that
//! is wrong.

#![allow(clippy::unwrap_used)]

mod world;

use northing_core::Scalar;
use northing_core::geometry::so3;
use northing_core::nalgebra::{UnitQuaternion, Vector3, convert, try_convert};
use northing_core::navigation::GnssPosition;
use northing_core::navigation::in_motion_alignment::{
    AlignmentStatus, InMotionAlignment, InMotionAlignmentConfig,
};
use world::{DT, GPS, RTK, Receiver, Vehicle, World, world, world_with};

const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// An unmodelled lever arm and clock that a receiver's stated standard deviation says nothing of.
const RTK_OFF: Receiver = Receiver {
    stated: 0.05,
    arm: 0.2,
    clock: 0.05,
    ..RTK
};

/// The estimate at a fix, and how far it is off.
#[derive(Debug, Clone, Copy)]
struct Moment {
    t: f64,
    status: AlignmentStatus,
    horizontal_m: f64,
    inside_95: bool,
    heading_off: f64,
    heading_std: f64,
    ned_from_body: UnitQuaternion<f64>,
    position: Vector3<f64>,
}

impl Moment {
    /// A heading stated below 8 degrees that is off by more than 5 degrees and three standard deviations.
    fn is_wrong(&self) -> bool {
        self.heading_std < 8.0 * DEGREE
            && self.heading_off.abs() > (3.0 * self.heading_std).max(5.0 * DEGREE)
    }
}

/// Runs a world and looks half a second after each fix.
fn run<T: Scalar, const K: usize, const N: usize>(
    alignment: &mut InMotionAlignment<T, K, N>,
    world: &World,
) -> Vec<Moment> {
    let to = |v: &Vector3<f64>| v.map(convert::<f64, T>);
    let mut moments = Vec::new();
    let mut fixes = world.fixes.iter().peekable();
    for k in 0..world.position.len() {
        if let Some((_, fix)) = fixes.next_if(|(at, _)| *at == k) {
            let fix = GnssPosition {
                ned: to(&fix.ned),
                std: to(&fix.std),
                has_height: fix.has_height,
            };
            alignment.gnss_position(&fix);
        }
        if k % 100 == 80 {
            moments.extend(look(alignment, world, k));
        }
        if let Some([rate, force]) = world.samples.get(k) {
            alignment
                .propagate(&to(rate), &to(force), convert(DT))
                .unwrap();
        }
    }
    moments
}

fn look<T: Scalar, const K: usize, const N: usize>(
    alignment: &InMotionAlignment<T, K, N>,
    world: &World,
    k: usize,
) -> Option<Moment> {
    let from = |v: T| try_convert::<T, f64>(v).unwrap();
    let solution = alignment.solution()?;
    let position = solution.position.map(from);
    let [w, i, j, l] =
        northing_core::geometry::rotation::to_wxyz(&solution.ned_from_body).map(from);
    let ned_from_body = northing_core::geometry::rotation::from_wxyz([w, i, j, l]).unwrap();
    let off = (world.position[k.saturating_add_signed(world.late)] - position).xy();
    let covariance = solution.position_covariance.map(from);
    let covariance = covariance.fixed_view::<2, 2>(0, 0).into_owned();
    let nees = off.dot(&(covariance.try_inverse().unwrap() * off));
    let error = so3::log(&(world.ned_from_body[k] * ned_from_body.inverse()));
    Some(Moment {
        t: k as f64 * DT,
        status: alignment.status(),
        horizontal_m: off.norm(),
        inside_95: nees < 5.991,
        heading_off: error.z,
        heading_std: from(solution.heading_std),
        ned_from_body,
        position,
    })
}

/// First second at which it is aligned.
fn aligned_at(moments: &[Moment]) -> Option<f64> {
    let aligned = |m: &&Moment| m.status == AlignmentStatus::Aligned;
    moments.iter().find(aligned).map(|m| m.t)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    f64::sqrt(sum / count)
}

/// What many seeds of one world came to.
#[derive(Debug, Default)]
struct Campaign {
    /// First seconds at which it was aligned, sorted.
    aligned: Vec<f64>,
    /// Runs that stated a wrong heading.
    wrong: usize,
    /// Horizontal RMS of each run from 5 s on, m.
    position: Vec<f64>,
    /// Share of all moments from 5 s on at which the truth is inside the 95 % ellipse.
    inside: f64,
    /// Normalised squared errors of the heading at the end of the runs that are aligned.
    heading_nees: Vec<f64>,
    /// Least standard deviation of a heading that was stated, rad.
    least_std: f64,
}

fn campaign<T: Scalar, const K: usize, const N: usize>(
    vehicle: Vehicle,
    receiver: &Receiver,
    seeds: u64,
    duration: f64,
) -> Campaign {
    let config = InMotionAlignmentConfig::<T>::default();
    campaign_of::<T, K, N>(config, seeds, |seed| {
        world(vehicle, receiver, seed, duration)
    })
}

fn campaign_of<T: Scalar, const K: usize, const N: usize>(
    config: InMotionAlignmentConfig<T>,
    seeds: u64,
    world: impl Fn(u64) -> World,
) -> Campaign {
    let mut made = Campaign {
        least_std: f64::MAX,
        ..Campaign::default()
    };
    let (mut inside, mut count) = (0, 0);
    for seed in 0..seeds {
        let world = world(seed);
        let mut alignment = InMotionAlignment::<T, K, N>::new(config).unwrap();
        let moments = run(&mut alignment, &world);
        made.aligned.extend(aligned_at(&moments));
        made.wrong += usize::from(moments.iter().any(Moment::is_wrong));
        let late = || moments.iter().filter(|m| m.t > 5.0);
        made.position.push(rms(late().map(|m| m.horizontal_m)));
        inside += late().filter(|m| m.inside_95).count();
        count += late().count();
        let end = moments.last().unwrap();
        if end.status == AlignmentStatus::Aligned {
            made.heading_nees
                .push((end.heading_off / end.heading_std).powi(2));
        }
        let least = moments.iter().map(|m| m.heading_std);
        made.least_std = least.fold(made.least_std, f64::min);
    }
    made.aligned.sort_by(f64::total_cmp);
    made.inside = f64::from(inside as u32) / f64::from(count as u32);
    made
}

impl Campaign {
    fn worst(&self) -> f64 {
        self.position.iter().copied().fold(0.0, f64::max)
    }

    fn median(&self) -> Option<f64> {
        self.aligned.get(self.aligned.len() / 2).copied()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn a_smooth_car_that_is_already_moving_finds_its_heading() {
    let good = campaign::<f64, 8, 12>(Vehicle::Car, &RTK, 40, 60.0);
    assert!(good.aligned.len() == 40 && good.wrong == 0);
    assert!(good.median().unwrap() < 12.0 && good.worst() < 0.1);
    assert!(good.inside > 0.95);
    // A lever arm and a clock that nobody knows of.
    let off = campaign::<f64, 8, 12>(Vehicle::Car, &RTK_OFF, 40, 60.0);
    assert!(off.aligned.len() == 40 && off.wrong == 0);
    assert!(off.worst() < 0.3 && off.inside > 0.95);
}

/// Its course says nothing of its heading.
#[test]
fn a_drone_that_flies_sideways_finds_its_heading() {
    let rtk = campaign::<f64, 8, 12>(Vehicle::Drone, &RTK_OFF, 40, 60.0);
    assert!(rtk.aligned.len() == 40 && rtk.wrong == 0);
    assert!(rtk.median().unwrap() < 11.0 && rtk.worst() < 0.3);
    assert!(rtk.inside > 0.95);
    let gps = campaign::<f64, 8, 12>(Vehicle::Drone, &GPS, 40, 60.0);
    assert!(gps.aligned.len() >= 38 && gps.wrong == 0);
    assert!(gps.median().unwrap() < 30.0 && gps.inside > 0.9);
}

#[test]
fn a_phone_that_lies_anyhow_in_a_car_finds_its_heading() {
    let gps = campaign::<f64, 8, 12>(Vehicle::Phone, &GPS, 40, 60.0);
    assert!(gps.aligned.len() >= 30 && gps.wrong == 0);
    assert!(gps.inside > 0.9);
}

/// The noise of fixes is no course: neither with errors as stated nor with a receiver twice as bad as it says.
#[test]
fn standing_says_nothing_of_the_heading() {
    let worse = Receiver {
        stated: 0.75,
        ..GPS
    };
    for receiver in [RTK, GPS, worse] {
        let made = campaign::<f64, 8, 12>(Vehicle::Standing, &receiver, 60, 180.0);
        assert!(made.aligned.is_empty() && made.wrong == 0);
        assert!(made.least_std > 60.0 * DEGREE);
        assert!(made.inside > 0.9 || receiver.stated < GPS.stated);
    }
}

#[test]
fn straight_on_says_nothing_of_the_heading() {
    let made = campaign::<f64, 8, 12>(Vehicle::Straight, &RTK, 40, 120.0);
    assert!(made.aligned.is_empty() && made.wrong == 0);
    assert!(made.least_std > 60.0 * DEGREE && made.worst() < 0.1);
}

/// Four hypotheses and a window of eight in single precision.
#[test]
fn the_small_form_states_no_wrong_heading_either() {
    for (vehicle, receiver, least) in [
        (Vehicle::Car, RTK_OFF, 30),
        (Vehicle::Drone, RTK_OFF, 38),
        (Vehicle::Drone, GPS, 20),
        (Vehicle::Standing, RTK, 0),
    ] {
        let made = campaign::<f32, 4, 8>(vehicle, &receiver, 40, 60.0);
        assert_eq!(made.wrong, 0);
        assert!(made.aligned.len() >= least);
    }
}

/// With the noise of the settings as it is in the world, and normal errors, the heading's covariance is consistent.
#[test]
fn the_heading_is_consistent_where_the_settings_are_right() {
    let config = InMotionAlignmentConfig {
        accelerometer_noise_density: 3e-3,
        gyroscope_noise_density: 2e-4,
        accelerometer_bias_random_walk: 0.0,
        gyroscope_bias_random_walk: 0.0,
        accelerometer_bias_std: 0.05,
        gyroscope_bias_std: 0.3 * DEGREE,
        lever_arm_std_m: 0.0,
        time_offset_std_s: 0.0,
        time_jitter_s: 0.0,
        position_uncorrelated_fraction: 1.0,
        position_correlated_fraction: 0.0,
        student_dof: 1e6,
        evidence_power: 1.0,
        largest_noise_scale: 1.0,
        ..InMotionAlignmentConfig::<f64>::default()
    };
    let seeds = 300;
    let receiver = Receiver {
        white: 0.3,
        stated: 0.3,
        ..RTK
    };
    let made = |seed| world_with(0.0, Vehicle::Drone, &receiver, seed, 40.0);
    let made = campaign_of::<f64, 8, 12>(config, seeds, made);
    assert!(made.heading_nees.len() >= 294);
    let nees = mean(&made.heading_nees);
    // The mean of so many squares is within 0.16 of one; linearisation costs the rest.
    assert!((0.84..1.30).contains(&nees), "{nees}");
    assert!((0.93..0.97).contains(&made.inside), "{}", made.inside);
}

/// The default noise is cautious.
#[test]
fn the_heading_is_conservative_with_the_defaults() {
    let made = campaign::<f64, 8, 12>(Vehicle::Drone, &GPS, 100, 60.0);
    let nees = mean(&made.heading_nees);
    assert!(made.wrong == 0 && (0.2..1.0).contains(&nees), "{nees}");
}

#[test]
fn a_fix_on_another_continent_leaves_no_trace() {
    let far = Vector3::new(2e6, -3e5, 100.0);
    let usual = world(Vehicle::Drone, &RTK, 3, 40.0);
    let run_of = |world: &World| {
        let mut alignment =
            InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
        run(&mut alignment, world)
    };
    let end = |moments: &[Moment]| *moments.last().unwrap();
    for at in [3, 8, 20] {
        let (mut off, mut missing) = (
            world(Vehicle::Drone, &RTK, 3, 40.0),
            world(Vehicle::Drone, &RTK, 3, 40.0),
        );
        off.fixes[at].1.ned += far;
        missing.fixes.remove(at);
        let (off, missing) = (run_of(&off), run_of(&missing));
        assert_eq!(off.len(), missing.len());
        for (a, b) in off.iter().zip(&missing) {
            let of = |m: &Moment| (m.position, m.heading_std);
            assert_eq!(of(a), of(b), "{at}");
        }
    }
    // Of the first one that is used and the second one of two is wrong, and it goes on from the second; behind that it begins again with those
    // that agree.
    let usual = run_of(&usual);
    for wrong in [0..2, 2..3] {
        let mut early = world(Vehicle::Drone, &RTK, 3, 40.0);
        for (_, fix) in &mut early.fixes[wrong] {
            fix.ned += far;
        }
        let moments = run_of(&early);
        for m in moments.iter().filter(|m| m.t > 6.0) {
            assert!(m.horizontal_m < if m.t > 12.0 { 0.2 } else { 1.0 }, "{m:?}");
        }
        let at = aligned_at(&moments).unwrap();
        assert!(at < aligned_at(&usual).unwrap() + 5.0, "{at}");
        assert!(!end(&moments).is_wrong() && end(&moments).heading_std < 3.0 * DEGREE);
    }
}

/// Ten metres to the side for good, as after a spoofed jump or a change of the reference station.
#[test]
fn it_follows_a_jump_of_the_fixes() {
    for seed in 0..10 {
        let mut world = world(Vehicle::Car, &RTK, seed, 60.0);
        for (_, fix) in &mut world.fixes[25..] {
            fix.ned.x += 10.0;
        }
        for p in &mut world.position[2530..] {
            p.x += 10.0;
        }
        let mut alignment =
            InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
        let moments = run(&mut alignment, &world);
        let wrong: Vec<_> = moments.iter().filter(|m| m.is_wrong()).collect();
        assert!(wrong.is_empty(), "{seed}: {wrong:?}");
        for m in moments.iter().filter(|m| m.t > 45.0) {
            assert!(m.horizontal_m < 0.3, "{seed}: {m:?}");
        }
        assert_eq!(alignment.restarts(), 1, "{seed}");
    }
}

#[test]
fn single_precision_agrees() {
    for (vehicle, receiver) in [(Vehicle::Car, RTK), (Vehicle::Drone, GPS)] {
        for seed in 0..5 {
            let world = world(vehicle, &receiver, seed, 60.0);
            let double = run(
                &mut InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap(),
                &world,
            );
            let single = run(
                &mut InMotionAlignment::<f32>::new(InMotionAlignmentConfig::default()).unwrap(),
                &world,
            );
            let (mut most, mut turn) = (0.0_f64, 0.0_f64);
            for (a, b) in double
                .iter()
                .zip(&single)
                .filter(|(a, _)| a.status == AlignmentStatus::Aligned)
            {
                most = most.max((a.position - b.position).norm());
                turn = turn.max(so3::log(&(a.ned_from_body * b.ned_from_body.inverse())).norm());
            }
            assert!(
                most < 0.01 && turn < 0.1 * DEGREE,
                "{seed}: {most} m, {turn} rad"
            );
        }
    }
}

/// A world that is turned about the vertical turns the result.
#[test]
fn the_result_turns_with_the_world() {
    // By three eighths of a turn the hypotheses are the same, by less they begin elsewhere.
    for (yaw, loose) in [(135.0, 1e-4), (20.0, 0.25)] {
        for seed in 0..5 {
            let usual = world(Vehicle::Drone, &RTK, seed, 40.0);
            let turned = world(Vehicle::Drone, &RTK, seed, 40.0).turned(yaw * DEGREE);
            let [a, b] = [&usual, &turned].map(|w| {
                run(
                    &mut InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap(),
                    w,
                )
            });
            let turn = so3::exp(&(Vector3::z() * (yaw * DEGREE)));
            let (mut off, mut place, mut std) = (0.0_f64, 0.0_f64, 0.0_f64);
            for (a, b) in a.iter().zip(&b).filter(|(a, _)| a.t > 12.0) {
                let error = so3::log(&(turn * a.ned_from_body * b.ned_from_body.inverse()));
                off = off.max(error.norm() / a.heading_std);
                place = place.max((turn * a.position - b.position).norm());
                std = std.max((a.heading_std / b.heading_std - 1.0).abs());
            }
            let most = off.max(place).max(std);
            assert!(most < loose, "{yaw} {seed}: {off} {place} {std}");
        }
    }
}
