//! What all inputs share: saying how they are, delivering payloads at a bearable pace, trying again.

use std::convert::Infallible;
use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use northing_recording::wire::WireFormat;

use super::spec::{Address, InputKind, InputSpec};
use super::{InputState, Inputs};
use crate::device::Work;
use crate::lab::{Device, lock};

/// Below this rate the person is told what to change, Hz.
const SLOW_HZ: f64 = 20.0;
/// How often an input says how it is.
const SAY_INTERVAL: Duration = Duration::from_secs(1);
/// First and longest pause before the next attempt.
const PAUSES: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(8)];
/// Payloads and bytes that one device delivers in [`WINDOW`]; whoever sends more is throttled.
const MOST_PAYLOADS: u32 = 300;
const MOST_BYTES: usize = 400_000;
const WINDOW: Duration = Duration::from_millis(100);

/// An input as its own task sees it.
#[derive(Debug)]
pub(super) struct Link {
    inputs: Arc<Inputs>,
    id: String,
    spec: InputSpec,
}

impl Link {
    pub(super) fn new(inputs: Arc<Inputs>, id: String, spec: InputSpec) -> Self {
        Self { inputs, id, spec }
    }

    pub(super) fn kind(&self) -> InputKind {
        self.spec.kind
    }

    pub(super) fn address(&self) -> &Address {
        &self.spec.address
    }

    /// Where phones reach this computer, if they may.
    pub(super) fn reach(&self) -> Option<&crate::addresses::Reach> {
        self.inputs.reach.as_deref()
    }

    pub(super) fn connecting(&self, what: &str) {
        let text = format!("{what} {}", self.spec.address);
        self.say(InputState::Connecting, text);
    }

    pub(super) fn say(&self, state: InputState, text: impl Into<String>) {
        self.inputs.say(&self.id, state, text.into());
    }

    /// A feed into the device `of`, which is named after the input's kind.
    pub(super) fn feed(&self, of: &str) -> Feed {
        let kind = self.spec.kind;
        Feed {
            inputs: self.inputs.clone(),
            device_id: format!("{}-{of}", kind.name()),
            name: format!("{} {}", kind.title(), short(of)),
            source: kind.name(),
            format: kind.format(),
            window: Instant::now(),
            payloads: 0,
            bytes: 0,
            throttled: false,
            told: None,
        }
    }
}

/// What tells a device from others in few letters: of a serial line neither folder nor speed.
fn short(of: &str) -> &str {
    let line = of.split('@').next().unwrap_or(of);
    line.rsplit('/').next().unwrap_or(line)
}

/// Delivers the payloads of one device.
#[derive(Debug)]
pub(super) struct Feed {
    inputs: Arc<Inputs>,
    device_id: String,
    name: String,
    source: &'static str,
    format: WireFormat,
    window: Instant,
    payloads: u32,
    bytes: usize,
    throttled: bool,
    told: Option<Instant>,
}

impl Feed {
    /// Hands a payload to the device and waits until there is room for it: while it waits nothing is
    /// read, and the sender is throttled by the network.
    ///
    /// # Errors
    /// There is no device for it: in a sentence.
    pub(super) async fn give(&mut self, bytes: Bytes) -> Result<(), String> {
        self.pace(bytes.len()).await;
        let work = self.work(bytes);
        self.device()?.give(work).await
    }

    /// Hands over a payload if there is room for it; for senders that cannot be throttled.
    pub(super) fn try_give(&mut self, bytes: Bytes) -> bool {
        let now = Instant::now();
        if now.duration_since(self.window) >= WINDOW {
            (self.window, self.payloads, self.bytes) = (now, 0, 0);
        }
        self.payloads += 1;
        self.bytes += bytes.len();
        let length = bytes.len();
        let work = self.work(bytes);
        let in_time = self.payloads <= MOST_PAYLOADS && self.bytes <= MOST_BYTES;
        let given = in_time
            && self
                .device()
                .is_ok_and(|device| device.try_give(work, length).is_ok());
        self.throttled |= !given;
        given
    }

    fn work(&self, bytes: Bytes) -> Work {
        Work::Payload {
            format: self.format,
            bytes,
            arrival_ns: self.inputs.lab.now_ns(),
            reply: None,
        }
    }

    fn device(&self) -> Result<Arc<Device>, String> {
        let device = self
            .inputs
            .lab
            .device(&self.device_id, &self.name, self.source)?;
        if device.source == self.source {
            return Ok(device);
        }
        let id = &self.device_id;
        Err(format!(
            "the name `{id}` is taken by another kind of device"
        ))
    }

    /// Waits while more has come than one device may send.
    pub(super) async fn pace(&mut self, bytes: usize) {
        let since = self.window.elapsed();
        if since >= WINDOW {
            (self.window, self.payloads, self.bytes) = (Instant::now(), 0, 0);
        } else if self.payloads >= MOST_PAYLOADS || self.bytes >= MOST_BYTES {
            self.throttled = true;
            tokio::time::sleep(WINDOW.saturating_sub(since)).await;
            (self.window, self.payloads, self.bytes) = (Instant::now(), 0, 0);
        }
        self.payloads += 1;
        self.bytes += bytes;
    }

