//! Parts of a study as Parquet files, a row a run: what `study --out` writes, and what `study merge` puts together.
//!
//! What study it is of, and which runs are in it, stands in the file's metadata as JSON. Rows are in the order of their numbers, and so
//! is what is merged: the same bytes in whatever order parts are named.

use std::collections::HashMap;
use std::fs::File;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, anyhow, bail};
use northing_experiments::studies::key::MOST_RUNS;
use northing_experiments::studies::{Plan, Row, RowsHash, StudyError, StudyKey, StudySums};
use northing_recording::AtomicFile;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

/// Key of the metadata.
const KEY: &str = "northing_study";
/// Rows that are held in memory.
const GROUP_ROWS: usize = 32_768;
/// Columns that say which run it was.
const BEFORE: [(&str, Physical); 6] = [
    ("run", Physical::INT64),
    ("source", Physical::BYTE_ARRAY),
    ("data_sha256", Physical::BYTE_ARRAY),
    ("seed", Physical::INT64),
    ("point", Physical::INT64),
    ("estimator", Physical::BYTE_ARRAY),
];
/// Columns that say what it used, and why there are no scores.
const AFTER: [&str; 3] = [PARAMETERS, "program", ERROR];
const PARAMETERS: &str = "parameters_sha256";
const ERROR: &str = "error";

/// What the metadata says.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    version: u32,
    study: StudyKey,
    ranges: Vec<Range<u64>>,
}

/// The columns of a study's table with their types.
fn columns(key: &StudyKey) -> Vec<(String, Physical)> {
    let varied = key
        .design
        .parameters()
        .into_iter()
        .zip(key.design.are_numbers());
    let varied = varied.map(|(name, is_number)| match is_number {
        true => (name, Physical::DOUBLE),
        false => (name, Physical::BYTE_ARRAY),
    });
    let scores = key.scores().iter().map(|name| (*name, Physical::DOUBLE));
    let after = AFTER.map(|name| (name, Physical::BYTE_ARRAY));
    let all = BEFORE.into_iter().chain(varied).chain(scores).chain(after);
    all.map(|(name, kind)| (name.to_owned(), kind)).collect()
}

fn schema(key: &StudyKey) -> parquet::errors::Result<Type> {
    let field = |(name, kind): (String, Physical)| {
        let text = (kind == Physical::BYTE_ARRAY).then_some(LogicalType::String);
        let field = Type::primitive_type_builder(&name, kind)
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(text)
            .build()?;
        Ok(Arc::new(field))
    };
    let fields: parquet::errors::Result<Vec<_>> = columns(key).into_iter().map(field).collect();
    Type::group_type_builder("study")
        .with_fields(fields?)
        .build()
}

/// A part being written.
struct Writer<'a> {
    plan: &'a Plan,
    output: SerializedFileWriter<AtomicFile>,
    rows: Vec<Row>,
}

impl<'a> Writer<'a> {
    fn create(path: &Path, plan: &'a Plan, ranges: Vec<Range<u64>>, force: bool) -> Result<Self> {
        let header = Header {
            version: 1,
            study: plan.key().clone(),
            ranges,
        };
        let header = KeyValue::new(KEY.to_owned(), serde_json::to_string(&header)?);
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_key_value_metadata(Some(vec![header]))
            .build();
        let output = AtomicFile::create(path, force)?;
        let schema = Arc::new(schema(plan.key())?);
        Ok(Self {
            plan,
            output: SerializedFileWriter::new(output, schema, Arc::new(properties))?,
            rows: Vec::new(),
        })
    }

    fn row(&mut self, row: Row) -> Result<()> {
        self.rows.push(row);
        if self.rows.len() >= GROUP_ROWS {
            self.write_group()?;
        }
        Ok(())
    }

