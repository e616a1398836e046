//! Handing in from the lab: judged as `northing grade` judges, kept as it reads, refused in the words of `northing hand-in`.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::fs::File;
use std::path::Path;

use northing_evaluation::exercises::{HandIn, Judgement};
use northing_live::hand_ins::{HandInRequest, HandIns, Taken};
use serde_json::{Value, json};

use crate::support::{Answer, TestLab, request};
use crate::what_if::finished;

fn asked(body: Value) -> HandInRequest {
    serde_json::from_value(body).unwrap()
}

fn taken(hand_ins: &HandIns, body: Value) -> Taken {
    let finished = finished();
    let at = "2026-01-01 10:00:00 UTC".to_owned();
    let hand_in = finished.hand_in(&asked(body), at).unwrap();
    hand_ins.take(&finished, &hand_in).unwrap()
}

fn consistent(change: &Value) -> Value {
    let mut body = json!({"card": "consistent", "student": " Anna  B. ", "answers": {}});
    for (key, value) in change.as_object().unwrap() {
        body[key] = value.clone();
    }
    body
}

fn failure(judgement: &Judgement) -> &str {
    &judgement.failure().unwrap().key
}

/// What `northing grade` finds in a file.
fn graded(path: &Path) -> (String, Judgement) {
    let (_, judged) = HandIn::read(File::open(path).unwrap()).unwrap();
    assert!(judged.as_claimed);
    (judged.student, judged.judgement)
}

#[test]
fn what_is_handed_in_is_judged_and_kept_as_grade_reads_it() {
    let data = tempfile::tempdir().unwrap();
    let folder = data.path().join("hand-ins");
    let hand_ins = HandIns::new(Some(folder.clone()));
    let changes = [
        json!({}),
        json!({"settings": {"accelerometer_std": 3.0}}),
        json!({"use": {"magnetometer": false, "compass": false}}),
        json!({"alterations": {"bump": {"at_s": 10.0, "duration_s": 1.0, "size": 20.0}}}),
    ];
    let all: Vec<Taken> = changes
        .iter()
        .map(|change| taken(&hand_ins, consistent(change)))
        .collect();
    let names: Vec<&str> = all.iter().map(|one| one.file.as_str()).collect();
    assert!(names[0].starts_with("consistent-anna-b--e1-"), "{names:?}");
    let stem = names[0].strip_suffix(".zip").unwrap();
    assert_eq!(names[3], format!("{stem}-4.zip"), "nothing is written over");
    // The changes of the what-if are what is judged.
    assert_eq!(failure(&all[1].judged.judgement), "reason.tooLarge");
    assert_eq!(failure(&all[2].judged.judgement), "reason.magnetometerUsed");
    let reasons = |k: usize| &all[k].judged.judgement.reasons;
    assert_ne!(reasons(0), reasons(3), "the bump is seen");
    for one in &all {
        assert_eq!(one.not_kept, None);
        let path = folder.join(&one.file);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            let mode = |path: &Path| path.metadata().unwrap().permissions().mode() & 0o777;
            assert_eq!((mode(&path), mode(&folder)), (0o600, 0o700));
        }
        assert_eq!(
            graded(&path),
            ("Anna B.".to_owned(), one.judged.judgement.clone())
        );
    }
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 4);
    // A lab that starts again judges the files that it finds, and files of elsewhere, too.
    std::fs::write(folder.join("broken.zip"), b"PK").unwrap();
    std::fs::write(folder.join("notes.txt"), b"who was ill").unwrap();
    let class = HandIns::new(Some(folder)).class();
    assert_eq!(class.hand_ins.len(), 4);
    assert_eq!(class.not_judged[0].0, "broken.zip");
    assert_eq!(class.hand_ins, hand_ins.class().hand_ins);
}

