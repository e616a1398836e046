//! Opening a recording: which format it is, and the reader for it.

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use crate::error::{RecordingError, Result};
use crate::metadata::Metadata;
use crate::options::{FieldUnit, ForceUnit, Format, OpenOptions, RateUnit};
use crate::recording::{Opened, Recording};
use crate::text::{Input, open_file, read_piece};
use crate::{
    csv, describe, euroc, foreign, gpx, kf_gins, kitti, lab_session, manifest, nmea,
    northing_serial, phyphox, rtklib, sensor_logger, tum, ubx, vectornav, ximu3,
};

/// Bytes that are looked at to tell the format.
const SAMPLE_BYTES: usize = 4096;

/// What a database of SQLite begins with, such as a bag of ROS 2.
pub(crate) const SQLITE: &[u8] = b"SQLite format 3\0";
/// Opens a recording: a file, or a folder of Sensor Logger, of phyphox, of a bag of ROS 2 or with KF-GINS's tables. The format is told by content, or by
/// `options.format`. Nothing but the head of the file is read yet.
///
/// # Errors
/// When it cannot be opened, is no recording, or lacks columns ([`RecordingError`] says which).
/// Errors further down in the file come while iterating.
pub fn open(path: &Path, options: &OpenOptions) -> Result<Recording> {
    let file = path.display().to_string();
    let opened = open_path(path, &file, options)?;
    Ok(Recording::new(
        file,
        with_reference(opened, options)?,
        options,
    ))
}

/// Reads a recording from a stream, e.g. standard input: our CSV, or with `options.manifest` any
/// delimited text. `name` stands for the file in messages.
///
/// # Errors
/// As [`open()`]; formats that need to jump in the file (Parquet, Sensor Logger) are refused.
pub fn read_from(
    input: impl Read + Send + 'static,
    name: &str,
    options: &OpenOptions,
) -> Result<Recording> {
    read_stream(Box::new(input), name, options)
}

fn read_stream(mut input: Input, name: &str, options: &OpenOptions) -> Result<Recording> {
    if options.describe {
        return Err(RecordingError::unsupported(
            name,
            "a stream cannot be described, which reads it twice; save it to a file, or say what it is with --manifest",
        ));
    }
    let head =
        stream_head(&mut input).map_err(|error| RecordingError::io(name, "read it", error))?;
    let format = match (options.format, &options.manifest) {
        (None, Some(_)) => Format::Manifest,
        (Some(format), _) => format,
        (None, None) => detect(&head, name)?,
    };
    let input: Input = Box::new(Cursor::new(head).chain(input));
    let metadata = named(name.to_owned());
    let opened = match (format, &options.manifest) {
        (Format::Manifest, Some(path)) => manifest::open_stream(input, name, path, options)?,
        (Format::Manifest, None) => {
            return Err(RecordingError::unsupported(
                name,
                "a stream of this kind needs its manifest; name it with --manifest FILE.toml",
            ));
        }
        (format, _) => open_stream(format, input, name, metadata)?,
    };
    let opened = with_reference(opened, options)?;
    Ok(Recording::new(name.to_owned(), opened, options))
}

/// Reads a recording that is in memory: Parquet, MCAP, our CSV, Sensor Logger's zip or JSON. `name`
/// stands for the file in messages.
///
/// # Errors
/// As [`open()`].
pub fn read_bytes(bytes: Vec<u8>, name: &str, options: &OpenOptions) -> Result<Recording> {
    let head = &bytes[..bytes.len().min(SAMPLE_BYTES)];
    let format = match options.format {
        Some(format) => format,
        None => detect(head, name)?,
    };
    let metadata = named(name.to_owned());
    let opened = match format {
        #[cfg(feature = "parquet")]
        Format::Parquet => crate::parquet::open(bytes::Bytes::from(bytes), name, metadata)?,
        #[cfg(feature = "mcap")]
        Format::Mcap => {
            let input = Box::new(Cursor::new(bytes));
            crate::mcap::open(input, name, metadata, wanted(options))?
        }
        Format::SensorLogger => {
            let device = options.device.as_deref();
            match lab_session::open(Cursor::new(&bytes), name, &metadata, device)? {
                Some(opened) => opened,
                None => sensor_logger::open_bytes(bytes, name, metadata)?,
            }
        }
        Format::Manifest => {
            return Err(RecordingError::unsupported(
                name,
                "a manifest names a file; use manifest::read_bytes for data in memory",
            ));
        }
        format => open_stream(format, Box::new(Cursor::new(bytes)), name, metadata)?,
    };
    let opened = with_reference(opened, options)?;
    Ok(Recording::new(name.to_owned(), opened, options))
}

