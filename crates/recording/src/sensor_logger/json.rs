//! Sensor Logger's JSON: one array of flat objects, every value a string, usually table after table.
//!
//! A first pass notes where each table starts and ends; then every table is read by a reader of
//! its own between those places, so nothing is held in memory whatever the order.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::Arc;

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::channels::Export;
use super::csv_tables::TIME;
use super::entries::{Entries, Entry};
use super::plain;
use crate::delimited::{Cells, Channel, Layout, TimeForm};
use crate::error::{RecordingError, Result, join};
use crate::event::{Event, SensorKind};
use crate::false_stamps::FalseStamps;
use crate::issues::Issues;
use crate::limits::TABLES;
use crate::recording::EventSource;
use crate::stamp;

/// Where the JSON is.
#[derive(Debug, Clone)]
pub(super) enum Store {
    File(PathBuf),
    Bytes(Arc<[u8]>),
}

impl Store {
    /// Its length, bytes.
    pub(super) fn length(&self) -> io::Result<u64> {
        match self {
            Self::File(path) => std::fs::metadata(path).map(|file| file.len()),
            Self::Bytes(bytes) => Ok(bytes.len() as u64),
        }
    }

    /// What is there from a place on.
    pub(super) fn read_from(&self, offset: u64) -> io::Result<Box<dyn BufRead + Send>> {
        Ok(match self {
            Self::File(path) => {
                let mut file = File::open(path)?;
                file.seek(SeekFrom::Start(offset))?;
                Box::new(BufReader::with_capacity(1 << 16, file))
            }
            Self::Bytes(bytes) => {
                let mut cursor = Cursor::new(Arc::clone(bytes));
                cursor.set_position(offset);
                Box::new(BufReader::new(cursor))
            }
        })
    }
}

/// A table's place in the file.
#[derive(Debug, Clone)]
struct Span {
    /// The name as it stands there.
    name: String,
    start: u64,
    start_line: u64,
    /// Just behind the last entry.
    end: u64,
}

/// The tables of a JSON export.
pub(super) struct Json {
    file: String,
    store: Store,
    tables: BTreeMap<String, Span>,
    metadata: Option<BTreeMap<String, String>>,
}

impl Json {
    /// Walks through the file once and notes where the tables are.
    pub(super) fn index(store: Store, file: &str) -> Result<Self> {
        let input = store
            .read_from(0)
            .map_err(|error| RecordingError::io(file, "open it", error))?;
        let mut entries = Entries::new(input, file, 0, 1);
        entries.expect_array()?;
        let mut tables: BTreeMap<String, Span> = BTreeMap::new();
        let mut metadata = None;
        while let Some(entry) = entries.next()? {
            let name: Name<'_> = entry.parse(file)?;
            let table = plain(&name.sensor);
            if table == "metadata" && metadata.is_none() {
                metadata = Some(metadata_of(&entry, file)?);
            }
            let end = entry.end;
            match tables.get_mut(&table) {
                Some(span) => span.end = end,
                None => {
                    let span = Span {
                        name: name.sensor.into_owned(),
                        start: entry.start,
                        start_line: entry.line,
                        end,
                    };
                    tables.insert(table, span);
                    TABLES.check(tables.len() as u64, file, "")?;
                }
            }
        }
        Ok(Self {
            file: file.to_owned(),
            store,
            tables,
            metadata,
        })
    }
}

impl Export for Json {
    fn has(&self, table: &str) -> bool {
        self.tables.contains_key(table)
    }

    fn names(&self) -> Vec<String> {
        self.tables.values().map(|span| span.name.clone()).collect()
    }

    fn metadata(&self) -> Result<Option<BTreeMap<String, String>>> {
        Ok(self.metadata.clone())
    }

