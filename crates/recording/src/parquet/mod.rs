//! Parquet with one row per instant, as `docs/formats.md` says (feature `parquet`).
//!
//! Columns are decoded one by one in batches of bounded size through the low-level column readers;
//! no row group is held as a whole. A sensor whose columns are all NaN (or null) on a row has no
//! sample there; a partial NaN or an infinity is a non-finite sample and passed on.

mod column;
mod layout;
mod pages;

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};

use column::{Column, read_rows};
use layout::Layout;
use pages::{Budget, GZIP_VERSION_2, Pages, Watched};

use crate::error::{RecordingError, Result, shown};
use crate::event::{Event, Sample, SensorKind};
use crate::issues::Issues;
use crate::limits::{self, FOOTER, Limit};
use crate::metadata::Metadata;
use crate::numbers;
use crate::recording::{Opened, Pieces};
use crate::stamp;

pub(crate) const TIME: &str = "t";
pub(crate) const MOVING: &str = "moving";
/// Time stamp of `t = 0`, ns; our writer's key, so that stamps survive exactly.
pub(crate) const START_NS: &str = "start_time_ns";

/// The columns of each sensor, in [`SensorKind::ALL`] order.
pub(crate) const SENSORS: numbers::ColumnsOfKinds = [
    (SensorKind::Gyroscope, "gx gy gz"),
    (SensorKind::Accelerometer, "ax ay az"),
    (SensorKind::Magnetometer, "mx my mz"),
    (SensorKind::MagnetometerUncalibrated, "umx umy umz"),
    (SensorKind::DeviceGyroscopeBias, "bgx bgy bgz"),
    (SensorKind::DeviceOrientation, "dqw dqx dqy dqz"),
    (SensorKind::Position, "px py pz"),
    (SensorKind::Velocity, "vx vy vz"),
    (SensorKind::Pressure, "pressure"),
    (SensorKind::CompassHeading, "heading heading_std"),
    (
        SensorKind::GnssPosition,
        "lat lon height std_n std_e std_d hdop satellites quality",
    ),
    (SensorKind::GnssVelocity, "vn ve vd vn_std ve_std vd_std"),
    (SensorKind::ForwardSpeed, "forward_speed"),
    (SensorKind::WaterVelocity, "water_forward water_starboard"),
    (SensorKind::TrueHeading, "true_heading true_heading_std"),
    (
        SensorKind::DeviceNavigation,
        "device_lat device_lon device_height device_std_n device_std_e device_std_d \
         device_vn device_ve device_vd device_heading_std device_validity",
    ),
    (
        SensorKind::ReferencePosition,
        "ref_lat ref_lon ref_height ref_std_n ref_std_e ref_std_d ref_hdop ref_satellites \
         ref_quality",
    ),
    (SensorKind::ReferenceVelocity, "ref_vn ref_ve ref_vd"),
    (SensorKind::Reference, "qw qx qy qz"),
];

/// Opens a file or bytes.
pub(crate) fn open<R: ChunkReader + Send + 'static>(
    input: R,
    file: &str,
    mut metadata: Metadata,
) -> Result<Opened> {
    let most_rows = limits::rows(input.len());
    check_footer(&input, file)?;
    let pages = Pages::new(input);
    let budget = pages.budget();
    let watched = Watched(Arc::clone(&pages));
    let reader = contained(file, None, || SerializedFileReader::new(watched))?;
    pages.watch(gzip_columns(&reader));
    let rows = reader.metadata().file_metadata().num_rows();
    most_rows.check(u64::try_from(rows).unwrap_or(u64::MAX), file, "")?;
    let start_ns = read_metadata(&reader, file, &mut metadata)?;
    let layout = Layout::find(&reader, file)?;
    check_compression(&reader, &layout.columns, file)?;
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
        most_rows,
        budget,
        events: Vec::new(),
    };
    Ok(Opened::new(metadata, sensors, Box::new(source)))
}

/// What to do about a compression that is not read.
const WRITE_AGAIN: &str = "write it again with zstd, snappy, gzip, LZ4_RAW or none (pandas and polars: compression=\"zstd\")";

/// Where in the file the columns that are packed with gzip stand.
fn gzip_columns<R: ChunkReader + 'static>(reader: &SerializedFileReader<R>) -> Vec<Range<u64>> {
    let groups = reader.metadata().row_groups().iter();
    let columns = groups.flat_map(|group| group.columns());
    let of_gzip = columns.filter(|column| matches!(column.compression(), Compression::GZIP(_)));
    of_gzip
        .map(|column| {
            let data = column.data_page_offset();
            let start = column.dictionary_page_offset().unwrap_or(data).min(data);
            let end = start.checked_add(column.compressed_size());
            // Of a footer that is invalid every page is looked at.
            let place = u64::try_from(start)
                .ok()
                .zip(end.and_then(|end| u64::try_from(end).ok()));
            place.map_or(0..u64::MAX, |(start, end)| start..end)
        })
        .collect()
}

