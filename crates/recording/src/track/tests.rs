use super::*;

/// Two points 111 m apart on the Greenwich meridian, at a date or at seconds of a week.
fn points(start_ns: i64) -> Vec<TrackPoint> {
    let at = |time_ns, latitude_deg: f64| TrackPoint {
        time_ns,
        latitude_rad: latitude_deg.to_radians(),
        longitude_rad: (-0.0005_f64).to_radians(),
        height_m: 45.25,
        std_m: Some([0.1, 0.2, 0.3]),
        attitude: Some(UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0)),
    };
    let bad = TrackPoint {
        latitude_rad: f64::NAN,
        ..at(start_ns, 0.0)
    };
    vec![
        at(start_ns, 51.5),
        bad,
        at(start_ns + 1_500_000_000, 51.501),
    ]
}

/// 2014-08-01.
const DATE_NS: i64 = 1_406_851_200_000_000_000;

fn written(name: &str, title: &str, points: &[TrackPoint]) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_track(&path, title, points, false)?;
    Ok(std::fs::read(&path).unwrap())
}

fn text(name: &str, points: &[TrackPoint]) -> String {
    String::from_utf8(written(name, "a < b & \"c\"\u{7}", points).unwrap()).unwrap()
}

#[test]
fn gpx_has_times_only_where_the_stamps_are_dates() {
    let dated = text("t.gpx", &points(DATE_NS));
    assert!(
        dated.contains("<name>a &lt; b &amp; &quot;c&quot; </name>"),
        "{dated}"
    );
    let second = "<trkpt lat=\"51.501000000\" lon=\"-0.000500000\"><ele>45.250</ele>\
        <time>2014-08-01T00:00:01.500Z</time></trkpt>\n</trkseg>";
    assert!(dated.contains(second), "{dated}");
    assert_eq!(dated.matches("<trkpt").count(), 2);
    assert!(!text("t.gpx", &points(0)).contains("<time>"));
}

#[test]
fn kml_is_a_track_or_a_line() {
    let dated = text("t.kml", &points(DATE_NS));
    assert_eq!(
        dated.matches("<when>").count(),
        dated.matches("<gx:coord>").count()
    );
    assert!(
        dated.contains("<gx:coord>-0.000500000 51.500000000 45.250</gx:coord>"),
        "{dated}"
    );
    let line = text("t.kml", &points(0));
    assert!(
        line.contains("\n-0.000500000,51.501000000,45.250\n"),
        "{line}"
    );
    assert!(!line.contains("gx:Track"), "{line}");
}

#[test]
fn geojson_is_a_line_with_its_uncertainty() {
    let read: serde_json::Value =
        serde_json::from_str(&text("t.geojson", &points(DATE_NS))).unwrap();
    let feature = &read["features"][0];
    assert_eq!(feature["geometry"]["type"], "LineString");
    assert_eq!(
        feature["geometry"]["coordinates"][1],
        serde_json::json!([-0.0005, 51.501, 45.25])
    );
    assert_eq!(
        feature["properties"]["std_ned_m"][0],
        serde_json::json!([0.1, 0.2, 0.3])
    );
    assert_eq!(feature["properties"]["start"], "2014-08-01T00:00:00Z");
    assert_eq!(feature["properties"]["name"], "a < b & \"c\"\u{7}");
    let one: serde_json::Value = serde_json::from_str(&text("t.geojson", &points(0)[..1])).unwrap();
    assert_eq!(one["features"][0]["geometry"]["type"], "Point");
    assert!(one["features"][0]["properties"].get("start").is_none());
}

#[test]
fn a_height_that_is_not_known_is_left_out() {
    for start_ns in [0, DATE_NS] {
        let mut points = points(start_ns);
        points.last_mut().unwrap().height_m = f64::NAN;
        let gpx = text("t.gpx", &points);
        assert_eq!(gpx.matches("<trkpt").count(), 2);
        assert_eq!(gpx.matches("<ele>").count(), 1);
        let kml = text("t.kml", &points);
        let last = match start_ns {
            0 => "\n-0.000500000,51.501000000\n",
            _ => "<gx:coord>-0.000500000 51.501000000</gx:coord>",
        };
        assert!(kml.contains(last), "{kml}");
        let json: serde_json::Value = serde_json::from_str(&text("t.geojson", &points)).unwrap();
        let line = &json["features"][0]["geometry"]["coordinates"];
        assert_eq!(
            *line,
            serde_json::json!([[-0.0005, 51.5, 45.25], [-0.0005, 51.501]])
        );
        assert!(!text("t.tum", &points).contains("NaN"));
    }
}

#[test]
fn tum_counts_metres_from_the_first_point() {
    let read = text("t.tum", &points(0));
    let last: Vec<f64> = read
        .lines()
        .last()
        .unwrap()
        .split(' ')
        .map(|x| x.parse().unwrap())
        .collect();
    approx::assert_relative_eq!(last[0], 1.5);
    approx::assert_relative_eq!(last[1], 111.26, epsilon = 0.01);
    approx::assert_relative_eq!(last[6], 0.5_f64.sin(), epsilon = 1e-12);
}

#[cfg(feature = "mcap")]
#[test]
fn mcap_has_fixes_with_covariance() {
    let bytes = written("t.mcap", "walk", &points(DATE_NS)).unwrap();
    let messages: Vec<_> = ::mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(std::result::Result::unwrap)
        .collect();
    assert_eq!(messages.len(), 2);
    let message = &messages[1];
    assert_eq!(message.channel.topic, "/fix");
    assert_eq!(message.log_time, DATE_NS as u64 + 1_500_000_000);
    assert_eq!(
        message.channel.schema.as_ref().unwrap().name,
        "sensor_msgs/msg/NavSatFix"
    );
    // Behind 4 bytes of encapsulation: stamp 8, "gps" 4 + 4, status 1, (1), service 2, (4): latitude.
    let data = &message.data[4..];
    let number = |at: usize| f64::from_le_bytes(data[at..at + 8].try_into().unwrap());
    approx::assert_relative_eq!(number(24), 51.501, epsilon = 1e-12);
    approx::assert_relative_eq!(number(40), 45.25);
    approx::assert_relative_eq!(number(48), 0.2 * 0.2);
    approx::assert_relative_eq!(number(48 + 8 * 8), 0.3 * 0.3);
    assert_eq!(data[48 + 72], 2);
    assert_eq!(data.len(), 48 + 73);
}

#[test]
fn what_cannot_be_written_is_told() {
    let told =
        |name: &str, points: &[TrackPoint]| written(name, "x", points).unwrap_err().to_string();
    assert!(told("t.shp", &points(0)).contains(".kml, .gpx, .geojson, .tum or .mcap"));
    assert!(told("t", &points(0)).contains(".kml"));
    assert!(told("t.gpx", &points(0)[1..2]).contains("no position"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.kml");
    write_track(&path, "x", &points(0), false).unwrap();
    let twice = write_track(&path, "x", &points(0), false).unwrap_err();
    assert!(twice.to_string().contains("--force"), "{twice}");
    write_track(&path, "x", &points(0), true).unwrap();
}
