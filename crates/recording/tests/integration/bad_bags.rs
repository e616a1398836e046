//! Bags that are cut off, without an index, of types that are not those of ROS, with too many topics, or made to exhaust memory:
//! what can be read is, and a true sentence says what not.
#![cfg(feature = "sqlite")]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;

use northing_recording::{OpenOptions, Recording, RecordingError, open, read_bytes};

use crate::ros;

use ros::{IMU, bag, bag_of_ros_1, bag_of_ros_1_with, bag_with, database, drive, record};
use rusqlite::Connection;

fn opened(bytes: Vec<u8>) -> Result<Recording, RecordingError> {
    read_bytes(bytes, "a.bag", &OpenOptions::default())
}

fn refusal(bytes: Vec<u8>) -> String {
    opened(bytes).unwrap_err().to_string()
}

/// How many events there are, and what is told.
fn read(recording: Result<Recording, RecordingError>) -> (usize, String) {
    let mut recording = recording.unwrap();
    let count = recording.by_ref().map(Result::unwrap).count();
    (count, recording.issues().notes.join(" "))
}

fn at(path: &Path) -> Result<Recording, RecordingError> {
    open(path, &OpenOptions::default())
}

#[test]
fn a_bag_without_its_index_is_the_same_recording() {
    let sent = drive(0..600);
    let (whole, _) = read(opened(bag(&sent)));
    // MCAP: the list of contents at the end, and the index behind each chunk, are not needed.
    let bytes = bag(&sent);
    let end = bytes.len() - 8 - 29;
    let summary = u64::from_le_bytes(bytes[end + 9..end + 17].try_into().unwrap()) as usize;
    let mut footer = vec![2];
    footer.extend(20_u64.to_le_bytes());
    footer.extend([0; 20]);
    let without = [&bytes[..summary], &footer, &bytes[bytes.len() - 8..]].concat();
    let (count, told) = read(opened(without));
    assert_eq!(count, whole);
    assert!(!told.contains("not finished"), "{told}");
    // ROS 1: the test's bags have none, as those that `rosbag reindex` is for.
    assert_eq!(read(opened(bag_of_ros_1(&sent, "lz4"))).0, whole);
    // SQLite: without the index over the stamps.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.db3");
    database(&path, &sent, <[u8]>::to_vec);
    let connection = Connection::open(&path).unwrap();
    connection
        .execute_batch("DROP INDEX timestamp_idx")
        .unwrap();
    drop(connection);
    assert_eq!(read(at(&path)).0, whole);
}

#[test]
fn a_bag_that_is_cut_off_is_read_up_to_there_and_that_is_said() {
    let sent = drive(0..600);
    let folder = tempfile::tempdir().unwrap();
    let (whole, _) = read(opened(bag(&sent)));
    let db3 = folder.path().join("bag.db3");
    database(&db3, &sent, <[u8]>::to_vec);
    for (name, bytes) in [
        ("a.mcap", bag(&sent)),
        ("a.bag", bag_of_ros_1(&sent, "none")),
        ("a.db3", fs::read(&db3).unwrap()),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, &bytes[..bytes.len() * 2 / 3]).unwrap();
        let (count, told) = read(at(&path));
        assert!(
            count > whole / 3 && count < whole,
            "{name}: {count} of {whole}"
        );
        let why = match name {
            "a.db3" => "SQLite says: database disk image is malformed",
            _ => "it ends in the middle: whatever wrote it was stopped",
        };
        assert!(
            told.contains(&format!(
                "The recording was not finished ({why}); it is read up to there."
            )),
            "{name}: {told}"
        );
        // Of the very beginning nothing can be read.
        fs::write(&path, &bytes[..100]).unwrap();
        let refused = at(&path).unwrap_err().to_string();
        assert!(
            refused.contains("damaged or cut off") && refused.contains("get a fresh copy"),
            "{name}: {refused}"
        );
    }
}

