//! Parquet with one row per instant, as `docs/formats.md` says (feature `parquet`).
//!
//! Columns are decoded one by one in batches of bounded size through the low-level column readers;
//! no row group is held as a whole. A sensor whose columns are all NaN (or null) on a row has no
//! sample there; a partial NaN or an infinity is a non-finite sample and passed on.

use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};

use bytes::Bytes;
use nalgebra::Vector3;
use parquet::basic::Type as Physical;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};

use crate::error::{RecordingError, Result, join, shown};
use crate::event::{Event, Reference, Sample, SensorKind, quaternion_from_file};
use crate::issues::Issues;
use crate::metadata::Metadata;
use crate::recording::{EventSource, Opened};
use crate::stamp;

pub(crate) const TIME: &str = "t";
pub(crate) const MOVING: &str = "moving";
/// Time stamp of `t = 0`, ns; our writer's key, so that stamps survive exactly.
pub(crate) const START_NS: &str = "start_time_ns";

/// The columns of each sensor, in [`SensorKind::ALL`] order.
pub(crate) const SENSORS: [(SensorKind, &[&str]); 10] = [
    (SensorKind::Gyroscope, &["gx", "gy", "gz"]),
    (SensorKind::Accelerometer, &["ax", "ay", "az"]),
    (SensorKind::Magnetometer, &["mx", "my", "mz"]),
    (SensorKind::MagnetometerUncalibrated, &["umx", "umy", "umz"]),
    (SensorKind::DeviceGyroscopeBias, &["bgx", "bgy", "bgz"]),
    (SensorKind::DeviceOrientation, &["dqw", "dqx", "dqy", "dqz"]),
    (SensorKind::Position, &["px", "py", "pz"]),
    (SensorKind::Velocity, &["vx", "vy", "vz"]),
    (SensorKind::Pressure, &["pressure"]),
    (SensorKind::Reference, &["qw", "qx", "qy", "qz"]),
];

/// Rows decoded at a time.
const BATCH: usize = 2048;

/// Opens a Parquet file on disk.
pub(crate) fn open_file(input: File, file: &str, metadata: Metadata) -> Result<Opened> {
    open(input, file, metadata)
}

/// Opens a Parquet file in memory.
pub(crate) fn open_bytes(input: Vec<u8>, file: &str, metadata: Metadata) -> Result<Opened> {
    open(Bytes::from(input), file, metadata)
}

fn open<R: ChunkReader + 'static>(input: R, file: &str, mut metadata: Metadata) -> Result<Opened> {
    let reader = contained(file, || SerializedFileReader::new(input))?;
    let start_ns = read_metadata(&reader, file, &mut metadata)?;
    let layout = Layout::find(&reader, file)?;
    let sensors = layout.sensors.iter().map(|(kind, _)| *kind).collect();
    let source = ParquetSource {
        file: file.to_owned(),
        columns: layout
            .columns
            .iter()
            .map(|place| Column::new(*place))
            .collect(),
        names: layout.names,
        sensors: layout.sensors,
        moving: layout.moving,
        start_ns,
        reader,
        next_group: 0,
        rows: 0,
        row: 0,
        rows_before: 0,
        events: Vec::new(),
        failed: false,
    };
    Ok(Opened {
        metadata,
        sensors,
        source: Box::new(source),
        notes: Vec::new(),
        units_applied: false,
    })
}

/// Runs a piece of the Parquet decoder. Panics on garbage have been seen in decoders of this size;
/// one must not take the program down, so it becomes the same error as any other damage. The state
/// touched by a panic is never used again.
fn contained<T>(
    file: &str,
    work: impl FnOnce() -> std::result::Result<T, ParquetError>,
) -> Result<T> {
    let damaged = |detail: String| RecordingError::Damaged {
        file: file.to_owned(),
        detail,
    };
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(damaged(shown(&error.to_string()))),
        Err(_) => Err(damaged("the Parquet decoder gave up".to_owned())),
    }
}

