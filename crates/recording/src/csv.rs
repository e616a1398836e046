//! Our own CSV: one header line with a unit in every name, empty cells where there is no sample.
//!
//! Read first: `docs/formats.md`. The names are in [`VECTORS`] and below; any order of columns.

use std::io::{BufRead, BufReader, Read};

use crate::delimited::{Channel, DelimitedSource, Layout, TimeForm, csv_error};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::metadata::Metadata;
use crate::numbers;
use crate::recording::Opened;
use crate::stamp;
use crate::text::read_line;

/// Vector sensors: the parts of a column name before and after the axis letter.
pub(crate) const VECTORS: [(SensorKind, &str, &str); 8] = [
    (SensorKind::Gyroscope, "gyro_", "_rad_s"),
    (SensorKind::Accelerometer, "acc_", "_m_s2"),
    (SensorKind::Magnetometer, "mag_", "_ut"),
    (SensorKind::MagnetometerUncalibrated, "mag_raw_", "_ut"),
    (SensorKind::DeviceGyroscopeBias, "gyro_bias_", "_rad_s"),
    (SensorKind::Position, "pos_", "_m"),
    (SensorKind::Velocity, "vel_", "_m_s"),
    // x, y, z of the world frame: north, east, down.
    (SensorKind::ReferenceVelocity, "ref_vel_", "_m_s"),
];
pub(crate) const TIME_S: &str = "t_s";
pub(crate) const TIME_NS: &str = "t_ns";
pub(crate) const DEVICE_ORIENTATION: [&str; 4] =
    ["device_qw", "device_qx", "device_qy", "device_qz"];
pub(crate) const REFERENCE: [&str; 4] = ["ref_qw", "ref_qx", "ref_qy", "ref_qz"];
pub(crate) const SCORED: &str = "scored";
/// The columns of a position behind a prefix.
macro_rules! position {
    ($prefix:literal) => {
        &[
            concat!($prefix, "latitude_rad"),
            concat!($prefix, "longitude_rad"),
            concat!($prefix, "height_m"),
            concat!($prefix, "std_n_m"),
            concat!($prefix, "std_e_m"),
            concat!($prefix, "std_d_m"),
            concat!($prefix, "hdop"),
            concat!($prefix, "satellites"),
            concat!($prefix, "quality"),
        ]
    };
}

/// The columns of the other kinds, in the order of their [`numbers`]. The last ones of a kind may be
/// missing where its samples need not have them.
pub(crate) const ROWS: [(SensorKind, &[&str]); 9] = [
    (SensorKind::Pressure, &["pressure_pa"]),
    (
        SensorKind::CompassHeading,
        &["compass_heading_rad", "compass_std_rad"],
    ),
    (SensorKind::GnssPosition, position!("gnss_")),
    (
        SensorKind::GnssVelocity,
        &[
            "gnss_vel_n_m_s",
            "gnss_vel_e_m_s",
            "gnss_vel_d_m_s",
            "gnss_vel_std_n_m_s",
            "gnss_vel_std_e_m_s",
            "gnss_vel_std_d_m_s",
        ],
    ),
    (SensorKind::ForwardSpeed, &["forward_speed_m_s"]),
    (
        SensorKind::WaterVelocity,
        &["water_vel_forward_m_s", "water_vel_starboard_m_s"],
    ),
    (
        SensorKind::TrueHeading,
        &["true_heading_rad", "true_heading_std_rad"],
    ),
    (
        SensorKind::DeviceNavigation,
        &[
            "device_latitude_rad",
            "device_longitude_rad",
            "device_height_m",
            "device_std_n_m",
            "device_std_e_m",
            "device_std_d_m",
            "device_vel_n_m_s",
            "device_vel_e_m_s",
            "device_vel_d_m_s",
            "device_heading_std_rad",
            "device_validity",
        ],
    ),
    (SensorKind::ReferencePosition, position!("ref_")),
];

/// Longest comment or header line that is accepted, bytes.
const LONGEST_LINE: u64 = 1 << 20;

