//! The worlds are consistent, the same for the same seed, move as their class says, and err by what they say.

use nalgebra::Vector3;

use super::motion::{Path, STEPS};
use super::*;
use crate::ground::GRAVITY_M_S2;
use crate::rotation::exp;
use crate::signals::Draws;

/// A path of a class with its unit and the truth, before any error.
fn noiseless(class: WorldClass, seed: u64) -> (Path, InertialUnit, Vec<WorldSample>) {
    let seconds = 120.0;
    let mut unit = InertialUnit::draw(class, seconds, &mut Draws::new(seed, "imu/errors"));
    unit.saturation = None;
    let count = (seconds * unit.rate_hz) as usize;
    let path = Path::draw(
        class,
        seconds,
        count,
        unit.rate_hz,
        &mut Draws::new(seed, "motion"),
    );
    let samples = unit.truth(&path, &Vector3::new(0.2, -0.3, 0.5));
    (path, unit, samples)
}

#[test]
fn noiseless_samples_lead_from_one_instant_to_the_next() {
    for class in WorldClass::ALL {
        let (path, unit, samples) = noiseless(class, 11);
        let h = 1.0 / unit.rate_hz;
        let first = STEPS / 2;
        let mount = samples[0].ned_from_unit.inverse() * path.ned_from_vehicle[STEPS];
        let attitude = |i: usize| path.ned_from_vehicle[i] * mount.inverse();
        let (mut q, mut v, mut p) = (attitude(first), path.velocity[first], path.position[first]);
        for (k, sample) in samples.iter().enumerate() {
            let middle = q * exp(&(sample.angular_rate * (0.5 * h)));
            let curved = Vector3::new(-p.x, -p.y, 2.0 * p.z) * (GRAVITY_M_S2 / 6.371e6);
            let a = middle * sample.specific_force + Vector3::z() * GRAVITY_M_S2 + curved;
            p += v * h + a * (0.5 * h * h);
            v += a * h;
            q *= exp(&(sample.angular_rate * h));
            let i = first + (k + 1) * STEPS;
            assert!(q.angle_to(&attitude(i)) < 1e-7, "{class:?} at {k}");
            assert!(
                (v - path.velocity[i]).norm() < 1e-3,
                "{class:?} at {k}: {}",
                (v - path.velocity[i]).norm()
            );
            assert!(
                (p - path.position[i]).norm() < 0.05,
                "{class:?} at {k}: {}",
                (p - path.position[i]).norm()
            );
        }
        let far = samples
            .iter()
            .map(|s| (s.antenna - s.position).norm() - 0.38_f64.sqrt());
        assert!(
            far.fold(0.0, |a: f64, b| a.max(b.abs())) < 1e-9,
            "the arm keeps its length"
        );
    }
}

#[test]
fn a_seed_and_a_number_are_one_world() {
    let world = NavigationWorld::draw(1, 5);
    assert_eq!(world, NavigationWorld::draw(1, 5));
    assert_ne!(world.samples, NavigationWorld::draw(2, 5).samples);
    assert_ne!(world.samples, NavigationWorld::draw(1, 14).samples);
    assert_eq!(
        WorldClass::named("drone-sideways"),
        Some(world.description.class)
    );
    assert!(
        world
            .samples
            .windows(2)
            .all(|w| w[0].stamp_ns < w[1].stamp_ns)
    );
    assert!(
        world
            .fixes
            .windows(2)
            .all(|w| w[0].stamp_ns < w[1].stamp_ns)
    );
    let finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
    assert!(
        world
            .samples
            .iter()
            .all(|s| finite(&s.angular_rate) && finite(&s.specific_force))
    );
    let text = world.description.to_string();
    assert!(text.starts_with("World 5: drone-sideways, "), "{text}");
}

/// Highest and lowest of something over the truth of a few paths.
fn range(class: WorldClass, of: impl Fn(&Path, usize) -> f64) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for seed in 0..6 {
        let mut draws = Draws::new(seed, "motion");
        let path = Path::draw(class, 120.0, 6000, 50.0, &mut draws);
        for i in 0..path.position.len() {
            let value = of(&path, i);
            range = [range[0].min(value), range[1].max(value)];
        }
    }
    range
}

