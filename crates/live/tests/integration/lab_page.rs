//! The lab page's path over its WebSocket, on a virtual phone whose truth is known.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};
use support::TestLab;
use tokio_tungstenite::tungstenite::stream::MaybeTlsStream;
use tokio_tungstenite::tungstenite::{Message, WebSocket, connect};

/// A lab page.
struct Page {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
}

impl Page {
    fn open(lab: &TestLab) -> Self {
        let url = format!("ws://{}/api/ws", lab.lab_host());
        let (socket, _) = connect(url).unwrap();
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream
                .set_read_timeout(Some(Duration::from_secs(60)))
                .unwrap();
        }
        Self { socket }
    }

    fn say(&mut self, message: &Value) {
        self.socket
            .send(Message::text(message.to_string()))
            .unwrap();
    }

    /// The next message for which `wanted` holds.
    fn wait(&mut self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..20_000 {
            let text = match self.socket.read() {
                Ok(Message::Text(text)) => text,
                // The library answers it, as a browser does.
                Ok(Message::Ping(_)) => continue,
                other => panic!("no {what}: {other:?}"),
            };
            let message: Value = serde_json::from_str(&text).unwrap();
            assert!(message["type"] != "error" || wanted(&message), "{message}");
            if wanted(&message) {
                return message;
            }
        }
        panic!("no {what} among 20000 messages");
    }
}

#[test]
fn the_first_messages_say_what_there_is() {
    let lab = TestLab::start();
    let mut page = Page::open(&lab);
    let hello = page.wait("hello", |m| m["type"] == "hello");
    assert!(
        hello["phone_urls"][0]
            .as_str()
            .unwrap()
            .ends_with(lab.token())
    );
    let names: Vec<&str> = hello["estimators"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|e| e["name"].as_str())
        .collect();
    assert!(
        names.contains(&"mekf") && names.contains(&"integration"),
        "{names:?}"
    );
    let std = hello["parameters"].as_array().unwrap();
    let std = std
        .iter()
        .find(|p| p["name"] == "accelerometer_std")
        .unwrap();
    assert!(std["default"]["lab"].is_number() && std["default"]["hand-held"].is_number());
    assert_eq!(hello["fingerprint"], lab.running.fingerprint);
    assert_eq!(
        page.wait("devices", |m| m["type"] == "devices")["devices"],
        json!([])
    );
}

