//! One decoder for whatever a device sends: payloads in the order of arrival in, events out.
//!
//! [`WireDecoder`] holds the format's own decoder and, where the format numbers its messages, what
//! puts them in order. It reads no clock: the time of arrival comes with each payload, so the same
//! payloads with the same times give the same events, live or from a file.

use std::str::FromStr;

use serde::de::IgnoredAny;

use super::hyperimu::HyperImu;
use super::linkoping::Linkoping;
use super::phone_page::{Batch, PhonePage};
use super::phyphox::Phyphox;
use super::razor::{Razor, RazorConfig, RazorOutput};
use super::sensor_logger_push::{Push, SensorLoggerPush};
use super::sensorserver::SensorServer;
use super::sensorstreamer::SensorStreamer;
use super::{Decoded, Placed, Resequencer, Tone, WireError, events};

/// A batch of the phone page that is missing is waited for this long, ns: the page sends it again
/// after four seconds at the latest.
const PAGE_WAIT_NS: i64 = 5_000_000_000;
/// While it is waited for, no more batches than this are held.
const PAGE_HELD: usize = 64;

/// What the bytes of a device are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum WireFormat {
    /// Batches of the own phone page: [`super::phone_page`].
    PhonePage,
    /// Messages of Sensor Logger's push: [`super::sensor_logger_push`].
    SensorLogger,
    /// Text frames of SensorServer: [`super::sensorserver`].
    SensorServer,
    /// Bytes of the Sensor Fusion app, cut anywhere: [`super::linkoping`].
    Linkoping,
    /// phyphox's answers to `/config` and `/get`: [`super::phyphox`].
    Phyphox,
    /// Text lines of a Razor board, cut anywhere: [`super::razor`].
    Razor,
    /// Binary frames of a Razor board, cut anywhere.
    RazorBinary,
    /// Whole lines of HyperIMU, one or more a payload: [`super::hyperimu`].
    HyperImu,
    /// Bytes of SensorStreamer, cut anywhere: [`super::sensorstreamer`].
    SensorStreamer,
    /// Our own events: [`super::events`].
    Events,
}

impl WireFormat {
    /// Every format.
    pub const ALL: [Self; 10] = [
        Self::PhonePage,
        Self::SensorLogger,
        Self::SensorServer,
        Self::Linkoping,
        Self::Phyphox,
        Self::Razor,
        Self::RazorBinary,
        Self::HyperImu,
        Self::SensorStreamer,
        Self::Events,
    ];

    /// The name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PhonePage => "phone-page",
            Self::SensorLogger => "sensor-logger",
            Self::SensorServer => "sensorserver",
            Self::Linkoping => "linkoping",
            Self::Phyphox => "phyphox",
            Self::Razor => "razor",
            Self::RazorBinary => "razor-binary",
            Self::HyperImu => "hyperimu",
            Self::SensorStreamer => "sensorstreamer",
            Self::Events => "events",
        }
    }

    /// Whether each payload is one JSON object.
    #[must_use]
    pub const fn is_json(self) -> bool {
        matches!(
            self,
            Self::PhonePage | Self::SensorLogger | Self::SensorServer | Self::Phyphox
        )
    }
}

impl FromStr for WireFormat {
    type Err = WireError;

    fn from_str(name: &str) -> Result<Self, WireError> {
        let found = Self::ALL.into_iter().find(|format| format.name() == name);
        found.ok_or_else(|| {
            let name = crate::error::shown(name);
            WireError::new(format!("this version does not know the format `{name}`"))
        })
    }
}

/// The decoder of one device. See the [module](self).
#[derive(Debug, Clone)]
pub struct WireDecoder {
    format: WireFormat,
    state: State,
    name: String,
    sessions: u64,
    last_arrival_ns: i64,
    /// Of sessions that are over.
    lost_before: u64,
    duplicated_before: u64,
}

#[derive(Debug, Clone)]
enum State {
    Page(Option<Box<PageLoad>>),
    SensorLogger(Box<SensorLoggerPush>),
    SensorServer(Box<SensorServer>),
    Linkoping(Box<Linkoping>),
    Phyphox(Box<Phyphox>),
    Razor(Box<Razor>),
    HyperImu(Box<HyperImu>),
    SensorStreamer(Box<SensorStreamer>),
    Events,
}

