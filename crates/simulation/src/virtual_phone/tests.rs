//! Tests of the virtual phone: the script, the merge of the streams, the errors, the refusals.

use northing_recording::{Event, Sample, SensorKind};

use super::*;
use crate::rotation::{exp, log};
use crate::sensors::Sampling;

fn record(config: VirtualPhoneConfig) -> Vec<Event> {
    VirtualPhone::new(config).unwrap().events().collect()
}

fn of_kind(events: &[Event], kind: SensorKind) -> Vec<Event> {
    let chosen = events.iter().filter(|e| e.sample.kind() == kind);
    chosen.copied().collect()
}

fn vector(event: &Event) -> Vector3<f64> {
    match event.sample {
        Sample::AngularRate(v) | Sample::SpecificForce(v) | Sample::MagneticField(v) => v,
        other => panic!("not a vector: {other:?}"),
    }
}

/// All sensors perfect and at the same instants.
fn perfect() -> VirtualPhoneConfig {
    let mut config = VirtualPhoneConfig::default();
    config.gyroscope.noise_std_rad_s = 0.0;
    config.gyroscope.bias_std_rad_s = 0.0;
    config.gyroscope.bias_random_walk_rad_s_sqrt_s = 0.0;
    config.gyroscope.resolution_rad_s = 0.0;
    config.gyroscope.averages = true;
    config.accelerometer.noise_std_m_s2 = 0.0;
    config.accelerometer.resolution_m_s2 = 0.0;
    config.magnetometer.sampling = Sampling::at_rate(100.0);
    config.magnetometer.noise_std_ut = 0.0;
    config.magnetometer.resolution_ut = 0.0;
    config
}

#[test]
fn the_default_is_the_lab_script_with_each_sensor_at_its_rate() {
    let events = record(VirtualPhoneConfig::default());
    let count = |kind| of_kind(&events, kind).len();
    assert_eq!(count(SensorKind::Gyroscope), 7501);
    assert_eq!(count(SensorKind::Accelerometer), 7501);
    assert_eq!(count(SensorKind::Magnetometer), 3750);
    assert_eq!(count(SensorKind::DeviceOrientation), 3749);
    assert_eq!(count(SensorKind::Reference), 7501);
    assert_eq!(events.len(), 7501 * 3 + 3750 + 3749);
}

#[test]
fn events_are_in_time_order_and_within_an_instant_in_the_order_of_kinds() {
    let mut config = VirtualPhoneConfig::default();
    config.gyroscope.sampling.jitter_std_s = 0.002;
    config.accelerometer.sampling.dropout_probability = 0.1;
    for events in [record(config), record(VirtualPhoneConfig::default())] {
        let rank = |e: &Event| {
            let all = SensorKind::ALL.iter();
            (
                e.time_ns,
                all.into_iter().position(|k| *k == e.sample.kind()),
            )
        };
        assert!(events.windows(2).all(|w| rank(&w[0]) < rank(&w[1])));
    }
}

#[test]
fn the_script_returns_exactly_to_the_start_pose_and_scores_from_the_motion_on() {
    for motion in Motion::ALL {
        for disturbance in Disturbance::ALL {
            let config = VirtualPhoneConfig {
                motion,
                disturbance,
                ..VirtualPhoneConfig::default()
            };
            let events = record(config);
            let mut farthest = 0.0_f64;
            for event in of_kind(&events, SensorKind::Reference) {
                let Sample::Reference(reference) = event.sample else {
                    panic!("not a reference")
                };
                let t = event.time_ns as f64 * 1e-9;
                assert_eq!(reference.scored, t >= 10.0, "{t}");
                if t <= 10.0 || t >= 70.0 {
                    assert_eq!(reference.attitude, nalgebra::UnitQuaternion::identity());
                }
                farthest = farthest.max(reference.attitude.angle());
            }
            assert_eq!(farthest > 0.5, motion != Motion::Rest);
        }
    }
}

