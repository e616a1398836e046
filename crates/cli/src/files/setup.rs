//! The options of a run that a report of the lab carries.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use northing_evaluation::attitude::RunOptions;
use northing_evaluation::attitude::setup::RunSetup;
use northing_report::setup_of;

/// Reads them.
///
/// # Errors
/// The file cannot be read, carries no setup, or one that no run can have.
pub(crate) fn read(path: &Path) -> Result<RunOptions> {
    let file = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("{file}: cannot read it"))?;
    let setup = setup_of(&text).and_then(|text| RunSetup::parse(&text));
    let setup = setup.map_err(|problem| anyhow!("{file}: {problem}"))?;
    setup.options().with_context(|| file.to_string())
}
