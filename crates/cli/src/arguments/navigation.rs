//! Arguments about navigation: which fixes are used, and which are held out and scored.

use std::path::PathBuf;

use clap::Args;
use northing_evaluation::navigation::{AidKind, NavigationOptions, Outage};

use super::input::seconds;

/// Options about navigation.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Navigation (error-state, axis-filters, dead-reckoning, device)")]
pub(crate) struct NavigationArgs {
    /// Use one of N fixes; the others are held out and scored at
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    gnss_every: Option<u32>,
    /// Keep all fixes back for a while, both in seconds, the start after the first fix; may be repeated
    #[arg(long, value_name = "START:DURATION")]
    outage: Vec<Outage>,
    /// Leave aids out, e.g. magnetometer,barometer
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    without: Vec<AidKind>,
    /// Scores count from so many seconds after the first fix [default: 60]
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    score_from: Option<f64>,
    /// Draw one picture (SVG): orientation and position with what was measured, a few seconds of both, and the track
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,
}

impl NavigationArgs {
    /// The first option given, for an estimator that has no use for it.
    pub(crate) fn first_given(&self) -> Option<&'static str> {
        let given = [
            ("--gnss-every", self.gnss_every.is_some()),
            ("--outage", !self.outage.is_empty()),
            ("--without", !self.without.is_empty()),
            ("--score-from", self.score_from.is_some()),
            ("--picture", self.picture.is_some()),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(n, _)| n)
    }

    /// Writes them into the options of a run.
    pub(crate) fn apply(&self, options: &mut NavigationOptions) {
        let defaults = NavigationOptions::default();
        options.gnss_every = self.gnss_every.unwrap_or(defaults.gnss_every);
        options.outages.clone_from(&self.outage);
        options.without.clone_from(&self.without);
        options.score_from_s = self.score_from.unwrap_or(defaults.score_from_s);
    }
}
