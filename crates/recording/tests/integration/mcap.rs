//! MCAP in and out: recordings of the lab, and messages of ROS 2.
#![cfg(feature = "mcap")]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::collections::BTreeMap;
use std::io::{Cursor, Write};

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_recording::mcap::{
    LabWriter, RecordKind, RosWriter, is_complete, lab_records, recover,
};
use northing_recording::wire::{WireFormat, events};
use northing_recording::{
    Event, Metadata, OpenOptions, Recording, Reference, Sample, SensorKind, open, read_bytes,
};

const START_NS: i64 = 1_763_697_600_000_000_000;

fn event(time_ms: i64, sample: Sample) -> Event {
    Event {
        time_ns: time_ms * 1_000_000,
        sample,
    }
}

/// Gyroscope and accelerometer at 100 Hz on stamps of their own, magnetometer at 25 Hz.
fn measured(seconds: i64) -> Vec<Event> {
    let mut all = Vec::new();
    for k in 0..100 * seconds {
        let x = k as f64 * 1e-3;
        all.push(event(
            10 * k,
            Sample::AngularRate(Vector3::new(x.sin(), 0.1, -0.2)),
        ));
        all.push(event(
            10 * k + 3,
            Sample::SpecificForce(Vector3::new(x, 0.1, 9.81)),
        ));
        if k % 4 == 0 {
            let field = Vector3::new(20.0, x, -40.0);
            all.push(event(10 * k + 3, Sample::MagneticField(field)));
        }
    }
    all
}

fn page(session: &str, seq: usize, events: &[Event]) -> Vec<u8> {
    let rows = |of: fn(&Sample) -> Option<&Vector3<f64>>| -> String {
        let rows = events.iter().filter_map(|event| {
            let v = of(&event.sample)?;
            let t = event.time_ns as f64 * 1e-6;
            Some(format!("[{t},{:?},{:?},{:?}]", v.x, v.y, v.z))
        });
        rows.collect::<Vec<_>>().join(",")
    };
    let g = rows(|s| match s {
        Sample::AngularRate(v) => Some(v),
        _ => None,
    });
    let a = rows(|s| match s {
        Sample::SpecificForce(v) => Some(v),
        _ => None,
    });
    let m = rows(|s| match s {
        Sample::MagneticField(v) => Some(v),
        _ => None,
    });
    format!(
        r#"{{"v":1,"device":"anna","session":"{session}","seq":{seq},"platform":"android","gs":{{"g":[{g}],"a":[{a}],"m":[{m}]}}}}"#
    )
    .into_bytes()
}

type Memory = LabWriter<Cursor<Vec<u8>>>;

fn writer() -> Memory {
    let facts = BTreeMap::from([("program".to_owned(), "test".to_owned())]);
    LabWriter::new(Cursor::new(Vec::new()), &facts).unwrap()
}

/// A phone whose batches overlap in time, overtake each other and come twice.
fn record(writer: &mut Memory, events: &[Event]) {
    let kind = RecordKind::Payload(WireFormat::PhonePage);
    let batches: Vec<Vec<u8>> = events
        .chunks(23)
        .enumerate()
        .map(|(seq, chunk)| page("s", seq, chunk))
        .collect();
    let mut order: Vec<usize> = (0..batches.len()).collect();
    order[1..]
        .chunks_exact_mut(2)
        .for_each(|pair| pair.swap(0, 1));
    order.push(0);
    for (turn, index) in order.into_iter().enumerate() {
        let arrival = START_NS + 100_000_000 * turn as i64;
        writer
            .write("anna", kind, arrival, &batches[index])
            .unwrap();
    }
}

fn read(mut recording: Recording) -> (Vec<Event>, Vec<String>) {
    let events = recording.by_ref().map(|event| event.unwrap()).collect();
    (events, recording.issues().sentences())
}

fn in_memory(bytes: Vec<u8>, device: Option<&str>) -> Recording {
    let options = OpenOptions {
        device: device.map(str::to_owned),
        ..OpenOptions::default()
    };
    read_bytes(bytes, "lab.mcap", &options).unwrap()
}

