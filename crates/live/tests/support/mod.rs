//! A lab on free ports, and a client of few words: HTTP over plain sockets, WebSockets.
#![allow(dead_code, unreachable_pub)] // every test file uses its own part

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use northing_live::connections::Patience;
use northing_live::server::{LiveConfig, Running, start};
use northing_recording::{Event, Sample};
use serde_json::{Value, json};

/// A lab that runs on a runtime of its own.
pub struct TestLab {
    pub runtime: tokio::runtime::Runtime,
    pub running: Running,
    pub data: tempfile::TempDir,
}

/// An answer: status and body.
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn json(&self) -> Value {
        let text = String::from_utf8_lossy(&self.body);
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }

    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

impl TestLab {
    pub fn start() -> Self {
        Self::with_patience(Patience::default())
    }

    /// A lab on a folder for data of before.
    pub fn start_with(data: tempfile::TempDir) -> Self {
        Self::start_in(data, Patience::default(), true)
    }

    /// A lab with a link for a teacher elsewhere, on a folder for data.
    pub fn start_with_teacher(data: tempfile::TempDir) -> Self {
        Self::start_as(data, Patience::default(), true, true)
    }

    /// A lab that records nothing.
    pub fn start_without_recording(data: tempfile::TempDir) -> Self {
        Self::start_in(data, Patience::default(), false)
    }

    /// A lab that keeps silent connections for so long.
    pub fn with_patience(patience: Patience) -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), patience, true)
    }

    fn start_in(data: tempfile::TempDir, patience: Patience, records: bool) -> Self {
        Self::start_as(data, patience, records, false)
    }

    fn start_as(
        data: tempfile::TempDir,
        patience: Patience,
        records: bool,
        teacher_link: bool,
    ) -> Self {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let config = LiveConfig {
            port: 0,
            data_dir: data.path().to_owned(),
            certificate: None,
            web_dir: None,
            network: false,
            patience,
            recordings: records.then(|| data.path().join("recordings")),
            options: RunOptions::new(EstimatorKind::Mekf, Profile::Lab),
            teacher_link,
            ..LiveConfig::default()
        };
        let running = runtime.block_on(start(config)).unwrap();
        Self {
            runtime,
            running,
            data,
        }
    }

    /// `127.0.0.1:PORT` of the lab page.
    pub fn lab_host(&self) -> String {
        host(&self.running.lab_url)
    }

    /// `127.0.0.1:PORT` of the apps' listener.
    pub fn app_host(&self) -> String {
        host(&self.running.ingest_urls[0])
    }

    /// `127.0.0.1:PORT` of the phones' listener.
    pub fn phone_host(&self) -> String {
        host(&self.running.phone_urls[0])
    }

    pub fn token(&self) -> &str {
        self.running.token.as_str()
    }

    /// Uploads a body as a native app does.
    pub fn upload(&self, body: &[u8]) -> Answer {
        let path = format!("/in/{}", self.token());
        request(&self.app_host(), "POST", &path, &[], body)
    }

    pub fn get(&self, path: &str) -> Answer {
        request(&self.lab_host(), "GET", path, &[], b"")
    }

    pub fn status(&self) -> Value {
        self.get("/api/status").json()
    }

    /// One device of the status.
    pub fn device(&self, id: &str) -> Value {
        let status = self.status();
        let devices = status["devices"].as_array().unwrap();
        devices
            .iter()
            .find(|d| d["id"] == id)
            .cloned()
            .unwrap_or_default()
    }
}

fn host(url: &str) -> String {
    let after = url.split_once("://").unwrap().1;
    after.split('/').next().unwrap().to_owned()
}

/// One request on a connection of its own. A header given replaces the usual one.
pub fn request(
    host: &str,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &[u8],
) -> Answer {
    let stream = TcpStream::connect(host).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(30)))
        .unwrap();
    exchange(stream, host, method, path, headers, body)
}

/// One request on a connection that ends with the answer.
pub fn exchange(
    mut stream: impl Read + Write,
    host: &str,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &[u8],
) -> Answer {
    let mut head = format!(
        "{method} {path} HTTP/1.1\r\nconnection: close\r\ncontent-length: {}\r\n",
        body.len()
    );
    if !headers.iter().any(|(name, _)| *name == "host") {
        head.push_str(&format!("host: {host}\r\n"));
    }
    for (name, value) in headers {
        head.push_str(&format!("{name}: {value}\r\n"));
    }
    head.push_str("\r\n");
    stream.write_all(head.as_bytes()).unwrap();
    // A server that refuses early may close before it has read everything.
    let _ = stream.write_all(body);
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes);
    let end = bytes
        .windows(4)
        .position(|w| w == b"\r\n\r\n")
        .expect("an answer");
    let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    Answer {
        status,
        head,
        body: bytes[end + 4..].to_vec(),
    }
}

/// A batch of the phone page with Generic Sensor readings of these events.
pub fn batch(device: &str, session: &str, seq: u64, events: &[Event]) -> Vec<u8> {
    let rows = |of: fn(&Sample) -> Option<[f64; 3]>| -> Vec<Value> {
        let rows = events.iter().filter_map(|event| {
            let [x, y, z] = of(&event.sample)?;
            Some(json!([event.time_ns as f64 * 1e-6, x, y, z]))
        });
        rows.collect()
    };
    let body = json!({
        "v": 1, "device": device, "name": "", "session": session, "seq": seq,
        "ua": "test", "platform": "android", "sent_ms": 0.0,
        "gs": {
            "g": rows(|s| match s { Sample::AngularRate(v) => Some((*v).into()), _ => None }),
            "a": rows(|s| match s { Sample::SpecificForce(v) => Some((*v).into()), _ => None }),
            "m": rows(|s| match s { Sample::MagneticField(v) => Some((*v).into()), _ => None }),
        },
    });
    body.to_string().into_bytes()
}

/// Waits until `ready` gives something.
pub fn wait_for<T>(what: &str, mut ready: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(value) = ready() {
            return value;
        }
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "waited a minute for {what}"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}
