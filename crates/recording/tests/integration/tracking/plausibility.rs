//! Gross errors of units, clocks and columns in recordings of targets, and tables as other programs write them.

use std::fmt::Write as _;
use std::path::PathBuf;

use northing_recording::tracking::{TrackingRecording, TrackingSample, open};

const MANIFEST: &str = r#"
name = "bay"
[scans]
file = "scans.csv"
scan = "scan"
time_s = "t"
own_north_m = "n"
own_east_m = "e"
own_heading_deg = "hdg"
own_heading_std_deg = "std"
[detections]
file = "det.csv"
scan = "scan"
range_m_bearing_rad = ["range", "bearing"]
[sensors.radar]
range_std_m = 10.0
bearing_std_deg = 1.0
detection_probability = 0.9
clutter_per_km2 = 2.0
largest_range_m = 3000.0
"#;

const AIS: &str = r#"
[plane]
latitude_deg = 54.3
longitude_deg = 10.15
[ais]
file = "ais.csv"
[ais.columns]
time = "Time"
mmsi = "MMSI"
latitude_deg = "Lat"
longitude_deg = "Lon"
[sensors.ais]
extent_std_m = 10.0
detection_probability = 0.95
clutter_per_km2 = 0.001
covers_all = false
"#;

/// Forty scans of a radar on a ship that goes 8 m/s north and then east, as the columns of its tables.
struct Bay {
    manifest: String,
    head: &'static str,
    scan: fn(usize) -> String,
    range_bearing: fn(usize) -> [f64; 2],
    ais: String,
}

fn own(k: usize) -> [f64; 3] {
    let leg = 16.0 * (k.min(20) as f64);
    [leg, 16.0 * k as f64 - leg, if k > 20 { 90.0 } else { 0.5 }]
}

impl Bay {
    fn new() -> Self {
        Self {
            manifest: MANIFEST.to_owned(),
            head: "scan,t,n,e,hdg,std",
            scan: |k| {
                let [north, east, heading] = own(k);
                format!("{k},{},{north},{east},{heading},0.5", 1_700_000_000 + 2 * k)
            },
            range_bearing: |k| [800.0 + k as f64, 0.15 * k as f64 - 3.0],
            ais: String::new(),
        }
    }

    fn with_ais(rows: impl Iterator<Item = String>) -> Self {
        Self {
            manifest: format!("{MANIFEST}{AIS}"),
            ais: rows.fold("Time,MMSI,Lat,Lon\n".to_owned(), |text, row| {
                text + &row + "\n"
            }),
            ..Self::new()
        }
    }

    fn folder(&self) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let (mut scans, mut detections) = (
            format!("{}\n", self.head),
            "scan,range,bearing\n".to_owned(),
        );
        for k in 0..40 {
            writeln!(scans, "{}", (self.scan)(k)).unwrap();
            let [range, bearing] = (self.range_bearing)(k);
            writeln!(detections, "{k},{range},{bearing}").unwrap();
        }
        for (name, text) in [
            ("m.toml", &self.manifest),
            ("scans.csv", &scans),
            ("det.csv", &detections),
            ("ais.csv", &self.ais),
        ] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let manifest = folder.path().join("m.toml");
        (folder, manifest)
    }

    fn read(&self) -> TrackingRecording {
        let (_folder, manifest) = self.folder();
        open(&manifest, None).unwrap()
    }

    /// One line with each of these.
    fn refused(&self, expected: &[&str]) {
        let (_folder, manifest) = self.folder();
        let message = open(&manifest, None).unwrap_err().to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        for part in expected {
            assert!(message.contains(part), "{message}\n{part}");
        }
    }

    fn remarked(&self, expected: &str) {
        let remarks = self.read().issues.remarks;
        assert!(
            remarks.len() == 1 && remarks[0].contains(expected),
            "{remarks:?}\n{expected}"
        );
    }
}

fn scans(recording: &TrackingRecording) -> usize {
    let is_scan = |sample: &TrackingSample| matches!(sample, TrackingSample::Scan(_));
    let events = recording.events.iter();
    events.filter(|event| is_scan(&event.sample)).count()
}

#[test]
fn a_right_recording_has_no_remark() {
    let recording = Bay::new().read();
    assert_eq!(recording.issues, Default::default());
    assert_eq!(scans(&recording), 40);
}

