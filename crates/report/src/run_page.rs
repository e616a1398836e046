//! The page of a run: what the summary says, and what only the program knows.

use northing_evaluation::parameters::Parameters;
use northing_evaluation::report::{Fact, RunReport};
use northing_evaluation::summary::RunSummary;
use northing_evaluation::trace::Trace;
use northing_recording::Metadata;

use crate::cli::command_line;

/// The page of a run; `config` are the parameters that it ran with.
pub(crate) fn render(
    summary: &RunSummary,
    config: &Parameters,
    metadata: &Metadata,
    trace: &Trace,
) -> String {
    let title = format!("Attitude of {}", metadata.name);
    let mut report = RunReport::of_run(title, summary, config, trace);
    report.command = Some(command_line());
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
