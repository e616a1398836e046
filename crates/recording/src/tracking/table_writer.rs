//! A recording of targets as a manifest with tables of scans, detections and true positions: what `northing track` reads.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::manifest::{DetectionTable, ScanTable, TrackingManifest, TruthTable};
use super::{Detection, OwnShipPose, Scan, TrackingRecording, TrackingSample};
use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::stamp::format_s;

/// Writes `NAME.toml` and beside it `NAME_scans.csv`, `NAME_detections.csv` and, where there is truth, `NAME_truth.csv`; the name is that
/// of the recording. An existing file is refused unless `force`; the manifest is written last. Returns its path.
///
/// # Errors
/// The recording holds AIS reports, which are no scans; a file cannot be written.
pub fn write_tables(recording: &TrackingRecording, folder: &Path, force: bool) -> Result<PathBuf> {
    let mut tables = Tables::default();
    for event in &recording.events {
        match &event.sample {
            TrackingSample::OwnShip(pose) => tables.own = *pose,
            TrackingSample::Scan(scan) => tables.scan(event.time_ns, scan, recording),
            TrackingSample::Truth(truth) => {
                let _ = writeln!(
                    tables.truth,
                    "{},{},{},{}",
                    truth.scan, truth.target, truth.north_m, truth.east_m
                );
            }
            TrackingSample::Ais(_) => {
                return Err(RecordingError::unsupported(
                    &recording.name,
                    "reports of AIS are not written as tables of scans",
                ));
            }
        }
    }
    let name = |kind: &str| PathBuf::from(format!("{}_{kind}.csv", recording.name));
    let manifest = manifest(recording, &tables, name);
    for (kind, head, rows) in [
        ("scans", SCANS, &tables.scans),
        ("detections", DETECTIONS, &tables.detections),
        ("truth", TRUTH, &tables.truth),
    ] {
        if !rows.is_empty() {
            write(&folder.join(name(kind)), &format!("{head}\n{rows}"), force)?;
        }
    }
    let path = folder.join(format!("{}.toml", recording.name));
    let text = toml::to_string(&manifest).map_err(|error| {
        RecordingError::unsupported(&recording.name, format!("its manifest: {error}"))
    })?;
    write(&path, &text, force)?;
    Ok(path)
}

const SCANS: &str =
    "scan,t_s,sensor,own_north_m,own_east_m,own_heading_deg,own_position_std_m,own_heading_std_deg";
const DETECTIONS: &str = "scan,range_m,bearing_rad,relative_north_m,relative_east_m,north_m,east_m";
const TRUTH: &str = "scan,target,north_m,east_m";

/// The rows of the tables.
#[derive(Default)]
struct Tables {
    own: OwnShipPose,
    scans: String,
    detections: String,
    truth: String,
}

impl Tables {
    fn scan(&mut self, time_ns: i64, scan: &Scan, recording: &TrackingRecording) {
        let own = &self.own;
        // Of north and east the larger: there is one column.
        let [position, heading] = own.std.map_or([0.0; 2], |[north, east, heading]| {
            [north.max(east), heading.to_degrees()]
        });
        let sensor = &recording.sensors[scan.sensor].0;
        let _ = writeln!(
            self.scans,
            "{},{},{sensor},{},{},{},{position},{heading}",
            scan.id,
            format_s(time_ns),
            own.north_m,
            own.east_m,
            own.heading_rad.to_degrees(),
        );
        for detection in &scan.detections {
            let cells = match detection {
                Detection::RangeBearing {
                    range_m,
                    bearing_rad,
                } => format!("{range_m},{bearing_rad},,,,"),
                Detection::Bearing { bearing_rad } => format!(",{bearing_rad},,,,"),
                Detection::Relative { north_m, east_m } => format!(",,{north_m},{east_m},,"),
                Detection::Placed { north_m, east_m } => format!(",,,,{north_m},{east_m}"),
            };
            let _ = writeln!(self.detections, "{},{cells}", scan.id);
        }
    }
}

