//! Sentences of a board: what they become, damaged ones, and a board that starts again.

use nalgebra::Vector3;
use northing_core::earth::wgs84::{Geodetic, LocalFrame};
use northing_core::navigation::Validity;

use crate::device_navigation::DeviceNavigation;
use crate::event::{Event, Sample, SensorKind};
use crate::wire::northing_serial::{Axes, NorthingSerial};
use crate::wire::{Decoded, Tone};

fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn decoded(axes: Axes, bodies: &[&str]) -> Decoded {
    let text: String = bodies.iter().map(|body| sentence(body)).collect();
    NorthingSerial::new(axes).push(text.as_bytes())
}

fn vector(decoded: &Decoded, kind: SensorKind) -> Vector3<f64> {
    let found = decoded
        .events
        .iter()
        .find(|event| event.sample.kind() == kind);
    match found.unwrap().sample {
        Sample::SpecificForce(v) | Sample::AngularRate(v) | Sample::MagneticField(v) => v,
        other => panic!("{other:?}"),
    }
}

/// Where the board itself says that it is, if it does.
fn navigation(decoded: &Decoded) -> Option<DeviceNavigation> {
    decoded.events.iter().find_map(|event| match event.sample {
        Sample::DeviceNavigation(estimate) => Some(estimate),
        _ => None,
    })
}

/// Metres from the origin of [`ORIGIN`].
fn metres(estimate: &DeviceNavigation) -> Vector3<f64> {
    let place = |latitude: f64, longitude: f64, height_m| Geodetic {
        latitude_rad: latitude,
        longitude_rad: longitude,
        height_m,
    };
    let origin = place(53.1173_f64.to_radians(), 23.1434_f64.to_radians(), 176.5);
    LocalFrame::new(origin).ned(&place(
        estimate.latitude_rad,
        estimate.longitude_rad,
        estimate.height_m,
    ))
}

const ORIGIN: &str = "PNORO,531173000,231434000,176500";
const FRAME: &str = "PNORI,4000,20,-7949,-5957,-98293,41,-1122,837,1908,-832,4511";
const ESTIMATE: &str = "PNORE,4000,3789,-4761,35808,1388,1388,1383,1,-6407,-1106,2146,-974,-839,-267,1868,1868,3488,A31D33A6";
const FIX: &str = "PNORG,4000,43204000,531173000,231434000,176500,9,92,1286,8440";

#[test]
fn a_step_of_the_board_is_read_in_its_own_axes() {
    let out = decoded(Axes::Board, &[ORIGIN, FRAME, FIX, ESTIMATE]);
    assert!(out.notices.is_empty(), "{:?}", out.notices);
    assert!(
        out.events
            .iter()
            .all(|event| event.time_ns == 4_000_000_000)
    );
    let force = vector(&out, SensorKind::Accelerometer);
    approx::assert_relative_eq!(
        force,
        Vector3::new(-0.7949, -0.5957, -9.8293),
        epsilon = 1e-12
    );
    let rate = vector(&out, SensorKind::Gyroscope);
    approx::assert_relative_eq!(rate, Vector3::new(41e-5, -1122e-5, 837e-5), epsilon = 1e-12);
    let field = vector(&out, SensorKind::Magnetometer);
    approx::assert_relative_eq!(field, Vector3::new(19.08, -8.32, 45.11), epsilon = 1e-12);
    let estimate = navigation(&out).unwrap();
    let position = Vector3::new(-6.407, -1.106, 2.146);
    approx::assert_relative_eq!(metres(&estimate), position, epsilon = 1e-6);
    assert_eq!(estimate.validity, Validity::Aided);
    let numbers = [estimate.velocity_m_s, estimate.std_m].concat();
    let expected = [-0.974, -0.839, -0.267, 1.868, 1.868, 3.488];
    for (number, expected) in numbers.iter().zip(expected) {
        approx::assert_relative_eq!(*number, expected, epsilon = 1e-12);
    }
    approx::assert_relative_eq!(
        estimate.heading_std_rad.to_degrees(),
        1.383,
        epsilon = 1e-12
    );
    let attitude = out.events.iter().find_map(|event| match event.sample {
        Sample::DeviceOrientation(q) => Some(q),
        _ => None,
    });
    let (roll, pitch, yaw) = attitude.unwrap().euler_angles();
    for (angle, degrees) in [(roll, 3.789_f64), (pitch, -4.761), (yaw, 35.808)] {
        approx::assert_relative_eq!(angle, degrees.to_radians(), epsilon = 1e-12);
    }
    let fix = out.events.iter().find_map(|event| match event.sample {
        Sample::GnssPosition(fix) => Some(fix),
        _ => None,
    });
    let fix = fix.unwrap();
    approx::assert_relative_eq!(fix.latitude_rad.to_degrees(), 53.1173, epsilon = 1e-12);
    approx::assert_relative_eq!(fix.height_m.unwrap(), 176.5);
    assert_eq!(fix.satellites, Some(9));
    let speed = out.events.iter().find_map(|event| match event.sample {
        Sample::GnssVelocity(v) => Some(v.north_m_s.hypot(v.east_m_s)),
        _ => None,
    });
    approx::assert_relative_eq!(speed.unwrap(), 1.286, epsilon = 1e-12);
}

