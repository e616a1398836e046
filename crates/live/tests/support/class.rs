//! A class of simulated phones that send to a lab in real time, and a lab page that watches them.
#![allow(dead_code, unreachable_pub)] // every program uses its own part

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use northing_recording::{Event, Sample};
use northing_simulation::sensors::Sampling;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::stream::MaybeTlsStream;
use tokio_tungstenite::tungstenite::{Message, connect};

/// How much of its samples a phone sends at once.
const BATCH: Duration = Duration::from_millis(100);
/// A phone that is asked to wait sends again after so long.
const AGAIN: Duration = Duration::from_millis(50);

/// Who sends, how fast, and for how long.
#[derive(Debug, Clone, Copy)]
pub struct Class {
    pub phones: u64,
    /// Samples a second of each of the three sensors.
    pub rate_hz: f64,
    pub seconds: f64,
}

/// What one phone has sent.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sent {
    pub device: String,
    pub samples: u64,
    pub batches: u64,
    /// Times that it was asked to wait.
    pub again: u64,
}

/// The identity of a phone.
pub fn name(phone: u64) -> String {
    format!("phone-{phone}")
}

impl Class {
    /// Lets all phones send to `path` of `host` until they are done.
    pub fn play(&self, host: &str, path: &str) -> Vec<Sent> {
        thread::scope(|scope| {
            let phones =
                (0..self.phones).map(|phone| scope.spawn(move || self.send(phone, host, path)));
            let phones: Vec<_> = phones.collect();
            phones
                .into_iter()
                .map(|phone| phone.join().expect("a phone that sends"))
                .collect()
        })
    }

    /// The events of one phone that a phone would send.
    fn events(&self, phone: u64) -> impl Iterator<Item = Event> {
        let mut config = VirtualPhoneConfig {
            seed: phone,
            duration_s: Some(self.seconds),
            ..VirtualPhoneConfig::default()
        };
        config.gyroscope.sampling = Sampling::at_rate(self.rate_hz);
        config.accelerometer.sampling = Sampling::at_rate(self.rate_hz);
        config.magnetometer.sampling = Sampling::at_rate(self.rate_hz);
        let is_sent = |event: &Event| {
            matches!(
                event.sample,
                Sample::AngularRate(_) | Sample::SpecificForce(_) | Sample::MagneticField(_)
            )
        };
        let simulated = VirtualPhone::new(config).expect("a phone");
        simulated.events().filter(is_sent)
    }

    /// A batch each 100 ms, as a phone does; phones do not begin at the same moment.
    fn send(&self, phone: u64, host: &str, path: &str) -> Sent {
        let start = Instant::now() + BATCH.mul_f64(phone as f64 / self.phones.max(1) as f64);
        let mut sent = Sent {
            device: name(phone),
            ..Sent::default()
        };
        let mut connection = Connection::open(host);
        let mut events = self.events(phone).peekable();
        while events.peek().is_some() {
            let end = BATCH.as_nanos() as i64 * (sent.batches as i64 + 1);
            let mut batch = Vec::new();
            while let Some(event) = events.next_if(|event| event.time_ns < end) {
                batch.push(event);
            }
            let body = body(&sent.device, sent.batches, &batch);
            let due = start + BATCH * u32::try_from(sent.batches + 1).unwrap_or(u32::MAX);
            thread::sleep(due.saturating_duration_since(Instant::now()));
            while connection.post(host, path, &body).0 != 200 {
                sent.again += 1;
                thread::sleep(AGAIN);
            }
            sent.samples += batch.len() as u64;
            sent.batches += 1;
        }
        sent
    }
}

/// A batch of the phone page with Generic Sensor readings of these events.
fn body(device: &str, seq: u64, events: &[Event]) -> Vec<u8> {
    let rows = |of: fn(&Sample) -> Option<[f64; 3]>| -> Vec<Value> {
        let rows = events.iter().filter_map(|event| {
            let [x, y, z] = of(&event.sample)?;
            Some(json!([event.time_ns as f64 * 1e-6, x, y, z]))
        });
        rows.collect()
    };
    let body = json!({
        "v": 1, "device": device, "name": "", "session": "load", "seq": seq,
        "ua": "load", "platform": "android", "sent_ms": 0.0,
        "gs": {
            "g": rows(|s| match s { Sample::AngularRate(v) => Some((*v).into()), _ => None }),
            "a": rows(|s| match s { Sample::SpecificForce(v) => Some((*v).into()), _ => None }),
            "m": rows(|s| match s { Sample::MagneticField(v) => Some((*v).into()), _ => None }),
        },
    });
    body.to_string().into_bytes()
}

