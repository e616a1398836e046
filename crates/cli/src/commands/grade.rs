//! `northing grade`: the hand-ins of a class, each run again, in one table with the reasons.

mod hand_ins;
mod table;

use std::path::PathBuf;

use anyhow::{Result, anyhow, bail};
use clap::Args;
use northing_evaluation::exercises::Card;
use northing_evaluation::exercises::words::Language;
use northing_recording::atomic_file::write_whole;

use crate::arguments::exercise::{card, language};
use crate::files::output::{check_free, print, print_json};
use crate::interrupt;
use hand_ins::{Grading, find};

/// Arguments of `grade`.
#[derive(Debug, Args)]
#[command(
    long_about = "Judges the hand-ins of a class: every file is run again, from its recording and its settings, and \
                  what the file says about itself decides nothing. Prints who passed which card, each hand-in with the \
                  reason, and the recordings that stand under several names. Folders are searched with all folders in \
                  them for files that end in .zip. A file that cannot be judged is named; the others are judged all \
                  the same, and the exit code is 2.",
    after_help = "\
Examples:
  northing grade class/
  northing grade class/ --out class.csv            # for a spreadsheet, with all reasons
  northing grade class/ --card bias --language es
  northing grade monday/ tuesday/ --json"
)]
pub(crate) struct GradeArgs {
    /// Folders of hand-ins, or single files
    #[arg(value_name = "FOLDER", required = true)]
    paths: Vec<PathBuf>,
    /// Judge the hand-ins of this card alone
    #[arg(long, value_name = "CARD", value_parser = card)]
    card: Option<Card>,
    /// Write the table: CSV, a row for each hand-in, with all reasons
    #[arg(long, value_name = "TABLE")]
    out: Option<PathBuf>,
    /// Overwrite the table if it exists
    #[arg(long)]
    force: bool,
    /// Language of the reasons: en or es
    #[arg(long, value_name = "NAME", default_value = "en", value_parser = language)]
    language: Language,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Judges them.
pub(crate) fn execute(args: &GradeArgs) -> Result<()> {
    if let Some(out) = &args.out {
        check_free(out, args.force)?;
    }
    let found = find(&args.paths)?;
    let grading = Grading::judged(found, args.card);
    if interrupt::happened() {
        bail!("interrupted");
    }
    let class = &grading.class;
    if class.hand_ins.is_empty() {
        return Err(grading.failure().unwrap_or_else(|| nothing_left(args.card)));
    }
    if let Some(out) = &args.out {
        write_whole(out, &class.csv(args.language)?, args.force)?;
    }
    if args.json {
        print_json(&table::document(&grading, args.language))?;
    } else {
        let mut text = table::text(&grading, args.language);
        if let Some(out) = &args.out {
            text.push_str(&format!("\nTable: {}\n", out.display()));
        }
        print(&text)?;
    }
    grading.failure().map_or(Ok(()), Err)
}

/// Every hand-in is of another card.
fn nothing_left(card: Option<Card>) -> anyhow::Error {
    let card = card.map_or("", Card::name);
    anyhow!("no hand-in of the card `{card}` is among the files; leave --card out to see all")
}
