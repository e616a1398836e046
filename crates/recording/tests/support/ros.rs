//! Messages of ROS 2 and bags of them, made byte by byte, for the tests of bags.
#![allow(dead_code, clippy::unwrap_used)] // helpers of tests unwrap like tests, and not every test needs all

use std::collections::BTreeMap;
use std::io::Cursor;

const START_NS: i64 = 1_763_697_600_000_000_000;

/// A message in CDR: bytes behind its header.
pub(crate) struct Cdr(pub(crate) Vec<u8>);

impl Cdr {
    /// A message with a header of this time and frame.
    pub(crate) fn new(time_ns: i64, frame: &str) -> Self {
        let mut cdr = Self(vec![0, 1, 0, 0]);
        cdr.0
            .extend(((time_ns / 1_000_000_000) as i32).to_le_bytes());
        cdr.0
            .extend(((time_ns % 1_000_000_000) as u32).to_le_bytes());
        cdr.text(frame);
        cdr
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.align(4);
        self.0.extend((text.len() as u32 + 1).to_le_bytes());
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    pub(crate) fn align(&mut self, size: usize) {
        while !(self.0.len() - 4).is_multiple_of(size) {
            self.0.push(0);
        }
    }

    pub(crate) fn numbers(mut self, values: &[f64]) -> Self {
        self.align(8);
        self.0.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        self
    }
}

pub(crate) fn imu(time_ns: i64, frame: &str, k: f64) -> Vec<u8> {
    let orientation = [
        0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ];
    let rate = [0.1 + 0.01 * k.sin(), 0.2, -0.1];
    let force = [0.3, 0.01 * k.cos(), 9.8];
    let cdr = Cdr::new(time_ns, frame).numbers(&orientation);
    cdr.numbers(&rate)
        .numbers(&[0.0; 9])
        .numbers(&force)
        .numbers(&[0.0; 9])
        .0
}

pub(crate) fn field(time_ns: i64, frame: &str, x_t: f64) -> Vec<u8> {
    let cdr = Cdr::new(time_ns, frame);
    cdr.numbers(&[x_t, 2e-6, -41e-6]).numbers(&[0.0; 9]).0
}

/// A fix; `covariance` with its kind.
pub(crate) fn fix(
    time_ns: i64,
    status: i8,
    latitude_deg: f64,
    covariance: ([f64; 9], u8),
) -> Vec<u8> {
    let mut cdr = Cdr::new(time_ns, "gps");
    cdr.0.push(status.to_le_bytes()[0]);
    cdr.align(2);
    cdr.0.extend([1, 0]);
    let mut cdr = cdr
        .numbers(&[latitude_deg, 10.123, 321.5])
        .numbers(&covariance.0);
    cdr.0.push(covariance.1);
    cdr.0
}

pub(crate) fn twist(time_ns: i64, enu: [f64; 3]) -> Vec<u8> {
    Cdr::new(time_ns, "gps").numbers(&enu).numbers(&[0.0; 3]).0
}

pub(crate) fn twist_with_covariance(time_ns: i64, enu: [f64; 3], variances: [f64; 3]) -> Vec<u8> {
    let mut covariance = [0.0; 36];
    for axis in 0..3 {
        covariance[7 * axis] = variances[axis];
    }
    let cdr = Cdr::new(time_ns, "gps").numbers(&enu).numbers(&[0.0; 3]);
    cdr.numbers(&covariance).0
}

/// A message: topic, type, time, bytes.
pub(crate) type Sent = (&'static str, &'static str, i64, Vec<u8>);

pub(crate) fn bag(messages: &[Sent]) -> Vec<u8> {
    bag_with(messages, "-", &BTreeMap::new())
}

/// A bag whose types have this definition, and whose channels say this.
pub(crate) fn bag_with(
    messages: &[Sent],
    definition: &str,
    facts: &BTreeMap<String, String>,
) -> Vec<u8> {
    let mut file = mcap::WriteOptions::new()
        .compression(None)
        .chunk_size(Some(1 << 14))
        .create(Cursor::new(Vec::new()))
        .unwrap();
    let mut channels = BTreeMap::new();
    for (topic, kind, time_ns, bytes) in messages {
        let id = *channels.entry(*topic).or_insert_with(|| {
            let definition = definition.as_bytes();
            let schema = file.add_schema(kind, "ros2msg", definition).unwrap();
            file.add_channel(schema, topic, "cdr", facts).unwrap()
        });
        let header = mcap::records::MessageHeader {
            channel_id: id,
            sequence: 0,
            log_time: *time_ns as u64,
            publish_time: *time_ns as u64,
        };
        file.write_to_known_channel(&header, bytes).unwrap();
    }
    file.finish().unwrap();
    file.into_inner().into_inner()
}

pub(crate) const IMU: &str = "sensor_msgs/msg/Imu";
pub(crate) const FIELD: &str = "sensor_msgs/msg/MagneticField";
pub(crate) const FIX: &str = "sensor_msgs/msg/NavSatFix";
pub(crate) const TWIST: &str = "geometry_msgs/msg/TwistStamped";
pub(crate) const KNOWN: ([f64; 9], u8) = ([4.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 16.0], 2);

pub(crate) fn at(index: i64) -> i64 {
    START_NS + index * 10_000_000
}

/// Some seconds of an Imu and its field, with fixes and velocities every second from `first` on.
pub(crate) fn drive(samples: std::ops::Range<i64>) -> Vec<Sent> {
    let mut sent = Vec::new();
    for k in samples {
        sent.push(("/imu/data_raw", IMU, at(k), imu(at(k), "imu", k as f64)));
        if k % 4 == 0 {
            sent.push(("/imu/mag", FIELD, at(k), field(at(k), "imu", 20.3e-6)));
        }
        if k % 100 == 0 {
            let latitude = 48.0 + 1e-7 * k as f64 / 3.0;
            sent.push(("/gps/fix", FIX, at(k), fix(at(k), 0, latitude, KNOWN)));
            sent.push((
                "/gps/vel",
                TWIST,
                at(k),
                twist(at(k), [0.3, 1.0 / 3.0, 0.0]),
            ));
            sent.push(("/cmd_vel", TWIST, at(k), twist(at(k), [9.0, 9.0, 9.0])));
        }
    }
    sent
}

/// The tables that `rosbag2_storage_sqlite3` makes.
#[cfg(feature = "sqlite")]
const TABLES: &str = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, \
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
    CREATE INDEX timestamp_idx ON messages (timestamp ASC);";

/// Writes a bag of ROS 2 in SQLite, each message as `pack` makes it.
#[cfg(feature = "sqlite")]
pub(crate) fn database(path: &std::path::Path, sent: &[Sent], pack: impl Fn(&[u8]) -> Vec<u8>) {
    let mut connection = rusqlite::Connection::open(path).unwrap();
    connection.execute_batch(TABLES).unwrap();
    let all = connection.transaction().unwrap();
    let mut topics = BTreeMap::new();
    for (topic, kind, time_ns, bytes) in sent {
        let next = topics.len() as i64 + 1;
        let id = *topics.entry(*topic).or_insert_with(|| {
            all.execute(
                "INSERT INTO topics VALUES (?1, ?2, ?3, 'cdr', '')",
                (next, topic, kind),
            )
            .unwrap();
            next
        });
        let add = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        all.execute(add, (id, time_ns, pack(bytes))).unwrap();
    }
    all.commit().unwrap();
}

/// A record of ROS 1: the fields of its header, and its data.
pub(crate) fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    for (name, value) in fields {
        header.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
        header.extend([name.as_bytes(), b"=", value].concat());
    }
    let lengths = [header.len(), data.len()].map(|length| (length as u32).to_le_bytes());
    [&lengths[0][..], &header, &lengths[1], data].concat()
}

