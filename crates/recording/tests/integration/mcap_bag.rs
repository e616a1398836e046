//! Bags of ROS 2: which topics are read, fixes and velocities of a receiver, folders of several files.
#![cfg(feature = "mcap")]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::fs;
use std::path::Path;

use northing_recording::{
    Event, OpenOptions, Recording, Sample, SensorKind, create, open, read_bytes,
};

use crate::ros;

use ros::{
    Cdr, FIELD, FIX, IMU, KNOWN, Sent, at, bag, drive, field, fix, imu, twist_with_covariance,
};

fn opened(bytes: Vec<u8>, device: Option<&str>) -> Recording {
    let options = OpenOptions {
        device: device.map(str::to_owned),
        ..OpenOptions::default()
    };
    read_bytes(bytes, "bag.mcap", &options).unwrap()
}

fn events(recording: &mut Recording) -> Vec<Event> {
    recording.map(Result::unwrap).collect()
}

#[test]
fn imu_field_fixes_and_velocities_of_a_bag_are_those_of_the_csv_to_the_bit() {
    let mut recording = opened(bag(&drive(0..600)), None);
    let sensors = recording.sensors().to_vec();
    assert!(
        sensors.contains(&SensorKind::GnssPosition) && sensors.contains(&SensorKind::GnssVelocity)
    );
    let metadata = recording.metadata().clone();
    let read = events(&mut recording);
    let fixes = read
        .iter()
        .filter(|e| matches!(e.sample, Sample::GnssPosition(_)));
    assert_eq!(fixes.count(), 6);
    let notes = recording.issues().notes.join(" ");
    assert!(
        notes.contains("Topics that are read: /gps/fix, /gps/vel, /imu/data_raw, /imu/mag.")
            && notes.contains("/cmd_vel (not the velocity of the receiver that is read)"),
        "{notes}"
    );

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.csv");
    let mut writer = create(&path, &metadata, &sensors, false).unwrap();
    for event in &read {
        writer.write(event).unwrap();
    }
    writer.finish().unwrap();
    let again = events(&mut open(&path, &OpenOptions::default()).unwrap());
    assert_eq!(again, read);
}

#[test]
fn a_fix_says_what_its_message_does() {
    let sent = [
        fix(at(0), 0, 48.0, KNOWN),
        fix(at(1), 2, 48.0, (KNOWN.0, 0)),
        fix(at(2), -1, 48.0, KNOWN),
        fix(at(3), 1, 48.0, ([0.0; 9], 2)),
    ];
    let mut sent: Vec<Sent> = sent
        .into_iter()
        .zip(0..)
        .map(|(bytes, k)| ("/fix", FIX, at(k), bytes))
        .collect();
    let covariance = twist_with_covariance(at(5), [3.0, 4.0, 1.0], [0.04, 0.09, 0.16]);
    sent.push((
        "/fix_velocity",
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        at(5),
        covariance,
    ));
    let mut recording = opened(bag(&sent), None);
    let read = events(&mut recording);
    let fixes: Vec<_> = read
        .iter()
        .filter_map(|event| match event.sample {
            Sample::GnssPosition(fix) => Some(fix),
            _ => None,
        })
        .collect();
    // North, east, down of a covariance of east, north, up.
    assert_eq!(fixes[0].std_m, Some([3.0, 2.0, 4.0]));
    assert_eq!(
        fixes[0].latitude_rad.to_bits(),
        48.0_f64.to_radians().to_bits()
    );
    assert_eq!(fixes.len(), 3, "the one without a fix is dropped");
    assert!(fixes[1..].iter().all(|fix| fix.std_m.is_none()));
    assert_eq!(
        recording.issues().invalid_fixes[&SensorKind::GnssPosition],
        1
    );
    let Sample::GnssVelocity(velocity) = read[3].sample else {
        panic!("{:?}", read[3]);
    };
    let numbers = [
        velocity.north_m_s,
        velocity.east_m_s,
        velocity.down_m_s.unwrap(),
    ];
    assert_eq!(
        numbers.map(f64::to_bits),
        [4.0, 3.0, -1.0_f64].map(f64::to_bits)
    );
    let std = velocity.std_m_s.unwrap();
    for (std, expected) in std.into_iter().zip([0.3, 0.2, 0.4]) {
        assert!((std - expected).abs() < 1e-15, "{std}");
    }
}

fn two_imus(field_topic: &'static str, frame: &str) -> Vec<u8> {
    let mut sent = Vec::new();
    for k in 0..200 {
        sent.push(("/base/imu/data_raw", IMU, at(k), imu(at(k), "base", 0.0)));
        sent.push(("/phone/imu", IMU, at(k), imu(at(k), "phone", 1.0)));
        sent.push((field_topic, FIELD, at(k), field(at(k), frame, 20e-6)));
    }
    bag(&sent)
}

fn has_field(recording: &Recording) -> bool {
    recording.sensors().contains(&SensorKind::Magnetometer)
}

