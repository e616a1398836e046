//! The cascades on a simulated flight with positions, and on what can be wrong with one.

#![allow(clippy::unwrap_used)]

use std::convert::Infallible;

use nalgebra::Vector3;
use northing_evaluation::attitude::observer::{EstimateRecord, PositionRecord};
use northing_evaluation::{EstimatorKind, Profile, RunObserver, RunOptions, RunSummary, run};
use northing_recording::{Event, Reference, Sample};
use northing_simulation::random::stream;
use northing_simulation::sensors::{ErrorModel, SensorErrors};
use northing_simulation::trajectory::{MultiSine, MultiSineConfig, Trajectory, Truth};
use northing_simulation::world::default_magnetic_field_ut;

/// Accelerometer bias of the flight, m/s^2.
const BIAS: Vector3<f64> = Vector3::new(0.06, -0.04, 0.05);
const TICK_NS: i64 = 10_000_000;

/// Turning like a [`MultiSine`], on a path of slow sines that begins at rest.
#[derive(Debug)]
struct Flight(MultiSine);

impl Flight {
    fn new(seconds: f64) -> Self {
        let motion = MultiSineConfig {
            amplitude_rad: 0.6,
            duration_s: seconds,
            ..MultiSineConfig::default()
        };
        Self(MultiSine::random(&mut stream(5, "flight"), &motion))
    }
}

impl Trajectory for Flight {
    fn at(&self, t_s: f64) -> Truth {
        let reach = Vector3::new(2.0, 1.5, 1.0);
        let pace = Vector3::new(0.4, 0.3, 0.5);
        let along = |f: fn(f64) -> f64, power: i32| {
            reach.zip_map(&pace, |a: f64, w: f64| a * w.powi(power) * f(w * t_s))
        };
        Truth {
            position: reach - along(f64::cos, 0),
            velocity: along(f64::sin, 1),
            acceleration_world: along(f64::cos, 2),
            ..self.0.at(t_s)
        }
    }
}

/// Everything measured on the flight: inertial samples at 100 Hz, the field at 50 Hz, positions
/// good to 0.1 m at 10 Hz, and the true attitude.
fn flight(seconds: f64) -> Vec<Event> {
    let path = Flight::new(seconds);
    let errors = |name, noise_std, bias, rate_hz| {
        let model = ErrorModel {
            noise_std,
            bias,
            ..ErrorModel::default()
        };
        SensorErrors::new(7, name, &model, rate_hz)
    };
    let mut gyroscope = errors("gyroscope", 0.005, [0.01, -0.02, 0.015], 100.0);
    let mut accelerometer = errors("accelerometer", 0.05, BIAS.into(), 100.0);
    let mut magnetometer = errors("magnetometer", 0.5, [0.0; 3], 50.0);
    let mut receiver = errors("receiver", 0.1, [0.0; 3], 10.0);
    let mut events = Vec::new();
    for k in 0..(seconds * 100.0) as i64 {
        let truth = path.at(k as f64 * 0.01);
        let mut add = |sample| {
            events.push(Event {
                time_ns: k * TICK_NS,
                sample,
            });
        };
        let body_from_world = truth.world_from_body.inverse();
        add(Sample::AngularRate(
            gyroscope.measure(&truth.angular_rate_body),
        ));
        add(Sample::SpecificForce(
            accelerometer.measure(&truth.specific_force_body()),
        ));
        if k % 2 == 0 {
            let field = body_from_world * default_magnetic_field_ut();
            add(Sample::MagneticField(magnetometer.measure(&field)));
        }
        if k % 10 == 0 {
            add(Sample::Position(receiver.measure(&truth.position)));
        }
        add(Sample::Reference(Reference {
            attitude: truth.world_from_body,
            scored: true,
        }));
    }
    events
}

/// The flight with its events changed; `None` leaves one out.
fn changed(events: &[Event], change: impl Fn(&Event) -> Option<Sample>) -> Vec<Event> {
    let one = |event: &Event| {
        Some(Event {
            sample: change(event)?,
            ..*event
        })
    };
    events.iter().filter_map(one).collect()
}

/// The flight with its positions changed, given their time, s.
fn moved(
    events: &[Event],
    change: impl Fn(f64, Vector3<f64>) -> Option<Vector3<f64>>,
) -> Vec<Event> {
    changed(events, |event| match event.sample {
        Sample::Position(p) => change(event.time_ns as f64 * 1e-9, p).map(Sample::Position),
        sample => Some(sample),
    })
}

