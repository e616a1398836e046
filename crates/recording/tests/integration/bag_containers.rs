//! Bags that are no plain MCAP: of ROS 2 in SQLite and compressed, of ROS 1; whole, cut and damaged.
#![cfg(feature = "sqlite")]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::ros;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use northing_recording::{Event, OpenOptions, open, read_bytes};
use ros::{at, bag, bag_of_ros_1, database, drive, imu};
use rusqlite::Connection;

fn events(path: &Path) -> Vec<Event> {
    let recording = open(path, &OpenOptions::default()).unwrap();
    // However it is packed, its axes are told: those of REP 103, or those that our writer put beside a channel.
    assert!(
        recording.metadata().body_axes.is_some(),
        "{}",
        path.display()
    );
    recording.map(Result::unwrap).collect()
}

fn refusal(path: &Path) -> String {
    open(path, &OpenOptions::default()).unwrap_err().to_string()
}

fn expected() -> Vec<Event> {
    let recording = read_bytes(bag(&drive(0..600)), "bag.mcap", &OpenOptions::default()).unwrap();
    recording.map(Result::unwrap).collect()
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 1).unwrap()
}

/// A folder with one file, and the same as it is listed by `metadata.yaml`.
fn folder(path: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let folder = path.join("folder");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join(name), bytes).unwrap();
    let list = format!(
        "rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n    - {name}\n  compression_mode: FILE\n"
    );
    fs::write(folder.join("metadata.yaml"), list).unwrap();
    folder
}

#[test]
fn a_bag_in_sqlite_is_the_same_recording_packed_and_unpacked() {
    let temporary = tempfile::tempdir().unwrap();
    let expected = expected();
    // Whatever a name has in it, it is no part of an address.
    let plain = temporary.path().join("a bag?#%41.db3");
    database(&plain, &drive(0..600), <[u8]>::to_vec);
    assert_eq!(events(&plain), expected);
    let packed = temporary.path().join("messages.db3");
    database(&packed, &drive(0..600), zstd);
    assert_eq!(events(&packed), expected);
    let bytes = fs::read(&plain).unwrap();
    for (name, bytes) in [
        ("bag_0.db3", bytes.clone()),
        ("bag_0.db3.zstd", zstd(&bytes)),
        ("bag_0.mcap.zstd", zstd(&bag(&drive(0..600)))),
    ] {
        let folder = folder(temporary.path(), name, &bytes);
        assert_eq!(events(&folder), expected, "{name}");
        fs::remove_file(folder.join("metadata.yaml")).unwrap();
        assert_eq!(events(&folder), expected, "{name}");
    }
}

#[test]
fn what_a_stopped_recorder_left_in_its_log_is_read_too() {
    let temporary = tempfile::tempdir().unwrap();
    let (path, copy) = (
        temporary.path().join("bag.db3"),
        temporary.path().join("copy.db3"),
    );
    let half = drive(0..300);
    database(&path, &half, <[u8]>::to_vec);
    let connection = Connection::open(&path).unwrap();
    connection
        .execute_batch("PRAGMA journal_mode = WAL; PRAGMA wal_autocheckpoint = 0")
        .unwrap();
    for k in 300..600 {
        let add = "INSERT INTO messages (topic_id, timestamp, data) SELECT id, ?1, ?2 FROM topics WHERE name LIKE '/imu/data_raw'";
        connection
            .execute(add, (at(k), imu(at(k), "imu", k as f64)))
            .unwrap();
    }
    for end in ["", "-wal"] {
        let name = |path: &Path| format!("{}{end}", path.display());
        fs::copy(name(&path), name(&copy)).unwrap();
    }
    let read = events(&copy);
    assert_eq!(read.last().unwrap().time_ns, at(599));
}

