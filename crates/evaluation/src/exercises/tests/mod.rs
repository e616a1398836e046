//! Each card with a right hand-in and three wrong ones, all simulated, judged with the reason.

mod files;
mod texts;

use nalgebra::Vector3;
use northing_core::geometry::so3;
use northing_recording::{Event, RecordingError, Sample, SensorKind, WorldFrame};
use northing_simulation::virtual_phone::{Disturbance, Motion};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

use super::words::{Language, reason};
use super::*;
use crate::attitude::alterations::{Alterations, Pulse};
use crate::attitude::options::CompassUse;
use crate::attitude::setup::RunSetup;
use crate::calibration::rest::{Span, calibrate};
use crate::{EstimatorKind, Profile, RunOptions};

/// Everything of a hand-in, to be made wrong in one thing.
#[derive(Clone)]
struct Sketch {
    card: Card,
    events: Vec<Event>,
    options: RunOptions,
    alterations: Alterations,
    answers: Answers,
}

impl Sketch {
    fn new(card: Card, events: Vec<Event>) -> Self {
        let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        let span = Span {
            from_s: Some(0.0),
            to_s: Some(8.0),
        };
        let given = events.iter().map(|event| Ok::<_, RecordingError>(*event));
        let source = Some(crate::calibration::magnetometer::MagnetometerSource::Device);
        options.calibration = Some(calibrate(given, span, source).unwrap().calibration);
        Self {
            card,
            events,
            options,
            alterations: Alterations::default(),
            answers: Answers::new(),
        }
    }

    /// Adds an answer: a text or a number.
    #[allow(clippy::needless_pass_by_value)]
    fn answer(mut self, name: &str, value: impl ToString) -> Self {
        self.answers.insert(name.to_owned(), value.to_string());
        self
    }

    fn judge(&self) -> Judgement {
        self.card.check(&Work {
            events: &self.events,
            options: &self.options,
            starts: &[],
            alterations: &self.alterations,
            answers: &self.answers,
        })
    }

    fn hand_in(&self, student: &str) -> HandIn {
        HandIn {
            student: student.to_owned(),
            card: self.card,
            at: "2026-11-25 10:00:00 UTC".to_owned(),
            answers: self.answers.clone(),
            setup: RunSetup::of(&self.options),
            starts: Vec::new(),
            alterations: self.alterations,
            world_frame: WorldFrame::Enu,
            events: self.events.clone(),
        }
    }
}

/// The right one passes; each wrong one fails for this reason, which has words in both languages.
fn check(right: &Sketch, wrong: [(&str, Sketch); 3]) {
    let judged = right.judge();
    assert!(judged.passed, "{:?}: {judged:#?}", right.card);
    for found in &judged.reasons {
        assert_in_words(found);
    }
    for (key, sketch) in wrong {
        let judged = sketch.judge();
        let failure = judged
            .failure()
            .unwrap_or_else(|| panic!("{:?} passes without {key}", sketch.card));
        assert_eq!(failure.key, key, "{judged:#?}");
        assert!(!judged.passed);
        assert_in_words(failure);
    }
}

fn assert_in_words(found: &Reason) {
    for language in Language::ALL {
        let sentence = reason(found, language);
        assert!(
            !sentence.is_empty() && !sentence.contains('{'),
            "{found:?}: `{sentence}`"
        );
    }
}

fn phone(change: impl FnOnce(&mut VirtualPhoneConfig)) -> Vec<Event> {
    let mut config = VirtualPhoneConfig::default();
    change(&mut config);
    let phone = VirtualPhone::new(config).unwrap();
    // What a student has: no truth.
    phone
        .events()
        .filter(|e| e.sample.kind() != SensorKind::Reference)
        .collect()
}

/// Without motion, and so no experiment.
fn resting() -> Vec<Event> {
    phone(|config| config.motion = Motion::Rest)
}

