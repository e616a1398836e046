//! From tables to the text of a manifest.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::across::{Forces, check_rate, other_times};
use super::names::{self, Group, Quantity};
use super::orientation::Writing;
use super::table::Table;
use super::time::{Time, rate_of_rows};
use super::turns::{Series, Turns, median};
use super::vectors::{self, Vector};
use super::{Confidence, Found, Guess, Section, navigation, text};
use crate::error::{RecordingError, Result, join, shown};
use crate::metadata::BodyAxes;
use crate::open::{open_data_file, stem};
use crate::options::OpenOptions;
use crate::signed_axes::SignedAxes;

/// A draft of a manifest.
#[derive(Debug, Clone, Serialize)]
pub struct Draft {
    /// Its text.
    pub manifest: String,
    /// What was guessed.
    pub guesses: Vec<Guess>,
    /// Of each file the columns of which nothing is taken.
    pub left_out: Vec<(String, String)>,
    /// What stands out in the files and is not a column's: why a position is not taken, times that have nothing in common.
    pub remarks: Vec<String>,
}

/// Drafts one manifest for the files, whose names in it are relative to `folder` where they are in it. `rate_hz` is that
/// of rows without time stamps.
///
/// # Errors
/// A file cannot be read, is neither a table nor a recording, or nothing in the files is known.
pub fn draft(paths: &[PathBuf], folder: &Path, rate_hz: Option<f64>) -> Result<Draft> {
    let mut files = Vec::new();
    for path in paths {
        files.push(Described::read(path)?);
    }
    find_vectors(&mut files, rate_hz)?;
    let forces = Forces::of(&files);
    for (place, file) in files.iter_mut().enumerate() {
        file.find_rest(place, forces.as_ref());
    }
    let axes = forces.as_ref().and_then(|forces| forces.body_axes(&files));
    let mut remarks: Vec<String> = files.iter().flat_map(Described::remark).collect();
    let known = |file: &Described| file.table.is_none() || !file.sections.is_empty();
    if !files.iter().any(known) {
        let names = files
            .iter()
            .flat_map(|file| &file.table)
            .flat_map(Table::names);
        let names: Vec<String> = names.collect();
        return Err(RecordingError::unsupported(
            paths
                .first()
                .map_or(String::new(), |path| path.display().to_string()),
            format!(
                "a table, but neither the names of its columns nor their numbers tell a sensor: {}; {}write a manifest as \
                 docs/formats.md says",
                join(names.iter().map(String::as_str)),
                remarks
                    .iter()
                    .map(|remark| format!("{}; ", remark.trim_end_matches('.')))
                    .collect::<String>()
            ),
        ));
    }
    remarks.extend(other_times(&files));
    let mut guesses: Vec<Guess> = files.iter().flat_map(Described::guesses).collect();
    let of_force = guesses.iter().find(|guess| guess.key == "accelerometer");
    let axes = axes
        .zip(of_force)
        .map(|(axes, force)| guess_of(axes, force));
    guesses.extend(axes.clone());
    Ok(Draft {
        manifest: text::of(&files, axes.as_ref(), &remarks, folder),
        guesses,
        left_out: files.iter().filter_map(Described::left_out).collect(),
        remarks,
    })
}

/// Body axes that the accelerometer tells.
fn guess_of(axes: BodyAxes, force: &Guess) -> Guess {
    Guess {
        file: force.file.clone(),
        key: "body_axes",
        columns: force.columns.clone(),
        taken: format!("body_axes = \"{}\"", axes.name()),
        why: format!(
            "the accelerometer's z reads gravity with a minus sign, as where x, y, z point {}. For a phone on its face take \"phone\"; \
             where the file points gravity down, axes = \"-x,-y,-z\" for the accelerometer",
            axes.in_words()
        ),
        confidence: Confidence::Assumed,
    }
}

/// A file, and what was found in it.
pub(super) struct Described {
    pub(super) path: PathBuf,
    /// None of a file that describes itself.
    pub(super) table: Option<Table>,
    pub(super) time: Option<Time>,
    groups: Vec<Group>,
    pub(super) sections: Vec<Section>,
    /// Why columns that are called a position are not taken.
    problem: Option<String>,
    pub(super) is_down: bool,
}

