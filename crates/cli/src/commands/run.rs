//! `northing run`: one estimator over one recording.

mod arguments;
#[cfg_attr(not(feature = "foxglove"), path = "run/without_foxglove.rs")]
mod foxglove;
mod navigation;

use anyhow::{Context, Result, bail};
use northing_evaluation::RunEstimator;
use northing_evaluation::attitude::reference::ReferenceUse;
use northing_evaluation::attitude::{Calibrations, EstimateFile, TraceObserver};
use northing_recording::atomic_file::write_whole;

use crate::arguments::estimation::{Asked, aligned_reference, run_over};
use crate::files::output::{check_free, print, print_json, report_written, same_file};
use crate::files::setup;
use crate::files::shown;
use crate::invocation::command_line;
use crate::text::attitude as text;
pub(crate) use arguments::RunArgs;
use northing_report::{TRACE_CAPACITY, run_page};

/// Runs.
pub(crate) fn execute(args: &RunArgs) -> Result<()> {
    let asked = args.asked_estimator()?;
    let opened = args.open_first(asked);
    let estimator = match &opened {
        // What is wrong with the recording is told after what is wrong with the options.
        Some(Ok(recording)) => RunEstimator::of_recording(asked, recording.sensors()),
        _ => asked,
    };
    let estimator = match estimator {
        Some(RunEstimator::Navigation(kind)) => return navigation::execute(kind, args, opened),
        Some(RunEstimator::Attitude(kind)) => Some(kind),
        None => None,
    };
    if let Some(option) = args.navigation.first_given() {
        bail!(
            "{option} has no effect on an estimator of the attitude alone; choose --estimator error-state, \
             axis-filters or dead-reckoning"
        );
    }
    let Asked {
        run: mut options,
        calibrations,
        align_reference,
    } = match &args.setup {
        Some(path) => Asked {
            run: setup::read(path)?,
            calibrations: Calibrations::default(),
            align_reference: false,
        },
        None => args.estimation.options_of_one(estimator, &args.input)?,
    };
    if let Some(report) = &args.report {
        if args.out.as_ref().is_some_and(|out| same_file(out, report)) {
            bail!(
                "--report and --out name the same file, {}; name two",
                report.display()
            );
        }
        check_free(report, args.force)?;
    }
    for output in args.report.iter().chain(&args.out) {
        args.input
            .check_not_read(output, &args.recording, &args.data)?;
    }
    let for_foxglove = foxglove::file(args)?;
    let out = args.out.as_ref().filter(|_| for_foxglove.is_none());
    let mut file = out
        .map(|out| EstimateFile::create(out, options.estimator, args.force))
        .transpose()?;
    if align_reference {
        options.reference = reference_of(args)?;
    }
    let mut recording = args.opened(opened)?;
    let metadata = recording.metadata().clone();
    calibrations
        .apply(&metadata, &mut options)
        .with_context(|| shown(&args.recording))?;
    if let Some(file) = &mut file {
        file.set_world(metadata.world_frame);
    }
    let traced = args.report.as_ref();
    let trace = traced.map(|_| TraceObserver::new(TRACE_CAPACITY, metadata.world_frame));
    let world = metadata.world_frame;
    let played = foxglove::attitude_recorder(args, &options, world, for_foxglove.as_ref());
    // Plots, a file and viewers, each where it is asked for.
    let mut watchers = ((trace, file), played);
    let name = shown(&args.recording);
    let summary = run_over(&mut recording, &name, &options, &mut watchers)?;
    let ((trace, file), played) = watchers;
    let played = played.map(foxglove::attitude_run);
    let mut written = Vec::new();
    if let (Some(path), Some(trace)) = (&args.report, trace) {
        let html = run_page::render(&summary, &metadata, trace.trace(), command_line());
        write_whole(path, html.as_bytes(), args.force)?;
        written.push(report_written(path));
    }
    if let (Some(path), Some(file)) = (&args.out, file) {
        file.finish()?;
        written.push(format!("Estimates: {}", path.display()));
    }
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
    foxglove::serve_attitude(args, options, played, &summary.parameters)
}

/// The reference's alignment, from a reading of the recording of its own.
fn reference_of(args: &RunArgs) -> Result<ReferenceUse> {
    if args.recording.as_os_str() == "-" {
        bail!(
            "--align-reference reads the recording twice; expected a file in place of standard input"
        );
    }
    aligned_reference(&mut args.opened(None)?, &shown(&args.recording))
}
