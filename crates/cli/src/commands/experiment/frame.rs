//! What experiments on random worlds share: which worlds, what is written, progress, Ctrl-C.

use anyhow::{Result, bail};
use clap::Args;
use serde::Serialize;

use crate::files::output::{ReportArgs, number, print, print_json};
use crate::interrupt;
use crate::invocation::command_line;
use crate::progress::SharedProgress;

/// Which worlds.
#[derive(Debug, Args)]
pub(super) struct WorldsArgs {
    /// How many worlds
    #[arg(long, value_name = "NUMBER", default_value_t = 1000)]
    pub(super) worlds: u64,
    /// Number of the first
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    pub(super) first: u64,
    /// Seed of all worlds
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub(super) seed: u64,
}

impl WorldsArgs {
    /// Refuses a number of worlds that is none, or too large to keep.
    pub(super) fn check(&self, most: u64) -> Result<()> {
        within("--worlds", self.worlds, most)
    }

    /// How many worlds of these numbers there are; `of` is what they were chosen by.
    pub(super) fn counted(&self, numbers: &[u64], of: &str) -> Result<u64> {
        if numbers.is_empty() {
            let last = self.first.saturating_add(self.worlds - 1);
            bail!(
                "no world of this {of} among the numbers {} to {last}; ask for 9 or more",
                self.first
            );
        }
        Ok(numbers.len() as u64)
    }
}

/// Refuses what is not from 1 to `most`.
pub(super) fn within(option: &str, value: u64, most: u64) -> Result<()> {
    if !(1..=most).contains(&value) {
        bail!("{option} is {value}, expected from 1 to {most}");
    }
    Ok(())
}

/// What is written.
#[derive(Debug, Args)]
pub(super) struct OutputArgs {
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    report: ReportArgs,
}

impl OutputArgs {
    /// Refuses a report that exists already.
    pub(super) fn check_free(&self) -> Result<()> {
        self.report.check_free()
    }

    /// Whether a report is asked for.
    pub(super) const fn has_report(&self) -> bool {
        self.report.report.is_some()
    }

    /// Writes the page that is asked for; `html` is given the command line.
    pub(super) fn write_report(&self, html: impl FnOnce(&str) -> String) -> Result<()> {
        self.report.write(|| html(&command_line()))
    }

    /// Prints one document, or text for people.
    pub(super) fn print(
        &self,
        document: &impl Serialize,
        text: impl FnOnce() -> String,
    ) -> Result<()> {
        if self.json {
            print_json(document)
        } else {
            print(&text())
        }
    }
}

/// Work of so many steps, with its progress; Ctrl-C ends it.
pub(super) fn with_progress<T>(
    steps: u64,
    what: &str,
    work: impl FnOnce(&(dyn Fn() + Sync)) -> T,
) -> T {
    let progress = SharedProgress::of_steps(steps, what);
    work(&|| {
        interrupt::exit_if_happened();
        progress.step();
    })
}

/// The first instant, and the first of each second.
pub(super) fn each_second<T>(
    instants: &[T],
    time_s: impl Fn(&T) -> f64,
) -> impl Iterator<Item = &T> {
    let mut next_s = 0.0;
    instants.iter().filter(move |instant| {
        let time_s = time_s(instant);
        let takes = time_s + 1e-6 >= next_s;
        if takes {
            next_s = time_s.floor() + 1.0;
        }
        takes
    })
}

/// A share in percent; `-` where there is none.
pub(super) fn percent(share: Option<f64>) -> String {
    number(share.map(|share| 100.0 * share), 1)
}