/// Refuses columns that are packed in a way that is not read.
fn check_compression<R: ChunkReader + 'static>(
    reader: &SerializedFileReader<R>,
    columns: &[usize],
    file: &str,
) -> Result<()> {
    let groups = reader.metadata().row_groups().iter();
    let used = groups.flat_map(|group| {
        columns
            .iter()
            .filter_map(|place| group.columns().get(*place))
    });
    for column in used {
        let is_read = matches!(
            column.compression(),
            Compression::UNCOMPRESSED
                | Compression::SNAPPY
                | Compression::GZIP(_)
                | Compression::ZSTD(_)
                | Compression::LZ4_RAW
        );
        if !is_read {
            let problem = format!(
                "its column `{}` is compressed with {}, which is not read; {WRITE_AGAIN}",
                shown(&column.column_path().string()),
                column.compression(),
            );
            return Err(RecordingError::unsupported(file, problem));
        }
    }
    Ok(())
}

/// Runs a piece of the Parquet decoder. Panics on garbage have been seen in decoders of this size;
/// one must not take the program down, so it becomes the same error as any other damage. The state
/// touched by a panic is never used again. A page that is too large is told as that.
fn contained<T>(
    file: &str,
    budget: Option<&Budget>,
    work: impl FnOnce() -> std::result::Result<T, ParquetError>,
) -> Result<T> {
    let damaged = |detail: String| RecordingError::damaged(file, detail);
    let done = catch_unwind(AssertUnwindSafe(work));
    if let Some((limit, found)) = budget.and_then(Budget::refused) {
        limit.check(found, file, "")?;
    }
    match done {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) if error.to_string().contains(GZIP_VERSION_2) => {
            let problem = format!("{GZIP_VERSION_2}; {WRITE_AGAIN}");
            Err(RecordingError::unsupported(file, problem))
        }
        Ok(Err(error)) => Err(damaged(shown(&error.to_string()))),
        Err(_) => Err(damaged("the Parquet decoder gave up".to_owned())),
    }
}

/// Refuses a footer that is larger than is held in memory; other damage is found by the decoder.
fn check_footer<R: ChunkReader>(input: &R, file: &str) -> Result<()> {
    let Some(start) = input.len().checked_sub(8) else {
        return Ok(());
    };
    let end = contained(file, None, || input.get_bytes(start, 8))?;
    match *end {
        [a, b, c, d, b'P', b'A', b'R', b'1'] => {
            let length = u32::from_le_bytes([a, b, c, d]);
            FOOTER.check(u64::from(length), file, "")
        }
        _ => Ok(()),
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
        let damaged = |detail: String| RecordingError::damaged(file, detail);
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

struct ParquetSource<R: ChunkReader + 'static> {
    file: String,
    reader: SerializedFileReader<Watched<R>>,
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
    most_rows: Limit,
    budget: Arc<Budget>,
    /// Events of the current row, the next one last.
    events: Vec<Event>,
}

impl<R: ChunkReader + 'static> ParquetSource<R> {
    /// Decodes the next batch; false at the end of the file.
    fn read_batch(&mut self) -> Result<bool> {
        self.rows_before += self.rows as u64;
        (self.rows, self.row) = (0, 0);
        self.most_rows.check(self.rows_before, &self.file, "")?;
        let budget = Some(self.budget.as_ref());
        loop {
            let (columns, reader) = (&mut self.columns, &self.reader);
            let rows = if columns[0].decoder.is_some() {
                contained(&self.file, budget, || read_rows(columns))?
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
            contained(&self.file, budget, || {
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
        let width = numbers::widths(kind).0;
        let mut values = [f64::NAN; numbers::MOST];
        for (value, column) in values.iter_mut().zip(&self.columns[first..first + width]) {
            *value = column.values[row];
        }
        if values[..width].iter().all(|value| value.is_nan()) {
            return None;
        }
        // 1: moving, -1: the set has no such flag.
        let scored = self
            .moving
            .is_none_or(|place| self.columns[place].values[row] != 0.0);
        numbers::sample(kind, &values, scored)
    }
}

impl<R: ChunkReader + Send + 'static> Pieces for ParquetSource<R> {
    fn ready(&mut self) -> Option<Event> {
        self.events.pop()
    }

    fn place(&self) -> Option<String> {
        let row = self.rows_before + self.row as u64;
        Some(format!("{}, row {row}", self.file))
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        if self.row < self.rows {
            self.read_row(issues).map(|()| true)
        } else {
            self.read_batch()
        }
    }
}