#[test]
fn databases_that_are_no_bag_or_compute_are_refused() {
    let temporary = tempfile::tempdir().unwrap();
    let endless = "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT x AS rowid, 1 AS topic_id, \
        x AS timestamp, zeroblob(100) AS data FROM n";
    for (name, sql) in [
        ("empty", "CREATE TABLE other(x)".to_owned()),
        ("view", format!("CREATE TABLE topics(id, name, type, serialization_format); CREATE VIEW messages AS {endless}")),
        (
            "generated",
            "CREATE TABLE topics(id, name, type, serialization_format); CREATE TABLE messages(id INTEGER PRIMARY KEY, \
             topic_id, timestamp, data GENERATED ALWAYS AS (zeroblob(1000000000)))"
                .to_owned(),
        ),
    ] {
        let path = temporary.path().join(name);
        Connection::open(&path).unwrap().execute_batch(&sql).unwrap();
        let refused = refusal(&path);
        assert!(refused.contains("a database of SQLite without a table"), "{name}: {refused}");
    }
    let cut = temporary.path().join("cut.db3");
    fs::write(&cut, b"SQLite format 3\0 and more").unwrap();
    assert!(refusal(&cut).contains("damaged or cut off: SQLite says"));
}

#[test]
fn a_packed_file_or_message_that_unpacks_to_gigabytes_is_refused() {
    let temporary = tempfile::tempdir().unwrap();
    let mut packer = zstd::Encoder::new(Vec::new(), 1).unwrap();
    for _ in 0..(70 << 4) {
        packer.write_all(&[0; 1 << 16]).unwrap();
    }
    let bomb = packer.finish().unwrap();
    assert!(bomb.len() < 20_000);
    let folder = folder(temporary.path(), "bag_0.db3.zstd", &bomb);
    assert!(
        refusal(&folder).contains("the unpacked file: more than"),
        "{}",
        refusal(&folder)
    );
    let path = temporary.path().join("bomb.db3");
    database(&path, &drive(0..2), |_| bomb.clone());
    assert!(
        refusal(&path).contains("a block of data: 33554433 bytes"),
        "{}",
        refusal(&path)
    );
    // Each is small enough, all together are not.
    let block = zstd(&vec![0; 30 << 20]);
    database(&temporary.path().join("many.db3"), &drive(0..6), |_| {
        block.clone()
    });
    assert!(refusal(&temporary.path().join("many.db3")).contains("the unpacked file"));
}

#[test]
fn a_bag_of_ros_1_is_the_same_recording() {
    let temporary = tempfile::tempdir().unwrap();
    let path = temporary.path().join("old.bag");
    for compression in ["none", "lz4"] {
        fs::write(&path, bag_of_ros_1(&drive(0..600), compression)).unwrap();
        assert_eq!(events(&path), expected(), "{compression}");
    }
    fs::write(&path, bag_of_ros_1(&drive(0..600), "rar")).unwrap();
    assert!(refusal(&path).contains("its chunks are compressed with `rar`"));
    fs::write(&path, b"#ROSBAG V1.2\nmore").unwrap();
    assert!(refusal(&path).contains("an older version than 2.0"));
    // Cut off: what is whole is read, and said.
    let whole = bag_of_ros_1(&drive(0..600), "none");
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let mut recording = open(&path, &OpenOptions::default()).unwrap();
    let read = recording.by_ref().map(Result::unwrap).count();
    assert!(read > 300 && read < expected().len());
    let notes = recording.issues().notes.join(" ");
    assert!(
        notes.contains("The recording was not finished (it ends in the middle"),
        "{notes}"
    );
}

#[test]
fn cut_and_flipped_bags_are_never_a_panic() {
    let temporary = tempfile::tempdir().unwrap();
    let path = temporary.path().join("bag.db3");
    database(&path, &drive(0..8), <[u8]>::to_vec);
    let bytes = fs::read(&path).unwrap();
    let damaged = temporary.path().join("damaged.db3");
    for at in (0..bytes.len()).step_by(7) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0xff;
        for bytes in [&bytes[..at], &flipped] {
            fs::write(&damaged, bytes).unwrap();
            if let Ok(recording) = open(&damaged, &OpenOptions::default()) {
                recording.for_each(drop);
            }
        }
    }
    for compression in ["none", "lz4", "bz2"] {
        let bytes = bag_of_ros_1(&drive(0..8), compression);
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 0xff;
            for bytes in [&bytes[..at], &flipped] {
                if let Ok(recording) =
                    read_bytes(bytes.to_vec(), "old.bag", &OpenOptions::default())
                {
                    recording.for_each(drop);
                }
            }
        }
    }
    // Lengths that reach beyond everything.
    let mut huge = b"#ROSBAG V2.0\n".to_vec();
    huge.extend([0xff; 64]);
    assert!(read_bytes(huge, "old.bag", &OpenOptions::default()).is_err());
}
