//! Delimited text, row by row: the engine under our CSV, the manifest and Sensor Logger's CSV files.
//!
//! A [`Layout`] says which columns make which sensor; [`DelimitedSource`] walks the rows.

mod blanks;
mod navigation;
mod rows;

use crate::error::{RecordingError, Result, shown};
use crate::event::{Event, Sample, SensorKind};
use crate::issues::Issues;
use crate::local_place::LocalPlace;
use crate::numbers::{self, MOST};
use crate::recording::Pieces;
use crate::stamp;
use csv::ByteRecord;

pub(crate) use blanks::Blanks;
pub(crate) use navigation::of_degrees_minutes;
#[cfg(feature = "ulog")]
pub(crate) use navigation::standard_pressure;
pub(crate) use rows::Rows;

/// Which columns (numbered from 0) make the time and the sensors.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// Every column's name, for messages.
    pub(crate) names: Vec<String>,
    /// The column of the time stamps; not read where rows are counted.
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
    /// A time of day alone.
    TimeOfDay,
    /// A date in the column of the time stamps, and the time of day in this one.
    DateAndTime(usize),
    /// The GPS week in the column of the time stamps, and the seconds of it in this one; told as GPS time.
    GpsWeek(usize),
    /// None: the rows follow each other at this rate, Hz.
    Rate(f64),
}

/// The rows that have a text in a column.
#[derive(Debug, Clone)]
pub(crate) struct RowsOf {
    pub(crate) column: usize,
    pub(crate) equals: Vec<u8>,
}

/// The columns of one sensor: number `i` of its row (see [`numbers`]) is `factors[i]` times column
/// `columns[i]`; NaN where there is none.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    pub(crate) kind: SensorKind,
    pub(crate) columns: [Option<usize>; MOST],
    factors: [f64; MOST],
    pub(crate) form: Form,
    /// Whether a reference is scored; without the column it is.
    pub(crate) scored: Option<usize>,
}

/// What the numbers of a channel are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Form {
    /// Those of its kind.
    Plain,
    /// Increments of a vector: to be divided by the time since the row before.
    Increment,
    /// Body-from-world instead of world-from-body.
    Inverse,
    /// Static pressure told as height in the standard atmosphere, m.
    PressureHeight,
    /// A position with the quality in RTKLIB's numbers.
    RtklibPosition,
    /// A position whose latitude and longitude are a hundred times the degrees plus the minutes.
    DegreesMinutes,
    /// Speed over ground, course and the speed's standard deviation.
    SpeedAndCourse,
    /// Metres north, east and down of a place.
    Local(LocalPlace),
    /// An orientation as roll, pitch and yaw, rad.
    RollPitchYaw,
    /// In Earth-centred, Earth-fixed axes, at the position in these columns.
    Ecef { place: [usize; 3], inverse: bool },
}

impl Channel {
    /// A channel whose first numbers are in `columns`.
    pub(crate) fn new(kind: SensorKind, columns: &[usize]) -> Self {
        let mut channel = Self {
            kind,
            columns: [None; MOST],
            factors: [1.0; MOST],
            form: Form::Plain,
            scored: None,
        };
        for (number, column) in columns.iter().enumerate() {
            channel.columns[number] = Some(*column);
        }
        channel
    }

    pub(crate) fn put(&mut self, number: usize, column: Option<usize>, factor: f64) {
        (self.columns[number], self.factors[number]) = (column, factor);
    }

    /// With every number multiplied by `factor`.
    pub(crate) fn times(mut self, factor: f64) -> Self {
        self.factors = [factor; MOST];
        self
    }

    pub(crate) fn of_form(self, form: Form) -> Self {
        Self { form, ..self }
    }

    /// The columns that it reads.
    pub(crate) fn read(&self) -> impl Iterator<Item = usize> {
        let columns = &self.columns;
        // One radius may stand for the standard deviations north and east, and for the vertical one.
        let radius = columns[3];
        let is_radius = |column: &&Option<usize>| radius.is_some() && **column == radius;
        let copies = columns[4..6].iter().take_while(is_radius).count();
        let rest = &columns[3 + copies..];
        columns[..3]
            .iter()
            .chain(rest)
            .chain([&self.scored])
            .flatten()
            .copied()
    }
}

