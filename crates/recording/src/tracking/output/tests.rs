//! Tracks in every format: what is written, and what is refused.

use std::path::PathBuf;

use super::*;

const PLANE: LocalPlane = LocalPlane {
    latitude_deg: 60.0,
    longitude_deg: 5.0,
};
/// 2026-01-02 03:04:05 UTC.
const START_NS: i64 = 1_767_323_045_000_000_000;

/// A target 1852 m north of the origin that comes south at 5 m/s; the own ship goes north at 5 m/s.
fn instant(k: i64) -> TargetInstant {
    let north = 1852.0 - 5.0 * k as f64;
    let mut covariance = [[0.0; 5]; 5];
    (0..5).for_each(|i| covariance[i][i] = [4.0, 0.25, 9.0, 0.5, 0.01][i]);
    (covariance[0][2], covariance[2][0]) = (1.5, 1.5);
    TargetInstant {
        time_ns: START_NS + k * 1_000_000_000,
        own_place_m: [5.0 * k as f64, 0.0],
        targets: vec![TargetPoint {
            track: 117,
            place_m: [north, 0.0],
            velocity_m_s: [-5.0, 0.0],
            covariance,
            existence: 0.999,
            visibility: 0.9,
            models: [0.7, 0.2, 0.1],
            sensor: "radar, fore".to_owned(),
            scan: Some(40 + k),
            detections_in_gate: 2,
            detection: (k > 0).then_some((3, 0.875)),
            missed_probability: 0.125,
            is_reported: true,
            ..TargetPoint::default()
        }],
    }
}

fn written(name: &str, plane: Option<&LocalPlane>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut writer = TargetWriter::create(&path, "bay", plane, false).unwrap();
    for k in 0..3 {
        writer.instant(instant(k), &[]).unwrap();
    }
    let nothing = TargetInstant {
        targets: Vec::new(),
        ..instant(3)
    };
    let ended = [
        (9, "merged into 2".to_owned()),
        (117, "existence".to_owned()),
    ];
    writer.instant(nothing, &ended).unwrap();
    writer.finish().unwrap();
    (folder, path)
}

