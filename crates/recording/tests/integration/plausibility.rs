//! The unit checks on made-up motion, so that they are tested without the data sets.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{
    Event, FieldUnit, ForceUnit, Metadata, OpenOptions, RateUnit, Recording, RecordingError,
    Sample, SensorKind,
};

/// How fast the body turns, as a fraction of [`rate_at`].
const TURNING: f64 = 0.6;
const RESTING: f64 = 0.0;

/// Turned over gently in the hand, as somebody does who looks at a thing from all sides, rad/s.
fn rate_at(t: f64) -> Vector3<f64> {
    Vector3::new((0.9 * t).sin(), 0.8 * (0.7 * t).cos(), 0.3)
}

/// 20 s at 100 Hz; the numbers are multiplied by the factors of rate, force and field.
fn recording(
    turning: f64,
    [rate_factor, force_factor, field_factor]: [f64; 3],
    options: &OpenOptions,
) -> Recording {
    let mut attitude = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
    let events = (0..2000_i64).flat_map(move |i| {
        let rate = rate_at(i as f64 * 0.01) * turning;
        attitude *= UnitQuaternion::from_scaled_axis(rate * 0.01);
        // The bias of a bad gyroscope.
        let measured = rate + Vector3::new(0.1, -0.02, 0.05);
        let force = attitude.inverse() * Vector3::z() * 9.81;
        let field = attitude.inverse() * Vector3::new(0.0, 22.0, -42.0);
        [
            Sample::AngularRate(measured * rate_factor),
            Sample::SpecificForce(force * force_factor),
            Sample::MagneticField(field * field_factor),
        ]
        .map(|sample| {
            Ok(Event {
                time_ns: i * 10_000_000,
                sample,
            })
        })
    });
    let metadata = Metadata {
        name: "motion".to_owned(),
        ..Metadata::default()
    };
    Recording::from_events(metadata, &SensorKind::ALL, events, options)
}

fn error(mut recording: Recording) -> Option<String> {
    recording.find_map(Result::err).map(|error| {
        assert!(
            matches!(error, RecordingError::ImplausibleUnit { .. }),
            "{error}"
        );
        error.to_string()
    })
}

const DEG: f64 = 180.0 / std::f64::consts::PI;
const DEFAULT: fn() -> OpenOptions = OpenOptions::default;

#[test]
fn right_units_pass_moving_and_at_rest() {
    for turning in [TURNING, RESTING] {
        assert_eq!(error(recording(turning, [1.0; 3], &DEFAULT())), None);
    }
}

#[test]
fn degrees_are_refused_with_the_option() {
    let error = error(recording(TURNING, [DEG, 1.0, 1.0], &DEFAULT())).unwrap();
    assert!(
        error.starts_with("motion: gyroscope: the accelerometer contradicts it in "),
        "{error}"
    );
    assert!(
        error.contains("if so, use --gyroscope-unit deg-per-s"),
        "{error}"
    );
}

#[test]
fn degrees_are_refused_when_the_acceleration_is_in_g_and_said_so() {
    let options = OpenOptions {
        accelerometer_unit: Some(ForceUnit::G),
        ..DEFAULT()
    };
    let error = error(recording(TURNING, [DEG, 1.0 / 9.80665, 1.0], &options)).unwrap();
    assert!(error.contains("--gyroscope-unit deg-per-s"), "{error}");
}

#[test]
fn rates_that_nothing_sustains_are_refused_without_an_accelerometer_too() {
    let events = (0..200_i64).map(|i| {
        Ok(Event {
            time_ns: i * 10_000_000,
            sample: Sample::AngularRate(Vector3::new(0.0, 90.0, 0.0)),
        })
    });
    let spinning = Recording::from_events(
        Metadata::default(),
        &[SensorKind::Gyroscope],
        events,
        &DEFAULT(),
    );
    assert!(
        error(spinning)
            .unwrap()
            .contains("stays above 60 rad/s (now 90)")
    );
}

