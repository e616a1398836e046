//! Worlds are the same for the same seed, their truth is consistent, they move and err as they say.

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{Sample, SensorKind};

use super::board::Triad;
use super::measure::Scene;
use super::*;
use crate::rotation::exp;

/// A world of this motion whose sensors have no errors.
fn ideal(motion: WorldMotion, rate_hz: f64, seed: u64) -> Scene {
    let mut scene = Scene::draw(motion, seed);
    scene.board = Board {
        gyroscope: Triad::ideal(rate_hz),
        accelerometer: Triad::ideal(rate_hz),
        heading: HeadingSource::Magnetometer(Triad::ideal(rate_hz)),
        group_delay_s: 0.0,
    };
    scene.delivery.jitter = 0.0;
    scene
}

fn vectors(events: &[Event], kind: SensorKind) -> Vec<Vector3<f64>> {
    let of_kind = events.iter().filter(|event| event.sample.kind() == kind);
    of_kind.filter_map(|event| event.sample.vector()).collect()
}

fn attitudes(events: &[Event]) -> Vec<UnitQuaternion<f64>> {
    let reference = |event: &Event| match event.sample {
        Sample::Reference(reference) => Some(reference.attitude),
        _ => None,
    };
    events.iter().filter_map(reference).collect()
}

#[test]
fn a_seed_and_a_number_are_one_world() {
    let world = AttitudeWorld::draw(1, 23);
    assert_eq!(world, AttitudeWorld::draw(1, 23));
    assert_ne!(world.events, AttitudeWorld::draw(2, 23).events);
    assert_ne!(world.events, AttitudeWorld::draw(1, 32).events);
    for number in 0..36 {
        let world = AttitudeWorld::draw(5, number);
        let stamps = || world.events.iter().map(Event::place);
        assert!(
            stamps().zip(stamps().skip(1)).all(|(a, b)| a <= b),
            "{number}"
        );
        assert!(world.events.iter().all(|event| event.sample.is_finite()));
        assert_eq!(world.description.motion, WorldMotion::of(number));
        let text = world.description.to_string();
        let start = format!("World {number}: {}, ", world.description.motion.name());
        assert!(text.starts_with(&start), "{text}");
    }
}

#[test]
fn a_world_without_its_fault_is_otherwise_the_same() {
    for number in 45..135 {
        let world = AttitudeWorld::draw(1, number);
        let mended = AttitudeWorld::draw_without_fault(1, number);
        assert_eq!(mended.description.fault, WorldFault::None);
        if world.description.fault == WorldFault::None {
            assert_eq!(world, mended, "{number}");
            continue;
        }
        assert_ne!(world.events, mended.events, "{number}");
        let description = |of: &AttitudeWorld| {
            let of = &of.description;
            (of.duration_s, of.field_ut, of.board.heading.name())
        };
        assert_eq!(description(&world), description(&mended), "{number}");
        let last = |of: &AttitudeWorld| attitudes(&of.events).last().copied();
        assert_eq!(last(&world), last(&mended), "{number}");
    }
}

#[test]
fn integrated_rates_lead_from_one_attitude_to_the_next() {
    for motion in WorldMotion::ALL {
        let scene = ideal(motion, 500.0, 7);
        let events = scene.events(7);
        let truth = attitudes(&events);
        let mut attitude = scene.chain.at(0.0).enu_from_body;
        for (k, rate) in vectors(&events, SensorKind::Gyroscope).iter().enumerate() {
            // A sample is the mean over its interval; the truth beside it is that of its middle.
            let [middle, end] = [0.5, 1.0].map(|x| scene.chain.at((k as f64 + x) / 500.0));
            attitude *= exp(&(rate / 500.0));
            assert!(
                attitude.angle_to(&end.enu_from_body) < 1e-7,
                "{motion:?} at {k}"
            );
            assert!(
                truth[k].angle_to(&middle.enu_from_body) < 1e-12,
                "{motion:?} at {k}"
            );
        }
    }
}

#[test]
fn integrated_forces_lead_from_one_velocity_to_the_next() {
    for motion in WorldMotion::ALL {
        let scene = ideal(motion, 500.0, 8);
        let events = scene.events(8);
        let forces = vectors(&events, SensorKind::Accelerometer);
        let truth = attitudes(&events);
        let gravity = Vector3::z() * scene.gravity_m_s2;
        let mut velocity = scene.chain.at(0.0).velocity;
        for (k, (force, attitude)) in forces.iter().zip(&truth).enumerate() {
            velocity += (attitude * force - gravity) / 500.0;
            let expected = scene.chain.at((k + 1) as f64 / 500.0).velocity;
            let off = (velocity - expected).norm();
            assert!(
                off < 0.02 + 1e-3 * expected.norm(),
                "{motion:?} at {k}: {off}"
            );
        }
    }
}