#[test]
fn perfect_sensors_agree_with_the_reference() {
    let config = perfect();
    let (force, field) = (
        crate::world::specific_force_at_rest(),
        VirtualPhone::new(config.clone())
            .unwrap()
            .magnetic_field_world_ut(),
    );
    let mut integrated = nalgebra::UnitQuaternion::identity();
    let (mut seen_force, mut seen_field) = (force, field);
    for event in record(config) {
        match event.sample {
            Sample::AngularRate(rate) => integrated *= exp(&(rate * 0.01)),
            Sample::SpecificForce(v) => seen_force = v,
            Sample::MagneticField(v) => seen_field = v,
            Sample::Reference(reference) => {
                let attitude = reference.attitude;
                assert!(log(&(integrated.inverse() * attitude)).norm() < 1e-9);
                assert!((attitude * seen_force - force).norm() < 1e-12);
                assert!((attitude * seen_field - field).norm() < 1e-12);
            }
            _ => {}
        }
    }
}

#[test]
fn a_gyroscope_that_does_not_average_shows_the_rate_of_the_instant() {
    let mut config = perfect();
    config.gyroscope.averages = false;
    let truth = VirtualPhone::new(config.clone()).unwrap().trajectory();
    for event in of_kind(&record(config), SensorKind::Gyroscope) {
        let expected = truth.at(event.time_ns as f64 * 1e-9).angular_rate_body;
        assert!((vector(&event) - expected).norm() < 1e-7);
    }
}

#[test]
fn at_rest_the_sensors_show_their_noise_and_their_bias() {
    let config = VirtualPhoneConfig {
        motion: Motion::Rest,
        duration_s: Some(200.0),
        ..VirtualPhoneConfig::default()
    };
    let phone = VirtualPhone::new(config.clone()).unwrap();
    let bias = phone.events().gyroscope_bias();
    let events = record(config);
    let field = phone.magnetic_field_world_ut();
    let up = crate::world::specific_force_at_rest();
    for (kind, truth, std, tolerance) in [
        // The bias walks 2e-5 * sqrt(200) = 3e-4 in the meantime.
        (SensorKind::Gyroscope, bias, 0.005, 0.02),
        (SensorKind::Accelerometer, up, 0.05, 0.02),
        (SensorKind::Magnetometer, field, 0.5, 0.03),
    ] {
        let values = of_kind(&events, kind);
        let squares = values.iter().map(|e| (vector(e) - truth).norm_squared());
        let measured = (squares.sum::<f64>() / (3.0 * values.len() as f64)).sqrt();
        assert!(
            (measured / std - 1.0).abs() < tolerance,
            "{kind:?}: {measured}"
        );
    }
    assert!((0.003..0.1).contains(&bias.norm()));
}

#[test]
fn disturbances_happen_only_during_the_motion() {
    let disturbed = |disturbance| {
        let phone = VirtualPhone::new(VirtualPhoneConfig {
            motion: Motion::Rest,
            disturbance,
            ..perfect()
        });
        let events: Vec<Event> = phone.unwrap().events().collect();
        let still = |kind| vector(&of_kind(&events, kind)[0]);
        let (force, field) = (
            still(SensorKind::Accelerometer),
            still(SensorKind::Magnetometer),
        );
        let times = |kind, rest: Vector3<f64>| -> Vec<f64> {
            let values = of_kind(&events, kind);
            let off = values.iter().filter(|e| (vector(e) - rest).norm() > 1e-9);
            off.map(|e| e.time_ns as f64 * 1e-9).collect()
        };
        (
            times(SensorKind::Accelerometer, force),
            times(SensorKind::Magnetometer, field),
        )
    };
    let (shaken, magnetic) = disturbed(Disturbance::None);
    assert!(shaken.is_empty() && magnetic.is_empty());
    let (shaken, magnetic) = disturbed(Disturbance::Both);
    // Shaking from 1 s to 9 s, the magnet from 14 s to 20 s, of every 20 s after the first 10 s.
    let near = |a: f64, b: f64| assert!((a - b).abs() < 0.05, "{a} {b}");
    near(shaken[0], 11.0);
    near(*shaken.last().unwrap(), 59.0);
    near(shaken.len() as f64 / 100.0, 24.0);
    near(magnetic[0], 24.0);
    near(*magnetic.last().unwrap(), 70.0);
    near(magnetic.len() as f64 / 100.0, 18.0);
    let (shaken, magnetic) = disturbed(Disturbance::Magnetic);
    assert!(shaken.is_empty() && !magnetic.is_empty());
}

