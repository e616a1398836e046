//! The file that is handed in.

use std::io::Cursor;

use super::*;
use crate::exercises::hand_in::shared;

#[test]
fn a_hand_in_is_the_same_for_everybody_and_trusts_nothing() {
    let sketch = Sketch::new(Card::Consistent, phone(|_| {}));
    let bytes = sketch.hand_in("Anna").to_bytes().unwrap();
    let (read, judged) = HandIn::read(Cursor::new(&bytes)).unwrap();
    assert_eq!(read.events, sketch.events);
    assert!(judged.judgement.passed && judged.as_claimed);
    assert_eq!(
        (judged.student.as_str(), judged.card),
        ("Anna", Card::Consistent)
    );
    // The same recording under another name is found.
    let (_, again) = HandIn::read(Cursor::new(sketch.hand_in("Ben").to_bytes().unwrap())).unwrap();
    let both = [judged, again];
    assert_eq!(
        shared(&both).into_values().collect::<Vec<_>>(),
        [["Anna", "Ben"]]
    );
    // A number that was improved afterwards is judged by the run, and the claim is seen to be another.
    let mut bad = sketch;
    bad.options.set("accelerometer_std=0.005").unwrap();
    let bytes = bad.hand_in("Cleo").to_bytes().unwrap();
    let forged = replaced(&bytes, "hand_in.json", |text| {
        text.replace("\"passed\": false", "\"passed\": true")
    });
    let (_, judged) = HandIn::read(Cursor::new(forged)).unwrap();
    assert!(!judged.judgement.passed && !judged.as_claimed);
}

#[test]
fn what_is_no_hand_in_says_so() {
    let said = |bytes: Vec<u8>| {
        HandIn::read(Cursor::new(bytes))
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    assert!(said(b"hello".to_vec()).contains("it is no zip"));
    let bytes = Sketch::new(Card::Consistent, turning(1.0, 0.0))
        .hand_in("Anna")
        .to_bytes()
        .unwrap();
    assert!(said(bytes[..bytes.len() / 2].to_vec()).contains("zip"));
    assert!(
        said(replaced(&bytes, "samples.bin", |text| format!("{text}x"))).contains("is not the one")
    );
    assert!(said(replaced(&bytes, "hand_in.json", |_| "{}".to_owned())).contains("hand_in.json"));
    assert!(
        said(replaced(&bytes, "hand_in.json", |text| text
            .replace("northing-hand-in", "other")))
        .contains("this program reads")
    );
    assert!(
        said(replaced(&bytes, "hand_in.json", |text| text
            .replace("\"skip_s\": 5.0", "\"skip_s\": -1.0")))
        .contains("skip_s")
    );
}

/// The zip with a part changed; bytes that are no text are kept as they are.
fn replaced(bytes: &[u8], part: &str, change: impl Fn(String) -> String) -> Vec<u8> {
    use std::io::{Read as _, Write as _};
    let mut from = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut to = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for i in 0..from.len() {
        let mut file = from.by_index(i).unwrap();
        let mut content = Vec::new();
        file.read_to_end(&mut content).unwrap();
        let name = file.name().unwrap().into_owned();
        if name == part {
            let text: String = content.iter().map(|b| char::from(*b)).collect();
            content = change(text).chars().map(|c| c as u8).collect();
        }
        to.start_file(name, zip::write::SimpleFileOptions::default())
            .unwrap();
        to.write_all(&content).unwrap();
    }
    to.finish().unwrap().into_inner()
}

/// The bias is that of the recording's own rest, whatever the file says: there is no number in it to be improved.
#[test]
fn a_calibration_from_the_first_seconds_is_made_anew() {
    let mut sketch = Sketch::new(Card::Bias, phone(|_| {}));
    let bias = sketch.options.calibration.take().unwrap();
    sketch.options.calibrate_first_s = Some(8.0);
    for (axis, value) in ["x", "y", "z"].into_iter().zip(bias.gyroscope_bias_rad_s) {
        sketch = sketch.answer(axis, value.to_degrees());
    }
    let (_, judged) =
        HandIn::read(Cursor::new(sketch.hand_in("Anna").to_bytes().unwrap())).unwrap();
    assert!(judged.judgement.passed, "{judged:#?}");
    sketch.options.calibrate_first_s = Some(60.0);
    let judged = sketch.judge();
    assert_eq!(
        judged.failure().unwrap().key,
        "reason.notCalibrated",
        "it moves by then"
    );
}

/// Names and answers are printed on terminals.
#[test]
fn what_a_stranger_wrote_stays_on_its_line() {
    let sketch =
        Sketch::new(Card::NoMagnetometer, turning(1.0, 0.0)).answer("axis", "yaw\u{1b}[2J\nx");
    let bytes = sketch.hand_in("Anna\n\u{1b}[31mred").to_bytes().unwrap();
    let (read, judged) = HandIn::read(Cursor::new(bytes)).unwrap();
    assert_eq!(judged.student, "Anna [31mred");
    assert_eq!(read.answers["axis"], "yaw[2J x");
}

/// A recording of another exercise fails with a reason.
#[test]
fn a_recording_of_another_card_is_seen_to_be_none() {
    let still = resting();
    let moving = phone(|_| {});
    for (card, events, key) in [
        (Card::Experiment, &still, "reason.motion"),
        (Card::Rate, &still, "reason.motion"),
        (Card::Consistent, &still, "reason.motion"),
        (Card::Scale, &still, "reason.twoRests"),
        (Card::Magnet, &moving, "reason.noMagnet"),
    ] {
        let judged = Sketch::new(card, events.clone()).judge();
        let failure = judged.failure().unwrap();
        assert_eq!(failure.key, key, "{card:?}: {judged:#?}");
        assert_in_words(failure);
    }
}

/// Stamps and numbers of a stranger: judged or refused, never a panic.
#[test]
fn wild_samples_are_judged_without_a_panic() {
    let (far, nan) = (i64::MAX, f64::NAN);
    let rate = |time_ns, x| Event {
        time_ns,
        sample: Sample::AngularRate(Vector3::new(x, 0.0, 0.0)),
    };
    let force = |time_ns, x| Event {
        time_ns,
        sample: Sample::SpecificForce(Vector3::new(x, 0.0, 9.8)),
    };
    let wild = [
        vec![],
        vec![rate(0, 0.0)],
        vec![
            rate(i64::MIN, 0.0),
            rate(far, 1.0),
            rate(0, 0.0),
            force(far, nan),
        ],
        vec![
            rate(0, nan),
            rate(1, 1e300),
            rate(2, -1e300),
            force(3, f64::INFINITY),
        ],
        (0..2000).map(|k| rate(k % 7, 1e200)).collect(),
    ];
    for card in Card::ALL {
        for events in &wild {
            let mut sketch = Sketch::new(Card::Bias, resting());
            sketch.card = card;
            sketch.events.clone_from(events);
            for question in card.questions() {
                sketch = sketch.answer(question.name, question.choices.first().unwrap_or(&"1"));
            }
            let judged = sketch.judge();
            assert!(
                !judged.passed || card == Card::Bias,
                "{card:?}: {judged:#?}"
            );
        }
    }
}