impl Described {
    fn read(path: &Path) -> Result<Self> {
        let opened = open_data_file(path, None, &OpenOptions::default());
        let mut file = Self {
            path: path.to_owned(),
            table: None,
            time: None,
            groups: Vec::new(),
            sections: Vec::new(),
            problem: None,
            is_down: false,
        };
        let Err(error) = opened else {
            return Ok(file);
        };
        // What the readers say of what is no table is better.
        let table = match Table::read(path) {
            Err(few @ RecordingError::NotARecording { .. }) => {
                // What our own columns should be called is no help here.
                let is_of_columns = matches!(error, RecordingError::MissingColumns { .. });
                return Err(if is_of_columns { few } else { error });
            }
            table => table?,
        };
        file.groups = names::groups(&table.columns, &stem(path));
        let is_named = file
            .groups
            .iter()
            .any(|group| group.quantity != Quantity::Other);
        let singles = table.columns.iter().filter_map(|c| names::single(&c.name));
        let is_receiver = singles.clone().any(|one| one == names::Single::Latitude);
        if is_named || is_receiver {
            // Where names tell the sensors, others are none: a velocity may be as long as gravity.
            let is_known =
                |group: &Group| group.columns.len() == 4 || group.quantity != Quantity::Other;
            file.groups.retain(is_known);
        } else {
            file.groups = by_place(&table);
        }
        let is_inertial = !file.groups.is_empty();
        file.time = Some(Time::of(&table, is_inertial));
        file.table = Some(table);
        Ok(file)
    }

    /// The numbers of a group over time.
    pub(super) fn series(&self, columns: &[usize]) -> Series {
        match (&self.table, &self.time) {
            (Some(table), Some(time)) => vectors::series(table, columns, &time.seconds),
            _ => Vec::new(),
        }
    }

    /// Takes a vector as the sensor of a key, unless a file before has it.
    fn take(&mut self, key: &'static str, vector: Vector) {
        let table = self.table.as_ref();
        let names = |place: &usize| table.map_or(String::new(), |table| table.called(*place));
        let columns: Vec<String> = vector.columns.iter().map(names).collect();
        let mut lines = vec![
            format!("columns = [{}]", columns.join(", ")),
            format!("unit = \"{}\"", vector.unit),
        ];
        if let Some(scale) = vector.scale {
            lines.push(format!("scale = {scale:?}"));
        }
        if vector.axes != SignedAxes::AS_THEY_ARE {
            lines.push(format!("axes = \"{}\"", vector.axes));
        }
        self.sections.push(Section {
            key,
            lines,
            columns: vector.columns,
            found: vector.found,
        });
    }

    /// The orientations, and what a receiver or a barometer told.
    fn find_rest(&mut self, place: usize, forces: Option<&Forces>) {
        let Some(table) = &self.table else { return };
        let is_stamped = self.is_stamped();
        let seconds = self.time.as_ref().map_or(&[][..], |time| &time.seconds);
        // Rows of one file belong together, those of two by their stamps.
        let forces =
            forces.filter(|forces| forces.file == place || forces.is_stamped && is_stamped);
        let force = |row: usize| {
            let forces = forces?;
            match forces.file == place {
                true => Some(nalgebra::Vector3::from_fn(|axis, _| {
                    table.columns[forces.columns[axis]].numbers[row]
                })),
                false => forces.at(*seconds.get(row)?),
            }
        };
        let mut sections: Vec<Section> = Vec::new();
        for group in self.groups.iter().filter(|group| group.columns.len() == 4) {
            let key = match group.quantity {
                Quantity::Reference => "reference",
                _ => "device_orientation",
            };
            let rows = quaternions(table, &group.columns, &force);
            let Some(rows) = rows.filter(|_| sections.iter().all(|one| one.key != key)) else {
                continue;
            };
            let writing = Writing::of(&rows, group.is_ordered, forces.is_some());
            self.is_down |= writing.is_down;
            let names: Vec<String> = group.columns.iter().map(|c| table.called(*c)).collect();
            sections.push(Section {
                key,
                lines: vec![
                    format!("columns = [{}]", names.join(", ")),
                    format!("order = \"{}\"", writing.order),
                    format!("direction = \"{}\"", writing.direction),
                ],
                columns: group.columns.clone(),
                found: writing.found,
            });
        }
        let (found, problem) = navigation::sections(table, seconds);
        sections.extend(found);
        self.sections.extend(sections);
        self.problem = problem;
    }

