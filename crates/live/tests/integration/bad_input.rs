//! Bad input over real sockets: a clear message to whoever can act on it, nothing valid lost, the
//! other phones undisturbed.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use northing_recording::{Event, Sample};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use rustls::pki_types::pem::PemObject as _;
use serde_json::json;
use support::{TestLab, batch, wait_for};
use tokio_tungstenite::tungstenite::client::client;
use tokio_tungstenite::tungstenite::{Message, WebSocket};

type Tls = rustls::StreamOwned<rustls::ClientConnection, TcpStream>;

fn sensor_events(seconds: f64) -> Vec<Event> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        duration_s: Some(seconds),
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

/// The same events, `seconds` later or earlier.
fn shifted(events: &[Event], seconds: i64) -> Vec<Event> {
    let mut events = events.to_vec();
    for event in &mut events {
        event.time_ns += seconds * 1_000_000_000;
    }
    events
}

/// A connection to the phones' listener.
fn tls(lab: &TestLab) -> Tls {
    let pem = lab.data.path().join("certificate.pem");
    let mut roots = rustls::RootCertStore::empty();
    roots
        .add(rustls::pki_types::CertificateDer::from_pem_file(pem).unwrap())
        .unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let name = rustls::pki_types::ServerName::try_from("127.0.0.1").unwrap();
    let client = rustls::ClientConnection::new(Arc::new(config), name).unwrap();
    let socket = TcpStream::connect(lab.phone_host()).unwrap();
    socket
        .set_read_timeout(Some(Duration::from_secs(30)))
        .unwrap();
    rustls::StreamOwned::new(client, socket)
}

/// A phone's WebSocket that has said the token.
fn phone_socket(lab: &TestLab) -> WebSocket<Tls> {
    let url = format!("ws://{}/in/ws", lab.phone_host());
    let (mut socket, _) = client(url, tls(lab)).unwrap();
    let token = json!({"token": lab.token()}).to_string();
    socket.send(Message::text(token)).unwrap();
    socket
}

/// Sends all of Anna's events while `disturb` does what it does, and finds them undisturbed.
fn with_anna_undisturbed(lab: &TestLab, disturb: impl FnOnce()) {
    let events = sensor_events(3.0);
    let half = events.len() / 2;
    let send = |part: &[Event], first: u64| {
        for (chunk, seq) in part.chunks(30).zip(first..) {
            assert_eq!(lab.upload(&batch("anna", "s", seq, chunk)).status, 200);
        }
    };
    send(&events[..half], 0);
    disturb();
    send(&events[half..], half.div_ceil(30) as u64);
    let anna = lab.device("anna");
    assert_eq!(anna["received"], events.len());
    for zero in ["lost", "late", "duplicated", "refused"] {
        assert_eq!(anna[zero], 0, "{zero}");
    }
    assert!(anna["estimates"]["mekf"]["q"].is_array());
}

#[test]
fn stamps_from_the_future_and_the_past_start_anew_and_nothing_breaks() {
    let lab = TestLab::start();
    let events = sensor_events(2.0);
    with_anna_undisturbed(&lab, || {
        let days = 86_400 * 400;
        let parts = [
            events.clone(),
            shifted(&events, days),
            shifted(&events, 10),
            shifted(&events, 0),
        ];
        for (part, seq) in parts.iter().zip(0..) {
            assert_eq!(lab.upload(&batch("ben", "s", seq, part)).status, 200);
        }
    });
    let ben = lab.device("ben");
    // Each time that the clock was set by more than an hour, 49 readings pass until it is accepted.
    assert_eq!(ben["received"], 4 * events.len() - 2 * 49);
    let angles = ben["estimates"]["mekf"]["angles_deg"].as_array().unwrap();
    assert!(angles.iter().all(|a| a.as_f64().is_some()), "{ben}");
    assert!(!ben["health"].as_array().unwrap().is_empty());
}

