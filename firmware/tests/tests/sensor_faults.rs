//! Faults of sensors, injected into what the emulated boards get: found as a host's filter finds them, and survived.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use std::ops::Range;
use std::thread;

use northing_core::faults::{Fault, FaultKind, FaultySensor};
use northing_core::nalgebra::Vector3;
use northing_core::navigation::{GnssIns, GnssInsConfig};
use northing_firmware::navigator::{AxisNavigator, ErrorStateNavigator};
use northing_firmware::{Navigator, ResetCause};
use northing_firmware_tests::Board;
use northing_firmware_tests::emulator::Emulator;
use northing_firmware_tests::host::Host;
use northing_firmware_tests::images::Chip;
use northing_firmware_tests::output::{Sentence, of_kind, sentences};
use northing_firmware_tests::walk::{SEED, Walk};
use northing_simulation::random::{normal_vector, stream};

/// Frames with each fault; 50 are a second.
const SPIKE: usize = 900;
const FROZEN_RATE: Range<usize> = 1000..1150;
const FROZEN_FORCE: Range<usize> = 1400..1550;
const NOISE: Range<usize> = 1800..1900;
const SHAKEN: Range<usize> = 2150..2300;
/// As much as `budgets.toml` has for the deepest build.
const MOST_STACK: u32 = 13_312;

/// A fault as it is told: sensor, kind, whether it is over, from and until (ms).
type Event = (String, String, bool, u32, u32);

/// Puts another value (as the board sends it) into a line of a frame.
fn replace(imu: &mut Vec<u8>, letter: char, value: impl FnOnce([f64; 3]) -> [f64; 3]) {
    let text = String::from_utf8(std::mem::take(imu)).unwrap();
    let start = format!("#{letter}-C=");
    let (_, rest) = text.split_once(&start).unwrap();
    let (line, _) = rest.split_once("\r\n").unwrap();
    let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
    let [x, y, z] = value(numbers.try_into().unwrap());
    let with = format!("{start}{x:.2},{y:.2},{z:.2}");
    *imu = text.replace(&format!("{start}{line}"), &with).into_bytes();
}

/// The walk, with the faults in it.
fn with_faults() -> Walk {
    let mut walk = Walk::new(SEED, 56.0);
    let mut noise = stream(3, "garbage");
    let (mut held_rate, mut held_force) = ([0.0; 3], [0.0; 3]);
    for (at, tick) in walk.ticks.iter_mut().enumerate() {
        let imu = &mut tick.imu;
        if at == SPIKE {
            // 34.9 rad/s, as counts.
            replace(imu, 'G', |[x, y, _]| [x, y, 28_743.0]);
        }
        for (range, letter, held) in [
            (FROZEN_RATE, 'G', &mut held_rate),
            (FROZEN_FORCE, 'A', &mut held_force),
        ] {
            if at == range.start {
                replace(imu, letter, |v| {
                    *held = v;
                    v
                });
            } else if range.contains(&at) {
                replace(imu, letter, |_| *held);
            }
        }
        if NOISE.contains(&at) {
            let garbage: [f64; 3] = normal_vector(&mut noise, 1500.0).into();
            replace(imu, 'A', |_| garbage);
        }
        if SHAKEN.contains(&at) {
            // Wild, but a motion: no fault.
            let sway = 700.0 * (at as f64 * 0.15).sin();
            replace(imu, 'A', |[x, y, z]| {
                let shaken = normal_vector(&mut noise, 30.0).x;
                [(x + sway + shaken).clamp(-512.0, 512.0), y, z]
            });
        }
    }
    walk
}

/// The events of a GNSS/INS on a host, in the precision of the chip, over the frames that the board had.
fn on_a_host(said: &[Sentence]) -> Vec<Event> {
    let mut ins = GnssIns::<f32, 64>::new(GnssInsConfig::default()).unwrap();
    let mut events = Vec::new();
    for frame in of_kind(said, 'I') {
        let vector = |place: usize, unit: f32| {
            let number = |i| frame.number::<i32>(place + i) as f32;
            Vector3::new(number(0), number(1), number(2)) * unit
        };
        let time_ns = i64::from(frame.number::<u32>(0)) * 1_000_000;
        ins.imu(time_ns, &vector(5, 1e-5), &vector(2, 1e-4))
            .unwrap();
        while let Some(fault) = ins.take_fault() {
            events.push(told(&fault));
        }
    }
    events
}