    /// Whether its rows have stamps.
    pub(super) fn is_stamped(&self) -> bool {
        (self.time.as_ref()).is_some_and(|time| !time.columns.is_empty())
    }

    /// Why columns that are called a position are not taken.
    fn remark(&self) -> Option<String> {
        let problem = self.problem.as_ref()?;
        Some(format!("{}: {problem}.", self.name()))
    }

    pub(super) fn name(&self) -> String {
        shown(&self.path.file_name().unwrap_or_default().to_string_lossy())
    }

    /// The section of time, of a table.
    fn time_section(&self) -> Option<Section> {
        let (table, time) = (self.table.as_ref()?, self.time.as_ref()?);
        let names: Vec<String> = time.columns.iter().map(|c| table.called(*c)).collect();
        let lines = match (&names[..], time.rate_hz) {
            ([one], _) => vec![
                format!("column = {one}"),
                format!("unit = \"{}\"", time.unit),
            ],
            ([date, clock], _) => vec![format!("columns = [{date}, {clock}]")],
            (_, rate_hz) => vec![format!("rate_hz = {:?}", rate_hz.unwrap_or(1.0))],
        };
        Some(Section {
            key: "time",
            lines,
            columns: time.columns.clone(),
            found: time.found.clone(),
        })
    }

    /// All sections in the order in which they are written.
    pub(super) fn all(&self) -> impl Iterator<Item = Section> {
        self.time_section().into_iter().chain(self.sections.clone())
    }

    /// Whether nothing but times was found in it.
    pub(super) fn has_no_sensor(&self) -> bool {
        self.sections.is_empty()
    }

    fn guesses(&self) -> Vec<Guess> {
        let Some(table) = &self.table else {
            return Vec::new();
        };
        let guess = |section: Section| Guess {
            file: self.name(),
            key: section.key,
            columns: join(
                section
                    .columns
                    .iter()
                    .map(|c| table.shown(*c))
                    .collect::<Vec<_>>()
                    .iter()
                    .map(String::as_str),
            ),
            taken: section
                .lines
                .iter()
                .filter(|line| is_choice(line))
                .cloned()
                .collect::<Vec<_>>()
                .join(", "),
            why: section.found.why,
            confidence: section.found.confidence,
        };
        self.all().map(guess).collect()
    }

    pub(super) fn left_out(&self) -> Option<(String, String)> {
        let table = self.table.as_ref()?;
        let used: Vec<usize> = self.all().flat_map(|section| section.columns).collect();
        let unused = (0..table.columns.len()).filter(|column| !used.contains(column));
        let names: Vec<String> = unused.map(|column| table.shown(column)).collect();
        (!names.is_empty()).then(|| (self.name(), join(names.iter().map(String::as_str))))
    }
}

/// Whether a line chooses something beside columns.
fn is_choice(line: &str) -> bool {
    [
        "unit",
        "scale",
        "axes",
        "order",
        "direction",
        "rate_hz",
        "speed_unit",
        "course_unit",
        "height_unit",
        "accuracy_unit",
    ]
    .iter()
    .any(|key| line.split(' ').next() == Some(key))
}

/// Columns without known names among which sensors are looked for.
const MOST_COLUMNS: usize = 64;

