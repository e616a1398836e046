//! Simulated walks and drives: the tables of the specification, and whether the error-state filter knows its error.

// 3.14 m is a published error.
#![allow(clippy::unwrap_used, clippy::approx_constant)]

use northing_experiments::ground::{Experiment, Scheme, TrackingScore};
use northing_simulation::ground::{Ground, ReceiverError};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

const EXPERIMENT: Experiment = Experiment { runs: 30, seed: 1 };

/// Schemes in the order of the tables.
const ORDER: [Scheme; 9] = [
    Scheme::Hold,
    Scheme::Printed,
    Scheme::NamesSwapped,
    Scheme::HeldFixReused,
    Scheme::Physical,
    Scheme::Tuned,
    Scheme::TunedFixed,
    Scheme::ErrorState,
    Scheme::ErrorStateVelocity,
];

fn of(scores: &[TrackingScore], scheme: Scheme) -> &TrackingScore {
    scores.iter().find(|score| score.scheme == scheme).unwrap()
}

fn near(what: &str, scheme: Scheme, ours: f64, published: f64) {
    let ratio = ours / published;
    assert!(
        (0.75..=1.25).contains(&ratio),
        "{what}, {}: {ours:.2} against {published}",
        scheme.name()
    );
}

#[test]
fn horizontal_errors_are_those_of_the_specification_within_a_quarter() {
    let tables = [
        (
            Ground::Walk,
            ReceiverError::White,
            [3.71, 4.66, 5.56, 2.81, 7.48, 4.23, 2.44, 1.91, 0.72],
        ),
        (
            Ground::Walk,
            ReceiverError::Correlated,
            [3.63, 3.61, 6.31, 3.97, 7.83, 4.90, 3.64, 3.51, 2.94],
        ),
        (
            Ground::Drive,
            ReceiverError::White,
            [6.52, 4.76, 32.3, 11.3, 11.2, 3.63, 3.14, 1.96, 0.74],
        ),
        (
            Ground::Drive,
            ReceiverError::Correlated,
            [6.54, 4.24, 32.5, 11.7, 11.8, 4.79, 4.32, 4.12, 3.46],
        ),
    ];
    for (kind, receiver, published) in tables {
        let scores = EXPERIMENT.tracking(kind, receiver);
        let what = format!("{kind:?} {receiver:?}");
        for (scheme, published) in ORDER.into_iter().zip(published) {
            near(&what, scheme, of(&scores, scheme).horizontal_m, published);
        }
        for scheme in [Scheme::ErrorState, Scheme::ErrorStateVelocity] {
            let score = of(&scores, scheme);
            assert!(score.tilt_deg.unwrap() < 0.27, "{what}: {score:?}");
            assert!(score.heading_deg.unwrap() < 0.38, "{what}: {score:?}");
        }
        if receiver == ReceiverError::White {
            near(
                &what,
                Scheme::ErrorState,
                of(&scores, Scheme::ErrorState).vertical_m,
                1.6,
            );
            near(
                &what,
                Scheme::ErrorState,
                of(&scores, Scheme::ErrorState).velocity_m_s.unwrap(),
                0.335,
            );
        }
    }
}

#[test]
fn outages_grow_as_in_the_specification() {
    // Medians of 16 runs there: 10, 30 and 60 s.
    let tables = [
        (
            Ground::Walk,
            [
                (Scheme::NamesSwapped, [17.0, 37.0, 52.0]),
                (Scheme::TunedFixed, [13.2, 42.0, 98.0]),
                (Scheme::ErrorState, [4.4, 24.7, 106.0]),
                (Scheme::ErrorStateVelocity, [1.5, 11.5, 75.0]),
                (Scheme::Hold, [12.8, 33.0, 62.0]),
            ],
        ),
        (
            Ground::Drive,
            [
                (Scheme::NamesSwapped, [101.0, 224.0, 297.0]),
                (Scheme::TunedFixed, [20.8, 84.0, 275.0]),
                (Scheme::ErrorState, [6.0, 31.9, 139.0]),
                (Scheme::ErrorStateVelocity, [1.8, 12.7, 80.0]),
                (Scheme::Hold, [96.0, 229.0, 408.0]),
            ],
        ),
    ];
    for (kind, table) in tables {
        let scores = EXPERIMENT.outages(kind);
        for (scheme, published) in table {
            let score = scores.iter().find(|score| score.scheme == scheme).unwrap();
            for (ours, published) in score.median_m.into_iter().zip(published) {
                // Medians of so few runs scatter; none may be worse.
                let ratio = ours / published;
                assert!(
                    (0.5..=1.25).contains(&ratio),
                    "{kind:?} {}: {ours:.1} against {published}",
                    scheme.name()
                );
            }
        }
    }
}

#[test]
fn the_error_state_filter_knows_its_own_error() {
    for kind in [Ground::Walk, Ground::Drive] {
        let consistency = EXPERIMENT.consistency(kind);
        let runs = EXPERIMENT.runs as f64;
        let all = ChiSquared::new(15.0 * runs).unwrap();
        let [low, high] = [0.0005, 0.9995].map(|p| all.inverse_cdf(p) / runs);
        assert_eq!(consistency.nees.len(), 4);
        for nees in &consistency.nees {
            assert!(
                (low..high).contains(nees),
                "{kind:?}: NEES {nees:.2} outside {low:.2} to {high:.2}"
            );
        }
        let off = |share: &f64| !(0.6..1.4).contains(share);
        let shares = consistency.squared_over_variance;
        assert!(!shares.iter().any(off), "{kind:?}: {shares:.2?}");
    }
}