#[test]
fn a_file_belongs_to_its_experiment() {
    let data = tempfile::tempdir().unwrap();
    let hand_ins = HandIns::new(Some(data.path().to_owned()));
    let finished = finished();
    let mut files = Vec::new();
    for _ in 0..2 {
        files.push(taken(&hand_ins, consistent(&json!({}))).file);
    }
    for file in &files {
        let bytes = hand_ins.file(&finished, file).unwrap();
        assert_eq!(bytes, std::fs::read(data.path().join(file)).unwrap());
    }
    // Another experiment, and another that has got the identifier of one that was deleted.
    let mut other = crate::what_if::finished();
    other.id = "e2".to_owned();
    assert!(
        files
            .iter()
            .all(|file| hand_ins.file(&other, file).is_none())
    );
    other.id = "e1".to_owned();
    other.hash = "0".repeat(64);
    assert!(
        files
            .iter()
            .all(|file| hand_ins.file(&other, file).is_none())
    );
    for name in ["", "../lock", ".zip", "consistent-anna-b--e1.zip"] {
        assert!(hand_ins.file(&finished, name).is_none(), "{name}");
    }
}

#[test]
fn where_nothing_is_kept_it_is_judged_and_can_be_fetched() {
    let hand_ins = HandIns::new(None);
    let one = taken(&hand_ins, consistent(&json!({})));
    let two = taken(&hand_ins, consistent(&json!({})));
    assert_ne!(one.file, two.file);
    assert!(one.not_kept.unwrap().contains("--no-recording"));
    let bytes = hand_ins.file(&finished(), &one.file).unwrap();
    let (_, judged) = HandIn::read(std::io::Cursor::new(bytes)).unwrap();
    assert_eq!(judged, one.judged);
    assert_eq!(hand_ins.class().hand_ins.len(), 2);
}

fn hand_in(lab: &TestLab, id: &str, body: &Value) -> Answer {
    let path = format!("/api/experiments/{id}/hand-in");
    let headers = [("content-type", "application/json")];
    request(
        &lab.lab_host(),
        "POST",
        &path,
        &headers,
        body.to_string().as_bytes(),
    )
}

#[test]
fn what_does_not_answer_a_card_is_refused_in_the_words_of_hand_in() {
    let said = |body: Value| {
        let refused = finished().hand_in(&asked(body), String::new());
        refused.map(|_| ()).unwrap_err()
    };
    let rate = |student: &str, rate: &str| json!({"card": "rate", "student": student, "answers": {"rate": rate}});
    for (body, sentence) in [
        (rate(" ", "50"), "student: expected a name"),
        (
            rate(&"a".repeat(81), "50"),
            "student: expected a name of at most 80 characters",
        ),
        (rate("Anna", "fast"), "rate=fast: expected a number in Hz"),
        (
            json!({"card": "rate", "student": "Anna", "answers": {}}),
            "rate: it is not answered; `rate` asks for rate",
        ),
        (
            json!({"card": "consistent", "student": "Anna", "answers": {"q": "1"}}),
            "q=1: `consistent` has no questions; leave it out",
        ),
    ] {
        assert_eq!(said(body), sentence);
    }
    let long = said(rate("Anna", &"0".repeat(81)));
    assert!(long.contains("at most 80 characters"), "{long}");
    let unknown = consistent(&json!({"settings": {"speed": 1.0}}));
    assert!(said(unknown).contains("speed"));
    // Over HTTP.
    let lab = TestLab::start();
    let none = hand_in(&lab, "e7", &rate("Anna", "50"));
    assert_eq!(none.status, 404, "{}", none.text());
    assert!(none.json()["error"].as_str().unwrap().contains("`e7`"));
    assert_eq!(hand_in(&lab, "e7", &json!({"card": "b"})).status, 400);
    let flood = json!({"card": "rate", "student": "a".repeat(20_000), "answers": {}});
    assert_eq!(hand_in(&lab, "e7", &flood).status, 413);
    assert!(!lab.data.path().join("hand-ins").exists());
    let cards = lab.get("/api/exercises").json();
    assert_eq!(cards.as_array().unwrap().len(), 7);
    assert_eq!(cards[1]["card"], "bias");
    assert_eq!(cards[1]["questions"][2]["unit"], "deg/s");
}