/// Three or four columns side by side whose numbers could be a vector or a quaternion, of a table without known names.
fn by_place(table: &Table) -> Vec<Group> {
    let group = |columns: Vec<usize>| Group {
        quantity: Quantity::Other,
        columns,
        is_ordered: false,
        unit: None,
    };
    let is_number = |column: &usize| table.columns[*column].words == 0;
    let numbers = (0..table.columns.len()).filter(is_number);
    let numbers: Vec<usize> = numbers.take(MOST_COLUMNS).collect();
    let mut groups = Vec::new();
    let mut at = 0;
    while at < numbers.len() {
        let four = numbers.get(at..at + 4);
        if let Some(four) = four.filter(|four| quaternions(table, four, &|_| None).is_some()) {
            groups.push(group(four.to_vec()));
            at += 4;
        } else {
            groups.extend(numbers.get(at..at + 3).map(|three| group(three.to_vec())));
            at += 1;
        }
    }
    groups
}

/// The rows of four columns with a quaternion of length 1, beside the specific force of the row where that is known.
fn quaternions(
    table: &Table,
    columns: &[usize],
    force: &dyn Fn(usize) -> Option<nalgebra::Vector3<f64>>,
) -> Option<Vec<([f64; 4], nalgebra::Vector3<f64>)>> {
    let number = |column: usize, row: usize| table.columns[column].numbers[row];
    let four = |row: usize| [0, 1, 2, 3].map(|i| number(columns[i], row));
    let mut off: Vec<f64> = (0..table.rows)
        .map(|row| (four(row).iter().map(|q| q * q).sum::<f64>().sqrt() - 1.0).abs())
        .collect();
    let is_unit = median(&mut off) < 0.02;
    let rows = (0..table.rows).filter_map(|row| {
        let force = force(row)?;
        let q = four(row);
        let is_whole = force.iter().chain(&q).all(|x| x.is_finite());
        (is_whole && q.iter().any(|x| x.abs() > 0.1)).then_some((q, force))
    });
    is_unit.then(|| rows.collect())
}

/// Finds the accelerometer, the magnetometers and the gyroscope among the groups of all files.
fn find_vectors(files: &mut [Described], rate_hz: Option<f64>) -> Result<()> {
    use Quantity as Is;
    let forces = pick(
        files,
        &[Is::Accelerometer, Is::LinearAcceleration, Is::Other],
        |file, group| vectors::accelerometer(group, &file.series(&group.columns)),
    );
    if let Some((place, vector)) = &forces {
        files[*place].take("accelerometer", vector.clone());
    }
    let is_only = files.len() == 1;
    let mut is_told_used = false;
    for file in files.iter_mut() {
        is_told_used |= file.settle_rate(rate_hz, is_only)?;
    }
    check_rate(files, rate_hz.filter(|_| !is_told_used))?;
    let series = forces
        .as_ref()
        .map(|(place, vector)| files[*place].series(&vector.columns));
    let gyroscope = pick(files, &[Is::Gyroscope, Is::Other], |file, group| {
        let rates = file.series(&group.columns);
        let vector = vectors::gyroscope(group, &rates, series.as_ref());
        // Without a name only the turns of gravity tell a gyroscope.
        let is_known =
            group.quantity == Is::Gyroscope || vector.found.confidence != Confidence::Assumed;
        (is_known && rates.len() > 2).then_some(vector)
    });
    if let Some((place, vector)) = gyroscope {
        files[place].take("gyroscope", vector);
    }
    for (key, is) in [
        ("magnetometer", &[Is::Magnetometer, Is::Other][..]),
        ("magnetometer_uncalibrated", &[Is::MagnetometerUncalibrated]),
    ] {
        let found = pick(files, is, |file, group| {
            vectors::magnetometer(group, &file.series(&group.columns))
        });
        if let Some((place, vector)) = found {
            files[place].take(key, vector);
        }
    }
    Ok(())
}

