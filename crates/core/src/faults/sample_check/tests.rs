//! Each fault on a smooth motion, and what is none.

use super::*;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::vec::Vec;

const DT_NS: i64 = 10_000_000;

/// A hand that turns a device, with the noise of its gyroscope, rad/s.
fn hand(seed: u64, noise: f64) -> impl FnMut(i64) -> Vector3<f64> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    move |k| {
        let t = k as f64 * 0.01;
        let moving = Vector3::new(
            1.5 * (3.0 * t).sin() + 0.4 * (17.0 * t).cos(),
            (2.3 * t + 1.0).sin() * 0.9,
            0.7 * (4.1 * t).cos() - 0.3 * (11.0 * t).sin(),
        );
        moving + Vector3::from_fn(|_, _| noise * rng.sample::<f64, _>(StandardNormal))
    }
}

/// What is said of samples 0 to `count`.
fn said(count: i64, mut sample: impl FnMut(i64) -> Vector3<f64>) -> Vec<Checked<f64>> {
    let mut check = SampleCheck::default();
    let said = (0..count).map(|k| check.check(k * DT_NS, &sample(k)));
    said.collect()
}

fn is_quiet(said: &[Checked<f64>]) -> bool {
    let fine = |c: &Checked<f64>| matches!(c, Checked::Good | Checked::Suspect | Checked::Step(_));
    said.iter().all(fine)
}

#[test]
fn one_sample_at_full_scale_is_a_spike_and_its_neighbours_are_good() {
    let mut motion = hand(1, 0.01);
    let said = said(1000, |k| {
        let w = motion(k);
        if k == 500 {
            Vector3::new(34.9, w.y, w.z)
        } else {
            w
        }
    });
    assert_eq!(said[500], Checked::Suspect);
    let Checked::Spike { from_ns, size } = said[501] else {
        panic!("{:?}", said[501])
    };
    assert!(from_ns == 499 * DT_NS && (size - 34.9).abs() < 2.0);
    assert!(is_quiet(&said[..500]) && is_quiet(&said[502..]));
}

#[test]
fn a_spike_in_a_motion_after_a_rest_is_a_spike_and_no_noise() {
    let mut motion = hand(12, 0.002);
    let said = said(1200, |k| {
        let w = motion(k);
        match k {
            ..800 => w * 1e-3,
            1000 => Vector3::new(34.9, w.y, w.z),
            _ => w,
        }
    });
    assert!(
        matches!(said[1001], Checked::Spike { .. }),
        "{:?}",
        said[1001]
    );
    assert!(is_quiet(&said[..1000]) && is_quiet(&said[1002..]));
}

/// A phone on a desk, whose browser rounds: it has read zeros since the beginning, and nothing is known of its changes.
#[test]
fn a_spike_among_zeros_is_a_spike_and_the_first_motion_is_none() {
    let said = said(1000, |k| match k {
        500 => Vector3::new(34.9, 0.0, 0.0),
        800.. => Vector3::new(0.1, 0.2, -0.1) * (k - 799) as f64,
        _ => Vector3::zeros(),
    });
    assert_eq!(said[500], Checked::Suspect);
    assert!(matches!(said[501], Checked::Spike { size, .. } if (size - 34.9).abs() < 1e-9));
    assert!(is_quiet(&said[..500]) && is_quiet(&said[502..]));
}

#[test]
fn a_spike_just_after_a_wild_motion_is_found_at_a_low_rate_too() {
    let mut motion = hand(13, 1e-4);
    let said = said(400, |k| {
        // Twenty samples a second: from one to the next it changes by some rad/s.
        let w = motion(5 * k);
        match k {
            ..300 => w * 3.0,
            320 => Vector3::new(34.9, 0.0, 0.0),
            _ => w * 1e-3,
        }
    });
    assert!(
        matches!(said[321], Checked::Spike { .. }),
        "{:?}",
        said[321]
    );
    assert!(is_quiet(&said[..320]) && is_quiet(&said[322..]));
}

#[test]
fn a_sudden_turn_is_a_step_and_its_integral_is_kept() {
    let mut still = hand(10, 0.0);
    let turned = |k: i64| still(k) * 1e-3 + Vector3::x() * if k < 100 { 0.0 } else { 5.0 };
    let said = said(200, turned);
    assert_eq!(said[100], Checked::Suspect);
    let Checked::Step(integral) = said[101] else {
        panic!("{:?}", said[101])
    };
    assert!((integral.x - (0.5 * 5.0 + 5.0) * 0.01).abs() < 1e-4);
    assert!(is_quiet(&said));
}

/// At a sixtieth of a second, from a rest to 1000 deg/s in a tenth.
#[test]
fn a_fast_turn_that_begins_waits_once_at_most() {
    let mut still = hand(13, 0.002);
    let turned = |k: i64| {
        let since = (k - 200).clamp(0, 6) as f64 / 6.0;
        still(0) * 1e-3 + Vector3::new(17.0, -4.0, 2.0) * (since * since * (3.0 - 2.0 * since))
    };
    let said = said(400, turned);
    let waits = |c: &&Checked<f64>| matches!(c, Checked::Suspect);
    assert!(said.iter().filter(waits).count() <= 1, "{said:?}");
    assert!(is_quiet(&said));
}

