//! Files that claim or unpack to much: each is refused or read in little memory and time, with a sentence.
//!
//! Measured on Linux: the peak of the process's memory, and under a limit of its address space, so that memory that is
//! only asked for counts too.
#![cfg(all(
    target_os = "linux",
    feature = "mcap",
    feature = "parquet",
    feature = "sqlite",
    feature = "ulog"
))]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

#[path = "support/ros.rs"]
mod ros;

use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use northing_recording::{OpenOptions, describe, open, tracking};
use parquet::basic::{Compression, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use zip::write::SimpleFileOptions;

/// What any file of at most 10 MB may cost.
const MOST_KB: u64 = 300 * 1000;
const LARGEST_FILE: usize = 10_000_000;
const LONGEST: Duration = Duration::from_secs(30);

/// A number of kilobytes of the process's state.
fn state_kb(key: &str) -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with(key)).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// What reading a file says, measured: errors, and remarks if there is none.
fn measured(name: &str, read: impl FnOnce() -> String) -> String {
    // The peak is counted from here.
    fs::write("/proc/self/clear_refs", "5").unwrap();
    let start = Instant::now();
    let free = getrlimit(Resource::As);
    let limit = Rlimit {
        current: Some((state_kb("VmSize:") + MOST_KB) * 1024),
        ..free
    };
    setrlimit(Resource::As, limit).unwrap();
    let said = read();
    setrlimit(Resource::As, free).unwrap();
    let (peak, took) = (state_kb("VmHWM:"), start.elapsed());
    assert!(peak < MOST_KB, "{name}: {peak} kB");
    assert!(took < LONGEST, "{name}: {took:?}");
    said
}

fn read(path: &Path) -> String {
    let mut recording = match open(path, &OpenOptions::default()) {
        Ok(recording) => recording,
        Err(error) => return error.to_string(),
    };
    let error = recording.by_ref().find_map(Result::err);
    error.map_or_else(
        || recording.issues().sentences().join(" "),
        |error| error.to_string(),
    )
}

fn repeated(line: &str, bytes: usize) -> Vec<u8> {
    line.repeat(bytes / line.len()).into_bytes()
}

/// A zip with these members.
fn zip_of<'a>(members: impl IntoIterator<Item = (&'a str, &'a [u8])>) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        let options = SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

fn zips() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let zeros = vec![b'0'; 400 << 20];
    let header = b"time,seconds_elapsed,z,y,x\n";
    let line = [&header[..], &zeros[..60 << 20]].concat();
    let mut lying = zip_of([("Gyroscope.csv", &zeros[..1 << 20])]);
    // The unpacked size in the central directory and before the data.
    let size = (1_u32 << 20).to_le_bytes();
    while let Some(at) = lying.windows(4).position(|bytes| bytes == size) {
        lying[at..at + 4].copy_from_slice(&10_u32.to_le_bytes());
    }
    let names: Vec<String> = (0..80_000).map(|number| format!("{number}.csv")).collect();
    let many = names.iter().map(|name| (name.as_str(), &b""[..]));
    vec![
        (
            "bomb.zip",
            zip_of([("Gyroscope.csv", &zeros[..])]),
            "the unpacked file: 419430400 bytes; at most ",
        ),
        (
            "line.zip",
            zip_of([("Gyroscope.csv", &line[..])]),
            "/Gyroscope.csv, line 2: a line: more than 1048576 bytes; at most 1048576 are read; check that the lines end",
        ),
        ("lying.zip", lying, "it unpacks to more than the zip says"),
        (
            "members.zip",
            zip_of(many),
            "the zip: 80000 members; at most 10000 are read",
        ),
    ]
}

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

fn record(kind: u8, length: u64, content: &[u8]) -> Vec<u8> {
    [&[kind][..], &length.to_le_bytes(), content].concat()
}

fn whole(kind: u8, content: &[u8]) -> Vec<u8> {
    record(kind, content.len() as u64, content)
}