impl Layout {
    /// The columns of the time stamps.
    pub(crate) fn time_columns(&self) -> Vec<usize> {
        match self.time_form {
            TimeForm::Decimal(_) | TimeForm::DateTime | TimeForm::TimeOfDay => vec![self.time],
            TimeForm::DateAndTime(second) | TimeForm::GpsWeek(second) => vec![self.time, second],
            TimeForm::Rate(_) => Vec::new(),
        }
    }

    /// The sensors in [`SensorKind::ALL`] order.
    pub(crate) fn sensors(&self) -> Vec<SensorKind> {
        let mut sensors: Vec<_> = self.channels.iter().map(|channel| channel.kind).collect();
        sensors.sort_unstable_by_key(|kind| kind.order());
        sensors
    }
}

/// Rows of text as events.
pub(crate) struct DelimitedSource {
    rows: Rows,
    layout: Layout,
    record: ByteRecord,
    /// Events of the current row, the next one last.
    row: Vec<Event>,
    /// Stamp of the row before.
    previous_ns: Option<i64>,
    /// What clocks that started again have lost since the first row, ns: days behind midnight, full counters.
    carried_ns: i64,
    /// Rows taken so far.
    taken: u64,
}

impl DelimitedSource {
    pub(crate) fn new(rows: Rows, layout: Layout) -> Self {
        Self {
            rows,
            layout,
            record: ByteRecord::new(),
            row: Vec::new(),
            previous_ns: None,
            carried_ns: 0,
            taken: 0,
        }
    }
}

impl Pieces for DelimitedSource {
    fn ready(&mut self) -> Option<Event> {
        self.row.pop()
    }

