//! The form of a table of text: what separates its cells, where its rows begin, what its columns are called, and the
//! numbers in them.

use std::collections::VecDeque;
use std::io::{BufReader, Read};
use std::path::Path;

use super::names::are_units;
use crate::error::{RecordingError, Result};
use crate::limits::LINE;
use crate::numpy::open_table;
use crate::stamp;
use crate::text::{Input, read_line};

/// Lines in which the form is looked for.
const LINES: usize = 400;
/// Bytes in which it is looked for.
const HEAD_BYTES: usize = 1 << 20;
/// Bytes that are looked at. Turns, by which units are told, come within minutes.
const MOST_BYTES: u64 = 64 << 20;
/// Cells that are kept.
const MOST_CELLS: usize = 4_000_000;
/// What may separate cells; the first one of equals wins.
const DELIMITERS: [char; 5] = ['\t', ';', ',', '|', ' '];
/// With what lines of comments begin.
const COMMENTS: [char; 3] = ['#', '%', '/'];

/// How a table is written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Form {
    /// What separates cells; a blank stands for runs of them.
    pub(super) delimiter: char,
    /// Whether numbers are written `0,5`.
    pub(super) decimal_comma: bool,
    /// Lines before the header, without one before the first row.
    pub(super) skip_rows: usize,
    /// Whether a row names the columns.
    pub(super) header: bool,
    /// The line of the names where one of units is below it; both are among the lines before the first row then, and columns are
    /// known by number.
    pub(super) names_above: Option<usize>,
    /// What lines within the rows begin with that are none.
    pub(super) comment: Option<char>,
}

/// A column and its numbers.
#[derive(Debug, Clone)]
pub(super) struct Column {
    /// Its name in the header, without one empty.
    pub(super) name: String,
    /// One number a row; NaN where there is none.
    pub(super) numbers: Vec<f64>,
    /// Of cells with a date, a time of day or both: the seconds since 1970, since midnight; NaN of others.
    pub(super) dates: Vec<f64>,
    /// What stands in its first cell that is not empty.
    pub(super) first: String,
    /// Cells that are neither empty nor a number.
    pub(super) words: usize,
}

/// A table.
#[derive(Debug, Clone)]
pub(super) struct Table {
    pub(super) form: Form,
    pub(super) columns: Vec<Column>,
    /// Rows that were looked at.
    pub(super) rows: usize,
    /// Lines that have another number of cells.
    others: usize,
}

impl Table {
    /// Looks at a file.
    ///
    /// # Errors
    /// It cannot be read, or is no table of numbers.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let file = path.display().to_string();
        let no_table = || {
            RecordingError::not_a_recording(
                &file,
                "no table of numbers: fewer than three rows of the same number of cells",
            )
        };
        let mut head: Vec<String> = Vec::new();
        let mut lines = Lines::open(path, &file)?;
        let mut bytes = 0;
        while head.len() < LINES
            && bytes < HEAD_BYTES
            && let Some(line) = lines.next()?
        {
            bytes += line.len();
            head.push(line);
        }
        let form = Form::of(&head).ok_or_else(no_table)?;
        let mut table = Self::empty(form, &head);
        for line in &head[table.form.first_row()..] {
            table.add(line);
        }
        while table.columns.len() * table.rows < MOST_CELLS
            && let Some(line) = lines.next()?
        {
            table.add(&line);
        }
        if table.rows < 3 {
            return Err(no_table());
        }
        // The last line may be cut off.
        if table.others > 1 {
            let (others, cells) = (table.others, table.columns.len());
            return Err(RecordingError::unsupported(
                file,
                format!(
                    "{others} of {} rows do not have the {cells} cells of the others; rows of several kinds need a \
                     manifest with `rows`, as docs/formats.md says",
                    table.rows + others
                ),
            ));
        }
        Ok(table)
    }

    /// Without rows yet.
    fn empty(form: Form, head: &[String]) -> Self {
        let first = form.cells(&head[form.first_row()]);
        let names = match (form.names_above, form.header) {
            (Some(line), _) => {
                let named = form.cells(&head[line]).into_iter();
                let units = form.cells(&head[line + 1]).into_iter();
                named
                    .zip(units)
                    .map(|(name, unit)| with_unit(&name, &unit))
                    .collect()
            }
            (None, true) => form.cells(&head[form.skip_rows]),
            (None, false) => vec![String::new(); first.len()],
        };
        let column = |name: String| Column {
            name: name.trim_start_matches('\u{feff}').to_owned(),
            numbers: Vec::new(),
            dates: Vec::new(),
            first: String::new(),
            words: 0,
        };
        let columns = names.into_iter().map(column).collect();
        Self {
            form,
            columns,
            rows: 0,
            others: 0,
        }
    }

    /// Takes a row; lines that are none are passed over.
    fn add(&mut self, line: &str) {
        let is_comment = |c| line.starts_with::<char>(c);
        if line.trim().is_empty() || self.form.comment.is_some_and(is_comment) {
            return;
        }
        let cells = self.form.cells(line);
        if cells.len() != self.columns.len() {
            self.others += 1;
            return;
        }
        self.rows += 1;
        for (column, cell) in self.columns.iter_mut().zip(cells) {
            let number = self.form.number(&cell);
            column.numbers.push(number.unwrap_or(f64::NAN));
            let is_word = number.is_none() && !is_blank(&cell);
            column.words += usize::from(is_word);
            column
                .dates
                .push(if is_word { date(&cell) } else { f64::NAN });
            if column.first.is_empty() && !is_blank(&cell) {
                column.first = cell;
            }
        }
    }
}

