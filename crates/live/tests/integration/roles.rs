//! Teacher and students over real TLS: who gets in, what each may do, see and hear, and where secrets are.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

#[path = "../support/browser.rs"]
mod browser;
use crate::support;

use std::path::{Path, PathBuf};

use browser::{Browser, Phone};
use northing_recording::{Event, Sample};
use northing_simulation::virtual_phone::Motion;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::{Value, json};
use support::{TestLab, exchange, wait_for};

/// What a phone page sends of a virtual phone at rest.
fn sensor_events(seed: u64) -> Vec<Event> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        seed,
        duration_s: Some(12.0),
        motion: Motion::Rest,
        ..VirtualPhoneConfig::default()
    });
    let sent = |event: &Event| {
        matches!(
            event.sample,
            Sample::AngularRate(_) | Sample::SpecificForce(_) | Sample::MagneticField(_)
        )
    };
    phone.unwrap().events().filter(sent).collect()
}

/// A phone that delivers and has joined.
fn joined(lab: &TestLab, name: &str, seed: u64) -> Phone {
    let mut phone = Phone::new(lab, name, sensor_events(seed));
    phone.send(lab, 2);
    let answer = phone.join(lab);
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert_eq!(answer.json()["device"], phone.device);
    phone
}

/// Calibrates and experiments from the phone itself; the identifier of the experiment.
fn experimented(lab: &TestLab, phone: &mut Phone) -> String {
    let calibrate = phone.ask(&json!({"type": "calibrate", "seconds": 1.5}));
    assert_eq!(calibrate.status, 200, "{}", calibrate.text());
    phone.send(lab, 10);
    let mine = phone.mine();
    assert_eq!(mine["calibration"]["tone"], "good", "{mine}");
    assert!(
        mine["rest"]["gyroscope_bias_rad_s"][0].is_number(),
        "{mine}"
    );
    let experiment = json!({"type": "experiment", "seconds": 3.0, "name": "mine"});
    assert_eq!(phone.ask(&experiment).status, 200);
    phone.send(lab, 3);
    let mine = phone.mine();
    assert_eq!(mine["under_way"]["what"], "experiment", "{mine}");
    assert!(mine["angles_deg"][2].is_number() && mine["std_deg"][2].is_number());
    phone.send(lab, 17);
    let result = wait_for("the result", || {
        let mine = phone.mine();
        mine["result"].is_object().then(|| mine["result"].clone())
    });
    assert_eq!(result["name"], "mine");
    assert!(result["calculated_error_deg"].is_number(), "{result}");
    assert!(result["integration_deg"].is_number(), "{result}");
    result["id"].as_str().unwrap().to_owned()
}

/// A lab with the phones of Anna and Ben, both with an experiment.
fn class() -> (TestLab, [Phone; 2], [String; 2]) {
    let lab = TestLab::start_with_teacher(tempfile::tempdir().unwrap());
    let mut phones = [joined(&lab, "anna", 3), joined(&lab, "ben", 4)];
    let experiments = [0, 1].map(|k| experimented(&lab, &mut phones[k]));
    (lab, phones, experiments)
}

fn teacher(lab: &TestLab) -> Browser {
    let url = lab.running.teacher_url.as_deref().unwrap();
    let token = url.split_once("#t=").unwrap().1;
    let mut browser = Browser::new(lab);
    let answer = browser.post("/join/teacher", &json!({"token": token}));
    assert_eq!(answer.status, 200, "{}", answer.text());
    browser
}

/// Everything that can be got of a lab, a device and an experiment.
fn paths(device: &str, experiment: &str, recording: &str) -> Vec<String> {
    let mut paths: Vec<String> = [
        "/api/status",
        "/api/qr.svg",
        "/api/session.zip",
        "/api/recordings",
        "/api/opened",
        "/api/class",
        "/api/class.csv",
    ]
    .map(str::to_owned)
    .into();
    paths.push(format!("/api/recordings/{recording}"));
    paths.push(format!("/api/devices/{device}/magnetometer.toml"));
    for file in [
        "report.html",
        "recording.csv",
        "recording.parquet",
        "recording.mcap",
        "estimates.tum",
    ] {
        paths.push(format!("/api/experiments/{experiment}/{file}"));
    }
    paths
}