#[derive(Default)]
struct Kept {
    estimates: Vec<EstimateRecord>,
    positions: Vec<PositionRecord>,
}

impl RunObserver for Kept {
    fn estimate(&mut self, record: &EstimateRecord) {
        let finite = |v: Option<Vector3<f64>>| v.unwrap_or_default().norm().is_finite();
        assert!(record.attitude.coords.norm().is_finite());
        assert!(
            finite(record.position) && finite(record.velocity),
            "{record:?}"
        );
        self.estimates.push(*record);
    }

    fn position(&mut self, record: &PositionRecord) {
        self.positions.push(*record);
    }
}

impl Kept {
    /// RMS of position and velocity error per axis over a span of seconds.
    fn errors(&self, from_s: f64, to_s: f64) -> [f64; 2] {
        let path = Flight::new(120.0);
        let mut sums = [0.0_f64; 2];
        let mut count = 0.0_f64;
        for record in &self.estimates {
            if (from_s..to_s).contains(&record.time_s) {
                let truth = path.at(record.time_s);
                sums[0] += (record.position.unwrap() - truth.position).norm_squared() / 3.0;
                sums[1] += (record.velocity.unwrap() - truth.velocity).norm_squared() / 3.0;
                count += 1.0;
            }
        }
        sums.map(|sum| (sum / count).sqrt())
    }
}

/// The lab's parameters, and an accelerometer that is known to accelerate.
fn options(kind: EstimatorKind) -> RunOptions {
    let mut options = RunOptions::new(kind, Profile::Lab);
    options.set("accelerometer_std=0.5").unwrap();
    options
}

/// Runs; every estimate is finite, or it ends there.
fn fly(events: &[Event], options: &RunOptions) -> (RunSummary, Kept) {
    let mut kept = Kept::default();
    let events = events.iter().map(|event| Ok::<_, Infallible>(*event));
    let summary = run(events, options, &mut kept).unwrap();
    (summary, kept)
}

fn skipped(summary: &RunSummary, reason: &str) -> u64 {
    let updates = &summary.position.as_ref().unwrap().updates;
    updates.skipped_because.get(reason).copied().unwrap_or(0)
}

#[test]
fn position_velocity_and_bias_are_found_and_told() {
    let events = flight(60.0);
    for kind in [EstimatorKind::Cascade, EstimatorKind::CascadeEkf] {
        let (summary, kept) = fly(&events, &options(kind));
        let [position, velocity] = kept.errors(20.0, 60.0);
        assert!(
            position < 0.1 && velocity < 0.15,
            "{kind}: {position} m, {velocity} m/s"
        );
        let told = summary.position.unwrap();
        // Half a second is alignment.
        assert_eq!((told.updates.fused, told.updates.skipped), (595, 5));
        assert_eq!(told.updates.skipped_because["not initialised"], 5);
        // Noise of 0.1 m, and what the estimate adds to it.
        let rms = told.innovation_rms_m.unwrap();
        for rms in [rms.horizontal, rms.vertical] {
            assert!((0.095..0.15).contains(&rms), "{kind}: {rms}");
        }
        let error = Vector3::from(told.accelerometer_bias_m_s2) - BIAS;
        // A degree of tilt is as good as 0.17 m/s^2 of bias.
        assert!(error.norm() < 0.25, "{kind}: {error}");
        assert_eq!(kept.positions.len(), 600);
    }
}

#[test]
fn without_positions_it_is_the_attitude_alone() {
    let events = moved(&flight(10.0), |_, _| None);
    let (summary, kept) = fly(&events, &options(EstimatorKind::Cascade));
    let (_, alone) = fly(&events, &options(EstimatorKind::Complementary));
    assert_eq!(kept.estimates, alone.estimates);
    assert!(kept.estimates.len() > 900 && kept.positions.is_empty());
    let waited =
        "The recording has no positions: the attitude ran, and the position observer waited.";
    assert_eq!(summary.issues, [waited]);
    let json = serde_json::to_value(&summary).unwrap();
    assert!(json.get("position").is_none());
    // Others say nothing about positions, whether there are any or not.
    let (other, kept) = fly(&flight(10.0), &options(EstimatorKind::Mekf));
    assert!(other.issues.is_empty() && other.position.is_none() && kept.positions.is_empty());
}

