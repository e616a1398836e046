//! Sensor Logger's folder: one CSV file a sensor, and `Metadata.csv`.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::channels::Export;
use super::plain;
use crate::delimited::{Channel, DelimitedSource, Layout, TimeForm, csv_error};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::open::{has_extension, stem};
use crate::recording::EventSource;
use crate::stamp;
use crate::text::open_file;

/// The name of the time column of every table.
pub(super) const TIME: &str = "time";

/// The tables of a folder.
pub(super) struct Folder {
    /// The folder (or zip) as the user gave it.
    shown: String,
    /// Plain name of a table to its file and the name to show.
    tables: BTreeMap<String, (PathBuf, String)>,
    /// Keeps the files of an unpacked zip.
    pub(super) unpacked: Option<TempDir>,
}

impl Folder {
    /// Lists the CSV files of a folder.
    pub(super) fn list(path: &Path, shown: &str) -> Result<Self> {
        let failed = |error| RecordingError::io(shown, "list the folder", error);
        let mut tables = BTreeMap::new();
        for entry in std::fs::read_dir(path).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if has_extension(&path, "csv") {
                let name = path.file_name().unwrap_or_default();
                let name = name.to_string_lossy().into_owned();
                tables.insert(plain(&stem(&path)), (path, name));
            }
        }
        Ok(Self {
            shown: shown.to_owned(),
            tables,
            unpacked: None,
        })
    }

    fn reader(&self, table: &str) -> Result<(String, csv::Reader<File>)> {
        let Some((path, name)) = self.tables.get(table) else {
            return Err(RecordingError::unsupported(
                &self.shown,
                format!("there is no table `{table}` in it"),
            ));
        };
        let file = format!("{}/{name}", self.shown);
        let input = open_file(path, &file)?;
        let reader = csv::ReaderBuilder::new()
            .buffer_capacity(1 << 16)
            .from_reader(input);
        Ok((file, reader))
    }
}

impl Export for Folder {
    fn has(&self, table: &str) -> bool {
        self.tables.contains_key(table)
    }

    fn names(&self) -> Vec<String> {
        self.tables.values().map(|(_, name)| name.clone()).collect()
    }

    fn metadata(&self) -> Result<Option<BTreeMap<String, String>>> {
        // The first row of `Metadata.csv` by column name.
        if !self.has("metadata") {
            return Ok(None);
        }
        let (file, mut reader) = self.reader("metadata")?;
        let failed = |error| csv_error(&file, 0, &error);
        let names = reader.headers().map_err(failed)?.clone();
        let mut row = csv::StringRecord::new();
        reader.read_record(&mut row).map_err(failed)?;
        let pairs = names.iter().zip(&row);
        Ok(Some(
            pairs
                .map(|(name, value)| (name.to_owned(), value.to_owned()))
                .collect(),
        ))
    }

    fn stream(
        &self,
        table: &str,
        columns: &[&str],
        kind: SensorKind,
        factor: f64,
    ) -> Result<Box<dyn EventSource>> {
        let (file, mut reader) = self.reader(table)?;
        let headers = reader
            .byte_headers()
            .map_err(|error| csv_error(&file, 0, &error))?;
        let names: Vec<String> = headers
            .iter()
            .map(|name| {
                let name = String::from_utf8_lossy(name);
                name.trim().trim_start_matches('\u{feff}').to_owned()
            })
            .collect();
        let find = |column: &str| {
            names.iter().position(|name| name == column).ok_or_else(|| {
                RecordingError::MissingColumns {
                    file: file.clone(),
                    missing: format!("column {column}"),
                    present: join(names.iter().map(String::as_str)),
                    advice: format!("a Sensor Logger table has time and {}", columns.join(", ")),
                }
            })
        };
        let places = columns.iter().map(|column| find(column));
        let places = places.collect::<Result<Vec<usize>>>()?;
        let layout = Layout {
            time: find(TIME)?,
            time_form: TimeForm::Decimal(stamp::NANOSECONDS),
            rows: None,
            channels: vec![Channel::new(kind, &places).times(factor)],
            decimal_comma: false,
            names,
        };
        Ok(Box::new(DelimitedSource::new(file, reader, layout, 0)))
    }

    fn unpacked(&mut self) -> Option<TempDir> {
        self.unpacked.take()
    }
}