#[test]
fn numbers_that_are_none_and_unknown_sensors_leave_the_valid_ones() {
    let lab = TestLab::start();
    with_anna_undisturbed(&lab, || {
        // NaN is no JSON: the batch is refused as a whole, in one line.
        let nan = br#"{"v":1,"device":"b","session":"s","seq":0,"gs":{"g":[[1,NaN,0,0]]}}"#;
        let answer = lab.upload(nan);
        assert_eq!(answer.status, 400);
        assert!(!answer.json()["error"].as_str().unwrap().contains('\n'));
        let body = br#"{"v":1,"device":"b","name":"B","session":"s","seq":0,"platform":"android",
            "gs":{"g":[[10,0,0,0],[20,1e999,0,0],[30,0,0,0]],"thermometer":[[10,21.5]],"a":{"x":1}},
            "lidar":[[1,2,3]],"dm":"none","do":[7,null,[]],"events":{"kind":5}}"#;
        // 1e999 overflows; parsers may refuse the batch or the reading, but say which.
        let answer = lab.upload(body);
        if answer.status == 400 {
            assert!(!answer.json()["error"].as_str().unwrap().is_empty());
            let body = String::from_utf8_lossy(body).replace("1e999", "1e300");
            assert_eq!(lab.upload(body.as_bytes()).status, 200);
        }
    });
    assert_eq!(lab.device("b")["received"], 2, "{}", lab.device("b"));
}

#[test]
fn deep_and_endless_json_is_refused_in_one_line() {
    let lab = TestLab::start();
    with_anna_undisturbed(&lab, || {
        let deep = [b"{\"v\":".to_vec(), b"[".repeat(100_000)].concat();
        let answer = lab.upload(&deep);
        assert_eq!(answer.status, 400, "{}", answer.text());
        // As many readings as fit, far more than a batch may have.
        let rows = vec!["[1,0,0,0]"; 20_000].join(",");
        let body =
            format!(r#"{{"v":1,"device":"many","session":"s","seq":0,"gs":{{"g":[{rows}]}}}}"#);
        assert!([200, 413].contains(&lab.upload(body.as_bytes()).status));
    });
}

#[test]
fn a_sensor_that_stops_in_the_middle_is_named_to_lab_and_phone() {
    let lab = TestLab::start();
    let events = sensor_events(6.0);
    let mut answer = json!(null);
    for (chunk, seq) in events.chunks(60).zip(0..) {
        // The magnetometer falls silent after two seconds.
        let rest: Vec<Event> = chunk
            .iter()
            .filter(|e| e.time_ns < 2_000_000_000 || !matches!(e.sample, Sample::MagneticField(_)))
            .cloned()
            .collect();
        answer = lab.upload(&batch("anna", "s", seq, &rest)).json();
    }
    let health = lab.device("anna")["health"].to_string();
    assert!(health.contains("magnetometer has stopped"), "{health}");
    let said = answer["commands"].to_string();
    assert!(said.contains("magnetometer has stopped"), "{said}");
}

#[test]
fn two_phones_with_one_identifier_become_two_devices_and_are_told() {
    let lab = TestLab::start();
    let events = sensor_events(4.0);
    let mut said = String::new();
    for (chunk, seq) in events.chunks(30).zip(0..) {
        lab.upload(&batch("anna", "first", seq, chunk));
        let answer = lab.upload(&batch("anna", "second", seq, chunk)).json();
        said = answer["commands"].to_string();
    }
    assert!(said.contains("device of its own"), "{said}");
    let received = |id: &str| lab.device(id)["received"].as_u64().unwrap() as usize;
    // Nothing is lost; the few batches until it was noticed went to the first one.
    wait_for("every reading of both", || {
        (received("anna") + received("anna+second") == 2 * events.len()).then_some(())
    });
    assert!(received("anna+second") > events.len() * 2 / 3);
    for id in ["anna", "anna+second"] {
        assert_eq!(lab.device(id)["lost"], 0, "{id}");
    }
}

#[test]
fn a_client_that_stalls_in_head_or_body_is_cut_off_and_the_others_go_on() {
    let lab = TestLab::start();
    let start = Instant::now();
    let mut head = TcpStream::connect(lab.app_host()).unwrap();
    head.write_all(b"POST /in/x HTTP/1.1\r\nhost: ").unwrap();
    let mut body = TcpStream::connect(lab.app_host()).unwrap();
    let text = format!(
        "POST /in/{} HTTP/1.1\r\nhost: {}\r\ncontent-length: 1000\r\n\r\n{{\"v\":1",
        lab.token(),
        lab.app_host()
    );
    body.write_all(text.as_bytes()).unwrap();
    // One that opens connections and never says anything, TLS or not.
    let silent: Vec<TcpStream> = (0..50)
        .map(|k| {
            let host = [lab.phone_host(), lab.app_host()];
            TcpStream::connect(&host[k % 2]).unwrap()
        })
        .collect();
    with_anna_undisturbed(&lab, || {});
    for (mut stream, what) in [(head, "head"), (body, "body")] {
        stream
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer);
        // Nothing, or that it took too long; never an acceptance.
        assert!(!answer.contains(" 200 "), "{what}: {answer}");
    }
    assert!(start.elapsed() < Duration::from_secs(60));
    drop(silent);
    assert_eq!(lab.device("anna")["lost"], 0);
}