/// A name and the unit below it as one name.
fn with_unit(name: &str, unit: &str) -> String {
    let unit = unit.trim_matches(|c| matches!(c, '[' | ']' | '(' | ')'));
    match unit {
        "" | "-" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    }
}

fn is_blank(cell: &str) -> bool {
    cell.is_empty() || cell.eq_ignore_ascii_case("nan") || cell.eq_ignore_ascii_case("na")
}

impl Form {
    /// Where the rows begin.
    fn first_row(&self) -> usize {
        self.skip_rows + usize::from(self.header)
    }

    /// The cells of a line.
    pub(super) fn cells(&self, line: &str) -> Vec<String> {
        let line = line.trim_end_matches(['\r', '\n']);
        if self.delimiter == ' ' {
            return line.split_whitespace().map(str::to_owned).collect();
        }
        if !line.contains('"') {
            let cells = line.split(self.delimiter);
            return cells.map(|cell| cell.trim().to_owned()).collect();
        }
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(self.delimiter as u8)
            .has_headers(false)
            .from_reader(line.as_bytes());
        let mut record = csv::StringRecord::new();
        match reader.read_record(&mut record) {
            Ok(true) => record.iter().map(|cell| cell.trim().to_owned()).collect(),
            _ => Vec::new(),
        }
    }

    fn number(&self, cell: &str) -> Option<f64> {
        if self.decimal_comma {
            cell.replace(',', ".").parse().ok()
        } else {
            cell.parse().ok()
        }
    }

    /// The form with the longest run of rows of numbers, at its end the last line.
    fn of(head: &[String]) -> Option<Self> {
        let mut best: Option<(usize, usize, Self)> = None;
        for delimiter in DELIMITERS {
            for decimal_comma in [false, true] {
                if decimal_comma && delimiter == ',' {
                    continue;
                }
                let Some((rows, cells, form)) = Self::with(head, delimiter, decimal_comma) else {
                    continue;
                };
                // Of forms with as many rows the one with more numbers; of equals the first.
                let is_better = best
                    .as_ref()
                    .is_none_or(|(r, c, _)| (rows, cells) > (*r, *c));
                if is_better {
                    best = Some((rows, cells, form));
                }
            }
        }
        best.map(|(_, _, form)| form)
    }

