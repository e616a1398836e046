//! Bags of ROS whose topics are out of order, whose topics are named in a manifest, and poses as fixes.
#![cfg(feature = "mcap")]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::fs;
use std::path::Path;

use northing_recording::{
    Event, OpenOptions, Recording, RecordingError, Sample, SensorKind, open, read_bytes,
};

use crate::ros;

use ros::{Cdr, IMU, Sent, at, bag, drive, field, imu};

fn opened(bytes: Vec<u8>) -> Recording {
    read_bytes(bytes, "bag.mcap", &OpenOptions::default()).unwrap()
}

fn events(recording: &mut Recording) -> Vec<Event> {
    recording.map(Result::unwrap).collect()
}

fn notes(recording: &Recording) -> String {
    recording.issues().notes.join(" ")
}

#[test]
fn topics_written_one_after_the_other_are_the_same_recording() {
    let sent = drive(0..3000);
    let expected = events(&mut opened(bag(&sent)));
    let mut apart = sent;
    apart.sort_by_key(|(topic, ..)| *topic);
    let mut recording = opened(bag(&apart));
    assert_eq!(events(&mut recording), expected);
    let told = notes(&recording);
    // The fixes come first.
    assert!(
        told.contains("Logged behind later stamps of other topics: gyroscope (by up to 29.000 s), accelerometer")
            && told.contains("the topics are merged by their stamps"),
        "{told}"
    );
    assert!(recording.issues().stamps_going_back.is_empty());
    // The same in a folder of files that divide the topics anywhere.
    let folder = tempfile::tempdir().unwrap();
    for (part, name) in apart
        .chunks(apart.len() / 3 + 1)
        .zip(["a_0.mcap", "a_1.mcap", "a_2.mcap"])
    {
        fs::write(folder.path().join(name), bag(part)).unwrap();
    }
    let mut recording = open(folder.path(), &OpenOptions::default()).unwrap();
    assert_eq!(events(&mut recording), expected);
}

/// A receiver's fix is there a tenth of a second and more after the instant that it is of.
#[test]
fn fixes_that_are_logged_late_keep_their_stamps_and_none_is_lost() {
    let sent = drive(0..3000);
    let expected = events(&mut opened(bag(&sent)));
    let mut late = sent;
    for (topic, _, log_ns, _) in &mut late {
        if topic.starts_with("/gps") {
            *log_ns += 152_000_000;
        }
    }
    late.sort_by_key(|(_, _, log_ns, _)| *log_ns);
    let mut recording = opened(bag(&late));
    assert_eq!(events(&mut recording), expected);
    let told = notes(&recording);
    assert!(
        told.contains("gnss-position (by up to 0.150 s), gnss-velocity"),
        "{told}"
    );
    assert!(recording.issues().stamps_going_back.is_empty());
}

#[test]
fn a_false_stamp_or_a_clock_that_was_set_back_is_no_disorder_of_topics() {
    let mut sent = drive(0..1000);
    let expected = events(&mut opened(bag(&sent)));
    let place = sent
        .iter()
        .position(|(topic, _, ns, _)| *topic == "/imu/data_raw" && *ns == at(501));
    let one = &mut sent[place.unwrap()];
    one.3 = imu(at(501) + 3_600_000_000_000, "imu", 501.0);
    let mut recording = opened(bag(&sent));
    let left = events(&mut recording);
    assert_eq!(
        left.len(),
        expected.len() - 2,
        "rate and force of one message"
    );
    assert!(
        notes(&recording).contains("false time stamp"),
        "{}",
        notes(&recording)
    );
    assert!(
        !notes(&recording).contains("merged"),
        "{}",
        notes(&recording)
    );

    // Two seconds before the end the clock was set back by four: what comes twice is counted, as of any file.
    let mut set_back = drive(0..1000);
    set_back.extend(drive(600..800));
    let mut recording = opened(bag(&set_back));
    let read = events(&mut recording);
    assert_eq!(read, expected);
    let back = &recording.issues().stamps_going_back;
    assert_eq!(back[&SensorKind::Gyroscope], 200);
}

#[test]
fn a_topic_that_is_out_of_order_by_itself_is_refused_with_what_to_do() {
    let mut sent = drive(0..1000);
    sent.reverse();
    let refused = opened(bag(&sent)).find_map(Result::err);
    let told = refused.unwrap().to_string();
    assert!(
        told.contains("time runs backwards") && told.contains("mcap sort"),
        "{told}"
    );
}

