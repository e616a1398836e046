//! `--foxglove` where the program is built without it: there are no viewers.

use std::sync::Arc;

use anyhow::Result;
use northing_live::lab::Lab;

use super::LiveArgs;

/// There are none.
pub(super) enum Viewers {}

impl Viewers {
    pub(super) fn url(&self) -> String {
        match *self {}
    }

    pub(super) async fn stop(self) {
        match self {}
    }
}

pub(super) fn start(_: &LiveArgs, _: &Arc<Lab>) -> Result<Option<Viewers>> {
    Ok(None)
}