fn mcap(records: &[u8]) -> Vec<u8> {
    [MAGIC, &whole(1, &[0; 8]), records].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// A chunk that says that it unpacks to `size` bytes.
fn chunk(size: u64, compression: &str, records: &[u8]) -> Vec<u8> {
    let times_size_crc = [&[0; 16][..], &size.to_le_bytes(), &[0; 4]].concat();
    let packed = (records.len() as u64).to_le_bytes();
    whole(
        6,
        &[&times_size_crc, &text(compression)[..], &packed, records].concat(),
    )
}

fn channel(id: u16, pairs: &[u8]) -> Vec<u8> {
    let pairs = [&(pairs.len() as u32).to_le_bytes()[..], pairs].concat();
    let numbers = [id.to_le_bytes(), [0; 2]].concat();
    whole(4, &[numbers, text("/imu"), text("cdr"), pairs].concat())
}

fn lz4(bytes: usize) -> Vec<u8> {
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    encoder.write_all(&vec![0; bytes]).unwrap();
    encoder.finish().unwrap()
}

fn mcaps() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let packed = |bytes: usize| zstd::bulk::compress(&vec![0; bytes], 1).unwrap();
    // Empty records, as many as a chunk may have.
    let size = 9 * 3_700_000;
    let most = packed(size);
    let message = whole(5, &[0; 22]);
    let overrun = [&message[..], &record(5, 100, &[0; 22])].concat();
    let pair = |number: u32| [text(&format!("{number:x}")), text("")].concat();
    let pairs: Vec<u8> = (0..500_000).flat_map(pair).collect();
    let channels: Vec<u8> = (0..4).flat_map(|id| channel(id, &pairs)).collect();
    let metadata = zstd::bulk::compress(&channels, 1).unwrap();
    let long_text = [&[0, 0, 0, 0][..], &u32::MAX.to_le_bytes()].concat();
    vec![
        (
            "record.mcap",
            mcap(&record(5, 2_580_000_000, &[0; 2600])),
            "it ends in the middle",
        ),
        (
            "chunk.mcap",
            mcap(&chunk(2_580_000_000, "zstd", &packed(2000))),
            "a block of data: 2580000000 bytes; at most 33554432 are read; write the file again",
        ),
        (
            "text.mcap",
            mcap(&whole(4, &long_text)),
            "a channel is damaged",
        ),
        (
            "more.mcap",
            mcap(&chunk(1000, "zstd", &packed(100 << 20))),
            "damaged or cut off",
        ),
        (
            "lz4.mcap",
            mcap(&chunk(1000, "lz4", &lz4(100 << 20))),
            "damaged or cut off",
        ),
        (
            "chunks.mcap",
            mcap(&chunk(size as u64, "zstd", &most).repeat(128)),
            "the unpacked file: ",
        ),
        (
            "overrun.mcap",
            mcap(&[channel(0, b""), chunk(overrun.len() as u64, "", &overrun)].concat()),
            "not a recording: MCAP with the topics /imu",
        ),
        (
            "channels.mcap",
            mcap(&chunk(channels.len() as u64, "zstd", &metadata)),
            "the schemas and channels: ",
        ),
    ]
}

