//! What-if: every change has the effect that it must have, beside the experiment as it was.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use northing_evaluation::attitude::alterations::{Alterations, Pulse};
use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use northing_live::experiments::Finished;
use northing_live::messages::{Change, SensorUse};
use northing_live::session::experiment::ExperimentRun;
use northing_live::to_page::{NisColumns, WhatIf};
use northing_simulation::virtual_phone::Motion;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::{Value, json};

const SECONDS: f64 = 30.0;

/// Half a minute of a virtual phone, moved gently.
pub(crate) fn finished() -> Finished {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        motion: Motion::Gentle,
        duration_s: Some(SECONDS),
        ..VirtualPhoneConfig::default()
    });
    let mut run = ExperimentRun::new(SECONDS, "half a minute").unwrap();
    run.begin(0, Vec::new());
    for event in phone.unwrap().events() {
        run.add(&event);
    }
    let finished = Finished {
        id: "e1".to_owned(),
        device: "anna".to_owned(),
        device_name: "Anna".to_owned(),
        at: String::new(),
        options: RunOptions::new(EstimatorKind::Mekf, Profile::Lab),
        estimators: vec![EstimatorKind::Mekf, EstimatorKind::Integration],
        subject: EstimatorKind::Mekf,
        summaries: Default::default(),
        hash: String::new(),
        originals: Default::default(),
        experiment: run.finish(),
    };
    finished.evaluated().unwrap()
}

fn altered(alterations: Alterations) -> Change {
    Change {
        alterations,
        ..Change::default()
    }
}

fn ask(finished: &Finished, change: &Change) -> WhatIf {
    finished.what_if(change, Value::Null).unwrap()
}

fn accelerometer_nis(answer: &WhatIf) -> f64 {
    answer.results["mekf"].nis_mean.accelerometer.unwrap()
}

/// The largest mean within a time, and before it.
fn largest(nis: &NisColumns, from_s: f64, to_s: f64) -> f64 {
    let within = nis.t_s.iter().zip(&nis.mean);
    let within = within.filter(|(t, _)| (from_s..to_s).contains(*t));
    within.map(|(_, mean)| *mean).fold(0.0, f64::max)
}

#[test]
fn nothing_changed_is_the_experiment_to_the_bit() {
    let finished = finished();
    let same = ask(&finished, &Change::default());
    assert_eq!(same.results, finished.summaries);
    assert_eq!(same.trace, same.original);
    let nis = &same.trace.nis["accelerometer"];
    let mean = nis.mean.iter().sum::<f64>() / nis.mean.len() as f64;
    assert!(
        (mean / accelerometer_nis(&same) - 1.0).abs() < 0.1,
        "{mean}"
    );
    assert!(nis.t_s.len() > 100 && nis.t_s.is_sorted());
    // The original stays what it was, whatever is asked.
    let settings = json!({"accelerometer_std": 3.0});
    let other = ask(
        &finished,
        &Change {
            settings: settings.as_object().unwrap().clone(),
            ..altered(Alterations {
                lost_share: Some(0.5),
                ..Alterations::default()
            })
        },
    );
    assert_eq!(other.original, same.original);
    assert!(accelerometer_nis(&other) < 0.1 * accelerometer_nis(&same));
}

#[test]
fn sensors_and_estimators_are_chosen() {
    let finished = finished();
    let used = SensorUse {
        gyroscope: true,
        accelerometer: true,
        magnetometer: false,
        compass: Some(false),
    };
    let without = ask(
        &finished,
        &Change {
            used: Some(used),
            ..Change::default()
        },
    );
    assert_eq!(without.results["mekf"].nis_mean.magnetometer, None);
    assert!(!without.trace.nis.contains_key("magnetometer"));
    assert!(without.original.nis.contains_key("magnetometer"));
    let heading = |answer: &WhatIf| answer.results["mekf"].error_deg.unwrap().total_rmse;
    assert!(heading(&without) > heading(&ask(&finished, &Change::default())));

    let kinds = [EstimatorKind::Usque, EstimatorKind::Mekf3];
    let others = ask(
        &finished,
        &Change {
            estimators: Some(kinds.to_vec()),
            subject: Some(EstimatorKind::Mekf3),
            ..Change::default()
        },
    );
    assert_eq!(
        others.results.keys().copied().collect::<Vec<_>>(),
        ["mekf3", "usque"]
    );
    assert_eq!(others.subject, EstimatorKind::Mekf3);
    assert_eq!(
        others.trace, others.original,
        "the original of the same estimator"
    );
    let refused = |change: Change| finished.what_if(&change, Value::Null).unwrap_err();
    let error = refused(Change {
        subject: Some(EstimatorKind::Usque),
        ..Change::default()
    });
    assert!(error.contains("`usque` is not among"), "{error}");
    let error = refused(Change {
        estimators: Some(Vec::new()),
        ..Change::default()
    });
    assert!(error.contains("choose one"), "{error}");
    let gyroscope = SensorUse {
        gyroscope: false,
        ..used
    };
    let error = refused(Change {
        used: Some(gyroscope),
        ..Change::default()
    });
    assert!(error.contains("gyroscope cannot be left out"), "{error}");
}

