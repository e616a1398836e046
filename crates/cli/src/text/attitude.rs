//! The outcome of a run for people: a short sheet, numbers with words.

use std::fmt::Write as _;

use northing_evaluation::attitude::{PositionSummary, RunSummary};
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::statistics::nis::UpdateCounts;
use northing_recording::SensorKind;

use crate::text::sheet::Sheet;
use crate::text::used;

/// The sheet of a run.
pub(crate) fn describe(summary: &RunSummary) -> String {
    describe_with(summary, &str::to_owned)
}

/// The same with every text of it changed.
pub(crate) fn describe_with(summary: &RunSummary, change: &dyn Fn(&str) -> String) -> String {
    let mut sheet = Sheet::default();
    errors(&mut sheet, summary);
    if let Some(nees) = &summary.nees {
        sheet.row("uncertainty", nees.in_words());
    }
    let causes = summary
        .findings
        .iter()
        .filter(|finding| finding.cause.is_mendable());
    let causes: Vec<String> = causes.map(|finding| finding.sentence.clone()).collect();
    sheet.sentences("look at first", &causes);
    let updates = &summary.updates;
    for (kind, counts) in [
        (SensorKind::Accelerometer, &updates.accelerometer),
        (SensorKind::Magnetometer, &updates.magnetometer),
        (SensorKind::CompassHeading, &updates.compass),
    ] {
        sensor(&mut sheet, summary, kind, counts);
    }
    if let Some(position) = &summary.position {
        sheet.row("position", place(position));
    }
    match &summary.final_test {
        Some(test) => sheet.row("final test", test.sentence.as_str()),
        None => sheet.row(
            "final test",
            "does not apply: the device does not rest in the same pose at both ends",
        ),
    }
    if let Some(stream) = summary.magnetometer
        && let Some(prior) = summary.hard_iron_prior_ut
    {
        sheet.row("hard iron", hard_iron(stream, prior));
    }
    if let Some(calibration) = &summary.calibration {
        sheet.row("calibration", calibration.as_str());
    }
    if let Some(calibration) = &summary.magnetometer_calibration {
        sheet.row("magnetometer calibration", calibration.as_str());
    }
    sheet.parameters(&summary.parameters);
    sheet.sentences("unobservable", &summary.unobservable);
    sheet.sentences("recording", &summary.issues);
    sheet.change(change);
    format!("{}\n\n{}", title(summary), sheet.render())
}

/// The errors against the reference; where nothing said where north is, those that do not depend on it.
fn errors(sheet: &mut Sheet, summary: &RunSummary) {
    let Some(error) = &summary.error_deg else {
        let why = match summary.reference {
            Some(_) => "the reference of the recording could not be scored",
            None => "the recording has no reference to score against",
        };
        sheet.row("attitude error", format!("unknown: {why}"));
        return;
    };
    let samples = error.scored_samples;
    if !error.heading_offset_removed {
        sheet.row(
            "attitude error",
            format!(
                "{:.2} deg RMS (heading {:.2}, inclination {:.2}) over {samples} scored samples",
                error.total_rmse, error.heading_rmse, error.inclination_rmse
            ),
        );
        return;
    }
    sheet.row(
        "inclination error",
        format!(
            "{:.2} deg RMS over {samples} scored samples",
            error.inclination_rmse
        ),
    );
    sheet.row(
        "heading error",
        format!(
            "drift {:.2} deg RMS since the first scored sample, {:.2} deg at the end; {:.2} deg RMS after a constant \
             offset of {:.1} deg is removed: nothing said where north is",
            error.heading_drift_rmse, error.heading_drift_end, error.heading_rmse, error.heading_offset
        ),
    );
}

fn title(summary: &RunSummary) -> String {
    let smoothed = if summary.smoothed { ", smoothed" } else { "" };
    let profile = summary
        .profile
        .map(|p| format!(" ({} profile{smoothed})", p.name()));
    format!(
        "{}: {}{} over {:.1} s, {} samples",
        summary.recording,
        summary.estimator,
        profile.unwrap_or_default(),
        summary.duration_s,
        summary.samples
    )
}

/// What the estimator takes for granted about the magnetometer's offset.
fn hard_iron(stream: MagnetometerSource, prior_ut: f64) -> String {
    let stream = stream.name();
    if prior_ut > 0.0 {
        format!("estimated, expected within {prior_ut:.0} uT per axis ({stream} magnetometer).")
    } else {
        format!("none expected: the {stream} magnetometer is taken as calibrated.")
    }
}

/// What became of the positions, and what they told.
fn place(position: &PositionSummary) -> String {
    let mut text = used(&position.updates);
    if let Some(rms) = position.innovation_rms_m {
        let _ = write!(
            text,
            " Measured minus estimated: {:.2} m RMS per horizontal axis, {:.2} m vertically.",
            rms.horizontal, rms.vertical
        );
    }
    let [x, y, z] = position.accelerometer_bias_m_s2;
    let _ = write!(
        text,
        " Accelerometer bias at the end: {x:.3}, {y:.3}, {z:.3} m/s^2."
    );
    text
}

/// A sensor's use, and its verdict.
fn sensor(sheet: &mut Sheet, summary: &RunSummary, kind: SensorKind, counts: &UpdateCounts) {
    let total = counts.fused + counts.gated + counts.skipped;
    if total == 0 {
        return;
    }
    let mut text = used(counts);
    let verdict = summary
        .verdicts
        .iter()
        .find(|verdict| verdict.sensor == kind);
    for sentence in verdict.iter().flat_map(|verdict| &verdict.sentences) {
        text.push(' ');
        text.push_str(sentence);
    }
    sheet.row(kind.name(), text);
}
