//! `northing completions`: scripts with which a shell completes commands and options.

use anyhow::Result;
use clap::{Args, Command};
use clap_complete::{Shell, generate};

use crate::files::output::print;

/// Arguments of `completions`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  northing completions bash > ~/.local/share/bash-completion/completions/northing
  northing completions zsh > ~/.zfunc/_northing        # a folder of $fpath
  northing completions fish > ~/.config/fish/completions/northing.fish")]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Prints the script for `program`.
pub(crate) fn execute(args: &CompletionsArgs, mut program: Command) -> Result<()> {
    let mut script = Vec::new();
    generate(args.shell, &mut program, "northing", &mut script);
    print(&String::from_utf8_lossy(&script))
}