/// The recording with the reference of another file, where the options name one.
fn with_reference(opened: Opened, options: &OpenOptions) -> Result<Opened> {
    let Some(path) = &options.reference else {
        return Ok(opened);
    };
    let file = path.display().to_string();
    let truth = open_path(path, &file, &OpenOptions::default())?;
    manifest::combined::with_reference(opened, truth, &file)
}

fn open_path(path: &Path, file: &str, options: &OpenOptions) -> Result<Opened> {
    if path.is_dir() && options.manifest.is_none() {
        return match beside(path) {
            Some(manifest_path) => manifest::open_with_data(&manifest_path, path, options),
            None => open_data_file(path, options.format, options),
        };
    }
    if let Some(manifest_path) = &options.manifest {
        return manifest::open_with_data(manifest_path, path, options);
    }
    let is_manifest = has_extension(path, "toml");
    match options.format {
        Some(Format::Manifest) | None if is_manifest => return manifest::open(path, options),
        Some(Format::Manifest) | None => {
            if let Some(manifest_path) = beside(path) {
                return manifest::open_with_data(&manifest_path, path, options);
            }
        }
        Some(_) => {}
    }
    if options.format == Some(Format::Manifest) {
        return Err(RecordingError::unsupported(
            file,
            format!(
                "no manifest beside it (`{file}.toml`); write one as docs/formats.md says, or name it with --manifest"
            ),
        ));
    }
    match open_data_file(path, options.format, options) {
        Err(_) if options.describe => described(path, options),
        opened => opened,
    }
}

/// Opens a table that nothing describes as its draft guesses, and says what was guessed.
fn described(path: &Path, options: &OpenOptions) -> Result<Opened> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let draft = describe::draft(&[path.to_owned()], folder, None)?;
    let mut opened = manifest::opened_text(&draft.manifest, path, options)?;
    let told = draft.guesses.iter().map(|guess| {
        let unit = match guess.key {
            "gyroscope" => options.gyroscope_unit.map(RateUnit::name),
            "accelerometer" => options.accelerometer_unit.map(ForceUnit::name),
            "magnetometer" | "magnetometer_uncalibrated" => {
                options.magnetometer_unit.map(FieldUnit::name)
            }
            _ => None,
        };
        match unit {
            Some(unit) => format!("{} Taken in {unit}, as told.", guess.sentence()),
            None => guess.sentence(),
        }
    });
    let told: Vec<String> = told.chain(draft.remarks.iter().cloned()).collect();
    opened.notes.splice(0..0, told);
    Ok(opened)
}

/// Opens a file or folder that describes itself; its format is told by content unless it is given.
#[cfg_attr(not(feature = "mcap"), allow(unused_variables))]
pub(crate) fn open_data_file(
    path: &Path,
    format: Option<Format>,
    options: &OpenOptions,
) -> Result<Opened> {
    let file = &path.display().to_string();
    let metadata = named(stem(path));
    if path.is_dir() {
        #[cfg(feature = "mcap")]
        {
            let wanted = wanted(options);
            let bag = crate::mcap::bag::open_folder(path, file, metadata.clone(), wanted)?;
            if let Some(opened) = bag {
                return Ok(opened);
            }
        }
        if options.topics.is_some() {
            return Err(no_topics(file, "a folder without files of one"));
        }
        if let Some(opened) = euroc::open_folder(path, &metadata)? {
            return Ok(opened);
        }
        if let Some(opened) = kitti::open_folder(path, file, &metadata)? {
            return Ok(opened);
        }
        if let Some(opened) = ximu3::open_folder(path, file, &metadata)? {
            return Ok(opened);
        }
        return match kf_gins::open_folder(path, file, &metadata)? {
            Some(opened) => Ok(opened),
            None => sensor_logger::open_folder(path, file, metadata),
        };
    }
    let mut input = open_file(path, file)?;
    let head = head(&mut input).map_err(|error| RecordingError::io(file, "open it", error))?;
    let format = match format {
        Some(format) => format,
        None => detect(&head, file)?,
    };
    if options.topics.is_some() && format != Format::Mcap {
        return Err(no_topics(file, format.name()));
    }
    let input = open_file(path, file)?;
    match format {
        Format::Manifest => Err(RecordingError::unsupported(
            file,
            "a table needs the keys of its columns in the manifest",
        )),
        Format::SensorLogger => {
            let device = options.device.as_deref();
            match lab_session::open_file(path, file, &metadata, device)? {
                Some(opened) => Ok(opened),
                None => sensor_logger::open_file(path, file, metadata),
            }
        }
        #[cfg(feature = "parquet")]
        Format::Parquet => crate::parquet::open(input, file, metadata),
        #[cfg(feature = "mcap")]
        Format::Mcap if head.starts_with(SQLITE) => {
            crate::mcap::open_database(path, file, metadata, wanted(options))
        }
        #[cfg(feature = "mcap")]
        Format::Mcap => crate::mcap::open(Box::new(input), file, metadata, wanted(options)),
        format => open_stream(format, Box::new(input), file, metadata),
    }
}

