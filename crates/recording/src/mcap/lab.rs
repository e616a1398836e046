//! The lab's own recordings: everything that devices sent, as it came, and every command.
//!
//! One channel a device and kind, the time of a message is the time of arrival. Payloads are the bytes
//! as they came; `control` has JSON objects with a key `event`: `device` (it came: its name, how it
//! delivers, the profile it started with), `command`, `poll` (time passed and something that waited
//! was taken), `removed`. `docs/formats.md` has the table.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use ::mcap::{McapResult, Message, Writer};

use super::output::{Output, options};
use crate::wire::WireFormat;

/// Key of a channel's metadata: the identifier of the device.
const DEVICE: &str = "device";
/// Key of a channel's metadata: what the messages are, the name of a [`WireFormat`] or one of those below.
const KIND: &str = "kind";
const CONTROL: &str = "control";
const REFUSED: &str = "refused";
/// Chunks are not larger than about this, bytes: what is lost at most when the power goes.
const CHUNK_BYTES: u64 = 256 * 1024;

/// What a message of a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RecordKind {
    /// Bytes of a device as they came.
    Payload(WireFormat),
    /// A JSON object: device, command, poll, removed.
    Control,
    /// Bytes that were refused, of no known device.
    Refused,
}

impl RecordKind {
    const fn name(self) -> &'static str {
        match self {
            Self::Payload(format) => format.name(),
            Self::Control => CONTROL,
            Self::Refused => REFUSED,
        }
    }

    fn named(name: &str) -> Option<Self> {
        match name {
            CONTROL => Some(Self::Control),
            REFUSED => Some(Self::Refused),
            _ => name.parse().ok().map(Self::Payload),
        }
    }

    const fn encoding(self) -> &'static str {
        match self {
            Self::Control => "json",
            Self::Payload(format) if format.is_json() => "json",
            Self::Payload(WireFormat::Events | WireFormat::RazorBinary) | Self::Refused => {
                "application/octet-stream"
            }
            Self::Payload(_) => "text/plain",
        }
    }
}

/// One message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabRecord {
    /// The device's identifier; empty for what was refused.
    pub device: String,
    /// What it is.
    pub kind: RecordKind,
    /// When it came, ns since 1970.
    pub arrival_ns: i64,
    /// The bytes as they came.
    pub bytes: Vec<u8>,
}

impl LabRecord {
    /// The record in a message; `None` for a message that is not of the lab.
    pub(crate) fn of(message: Message<'_>) -> Option<Self> {
        let metadata = &message.channel.metadata;
        Some(Self {
            device: metadata.get(DEVICE)?.clone(),
            kind: RecordKind::named(metadata.get(KIND)?)?,
            arrival_ns: i64::try_from(message.log_time).ok()?,
            bytes: message.data.into_owned(),
        })
    }
}

/// The device and kind of a channel of the lab.
pub(crate) fn channel_of(metadata: &BTreeMap<String, String>) -> Option<(&str, RecordKind)> {
    let kind = RecordKind::named(metadata.get(KIND)?)?;
    Some((metadata.get(DEVICE)?, kind))
}

/// Writes a recording. Append-only: what is flushed is readable whatever happens later.
pub struct LabWriter<W: Write + Seek>(Output<W, (String, RecordKind)>);

impl<W: Write + Seek> LabWriter<W> {
    /// Begins a file. `facts` (program, time, computer) go in as metadata.
    ///
    /// # Errors
    /// The output refuses.
    pub fn new(output: W, facts: &BTreeMap<String, String>) -> McapResult<Self> {
        let options = options().chunk_size(Some(CHUNK_BYTES));
        Output::new(output, options, facts.clone()).map(Self)
    }

    /// Adds a record.
    ///
    /// # Errors
    /// The output refuses, or there are 65 536 channels.
    pub fn write(
        &mut self,
        device: &str,
        kind: RecordKind,
        arrival_ns: i64,
        bytes: &[u8],
    ) -> McapResult<()> {
        let key = (device.to_owned(), kind);
        self.0
            .message(key, arrival_ns, bytes, |file| channel(file, device, kind))
    }

    /// Ends the chunk under way and hands everything to the output.
    ///
    /// # Errors
    /// The output refuses.
    pub fn flush(&mut self) -> McapResult<()> {
        self.0.flush()
    }

    /// Writes the index and hands back the output.
    ///
    /// # Errors
    /// The output refuses.
    pub fn finish(mut self) -> McapResult<W> {
        self.0.finish()?;
        Ok(self.0.into_inner())
    }

    /// Gives the recording up: nothing more is written, not even an index.
    pub fn abandon(self) -> W {
        self.0.into_inner()
    }
}

/// Adds the channel of a device and kind to the file.
fn channel<W: Write + Seek>(
    file: &mut Writer<W>,
    device: &str,
    kind: RecordKind,
) -> McapResult<u16> {
    let schema = if kind.encoding() == "json" {
        let name = format!("northing.{}", kind.name());
        let schema = format!(r#"{{"title":"{name}","type":"object"}}"#);
        file.add_schema(&name, "jsonschema", schema.as_bytes())?
    } else {
        0
    };
    let topic = match kind {
        RecordKind::Refused => format!("/{REFUSED}"),
        _ => format!("/{device}/{}", kind.name()),
    };
    let metadata = BTreeMap::from([
        (DEVICE.to_owned(), device.to_owned()),
        (KIND.to_owned(), kind.name().to_owned()),
    ]);
    file.add_channel(schema, &topic, kind.encoding(), &metadata)
}

impl<W: Write + Seek> std::fmt::Debug for LabWriter<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LabWriter").finish_non_exhaustive()
    }
}