#[test]
fn a_recording_of_the_lab_gives_each_sample_once_and_in_order() {
    let events = measured(5);
    let mut writer = writer();
    record(&mut writer, &events);
    let recording = in_memory(writer.finish().unwrap().into_inner(), None);
    assert_eq!(recording.metadata().device.as_deref(), Some("anna"));
    assert_eq!(recording.metadata().format, "mcap");
    assert_eq!(
        recording.sensors(),
        [
            SensorKind::Gyroscope,
            SensorKind::Accelerometer,
            SensorKind::Magnetometer
        ]
    );
    let (back, issues) = read(recording);
    assert_eq!(back, events);
    assert_eq!(issues, [""; 0]);
}

#[test]
fn of_several_devices_one_is_chosen_and_the_choice_is_listed() {
    let mut writer = writer();
    record(&mut writer, &measured(2));
    let kind = RecordKind::Payload(WireFormat::Events);
    let own = measured(1);
    writer
        .write("virtual 1", kind, START_NS, &events::encode(&own))
        .unwrap();
    writer
        .write("", RecordKind::Refused, START_NS, b"{")
        .unwrap();
    let bytes = writer.finish().unwrap().into_inner();
    let error = read_bytes(bytes.clone(), "lab.mcap", &OpenOptions::default()).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("anna, virtual 1") && text.contains("--device"),
        "{text}"
    );
    let (back, _) = read(in_memory(bytes.clone(), Some("virtual 1")));
    assert_eq!(back, own);
    let options = OpenOptions {
        device: Some("ben".to_owned()),
        ..OpenOptions::default()
    };
    let text = read_bytes(bytes, "lab.mcap", &options)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("no device `ben`") && text.contains("anna"),
        "{text}"
    );
}

#[test]
fn another_page_load_follows_the_one_before() {
    let mut writer = writer();
    let kind = RecordKind::Payload(WireFormat::PhonePage);
    let events = measured(4);
    for (arrival_s, session) in [(0, "a"), (10, "b")] {
        let arrival = START_NS + arrival_s * 1_000_000_000;
        writer
            .write("anna", kind, arrival, &page(session, 0, &events))
            .unwrap();
    }
    let (back, issues) = read(in_memory(writer.finish().unwrap().into_inner(), None));
    assert_eq!(back.len(), 2 * events.len());
    let last = events.last().unwrap().time_ns;
    assert_eq!(back[events.len()].time_ns, last + 10_000_000_000);
    assert!(
        issues[0].contains("10") || issues[1].contains("anew"),
        "{issues:?}"
    );
}

#[test]
fn a_recording_cut_anywhere_is_read_up_to_there_and_recovered() {
    let events = measured(20);
    let mut writer = writer();
    let kind = RecordKind::Payload(WireFormat::Events);
    for chunk in events.chunks(50) {
        writer
            .write("v", kind, START_NS, &events::encode(chunk))
            .unwrap();
        writer.flush().unwrap();
    }
    let flushed = writer.abandon().into_inner();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.mcap");
    for cut in [0, 777, flushed.len() / 2] {
        let bytes = &flushed[..flushed.len() - cut];
        std::fs::write(&path, bytes).unwrap();
        assert!(!is_complete(&path).unwrap());
        let (back, issues) = read(open(&path, &OpenOptions::default()).unwrap());
        assert_eq!(back, events[..back.len()]);
        // One message has 50 events of at most 35 bytes, and what belongs to it in the file.
        let missing = events.len() - back.len();
        assert!(
            missing * 34 <= cut + 50 * 35 && (cut > 0 || missing == 0),
            "{cut}: {missing}"
        );
        assert!(
            issues.iter().any(|i| i.contains("not finished")),
            "{issues:?}"
        );
        let recovered = recover(&path).unwrap();
        assert_eq!(recovered.messages as usize, back.len().div_ceil(50));
        assert!(is_complete(&path).unwrap());
        let (again, issues) = read(open(&path, &OpenOptions::default()).unwrap());
        assert_eq!(again, back);
        assert_eq!(issues, [""; 0]);
    }
    std::fs::write(&path, &flushed[..20]).unwrap();
    assert!(recover(&path).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), flushed[..20]);
    assert!(open(&path, &OpenOptions::default()).is_err());
}

