//! The fault campaign end to end: one result for a seed, rows where a fault concerns an estimator, what holds today.

use northing_evaluation::EstimatorKind;
use northing_evaluation::navigation::NavigationKind;
use northing_evaluation::registry::Question;
use northing_experiments::faults::{Campaign, Origin, Subject};
use northing_simulation::fault_injection::InjectedFault;

fn few(faults: &[&str]) -> Campaign {
    Campaign {
        subjects: vec![
            Subject::Attitude(EstimatorKind::BoundedVelocity),
            Subject::Attitude(EstimatorKind::Complementary),
            Subject::Navigation(NavigationKind::ErrorState),
        ],
        faults: faults
            .iter()
            .filter_map(|name| InjectedFault::named(name))
            .collect(),
        ..Campaign::of_worlds(1, 3)
    }
}

#[test]
fn a_seed_is_one_result_with_a_row_a_fault_and_estimator() {
    let campaign = few(&["accelerometer-spike", "magnetometer-spike", "fix-10km-off"]);
    assert_eq!(campaign.streams(), 6);
    let outcome = campaign.run(&|| ());
    assert_eq!(outcome, campaign.run(&|| ()));
    let rows: Vec<_> = outcome
        .rows
        .iter()
        .map(|row| (row.fault, row.estimator, row.runs))
        .collect();
    assert_eq!(
        rows,
        [
            ("accelerometer-spike", "bounded-velocity", 3),
            ("accelerometer-spike", "complementary", 3),
            ("magnetometer-spike", "bounded-velocity", 3),
            ("magnetometer-spike", "complementary", 3),
            ("accelerometer-spike", "error-state", 3),
            ("fix-10km-off", "error-state", 3),
        ]
    );
    assert_eq!(
        outcome
            .table(Question::Navigation, Origin::Recorded)
            .count(),
        0
    );
    // One bad sample of what is gated, or weighs little, costs next to nothing.
    for row in &outcome.rows {
        assert!((row.meets_share - 1.0).abs() < 1e-9, "{row:?}");
        assert!(
            row.cost.unwrap() < 1.2 && row.clean_rms.unwrap() < 5.0,
            "{row:?}"
        );
    }
    // An observer states no covariance.
    let observer = outcome.row("accelerometer-spike", "complementary", Origin::Simulated);
    assert!(observer.unwrap().nees.is_none());
    // The worst are runs again, and the same.
    let worse = few(&["gyroscope-clipped-spin-3s", "all-garbage-20s"]);
    let outcome = worse.run(&|| ());
    for judgement in &outcome.worst {
        assert!(!judgement.meets);
        assert_eq!(worse.again(judgement).unwrap().judgement, *judgement);
    }
}

#[test]
fn faults_show_as_errors_in_what_they_concern() {
    let outcome = few(&[
        "gyroscope-frozen-3s",
        "gyroscope-bias-0.1",
        "receiver-missing-30s",
    ])
    .run(&|| ());
    let largest = |fault, estimator| {
        let row = outcome.row(fault, estimator, Origin::Simulated).unwrap();
        row.largest.unwrap() / row.clean_rms.unwrap()
    };
    // Three seconds of a wrong rate, and a rate that nothing explains, are seen in every estimate of attitude.
    assert!(largest("gyroscope-frozen-3s", "complementary") > 3.0);
    assert!(largest("gyroscope-bias-0.1", "complementary") > 3.0);
    // Without fixes the position runs away, and is back with them. The target is 95 % of the runs.
    assert!(largest("receiver-missing-30s", "error-state") > 3.0);
    let back = outcome
        .row("receiver-missing-30s", "error-state", Origin::Simulated)
        .unwrap();
    assert!(back.recovered_share >= 0.66, "{back:?}");
}

/// One stamp an hour ahead, of the samples of one sensor, moves no filter's time on.
#[test]
fn a_false_stamp_costs_no_navigation_filter_anything() {
    let outcome = Campaign {
        subjects: vec![
            Subject::Navigation(NavigationKind::ErrorState),
            Subject::Navigation(NavigationKind::AxisFilters),
            Subject::Navigation(NavigationKind::DeadReckoning),
        ],
        ..few(&["gyroscope-stamp-ahead"])
    }
    .run(&|| ());
    assert_eq!(outcome.rows.len(), 3);
    for row in &outcome.rows {
        assert!((row.meets_share - 1.0).abs() < 1e-9, "{row:?}");
    }
}

#[test]
fn estimators_have_names_and_the_default_comes_first() {
    assert_eq!(Subject::every()[0].name(), "bounded-velocity");
    assert!(
        Subject::every()
            .iter()
            .all(|s| Subject::named(s.name()) == Some(*s))
    );
    assert!(Subject::named("device").is_none());
    assert!(Subject::names().contains("error-state"));
}