/// One page load has its own clock and its own numbers.
#[derive(Debug, Clone)]
struct PageLoad {
    session: String,
    decoder: PhonePage,
    order: Resequencer<Batch>,
}

impl PageLoad {
    fn new(session: &str) -> Self {
        Self {
            session: session.to_owned(),
            decoder: PhonePage::new(),
            order: Resequencer::new(PAGE_WAIT_NS, PAGE_HELD),
        }
    }

    fn decode(&mut self, batches: Vec<Batch>) -> Decoded {
        let mut out = Decoded::default();
        for batch in batches {
            let hidden = batch.page_events.iter().any(|event| event.kind == "hidden");
            out.append(self.decoder.decode(&batch));
            if hidden {
                out.note(
                    Tone::Warning,
                    "The page on the phone is hidden: its sensors pause.",
                );
            }
        }
        out
    }
}

impl WireDecoder {
    /// A decoder for a device from which nothing has come yet.
    #[must_use]
    pub fn new(format: WireFormat) -> Self {
        let razor = |output| {
            State::Razor(Box::new(Razor::new(RazorConfig {
                output,
                ..RazorConfig::default()
            })))
        };
        let state = match format {
            WireFormat::PhonePage => State::Page(None),
            WireFormat::SensorLogger => State::SensorLogger(Box::default()),
            WireFormat::SensorServer => State::SensorServer(Box::default()),
            WireFormat::Linkoping => State::Linkoping(Box::default()),
            WireFormat::Phyphox => State::Phyphox(Box::default()),
            WireFormat::Razor => razor(RazorOutput::Text),
            WireFormat::RazorBinary => razor(RazorOutput::BinarySensors),
            WireFormat::HyperImu => State::HyperImu(Box::default()),
            WireFormat::SensorStreamer => State::SensorStreamer(Box::default()),
            WireFormat::Events => State::Events,
        };
        Self {
            format,
            state,
            name: String::new(),
            sessions: 0,
            last_arrival_ns: 0,
            lost_before: 0,
            duplicated_before: 0,
        }
    }

    /// Decodes what a payload that arrived at `arrival_ns` (any clock that does not go back) makes
    /// ready: itself, others that waited for it, or nothing yet.
    ///
    /// # Errors
    /// A line for whoever sent it when nothing of the payload can be used; the decoder is as before.
    pub fn accept(&mut self, payload: &[u8], arrival_ns: i64) -> Result<Decoded, WireError> {
        self.sessions = self.sessions.max(1);
        self.last_arrival_ns = arrival_ns;
        match &mut self.state {
            State::Page(_) => {
                let batch = Batch::parse(payload)?;
                Ok(self.page(batch, arrival_ns))
            }
            State::SensorLogger(decoder) => {
                let push = Push::parse(payload)?;
                if decoder.is_other_session(&push) {
                    self.sessions += 1;
                }
                Ok(decoder.accept(push))
            }
            State::Phyphox(decoder) => {
                if is_phyphox_config(payload) {
                    **decoder = Phyphox::from_config(payload)?;
                    return Ok(Decoded::default());
                }
                Ok(decoder.push(payload))
            }
            State::SensorServer(decoder) => Ok(decoder.push(payload)),
            State::Linkoping(decoder) => Ok(decoder.push(payload)),
            State::Razor(decoder) => Ok(decoder.push(payload)),
            State::HyperImu(decoder) => Ok(decoder.push_datagram(payload)),
            State::SensorStreamer(decoder) => Ok(decoder.push(payload)),
            State::Events => Ok(Decoded {
                events: events::decode(payload)?,
                ..Decoded::default()
            }),
        }
    }

    fn page(&mut self, batch: Batch, arrival_ns: i64) -> Decoded {
        if !batch.name.is_empty() {
            batch.name.clone_into(&mut self.name);
        }
        let State::Page(page) = &mut self.state else {
            return Decoded::default();
        };
        let mut out = Decoded::default();
        if let Some(old) = page.take_if(|page| page.session != batch.session) {
            let mut old = old;
            let rest = old.order.flush();
            out.append(old.decode(rest));
            self.lost_before += old.order.lost();
            self.duplicated_before += old.order.duplicated();
            self.sessions += 1;
        }
        let page = page.get_or_insert_with(|| Box::new(PageLoad::new(&batch.session)));
        match page.order.push(batch.seq, arrival_ns, batch) {
            Placed::Ready(ready) => out.append(page.decode(ready)),
            Placed::Late(late) => {
                let mut decoded = page.decode(vec![late]);
                decoded.late = std::mem::take(&mut decoded.events);
                out.append(decoded);
            }
            Placed::Duplicate => {}
        }
        out
    }