/// Two inertial sensors, two fields, a pose of motion capture.
fn robot() -> Vec<Sent> {
    let mut sent = Vec::new();
    for k in 0..400 {
        sent.push(("/a/imu", IMU, at(k), imu(at(k), "a", 0.0)));
        sent.push(("/b/imu", IMU, at(k), imu(at(k), "b", k as f64)));
        sent.push(("/a/mag", ros::FIELD, at(k), field(at(k), "a", 20e-6)));
        sent.push(("/b/mag", ros::FIELD, at(k), field(at(k), "b", 30e-6)));
        let position = [0.01 * k as f64, -2.0, 1.5];
        sent.push(("/pose", POSE, at(k), pose(at(k), position)));
        sent.push(("/amcl_pose", POSE_COV, at(k), amcl(at(k), position)));
        sent.push(("/odom", ODOMETRY, at(k), odometry(at(k), position)));
    }
    sent
}

const POSE: &str = "geometry_msgs/msg/PoseStamped";
const POSE_COV: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";
const ODOMETRY: &str = "nav_msgs/msg/Odometry";
const LEVEL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

fn pose(time_ns: i64, position: [f64; 3]) -> Vec<u8> {
    Cdr::new(time_ns, "map")
        .numbers(&position)
        .numbers(&LEVEL)
        .0
}

/// In the plane: the variance of the height is 0, and so is the height.
fn amcl(time_ns: i64, [x, y, _]: [f64; 3]) -> Vec<u8> {
    let mut covariance = [0.0; 36];
    (covariance[0], covariance[7], covariance[35]) = (0.04, 0.09, 0.01);
    let cdr = Cdr::new(time_ns, "map").numbers(&[x, y, 0.0]);
    cdr.numbers(&LEVEL).numbers(&covariance).0
}

fn odometry(time_ns: i64, position: [f64; 3]) -> Vec<u8> {
    let mut covariance = [0.0; 36];
    (covariance[0], covariance[7], covariance[14]) = (0.04, 0.09, 0.16);
    let mut cdr = Cdr::new(time_ns, "odom");
    cdr.text("base_link");
    let cdr = cdr.numbers(&position).numbers(&LEVEL).numbers(&covariance);
    cdr.numbers(&[0.7, 0.1, 0.0, 0.0, 0.0, 0.2])
        .numbers(&[0.0; 36])
        .0
}

/// What a manifest makes of the robot's bag.
fn through(keys: &str, folder: &Path) -> Result<Recording, RecordingError> {
    fs::write(folder.join("robot.mcap"), bag(&robot())).unwrap();
    let manifest = folder.join("robot.toml");
    fs::write(&manifest, format!("file = \"robot.mcap\"\n{keys}")).unwrap();
    open(&manifest, &OpenOptions::default())
}

const ORIGIN: &str = "origin = { latitude_deg = 48.0, longitude_deg = 9.0, height_m = 300.0 }";

#[test]
fn a_manifest_names_the_topic_of_each_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let keys = r#"use = { gyroscope = "/b/imu", accelerometer = "/a/imu", magnetometer = "/b/mag", reference = "/pose", forward-speed = "/odom" }"#;
    let mut recording = through(keys, folder.path()).unwrap();
    let read = events(&mut recording);
    let count = |kind| read.iter().filter(|e| e.sample.kind() == kind).count();
    for kind in [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::Reference,
        SensorKind::ForwardSpeed,
    ] {
        assert_eq!(count(kind), 400, "{}", kind.name());
    }
    assert_eq!(read.len(), 2000);
    for event in &read {
        match event.sample {
            // The field of /b is 30, the rate of /b moves, the force of /a does not.
            Sample::MagneticField(v) => assert!((v.x - 30.0).abs() < 1e-9),
            Sample::SpecificForce(v) => assert!((v.y - 0.01).abs() < 1e-15),
            Sample::ForwardSpeed(v) => assert!((v - 0.7).abs() < 1e-15),
            _ => {}
        }
    }
    let rates = read.iter().filter_map(|e| match e.sample {
        Sample::AngularRate(v) => Some(v.x),
        _ => None,
    });
    assert!(rates.clone().fold(0.0, f64::max) > 0.109);
    let told = notes(&recording);
    assert!(
        told.contains("Topics that are read: /a/imu, /b/imu, /b/mag, /odom, /pose.")
            && told.contains("/a/mag (sensor_msgs/msg/MagneticField, not named in `use`)"),
        "{told}"
    );
}

