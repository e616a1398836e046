//! Razor AHRS boards.

use nalgebra::Vector3;

use super::{said, turned, vectors};
use crate::event::SensorKind;
use crate::wire::Decoded;
use crate::wire::razor::{Razor, RazorConfig, RazorOutput};

const G: f64 = 9.80665;

fn binary() -> Razor {
    Razor::new(RazorConfig {
        output: RazorOutput::BinarySensors,
        ..RazorConfig::default()
    })
}

fn frame(yaw_counts: f32) -> Vec<u8> {
    let numbers = [0.0, 0.0, 256.0, 220.0, 0.0, 420.0, 0.0, 0.0, yaw_counts];
    numbers.iter().flat_map(|n: &f32| n.to_le_bytes()).collect()
}

#[test]
fn frames_are_counted_and_axes_are_ours() {
    let text = "#A-C=0,0,256\r\n#M-C=220,0,420\r\n#G-C=1,2,-3\r\n#A-C=256,0,0\r\n#G-C=0,0,0\r\n";
    let out = Razor::default().push(text.as_bytes());
    // At rest gravity points down; nose down gravity points forward, specific force backward.
    let force = vectors(&out, SensorKind::Accelerometer);
    assert_eq!(force, [[0.0, 0.0, G], [0.0, -G, 0.0]]);
    let scale = 0.06957_f64.to_radians();
    let rate = vectors(&out, SensorKind::Gyroscope);
    assert_eq!(rate, [[2.0 * scale, scale, 3.0 * scale], [0.0; 3]]);
    assert_eq!(
        vectors(&out, SensorKind::Magnetometer),
        [[0.0, 22.0, -42.0]]
    );
    let times: Vec<_> = out.events.iter().map(|event| event.time_ns).collect();
    assert_eq!(times, [0, 0, 0, 20_000_000, 20_000_000]);
}

#[test]
fn angles_are_yaw_pitch_roll_of_an_aeroplane() {
    // Heading east, level.
    let out = Razor::default().push(b"#YPR=90,0,0\r\n");
    approx::assert_relative_eq!(turned(&out, Vector3::y()), Vector3::x(), epsilon = 1e-12);
    // Nose up: the top edge points up.
    let out = Razor::default().push(b"#YPR=0,90,0\r\n");
    approx::assert_relative_eq!(turned(&out, Vector3::y()), Vector3::z(), epsilon = 1e-12);
    // Right wing down; the old firmware's order.
    let out = Razor::default().push(b"!ANG:90,0,0\r\n");
    approx::assert_relative_eq!(turned(&out, Vector3::x()), -Vector3::z(), epsilon = 1e-12);
}

#[test]
fn raw_fields_are_uncalibrated_and_other_lines_are_said() {
    let out = Razor::default().push(b"#SYNCH00\r\n#M-R=10,0,0\r\nhello\r\n#G-C=1,x,3\r\n");
    let field = vectors(&out, SensorKind::MagnetometerUncalibrated);
    assert_eq!(field, [[0.0, 1.0, 0.0]]);
    assert!(said(&out, "not one of the Razor firmware's") && said(&out, "a number is missing"));
}

#[test]
fn binary_frames_are_found_again_after_lost_bytes() {
    let mut stream = b"#SYNCH01\r\n".to_vec();
    for index in 1_u8..=10 {
        let bytes = frame(f32::from(index));
        stream.extend(if index == 5 { &bytes[11..] } else { &bytes[..] });
    }
    for cut in [1, 17, 36, 1000] {
        let mut decoder = binary();
        let mut out = Decoded::default();
        for piece in stream.chunks(cut) {
            out.append(decoder.push(piece));
        }
        let scale = 0.06957_f64.to_radians();
        let counts: Vec<_> = vectors(&out, SensorKind::Gyroscope)
            .iter()
            .map(|rate| (-rate[2] / scale).round())
            .collect();
        assert_eq!(
            counts,
            [1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 9.0, 10.0],
            "{cut}"
        );
        let lost = out
            .notices
            .iter()
            .find(|n| n.text.contains("bytes were lost"));
        assert_eq!(lost.map(|notice| notice.count), Some(25));
    }
}
