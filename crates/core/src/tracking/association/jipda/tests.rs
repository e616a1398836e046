//! Joint association against brute force, bounds, and degenerate weights.

use std::vec::Vec;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;

type Weights = Association<f64, 6>;

/// Every joint event in turn: the definition.
fn brute_force(weights: &[Weights]) -> Vec<Weights> {
    let mut sums = std::vec![Weights::missed(0.0); weights.len()];
    let mut choice = std::vec![0_usize; weights.len()];
    loop {
        let hits: Vec<usize> = choice.iter().filter(|c| **c > 0).copied().collect();
        let exclusive = (1..hits.len()).all(|i| !hits[..i].contains(&hits[i]));
        if exclusive {
            let weight: f64 = choice
                .iter()
                .zip(weights)
                .map(|(c, w)| {
                    if *c == 0 {
                        w.missed
                    } else {
                        w.detections[c - 1]
                    }
                })
                .product();
            for (c, sum) in choice.iter().zip(&mut sums) {
                if *c == 0 {
                    sum.missed += weight;
                } else {
                    sum.detections[c - 1] += weight;
                }
            }
        }
        let Some(next) = choice.iter().position(|c| *c < 6) else {
            break;
        };
        choice[next] += 1;
        choice[..next].fill(0);
    }
    sums.iter_mut().for_each(Association::normalize);
    sums
}

fn distance(a: &[Weights], b: &[Weights]) -> f64 {
    let pairs = a.iter().zip(b).flat_map(|(a, b)| {
        let rest = a.detections.iter().zip(&b.detections);
        rest.map(|(x, y)| (x - y).abs())
            .chain([(a.missed - b.missed).abs()])
    });
    pairs.fold(0.0, f64::max)
}

fn weights() -> impl Strategy<Value = Vec<Weights>> {
    weights_up_to(0.05, 20.0)
}

/// One to four targets that may be missed and have up to six detections to choose from.
fn weights_up_to(least_missed: f64, largest: f64) -> impl Strategy<Value = Vec<Weights>> {
    let weight = prop_oneof![Just(0.0), 0.01..largest];
    let target = (least_missed..1.0f64, prop::array::uniform6(weight))
        .prop_map(|(missed, detections)| Weights { missed, detections });
    prop::collection::vec(target, 1..5)
}

/// What belief propagation makes of the weights.
fn propagated(weights: &[Weights]) -> Vec<Weights> {
    let mut marginals = std::vec![Weights::missed(0.0); weights.len()];
    belief_propagation(weights, &mut marginals, (1 << weights.len()) - 1);
    marginals.iter_mut().for_each(Association::normalize);
    marginals
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(11), ..ProptestConfig::default() })]

    #[test]
    fn exact_marginals_equal_brute_force(weights in weights()) {
        let mut marginals = std::vec![Weights::missed(0.0); weights.len()];
        let effort = associate(&weights, &mut marginals);
        prop_assert_eq!(effort.approximate_clusters, 0);
        prop_assert!(distance(&marginals, &brute_force(&weights)) < 1e-12);
    }

    #[test]
    fn belief_propagation_gives_no_detection_away_twice(weights in weights()) {
        let marginals = propagated(&weights);
        for column in 0..6 {
            let used: f64 = marginals.iter().map(|m| m.detections[column]).sum();
            prop_assert!(used < 1.0 + 1e-3);
        }
    }

    /// Where targets that are hardly ever missed share all their detections it takes the likeliest
    /// event for nearly certain; elsewhere it is close.
    #[test]
    fn belief_propagation_is_close_where_targets_may_be_missed(weights in weights_up_to(0.5, 2.0)) {
        let d = distance(&propagated(&weights), &brute_force(&weights));
        prop_assert!(d < 0.1, "{}", d);
    }
}

#[test]
fn two_targets_and_one_shared_detection_by_hand() {
    let target = |missed, detection| {
        let mut w = Weights::missed(missed);
        w.detections[0] = detection;
        w
    };
    // events: none 0.2 * 0.5, first 3 * 0.5, second 0.2 * 1; both is impossible
    let weights = [target(0.2, 3.0), target(0.5, 1.0)];
    let mut marginals = [Weights::missed(0.0); 2];
    associate(&weights, &mut marginals);
    let total = 0.1 + 1.5 + 0.2;
    assert!((marginals[0].detections[0] - 1.5 / total).abs() < 1e-12);
    assert!((marginals[1].detections[0] - 0.2 / total).abs() < 1e-12);
    assert!((marginals[0].missed - 0.3 / total).abs() < 1e-12);
}

#[test]
fn belief_propagation_is_exact_for_a_single_shared_detection() {
    let mut weights = [Weights::missed(0.4); 2];
    weights[0].detections[0] = 2.0;
    weights[1].detections[0] = 0.7;
    let mut marginals = weights;
    belief_propagation(&weights, &mut marginals, 0b11);
    marginals.iter_mut().for_each(Association::normalize);
    assert!(distance(&marginals, &brute_force(&weights)) < 1e-9);
}

#[test]
fn a_cluster_beyond_the_bound_falls_back_and_is_counted() {
    let target = Association::<f64, 16> {
        missed: 0.2,
        detections: [1.0; 16],
    };
    let weights = [target; 12];
    let mut marginals = weights;
    let effort = associate(&weights, &mut marginals);
    assert_eq!((effort.exact_clusters, effort.approximate_clusters), (0, 1));
    // by symmetry every target gets the same, and every detection at most one target
    let used = 12.0 * (1.0 - marginals[3].missed);
    assert!(used <= 16.0 && marginals[3].missed < 0.2, "{used}");
    assert!((marginals[0].detections[0] - marginals[11].detections[15]).abs() < 1e-3);
}

#[test]
fn separate_targets_are_separate_clusters_and_weightless_ones_are_missed() {
    let mut weights = [Weights::missed(0.3); 3];
    weights[0].detections[0] = 1.0;
    weights[1].detections[1] = 1.0;
    weights[2] = Weights::missed(0.0);
    let mut marginals = weights;
    let effort = associate(&weights, &mut marginals);
    assert_eq!(effort.exact_clusters, 3);
    assert!((marginals[0].detections[0] - 1.0 / 1.3).abs() < 1e-12);
    assert_eq!(marginals[2], Weights::missed(1.0));
}
