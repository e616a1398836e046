//! Scans, detections and truth from delimited text.

use std::collections::HashMap;
use std::path::Path;

use csv::StringRecord;

use super::TrackingRecording;
use super::manifest::{DetectionTable, ScanTable, TrackingManifest, TruthTable};
use super::plausibility::{self, Bearings, OwnPoint};
use super::sample::{Detection, OwnShipPose, Scan, TargetTruth, TrackingEvent, TrackingSample};
use crate::delimited::Rows;
use crate::error::{RecordingError, Result, join, shown};
use crate::limits::TRACKING_EVENTS;
use crate::stamp;
use crate::text::open_file;

/// A table being read: cells by the names of its columns.
pub(super) struct Table {
    file: String,
    columns: HashMap<String, usize>,
    rows: Rows,
    row: StringRecord,
}

impl Table {
    /// Opens a table; its first row names the columns.
    pub(super) fn open(folder: &Path, name: &Path) -> Result<Self> {
        let path = folder.join(name);
        let file = path.display().to_string();
        let input = open_file(&path, &file)?;
        let mut builder = csv::ReaderBuilder::new();
        builder.trim(csv::Trim::All);
        let mut rows = Rows::new(file.clone(), &mut builder, Box::new(input), 0);
        let headers = StringRecord::from_byte_record(rows.first()?).map_err(|_| {
            RecordingError::bad_line(&file, 1, "names of columns that are no text in UTF-8")
        })?;
        let mut columns = HashMap::new();
        for (index, column) in headers.iter().enumerate() {
            if columns.insert(column.to_owned(), index).is_some() {
                return Err(RecordingError::RepeatedColumn {
                    file,
                    column: shown(column),
                });
            }
        }
        Ok(Self {
            file,
            columns,
            rows,
            row: StringRecord::new(),
        })
    }

    pub(super) fn file(&self) -> &str {
        &self.file
    }

    /// The place of a column.
    pub(super) fn column(&self, name: &str) -> Result<usize> {
        self.columns.get(name).copied().ok_or_else(|| {
            let mut present: Vec<_> = self.columns.keys().map(String::as_str).collect();
            present.sort_unstable();
            RecordingError::MissingColumns {
                file: self.file.clone(),
                missing: format!("column `{}`", shown(name)),
                present: join(present),
                advice: "correct the name in the manifest".to_owned(),
            }
        })
    }

    /// The place of a column that need not be.
    pub(super) fn optional(&self, name: Option<&String>) -> Result<Option<usize>> {
        name.map(|name| self.column(name)).transpose()
    }

    /// Goes to the next row; false at the end.
    pub(super) fn advance(&mut self) -> Result<bool> {
        self.rows.read_text(&mut self.row)
    }

    /// The text of a cell.
    pub(super) fn text(&self, column: usize) -> &str {
        self.row.get(column).unwrap_or_default()
    }

    /// A number; `nan` and `inf` are numbers too, which trackers refuse and count.
    pub(super) fn number(&self, column: usize) -> Result<f64> {
        let text = self.text(column);
        text.parse().map_err(|_| self.bad_cell(column, "a number"))
    }

    fn integer<T: std::str::FromStr>(&self, column: usize) -> Result<T> {
        whole(self.text(column)).ok_or_else(|| self.bad_cell(column, "a whole number"))
    }

    /// A time stamp: seconds, or a date and a time of day.
    pub(super) fn time_ns(&self, column: usize) -> Result<i64> {
        let text = self.text(column).as_bytes();
        let time_ns = stamp::parse_ns(text, stamp::SECONDS);
        time_ns
            .or_else(|| stamp::parse_date_time(text))
            .ok_or_else(|| self.bad_cell(column, expected_time(self.text(column))))
    }

