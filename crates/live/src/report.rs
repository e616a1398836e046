//! The lab report of an experiment: what every page about a run says, and what the lab knows.

use base64::Engine as _;
use northing_evaluation::attitude::outcome::RunSummary;
use northing_evaluation::attitude::setup::RunSetup;
use northing_evaluation::attitude::trace::Trace;
use northing_report::{Fact, RunReport, inline_script};

use crate::experiments::{Finished, run_options};

/// The page.
#[must_use]
pub fn render(finished: &Finished, summary: &RunSummary, trace: &Trace) -> String {
    let mut report = RunReport::of_run(title(finished), summary, trace);
    report.summary.extend(others(finished, summary));
    let facts = [
        Fact::new("device", finished.device_name.as_str()),
        Fact::new("ended", finished.at.as_str()),
        Fact::new("SHA-256 of the samples", finished.hash.as_str()),
    ];
    report.recording_facts.splice(0..0, facts);
    let id = &finished.id;
    // The names that the lab gives these files when they are downloaded.
    let command = format!("northing run {id}-recording.csv --setup {id}-report.html");
    report.command = Some(command);
    let options = run_options(&finished.experiment, &finished.options, summary.estimator);
    report.setup = Some(RunSetup::of(&options).to_text());
    report.render()
}

/// What a report's page may do: it has its style sheet, its pictures and its one script within itself.
#[must_use]
pub fn policy() -> String {
    let digest = ring::digest::digest(&ring::digest::SHA256, inline_script().as_bytes());
    let hash = base64::engine::general_purpose::STANDARD.encode(digest);
    format!(
        "default-src 'none'; script-src 'sha256-{hash}'; style-src 'unsafe-inline'; img-src data: blob:"
    )
}

/// What people call it; only a number is called an experiment.
fn title(finished: &Finished) -> String {
    match finished.experiment.name.as_str() {
        "" => format!("Experiment {}", finished.id),
        name => name.to_owned(),
    }
}

/// The calculated errors of the other estimators.
fn others<'a>(finished: &'a Finished, drawn: &'a RunSummary) -> impl Iterator<Item = Fact> + 'a {
    let others = finished.summaries.iter();
    let others = others.filter(|(name, _)| **name != drawn.estimator.name());
    others.filter_map(|(name, summary)| {
        let error = summary.final_test.as_ref()?.judged_deg().0;
        let label = format!("final test, calculated error of {name}");
        Some(Fact::new(label, format!("{error:.2} deg")))
    })
}