#[test]
fn bearings_in_degrees_are_refused() {
    let mut bay = Bay::new();
    bay.range_bearing = |k| [800.0, 9.0 * k as f64 - 180.0];
    bay.refused(&[
        "det.csv",
        "column `bearing`",
        "2 pi",
        "the largest is 180",
        "multiply the column by pi / 180",
    ]);
    // A camera within thirty degrees of the bow.
    bay.manifest = MANIFEST.replace(
        "range_m_bearing_rad = [\"range\", \"bearing\"]",
        "bearing_rad = \"bearing\"",
    );
    bay.range_bearing = |k| [800.0, 1.5 * k as f64 - 30.0];
    bay.refused(&["det.csv", "column `bearing`", "degrees"]);
    // One that goes on past a turn, now and then, and one that counts its turns.
    bay.range_bearing = |k| [800.0, if k == 7 { 6.5 } else { 6.0 }];
    assert_eq!(bay.read().issues.remarks, [""; 0]);
    bay.range_bearing = |k| [800.0, 0.19 * k as f64 + 40.0];
    bay.remarked("bearings in column `bearing`: 40 of 40 are beyond a full turn of 2 pi, the largest is 47.4");
    bay.range_bearing = |k| [800.0, 12.0 * k as f64];
    bay.remarked("are beyond a full turn of 2 pi, the largest is 468.0");
}

#[test]
fn headings_in_radians_are_refused_where_the_course_says_so() {
    let mut bay = Bay::new();
    bay.scan = |k| {
        let [north, east, heading] = own(k);
        format!("{k},{},{north},{east},{},0.5", 2 * k, heading.to_radians())
    };
    bay.refused(&["scans.csv", "own heading", "column `hdg`", "180 / pi"]);
    // A ship that drifts at half a metre a second, or lies still, has no course to say so.
    bay.scan = |k| {
        let [north, east, heading] = own(k);
        format!("{k},{},{north},{east},{},0.5", 32 * k, heading.to_radians())
    };
    assert_eq!(bay.read().issues.remarks, [""; 0]);
    // Zeros, where detections are in axes to the north.
    bay.scan = |k| {
        let [north, east, _] = own(k);
        format!("{k},{},{north},{east},0,0.5", 2 * k)
    };
    assert_eq!(bay.read().issues.remarks, [""; 0]);
}

#[test]
fn ranges_in_miles_are_refused_and_a_limit_below_all_is_said() {
    let mut bay = Bay::new();
    bay.range_bearing = |k| [0.4 + 0.01 * k as f64, 0.0];
    bay.refused(&[
        "det.csv",
        "all 40 detections of radar",
        "range_std_m of 10 m",
        "1852",
    ]);
    bay.range_bearing = |k| [-800.0 - k as f64, 0.0];
    assert_eq!(bay.read().issues.remarks, [""; 0]);
    let mut bay = Bay::new();
    bay.manifest = MANIFEST.replace("3000.0", "3.0");
    bay.remarked(
        "all 40 detections of radar lie beyond its largest_range_m of 3 m, the farthest at 839 m",
    );
    bay.manifest = MANIFEST.replace("3000.0", "805.0");
    bay.remarked("34 of 40 detections of radar lie beyond its largest_range_m of 805 m");
}

#[test]
fn clocks_that_stand_or_run_a_thousand_times_too_fast() {
    let mut bay = Bay::new();
    bay.scan = |k| format!("{k},1700000000,0,0,0,0.5");
    bay.refused(&[
        "scans.csv",
        "column `t`",
        "all 40 scans of radar",
        "1700000000.0 s",
        "write the time of each scan",
    ]);
    bay.scan = |k| format!("{k},{},0,0,0,0.5", 2000 * k);
    bay.remarked("the scans of radar are 2000 s apart (median of column `t`): milliseconds under the name of seconds?");
}

#[test]
fn times_as_dates_are_taken_and_milliseconds_since_1970_are_named() {
    let mut bay = Bay::new();
    bay.scan = |k| format!("{k},2023-11-14T22:13:{:02}.500Z,0,0,0,0.5", k + 20);
    assert_eq!(bay.read().events[0].time_ns, 1_700_000_000_500_000_000);
    bay.scan = |k| format!("{k},{},0,0,0,0.5", 1_700_000_000_000 + 2000 * k as u64);
    bay.refused(&[
        "scans.csv, line 2, column `t`: `1700000000000` is not a time in seconds",
        "divide by 1000",
    ]);
    let row = |k: u64| format!("{},211000003,54.3,10.15", 1_700_000_000_000 + 2000 * k);
    Bay::with_ais((0..9).map(row)).refused(&[
        "ais.csv, line 2, column `Time`",
        "milliseconds: divide by 1000",
    ]);
}