#[test]
fn each_class_moves_as_it_says() {
    let speed = |path: &Path, i: usize| path.velocity[i].norm();
    let forward = |path: &Path, i: usize| (path.ned_from_vehicle[i].inverse() * path.velocity[i]).x;
    let sideways = |path: &Path, i: usize| {
        (path.ned_from_vehicle[i].inverse() * path.velocity[i])
            .y
            .abs()
    };
    let tilt = |path: &Path, i: usize| {
        let down = path.ned_from_vehicle[i] * Vector3::z();
        down.xy().norm().atan2(down.z).to_degrees()
    };
    for class in WorldClass::ALL {
        let [slowest, fastest] = range(class, speed);
        let ([back, _], [_, side], [_, tilted]) = (
            range(class, forward),
            range(class, sideways),
            range(class, tilt),
        );
        let seen = format!(
            "{class:?}: {slowest} to {fastest} m/s, back {back}, side {side}, tilt {tilted}"
        );
        let (speeds, reverse, most_side, tilts) = match class {
            WorldClass::CarSmooth | WorldClass::CarPhone => ([12.0, 32.0], false, 1.5, [1.0, 12.0]),
            WorldClass::CarRough => ([12.0, 32.0], false, 3.0, [1.0, 15.0]),
            WorldClass::CarParking => ([1.5, 7.0], true, 2.0, [0.1, 9.0]),
            WorldClass::Bicycle => ([4.0, 11.0], false, 2.5, [8.0, 25.0]),
            WorldClass::DroneSideways => ([4.0, 18.0], true, 18.0, [5.0, 50.0]),
            WorldClass::DroneHovering => ([0.3, 5.0], true, 5.0, [2.0, 50.0]),
            WorldClass::Ship => ([2.0, 13.0], true, 3.0, [0.3, 30.0]),
            WorldClass::Pedestrian => ([1.0, 2.8], true, 2.8, [2.0, 35.0]),
        };
        assert!(
            slowest < 1.0 && (speeds[0]..speeds[1]).contains(&fastest),
            "{seen}"
        );
        assert!(reverse || back > -0.3, "{seen}");
        assert!(
            side < most_side && (tilts[0]..tilts[1]).contains(&tilted),
            "{seen}"
        );
    }
    assert!(
        range(WorldClass::CarParking, forward)[0] < -1.0,
        "it reverses"
    );
    assert!(
        range(WorldClass::DroneSideways, sideways)[1] > 4.0,
        "it flies sideways"
    );
}

#[test]
fn a_bicycle_leans_into_its_turns_and_a_car_does_not() {
    // Sideways force over sideways acceleration, from the truth.
    let felt = |class| {
        let (_, unit, samples) = noiseless(class, 3);
        let [w, x, y, z] = unit.unit_from_vehicle;
        let vehicle_from_unit =
            nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z))
                .inverse();
        let force = samples
            .iter()
            .map(|s| (vehicle_from_unit * s.specific_force).y.powi(2));
        (force.sum::<f64>() / samples.len() as f64).sqrt()
    };
    assert!(felt(WorldClass::Bicycle) < 0.6 && felt(WorldClass::CarSmooth) > 0.6);
}

/// Receivers of many worlds, with their class.
fn receivers() -> impl Iterator<Item = (u64, WorldReceiver)> {
    (0..600).map(|number| {
        let seed = run_seed(1, number);
        let mut draws = Draws::new(seed, "receiver/errors");
        (
            number,
            WorldReceiver::draw(WorldClass::of(number), 180.0, &mut draws),
        )
    })
}

#[test]
fn receivers_are_as_various_as_the_table_says() {
    let share = |asked: &dyn Fn(&WorldReceiver) -> bool| {
        receivers().filter(|(_, receiver)| asked(receiver)).count() as f64 / 600.0
    };
    let near = |share: f64, expected: f64| (share - expected).abs() < 0.06;
    assert!(near(share(&|r| r.velocity_std_m_s.is_some()), 0.5));
    assert!(near(share(&|r| r.position_std_m < 0.316), 0.5));
    assert!(share(&|r| (0.0999..=10.01).contains(&r.position_stated)) > 0.999);
    assert!(
        share(&|r| (0.45..2.2).contains(&r.position_stated)) > 0.6,
        "most state about the truth"
    );
    assert!(
        share(&|r| r.position_stated < 0.2) > 0.01 && share(&|r| r.position_stated > 5.0) > 0.01
    );
    assert!(
        share(&|r| (0.0..=0.3).contains(&r.latency_s)) > 0.999
            && share(&|r| r.latency_s > 0.2) > 0.1
    );
    let having = |kind| share(&|r: &WorldReceiver| r.faults.iter().any(|fault| fault.kind == kind));
    assert!(near(having(FaultKind::Outlier), 0.25) && near(having(FaultKind::Outage), 0.3));
    assert!(near(having(FaultKind::Drift), 0.12) && near(having(FaultKind::Frozen), 0.1));
    assert!(near(having(FaultKind::Stale), 0.05));
}