#[test]
fn a_gyroscope_that_freezes_in_motion_is_stuck_within_a_twentieth_of_a_second() {
    for (seed, resolution) in [(2, 0.0), (3, 1e-3), (4, 0.02)] {
        let mut motion = hand(seed, 0.01);
        let mut sample = move |k: i64| {
            let w = motion(k);
            if resolution > 0.0 {
                w.map(|c| (c / resolution).round() * resolution)
            } else {
                w
            }
        };
        let frozen = sample(399);
        let said = said(1000, |k| match k {
            399..700 => frozen,
            _ => sample(k),
        });
        let first = said.iter().position(|c| matches!(c, Checked::Stuck { .. }));
        assert!((402..410).contains(&first.unwrap()), "{first:?}");
        assert_eq!(
            said[650],
            Checked::Stuck {
                from_ns: 399 * DT_NS
            }
        );
        assert!(
            is_quiet(&said[..400]) && is_quiet(&said[701..]),
            "{resolution}"
        );
    }
}

#[test]
fn rounding_at_rest_and_samples_that_are_written_twice_are_not_stuck() {
    let mut still = hand(5, 0.004);
    // At rest, rounded to steps larger than the noise.
    let rounded = said(5000, |k| {
        (still(0) * 0.0 + still(k) * 0.0 + Vector3::repeat(1e-4) * (k % 3) as f64)
            .map(|c| (c / 0.01).round() * 0.01)
    });
    assert!(is_quiet(&rounded));
    for copies in [2, 4] {
        let mut motion = hand(6, 0.01);
        let mut last = Vector3::zeros();
        let held = said(5000, |k| {
            if k % copies == 0 {
                last = motion(k);
            }
            last
        });
        // Until it has been seen how often it repeats itself, nothing is concluded from that.
        assert!(is_quiet(&held), "{copies}");
    }
    let exact = |k: i64| Vector3::z() * if k < 300 { 0.0 } else { 0.5 };
    assert!(is_quiet(&said(1000, exact)));
}

#[test]
fn what_is_clipped_is_found_by_the_value_that_repeats() {
    let mut motion = hand(7, 0.01);
    let said = said(1500, |k| {
        let spin = 60.0 * (0.02 * k as f64 - 10.0).sin().max(0.0);
        let spin = if (500..657).contains(&k) { spin } else { 0.0 };
        (motion(k) + Vector3::z() * spin).map(|c| c.clamp(-35.0, 35.0))
    });
    let clipped = |c: &Checked<f64>| matches!(c, Checked::Saturated { full_scale } if (*full_scale - 35.0).abs() < 1e-9);
    // 35 of 60 is passed after 0.31 s of the half wave, and again 0.94 s later.
    let found = said.iter().filter(|c| clipped(c)).count();
    assert!((80..96).contains(&found), "{found}");
    assert!(is_quiet(&said[..500]) && is_quiet(&said[660..]));
}

#[test]
fn white_garbage_is_noise_until_a_moment_after_it_is_over() {
    let mut motion = hand(8, 0.01);
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    let said = said(4000, |k| match k {
        1000..3000 => Vector3::from_fn(|_, _| 6.0 * rng.sample::<f64, _>(StandardNormal)),
        _ => motion(k),
    });
    let unusable = |c: &&Checked<f64>| !c.is_measured();
    assert!(said[1030..3000].iter().filter(unusable).count() > 1950);
    assert!(is_quiet(&said[..1000]) && is_quiet(&said[3030..]));
}

#[test]
fn motions_from_the_desk_to_running_raise_no_alarm() {
    for seed in 0..20 {
        let mut rng = Pcg64Mcg::seed_from_u64(100 + seed);
        let [frequency, size, noise] =
            [2.0, 3.0, 0.02].map(|most: f64| rng.random_range(0.0..most));
        let resolution = [0.0, 1e-4, 2e-3][seed as usize % 3];
        let mut base = hand(200 + seed, noise);
        let said = said(6000, |k| {
            let t = k as f64 * 0.01;
            // It rests, is taken up, and steps shake it.
            let moving = if (t % 20.0) < 8.0 { 0.0 } else { 1.0 };
            let step = (-((t % 0.7) / 0.03).powi(2)).exp();
            let sample = (base)(k) * moving * size
                + Vector3::new(1.0, -0.6, 0.3) * (moving * step * size * frequency)
                + Vector3::from_fn(|_, _| noise * rng.sample::<f64, _>(StandardNormal));
            if resolution > 0.0 {
                sample.map(|c| (c / resolution).round() * resolution)
            } else {
                sample
            }
        });
        let alarm = said.iter().position(|c| {
            !matches!(c, Checked::Good | Checked::Suspect | Checked::Step(_))
                && !matches!(c, Checked::Spike { size, .. } if *size < 1.75)
        });
        assert!(
            alarm.is_none(),
            "seed {seed}: {alarm:?} {:?}",
            said[alarm.unwrap()]
        );
    }
}

/// A table that stops smoothly, under a sensor whose noise is below its rounding.
#[test]
fn a_motion_that_comes_to_rest_is_not_stuck_and_one_that_breaks_off_is() {
    let step = 0.001;
    let rounded = |x: f64| (x / step).round() * step;
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let mut sample = |k: i64, std: f64| {
        let t = k as f64 / 286.0;
        let left = (5.0 - t).max(0.0);
        let begun = (t * t).min(1.0);
        let noise = Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
        Vector3::new(-0.8, -0.7, 0.5) * (left * left * begun) + Vector3::repeat(0.05) + noise
    };
    for std in [0.0, 1e-4, 2e-4, 3e-4] {
        assert!(
            is_quiet(&said(3000, |k| sample(k, std).map(rounded))),
            "{std}"
        );
    }
    for std in [2e-4, 1e-3, 5e-3] {
        let mut held = Vector3::zeros();
        let broken = said(2000, |k| {
            if k < 1000 {
                held = sample(k, std).map(rounded);
            }
            held
        });
        let stuck = broken.iter().any(|c| matches!(c, Checked::Stuck { .. }));
        assert!(stuck, "{std}");
    }
}