/// Only the first of two instants is one of a target that is there more likely than not; then the track ends.
fn doubtful(name: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut writer = TargetWriter::create(&path, "bay", Some(&PLANE), false).unwrap();
    let mut last = instant(1);
    last.targets[0].is_reported = false;
    let mut never = last.targets[0].clone();
    never.track = 118;
    last.targets.push(never);
    writer.instant(instant(0), &[]).unwrap();
    writer.instant(last, &[]).unwrap();
    let ended = [(117, "existence".to_owned())];
    writer.instant(TargetInstant::default(), &ended).unwrap();
    writer.finish().unwrap();
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn a_target_that_has_probably_left_is_told_as_lost_and_is_on_no_map() {
    let table = doubtful("tracks.csv");
    let column = table.split([',', '\n']).position(|name| name == "reported");
    let cell = |line: &str| line.split(',').nth(column.unwrap()).map(str::to_owned);
    // The name of the sensor has a comma, but stands behind.
    let told: Vec<_> = table.lines().skip(1).filter_map(cell).collect();
    assert_eq!(told, ["1", "0", "0"]);
    let nmea = doubtful("tracks.nmea");
    let status = |letter: char| nmea.matches(&format!(",N,T117,{letter},")).count();
    assert_eq!((status('T'), status('L')), (1, 1), "{nmea}");
    let map: serde_json::Value = serde_json::from_str(&doubtful("tracks.geojson")).unwrap();
    let features = map["features"].as_array().unwrap();
    assert_eq!(features.len(), 1, "a track that was never reported is none");
    let properties = &features[0]["properties"];
    assert_eq!(properties["times_s"].as_array().unwrap().len(), 1);
    assert_eq!(properties["ended_because"], "existence");
    assert_eq!(doubtful("tracks.kml").matches("<when>").count(), 1);
}

fn text(name: &str, plane: Option<&LocalPlane>) -> String {
    std::fs::read_to_string(written(name, plane).1).unwrap()
}

#[test]
fn a_row_tells_everything_and_the_last_why_the_track_ended() {
    let text = text("tracks.csv", Some(&PLANE));
    let mut reader = ::csv::Reader::from_reader(text.as_bytes());
    let names = reader.headers().unwrap().clone();
    let rows: Vec<_> = reader.records().map(|row| row.unwrap()).collect();
    assert_eq!((names.len(), rows.len()), (row::COLUMNS.len(), 3));
    let cell = |row: usize, name: &str| {
        let column = names.iter().position(|n| n == name).unwrap();
        rows[row][column].to_owned()
    };
    assert_eq!(cell(1, "t_s"), "1767323046.0");
    assert_eq!(
        (cell(0, "track"), cell(1, "north_m")),
        ("117".into(), "1847".into())
    );
    assert_eq!(
        (cell(0, "cov_ne_m2"), cell(0, "vel_cov_ee_m2_s2")),
        ("1.5".into(), "0.5".into())
    );
    assert_eq!(
        (cell(0, "turn_rate_var_rad2_s2"), cell(0, "model_turning")),
        ("0.01".into(), "0.2".into())
    );
    assert_eq!(
        (cell(0, "sensor"), cell(2, "scan")),
        ("radar, fore".into(), "42".into())
    );
    assert_eq!(
        (cell(0, "detection"), cell(1, "detection")),
        (String::new(), "3".into())
    );
    assert_eq!(
        (
            cell(0, "detection_probability"),
            cell(1, "missed_probability")
        ),
        (String::new(), "0.125".into())
    );
    assert_eq!(
        (cell(1, "end"), cell(2, "end")),
        (String::new(), "existence".into())
    );
    let latitude: f64 = cell(0, "latitude_deg").parse().unwrap();
    assert!(
        (latitude - 60.0 - 1852.0 / 111_412.0).abs() < 1e-6,
        "{latitude}"
    );
}

#[test]
fn without_a_place_on_the_earth_there_is_a_table_and_no_map() {
    let table = text("tracks.csv", None);
    assert!(table.lines().next().unwrap().ends_with(",end"));
    for name in ["tracks.geojson", "tracks.kml"] {
        let refused = check_targets_path(Path::new(name), None).unwrap_err();
        assert!(refused.to_string().contains("add [plane]"), "{refused}");
    }
    let refused = check_targets_path(Path::new("tracks.xls"), Some(&PLANE)).unwrap_err();
    assert!(refused.to_string().contains(".parquet"), "{refused}");
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_has_the_rows_of_the_text() {
    use ::parquet::file::reader::SerializedFileReader;
    use ::parquet::record::Field;
    let (_folder, path) = written("tracks.parquet", Some(&PLANE));
    let reader = SerializedFileReader::new(std::fs::File::open(path).unwrap()).unwrap();
    let rows: Vec<_> = reader.into_iter().map(|row| row.unwrap()).collect();
    assert_eq!(rows.len(), 3);
    let cells = |row: usize| -> std::collections::BTreeMap<String, Field> {
        rows[row]
            .get_column_iter()
            .map(|(n, f)| (n.clone(), f.clone()))
            .collect()
    };
    let (first, last) = (cells(0), cells(2));
    assert_eq!(first.len(), row::COLUMNS.len());
    assert_eq!(
        (&first["track"], &first["detection"]),
        (&Field::Long(117), &Field::Null)
    );
    assert_eq!(
        (&last["detection"], &last["scan"]),
        (&Field::Long(3), &Field::Long(42))
    );
    assert_eq!(last["end"], Field::Str("existence".to_owned()));
    assert_eq!(
        (&last["north_m"], &last["cov_ne_m2"]),
        (&Field::Double(1842.0), &Field::Double(1.5))
    );
}

#[test]
fn a_map_has_a_line_for_each_track() {
    let json: serde_json::Value = serde_json::from_str(&text("a.geojson", Some(&PLANE))).unwrap();
    let feature = &json["features"][0];
    assert_eq!(
        feature["geometry"]["coordinates"].as_array().unwrap().len(),
        3
    );
    assert_eq!(feature["properties"]["track"], 117);
    assert_eq!(
        feature["properties"]["std_ne_m"][0],
        serde_json::json!([2.0, 3.0])
    );
    assert_eq!(feature["properties"]["ended_because"], "existence");
    assert_eq!(feature["properties"]["start"], "2026-01-02T03:04:05Z");
    let kml = text("a.kml", Some(&PLANE));
    assert_eq!(
        kml.matches("<gx:coord>5.000000000 60.0").count(),
        3,
        "{kml}"
    );
    assert!(
        kml.contains("<name>bay, track 117</name>") && kml.contains("<when>2026-01-02T03:04:06Z")
    );
}

#[test]
fn chart_plotters_get_sentences_with_the_closest_approach() {
    let nmea = text("a.nmea", Some(&PLANE));
    let lines: Vec<&str> = nmea.lines().collect();
    // at each instant the own ship and two sentences of the target; at the last the own ship alone
    assert_eq!(lines.len(), 10, "{nmea}");
    for line in &lines {
        let (body, sum) = line[1..].split_once('*').unwrap();
        let expected = body.bytes().fold(0_u8, |sum, byte| sum ^ byte);
        assert_eq!(u8::from_str_radix(sum, 16).unwrap(), expected);
        assert!(line.len() <= 80, "longer than NMEA 0183 allows: {line}");
    }
    assert_eq!(
        lines[0],
        "$INRMC,030405.00,A,6000.00000,N,00500.00000,E,,,020126,,*25"
    );
    // 1 nautical mile ahead, coming south; nothing is known of the closest approach yet
    assert!(
        lines[1].starts_with("$RATTM,17,1.000,0.0,T,9.7,180.0,T,,,N,T117,T,,030405.00,A*"),
        "{nmea}"
    );
    assert!(lines[2].starts_with("$RATLL,17,6000.99"), "{nmea}");
    assert!(
        lines[3].contains(",A,6000.00269,N,00500.00000,E,9.72,0.0,020126,,"),
        "{nmea}"
    );
    // they meet head on: 1842 m between them at 10 m/s are 3.1 minutes
    assert!(lines[4].contains(",T,0.000,3.1,N,T117,T,"), "{nmea}");
    assert!(lines[7].contains(",N,T117,L,"), "the track ended: {nmea}");
    let without = text("b.nmea", None);
    assert!(
        without.lines().all(|line| line.starts_with("$RATTM")),
        "{without}"
    );
}

#[test]
fn minutes_are_never_sixty() {
    let [north, east] = [-1e-9, 0.0];
    let place = sentences::degrees_and_minutes(&PLANE, [north, east]);
    assert_eq!(place, "6000.00000,N,00500.00000,E");
    let south_west = LocalPlane {
        latitude_deg: -0.5,
        longitude_deg: -10.25,
    };
    let place = sentences::degrees_and_minutes(&south_west, [0.0, 0.0]);
    assert_eq!(place, "0030.00000,S,01015.00000,W");
}

#[test]
fn every_column_is_documented() {
    let formats = include_str!("../../../../../docs/formats.md");
    for (column, _) in row::COLUMNS {
        assert!(formats.contains(&format!("`{column}`")), "{column}");
    }
}
