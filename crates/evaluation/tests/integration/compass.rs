//! A phone without magnetometer: with its compass it keeps its heading, and its covariance is consistent; without, it drifts.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use northing_evaluation::attitude::options::{CompassUse, RunOptions};
use northing_evaluation::attitude::outcome::RunSummary;
use northing_evaluation::{EstimatorKind, Profile, run};
use northing_recording::{Event, RecordingError, SensorKind};
use northing_simulation::sensors::Sampling;
use northing_simulation::virtual_phone::Motion;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use rayon::prelude::*;

/// Five minutes in a hand: a gyroscope whose bias drifts, a compass that errs by 5 deg for 2 s.
fn phone(seed: u64, motion: Motion) -> VirtualPhoneConfig {
    let mut config = VirtualPhoneConfig {
        seed,
        motion,
        motion_s: 285.0,
        ..VirtualPhoneConfig::default()
    };
    config.gyroscope.bias_random_walk_rad_s_sqrt_s = 2e-4;
    config.magnetometer.sampling = Sampling::at_rate(0.0);
    config.compass.sampling = Sampling::at_rate(10.0);
    config
}

fn options(estimator: EstimatorKind, compass: CompassUse) -> RunOptions {
    let mut options = RunOptions {
        calibrate_first_s: Some(9.0),
        ..RunOptions::new(estimator, Profile::Lab)
    };
    options.sensors.compass = compass;
    // What the compass's errors are worth: twice their memory.
    options.set("compass_correlation_time_s=4").unwrap();
    options.set("compass_std=0.0873").unwrap();
    options
}

fn summary(config: VirtualPhoneConfig, options: &RunOptions) -> RunSummary {
    let phone = VirtualPhone::new(config).unwrap();
    let events = phone.events().map(Ok::<Event, RecordingError>);
    run(events, options, &mut ()).unwrap()
}

/// Mean heading error (RMS of each run, deg), mean NEES per degree of freedom, mean NIS.
fn campaign(estimator: EstimatorKind, motion: Motion, compass: CompassUse) -> [f64; 3] {
    let options = options(estimator, compass);
    let runs: Vec<RunSummary> = (1..=16_u64)
        .into_par_iter()
        .map(|seed| summary(phone(seed, motion), &options))
        .collect();
    let mean = |of: &dyn Fn(&RunSummary) -> f64| runs.iter().map(of).sum::<f64>() / 16.0;
    let result = [
        mean(&|s| s.error_deg.unwrap().heading_rmse),
        mean(&|s| s.nees_mean.unwrap()),
        mean(&|s| s.nis_mean.compass.unwrap_or(f64::NAN)),
    ];
    println!(
        "{estimator} {motion:?} {compass:?}: heading {:.2} deg, NEES {:.2}, NIS {:.2}",
        result[0], result[1], result[2]
    );
    result
}

#[test]
fn with_the_compass_the_heading_stays_and_without_it_drifts() {
    for estimator in [
        EstimatorKind::Mekf,
        EstimatorKind::Usque,
        EstimatorKind::QuaternionEkf,
    ] {
        let [heading, nees, nis] = campaign(estimator, Motion::Gentle, CompassUse::default());
        assert!(heading < 2.5, "{estimator}: {heading} deg");
        assert!((0.7..1.4).contains(&nees), "{estimator}: NEES {nees}");
        assert!((0.7..1.4).contains(&nis), "{estimator}: NIS {nis}");
    }
    // On a table, where nothing else shows the bias about the vertical.
    let [lying, nees, _] = campaign(EstimatorKind::Mekf, Motion::Rest, CompassUse::default());
    let [drifting, ..] = campaign(EstimatorKind::Mekf, Motion::Rest, CompassUse::Never);
    assert!(lying < 2.5 && drifting > 8.0, "{lying} and {drifting} deg");
    assert!((0.7..1.4).contains(&nees), "NEES {nees}");
}

#[test]
fn a_phone_that_is_thrown_about_upright_and_over_is_safe() {
    let [heading, nees, _] = campaign(EstimatorKind::Mekf, Motion::Brisk, CompassUse::default());
    assert!(heading < 3.5, "{heading} deg");
    assert!((0.6..1.6).contains(&nees), "NEES {nees}");
    let one = summary(
        phone(3, Motion::Brisk),
        &options(EstimatorKind::Mekf, CompassUse::default()),
    );
    let upright = one.updates.compass.skipped_because["direction gives no information"];
    assert!(upright > 20, "{upright} of {:?}", one.updates.compass);
}

#[test]
fn which_north_is_used_is_said() {
    let with = summary(
        phone(1, Motion::Gentle),
        &options(EstimatorKind::Mekf, CompassUse::default()),
    );
    assert!(with.unobservable.is_empty(), "{:?}", with.unobservable);
    assert!(
        with.issues
            .iter()
            .any(|i| i.contains("device's own compass")),
        "{:?}",
        with.issues
    );
    let verdict = with
        .verdicts
        .iter()
        .find(|v| v.sensor == SensorKind::CompassHeading);
    assert!(verdict.is_some(), "{:?}", with.verdicts);
    // Beside a magnetometer it is not used unless one asks for it.
    let mut both = phone(1, Motion::Gentle);
    both.magnetometer = VirtualPhoneConfig::default().magnetometer;
    let auto = summary(
        both.clone(),
        &options(EstimatorKind::Mekf, CompassUse::default()),
    );
    assert_eq!(auto.updates.compass.fused, 0);
    assert!(
        auto.issues.iter().any(|i| i.contains("left out")),
        "{:?}",
        auto.issues
    );
    let always = summary(both, &options(EstimatorKind::Mekf, CompassUse::Always));
    assert!(
        always.updates.compass.fused > 2000,
        "{:?}",
        always.updates.compass
    );
    assert!(always.updates.magnetometer.fused > 10_000);
}
