//! The text of a manifest: its keys, and the reasons as comments.

use std::path::Path;

use super::Guess;
use super::draft::Described;
use super::table::Table;
use crate::error::shown;

impl Table {
    /// A column as a manifest names it.
    pub(super) fn called(&self, place: usize) -> String {
        let name = &self.columns[place].name;
        let same = self.columns.iter().filter(|other| other.name == *name);
        if self.form.header && !name.is_empty() && same.count() == 1 {
            toml::Value::String(name.clone()).to_string()
        } else {
            (place + 1).to_string()
        }
    }

    /// A column as people call it.
    pub(super) fn shown(&self, place: usize) -> String {
        match self.columns[place].name.as_str() {
            "" => format!("{}", place + 1),
            name => shown(name),
        }
    }

    pub(super) fn names(&self) -> Vec<String> {
        (0..self.columns.len())
            .map(|place| self.shown(place))
            .collect()
    }
}

/// The manifest.
pub(super) fn of(
    files: &[Described],
    axes: Option<&Guess>,
    remarks: &[String],
    folder: &Path,
) -> String {
    let mut text = String::from(
        "# A draft: what the columns are was guessed from their names and numbers. Check what is only likely or assumed.\n\n",
    );
    for remark in remarks {
        text.push_str(&format!("# {}\n\n", remark.replace('\n', " ")));
    }
    let is_down = files.iter().any(|file| file.is_down);
    if is_down {
        text.push_str("world_frame = \"ned\"   # by the quaternions: z is down\n\n");
    }
    let has_sensors = files.iter().any(|file| {
        let mut sections = file.sections.iter();
        sections.any(|one| ["gyroscope", "accelerometer"].contains(&one.key))
    });
    if let Some(axes) = axes {
        let (sure, why) = (axes.confidence.name(), &axes.why);
        text.push_str(&format!("# {sure}: {why}\n{}\n\n", axes.taken));
    } else if has_sensors && !is_down {
        text.push_str(
            "# body_axes = \"phone\"   # x, y, z: right, forward, up; \"flu\": forward, left, up; \"frd\": forward, right, down\n\n",
        );
    }
    let prefix = if files.len() > 1 { "source." } else { "" };
    for file in files {
        if files.len() > 1 && file.table.is_some() && file.has_no_sensor() {
            let named = shown(&named_in(&file.path, folder));
            let columns = file
                .left_out()
                .map_or(String::new(), |(_, names)| format!(" in {names}"));
            text.push_str(&format!(
                "# {named} is left out: no sensor was recognised{columns}.\n\n"
            ));
            continue;
        }
        if files.len() > 1 {
            text.push_str("[[source]]\n");
        }
        let named = named_in(&file.path, folder);
        text.push_str(&format!("file = {}\n", toml::Value::String(named)));
        let Some(table) = &file.table else {
            text.push_str("# It describes itself.\n\n");
            continue;
        };
        form(table, &mut text);
        for section in file.all() {
            let found = &section.found;
            text.push_str(&format!(
                "\n[{prefix}{}]\n# {}: {}\n{}\n",
                section.key,
                found.confidence.name(),
                found.why,
                section.lines.join("\n")
            ));
        }
        if let Some((_, names)) = file.left_out() {
            text.push_str(&format!("\n# Columns not used: {names}\n"));
        }
        text.push('\n');
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// How the table is written, where that is not the rule.
fn form(table: &Table, text: &mut String) {
    let form = &table.form;
    if form.delimiter != ',' {
        let delimiter = toml::Value::String(form.delimiter.to_string());
        text.push_str(&format!("delimiter = {delimiter}\n"));
    }
    if form.decimal_comma {
        text.push_str("decimal_comma = true\n");
    }
    if form.skip_rows > 0 {
        text.push_str(&format!("skip_rows = {}\n", form.skip_rows));
    }
    if !form.header {
        text.push_str("header = false\n");
    }
    if let Some(comment) = form.comment {
        text.push_str(&format!("comment = \"{comment}\"\n"));
    }
}

/// The name of a file in a manifest in `folder`.
fn named_in(path: &Path, folder: &Path) -> String {
    let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let folder = match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    };
    let (path, folder) = (whole(path), whole(folder));
    path.strip_prefix(&folder)
        .unwrap_or(&path)
        .display()
        .to_string()
}
