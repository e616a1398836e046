//! Numbers of one Parquet column, batch by batch.

use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;

/// Rows decoded at a time.
const BATCH: usize = 2048;

/// One column: its decoder in the current row group and its values of the current batch.
pub(super) struct Column {
    pub(super) place: usize,
    pub(super) decoder: Option<ColumnReader>,
    pub(super) values: Vec<f64>,
    levels: Vec<i16>,
}

/// Reads up to [`BATCH`] rows of every column; all must give the same number. `None` without decoders.
pub(super) fn read_rows(
    columns: &mut [Column],
) -> std::result::Result<Option<usize>, ParquetError> {
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
    pub(super) fn new(place: usize) -> Self {
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
