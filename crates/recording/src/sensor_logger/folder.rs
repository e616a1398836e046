//! Sensor Logger's folder: one CSV file a sensor, and `Metadata.csv`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::csv_tables::CsvTables;
use super::plain;
use crate::error::{RecordingError, Result};
use crate::open::{has_extension, stem};
use crate::text::{Input, open_file};

/// The tables of a folder.
pub(super) struct Folder {
    /// The folder as the user gave it.
    shown: String,
    /// Plain name of a table to its file and the name to show.
    tables: BTreeMap<String, (PathBuf, String)>,
}

impl Folder {
    /// Lists the CSV files of a folder.
    pub(super) fn list(path: &Path, shown: &str) -> Result<Self> {
        let failed = |error| RecordingError::io(shown, "list the folder", error);
        let mut tables = BTreeMap::new();
        for entry in std::fs::read_dir(path).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if has_extension(&path, "csv") {
                let name = path.file_name().unwrap_or_default();
                let name = name.to_string_lossy().into_owned();
                tables.insert(plain(&stem(&path)), (path, name));
            }
        }
        Ok(Self {
            shown: shown.to_owned(),
            tables,
        })
    }
}

impl CsvTables for Folder {
    fn has(&self, table: &str) -> bool {
        self.tables.contains_key(table)
    }

    fn names(&self) -> Vec<String> {
        self.tables.values().map(|(_, name)| name.clone()).collect()
    }

    fn input(&self, table: &str) -> Result<(String, Input)> {
        let Some((path, name)) = self.tables.get(table) else {
            return Err(RecordingError::unsupported(
                &self.shown,
                format!("there is no table `{table}` in it"),
            ));
        };
        let file = format!("{}/{name}", self.shown);
        let input = open_file(path, &file)?;
        Ok((file, Box::new(input)))
    }
}