/// Everything that can be asked for about a device and an experiment.
fn requests(device: &str, id: &str) -> Vec<Value> {
    vec![
        json!({"type": "watch", "device": device}),
        json!({"type": "calibrate", "device": device, "seconds": 5.0}),
        json!({"type": "experiment", "device": device, "seconds": 5.0}),
        json!({"type": "stop", "device": device}),
        json!({"type": "settings", "device": device, "profile": "lab"}),
        json!({"type": "sensors", "device": device, "use": {"magnetometer": false}}),
        json!({"type": "estimators", "device": device, "use": ["mekf"]}),
        json!({"type": "subject", "device": device, "estimator": "mekf"}),
        json!({"type": "calibrate_magnetometer", "device": device, "action": "start"}),
        json!({"type": "rename", "device": device, "name": "stolen"}),
        json!({"type": "remove", "device": device}),
        json!({"type": "what_if", "id": id}),
        json!({"type": "allan", "id": id}),
        json!({"type": "delete_experiment", "id": id}),
        json!({"type": "archive_experiment", "id": id, "archived": true}),
        json!({"type": "calibrate_all", "seconds": 5.0}),
        json!({"type": "experiment_all", "seconds": 5.0}),
        json!({"type": "stop_all"}),
        json!({"type": "virtual_phone", "action": "add"}),
        json!({"type": "virtual_phone", "action": "remove", "device": device}),
        json!({"type": "input", "action": "add", "kind": "linkoping"}),
        json!({"type": "input", "action": "remove", "id": "x"}),
    ]
}

fn recording_of(lab: &TestLab) -> String {
    let list = lab.get("/api/recordings").json();
    list[0]["name"].as_str().unwrap().to_owned()
}

#[test]
fn a_student_reads_and_steers_its_own_phone_and_nothing_of_anybody_else() {
    let (lab, [mut anna, ben], [own, other]) = class();
    let recording = recording_of(&lab);
    // Files.
    for path in paths(&ben.device, &other, &recording) {
        let answer = anna.browser.get(&path);
        assert_eq!(answer.status, 403, "{path}");
        let text = answer.text();
        assert!(
            text.contains("teacher") || text.contains("your phone"),
            "{path}: {text}"
        );
        assert!(!text.contains("ben"), "{path}: {text}");
    }
    for file in ["report.html", "recording.csv", "estimates.tum"] {
        let answer = anna.browser.get(&format!("/api/experiments/{own}/{file}"));
        assert_eq!(answer.status, 200, "{file}");
    }
    // Posts.
    let before = lab.device(&ben.device);
    for request in requests(&ben.device, &other) {
        let answer = anna.ask(&request);
        assert_eq!(answer.status, 403, "{request}: {}", answer.text());
    }
    // What the page cannot say of itself, the lab adds; what it says is judged.
    for allowed in [
        json!({"type": "settings", "profile": "hand-held"}),
        json!({"type": "stop"}),
    ] {
        assert_eq!(anna.ask(&allowed).status, 200, "{allowed}");
    }
    assert_eq!(anna.mine()["profile"], "hand-held");
    for teachers in [
        json!({"type": "delete_experiment", "id": own}),
        json!({"type": "remove"}),
    ] {
        assert_eq!(anna.ask(&teachers).status, 403, "{teachers}");
    }
    let after = lab.device(&ben.device);
    for key in [
        "name",
        "settings",
        "use",
        "estimators",
        "subject",
        "under_way",
        "rest",
    ] {
        assert_eq!(before[key], after[key], "{key}");
    }
    assert_eq!(lab.status()["experiments"].as_array().unwrap().len(), 2);
    // The teacher elsewhere gets all of it.
    let mut teacher = teacher(&lab);
    for path in paths(&anna.device, &other, &recording) {
        let answer = teacher.get(&path);
        // No magnetometer was calibrated.
        let expected = if path.contains("magnetometer") {
            404
        } else {
            200
        };
        assert_eq!(answer.status, expected, "{path}");
    }
    assert_eq!(teacher.get("/api/mine").status, 404);
    assert_eq!(teacher.get("/lab/").status, 200);
    assert_eq!(anna.browser.get("/lab/").status, 200);
}

