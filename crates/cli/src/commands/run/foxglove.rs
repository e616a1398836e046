//! `northing run --foxglove`: the run behind a server that viewers play, pause, seek in and set parameters of.

use anyhow::{Result, bail};
use northing_evaluation::navigation::NavigationOptions;
use northing_evaluation::{Origin, RunOptions, UsedParameter};
use northing_foxglove::{AttitudeRecorder, NavigationRecorder, PlayedRun, Player, Source};
use northing_recording::WorldFrame;

use super::arguments::RunArgs;
use super::navigation;
use crate::arguments::estimation;
use crate::files::output::print;
use crate::files::shown;
use crate::interrupt;

pub(super) fn attitude_recorder(
    args: &RunArgs,
    options: &RunOptions,
    world: WorldFrame,
) -> Option<AttitudeRecorder> {
    let recorder = |_| AttitudeRecorder::new(options, world);
    args.foxglove.map(recorder)
}

pub(super) fn navigation_recorder(args: &RunArgs) -> Option<NavigationRecorder> {
    args.foxglove.map(|_| NavigationRecorder::default())
}

/// Serves an attitude run until Ctrl-C, if that was asked for.
pub(super) fn serve_attitude(
    args: &RunArgs,
    options: RunOptions,
    recorder: Option<AttitudeRecorder>,
    used: &[UsedParameter],
) -> Result<()> {
    let Some(recorder) = recorder else {
        return Ok(());
    };
    serve(
        args,
        recorder.finish(),
        used,
        &mut Attitude { args, options },
    )
}

/// Serves a navigation run until Ctrl-C, if that was asked for.
pub(super) fn serve_navigation(
    args: &RunArgs,
    options: NavigationOptions,
    recorder: Option<NavigationRecorder>,
    used: &[UsedParameter],
) -> Result<()> {
    let Some(recorder) = recorder else {
        return Ok(());
    };
    serve(
        args,
        recorder.finish(),
        used,
        &mut Navigation { args, options },
    )
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
