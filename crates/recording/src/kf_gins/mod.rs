//! KF-GINS text files: seven columns without names, inertial increments or positions of a receiver.
//!
//! Read first: `docs/formats.md`; the format is that of the program KF-GINS (Wuhan University). A row begins with GPS
//! seconds of the week; columns are separated by blanks, tabs or commas. Body axes are forward, right, down, the world is
//! north, east, down. Increments become rates and forces over the time since the row before, so the first row gives
//! no sample. Which of the two tables a file is, is told by its numbers (see [`Table::of`]); whatever fits neither needs
//! a manifest.

mod told;

use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use crate::delimited::{Blanks, Channel, DelimitedSource, Form, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result};
use crate::event::SensorKind;
use crate::false_stamps::FalseStamps;
use crate::merge::Merged;
use crate::metadata::Metadata;
use crate::recording::{EventSource, Opened};
use crate::stamp;
use crate::text::Input;

pub(crate) use told::{Table, columns_of_numbers};

/// Bytes that are looked at to tell which table it is.
const HEAD: u64 = 4096;
/// Files of a folder that are looked at.
const MOST_FILES: usize = 256;

impl Table {
    /// What stands in the columns.
    const fn names(self) -> &'static str {
        match self {
            Self::Increments => {
                "time of week, angle x, angle y, angle z, velocity x, velocity y, velocity z"
            }
            Self::Positions => {
                "time of week, latitude, longitude, height, std north, std east, std down"
            }
        }
    }

    fn channels(self) -> Vec<Channel> {
        match self {
            Self::Increments => vec![
                Channel::new(SensorKind::Gyroscope, &[1, 2, 3]).of_form(Form::Increment),
                Channel::new(SensorKind::Accelerometer, &[4, 5, 6]).of_form(Form::Increment),
            ],
            Self::Positions => {
                let mut position = Channel::new(SensorKind::GnssPosition, &[1, 2, 3, 4, 5, 6]);
                position.put(0, Some(1), 1_f64.to_radians());
                position.put(1, Some(2), 1_f64.to_radians());
                vec![position]
            }
        }
    }

    fn source(self, file: &str, head: &[u8], input: Input) -> Box<dyn EventSource> {
        let rows = head.split(|byte| *byte == b'\n');
        let mut rows = rows.filter(|row| !row.trim_ascii_start().starts_with(b"#"));
        let has_commas = rows.any(|row| row.contains(&b','));
        let input: Input = if has_commas {
            Box::new(input)
        } else {
            Box::new(Blanks::new(BufReader::with_capacity(1 << 16, input)))
        };
        let mut builder = csv::ReaderBuilder::new();
        builder
            .delimiter(if has_commas { b',' } else { b' ' })
            .comment(Some(b'#'))
            .has_headers(false);
        let rows = Rows::new(file.to_owned(), &mut builder, input, 0);
        let layout = Layout {
            names: self.names().split(", ").map(str::to_owned).collect(),
            time: 0,
            time_form: TimeForm::Decimal(stamp::SECONDS),
            channels: self.channels(),
            decimal_comma: false,
            rows: None,
        };
        Box::new(FalseStamps::new(DelimitedSource::new(rows, layout)))
    }

    fn sensors(self) -> Vec<SensorKind> {
        self.channels().iter().map(|channel| channel.kind).collect()
    }
}

/// Opens one table.
///
/// # Errors
/// It cannot be read, or its first rows are neither of the two.
pub(crate) fn open(mut input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let head = head(&mut input).map_err(|error| RecordingError::io(file, "read it", error))?;
    let Some(table) = Table::of_bytes(&head) else {
        return Err(RecordingError::unsupported(
            file,
            "the first rows are no KF-GINS table: seven numbers each, either seconds of the week, increments of \
                      angle (rad) and of velocity (m/s), or seconds of the week, latitude, longitude (deg), height and \
                      three standard deviations (m); a manifest describes any other table",
        ));
    };
    let source = table.source(
        file,
        &head,
        Box::new(Cursor::new(head.clone()).chain(input)),
    );
    Ok(Opened::ned("kf-gins", metadata, &table.sensors(), source))
}

/// Opens a folder that holds both tables; `None` when it does not.
///
/// # Errors
/// The folder cannot be listed, or holds more than one table of a kind.
pub(crate) fn open_folder(path: &Path, file: &str, metadata: &Metadata) -> Result<Option<Opened>> {
    let tables =
        tables_in(path).map_err(|error| RecordingError::io(file, "list the folder", error))?;
    let of = |wanted: Table| -> Vec<&PathBuf> {
        let found = tables.iter().filter(|(_, table)| *table == wanted);
        found.map(|(path, _)| path).collect()
    };
    let found = [Table::Increments, Table::Positions].map(of);
    if found.iter().any(Vec::is_empty) {
        return Ok(None);
    }
    let mut streams = Vec::new();
    let mut sensors = Vec::new();
    for (table, paths) in [Table::Increments, Table::Positions].into_iter().zip(found) {
        let [path] = paths[..] else {
            return Err(several(file, table, &paths));
        };
        let name = path.display().to_string();
        let failed = |error| RecordingError::io(&name, "read it", error);
        let mut input = File::open(path).map_err(failed)?;
        let head = head(&mut input).map_err(failed)?;
        let rest = Cursor::new(head.clone()).chain(input);
        streams.push(table.source(&name, &head, Box::new(rest)));
        sensors.extend(table.sensors());
    }
    let source = Box::new(Merged::new(streams));
    Ok(Some(Opened::ned(
        "kf-gins",
        metadata.clone(),
        &sensors,
        source,
    )))
}

fn several(file: &str, table: Table, paths: &[&PathBuf]) -> RecordingError {
    let names = paths.iter().filter_map(|path| path.file_name());
    let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
    RecordingError::unsupported(
        file,
        format!(
            "{} KF-GINS tables of {} ({}); write a manifest with one [[source]] `file = \"...\"`, `format = \"kf-gins\"` \
             for each of the two that belong together",
            paths.len(),
            table.what(),
            names.join(", ")
        ),
    )
}

/// The first bytes of a file.
fn head(input: &mut impl Read) -> std::io::Result<Vec<u8>> {
    let mut head = Vec::new();
    input.by_ref().take(HEAD).read_to_end(&mut head)?;
    Ok(head)
}

/// The files of a folder that are such tables, by name.
fn tables_in(folder: &Path) -> std::io::Result<Vec<(PathBuf, Table)>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder)?.take(MOST_FILES) {
        let entry = entry?;
        if entry.file_type()?.is_file() {
            paths.push(entry.path());
        }
    }
    paths.sort_unstable();
    let table = |path: PathBuf| {
        // What cannot be opened is none of ours: a folder may hold anything.
        let head = File::open(&path).and_then(|mut input| head(&mut input));
        Some((path, Table::of_bytes(&head.ok()?)?))
    };
    Ok(paths.into_iter().filter_map(table).collect())
}

#[cfg(test)]
mod tests;