#[test]
fn the_position_observer_takes_the_rotation_it_is_told_to() {
    let events = flight(30.0);
    let mut options = options(EstimatorKind::CascadeEkf);
    let (_, estimated) = fly(&events, &options);
    options.set("cascade_rotation=reconstructed").unwrap();
    let (_, reconstructed) = fly(&events, &options);
    let pairs = estimated.estimates.iter().zip(&reconstructed.estimates);
    assert!(pairs.clone().all(|(a, b)| a.attitude == b.attitude));
    assert!(pairs.clone().any(|(a, b)| a.velocity != b.velocity));
    // The EKF is the better of the two, and it shows.
    let velocity = |kept: &Kept| kept.errors(10.0, 30.0)[1];
    assert!(velocity(&reconstructed) < velocity(&estimated));
    options.set("cascade_pole=0.5").unwrap();
    let (_, slower) = fly(&events, &options);
    assert_ne!(slower.estimates, reconstructed.estimates);
}

/// North, east, down is the same world: the estimate is the same, turned.
#[test]
fn the_world_may_be_north_east_down() {
    use northing_core::geometry::frames::{enu_from_ned_rotation, ned_from_enu};
    let events = flight(20.0);
    let (_, enu) = fly(&events, &options(EstimatorKind::Cascade));
    let down = changed(&events, |event| {
        Some(match event.sample {
            Sample::Position(p) => Sample::Position(ned_from_enu(&p)),
            Sample::Reference(r) => Sample::Reference(Reference {
                attitude: enu_from_ned_rotation::<f64>().inverse() * r.attitude,
                ..r
            }),
            sample => sample,
        })
    });
    let options = RunOptions {
        world_frame: northing_recording::WorldFrame::Ned,
        ..options(EstimatorKind::Cascade)
    };
    let (_, ned) = fly(&down, &options);
    let places =
        |kept: &Kept| -> Vec<_> { kept.estimates.iter().filter_map(|e| e.position).collect() };
    let pairs: Vec<_> = places(&enu).into_iter().zip(places(&ned)).collect();
    assert!(pairs.len() > 1900);
    for (enu, ned) in pairs {
        assert!((ned_from_enu(&enu) - ned).norm() < 1e-6, "{enu} {ned}");
    }
}

#[test]
fn positions_held_between_measurements_are_not_measurements() {
    let events = flight(30.0);
    let (_, once) = fly(&events, &options(EstimatorKind::Cascade));
    // As a table at the rate of the gyroscope has them: every row with the last position.
    let mut held = Vec::new();
    let mut last = None;
    for event in &events {
        match event.sample {
            Sample::Position(_) => last = Some(event.sample),
            Sample::Reference(_) => held.extend(last.map(|sample| Event { sample, ..*event })),
            _ => {}
        }
        if !matches!(event.sample, Sample::Position(_)) {
            held.push(*event);
        }
    }
    let (summary, kept) = fly(&held, &options(EstimatorKind::Cascade));
    assert_eq!(skipped(&summary, "the same numbers again"), 9 * 295);
    let place = |kept: &Kept| kept.estimates.last().unwrap().position;
    assert!(place(&once).is_some());
    assert_eq!(place(&kept), place(&once));
}

/// A body at rest gives the same rounded position again and again: that is one, every two seconds.
#[test]
fn a_position_that_stays_the_same_at_rest_still_holds_the_estimate() {
    let rest = Vector3::new(0.0, 0.0, 9.81);
    let mut events = Vec::new();
    for k in 0..12_000_i64 {
        let mut add = |sample| {
            events.push(Event {
                time_ns: k * TICK_NS,
                sample,
            });
        };
        add(Sample::AngularRate(Vector3::zeros()));
        add(Sample::SpecificForce(rest + Vector3::new(0.02, 0.0, 0.0)));
        if k % 10 == 0 {
            add(Sample::Position(Vector3::new(12.0, -3.0, 1.0)));
        }
    }
    let (summary, kept) = fly(&events, &options(EstimatorKind::Cascade));
    let position = kept.estimates.last().unwrap().position.unwrap();
    assert!(
        (position - Vector3::new(12.0, -3.0, 1.0)).norm() < 0.05,
        "{position}"
    );
    assert!(summary.position.unwrap().updates.fused >= 59);
}