    /// The complaint about a cell of the current row.
    pub(super) fn bad_cell(&self, column: usize, expected: &'static str) -> RecordingError {
        let name = self.columns.iter().find(|(_, at)| **at == column);
        RecordingError::BadCell {
            file: self.file.clone(),
            line: self.row.position().map_or(0, csv::Position::line),
            column: name.map(|(name, _)| shown(name)).unwrap_or_default(),
            text: shown(self.text(column)),
            expected,
        }
    }
}

/// A whole number; programs of statistics write one of a column with holes as `12.0`.
pub(super) fn whole<T: std::str::FromStr>(text: &str) -> Option<T> {
    let zeros = |(_, digits): &(&str, &str)| digits.bytes().all(|digit| digit == b'0');
    let number = text.split_once('.').filter(zeros);
    number.map_or(text, |(whole, _)| whole).parse().ok()
}

/// What a cell of the time should hold, which holds this. Seconds since 1970 have ten digits before the point, until the year 2286.
fn expected_time(text: &str) -> &'static str {
    let number = text.parse::<f64>().unwrap_or(0.0).abs();
    match number {
        1e11..1e14 => "a time in seconds; these look like milliseconds: divide by 1000",
        1e14..1e17 => "a time in seconds; these look like microseconds: divide by 1000000",
        1e17..1e20 => "a time in seconds; these look like nanoseconds: divide by 1000000000",
        _ => "a time in seconds, nor a date with the time of day, such as 2023-11-14T22:13:20.5Z",
    }
}

/// What detections and truths need to know of their scan.
struct Place {
    time_ns: i64,
    /// Where the scan stands in the events, when its sensor is described.
    event: Option<usize>,
}

/// Reads the three tables.
pub(super) fn read(
    manifest: &TrackingManifest,
    scans: &ScanTable,
    file: &str,
    folder: &Path,
    out: &mut TrackingRecording,
) -> Result<()> {
    let places = read_scans(scans, file, folder, out)?;
    if let Some(table) = &manifest.detections {
        read_detections(table, folder, &places, out)?;
        plausibility::ranges(&plausibility::file_of(folder, &table.file), out)?;
    }
    if let Some(table) = &manifest.truth {
        read_truth(table, folder, &places, out)?;
    }
    Ok(())
}

