//! `--foxglove` where the program is built without it: nobody watches, nothing is served.

use std::path::PathBuf;

use anyhow::Result;
use northing_evaluation::navigation::NavigationOptions;
use northing_evaluation::{RunOptions, UsedParameter};
use northing_recording::WorldFrame;

use super::arguments::RunArgs;

pub(super) fn file(_: &RunArgs) -> Result<Option<()>> {
    Ok(None)
}

pub(super) fn write(_: Option<()>, _: Option<&()>) -> Result<Option<PathBuf>> {
    Ok(None)
}

pub(super) fn attitude_recorder(
    _: &RunArgs,
    _: &RunOptions,
    _: WorldFrame,
    _: Option<&()>,
) -> Option<()> {
    None
}

pub(super) fn navigation_recorder(_: &RunArgs, _: Option<&()>) -> Option<()> {
    None
}

pub(super) fn attitude_run((): ()) {}

pub(super) fn navigation_run((): ()) {}

pub(super) fn serve_attitude(
    _: &RunArgs,
    _: RunOptions,
    _: Option<()>,
    _: &[UsedParameter],
) -> Result<()> {
    Ok(())
}

pub(super) fn serve_navigation(
    _: &RunArgs,
    _: NavigationOptions,
    _: Option<()>,
    _: &[UsedParameter],
) -> Result<()> {
    Ok(())
}
