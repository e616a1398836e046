//! A table of doubles as Parquet, written in groups of rows so that memory stays bounded.

use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, ZstdLevel};
use parquet::data_type::{DataType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};

/// Rows that are held in memory.
const GROUP_ROWS: usize = 32_768;

/// A file being written.
pub struct ParquetTable {
    file: String,
    output: SerializedFileWriter<AtomicFile>,
    columns: Vec<Vec<f64>>,
}

impl ParquetTable {
    /// Starts the file with columns of these names.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create<'a>(
        path: &Path,
        names: impl Iterator<Item = &'a str>,
        force: bool,
    ) -> Result<Self> {
        let file = path.display().to_string();
        let fields: Vec<String> = names
            .map(|name| format!("required double {name};"))
            .collect();
        let message = format!("message estimates {{ {} }}", fields.join(" "));
        Ok(Self {
            file,
            output: begin(path, &message, false, force)?,
            columns: vec![Vec::new(); fields.len()],
        })
    }

    /// Adds a row, one number for each column.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn row(&mut self, numbers: &[f64]) -> Result<()> {
        for (column, number) in self.columns.iter_mut().zip(numbers) {
            column.push(*number);
        }
        if self
            .columns
            .first()
            .is_some_and(|column| column.len() >= GROUP_ROWS)
        {
            self.write_group()
                .map_err(|error| failed(&self.file, &error))?;
        }
        Ok(())
    }

    fn write_group(&mut self) -> std::result::Result<(), ParquetError> {
        write_group::<DoubleType>(&mut self.output, &self.columns)?;
        self.columns.iter_mut().for_each(Vec::clear);
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<()> {
        let file = std::mem::take(&mut self.file);
        let failed = |error| failed(&file, &error);
        if self
            .columns
            .first()
            .is_some_and(|column| !column.is_empty())
        {
            self.write_group().map_err(failed)?;
        }
        self.output.into_inner().map_err(failed)?.commit()
    }
}

/// Starts a file whose columns are those of `message`; values that repeat are told once where it has a dictionary.
pub(crate) fn begin(
    path: &Path,
    message: &str,
    has_dictionary: bool,
    force: bool,
) -> Result<SerializedFileWriter<AtomicFile>> {
    let failed = |error| failed(&path.display().to_string(), &error);
    let schema = parse_message_type(message).map_err(failed)?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(has_dictionary)
        .build();
    let output = AtomicFile::create(path, force)?;
    SerializedFileWriter::new(output, Arc::new(schema), Arc::new(properties)).map_err(failed)
}

/// What a writer of Parquet says, as an error of its file.
pub(crate) fn failed(file: &str, error: &ParquetError) -> RecordingError {
    RecordingError::io(file, "write it", std::io::Error::other(error.to_string()))
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
