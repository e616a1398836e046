//! The phone page's batches.

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::{said, turned, vectors};
use crate::event::{Sample, SensorKind};
use crate::wire::phone_page::{Batch, PhonePage};
use crate::wire::{Decoded, MOST_READINGS, Tone};

const G: f64 = 9.80665;

fn batch(platform: &str, readings: &Value) -> Vec<u8> {
    let mut batch = json!({"v": 1, "device": "d", "name": "n", "session": "s", "seq": 3,
        "platform": platform, "sent_ms": 12.5});
    for (key, rows) in readings.as_object().unwrap() {
        batch[key] = rows.clone();
    }
    batch.to_string().into_bytes()
}

fn decode(platform: &str, readings: &Value) -> Decoded {
    PhonePage::default().push(&batch(platform, readings))
}

/// DeviceMotion at rest with this gravity on z, ten times from `start_ms`.
fn rest(start_ms: u32, gravity: f64) -> Value {
    (0..10)
        .map(|index| json!([start_ms + 16 * index, 0, 0, 0, 0, 0, gravity, 0, 0, 0]))
        .collect()
}

#[test]
fn the_envelope_says_who_and_which() {
    let bytes = batch(
        "android",
        &json!({"events": [{"t_ms": 5.5, "kind": "hidden", "text": ""}, 7]}),
    );
    let batch = Batch::parse(&bytes).unwrap();
    assert_eq!(
        (batch.device.as_str(), batch.session.as_str(), batch.seq),
        ("d", "s", 3)
    );
    assert_eq!((batch.name.as_str(), batch.sent_ms), ("n", Some(12.5)));
    assert_eq!(batch.page_events[0].kind, "hidden");
    assert_eq!(batch.page_events[0].time_ns, Some(5_500_000));
}