#[test]
fn a_socket_that_never_reads_or_floods_harms_nobody() {
    let lab = TestLab::start();
    let mut socket = phone_socket(&lab);
    let mut flood = phone_socket(&lab);
    let large = " ".repeat(200_000);
    with_anna_undisturbed(&lab, || {
        // Answers that are not read fill the buffers; then the lab stops reading, too.
        let stream = &socket.get_mut().sock;
        stream.set_nonblocking(true).unwrap();
        for seq in 0..20_000_u64 {
            let text = format!(r#"{{"v":1,"device":"deaf","session":"s","seq":{seq},"gs":{{}}}}"#);
            if socket.send(Message::text(text)).is_err() {
                break;
            }
        }
        // Messages that are no batches, as fast as they go; the lab may hang up.
        for _ in 0..50 {
            if flood.send(Message::text(large.as_str())).is_err() {
                break;
            }
        }
    });
    let known = lab.status();
    let names: Vec<_> = known["devices"].as_array().unwrap().iter().collect();
    assert!(names.len() <= 2, "{known}");
}

#[test]
fn a_socket_without_the_token_gets_nothing_in() {
    let lab = TestLab::start();
    let url = format!("ws://{}/in/ws", lab.phone_host());
    let (mut socket, _) = client(url, tls(&lab)).unwrap();
    socket.send(Message::text(r#"{"token":"x"}"#)).unwrap();
    let Ok(Message::Text(answer)) = socket.read() else {
        panic!("no answer");
    };
    assert!(answer.contains("wrong token"), "{answer}");
    let body = String::from_utf8(batch("a", "s", 0, &sensor_events(0.1))).unwrap();
    let _ = socket.send(Message::text(body));
    while socket.read().is_ok() {}
    assert!(lab.status()["devices"].as_array().unwrap().is_empty());
}

#[test]
fn a_full_lab_says_so_and_goes_on() {
    let lab = TestLab::start();
    let events = sensor_events(0.1);
    for k in 0..64 {
        let body = batch(&format!("d{k}"), "s", 0, &events);
        assert_eq!(lab.upload(&body).status, 200);
    }
    // To an app that shows such texts (499), or to the page (503).
    let answer = lab.upload(&batch("late", "s", 0, &events));
    assert_eq!(answer.status, 503);
    assert!(answer.text().contains("the lab is full"));
    assert_eq!(lab.upload(&batch("d3", "s", 1, &events)).status, 200);
    wait_for("all", || {
        (lab.status()["devices"].as_array().unwrap().len() == 64).then_some(())
    });
}