#[test]
fn in_a_phones_axes_up_is_up_and_east_is_first() {
    let out = decoded(Axes::Phone, &[ORIGIN, FRAME, ESTIMATE]);
    let force = vector(&out, SensorKind::Accelerometer);
    approx::assert_relative_eq!(
        force,
        Vector3::new(-0.5957, -0.7949, 9.8293),
        epsilon = 1e-12
    );
    // A place on the Earth has no axes.
    assert!(navigation(&out).is_some());
    let attitude = out.events.iter().find_map(|event| match event.sample {
        Sample::DeviceOrientation(q) => Some(q),
        _ => None,
    });
    // Where the board says that gravity is, the force at rest points up.
    let up = attitude.unwrap() * force.normalize();
    assert!(up.z > 0.99, "{up}");
}

#[test]
fn what_is_unknown_is_left_out_and_what_is_damaged_is_said() {
    let out = decoded(
        Axes::Board,
        &[
            "PNORI,20,,,,,1,2,3,,,",
            "PNORE,20,0,0,0,9,9,9,0,,,,,,,,,,00000000",
            // Where the positions count from is not known yet.
            "PNORE,40,0,0,0,9,9,9,1,1,2,3,4,5,6,7,8,9,00000000",
            ORIGIN,
            "PNORE,60,0,0,0,9,9,9,3,1,2,3,4,5,6,7,8,9,00000000",
            "PNORB,1,axis-filters,power",
            "PNORE,0,0,0,0,9,9,9,1,1,2,3,4,5,6,7,8,9,00000000",
        ],
    );
    let kinds: Vec<_> = out.events.iter().map(|event| event.sample.kind()).collect();
    let orientation = SensorKind::DeviceOrientation;
    let expected = [
        SensorKind::Gyroscope,
        orientation,
        orientation,
        orientation,
        SensorKind::DeviceNavigation,
        orientation,
    ];
    assert_eq!(kinds, expected);
    // The board itself does not trust it any more, and says so.
    assert_eq!(navigation(&out).unwrap().validity, Validity::Invalid);
    let whole = sentence(FRAME);
    for place in 1..whole.len() - 2 {
        let mut bytes = whole.clone().into_bytes();
        bytes[place] ^= 1;
        let out = NorthingSerial::new(Axes::Board).push(&bytes);
        assert!(out.events.is_empty(), "{place}");
        assert_eq!(out.notices[0].tone, Tone::Bad);
    }
    let out = decoded(
        Axes::Board,
        &["PNORI,20", "PNORX,1", "PNORI,x,20,1,1,1,1,1,1,1,1,1"],
    );
    assert!(out.events.is_empty());
    assert_eq!(out.notices[0].count, 3);
}

#[test]
fn time_goes_on_when_the_board_starts_again_and_when_its_counter_rolls_over() {
    let mut decoder = NorthingSerial::new(Axes::Board);
    let mut time = |body: &str| -> (Option<i64>, usize) {
        let out = decoder.push(sentence(body).as_bytes());
        let first: Option<&Event> = out.events.first();
        (first.map(|event| event.time_ns), out.notices.len())
    };
    let before = u32::MAX - 9;
    let frame = |ms: u32| format!("PNORI,{ms},20,,,,1,2,3,,,");
    let first = i64::from(before) * 1_000_000;
    assert_eq!(time("PNORB,1,axis-filters,power"), (None, 1));
    assert_eq!(time(&frame(before)), (Some(first), 0));
    assert_eq!(time(&frame(10)), (Some(first + 20_000_000), 0));
    assert_eq!(time("PNORB,1,axis-filters,watchdog"), (None, 2));
    assert_eq!(time(&frame(0)), (Some(first + 1_020_000_000), 0));
    assert_eq!(time(&frame(20)), (Some(first + 1_040_000_000), 0));
}

#[test]
fn faults_that_the_board_has_found_are_remarks() {
    let mut decoder = NorthingSerial::new(Axes::Board);
    let mut told = |body: &str| -> Vec<(Tone, String)> {
        let notices = decoder.push(sentence(body).as_bytes()).notices;
        notices.into_iter().map(|n| (n.tone, n.text)).collect()
    };
    let fault = |what: &str| {
        let text = format!("The board has found a fault of its {what}.");
        vec![(Tone::Warning, text)]
    };
    for (body, what) in [
        (
            "PNORF,12340,gyroscope,spike,over,12300,3490000",
            "gyroscope: a spike of 34.900 rad/s after 12.30 s, left out",
        ),
        (
            "PNORF,13080,accelerometer,stuck,found,13000,80",
            "accelerometer: the same numbers from 13.00 s, not used as measurements",
        ),
        (
            "PNORF,16000,accelerometer,stuck,over,13000,3000",
            "accelerometer: the same numbers from 13.00 s to 16.00 s, not used as measurements",
        ),
        (
            "PNORF,17000,magnetometer,noise,found,16500,500",
            "magnetometer: nothing but noise from 16.50 s, not used as measurements",
        ),
        (
            "PNORF,18000,accelerometer,saturated,over,17500,392000",
            "accelerometer: clipped (39.200 m/s^2) from 17.50 s to 18.00 s; what lies beyond was not seen",
        ),
    ] {
        assert_eq!(told(body), fault(what));
    }
    for body in [
        "PNORF,19000,gyroscope,stuck,found,18000",
        "PNORF,19000,gyroscope,stuck,perhaps,18000,1000",
        "PNORF,19000,barometer,stuck,found,18000,1000",
        "PNORF,19000,gyroscope,tired,found,18000,1000",
        "PNORF,19000,gyroscope,stuck,found,-1,1000",
    ] {
        let notices = told(body);
        assert_eq!(notices[0].0, Tone::Bad, "{body}");
    }
}
