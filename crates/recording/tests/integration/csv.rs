//! Our CSV: what is read, and every way in which a file can be wrong.

use crate::support;

use northing_recording::{
    Format, OpenOptions, Reference, Sample, SensorKind, WorldFrame, open, read_from,
};
use proptest::prelude::*;
use support::{csv, error_of, events};

const GYRO: &str = "gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s";

#[test]
fn columns_in_any_order_with_metadata_and_empty_cells() {
    let text = "\u{feff}# name: walk\n# device: phone 7\n# world_frame: ned\n# weather: rain: heavy\n\
        acc_z_m_s2,acc_x_m_s2,acc_y_m_s2,t_s,gyro_z_rad_s,gyro_x_rad_s,gyro_y_rad_s,ref_qw,ref_qx,ref_qy,ref_qz,scored,pressure_pa\r\n\
        9.5,0.5,-1e-1,1763697600.000000001,3,1,2,1,0,0,0,0,\r\n\
        ,,,1763697600.005,6,4,5,,,,,,101325\n\
        \n\
        ,,,1763697600.010,9,7,8,2,0,0,0,1,\n";
    let mut recording = csv(text).unwrap();
    let metadata = recording.metadata().clone();
    assert_eq!(metadata.name, "walk");
    assert_eq!(metadata.device.as_deref(), Some("phone 7"));
    assert_eq!(metadata.world_frame, WorldFrame::Ned);
    assert_eq!(metadata.extra["weather"], "rain: heavy");
    assert_eq!(
        recording.sensors(),
        [
            SensorKind::Gyroscope,
            SensorKind::Accelerometer,
            SensorKind::Pressure,
            SensorKind::Reference
        ]
    );
    let events = events(&mut recording).unwrap();
    let stamps: Vec<i64> = events
        .iter()
        .map(|event| event.time_ns - 1_763_697_600_000_000_000)
        .collect();
    assert_eq!(
        stamps,
        [1, 1, 1, 5_000_000, 5_000_000, 10_000_000, 10_000_000]
    );
    assert_eq!(
        events[0].sample,
        Sample::AngularRate([1.0, 2.0, 3.0].into())
    );
    assert_eq!(
        events[1].sample,
        Sample::SpecificForce([0.5, -0.1, 9.5].into())
    );
    let at_identity = |scored| {
        Sample::Reference(Reference {
            attitude: nalgebra::UnitQuaternion::identity(),
            scored,
        })
    };
    assert_eq!(events[2].sample, at_identity(false));
    assert_eq!(events[4].sample, Sample::Pressure(101_325.0));
    assert_eq!(events[6].sample, at_identity(true));
    assert!(recording.issues().is_empty());
}

#[test]
fn more_comments_than_the_head_that_tells_the_format() {
    let comments: String = (0..500).map(|i| format!("# key {i}: value\n")).collect();
    let recording = csv(&format!("{comments}t_s,{GYRO}\n0,0,0,0\n")).unwrap();
    assert_eq!(recording.metadata().extra.len(), 500);
    assert_eq!(recording.count(), 1);
}

#[test]
fn nanosecond_stamps_and_unused_columns() {
    let mut recording = csv(&format!(
        "t_ns,{GYRO},temperature\n1763697600000000001,0,0,0,20\n"
    ))
    .unwrap();
    let events = events(&mut recording).unwrap();
    assert_eq!(events[0].time_ns, 1_763_697_600_000_000_001);
    assert_eq!(
        recording.issues().sentences(),
        ["Columns not used: temperature."]
    );
}

#[test]
fn rows_without_a_stamp_and_non_finite_samples_are_counted() {
    let mut recording = csv(&format!(
        "t_s,{GYRO}\n0,0,0,0\n,1,1,1\nNaN,1,1,1\n0.01,nan,0,0\n0.02,1,inf,0\n0.03,1,,0\n0.04,0,0,0\n"
    ))
    .unwrap();
    let events = events(&mut recording).unwrap();
    assert_eq!(events.len(), 5);
    assert_eq!(recording.issues().rows_without_stamp, 2);
    assert_eq!(
        recording.issues().non_finite_samples[&SensorKind::Gyroscope],
        3
    );
    assert_eq!(
        events
            .iter()
            .filter(|event| event.sample.is_finite())
            .count(),
        2
    );
    assert_eq!(
        recording.issues().sentences(),
        [
            "Dropped for want of a time stamp: 2 row(s).",
            "The gyroscope has 3 sample(s) with NaN or infinity; estimators skip them."
        ]
    );
}

