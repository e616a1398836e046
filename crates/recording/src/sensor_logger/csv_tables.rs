//! Sensor Logger's tables as CSV, wherever they are: in a folder or in a zip.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use csv::ByteRecord;

use super::channels::Export;
use crate::delimited::{Channel, DelimitedSource, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::false_stamps::FalseStamps;
use crate::phyphox;
use crate::recording::EventSource;
use crate::stamp;
use crate::text::Input;

/// The name of the time column of every table.
pub(super) const TIME: &str = "time";

/// Tables of an export, each a CSV file that can be read from its beginning as often as is wanted.
pub(super) trait CsvTables {
    fn has(&self, table: &str) -> bool;

    /// The names of all tables as they stand there.
    fn names(&self) -> Vec<String>;

    /// The name of a table for messages, and its text.
    fn input(&self, table: &str) -> Result<(String, Input)>;

    fn rows(&self, table: &str) -> Result<Rows> {
        let (file, input) = self.input(table)?;
        let builder = &mut csv::ReaderBuilder::new();
        Ok(Rows::new(file, builder, input, 0))
    }
}

/// The tables if they are of phyphox: every one that begins with its header.
pub(super) fn of_phyphox(tables: &impl CsvTables) -> Result<Option<Vec<phyphox::Table>>> {
    /// Longest header that is looked for.
    const HEADER: u64 = 256;
    let mut found = Vec::new();
    for table in phyphox::TABLES.iter().filter(|table| tables.has(table)) {
        let (file, mut input) = tables.input(table)?;
        let mut head = Vec::new();
        let read = input.by_ref().take(HEADER).read_to_end(&mut head);
        // What cannot be read is told by whoever reads it.
        if read.is_ok() && phyphox::recognises(&String::from_utf8_lossy(&head)) {
            found.push((file, Box::new(Cursor::new(head).chain(input)) as Input));
        }
    }
    Ok((!found.is_empty()).then_some(found))
}

impl<T: CsvTables> Export for T {
    fn has(&self, table: &str) -> bool {
        CsvTables::has(self, table)
    }

    fn names(&self) -> Vec<String> {
        CsvTables::names(self)
    }

    fn metadata(&self) -> Result<Option<BTreeMap<String, String>>> {
        // The first row of `Metadata.csv` by column name.
        if !CsvTables::has(self, "metadata") {
            return Ok(None);
        }
        let mut rows = self.rows("metadata")?;
        let names = rows.first()?;
        let mut row = ByteRecord::new();
        rows.read(&mut row)?;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let pairs = names.iter().zip(&row);
        Ok(Some(
            pairs
                .map(|(name, value)| (text(name), text(value)))
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
        let mut rows = self.rows(table)?;
        let header = rows.first()?;
        let names: Vec<String> = header
            .iter()
            .map(|name| {
                let name = String::from_utf8_lossy(name);
                name.trim().trim_start_matches('\u{feff}').to_owned()
            })
            .collect();
        let find = |column: &str| {
            names.iter().position(|name| name == column).ok_or_else(|| {
                RecordingError::MissingColumns {
                    file: rows.file().to_owned(),
                    missing: format!("column {column}"),
                    present: join(names.iter().map(String::as_str)),
                    advice: match names.iter().any(|name| name == TIME) {
                        true => format!("a Sensor Logger table has time and {}", columns.join(", ")),
                        false => {
                            "it has the name of a table of Sensor Logger and is none; `northing describe FILE... --out \
                             FILE.toml` drafts a manifest of other tables"
                                .to_owned()
                        }
                    },
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
        let source = DelimitedSource::new(rows, layout);
        Ok(Box::new(FalseStamps::new(source)))
    }
}