/// Fills the metadata from the key/value pairs; returns the stamp of `t = 0`.
fn read_metadata<R: ChunkReader + 'static>(
    reader: &SerializedFileReader<R>,
    file: &str,
    metadata: &mut Metadata,
) -> Result<i64> {
    "parquet".clone_into(&mut metadata.format);
    let mut start_ns = 0;
    let pairs = reader.metadata().file_metadata().key_value_metadata();
    for pair in pairs.into_iter().flatten() {
        let value = pair.value.as_deref().unwrap_or_default();
        let damaged = |detail: String| RecordingError::Damaged {
            file: file.to_owned(),
            detail,
        };
        match pair.key.as_str() {
            "ARROW:schema" => {}
            START_NS => {
                start_ns =
                    stamp::parse_ns(value.as_bytes(), stamp::NANOSECONDS).ok_or_else(|| {
                        damaged(format!("{START_NS} is `{}`, not nanoseconds", shown(value)))
                    })?;
            }
            "trial" => metadata.set("name", value).map_err(damaged)?,
            "phone" => metadata.set("device", value).map_err(damaged)?,
            key => metadata.set(key, value).map_err(damaged)?,
        }
    }
    Ok(start_ns)
}

/// Which columns of the file are read, and what they make.
struct Layout {
    /// Column numbers in the file; the first is the time.
    columns: Vec<usize>,
    names: Vec<String>,
    /// Sensor and where its first value stands in `columns`.
    sensors: Vec<(SensorKind, usize)>,
    moving: Option<usize>,
}

impl Layout {
    fn find<R: ChunkReader + 'static>(
        reader: &SerializedFileReader<R>,
        file: &str,
    ) -> Result<Self> {
        let schema = reader.metadata().file_metadata().schema_descr();
        let present: Vec<(String, Physical)> = schema
            .columns()
            .iter()
            .map(|column| (column.path().string(), column.physical_type()))
            .collect();
        let place_of = |name: &str| present.iter().position(|(n, _)| n == name);
        let missing = |names: &[&str]| {
            RecordingError::MissingColumns {
            file: file.to_owned(),
            missing: format!("column {}", join(names.iter().copied())),
            present: join(present.iter().map(|(name, _)| name.as_str())),
            advice: "the columns are t (s), gx gy gz (rad/s), ax ay az (m/s^2), mx my mz (uT), as docs/formats.md says"
                .to_owned(),
        }
        };
        let mut layout = Self {
            columns: vec![place_of(TIME).ok_or_else(|| missing(&[TIME]))?],
            names: Vec::new(),
            sensors: Vec::new(),
            moving: None,
        };
        for (kind, names) in SENSORS {
            let absent: Vec<&str> = names
                .iter()
                .copied()
                .filter(|n| place_of(n).is_none())
                .collect();
            if absent.len() == names.len() {
                continue;
            }
            if !absent.is_empty() {
                return Err(missing(&absent));
            }
            layout.sensors.push((kind, layout.columns.len()));
            layout
                .columns
                .extend(names.iter().filter_map(|n| place_of(n)));
        }
        if !layout
            .sensors
            .iter()
            .any(|(kind, _)| *kind == SensorKind::Gyroscope)
        {
            let others: Vec<_> = layout.sensors.iter().map(|(kind, _)| *kind).collect();
            return if others.is_empty() {
                Err(missing(&["gx", "gy", "gz"]))
            } else {
                Err(RecordingError::no_gyroscope(file, &others))
            };
        }
        if let Some(place) = place_of(MOVING) {
            layout.moving = Some(layout.columns.len());
            layout.columns.push(place);
        }
        layout.check_types(&present, file)?;
        let repetitions = |place: usize| schema.column(place).max_rep_level();
        if layout.columns.iter().any(|place| repetitions(*place) > 0) {
            return Err(missing(&["with single numbers (lists are not read)"]));
        }
        Ok(layout)
    }

    fn check_types(&mut self, present: &[(String, Physical)], file: &str) -> Result<()> {
        for &place in &self.columns {
            let (name, physical) = &present[place];
            let numeric = matches!(
                physical,
                Physical::FLOAT
                    | Physical::DOUBLE
                    | Physical::INT32
                    | Physical::INT64
                    | Physical::BOOLEAN
            );
            if !numeric {
                return Err(RecordingError::Unsupported {
                    file: file.to_owned(),
                    problem: format!(
                        "column `{}` is of type {physical}; expected float or double",
                        shown(name)
                    ),
                });
            }
            self.names.push(name.clone());
        }
        Ok(())
    }
}