#[test]
fn positions_of_poses_are_fixes_where_the_manifest_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let fixes = |topic: &str, more: &str| {
        let keys = format!(
            "use = {{ gyroscope = \"/a/imu\" }}\nlocal_position = {{ topic = \"{topic}\", {ORIGIN}{more} }}"
        );
        let mut recording = through(&keys, folder.path()).unwrap();
        let fixes = events(&mut recording).into_iter();
        let fixes = fixes.filter_map(|event| match event.sample {
            Sample::GnssPosition(fix) => Some(fix),
            _ => None,
        });
        fixes.collect::<Vec<_>>()
    };
    let of_pose = fixes("/pose", ", std_m = [0.01, 0.02, 0.03]");
    assert_eq!(of_pose.len(), 400);
    // North, east, down of east, north, up.
    assert_eq!(of_pose[0].std_m, Some([0.02, 0.01, 0.03]));
    // 2 m to the south and 3.99 m to the east, on the ellipsoid.
    let last = of_pose[399];
    let south_m = (48.0_f64.to_radians() - last.latitude_rad) * 6_368_000.0;
    let east_m =
        (last.longitude_rad - 9.0_f64.to_radians()) * 6_390_000.0 * 48.0_f64.to_radians().cos();
    assert!(
        (south_m - 2.0).abs() < 0.01 && (east_m - 3.99).abs() < 0.01,
        "{south_m} {east_m}"
    );
    assert!((last.height_m.unwrap() - 301.5).abs() < 1e-3);
    assert_eq!(fixes("/pose", "")[0].std_m, None);

    let of_odometry = fixes("/odom", "");
    let std = of_odometry[0].std_m.unwrap();
    for (got, expected) in std.iter().zip([0.3, 0.2, 0.4]) {
        assert!((got - expected).abs() < 1e-12, "{std:?}");
    }
    // What the manifest states goes before.
    assert_eq!(
        fixes("/odom", ", std_m = [1.0, 2.0, 3.0]")[0].std_m,
        Some([2.0, 1.0, 3.0])
    );

    let in_the_plane = fixes("/amcl_pose", "");
    assert_eq!(
        in_the_plane[0].height_m, None,
        "a height of 0 was not measured"
    );
    let [north, east, _] = in_the_plane[0].std_m.unwrap();
    assert!((north - 0.3).abs() < 1e-12 && (east - 0.2).abs() < 1e-12);
    assert!(
        in_the_plane
            .iter()
            .all(northing_recording::GnssPosition::is_usable)
    );
    // Along other axes: x north, y east.
    let turned = fixes("/pose", ", axes = \"neu\"");
    assert!((turned[399].latitude_rad - 48.0_f64.to_radians()) * 6_368_000.0 > 3.9);
}

#[test]
fn a_pose_as_a_fix_leaves_the_other_topics_to_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let keys = format!("[local_position]\ntopic = \"/pose\"\n{ORIGIN}\n");
    // Two Imu, neither of them the raw one.
    let refused = through(&keys, folder.path()).unwrap_err().to_string();
    assert!(refused.contains("--device"), "{refused}");
    let options = OpenOptions {
        device: Some("/b/imu".to_owned()),
        ..OpenOptions::default()
    };
    let recording = open(&folder.path().join("robot.toml"), &options).unwrap();
    let sensors = recording.sensors();
    assert!(
        sensors.contains(&SensorKind::GnssPosition) && sensors.contains(&SensorKind::Magnetometer)
    );
}

#[test]
fn what_cannot_be_named_is_refused_with_what_can() {
    let folder = tempfile::tempdir().unwrap();
    let refusal = |keys: &str| through(keys, folder.path()).unwrap_err().to_string();
    for (keys, words) in [
        (
            r#"use = { gyroscope = "/c/imu" }"#,
            "gyroscope: there is no topic `/c/imu`; it has /a/imu, /a/mag",
        ),
        (
            r#"use = { magnetometer = "/a/imu" }"#,
            "magnetometer: `/a/imu` is sensor_msgs/msg/Imu; expected sensor_msgs/msg/MagneticField",
        ),
        (
            r#"use = { gyroscope = "/a/imu", gnss-position = "/pose" }"#,
            "whose positions are metres from a place: name it in [local_position] with its `origin`",
        ),
        (
            r#"use = { water-velocity = "/odom" }"#,
            "no topic is read as water-velocity; expected gyroscope, accelerometer",
        ),
        (r#"use = { gyro = "/a/imu" }"#, "unknown variant `gyro`"),
        ("use = 3", "a list of sensors, or of a bag a table"),
        (
            r#"local_position = { columns = ["x", "y", "z"], origin = { latitude_deg = 1, longitude_deg = 1, height_m = 0 } }"#,
            "[local_position] needs `topic`",
        ),
        (
            r#"use = { magnetometer = "/a/mag" }"#,
            "no gyroscope: it has magnetometer",
        ),
    ] {
        let told = refusal(keys);
        assert!(told.contains(words), "{keys}: {told}");
    }
    fs::write(
        folder.path().join("t.csv"),
        "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0,0,0\n",
    )
    .unwrap();
    let table = |keys: &str| {
        let path = folder.path().join("t.toml");
        fs::write(&path, format!("file = \"t.csv\"\n{keys}")).unwrap();
        open(&path, &OpenOptions::default())
            .unwrap_err()
            .to_string()
    };
    let told = table(r#"use = { gyroscope = "/imu" }"#);
    assert!(
        told.contains("topics are named, which are of a bag of ROS; this is csv"),
        "{told}"
    );
    let told = table("time = { column = \"t_s\", unit = \"s\" }\nuse = { gyroscope = \"/imu\" }");
    assert!(
        told.contains("`use` has topics, which are of bags; this is a table"),
        "{told}"
    );
}