#[test]
fn types_of_the_same_name_with_other_fields_are_left_out_and_said() {
    let sent = drive(0..200);
    let imu: Vec<_> = sent
        .iter()
        .filter(|(_, kind, ..)| *kind == IMU)
        .cloned()
        .collect();
    let right = "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
        geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
        geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n===\nMSG: std_msgs/Header\n\
        builtin_interfaces/Time stamp\nstring frame_id\n===\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n===\n\
        MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n===\nMSG: geometry_msgs/Vector3\n\
        float64 x\nfloat64 y\nfloat64 z\n";
    let other = right.replace(
        "float64[9] orientation_covariance",
        "float32[9] orientation_covariance",
    );
    let hash = |hash: &str| BTreeMap::from([("topic_type_hash".to_owned(), hash.to_owned())]);
    let known = hash("RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b");
    assert_eq!(read(opened(bag_with(&imu, right, &known))).0, 400);
    let words = "of which none is a device of the lab";
    for (definition, facts) in [(&other[..], &known), (right, &hash("RIHS01_123456"))] {
        let refused = refusal(bag_with(&imu, definition, facts));
        assert!(
            refused.contains("/imu/data_raw (sensor_msgs/msg/Imu of another definition)")
                && refused.contains(words),
            "{refused}"
        );
    }
    // In SQLite, by the hash; fixes of a right type beside it are read.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.db3");
    database(&path, &sent, <[u8]>::to_vec);
    let connection = Connection::open(&path).unwrap();
    connection
        .execute_batch(
            "ALTER TABLE topics ADD COLUMN type_description_hash TEXT NOT NULL DEFAULT '';
             UPDATE topics SET type_description_hash = 'RIHS01_123456' WHERE type LIKE '%/Imu'",
        )
        .unwrap();
    drop(connection);
    let (count, told) = read(at(&path));
    assert_eq!(count, 4, "two fixes, two velocities");
    assert!(
        told.contains("/imu/data_raw (sensor_msgs/msg/Imu of another definition: not read)"),
        "{told}"
    );
    // Of ROS 1, by the definition.
    let header = "===\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
    let refused = refusal(bag_of_ros_1_with(
        &imu,
        "none",
        &format!("Header header\nfloat32 x\n{header}"),
    ));
    assert!(
        refused.contains("/imu/data_raw (sensor_msgs/msg/Imu of another definition)"),
        "{refused}"
    );
}

#[test]
fn a_million_topics_are_refused_by_their_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("many.db3");
    database(&path, &drive(0..200), <[u8]>::to_vec);
    let connection = Connection::open(&path).unwrap();
    connection
        .execute_batch(
            "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n WHERE x < 1000000)
             INSERT INTO topics SELECT x + 100, 't' || x, 'a/msg/B', 'cdr', '' FROM n",
        )
        .unwrap();
    drop(connection);
    let refused = at(&path).unwrap_err().to_string();
    assert!(
        refused.contains("the bag: more than 65536 topics; at most 65536 are read; write it again with the topics that are needed"),
        "{refused}"
    );
    // ROS 1 numbers its topics with 32 bits, MCAP with 16.
    let connection = |id: u32| {
        let topic = format!("/{id}");
        let fields = [
            ("op", &[7][..]),
            ("conn", &id.to_le_bytes()),
            ("topic", topic.as_bytes()),
        ];
        let data = record(&[("type", b"a/B")], b"");
        record(&fields, &data[4..data.len() - 4])
    };
    let all: Vec<u8> = (0..1_000_000).flat_map(connection).collect();
    let chunks = all.chunks(1 << 20);
    let mut bytes = b"#ROSBAG V2.0\n".to_vec();
    // Whole records only.
    let mut rest: Vec<u8> = Vec::new();
    for part in chunks {
        rest.extend(part);
        let mut end = 0;
        while let Some(next) = record_end(&rest, end) {
            end = next;
        }
        let size = (end as u32).to_le_bytes();
        bytes.extend(record(
            &[("op", &[5]), ("compression", b"none"), ("size", &size)],
            &rest[..end],
        ));
        rest.drain(..end);
    }
    let refused = refusal(bytes);
    assert!(refused.contains("at most"), "{refused}");
    assert!(
        refused.contains("write") && refused.contains("the topics that are needed"),
        "{refused}"
    );
}

/// Where the record at this place ends, if it is whole.
fn record_end(bytes: &[u8], at: usize) -> Option<usize> {
    let length =
        |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let data = at + 4 + length(at)?;
    let end = data + 4 + length(data)?;
    (end <= bytes.len()).then_some(end)
}

#[test]
fn chunks_of_ros_1_that_unpack_to_gigabytes_are_refused() {
    let lz4 = |bytes: usize| {
        let mut packer = lz4_flex::frame::FrameEncoder::new(Vec::new());
        packer.write_all(&vec![0; bytes]).unwrap();
        packer.finish().unwrap()
    };
    let chunk = |size: u32, packed: &[u8]| {
        let fields = [
            ("op", &[5][..]),
            ("compression", b"lz4"),
            ("size", &size.to_le_bytes()),
        ];
        record(&fields, packed)
    };
    let bag = |chunks: &[u8]| [b"#ROSBAG V2.0\n", chunks].concat();
    // By its own word, and beyond it.
    let refused = refusal(bag(&chunk(3_000_000_000, &lz4(100))));
    assert!(
        refused.contains("a block of data: 3000000000 bytes; at most 33554432 are read"),
        "{refused}"
    );
    let refused = refusal(bag(&chunk(1000, &lz4(100 << 20))));
    assert!(
        refused.contains("a chunk has another size than it says"),
        "{refused}"
    );
    // Each is small enough, all together are not: zeros are records without end.
    let block = chunk(32 << 20, &lz4(32 << 20));
    let refused = refusal(bag(&block.repeat(40)));
    assert!(
        refused.contains("the unpacked file") || refused.contains("damaged"),
        "{refused}"
    );
}