    /// Decodes what has waited long enough at `now_ns`; `None` when there is nothing of the kind.
    pub fn poll(&mut self, now_ns: i64) -> Option<Decoded> {
        match &mut self.state {
            State::Page(Some(page)) => {
                let ready = page.order.poll(now_ns);
                (!ready.is_empty()).then(|| page.decode(ready))
            }
            // Its messages wait in the readings' time, which stands still when nothing comes.
            State::SensorLogger(decoder) => {
                let silent = now_ns.saturating_sub(self.last_arrival_ns) >= PAGE_WAIT_NS;
                (silent && decoder.waiting() > 0).then(|| decoder.flush())
            }
            _ => None,
        }
    }

    /// Decodes what still waits: the stream has ended.
    pub fn finish(&mut self) -> Decoded {
        match &mut self.state {
            State::Page(Some(page)) => {
                let rest = page.order.flush();
                page.decode(rest)
            }
            State::SensorLogger(decoder) => decoder.flush(),
            _ => Decoded::default(),
        }
    }

    /// What it decodes.
    #[must_use]
    pub const fn format(&self) -> WireFormat {
        self.format
    }

    /// The name that the person gave the device; empty while unknown.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How often a clock began: page loads, recordings of an app. 0 before the first payload.
    #[must_use]
    pub const fn sessions(&self) -> u64 {
        self.sessions
    }

    /// Messages that never came.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost_before
            + match &self.state {
                State::Page(Some(page)) => page.order.lost(),
                State::SensorLogger(decoder) => decoder.lost(),
                _ => 0,
            }
    }

    /// Messages that came more than once.
    #[must_use]
    pub fn duplicated(&self) -> u64 {
        self.duplicated_before
            + match &self.state {
                State::Page(Some(page)) => page.order.duplicated(),
                State::SensorLogger(decoder) => decoder.duplicated(),
                _ => 0,
            }
    }
}