#[test]
fn records_come_back_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lab.mcap");
    let mut writer =
        LabWriter::new(std::fs::File::create(&path).unwrap(), &BTreeMap::new()).unwrap();
    let written = [
        ("a", RecordKind::Control, 5, &br#"{"event":"device"}"#[..]),
        ("a", RecordKind::Payload(WireFormat::Razor), 7, b"#YPR=1"),
        (
            "b",
            RecordKind::Payload(WireFormat::RazorBinary),
            6,
            b"\x00\xff",
        ),
        ("", RecordKind::Refused, 8, b""),
    ];
    for (device, kind, arrival_ns, bytes) in written {
        writer.write(device, kind, arrival_ns, bytes).unwrap();
    }
    writer.finish().unwrap();
    let mut records = lab_records(&path).unwrap();
    for (device, kind, arrival_ns, bytes) in written {
        let record = records.next().unwrap();
        assert_eq!(
            (
                record.device.as_str(),
                record.kind,
                record.arrival_ns,
                record.bytes.as_slice()
            ),
            (device, kind, arrival_ns, bytes)
        );
    }
    assert!(records.next().is_none() && records.cut().is_none());
}

#[test]
fn messages_of_ros_come_back() {
    let q = UnitQuaternion::from_euler_angles(0.1, 0.2, 2.9);
    let mut events = measured(2);
    events.push(event(2000, Sample::AngularRate(Vector3::zeros())));
    events.push(event(2000, Sample::SpecificForce(Vector3::z())));
    events.push(event(2000, Sample::DeviceOrientation(q)));
    let reference = |scored| {
        Sample::Reference(Reference {
            attitude: q,
            scored,
        })
    };
    events.push(event(2000, reference(true)));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.mcap");
    let mut writer = northing_recording::create(&path, &Metadata::default(), &[], false).unwrap();
    for event in &events {
        writer.write(event).unwrap();
    }
    // Not scored and without topic: left out.
    writer.write(&event(6000, reference(false))).unwrap();
    writer.write(&event(6010, Sample::Pressure(1e5))).unwrap();
    writer.finish().unwrap();
    let recording = open(&path, &OpenOptions::default()).unwrap();
    let (back, issues) = read(recording);
    assert_eq!(
        issues,
        [
            "Topics that are read: /device/orientation, /imu/data_raw, /imu/mag, /reference/orientation."
        ]
    );
    assert_eq!(back.len(), events.len());
    for (one, other) in back.iter().zip(&events) {
        assert_eq!(one.time_ns, other.time_ns);
        match (&one.sample, &other.sample) {
            (Sample::MagneticField(a), Sample::MagneticField(b)) => {
                approx::assert_relative_eq!(a, b, max_relative = 1e-15);
            }
            (a, b) => assert_eq!(a, b),
        }
    }
}

#[test]
fn an_estimate_is_written_beside_the_raw_data_as_ros_means_it() {
    let q = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let p = Matrix3::from_diagonal(&Vector3::new(1.0, 4.0, 9.0));
    let rate = Sample::AngularRate(Vector3::x());
    let mut writer = RosWriter::new(Cursor::new(Vec::new()), &Metadata::default(), "x").unwrap();
    writer.add(&event(1000, rate)).unwrap();
    writer
        .estimate(1_000_000_000, &q, Some(&p), [Some(&rate), None])
        .unwrap();
    let bytes = writer.complete().unwrap().into_inner();
    let messages: Vec<_> = ::mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(|m| m.unwrap())
        .collect();
    let of = |topic: &str| messages.iter().find(|m| m.channel.topic == topic).unwrap();
    let (raw, data) = (of("/imu/data_raw"), of("/imu/data"));
    for message in [raw, data] {
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(
            (schema.name.as_str(), schema.encoding.as_str()),
            ("sensor_msgs/msg/Imu", "ros2msg")
        );
        assert!(String::from_utf8_lossy(&schema.data).contains("MSG: builtin_interfaces/Time"));
        assert_eq!(
            (message.channel.message_encoding.as_str(), message.log_time),
            ("cdr", 1_000_000_000)
        );
    }
    let number = |message: &::mcap::Message<'_>, index: usize| {
        let at = 20 + 8 * index;
        f64::from_le_bytes(message.data[at..at + 8].try_into().unwrap())
    };
    // No orientation in the raw data; no force in either.
    assert_eq!(
        (number(raw, 4), number(raw, 28), number(data, 28)),
        (-1.0, -1.0, -1.0)
    );
    // A quarter turn exchanges the variances about x and y.
    let variances = [number(data, 4), number(data, 8), number(data, 12)];
    for (variance, expected) in variances.into_iter().zip([4.0, 1.0, 9.0]) {
        approx::assert_relative_eq!(variance, expected, max_relative = 1e-12);
    }
    approx::assert_relative_eq!(
        number(data, 2),
        std::f64::consts::FRAC_1_SQRT_2,
        max_relative = 1e-12
    );
    // Both topics hold the rate; a reader takes the raw one, and the other when told.
    let recording = in_memory(bytes.clone(), None);
    assert_eq!(recording.sensors(), [SensorKind::Gyroscope]);
    let recording = in_memory(bytes, Some("/imu/data"));
    assert_eq!(
        recording.sensors(),
        [SensorKind::Gyroscope, SensorKind::DeviceOrientation]
    );
}

