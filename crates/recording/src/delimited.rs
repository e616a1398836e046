//! Delimited text, row by row: the engine under our CSV, the manifest and Sensor Logger's CSV files.
//!
//! A [`Layout`] says which columns make which sensor; [`DelimitedSource`] walks the rows.

mod blanks;
mod navigation;

use std::io::Read;

use csv::{ByteRecord, Position};
use nalgebra::Vector3;

use crate::error::{RecordingError, Result, shown};
use crate::event::{Event, Reference, Sample, SensorKind, quaternion_from_file};
use crate::issues::Issues;
use crate::numbers;
use crate::recording::Pieces;
use crate::stamp;

pub(crate) use blanks::Blanks;
#[cfg(feature = "ulog")]
pub(crate) use navigation::standard_pressure;
pub(crate) use navigation::{EcefPart, EcefPose};

/// Which columns (numbered from 0) make the time and the sensors.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// Every column's name, for messages.
    pub(crate) names: Vec<String>,
    pub(crate) time: usize,
    pub(crate) time_form: TimeForm,
    pub(crate) channels: Vec<Channel>,
    /// Whether numbers are written with a decimal comma.
    pub(crate) decimal_comma: bool,
    /// The rows to take; without it all.
    pub(crate) rows: Option<RowsOf>,
}

/// How time stamps are written.
#[derive(Debug, Clone, Copy)]
pub(crate) enum TimeForm {
    /// A number; the decimal exponent from its unit to nanoseconds.
    Decimal(i32),
    /// A date and a time of day.
    DateTime,
}

/// The rows that have a text in a column.
#[derive(Debug, Clone)]
pub(crate) struct RowsOf {
    pub(crate) column: usize,
    pub(crate) equals: Vec<u8>,
}

/// The columns of one sensor.
#[derive(Debug, Clone)]
pub(crate) enum Channel {
    /// Body axis `i` is `factors[i]` times column `columns[i]`; of increments divided by the time since
    /// the row before.
    Vector {
        kind: SensorKind,
        columns: [usize; 3],
        factors: [f64; 3],
        is_increment: bool,
    },
    /// Order w, x, y, z; `inverse` when the file holds body-from-world.
    DeviceOrientation {
        columns: [usize; 4],
        inverse: bool,
    },
    Reference {
        columns: [usize; 4],
        inverse: bool,
        scored: Option<usize>,
    },
    /// Any other kind: number `i` of its row (see [`numbers`]) is `factors[i]` times column
    /// `columns[i]`; NaN where there is none.
    Numbers {
        kind: SensorKind,
        columns: [Option<usize>; numbers::MOST],
        factors: [f64; numbers::MOST],
    },
    /// Static pressure told as height in the standard atmosphere, m.
    PressureHeight {
        column: usize,
    },
    /// As [`Channel::Numbers`], with the quality in RTKLIB's numbers.
    RtklibPosition {
        columns: [Option<usize>; numbers::MOST],
        factors: [f64; numbers::MOST],
    },
    SpeedAndCourse {
        speed: usize,
        course: usize,
        std: Option<usize>,
        to_m_per_s: f64,
        to_rad: f64,
    },
    Ecef(EcefPose),
}

impl Channel {
    /// The channel of a kind with one number.
    pub(crate) fn one(kind: SensorKind, column: usize, factor: f64) -> Self {
        let (mut columns, mut factors) = ([None; numbers::MOST], [1.0; numbers::MOST]);
        (columns[0], factors[0]) = (Some(column), factor);
        Self::Numbers {
            kind,
            columns,
            factors,
        }
    }

    /// The columns that it reads.
    pub(crate) fn columns(&self) -> Vec<usize> {
        match self {
            Self::Vector { columns, .. } => columns.to_vec(),
            Self::DeviceOrientation { columns, .. } => columns.to_vec(),
            Self::Reference {
                columns, scored, ..
            } => columns.iter().copied().chain(*scored).collect(),
            Self::Numbers { columns, .. } | Self::RtklibPosition { columns, .. } => {
                // One radius may stand for the standard deviations north and east.
                let is_radius = columns[3].is_some() && columns[3] == columns[4];
                let skipped = usize::from(is_radius);
                let rest = columns[..3].iter().chain(&columns[3 + skipped..]);
                rest.flatten().copied().collect()
            }
            Self::PressureHeight { column } => vec![*column],
            Self::SpeedAndCourse {
                speed, course, std, ..
            } => [*speed, *course].into_iter().chain(*std).collect(),
            Self::Ecef(pose) => pose.columns(),
        }
    }

