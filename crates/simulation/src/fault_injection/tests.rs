use nalgebra::UnitQuaternion;
use northing_recording::{GnssPosition, Reference};

use super::*;
use crate::attitude_world::{AttitudeWorld, WorldMotion};
use crate::rotation::exp;

fn stream() -> Vec<Event> {
    AttitudeWorld::draw_healthy(1, 0, WorldMotion::Walking, 40.0).events
}

fn named(name: &str) -> &'static InjectedFault {
    InjectedFault::named(name).unwrap()
}

/// Events that differ, with what they were.
fn differing<'a>(clean: &'a [Event], faulty: &'a [Event]) -> Vec<(&'a Event, &'a Event)> {
    assert_eq!(clean.len(), faulty.len());
    clean.iter().zip(faulty).filter(|(a, b)| a != b).collect()
}

#[test]
fn every_fault_touches_its_sensor_from_its_beginning_on_and_nothing_else() {
    let clean = stream();
    let from = onset(&clean, 3).unwrap();
    for fault in &CATALOGUE {
        if fault.target == InjectionTarget::Receiver {
            continue;
        }
        let (faulty, until) = fault.inject(&clean, from, 3);
        assert_eq!(faulty, fault.inject(&clean, from, 3).0, "{}", fault.name);
        assert_eq!(until, from + nanoseconds(fault.duration_s));
        let changed: Vec<&Event> = if matches!(fault.effect, Effect::Missing) {
            clean
                .iter()
                .filter(|event| !faulty.contains(event))
                .collect()
        } else {
            differing(&clean, &faulty)
                .into_iter()
                .map(|(was, _)| was)
                .collect()
        };
        assert!(!changed.is_empty(), "{}", fault.name);
        let stays = matches!(fault.effect, Effect::BiasStep { .. });
        for event in &changed {
            assert!(event.time_ns >= from, "{}", fault.name);
            assert!(
                stays || fault.is_one_sample() || event.time_ns < until,
                "{}",
                fault.name
            );
            let spins = fault.needs_simulation();
            assert!(
                spins || fault.touches(event.sample.kind()),
                "{}",
                fault.name
            );
        }
        if fault.is_one_sample() {
            assert_eq!(changed.len(), 1, "{}", fault.name);
        }
    }
}

#[test]
fn spikes_clips_and_zeros_have_their_sizes() {
    let clean = stream();
    let from = onset(&clean, 3).unwrap();
    let vectors = |name: &str| -> Vec<[Vector3<f64>; 2]> {
        let (faulty, _) = named(name).inject(&clean, from, 3);
        let of = |event: &Event| event.sample.vector().unwrap();
        let pairs = differing(&clean, &faulty);
        pairs
            .into_iter()
            .map(|(was, is)| [of(was), of(is)])
            .collect()
    };
    let one = vectors("gyroscope-spike")[0];
    let at_full_scale =
        |v: &Vector3<f64>| v.iter().filter(|x| (x.abs() - 34.9).abs() < 1e-12).count();
    assert_eq!(at_full_scale(&one[1]), 1);
    assert_eq!(at_full_scale(&vectors("gyroscope-spike-all-axes")[0][1]), 3);
    assert!(
        vectors("gyroscope-zeros-3s")
            .iter()
            .all(|[_, is]| *is == Vector3::zeros())
    );
    let frozen = vectors("gyroscope-frozen-3s");
    assert!(frozen.iter().all(|[_, is]| *is == frozen[0][1]));
    let clipped = vectors("gyroscope-clipped-3s");
    let most = |k: usize| {
        clipped
            .iter()
            .map(|pair| pair[k].amax())
            .fold(0.0, f64::max)
    };
    assert!(
        (most(1) / most(0) - 0.5).abs() < 1e-9,
        "{} {}",
        most(0),
        most(1)
    );
    let steps: Vec<_> = vectors("gyroscope-bias-0.1")
        .iter()
        .map(|[was, is]| is - was)
        .collect();
    assert!(steps.iter().all(|step| (step.norm() - 0.1).abs() < 1e-9));
}

#[test]
fn a_spin_is_the_motion_whose_rates_it_shows() {
    let at = |k: i64| k * 1_000_000;
    let still: Vec<Event> = (0..4000)
        .flat_map(|k| {
            let reference = Reference {
                attitude: UnitQuaternion::identity(),
                scored: true,
            };
            let up = Vector3::new(0.0, 0.0, 9.8);
            [
                Sample::AngularRate(Vector3::zeros()),
                Sample::SpecificForce(up),
                Sample::Reference(reference),
            ]
            .map(|sample| Event {
                time_ns: at(k),
                sample,
            })
        })
        .collect();
    let spin = Spin::new(0, 60.0, [at(500), at(3500)]);
    assert!((spin.rate - 60.0).abs() < 1.2);
    let mut attitude = UnitQuaternion::identity();
    let mut before = 0.0;
    for event in still.iter().map(|event| spin.of(event)) {
        match event.sample {
            Sample::AngularRate(rate) => {
                attitude *= exp(&(Vector3::x() * 0.5e-3 * (rate.x + before)));
                before = rate.x;
            }
            Sample::SpecificForce(force) => {
                assert!((attitude * force - Vector3::new(0.0, 0.0, 9.8)).norm() < 0.01);
            }
            Sample::Reference(reference) => {
                assert!(
                    attitude.angle_to(&reference.attitude) < 1e-3,
                    "{}",
                    event.time_ns
                );
            }
            _ => unreachable!(),
        }
    }
    assert!(attitude.angle() < 1e-3, "whole turns");
}

#[test]
fn a_receiver_freezes_is_silent_or_is_elsewhere_once() {
    let fix = |k: i64| Event {
        time_ns: k * 1_000_000_000,
        sample: Sample::GnssPosition(GnssPosition {
            latitude_rad: 0.5 + 1e-6 * k as f64,
            longitude_rad: 0.1,
            height_m: None,
            std_m: None,
            hdop: None,
            satellites: None,
            quality: northing_recording::GnssQuality::default(),
        }),
    };
    let clean: Vec<_> = (0..100).map(fix).collect();
    let inject = |name: &str| named(name).inject(&clean, 29_500_000_000, 1).0;
    let frozen = inject("receiver-frozen-30s");
    assert_eq!(differing(&clean, &frozen).len(), 30);
    assert!(
        frozen[30..60]
            .iter()
            .all(|event| event.sample == clean[29].sample)
    );
    assert_eq!(inject("receiver-missing-30s").len(), 70);
    let off = inject("fix-10km-off");
    let changed = differing(&clean, &off);
    assert_eq!(changed.len(), 1);
    assert_eq!(changed[0].0.time_ns, 30_000_000_000);
}

#[test]
fn faults_begin_around_a_third_where_it_moves() {
    let clean = stream();
    let (first, last) = (clean[0].time_ns, clean.last().unwrap().time_ns);
    for seed in 0..20 {
        let share = (onset(&clean, seed).unwrap() - first) as f64 / (last - first) as f64;
        assert!((0.27..0.39).contains(&share), "{share}");
    }
    assert_ne!(onset(&clean, 1), onset(&clean, 2));
    assert_eq!(onset(&[], 1), None);
}
