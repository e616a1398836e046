//! Parquet files of other makers: nulls, other number types, missing and wrong columns.
#![cfg(feature = "parquet")]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::sync::Arc;

use northing_recording::{
    Event, OpenOptions, Recording, RecordingError, Sample, SensorKind, read_bytes,
};
use parquet::basic::{Compression, GzipLevel};
use parquet::data_type::{ByteArrayType, DoubleType, FloatType, Int64Type};
use parquet::file::properties::{WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::parser::parse_message_type;
use support::error_of;

/// A column of a made-up file; `None` is a null.
#[derive(Clone)]
enum Column {
    Float(&'static str, Vec<Option<f32>>),
    Double(&'static str, Vec<Option<f64>>),
    Integer(&'static str, Vec<Option<i64>>),
    Text(&'static str, Vec<Option<&'static str>>),
}

impl Column {
    fn declaration(&self) -> String {
        match self {
            Self::Float(name, _) => format!("optional float {name};"),
            Self::Double(name, _) => format!("optional double {name};"),
            Self::Integer(name, _) => format!("optional int64 {name};"),
            Self::Text(name, _) => format!("optional binary {name} (UTF8);"),
        }
    }

    fn write(&self, writer: &mut SerializedColumnWriter<'_>) {
        fn split<T: Clone>(values: &[Option<T>]) -> (Vec<i16>, Vec<T>) {
            (
                values.iter().map(|v| i16::from(v.is_some())).collect(),
                values.iter().flatten().cloned().collect(),
            )
        }
        match self {
            Self::Float(_, values) => {
                let (levels, values) = split(values);
                writer
                    .typed::<FloatType>()
                    .write_batch(&values, Some(&levels), None)
                    .unwrap();
            }
            Self::Double(_, values) => {
                let (levels, values) = split(values);
                writer
                    .typed::<DoubleType>()
                    .write_batch(&values, Some(&levels), None)
                    .unwrap();
            }
            Self::Integer(_, values) => {
                let (levels, values) = split(values);
                writer
                    .typed::<Int64Type>()
                    .write_batch(&values, Some(&levels), None)
                    .unwrap();
            }
            Self::Text(_, values) => {
                let (levels, values) = split(values);
                let values: Vec<_> = values.into_iter().map(Into::into).collect();
                writer
                    .typed::<ByteArrayType>()
                    .write_batch(&values, Some(&levels), None)
                    .unwrap();
            }
        }
    }
}

fn read(columns: &[Column]) -> Result<Recording, RecordingError> {
    let declarations: String = columns.iter().map(Column::declaration).collect();
    let schema = parse_message_type(&format!("message other {{ {declarations} }}")).unwrap();
    let mut bytes = Vec::new();
    let mut writer =
        SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::default()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for column in columns {
        let mut writer = group.next_column().unwrap().unwrap();
        column.write(&mut writer);
        writer.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
    read_bytes(bytes, "other.parquet", &OpenOptions::default())
}

fn gyroscope() -> Vec<Column> {
    vec![
        Column::Double("t", vec![Some(0.0), None, Some(0.01), Some(0.02)]),
        Column::Float("gx", vec![Some(1.0), Some(1.0), None, None]),
        Column::Float("gy", vec![Some(2.0), Some(2.0), None, Some(f32::INFINITY)]),
        Column::Integer("gz", vec![Some(3), Some(3), None, Some(0)]),
    ]
}

#[test]
fn nulls_are_absent_samples_and_any_number_type_is_read() {
    let mut recording = read(&gyroscope()).unwrap();
    let events: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
    assert_eq!(events.len(), 2);
    assert_eq!(
        events[0].sample,
        Sample::AngularRate([1.0, 2.0, 3.0].into())
    );
    assert_eq!(events[1].time_ns, 20_000_000);
    assert_eq!(recording.issues().rows_without_stamp, 1);
    assert_eq!(
        recording.issues().non_finite_samples[&SensorKind::Gyroscope],
        1
    );
}

#[test]
fn missing_and_wrong_columns_are_named() {
    let without = |name: &str| {
        let mut columns = gyroscope();
        columns.retain(|column| !column.declaration().contains(&format!(" {name};")));
        error_of(read(&columns))
    };
    assert!(without("t").starts_with(
        "other.parquet: missing column t; the file has gx, gy, gz; the columns are t (s),"
    ));
    assert!(without("gy").starts_with("other.parquet: missing column gy; the file has t, gx, gz;"));

    let time = gyroscope()[0].clone();
    let numbers = vec![Some(0.0_f32); 4];
    let force = ["ax", "ay", "az"].map(|name| Column::Float(name, numbers.clone()));
    let only_force = [std::slice::from_ref(&time), &force[..]].concat();
    assert!(
        error_of(read(&only_force))
            .starts_with("other.parquet: no gyroscope: it has accelerometer;")
    );
    assert!(
        error_of(read(&[time]))
            .starts_with("other.parquet: missing column gx, gy, gz; the file has t;")
    );

    let mut with_text = gyroscope();
    with_text[0] = Column::Text("t", vec![Some("noon"); 4]);
    assert_eq!(
        error_of(read(&with_text)),
        "other.parquet: column `t` is of type BYTE_ARRAY; expected float or double"
    );
}

#[test]
fn a_time_that_is_none_names_its_row() {
    let mut columns = gyroscope();
    columns[0] = Column::Double("t", vec![Some(0.0), Some(0.005), Some(1e30), Some(0.02)]);
    assert_eq!(
        error_of(read(&columns)),
        "other.parquet, line 3, column `t`: `1000000000000000000000000000000` is not a time in seconds"
    );
}

#[test]
fn columns_without_rows_are_empty() {
    let columns = ["t", "gx", "gy", "gz"].map(|name| Column::Double(name, vec![]));
    assert!(
        error_of(read(&columns)).starts_with("other.parquet: empty: no sample with a time stamp")
    );
}

/// The gyroscope for some seconds, packed in this way.
fn packed(compression: Compression, version: WriterVersion) -> Vec<u8> {
    let properties = WriterProperties::builder()
        .set_compression(compression)
        .set_writer_version(version)
        .build();
    let schema = "message rows { required double t; required double gx; required double gy; required double gz; }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties)).unwrap();
    let mut group = file.next_row_group().unwrap();
    let values: Vec<f64> = (0..500).map(|k| 0.01 * f64::from(k)).collect();
    while let Some(mut column) = group.next_column().unwrap() {
        column
            .typed::<DoubleType>()
            .write_batch(&values, None, None)
            .unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    file.close().unwrap();
    bytes
}

fn read_packed(bytes: Vec<u8>) -> Result<Vec<Event>, RecordingError> {
    read_bytes(bytes, "other.parquet", &OpenOptions::default())?.collect()
}

#[test]
fn gzip_and_lz4_are_read_and_others_are_refused_by_name() {
    let plain = packed(Compression::UNCOMPRESSED, WriterVersion::PARQUET_1_0);
    let expected = read_packed(plain).unwrap();
    assert_eq!(expected.len(), 500);
    let gzip = Compression::GZIP(GzipLevel::default());
    for (compression, version) in [
        (gzip, WriterVersion::PARQUET_1_0),
        (Compression::LZ4_RAW, WriterVersion::PARQUET_1_0),
        (Compression::LZ4_RAW, WriterVersion::PARQUET_2_0),
        (Compression::SNAPPY, WriterVersion::PARQUET_1_0),
    ] {
        let read = read_packed(packed(compression, version)).unwrap();
        assert_eq!(read, expected, "{compression}");
    }
    for (bytes, named) in [
        (
            packed(gzip, WriterVersion::PARQUET_2_0),
            "gzip in data pages of version 2 is not read; write it again",
        ),
        (
            packed(Compression::LZ4, WriterVersion::PARQUET_1_0),
            "its column `t` is compressed with LZ4, which is not read; write it again",
        ),
    ] {
        let error = read_packed(bytes).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("other.parquet: {named}")),
            "{error}"
        );
    }
}

#[test]
fn cut_and_flipped_pages_are_refused_or_read() {
    let gzip = Compression::GZIP(GzipLevel::default());
    for compression in [gzip, Compression::LZ4_RAW] {
        let whole = packed(compression, WriterVersion::PARQUET_1_0);
        for at in (0..whole.len()).step_by(13) {
            assert!(read_packed(whole[..at].to_vec()).is_err(), "{at}");
            let mut flipped = whole.clone();
            flipped[at] ^= 0x11;
            // Any answer but a panic or more than there is.
            assert!(
                read_packed(flipped).map_or(0, |events| events.len()) <= 500,
                "{at}"
            );
        }
    }
}
