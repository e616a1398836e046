//! Our own CSV: one header line with a unit in every name, empty cells where there is no sample.
//!
//! Read first: `docs/formats.md`. The names are in [`COLUMNS`]; any order of columns.

use std::io::{BufRead, BufReader};

use crate::delimited::{Channel, DelimitedSource, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::limits::{COMMENTS, LINE};
use crate::metadata::Metadata;
use crate::numbers::{ColumnsOfKinds, widths};
use crate::recording::Opened;
use crate::stamp;
use crate::text::{Input, read_line};

pub(crate) const TIME_S: &str = "t_s";
pub(crate) const TIME_NS: &str = "t_ns";
/// Beside a reference: whether it is scored.
pub(crate) const SCORED: &str = "scored";

/// The columns of each kind, in the order of its [`numbers`]. The last ones of a kind may be missing where its
/// samples need not have them.
pub(crate) const COLUMNS: ColumnsOfKinds = [
    (
        SensorKind::Gyroscope,
        "gyro_x_rad_s gyro_y_rad_s gyro_z_rad_s",
    ),
    (
        SensorKind::Accelerometer,
        "acc_x_m_s2 acc_y_m_s2 acc_z_m_s2",
    ),
    (SensorKind::Magnetometer, "mag_x_ut mag_y_ut mag_z_ut"),
    (
        SensorKind::MagnetometerUncalibrated,
        "mag_raw_x_ut mag_raw_y_ut mag_raw_z_ut",
    ),
    (
        SensorKind::DeviceGyroscopeBias,
        "gyro_bias_x_rad_s gyro_bias_y_rad_s gyro_bias_z_rad_s",
    ),
    (SensorKind::Position, "pos_x_m pos_y_m pos_z_m"),
    (SensorKind::Velocity, "vel_x_m_s vel_y_m_s vel_z_m_s"),
    // x, y, z of the world frame: north, east, down.
    (
        SensorKind::ReferenceVelocity,
        "ref_vel_x_m_s ref_vel_y_m_s ref_vel_z_m_s",
    ),
    (
        SensorKind::DeviceOrientation,
        "device_qw device_qx device_qy device_qz",
    ),
    (SensorKind::Pressure, "pressure_pa"),
    (
        SensorKind::CompassHeading,
        "compass_heading_rad compass_std_rad",
    ),
    (
        SensorKind::GnssPosition,
        "gnss_latitude_rad gnss_longitude_rad gnss_height_m gnss_std_n_m gnss_std_e_m \
         gnss_std_d_m gnss_hdop gnss_satellites gnss_quality",
    ),
    (
        SensorKind::GnssVelocity,
        "gnss_vel_n_m_s gnss_vel_e_m_s gnss_vel_d_m_s gnss_vel_std_n_m_s gnss_vel_std_e_m_s \
         gnss_vel_std_d_m_s",
    ),
    (SensorKind::ForwardSpeed, "forward_speed_m_s"),
    (
        SensorKind::WaterVelocity,
        "water_vel_forward_m_s water_vel_starboard_m_s",
    ),
    (
        SensorKind::TrueHeading,
        "true_heading_rad true_heading_std_rad",
    ),
    (
        SensorKind::DeviceNavigation,
        "device_latitude_rad device_longitude_rad device_height_m device_std_n_m \
         device_std_e_m device_std_d_m device_vel_n_m_s device_vel_e_m_s device_vel_d_m_s \
         device_heading_std_rad device_validity",
    ),
    (
        SensorKind::ReferencePosition,
        "ref_latitude_rad ref_longitude_rad ref_height_m ref_std_n_m ref_std_e_m ref_std_d_m \
         ref_hdop ref_satellites ref_quality",
    ),
    (SensorKind::Reference, "ref_qw ref_qx ref_qy ref_qz"),
];

const ADVICE: &str = "name the columns as docs/formats.md says, e.g. t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,\
     acc_x_m_s2,..., or describe the file with a manifest (.toml), which `northing describe` drafts";

/// Opens the CSV behind `input`, reading its comments and its header.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let mut input = BufReader::with_capacity(1 << 16, input);
    let mut metadata = metadata;
    let lines_before = read_comments(&mut input, file, &mut metadata)?;
    let builder = &mut csv::ReaderBuilder::new();
    let mut rows = Rows::new(file.to_owned(), builder, Box::new(input), lines_before);
    let header = rows.first()?;
    let names: Vec<String> = header
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
    let sensors = layout.sensors();
    let source = DelimitedSource::new(rows, layout);
    let mut opened = Opened::new(metadata, sensors, Box::new(source));
    if !unused.is_empty() {
        let names = join(unused.iter().map(String::as_str));
        opened.notes.push(format!("Columns not used: {names}."));
    }
    Ok(opened)
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
pub(crate) fn read_comments(
    input: &mut impl BufRead,
    file: &str,
    metadata: &mut Metadata,
) -> Result<u64> {
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
        read_line(input, LINE.most + 1, &mut line, file)?;
        lines += 1;
        COMMENTS.check(lines, file, "")?;
        LINE.check(line.len() as u64, file, &format!(", line {lines}"))?;
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
        (None, None) => return Err(header.missing(&[TIME_S])),
    };
    let mut channels = Vec::new();
    for (kind, names) in COLUMNS {
        let names: Vec<&str> = names.split(' ').collect();
        channels.extend(header.channel(kind, &names)?);
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
    RecordingError::check_sensors(file, &layout.sensors())?;
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

    /// The channel of a kind whose last numbers may be absent; `None` without any of its columns.
    fn channel(&mut self, kind: SensorKind, names: &[&str]) -> Result<Option<Channel>> {
        let mut channel = Channel::new(kind, &[]);
        for (column, name) in channel.columns.iter_mut().zip(names) {
            *column = self.find(name)?;
        }
        if channel.columns.iter().all(Option::is_none) {
            return Ok(None);
        }
        let needed = names.iter().take(widths(kind).1).zip(&channel.columns);
        let missing = needed.filter(|(_, column)| column.is_none());
        let missing: Vec<&str> = missing.map(|(name, _)| *name).collect();
        if !missing.is_empty() {
            return Err(self.missing(&missing));
        }
        if kind == SensorKind::Reference {
            channel.scored = self.find(SCORED)?;
        }
        Ok(Some(channel))
    }

    fn missing(&self, missing: &[&str]) -> RecordingError {
        let from_sensor_logger = self.names.iter().any(|name| name == "seconds_elapsed");
        RecordingError::MissingColumns {
            file: self.file.to_owned(),
            missing: format!("column {}", join(missing.iter().copied())),
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