fn told(fault: &Fault<f32>) -> Event {
    let sensor = match fault.sensor {
        FaultySensor::Gyroscope => "gyroscope",
        FaultySensor::Accelerometer => "accelerometer",
        FaultySensor::Magnetometer => "magnetometer",
    };
    let kind = match fault.kind {
        FaultKind::Spike => "spike",
        FaultKind::Stuck => "stuck",
        FaultKind::Noise => "noise",
        FaultKind::Saturated => "saturated",
        FaultKind::Missing => "missing",
        FaultKind::Stamp => "stamp",
        FaultKind::BiasStep => "bias-step",
    };
    let ms = |ns: i64| u32::try_from(ns / 1_000_000).unwrap();
    (
        sensor.to_owned(),
        kind.to_owned(),
        fault.is_over,
        ms(fault.from_ns),
        ms(fault.until_ns),
    )
}

/// The events that a board has printed.
fn printed(said: &[Sentence]) -> Vec<Event> {
    let events = of_kind(said, 'F').map(|fault| {
        let is_over = match &*fault.fields[3] {
            "over" => true,
            "found" => false,
            other => panic!("{other}"),
        };
        (
            fault.fields[1].clone(),
            fault.fields[2].clone(),
            is_over,
            fault.number(4),
            fault.number(0),
        )
    });
    events.collect()
}

/// Time of the last sample before a frame, ms. The first frame begins the time.
const fn before(frame: usize) -> u32 {
    (frame as u32 - 1) * 20
}

/// What both chips and the host print of the walk with faults.
fn said<N: Navigator>(image: &'static str, walk: &Walk) -> Vec<Sentence> {
    let on_host = Host::<N>::start(ResetCause::Power).ticks(&walk.ticks);
    thread::scope(|scope| {
        for chip in Chip::ALL {
            let on_host = &on_host;
            scope.spawn(move || {
                let mut board = Emulator::start(chip, image);
                let on_chip = board.ticks(&walk.ticks);
                let stack = board.stack_used();
                println!("{} {image}: stack {stack} B", chip.name());
                assert!(stack <= MOST_STACK, "{stack}");
                assert!(sentences(&on_chip) == sentences(on_host), "{}", chip.name());
            });
        }
    });
    sentences(&on_host)
}

/// Largest errors of tilt and heading at the end, degrees.
fn errors_at_the_end(said: &[Sentence], walk: &Walk) -> [f64; 2] {
    let late = of_kind(said, 'E').filter(|estimate| estimate.number::<usize>(0) > 55_000);
    late.fold([0.0; 2], |[tilt, heading], estimate| {
        let truth = &walk.truth[estimate.number::<usize>(0) / 20];
        let (roll, pitch, yaw) = truth.attitude.euler_angles();
        let [r, p, y] = estimate.vector(1, 1e-3).map(f64::to_radians);
        let off = (r - roll).hypot(p - pitch).to_degrees();
        let turned = (y - yaw).sin().abs().asin().to_degrees();
        [tilt.max(off), heading.max(turned)]
    })
}

fn faults_are_found_as_on_a_host_and_survived<N: Navigator>(image: &'static str) {
    let walk = with_faults();
    let said = said::<N>(image, &walk);
    let events = printed(&said);
    println!("{events:#?}");
    assert_eq!(events, on_a_host(&said));

    // The sample behind it shows it.
    let spike = (
        "gyroscope",
        "spike",
        true,
        before(SPIKE),
        before(SPIKE) + 40,
    );
    let (sensor, kind, is_over, from, until) = &events[0];
    assert_eq!((&**sensor, &**kind, *is_over, *from, *until), spike);
    for (sensor, kind, frames) in [
        ("gyroscope", "stuck", FROZEN_RATE),
        ("accelerometer", "stuck", FROZEN_FORCE),
        ("accelerometer", "noise", NOISE),
    ] {
        let told: Vec<_> = events
            .iter()
            .filter(|event| (&*event.0, &*event.1) == (sensor, kind))
            .collect();
        let [found, over] = told[..] else {
            panic!("{sensor} {kind}: {told:?}");
        };
        assert_eq!((found.2, over.2, found.3), (false, true, over.3));
        // It is found within a quarter of a second, and over within half a second of its end.
        let [begin, end] = [frames.start, frames.end].map(before);
        assert!((begin..begin + 250).contains(&found.4), "{found:?}");
        assert!((end..end + 500).contains(&over.4), "{over:?}");
    }
    assert_eq!(events.len(), 7);
    let [tilt, heading] = errors_at_the_end(&said, &walk);
    println!("tilt {tilt:.2} deg, heading {heading:.2} deg");
    assert!(tilt < 5.0 && heading < 10.0, "{tilt} {heading}");
}

#[test]
fn axis_filters_on_a_chip_find_the_faults_that_a_host_finds() {
    faults_are_found_as_on_a_host_and_survived::<AxisNavigator>("emulated-axis-filters");
}

#[test]
fn the_error_state_filter_on_a_chip_finds_them_too() {
    faults_are_found_as_on_a_host_and_survived::<ErrorStateNavigator>("emulated-error-state");
}