/// A world of car-smooth with this receiver.
fn with_receiver(
    change: impl Fn(&mut WorldReceiver),
) -> (Vec<WorldSample>, WorldReceiver, Vec<WorldFix>) {
    let (path, unit, samples) = noiseless(WorldClass::CarSmooth, 5);
    let mut receiver = WorldReceiver {
        rate_hz: 10.0,
        position_std_m: 0.5,
        correlated_fraction: 0.0,
        position_stated: 3.0,
        velocity_std_m_s: Some(0.2),
        velocity_stated: 0.5,
        latency_s: 0.25,
        lever_arm_m: [0.2, -0.3, 0.5],
        faults: Vec::new(),
    };
    change(&mut receiver);
    let fixes = receiver.measure(&path, &samples, &unit, 8);
    (samples, receiver, fixes)
}

/// Error of a fix against the truth of its own time.
fn errors(samples: &[WorldSample], fixes: &[WorldFix]) -> Vec<Vector3<f64>> {
    let truth = |fix: &WorldFix| {
        samples
            .iter()
            .find(|s| (s.time_s - fix.time_s).abs() < 1e-9)
    };
    let error = |fix: &WorldFix| fix.position[0] - truth(fix).unwrap().antenna;
    fixes.iter().map(error).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = values.fold((0.0, 0.0), |(n, sum), v| (n + 1.0, sum + v * v));
    (sum / f64::max(n, 1.0)).sqrt()
}

#[test]
fn a_receiver_errs_by_what_it_says() {
    let (samples, receiver, fixes) = with_receiver(|_| ());
    assert!(fixes.len() > 1190, "{}", fixes.len());
    let white = errors(&samples, &fixes);
    assert!((rms(white.iter().map(|e| e.x)) / 0.5 - 1.0).abs() < 0.1);
    assert!((rms(white.iter().map(|e| e.z)) / 0.9 - 1.0).abs() < 0.1);
    for fix in &fixes {
        let late = fix.stamp_ns as f64 * 1e-9 - fix.time_s;
        assert!((late - receiver.latency_s).abs() < 1e-8);
        assert!((fix.position[1] - Vector3::new(1.5, 1.5, 2.7)).norm() < 1e-12);
        assert!((fix.velocity.unwrap()[1] - Vector3::repeat(0.1)).norm() < 1e-12);
    }
    let speeds = fixes.iter().filter_map(|fix| {
        let truth = samples
            .iter()
            .find(|s| (s.time_s - fix.time_s).abs() < 1e-9)?;
        Some(fix.velocity?[0].x - truth.velocity.x)
    });
    assert!((rms(speeds) / 0.2 - 1.0).abs() < 0.15);

    let (samples, _, fixes) = with_receiver(|receiver| receiver.correlated_fraction = 0.98);
    let slow = errors(&samples, &fixes);
    let step = |errors: &[Vector3<f64>]| rms(errors.windows(2).map(|w| w[1].x - w[0].x));
    assert!(step(&slow) < 0.3 * step(&white), "neighbours are alike");
}

#[test]
fn faults_are_where_they_say() {
    let fault = |kind, from_s, until_s, size_m| Fault {
        kind,
        from_s,
        until_s,
        size_m,
        direction: [0.6, -0.8],
    };
    let (samples, _, fixes) = with_receiver(|receiver| {
        receiver.position_std_m = 1e-6;
        receiver.faults = vec![
            fault(FaultKind::Stale, 0.0, 0.0, 5e4),
            fault(FaultKind::Outlier, 10.0, 10.0, 3e3),
            fault(FaultKind::Outage, 20.0, 40.0, 0.0),
            fault(FaultKind::Frozen, 50.0, 55.0, 0.0),
            fault(FaultKind::Drift, 58.0, 118.0, 30.0),
        ];
    });
    let errors = errors(&samples, &fixes);
    let mut counts = [0; 4];
    for (k, (fix, error)) in fixes.iter().zip(&errors).enumerate() {
        let off = error.xy().norm();
        assert!(!(20.0..40.0).contains(&fix.time_s));
        match fix.fault {
            None => assert!(off < 1e-4, "{k}: {off}"),
            Some(FaultKind::Stale) => assert!(k == 0 && (off - 5e4).abs() < 1.0),
            Some(FaultKind::Outlier) => assert!((off - 3e3).abs() < 1.0 && fix.time_s < 10.11),
            Some(FaultKind::Frozen) => {
                assert!((fix.position[0] - fixes[k - 1].position[0]).norm() < 1e-12);
            }
            Some(FaultKind::Drift) => assert!(off < 30.01 && error.x * -0.8 - error.y * 0.6 < 1e-3),
            Some(FaultKind::Outage) => panic!("an outage has no fixes"),
        }
        for (count, kind) in counts.iter_mut().zip([
            FaultKind::Stale,
            FaultKind::Outlier,
            FaultKind::Frozen,
            FaultKind::Drift,
        ]) {
            *count += i32::from(fix.fault == Some(kind));
        }
    }
    assert_eq!(counts[..2], [1, 1]);
    assert!(
        (49..=51).contains(&counts[2]) && (595..=601).contains(&counts[3]),
        "{counts:?}"
    );
    let most = errors
        .iter()
        .filter(|e| e.norm() < 100.0)
        .map(|e| e.xy().norm());
    assert!(
        (most.fold(0.0, f64::max) - 30.0).abs() < 0.1,
        "the drift comes to its size"
    );
}

