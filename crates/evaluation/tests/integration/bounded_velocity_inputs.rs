//! The bounded-velocity filter on what devices deliver when something is wrong with them.

use nalgebra::{UnitQuaternion, Vector3};
use northing_evaluation::attitude::options::RunOptions;
use northing_evaluation::attitude::outcome::RunSummary;
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::{EstimatorKind, Profile, run};
use northing_recording::{Event, RecordingError, Reference, Sample};
use northing_simulation::virtual_phone::Motion;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

/// A minute and a half in a hand; what `change` makes of each event, with its time in seconds.
fn events(change: impl Fn(f64, Sample) -> Option<Sample>) -> Vec<Event> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        motion: Motion::Gentle,
        motion_s: 90.0,
        ..VirtualPhoneConfig::default()
    });
    let phone = phone.expect("a virtual phone");
    let mut first = None;
    let changed = phone.events().filter_map(|event| {
        let since = event.time_ns - *first.get_or_insert(event.time_ns);
        let sample = change(since as f64 * 1e-9, event.sample)?;
        Some(Event { sample, ..event })
    });
    changed.collect()
}

fn options() -> RunOptions {
    RunOptions::new(EstimatorKind::BoundedVelocity, Profile::Lab)
}

fn summary(events: &[Event], options: &RunOptions) -> RunSummary {
    let events = events.iter().copied().map(Ok::<Event, RecordingError>);
    let summary = run(events, options, &mut ()).expect("a run");
    let error = summary.error_deg.expect("a virtual phone knows the truth");
    assert_eq!(error.not_finite_samples, 0);
    eprintln!("{error:?}, NEES {:?}", summary.nees_mean);
    summary
}

fn total(summary: &RunSummary) -> f64 {
    summary.error_deg.expect("a score").total_rmse
}

fn inclination(summary: &RunSummary) -> f64 {
    summary.error_deg.expect("a score").inclination_rmse
}

const IRON: Vector3<f64> = Vector3::new(310.0, -540.0, 220.0);

/// The uncalibrated stream beside the device's own, at every third of its instants.
fn with_uncalibrated(events: &[Event], also_device: bool) -> Vec<Event> {
    let mut out = Vec::new();
    let mut count = 0;
    for event in events {
        let Sample::MagneticField(field) = event.sample else {
            out.push(*event);
            continue;
        };
        if also_device {
            out.push(*event);
        }
        if count % 3 == 0 {
            let sample = Sample::MagneticFieldUncalibrated(field + IRON);
            out.push(Event { sample, ..*event });
        }
        count += 1;
    }
    out
}

fn uncalibrated() -> RunOptions {
    let mut options = options();
    options.sensors.magnetometer_source = MagnetometerSource::Uncalibrated;
    options
}

#[test]
fn a_sound_phone_is_followed() {
    let events = events(|_, sample| Some(sample));
    let summary = summary(&events, &options());
    assert!(total(&summary) < 1.0, "{}", total(&summary));
}

#[test]
fn an_uncalibrated_channel_at_another_rate_gives_the_heading_and_its_offset_is_said() {
    let sound = events(|_, sample| Some(sample));
    let both = with_uncalibrated(&sound, true);
    let run = summary(&both, &uncalibrated());
    assert!(total(&run) < 2.0, "{}", total(&run));
    let said = run.issues.iter().any(|issue| issue.contains("offset"));
    assert!(said, "{:?}", run.issues);
    // Hundreds of microtesla that nobody knows: the tilt stays, and what is wrong is said.
    let alone = with_uncalibrated(&sound, false);
    let run = summary(&alone, &uncalibrated());
    assert!(inclination(&run) < 1.0, "{}", inclination(&run));
    let said = run
        .issues
        .iter()
        .any(|issue| issue.contains("Calibrate the magnetometer"));
    assert!(said, "{:?}", run.issues);
    // No such channel at all: no magnetometer, said.
    let run = summary(&sound, &uncalibrated());
    assert!(inclination(&run) < 1.0 && !run.unobservable.is_empty());
}