    pub(crate) fn kind(&self) -> SensorKind {
        match self {
            Self::Vector { kind, .. } => *kind,
            Self::DeviceOrientation { .. } => SensorKind::DeviceOrientation,
            Self::Reference { .. } => SensorKind::Reference,
            Self::Numbers { kind, .. } => *kind,
            Self::PressureHeight { .. } => SensorKind::Pressure,
            Self::RtklibPosition { .. } => SensorKind::GnssPosition,
            Self::SpeedAndCourse { .. } => SensorKind::GnssVelocity,
            Self::Ecef(pose) => pose.kind(),
        }
    }
}

impl Layout {
    /// The sensors in [`SensorKind::ALL`] order.
    pub(crate) fn sensors(&self) -> Vec<SensorKind> {
        let mut sensors: Vec<_> = self.channels.iter().map(Channel::kind).collect();
        sensors.sort_unstable_by_key(|kind| kind.order());
        sensors
    }
}

/// Rows of text as events.
pub(crate) struct DelimitedSource<R> {
    file: String,
    reader: csv::Reader<R>,
    layout: Layout,
    /// Lines of the file before the part that `reader` sees.
    lines_before: u64,
    record: ByteRecord,
    /// Events of the current row, the next one last.
    row: Vec<Event>,
    /// Stamp of the row before.
    previous_ns: Option<i64>,
}

impl<R: Read + Send> DelimitedSource<R> {
    pub(crate) fn new(
        file: String,
        reader: csv::Reader<R>,
        layout: Layout,
        lines_before: u64,
    ) -> Self {
        Self {
            file,
            reader,
            layout,
            lines_before,
            record: ByteRecord::new(),
            row: Vec::new(),
            previous_ns: None,
        }
    }
}

impl<R: Read + Send> Pieces for DelimitedSource<R> {
    fn ready(&mut self) -> Option<Event> {
        self.row.pop()
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let more = self
            .reader
            .read_byte_record(&mut self.record)
            .map_err(|error| csv_error(&self.file, self.lines_before, &error))?;
        if !more {
            return Ok(false);
        }
        let mut cells = Cells {
            file: &self.file,
            record: &self.record,
            layout: &self.layout,
            line: self.lines_before + self.record.position().map_or(0, Position::line),
            interval_s: None,
        };
        if let Some(rows) = &self.layout.rows
            && cells.cell(rows.column) != rows.equals
        {
            return Ok(true);
        }
        let Some(time_ns) = cells.stamp()? else {
            issues.rows_without_stamp += 1;
            return Ok(true);
        };
        let interval_ns = self
            .previous_ns
            .replace(time_ns)
            .map_or(0, |previous| time_ns.saturating_sub(previous));
        cells.interval_s = (interval_ns > 0).then_some(interval_ns as f64 * 1e-9);
        for channel in self.layout.channels.iter().rev() {
            if let Some(sample) = cells.sample(channel)? {
                self.row.push(Event { time_ns, sample });
            }
        }
        Ok(true)
    }
}

/// One row, seen through the layout.
pub(crate) struct Cells<'a> {
    pub(crate) file: &'a str,
    pub(crate) record: &'a ByteRecord,
    pub(crate) layout: &'a Layout,
    /// The row's line in the file, for messages.
    pub(crate) line: u64,
    /// Time since the row before, s, if it went forward.
    pub(crate) interval_s: Option<f64>,
}

const DECIMAL: &str = "a time stamp (a decimal number, at most 146 years of nanoseconds)";