#[test]
fn a_students_page_hears_of_its_own_phone_alone() {
    let (lab, [anna, mut ben], [own, other]) = class();
    let mut page = anna.browser.socket().unwrap();
    let mut heard = page.until("the table", |m| m["type"] == "experiments");
    let hello = &heard[0];
    assert_eq!(hello["role"], "student");
    for key in ["phone_urls", "ingest_urls", "inputs", "input_kinds"] {
        assert_eq!(hello[key], json!([]), "{key}");
    }
    assert_eq!(heard[1]["devices"].as_array().unwrap().len(), 1);
    assert_eq!(heard[1]["devices"][0]["id"], anna.device);
    assert_eq!(heard.last().unwrap()["rows"][0]["id"], own.as_str());
    for (number, request) in requests(&ben.device, &other).into_iter().enumerate() {
        let mut request = request;
        request["request"] = json!(number);
        page.say(&request);
        heard.extend(page.until("a refusal", |m| {
            m["type"] == "error" && m["request"] == number
        }));
        let text = heard.pop().unwrap()["text"].as_str().unwrap().to_owned();
        assert!(
            text.contains("teacher") || text.contains("your phone"),
            "{request}: {text}"
        );
    }
    // Meanwhile Ben calibrates and experiments, and the teacher renames his phone.
    let mut teacher = teacher(&lab).socket().unwrap();
    teacher.say(&json!({"type": "rename", "device": ben.device, "name": "Ben's own"}));
    teacher.until("the name", |m| m["devices"][1]["name"] == "Ben's own");
    ben.ask(&json!({"type": "calibrate", "seconds": 1.0}));
    ben.send(&lab, 6);
    ben.ask(&json!({"type": "experiment", "seconds": 1.0, "name": "second"}));
    ben.send(&lab, 8);
    wait_for("Ben's result", || {
        (ben.mine()["result"]["name"] == "second").then_some(())
    });
    let everything = teacher.until("the experiment", |m| m["type"] == "experiments");
    let of_ben = |m: &&Value| m["device"] == ben.device.as_str();
    assert!(
        everything
            .iter()
            .filter(of_ben)
            .any(|m| m["type"] == "frame")
    );
    assert!(
        everything
            .iter()
            .filter(of_ben)
            .any(|m| m["type"] == "calibration")
    );
    // Her own what-if is answered, and nothing in between was of Ben.
    page.say(&json!({"type": "what_if", "id": own, "request": "last"}));
    heard.extend(page.until("an answer", |m| m["request"] == "last"));
    assert_eq!(heard.last().unwrap()["type"], "what_if");
    let said = json!(heard).to_string().to_lowercase();
    assert!(!said.contains("ben"), "{said}");
    assert!(
        !heard
            .iter()
            .any(|m| m["type"] == "recording" || m["type"] == "inputs")
    );
}

