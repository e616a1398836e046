//! A span of a recording: `--from` and `--to`, in seconds after its first sample.

use anyhow::{Result, bail};
use clap::Args;
use northing_recording::{Event, RecordingError};

use crate::arguments::input::seconds;

/// Options that choose a span.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(crate) struct SpanArgs {
    /// Start of the span, seconds after the first sample
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) from: Option<f64>,
    /// End of the span, seconds after the first sample
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(crate) to: Option<f64>,
}

impl SpanArgs {
    /// Refuses a span that ends before it begins.
    pub(crate) fn check(&self) -> Result<()> {
        if let (Some(from), Some(to)) = (self.from, self.to)
            && from >= to
        {
            bail!("--from {from} is not before --to {to}");
        }
        Ok(())
    }

    /// The events within the span, and every error.
    pub(crate) fn of(
        self,
        events: impl Iterator<Item = Result<Event, RecordingError>>,
    ) -> impl Iterator<Item = Result<Event, RecordingError>> {
        let mut first_ns = None;
        let [from, to] = [self.from.unwrap_or(0.0), self.to.unwrap_or(f64::INFINITY)];
        events.filter(move |event| match event {
            Ok(event) => {
                let first_ns = *first_ns.get_or_insert(event.time_ns);
                let time_s = event.time_ns.saturating_sub(first_ns) as f64 * 1e-9;
                (from..=to).contains(&time_s)
            }
            Err(_) => true,
        })
    }
}
