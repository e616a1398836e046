//! Arrays of NumPy (`.npy`, `.npz`) as a table of text, which manifests and their drafts read like any other.
//!
//! Read first: `docs/formats.md`, section "Arrays of NumPy". An array of N rows and three columns that is saved as `gyr` is the
//! columns `gyr_x`, `gyr_y`, `gyr_z`; one number called `rate`, `fs` or the like stands for the column of times.

mod npy;

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use zip::ZipArchive;

use crate::error::{RecordingError, Result, join, shown};
use crate::limits::{self, MEMBERS};
use crate::text::{Input, open_file};
use npy::{Array, MAGIC, Values};

/// Opens a table of text, as it is or made of arrays.
pub(crate) fn open_table(path: &Path, file: &str) -> Result<Input> {
    let failed = |error| RecordingError::io(file, "read it", error);
    let mut input = open_file(path, file)?;
    let mut head = Vec::new();
    let mut begin = input.by_ref().take(MAGIC.len() as u64);
    begin.read_to_end(&mut head).map_err(failed)?;
    input.rewind().map_err(failed)?;
    let length = input.metadata().map_err(failed)?.len();
    if head.starts_with(MAGIC) {
        let limit = limits::unpacked(length);
        let array = Array::read(&mut input, length, &mut 0, limit, file)?;
        return Ok(Box::new(Rows::alone(array)));
    }
    if head.starts_with(b"PK\x03\x04")
        && let Some(named) = members(input, length, file)?
    {
        return Ok(Box::new(Rows::of(named, file)?));
    }
    Ok(Box::new(open_file(path, file)?))
}