    fn write_group(&mut self) -> Result<()> {
        let mut group = self.output.next_row_group()?;
        let cells: Vec<Vec<Cell>> = self.rows.iter().map(|row| cells(self.plan, row)).collect();
        let mut place = 0;
        while let Some(mut column) = group.next_column()? {
            let cells = cells.iter().filter_map(|row| row.get(place));
            match columns(self.plan.key()).get(place).map(|(_, kind)| *kind) {
                Some(Physical::INT64) => {
                    let values: Vec<i64> = cells.map(Cell::integer).collect();
                    column
                        .typed::<Int64Type>()
                        .write_batch(&values, None, None)?;
                }
                Some(Physical::DOUBLE) => {
                    let values: Vec<f64> = cells.map(Cell::double).collect();
                    column
                        .typed::<DoubleType>()
                        .write_batch(&values, None, None)?;
                }
                _ => {
                    let values: Vec<ByteArray> = cells.map(Cell::text).collect();
                    column
                        .typed::<ByteArrayType>()
                        .write_batch(&values, None, None)?;
                }
            }
            column.close()?;
            place += 1;
        }
        group.close()?;
        self.rows.clear();
        Ok(())
    }

    fn finish(mut self) -> Result<()> {
        if !self.rows.is_empty() {
            self.write_group()?;
        }
        Ok(self.output.into_inner()?.commit()?)
    }
}

/// One cell of the table.
enum Cell {
    Integer(i64),
    Double(f64),
    Text(String),
}

impl Cell {
    fn integer(&self) -> i64 {
        match self {
            Self::Integer(value) => *value,
            _ => 0,
        }
    }

    fn double(&self) -> f64 {
        match self {
            Self::Double(value) => *value,
            _ => f64::NAN,
        }
    }

    fn text(&self) -> ByteArray {
        match self {
            Self::Text(text) => ByteArray::from(text.as_str()),
            _ => ByteArray::from(""),
        }
    }
}

/// The cells of a row, in the order of [`columns`].
fn cells(plan: &Plan, row: &Row) -> Vec<Cell> {
    let (key, place) = (plan.key(), plan.place(row.run));
    let text = |text: &str| Cell::Text(text.to_owned());
    let mut cells = vec![
        Cell::Integer(row.run.cast_signed()),
        Cell::Text(plan.source_name(place.source)),
        text(key.sources.sha256(place.source)),
        Cell::Integer(place.seed.cast_signed()),
        Cell::Integer(place.point.cast_signed()),
        text(
            key.estimators
                .get(place.estimator)
                .map_or("", String::as_str),
        ),
    ];
    let values = plan.points().values(place.point).into_iter();
    let value = |(value, is_number): (Json, bool)| match (is_number, value.as_f64()) {
        (true, value) => Cell::Double(value.unwrap_or(f64::NAN)),
        (false, _) => Cell::Text(northing_evaluation::by_name::text(&value)),
    };
    cells.extend(values.zip(key.design.are_numbers()).map(value));
    cells.extend(row.scores.iter().map(|score| Cell::Double(*score)));
    cells.extend([
        text(&row.parameters_sha256),
        text(&key.program),
        text(&row.error),
    ]);
    cells
}

/// Writes rows of these runs as a part.
///
/// # Errors
/// The file exists and `force` is not given, or cannot be written.
pub fn write(
    path: &Path,
    plan: &Plan,
    runs: Range<u64>,
    rows: Vec<Row>,
    force: bool,
) -> Result<()> {
    let place = || format!("{}: cannot write it", path.display());
    let mut writer = Writer::create(path, plan, vec![runs], force)?;
    for row in rows {
        writer.row(row).with_context(place)?;
    }
    writer.finish().with_context(place)
}

/// A part that is read, group by group of its rows.
pub struct StudyPart {
    /// The file.
    pub path: PathBuf,
    /// What study it is of.
    pub key: StudyKey,
    /// The runs in it, ascending.
    pub ranges: Vec<Range<u64>>,
    reader: SerializedFileReader<File>,
    /// The next group of rows.
    group: usize,
    rows: std::vec::IntoIter<Row>,
}

