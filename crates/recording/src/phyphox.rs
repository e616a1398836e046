//! Exports of phyphox (iOS and Android): one CSV table a sensor, in a zip, in a folder or alone.
//!
//! Read first: `docs/formats.md`, section "phyphox". The first column is `Time (s)` of the experiment, the others have
//! their quantity and unit in the header; the unit tells the sensor. Excel's variants (semicolons or tabs, decimal
//! commas) are told by the first two lines.

use std::io::{Cursor, Read};

use crate::delimited::{Channel, DelimitedSource, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::false_stamps::FalseStamps;
use crate::merge::Merged;
use crate::metadata::Metadata;
use crate::recording::{EventSource, Opened};
use crate::stamp;
use crate::text::Input;

/// The first column of every table.
const TIME: &str = "Time (s)";
/// Bytes in which the header and the first row stand.
const HEAD: u64 = 4096;
/// Tables of an export that may have sensors, by the letters and digits of their names.
pub(crate) const TABLES: [&str; 9] = [
    "accelerometer",
    "gyroscope",
    "linearacceleration",
    "linearaccelerometer",
    "location",
    "magnetometer",
    "pressure",
    "rawdata",
    "data",
];

/// A table's name and its text.
pub(crate) type Table = (String, Input);

/// Whether a text begins with the header of a table.
pub(crate) fn recognises(text: &str) -> bool {
    let line = text.lines().next().unwrap_or_default();
    let rest = line
        .trim_start_matches(['"', '\u{feff}'])
        .strip_prefix(TIME);
    rest.is_some_and(|rest| rest.trim_start_matches('"').starts_with([',', ';', '\t']))
}

/// Opens one table.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    open_tables(vec![(file.to_owned(), Box::new(input))], file, metadata)
}

/// Opens the tables of an export as one recording.
pub(crate) fn open_tables(
    tables: Vec<Table>,
    file: &str,
    mut metadata: Metadata,
) -> Result<Opened> {
    let (mut sources, mut notes) = (Vec::new(), Vec::new());
    let mut sensors: Vec<SensorKind> = Vec::new();
    for (name, input) in tables {
        let (rows, layout) = table(&name, input)?;
        let kinds = layout.sensors();
        if kinds.is_empty() {
            notes.push(format!(
                "Left out: {}, of which nothing is used.",
                crate::error::shown(&name)
            ));
            continue;
        }
        if let Some(twice) = kinds.iter().find(|kind| sensors.contains(kind)) {
            let problem = format!("two tables have a {}; keep one of them", twice.name());
            return Err(RecordingError::unsupported(file, problem));
        }
        sensors.extend(kinds);
        let source: Box<dyn EventSource> = Box::new(DelimitedSource::new(rows, layout));
        sources.push(Box::new(FalseStamps::new(source)) as Box<dyn EventSource>);
    }
    sensors.sort_unstable_by_key(|kind| kind.order());
    RecordingError::check_sensors(file, &sensors)?;
    "phyphox".clone_into(&mut metadata.format);
    Ok(Opened {
        notes,
        ..Opened::new(metadata, sensors, Box::new(Merged::new(sources)))
    })
}

/// The rows of a table, and its sensors.
fn table(name: &str, mut input: Input) -> Result<(Rows, Layout)> {
    let mut head = Vec::new();
    let read = input.by_ref().take(HEAD).read_to_end(&mut head);
    read.map_err(|error| RecordingError::io(name, "read it", error))?;
    let text = String::from_utf8_lossy(&head).into_owned();
    let mut lines = text.lines();
    let (header, first) = (lines.next().unwrap_or_default(), lines.next());
    let delimiter = [b'\t', b';']
        .into_iter()
        .find(|c| header.contains(char::from(*c)));
    let delimiter = delimiter.unwrap_or(b',');
    let decimal_comma = delimiter != b',' && first.is_some_and(|row| row.contains(','));
    let input: Input = Box::new(Cursor::new(head).chain(input));
    let mut builder = csv::ReaderBuilder::new();
    let mut rows = Rows::new(name.to_owned(), builder.delimiter(delimiter), input, 0);
    let names: Vec<String> = rows
        .first()?
        .iter()
        .map(|cell| {
            String::from_utf8_lossy(cell)
                .trim_matches(['\u{feff}', '"', ' '])
                .to_owned()
        })
        .collect();
    if names.first().map(String::as_str) != Some(TIME) {
        return Err(RecordingError::MissingColumns {
            file: name.to_owned(),
            missing: format!("column {TIME}"),
            present: join(names.iter().map(String::as_str)),
            advice: "a table of phyphox begins with it".to_owned(),
        });
    }
    let layout = Layout {
        time: 0,
        time_form: TimeForm::Decimal(stamp::SECONDS),
        channels: channels(name, &names),
        decimal_comma,
        rows: None,
        names,
    };
    Ok((rows, layout))
}

/// The sensors of the columns of a table.
fn channels(table: &str, names: &[String]) -> Vec<Channel> {
    let table = table.to_lowercase();
    let quantities: Vec<(String, String)> = names.iter().map(|name| split(name)).collect();
    let axis = |kind: SensorKind, axis: &str| {
        let is_axis = |(quantity, unit): &(String, String)| {
            let is_linear = [quantity, &table]
                .iter()
                .any(|name| name.contains("linear"));
            let is_kind = match unit.as_str() {
                "rad/s" => kind == SensorKind::Gyroscope,
                "m/s^2" | "m/s\u{b2}" => kind == SensorKind::Accelerometer && !is_linear,
                "\u{b5}t" | "\u{3bc}t" => kind == SensorKind::Magnetometer,
                _ => false,
            };
            is_kind && (quantity == axis || quantity.ends_with(&format!(" {axis}")))
        };
        quantities.iter().position(is_axis)
    };
    let mut channels = Vec::new();
    for kind in [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
    ] {
        if let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|name| axis(kind, name)) {
            channels.push(Channel::new(kind, &[x, y, z]));
        }
    }
    let of = |wanted: &str, units: &[&str]| {
        let is = |(quantity, unit): &(String, String)| {
            quantity.ends_with(wanted) && units.contains(&unit.as_str())
        };
        quantities.iter().position(is)
    };
    if let Some(pressure) = of("pressure", &["hpa"]) {
        channels.push(Channel::new(SensorKind::Pressure, &[pressure]).times(100.0));
    }
    let degrees = ["\u{b0}", "deg"];
    if let (Some(latitude), Some(longitude)) = (of("latitude", &degrees), of("longitude", &degrees))
    {
        let mut position = Channel::new(SensorKind::GnssPosition, &[]);
        position.put(0, Some(latitude), 1_f64.to_radians());
        position.put(1, Some(longitude), 1_f64.to_radians());
        position.put(2, of("height", &["m"]), 1.0);
        channels.push(position);
    }
    channels
}

/// Quantity and unit of a header's cell, small: `Gyroscope x (rad/s)`.
fn split(name: &str) -> (String, String) {
    let name = name.to_lowercase();
    match name.split_once('(') {
        Some((quantity, unit)) => {
            let unit = unit.trim_end_matches(')').trim();
            (quantity.trim().to_owned(), unit.to_owned())
        }
        None => (name.trim().to_owned(), String::new()),
    }
}