#[test]
fn rate_and_acceleration_are_derivatives_of_attitude_and_velocity() {
    let h = 1e-5;
    for motion in WorldMotion::ALL {
        let chain = ideal(motion, 100.0, 9).chain;
        for k in 0..300 {
            let t = 0.1 + 0.17 * f64::from(k);
            let (before, now, after) = (chain.at(t - h), chain.at(t), chain.at(t + h));
            let turn = before.enu_from_body.inverse() * after.enu_from_body;
            let rate = crate::rotation::log(&turn) / (2.0 * h);
            assert!((rate - now.angular_rate).norm() < 1e-4, "{motion:?} at {t}");
            let acceleration = (after.velocity - before.velocity) / (2.0 * h);
            let off = (acceleration - now.acceleration).norm();
            assert!(off < 1e-3, "{motion:?} at {t}: {off}");
        }
    }
}

/// Highest rate (deg/s) and root mean square of the acceleration (m/s^2) of a few worlds.
fn liveliness(motion: WorldMotion) -> [f64; 2] {
    let (mut rate, mut square, mut count) = (0.0_f64, 0.0, 0.0);
    for seed in 0..8 {
        let scene = ideal(motion, 100.0, seed);
        for k in 0..6000 {
            let state = scene.chain.at(0.01 * f64::from(k));
            rate = rate.max(state.angular_rate.norm().to_degrees());
            square += state.acceleration.norm_squared();
            count += 1.0;
        }
    }
    [rate, (square / count).sqrt()]
}

#[test]
fn each_motion_is_as_lively_as_it_says() {
    for motion in WorldMotion::ALL {
        let [rate, acceleration] = liveliness(motion);
        let (rates, accelerations) = match motion {
            WorldMotion::Desk => ([-1.0, 1e-9], [-1.0, 1e-9]),
            WorldMotion::PutDown => ([60.0, 900.0], [0.2, 5.0]),
            WorldMotion::Walking => ([50.0, 500.0], [1.0, 6.0]),
            WorldMotion::Running => ([150.0, 1500.0], [6.0, 40.0]),
            WorldMotion::Swinging => ([100.0, 900.0], [1.0, 15.0]),
            WorldMotion::Driving => ([5.0, 60.0], [0.5, 4.0]),
            WorldMotion::Drone => ([20.0, 300.0], [1.0, 12.0]),
            WorldMotion::SlowTurns => ([20.0, 31.0], [0.0, 0.1]),
            WorldMotion::FastTurns => ([600.0, 901.0], [0.3, 20.0]),
        };
        let within = |[low, high]: [f64; 2], value| (low..high).contains(&value);
        let seen = format!("{motion:?}: {rate} deg/s, {acceleration} m/s^2");
        assert!(
            within(rates, rate) && within(accelerations, acceleration),
            "{seen}"
        );
    }
}

fn descriptions(count: u64) -> Vec<AttitudeWorldDescription> {
    let scene = |number: u64| {
        let motion = WorldMotion::of(number);
        let fault = WorldFault::of(motion, number / 9);
        Scene::with(motion, fault, true, run_seed(1, number)).description(number, fault)
    };
    (0..count).map(scene).collect()
}

