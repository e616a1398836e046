//! Scores of a run: which there are for each question, and how they follow from a summary.

use northing_evaluation::RunSummary;
use northing_evaluation::navigation::NavigationSummary;
use northing_evaluation::statistics::nis::NisSummary;
use northing_evaluation::tracking::TrackSummary;
use northing_evaluation::tracking::outcome::TargetSummary;

use super::file::StudyQuestion;
use super::key::Sources;
use crate::attitude_worlds::EstimatorScore;

/// Root mean squares of errors (`northing run`), NEES and NIS per degree of freedom, share of the instants inside the stated 95 %.
const ATTITUDE: [&str; 11] = [
    "total_rmse_deg",
    "heading_rmse_deg",
    "tilt_rmse_deg",
    "heading_drift_rmse_deg",
    "nees",
    "tilt_nees",
    "tilt_coverage_95",
    "heading_coverage_95",
    "accelerometer_nis",
    "magnetometer_nis",
    "compass_nis",
];

/// Errors at held-out fixes or at a reference, beside those of the last fix held and moved on.
const NAVIGATION: [&str; 10] = [
    "horizontal_rmse_m",
    "vertical_rmse_m",
    "coverage_95",
    "velocity_rmse_m_s",
    "heading_rmse_deg",
    "tilt_rmse_deg",
    "outage_error_rms_m",
    "hold_rmse_m",
    "extrapolation_rmse_m",
    "scored_fixes",
];

/// Over all targets; `coverage` is the share of instants with a track near, `coverage_95` of those inside the stated 95 %.
const TRACKING: [&str; 13] = [
    "gospa_m",
    "ospa_m",
    "tgospa_m",
    "coverage",
    "coverage_95",
    "anees",
    "position_rmse_m",
    "switches",
    "lost_targets",
    "targets",
    "confirmed_tracks",
    "false_tracks",
    "false_tracks_per_hour",
];

/// One target of a scenario; NEES per degree of freedom.
const SCENARIO: [&str; 4] = [
    "position_rmse_m",
    "velocity_rmse_m_s",
    "nees",
    "skipped_updates",
];

/// Names of the scores.
pub(super) const fn names(question: StudyQuestion, sources: &Sources) -> &'static [&'static str] {
    match (question, sources) {
        (StudyQuestion::Attitude, _) => &ATTITUDE,
        (StudyQuestion::Navigation, _) => &NAVIGATION,
        (StudyQuestion::Tracking, Sources::Scenario { .. }) => &SCENARIO,
        (StudyQuestion::Tracking, _) => &TRACKING,
    }
}

fn filled<const N: usize>(values: [Option<f64>; N]) -> Vec<f64> {
    let each = values.into_iter();
    each.map(|value| value.unwrap_or(f64::NAN)).collect()
}

/// Of an attitude run, with what was gathered at its instants.
pub(super) fn attitude(summary: &RunSummary, score: &EstimatorScore) -> Vec<f64> {
    let error = summary.error_deg;
    let nees = summary.nees;
    let nis = |nis: Option<NisSummary>| nis.map(|nis| nis.mean / f64::from(nis.degrees_of_freedom));
    filled([
        error.map(|error| error.total_rmse),
        error.map(|error| error.heading_rmse),
        error.map(|error| error.inclination_rmse),
        error.map(|error| error.heading_drift_rmse),
        nees.map(|nees| nees.mean),
        nees.map(|nees| nees.tilt_mean),
        score.tilt.map(|tilt| tilt.coverage),
        score.heading.map(|heading| heading.coverage),
        nis(summary.nis.accelerometer),
        nis(summary.nis.magnetometer),
        nis(summary.nis.compass),
    ])
}

/// Of a navigation run.
pub(super) fn navigation(summary: &NavigationSummary) -> Vec<f64> {
    let position = summary.position.as_ref();
    let ends = summary.outages.iter().filter_map(|o| o.horizontal_error_m);
    filled([
        position.map(|p| p.horizontal_rmse_m),
        position.and_then(|p| p.vertical_rmse_m),
        position.map(|p| p.inside_95),
        summary.velocity_rmse_m_s,
        summary.heading_rmse_deg,
        summary.tilt_rmse_deg,
        crate::scoring::rms(ends),
        position.and_then(|p| p.hold_rmse_m),
        position.and_then(|p| p.extrapolation_rmse_m),
        position.map(|p| p.scored_fixes as f64),
    ])
}

/// Of a tracking run: each target counts by its instants.
pub(super) fn tracking(summary: &TrackSummary) -> Vec<f64> {
    let targets = &summary.targets;
    let weighted = |weight: fn(&TargetSummary) -> usize,
                    of: &dyn Fn(&TargetSummary) -> Option<f64>| {
        let each = targets
            .iter()
            .filter_map(|t| Some((weight(t) as f64, of(t)?)));
        let (weights, sum) = each.fold((0.0, 0.0), |(n, sum), (w, x)| (n + w, sum + w * x));
        (weights > 0.0).then(|| sum / weights)
    };
    let matched = |of: &dyn Fn(&TargetSummary) -> Option<f64>| weighted(|t| t.matched, of);
    let square = |target: &TargetSummary| target.rmse_m.map(|rmse| rmse * rmse);
    let count = |of: fn(&TargetSummary) -> usize| {
        (!targets.is_empty()).then(|| targets.iter().map(of).sum::<usize>() as f64)
    };
    filled([
        summary.gospa_m,
        summary.ospa_m,
        summary.tgospa_m,
        weighted(|t| t.epochs, &|t| Some(t.coverage)),
        matched(&|t| t.inside_95),
        matched(&|t| t.anees),
        matched(&square).map(f64::sqrt),
        count(|t| t.switches),
        count(|t| usize::from(t.lost)),
        Some(targets.len() as f64),
        Some(summary.confirmed_tracks as f64),
        count(|_| 0).map(|_| summary.false_tracks as f64),
        summary.false_tracks_per_hour,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::registry::listed;
    use northing_evaluation::{EstimatorKind, navigation::NavigationKind, tracking::TrackerKind};

    /// A table has a column for each varied parameter beside those of the scores.
    #[test]
    fn no_parameter_has_the_name_of_a_score() {
        let parameters = listed::<EstimatorKind>()
            .chain(listed::<NavigationKind>())
            .chain(listed::<TrackerKind>())
            .flat_map(|estimator| estimator.parameters);
        for parameter in parameters {
            for names in [&ATTITUDE[..], &NAVIGATION, &TRACKING, &SCENARIO] {
                assert!(
                    !names.contains(&parameter.name.as_str()),
                    "{}",
                    parameter.name
                );
            }
        }
    }
}