#[test]
fn a_jump_of_a_kilometre_is_left_out_once_and_accepted_for_good() {
    let events = flight(60.0);
    let jump = Vector3::new(1000.0, 0.0, 0.0);
    let once = moved(&events, |t, p| {
        Some(if (30.0..30.05).contains(&t) {
            p + jump
        } else {
            p
        })
    });
    for kind in [EstimatorKind::Cascade, EstimatorKind::CascadeEkf] {
        let (summary, kept) = fly(&once, &options(kind));
        let updates = summary.position.unwrap().updates;
        assert_eq!((updates.gated, updates.inflated), (1, 0));
        assert!(
            kept.errors(30.0, 32.0)[0] < 0.2,
            "{:?}",
            kept.errors(30.0, 32.0)
        );
        let for_good = moved(&events, |t, p| Some(if t >= 30.0 { p + jump } else { p }));
        let (summary, kept) = fly(&for_good, &options(kind));
        let updates = summary.position.unwrap().updates;
        assert!(updates.gated >= 5 && updates.inflated >= 1, "{updates:?}");
        let end = kept.estimates.last().unwrap();
        let truth = Flight::new(60.0).at(end.time_s).position + jump;
        let off = (end.position.unwrap() - truth).norm();
        assert!(off < 1.0, "{kind}: {off} m");
    }
}

#[test]
fn positions_that_come_late_are_of_their_own_time() {
    let events = flight(60.0);
    let mut late = events.clone();
    // Three tenths of a second later in the stream, each with the stamp of when it was true.
    late.sort_by_key(|event| match event.sample {
        Sample::Position(_) => event.time_ns + 300_000_000,
        _ => event.time_ns,
    });
    let (_, on_time) = fly(&events, &options(EstimatorKind::CascadeEkf));
    let (summary, kept) = fly(&late, &options(EstimatorKind::CascadeEkf));
    assert!(summary.position.unwrap().updates.fused > 590);
    let (on_time, late) = (on_time.errors(20.0, 60.0), kept.errors(20.0, 60.0));
    assert!(
        late[0] < 1.5 * on_time[0] && late[1] < 1.5 * on_time[1],
        "{on_time:?} {late:?}"
    );
    // Taken for those of now they would be off by the way of 0.3 s, 0.2 m.
    let wrong = moved(&events, |t, _| Some(Flight::new(60.0).at(t - 0.3).position));
    let (_, wrong) = fly(&wrong, &options(EstimatorKind::CascadeEkf));
    assert!(
        wrong.errors(20.0, 60.0)[0] > 1.5 * late[0],
        "{:?}",
        wrong.errors(20.0, 60.0)
    );
}

#[test]
fn after_a_minute_without_positions_it_finds_back() {
    let events = moved(&flight(120.0), |t, p| {
        (!(30.0..90.0).contains(&t)).then_some(p)
    });
    for kind in [EstimatorKind::Cascade, EstimatorKind::CascadeEkf] {
        let (summary, kept) = fly(&events, &options(kind));
        let updates = summary.position.unwrap().updates;
        assert!(updates.gated >= 5 && updates.inflated >= 1, "{updates:?}");
        let [position, _] = kept.errors(110.0, 120.0);
        assert!(position < 0.3, "{kind}: {position} m");
    }
}

