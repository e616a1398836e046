//! One table of a manifest: delimited text with the columns that it names.

use std::io::{BufRead, BufReader};

use super::layout::LayoutBuilder;
use super::schema::Source;
use crate::delimited::{Blanks, DelimitedSource, Rows};
use crate::error::{RecordingError, Result};
use crate::metadata::Metadata;
use crate::options::OpenOptions;
use crate::recording::Opened;
use crate::text::Input;

/// Reads `input` as the source describes; `file` and `manifest_file` stand for the two in messages.
pub(super) fn open(
    source: &Source,
    manifest_file: &str,
    input: Input,
    file: &str,
    options: &OpenOptions,
) -> Result<Opened> {
    let mut input = BufReader::with_capacity(1 << 16, input);
    skip(&mut input, source.skip_rows, file)?;
    let input: Input = if source.delimiter == ' ' {
        Box::new(Blanks::new(input))
    } else {
        Box::new(input)
    };
    let mut builder = csv::ReaderBuilder::new();
    builder
        .delimiter(source.delimiter as u8)
        .comment(source.comment.map(|c| c as u8))
        .has_headers(source.header)
        // Rows of several kinds have several lengths.
        .flexible(source.rows.is_some());
    let mut rows = Rows::new(file.to_owned(), &mut builder, input, source.skip_rows);
    let names = column_names(source, &mut rows, file)?;
    let layout = LayoutBuilder {
        source,
        manifest_file,
        file,
        names,
        options,
    }
    .build()?;
    let sensors = layout.sensors();
    let source = DelimitedSource::new(rows, layout);
    Ok(Opened {
        units_applied: true,
        ..Opened::new(Metadata::default(), sensors, Box::new(source))
    })
}

/// The names in the header; without one the numbers of the columns from 1.
fn column_names(source: &Source, rows: &mut Rows, file: &str) -> Result<Vec<String>> {
    // Without a header this is the first row, which stays to be read.
    let first = rows.first()?;
    if first.is_empty() {
        return Err(RecordingError::empty(
            file,
            format!("nothing after {} skipped lines", source.skip_rows),
            "rows of numbers",
        ));
    }
    if !source.header {
        return Ok((1..=first.len()).map(|number| number.to_string()).collect());
    }
    let name = |bytes: &[u8]| {
        String::from_utf8_lossy(bytes.trim_ascii())
            .trim_start_matches('\u{feff}')
            .to_owned()
    };
    Ok(first.iter().map(name).collect())
}

fn skip(input: &mut impl BufRead, lines: u64, file: &str) -> Result<()> {
    for _ in 0..lines {
        let skipped = input
            .skip_until(b'\n')
            .map_err(|error| RecordingError::io(file, "read it", error))?;
        if skipped == 0 {
            return Ok(());
        }
    }
    Ok(())
}
