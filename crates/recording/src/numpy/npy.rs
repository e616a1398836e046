//! One array of NumPy (`.npy`).
//!
//! Read first: NumPy, *A simple file format for NumPy arrays* (NEP 1). Six bytes `\x93NUMPY`, the version, the length of the
//! header, and the header: a dictionary of Python with `descr` (the kind of its numbers), `fortran_order` and `shape`.
//! Only that form is read, without a parser of Python's literals, whose nesting a file could make as deep as it likes.

use std::io::Read;

use crate::error::{RecordingError, Result, shown};
use crate::limits::Limit;

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header that is read: those of plain numbers have some 120 bytes.
const LONGEST_HEADER: usize = 1 << 16;

/// Numbers with their shape, those of a row one after the other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    /// Rows and columns; a single number has one of each.
    pub(super) shape: [usize; 2],
    pub(super) values: Values,
    /// The unit of times, as a manifest has it.
    pub(super) time_unit: Option<&'static str>,
}

/// Whole numbers stay whole: nanoseconds since 1970 are more than a real number holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    Integers(Vec<i64>),
    Reals(Vec<f64>),
}

impl Array {
    /// Reads an array of `bytes` bytes. What is in memory then is counted in `held` and stays within the limit: there a
    /// number has eight bytes, however small it is in the file.
    ///
    /// # Errors
    /// It is cut off, too large, has other things than numbers, or more than two axes.
    pub(super) fn read(
        input: &mut impl Read,
        bytes: u64,
        held: &mut u64,
        limit: Limit,
        file: &str,
    ) -> Result<Self> {
        let failed = |error| RecordingError::io(file, "read it", error);
        let damaged = |detail: &str| RecordingError::damaged(file, detail.to_owned());
        let cut_off = || damaged("the array is shorter than its header says");
        let mut begin = Vec::new();
        input.take(8).read_to_end(&mut begin).map_err(failed)?;
        let (true, [.., version, _]) = (begin.starts_with(MAGIC), &begin[..]) else {
            return Err(damaged("no array of NumPy"));
        };
        let width = if *version == 1 { 2 } else { 4 };
        let mut length = [0; 4];
        let read = input.read_exact(&mut length[..width]);
        read.map_err(|_| cut_off())?;
        let length = u32::from_le_bytes(length) as usize;
        if length > LONGEST_HEADER {
            return Err(damaged("its header is longer than any of numbers"));
        }
        let mut header = Vec::new();
        let most = length as u64;
        input.take(most).read_to_end(&mut header).map_err(failed)?;
        if header.len() < length {
            return Err(cut_off());
        }
        let header = Header::parse(&String::from_utf8_lossy(&header), file)?;
        let needed = header.bytes().filter(|needed| *needed <= bytes);
        let needed = needed.ok_or_else(cut_off)?;
        let in_memory = (needed / header.size as u64).saturating_mul(8);
        *held = held.saturating_add(needed).saturating_add(in_memory);
        limit.check(*held, file, "")?;
        let mut data = Vec::new();
        input.take(needed).read_to_end(&mut data).map_err(failed)?;
        if data.len() as u64 != needed {
            return Err(cut_off());
        }
        Ok(header.array(&data))
    }

    /// With rows and columns exchanged.
    pub(super) fn transposed(self) -> Self {
        let [rows, columns] = self.shape;
        let order = (0..columns).flat_map(|c| (0..rows).map(move |r| r * columns + c));
        let values = match self.values {
            Values::Integers(v) => Values::Integers(order.map(|place| v[place]).collect()),
            Values::Reals(v) => Values::Reals(order.map(|place| v[place]).collect()),
        };
        Self {
            shape: [columns, rows],
            values,
            ..self
        }
    }
}

/// What the header says.
struct Header {
    is_little: bool,
    /// Kind and bytes of a number: `f8`, `M8`.
    kind: Kind,
    size: usize,
    time_unit: Option<&'static str>,
    is_fortran: bool,
    shape: Vec<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Real,
    Signed,
    Unsigned,
}