    /// The rows, their numbers in a row, and the form with this delimiter, if there is a table.
    fn with(head: &[String], delimiter: char, decimal_comma: bool) -> Option<(usize, usize, Self)> {
        let mut form = Self {
            delimiter,
            decimal_comma,
            skip_rows: 0,
            header: false,
            names_above: None,
            comment: None,
        };
        let body: Vec<(usize, Vec<String>)> = (head.iter().enumerate())
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with(COMMENTS))
            .map(|(place, line)| (place, form.cells(line)))
            .collect();
        let width = body.get(body.len() / 2)?.1.len();
        let is_row = |cells: &[String]| {
            cells.len() == width && cells.iter().any(|cell| form.number(cell).is_some())
        };
        let is_part = |cells: &[String]| {
            let told = cells.iter().filter(|cell| form.is_value(cell)).count();
            is_row(cells) && 2 * told > width
        };
        let from = body.iter().position(|(_, cells)| is_part(cells))?;
        let rows = body[from..].iter().filter(|(_, cells)| is_row(cells));
        let rows = rows.count();
        if width < 2 || rows < 3 {
            return None;
        }
        let numbers = body[from].1.iter().filter(|c| form.number(c).is_some());
        let numbers = numbers.count();
        let first = body[from].0;
        form.skip_rows = first;
        // The line before, which may begin as comments do, has as many names.
        let header = (0..first).rev().find(|line| !head[*line].trim().is_empty());
        if let Some(line) = header {
            let are_names = |names: &[String]| {
                names.len() == width
                    && names
                        .iter()
                        .any(|n| n.chars().any(|c| c.is_ascii_alphabetic()))
                    && names.iter().all(|n| form.number(n).is_none())
            };
            let names = form.cells(&head[line]);
            let above = line.checked_sub(1).filter(|above| {
                names.len() == width && are_units(&names) && are_names(&form.cells(&head[*above]))
            });
            if line + 1 == first && above.is_some() {
                form.names_above = above;
            } else if line + 1 == first && are_names(&names) {
                (form.header, form.skip_rows) = (true, line);
            }
        }
        let within = head[first..].iter();
        form.comment = within
            .filter_map(|line| line.chars().next())
            .find(|c| COMMENTS.contains(c));
        if form.comment.is_some() && head[form.skip_rows].starts_with(COMMENTS) {
            // The header would be passed over as well.
            (form.header, form.skip_rows) = (false, first);
        }
        Some((rows, numbers, form))
    }

    /// Whether a cell is a number, empty, or a date or time.
    fn is_value(&self, cell: &str) -> bool {
        is_blank(cell)
            || self.number(cell).is_some()
            || stamp::parse_date_time(cell.as_bytes()).is_some()
            || is_date(cell)
            || is_time_of_day(cell)
    }
}

/// The seconds of a date, of a time of day or of both.
fn date(cell: &str) -> f64 {
    let parse = |text: &str| stamp::parse_date_time(text.as_bytes());
    let whole = parse(cell).or_else(|| parse(&format!("{cell} 00:00:00")));
    let clock = || {
        is_time_of_day(cell)
            .then(|| parse(&format!("1970-01-01 {cell}")))
            .flatten()
    };
    whole.or_else(clock).map_or(f64::NAN, |ns| ns as f64 * 1e-9)
}

/// Whether a cell is a date alone.
pub(super) fn is_date(cell: &str) -> bool {
    stamp::parse_date_time(format!("{cell} 00:00:00").as_bytes()).is_some()
}

/// Whether a cell is a time of day alone.
pub(super) fn is_time_of_day(cell: &str) -> bool {
    cell.contains(':') && stamp::parse_date_time(format!("2000-01-01 {cell}").as_bytes()).is_some()
}

/// The lines of a file, none of them endless, up to the bytes that are looked at.
struct Lines {
    input: BufReader<std::io::Take<Input>>,
    file: String,
    line: Vec<u8>,
    /// Lines that were read ahead for the end of a quotation that did not come.
    ahead: VecDeque<String>,
}

/// A quotation in a cell goes over so many lines at most.
const QUOTED_LINES: usize = 8;

impl Lines {
    fn open(path: &Path, file: &str) -> Result<Self> {
        Ok(Self {
            input: BufReader::with_capacity(1 << 16, open_table(path, file)?.take(MOST_BYTES)),
            file: file.to_owned(),
            line: Vec::new(),
            ahead: VecDeque::new(),
        })
    }

    /// The next row: a line, or more of them where a quotation goes on; `None` at the end.
    fn next(&mut self) -> Result<Option<String>> {
        let Some(mut row) = self.line()? else {
            return Ok(None);
        };
        let is_open = |row: &str| row.matches('"').count() % 2 == 1;
        let mut more = Vec::new();
        while is_open(&row) && more.len() + 1 < QUOTED_LINES {
            let Some(line) = self.line()? else {
                break;
            };
            row.push_str(&line);
            more.push(line);
        }
        if is_open(&row) && !more.is_empty() {
            // No quotation, but the sign itself.
            row.truncate(row.len() - more.iter().map(String::len).sum::<usize>());
            more.into_iter()
                .rev()
                .for_each(|line| self.ahead.push_front(line));
        }
        Ok(Some(row))
    }

    /// The next line; `None` at the end.
    fn line(&mut self) -> Result<Option<String>> {
        if let Some(line) = self.ahead.pop_front() {
            return Ok(Some(line));
        }
        if !read_line(&mut self.input, LINE.most + 1, &mut self.line, &self.file)? {
            return Ok(None);
        }
        LINE.check(self.line.len() as u64, &self.file, "")?;
        if self.line.contains(&0) {
            let found = "binary data of an unknown kind";
            return Err(RecordingError::not_a_recording(&self.file, found));
        }
        Ok(Some(String::from_utf8_lossy(&self.line).into_owned()))
    }
}