impl StudyPart {
    /// Opens a part.
    ///
    /// # Errors
    /// The file cannot be read, or is no part of a study.
    pub fn open(path: &Path) -> Result<Self> {
        // The decoder has been seen to panic on garbage; that becomes an error like any other damage.
        guarded(path, || Self::open_file(path))
    }

    fn open_file(path: &Path) -> Result<Self> {
        let reader = SerializedFileReader::new(File::open(path)?)?;
        let metadata = reader.metadata().file_metadata();
        let pairs = metadata.key_value_metadata().into_iter().flatten();
        let header = pairs
            .filter(|pair| pair.key == KEY)
            .find_map(|pair| pair.value.as_deref());
        let header = header.context("its metadata says nothing of one")?;
        let header: Header = serde_json::from_str(header)?;
        if header.version != 1 {
            bail!("it has version {}, expected 1", header.version);
        }
        let runs = header.study.runs()?;
        let mut next = 0;
        for range in &header.ranges {
            if range.is_empty() || range.start < next || range.end > runs {
                bail!("its runs are not in order");
            }
            next = range.end;
        }
        let held: u64 = header
            .ranges
            .iter()
            .map(|range| range.end - range.start)
            .sum();
        if held == 0 || held > MOST_RUNS || u64::try_from(metadata.num_rows()) != Ok(held) {
            bail!("it has {} rows, expected {held}", metadata.num_rows());
        }
        Ok(Self {
            path: path.to_owned(),
            key: header.study,
            ranges: header.ranges,
            reader,
            group: 0,
            rows: Vec::new().into_iter(),
        })
    }

    /// Refuses a part of another study than this one, which `first` calls by its name.
    ///
    /// # Errors
    /// What differs, with both.
    pub fn check(&self, key: &StudyKey, first: &str) -> Result<(), StudyError> {
        match key.difference(&self.key) {
            Some(what) => Err(StudyError::OtherStudy {
                file: self.path.display().to_string(),
                first: first.to_owned(),
                what,
            }),
            None => Ok(()),
        }
    }

    /// The next row; there are as many as the ranges say.
    fn next(&mut self) -> Result<Row> {
        loop {
            if let Some(row) = self.rows.next() {
                return Ok(row);
            }
            let path = self.path.clone();
            self.rows = guarded(&path, || self.read_group())?.into_iter();
        }
    }

    fn read_group(&mut self) -> Result<Vec<Row>> {
        if self.group >= self.reader.num_row_groups() {
            bail!("rows are missing");
        }
        let columns = columns(&self.key);
        let place = |name: &str| columns.iter().position(|(column, _)| column == name);
        let place = |name: &str| place(name).with_context(|| format!("no column {name}"));
        let group = self.reader.get_row_group(self.group)?;
        self.group += 1;
        let rows = usize::try_from(group.metadata().num_rows())?;
        let texts = |name: &str| -> Result<Vec<ByteArray>> {
            let mut values = Vec::new();
            match group.get_column_reader(place(name)?)? {
                ColumnReader::ByteArrayColumnReader(mut column) => {
                    column.read_records(rows, None, None, &mut values)?;
                }
                _ => bail!("column {name} does not hold text"),
            }
            Ok(values)
        };
        let mut runs = Vec::new();
        match group.get_column_reader(place("run")?)? {
            ColumnReader::Int64ColumnReader(mut column) => {
                column.read_records(rows, None, None, &mut runs)?;
            }
            _ => bail!("column run does not hold integers"),
        }
        let mut scores: Vec<Vec<f64>> = Vec::new();
        for name in self.key.scores() {
            let mut values = Vec::new();
            match group.get_column_reader(place(name)?)? {
                ColumnReader::DoubleColumnReader(mut column) => {
                    column.read_records(rows, None, None, &mut values)?;
                }
                _ => bail!("column {name} does not hold numbers"),
            }
            scores.push(values);
        }
        let (used, errors) = (texts(PARAMETERS)?, texts(ERROR)?);
        let lengths = scores
            .iter()
            .map(Vec::len)
            .chain([used.len(), errors.len(), runs.len()]);
        if lengths.into_iter().any(|length| length != rows) {
            bail!("columns are cut off");
        }
        let row = |k: usize| {
            Ok(Row {
                run: u64::try_from(runs[k])?,
                scores: scores.iter().map(|column| column[k]).collect(),
                parameters_sha256: used[k].as_utf8()?.to_owned(),
                error: errors[k].as_utf8()?.to_owned(),
            })
        };
        (0..rows).map(row).collect()
    }
}

