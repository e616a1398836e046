//! The paper's lab on twenty virtual phones: calibrate at rest, move, put back, rest.

#![allow(clippy::unwrap_used)]

use northing_evaluation::attitude::final_test::FinalVerdict;
use northing_evaluation::{EstimatorKind, Profile, RunOptions, RunSummary, run};
use northing_recording::RecordingError;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use rayon::prelude::*;

const PHONES: u64 = 20;

fn lab(estimator: EstimatorKind) -> Vec<RunSummary> {
    let mut options = RunOptions::new(estimator, Profile::Lab);
    options.calibrate_first_s = Some(9.0);
    let one = |seed| {
        let phone = VirtualPhone::new(VirtualPhoneConfig {
            seed,
            ..Default::default()
        })
        .unwrap();
        run(
            phone.events().map(Ok::<_, RecordingError>),
            &options,
            &mut (),
        )
        .unwrap()
    };
    (1..=PHONES).into_par_iter().map(one).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    (values.map(|v| v * v).sum::<f64>() / PHONES as f64).sqrt()
}

fn calculated_deg(summaries: &[RunSummary]) -> f64 {
    rms(summaries
        .iter()
        .map(|s| s.final_test.as_ref().unwrap().calculated_error_deg))
}

/// Twenty errors of three components each: their RMS is known to 13 %, two sigma.
#[test]
fn the_mekf_ends_as_far_off_as_it_says_and_integration_much_farther() {
    let mekf = lab(EstimatorKind::Mekf);
    let calculated = calculated_deg(&mekf);
    let estimated = rms(mekf
        .iter()
        .map(|s| s.final_test.as_ref().unwrap().estimated_error_deg.unwrap()));
    assert!(
        (calculated / estimated - 1.0).abs() < 0.3,
        "{calculated} {estimated}"
    );
    let consistent = mekf
        .iter()
        .filter(|s| s.final_test.as_ref().unwrap().verdict == Some(FinalVerdict::Consistent));
    // 95 % are expected; fewer than 15 of 20 has a chance of 3e-4.
    assert!(consistent.count() >= 15);
    let integration = calculated_deg(&lab(EstimatorKind::Integration));
    assert!(integration > 5.0 * calculated, "{integration} {calculated}");
}

#[test]
fn noise_from_the_rest_is_consistent_and_so_is_the_covariance() {
    let mekf = lab(EstimatorKind::Mekf);
    let mean =
        |value: &dyn Fn(&RunSummary) -> f64| mekf.iter().map(value).sum::<f64>() / PHONES as f64;
    let accelerometer = mean(&|s| s.nis_mean.accelerometer.unwrap());
    let magnetometer = mean(&|s| s.nis_mean.magnetometer.unwrap());
    assert!((accelerometer - 3.0).abs() < 0.15, "{accelerometer}");
    assert!((magnetometer - 3.0).abs() < 0.15, "{magnetometer}");
    let nees = mean(&|s| s.nees_mean.unwrap());
    assert!((0.7..1.3).contains(&nees), "{nees}");
    for summary in &mekf {
        for verdict in &summary.verdicts {
            assert!(
                verdict.sentences[0].contains("R is consistent"),
                "{verdict:?}"
            );
        }
    }
}