#[test]
fn worlds_are_as_various_as_the_table_says() {
    let worlds = descriptions(900);
    let share = |asked: &dyn Fn(&AttitudeWorldDescription) -> bool| {
        worlds.iter().filter(|world| asked(world)).count() as f64 / worlds.len() as f64
    };
    for fault in WorldFault::ALL {
        let having = share(&|w| w.fault == fault);
        let expected = if fault == WorldFault::None {
            0.2..0.45
        } else {
            0.015..0.09
        };
        assert!(expected.contains(&having), "{fault:?}: {having}");
    }
    let range = |of: &dyn Fn(&AttitudeWorldDescription) -> f64| {
        let values = worlds.iter().map(of);
        values.fold([f64::INFINITY, 0.0], |[low, high], v: f64| {
            [v.min(low), v.max(high)]
        })
    };
    let spans = |[low, high]: [f64; 2], from: f64, to: f64| {
        (from * 0.999..from * 1.2).contains(&low) && (to * 0.9..to * 1.001).contains(&high)
    };
    assert!(spans(
        range(&|w| w.board.gyroscope.noise_density),
        1e-5,
        1e-2
    ));
    assert!(spans(
        range(&|w| w.board.accelerometer.noise_density),
        2e-4,
        0.4
    ));
    assert!(spans(range(&|w| w.board.gyroscope.rate_hz), 20.0, 500.0));
    assert!(spans(range(&|w| w.duration_s), 60.0, 120.0));
    let apart = range(&AttitudeWorldDescription::misalignment_deg);
    assert!((2.5..3.0).contains(&apart[1]), "{apart:?}");
    let scale = range(&|w| Vector3::from(w.board.accelerometer.scale_error).amax());
    assert!((0.038..=0.04).contains(&scale[1]), "{scale:?}");
    let near = |share: f64, expected: f64| (share - expected).abs() < 0.06;
    assert!(near(
        share(&|w| w.board.heading.name() == "magnetometer"),
        0.7
    ));
    assert!(near(share(&|w| w.board.heading.name() == "compass"), 0.17));
    assert!(share(&|w| w.disturbance.is_some_and(|d| d.until_s.is_none())) > 0.01);
    let of_fault = |fault| {
        worlds
            .iter()
            .filter(move |w: &&AttitudeWorldDescription| w.fault == fault)
    };
    assert!(of_fault(WorldFault::Hole).all(|w| !w.delivery.holes.is_empty()));
    let lengths = of_fault(WorldFault::Hole).flat_map(|w| &w.delivery.holes);
    assert!(
        lengths
            .map(|[from, until]| until - from)
            .all(|s| (0.0999..2.001).contains(&s))
    );
    assert!(of_fault(WorldFault::HardIron).all(|w| w.board.heading.name() == "magnetometer"));
}

/// The first world of this fault after a number.
fn world_with(fault: WorldFault, after: u64) -> AttitudeWorld {
    let fits = |number: &u64| WorldFault::of(WorldMotion::of(*number), number / 9) == fault;
    AttitudeWorld::draw(1, (after..).find(fits).unwrap_or_default())
}

fn stamps(world: &AttitudeWorld, kind: SensorKind) -> Vec<f64> {
    let of_kind = world
        .events
        .iter()
        .filter(|event| event.sample.kind() == kind);
    of_kind.map(|event| event.time_ns as f64 * 1e-9).collect()
}

#[test]
fn holes_bursts_and_jitter_are_in_the_stamps() {
    let world = world_with(WorldFault::Hole, 0);
    for kind in [SensorKind::Gyroscope, SensorKind::Accelerometer] {
        let times = stamps(&world, kind);
        for [from, until] in &world.description.delivery.holes {
            // The stamps jitter a little.
            assert!(
                times
                    .iter()
                    .all(|t| !(from + 1e-3..until - 1e-3).contains(t)),
                "{kind:?}"
            );
        }
    }
    let world = world_with(WorldFault::Bursts, 0);
    let times = stamps(&world, SensorKind::Gyroscope);
    let bursts = world.description.delivery.bursts.unwrap();
    let close = times.windows(2).filter(|w| w[1] - w[0] < 2e-4).count() as f64;
    let expected = 1.0 - 1.0 / bursts.samples as f64;
    assert!(
        (close / times.len() as f64 - expected).abs() < 0.02,
        "{close} {expected}"
    );
    let world = world_with(WorldFault::Jitter, 0);
    let interval = 1.0 / world.description.board.gyroscope.rate_hz;
    let times = stamps(&world, SensorKind::Gyroscope);
    let squares = times
        .windows(2)
        .map(|w| ((w[1] - w[0]) / interval - 1.0).powi(2));
    let spread = (0.5 * squares.sum::<f64>() / times.len() as f64).sqrt();
    let stated = world.description.delivery.jitter;
    assert!(
        (0.6..1.05).contains(&(spread / stated)),
        "{spread} {stated}"
    );
}

