//! `northing run --foxglove`: the run behind a server that viewers play, pause, seek in and set parameters of; and
//! `--messages foxglove`: the same as a file.

use anyhow::{Result, bail};
use northing_evaluation::navigation::NavigationOptions;
use northing_evaluation::{Origin, RunOptions, UsedParameter};
use northing_foxglove::{AttitudeRecorder, NavigationRecorder, PlayedRun, Player, RunFile, Source};
use northing_recording::WorldFrame;

use super::arguments::{Messages, RunArgs};
use super::navigation;
use crate::arguments::estimation;
use crate::files::output::print;
use crate::files::shown;
use crate::interrupt;

/// The file of Foxglove's messages, if that was asked for: `--out` is this one then.
pub(super) fn file(args: &RunArgs) -> Result<Option<RunFile>> {
    let Some(path) = args.out.as_ref() else {
        return Ok(None);
    };
    if args.messages == Messages::Ros2 {
        return Ok(None);
    }
    if path.extension().is_none_or(|end| end != "mcap") {
        bail!(
            "--messages foxglove is of MCAP files, and --out is {}; name it .mcap",
            path.display()
        );
    }
    Ok(Some(RunFile::create(path, args.force)?))
}

/// Writes the file; its path.
pub(super) fn write(
    file: Option<RunFile>,
    run: Option<&PlayedRun>,
) -> Result<Option<std::path::PathBuf>> {
    let (Some(file), Some(run)) = (file, run) else {
        return Ok(None);
    };
    let path = file.path().to_owned();
    file.write(run)?;
    Ok(Some(path))
}

pub(super) fn attitude_recorder(
    args: &RunArgs,
    options: &RunOptions,
    world: WorldFrame,
    file: Option<&RunFile>,
) -> Option<AttitudeRecorder> {
    let is_asked = args.foxglove.is_some() || file.is_some();
    is_asked.then(|| AttitudeRecorder::new(options, world))
}

pub(super) fn navigation_recorder(
    args: &RunArgs,
    file: Option<&RunFile>,
) -> Option<NavigationRecorder> {
    let is_asked = args.foxglove.is_some() || file.is_some();
    is_asked.then(NavigationRecorder::default)
}

pub(super) fn attitude_run(recorder: AttitudeRecorder) -> PlayedRun {
    recorder.finish()
}

pub(super) fn navigation_run(recorder: NavigationRecorder) -> PlayedRun {
    recorder.finish()
}

/// Serves an attitude run until Ctrl-C, if that was asked for.
pub(super) fn serve_attitude(
    args: &RunArgs,
    options: RunOptions,
    run: Option<PlayedRun>,
    used: &[UsedParameter],
) -> Result<()> {
    match run {
        Some(run) => serve(args, run, used, &mut Attitude { args, options }),
        None => Ok(()),
    }
}

/// Serves a navigation run until Ctrl-C, if that was asked for.
pub(super) fn serve_navigation(
    args: &RunArgs,
    options: NavigationOptions,
    run: Option<PlayedRun>,
    used: &[UsedParameter],
) -> Result<()> {
    match run {
        Some(run) => serve(args, run, used, &mut Navigation { args, options }),
        None => Ok(()),
    }
}

fn serve(
    args: &RunArgs,
    run: PlayedRun,
    used: &[UsedParameter],
    source: &mut dyn Source,
) -> Result<()> {
    let (Some(address), name) = (args.foxglove, shown(&args.recording)) else {
        return Ok(());
    };
    let Some([start_ns, end_ns]) = run.span_ns() else {
        bail!("{name}: there was not one estimate, so there is nothing to play");
    };
    let player = Player::start(address, &format!("northing: {name}"), run, used)?;
    let text = format!(
        "\nFoxglove: ws://{} ({:.0} s to play); Ctrl-C ends it.\n",
        player.address(),
        end_ns.saturating_sub(start_ns) as f64 * 1e-9
    );
    match args.json {
        // Standard output is the document alone.
        true => eprint!("{text}"),
        false => print(&text)?,
    }
    player.serve(source, &interrupt::happened);
    Ok(())
}

/// Refuses parameters that the estimator does not read, and recordings that can be read only once.
fn check(args: &RunArgs, settings: &[String], known: &[UsedParameter]) -> Result<()> {
    if args.recording.as_os_str() == "-" {
        bail!("the recording came by standard input and cannot be read again; run it from a file");
    }
    for setting in settings {
        let name = setting.split('=').next().unwrap_or_default();
        if !known.iter().any(|parameter| parameter.name == name) {
            let known: Vec<&str> = known.iter().map(|p| p.name.as_str()).collect();
            bail!(
                "{name} is no parameter of this estimator, which has {}",
                known.join(", ")
            );
        }
    }
    Ok(())
}

struct Attitude<'a> {
    args: &'a RunArgs,
    options: RunOptions,
}

impl Attitude<'_> {
    fn run(&mut self, settings: &[String]) -> Result<(PlayedRun, Vec<UsedParameter>)> {
        check(self.args, settings, &self.options.parameters())?;
        let mut options = self.options.clone();
        for setting in settings {
            options.set(setting)?;
        }
        options.check()?;
        let mut recording = self.args.opened(None)?;
        let world = recording.metadata().world_frame;
        let mut recorder = AttitudeRecorder::new(&options, world);
        let name = shown(&self.args.recording);
        let summary = estimation::run_over(&mut recording, &name, &options, &mut recorder)?;
        self.options = options;
        Ok((recorder.finish(), summary.parameters))
    }
}

impl Source for Attitude<'_> {
    fn run_with(&mut self, settings: &[String]) -> Result<(PlayedRun, Vec<UsedParameter>), String> {
        self.run(settings).map_err(|error| format!("{error:#}"))
    }
}

struct Navigation<'a> {
    args: &'a RunArgs,
    options: NavigationOptions,
}

impl Navigation<'_> {
    fn run(&mut self, settings: &[String]) -> Result<(PlayedRun, Vec<UsedParameter>)> {
        check(self.args, settings, &self.options.used_parameters())?;
        let mut options = self.options.clone();
        for setting in settings {
            options.set_from(setting, Origin::Set)?;
        }
        options.check()?;
        let mut recording = self.args.opened(None)?;
        let mut recorder = NavigationRecorder::default();
        let name = shown(&self.args.recording);
        let summary = navigation::run_over(&mut recording, &name, &options, &mut recorder)?;
        self.options = options;
        Ok((recorder.finish(), summary.parameters))
    }
}

impl Source for Navigation<'_> {
    fn run_with(&mut self, settings: &[String]) -> Result<(PlayedRun, Vec<UsedParameter>), String> {
        self.run(settings).map_err(|error| format!("{error:#}"))
    }
}