const ADVICE: &str = "name the columns as docs/formats.md says, e.g. t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,\
     acc_x_m_s2,..., or describe the file with a manifest (.toml)";

/// Column names of a vector sensor, x, y, z.
pub(crate) fn vector_columns(prefix: &str, suffix: &str) -> [String; 3] {
    ["x", "y", "z"].map(|axis| format!("{prefix}{axis}{suffix}"))
}

/// Opens the CSV behind `input`, reading its comments and its header.
pub(crate) fn open(
    input: impl Read + Send + 'static,
    file: &str,
    metadata: Metadata,
) -> Result<Opened> {
    let mut input = BufReader::with_capacity(1 << 16, input);
    let mut metadata = metadata;
    let lines_before = read_comments(&mut input, file, &mut metadata)?;
    let mut reader = csv::ReaderBuilder::new()
        .buffer_capacity(1 << 16)
        .from_reader(input);
    let headers = reader
        .byte_headers()
        .map_err(|error| csv_error(file, lines_before, &error))?;
    let names: Vec<String> = headers
        .iter()
        .map(|name| String::from_utf8_lossy(name.trim_ascii()).into_owned())
        .collect();
    if names.iter().all(String::is_empty) {
        return Err(RecordingError::empty(
            file,
            "no header line",
            "a header line with column names and rows of numbers",
        ));
    }
    let (layout, unused) = layout(names, file)?;
    metadata.format = "csv".to_owned();
    let notes = if unused.is_empty() {
        Vec::new()
    } else {
        vec![format!(
            "Columns not used: {}.",
            join(unused.iter().map(String::as_str))
        )]
    };
    Ok(Opened {
        metadata,
        sensors: layout.sensors(),
        source: Box::new(DelimitedSource::new(
            file.to_owned(),
            reader,
            layout,
            lines_before,
        )),
        notes,
        units_applied: false,
    })
}

/// Whether a header line looks like ours.
pub(crate) fn recognises(header: &str) -> bool {
    header
        .split(',')
        .map(|name| name.trim().trim_matches('"'))
        .any(|name| name == TIME_S || name == TIME_NS)
}

/// Reads the leading `# key: value` lines (and a byte order mark) into the metadata; returns how
/// many lines they were.
fn read_comments(input: &mut impl BufRead, file: &str, metadata: &mut Metadata) -> Result<u64> {
    let failed = |error| RecordingError::io(file, "read it", error);
    if input
        .fill_buf()
        .map_err(failed)?
        .starts_with(b"\xef\xbb\xbf")
    {
        input.consume(3);
    }
    let mut lines = 0;
    while input.fill_buf().map_err(failed)?.first() == Some(&b'#') {
        let mut line = Vec::new();
        read_line(input, LONGEST_LINE, &mut line, file)?;
        lines += 1;
        let line = String::from_utf8_lossy(&line);
        if let Some((key, value)) = line.trim_start_matches('#').split_once(':') {
            metadata
                .set(key.trim(), value.trim())
                .map_err(|problem| RecordingError::bad_line(file, lines, problem))?;
        }
    }
    Ok(lines)
}