fn read_scans(
    scans: &ScanTable,
    file: &str,
    folder: &Path,
    out: &mut TrackingRecording,
) -> Result<HashMap<i64, Place>> {
    let mut table = Table::open(folder, &scans.file)?;
    let (id, time) = (table.column(&scans.scan)?, table.column(&scans.time_s)?);
    let sensor = table.optional(scans.sensor.as_ref())?;
    let north = table.optional(scans.own_north_m.as_ref())?;
    let east = table.optional(scans.own_east_m.as_ref())?;
    let heading = table.optional(scans.own_heading_deg.as_ref())?;
    let position_std = table.optional(scans.own_position_std_m.as_ref())?;
    let heading_std = table.optional(scans.own_heading_std_deg.as_ref())?;
    let only = out.sensors.iter().position(|(name, _)| name != "ais");
    if north.is_none() {
        let bow = if heading.is_none() {
            ", its bow to the north"
        } else {
            ""
        };
        out.issues.remarks.push(format!(
            "[scans] names no place of the own ship (own_north_m, own_east_m): it is taken to stand at the origin{bow}"
        ));
    }
    let pose_columns = [north, east, heading, position_std, heading_std];
    let mut places = HashMap::new();
    let mut own = Vec::new();
    let mut times = vec![Vec::new(); out.sensors.len()];
    let mut negative = None;
    let mut negatives = 0;
    while table.advance()? {
        let number = |column: Option<usize>| column.map_or(Ok(0.0), |c| table.number(c));
        let (scan_id, time_ns) = (table.integer(id)?, table.time_ns(time)?);
        if places.contains_key(&scan_id) {
            return Err(table.bad_cell(id, "a scan number that stands once"));
        }
        let is_empty = |column: &usize| table.text(*column).is_empty();
        if pose_columns.iter().flatten().any(is_empty) {
            out.issues.scans_without_own_ship += 1;
            let event = None;
            places.insert(scan_id, Place { time_ns, event });
            continue;
        }
        let std = if position_std.is_some() || heading_std.is_some() {
            let position = number(position_std)?;
            Some([position, position, number(heading_std)?.to_radians()])
        } else {
            None
        };
        let pose = OwnShipPose {
            north_m: number(north)?,
            east_m: number(east)?,
            heading_rad: number(heading)?.to_radians(),
            std,
        };
        if std.is_some_and(|std| std.iter().any(|std| *std < 0.0)) {
            negatives += 1;
            let is_negative = |column: &&usize| table.number(**column).is_ok_and(|std| std < 0.0);
            let columns = [position_std, heading_std];
            let column = columns.iter().flatten().find(is_negative);
            negative = negative.or(column.map(|column| {
                table.bad_cell(
                    *column,
                    "a standard deviation: it is negative, as in every scan",
                )
            }));
        }
        if heading.is_some() && north.is_some() {
            own.push(OwnPoint {
                time_ns,
                place: [pose.north_m, pose.east_m],
                position_std_m: std.map_or(0.0, |[position, ..]| position),
                heading: number(heading)?,
            });
        }
        let used = match sensor {
            Some(column) => {
                let name = table.text(column);
                out.sensors.iter().position(|(known, _)| known == name)
            }
            None => only,
        };
        let sample = TrackingSample::OwnShip(pose);
        out.add(TrackingEvent { time_ns, sample }, &table.file)?;
        let event = used.map(|_| out.events.len());
        let place = Place { time_ns, event };
        places.insert(scan_id, place);
        let Some(sensor) = used else {
            out.issues.scans_of_unknown_sensors += 1;
            continue;
        };
        times[sensor].push(time_ns);
        let sample = TrackingSample::Scan(Scan {
            id: scan_id,
            sensor,
            detections: Vec::new(),
        });
        out.add(TrackingEvent { time_ns, sample }, &table.file)?;
    }
    let (rows, without) = (places.len() as u64, out.issues.scans_without_own_ship);
    if rows > 0 && rows == without {
        return Err(RecordingError::empty(
            table.file(),
            format!("each of its {rows} scans has an empty cell of the own ship's pose"),
            "numbers in the columns of own_north_m, own_east_m and what else of the own ship [scans] names; without them leave these keys out",
        ));
    }
    if rows > 0 && rows == without + out.issues.scans_of_unknown_sensors {
        return Err(RecordingError::manifest(
            file,
            "no scan is of a sensor in [sensors]; name them as the table of scans does",
        ));
    }
    // Of some the tracker refuses the scans, and counts them.
    if negatives == rows - without
        && let Some(error) = negative
    {
        return Err(error);
    }
    if let Some(column) = &scans.own_heading_deg {
        plausibility::heading_unit(table.file(), column, own)?;
    }
    plausibility::scan_times(table.file(), scans, times, out)?;
    Ok(places)
}

/// Columns of the four kinds of detections.
struct Kinds {
    range_bearing: Option<[usize; 2]>,
    relative: Option<[usize; 2]>,
    placed: Option<[usize; 2]>,
    bearing: Option<usize>,
}

impl Kinds {
    fn new(table: &Table, wanted: &DetectionTable) -> Result<Self> {
        let pair = |names: &Option<[String; 2]>| -> Result<Option<[usize; 2]>> {
            let Some([first, second]) = names else {
                return Ok(None);
            };
            Ok(Some([table.column(first)?, table.column(second)?]))
        };
        Ok(Self {
            range_bearing: pair(&wanted.range_m_bearing_rad)?,
            relative: pair(&wanted.relative_north_east_m)?,
            placed: pair(&wanted.north_east_m)?,
            bearing: table.optional(wanted.bearing_rad.as_ref())?,
        })
    }

