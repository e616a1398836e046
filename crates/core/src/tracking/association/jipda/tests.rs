//! Joint association against brute force, bounds, and degenerate weights.

use std::vec::Vec;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;

/// Weights as a table: zero outside the gate.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Weights {
    missed: f64,
    detections: [f64; 6],
}

impl Weights {
    fn missed(missed: f64) -> Self {
        Self {
            missed,
            detections: [0.0; 6],
        }
    }

    fn normalize(&mut self) {
        let sum = self.missed + self.detections.iter().sum::<f64>();
        self.missed /= sum;
        self.detections.iter_mut().for_each(|w| *w /= sum);
    }

    fn listed(&self) -> Association<f64, 6> {
        let mut out = Association::missed(self.missed);
        for (j, weight) in (0..).zip(self.detections) {
            assert!(out.add(j, weight));
        }
        out
    }

    fn table(listed: &Association<f64, 6>) -> Self {
        let mut out = Self::missed(listed.missed);
        for candidate in listed.candidates() {
            out.detections[candidate.detection as usize] = candidate.weight;
        }
        out
    }
}

/// Most targets of a test; the others have nothing in their gates.
const TARGETS: usize = 5;

fn listed(weights: &[Weights]) -> [Association<f64, 6>; TARGETS] {
    core::array::from_fn(|t| {
        weights
            .get(t)
            .map_or(Association::missed(1.0), Weights::listed)
    })
}

fn associated(weights: &[Weights]) -> (Vec<Weights>, AssociationEffort) {
    let weighed = listed(weights);
    let mut marginals = weighed;
    let mut clusters = Clusters::<_, TARGETS, 6>::default();
    let effort = associate(&weighed, &mut marginals, &mut clusters);
    let tables = marginals[..weights.len()].iter().map(Weights::table);
    (tables.collect(), effort)
}

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
    sums.iter_mut().for_each(Weights::normalize);
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

/// What belief propagation makes of the weights, cluster by cluster.
fn propagated(weights: &[Weights]) -> Vec<Weights> {
    let weighed = listed(weights);
    let mut marginals = weighed;
    let mut clusters = Clusters::<_, TARGETS, 6>::default();
    clusters.find(&weighed);
    for first in 0..TARGETS {
        if clusters.leads(first) {
            belief_propagation(&weighed, &mut marginals, &mut clusters, first);
        }
    }
    marginals.iter_mut().for_each(Association::normalize);
    marginals[..weights.len()]
        .iter()
        .map(Weights::table)
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(11), ..ProptestConfig::default() })]

    #[test]
    fn exact_marginals_equal_brute_force(weights in weights()) {
        let (marginals, effort) = associated(&weights);
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
    let (marginals, _) = associated(&weights);
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
    assert!(distance(&propagated(&weights), &brute_force(&weights)) < 1e-9);
}

#[test]
fn a_cluster_beyond_the_bound_falls_back_and_is_counted() {
    let mut target = Association::<f64, 16>::missed(0.2);
    (0..16).for_each(|j| assert!(target.add(j, 1.0)));
    let weights = [target; 12];
    let mut marginals = weights;
    let mut clusters = Clusters::<_, 12, 16>::default();
    let effort = associate(&weights, &mut marginals, &mut clusters);
    assert_eq!((effort.exact_clusters, effort.approximate_clusters), (0, 1));
    // by symmetry every target gets the same, and every detection at most one target
    let used = 12.0 * (1.0 - marginals[3].missed);
    assert!(used <= 16.0 && marginals[3].missed < 0.2, "{used}");
    let share = |t: usize, j: usize| marginals[t].candidates()[j].weight;
    assert!((share(0, 0) - share(11, 15)).abs() < 1e-3);
}

#[test]
fn separate_targets_are_separate_clusters_and_weightless_ones_are_missed() {
    let mut weights = [Weights::missed(0.3); TARGETS];
    weights[0].detections[0] = 1.0;
    weights[1].detections[1] = 1.0;
    weights[2] = Weights::missed(0.0);
    let (marginals, effort) = associated(&weights);
    assert_eq!(effort.exact_clusters, TARGETS as u32);
    assert!((marginals[0].detections[0] - 1.0 / 1.3).abs() < 1e-12);
    assert_eq!(marginals[2], Weights::missed(1.0));
}

#[test]
fn targets_are_one_cluster_through_others_and_detections_of_any_number_count() {
    let share = |detections: &[u32]| {
        let mut out = Association::<f64, 3>::missed(0.5);
        detections.iter().for_each(|j| assert!(out.add(*j, 1.0)));
        out
    };
    // first and last share nothing, but both share with the second
    let far = 4_000_000;
    let weights = [
        share(&[7, far]),
        share(&[9, far]),
        share(&[3]),
        share(&[1, 9]),
    ];
    let mut clusters = Clusters::<_, 4, 3>::default();
    clusters.find(&weights);
    assert_eq!(clusters.from(0).collect::<Vec<_>>(), [0, 1, 3]);
    assert!(clusters.leads(2) && clusters.after(2).is_none());
    let mut marginals = weights;
    let effort = associate(&weights, &mut marginals, &mut clusters);
    assert_eq!((effort.exact_clusters, effort.approximate_clusters), (2, 0));
}