#[test]
fn time_that_stumbles_is_counted_and_time_that_runs_back_refused() {
    let mut recording = csv(&format!(
        "t_s,{GYRO}\n0,0,0,0\n0.01,0,0,0\n0.01,1,1,1\n0.005,2,2,2\n0.02,0,0,0\n1.02,0,0,0\n"
    ))
    .unwrap();
    assert_eq!(events(&mut recording).unwrap().len(), 4);
    let issues = recording.issues();
    assert_eq!(issues.duplicate_stamps[&SensorKind::Gyroscope], 1);
    assert_eq!(issues.stamps_going_back[&SensorKind::Gyroscope], 1);
    assert_eq!((issues.gaps, issues.longest_gap_start_s), (1, 0.02));

    let error = error_of(csv(&format!("t_s,{GYRO}\n3,0,0,0\n2,0,0,0\n1,0,0,0\n")));
    assert_eq!(
        error,
        "test.csv: time runs backwards: 2 of 3 gyroscope stamps are earlier than one before them; \
         sort the rows by time, or check the time column and its unit"
    );
}

/// `micros()` of a board starts again after 4294.967296 s, whatever the unit that it was written in.
#[test]
fn a_counter_of_32_bits_that_starts_again_goes_on() {
    let full_us = 1_u64 << 32;
    let stamps = (0..400_u64).map(|k| (2 * full_us - 1_000_000 + 10_000 * k) % full_us);
    let rows: String = stamps
        .map(|us| format!("{}.{:06},0.1,0,0\n", us / 1_000_000, us % 1_000_000))
        .collect();
    let mut recording = csv(&format!("t_s,{GYRO}\n{rows}")).unwrap();
    let events = events(&mut recording).unwrap();
    assert_eq!(events.len(), 400);
    for pair in events.windows(2) {
        assert_eq!(pair[1].time_ns - pair[0].time_ns, 10_000_000);
    }
    let said = recording.issues().sentences();
    assert_eq!(
        said,
        [
            "The time starts again at line 102, where a counter of 32 bits is full: 4294.967296 s are added from there on."
        ]
    );
}

/// Seconds since midnight, and those of a GPS week.
#[test]
fn seconds_of_a_day_or_a_week_go_on_where_it_ends() {
    for (length_s, what) in [(86_400, "a day"), (604_800, "a week")] {
        let rows: String = (0..4000)
            .map(|k| (length_s * 100 - 1000 + k) % (length_s * 100))
            .map(|t| format!("{}.{:02},0.1,0,0\n", t / 100, t % 100))
            .collect();
        let mut recording = csv(&format!("t_s,{GYRO}\n{rows}")).unwrap();
        let events = events(&mut recording).unwrap();
        assert_eq!(events.len(), 4000);
        for pair in events.windows(2) {
            assert_eq!(pair[1].time_ns - pair[0].time_ns, 10_000_000);
        }
        let said = recording.issues().sentences();
        let told = format!(
            "The time starts again at line 1002, where the seconds of {what} are over: {length_s}.000000 s are added from there on."
        );
        assert_eq!(said, [told]);
    }
}

#[test]
fn bad_cells_name_line_and_column() {
    let error = error_of(csv(&format!(
        "# name: x\nt_s,{GYRO}\n0,0,0,0\n0.1,0,zero,0\n"
    )));
    assert_eq!(
        error,
        "test.csv, line 4, column `gyro_y_rad_s`: `zero` is not a number (leave the cell empty where there is no sample)"
    );
    let error = error_of(csv(&format!("t_s,{GYRO}\n12:00,0,0,0\n")));
    assert!(
        error.starts_with("test.csv, line 2, column `t_s`: `12:00` is not a time stamp"),
        "{error}"
    );
    let error = error_of(csv(&format!("t_s,{GYRO}\n0,0,0,0\n0.1,0,0\n")));
    assert_eq!(
        error,
        "test.csv, line 3: 3 cells where the first row has 4; is the line cut off?"
    );
    let error = error_of(csv(&format!(
        "t_s,{GYRO},ref_qw,ref_qx,ref_qy,ref_qz,scored\n0,0,0,0,1,0,0,0,maybe\n"
    )));
    assert_eq!(
        error,
        "test.csv, line 2, column `scored`: `maybe` is not 0 or 1"
    );
    let error = error_of(csv(&format!("# world_frame: up\nt_s,{GYRO}\n")));
    assert_eq!(
        error,
        "test.csv, line 1: unknown world_frame `up`; expected enu or ned"
    );
}

