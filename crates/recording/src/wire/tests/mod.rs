//! Tests of the decoders with messages that the tests write themselves, kind and hostile.

mod hostile;
mod line_formats;
mod northing_serial;
mod phone_page;
mod phyphox;
mod razor;
mod sensor_logger_push;
mod sensorserver;

use nalgebra::Vector3;

use super::{Decoded, MOST_NOTICES, Tone};
use crate::event::{Sample, SensorKind};

/// The vectors of one sensor, in order.
fn vectors(out: &Decoded, kind: SensorKind) -> Vec<[f64; 3]> {
    let of_kind = out.events.iter().filter(|e| e.sample.kind() == kind);
    of_kind
        .map(|event| match event.sample {
            Sample::AngularRate(v)
            | Sample::SpecificForce(v)
            | Sample::MagneticField(v)
            | Sample::MagneticFieldUncalibrated(v)
            | Sample::DeviceGyroscopeBias(v) => v.into(),
            other => panic!("{other:?} is no vector"),
        })
        .collect()
}

/// Where the first orientation takes a body vector.
fn turned(out: &Decoded, body: Vector3<f64>) -> Vector3<f64> {
    let attitude = out.events.iter().find_map(|event| match event.sample {
        Sample::DeviceOrientation(q) => Some(q),
        _ => None,
    });
    attitude.expect("an orientation") * body
}

fn said(out: &Decoded, part: &str) -> bool {
    out.notices.iter().any(|notice| notice.text.contains(part))
}

#[test]
fn equal_remarks_are_counted_and_their_number_is_limited() {
    let mut decoded = Decoded::default();
    for _ in 0..3 {
        decoded.note(Tone::Bad, "the same");
    }
    assert_eq!(decoded.notices.len(), 1);
    assert_eq!(decoded.notices[0].count, 3);
    for index in 0..1000 {
        decoded.note(Tone::Info, format!("remark {index}"));
    }
    assert_eq!(decoded.notices.len(), MOST_NOTICES);
    let total: u64 = decoded.notices.iter().map(|notice| notice.count).sum();
    assert_eq!(total, 1003);
}

#[test]
fn absurd_and_missing_numbers_are_left_out_and_said() {
    let mut decoded = Decoded::default();
    decoded.vector(0, SensorKind::Gyroscope, Vector3::new(0.0, 201.0, 0.0));
    decoded.vector(0, SensorKind::Gyroscope, Vector3::new(0.0, f64::NAN, 0.0));
    decoded.pressure(0, f64::INFINITY);
    decoded.orientation(0, [0.0; 4]);
    decoded.vector(7, SensorKind::Gyroscope, Vector3::new(0.0, 1.0, 0.0));
    assert_eq!(decoded.events.len(), 1);
    assert_eq!(decoded.events[0].time_ns, 7);
    assert_eq!(decoded.notices.len(), 4);
    assert!(decoded.notices.iter().all(|n| n.tone == Tone::Bad));
}

#[test]
fn orientations_have_a_positive_scalar() {
    let mut decoded = Decoded::default();
    decoded.orientation(0, [-2.0, 0.0, 0.0, 2.0]);
    let Sample::DeviceOrientation(q) = decoded.events[0].sample else {
        panic!("no orientation");
    };
    assert!(q.w > 0.0 && q.k < 0.0);
}
