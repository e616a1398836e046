//! Clients that say nothing, pretend to be others, or are too many: they cost others nothing.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use northing_live::connections::Patience;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, ServerName};
use support::{TestLab, batch, wait_for};

/// How long it takes until the other end closes; at most a minute.
fn closed_after(stream: &mut impl Read) -> Duration {
    let start = Instant::now();
    let mut byte = [0; 1024];
    while stream.read(&mut byte).is_ok_and(|read| read > 0) {}
    start.elapsed()
}

fn connect(host: &str) -> TcpStream {
    let stream = TcpStream::connect(host).unwrap();
    let minute = Some(Duration::from_secs(60));
    stream.set_read_timeout(minute).unwrap();
    stream
}

fn impatient() -> TestLab {
    let soon = Duration::from_millis(300);
    TestLab::with_patience(Patience {
        handshake: soon,
        first_byte: soon,
        idle: soon,
        write: soon,
    })
}

/// A client that trusts the lab's certificate, with the encryption agreed on.
fn encrypted(lab: &TestLab) -> rustls::StreamOwned<rustls::ClientConnection, TcpStream> {
    let mut roots = rustls::RootCertStore::empty();
    let file = lab.data.path().join("certificate.pem");
    roots
        .add(CertificateDer::from_pem_file(file).unwrap())
        .unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let name = ServerName::try_from("localhost").unwrap();
    let client = rustls::ClientConnection::new(Arc::new(config), name).unwrap();
    let mut stream = rustls::StreamOwned::new(client, connect(&lab.phone_host()));
    while stream.conn.is_handshaking() {
        stream.conn.complete_io(&mut stream.sock).unwrap();
    }
    stream
}

#[test]
fn who_connects_and_says_nothing_is_sent_away() {
    let lab = impatient();
    let soon = Duration::from_secs(20);
    for host in [lab.lab_host(), lab.app_host(), lab.phone_host()] {
        let took = closed_after(&mut connect(&host));
        assert!(took < soon, "{host}: {took:?}");
    }
    // Also after the encryption has been agreed on, and in the middle of a request.
    assert!(closed_after(&mut encrypted(&lab)) < soon);
    let mut half = encrypted(&lab);
    half.write_all(b"GET /p HT").unwrap();
    assert!(closed_after(&mut half) < soon);
}

#[test]
fn a_patient_lab_keeps_a_quiet_client_and_answers_it() {
    let lab = TestLab::start();
    let mut stream = encrypted(&lab);
    std::thread::sleep(Duration::from_millis(700));
    let request = format!(
        "GET /no-such HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n\r\n",
        lab.phone_host()
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    assert!(answer.starts_with("HTTP/1.1 404"), "{answer}");
}

/// HTTP/2 by prior knowledge has no head that must come in time.
#[test]
fn plain_ports_speak_http_1_alone() {
    let lab = TestLab::with_patience(Patience::default());
    for host in [lab.lab_host(), lab.app_host()] {
        let mut stream = connect(&host);
        let empty_settings = [0, 0, 0, 4, 0, 0, 0, 0, 0];
        stream
            .write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
            .unwrap();
        stream.write_all(&empty_settings).unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let text = String::from_utf8_lossy(&answer);
        assert!(
            answer.is_empty() || text.starts_with("HTTP/1.1 4"),
            "{text:?}"
        );
    }
}

/// A head that comes byte by byte is not waited for.
#[test]
fn a_head_that_drips_is_given_up() {
    let lab = TestLab::with_patience(Patience::default());
    let mut stream = connect(&lab.lab_host());
    stream
        .set_read_timeout(Some(Duration::from_millis(500)))
        .unwrap();
    stream
        .write_all(b"GET / HTTP/1.1\r\nHost: x\r\nA: ")
        .unwrap();
    let start = Instant::now();
    let mut byte = [0; 256];
    let closed = loop {
        match stream.read(&mut byte) {
            Ok(0) => break true,
            Ok(_) => {}
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(_) => break true,
        }
        if stream.write_all(b"a").is_err() {
            break true;
        }
        if start.elapsed() > Duration::from_secs(20) {
            break false;
        }
    };
    assert!(closed, "still open after {:?}", start.elapsed());
    assert!(
        start.elapsed() > Duration::from_secs(5),
        "{:?}",
        start.elapsed()
    );
}

#[test]
fn nobody_is_a_device_of_the_labs_own() {
    let lab = TestLab::start();
    for id in ["virtual-1", "replay-walk", "file-walk"] {
        let answer = lab.upload(&batch(id, "s", 0, &[]));
        assert_eq!(answer.status, 400, "{id}");
        assert!(answer.text().contains("kept for the lab's own devices"));
    }
    assert!(lab.status()["devices"].as_array().unwrap().is_empty());
}

#[test]
fn a_sensor_logger_without_an_identifier_is_known_by_its_address() {
    let lab = TestLab::start();
    let message = br#"{"messageId":0,"sessionId":"s","deviceId":"","payload":[
        {"name":"gyroscope","time":1763697600000000000,"values":{"x":0.01,"y":0.0,"z":0.0}}]}"#;
    assert_eq!(lab.upload(message).status, 200);
    let device = lab.device("sensor-logger-127.0.0.1");
    assert_eq!(device["source"], "sensor-logger", "{}", lab.status());
    assert_eq!(lab.device(""), serde_json::Value::Null);
}

#[test]
fn a_full_lab_says_so_to_the_phone() {
    let lab = TestLab::start();
    for k in 0..64 {
        assert_eq!(
            lab.upload(&batch(&format!("phone {k}"), "s", 0, &[]))
                .status,
            200
        );
    }
    let answer = lab.upload(&batch("late", "s", 0, &[]));
    assert_eq!(answer.status, 503);
    let error = answer.json()["error"].as_str().unwrap().to_owned();
    assert!(error.contains("the lab is full"), "{error}");
    assert_eq!(lab.upload(&batch("phone 3", "s", 1, &[])).status, 200);
}

#[test]
fn each_address_has_a_code_of_its_own() {
    let lab = TestLab::start();
    let code = wait_for("the code", || Some(lab.get("/api/qr.svg?url=0")));
    assert!(code.text().contains("<svg") && code.text() == lab.get("/api/qr.svg").text());
    assert_eq!(lab.get("/api/qr.svg?url=1").status, 404);
    assert_eq!(lab.get("/api/qr.svg?url=x").status, 400);
}
