//! The table as Parquet: doubles, whole numbers that may be missing, texts.

use std::path::Path;

use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};

use super::super::LocalPlane;
use super::row::{Cell, Type, cells, columns};
use super::{TargetInstant, TargetOutput};
use crate::atomic_file::AtomicFile;
use crate::error::Result;
use crate::parquet_table::{begin, failed};

/// Rows of a row group: what is held in memory.
const GROUP_ROWS: usize = 16_384;

/// Values of one column that wait to be written.
enum Column {
    Numbers(Vec<f64>),
    Wholes(Vec<i64>, Vec<i16>),
    Texts(Vec<ByteArray>),
}

pub(super) struct Table {
    file: String,
    output: SerializedFileWriter<AtomicFile>,
    plane: Option<LocalPlane>,
    columns: Vec<Column>,
    rows: usize,
}

impl Table {
    pub(super) fn create(path: &Path, plane: Option<LocalPlane>, force: bool) -> Result<Self> {
        let file = path.display().to_string();
        let columns = columns(plane.as_ref());
        let field = |(name, kind): &(&str, Type)| match kind {
            Type::Number => format!("required double {name};"),
            Type::Whole => format!("optional int64 {name};"),
            Type::Text => format!("required binary {name} (UTF8);"),
        };
        let fields: Vec<String> = columns.iter().map(field).collect();
        let message = format!("message tracks {{ {} }}", fields.join(" "));
        let output = begin(path, &message, true, force)?;
        Ok(Self {
            file,
            output,
            plane,
            columns: columns.iter().map(|(_, kind)| empty(*kind)).collect(),
            rows: 0,
        })
    }

    fn write_group(&mut self) -> std::result::Result<(), ParquetError> {
        if self.rows == 0 {
            return Ok(());
        }
        let mut group = self.output.next_row_group()?;
        for column in &mut self.columns {
            match column {
                Column::Numbers(values) => {
                    write::<DoubleType>(&mut group, values, None)?;
                    values.clear();
                }
                Column::Wholes(values, there) => {
                    write::<Int64Type>(&mut group, values, Some(there))?;
                    values.clear();
                    there.clear();
                }
                Column::Texts(values) => {
                    write::<ByteArrayType>(&mut group, values, None)?;
                    values.clear();
                }
            }
        }
        self.rows = 0;
        group.close().map(drop)
    }
}

fn empty(kind: Type) -> Column {
    match kind {
        Type::Number => Column::Numbers(Vec::new()),
        Type::Whole => Column::Wholes(Vec::new(), Vec::new()),
        Type::Text => Column::Texts(Vec::new()),
    }
}

/// Writes the next column of a group; `there` tells of each row whether it has a value.
fn write<D: DataType>(
    group: &mut SerializedRowGroupWriter<'_, AtomicFile>,
    values: &[D::T],
    there: Option<&[i16]>,
) -> std::result::Result<(), ParquetError> {
    if let Some(mut column) = group.next_column()? {
        column.typed::<D>().write_batch(values, there, None)?;
        column.close()?;
    }
    Ok(())
}

impl TargetOutput for Table {
    fn instant(&mut self, instant: &TargetInstant) -> Result<()> {
        for target in &instant.targets {
            let row = cells(instant.time_ns, target, self.plane.as_ref());
            for (column, cell) in self.columns.iter_mut().zip(row) {
                match (column, cell) {
                    (Column::Numbers(values), Cell::Number(number)) => values.push(number),
                    (Column::Numbers(values), Cell::Time(time_ns)) => {
                        values.push(time_ns as f64 * 1e-9);
                    }
                    (Column::Wholes(values, there), Cell::Whole(number)) => {
                        there.push(i16::from(number.is_some()));
                        values.extend(number);
                    }
                    (Column::Texts(values), Cell::Text(text)) => values.push(text.into()),
                    _ => {}
                }
            }
            self.rows += 1;
        }
        if self.rows >= GROUP_ROWS {
            self.write_group()
                .map_err(|error| failed(&self.file, &error))?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        let file = std::mem::take(&mut self.file);
        self.write_group().map_err(|error| failed(&file, &error))?;
        let output = self.output.into_inner();
        output.map_err(|error| failed(&file, &error))?.commit()
    }
}