#[test]
fn the_experiment() {
    let right = Sketch::new(Card::Experiment, phone(|_| {}));
    let run = right.hand_in("").judge().unwrap();
    // What the page shows of it, which the first run tells.
    assert_eq!(run.failure().unwrap().key, "reason.unanswered");
    let work = Work {
        events: &right.events,
        options: &right.options,
        starts: &[],
        alterations: &right.alterations,
        answers: &right.answers,
    };
    let summary = work
        .run(&right.events, EstimatorKind::Mekf, &mut ())
        .unwrap();
    let test = summary.final_test.unwrap();
    let right = right
        .answer("calculated", format!("{:.2}", test.calculated_error_deg))
        .answer(
            "estimated",
            format!("{:.2}", test.estimated_error_deg.unwrap()).replace('.', ","),
        )
        .answer("verdict", test.verdict.unwrap().name());
    let mut uncalibrated = right.clone();
    uncalibrated.options.calibration = None;
    let invented = right.clone().answer("calculated", "0.0");
    let still = Sketch {
        events: resting(),
        ..right.clone()
    };
    check(
        &right,
        [
            ("reason.calibrated", uncalibrated),
            ("reason.calculated", invented),
            ("reason.motion", still),
        ],
    );
}

#[test]
fn the_bias() {
    let sketch = Sketch::new(Card::Bias, phone(|_| {}));
    let bias = sketch.options.calibration.unwrap().gyroscope_bias_rad_s;
    let answered = |scale: f64, off: f64| {
        let mut answered = sketch.clone();
        for (axis, value) in ["x", "y", "z"].into_iter().zip(bias) {
            answered = answered.answer(axis, format!("{:.5}", value * scale + off));
        }
        answered
    };
    let degrees = 1_f64.to_degrees();
    check(
        &answered(degrees, 0.01),
        [
            ("reason.biasUnit", answered(1.0, 0.0)),
            ("reason.biasSign", answered(-degrees, 0.0)),
            ("reason.bias", answered(degrees, 0.05)),
        ],
    );
    let mut uncalibrated = answered(degrees, 0.0);
    uncalibrated.options.calibration = None;
    assert_eq!(
        uncalibrated.judge().failure().unwrap().key,
        "reason.calibrated"
    );
}

#[test]
fn consistent_nis() {
    let right = Sketch::new(Card::Consistent, phone(|_| {}));
    let with = |setting: &str| {
        let mut sketch = right.clone();
        sketch.options.set(setting).unwrap();
        sketch
    };
    let mut without = right.clone();
    without.options.sensors.magnetometer = false;
    check(
        &right,
        [
            ("reason.tooSmall", with("accelerometer_std=0.005")),
            ("reason.tooLarge", with("magnetometer_std_ut=8")),
            ("reason.magnetometerUsed", without),
        ],
    );
    let still = Sketch {
        events: resting(),
        ..right
    };
    assert_eq!(still.judge().failure().unwrap().key, "reason.motion");
}

#[test]
fn without_magnetometer() {
    let mut right = Sketch::new(Card::NoMagnetometer, phone(|_| {}))
        .answer("axis", "yaw")
        .answer("why", "gravity");
    right.options.sensors.magnetometer = false;
    right.options.sensors.compass = CompassUse::Never;
    // Nobody need switch off a compass that is not there.
    let mut unsaid = right.clone();
    unsaid.options.sensors.compass = CompassUse::WithoutMagnetometer;
    assert!(unsaid.judge().passed);
    let mut with = right.clone();
    with.options.sensors.magnetometer = true;
    check(
        &right,
        [
            ("reason.magnetometerOff", with),
            ("reason.axis", right.clone().answer("axis", "pitch")),
            ("reason.why", right.clone().answer("why", "gyroscope")),
        ],
    );
}

#[test]
fn the_rate() {
    let sketch = Sketch::new(Card::Rate, phone(|config| config.motion = Motion::Brisk));
    // Halving 100 Hz until it fails, as a student does.
    let mut rate = 100.0;
    let fails = loop {
        rate /= 2.0;
        let judged = sketch.clone().answer("rate", rate).judge();
        if judged.passed {
            break rate;
        }
        assert!(rate > 1.0, "no rate fails");
    };
    check(
        &sketch.clone().answer("rate", fails),
        [
            (
                "reason.rateFails",
                sketch.clone().answer("rate", 2.0 * fails),
            ),
            (
                "reason.rateTwice",
                sketch.clone().answer("rate", fails / 2.0),
            ),
            ("reason.rateRange", sketch.clone().answer("rate", 200)),
        ],
    );
    assert_eq!(
        sketch.answer("rate", "fast").judge().failure().unwrap().key,
        "reason.unanswered"
    );
}