/// Calibration, experiment, result, what-if, files: each number against the virtual phone's truth.
#[test]
fn the_path_of_the_paper_on_a_virtual_phone() {
    let lab = TestLab::start();
    let mut page = Page::open(&lab);
    page.say(&json!({"type": "virtual_phone", "action": "add", "motion": "gentle", "disturbance": "none", "seed": 5}));
    let id = "virtual-1";
    page.wait("the device", |m| m["devices"][0]["delivers"] == true);
    page.say(&json!({"type": "calibrate", "device": id, "seconds": 5}));
    let calibrated = page.wait("a calibration", |m| {
        m["type"] == "calibration" && m["state"] != "running"
    });
    assert_eq!(calibrated["state"], "done", "{calibrated}");
    assert!(calibrated["result"]["gyroscope_samples"].as_u64().unwrap() > 450);
    assert!(
        calibrated["samples"]["accelerometer"]["t_s"]
            .as_array()
            .unwrap()
            .len()
            > 100
    );

    page.say(&json!({"type": "experiment", "device": id, "seconds": 6, "name": "first"}));
    let frame = page.wait("a frame", |m| {
        m["type"] == "frame" && m["truth"].is_object()
    });
    let off = frame["between_deg"]["mekf|truth"].as_f64().unwrap();
    assert!(off < 3.0, "{off}");
    let done = page.wait("a result", |m| {
        m["type"] == "experiment" && m["state"] == "done"
    });
    let summary = &done["result"]["summary"];
    let error = summary["mekf"]["error_deg"]["total_rmse"].as_f64().unwrap();
    assert!(error < 2.0, "{summary}");
    assert!(summary["integration"].is_object() && summary["device"].is_object());
    assert_eq!(done["result"]["hash"].as_str().unwrap().len(), 64);
    let rows = page.wait("the table", |m| m["type"] == "experiments");
    assert_eq!(rows["rows"][0]["name"], "first");

    let experiment = done["id"].as_str().unwrap();
    // Nothing changed: the same numbers, to the bit.
    page.say(
        &json!({"type": "what_if", "request": 1, "id": experiment, "settings": {}, "curve": null}),
    );
    let same = page.wait("an answer", |m| m["type"] == "what_if");
    assert_eq!(same["request"], 1);
    assert_eq!(&same["results"], summary);
    page.say(&json!({"type": "what_if", "request": 7, "id": experiment, "settings": {},
        "use": {"magnetometer": false}, "alterations": {"rate_hz": 10.0}, "estimators": ["mekf", "usque"], "subject": "usque"}));
    let worse = page.wait("an answer", |m| m["request"] == 7);
    assert_eq!(worse["type"], "what_if", "{worse}");
    assert_eq!(
        (&worse["subject"], &worse["results"]["mekf3"]),
        (&json!("usque"), &Value::Null)
    );
    assert!(worse["trace"]["nis"]["magnetometer"].is_null());
    assert!(worse["original"]["nis"]["magnetometer"]["mean"].is_array());
    page.say(&json!({"type": "what_if", "request": 2, "id": experiment,
        "settings": {"accelerometer_std": 5.0}, "curve": "accelerometer_std"}));
    let other = page.wait("an answer", |m| m["request"] == 2);
    assert_eq!(
        other["type"], "what_if",
        "the answer comes before the curve"
    );
    let nis = |answer: &Value| {
        answer["results"]["mekf"]["nis_mean"]["accelerometer"]
            .as_f64()
            .unwrap()
    };
    assert!(
        nis(&other) < 0.1 * nis(&same),
        "a hundred times the R, a tiny NIS"
    );
    let curve = page.wait("the curve", |m| m["type"] == "curve" && m["request"] == 2);
    let curve = curve["curve"]["nis"]["accelerometer"].as_array().unwrap();
    let curve: Vec<f64> = curve.iter().filter_map(Value::as_f64).collect();
    assert!(
        curve.len() > 10 && curve.windows(2).all(|w| w[0] > w[1]),
        "{curve:?}"
    );
    page.say(
        &json!({"type": "what_if", "request": 3, "id": experiment, "settings": {"no_such": 1}}),
    );
    let refused = page.wait("a refusal", |m| m["request"] == 3);
    assert!(
        refused["text"]
            .as_str()
            .unwrap()
            .contains("unknown parameter `no_such`")
    );
    files(&lab, experiment, done["result"]["hash"].as_str().unwrap());

    page.say(&json!({"type": "delete_experiment", "id": experiment}));
    page.wait("a table without it", |m| {
        m["type"] == "experiments" && m["rows"] == json!([])
    });
    page.say(&json!({"type": "virtual_phone", "action": "remove"}));
    page.wait("an empty lab", |m| {
        m["type"] == "devices" && m["devices"] == json!([])
    });
}

fn files(lab: &TestLab, experiment: &str, hash: &str) {
    let file = |name: &str| lab.get(&format!("/api/experiments/{experiment}/{name}"));
    let report = file("report.html");
    assert_eq!(report.status, 200);
    assert!(report.text().contains(hash) && report.text().contains("accelerometer_std"));
    let csv = file("recording.csv");
    let name = "recording.csv";
    let options = northing_recording::OpenOptions::default();
    let read = northing_recording::read_bytes(csv.body, name, &options).unwrap();
    let from_csv: Vec<_> = read.map(Result::unwrap).collect();
    assert!(from_csv.len() > 1500, "{}", from_csv.len());
    let parquet = file("recording.parquet").body;
    let read = northing_recording::read_bytes(parquet, "recording.parquet", &options).unwrap();
    assert!(
        read.map(Result::unwrap).eq(from_csv),
        "both files hold the same events"
    );
    let tum = file("estimates.tum").text();
    assert!(
        tum.lines()
            .filter(|line| line.split(' ').count() == 8)
            .count()
            > 400
    );
    assert_eq!(file("other.txt").status, 404);
    assert_eq!(lab.get("/api/experiments/e999/report.html").status, 404);
}