/// Turns a panic and any other damage into an error that names the file.
fn guarded<T>(path: &Path, read: impl FnOnce() -> Result<T>) -> Result<T> {
    let read = catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(anyhow!("the Parquet decoder gave up")));
    read.with_context(|| {
        let file = path.display();
        format!("{file}: not a part of a study as `study --out` writes it")
    })
}

/// What parts hold together.
#[derive(Debug)]
pub struct Merged {
    /// The study.
    pub plan: Plan,
    /// Sums over the rows.
    pub sums: StudySums,
    /// Hash of the rows.
    pub hash: String,
}

/// Reads parts of one study in the order of their runs and writes them as one table, if that is wanted. Memory does not grow with
/// their number.
///
/// # Errors
/// There is none, they are of different studies, a run is in two of them, or a file cannot be read or written.
pub fn merge(parts: &[PathBuf], out: Option<(&Path, bool)>) -> Result<Merged> {
    let (key, mut pieces) = pieces(parts)?;
    pieces.sort_by_key(|(range, _)| range.start);
    for pair in pieces.windows(2) {
        let [(one, first), (other, second)] = pair else {
            continue;
        };
        if other.start < one.end {
            let name = |part: &usize| parts[*part].display().to_string();
            let (file, other, run) = (name(first), name(second), other.start);
            return Err(StudyError::Overlap { file, other, run }.into());
        }
    }
    let plan = Plan::of(key)?;
    let mut sums = StudySums::new(&plan);
    let mut hash = RowsHash::of(plan.key());
    let mut writer = match out {
        Some((path, force)) => Some(Writer::create(path, &plan, joined(&pieces), force)?),
        None => None,
    };
    let mut open: HashMap<usize, StudyPart> = HashMap::new();
    for (range, part) in &pieces {
        let mut rows = match open.remove(part) {
            Some(rows) => rows,
            None => StudyPart::open(&parts[*part])?,
        };
        for run in range.clone() {
            let row = rows.next()?;
            if row.run != run {
                bail!(
                    "{}: row {} stands where run {run} is expected",
                    rows.path.display(),
                    row.run
                );
            }
            sums.add(&plan, &row);
            hash.add(&row);
            if let Some(writer) = &mut writer {
                writer.row(row)?;
            }
        }
        if rows.ranges.last() != Some(range) {
            open.insert(*part, rows);
        }
    }
    if let Some(writer) = writer {
        writer.finish()?;
    }
    let hash = hash.finish();
    Ok(Merged { plan, sums, hash })
}

/// Runs, and the place of the part that holds them.
type Piece = (Range<u64>, usize);

/// The runs of each part, and the study that all of them are of.
fn pieces(parts: &[PathBuf]) -> Result<(StudyKey, Vec<Piece>)> {
    let mut first: Option<(StudyKey, String)> = None;
    let mut pieces = Vec::new();
    for (place, path) in parts.iter().enumerate() {
        let part = StudyPart::open(path)?;
        match &first {
            Some((key, name)) => part.check(key, name)?,
            None => first = Some((part.key, path.display().to_string())),
        }
        pieces.extend(part.ranges.into_iter().map(|range| (range, place)));
    }
    let (key, _) = first.ok_or(StudyError::NoParts)?;
    Ok((key, pieces))
}

/// Ranges that follow one another as one.
fn joined(pieces: &[Piece]) -> Vec<Range<u64>> {
    let mut ranges: Vec<Range<u64>> = Vec::new();
    for (range, _) in pieces {
        match ranges.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => ranges.push(range.clone()),
        }
    }
    ranges
}