struct ParquetSource<R: ChunkReader + 'static> {
    file: String,
    reader: SerializedFileReader<R>,
    columns: Vec<Column>,
    names: Vec<String>,
    sensors: Vec<(SensorKind, usize)>,
    moving: Option<usize>,
    start_ns: i64,
    next_group: usize,
    /// Rows in the current batch, the next of them, and rows of the batches before.
    rows: usize,
    row: usize,
    rows_before: u64,
    /// Events of the current row, the next one last.
    events: Vec<Event>,
    failed: bool,
}

impl<R: ChunkReader + 'static> ParquetSource<R> {
    /// Decodes the next batch; false at the end of the file.
    fn read_batch(&mut self) -> Result<bool> {
        self.rows_before += self.rows as u64;
        (self.rows, self.row) = (0, 0);
        loop {
            let (columns, reader) = (&mut self.columns, &self.reader);
            let rows = if columns[0].decoder.is_some() {
                contained(&self.file, || read_rows(columns))?
            } else {
                None
            };
            match rows {
                Some(0) | None => {}
                Some(rows) => {
                    self.rows = rows;
                    return Ok(true);
                }
            }
            if self.next_group == reader.num_row_groups() {
                return Ok(false);
            }
            let group = self.next_group;
            self.next_group += 1;
            contained(&self.file, || {
                let group = reader.get_row_group(group)?;
                for column in columns.iter_mut() {
                    column.decoder = Some(group.get_column_reader(column.place)?);
                }
                Ok(())
            })?;
        }
    }

    /// Turns the next row of the batch into events.
    fn read_row(&mut self, issues: &mut Issues) -> Result<()> {
        let row = self.row;
        self.row += 1;
        let t = self.columns[0].values[row];
        if t.is_nan() {
            issues.rows_without_stamp += 1;
            return Ok(());
        }
        let since_start = stamp::from_seconds(t).and_then(|ns| ns.checked_add(self.start_ns));
        let Some(time_ns) = since_start else {
            return Err(RecordingError::BadCell {
                file: self.file.clone(),
                line: self.rows_before + row as u64 + 1,
                column: self.names[0].clone(),
                text: t.to_string(),
                expected: "a time in seconds",
            });
        };
        for &(kind, first) in self.sensors.iter().rev() {
            if let Some(sample) = self.sample(kind, first, row) {
                self.events.push(Event { time_ns, sample });
            }
        }
        Ok(())
    }

    fn sample(&self, kind: SensorKind, first: usize, row: usize) -> Option<Sample> {
        let value = |offset: usize| self.columns[first + offset].values[row];
        match kind {
            SensorKind::Pressure => {
                let pressure = value(0);
                (!pressure.is_nan()).then_some(Sample::Pressure(pressure))
            }
            SensorKind::DeviceOrientation | SensorKind::Reference => {
                let [w, x, y, z] = [value(0), value(1), value(2), value(3)];
                if w.is_nan() && x.is_nan() && y.is_nan() && z.is_nan() {
                    return None;
                }
                let attitude = quaternion_from_file(w, x, y, z);
                if kind == SensorKind::DeviceOrientation {
                    return Some(Sample::DeviceOrientation(attitude));
                }
                // 1: moving, -1: the set has no such flag.
                let scored = self
                    .moving
                    .is_none_or(|place| self.columns[place].values[row] != 0.0);
                Some(Sample::Reference(Reference { attitude, scored }))
            }
            _ => {
                let [x, y, z] = [value(0), value(1), value(2)];
                if x.is_nan() && y.is_nan() && z.is_nan() {
                    return None;
                }
                Sample::from_vector(kind, Vector3::new(x, y, z))
            }
        }
    }
}