/// A message of ROS 2 as one of ROS 1: a number in front, no closing zero, no gaps.
fn of_ros_1(kind: &str, cdr: &[u8]) -> Vec<u8> {
    let length = u32::from_le_bytes(cdr[12..16].try_into().unwrap()) as usize;
    let frame = &cdr[16..16 + length - 1];
    let mut at = 16 + length;
    let mut bytes = 9_u32.to_le_bytes().to_vec();
    bytes.extend(&cdr[4..12]);
    bytes.extend((frame.len() as u32).to_le_bytes());
    bytes.extend(frame);
    if kind.ends_with("NavSatFix") {
        bytes.push(cdr[at]);
        at = 4 + (at + 1 - 4).next_multiple_of(2);
        bytes.extend(&cdr[at..at + 2]);
        at += 2;
    }
    at = 4 + (at - 4).next_multiple_of(8);
    bytes.extend(&cdr[at..]);
    bytes
}

/// A bag of ROS 1 in chunks of 100 messages.
pub(crate) fn bag_of_ros_1(sent: &[Sent], compression: &str) -> Vec<u8> {
    bag_of_ros_1_with(sent, compression, "")
}

/// A bag whose types have this definition.
pub(crate) fn bag_of_ros_1_with(sent: &[Sent], compression: &str, definition: &str) -> Vec<u8> {
    let mut bytes = b"#ROSBAG V2.0\n".to_vec();
    bytes.extend(record(
        &[("op", &[3]), ("index_pos", &[0; 8])],
        &[b' '; 100],
    ));
    let mut connections: BTreeMap<&str, u32> = BTreeMap::new();
    for part in sent.chunks(100) {
        let mut chunk = Vec::new();
        for (topic, kind, time_ns, cdr) in part {
            let next = connections.len() as u32;
            let id = *connections.entry(*topic).or_insert(next);
            let id = id.to_le_bytes();
            let name = kind.replace("/msg/", "/");
            // A record without its own length around it is what the data of a connection is.
            let about = &record(
                &[
                    ("topic", topic.as_bytes()),
                    ("type", name.as_bytes()),
                    ("message_definition", definition.as_bytes()),
                ],
                b"",
            );
            let about = &about[4..about.len() - 4];
            chunk.extend(record(
                &[("op", &[7]), ("conn", &id), ("topic", topic.as_bytes())],
                about,
            ));
            let time = [time_ns / 1_000_000_000, time_ns % 1_000_000_000]
                .map(|x| (x as u32).to_le_bytes());
            let fields = [("op", &[2][..]), ("conn", &id), ("time", &time.concat())];
            chunk.extend(record(&fields, &of_ros_1(kind, cdr)));
        }
        let packed = match compression {
            "lz4" => {
                let mut packer = lz4_flex::frame::FrameEncoder::new(Vec::new());
                std::io::Write::write_all(&mut packer, &chunk).unwrap();
                packer.finish().unwrap()
            }
            _ => chunk.clone(),
        };
        let size = (chunk.len() as u32).to_le_bytes();
        let fields = [
            ("op", &[5][..]),
            ("compression", compression.as_bytes()),
            ("size", &size),
        ];
        bytes.extend(record(&fields, &packed));
        bytes.extend(record(&[("op", &[4]), ("ver", &[1, 0, 0, 0])], &[0; 24]));
    }
    bytes
}
