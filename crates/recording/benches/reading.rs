//! How fast recordings are read: `cargo bench -p northing-recording --features parquet`.
//!
//! The recordings are made up: 120 s of a phone with its gyroscope and accelerometer at 200 Hz and
//! the magnetometer at 50 Hz on stamps of their own, a reference on every row.
#![allow(clippy::unwrap_used)] // a benchmark unwraps like a test

use divan::Bencher;
use divan::counter::ItemsCount;
use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{
    Event, Metadata, OpenOptions, Reference, Sample, SensorKind, create, open,
};

fn main() {
    divan::main();
}

/// The events of the made-up phone.
fn phone() -> Vec<Event> {
    let mut attitude = UnitQuaternion::identity();
    let mut events = Vec::new();
    for i in 0..24_000_i64 {
        let time_ns = i * 5_000_000;
        let t = i as f64 * 0.005;
        let rate = Vector3::new(0.3 * t.sin(), 0.2, 0.1 * t.cos());
        attitude *= UnitQuaternion::from_scaled_axis(rate * 0.005);
        let mut put = |time_ns, sample| events.push(Event { time_ns, sample });
        let reference = Reference {
            attitude,
            scored: true,
        };
        put(time_ns, Sample::AngularRate(rate));
        put(time_ns, Sample::Reference(reference));
        if i % 2 == 0 {
            put(time_ns, Sample::DeviceOrientation(attitude));
        }
        let force = attitude.inverse() * Vector3::z() * 9.81;
        put(time_ns + 1_000_000, Sample::SpecificForce(force));
        if i % 4 == 0 {
            let field = attitude.inverse() * Vector3::new(0.0, 22.0, -42.0);
            put(time_ns + 2_000_000, Sample::MagneticField(field));
        }
    }
    events
}

fn read(bencher: Bencher<'_, '_>, name: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let events = phone();
    let mut writer = create(&path, &Metadata::default(), &SensorKind::ALL, false).unwrap();
    events.iter().for_each(|event| writer.write(event).unwrap());
    writer.finish().unwrap();
    bencher
        .counter(ItemsCount::new(events.len()))
        .bench_local(|| {
            let recording = open(&path, &OpenOptions::default()).unwrap();
            assert_eq!(recording.map(Result::unwrap).count(), events.len());
        });
}

#[cfg(feature = "parquet")]
#[divan::bench]
fn parquet_120_s_of_a_phone(bencher: Bencher<'_, '_>) {
    read(bencher, "phone.parquet");
}

#[divan::bench]
fn csv_120_s_of_a_phone(bencher: Bencher<'_, '_>) {
    read(bencher, "phone.csv");
}