#[test]
fn damaged_bytes_are_an_error_or_a_remark_and_never_a_panic() {
    let mut writer = writer();
    record(&mut writer, &measured(1));
    let whole = writer.finish().unwrap().into_inner();
    for position in (0..whole.len()).step_by(97) {
        let mut bytes = whole.clone();
        bytes[position] ^= 0x55;
        bytes.truncate(whole.len() - position % 3);
        if let Ok(recording) = read_bytes(bytes, "x.mcap", &OpenOptions::default()) {
            for event in recording {
                let _ = event;
            }
        }
    }
}

/// The same file with its chunks packed by `pack` under that name.
fn repacked(bytes: &[u8], name: &str, pack: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    const CHUNK: u8 = 6;
    let mut out = bytes[..8].to_vec();
    let mut rest = &bytes[8..bytes.len() - 8];
    while let Some((head, behind)) = rest.split_first_chunk::<9>() {
        let length = u64::from_le_bytes(head[1..].try_into().unwrap()) as usize;
        let (content, behind) = behind.split_at(length);
        rest = behind;
        let content = if head[0] == CHUNK {
            // Times, size and checksum; then the name of no compression, the length and the records.
            let records = pack(&content[28 + 4 + 8..]);
            let text = [&(name.len() as u32).to_le_bytes(), name.as_bytes()].concat();
            let length = (records.len() as u64).to_le_bytes();
            [&content[..28], &text, &length, &records].concat()
        } else {
            content.to_vec()
        };
        out.push(head[0]);
        out.extend((content.len() as u64).to_le_bytes());
        out.extend(content);
    }
    out.extend(&bytes[bytes.len() - 8..]);
    out
}

fn lz4(records: &[u8]) -> Vec<u8> {
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    encoder.write_all(records).unwrap();
    encoder.finish().unwrap()
}

fn written_for_ros() -> Vec<u8> {
    let mut writer =
        RosWriter::new(Cursor::new(Vec::new()), &Metadata::default(), "memory").unwrap();
    for event in measured(3) {
        writer.add(&event).unwrap();
    }
    writer.complete().unwrap().into_inner()
}

#[test]
fn chunks_of_lz4_are_read_and_others_are_refused_by_name() {
    let plain = written_for_ros();
    let expected = read(in_memory(plain.clone(), None)).0;
    assert!(expected.len() > 600);
    let (events, notes) = read(in_memory(repacked(&plain, "lz4", lz4), None));
    assert_eq!(events, expected);
    assert!(
        !notes.iter().any(|note| note.contains("not finished")),
        "{notes:?}"
    );

    let other = repacked(&plain, "br", <[u8]>::to_vec);
    let error = read_bytes(other, "memory.mcap", &OpenOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "memory.mcap: its chunks are compressed with `br`; zstd, lz4 and none are read; write it again, e.g. with \
         `mcap compress --compression zstd`"
    );
}

#[test]
fn cut_and_flipped_chunks_of_lz4_are_no_panic_and_no_false_sample() {
    let plain = written_for_ros();
    let expected = read(in_memory(plain.clone(), None)).0;
    let whole = repacked(&plain, "lz4", lz4);
    let read = |bytes: Vec<u8>| {
        read_bytes(bytes, "memory.mcap", &OpenOptions::default())
            .map(|recording| recording.filter_map(Result::ok).collect::<Vec<_>>())
            .unwrap_or_default()
    };
    for length in (0..whole.len()).step_by(whole.len() / 97) {
        assert!(
            expected.starts_with(&read(whole[..length].to_vec())),
            "{length}"
        );
    }
    for at in (0..whole.len()).step_by(whole.len() / 97) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        assert!(read(bytes).len() <= expected.len(), "{at}");
    }
}
