//! Outliers of the receiver: those that later fixes show, the first of all, and those that are impossible.

use super::*;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Standard deviation of a position, m.
const STD: f64 = 0.05;

/// Circles without turning with noise, `seconds` long, and a fix every `every` seconds; `off` gives what it is off by, m. Gives
/// the alignment, and how far off it is at the end, m.
fn circles(
    seconds: u32,
    every: u32,
    off: impl Fn(f64) -> Vector3<f64>,
) -> (InMotionAlignment<f64>, f64) {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let mut noise =
        |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
    let mut made = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
    let place = |t: f64| Vector3::new(-t.cos(), -t.sin(), 0.0) * 4.0;
    for k in 0..=seconds * 100 {
        let t = f64::from(k) * 0.01;
        if k > 0 && k % (every * 100) == 0 {
            made.gnss_position(&GnssPosition {
                ned: place(t) + noise(STD) + off(t),
                std: Vector3::repeat(STD),
                has_height: true,
            });
        }
        let t = t + 0.005;
        let force = Vector3::new(4.0 * t.cos(), 4.0 * t.sin(), -9.806_65);
        let (rate, force) = (noise(2e-3), force + noise(0.05));
        made.propagate(&rate, &force, 0.01).unwrap();
    }
    let error = made.solution().unwrap().position - place(f64::from(seconds));
    (made, error.norm())
}

/// The fixes of the window that are left out.
fn left_out(made: &InMotionAlignment<f64>) -> usize {
    let intervals = made.memory.window.intervals().iter();
    intervals.filter(|one| one.outlier_std > 0.0).count()
}

#[test]
fn where_there_is_no_outlier_no_fix_is_left_out() {
    for every in [1, 5] {
        let (made, error) = circles(60 * every, every, |_| Vector3::zeros());
        assert!(error < 0.2, "{error}");
        assert_eq!((left_out(&made), made.restarts()), (0, 0));
    }
}

/// Five seconds apart and with the heading unknown the samples allow metres: what they cannot contradict later fixes do.
#[test]
fn an_outlier_that_the_samples_allow_is_left_out_once_later_fixes_show_it() {
    let outlier = Vector3::new(14.0, -9.0, 3.0);
    for at in [15.0, 20.0] {
        let off = |t: f64| outlier * f64::from(u8::from((t - at).abs() < 0.1));
        let (made, error) = circles(40, 5, off);
        assert!(error < 0.3, "{at} {error}");
        assert_eq!((left_out(&made), made.restarts()), (1, 0));
        let (state, _) = made.hand_over().unwrap();
        assert!(state.gyroscope_bias.norm() < 0.01);
    }
}

#[test]
fn the_first_fix_may_be_the_outlier() {
    let off = |t: f64| Vector3::x() * if t < 6.0 { 24.0 } else { 0.0 };
    let (made, error) = circles(35, 5, off);
    assert!(error < 0.3, "{error}");
    assert_eq!(made.restarts(), 0);
}

/// Two impossible fixes among the first few are another place only where they lie together.
#[test]
fn gross_errors_that_lie_apart_are_no_other_place() {
    let apart = |t: f64| match t as u32 {
        5 => Vector3::x() * 5e3,
        6 => Vector3::y() * 4e5,
        _ => Vector3::zeros(),
    };
    let (made, error) = circles(10, 1, apart);
    assert!(error < 0.5, "{error}");
    assert_eq!(made.restarts(), 0);
    let stale = |t: f64| Vector3::x() * if t < 1.5 { 4e5 } else { 0.0 };
    let (made, error) = circles(10, 1, stale);
    assert!(error < 0.5, "{error}");
    assert_eq!(made.restarts(), 1);
}
