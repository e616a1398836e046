//! Outliers of the receiver: those that later fixes show, the first of all, and those that are impossible.

use super::*;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::collections::BTreeSet;
use std::vec::Vec;

/// Standard deviation of a position, m.
const STD: f64 = 0.05;

/// What came of a run.
struct Run {
    made: InMotionAlignment<f64>,
    /// How far off it is at the end, m.
    error: f64,
    /// Times of the fixes that were left out at any time, s.
    left_out: BTreeSet<u32>,
}

/// Circles without turning with noise at a speed (m/s) of their middle to the north, `seconds` long, and a fix every `every`
/// seconds; `off` gives what it is off by, m.
fn circles(seconds: u32, every: u32, speed: f64, off: impl Fn(f64) -> Vector3<f64>) -> Run {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let mut noise =
        |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
    let mut made = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
    let place = |t: f64| Vector3::new(-t.cos(), -t.sin(), 0.0) * 4.0 + Vector3::x() * speed * t;
    let mut left_out = BTreeSet::new();
    for k in 0..=seconds * 100 {
        let t = f64::from(k) * 0.01;
        if k > 0 && k % (every * 100) == 0 {
            made.gnss_position(&GnssPosition {
                ned: place(t) + noise(STD) + off(t),
                std: Vector3::repeat(STD),
                has_height: true,
            });
            left_out.extend(times_left_out(&made, t));
        }
        let t = t + 0.005;
        let force = Vector3::new(4.0 * t.cos(), 4.0 * t.sin(), -9.806_65);
        let (rate, force) = (noise(2e-3), force + noise(0.05));
        made.propagate(&rate, &force, 0.01).unwrap();
    }
    // One sample behind the last fix.
    let error = made.solution().unwrap().position - place(f64::from(seconds) + 0.01);
    Run {
        made,
        error: error.norm(),
        left_out,
    }
}

/// Times (s) of the fixes of the window that are left out, at the time of the newest.
fn times_left_out(made: &InMotionAlignment<f64>, newest: f64) -> Vec<u32> {
    let mut t = newest;
    let mut times = Vec::new();
    for interval in made.memory.window.intervals().iter().rev() {
        if interval.outlier_std > 0.0 {
            times.push(t.round() as u32);
        }
        t -= interval.inertial.duration_s();
    }
    times
}

#[test]
fn where_there_is_no_outlier_no_fix_is_left_out() {
    for every in [1, 5] {
        let run = circles(60 * every, every, 0.0, |_| Vector3::zeros());
        assert!(run.error < 0.2, "{}", run.error);
        assert_eq!((run.left_out, run.made.restarts()), (BTreeSet::new(), 0));
    }
}

/// Five seconds apart and with the heading unknown the samples allow metres: what they cannot contradict later fixes do.
#[test]
fn an_outlier_that_the_samples_allow_is_left_out_once_later_fixes_show_it() {
    let outlier = Vector3::new(14.0, -9.0, 3.0);
    for at in [15, 20] {
        let off = |t: f64| outlier * f64::from(u8::from((t - f64::from(at)).abs() < 0.1));
        let run = circles(40, 5, 0.0, off);
        assert!(run.error < 0.3, "{at} {}", run.error);
        assert_eq!((run.left_out, run.made.restarts()), ([at].into(), 0));
        let (state, _) = run.made.hand_over().unwrap();
        assert!(state.gyroscope_bias.norm() < 0.01);
    }
}

/// Ten outliers as each of the first four fixes: how many have done no harm half a minute later. All of them is the target; as
/// the first fix one still does.
#[test]
fn outliers_among_the_first_fixes_mostly_do_no_harm() {
    const OUTLIERS: [[f64; 2]; 10] = [
        [12.0, 0.0],
        [24.0, 0.0],
        [0.0, 24.0],
        [40.0, 0.0],
        [0.0, 40.0],
        [-40.0, 0.0],
        [0.0, -40.0],
        [60.0, 0.0],
        [0.0, 60.0],
        [-60.0, 20.0],
    ];
    for (at, least) in [(5, 9), (10, 10), (15, 10), (20, 10)] {
        let is_cured = |[north, east]: &[f64; 2]| {
            let is_then = |t: f64| f64::from(u8::from((t - f64::from(at)).abs() < 0.1));
            let off = |t: f64| Vector3::new(*north, *east, 0.0) * is_then(t);
            circles(45, 5, 0.0, off).error < 0.3
        };
        let cured = OUTLIERS.iter().filter(|outlier| is_cured(outlier)).count();
        assert!(cured >= least, "{at}: {cured} of {}", OUTLIERS.len());
    }
}

/// Two impossible fixes among the first few are another place only where they lie together.
#[test]
fn gross_errors_that_lie_apart_are_no_other_place() {
    let apart = |t: f64| match t as u32 {
        5 => Vector3::x() * 5e3,
        6 => Vector3::y() * 4e5,
        _ => Vector3::zeros(),
    };
    let run = circles(10, 1, 0.0, apart);
    assert!(run.error < 0.5, "{}", run.error);
    assert_eq!(run.made.restarts(), 0);
}

/// A first fix of long ago, on a vehicle that stays and on aircraft; what is faster than can be expected contradicts its first fix, too.
#[test]
fn it_begins_again_behind_a_first_fix_of_long_ago() {
    for (speed, of_long_ago, restarts) in [
        (0.0, 4e5, 1),
        (150.0, 4e5, 1),
        (250.0, 4e5, 1),
        (250.0, 0.0, 1),
        (700.0, 0.0, 2),
    ] {
        let stale = |t: f64| Vector3::y() * if t < 1.5 { of_long_ago } else { 0.0 };
        let run = circles(30, 1, speed, stale);
        assert!(run.error < 0.5, "{speed} {}", run.error);
        assert_eq!(run.made.restarts(), restarts, "{speed}");
    }
}

/// Later a fix far away is another place only where one more lies there.
#[test]
fn one_fix_elsewhere_among_the_first_few_is_none() {
    let elsewhere = |t: f64| Vector3::y() * if (t - 3.0).abs() < 0.5 { 4e5 } else { 0.0 };
    let run = circles(30, 1, 0.0, elsewhere);
    assert!(run.error < 0.2, "{}", run.error);
    assert_eq!(run.made.restarts(), 0);
}

/// What begins from a filter's state knows a heading, which it would lose to a second fix that is an outlier.
#[test]
fn behind_a_state_that_is_known_the_second_fix_is_none_either() {
    let mut made = circles(30, 1, 0.0, |_| Vector3::zeros()).made;
    let (state, _) = made.hand_over().unwrap();
    made.begin_from(&state, 1.0);
    let begun = made.restarts();
    for (second, off) in [(0, 0.0), (1, 4e5), (2, 0.0)] {
        let ned = state.position + Vector3::y() * off;
        let fix = GnssPosition {
            ned,
            std: Vector3::repeat(1.0),
            has_height: true,
        };
        made.gnss_position(&fix);
        assert_eq!(made.restarts(), begun, "{second}");
        for _ in 0..100 {
            made.propagate(&Vector3::zeros(), &-Vector3::z().scale(9.806_65), 0.01)
                .unwrap();
        }
    }
}