#[test]
fn faults_are_in_the_samples() {
    let world = world_with(WorldFault::Rounding, 0);
    let step = world.description.board.accelerometer.step;
    let whole = |v: f64| (v / step - (v / step).round()).abs() < 1e-6;
    let forces = vectors(&world.events, SensorKind::Accelerometer);
    assert!(forces.iter().flatten().all(|v| whole(*v)));

    for number in 0..4 {
        let world = world_with(WorldFault::Saturation, 60 * number);
        let clipped = |triad: &Triad, kind| {
            let vectors = vectors(&world.events, kind);
            let clipped = |v: &&Vector3<f64>| v.amax() > triad.full_scale - triad.step;
            assert!(
                vectors
                    .iter()
                    .all(|v| v.amax() < triad.full_scale + triad.step)
            );
            vectors.iter().filter(clipped).count()
        };
        let board = &world.description.board;
        let count = clipped(&board.gyroscope, SensorKind::Gyroscope)
            + clipped(&board.accelerometer, SensorKind::Accelerometer);
        assert!(count > 0, "{}", world.description);
    }

    let world = world_with(WorldFault::MagneticDisturbance, 0);
    let magnet = world.description.disturbance.unwrap();
    let strength = Vector3::from(magnet.field_ut).norm();
    assert!(magnet.field_at(magnet.from_s).norm() < 1e-12);
    assert!((magnet.field_at(magnet.from_s + 2.0).norm() - strength).abs() < 1e-9);

    let world = world_with(WorldFault::BiasJump, 0);
    let jump = world.description.bias_jump.unwrap();
    assert_eq!(world.description.motion, WorldMotion::Desk);
    let rates = vectors(&world.events, SensorKind::Gyroscope);
    let at = stamps(&world, SensorKind::Gyroscope).partition_point(|t| *t < jump.time_s);
    let mean = |rates: &[Vector3<f64>]| rates.iter().sum::<Vector3<f64>>() / rates.len() as f64;
    let seen = mean(&rates[at + 1..]) - mean(&rates[..at]);
    assert!(
        (seen - Vector3::from(jump.gyroscope_rad_s)).norm() < 2e-3,
        "{seen}"
    );
}

#[test]
fn a_faultless_board_errs_by_what_it_says() {
    let mut scene = ideal(WorldMotion::Walking, 100.0, 3);
    let truth = scene.events(3);
    scene.board.gyroscope.noise_density = 1e-3;
    scene.board.accelerometer.bias = [0.1, -0.2, 0.0];
    scene.board.accelerometer.scale_error = [0.02, 0.0, 0.0];
    let turn = exp(&Vector3::new(0.0, 0.0, 0.03));
    let HeadingSource::Magnetometer(field) = &mut scene.board.heading else {
        panic!("an ideal board has one")
    };
    field.set_turn(&turn);
    let measured = scene.events(3);
    let pairs = |kind| {
        let truth = vectors(&truth, kind).into_iter();
        truth.zip(vectors(&measured, kind)).collect::<Vec<_>>()
    };
    let rates = pairs(SensorKind::Gyroscope);
    let square: f64 = rates.iter().map(|(t, m)| (m - t).norm_squared()).sum();
    let std = (square / (3.0 * rates.len() as f64)).sqrt();
    assert!((std / 0.01 - 1.0).abs() < 0.03, "1e-3 over 10 ms: {std}");
    for (truth, measured) in pairs(SensorKind::Accelerometer) {
        let expected = Vector3::new(1.02 * truth.x + 0.1, truth.y - 0.2, truth.z);
        assert!((measured - expected).norm() < 1e-9);
    }
    for (truth, measured) in pairs(SensorKind::Magnetometer) {
        assert!((measured - turn * truth).norm() < 1e-9);
    }
}

#[test]
fn a_compass_is_off_by_its_error_and_late() {
    let mut scene = ideal(WorldMotion::SlowTurns, 100.0, 4);
    let compass = WorldCompass {
        rate_hz: 20.0,
        std_rad: 0.1,
        correlation_time_s: 0.1,
        lag_s: 0.2,
        stated_std_rad: 0.15,
    };
    scene.board.heading = HeadingSource::Compass(compass);
    let (mut square, mut count) = (0.0, 0.0);
    for event in scene.events(4) {
        let Sample::CompassHeading(heading) = event.sample else {
            continue;
        };
        let top = scene
            .chain
            .at(event.time_ns as f64 * 1e-9 - 0.2)
            .enu_from_body
            * Vector3::y();
        let off = (heading.heading_rad - top.x.atan2(top.y) + core::f64::consts::PI)
            .rem_euclid(core::f64::consts::TAU)
            - core::f64::consts::PI;
        square += off * off;
        count += 1.0;
        assert!((heading.std_rad - 0.15).abs() < 1e-12);
    }
    let rms = f64::sqrt(square / count);
    assert!((rms / 0.1 - 1.0).abs() < 0.15, "{rms}");
}