fn texts() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let header = "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n";
    let after = |start: &str, rest: Vec<u8>| [start.as_bytes(), &rest].concat();
    let endless = vec![b'1'; LARGEST_FILE - 1000];
    let comments = (0..1_000_000).flat_map(|number: u32| format!("#{number:x}:\n").into_bytes());
    let columns = after("t_s", repeated(",a", 1_000_000));
    let tables = (0..300_000).map(|number: u32| format!("{{\"sensor\":\"{number:x}\"}},"));
    let quote = after(&format!("{header}\"0"), repeated("1,2,3\n", 9_000_000));
    let fix = "$GPGGA,120000,4800,N,01100,E,1,08,1,500,M,46,M,,\n";
    vec![
        (
            "line.csv",
            after(header, endless.clone()),
            "line 2: a line: more than 1048576 bytes",
        ),
        ("quote.csv", quote, "line 2: a line: more than"),
        (
            "header.csv",
            after("t_s,", endless.clone()),
            "line 1: a line: more than",
        ),
        (
            "comments.csv",
            comments.collect(),
            "the comments at the top: 10001 lines",
        ),
        ("columns.csv", columns, "missing"),
        (
            "entry.json",
            after("[{\"sensor\":\"", endless.clone()),
            "line 1: an entry {...}: more than 1048576 bytes",
        ),
        (
            "tables.json",
            after("[", tables.collect::<String>().into_bytes()),
            "the export: 1001 tables",
        ),
        (
            "nested.json",
            after("[{\"sensor\":", repeated("[", 900_000)),
            "not closed",
        ),
        (
            "line.log",
            after(fix, endless),
            "line(s) that are no NMEA sentence",
        ),
        (
            "second.log",
            after(fix, repeated("$HEHDT,1,T\n", 9_900_000)),
            "long after its last",
        ),
        (
            "fixes.log",
            after(
                fix,
                repeated("$GPGGA,,4800,N,01100,E,1,8,1,5,M,,,,\n", 9_900_000),
            ),
            "",
        ),
    ]
}

/// Columns of zeros, each in one page: packed, or a dictionary of one number.
fn zeros(has_dictionary: bool) -> Vec<u8> {
    let schema = "message rows { required double t; required double gx; required double gy; required double gz; }";
    let schema = Arc::new(parquet::schema::parser::parse_message_type(schema).unwrap());
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(has_dictionary)
        .set_data_page_size_limit(usize::MAX)
        .set_data_page_row_count_limit(usize::MAX)
        .set_write_batch_size(usize::MAX)
        .build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties)).unwrap();
    let mut group = file.next_row_group().unwrap();
    let zeros = vec![0.0; 8 << 20];
    while let Some(mut column) = group.next_column().unwrap() {
        if let ColumnWriter::DoubleColumnWriter(writer) = column.untyped() {
            writer.write_batch(&zeros, None, None).unwrap();
        }
        column.close().unwrap();
    }
    group.close().unwrap();
    file.close().unwrap();
    bytes
}

fn parquets() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let mut footer = vec![0; 6_000_000];
    footer[..4].copy_from_slice(b"PAR1");
    footer.extend(5_900_000_u32.to_le_bytes());
    footer.extend(b"PAR1");
    vec![
        (
            "page.parquet",
            zeros(false),
            "a block of data: 67108864 bytes; at most 33554432",
        ),
        (
            "rows.parquet",
            zeros(true),
            "the file: 8388608 rows; at most ",
        ),
        (
            "footer.parquet",
            footer,
            "the footer of the file: 5900000 bytes; at most 4194304",
        ),
    ]
}

/// Bags of ROS 1 and in SQLite: a chunk that says that it is large, chunks, messages and rows that are many.
fn bags(folder: &Path) -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let zeros = vec![0; 30 << 20];
    let mut packer = lz4_flex::frame::FrameEncoder::new(Vec::new());
    packer.write_all(&zeros).unwrap();
    let packed = packer.finish().unwrap();
    let chunk = |size: u32| {
        let size = size.to_le_bytes();
        let fields = [("op", &[5][..]), ("compression", b"lz4"), ("size", &size)];
        ros::record(&fields, &packed)
    };
    let bag = |chunk: &[u8]| {
        let count = (LARGEST_FILE - 13) / chunk.len();
        [b"#ROSBAG V2.0\n", &chunk.repeat(count)[..]].concat()
    };
    let database = |name: &str, count: i64, message: &[u8]| {
        let path = folder.join(name);
        ros::database(&path, &ros::drive(0..count), |_| message.to_vec());
        fs::read(path).unwrap()
    };
    let message = zstd::encode_all(&zeros[..], 1).unwrap();
    vec![
        (
            "chunk.bag",
            bag(&chunk(u32::MAX)),
            "a block of data: 4294967295 bytes; at most 33554432",
        ),
        ("chunks.bag", bag(&chunk(30 << 20)), "the unpacked file: "),
        (
            "messages.db3",
            database("made_1.db3", 500, &message),
            "the unpacked file: ",
        ),
        ("rows.db3", database("made_2.db3", 150_000, b""), ""),
        ("blobs.db3", database("made_3.db3", 2, &[1; 1 << 20]), ""),
    ]
}