#[test]
fn the_device_orientation_is_late_and_a_little_wrong() {
    let config = VirtualPhoneConfig {
        motion: Motion::Brisk,
        ..VirtualPhoneConfig::default()
    };
    let truth = VirtualPhone::new(config.clone()).unwrap().trajectory();
    let events = of_kind(&record(config), SensorKind::DeviceOrientation);
    let (mut prompt, mut late) = (0.0, 0.0);
    for event in &events {
        let Sample::DeviceOrientation(reported) = event.sample else {
            panic!("not an orientation")
        };
        let t = event.time_ns as f64 * 1e-9;
        let error_at = |t| reported.angle_to(&truth.at(t).world_from_body).to_degrees();
        prompt += error_at(t).powi(2);
        late += error_at(t - 0.02).powi(2);
    }
    let rms_deg = |sum: f64| (sum / events.len() as f64).sqrt();
    assert!((0.5..9.0).contains(&rms_deg(late)), "{}", rms_deg(late));
    assert!(rms_deg(prompt) > rms_deg(late));
}

#[test]
fn a_seed_reproduces_the_recording_and_the_streams_do_not_touch_each_other() {
    let base = record(VirtualPhoneConfig::default());
    assert_eq!(base, record(VirtualPhoneConfig::default()));
    let seed_2 = VirtualPhoneConfig {
        seed: 2,
        ..VirtualPhoneConfig::default()
    };
    assert_ne!(base, record(seed_2));

    // Another gyroscope, no device orientation: the rest to the bit.
    let mut config = VirtualPhoneConfig::default();
    config.gyroscope.noise_std_rad_s = 0.5;
    config.device_orientation.sampling.rate_hz = 0.0;
    let changed = record(config);
    for kind in [
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::Reference,
    ] {
        assert_eq!(of_kind(&base, kind), of_kind(&changed, kind));
    }
    assert_ne!(
        of_kind(&base, SensorKind::Gyroscope),
        of_kind(&changed, SensorKind::Gyroscope)
    );
    assert!(of_kind(&changed, SensorKind::DeviceOrientation).is_empty());
}

#[test]
fn lost_samples_leave_those_that_arrive_as_they_were() {
    let mut config = VirtualPhoneConfig::default();
    config.magnetometer.sampling.dropout_probability = 0.3;
    config.gyroscope.sampling.dropout_probability = 0.3;
    let (whole, lossy) = (record(VirtualPhoneConfig::default()), record(config));
    for kind in [SensorKind::Magnetometer, SensorKind::Gyroscope] {
        let (whole, lossy) = (of_kind(&whole, kind), of_kind(&lossy, kind));
        let share = lossy.len() as f64 / whole.len() as f64;
        assert!((share - 0.7).abs() < 0.03, "{share}");
        let mut all = whole.iter();
        assert!(lossy.iter().all(|e| all.any(|w| w == e)));
    }
    let references = |events: &[Event]| of_kind(events, SensorKind::Reference);
    assert_eq!(references(&whole), references(&lossy));
}

#[test]
fn a_long_recording_repeats_the_script_in_flat_memory() {
    let config = VirtualPhoneConfig {
        duration_s: Some(3000.0),
        start_time_ns: 1_700_000_000_000_000_000,
        ..VirtualPhoneConfig::default()
    };
    let phone = VirtualPhone::new(config).unwrap();
    let (mut n, mut last_ns, mut third_round) = (0_u32, i64::MIN, None);
    for event in phone.events() {
        assert!(event.time_ns >= last_ns);
        last_ns = event.time_ns;
        n += 1;
        if let Sample::Reference(reference) = event.sample {
            let t_ns = event.time_ns - 1_700_000_000_000_000_000;
            assert_eq!(reference.scored, t_ns >= 10_000_000_000);
            if t_ns == (2 * 75 + 30) * 1_000_000_000 {
                third_round = Some(reference.attitude);
            }
        }
    }
    assert_eq!(n, 300_001 * 3 + 150_000 + 149_999);
    assert_eq!(last_ns, 1_700_003_000_000_000_000);
    let same_instant = phone.trajectory().at(30.0).world_from_body;
    assert!(third_round.unwrap().angle_to(&same_instant) < 1e-7);
}

#[test]
fn sensors_can_be_switched_off() {
    let mut config = VirtualPhoneConfig::default();
    config.gyroscope.sampling.rate_hz = 0.0;
    config.magnetometer.sampling.rate_hz = 0.0;
    let events = record(config.clone());
    assert!(of_kind(&events, SensorKind::Gyroscope).is_empty());
    assert!(of_kind(&events, SensorKind::Magnetometer).is_empty());
    assert_eq!(of_kind(&events, SensorKind::Reference).len(), 7501);
    config.reference.recorded = false;
    config.accelerometer.sampling.rate_hz = 0.0;
    config.device_orientation.sampling.rate_hz = 0.0;
    assert_eq!(record(config), Vec::new());
}