fn no_topics(file: &str, found: &str) -> RecordingError {
    RecordingError::unsupported(
        file,
        format!("topics are named, which are of a bag of ROS; this is {found}"),
    )
}

/// What the options say of devices and topics.
#[cfg(feature = "mcap")]
fn wanted(options: &OpenOptions) -> crate::mcap::Wanted<'_> {
    crate::mcap::Wanted {
        device: options.device.as_deref(),
        topics: options.topics.as_ref(),
    }
}

/// Opens a format that is read from its beginning to its end.
fn open_stream(format: Format, input: Input, name: &str, metadata: Metadata) -> Result<Opened> {
    if let Some(problem) = not_built(format) {
        return Err(RecordingError::unsupported(name, problem));
    }
    match format {
        Format::Csv => csv::open(input, name, metadata),
        Format::Phyphox => phyphox::open(input, name, metadata),
        Format::Nmea => Ok(nmea::open(input, name, metadata)),
        Format::Ubx => Ok(ubx::open(input, name, metadata)),
        Format::Euroc => euroc::open(input, name, metadata),
        Format::Rtklib => rtklib::open(input, name, metadata),
        Format::Gpx => gpx::open(input, name, metadata),
        Format::Tum => tum::open(input, name, metadata),
        Format::VectorNav => Ok(vectornav::open(input, name, metadata)),
        Format::XImu3 => ximu3::open_any(input, name, metadata),
        Format::KfGins => kf_gins::open(input, name, metadata),
        #[cfg(feature = "ulog")]
        Format::Ulog => crate::ulog::open(input, name, metadata),
        #[cfg(feature = "ardupilot")]
        Format::ArduPilot => crate::ardupilot::open(input, name, metadata),
        Format::NorthingSerial => Ok(northing_serial::open(input, name, metadata)),
        format => Err(RecordingError::unsupported(
            name,
            format!("{format} cannot be read from a stream; save it to a file and open that"),
        )),
    }
}

/// The first bytes of a file.
fn head(input: &mut File) -> std::io::Result<Vec<u8>> {
    let mut head = Vec::new();
    input.take(SAMPLE_BYTES as u64).read_to_end(&mut head)?;
    Ok(head)
}

/// The first bytes of a stream: up to its header line, however small the pieces in which it comes,
/// so that a live stream is not waited for longer than needed.
fn stream_head(input: &mut impl Read) -> std::io::Result<Vec<u8>> {
    let mut head = Vec::new();
    let mut piece = [0; SAMPLE_BYTES];
    loop {
        let read = read_piece(input, &mut piece[..SAMPLE_BYTES - head.len()])?;
        head.extend_from_slice(&piece[..read]);
        let has_header = head
            .split_inclusive(|byte| *byte == b'\n')
            .any(|line| line.ends_with(b"\n") && !line.starts_with(b"#"));
        if read == 0 || has_header || head.len() == SAMPLE_BYTES {
            return Ok(head);
        }
    }
}