impl<R: ChunkReader + 'static> EventSource for ParquetSource<R> {
    fn next_event(&mut self, issues: &mut Issues) -> Option<Result<Event>> {
        loop {
            if let Some(event) = self.events.pop() {
                return Some(Ok(event));
            }
            if self.failed {
                return None;
            }
            let step = if self.row < self.rows {
                self.read_row(issues).map(|()| true)
            } else {
                self.read_batch()
            };
            match step {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => {
                    self.failed = true;
                    return Some(Err(error));
                }
            }
        }
    }
}

/// One column: its decoder in the current row group and its values of the current batch.
struct Column {
    place: usize,
    decoder: Option<ColumnReader>,
    values: Vec<f64>,
    levels: Vec<i16>,
}

/// Reads up to [`BATCH`] rows of every column; all must give the same number. `None` without decoders.
fn read_rows(columns: &mut [Column]) -> std::result::Result<Option<usize>, ParquetError> {
    let mut rows = None;
    for column in columns {
        let read = column.read()?;
        if *rows.get_or_insert(read) != read {
            return Err(ParquetError::General(
                "columns of different length".to_owned(),
            ));
        }
    }
    Ok(rows)
}

impl Column {
    fn new(place: usize) -> Self {
        Self {
            place,
            decoder: None,
            values: Vec::new(),
            levels: Vec::new(),
        }
    }

    /// Fills `values` with the next batch, NaN for nulls; returns the number of rows.
    fn read(&mut self) -> std::result::Result<usize, ParquetError> {
        let Self {
            decoder,
            values,
            levels,
            ..
        } = self;
        match decoder {
            Some(ColumnReader::FloatColumnReader(d)) => {
                read_as(d, values, levels, |v: f32| f64::from(v))
            }
            Some(ColumnReader::DoubleColumnReader(d)) => read_as(d, values, levels, |v: f64| v),
            Some(ColumnReader::Int32ColumnReader(d)) => {
                read_as(d, values, levels, |v: i32| f64::from(v))
            }
            // Stamps and flags stay far below 2^53.
            Some(ColumnReader::Int64ColumnReader(d)) => {
                read_as(d, values, levels, |v: i64| v as f64)
            }
            Some(ColumnReader::BoolColumnReader(d)) => {
                read_as(d, values, levels, |v: bool| f64::from(u8::from(v)))
            }
            _ => Err(ParquetError::General(
                "a column is not of a numeric type".to_owned(),
            )),
        }
    }
}

fn read_as<T: DataType>(
    decoder: &mut ColumnReaderImpl<T>,
    values: &mut Vec<f64>,
    levels: &mut Vec<i16>,
    convert: impl Fn(T::T) -> f64,
) -> std::result::Result<usize, ParquetError> {
    values.clear();
    levels.clear();
    let mut present = Vec::with_capacity(BATCH);
    let mut rows = 0;
    while rows < BATCH {
        let (read, _, _) = decoder.read_records(BATCH - rows, Some(levels), None, &mut present)?;
        if read == 0 {
            break;
        }
        rows += read;
    }
    if levels.is_empty() {
        // A required column has no definition levels: every value is there.
        values.extend(present.into_iter().map(convert));
    } else {
        // Level 1 of a flat optional column: the value is there.
        let mut present = present.into_iter();
        values.extend(levels.iter().map(|level| {
            let value = if *level > 0 { present.next() } else { None };
            value.map_or(f64::NAN, &convert)
        }));
    }
    if values.len() == rows {
        Ok(rows)
    } else {
        Err(ParquetError::General("fewer values than rows".to_owned()))
    }
}