/// The first group of these quantities, in their order, that `look` takes for one.
fn pick(
    files: &[Described],
    quantities: &[Quantity],
    look: impl Fn(&Described, &Group) -> Option<Vector>,
) -> Option<(usize, Vector)> {
    for quantity in quantities {
        for (place, file) in files.iter().enumerate() {
            let is_free = |group: &&Group| {
                let taken = file.sections.iter().flat_map(|section| &section.columns);
                let time = file.time.iter().flat_map(|time| &time.columns);
                let mut taken = taken.chain(time);
                group.columns.len() == 3 && !taken.any(|column| group.columns.contains(column))
            };
            let of_kind = |group: &&Group| group.quantity == *quantity;
            let groups = file.groups.iter().filter(of_kind).filter(is_free);
            let mut found = groups.filter_map(|group| look(file, group));
            let found = match quantity {
                Quantity::Other => found.min_by(|a, b| a.misfit.total_cmp(&b.misfit)),
                _ => found.next(),
            };
            if let Some(vector) = found {
                return Some((place, vector));
            }
        }
    }
    None
}

impl Described {
    /// The rate at which gravity turns as one of the groups says, the gyroscope.
    fn rate_by_turns(&self) -> Option<(f64, Found)> {
        let is_force = |one: &&Section| one.key == "accelerometer";
        let columns = &self.sections.iter().find(is_force)?.columns;
        let forces = self.series(columns);
        let is_free = |group: &&Group| !group.columns.iter().any(|column| columns.contains(column));
        let is_gyroscope = |group: &&Group| group.quantity == Quantity::Gyroscope;
        let named = self.groups.iter().find(is_gyroscope);
        let candidates = match named {
            Some(group) => vec![group],
            None => self
                .groups
                .iter()
                .filter(|group| group.columns.len() == 3)
                .filter(is_free)
                .collect(),
        };
        let fits = candidates.into_iter().filter_map(|group| {
            let fit =
                Turns::of(&self.series(&group.columns), &forces).fit(SignedAxes::AS_THEY_ARE)?;
            fit.tells().then_some((group, fit))
        });
        let (group, fit) = fits.max_by(|(_, a), (_, b)| a.correlation.total_cmp(&b.correlation))?;
        let without = self
            .time
            .as_ref()
            .map_or("", |time| time.found.why.as_str());
        rate_of_rows(without, group.unit, fit)
    }

    /// The rate of rows without time stamps, or with stamps that are cut off: the user's, or that at which gravity turns as the
    /// gyroscope says. Stamps of one file alone are given up without being asked: rows that are counted begin at 0. Says whether
    /// the user's was taken.
    fn settle_rate(&mut self, told_hz: Option<f64>, is_only: bool) -> Result<bool> {
        let is_without = |time: &Time| time.columns.is_empty();
        let is_named = |group: &Group| group.quantity != Quantity::Other;
        let is_sensor = self.groups.iter().any(is_named) || !self.sections.is_empty();
        let (Some(time), Some(table), true) = (&self.time, &self.table, is_sensor) else {
            return Ok(false);
        };
        if !is_without(time) {
            let counted = match told_hz.filter(|_| time.repeats()) {
                Some(rate_hz) => {
                    let why = "the rate that was told; the times repeat from row to row";
                    Some(time.with_rate(rate_hz, Found::new(why, Confidence::Certain)))
                }
                None => time.counted(table).filter(|_| is_only && told_hz.is_none()),
            };
            let is_counted = counted.is_some();
            self.time = counted.or(self.time.take());
            return Ok(is_counted && told_hz.is_some());
        }
        let found = match told_hz {
            Some(rate) => Some((
                rate,
                Found::new("the rate that was told", Confidence::Certain),
            )),
            None => self.rate_by_turns(),
        };
        let Some((rate_hz, found)) = found else {
            let without = self
                .time
                .as_ref()
                .map_or("", |time| time.found.why.as_str());
            return Err(RecordingError::unsupported(
                self.path.display().to_string(),
                format!(
                    "{without}, and there are no turns of gravity that tell the rate of its rows; say it: `northing describe FILE --rate HZ`"
                ),
            ));
        };
        if let Some(time) = &mut self.time {
            time.seconds.iter_mut().for_each(|t| *t /= rate_hz);
            (time.rate_hz, time.found) = (Some(rate_hz), found);
        }
        Ok(told_hz.is_some())
    }
}