impl<'a> Cells<'a> {
    fn cell(&self, column: usize) -> &'a [u8] {
        self.record.get(column).unwrap_or_default().trim_ascii()
    }

    /// The row's time stamp; `None` when the cell is empty or NaN.
    pub(crate) fn stamp(&self) -> Result<Option<i64>> {
        let column = self.layout.time;
        let cell = self.cell(column);
        if cell.is_empty() || cell.eq_ignore_ascii_case(b"nan") {
            return Ok(None);
        }
        let (parsed, expected) = match self.layout.time_form {
            TimeForm::Decimal(exponent) if self.layout.decimal_comma => {
                (stamp::parse_ns(&with_point(cell), exponent), DECIMAL)
            }
            TimeForm::Decimal(exponent) => (stamp::parse_ns(cell, exponent), DECIMAL),
            TimeForm::DateTime => (
                stamp::parse_date_time(cell),
                "a date and a time of day, e.g. 2014-08-01T00:00:00.186Z",
            ),
        };
        parsed
            .map(Some)
            .ok_or_else(|| self.bad_cell(column, expected))
    }

    /// The number of a cell; `None` when it is empty.
    fn number(&self, column: usize) -> Result<Option<f64>> {
        let cell = self.cell(column);
        if cell.is_empty() {
            return Ok(None);
        }
        let parsed = if self.layout.decimal_comma {
            parse_f64(&with_point(cell))
        } else {
            parse_f64(cell)
        };
        parsed.map(Some).ok_or_else(|| {
            self.bad_cell(
                column,
                "a number (leave the cell empty where there is no sample)",
            )
        })
    }

    /// The numbers of several cells: `None` when all are empty, NaN for single empty ones.
    fn numbers<const N: usize>(&self, columns: &[usize; N]) -> Result<Option<[f64; N]>> {
        let mut values = [f64::NAN; N];
        let mut any = false;
        for (value, &column) in values.iter_mut().zip(columns) {
            if let Some(number) = self.number(column)? {
                (*value, any) = (number, true);
            }
        }
        Ok(any.then_some(values))
    }

    /// The row's sample of one sensor; `None` when its cells are empty.
    pub(crate) fn sample(&self, channel: &Channel) -> Result<Option<Sample>> {
        Ok(match channel {
            Channel::Vector {
                kind,
                columns,
                factors,
                is_increment,
            } => self.numbers(columns)?.and_then(|[x, y, z]| {
                let v = Vector3::new(x * factors[0], y * factors[1], z * factors[2]);
                if *is_increment {
                    // Over how long the first row's increment was gained nobody knows.
                    return Sample::from_vector(*kind, v / self.interval_s?);
                }
                Sample::from_vector(*kind, v)
            }),
            Channel::DeviceOrientation { columns, inverse } => self
                .attitude(columns, *inverse)?
                .map(Sample::DeviceOrientation),
            Channel::Reference {
                columns,
                inverse,
                scored,
            } => {
                let Some(attitude) = self.attitude(columns, *inverse)? else {
                    return Ok(None);
                };
                let scored = scored.map_or(Ok(true), |column| self.flag(column))?;
                Some(Sample::Reference(Reference { attitude, scored }))
            }
            Channel::Numbers {
                kind,
                columns,
                factors,
            } => self.row_of(*kind, columns, factors)?,
            channel => self.navigation(channel)?,
        })
    }

    /// The sample of a kind whose numbers may be absent; `None` when all that it needs are empty.
    fn row_of(
        &self,
        kind: SensorKind,
        columns: &[Option<usize>; numbers::MOST],
        factors: &[f64; numbers::MOST],
    ) -> Result<Option<Sample>> {
        let mut row = [f64::NAN; numbers::MOST];
        for ((value, column), factor) in row.iter_mut().zip(columns).zip(factors) {
            if let Some(column) = column
                && let Some(number) = self.number(*column)?
            {
                *value = number * factor;
            }
        }
        let needed = columns.iter().take(numbers::widths(kind).1).flatten();
        if needed.clone().all(|column| self.cell(*column).is_empty()) {
            return Ok(None);
        }
        Ok(numbers::sample(kind, &row, true))
    }

    fn attitude(
        &self,
        columns: &[usize; 4],
        inverse: bool,
    ) -> Result<Option<nalgebra::UnitQuaternion<f64>>> {
        Ok(self.numbers(columns)?.map(|[w, x, y, z]| {
            let q = quaternion_from_file(w, x, y, z);
            if inverse { q.inverse() } else { q }
        }))
    }

    /// 0 or false: not scored; anything else that is allowed, and an empty cell: scored.
    fn flag(&self, column: usize) -> Result<bool> {
        match self.cell(column) {
            b"0" | b"false" | b"False" | b"0.0" => Ok(false),
            b"" | b"1" | b"true" | b"True" | b"1.0" | b"-1" => Ok(true),
            _ => Err(self.bad_cell(column, "0 or 1")),
        }
    }

    fn bad_cell(&self, column: usize, expected: &'static str) -> RecordingError {
        RecordingError::BadCell {
            file: self.file.to_owned(),
            line: self.line,
            column: shown(self.layout.names.get(column).map_or("?", String::as_str)),
            text: shown(&String::from_utf8_lossy(self.cell(column))),
            expected,
        }
    }
}

fn parse_f64(cell: &[u8]) -> Option<f64> {
    std::str::from_utf8(cell).ok()?.parse().ok()
}

fn with_point(cell: &[u8]) -> Vec<u8> {
    cell.iter()
        .map(|&b| if b == b',' { b'.' } else { b })
        .collect()
}

/// An error of the csv crate as ours.
pub(crate) fn csv_error(file: &str, lines_before: u64, error: &csv::Error) -> RecordingError {
    match error.kind() {
        csv::ErrorKind::UnequalLengths {
            pos,
            expected_len,
            len,
        } => RecordingError::bad_line(
            file,
            lines_before + pos.as_ref().map_or(0, Position::line),
            format!("{len} cells where the first row has {expected_len}; is the line cut off?"),
        ),
        csv::ErrorKind::Io(cause) => {
            // The csv crate lends its error, io::Error is not Clone.
            RecordingError::io(
                file,
                "read it",
                std::io::Error::new(cause.kind(), cause.to_string()),
            )
        }
        _ => RecordingError::bad_line(
            file,
            lines_before + error.position().map_or(0, Position::line),
            error.to_string(),
        ),
    }
}
