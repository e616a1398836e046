//! Scores of third-party baselines on the same recordings: the CSV files that `oracles/` writes.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use northing_evaluation::attitude::EstimatorKind;
use northing_evaluation::attitude::compare::{ErrorsDeg, Score, folder_of};

use crate::files::shown;

/// The columns, in any order among any others.
const COLUMNS: [&str; 5] = [
    "recording",
    "estimator",
    "total_deg",
    "heading_deg",
    "inclination_deg",
];
/// Longest name of an estimator: a column of the table has to hold it.
const LONGEST_NAME: usize = 40;
/// No angle between two attitudes is larger, deg.
const LARGEST_DEG: f64 = 180.0;

/// Reads the files; their rows have to speak of these recordings, and of each estimator once.
///
/// # Errors
/// A file that cannot be read, lacks a column, or has a row that is invalid: file, line and
/// what was expected.
pub(crate) fn read_all(files: &[PathBuf], recordings: &[PathBuf]) -> Result<Vec<Score>> {
    let mut scores = Vec::new();
    let mut seen = HashSet::new();
    for file in files {
        let name = file.display().to_string();
        let bytes = std::fs::read(file).with_context(|| format!("{name}: cannot read it"))?;
        parse(&bytes, recordings, &mut |score| {
            if !seen.insert((score.recording.clone(), score.estimator.clone())) {
                let (estimator, recording) = (score.estimator, score.recording);
                bail!("a second row for `{estimator}` on {recording}; expected one");
            }
            scores.push(score);
            Ok(())
        })
        .map_err(|(line, error)| anyhow!("{name}, line {line}{error}"))?;
    }
    Ok(scores)
}

/// An error with the line it is about.
type AtLine = (u64, String);

/// Reads one file and hands over its rows.
fn parse(
    bytes: &[u8],
    recordings: &[PathBuf],
    take: &mut dyn FnMut(Score) -> Result<()>,
) -> Result<(), AtLine> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let headings = reader.headers().map_err(|error| at_line(&error))?.clone();
    let columns = COLUMNS.map(|name| headings.iter().position(|heading| heading == name));
    let missing: Vec<_> = COLUMNS
        .iter()
        .zip(columns)
        .filter(|(_, column)| column.is_none())
        .map(|(name, _)| format!("`{name}`"))
        .collect();
    let [
        Some(recording),
        Some(estimator),
        Some(total),
        Some(heading),
        Some(inclination),
    ] = columns
    else {
        let missing = missing.join(", ");
        let all = COLUMNS.join(",");
        return Err((
            1,
            format!(": no column {missing}; expected a header with {all}"),
        ));
    };
    let mut rows = 0;
    for row in reader.records() {
        let row = row.map_err(|error| at_line(&error))?;
        let line = row.position().map_or(0, csv::Position::line);
        let cell = |column: usize| row.get(column).unwrap_or_default();
        let score = || -> Result<Score, String> {
            let path = recording_named(cell(recording), recordings)?;
            Ok(Score {
                recording: shown(path),
                folder: folder_of(path),
                estimator: estimator_named(cell(estimator))?,
                error_deg: Some(ErrorsDeg {
                    total: degrees(cell(total), COLUMNS[2])?,
                    heading: degrees(cell(heading), COLUMNS[3])?,
                    inclination: degrees(cell(inclination), COLUMNS[4])?,
                }),
                nees: None,
            })
        };
        let score = score().map_err(|message| (line, message))?;
        take(score).map_err(|error| (line, format!(": {error}")))?;
        rows += 1;
    }
    if rows == 0 {
        return Err((
            2,
            ": no rows; expected one for each recording and estimator".to_owned(),
        ));
    }
    Ok(())
}

/// What the reader of CSV complains about.
fn at_line(error: &csv::Error) -> AtLine {
    let line = error.position().map_or(1, csv::Position::line);
    let what = match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => format!(": {len} cells; expected {expected_len}, as in the header"),
        csv::ErrorKind::Utf8 { .. } => ": this is no text; expected a CSV file in UTF-8".to_owned(),
        _ => format!(": {error}; expected a CSV file"),
    };
    (line, what)
}

/// The recording that a row means: a file's name, with or without its ending, and with as many of
/// the folders above it as are needed to tell it from others.
fn recording_named<'a>(name: &str, recordings: &'a [PathBuf]) -> Result<&'a Path, String> {
    let column = ", column `recording`";
    if name.is_empty() {
        return Err(format!("{column}: empty; expected the name of a recording"));
    }
    let mut meant = recordings
        .iter()
        .filter(|path| path.ends_with(name) || path.with_extension("").ends_with(name));
    match (meant.next(), meant.next()) {
        (Some(path), None) => Ok(path),
        (Some(one), Some(other)) => Err(format!(
            "{column}: `{name}` is {} or {}; expected its folder before it, as in FOLDER/{name}",
            one.display(),
            other.display()
        )),
        (None, _) => {
            let example = recordings.first().and_then(|path| path.file_stem());
            let example = example.unwrap_or_default().to_string_lossy();
            Err(format!(
                "{column}: `{name}` is none of the {} recordings; expected a name such as `{example}`",
                recordings.len()
            ))
        }
    }
}

/// The name of an estimator that is none of ours.
fn estimator_named(name: &str) -> Result<String, String> {
    let column = ", column `estimator`";
    if name.is_empty() || name.chars().count() > LONGEST_NAME || name.contains(char::is_control) {
        return Err(format!(
            "{column}: `{name}`; expected a name of 1 to {LONGEST_NAME} characters"
        ));
    }
    if EstimatorKind::named(name).is_some() {
        return Err(format!(
            "{column}: `{name}` is an estimator of this program, which runs it itself; expected another name"
        ));
    }
    Ok(name.to_owned())
}

/// An error angle.
fn degrees(text: &str, column: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok();
    value
        .filter(|value| (0.0..=LARGEST_DEG).contains(value))
        .ok_or_else(|| {
            format!(", column `{column}`: `{text}`; expected degrees from 0 to {LARGEST_DEG}")
        })
}