#[test]
fn g_gauss_and_tesla_are_refused_with_the_option() {
    for (factors, expected) in [
        (
            [1.0, 1.0 / 9.80665, 1.0],
            "motion: accelerometer: the median norm of its first seconds is 1.000",
        ),
        ([1.0, 1.0 / 9.80665, 1.0], "use --accelerometer-unit g"),
        ([1.0, 1.0, 0.01], "use --magnetometer-unit gauss"),
        ([1.0, 1.0, 1e-6], "use --magnetometer-unit tesla"),
    ] {
        let error = error(recording(TURNING, factors, &DEFAULT())).unwrap();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn recordings_shorter_than_the_windows_are_judged_at_their_end() {
    let short = |factors| {
        let events: Vec<_> = recording(
            TURNING,
            factors,
            &OpenOptions {
                plausibility: false,
                ..DEFAULT()
            },
        )
        .take(3 * 50)
        .collect();
        Recording::from_events(
            Metadata::default(),
            &SensorKind::ALL,
            events.into_iter(),
            &DEFAULT(),
        )
    };
    assert_eq!(error(short([1.0; 3])), None);
    assert!(
        error(short([1.0, 1.0 / 9.80665, 1.0]))
            .unwrap()
            .contains("--accelerometer-unit g")
    );
    assert!(
        error(short([1.0, 1.0, 0.01]))
            .unwrap()
            .contains("--magnetometer-unit gauss")
    );
}

#[test]
fn a_unit_that_the_user_names_is_applied_and_not_doubted() {
    let options = OpenOptions {
        gyroscope_unit: Some(RateUnit::DegPerS),
        accelerometer_unit: Some(ForceUnit::G),
        magnetometer_unit: Some(FieldUnit::Gauss),
        ..DEFAULT()
    };
    assert_eq!(
        error(recording(TURNING, [DEG, 1.0 / 9.80665, 0.01], &options)),
        None
    );
    let accepted = OpenOptions {
        gyroscope_unit: Some(RateUnit::RadPerS),
        ..DEFAULT()
    };
    assert_eq!(error(recording(TURNING, [DEG, 1.0, 1.0], &accepted)), None);
    let unchecked = OpenOptions {
        plausibility: false,
        ..DEFAULT()
    };
    assert_eq!(
        error(recording(TURNING, [DEG, 0.1, 1e-6], &unchecked)),
        None
    );
}

#[test]
fn all_zero_and_non_finite_vectors_say_nothing_about_units() {
    for bad in [Vector3::zeros(), Vector3::repeat(f64::NAN)] {
        let events = (0..1000_i64).flat_map(move |i| {
            [
                Sample::AngularRate(bad),
                Sample::SpecificForce(bad),
                Sample::MagneticField(bad),
            ]
            .map(|sample| {
                Ok(Event {
                    time_ns: i * 10_000_000,
                    sample,
                })
            })
        });
        let odd = Recording::from_events(Metadata::default(), &SensorKind::ALL, events, &DEFAULT());
        assert_eq!(error(odd), None);
    }
}

#[test]
fn a_gyroscope_that_turns_against_gravity_is_refused() {
    // The hand turns it over; at rest both signs fit.
    let reversed = error(recording(TURNING, [-1.0, 1.0, 1.0], &DEFAULT())).unwrap();
    assert!(
        reversed.contains("gravity turns the other way")
            && reversed.contains("--gyroscope-unit rad-per-s"),
        "{reversed}"
    );
    assert_eq!(
        error(recording(RESTING, [-1.0, 1.0, 1.0], &DEFAULT())),
        None
    );
    // Forces of the other sign turn as gravity does: the accelerometer is upside down, which nothing here tells.
    assert_eq!(
        error(recording(TURNING, [1.0, -1.0, 1.0], &DEFAULT())),
        None
    );
    let insisted = OpenOptions {
        gyroscope_unit: Some(RateUnit::RadPerS),
        ..DEFAULT()
    };
    assert_eq!(error(recording(TURNING, [-1.0, 1.0, 1.0], &insisted)), None);
}

/// One axis reversed, two exchanged, the accelerometer's reversed: what would fit is named, as a manifest has it.
#[test]
fn exchanged_axes_and_single_wrong_signs_are_refused_with_the_axes_that_fit() {
    type Map = fn(&Vector3<f64>) -> Vector3<f64>;
    let cases: [(Map, Map, &str); 4] = [
        (|w| Vector3::new(-w.x, w.y, w.z), |f| *f, "axes -x,y,z of"),
        (|w| Vector3::new(w.y, w.x, w.z), |f| *f, "axes y,x,z of"),
        (|w| Vector3::new(w.z, w.x, w.y), |f| *f, "axes y,z,x of"),
        (|w| *w, |f| Vector3::new(f.x, f.y, -f.z), "axes -x,-y,z of"),
    ];
    for (rates, forces, named) in cases {
        let options = OpenOptions {
            plausibility: false,
            ..DEFAULT()
        };
        let right = recording(1.3, [1.0; 3], &options).map(Result::unwrap);
        let wrong = right.map(move |event| {
            let sample = match event.sample {
                Sample::AngularRate(rate) => Sample::AngularRate(rates(&rate)),
                Sample::SpecificForce(force) => Sample::SpecificForce(forces(&force)),
                other => other,
            };
            Ok(Event { sample, ..event })
        });
        let read = Recording::from_events(Metadata::default(), &SensorKind::ALL, wrong, &DEFAULT());
        let said = error(read).unwrap();
        assert!(
            said.contains(named) && said.contains("`axes` in a manifest"),
            "{said}"
        );
    }
}

#[test]
fn acceleration_without_gravity_is_refused_and_said() {
    let still = error(recording(RESTING, [1.0, 0.008, 1.0], &DEFAULT())).unwrap();
    assert!(
        still.contains(
            "is 0.078, expected about 9.8 m/s^2; this looks like acceleration without gravity"
        ),
        "{still}"
    );
    // Of a hand that shakes it may be either.
    let shaken = error(recording(TURNING, [1.0, 0.15, 1.0], &DEFAULT())).unwrap();
    assert!(
        shaken.contains("looks like g, or like acceleration without gravity")
            && shaken.contains("--accelerometer-unit g"),
        "{shaken}"
    );
    let insisted = OpenOptions {
        accelerometer_unit: Some(ForceUnit::MPerS2),
        ..DEFAULT()
    };
    assert_eq!(
        error(recording(RESTING, [1.0, 0.008, 1.0], &insisted)),
        None
    );
}