/// One connection that is kept open, as browsers do.
pub struct Connection(Option<BufReader<TcpStream>>);

impl Connection {
    pub fn open(host: &str) -> Self {
        let stream = TcpStream::connect(host).ok();
        if let Some(stream) = &stream {
            // A batch is one packet: waiting for more of it only costs time.
            stream.set_nodelay(true).expect("a socket option");
            let patience = Some(Duration::from_secs(30));
            stream.set_read_timeout(patience).expect("a socket option");
        }
        Self(stream.map(BufReader::new))
    }

    /// Posts a body; status 0 where there was no answer.
    pub fn post(&mut self, host: &str, path: &str, body: &[u8]) -> (u16, Vec<u8>) {
        self.ask(host, "POST", path, body)
    }

    /// Gets a document.
    pub fn get(&mut self, host: &str, path: &str) -> (u16, Vec<u8>) {
        self.ask(host, "GET", path, b"")
    }

    fn ask(&mut self, host: &str, method: &str, path: &str, body: &[u8]) -> (u16, Vec<u8>) {
        let answer = self.exchange(host, method, path, body);
        if answer.is_none() {
            *self = Self::open(host);
        }
        answer.unwrap_or_default()
    }

    fn exchange(
        &mut self,
        host: &str,
        method: &str,
        path: &str,
        body: &[u8],
    ) -> Option<(u16, Vec<u8>)> {
        let reader = self.0.as_mut()?;
        let head = format!(
            "{method} {path} HTTP/1.1\r\nhost: {host}\r\ncontent-length: {}\r\n\r\n",
            body.len()
        );
        let request = [head.as_bytes(), body].concat();
        reader.get_mut().write_all(&request).ok()?;
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let status = line.split(' ').nth(1)?.parse().ok()?;
        let mut length = 0;
        loop {
            line.clear();
            reader.read_line(&mut line).ok()?;
            let Some((name, value)) = line.split_once(':') else {
                break;
            };
            if name.eq_ignore_ascii_case("content-length") {
                length = value.trim().parse().ok()?;
            }
        }
        let mut content = vec![0; length];
        reader.read_exact(&mut content).ok()?;
        Some((status, content))
    }
}

/// What a page saw.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// Frames of each device, and the sensor time of the newest, s.
    pub frames: BTreeMap<String, (u64, f64)>,
    /// Frames that came out of order, or without an estimate after one with it.
    pub disorder: Vec<String>,
}

/// A lab page that watches until it is told to stop.
pub struct Watcher {
    stop: Arc<AtomicBool>,
    page: JoinHandle<Seen>,
}

impl Watcher {
    /// Opens the page of a lab.
    pub fn open(lab_host: &str) -> Self {
        let (mut socket, _) = connect(format!("ws://{lab_host}/api/ws")).expect("a lab page");
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            let patience = Some(Duration::from_millis(200));
            stream.set_read_timeout(patience).expect("a socket option");
        }
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let page = thread::spawn(move || {
            let mut seen = Seen::default();
            while !stopped.load(Ordering::Relaxed) {
                // Without a message for a while the socket says so.
                if let Ok(Message::Text(text)) = socket.read() {
                    seen.take(&text);
                }
            }
            seen
        });
        Self { stop, page }
    }

    /// Closes the page.
    pub fn close(self) -> Seen {
        self.stop.store(true, Ordering::Relaxed);
        self.page.join().expect("a page that watches")
    }
}

impl Seen {
    fn take(&mut self, text: &str) {
        let Ok(message) = serde_json::from_str::<Value>(text) else {
            self.disorder.push(format!("no JSON: {text:.80}"));
            return;
        };
        if message["type"] != "frame" {
            return;
        }
        let device = message["device"].as_str().unwrap_or_default().to_owned();
        let t_s = message["t_s"].as_f64().unwrap_or(f64::NAN);
        let is_estimated = message["estimates"]["mekf"]["q"].is_array();
        let (count, last) = self.frames.entry(device.clone()).or_insert((0, f64::MIN));
        // Without new samples a frame is sent again. A time that is no number is disorder, too.
        let goes_on = t_s >= *last;
        if !goes_on || (*count > 20 && !is_estimated) {
            let what = format!("{device}: {t_s} s after {last} s, estimate: {is_estimated}");
            self.disorder.push(what);
        }
        (*count, *last) = (*count + 1, t_s);
    }
}
