//! Times and rates of rows in drafts of manifests.

use northing_recording::describe::Confidence;

use super::{draft_of, read, slow, sure};
use crate::tables::{Random, recording};

#[test]
fn the_unit_of_time_that_a_header_names_holds_at_any_rate_that_can_be() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(11);
    let rows = recording(&mut random, 100.0, 3.0);
    let seconds = |events: &[northing_recording::Event]| {
        (events[events.len() - 1].time_ns - events[0].time_ns) as f64 * 1e-9
    };
    let (draft, events) = read(
        folder.path(),
        "a.csv",
        &slow("t_s", &rows, |k| k.to_string()),
        None,
    );
    assert!(
        (seconds(&events) - 299.0).abs() < 1e-9,
        "{}",
        draft.manifest
    );
    assert_eq!(sure(&draft, "time"), Confidence::Likely);
    // Without a unit in the header both are as plausible, which is said.
    let (draft, _) = read(
        folder.path(),
        "a.csv",
        &slow("time", &rows, |k| k.to_string()),
        None,
    );
    assert_eq!(sure(&draft, "time"), Confidence::Assumed);
    assert!(
        draft.manifest.contains("in s it would be 1.0000 Hz"),
        "{}",
        draft.manifest
    );
    // Ten nanoseconds are no time of a row.
    let ten = |k: usize| (10 * k).to_string();
    let (draft, events) = read(folder.path(), "a.csv", &slow("t_ns", &rows, ten), None);
    assert!((seconds(&events) - 2.99).abs() < 1e-9, "{}", draft.manifest);
    assert!(
        draft.manifest.contains("the header says ns"),
        "{}",
        draft.manifest
    );
}

#[test]
fn a_finer_clock_stands_before_dates_that_are_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(12);
    let rows = recording(&mut random, 100.0, 5.0);
    let time = |k: usize| format!("2024-05-06 07:08:{:02},{}", k / 100, 10 * k);
    let text = slow("date,elapsed_ms", &rows, time);
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert_eq!(
        events[2].time_ns - events[0].time_ns,
        10_000_000,
        "{}",
        draft.manifest
    );
    // What only happens to grow is no clock.
    let time = |k: usize| format!("2024-05-06 07:08:{:02},{}", k / 100, 0.01 * k as f64);
    let text = slow("date,wound_up", &rows, time);
    let (draft, _) = draft_of(folder.path(), &text);
    assert!(draft.contains("column = \"date\""), "{draft}");
    // Dates as fine are better: they tell when it was.
    let time = |k: usize| format!("2024-05-06 07:08:{:06.3},{}", k as f64 * 0.01, 10 * k);
    let text = slow("date,elapsed_ms", &rows, time);
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert_eq!(
        events[0].time_ns, 1_714_979_280_000_000_000,
        "{}",
        draft.manifest
    );
}

#[test]
fn times_of_day_and_dates_with_the_day_first_are_read_with_their_holes() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(11), 100.0, 20.0);
    // Ten seconds are missing, and midnight is between.
    let clock = |k: usize| {
        let s = 86_390.0 + k as f64 * 0.01 + if k < 500 { 0.0 } else { 10.0 };
        let of_day = s % 86_400.0;
        let (h, m) = ((of_day / 3600.0).floor(), (of_day / 60.0).floor() % 60.0);
        (
            s >= 86_400.0,
            format!("{h:02}:{m:02}:{:06.3}", of_day % 60.0),
        )
    };
    let dates = |k: usize| {
        let (is_next, clock) = clock(k);
        format!("{}.03.2025 {clock}", if is_next { "02" } else { "01" })
    };
    type Stamps<'a> = &'a dyn Fn(usize) -> String;
    let forms: [(&str, Stamps<'_>, &str); 3] = [
        ("time", &|k| clock(k).1, "time-of-day"),
        ("Datum", &dates, "date-time"),
        // Which number is the month nobody knows; the clock is enough.
        (
            "Date,Time",
            &|k| format!("03/04/2025,{}", clock(k).1),
            "time-of-day",
        ),
    ];
    for (header, time, unit) in forms {
        let (draft, events) = read(folder.path(), "a.csv", &slow(header, &rows, time), None);
        assert!(
            draft.manifest.contains(&format!("unit = \"{unit}\"")),
            "{}",
            draft.manifest
        );
        let seconds = (events[events.len() - 1].time_ns - events[0].time_ns) as f64 * 1e-9;
        assert!(
            (seconds - (rows.len() as f64 - 1.0) * 0.01 - 10.0).abs() < 1e-6,
            "{header}: {seconds}"
        );
    }
    // What is called a time and is none is said.
    for (time, why) in [
        (
            "03/04/2025 12:00:00",
            "is called a time, but `03/04/2025 12:00:00` is none that can be read",
        ),
        ("7", "is called a time, but its numbers do not go on"),
    ] {
        let (text, _) = draft_of(folder.path(), &slow("time", &rows, |_| time.to_owned()));
        assert!(text.contains("rate_hz =") && text.contains(why), "{text}");
    }
}

#[test]
fn times_cut_to_whole_seconds_are_counted_and_a_rate_is_never_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(12), 100.0, 30.0);
    let clock = |k: usize| format!("23:59:{:02}", 20 + k / 100);
    let text = slow("time", &rows, clock);
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    let why = "column `time` has one stamp for about 100 rows, 1.000 s apart";
    assert!(
        draft.manifest.contains(why) && draft.manifest.contains("rate_hz = 100.0"),
        "{}",
        draft.manifest
    );
    assert_eq!(events.len(), 2 * rows.len());
    let (draft, _) = read(folder.path(), "a.csv", &text, Some(99.5));
    assert!(
        draft.manifest.contains("rate_hz = 99.5"),
        "{}",
        draft.manifest
    );
    // Samples that are held until the next stamp are no samples.
    let lines: Vec<&str> = text.lines().collect();
    let held = (0..rows.len()).map(|k| format!("{}\n", lines[1 + k - k % 100]));
    let held = format!("{}\n{}", lines[0], held.collect::<String>());
    let (text, _) = draft_of(folder.path(), &held);
    assert!(text.contains("unit = \"time-of-day\""), "{text}");
    // Stamps that are good make a rate invalid.
    let path = folder.path().join("b.csv");
    std::fs::write(
        &path,
        slow("t_s", &rows, |k| format!("{:.2}", k as f64 * 0.01)),
    )
    .unwrap();
    let refused = northing_recording::describe::draft(&[path], folder.path(), Some(100.0));
    let refused = refused.unwrap_err().to_string();
    assert!(
        refused.contains("column `t_s`") && refused.contains("leave --rate out"),
        "{refused}"
    );
}