    /// The detection of a row; `None` when all its cells are empty, which is a scan that saw nothing.
    fn detection(&self, table: &Table) -> Result<Option<Detection>> {
        // A bearing may stand alone, without a range: its cell does not make a pair.
        let speaks = |c: &usize| !table.text(*c).is_empty() && Some(*c) != self.bearing;
        let pair = |columns: Option<[usize; 2]>| -> Result<Option<[f64; 2]>> {
            match columns.filter(|columns| columns.iter().any(speaks)) {
                Some([first, second]) => Ok(Some([table.number(first)?, table.number(second)?])),
                None => Ok(None),
            }
        };
        if let Some([range_m, bearing_rad]) = pair(self.range_bearing)? {
            return Ok(Some(Detection::RangeBearing {
                range_m,
                bearing_rad,
            }));
        }
        if let Some([north_m, east_m]) = pair(self.relative)? {
            return Ok(Some(Detection::Relative { north_m, east_m }));
        }
        if let Some([north_m, east_m]) = pair(self.placed)? {
            return Ok(Some(Detection::Placed { north_m, east_m }));
        }
        let bearing = self.bearing.filter(|c| !table.text(*c).is_empty());
        let bearing = bearing.map(|c| table.number(c)).transpose()?;
        Ok(bearing.map(|bearing_rad| Detection::Bearing { bearing_rad }))
    }
}

fn read_detections(
    wanted: &DetectionTable,
    folder: &Path,
    places: &HashMap<i64, Place>,
    out: &mut TrackingRecording,
) -> Result<()> {
    let mut table = Table::open(folder, &wanted.file)?;
    let id = table.column(&wanted.scan)?;
    let kinds = Kinds::new(&table, wanted)?;
    let mut detections = 0;
    let [mut bearings, mut lone_bearings] = [Bearings::default(); 2];
    while table.advance()? {
        let Some(detection) = kinds.detection(&table)? else {
            continue;
        };
        match detection {
            Detection::RangeBearing { bearing_rad, .. } => bearings.take(bearing_rad),
            Detection::Bearing { bearing_rad } => lone_bearings.take(bearing_rad),
            _ => {}
        }
        detections += 1;
        TRACKING_EVENTS.check(detections, &table.file, "")?;
        let Some(place) = places.get(&table.integer(id)?) else {
            out.issues.rows_without_scan += 1;
            continue;
        };
        let event = place.event.and_then(|at| out.events.get_mut(at));
        if let Some(TrackingSample::Scan(scan)) = event.map(|event| &mut event.sample) {
            scan.detections.push(detection);
        }
    }
    if let Some([_, column]) = &wanted.range_m_bearing_rad {
        bearings.check(&table.file, column, &mut out.issues)?;
    }
    if let Some(column) = &wanted.bearing_rad {
        lone_bearings.check(&table.file, column, &mut out.issues)?;
    }
    Ok(())
}

fn read_truth(
    wanted: &TruthTable,
    folder: &Path,
    places: &HashMap<i64, Place>,
    out: &mut TrackingRecording,
) -> Result<()> {
    let mut table = Table::open(folder, &wanted.file)?;
    let id = table.column(&wanted.scan)?;
    let target = table.optional(wanted.target.as_ref())?;
    let (north, east) = (
        table.column(&wanted.north_m)?,
        table.column(&wanted.east_m)?,
    );
    while table.advance()? {
        let scan = table.integer(id)?;
        let Some(place) = places.get(&scan) else {
            out.issues.rows_without_scan += 1;
            continue;
        };
        let truth = TargetTruth {
            scan,
            target: target.map_or(Ok(1), |column| table.integer(column))?,
            north_m: table.number(north)?,
            east_m: table.number(east)?,
        };
        let event = TrackingEvent {
            time_ns: place.time_ns,
            sample: TrackingSample::Truth(truth),
        };
        out.add(event, &table.file)?;
    }
    Ok(())
}
