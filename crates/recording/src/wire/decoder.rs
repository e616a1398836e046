//! One decoder for whatever a device sends: payloads in the order of arrival in, events out.
//!
//! [`WireDecoder`] holds the format's own decoder and, where the format numbers its messages, what
//! puts them in order. It reads no clock: the time of arrival comes with each payload, so the same
//! payloads with the same times give the same events, live or from a file.

use std::collections::VecDeque;
use std::str::FromStr;

use serde::de::IgnoredAny;

use super::hyperimu::HyperImu;
use super::linkoping::Linkoping;
use super::northing_serial::{Axes, NorthingSerial};
use super::phone_page::{Batch, PhonePage};
use super::phyphox::Phyphox;
use super::razor::{Razor, RazorConfig, RazorOutput};
use super::sensor_logger_push::{Push, SensorLoggerPush};
use super::sensorserver::SensorServer;
use super::sensorstreamer::SensorStreamer;
use super::{Decoded, Placed, Resequencer, WireError, events};
use crate::options::named;

/// A batch of the phone page that is missing is waited for this long, ns: the page sends it again
/// after four seconds at the latest.
const PAGE_WAIT_NS: i64 = 5_000_000_000;
/// While it is waited for, no more batches than this are held.
const PAGE_HELD: usize = 64;
/// Of two pages with one identifier the one that sent last is accepted until it has been silent for
/// this long, ns.
const PAGE_SILENT_NS: i64 = 3_000_000_000;
/// So many batches of the other one in a row, and none of this one, show that it has gone on alone.
const PAGE_RETURNS: u32 = 3;
/// Page loads that are remembered.
const MOST_PAGE_LOADS: usize = 8;

named! {
    /// What the bytes of a device are.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub enum WireFormat {
        /// Batches of the own phone page: [`super::phone_page`].
        PhonePage = "phone-page",
        /// Messages of Sensor Logger's push: [`super::sensor_logger_push`].
        SensorLogger = "sensor-logger",
        /// Text frames of SensorServer: [`super::sensorserver`].
        SensorServer = "sensorserver",
        /// Bytes of the Sensor Fusion app, cut anywhere: [`super::linkoping`].
        Linkoping = "linkoping",
        /// phyphox's answers to `/config` and `/get`: [`super::phyphox`].
        Phyphox = "phyphox",
        /// Text lines of a Razor board, cut anywhere: [`super::razor`].
        Razor = "razor",
        /// Binary frames of a Razor board, cut anywhere.
        RazorBinary = "razor-binary",
        /// Whole lines of HyperIMU, one or more a payload: [`super::hyperimu`].
        HyperImu = "hyperimu",
        /// Bytes of SensorStreamer, cut anywhere: [`super::sensorstreamer`].
        SensorStreamer = "sensorstreamer",
        /// Sentences of a board with our firmware, cut anywhere: [`super::northing_serial`].
        NorthingSerial = "northing-serial",
        /// Our own events: [`super::events`].
        Events = "events",
    }
}

impl WireFormat {
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

/// The decoder of one device.
#[derive(Debug, Clone)]
pub struct WireDecoder {
    format: WireFormat,
    state: State,
    name: String,
    sessions: u64,
    /// Page loads that another one has followed; the newest last.
    ended: VecDeque<Box<PageLoad>>,
    /// Batches of one of those since the current page's last one.
    returns: u32,
    last_arrival_ns: i64,
    /// Of sessions that are forgotten.
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
    NorthingSerial(Box<NorthingSerial>),
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
            decoder: PhonePage::default(),
            order: Resequencer::new(PAGE_WAIT_NS, PAGE_HELD),
        }
    }

    /// What a batch brings: itself and those that waited for it.
    fn place(&mut self, batch: Batch, arrival_ns: i64) -> Decoded {
        match self.order.push(batch.seq, arrival_ns, batch) {
            Placed::Ready(ready) => self.decode(ready),
            Placed::Late(late) => {
                let mut decoded = self.decode(vec![late]);
                decoded.late = std::mem::take(&mut decoded.events);
                decoded
            }
            Placed::Duplicate => Decoded::default(),
        }
    }

    fn decode(&mut self, batches: Vec<Batch>) -> Decoded {
        let mut out = Decoded::default();
        for batch in batches {
            let hidden = batch.page_events.iter().any(|event| event.kind == "hidden");
            out.append(self.decoder.decode(&batch));
            if hidden {
                out.warn("The page on the phone was hidden: its sensors pause meanwhile.");
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
            WireFormat::NorthingSerial => {
                State::NorthingSerial(Box::new(NorthingSerial::new(Axes::Phone)))
            }
            WireFormat::Events => State::Events,
        };
        Self {
            format,
            state,
            name: String::new(),
            sessions: 0,
            ended: VecDeque::new(),
            returns: 0,
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
                self.last_arrival_ns = arrival_ns;
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
            State::NorthingSerial(decoder) => Ok(decoder.push(payload)),
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
        let is_current = page.as_ref().is_none_or(|p| p.session == batch.session);
        let silent = arrival_ns.saturating_sub(self.last_arrival_ns) >= PAGE_SILENT_NS;
        let ended = self.ended.iter().position(|p| p.session == batch.session);
        self.returns = if is_current { 0 } else { self.returns + 1 };
        if let Some(old) = ended.and_then(|at| self.ended.get_mut(at))
            && !silent
            && self.returns < PAGE_RETURNS
        {
            // The last of a page that was loaded anew: the clock is another one's by now.
            let mut out = old.place(batch, arrival_ns);
            out.late.append(&mut out.events);
            return out;
        }
        self.last_arrival_ns = arrival_ns;
        let mut out = Decoded::default();
        if !is_current {
            out = self.turn_to(ended);
        }
        if let State::Page(page) = &mut self.state {
            let page = page.get_or_insert_with(|| Box::new(PageLoad::new(&batch.session)));
            out.append(page.place(batch, arrival_ns));
        }
        out
    }

    /// Ends the current page load; the one at `ended` goes on, or a new one may begin.
    fn turn_to(&mut self, ended: Option<usize>) -> Decoded {
        let mut out = Decoded::default();
        let State::Page(page) = &mut self.state else {
            return out;
        };
        self.returns = 0;
        self.sessions += 1;
        if let Some(mut old) = page.take() {
            let rest = old.order.flush();
            out = old.decode(rest);
            self.ended.push_back(old);
        }
        *page = ended.and_then(|at| self.ended.remove(at));
        if self.ended.len() > MOST_PAGE_LOADS
            && let Some(forgotten) = self.ended.pop_front()
        {
            self.lost_before += forgotten.order.lost();
            self.duplicated_before += forgotten.order.duplicated();
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
        match &self.state {
            State::SensorLogger(decoder) => decoder.lost(),
            _ => self.lost_before + self.orders().map(Resequencer::lost).sum::<u64>(),
        }
    }

    /// Messages that came more than once.
    #[must_use]
    pub fn duplicated(&self) -> u64 {
        match &self.state {
            State::SensorLogger(decoder) => decoder.duplicated(),
            _ => self.duplicated_before + self.orders().map(Resequencer::duplicated).sum::<u64>(),
        }
    }

    /// Those of the page loads that are remembered.
    fn orders(&self) -> impl Iterator<Item = &Resequencer<Batch>> {
        let current = match &self.state {
            State::Page(page) => page.as_ref(),
            _ => None,
        };
        self.ended.iter().chain(current).map(|page| &page.order)
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
mod tests;