#[test]
fn a_student_hands_in_experiments_of_its_own_phone_and_the_teacher_sees_all() {
    let (lab, [mut anna, mut ben], [own, other]) = class();
    let hand_in = |id: &str| format!("/api/experiments/{id}/hand-in");
    let bias = anna.mine()["rest"]["gyroscope_bias_rad_s"].clone();
    let body = |student: &str, sign: f64| {
        let answer = |i: usize| {
            let rad_s = bias[i].as_f64().unwrap();
            format!("{:.3}", sign * rad_s.to_degrees()).replace('.', ",")
        };
        let answers = json!({"x": answer(0), "y": answer(1), "z": answer(2)});
        json!({"card": "bias", "student": student, "answers": answers})
    };
    assert_eq!(anna.browser.get("/api/exercises").status, 200);
    let answer = anna.browser.post(&hand_in(&own), &body("Anna", 1.0));
    assert_eq!(answer.status, 200, "{}", answer.text());
    let right = answer.json();
    assert_eq!(right["judgement"]["passed"], true, "{right}");
    assert_eq!(right["kept"], true);
    let wrong = anna.browser.post(&hand_in(&own), &body("Anna", -1.0));
    let wrong = wrong.json();
    assert_eq!(wrong["judgement"]["passed"], false);
    let reasons = wrong["judgement"]["reasons"].as_array().unwrap();
    assert_eq!(reasons.last().unwrap()["key"], "reason.biasSign");
    // What is of another, and what there is not, is refused alike.
    let url = right["url"].as_str().unwrap().to_owned();
    let refusals = [
        anna.browser.post(&hand_in(&other), &body("Anna", 1.0)),
        anna.browser.post(&hand_in("e99"), &body("Anna", 1.0)),
        ben.browser.get(&url),
        ben.browser.get("/api/experiments/e99/hand-ins/a.zip"),
    ];
    for refusal in refusals {
        assert_eq!(refusal.status, 403);
        let said = json!({"error": "there is no such experiment of your phone"});
        assert_eq!(refusal.json(), said);
    }
    // Nor is it had under an experiment of one's own.
    let file = right["file"].as_str().unwrap();
    let path = format!("/api/experiments/{other}/hand-ins/{file}");
    assert_eq!(ben.browser.get(&path).status, 404);
    let mut teacher = teacher(&lab);
    for browser in [&mut anna.browser, &mut teacher] {
        let zip = browser.get(&url);
        assert_eq!(zip.status, 200, "{}", zip.text());
        let kept = std::fs::read(lab.data.path().join("hand-ins").join(file)).unwrap();
        assert_eq!(zip.body, kept);
    }
    let table = teacher.get("/api/class").json();
    let students = json!([{"student": "Anna", "passed": {"bias": true}}]);
    assert_eq!(table["students"], students);
    assert_eq!(table["hand_ins"].as_array().unwrap().len(), 2);
    assert_eq!(lab.get("/api/class").json(), table);
    let csv = teacher.get("/api/class.csv?language=es").text();
    assert_eq!(csv.lines().count(), 3, "{csv}");
    assert!(
        csv.contains("Anna,bias,no,") && csv.contains("signo"),
        "{csv}"
    );
    // The teacher hands in what is of anybody.
    let answer = teacher.post(&hand_in(&other), &body("Ben", 1.0));
    assert_eq!(answer.status, 200, "{}", answer.text());
}

#[test]
fn who_has_not_joined_gets_nothing() {
    let (lab, [anna, _], [own, _]) = class();
    let recording = recording_of(&lab);
    let mut strangers = [Browser::new(&lab), Browser::new(&lab)];
    strangers[1].cookie = Some(format!("__Host-northing={}", "A".repeat(22)));
    for stranger in &mut strangers {
        let more = ["/api/role", "/api/mine", "/api/ws", "/api/exercises"].map(str::to_owned);
        for path in paths(&anna.device, &own, &recording)
            .into_iter()
            .chain(more)
        {
            let answer = stranger.get(&path);
            assert_eq!(answer.status, 401, "{path}: {}", answer.text());
            assert!(answer.text().contains("has not joined"), "{path}");
        }
        let hand_in = format!("/api/experiments/{own}/hand-in");
        for path in ["/api/ask", "/join/code", &hand_in] {
            assert_eq!(
                stranger.post(path, &json!({"type": "stop"})).status,
                401,
                "{path}"
            );
        }
        for path in ["/lab", "/lab/", "/lab/assets/lab.js"] {
            let answer = stranger.get(path);
            assert_eq!(answer.status, 303, "{path}");
            assert!(answer.head.contains("location: /join"), "{}", answer.head);
        }
        assert!(stranger.socket().is_err());
        assert_eq!(stranger.get("/join").status, 200);
    }
    // The other listeners know no cookie: uploads of apps have no lab page.
    let path = "/api/status";
    let answer = support::request(&lab.app_host(), "GET", path, &[], b"");
    assert_eq!(answer.status, 404);
}

