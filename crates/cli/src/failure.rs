//! How the program ends when something is wrong: one line on standard error and an exit code.

use std::io;
use std::process::ExitCode;

use clap::CommandFactory as _;

use crate::cli::Cli;
use crate::interrupt;

/// Exit code for anything the user can put right: arguments, files, settings.
const BAD_INPUT: u8 = 2;
/// The widest message of an argument error before it is cut.
const LONGEST: usize = 2000;

/// Ends the program with the outcome of a command.
pub(crate) fn exit_code(outcome: &anyhow::Result<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) if interrupt::happened() => {
            complain("interrupted; what was begun is not written");
            ExitCode::from(interrupt::EXIT_CODE)
        }
        // `northing ... | head`: the reader has seen enough.
        Err(error) if is_broken_pipe(error) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&with_causes(error));
            ExitCode::from(BAD_INPUT)
        }
    }
}

/// Prints what clap has to say: help and versions on standard output, an error as one line.
pub(crate) fn exit_code_of_arguments(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        // A closed pipe behind `--help` is no error either.
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let text = error.render().to_string();
    let arguments = std::env::args_os()
        .skip(1)
        .map(|word| word.to_string_lossy().into_owned());
    complain(&one_line_of_clap(&text, &command_of(arguments)));
    ExitCode::from(BAD_INPUT)
}

/// The message with those of its causes that it does not repeat itself.
fn with_causes(error: &anyhow::Error) -> String {
    let mut message = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if message.is_empty() {
            message = cause;
        } else if !message.contains(&cause) {
            message = format!("{message}: {cause}");
        }
    }
    message
}

fn complain(message: &str) {
    eprintln!("northing: {}", one_line(message));
}

/// A message without line breaks or other control characters.
fn one_line(message: &str) -> String {
    let words: Vec<&str> = message.split_whitespace().collect();
    words
        .join(" ")
        .chars()
        .filter(|c| !c.is_control())
        .take(LONGEST)
        .collect()
}

/// clap's paragraph as a sentence: what is wrong, any tip, and where to read on.
fn one_line_of_clap(text: &str, command: &str) -> String {
    let about = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage: "));
    let kept = about.filter(|line| !line.is_empty() && !line.starts_with("For more information"));
    let words: Vec<&str> = kept
        .map(|line| line.strip_prefix("error: ").unwrap_or(line))
        .collect();
    format!("{}; see {command} --help", words.join(" "))
}

/// The command whose help applies to these arguments.
fn command_of(arguments: impl Iterator<Item = String>) -> String {
    let mut known = Cli::command();
    let mut name = known.get_name().to_owned();
    for argument in arguments {
        let Some(next) = known.find_subcommand(&argument).cloned() else {
            break;
        };
        name = format!("{name} {argument}");
        known = next;
    }
    name
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause
            .downcast_ref::<io::Error>()
            .is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line_without_control_characters() {
        assert_eq!(one_line("a\n  b\tc\u{7}d\r\n"), "a b cd");
    }

    #[test]
    fn a_paragraph_of_clap_becomes_a_sentence_that_names_the_help() {
        let text = "error: unexpected argument '--sets' found\n\n  \
                    tip: a similar argument exists: '--set'\n\n\
                    Usage: northing run [OPTIONS] <RECORDING>\n\nFor more information, try '--help'.\n";
        assert_eq!(
            one_line_of_clap(text, "northing run"),
            "unexpected argument '--sets' found tip: a similar argument exists: '--set'; \
             see northing run --help"
        );
    }

    #[test]
    fn the_command_is_found_behind_its_name() {
        let command = |words: &str| command_of(words.split_whitespace().map(str::to_owned));
        assert_eq!(
            command("calibrate rest x.csv --from"),
            "northing calibrate rest"
        );
        assert_eq!(command("fly away"), "northing");
        assert_eq!(command(""), "northing");
    }

    #[test]
    fn causes_are_told_once() {
        let error = anyhow::anyhow!("no such file").context("a.csv: cannot open it: no such file");
        assert_eq!(with_causes(&error), "a.csv: cannot open it: no such file");
        let error = anyhow::anyhow!("no such file").context("a.csv");
        assert_eq!(with_causes(&error), "a.csv: no such file");
    }

    #[test]
    fn a_broken_pipe_is_found_below_other_errors() {
        let broken = io::Error::from(io::ErrorKind::BrokenPipe);
        assert!(is_broken_pipe(
            &anyhow::Error::from(broken).context("writing")
        ));
        assert!(!is_broken_pipe(&anyhow::anyhow!("else")));
    }
}