#[test]
fn settings_reach_the_device_and_mistakes_come_back_in_words() {
    let lab = TestLab::start();
    let mut page = Page::open(&lab);
    page.say(&json!({"type": "virtual_phone", "action": "add", "motion": "rest"}));
    page.wait("the device", |m| m["devices"][0]["id"] == "virtual-1");
    let device = "virtual-1";
    page.say(&json!({"type": "settings", "device": device, "profile": "hand-held", "settings": {"accelerometer_std": 0.7}}));
    page.wait("the setting", |m| {
        m["devices"][0]["settings"]["accelerometer_std"] == 0.7
    });
    page.say(&json!({"type": "sensors", "device": device, "use": {"gyroscope": true, "accelerometer": true, "magnetometer": false}}));
    page.wait("the choice", |m| {
        m["devices"][0]["use"]["magnetometer"] == false
    });
    page.say(&json!({"type": "estimators", "device": device, "use": ["mekf", "usque"]}));
    page.wait("another estimator", |m| m["estimates"]["usque"].is_object());
    page.say(&json!({"type": "rename", "device": device, "name": "Left"}));
    page.wait("the name", |m| m["devices"][0]["name"] == "Left");
    let mistakes = [
        (
            json!({"type": "settings", "device": device, "settings": {"accelerometer_std": -1}}),
            "from 1e-6 to 10000",
        ),
        (
            json!({"type": "sensors", "device": device, "use": {"gyroscope": false}}),
            "gyroscope",
        ),
        (
            json!({"type": "calibrate", "device": "nobody", "seconds": 5}),
            "no device `nobody`",
        ),
        (
            json!({"type": "calibrate", "device": device, "seconds": 0}),
            "expected 1 to 600",
        ),
        (json!({"type": "what_if", "id": "e9"}), "no experiment `e9`"),
        (json!({"type": "dance"}), "does not know"),
    ];
    for (message, words) in mistakes {
        page.say(&message);
        let error = page.wait("an error", |m| m["type"] == "error");
        assert!(error["text"].as_str().unwrap().contains(words), "{error}");
    }
}

/// Turned all over by its script, a magnetised virtual phone gives its hard iron; the file says the
/// same, and a device that has gone can be taken away.
#[test]
fn a_magnetometer_is_calibrated_while_the_phone_turns() {
    let lab = TestLab::start();
    let mut page = Page::open(&lab);
    let device = "virtual-1";
    page.say(&json!({"type": "virtual_phone", "action": "add", "motion": "tumble", "hard_iron_ut": [25, -14, 30]}));
    page.wait("the device", |m| m["devices"][0]["id"] == device);
    let order = |action: &str| json!({"type": "calibrate_magnetometer", "device": device, "action": action});
    page.say(&order("finish"));
    let refused = page.wait("a refusal", |m| m["type"] == "error");
    assert!(
        refused["text"].as_str().unwrap().contains("start one"),
        "{refused}"
    );
    page.say(&order("start"));
    let first = page.wait("progress", |m| {
        m["type"] == "magnetometer" && m["coverage"].is_object()
    });
    assert_eq!(first["coverage"]["cells"].as_array().unwrap().len(), 72);
    // It rests for 10 s, then turns.
    let good = page.wait("a good fit", |m| {
        m["type"] == "magnetometer"
            && m["coverage"]["fraction"].as_f64() > Some(0.55)
            && m["verdict"]["tone"] == "good"
    });
    assert!(good["points"].as_array().unwrap().len() > 50);
    assert!(
        good["hint"].as_str().unwrap().contains("Turn it so that"),
        "{good}"
    );
    page.say(&order("finish"));
    let done = page.wait("the calibration", |m| {
        m["type"] == "magnetometer" && m["state"] == "done"
    });
    let found: Vec<f64> = done["fit"]["hard_iron_ut"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_f64)
        .collect();
    for (found, truth) in found.iter().zip([25.0, -14.0, 30.0]) {
        assert!((found - truth).abs() < 1.0, "{done}");
    }
    page.wait("it in force", |m| {
        m["devices"][0]["magnetometer"]["model"].is_string()
    });
    let file = lab.get(&format!("/api/devices/{device}/magnetometer.toml"));
    assert_eq!(file.status, 200);
    assert!(file.text().contains("hard_iron_ut = ["), "{}", file.text());
    page.say(&order("discard"));
    page.wait("its end", |m| {
        m["type"] == "devices" && m["devices"][0]["magnetometer"].is_null()
    });
    assert_eq!(
        lab.get(&format!("/api/devices/{device}/magnetometer.toml"))
            .status,
        404
    );
    page.say(&json!({"type": "remove", "device": device}));
    page.wait("an empty lab", |m| {
        m["type"] == "devices" && m["devices"] == json!([])
    });
}

