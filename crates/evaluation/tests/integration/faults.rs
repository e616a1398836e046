//! One bad number: every attitude estimator survives faults of its samples, and every run tells them.

use nalgebra::Vector3;
use northing_core::faults::{FaultKind, FaultySensor};
use northing_evaluation::{EstimatorKind, Profile, RunOptions, RunSummary, run};
use northing_recording::{Event, RecordingError, Sample};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

const FILTERS: [EstimatorKind; 6] = [
    EstimatorKind::BoundedVelocity,
    EstimatorKind::Mekf,
    EstimatorKind::Mekf3,
    EstimatorKind::Usque,
    EstimatorKind::QuaternionEkf,
    EstimatorKind::Complementary,
];

fn phone() -> Vec<Event> {
    let config = VirtualPhoneConfig {
        seed: 4,
        rest_before_s: 5.0,
        motion_s: 40.0,
        rest_after_s: 3.0,
        ..VirtualPhoneConfig::default()
    };
    VirtualPhone::new(config)
        .expect("a valid phone")
        .events()
        .collect()
}

fn summary(kind: EstimatorKind, events: &[Event], score_from_s: f64) -> RunSummary {
    let mut options = RunOptions::new(kind, Profile::HandHeld);
    options.skip_s = score_from_s;
    let events = events.iter().cloned().map(Ok::<_, RecordingError>);
    run(events, &options, &mut ()).expect("a run")
}

fn rmse(summary: &RunSummary) -> f64 {
    summary.error_deg.as_ref().expect("a reference").total_rmse
}

/// Changes the angular rates from `from_s` to `to_s`.
fn with_rates(from_s: f64, to_s: f64, mut change: impl FnMut(&mut Vector3<f64>)) -> Vec<Event> {
    let mut events = phone();
    let first = events[0].time_ns;
    for event in &mut events {
        let t = (event.time_ns - first) as f64 * 1e-9;
        if let Sample::AngularRate(rate) = &mut event.sample
            && (from_s..to_s).contains(&t)
        {
            change(rate);
        }
    }
    events
}

#[test]
fn one_gyroscope_sample_at_full_scale_costs_nothing() {
    let clean = phone();
    let mut spent = false;
    let spiked = with_rates(20.0, 21.0, |rate| {
        if !std::mem::replace(&mut spent, true) {
            rate.x = 34.9;
        }
    });
    for kind in FILTERS {
        let (clean, spiked) = (summary(kind, &clean, 0.0), summary(kind, &spiked, 0.0));
        assert!(clean.faults.is_empty(), "{kind:?}: {:?}", clean.faults);
        assert!(
            rmse(&spiked) < 1.05 * rmse(&clean),
            "{kind:?}: {} {}",
            rmse(&spiked),
            rmse(&clean)
        );
        let [fault] = spiked.faults[..] else {
            panic!("{kind:?}: {:?}", spiked.faults)
        };
        assert_eq!(
            (fault.sensor, fault.kind),
            (FaultySensor::Gyroscope, FaultKind::Spike)
        );
        assert!((fault.from_s - 20.0).abs() < 0.03, "{fault:?}");
        assert!(
            spiked
                .issues
                .iter()
                .any(|issue| issue.contains("gyroscope: spike"))
        );
    }
}

/// In the order of arrival, as a driver on a chip sees it; readers of files take such rows out before.
#[test]
fn one_gyroscope_stamp_an_hour_ahead_costs_nothing() {
    let clean = phone();
    let mut ahead = clean.clone();
    let first_ns = clean[0].time_ns;
    let is_meant = |event: &&mut Event| {
        event.time_ns > first_ns + 20_000_000_000 && matches!(event.sample, Sample::AngularRate(_))
    };
    let event = ahead.iter_mut().find(is_meant).expect("a rate after 20 s");
    let from_s = (event.time_ns - first_ns) as f64 * 1e-9;
    event.time_ns += 3_600_000_000_000;
    for kind in FILTERS {
        let (clean, ahead) = (summary(kind, &clean, 0.0), summary(kind, &ahead, 0.0));
        assert!(
            rmse(&ahead) < 1.05 * rmse(&clean),
            "{kind:?}: {} {}",
            rmse(&ahead),
            rmse(&clean)
        );
        let [fault] = ahead.faults[..] else {
            panic!("{kind:?}: {:?}", ahead.faults)
        };
        assert_eq!(
            (fault.sensor, fault.kind),
            (FaultySensor::Gyroscope, FaultKind::Stamp)
        );
        assert!((fault.from_s - from_s).abs() < 0.05, "{fault:?}");
        assert!((fault.size - 3600.0).abs() < 0.05, "{fault:?}");
    }
}