/// The arrays of a zip by their names; none where it has other files.
fn members(input: File, length: u64, file: &str) -> Result<Option<Vec<(String, Array)>>> {
    let damaged =
        |error: zip::result::ZipError| RecordingError::damaged(file, shown(&error.to_string()));
    let mut archive = ZipArchive::new(input).map_err(damaged)?;
    MEMBERS.check(archive.len() as u64, file, "")?;
    let (mut named, mut held) = (Vec::new(), 0);
    let limit = limits::unpacked(length);
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?.into_owned();
        let Some(name) = name.strip_suffix(".npy") else {
            return Ok(None);
        };
        let size = entry.size();
        let shown = format!("{file}/{}", shown(name));
        // An array of words beside the sensors is no reason to refuse them.
        match Array::read(&mut entry, size, &mut held, limit, &shown) {
            Ok(array) => named.push((name.to_owned(), array)),
            Err(RecordingError::Unsupported { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok((!named.is_empty()).then_some(named))
}

/// What a single number is called that tells the samples a second.
const RATES: [&str; 9] = [
    "rate",
    "fs",
    "samplingrate",
    "samplerate",
    "samplingfrequency",
    "frequency",
    "freq",
    "hz",
    "ratehz",
];

/// Columns of a row that are named by letters or numbers.
fn endings(columns: usize) -> Vec<String> {
    match columns {
        1 => vec![String::new()],
        3 => ["_x", "_y", "_z"].map(str::to_owned).to_vec(),
        4 => ["_0", "_1", "_2", "_3"].map(str::to_owned).to_vec(),
        n => (1..=n).map(|number| format!("_column_{number}")).collect(),
    }
}

/// The lines of a table that is made of arrays, one after the other.
struct Rows {
    arrays: Vec<Array>,
    rate_hz: Option<f64>,
    rows: usize,
    row: usize,
    line: Vec<u8>,
    at: usize,
}

impl Rows {
    /// Of one array, whose columns have no names but what the file is called.
    fn alone(array: Array) -> Self {
        let array = lying(array);
        let [rows, columns] = array.shape;
        let header = match columns {
            3 | 4 => endings(columns).join(",").replace('_', ""),
            _ => String::new(),
        };
        Self::new(vec![array], None, rows, header)
    }

    /// Of arrays with names.
    fn of(named: Vec<(String, Array)>, file: &str) -> Result<Self> {
        let mut rate = None;
        let mut arrays: Vec<(String, Array)> = Vec::new();
        for (name, array) in named {
            let plain: String = name.chars().filter(|c| c.is_alphanumeric()).collect();
            match array.shape {
                [1, 1] if RATES.contains(&plain.to_lowercase().as_str()) => {
                    rate = Some((name, array.number(0)));
                }
                [1, 1] => {}
                _ => arrays.push((name, lying(array))),
            }
        }
        let rows = arrays.iter().map(|(_, a)| a.shape[0]).max().unwrap_or(0);
        let is_short = |array: &Array| array.shape[0] != rows;
        let shapes = |(name, array): &(String, Array)| {
            let [rows, columns] = array.shape;
            format!("{name} {rows} x {columns}")
        };
        // A sensor that is slower than the others, not a matrix beside them.
        if arrays
            .iter()
            .any(|(_, a)| is_short(a) && a.shape[0] > WIDEST)
        {
            let shapes: Vec<String> = arrays.iter().map(shapes).collect();
            return Err(RecordingError::unsupported(
                file,
                format!(
                    "arrays of different lengths: {}; save those of each length with their times as a file of their own, and let \
                     `northing describe FILE FILE` look at them",
                    join(shapes.iter().map(String::as_str))
                ),
            ));
        }
        arrays.retain(|(_, array)| !is_short(array));
        let is_timed = arrays
            .iter()
            .any(|(name, array)| array.time_unit.is_some() || crate::describe::is_time(name));
        let rate = rate.filter(|(_, hz)| !is_timed && hz.is_some_and(|hz| hz > 0.0));
        let mut header: Vec<String> = Vec::new();
        if let Some((name, _)) = &rate {
            header.push(format!("time (s) by {}", cell(name)));
        }
        for (name, array) in &arrays {
            let unit = array
                .time_unit
                .map_or(String::new(), |unit| format!(" ({unit})"));
            let ends = endings(array.shape[1]);
            header.extend(ends.iter().map(|end| format!("{}{end}{unit}", cell(name))));
        }
        let arrays = arrays.into_iter().map(|(_, array)| array).collect();
        let rate_hz = rate.and_then(|(_, hz)| hz);
        Ok(Self::new(arrays, rate_hz, rows, header.join(",")))
    }

    fn new(arrays: Vec<Array>, rate_hz: Option<f64>, rows: usize, mut header: String) -> Self {
        if !header.is_empty() {
            header.push('\n');
        }
        Self {
            arrays,
            rate_hz,
            rows,
            row: 0,
            line: header.into_bytes(),
            at: 0,
        }
    }

    /// Writes the next row; false behind the last one.
    fn next(&mut self) -> bool {
        if self.row == self.rows {
            return false;
        }
        self.at = 0;
        self.line.clear();
        let time = self.rate_hz.map(|hz| format!("{:?}", self.row as f64 / hz));
        let numbers = self.arrays.iter().flat_map(|array| {
            let columns = array.shape[1];
            (self.row * columns..(self.row + 1) * columns).map(|place| array.cell(place))
        });
        let cells: Vec<String> = time.into_iter().chain(numbers).collect();
        self.line.extend_from_slice(cells.join(",").as_bytes());
        self.line.push(b'\n');
        self.row += 1;
        true
    }
}

/// A name without what divides cells.
fn cell(name: &str) -> String {
    let is_plain = |c: char| !c.is_control() && !matches!(c, ',' | '"' | '(' | '[');
    name.chars().filter(|c| is_plain(*c)).collect()
}

/// The most numbers that a sample has.
const WIDEST: usize = 20;

/// With a row for each sample: some have a column for each.
fn lying(array: Array) -> Array {
    match array.shape {
        [rows, columns] if columns > WIDEST && rows <= WIDEST => array.transposed(),
        _ => array,
    }
}

impl Array {
    fn number(&self, place: usize) -> Option<f64> {
        match &self.values {
            Values::Integers(v) => v.get(place).map(|x| *x as f64),
            Values::Reals(v) => v.get(place).copied(),
        }
    }

    /// A number as text that is read back to the same number; NaN as an empty cell.
    fn cell(&self, place: usize) -> String {
        match &self.values {
            // The smallest one stands for no time.
            Values::Integers(v) => match v.get(place) {
                Some(x) if *x != i64::MIN => x.to_string(),
                _ => String::new(),
            },
            Values::Reals(v) => match v.get(place) {
                Some(x) if !x.is_nan() => format!("{x:?}"),
                _ => String::new(),
            },
        }
    }
}

impl Read for Rows {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let mut written = 0;
        while written < out.len() {
            if self.at == self.line.len() && !self.next() {
                break;
            }
            let count = (out.len() - written).min(self.line.len() - self.at);
            out[written..written + count].copy_from_slice(&self.line[self.at..self.at + count]);
            (written, self.at) = (written + count, self.at + count);
        }
        Ok(written)
    }
}

#[cfg(test)]
mod tests;