#[test]
fn a_magnetometer_may_appear_or_disappear_in_the_middle() {
    let is_field = |sample: &Sample| matches!(sample, Sample::MagneticField(_));
    let gone = events(|t, sample| (t < 40.0 || !is_field(&sample)).then_some(sample));
    let late = events(|t, sample| (t > 40.0 || !is_field(&sample)).then_some(sample));
    for events in [gone, late] {
        let run = summary(&events, &options());
        assert!(inclination(&run) < 1.0, "{}", inclination(&run));
    }
}

/// The uncalibrated stream comes when the run has begun, or goes; the choice was free.
#[test]
fn a_stream_that_comes_late_is_not_chosen_and_one_that_goes_leaves_the_tilt() {
    let sound = events(|_, sample| Some(sample));
    let both = with_uncalibrated(&sound, true);
    let first = both[0].time_ns;
    let part = |keep: fn(f64) -> bool| -> Vec<Event> {
        let kept = both.iter().filter(|event| {
            let raw = matches!(event.sample, Sample::MagneticFieldUncalibrated(_));
            !raw || keep((event.time_ns - first) as f64 * 1e-9)
        });
        kept.copied().collect()
    };
    let mut options = options();
    options.choose_magnetometer = true;
    let late = summary(&part(|t| t > 30.0), &options);
    assert_eq!(late.magnetometer, Some(MagnetometerSource::Device));
    assert!(total(&late) < 2.0, "{}", total(&late));
    let gone = summary(&part(|t| t < 50.0), &options);
    assert_eq!(gone.magnetometer, Some(MagnetometerSource::Uncalibrated));
    assert!(total(&gone) < 5.0, "{}", total(&gone));
    assert!(inclination(&gone) < 1.0, "{}", inclination(&gone));
}

/// On a turntable from the first sample on, tilted, at five radians a second.
#[test]
fn a_recording_that_starts_spinning_is_followed() {
    let rate = Vector3::new(0.0, 0.4, 5.0);
    let field = Vector3::new(0.0, 22.0, -42.0);
    let mut spinning = Vec::new();
    for k in 0..6000_i64 {
        let time_ns = k * 10_000_000;
        let turn = rate * (k as f64 * 0.01);
        let truth = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0)
            * UnitQuaternion::from_scaled_axis(turn);
        let body = |v: Vector3<f64>| truth.inverse() * v;
        let wobble = (k % 7) as f64 * 0.1;
        let reference = Reference {
            attitude: truth,
            scored: true,
        };
        for sample in [
            Sample::AngularRate(rate),
            Sample::SpecificForce(body(Vector3::z() * 9.81)),
            Sample::MagneticField(body(field).add_scalar(wobble)),
            Sample::Reference(reference),
        ] {
            spinning.push(Event { time_ns, sample });
        }
    }
    let run = summary(&spinning, &options());
    assert!(total(&run) < 2.0, "{}", total(&run));
}

#[test]
fn clipped_sensors_and_a_start_in_motion_do_not_break_it() {
    let clipped = events(|t, sample| {
        let clip = |v: Vector3<f64>, limit: f64| v.map(|x| x.clamp(-limit, limit));
        match sample {
            _ if t < 12.0 => None,
            Sample::AngularRate(v) => Some(Sample::AngularRate(clip(v, 1.0))),
            Sample::SpecificForce(v) => Some(Sample::SpecificForce(clip(v, 9.7))),
            other => Some(other),
        }
    });
    let mut options = options();
    options
        .set("bounded_gyroscope_saturation=0.99")
        .expect("a setting");
    options
        .set("bounded_accelerometer_saturation=9.6")
        .expect("a setting");
    let run = summary(&clipped, &options);
    assert!(total(&run) < 3.0, "{}", total(&run));
}