#[test]
fn a_unit_errs_by_what_it_says() {
    let (path, unit, truth) = noiseless(WorldClass::DroneSideways, 6);
    let mut quiet = InertialUnit {
        vibration_m_s2: 0.0,
        vibration_rad_s: 0.0,
        gyroscope_bias_random_walk: 0.0,
        accelerometer_bias_random_walk: 0.0,
        gyroscope_bias_rad_s: [0.01, 0.0, 0.0],
        accelerometer_bias_m_s2: [0.0, 0.0, -0.2],
        bias_jumps: vec![BiasJump {
            time_s: 60.0,
            gyroscope_rad_s: [0.0, 0.02, 0.0],
            accelerometer_m_s2: [0.0; 3],
        }],
        ..unit
    };
    let residuals = |unit: &InertialUnit| -> Vec<[Vector3<f64>; 2]> {
        let mut measured = truth.clone();
        unit.measure(&mut measured, &path, 1);
        let pairs = measured.iter().zip(&truth);
        pairs
            .map(|(m, t)| {
                [
                    m.angular_rate - t.angular_rate,
                    m.specific_force - t.specific_force,
                ]
            })
            .collect()
    };
    let errors = residuals(&quiet);
    let root = quiet.rate_hz.sqrt();
    let white = rms(errors.iter().map(|[rate, _]| rate.z)) / (quiet.gyroscope_noise_density * root);
    assert!((white - 1.0).abs() < 0.05, "{white}");
    let white =
        rms(errors.iter().map(|[_, force]| force.x)) / (quiet.accelerometer_noise_density * root);
    assert!((white - 1.0).abs() < 0.05, "{white}");
    let half = errors.len() / 2;
    let mean = |part: &[[Vector3<f64>; 2]]| {
        part.iter()
            .fold([Vector3::zeros(); 2], |[a, b], [c, d]| [a + c, b + d])
            .map(|sum| sum / part.len() as f64)
    };
    let ([early, force], [late, _]) = (mean(&errors[..half]), mean(&errors[half..]));
    assert!((early - Vector3::new(0.01, 0.0, 0.0)).norm() < 1e-3 && (late.y - 0.02).abs() < 1e-3);
    assert!((force.z + 0.2).abs() < 0.01);

    quiet.vibration_m_s2 = 2.0;
    quiet.vibration_hz = 0.2 * quiet.rate_hz;
    let shaken = rms(residuals(&quiet).iter().map(|[_, force]| force.y));
    // A craft that takes off shakes for a part of the time only; 0.97 is the low-pass.
    let shake = rms(path.shake.iter().copied());
    assert!(
        (shaken / (2.0 * 0.97 * shake) - 1.0).abs() < 0.15,
        "{shaken} {shake}"
    );

    quiet.saturation = Some([0.3, 11.0]);
    let mut measured = truth.clone();
    quiet.measure(&mut measured, &path, 1);
    let largest = measured
        .iter()
        .map(|s| s.specific_force.amax())
        .fold(0.0, f64::max);
    assert!((largest - 11.0).abs() < 1e-9);
}

#[test]
fn units_are_as_various_as_the_table_says() {
    let units: Vec<InertialUnit> = (0..600)
        .map(|number| {
            let mut draws = Draws::new(run_seed(1, number), "imu/errors");
            InertialUnit::draw(WorldClass::of(number), 180.0, &mut draws)
        })
        .collect();
    let share = |asked: &dyn Fn(&InertialUnit) -> bool| {
        units.iter().filter(|u| asked(u)).count() as f64 / 600.0
    };
    assert!(share(&|u| (5e-6..2e-3).contains(&u.gyroscope_noise_density)) > 0.999);
    assert!(
        share(&|u| u.gyroscope_noise_density < 6e-5) > 0.1
            && share(&|u| u.gyroscope_noise_density > 2e-4) > 0.1
    );
    assert!(share(&|u| (50.0..=200.0).contains(&u.rate_hz)) > 0.999);
    let near = |share: f64, expected: f64| (share - expected).abs() < 0.04;
    assert!(
        near(share(&|u| !u.bias_jumps.is_empty()), 0.1)
            && near(share(&|u| u.saturation.is_some()), 0.04)
    );
    // Four of nine classes always, the others three times in ten.
    assert!(near(share(&|u| u.any_mount), (4.0 + 5.0 * 0.3) / 9.0));
}