#[test]
fn the_first_secret_of_a_page_that_delivers_keeps_the_device() {
    let lab = TestLab::start();
    let mut anna = Phone::new(&lab, "anna", sensor_events(3));
    // Nothing was sent yet.
    assert_eq!(anna.join(&lab).status, 404);
    anna.send(&lab, 1);
    assert_eq!(anna.join_with("wrong").status, 403);
    assert_eq!(anna.join(&lab).status, 200);
    // Another page under her name: it must know her page load, and then her secret.
    let mut thief = Phone::new(&lab, "thief", Vec::new());
    thief.device.clone_from(&anna.device);
    assert_eq!(thief.join(&lab).status, 404);
    thief.session.clone_from(&anna.session);
    let refused = thief.join(&lab);
    assert_eq!(refused.status, 409, "{}", refused.text());
    assert!(refused.text().contains("belongs to another page"));
    assert_eq!(thief.browser.cookie, None);
    // Her page is loaded again: the same secret, another session.
    anna.session = "anna-second-session".to_owned();
    let mut old = anna.browser.clone();
    anna.send(&lab, 1);
    assert_eq!(anna.join(&lab).status, 200);
    assert_eq!(anna.mine()["device"], anna.device);
    assert_eq!(old.get("/api/mine").status, 401);
    // Not every text is a secret.
    let mut short = Phone::new(&lab, "carl", sensor_events(5));
    short.send(&lab, 1);
    short.secret = "1234".to_owned();
    assert_eq!(short.join(&lab).status, 403);
}

#[test]
fn a_laptop_joins_with_a_code_once_and_guesses_are_slowed() {
    let lab = TestLab::start();
    let mut anna = joined(&lab, "anna", 3);
    let code = anna.browser.post("/join/code", &json!({})).json();
    assert_eq!(code["seconds"], 300);
    let code = code["code"].as_str().unwrap().to_owned();
    let mut laptop = Browser::new(&lab);
    let answer = laptop.post("/join/laptop", &json!({"code": code.to_lowercase()}));
    assert_eq!(answer.status, 200, "{}", answer.text());
    let role = laptop.get("/api/role").json();
    assert_eq!(role, json!({"role": "student", "device": anna.device}));
    let hello = laptop
        .socket()
        .unwrap()
        .until("hello", |m| m["type"] == "hello");
    assert_eq!(hello[0]["role"], "student");
    // A laptop may give out no more than the phone: a code of its own is of the same device.
    let mut second = Browser::new(&lab);
    let wrong = second.post("/join/laptop", &json!({"code": code}));
    assert_eq!(wrong.status, 403, "{}", wrong.text());
    assert!(wrong.text().contains("good once"), "{}", wrong.text());
    assert_eq!(second.cookie, None);
    let code = anna.browser.post("/join/code", &json!({})).json()["code"].clone();
    let tries = (0..60).map(|_| {
        second
            .post("/join/laptop", &json!({"code": "AAAAAAAA"}))
            .status
    });
    let tries: Vec<u16> = tries.collect();
    let looked = tries.iter().filter(|status| **status == 403).count();
    assert!((15..50).contains(&looked), "{tries:?}");
    assert_eq!(tries.last(), Some(&429));
    // While it guesses not even the right one is looked at; tokens of teachers and labs alike.
    assert_eq!(
        second.post("/join/laptop", &json!({"code": code})).status,
        429
    );
    assert_eq!(
        second.post("/join/teacher", &json!({"token": "x"})).status,
        429
    );
    // Who is in stays in.
    assert_eq!(laptop.get("/api/mine").status, 200);
    assert_eq!(anna.mine()["device"], anna.device);
}

#[test]
fn without_a_link_no_teacher_comes_from_elsewhere() {
    let lab = TestLab::start();
    assert_eq!(lab.running.teacher_url, None);
    let mut browser = Browser::new(&lab);
    for token in ["", lab.token(), &"A".repeat(22)] {
        let answer = browser.post("/join/teacher", &json!({"token": token}));
        assert_eq!(answer.status, 403, "{token}");
    }
}