#[test]
fn an_envelope_that_lacks_something_is_refused_in_one_line() {
    for (bytes, expected) in [
        (
            r#"{"v":2,"device":"d","session":"s","seq":0}"#,
            "`v` must be 1",
        ),
        (r#"{"v":1,"session":"s","seq":0}"#, "`device` is missing"),
        (r#"{"v":1,"device":"d","seq":0}"#, "`session` is missing"),
        (
            r#"{"v":1,"device":"d","session":"s","seq":-1}"#,
            "`seq` must be",
        ),
    ] {
        let error = Batch::parse(bytes.as_bytes()).unwrap_err();
        assert!(error.problem.contains(expected), "{error}");
        let decoded = PhonePage::default().push(bytes.as_bytes());
        assert_eq!(decoded.notices[0].tone, Tone::Bad);
    }
}

#[test]
fn device_motion_is_in_degrees_about_x_y_z_and_inverted_on_ios() {
    let readings = json!({"dm": [[100.25, 0, 0, 0, 1.0, -2.0, 9.0, 10.0, -20.0, 180.0]]});
    for (platform, sign) in [("android", 1.0), ("ios", -1.0)] {
        let out = decode(platform, &readings);
        assert_eq!(out.events[0].time_ns, 100_250_000);
        let force = vectors(&out, SensorKind::Accelerometer);
        assert_eq!(force, [[sign, -2.0 * sign, 9.0 * sign]]);
        let rate = vectors(&out, SensorKind::Gyroscope);
        assert_eq!(rate, [[10.0, -20.0, 180.0].map(f64::to_radians)]);
    }
}

#[test]
fn the_phones_own_orientation_beats_its_platform_string() {
    // An iPhone that follows the standard after all; standing upright on its lower edge.
    let motion: Value = (0..10)
        .map(|index| json!([16 * index, 0, 0, 0, 0, G, 0, 0, 0, 0]))
        .collect();
    let orientation: Value = (0..10)
        .map(|index| json!([16 * index, 40, 90, 0, 0, null, null]))
        .collect();
    let out = decode("ios", &json!({"dm": motion, "do": orientation}));
    assert_eq!(
        vectors(&out, SensorKind::Accelerometer),
        [[0.0, G, 0.0]; 10]
    );
    assert!(said(&out, "by the phone's own orientation"));
}

#[test]
fn without_platform_gravity_at_rest_decides_and_later_postures_do_not() {
    let mut page = PhonePage::default();
    let out = page.push(&batch("other", &json!({"dm": rest(0, -G)})));
    assert_eq!(
        vectors(&out, SensorKind::Accelerometer),
        [[0.0, 0.0, G]; 10]
    );
    assert!(said(&out, "if the screen was up"));
    let out = page.push(&batch("other", &json!({"dm": rest(1000, G)})));
    assert_eq!(
        vectors(&out, SensorKind::Accelerometer),
        [[0.0, 0.0, -G]; 10]
    );
    assert!(out.notices.is_empty(), "{:?}", out.notices);
}

#[test]
fn generic_sensors_are_preferred_while_they_come() {
    let mut page = PhonePage::default();
    let both = json!({"gs": {"a": [[10, 0, 0, 9.75]], "g": [[10, 0.5, 0, 0]]},
        "dm": [[12, 0, 0, 0, 0, 0, 9.5, 1, 1, 1]]});
    let out = page.push(&batch("android", &both));
    assert_eq!(vectors(&out, SensorKind::Accelerometer), [[0.0, 0.0, 9.75]]);
    assert_eq!(vectors(&out, SensorKind::Gyroscope), [[0.5, 0.0, 0.0]]);
    let later = json!({"dm": [[1500, 0, 0, 0, 0, 0, 9.5, 0, 0, 0]]});
    let out = page.push(&batch("android", &later));
    assert_eq!(vectors(&out, SensorKind::Accelerometer), [[0.0, 0.0, 9.5]]);
}

#[test]
fn orientation_angles_are_about_z_x_y_and_an_arbitrary_zero_is_turned_to_north_once() {
    // Top edge to the east: heading 90 deg clockwise is alpha 270 deg.
    let out = decode("android", &json!({"do": [[1, 270, 0, 0, 1, null, null]]}));
    approx::assert_relative_eq!(turned(&out, Vector3::y()), Vector3::x(), epsilon = 1e-12);
    // The same with alpha from anywhere, tilted by 30 deg.
    let mut page = PhonePage::default();
    let arbitrary = json!({"do": [[1, 77, 30, 0, 0, 90, 10]]});
    let out = page.push(&batch("ios", &arbitrary));
    let top = Vector3::new(30_f64.to_radians().cos(), 0.0, 0.5);
    approx::assert_relative_eq!(turned(&out, Vector3::y()), top, epsilon = 1e-12);
    // The compass jumps, the orientation does not.
    let out = page.push(&batch("ios", &json!({"do": [[17, 77, 30, 0, 0, 140, 10]]})));
    approx::assert_relative_eq!(turned(&out, Vector3::y()), top, epsilon = 1e-12);
    // Roll is about the top edge.
    let out = decode("android", &json!({"do": [[1, 0, 0, 90, 1]]}));
    approx::assert_relative_eq!(turned(&out, Vector3::z()), Vector3::x(), epsilon = 1e-12);
}

/// Headings with their deviations, deg, and their times, ms.
fn headings(out: &Decoded) -> Vec<(i64, f64, f64)> {
    let of = |e: &crate::Event| match e.sample {
        Sample::CompassHeading(c) => {
            let deg = [c.heading_rad, c.std_rad].map(|x| x.to_degrees().round());
            Some((e.time_ns / 1_000_000, deg[0], deg[1]))
        }
        _ => None,
    };
    out.events.iter().filter_map(of).collect()
}

#[test]
fn a_compass_gives_a_heading_ten_times_a_second_with_its_own_accuracy() {
    let rows: Value = (0..60)
        .map(|i| json!([17 * i, 77, 30, 0, 0, 90 + i, 15]))
        .collect();
    let out = decode("ios", &json!({ "do": rows }));
    let seen = headings(&out);
    assert_eq!(seen.len(), 10, "{seen:?}");
    assert_eq!(&seen[..2], [(0, 90.0, 15.0), (102, 96.0, 15.0)]);
}

#[test]
fn an_absolute_orientation_stands_in_for_a_compass_and_an_arbitrary_one_does_not() {
    let out = decode("android", &json!({"do": [[1, 270, 20, 0, 1, null, null]]}));
    assert_eq!(headings(&out), [(1, 90.0, 10.0)]);
    // x, y, z, w: a quarter turn to the right about up.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let out = decode("android", &json!({"gs": {"q": [[2, 0, 0, -half, half]]}}));
    assert_eq!(headings(&out), [(2, 90.0, 10.0)]);
    let out = decode("android", &json!({"do": [[1, 270, 0, 0, 0, null, null]]}));
    assert!(headings(&out).is_empty());
}

#[test]
fn no_heading_is_taken_upright_or_when_the_phone_does_not_trust_it() {
    for row in [
        json!([1, 77, 75, 0, 0, 90, 10]),
        json!([1, 77, 0, 0, 0, 90, -1]),
        json!([1, 77, 0, 0, 0, 400, 10]),
        json!([1, 77, -90, 0, 1, null, null]),
    ] {
        let out = decode("ios", &json!({ "do": [row] }));
        assert!(headings(&out).is_empty(), "{row}");
    }
}

#[test]
fn without_a_compass_the_zero_of_heading_is_said_to_be_arbitrary() {
    let out = decode("ios", &json!({"do": [[1, 77, 0, 0, 0, 90, -1]]}));
    assert_eq!(out.events.len(), 1);
    assert!(said(&out, "arbitrary zero"));
}

#[test]
fn one_bad_reading_costs_only_itself() {
    let out = decode(
        "android",
        &json!({
        "dm": [[1, 0, 0, 0, 0, 0, 9.8, 0, 0, 0], "nonsense", [2, 0, 0, 0, 0, 0, 1e9, 0, 0, 0],
            [3, 0, 0, 0, null, 0, 9.8, 0, null, 0], [null, 0, 0, 0, 0, 0, 9.8, 0, 0, 0],
            [4, 0, 0, 0, 0, 0, 9.8, 0, 0, 0]],
        "gs": 5, "do": [[1, null, 0, 0, 1], {}], "events": "none"}),
    );
    assert_eq!(vectors(&out, SensorKind::Accelerometer).len(), 2);
    assert_eq!(vectors(&out, SensorKind::Gyroscope).len(), 3);
    for part in [
        "no time",
        "is not plausible",
        "a number is missing",
        "An orientation was left out",
    ] {
        assert!(said(&out, part), "{part}: {:?}", out.notices);
    }
}

#[test]
fn missing_sensors_are_said() {
    let out = decode(
        "android",
        &json!({"dm": [[1, 0, 0, 0, 0, 0, 9.8, null, null, null]]}),
    );
    assert!(said(&out, "no gyroscope"));
    let out = decode(
        "android",
        &json!({"dm": [[1, 0, 0, 0, null, null, null, 0, 0, 0]]}),
    );
    assert!(said(&out, "no acceleration with gravity"));
}

#[test]
fn a_batch_that_is_too_long_is_used_up_to_the_limit() {
    let rows: Value = (0..MOST_READINGS + 7)
        .map(|i| json!([i, 0, 0, 0]))
        .collect();
    let out = decode(
        "android",
        &json!({"gs": {"g": rows}, "do": [[1, 0, 0, 0, 1]]}),
    );
    assert_eq!(out.events.len(), MOST_READINGS);
    let notice = out
        .notices
        .iter()
        .find(|n| n.text.contains("more than 2000"))
        .unwrap();
    assert_eq!(notice.count, 8);
}

#[test]
fn a_batch_keeps_no_more_readings_than_are_used() {
    let rows = vec!["[1,0,0,9.8]"; 3 * MOST_READINGS].join(",");
    let bytes = format!(r#"{{"v":1,"device":"d","session":"s","seq":0,"gs":{{"a":[{rows}]}}}}"#);
    let small = br#"{"v":1,"device":"d","session":"s","seq":0,"gs":{"a":[[1,0,0,9.8]]}}"#;
    let mut batch = Batch::parse(bytes.as_bytes()).unwrap();
    assert_eq!(
        batch.lists().iter().map(|list| list.len()).sum::<usize>(),
        MOST_READINGS
    );
    let decoded = PhonePage::default().decode(&batch);
    let notice = decoded
        .notices
        .iter()
        .find(|n| n.text.contains("more than 2000"));
    assert_eq!(notice.map(|n| n.count), Some(2 * MOST_READINGS as u64));
    let mut batch = Batch::parse(small).unwrap();
    assert_eq!(
        batch.lists().iter().map(|list| list.len()).sum::<usize>(),
        1
    );
}