#[test]
fn a_frozen_or_silent_gyroscope_is_survived_by_every_filter() {
    let clean = phone();
    for zeros in [false, true] {
        let mut held = None;
        let frozen = with_rates(20.0, 23.0, |rate| {
            *rate = *held.get_or_insert(if zeros { Vector3::zeros() } else { *rate });
        });
        for kind in FILTERS {
            // Ten seconds of normal samples later.
            let (clean, frozen) = (summary(kind, &clean, 33.0), summary(kind, &frozen, 33.0));
            assert!(
                rmse(&frozen) < rmse(&clean) + 5.0,
                "{kind:?}: {} {}",
                rmse(&frozen),
                rmse(&clean)
            );
            let fault = frozen.faults[0];
            assert_eq!(
                (fault.sensor, fault.kind),
                (FaultySensor::Gyroscope, FaultKind::Stuck)
            );
            assert!(
                fault.found_s < 20.3 && (fault.until_s.unwrap() - 23.0).abs() < 0.1,
                "{fault:?}"
            );
        }
    }
}

#[test]
fn a_step_of_the_gyroscopes_bias_is_found_and_removed() {
    let config = VirtualPhoneConfig {
        seed: 4,
        rest_before_s: 5.0,
        motion_s: 85.0,
        rest_after_s: 3.0,
        ..VirtualPhoneConfig::default()
    };
    let clean: Vec<Event> = VirtualPhone::new(config)
        .expect("a valid phone")
        .events()
        .collect();
    let mut stepped = clean.clone();
    for event in &mut stepped {
        let since_s = (event.time_ns - clean[0].time_ns) as f64 * 1e-9;
        if let Sample::AngularRate(rate) = &mut event.sample
            && since_s > 50.0
        {
            *rate += Vector3::new(0.03, -0.03, 0.026);
        }
    }
    for kind in FILTERS {
        // Ten seconds after the step.
        let (clean, stepped) = (summary(kind, &clean, 60.0), summary(kind, &stepped, 60.0));
        assert!(clean.faults.is_empty(), "{kind:?}: {:?}", clean.faults);
        let more = rmse(&stepped) - rmse(&clean);
        assert!(more < 5.0, "{kind:?}: {more}");
        let [fault] = stepped.faults[..] else {
            panic!("{kind:?}: {:?}", stepped.faults)
        };
        assert_eq!(
            (fault.sensor, fault.kind),
            (FaultySensor::Gyroscope, FaultKind::BiasStep)
        );
        assert!((50.0..60.0).contains(&fault.found_s), "{fault:?}");
        assert!((0.03..0.08).contains(&fault.size), "{fault:?}");
        let told = |issue: &String| issue.contains("gyroscope: its bias changed by 0.0");
        assert!(stepped.issues.iter().any(told), "{:?}", stepped.issues);
    }
}

#[test]
fn samples_of_a_faulty_gyroscope_do_not_make_the_reference_another_recordings() {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(2);
    let garbage = with_rates(15.0, 30.0, |rate| {
        *rate = Vector3::from_fn(|_, _| rng.random_range(-15.0..15.0));
    });
    let summary = summary(EstimatorKind::BoundedVelocity, &garbage, 40.0);
    assert!(
        summary
            .faults
            .iter()
            .any(|fault| fault.kind == FaultKind::Noise)
    );
    assert!(rmse(&summary) < 10.0, "{}", rmse(&summary));
}