#[test]
fn what_needs_a_gyroscope_waits_for_its_first_sample() {
    let lab = TestLab::start();
    let mut events = sensor_events(4);
    let mut at = 0;
    events.retain(|event| {
        at += 1;
        at > 300 || !matches!(event.sample, Sample::AngularRate(_))
    });
    let mut anna = Phone::new(&lab, "anna", events);
    anna.send(&lab, 2);
    assert_eq!(anna.join(&lab).status, 200);
    for request in [
        json!({"type": "experiment", "seconds": 3.0, "name": "early"}),
        json!({"type": "calibrate", "seconds": 3.0}),
    ] {
        let answer = anna.ask(&request);
        // The page asks again after 503.
        assert_eq!(answer.status, 503, "{}", answer.text());
        assert!(answer.text().contains("no gyroscope sample has come"));
    }
    let settings = json!({"type": "settings", "profile": "lab"});
    assert_eq!(anna.ask(&settings).status, 200);
    anna.send(&lab, 4);
    let experiment = json!({"type": "experiment", "seconds": 3.0, "name": "then"});
    wait_for("gyroscope samples", || {
        let status = anna.ask(&experiment).status;
        assert!(matches!(status, 200 | 503), "{status}");
        (status == 200).then_some(())
    });
}

#[test]
fn pages_of_another_origin_cannot_use_the_cookie() {
    let lab = TestLab::start();
    let mut anna = joined(&lab, "anna", 3);
    for origin in ["https://evil.example", "null", "http://127.0.0.1:1"] {
        for path in [
            "/api/ask",
            "/join/code",
            "/join/phone",
            "/join/laptop",
            "/join/teacher",
        ] {
            let headers = [("origin", origin)];
            let answer = anna
                .browser
                .ask("POST", path, &headers, br#"{"type": "stop"}"#);
            assert_eq!(answer.status, 403, "{origin} {path}");
            assert!(answer.text().contains("another page may not"));
        }
    }
}

/// The folder as a program that was killed now would leave it.
fn as_killed(lab: &TestLab) -> tempfile::TempDir {
    fn copy(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap().flatten() {
            let other = to.join(entry.file_name());
            match entry.file_type().unwrap().is_dir() {
                true => copy(&entry.path(), &other),
                false => drop(std::fs::copy(entry.path(), other).unwrap()),
            }
        }
    }
    let data = tempfile::tempdir().unwrap();
    copy(lab.data.path(), data.path());
    data
}

#[test]
fn a_lab_that_was_killed_knows_its_phones_and_one_that_ended_does_not() {
    let lab = TestLab::start_with_teacher(tempfile::tempdir().unwrap());
    let mut anna = joined(&lab, "anna", 3);
    let teacher = teacher(&lab);
    let file = lab.data.path().join("lab/tokens.json");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    }
    let kept = std::fs::read_to_string(&file).unwrap();
    for secret in [&anna.secret, &anna.browser.key(), &teacher.key()] {
        assert!(!kept.contains(secret.as_str()), "only hashes are kept");
    }

    let again = TestLab::start_with_teacher(as_killed(&lab));
    assert_eq!(again.token(), lab.token());
    let link = |lab: &TestLab| {
        let url = lab.running.teacher_url.clone().unwrap();
        url.split_once('#').unwrap().1.to_owned()
    };
    assert_eq!(link(&again), link(&lab));
    // The phone goes on by itself, with the cookie that it has.
    anna.browser = anna.browser.at(&again);
    anna.send(&again, 2);
    assert_eq!(anna.mine()["device"], anna.device);
    assert_eq!(teacher.at(&again).get("/api/status").status, 200);
    // The batches before these went to the lab that was killed: they are waited for, in vain.
    wait_for("samples", || {
        (again.device(&anna.device)["received"].as_u64()? > 0).then_some(())
    });
    let mut thief = Phone::new(&again, "thief", Vec::new());
    (thief.device, thief.session) = (anna.device.clone(), anna.session.clone());
    assert_eq!(thief.join(&again).status, 409);

    // Killed, and started without a link: no teacher elsewhere any more.
    let without = TestLab::start_with(as_killed(&again));
    assert_eq!(teacher.at(&without).get("/api/status").status, 401);

    again.runtime.block_on(again.running.stop());
    let folder = as_killed(&again);
    assert!(!folder.path().join("lab/tokens.json").exists());
    let ended = TestLab::start_with_teacher(folder);
    assert_ne!(ended.token(), lab.token());
    assert_eq!(anna.browser.at(&ended).get("/api/mine").status, 401);
    assert_eq!(teacher.at(&ended).get("/api/status").status, 401);
}