/// The layout of a header, and the columns it does not use.
fn layout(names: Vec<String>, file: &str) -> Result<(Layout, Vec<String>)> {
    let mut header = Header {
        file,
        used: vec![false; names.len()],
        names: &names,
    };
    let (time, time_exponent) = match (header.find(TIME_NS)?, header.find(TIME_S)?) {
        (Some(column), _) => (column, stamp::NANOSECONDS),
        (None, Some(column)) => (column, stamp::SECONDS),
        (None, None) => return Err(header.missing(&[TIME_S.to_owned()])),
    };
    let mut channels = Vec::new();
    for (kind, prefix, suffix) in VECTORS {
        if let Some(columns) = header.group(&vector_columns(prefix, suffix))? {
            let factors = [1.0; 3];
            channels.push(Channel::Vector {
                kind,
                columns,
                factors,
                is_increment: false,
            });
        }
    }
    if let Some(columns) = header.group(&DEVICE_ORIENTATION.map(str::to_owned))? {
        let inverse = false;
        channels.push(Channel::DeviceOrientation { columns, inverse });
    }
    for (kind, names) in ROWS {
        if let Some(columns) = header.row(kind, names)? {
            let factors = [1.0; numbers::MOST];
            channels.push(Channel::Numbers {
                kind,
                columns,
                factors,
            });
        }
    }
    if let Some(columns) = header.group(&REFERENCE.map(str::to_owned))? {
        channels.push(Channel::Reference {
            columns,
            inverse: false,
            scored: header.find(SCORED)?,
        });
    }
    let unused = header.unused();
    let layout = Layout {
        names,
        time,
        time_form: TimeForm::Decimal(time_exponent),
        channels,
        decimal_comma: false,
        rows: None,
    };
    if layout.channels.is_empty() {
        return Err(RecordingError::MissingColumns {
            file: file.to_owned(),
            missing: "the columns of any sensor".to_owned(),
            present: join(layout.names.iter().map(String::as_str)),
            advice: ADVICE.to_owned(),
        });
    }
    if !layout.sensors().contains(&SensorKind::Gyroscope) {
        return Err(RecordingError::no_gyroscope(file, &layout.sensors()));
    }
    Ok((layout, unused))
}

struct Header<'a> {
    file: &'a str,
    names: &'a [String],
    used: Vec<bool>,
}

impl Header<'_> {
    fn find(&mut self, name: &str) -> Result<Option<usize>> {
        let mut places = self.names.iter().enumerate().filter(|(_, n)| *n == name);
        let first = places.next().map(|(place, _)| place);
        if places.next().is_some() {
            return Err(RecordingError::RepeatedColumn {
                file: self.file.to_owned(),
                column: name.to_owned(),
            });
        }
        if let Some(place) = first {
            self.used[place] = true;
        }
        Ok(first)
    }

    /// All columns of a sensor, or none; some of them is an error.
    fn group<const N: usize>(&mut self, names: &[String; N]) -> Result<Option<[usize; N]>> {
        let mut places = [0; N];
        let mut missing = Vec::new();
        for (place, name) in places.iter_mut().zip(names) {
            match self.find(name)? {
                Some(found) => *place = found,
                None => missing.push(name.clone()),
            }
        }
        match missing.len() {
            0 => Ok(Some(places)),
            n if n == N => Ok(None),
            _ => Err(self.missing(&missing)),
        }
    }

    /// The columns of a kind whose last numbers may be absent; `None` without any of them.
    fn row(
        &mut self,
        kind: SensorKind,
        names: &[&str],
    ) -> Result<Option<[Option<usize>; numbers::MOST]>> {
        let mut columns = [None; numbers::MOST];
        for (column, name) in columns.iter_mut().zip(names) {
            *column = self.find(name)?;
        }
        if columns.iter().all(Option::is_none) {
            return Ok(None);
        }
        let needed = names.iter().take(numbers::widths(kind).1).zip(&columns);
        let missing: Vec<String> = needed
            .filter(|(_, column)| column.is_none())
            .map(|(name, _)| (*name).to_owned())
            .collect();
        if missing.is_empty() {
            Ok(Some(columns))
        } else {
            Err(self.missing(&missing))
        }
    }

    fn missing(&self, missing: &[String]) -> RecordingError {
        let from_sensor_logger = self.names.iter().any(|name| name == "seconds_elapsed");
        RecordingError::MissingColumns {
            file: self.file.to_owned(),
            missing: format!("column {}", join(missing.iter().map(String::as_str))),
            present: join(self.names.iter().map(String::as_str)),
            advice: if from_sensor_logger {
                "this is one sensor of a Sensor Logger export: open its folder or zip".to_owned()
            } else {
                ADVICE.to_owned()
            },
        }
    }

    fn unused(&self) -> Vec<String> {
        self.names
            .iter()
            .zip(&self.used)
            .filter(|(_, used)| !**used)
            .map(|(name, _)| name.clone())
            .collect()
    }
}