    /// How it delivers, in words, once a second; `None` in between.
    pub(super) fn news(&mut self) -> Option<String> {
        if self.told.is_some_and(|told| told.elapsed() < SAY_INTERVAL) {
            return None;
        }
        self.told = Some(Instant::now());
        let device = self.inputs.lab.find(&self.device_id).ok()?;
        let rate = lock(&device.status)
            .session
            .rates_hz
            .get("gyroscope")
            .copied();
        let mut text = match rate {
            None => "connected; no gyroscope sample yet".to_owned(),
            Some(rate) if rate < SLOW_HZ => format!(
                "connected, but only {rate:.0} gyroscope samples a second: {}",
                self.advice()
            ),
            // In coarse steps, so that it is news only when something changes.
            Some(rate) => format!(
                "connected: about {:.0} gyroscope samples a second",
                (rate / 10.0).round() * 10.0
            ),
        };
        if std::mem::take(&mut self.throttled) {
            text.push_str("; it sends more than the lab takes and is throttled");
        }
        Some(text)
    }

    fn advice(&self) -> &'static str {
        match self.format {
            WireFormat::SensorServer => {
                "set the sampling rate to 10000 microseconds in SensorServer's settings and connect again"
            }
            WireFormat::Phyphox => "choose the fastest sensor rate in the phyphox experiment",
            WireFormat::Razor | WireFormat::NorthingSerial => {
                "check the board's output and the line's speed"
            }
            _ => "choose the fastest sensor rate in the app",
        }
    }
}

/// How an attempt ends: it ends only by an error, in words.
pub(super) type Ended = Result<Infallible, String>;

/// Longer and longer pauses between attempts.
#[derive(Debug)]
pub(super) struct BackOff {
    pause: Duration,
}

impl Default for BackOff {
    fn default() -> Self {
        Self { pause: PAUSES[0] }
    }
}

impl BackOff {
    /// Says why the last attempt ended, and waits before the next; not long where it had `delivered`.
    pub(super) async fn wait(&mut self, link: &Link, why: &str, delivered: bool) {
        if delivered {
            self.pause = PAUSES[0];
        }
        let text = format!("{}; trying again", why.trim_end_matches('.'));
        link.say(InputState::Failed, text);
        tokio::time::sleep(self.pause).await;
        self.pause = (self.pause * 2).min(PAUSES[1]);
    }
}

/// An error of the network in words.
pub(super) fn in_words(error: &io::Error, address: &Address) -> String {
    match error.kind() {
        io::ErrorKind::ConnectionRefused => format!(
            "{address} refuses the connection: is the app's server started, and is the address right?"
        ),
        io::ErrorKind::TimedOut => not_reached(address),
        io::ErrorKind::HostUnreachable | io::ErrorKind::NetworkUnreachable => {
            format!("{address} cannot be reached: are phone and computer in the same network?")
        }
        io::ErrorKind::ConnectionReset
        | io::ErrorKind::BrokenPipe
        | io::ErrorKind::ConnectionAborted
        | io::ErrorKind::UnexpectedEof => format!("{address} broke the connection off"),
        _ => format!("{address}: {error}"),
    }
}

/// Nobody answered in time.
pub(super) fn not_reached(address: &Address) -> String {
    format!(
        "{address} does not answer: are phone and computer in the same network, and does it let them talk?"
    )
}

/// Cuts a stream into whole lines; what a broken connection left unfinished is never used.
#[derive(Debug, Default)]
pub(super) struct LineCutter {
    rest: Vec<u8>,
    /// Bytes left out because no line ended.
    pub(super) left_out: usize,
}

impl LineCutter {
    /// No line of any app is longer, bytes.
    const LONGEST: usize = 8192;

    /// The whole lines so far, their ends included; empty while there is none.
    pub(super) fn push(&mut self, bytes: &[u8]) -> Bytes {
        let Some(end) = bytes.iter().rposition(|&byte| byte == b'\n') else {
            self.rest.extend_from_slice(bytes);
            if self.rest.len() > Self::LONGEST {
                self.left_out += self.rest.len();
                self.rest.clear();
            }
            return Bytes::new();
        };
        let mut lines = std::mem::take(&mut self.rest);
        lines.extend_from_slice(&bytes[..=end]);
        self.rest.extend_from_slice(&bytes[end + 1..]);
        lines.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_whole_and_endless_ones_are_dropped() {
        let mut cutter = LineCutter::default();
        assert!(cutter.push(b"ab").is_empty());
        assert_eq!(cutter.push(b"c\nd\ne"), "abc\nd\n");
        assert_eq!(cutter.push(b"\n"), "e\n");
        for _ in 0..1000 {
            assert!(cutter.push(&[b'x'; 100]).is_empty());
            assert!(cutter.rest.len() <= LineCutter::LONGEST);
        }
        assert!(cutter.left_out > 90_000);
        assert!(cutter.push(b"\n").len() <= LineCutter::LONGEST + 1);
        assert_eq!(cutter.push(b"good\n"), "good\n");
    }
}