#[test]
fn damaged_tokens_are_set_aside_and_said() {
    let data = tempfile::tempdir().unwrap();
    let folder = data.path().join("lab");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("tokens.json"), "{").unwrap();
    let lab = TestLab::start_with(data);
    let said = lab.running.recovered.join(" ");
    assert!(
        said.contains("tokens.json") && said.contains("set-aside"),
        "{said}"
    );
    joined(&lab, "anna", 3);
}

/// Every file below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().flatten();
    entries
        .flat_map(|entry| match entry.path() {
            path if path.is_dir() => files(&path),
            path => vec![path],
        })
        .collect()
}

fn contains(bytes: &[u8], text: &str) -> bool {
    bytes
        .windows(text.len())
        .any(|window| window == text.as_bytes())
}

#[test]
fn secrets_are_in_no_other_file_report_or_answer() {
    let (lab, [mut anna, _ben], [own, _]) = class();
    let mut teacher = teacher(&lab);
    let code = anna.browser.post("/join/code", &json!({})).json();
    let code = code["code"].as_str().unwrap().to_owned();
    let mut laptop = Browser::new(&lab);
    assert_eq!(
        laptop.post("/join/laptop", &json!({"code": code})).status,
        200
    );
    let link = lab.running.teacher_url.clone().unwrap();
    let link = link.split_once("#t=").unwrap().1.to_owned();
    let secrets = [
        anna.secret.clone(),
        anna.browser.key(),
        laptop.key(),
        teacher.key(),
        code,
        link,
    ];
    // What a student's browser and what the teacher's gets; only the teacher is shown the lab's own token, as QR code.
    let mut answers: Vec<(String, Vec<u8>)> = Vec::new();
    for path in paths(&anna.device, &own, &recording_of(&lab)) {
        answers.push((path.clone(), teacher.get(&path).body));
        answers.push((path.clone(), anna.browser.get(&path).body));
    }
    for path in ["/p", "/join", "/lab/", "/api/role", "/api/mine"] {
        let answer = anna.browser.get(path);
        assert!(
            answer.head.contains("referrer-policy: no-referrer"),
            "{path}"
        );
        answers.push((path.to_owned(), answer.body));
    }
    let mut page = anna.browser.socket().unwrap();
    let heard = page.until("the table", |m| m["type"] == "experiments");
    answers.push((
        "a student's page".to_owned(),
        json!(heard).to_string().into(),
    ));
    for (path, body) in &answers {
        for secret in &secrets {
            assert!(!contains(body, secret), "{path}: {secret}");
        }
        let is_teachers = path == "/api/status";
        assert!(is_teachers || !contains(body, lab.token()), "{path}");
    }
    // Recordings are not compressed: what is in them would be seen.
    lab.runtime.block_on(lab.running.stop());
    let folder = lab.data.path();
    let mut seen = false;
    for path in files(folder) {
        let bytes = std::fs::read(&path).unwrap();
        seen |= contains(&bytes, &anna.session);
        for secret in secrets.iter().map(String::as_str).chain([lab.token()]) {
            assert!(!contains(&bytes, secret), "{}", path.display());
        }
    }
    assert!(seen, "the batches themselves are in a recording");
}

/// A connection without TLS to the phones' listener gets nothing that could be read on the way.
#[test]
fn without_tls_there_is_no_answer() {
    let lab = TestLab::start();
    let host = lab.phone_host();
    let outcome = std::panic::catch_unwind(|| {
        let stream = std::net::TcpStream::connect(&host).unwrap();
        exchange(stream, &host, "GET", "/join", &[], b"")
    });
    assert!(outcome.is_err(), "an answer came without TLS");
}