#[test]
fn metadata_names_frame_seed_and_settings() {
    let metadata = VirtualPhone::new(VirtualPhoneConfig::default())
        .unwrap()
        .metadata();
    assert_eq!(metadata.world_frame, WorldFrame::Enu);
    assert_eq!(metadata.name, "virtual-phone");
    assert_eq!(metadata.extra["seed"], "1");
    assert_eq!(metadata.extra["motion"], "gentle");
    assert_eq!(metadata.extra["duration_s"], "75");
    assert_eq!(
        metadata.extra["true_initial_gyroscope_bias_rad_s"]
            .split(' ')
            .count(),
        3
    );
}

#[test]
fn nonsense_is_refused_with_the_field_the_value_and_what_was_expected() {
    let refused = |change: &dyn Fn(&mut VirtualPhoneConfig)| {
        let mut config = VirtualPhoneConfig::default();
        change(&mut config);
        VirtualPhone::new(config).unwrap_err().to_string()
    };
    assert_eq!(
        refused(&|c| c.gyroscope.sampling.rate_hz = -1.0),
        "virtual phone: gyroscope.sampling.rate_hz is -1, expected 0 (off) to 1e6 Hz"
    );
    assert_eq!(
        refused(&|c| c.duration_s = Some(f64::NAN)),
        "virtual phone: duration_s is NaN, expected a finite number, zero or more"
    );
    type Change<'a> = &'a dyn Fn(&mut VirtualPhoneConfig);
    let cases: [(Change<'_>, &str); 8] = [
        (&|c| c.duration_s = Some(1e12), "duration_s"),
        (&|c| c.rest_before_s = -1.0, "rest_before_s"),
        (
            &|c| (c.rest_before_s, c.motion_s, c.rest_after_s) = (0.0, 0.0, 0.0),
            "motion_s",
        ),
        (&|c| c.magnetic_dip_deg = 100.0, "magnetic_dip_deg"),
        (
            &|c| c.accelerometer.noise_std_m_s2 = -0.1,
            "accelerometer noise std",
        ),
        (
            &|c| c.magnetometer.bias_ut[1] = f64::INFINITY,
            "magnetometer bias",
        ),
        (
            &|c| c.magnetometer.sampling.dropout_probability = 1.5,
            "dropout_probability",
        ),
        (
            &|c| c.device_orientation.correlation_time_s = 0.0,
            "correlation_time_s",
        ),
    ];
    for (change, field) in cases {
        assert!(
            refused(change).contains(field),
            "{field}: {}",
            refused(change)
        );
    }
}

#[test]
fn a_configuration_is_a_toml_table_that_names_only_what_differs() {
    let read = |text: &str| toml::from_str::<VirtualPhoneConfig>(text);
    assert_eq!(read("").unwrap(), VirtualPhoneConfig::default());

    let text = "seed = 7\nmotion = 'brisk'\ndisturbance = 'both'\n\
                [gyroscope]\nnoise_std_rad_s = 0.01\n\
                [magnetometer.sampling]\nrate_hz = 20.0\n";
    let config = read(text).unwrap();
    let mut expected = VirtualPhoneConfig {
        seed: 7,
        motion: Motion::Brisk,
        disturbance: Disturbance::Both,
        ..VirtualPhoneConfig::default()
    };
    expected.gyroscope.noise_std_rad_s = 0.01;
    expected.magnetometer.sampling = Sampling::at_rate(20.0);
    assert_eq!(config, expected);
    assert_eq!(read(&toml::to_string(&config).unwrap()).unwrap(), config);

    for (text, complaint) in [
        ("sead = 7", "unknown field `sead`"),
        ("motion = 'wild'", "unknown variant `wild`"),
        ("[gyroscope]\nnoise_std = 1.0", "unknown field `noise_std`"),
        (
            "[gyroscope.sampling]\ndelay_s = 0.1",
            "missing field `rate_hz`",
        ),
    ] {
        let message = read(text).unwrap_err().to_string();
        assert!(message.contains(complaint), "{message}");
    }
}