#[test]
fn commands_of_a_page_are_carried_out_in_their_order() {
    let lab = TestLab::start();
    let mut page = Page::open(&lab);
    page.say(&json!({"type": "virtual_phone", "action": "add", "motion": "rest"}));
    page.wait("the device", |m| m["devices"][0]["id"] == "virtual-1");
    for k in 1..=200 {
        page.say(&json!({"type": "settings", "device": "virtual-1", "settings": {"accelerometer_std": f64::from(k) * 0.01}}));
    }
    page.say(&json!({"type": "rename", "device": "virtual-1", "name": "last"}));
    let last = page.wait("the last one", |m| m["devices"][0]["name"] == "last");
    assert_eq!(last["devices"][0]["settings"]["accelerometer_std"], 2.0);
}

/// A short rest is refused with what is missing.
#[test]
fn an_allan_deviation_needs_a_rest_of_a_minute() {
    let lab = TestLab::start();
    let mut page = Page::open(&lab);
    page.say(&json!({"type": "virtual_phone", "action": "add", "motion": "rest"}));
    page.wait("the device", |m| m["devices"][0]["delivers"] == true);
    page.say(&json!({"type": "experiment", "device": "virtual-1", "seconds": 2, "name": "rest"}));
    let done = page.wait("a result", |m| {
        m["type"] == "experiment" && m["state"] == "done"
    });
    page.say(&json!({"type": "allan", "request": 7, "id": done["id"]}));
    let refused = page.wait("an answer", |m| m["type"] == "allan");
    assert_eq!(
        (&refused["state"], &refused["request"]),
        (&json!("refused"), &json!(7))
    );
    assert!(
        refused["text"].as_str().unwrap().contains("ten minutes"),
        "{refused}"
    );
    page.say(&json!({"type": "allan", "request": 8, "id": "e77"}));
    let error = page.wait("an error", |m| m["type"] == "error");
    assert_eq!(error["request"], 8);
}

#[test]
fn the_phone_page_comes_over_tls_with_a_certificate_that_names_the_address() {
    use rustls::pki_types::pem::PemObject as _;
    use std::io::{Read, Write};
    use std::sync::Arc;

    let lab = TestLab::start();
    let pem = lab.data.path().join("certificate.pem");
    let mut roots = rustls::RootCertStore::empty();
    roots
        .add(rustls::pki_types::CertificateDer::from_pem_file(pem).unwrap())
        .unwrap();
    for version in [&rustls::version::TLS12, &rustls::version::TLS13] {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = rustls::ClientConfig::builder_with_provider(provider)
            .with_protocol_versions(&[version])
            .unwrap()
            .with_root_certificates(roots.clone())
            .with_no_client_auth();
        let name = rustls::pki_types::ServerName::try_from("127.0.0.1").unwrap();
        let client = rustls::ClientConnection::new(Arc::new(config), name).unwrap();
        let socket = TcpStream::connect(lab.phone_host()).unwrap();
        socket
            .set_read_timeout(Some(Duration::from_secs(30)))
            .unwrap();
        let mut stream = rustls::StreamOwned::new(client, socket);
        let host = lab.phone_host();
        let body = support::batch("tls", "s", 0, &[]);
        let head = format!(
            "POST /in HTTP/1.1\r\nhost: {host}\r\nx-northing-token: {}\r\norigin: https://{host}\r\ncontent-length: {}\r\nconnection: close\r\n\r\n",
            lab.token(),
            body.len()
        );
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(&body).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer);
        assert!(
            answer.starts_with("HTTP/1.1 200") && answer.contains("\"ack\":0"),
            "{answer}"
        );
    }
    assert_eq!(lab.device("tls")["source"], "page");
}
