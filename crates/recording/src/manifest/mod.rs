//! Any other delimited text file, described by a small TOML manifest.
//!
//! Read first: `docs/formats.md`, which has an example. Opening the manifest opens the recording.

mod blanks;
mod layout;
mod schema;

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;

use crate::delimited::{DelimitedSource, csv_error};
use crate::error::{RecordingError, Result};
use crate::metadata::Metadata;
use crate::open::named;
use crate::options::OpenOptions;
use crate::recording::{Opened, Recording};

use blanks::Blanks;
use layout::LayoutBuilder;
pub use schema::{
    Column, Manifest, Metre, MetrePerSecond, PressureColumn, PressureUnit, QuaternionColumns,
    QuaternionDirection, QuaternionOrder, TimeColumn, TimeUnit, VectorColumns, parse,
};

/// Reads delimited text in memory through a manifest in memory; `name` stands for both in messages.
///
/// # Errors
/// As [`crate::open()`].
pub fn read_bytes(
    manifest: &str,
    data: Vec<u8>,
    name: &str,
    options: &OpenOptions,
) -> Result<Recording> {
    let manifest = parse(manifest, name)?;
    let opened = open_data(
        &manifest,
        name,
        Cursor::new(data),
        name,
        named(name.to_owned()),
        options,
    )?;
    Ok(Recording::new(name.to_owned(), opened, options))
}

/// Opens the data file that the manifest names.
pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Opened> {
    let (manifest, file) = load(path)?;
    let Some(data) = &manifest.file else {
        return Err(problem(
            &file,
            "missing key `file`: the data file, relative to the manifest".to_owned(),
        ));
    };
    let data = path.parent().unwrap_or(Path::new("")).join(data);
    open_loaded(&manifest, &file, &data, options)
}

/// Opens `data` as the manifest at `path` describes, whatever file that names.
pub(crate) fn open_with_data(path: &Path, data: &Path, options: &OpenOptions) -> Result<Opened> {
    let (manifest, file) = load(path)?;
    open_loaded(&manifest, &file, data, options)
}

/// Reads a stream as the manifest at `path` describes.
pub(crate) fn open_stream(
    input: impl Read + Send + 'static,
    name: &str,
    path: &Path,
    options: &OpenOptions,
) -> Result<Opened> {
    let (manifest, file) = load(path)?;
    open_data(
        &manifest,
        &file,
        input,
        name,
        named(name.to_owned()),
        options,
    )
}

/// Whether there is a manifest at `path` which names `data`.
pub(crate) fn describes(path: &Path, data: &Path) -> bool {
    let Ok((manifest, _)) = load(path) else {
        return false;
    };
    let named = manifest.file.as_deref().and_then(Path::file_name);
    named.is_some() && named == data.file_name()
}

fn load(path: &Path) -> Result<(Manifest, String)> {
    /// A manifest is a page; anything longer is another file.
    const LONGEST: u64 = 1 << 20;
    let file = path.display().to_string();
    let mut text = String::new();
    File::open(path)
        .and_then(|input| input.take(LONGEST).read_to_string(&mut text))
        .map_err(|error| RecordingError::io(&file, "read the manifest", error))?;
    Ok((parse(&text, &file)?, file))
}

fn open_loaded(
    manifest: &Manifest,
    manifest_file: &str,
    data: &Path,
    options: &OpenOptions,
) -> Result<Opened> {
    let file = data.display().to_string();
    let input = File::open(data).map_err(|error| RecordingError::io(&file, "open it", error))?;
    let stem = data
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    open_data(manifest, manifest_file, input, &file, named(stem), options)
}

fn open_data(
    manifest: &Manifest,
    manifest_file: &str,
    input: impl Read + Send + 'static,
    file: &str,
    mut metadata: Metadata,
    options: &OpenOptions,
) -> Result<Opened> {
    "manifest".clone_into(&mut metadata.format);
    metadata.world_frame = manifest.world_frame;
    metadata.device.clone_from(&manifest.device);
    metadata.extra.clone_from(&manifest.extra);
    if let Some(name) = &manifest.name {
        metadata.name.clone_from(name);
    }
    let mut input = BufReader::with_capacity(1 << 16, input);
    skip(&mut input, manifest.skip_rows, file)?;
    let blanks = manifest.delimiter == ' ';
    let input: Box<dyn Read + Send> = if blanks {
        Box::new(Blanks::new(input))
    } else {
        Box::new(input)
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(manifest.delimiter as u8)
        .comment(manifest.comment.map(|c| c as u8))
        .has_headers(manifest.header)
        .buffer_capacity(1 << 16)
        .from_reader(input);
    // Without a header this is the first row, which stays to be read.
    let first = reader
        .byte_headers()
        .map_err(|error| csv_error(file, manifest.skip_rows, &error))?;
    if first.is_empty() {
        return Err(RecordingError::Empty {
            file: file.to_owned(),
            found: format!("nothing after {} skipped lines", manifest.skip_rows),
            expected: "rows of numbers",
        });
    }
    let names = if manifest.header {
        first
            .iter()
            .map(|name| {
                String::from_utf8_lossy(name.trim_ascii())
                    .trim_start_matches('\u{feff}')
                    .to_owned()
            })
            .collect()
    } else {
        (1..=first.len()).map(|number| number.to_string()).collect()
    };
    let layout = LayoutBuilder {
        manifest,
        manifest_file,
        file,
        names,
        options,
    }
    .build()?;
    Ok(Opened {
        metadata,
        sensors: layout.sensors(),
        source: Box::new(DelimitedSource::new(
            file.to_owned(),
            reader,
            layout,
            manifest.skip_rows,
        )),
        notes: Vec::new(),
        units_applied: true,
    })
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

fn problem(file: &str, problem: String) -> RecordingError {
    RecordingError::Manifest {
        file: file.to_owned(),
        problem,
    }
}