    fn stream(
        &self,
        table: &str,
        columns: &[&str],
        kind: SensorKind,
        factor: f64,
    ) -> Result<Box<dyn EventSource>> {
        let Some(span) = self.tables.get(table) else {
            return Err(RecordingError::unsupported(
                &self.file,
                format!("there is no table `{table}` in it"),
            ));
        };
        let input = self
            .store
            .read_from(span.start)
            .map_err(|error| RecordingError::io(&self.file, "open it", error))?;
        let names: Vec<String> = std::iter::once(TIME)
            .chain(columns.iter().copied())
            .map(str::to_owned)
            .collect();
        let places: Vec<usize> = (1..=columns.len()).collect();
        let source = Table {
            file: self.file.clone(),
            table: table.to_owned(),
            end: span.end,
            line: span.start_line,
            entries: Entries::new(input, &self.file, span.start, span.start_line),
            layout: Layout {
                names,
                time: 0,
                time_form: TimeForm::Decimal(stamp::NANOSECONDS),
                rows: None,
                channels: vec![Channel::new(kind, &places).times(factor)],
                decimal_comma: false,
            },
        };
        Ok(Box::new(FalseStamps::new(source)))
    }
}

/// One table, read between its first and its last entry.
struct Table {
    file: String,
    table: String,
    end: u64,
    /// Of the last entry.
    line: u64,
    entries: Entries,
    layout: Layout,
}

impl EventSource for Table {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        loop {
            if self.entries.offset >= self.end {
                return Ok(None);
            }
            let Some(entry) = self.entries.next()? else {
                return Ok(None);
            };
            self.line = entry.line;
            let name: Name<'_> = entry.parse(&self.file)?;
            if plain(&name.sensor) != self.table {
                continue;
            }
            let row: Row<'_> = entry.parse(&self.file)?;
            let record = record(&row, &self.layout.names).map_err(|missing| {
                RecordingError::bad_line(
                    &self.file,
                    entry.line,
                    format!("an entry of {} {missing}", self.table),
                )
            })?;
            let cells = Cells {
                file: &self.file,
                record: &record,
                layout: &self.layout,
                line: entry.line,
                row: 0,
                interval_s: None,
            };
            let Some(time_ns) = cells.stamp()? else {
                issues.rows_without_stamp += 1;
                continue;
            };
            if let Some(sample) = cells.sample(&self.layout.channels[0])? {
                return Ok(Some(Event { time_ns, sample }));
            }
        }
    }

    fn place(&self) -> Option<String> {
        Some(format!("{}, line {}", self.file, self.line))
    }
}

/// An entry's values in the order of the layout's names.
fn record(row: &Row<'_>, names: &[String]) -> std::result::Result<csv::ByteRecord, String> {
    let mut record = csv::ByteRecord::new();
    for name in names {
        let value = row.get(name.as_str()).ok_or_else(|| {
            let present = join(row.keys().map(Cow::as_ref));
            format!("without `{name}`; it has {present}")
        })?;
        record.push_field(value.text().as_bytes());
    }
    Ok(record)
}

/// A flat object.
type Row<'a> = BTreeMap<Cow<'a, str>, Value<'a>>;

#[derive(Deserialize)]
struct Name<'a> {
    #[serde(borrow)]
    sensor: Cow<'a, str>,
}

/// A value: of strings and numbers it matters what they say.
#[derive(Deserialize)]
#[serde(untagged)]
enum Value<'a> {
    Text(#[serde(borrow)] Cow<'a, str>),
    Unsigned(u64),
    Signed(i64),
    Float(f64),
    Flag(bool),
    Other(IgnoredAny),
}

impl Value<'_> {
    /// As text; what is neither a text nor a number nor a flag as nothing.
    fn text(&self) -> Cow<'_, str> {
        match self {
            Self::Text(text) => Cow::Borrowed(text),
            Self::Unsigned(number) => number.to_string().into(),
            Self::Signed(number) => number.to_string().into(),
            Self::Float(number) => number.to_string().into(),
            Self::Flag(flag) => flag.to_string().into(),
            Self::Other(_) => Cow::Borrowed(""),
        }
    }
}

fn metadata_of(entry: &Entry<'_>, file: &str) -> Result<BTreeMap<String, String>> {
    let row: Row<'_> = entry.parse(file)?;
    let pairs = row.into_iter().filter(|(key, _)| key != "sensor");
    Ok(pairs
        .map(|(key, value)| (key.into_owned(), value.text().into_owned()))
        .collect())
}
