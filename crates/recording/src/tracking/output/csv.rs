//! The table as text: every number with all its digits, nothing where there is none.

use std::path::Path;

use super::super::LocalPlane;
use super::row::{Cell, cells, columns};
use super::{TargetInstant, TargetOutput};
use crate::atomic_file::AtomicFile;
use crate::error::Result;
use crate::stamp::format_s;

pub(super) struct Table {
    out: AtomicFile,
    plane: Option<LocalPlane>,
}

impl Table {
    pub(super) fn create(path: &Path, plane: Option<LocalPlane>, force: bool) -> Result<Self> {
        let mut out = AtomicFile::create(path, force)?;
        let names: Vec<&str> = columns(plane.as_ref())
            .iter()
            .map(|(name, _)| *name)
            .collect();
        out.print(format_args!("{}\n", names.join(",")))?;
        Ok(Self { out, plane })
    }
}

impl TargetOutput for Table {
    fn instant(&mut self, instant: &TargetInstant) -> Result<()> {
        for target in &instant.targets {
            let row = cells(instant.time_ns, target, self.plane.as_ref());
            let cells: Vec<String> = row.iter().map(text).collect();
            self.out.print(format_args!("{}\n", cells.join(",")))?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.out.commit()
    }
}

fn text(cell: &Cell<'_>) -> String {
    match cell {
        Cell::Time(time_ns) => format_s(*time_ns),
        Cell::Number(number) if number.is_nan() => String::new(),
        Cell::Number(number) => number.to_string(),
        Cell::Whole(number) => number.map_or(String::new(), |number| number.to_string()),
        Cell::Text(text) if text.contains([',', '"', '\n', '\r']) => {
            format!("\"{}\"", text.replace('"', "\"\""))
        }
        Cell::Text(text) => (*text).to_owned(),
    }
}
