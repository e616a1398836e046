//! Fixes that cannot be are refused with one line that says what to do; odd ones are counted.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use northing_recording::{OpenOptions, Recording, manifest};
use support::error_of;

/// A drive of a minute at 12 m/s that turns slowly, a fix a second: seconds, latitude and longitude in
/// degrees, velocity north and east.
fn drive(latitude: f64, longitude: f64) -> Vec<[f64; 5]> {
    let mut place = [latitude, longitude];
    (0..60)
        .map(|i| {
            let t = f64::from(i);
            let course = 0.4 + t * 0.03;
            let v = [12.0 * course.cos(), 12.0 * course.sin()];
            let row = [t, place[0], place[1], v[0], v[1]];
            let metres_per_degree = 111_200.0;
            place[0] += v[0] / metres_per_degree;
            place[1] += v[1] / (metres_per_degree * latitude.to_radians().cos());
            row
        })
        .collect()
}

/// Reads a drive whose columns are called as the manifest wants them.
fn read(rows: &[[f64; 5]], keys: &str) -> Result<Recording, northing_recording::RecordingError> {
    let manifest = format!("time = {{ column = 1, unit = \"s\" }}\nheader = false\n{keys}\n");
    let data: String = rows
        .iter()
        .map(|[t, lat, lon, n, e]| format!("{t},{lat:.12},{lon:.12},{n},{e},0\n"))
        .collect();
    manifest::read_bytes(
        &manifest,
        data.into_bytes(),
        "drive.csv",
        &OpenOptions::default(),
    )
}

const RIGHT: &str =
    "gnss_position = { latitude = 2, longitude = 3 }\ngnss_velocity = { columns = [4, 5, 6] }";

fn remarks(rows: &[[f64; 5]]) -> Vec<String> {
    let mut recording = read(rows, RIGHT).unwrap();
    assert_eq!(
        recording.by_ref().filter(Result::is_ok).count(),
        2 * rows.len()
    );
    recording.issues().sentences()
}

#[test]
fn a_drive_passes_wherever_it_is() {
    for (latitude, longitude) in [
        (40.1, -105.1),
        (-33.9, 151.2),
        (1.3, 103.8),
        (0.7, -1.8),
        (70.0, 179.9999),
    ] {
        assert_eq!(
            remarks(&drive(latitude, longitude)),
            Vec::<String>::new(),
            "{latitude}"
        );
    }
}

#[test]
fn swapped_coordinates_are_told() {
    let swapped = RIGHT.replace("latitude = 2, longitude = 3", "latitude = 3, longitude = 2");
    // Beyond the pole: at once.
    let text = error_of(read(&drive(40.1, -105.1), &swapped));
    assert!(
        text.contains("beyond the pole") && text.contains("swapped"),
        "{text}"
    );
    assert!(
        text.contains("exchange `latitude` and `longitude`"),
        "{text}"
    );
    // A place that there is: by its velocity.
    let text = error_of(read(&drive(47.4, 8.5), &swapped));
    assert!(
        text.contains("do not go where the receiver's own velocity goes"),
        "{text}"
    );
    assert!(text.contains("look swapped"), "{text}");
    assert_eq!(text.lines().count(), 1);
}

#[test]
fn units_of_angles_are_told() {
    let radians = RIGHT.replace("longitude = 3", "longitude = 3, unit = \"rad\"");
    let text = error_of(read(&drive(47.4, 8.5), &radians));
    assert!(
        text.contains("degrees under the name of radians") && text.contains("unit = \"deg\""),
        "{text}"
    );
    let mut rows = drive(47.4, 8.5);
    for row in &mut rows {
        row[1] = row[1].to_radians();
        row[2] = row[2].to_radians();
    }
    let text = error_of(read(&rows, RIGHT));
    assert!(
        text.contains("radians under the name of degrees") && text.contains("unit = \"rad\""),
        "{text}"
    );
    let integers = RIGHT.replace("longitude = 3", "longitude = 3, unit = \"1e-7-deg\"");
    assert!(
        read(&rows, &integers)
            .unwrap()
            .filter(Result::is_err)
            .count()
            <= 1
    );
    for row in &mut rows {
        row[1] *= 1e9;
    }
    let text = error_of(read(&rows, RIGHT));
    assert!(
        text.contains("no place on the Earth") && text.contains("1e-7-deg"),
        "{text}"
    );
}