fn manifest(
    recording: &TrackingRecording,
    tables: &Tables,
    name: impl Fn(&str) -> PathBuf,
) -> TrackingManifest {
    let text = str::to_owned;
    let pair = |first: &str, second: &str| Some([text(first), text(second)]);
    let scans = ScanTable {
        file: name("scans"),
        scan: text("scan"),
        time_s: text("t_s"),
        sensor: Some(text("sensor")),
        own_north_m: Some(text("own_north_m")),
        own_east_m: Some(text("own_east_m")),
        own_heading_deg: Some(text("own_heading_deg")),
        own_position_std_m: Some(text("own_position_std_m")),
        own_heading_std_deg: Some(text("own_heading_std_deg")),
    };
    let detections = DetectionTable {
        file: name("detections"),
        scan: text("scan"),
        range_m_bearing_rad: pair("range_m", "bearing_rad"),
        relative_north_east_m: pair("relative_north_m", "relative_east_m"),
        north_east_m: pair("north_m", "east_m"),
        bearing_rad: Some(text("bearing_rad")),
    };
    let truth = TruthTable {
        file: name("truth"),
        scan: text("scan"),
        target: Some(text("target")),
        north_m: text("north_m"),
        east_m: text("east_m"),
        std_m: recording.truth_std_m,
    };
    TrackingManifest {
        name: recording.name.clone(),
        plane: recording.plane,
        scans: Some(scans),
        detections: (!tables.detections.is_empty()).then_some(detections),
        truth: (!tables.truth.is_empty()).then_some(truth),
        ais: None,
        sensors: recording.sensors.iter().cloned().collect(),
    }
}

fn write(path: &Path, text: &str, force: bool) -> Result<()> {
    let mut out = AtomicFile::create(path, force)?;
    out.print(format_args!("{text}"))?;
    out.commit()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::{SensorSettings, TargetTruth, TrackingEvent, TrackingIssues, open};
    use approx::assert_relative_eq;

    fn recording() -> TrackingRecording {
        let radar = SensorSettings {
            range_std_m: 5.0,
            bearing_std_deg: 0.3,
            extent_std_m: 0.0,
            detection_probability: 0.9,
            clutter_per_km2: Some(1.0 / 3.0),
            clutter_per_rad: None,
            largest_range_m: 2e3,
            covers_all: true,
            initiates: true,
            used: true,
        };
        let all = vec![
            Detection::RangeBearing {
                range_m: 1.0 / 7.0,
                bearing_rad: -0.1,
            },
            Detection::Bearing { bearing_rad: 0.25 },
            Detection::Relative {
                north_m: 3.0,
                east_m: -4.5,
            },
            Detection::Placed {
                north_m: 1e5,
                east_m: 2.5,
            },
        ];
        let mut events = Vec::new();
        for id in 0..3_i64 {
            let own = OwnShipPose {
                north_m: 0.1 * id as f64,
                east_m: -2.0,
                heading_rad: 0.3,
                std: Some([0.5, 0.5, 0.01]),
            };
            let scan = Scan {
                id,
                sensor: 0,
                // The second one saw nothing.
                detections: if id == 1 { Vec::new() } else { all.clone() },
            };
            let truth = TargetTruth {
                scan: id,
                target: 4,
                north_m: 1.0 / 3.0,
                east_m: 7.0,
            };
            events.extend(
                [
                    TrackingSample::OwnShip(own),
                    TrackingSample::Scan(scan),
                    TrackingSample::Truth(truth),
                ]
                .map(|sample| TrackingEvent {
                    time_ns: 2_500_000_001 * id,
                    sample,
                }),
            );
        }
        TrackingRecording {
            name: "harbour-3".to_owned(),
            plane: None,
            sensors: vec![("radar".to_owned(), radar)],
            events,
            truth_std_m: 0.5,
            issues: TrackingIssues::default(),
        }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let written = recording();
        let path = write_tables(&written, folder.path(), false).unwrap();
        let mut read = open(&path, None).unwrap();
        // Degrees take the last bit of an angle.
        for event in &mut read.events {
            if let TrackingSample::OwnShip(pose) = &mut event.sample {
                assert_relative_eq!(pose.heading_rad, 0.3, epsilon = 1e-15);
                assert_relative_eq!(pose.std.unwrap()[2], 0.01, epsilon = 1e-15);
                pose.heading_rad = 0.3;
                pose.std = Some([0.5, 0.5, 0.01]);
            }
        }
        assert_eq!(read, written);
        let again = write_tables(&written, folder.path(), false);
        assert!(matches!(again, Err(RecordingError::Exists { .. })));
        assert_eq!(write_tables(&written, folder.path(), true).unwrap(), path);
    }
}
