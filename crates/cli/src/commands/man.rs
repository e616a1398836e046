//! `northing man`: the manual pages, from the same definitions as the help.

use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use clap::{Args, Command};
use clap_mangen::Man;
use northing_recording::atomic_file::write_whole;

use crate::files::output::{check_free, print};

/// Arguments of `man`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  mkdir -p ~/.local/share/man/man1
  northing man ~/.local/share/man/man1
  man northing-run")]
pub(crate) struct ManArgs {
    /// The folder, which must exist
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Overwrite pages that exist
    #[arg(long)]
    force: bool,
}

/// Writes those of `program`, or none of them where one is in the way.
pub(crate) fn execute(args: &ManArgs, program: Command) -> Result<()> {
    if !args.folder.is_dir() {
        bail!("{}: not a folder; make it first", args.folder.display());
    }
    let mut pages = Vec::new();
    let mut root = program.disable_help_flag(true);
    root.build();
    collect(&root, "northing", &mut pages)?;
    let pages: Vec<_> = pages
        .into_iter()
        .map(|(name, page)| (args.folder.join(format!("{name}.1")), page))
        .collect();
    for (path, _) in &pages {
        check_free(path, args.force)?;
    }
    for (path, page) in &pages {
        write_whole(path, page, args.force)?;
    }
    print(&format!(
        "{} manual pages in {}: man northing\n",
        pages.len(),
        args.folder.display()
    ))
}

/// The page of a command and those of the commands below it.
fn collect(command: &Command, name: &str, pages: &mut Vec<(String, Vec<u8>)>) -> Result<()> {
    let below: Vec<&Command> = command
        .get_subcommands()
        .filter(|below| !below.is_hide_set())
        .collect();
    let mut page = Vec::new();
    Man::new(command.clone())
        .title(name.to_uppercase())
        .source(concat!("northing ", env!("CARGO_PKG_VERSION")))
        .render(&mut page)
        .with_context(|| format!("manual page of {name}"))?;
    let page = with_examples_as_they_are(&String::from_utf8_lossy(&page));
    pages.push((name.to_owned(), page.into_bytes()));
    for one in below {
        collect(one, &format!("{name}-{}", one.get_name()), pages)?;
    }
    Ok(())
}

/// The end of a command's help as a section of its own, its lines not run together.
fn with_examples_as_they_are(page: &str) -> String {
    let Some((head, end)) = page.split_once(".SH EXTRA\n") else {
        return page.to_owned();
    };
    match end.strip_prefix("Examples:\n") {
        Some(examples) => format!("{head}.SH EXAMPLES\n.nf\n{}\n.fi\n", examples.trim_end()),
        None => format!("{head}.SH NOTES\n{end}"),
    }
}
