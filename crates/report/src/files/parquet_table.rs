//! A table of doubles as Parquet, written in groups of rows so that memory stays bounded.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use northing_recording::AtomicFile;
use parquet::basic::{Compression, ZstdLevel};
use parquet::data_type::{DataType, DoubleType};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

/// Rows that are held in memory.
const GROUP_ROWS: usize = 32_768;

/// A file being written.
pub(super) struct ParquetTable {
    file: String,
    output: SerializedFileWriter<AtomicFile>,
    columns: Vec<Vec<f64>>,
}

impl ParquetTable {
    /// Starts the file with columns of these names.
    pub(super) fn create<'a>(
        path: &Path,
        names: impl Iterator<Item = &'a str>,
        force: bool,
    ) -> Result<Self> {
        let file = path.display().to_string();
        let fields: Vec<String> = names
            .map(|name| format!("required double {name};"))
            .collect();
        let schema = parse_message_type(&format!("message estimates {{ {} }}", fields.join(" ")))?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_dictionary_enabled(false)
            .build();
        let output = AtomicFile::create(path, force)?;
        let output = SerializedFileWriter::new(output, Arc::new(schema), Arc::new(properties))
            .with_context(|| format!("{file}: cannot write it"))?;
        Ok(Self {
            file,
            output,
            columns: vec![Vec::new(); fields.len()],
        })
    }

    /// Adds a row, one number for each column.
    pub(super) fn row(&mut self, numbers: &[f64]) -> Result<()> {
        for (column, number) in self.columns.iter_mut().zip(numbers) {
            column.push(*number);
        }
        if self
            .columns
            .first()
            .is_some_and(|column| column.len() >= GROUP_ROWS)
        {
            self.write_group()
                .with_context(|| format!("{}: cannot write it", self.file))?;
        }
        Ok(())
    }

    fn write_group(&mut self) -> parquet::errors::Result<()> {
        write_group::<DoubleType>(&mut self.output, &self.columns)?;
        self.columns.iter_mut().for_each(Vec::clear);
        Ok(())
    }

    /// Completes the file.
    pub(super) fn finish(mut self) -> Result<()> {
        let file = std::mem::take(&mut self.file);
        let place = || format!("{file}: cannot write it");
        if self
            .columns
            .first()
            .is_some_and(|column| !column.is_empty())
        {
            self.write_group().with_context(place)?;
        }
        let output = self.output.into_inner().with_context(place)?;
        Ok(output.commit()?)
    }
}

/// Writes columns as one group of rows.
///
/// # Errors
/// What Parquet's writer says, such as a full disk.
pub fn write_group<D: DataType>(
    output: &mut SerializedFileWriter<AtomicFile>,
    columns: &[Vec<D::T>],
) -> parquet::errors::Result<()> {
    let mut group = output.next_row_group()?;
    for values in columns {
        if let Some(mut column) = group.next_column()? {
            column.typed::<D>().write_batch(values, None, None)?;
            column.close()?;
        }
    }
    group.close()?;
    Ok(())
}