#[test]
fn worse_samples_have_the_effect_that_they_must_have() {
    let finished = finished();
    let same = ask(&finished, &Change::default());
    let samples = |answer: &WhatIf| answer.results["mekf"].samples as f64;
    let error = |answer: &WhatIf| answer.results["mekf"].error_deg.unwrap().total_rmse;

    let slow = ask(
        &finished,
        &altered(Alterations {
            rate_hz: Some(10.0),
            ..Alterations::default()
        }),
    );
    assert!(samples(&slow) < 0.3 * samples(&same), "{}", samples(&slow));
    let lost = ask(
        &finished,
        &altered(Alterations {
            lost_share: Some(0.5),
            ..Alterations::default()
        }),
    );
    let share = samples(&lost) / samples(&same);
    assert!((share - 0.5).abs() < 0.05, "{share}");
    let coarse = ask(
        &finished,
        &altered(Alterations {
            gyroscope_step_deg_s: Some(20.0),
            ..Alterations::default()
        }),
    );
    assert!(
        error(&coarse) > 1.2 * error(&same),
        "{} {}",
        error(&coarse),
        error(&same)
    );
    let late = ask(
        &finished,
        &altered(Alterations {
            delay_s: Some(0.3),
            ..Alterations::default()
        }),
    );
    assert!(accelerometer_nis(&late) > 1.5 * accelerometer_nis(&same));
}

#[test]
fn a_bump_and_a_magnet_are_seen_when_they_are_there_and_not_before() {
    let finished = finished();
    let pulse = |size| {
        Some(Pulse {
            at_s: 20.0,
            duration_s: 2.0,
            size,
        })
    };
    let disturbed = [
        (
            "accelerometer",
            Alterations {
                bump: pulse(6.0),
                ..Alterations::default()
            },
        ),
        (
            "magnetometer",
            Alterations {
                magnet: pulse(60.0),
                ..Alterations::default()
            },
        ),
    ];
    for (sensor, alterations) in disturbed {
        let answer = ask(&finished, &altered(alterations));
        let (now, before) = (&answer.trace.nis[sensor], &answer.original.nis[sensor]);
        // The same samples by the same filter: the same to the bit.
        let [same, as_before] = [now, before].map(|curve| largest(curve, 0.0, 19.5).to_bits());
        assert_eq!(same, as_before);
        let (during, then) = (largest(now, 20.0, 22.0), largest(before, 20.0, 22.0));
        assert!(during > 5.0 * then, "{sensor}: {during} instead of {then}");
    }
}

#[test]
fn what_is_of_no_use_is_refused_by_name() {
    let finished = finished();
    let refused = |alterations: Alterations| {
        let change = altered(alterations);
        let curve = finished.curve(&change, "accelerometer_std", &|| true);
        let error = finished.what_if(&change, Value::Null).unwrap_err();
        assert_eq!(curve.unwrap_err(), error);
        error
    };
    let error = refused(Alterations {
        rate_hz: Some(0.0),
        ..Alterations::default()
    });
    assert!(error.starts_with("rate_hz"), "{error}");
    let error = refused(Alterations {
        lost_share: Some(1.0),
        ..Alterations::default()
    });
    assert!(error.starts_with("lost_share"), "{error}");
}

/// The curve is over the altered samples, too: at the present value it is the answer itself.
#[test]
fn the_curve_goes_through_the_answer() {
    let finished = finished();
    let change = altered(Alterations {
        rate_hz: Some(20.0),
        accelerometer_step_m_s2: Some(0.5),
        ..Alterations::default()
    });
    let answer = ask(&finished, &change);
    let curve = finished.curve(&change, "accelerometer_std", &|| true);
    let curve = curve.unwrap().unwrap();
    let middle = curve.values.len() / 2;
    assert_eq!(
        curve.nis["accelerometer"][middle],
        Some(accelerometer_nis(&answer))
    );
    assert!(curve.nis["accelerometer"][0].unwrap() > accelerometer_nis(&answer));
}
