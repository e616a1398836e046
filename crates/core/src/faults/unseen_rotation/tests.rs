//! The closed forms against simulated Gauss-Markov rates, and what is learnt of them.

use super::*;
use approx::assert_relative_eq;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// One that knows a rate of this mean square and correlation time about each axis.
fn known(variance: f64, time: f64) -> UnseenRotation<f64> {
    let squares = [
        Vector3::repeat(variance),
        Vector3::repeat(2.0 * variance / (time * time)),
    ];
    UnseenRotation {
        recent: squares,
        whole: squares,
        seen_s: LONG_MEMORY_S,
    }
}

/// Mean and variance of the turn over `time`, given the rate before it and, for `between`, after it: by regression over
/// simulated rates.
fn simulated(variance: f64, tau: f64, time: f64) -> [[f64; 2]; 2] {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let steps = 200;
    let dt = time / f64::from(steps);
    let kept = (-dt / tau).exp();
    let noise = (variance * (1.0 - kept * kept)).sqrt();
    let runs = 20_000;
    let mut one = [0.0; 3];
    let mut two = [0.0; 3];
    for _ in 0..runs {
        let before = variance.sqrt() * rng.sample::<f64, _>(StandardNormal);
        let (mut rate, mut turn) = (before, 0.0);
        for _ in 0..steps {
            let next = kept * rate + noise * rng.sample::<f64, _>(StandardNormal);
            turn += 0.5 * (rate + next) * dt;
            rate = next;
        }
        for (sums, known) in [(&mut one, before), (&mut two, before + rate)] {
            sums[0] += known * known;
            sums[1] += known * turn;
            sums[2] += turn * turn;
        }
    }
    [one, two].map(|[xx, xy, yy]| [xy / xx, (yy - xy * xy / xx) / f64::from(runs)])
}

#[test]
fn closed_forms_are_what_simulated_rates_do() {
    for (variance, tau, time) in [(1.0, 0.3, 0.1), (4.0, 0.2, 0.5), (0.3, 0.5, 3.0)] {
        let [one, two] = simulated(variance, tau, time);
        let process = known(variance, tau);
        let still = Vector3::zeros();
        let since = process.since(&still, time);
        assert_relative_eq!(since.held_s, one[0], max_relative = 0.05);
        assert_relative_eq!(since.variance, one[1], max_relative = 0.05);
        let between = process.between(&still, &still, time);
        assert_relative_eq!(between.held_s, two[0], max_relative = 0.05);
        assert_relative_eq!(between.variance, two[1], max_relative = 0.05);
    }
}

#[test]
fn short_holes_give_the_trapezoidal_rule_and_series_meet_their_closed_forms() {
    let process = known(1.0, 0.4);
    let still = Vector3::zeros();
    let short = process.between(&still, &still, 0.01);
    assert_relative_eq!(short.held_s, 0.005, max_relative = 1e-3);
    // Either side of the change from series to closed form.
    let at = |time| process.between(&still, &still, time).variance;
    assert_relative_eq!(
        at(0.0401) / at(0.0399),
        (401_f64 / 399.0).powi(3),
        max_relative = 2e-3
    );
    let at = |time| process.since(&still, time).variance;
    assert_relative_eq!(
        at(0.0201) / at(0.0199),
        (201_f64 / 199.0).powi(3),
        max_relative = 0.05
    );
}

#[test]
fn it_learns_how_lively_a_motion_is_and_forgets_the_prior() {
    let mut process = UnseenRotation::<f64>::new(0.5);
    let prior = process.since(&Vector3::zeros(), 10.0).variance;
    assert_relative_eq!(prior, 0.25 * 10.0, max_relative = 0.05);
    let rate = |t: f64| Vector3::new(2.0 * (5.0 * t).sin(), 0.3 * (2.0 * t).cos(), 0.0);
    for k in 0..6000 {
        let t = f64::from(k) * 0.01;
        process.learn(&rate(t), &rate(t + 0.01), 0.01);
    }
    let (variance, tau) = process.process(0.0);
    assert_relative_eq!(variance, 2.0, max_relative = 0.1);
    assert_relative_eq!(tau, 2_f64.sqrt() / 5.0, max_relative = 0.1);
    // A rate that is known counts as one that there may be.
    let (variance, _) = process.process(100.0);
    assert_relative_eq!(variance, 100.0);
}
