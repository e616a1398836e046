//! Arrivals are drawn; the instants at which samples were taken are known.

use rand::RngExt as _;
use rand_pcg::Pcg64;

use super::*;
use std::vec::Vec;

fn ns(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

/// Instants that a clock gives for these stamps after it has looked at the first of them, s; none for a sample that is no newer.
fn given(stamps: &[i64]) -> (Vec<Option<f64>>, SamplingClock<f64>) {
    let mut clock = SamplingClock::default();
    for stamp in stamps.iter().take(96) {
        clock.arrived(*stamp);
    }
    let mut clock = clock.rewound();
    let instants: Vec<_> = stamps.iter().map(|stamp| clock.arrived(*stamp)).collect();
    let known: Vec<_> = instants.iter().flatten().collect();
    assert!(known.is_sorted_by(|a, b| a < b), "instants increase");
    let instants = instants.iter().map(|t| t.map(|t| t as f64 * 1e-9));
    (instants.collect(), clock)
}

/// Stamps of samples that were taken every `interval` seconds, delivered `size` at a time with stamps that are `apart` seconds apart.
fn bunches(count: usize, interval: f64, (size, apart): (usize, f64), jitter: f64) -> Vec<i64> {
    let mut draws = Pcg64::new(size as u128, 1);
    let mut arrival = 0.0;
    let stamp = |k: usize| {
        if k.is_multiple_of(size) {
            let end = (k + size - 1) as f64;
            arrival = (end + jitter * (draws.random::<f64>() - 0.5)) * interval;
        }
        ns(1.0 + arrival + apart * (k % size) as f64)
    };
    (0..count).map(stamp).collect()
}

fn worst(instants: &[Option<f64>], interval: f64) -> f64 {
    let off = |(k, t): (usize, &Option<f64>)| (t.unwrap() - 1.0 - k as f64 * interval).abs();
    instants.iter().enumerate().map(off).fold(0.0, f64::max) / interval
}

#[test]
fn samples_of_bunches_get_the_instants_of_the_sensors_clock() {
    for size in [2, 3, 4, 5, 6, 8, 10] {
        for interval in [0.05, 0.01, 0.002] {
            for apart in [0.0, 0.02 * interval] {
                let stamps = bunches(2000, interval, (size, apart), 0.0);
                let (instants, clock) = given(&stamps);
                assert!(clock.is_bunched());
                let worst = worst(&instants, interval);
                // The last of a bunch is read later than it is taken.
                let late = apart * (size - 1) as f64 / interval;
                assert!(worst < 0.02 + late, "{size} {interval} {apart}: {worst}");
                let off = clock.interval_s().unwrap() / interval - 1.0;
                assert!(off.abs() < 1e-3, "{off}");
                // Arrivals that vary.
                let stamps = bunches(2000, interval, (size, apart), 0.5);
                let (instants, _) = given(&stamps);
                let worst = self::worst(&instants, interval);
                assert!(worst < 0.6, "{size} {interval} {apart}: {worst}");
            }
        }
    }
}

/// A radio that sends what it has after each of its random waits.
#[test]
fn packets_of_any_size_are_put_apart() {
    let interval = 0.01;
    for seed in 0..20_u32 {
        let mut draws = Pcg64::new(u128::from(seed), 1);
        let (mut stamps, mut next) = (Vec::new(), 0.0);
        for k in 0..3000 {
            let taken = f64::from(k) * interval;
            while next < taken {
                next += interval * (1.0 + 8.0 * draws.random::<f64>());
            }
            stamps.push(ns(1.0 + next));
        }
        let (instants, clock) = given(&stamps);
        assert!(clock.is_bunched(), "{seed}");
        // The packet's wait is on average half an interval behind its last sample.
        let squares = instants.iter().enumerate().skip(64).map(|(k, t)| {
            let off = (t.unwrap() - 1.0) / interval - k as f64 - 0.5;
            off * off
        });
        let rms = (squares.sum::<f64>() / (instants.len() - 64) as f64).sqrt();
        assert!(rms < 0.5, "{seed}: {rms} intervals");
    }
}

#[test]
fn stamps_that_are_not_bunched_are_passed_on() {
    for seed in 0..40_u32 {
        let mut draws = Pcg64::new(u128::from(seed), 1);
        // Intervals that vary by up to half; holes of up to 3 s; a rate that changes; samples that are lost.
        let (jitter, hole) = (0.49 * draws.random::<f64>(), 3.0 * draws.random::<f64>());
        let (loss, mut interval) = (0.3 * draws.random::<f64>(), 0.01);
        let (mut taken, mut stamps) = (0.0, Vec::new());
        for k in 0..4000 {
            if k == 2000 {
                interval *= if seed % 2 == 0 { 5.0 } else { 0.2 };
            }
            taken += interval;
            if draws.random::<f64>() < 0.003 {
                taken += hole;
            }
            let stamp = taken + interval * jitter * (2.0 * draws.random::<f64>() - 1.0);
            if draws.random::<f64>() > loss && stamps.last().is_none_or(|last| *last < ns(stamp)) {
                stamps.push(ns(stamp));
            }
        }
        let (instants, clock) = given(&stamps);
        assert!(!clock.is_bunched(), "{seed}");
        for (stamp, instant) in stamps.iter().zip(instants) {
            assert_eq!(Some(*stamp), instant.map(ns), "{seed}");
        }
    }
    // Equal ones, and those that go back, are no instants of their own.
    let (instants, _) = given(&[5, 5, 4, 6]);
    let instants: Vec<_> = instants.iter().map(|t| t.map(ns)).collect();
    assert_eq!(instants, [Some(5), None, None, Some(6)]);
}

#[test]
fn behind_a_hole_and_another_rate_the_clock_is_found_again() {
    let interval = 0.01;
    for size in [2, 4, 8] {
        for hole in [0.15, 0.4, 2.0, 60.0] {
            let mut stamps = bunches(1000, interval, (size, 0.0), 0.0);
            let more = bunches(1000, interval, (size, 0.0), 0.0);
            stamps.extend(more.iter().map(|t| t + ns(hole + 1000.0 * interval)));
            let (instants, _) = given(&stamps);
            let behind: Vec<_> = instants[1000..]
                .iter()
                .map(|t| t.map(|t| t - hole - 1000.0 * interval))
                .collect();
            for (k, t) in behind.iter().enumerate().skip(4 * size) {
                let off = (t.unwrap() - 1.0) / interval - k as f64;
                assert!(off.abs() < 0.1, "{size} {hole} {k}: {off}");
            }
        }
        for faster in [0.5, 0.8, 1.3, 2.0] {
            let mut stamps = bunches(1000, interval, (size, 0.0), 0.0);
            let more = bunches(2000, interval * faster, (size, 0.0), 0.0);
            stamps.extend(more.iter().map(|t| t + ns(1000.0 * interval)));
            let (instants, clock) = given(&stamps);
            assert!(clock.is_bunched(), "{size} {faster}");
            for (k, t) in instants[1000..].iter().enumerate().skip(300) {
                let taken = 1.0 + 1000.0 * interval + k as f64 * interval * faster;
                let off = (t.unwrap() - taken) / interval;
                assert!(off.abs() < 0.5, "{size} {faster} {k}: {off}");
            }
        }
    }
}

#[test]
fn what_ceases_to_be_bunched_is_passed_on() {
    let mut stamps = bunches(1000, 0.01, (5, 0.0), 0.0);
    stamps.extend((0..1000).map(|k| ns(11.0 + 0.01 * f64::from(k))));
    let (instants, clock) = given(&stamps);
    assert!(!clock.is_bunched());
    for (stamp, instant) in stamps.iter().zip(&instants).skip(1300) {
        assert_eq!(Some(*stamp), instant.map(ns));
    }
}

#[test]
fn any_stamps_give_instants_that_increase() {
    let mut draws = Pcg64::new(7, 1);
    for _ in 0..200 {
        let mut clock = SamplingClock::<f32>::default();
        let (mut time_ns, mut last) = (i64::MIN, i64::MIN);
        for _ in 0..300 {
            let exponent = draws.random_range(0..63);
            let step = draws.random_range(0..=(1_i64 << exponent));
            time_ns = time_ns.saturating_add(if draws.random::<bool>() { step } else { 0 });
            if let Some(instant) = clock.arrived(time_ns) {
                assert!(instant > last || instant == i64::MAX);
                last = instant;
            }
        }
    }
}