/// The format of a content that starts with `head`.
fn detect(head: &[u8], file: &str) -> Result<Format> {
    let not = |found: &str| RecordingError::not_a_recording(file, found);
    if head.is_empty() {
        return Err(RecordingError::empty(file, "0 bytes", "a recording"));
    }
    if head.starts_with(b"PAR1") {
        return Ok(Format::Parquet);
    }
    if [&b"\x89MCAP"[..], SQLITE, b"#ROSBAG V"]
        .iter()
        .any(|magic| head.starts_with(magic))
    {
        return Ok(Format::Mcap);
    }
    if head.starts_with(b"ULog\x01\x12\x35") {
        return Ok(Format::Ulog);
    }
    // The format of formats is the first message of a log.
    if head.starts_with(b"\xa3\x95\x80\x80") {
        return Ok(Format::ArduPilot);
    }
    if head.starts_with(b"PK\x03\x04") {
        return Ok(Format::SensorLogger);
    }
    if ubx::recognises(head) {
        return Ok(Format::Ubx);
    }
    if ximu3::recognises(head) {
        return Ok(Format::XImu3);
    }
    if let Some(problem) = foreign::recognised(head) {
        return Err(RecordingError::unsupported(file, problem));
    }
    if head.contains(&0) {
        return Err(not("binary data of an unknown kind"));
    }
    let text = String::from_utf8_lossy(head);
    let text = text.trim_start_matches('\u{feff}');
    if text.trim_start().starts_with(['[', '{']) {
        return Ok(Format::SensorLogger);
    }
    if euroc::recognises(text) {
        return Ok(Format::Euroc);
    }
    if rtklib::recognises(text) {
        return Ok(Format::Rtklib);
    }
    if gpx::recognises(text) {
        return Ok(Format::Gpx);
    }
    if tum::recognises(text) {
        return Ok(Format::Tum);
    }
    if phyphox::recognises(text) {
        return Ok(Format::Phyphox);
    }
    let has_time_column = text
        .lines()
        .find(|line| !line.starts_with('#'))
        .is_some_and(csv::recognises);
    if northing_serial::recognises(text) {
        return Ok(Format::NorthingSerial);
    }
    if !has_time_column && vectornav::recognises(text) {
        return Ok(Format::VectorNav);
    }
    if !has_time_column && nmea::recognises(text) {
        return Ok(Format::Nmea);
    }
    let comments_only = !text.is_empty() && text.lines().all(|line| line.starts_with('#'));
    let header = text
        .lines()
        .find(|line| !line.starts_with('#'))
        .unwrap_or_default();
    // A header that is no time column of ours, but has the shape of one: let the reader name the
    // columns that are missing.
    if comments_only
        || csv::recognises(header)
        || (header.contains(',') && header.contains(|c: char| c.is_ascii_alphabetic()))
    {
        return Ok(Format::Csv);
    }
    if header.contains(';') && csv::recognises(&header.replace(';', ",")) {
        return Err(RecordingError::unsupported(
            file,
            "our column names, but separated by `;`; expected commas between cells and points in numbers, or a manifest, which \
             `northing describe` drafts",
        ));
    }
    if kf_gins::Table::of(text).is_some() {
        return Ok(Format::KfGins);
    }
    if let Some(columns) = kf_gins::columns_of_numbers(text) {
        return Err(RecordingError::unsupported(
            file,
            format!(
                "{columns} columns of numbers without names, and not as KF-GINS has them; `northing describe` drafts a manifest; or write one beside \
                 it (`FILE.EXT.toml`) with `header = false`, the `delimiter`, and the columns of time and sensors by their \
                 number from 1, as docs/formats.md says"
            ),
        ));
    }
    Err(not(
        "text without our column names and without a manifest beside it",
    ))
}

/// The manifest of a data file: `FILE.EXT.toml` or `FILE.toml` beside it.
fn beside(path: &Path) -> Option<PathBuf> {
    let mut appended = path.as_os_str().to_owned();
    appended.push(".toml");
    let replaced = path.with_extension("toml");
    [PathBuf::from(appended), replaced]
        .into_iter()
        .find(|candidate| candidate != path && manifest::describes(candidate, path))
}

/// Whether a path ends in `.extension`, in any case.
#[must_use]
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

pub(crate) fn stem(path: &Path) -> String {
    path.file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

pub(crate) fn named(name: String) -> Metadata {
    Metadata {
        name,
        ..Metadata::default()
    }
}

/// Why this build cannot read a format, if it cannot.
fn not_built(format: Format) -> Option<&'static str> {
    match format {
        Format::Parquet if cfg!(not(feature = "parquet")) => Some(
            "this build cannot read Parquet; build with `--features parquet`, or convert the file to CSV",
        ),
        Format::Mcap if cfg!(not(feature = "mcap")) => {
            Some("this build cannot read MCAP; build with `--features mcap`")
        }
        Format::Ulog if cfg!(not(feature = "ulog")) => {
            Some("this build cannot read ULog; build with `--features ulog`")
        }
        Format::ArduPilot if cfg!(not(feature = "ardupilot")) => {
            Some("this build cannot read logs of ArduPilot; build with `--features ardupilot`")
        }
        _ => None,
    }
}
