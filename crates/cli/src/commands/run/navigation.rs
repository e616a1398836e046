//! `northing run` with a navigation estimator: position, velocity and attitude, and their errors.

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use northing_evaluation::navigation::trace::NavigationTrace;
use northing_evaluation::navigation::{
    NavigationFile, NavigationKind, NavigationObserver, NavigationOptions, NavigationSummary,
    run_navigation,
};
use northing_recording::Recording;
use northing_recording::atomic_file::write_whole;
use northing_report::{NavigationReport, TRACE_CAPACITY};

use super::arguments::RunArgs;
use super::foxglove;
use crate::arguments::estimation::of_recording;
use crate::files::output::{check_free, print, print_json, report_written, same_file};
use crate::files::shown;
use crate::invocation::command_line;
use crate::progress::watched;
use crate::text::navigation as text;

/// Runs.
pub(crate) fn execute(
    kind: NavigationKind,
    args: &RunArgs,
    opened: Option<Result<Recording>>,
) -> Result<()> {
    check_outputs(args)?;
    let mut recording = args.opened(opened)?;
    let mut options = args
        .estimation
        .navigation_options(kind, recording.metadata())?;
    args.navigation.apply(&mut options);
    let for_foxglove = foxglove::file(args)?;
    let file = args.out.as_deref().filter(|_| for_foxglove.is_none());
    let traced = args.report.is_some() || args.navigation.picture.is_some();
    let trace = traced.then(|| NavigationTrace::new(TRACE_CAPACITY));
    let file = file
        .map(|path| NavigationFile::create(path, args.force))
        .transpose()?;
    let recorder = foxglove::navigation_recorder(args, for_foxglove.as_ref());
    let mut watchers = ((trace, file), recorder);
    let name = shown(&args.recording);
    let summary = run_over(&mut recording, &name, &options, &mut watchers)?;
    let title = recording.metadata().name.clone();
    let (outputs, played) = watchers;
    let played = played.map(foxglove::navigation_run);
    let mut written = write_outputs(args, &summary, &title, outputs)?;
    if let Some(path) = foxglove::write(for_foxglove, played.as_ref())? {
        written.push(format!("For Foxglove: {}", path.display()));
    }
    if args.json {
        print_json(&summary)?;
    } else {
        let mut text = text::describe(&summary);
        if !written.is_empty() {
            text.push_str(&format!("\n{}\n", written.join("\n")));
        }
        print(&text)?;
    }
    foxglove::serve_navigation(args, options, played, &summary.parameters)
}

/// Refuses outputs that cannot be written, before any work is done for them.
fn check_outputs(args: &RunArgs) -> Result<()> {
    let outputs = [
        ("--report", &args.report),
        ("--picture", &args.navigation.picture),
        ("--out", &args.out),
    ];
    let mut named: Vec<(&str, &Path)> = Vec::new();
    for (option, path) in outputs {
        let Some(path) = path else { continue };
        if let Some((other, _)) = named.iter().find(|(_, other)| same_file(other, path)) {
            bail!(
                "{other} and {option} name the same file, {}; name two",
                path.display()
            );
        }
        args.input
            .check_not_read(path, &args.recording, &args.data)?;
        check_free(path, args.force)?;
        named.push((option, path));
    }
    Ok(())
}

/// Runs an estimator over a recording; `name` stands for it in the summary and in messages.
pub(super) fn run_over(
    recording: &mut Recording,
    name: &str,
    options: &NavigationOptions,
    observer: &mut dyn NavigationObserver,
) -> Result<NavigationSummary> {
    let world = recording.metadata().frames();
    let events = watched(recording, "navigating");
    let summary = run_navigation(events, name, world, options, observer);
    let mut summary = summary.map_err(|error| {
        let dropped = recording.issues().rows_without_stamp;
        let error = of_recording(error, name);
        if dropped == 0 {
            return error;
        }
        // What was dropped may be all the fixes that there are.
        anyhow!("{error:#}; rows without a time stamp, which were dropped: {dropped}")
    })?;
    summary.issues.splice(0..0, recording.issues().sentences());
    Ok(summary)
}

fn write_outputs(
    args: &RunArgs,
    summary: &NavigationSummary,
    name: &str,
    (trace, file): (Option<NavigationTrace>, Option<NavigationFile>),
) -> Result<Vec<String>> {
    let mut written = Vec::new();
    if let Some(trace) = &trace {
        let page = NavigationReport {
            name: name.to_owned(),
            summary,
            trace,
            command: Some(command_line()),
        };
        if let Some(path) = &args.report {
            write_whole(path, page.render().as_bytes(), args.force)?;
            written.push(report_written(path));
        }
        if let Some(path) = &args.navigation.picture {
            let Some(picture) = page.picture() else {
                bail!("{name}: there was not one estimate, so there is nothing to draw");
            };
            write_whole(path, picture.as_bytes(), args.force)?;
            written.push(format!("Picture: {}", path.display()));
        }
    }
    if let (Some(path), Some(file)) = (&args.out, file) {
        file.finish(name)
            .with_context(|| path.display().to_string())?;
        written.push(format!("Estimates: {}", path.display()));
    }
    Ok(written)
}
