//! The page of a run: what the summary says, and what only the program knows.

use crate::attitude::run_report::RunReport;
use crate::page::facts::Fact;
use northing_evaluation::attitude::{RunSummary, Trace};
use northing_recording::Metadata;

/// The page of a run; `command` makes it again.
#[must_use]
pub fn render(summary: &RunSummary, metadata: &Metadata, trace: &Trace, command: String) -> String {
    let title = format!("Attitude of {}", metadata.name);
    let mut report = RunReport::of_run(title, summary, trace);
    report.command = Some(command);
    let mut facts = vec![
        Fact::new("format", metadata.format.as_str()),
        Fact::new("world frame", metadata.world_frame.name()),
    ];
    facts.extend(
        metadata
            .device
            .as_ref()
            .map(|device| Fact::new("device", device)),
    );
    report.recording_facts.splice(0..0, facts);
    report.render()
}