/// A log of an autopilot whose clock stands still.
fn ulog() -> Vec<u8> {
    let message = |kind: u8, content: &[u8]| {
        let length = (content.len() as u16).to_le_bytes();
        [&length[..], &[kind], content].concat()
    };
    let header = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0";
    let flags = message(b'B', &[0; 40]);
    let format = message(
        b'F',
        b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;",
    );
    let subscription = message(b'A', b"\0\x07\0sensor_combined");
    let data = message(
        b'D',
        &[&[7, 0][..], &[1, 0, 0, 0, 0, 0, 0, 0], &[0; 12]].concat(),
    );
    let count = 9_000_000 / data.len();
    [
        &header[..],
        &flags,
        &format,
        &subscription,
        &data.repeat(count),
    ]
    .concat()
}

/// A table of a million scans and more.
fn scans(folder: &Path) -> String {
    let manifest = "name = \"many\"\n[sensors.radar]\nrange_std_m = 1.0\nbearing_std_deg = 1.0\ndetection_probability = 0.9\nclutter_per_km2 = 1.0\n\
        [scans]\nfile = \"scans.csv\"\nscan = \"i\"\ntime_s = \"t\"\nown_north_m = \"t\"\nown_east_m = \"t\"\n";
    let rows = (0..900_000).map(|number| format!("{number},0\n"));
    fs::write(
        folder.join("scans.csv"),
        format!("i,t\n{}", rows.collect::<String>()),
    )
    .unwrap();
    let path = folder.join("scans.toml");
    fs::write(&path, manifest).unwrap();
    measured("scans.csv", || match tracking::open(&path, None) {
        Ok(recording) => format!("{} events", recording.events.len()),
        Err(error) => error.to_string(),
    })
}

/// Reads each of the files; all of them are in memory, so that they are made in groups.
fn check(folder: &Path, cases: impl IntoIterator<Item = (&'static str, Vec<u8>, &'static str)>) {
    for (name, bytes, expected) in cases {
        assert!(bytes.len() <= LARGEST_FILE, "{name}: {} bytes", bytes.len());
        let path = folder.join(name);
        fs::write(&path, &bytes).unwrap();
        drop(bytes);
        let said = measured(name, || read(&path));
        assert!(said.contains(expected), "{name}: {said}");
    }
}

#[test]
fn no_file_of_ten_megabytes_costs_more_than_300_mb_or_half_a_minute() {
    let folder = tempfile::tempdir().unwrap();
    let long_manifest = ("long.toml", repeated("# \n", 2_000_000), "the file: 1999");
    let clock = ("clock.ulg", ulog(), "");
    // A bomb among arrays, whose bytes become numbers.
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (50000000, 1), }\n";
    let mut array = [
        b"\x93NUMPY\x01\0",
        &[header.len() as u8, 0][..],
        header.as_bytes(),
    ]
    .concat();
    array.resize(array.len() + 50_000_000, 0);
    let arrays = zip_of([("gyr.npy", &array[..])]);
    drop(array);
    let path = folder.path().join("arrays.npz");
    fs::write(&path, arrays).unwrap();
    let said = measured("arrays.npz", || {
        describe::draft(&[path], folder.path(), None)
            .map_or_else(|error| error.to_string(), |draft| draft.manifest)
    });
    assert!(
        said.contains("arrays.npz/gyr: the unpacked file: 450000"),
        "{said}"
    );
    let cases = zips()
        .into_iter()
        .chain(mcaps())
        .chain(texts())
        .chain(parquets())
        .chain([long_manifest, clock]);
    check(folder.path(), cases);
    check(folder.path(), bags(folder.path()));
    let said = scans(folder.path());
    assert!(
        said.contains("the recording: 500001 scans, detections and reports; at most 500000"),
        "{said}"
    );
}