#[test]
fn a_longitude_that_counts_to_the_west_is_told() {
    let mut rows = drive(40.1, -105.1);
    rows.iter_mut().for_each(|row| row[2] = -row[2]);
    let text = error_of(read(&rows, RIGHT));
    assert!(text.contains("west were positive"), "{text}");
}

#[test]
fn jumps_and_repetitions_are_counted_and_delivered() {
    let mut rows = drive(47.4, 8.5);
    rows[30][1] += 0.01;
    rows[45][1] = rows[44][1];
    rows[45][2] = rows[44][2];
    let told = remarks(&rows);
    // There and back again.
    assert!(
        told.iter()
            .any(|s| s.contains("jump 2 time(s), by up to 11")),
        "{told:?}"
    );
    assert!(
        told.iter()
            .any(|s| s.starts_with("1 fix(es) repeat the position")),
        "{told:?}"
    );
}

#[test]
fn late_and_repeated_stamps_are_dropped_and_counted() {
    let mut rows = drive(47.4, 8.5);
    rows[20][0] = 15.0;
    rows[30][0] = rows[29][0];
    let mut recording = read(&rows, RIGHT).unwrap();
    let delivered: Vec<_> = recording.by_ref().map(Result::unwrap).collect();
    assert_eq!(delivered.len(), 2 * 58);
    assert!(
        delivered
            .windows(2)
            .all(|pair| pair[0].time_ns <= pair[1].time_ns)
    );
    let told = recording.issues().sentences().join(" ");
    assert!(
        told.contains("The time of gnss-position goes back once"),
        "{told}"
    );
    assert!(
        told.contains("The time of gnss-position repeats itself once"),
        "{told}"
    );
}

#[test]
fn a_velocity_with_its_columns_exchanged_or_in_another_unit_is_told() {
    let exchanged = RIGHT.replace("[4, 5, 6]", "[5, 4, 6]");
    let text = error_of(read(&drive(47.4, 8.5), &exchanged));
    assert!(
        text.contains("north and east of the velocity look swapped"),
        "{text}"
    );
    for (unit, ratio, name) in [
        (0.514_444, "0.51 times", "knots"),
        (1.0 / 3.6, "0.28 times", "km/h"),
        (0.447_04, "0.45 times", "miles an hour"),
        (0.01, "0.01 times", "cm/s"),
    ] {
        let mut rows = drive(47.4, 8.5);
        for row in &mut rows {
            row[3] /= unit;
            row[4] /= unit;
        }
        let text = error_of(read(&rows, RIGHT));
        assert!(
            text.contains(&format!(
                "the fixes go {ratio} as far as the receiver's own velocity"
            )) && text.contains(&format!("looks like {name} under the name of m/s")),
            "{text}"
        );
    }
}

/// A drive over hills of 60 m: what is said of heights and a velocity down that is `factor` times the right one, and `more` beside.
fn over_hills(factor: f64, more: f64) -> Result<Vec<String>, String> {
    let height = |t: f64| 400.0 + 30.0 * (0.2 * t).sin();
    let text: String = drive(47.4, 8.5)
        .iter()
        .map(|[t, lat, lon, n, e]| {
            let down = -6.0 * (0.2 * (t + 0.5)).cos() * factor + more;
            let noise = 0.8 * (7.7 * t).sin();
            format!(
                "{t},{lat:.12},{lon:.12},{n},{e},{down},{}\n",
                height(*t) + noise
            )
        })
        .collect();
    let manifest = "time = { column = 1, unit = \"s\" }\nheader = false\n\
                    gnss_position = { latitude = 2, longitude = 3, height = 7 }\n\
                    gnss_velocity = { columns = [4, 5, 6] }\n";
    let recording = manifest::read_bytes(
        manifest,
        text.into_bytes(),
        "drive.csv",
        &OpenOptions::default(),
    );
    let mut recording = recording.unwrap();
    match recording.find_map(Result::err) {
        Some(error) => Err(error.to_string()),
        None => Ok(recording.issues().sentences()),
    }
}

#[test]
fn a_velocity_down_that_is_up_is_told_and_one_that_is_off_is_said() {
    assert_eq!(over_hills(1.0, 0.0), Ok(Vec::new()));
    let up = over_hills(-1.0, 0.0).unwrap_err();
    assert!(up.contains("looks as if up were positive"), "{up}");
    let off = over_hills(0.0, 2.0).unwrap();
    assert!(
        off.len() == 1
            && off[0].contains("velocity goes 1")
            && off[0].contains("m down where its heights go"),
        "{off:?}"
    );
}
