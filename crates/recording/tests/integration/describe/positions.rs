//! Positions, heights and accuracies in drafts of manifests.

use northing_recording::Sample;

use super::{draft_of_files, read, slow};
use crate::tables::{Random, recording};

#[test]
fn cells_with_a_line_inside_and_heights_in_feet_or_millimetres_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let text = |header: &str, height: &str, factor: f64| {
        let rows = (0..20).map(|k| {
            let at = |degrees: f64| (degrees + 1e-5 * f64::from(k)) * factor;
            format!(
                "{k},{},{},{height},\"$GPGGA,{k},0*63\r\n\"\n",
                at(47.0),
                at(8.5)
            )
        });
        format!(
            "t,latitude,longitude,{header},raw\n{}",
            rows.collect::<String>()
        )
    };
    let height = |header: &str, height: &str, factor: f64| {
        let (draft, events) = read(folder.path(), "a.csv", &text(header, height, factor), None);
        assert_eq!(events.len(), 20, "{}", draft.manifest);
        match &events[3].sample {
            Sample::GnssPosition(fix) => fix.height_m.unwrap(),
            other => panic!("{other:?}"),
        }
    };
    assert!((height("alt", "300", 1.0) - 300.0).abs() < 1e-9);
    assert!((height("alt_ft", "1000", 1.0) - 304.8).abs() < 1e-9);
    assert!((height("hMSL", "300123", 1e7) - 300.123).abs() < 1e-9);
}

#[test]
fn fixes_of_zeros_between_epochs_are_said_and_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..2000)
        .map(|k| match k % 100 {
            0 => format!(
                "{:.2},{},8.5,300\n",
                0.01 * f64::from(k),
                47.0 + 1e-5 * f64::from(k)
            ),
            _ => format!("{:.2},0,0,0\n", 0.01 * f64::from(k)),
        })
        .collect();
    let text = format!("time,latitude,longitude,altitude\n{rows}");
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert_eq!(events.len(), 20, "{}", draft.manifest);
    assert!(
        draft
            .manifest
            .contains("both are exactly 0 in 1980 of 2000 rows, which is taken as no fix"),
        "{}",
        draft.manifest
    );
}

#[test]
fn columns_of_u_blox_are_millimetres_where_the_height_is() {
    let folder = tempfile::tempdir().unwrap();
    for moving in [0.0, 1.0] {
        let rows: String = (0..60)
            .map(|k| {
                let north = 487_000_000 + (moving * 1800.0 * f64::from(k)) as i64;
                let speed = (moving * 20_000.0) as i64 + 100;
                format!(
                    "{},{north},91000123,303372,{speed},20,-25,1500,2000\n",
                    1000 * k
                )
            })
            .collect();
        let text = format!("time_ms,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc\n{rows}");
        let (draft, events) = read(folder.path(), "a.csv", &text, None);
        for line in ["accuracy_unit = \"mm\"", "speed_unit = \"mm-per-s\""] {
            assert!(draft.manifest.contains(line), "{}", draft.manifest);
        }
        assert!(events.iter().any(|event| matches!(
            event.sample,
            Sample::GnssPosition(fix) if fix.std_m.is_some_and(|std| (std[2] - 2.0).abs() < 1e-9)
        )));
    }
}

/// Phones and loggers of positions tell one number.
#[test]
fn an_accuracy_that_stands_alone_is_the_radius_of_a_fix() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["h_acc", "accuracy", "gps_accuracy", "horizontal_accuracy_m"] {
        let rows: String = (0..60)
            .map(|k| format!("{k},48.{:05},11.5,500,4.0\n", 10_000 + 9 * k))
            .collect();
        let text = format!("time_s,latitude,longitude,altitude,{name}\n{rows}");
        let (draft, events) = read(folder.path(), "a.csv", &text, None);
        let manifest = &draft.manifest;
        assert!(manifest.contains("taken as the radius"), "{manifest}");
        assert!(events.iter().all(|event| matches!(
            event.sample,
            Sample::GnssPosition(fix) if fix.std_m.is_some_and(|std| {
                let expected = [8_f64.sqrt(), 8_f64.sqrt(), 6.8];
                (std.iter().zip(expected)).all(|(std, expected)| (std - expected).abs() < 1e-9)
            })
        )));
    }
}