#[test]
fn missing_columns_list_what_is_there() {
    let error = error_of(csv("t_s,gyro_x_rad_s,gyro_z_rad_s\n0,0,0\n"));
    assert!(
        error.starts_with(
            "test.csv: missing column gyro_y_rad_s; the file has t_s, gyro_x_rad_s, gyro_z_rad_s; name the columns"
        ),
        "{error}"
    );
    let error = error_of(csv("time,gx,gy,gz\n0,0,0,0\n"));
    assert!(
        error.starts_with("test.csv: missing column t_s; the file has time, gx, gy, gz;"),
        "{error}"
    );
    let error = error_of(csv("t_s,gx,gy,gz\n0,0,0,0\n"));
    assert!(
        error.starts_with("test.csv: missing the columns of any sensor;"),
        "{error}"
    );
    let error = error_of(csv("time,seconds_elapsed,z,y,x\n0,0,0,0,0\n"));
    assert!(error.contains("open its folder or zip"), "{error}");
    let error = error_of(csv(&format!("t_s,t_s,{GYRO}\n0,0,0,0,0\n")));
    assert_eq!(
        error,
        "test.csv: column `t_s` is there twice; keep one of them"
    );
}

#[test]
fn a_false_stamp_costs_its_row_and_is_told_with_line_and_value() {
    let rows = (0..100).map(|k| {
        let t_s = 0.01 * f64::from(k) + if k == 50 { 30.0 } else { 0.0 };
        format!("{t_s:.3},0.{k},0,0\n")
    });
    let text = format!("# name: walk\nt_s,{GYRO}\n{}", rows.collect::<String>());
    let mut recording = csv(&text).unwrap();
    let events = events(&mut recording).unwrap();
    assert_eq!(events.len(), 99);
    assert!(
        events
            .windows(2)
            .all(|pair| pair[0].time_ns < pair[1].time_ns)
    );
    assert_eq!(
        recording.issues().sentences(),
        [
            "test.csv, line 53: a false time stamp 30.5 s, 30.010 s ahead of those around it; what is stamped with it is left out."
        ]
    );
}

#[test]
fn no_gyroscope_is_known_at_open_and_the_other_sensors_are_optional() {
    let error = csv("t_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2\n0,0,0,9.81\n").unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("test.csv: no gyroscope: it has accelerometer;"),
        "{error}"
    );
    assert_eq!(
        events(&mut csv(&format!("t_s,{GYRO}\n0,0,0,0\n")).unwrap())
            .unwrap()
            .len(),
        1
    );
}

#[test]
fn empty_files_and_other_files_are_named() {
    assert_eq!(
        error_of(csv("")),
        "test.csv: empty: 0 bytes; expected a recording"
    );
    let error = error_of(csv(&format!("t_s,{GYRO}\n")));
    assert_eq!(
        error,
        "test.csv: empty: no sample with a time stamp; expected at least one sample"
    );
    assert!(error_of(csv("Dear diary\n")).starts_with("test.csv: not a recording: text without"));
    let zeros = northing_recording::read_bytes(vec![1, 0, 2, 0], "x.bin", &OpenOptions::default());
    assert!(error_of(zeros).starts_with("x.bin: not a recording: binary data"));
    let folder = tempfile::tempdir().unwrap();
    let missing = open(&folder.path().join("no.csv"), &OpenOptions::default());
    assert!(error_of(missing).contains("no.csv: cannot open it: "));
}

#[test]
fn a_stream_is_read_and_formats_that_jump_are_refused() {
    let text = format!("t_s,{GYRO}\n0,0,0,0\n0.01,0,0,0\n");
    let options = OpenOptions::default();
    let recording = read_from(std::io::Cursor::new(text), "standard input", &options).unwrap();
    assert_eq!(recording.count(), 2);
    let error = read_from(&b"PAR1...."[..], "standard input", &options).unwrap_err();
    assert_eq!(
        error.to_string(),
        "standard input: parquet cannot be read from a stream; save it to a file and open that"
    );
}

/// A pipe whose writer is slow: one byte at a time.
struct Trickle(std::io::Cursor<Vec<u8>>);

impl std::io::Read for Trickle {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let most = out.len().min(1);
        self.0.read(&mut out[..most])
    }
}

#[test]
fn a_stream_may_come_in_pieces_of_any_size() {
    let text = format!("# device: slow\nt_s,{GYRO}\n0,0,0,0\n0.01,0,0,0\n");
    let input = Trickle(std::io::Cursor::new(text.into_bytes()));
    let recording = read_from(input, "standard input", &OpenOptions::default()).unwrap();
    assert_eq!(recording.metadata().device.as_deref(), Some("slow"));
    assert_eq!(recording.count(), 2);
}

proptest! {
    #![proptest_config(support::arbitrary_cases(256, 0xc5))]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let options = OpenOptions { format: Some(Format::Csv), ..OpenOptions::default() };
        if let Ok(recording) = northing_recording::read_bytes(bytes, "fuzz", &options) {
            recording.for_each(drop);
        }
    }

    #[test]
    fn arbitrary_rows_never_panic(rows in "[-0-9.,eEnaif#\"\n]{0,300}") {
        let text = format!("t_s,{GYRO},ref_qw,ref_qx,ref_qy,ref_qz,scored\n{rows}");
        if let Ok(recording) = csv(&text) {
            recording.for_each(drop);
        }
    }
}