/// Rest, `turns` about z, rest: a gyroscope that reads too much by `percent`, with a bias.
fn turning(turns: f64, percent: f64) -> Vec<Event> {
    let (rest_s, turn_s) = (9.0, 12.0);
    let bias = Vector3::new(0.003, -0.004, 0.006);
    let mut events = Vec::new();
    for k in 0..3000_i64 {
        let t = k as f64 * 0.01;
        let phase = ((t - rest_s) / turn_s).clamp(0.0, 1.0);
        let rate =
            std::f64::consts::TAU * turns / turn_s * (1.0 - (std::f64::consts::TAU * phase).cos());
        let angle = std::f64::consts::TAU
            * turns
            * (phase - (std::f64::consts::TAU * phase).sin() / std::f64::consts::TAU);
        // A little noise: the same for every sensor, so that nothing looks broken.
        let noise = |seed: i64| ((k * 7919 + seed * 104_729) % 1000) as f64 / 1000.0 - 0.5;
        let measured = Vector3::new(0.0, 0.0, rate * (1.0 + percent / 100.0))
            + bias
            + Vector3::new(noise(1), noise(2), noise(3)) * 2e-3;
        let force = Vector3::new(0.1, 0.0, 9.8) + Vector3::new(noise(4), noise(5), noise(6)) * 0.02;
        let field = so3::exp(&Vector3::new(0.0, 0.0, -angle)) * Vector3::new(0.0, 22.0, -40.0)
            + Vector3::new(noise(7), noise(8), noise(9)) * 0.3;
        for sample in [
            Sample::AngularRate(measured),
            Sample::SpecificForce(force),
            Sample::MagneticField(field),
        ] {
            events.push(Event {
                time_ns: k * 10_000_000,
                sample,
            });
        }
    }
    events
}

#[test]
fn the_scale() {
    let sketch = Sketch::new(Card::Scale, turning(3.0, 1.5)).answer("axis", "z");
    let right = sketch.clone().answer("error", "1.5");
    let other_way = Sketch::new(Card::Scale, turning(-2.0, -0.8))
        .answer("axis", "z")
        .answer("error", "-0.8");
    assert!(other_way.judge().passed, "{:#?}", other_way.judge());
    // 54 degrees over three turns: a bad gyroscope, and not a phone that was not brought back.
    let bad = Sketch::new(Card::Scale, turning(3.0, 5.0));
    let bad = bad.answer("axis", "z").answer("error", "5");
    assert!(bad.judge().passed, "{:#?}", bad.judge());
    let half = Sketch::new(Card::Scale, turning(2.5, 0.0))
        .answer("axis", "z")
        .answer("error", "0");
    check(
        &right,
        [
            ("reason.scaleSign", sketch.clone().answer("error", "-1.5")),
            ("reason.backInPose", half),
            ("reason.scaleAxis", right.clone().answer("axis", "x")),
        ],
    );
    // As a share instead of percent.
    assert_eq!(
        sketch
            .answer("error", "0.015")
            .judge()
            .failure()
            .unwrap()
            .key,
        "reason.scale"
    );
}

#[test]
fn the_magnet() {
    let near = phone(|config| {
        config.motion = Motion::Rest;
        config.disturbance = Disturbance::None;
    });
    let magnet = Alterations {
        magnet: Some(Pulse {
            at_s: 40.0,
            duration_s: 8.0,
            size: 60.0,
        }),
        ..Alterations::default()
    };
    let sketch = Sketch::new(Card::Magnet, magnet.apply(&near));
    let mut none = Sketch::new(Card::Magnet, near).answer("at", 44);
    let without: Vec<Event> = none
        .events
        .iter()
        .filter(|e| e.sample.kind() != SensorKind::Magnetometer)
        .copied()
        .collect();
    let blind = Sketch {
        events: without,
        ..none.clone()
    };
    none.card = Card::Magnet;
    check(
        &sketch.clone().answer("at", "44,0"),
        [
            ("reason.magnetTime", sketch.answer("at", 20)),
            ("reason.noMagnet", none),
            ("reason.noField", blind),
        ],
    );
}