#[test]
fn a_field_of_another_sensor_is_left_out_and_said() {
    let foreign = two_imus("/phone/mag", "phone");
    let recording = opened(foreign.clone(), None);
    assert!(!has_field(&recording));
    let notes = recording.issues().notes.join(" ");
    for part in [
        "Topics that are read: /base/imu/data_raw.",
        "/phone/imu (another Imu; choose it with --device /phone/imu)",
        "/phone/mag (a field of another namespace and frame than the Imu)",
    ] {
        assert!(notes.contains(part), "{notes}");
    }
    assert!(has_field(&opened(foreign, Some("/phone/imu"))));
    // The same frame, the same namespace or a part of it.
    assert!(has_field(&opened(two_imus("/mag", "base"), None)));
    assert!(has_field(&opened(two_imus("/base/mag", "?"), None)));
    assert!(has_field(&opened(two_imus("/base/imu/mag", "?"), None)));

    // One Imu and one field: there is nothing to confuse.
    let mut sent = Vec::new();
    for k in 0..200 {
        sent.push(("/imu/data_raw", IMU, at(k), imu(at(k), "base", 0.0)));
        sent.push(("/phone/mag", FIELD, at(k), field(at(k), "phone", 20e-6)));
    }
    assert!(has_field(&opened(bag(&sent), None)));
}

#[test]
fn a_pose_of_a_reference_system_is_the_reference_and_another_is_not() {
    let with_pose = |topic: &'static str, kind: &'static str| {
        let mut sent = drive(0..200);
        for k in 0..200 {
            let mut cdr = Cdr::new(at(k), "world");
            if kind.ends_with("Odometry") {
                cdr.text("body");
            }
            let pose = cdr
                .numbers(&[1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8])
                .numbers(&[0.0; 48]);
            sent.push((topic, kind, at(k), pose.0));
        }
        sent.sort_by_key(|(_, _, time_ns, _)| *time_ns);
        let mut recording = opened(bag(&sent), None);
        let read = events(&mut recording).into_iter();
        let references: Vec<_> = read
            .filter_map(|event| match event.sample {
                Sample::Reference(reference) => Some(reference.attitude),
                _ => None,
            })
            .collect();
        (references, recording.issues().notes.join(" "))
    };
    for (topic, kind) in [
        ("/optitrack/pose", "geometry_msgs/msg/PoseStamped"),
        ("/ground_truth/odom", "nav_msgs/msg/Odometry"),
    ] {
        let (references, _) = with_pose(topic, kind);
        assert_eq!(references.len(), 200, "{topic}");
        assert!((references[0].k - 0.6).abs() < 1e-15 && (references[0].w - 0.8).abs() < 1e-15);
    }
    let (references, notes) = with_pose("/odom", "nav_msgs/msg/Odometry");
    assert_eq!(references.len(), 0);
    assert!(
        notes.contains("/odom (a pose whose topic does not say that it is a reference)"),
        "{notes}"
    );
}

fn metadata_yaml(files: &[&str]) -> String {
    let files: String = files.iter().map(|file| format!("    - {file}\n")).collect();
    format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  relative_file_paths:\n{files}  duration:\n    nanoseconds: 1\n"
    )
}

fn refusal(path: &Path) -> String {
    open(path, &OpenOptions::default()).unwrap_err().to_string()
}

#[test]
fn a_folder_of_several_files_is_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let names: Vec<String> = (0..12).map(|number| format!("bag_{number}.mcap")).collect();
    for (number, name) in (0..).zip(&names) {
        fs::write(
            path.join(name),
            bag(&drive(number * 100..(number + 1) * 100)),
        )
        .unwrap();
    }
    let expected = events(&mut opened(bag(&drive(0..1200)), None));
    // Without metadata.yaml, as a recorder leaves it that was stopped; then with it.
    for _ in 0..2 {
        let mut recording = open(path, &OpenOptions::default()).unwrap();
        assert!(recording.sensors().contains(&SensorKind::GnssPosition));
        assert_eq!(events(&mut recording), expected);
        assert!(recording.issues().notes[0].starts_with("Topics that are read: /gps/fix"));
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        fs::write(path.join("metadata.yaml"), metadata_yaml(&names)).unwrap();
    }
    fs::write(
        path.join("metadata.yaml"),
        metadata_yaml(&["../bag_0.mcap"]),
    )
    .unwrap();
    assert!(refusal(path).contains(
        "its metadata.yaml lists `../bag_0.mcap`, which is no .mcap or .db3 file of the folder"
    ));
    let many = vec!["bag_0.mcap"; 1001];
    fs::write(path.join("metadata.yaml"), metadata_yaml(&many)).unwrap();
    assert!(refusal(path).contains("the bag: 1001 files; at most 1000 are read"));
    // Any bytes in the list are read or refused.
    let text = metadata_yaml(&["bag_0.mcap", "bag_1.mcap"]).into_bytes();
    for cut in 0..text.len() {
        let mut flipped = text.clone();
        flipped[cut] ^= 0x42;
        for bytes in [&text[..cut], &flipped] {
            fs::write(path.join("metadata.yaml"), bytes).unwrap();
            if let Ok(recording) = open(path, &OpenOptions::default()) {
                assert!(recording.count() <= expected.len());
            }
        }
    }
}

#[test]
fn cut_and_flipped_messages_are_never_a_panic() {
    let sent = drive(0..8);
    for (index, (_, _, _, bytes)) in sent.iter().enumerate() {
        for at in 0..bytes.len() {
            let mut damaged = sent.clone();
            if at % 2 == 0 {
                damaged[index].3.truncate(at);
            } else {
                damaged[index].3[at] ^= 0xff;
            }
            opened(bag(&damaged), None).for_each(drop);
        }
    }
}