/// Whether it is the answer to `/config` rather than to `/get`.
fn is_phyphox_config(answer: &[u8]) -> bool {
    #[derive(serde::Deserialize)]
    struct Shape {
        inputs: Option<IgnoredAny>,
        buffer: Option<IgnoredAny>,
    }
    let shape = serde_json::from_slice::<Shape>(answer);
    shape.is_ok_and(|shape| shape.inputs.is_some() && shape.buffer.is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Event, Sample};

    fn page(session: &str, seq: u64, time_ms: u64) -> Vec<u8> {
        format!(
            r#"{{"v":1,"device":"d","name":"Anna","session":"{session}","seq":{seq},"gs":{{"g":[[{time_ms},0.1,0,0]]}}}}"#
        )
        .into_bytes()
    }

    fn stamps_ms(decoded: &Decoded) -> Vec<i64> {
        decoded
            .events
            .iter()
            .map(|e| e.time_ns / 1_000_000)
            .collect()
    }

    #[test]
    fn page_batches_come_in_order_once_and_gaps_are_given_up_by_poll() {
        let mut decoder = WireDecoder::new(WireFormat::PhonePage);
        let mut at = |seq: u64, arrival_ns: i64| {
            let decoded = decoder.accept(&page("s", seq, 10 * (seq + 1)), arrival_ns);
            stamps_ms(&decoded.unwrap())
        };
        assert_eq!(at(0, 0), [10]);
        assert_eq!(at(2, 1), [0; 0]);
        assert_eq!(at(2, 2), [0; 0]);
        assert_eq!(at(1, 3), [20, 30]);
        assert_eq!(at(4, 4), [0; 0]);
        assert_eq!(decoder.poll(PAGE_WAIT_NS), None);
        let given_up = decoder.poll(PAGE_WAIT_NS + 4).unwrap();
        assert_eq!(stamps_ms(&given_up), [50]);
        let late = decoder.accept(&page("s", 3, 40), PAGE_WAIT_NS + 5).unwrap();
        assert_eq!((late.events.len(), late.late.len()), (0, 1));
        assert_eq!((decoder.lost(), decoder.duplicated()), (0, 1));
        assert_eq!((decoder.name(), decoder.sessions()), ("Anna", 1));
    }

    #[test]
    fn another_page_load_begins_anew_and_what_waited_is_not_lost() {
        let mut decoder = WireDecoder::new(WireFormat::PhonePage);
        let accept = |decoder: &mut WireDecoder, session, seq, time_ms| {
            stamps_ms(&decoder.accept(&page(session, seq, time_ms), 0).unwrap())
        };
        assert_eq!(accept(&mut decoder, "a", 0, 500), [500]);
        assert_eq!(accept(&mut decoder, "a", 2, 700), [0; 0]);
        assert_eq!(accept(&mut decoder, "b", 0, 1), [700, 1]);
        assert_eq!(accept(&mut decoder, "b", 0, 1), [0; 0]);
        assert_eq!(decoder.sessions(), 2);
        assert_eq!((decoder.lost(), decoder.duplicated()), (1, 1));
    }

    #[test]
    fn a_message_of_sensor_logger_that_waits_is_taken_when_nothing_else_comes() {
        let mut decoder = WireDecoder::new(WireFormat::SensorLogger);
        let push = |id: u64| {
            format!(
                r#"{{"messageId":{id},"sessionId":"s","deviceId":"d","payload":[{{"name":"gyroscope","time":{},"values":{{"x":0,"y":0,"z":0}}}}]}}"#,
                id * 1_000_000
            )
        };
        assert_eq!(
            stamps_ms(&decoder.accept(push(0).as_bytes(), 0).unwrap()),
            [0]
        );
        assert!(
            decoder
                .accept(push(2).as_bytes(), 5)
                .unwrap()
                .events
                .is_empty()
        );
        assert_eq!(decoder.poll(PAGE_WAIT_NS), None);
        assert_eq!(stamps_ms(&decoder.poll(PAGE_WAIT_NS + 5).unwrap()), [2]);
        assert_eq!(decoder.lost(), 1);
        assert_eq!(decoder.poll(2 * PAGE_WAIT_NS + 5), None);
    }

    #[test]
    fn what_is_refused_changes_nothing() {
        let mut decoder = WireDecoder::new(WireFormat::PhonePage);
        assert!(decoder.accept(b"{", 0).is_err());
        assert_eq!(decoder.accept(&page("a", 0, 1), 0).unwrap().events.len(), 1);
        let mut decoder = WireDecoder::new(WireFormat::Events);
        assert!(decoder.accept(b"x", 0).is_err());
        let event = Event {
            time_ns: 1,
            sample: Sample::Pressure(2.0),
        };
        let decoded = decoder.accept(&events::encode(&[event]), 0).unwrap();
        assert_eq!(decoded.events, [event]);
    }

    #[test]
    fn every_format_has_its_name_and_takes_any_bytes() {
        for format in WireFormat::ALL {
            assert_eq!(format.name().parse(), Ok(format));
            let mut decoder = WireDecoder::new(format);
            for bytes in [&b""[..], b"{}", b"\xff\x00\n", b"1,2,3\n", b"[]"] {
                let _ = decoder.accept(bytes, i64::MAX);
                let _ = decoder.poll(i64::MIN);
            }
            decoder.finish();
        }
        assert!("telepathy".parse::<WireFormat>().is_err());
    }

    #[test]
    fn phyphox_takes_its_configuration_from_the_same_stream() {
        let mut decoder = WireDecoder::new(WireFormat::Phyphox);
        let config = br#"{"inputs":[{"source":"gyroscope","outputs":[{"x":"a"},{"y":"b"},{"z":"c"},{"t":"d"}]}],"buffers":[]}"#;
        assert_eq!(decoder.accept(config, 0).unwrap(), Decoded::default());
        let answer = br#"{"buffer":{"a":{"buffer":[1]},"b":{"buffer":[2]},"c":{"buffer":[3]},"d":{"buffer":[0.5]}},"status":{}}"#;
        let decoded = decoder.accept(answer, 0).unwrap();
        assert_eq!(stamps_ms(&decoded), [500]);
        assert!(decoder.accept(br#"{"inputs":[]}"#, 0).is_err());
    }
}