#[test]
fn time_that_stands_still_changes_nothing_and_is_counted() {
    let mut events = flight(40.0);
    let stop = 20_000_000_000;
    for event in &mut events {
        if (stop..stop + 1_000_000_000).contains(&event.time_ns) {
            event.time_ns = stop;
        }
    }
    for kind in [EstimatorKind::Cascade, EstimatorKind::CascadeEkf] {
        let (summary, kept) = fly(&events, &options(kind));
        let standing = kept.estimates.iter().filter(|e| e.time_ns == stop).count();
        assert!(standing <= 1, "{standing}");
        assert!(summary.gaps.count == 1, "{:?}", summary.gaps);
        assert!(
            kept.errors(35.0, 40.0)[0] < 0.2,
            "{:?}",
            kept.errors(35.0, 40.0)
        );
    }
    // The same stamp, but other samples between: refused one by one.
    let mut again = Vec::new();
    for event in flight(10.0) {
        again.push(event);
        if event.time_ns > 5_000_000_000 && matches!(event.sample, Sample::Reference(_)) {
            for sample in [
                Sample::AngularRate(Vector3::x()),
                Sample::Position(Vector3::zeros()),
            ] {
                again.push(Event {
                    time_ns: 5_000_000_000,
                    sample,
                });
            }
        }
    }
    let (summary, _) = fly(&again, &options(EstimatorKind::Cascade));
    let because = &summary.updates.gyroscope.skipped_because;
    assert_eq!(because["time stamp repeated or going back"], 499);
    let repeated = [
        "the same numbers again",
        "time stamp repeated or going back",
        "far out of range",
    ];
    let refused: u64 = repeated
        .iter()
        .map(|reason| skipped(&summary, reason))
        .sum();
    assert_eq!(refused, 499, "{:?}", summary.position);
}

/// Every sensor broken in turn; each sample is taken, gated or skipped for a reason, and counted.
#[test]
fn broken_sensors_leave_the_state_finite_and_are_counted() {
    let events = flight(30.0);
    let from = |t: f64, event: &Event| event.time_ns as f64 * 1e-9 > t;
    let nan = Vector3::repeat(f64::NAN);
    type Change<'a> = Box<dyn Fn(&Event) -> Sample + 'a>;
    let on = |t: f64, change: fn(Sample) -> Sample| -> Change<'_> {
        Box::new(move |event| {
            if from(t, event) {
                change(event.sample)
            } else {
                event.sample
            }
        })
    };
    let cases: [(&str, Change<'_>); 7] = [
        (
            "silent accelerometer",
            on(10.0, |s| match s {
                Sample::SpecificForce(_) => Sample::SpecificForce(Vector3::zeros()),
                s => s,
            }),
        ),
        (
            "saturated accelerometer",
            on(10.0, |s| match s {
                Sample::SpecificForce(v) => Sample::SpecificForce(v.map(|x| x.clamp(-5.0, 5.0))),
                s => s,
            }),
        ),
        (
            "absurd accelerometer",
            on(10.0, |s| match s {
                Sample::SpecificForce(v) => Sample::SpecificForce(v * 1e6),
                s => s,
            }),
        ),
        (
            "field along gravity",
            Box::new(|event| match event.sample {
                Sample::MagneticField(_) => Sample::MagneticField(Vector3::new(0.0, 0.0, -40.0)),
                s => s,
            }),
        ),
        (
            "no field",
            on(10.0, |s| match s {
                Sample::MagneticField(_) => Sample::MagneticField(Vector3::zeros()),
                s => s,
            }),
        ),
        ("numbers that are none", {
            Box::new(move |event| match event.sample {
                _ if event.time_ns / TICK_NS % 3 > 0 || !from(10.0, event) => event.sample,
                Sample::AngularRate(_) => Sample::AngularRate(nan),
                Sample::SpecificForce(_) => Sample::SpecificForce(nan),
                Sample::Position(_) => Sample::Position(nan),
                s => s,
            })
        }),
        (
            "absurd positions",
            on(10.0, |s| match s {
                Sample::Position(p) => Sample::Position(p + Vector3::repeat(1e12)),
                s => s,
            }),
        ),
    ];
    for (what, change) in &cases {
        let broken = changed(&events, |event| Some(change(event)));
        for kind in [EstimatorKind::Cascade, EstimatorKind::CascadeEkf] {
            let (summary, kept) = fly(&broken, &options(kind));
            let told = summary.position.unwrap();
            let all = told.updates.fused + told.updates.gated + told.updates.skipped;
            assert_eq!(all, 300, "{what}");
            assert!(
                kept.estimates.len() > 1900,
                "{what}: {}",
                kept.estimates.len()
            );
            let counts = &summary.updates;
            let seen = counts.accelerometer.fused
                + counts.accelerometer.gated
                + counts.accelerometer.skipped;
            assert_eq!(seen, 3000, "{what}");
            let [position, _] = kept.errors(25.0, 30.0);
            // Where positions go on, the estimate stays with them.
            if *what != "absurd positions" {
                assert!(position < 2.0, "{kind}, {what}: {position} m");
            }
        }
    }
}