    fn place(&self) -> Option<String> {
        let line = self.rows.line(self.record.position());
        Some(format!("{}, line {line}", self.rows.file()))
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        if !self.rows.read(&mut self.record)? {
            return Ok(false);
        }
        let mut cells = Cells {
            file: self.rows.file(),
            record: &self.record,
            layout: &self.layout,
            line: self.rows.line(self.record.position()),
            row: self.taken,
            interval_s: None,
        };
        if let Some(rows) = &self.layout.rows
            && cells.cell(rows.column) != rows.equals
        {
            return Ok(true);
        }
        self.taken += 1;
        let Some(time_ns) = cells.stamp()? else {
            issues.rows_without_stamp += 1;
            return Ok(true);
        };
        let lost_ns = match (self.layout.time_form, self.previous_ns) {
            (TimeForm::TimeOfDay, Some(previous)) => {
                day_lost(time_ns, previous.saturating_sub(self.carried_ns))
            }
            (TimeForm::Decimal(_), Some(previous)) => {
                let full = full(time_ns, previous.saturating_sub(self.carried_ns));
                // Told once: a table may start again in every other row.
                if let Some(full) = full.filter(|_| self.carried_ns == 0) {
                    issues.notes.push(started_again(cells.line, full));
                }
                full.map_or(0, |(full_ns, _)| full_ns)
            }
            _ => 0,
        };
        self.carried_ns = self.carried_ns.saturating_add(lost_ns);
        let time_ns = time_ns.saturating_add(self.carried_ns);
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

/// What a time of day lost at midnight, ns: a day where it is half a day or more before the row before it.
fn day_lost(time_ns: i64, previous_ns: i64) -> i64 {
    if time_ns < previous_ns.saturating_sub(DAY_NS / 2) {
        DAY_NS
    } else {
        0
    }
}

/// A count that starts again: after so long, ns, and as people call it.
type Full = (i64, &'static str);

/// What starts again at 0: the counters of 32 bits of microseconds, after 71.6 minutes, and of milliseconds, after 49.7 days
/// (`micros()` and `millis()` of Arduino), the seconds of a day and those of a week, whatever the unit that they were written in.
const STARTING_AGAIN: [Full; 4] = [
    (1_000 << 32, "a counter of 32 bits is full"),
    (1_000_000 << 32, "a counter of 32 bits is full"),
    (DAY_NS, "the seconds of a day are over"),
    (WEEK_S * 1_000_000_000, "the seconds of a week are over"),
];
const DAY_NS: i64 = 86_400_000_000_000;

/// The count that was full at a stamp that goes back.
fn full(time_ns: i64, previous_ns: i64) -> Option<Full> {
    /// A count that is full goes on within this; other rows that go back do not end and begin there.
    const NEAR_NS: i64 = 10_000_000_000;
    let started_again = |(full_ns, _): &Full| {
        (full_ns - NEAR_NS..*full_ns).contains(&previous_ns) && (0..NEAR_NS).contains(&time_ns)
    };
    STARTING_AGAIN.into_iter().find(started_again)
}

fn started_again(line: u64, (lost_ns, what): Full) -> String {
    format!(
        "The time starts again at line {line}, where {what}: {:.6} s are added from there on.",
        lost_ns as f64 * 1e-9
    )
}

/// One row, seen through the layout.
pub(crate) struct Cells<'a> {
    pub(crate) file: &'a str,
    pub(crate) record: &'a ByteRecord,
    pub(crate) layout: &'a Layout,
    /// The row's line in the file, for messages.
    pub(crate) line: u64,
    /// Rows taken before it.
    pub(crate) row: u64,
    /// Time since the row before, s, if it went forward.
    pub(crate) interval_s: Option<f64>,
}

/// The beginning of GPS time, 1980-01-06, in the seconds of a calendar without leap seconds.
const GPS_EPOCH_S: i64 = 315_964_800;
const WEEK_S: i64 = 604_800;
const WEEK: &str = "a GPS week, with seconds of the week beside it";
const CLOCK: &str = "a time of day, e.g. 23:59:59.5";
const DATE: &str = "a date and a time of day, e.g. 2014-08-01T00:00:00.186Z";
const DECIMAL: &str = "a time stamp (a decimal number, at most 146 years of nanoseconds)";

impl<'a> Cells<'a> {
    fn cell(&self, column: usize) -> &'a [u8] {
        self.record.get(column).unwrap_or_default().trim_ascii()
    }

    /// The row's time stamp; `None` when the cell is empty or NaN.
    pub(crate) fn stamp(&self) -> Result<Option<i64>> {
        if let TimeForm::Rate(rate_hz) = self.layout.time_form {
            // Exact to a nanosecond for a hundred days; `as` saturates.
            return Ok(Some((self.row as f64 * 1e9 / rate_hz).round() as i64));
        }
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
            TimeForm::DateAndTime(time_of_day) => {
                let both = [cell, b" ", self.cell(time_of_day)].concat();
                (stamp::parse_date_time(&both), DATE)
            }
            TimeForm::GpsWeek(seconds) => {
                let seconds = stamp::parse_ns(self.cell(seconds), stamp::SECONDS);
                let week = parse_f64(cell).filter(|week| (0.0..10_000.0).contains(week));
                let start = week.map(|week| (GPS_EPOCH_S + week as i64 * WEEK_S) * 1_000_000_000);
                (
                    seconds.zip(start).map(|(s, start)| s.saturating_add(start)),
                    WEEK,
                )
            }
            TimeForm::TimeOfDay => (stamp::parse_time_of_day(cell), CLOCK),
            TimeForm::DateTime | TimeForm::Rate(_) => (stamp::parse_date_time(cell), DATE),
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

    /// The row's sample of one sensor; `None` when the cells that it needs are empty.
    pub(crate) fn sample(&self, channel: &Channel) -> Result<Option<Sample>> {
        let Channel { kind, columns, .. } = channel;
        let mut row = [f64::NAN; MOST];
        for ((value, column), factor) in row.iter_mut().zip(columns).zip(&channel.factors) {
            if let Some(column) = column
                && let Some(number) = self.number(*column)?
            {
                *value = number * factor;
            }
        }
        let mut needed = columns.iter().take(numbers::widths(*kind).1).flatten();
        if needed.all(|column| self.cell(*column).is_empty()) {
            return Ok(None);
        }
        let scored = channel
            .scored
            .map_or(Ok(true), |column| self.flag(column))?;
        let sample = numbers::sample(*kind, &row, scored);
        sample.map_or(Ok(None), |sample| {
            self.converted(sample, channel.form, &row)
        })
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