impl Header {
    fn parse(text: &str, file: &str) -> Result<Self> {
        let damaged = || {
            let text = shown(text.trim());
            RecordingError::damaged(file, format!("a header of NumPy is not `{text}`"))
        };
        // Behind the key, its colon and blanks.
        let value = |key: &str| {
            let (_, rest) = text.split_once(&format!("'{key}'"))?;
            rest.trim_start().strip_prefix(':').map(str::trim_start)
        };
        let descr = value("descr").ok_or_else(damaged)?;
        let Some(descr) = descr
            .strip_prefix('\'')
            .and_then(|rest| rest.split('\'').next())
        else {
            return Err(RecordingError::unsupported(
                file,
                "an array of NumPy with named fields; save each field as an array of its own with `numpy.savez`",
            ));
        };
        let is_fortran = value("fortran_order")
            .ok_or_else(damaged)?
            .starts_with("True");
        let shape = value("shape").and_then(|rest| rest.strip_prefix('(')?.split(')').next());
        let shape = shape.ok_or_else(damaged)?.split(',').map(str::trim);
        let shape: Option<Vec<usize>> = shape
            .filter(|number| !number.is_empty())
            .map(|number| number.trim_end_matches('L').parse().ok())
            .collect();
        let shape = shape.ok_or_else(damaged)?;
        if shape.len() > 2 {
            return Err(RecordingError::unsupported(
                file,
                format!(
                    "an array of {} axes; a recording has rows of numbers, one a sample",
                    shape.len()
                ),
            ));
        }
        let (kind, size, time_unit) = numbers(descr).ok_or_else(|| {
            RecordingError::unsupported(
                file,
                format!(
                    "an array of `{}`, which are no numbers that are read; save it as float64",
                    shown(descr)
                ),
            )
        })?;
        Ok(Self {
            is_little: !descr.starts_with('>'),
            kind,
            size,
            time_unit,
            is_fortran,
            shape,
        })
    }

    /// Bytes of all numbers.
    fn bytes(&self) -> Option<u64> {
        let numbers = self
            .shape
            .iter()
            .try_fold(1_usize, |n, m| n.checked_mul(*m));
        let bytes = numbers?.checked_mul(self.size)?;
        u64::try_from(bytes).ok()
    }

    fn array(&self, data: &[u8]) -> Array {
        let numbers = data.chunks_exact(self.size).map(|bytes| self.number(bytes));
        let values = match self.kind {
            Kind::Real => Values::Reals(numbers.map(|(_, real)| real).collect()),
            _ => Values::Integers(numbers.map(|(integer, _)| integer).collect()),
        };
        let shape = match self.shape[..] {
            [] => [1, 1],
            [rows] => [rows, 1],
            [rows, columns] if self.is_fortran => [columns, rows],
            [rows, columns, ..] => [rows, columns],
        };
        let array = Array {
            shape,
            values,
            time_unit: self.time_unit,
        };
        match self.is_fortran && self.shape.len() == 2 {
            true => array.transposed(),
            false => array,
        }
    }

    /// A number, whole or real.
    fn number(&self, bytes: &[u8]) -> (i64, f64) {
        let mut low = [0; 8];
        for (place, byte) in bytes.iter().enumerate() {
            low[if self.is_little {
                place
            } else {
                self.size - 1 - place
            }] = *byte;
        }
        let raw = u64::from_le_bytes(low);
        match (self.kind, self.size) {
            (Kind::Real, 4) => (0, f64::from(f32::from_bits(raw as u32))),
            (Kind::Real, _) => (0, f64::from_bits(raw)),
            (Kind::Unsigned, _) => (i64::try_from(raw).unwrap_or(i64::MAX), 0.0),
            (Kind::Signed, size) => {
                let unused = 64 - 8 * size as u32;
                ((raw << unused).cast_signed() >> unused, 0.0)
            }
        }
    }
}

/// Kind, bytes and unit of time of numbers: `<f8`, `|u1`, `<M8[ns]`.
fn numbers(descr: &str) -> Option<(Kind, usize, Option<&'static str>)> {
    let plain = descr.trim_start_matches(['<', '>', '|', '=']);
    let (plain, unit) = match plain.split_once('[') {
        Some((plain, unit)) => {
            let units = ["s", "ms", "us", "ns"].into_iter();
            let unit = units
                .into_iter()
                .find(|u| unit.strip_suffix(']') == Some(*u));
            (plain, Some(unit?))
        }
        None => (plain, None),
    };
    Some(match (plain, unit) {
        ("f4", None) => (Kind::Real, 4, None),
        ("f8", None) => (Kind::Real, 8, None),
        ("b1" | "u1", None) => (Kind::Unsigned, 1, None),
        ("u2", None) => (Kind::Unsigned, 2, None),
        ("u4", None) => (Kind::Unsigned, 4, None),
        ("u8", None) => (Kind::Unsigned, 8, None),
        ("i1", None) => (Kind::Signed, 1, None),
        ("i2", None) => (Kind::Signed, 2, None),
        ("i4", None) => (Kind::Signed, 4, None),
        ("i8", None) => (Kind::Signed, 8, None),
        ("M8" | "m8", Some(unit)) => (Kind::Signed, 8, Some(unit)),
        _ => return None,
    })
}