#[test]
fn the_accuracy_of_a_speed_or_a_course_is_none_of_a_fix() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "gps_speed_accuracy",
        "gps_bearing_accuracy",
        "magnetometer_accuracy",
    ] {
        let rows: String = (0..60)
            .map(|k| format!("{k},48.{:05},11.5,500,0.3\n", 10_000 + 9 * k))
            .collect();
        let text = format!("time_s,latitude,longitude,altitude,{name}\n{rows}");
        let (draft, _) = read(folder.path(), "a.csv", &text, None);
        let manifest = &draft.manifest;
        assert!(!manifest.contains("accuracy ="), "{manifest}");
    }
}

#[test]
fn degrees_with_minutes_are_read_and_what_is_no_position_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let text = |latitude: f64, beside: &str| {
        let rows: String = (0..40)
            .map(|k| {
                let t = f64::from(k);
                format!(
                    "{k},{:.5},{beside},{:.5},E,300\n",
                    latitude + 0.01 * t,
                    906.0 + 0.002 * t
                )
            })
            .collect();
        format!("time_s,lat,ns,lon,ew,alt\n{rows}")
    };
    let (draft, events) = read(folder.path(), "a.csv", &text(4841.9, "N"), None);
    assert!(
        draft.manifest.contains("unit = \"deg-min\""),
        "{}",
        draft.manifest
    );
    let Sample::GnssPosition(fix) = events[0].sample else {
        panic!("{:?}", events[0])
    };
    assert!((fix.latitude_rad.to_degrees() - 48.0 - 41.9 / 60.0).abs() < 1e-9);
    // Beside a sensor that is found.
    let imu = slow("t_s", &recording(&mut Random(3), 100.0, 20.0), |k| {
        format!("{:.2}", k as f64 * 0.01)
    });
    let paths = ["imu.csv", "fixes.csv"].map(|name| folder.path().join(name));
    std::fs::write(&paths[0], imu).unwrap();
    for (fixes, why) in [
        (text(4871.9, "N"), "which are no degrees, radians"),
        (text(4841.9, "S"), "`ns` beside it says S"),
    ] {
        std::fs::write(&paths[1], fixes).unwrap();
        let made = draft_of_files(&paths, folder.path());
        let is_told = made.remarks.iter().any(|remark| {
            remark.starts_with("fixes.csv: lat, lon are called a position, but are not used")
                && remark.contains(why)
        });
        assert!(is_told, "{:?}", made.remarks);
        let alone =
            northing_recording::describe::draft(&paths[1..], folder.path(), None).unwrap_err();
        assert!(alone.to_string().contains(why), "{alone}");
    }
}

/// Numbers of the length of a field that do not turn are a position, or anything else.
#[test]
fn a_latitude_a_longitude_and_a_height_of_unknown_names_are_no_magnetometer() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..240)
        .map(|k| {
            let t = f64::from(k);
            format!(
                "{k},{:.7},{:.7},{:.2}\n",
                48.7 + 1e-5 * t,
                9.1 + 2e-5 * t,
                303.0 + (0.1 * t).sin()
            )
        })
        .collect();
    let fixes = folder.path().join("fixes.csv");
    std::fs::write(&fixes, format!("t_s,Breite,Länge,Höhe\n{rows}")).unwrap();
    let imu = folder.path().join("imu.csv");
    let stamps = |k: usize| format!("{:.2}", k as f64 * 0.01);
    std::fs::write(
        &imu,
        slow("t_s", &recording(&mut Random(3), 100.0, 20.0), stamps),
    )
    .unwrap();
    let made = draft_of_files(&[imu, fixes], folder.path());
    assert!(
        !made.manifest.contains("magnetometer")
            && made.manifest.contains(
                "# fixes.csv is left out: no sensor was recognised in Breite, Länge, Höhe."
            ),
        "{}",
        made.manifest
    );
}