#[test]
fn latitude_and_longitude_exchanged_are_refused_with_the_distance() {
    let row = |time: &str, k: usize, place: &str| {
        format!("2023-11-14 {time}:{k:02}.238,211000003,{place}")
    };
    let exchanged = (0..30).map(|k| row("22:13", k, "10.1558532,54.3036328"));
    Bay::with_ais(exchanged).refused(&[
        "ais.csv",
        "AIS reports",
        "about 5693 km from [plane]",
        "1 km with columns `Lat` and `Lon` exchanged",
        "exchange",
    ]);
    let beyond = (0..30).map(|k| row("22:13", k, "151.2,-33.8"));
    Bay::with_ais(beyond).refused(&["column `Lat`: 30 of 30 latitudes are beyond 90 deg"]);
    let elsewhere = (0..30).map(|k| row("22:13", k, "-33.8,151.2"));
    Bay::with_ais(elsewhere).refused(&[
        "km from [plane]",
        "correct latitude_deg and longitude_deg of [plane]",
    ]);
    let right = (20..59).map(|k| row("22:13", k, "54.3036328,10.1558532"));
    assert_eq!(Bay::with_ais(right).read().issues.remarks, [""; 0]);
    let hour = (20..59).map(|k| row("23:13", k, "54.3036328,10.1558532"));
    Bay::with_ais(hour).remarked(
        "do not overlap: radar from 2023-11-14 22:13:20 to 2023-11-14 22:14:38, ais from 2023-11-14 23:13:20 to 2023-11-14 23:13:58; is one of them of another time zone or clock?",
    );
}

#[test]
fn a_radar_on_the_shore_needs_no_own_ship() {
    let keys = [
        "own_north_m = \"n\"\n",
        "own_east_m = \"e\"\n",
        "own_heading_deg = \"hdg\"\n",
        "own_heading_std_deg = \"std\"\n",
    ];
    let mut bay = Bay::new();
    bay.manifest = keys
        .iter()
        .fold(MANIFEST.to_owned(), |text, key| text.replace(key, ""));
    bay.head = "scan,t";
    bay.scan = |k| format!("{k},{}", 2 * k);
    bay.remarked("it is taken to stand at the origin, its bow to the north");
    let recording = bay.read();
    assert_eq!(scans(&recording), 40);
    assert_eq!(
        recording.events[0].sample,
        TrackingSample::OwnShip(Default::default())
    );
    bay.manifest = MANIFEST.replace("own_east_m = \"e\"\n", "");
    bay.refused(&["[scans] has one of own_north_m and own_east_m"]);
}

#[test]
fn scans_while_the_own_ship_has_no_place_are_left_out_and_counted() {
    let mut bay = Bay::new();
    bay.scan = |k| {
        let place = if (10..14).contains(&k) { "," } else { "5,6" };
        format!("{k},{},{place},0,0.5", 2 * k)
    };
    let recording = bay.read();
    assert_eq!(
        (recording.issues.scans_without_own_ship, scans(&recording)),
        (4, 36)
    );
    assert_eq!(recording.issues.rows_without_scan, 0);
    bay.scan = |k| format!("{k},{},,,0,0.5", 2 * k);
    bay.refused(&[
        "scans.csv",
        "each of its 40 scans has an empty cell of the own ship's pose",
    ]);
}

#[test]
fn whole_numbers_may_have_a_point() {
    let mut bay = Bay::new();
    bay.scan = |k| format!("{k}.0,{},0,0,0,0.5", 2 * k);
    assert_eq!(scans(&bay.read()), 40);
    bay.scan = |k| format!("{k}.5,{},0,0,0,0.5", 2 * k);
    bay.refused(&["line 2, column `scan`: `0.5` is not a whole number"]);
}

#[test]
fn standard_deviations_that_are_all_negative_are_refused() {
    let mut bay = Bay::new();
    bay.scan = |k| format!("{k},{},0,0,0,-0.5", 2 * k);
    bay.refused(&[
        "scans.csv, line 2, column `std`: `-0.5` is not a standard deviation",
        "negative, as in every scan",
    ]);
    // Of one the tracker refuses the scan, and counts it.
    bay.scan = |k| {
        format!(
            "{k},{},0,0,0,{}",
            2 * k,
            if k == 0 { "-0.5" } else { "0.5" }
        )
    };
    assert_eq!(scans(&bay.read()), 40);
}

#[test]
fn a_table_is_no_manifest() {
    let (folder, _) = Bay::new().folder();
    let message = open(&folder.path().join("scans.csv"), None)
        .unwrap_err()
        .to_string();
    for part in ["scans.csv: not a manifest", "(.toml)", "docs/formats.md"] {
        assert!(message.contains(part), "{message}");
    }
}
