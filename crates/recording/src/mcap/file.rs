//! The messages of an MCAP file, one after the other, up to its end or up to where it is cut or damaged.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::sync::Arc;

use ::mcap::records::op;
use ::mcap::{Channel, Message};

use super::definitions::{Definitions, Fields};
use super::records::{Records, Stop};
use super::ros::{self, IMU, MAGNETIC_FIELD};
use super::topics::is;
use crate::error::{RecordingError, Result};
use crate::issues::Issues;

/// What every MCAP file starts and every complete one ends with.
pub(crate) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";

/// A file or bytes in memory.
pub(crate) trait Input: Read + Seek + Send {}
impl<T: Read + Seek + Send> Input for T {}

/// How a file ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum End {
    /// As it was closed.
    Complete,
    /// Its writer was stopped, something is damaged, or larger than is read: the rest is not used.
    Stopped(Stop),
}

impl End {
    /// Why it ended before its end.
    pub(crate) fn why(&self) -> Option<String> {
        match self {
            Self::Complete => None,
            Self::Stopped(Stop::Cut(why)) => Some(why.clone()),
            Self::Stopped(Stop::TooLarge(limit, found)) => Some(format!(
                "{} has {found} {}, more than {}",
                limit.what, limit.unit, limit.most
            )),
            Self::Stopped(Stop::Compression(name)) => Some(format!(
                "its chunks are compressed with `{name}`, which is not read"
            )),
        }
    }

    /// Refuses a file that is larger than is read, or compressed in a way that is not.
    fn check(&self, file: &str) -> Result<()> {
        match self {
            Self::Stopped(Stop::TooLarge(limit, found)) => limit.check(*found, file, ""),
            Self::Stopped(Stop::Compression(name)) => Err(RecordingError::unsupported(
                file,
                format!(
                    "its chunks are compressed with `{name}`; zstd, lz4 and none are read; write it again, e.g. with \
                     `mcap compress --compression zstd`"
                ),
            )),
            _ => Ok(()),
        }
    }
}

/// The messages of a file in the order in which they were written. Memory does not grow with the file.
pub(crate) struct Messages {
    records: Records,
    definitions: Definitions,
    complete: bool,
    begun: bool,
    end: Option<End>,
}

impl Messages {
    /// Starts at the beginning of `input`.
    pub(crate) fn new(mut input: Box<dyn Input>, file: &str) -> Result<Self> {
        let complete = has_end(&mut input);
        let complete = complete.map_err(|error| RecordingError::io(file, "read it", error))?;
        Ok(Self {
            records: Records::new(input, file)?,
            definitions: Definitions::default(),
            complete,
            begun: false,
            end: None,
        })
    }

    /// How it ended, once it has.
    pub(crate) fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    /// Tells that the file is cut, and how many messages could not be decoded.
    pub(super) fn report(&self, unreadable: u64, issues: &mut Issues) {
        if let Some(why) = self.end.as_ref().and_then(End::why) {
            issues.notes.push(format!(
                "The recording was not finished ({why}); it is read up to there."
            ));
        }
        if unreadable > 0 {
            let text = format!("Messages that could not be decoded: {unreadable}.");
            issues.notes.push(text);
        }
    }

    /// From the beginning again.
    pub(crate) fn again(self, file: &str) -> Result<Self> {
        Self::new(self.records.into_input(), file)
    }

    fn read(&mut self) -> std::result::Result<Option<Message<'static>>, Stop> {
        if !std::mem::replace(&mut self.begun, true) {
            self.records.begin()?;
        }
        while let Some((kind, record)) = self.records.next()? {
            match kind {
                op::SCHEMA => self.definitions.schema(record)?,
                op::CHANNEL => self.definitions.channel(record)?,
                op::MESSAGE => return self.definitions.message(record).map(Some),
                _ => {}
            }
        }
        Ok(None)
    }
}

impl Iterator for Messages {
    type Item = Message<'static>;

    fn next(&mut self) -> Option<Message<'static>> {
        if self.end.is_some() {
            return None;
        }
        let next = self.read();
        self.end = match &next {
            Ok(Some(_)) => None,
            Ok(None) if self.complete => Some(End::Complete),
            Ok(None) => Some(End::Stopped(Stop::in_the_middle())),
            Err(stop) => Some(End::Stopped(stop.clone())),
        };
        next.ok().flatten()
    }
}

/// Whether the input ends as a complete file does.
pub(crate) fn has_end(input: &mut (impl Read + Seek)) -> std::io::Result<bool> {
    let length = input.seek(SeekFrom::End(0))?;
    let magic = MAGIC.len() as u64;
    if length < 2 * magic {
        return Ok(false);
    }
    input.seek(SeekFrom::Start(length - magic))?;
    let mut last = [0; MAGIC.len()];
    input.read_exact(&mut last)?;
    Ok(last == *MAGIC)
}

/// The channels of a file, each once, and how the file ended.
pub(crate) struct Contents {
    pub(crate) channels: Vec<Arc<Channel<'static>>>,
    /// The frame in the first message of each topic of sensors of ROS 2.
    pub(crate) frames: BTreeMap<String, String>,
    pub(crate) end: End,
}

/// Looks through the whole file for its channels: an unfinished one has no list of them.
///
/// # Errors
/// Something in it is larger than is read.
pub(crate) fn contents(messages: &mut Messages, file: &str) -> Result<Contents> {
    let mut channels: Vec<Arc<Channel<'static>>> = Vec::new();
    let mut frames = BTreeMap::new();
    let mut known = vec![false; usize::from(u16::MAX) + 1];
    for message in &mut *messages {
        let seen = &mut known[usize::from(message.channel.id)];
        if !std::mem::replace(seen, true) {
            channels.push(message.channel.clone());
            let is_sensor = [IMU, MAGNETIC_FIELD]
                .iter()
                .any(|kind| is(&message.channel, kind));
            if let (true, Some(frame)) = (is_sensor, ros::frame(&message.data)) {
                frames.insert(message.channel.topic.clone(), frame.to_owned());
            }
        }
    }
    let end = messages.end().cloned().unwrap_or(End::Complete);
    end.check(file)?;
    Ok(Contents {
        channels,
        frames,
        end,
    })
}

/// The list of contents at the end of a complete file.
pub(crate) struct Summary {
    pub(crate) channels: Vec<Arc<Channel<'static>>>,
    /// Time of the first message, ns since 1970.
    pub(crate) start_ns: Option<u64>,
}

/// Reads the list of contents; `None` when there is none.
pub(crate) fn summary(mut input: Box<dyn Input>) -> Option<Summary> {
    /// The footer: kind and length of the record, where the summary and its offsets begin, its checksum.
    const FOOTER: i64 = 9 + 8 + 8 + 4;
    input
        .seek(SeekFrom::End(-FOOTER - MAGIC.len() as i64))
        .ok()?;
    let mut footer = [0; FOOTER as usize];
    input.read_exact(&mut footer).ok()?;
    let (kind, rest) = footer.split_first()?;
    let mut fields = Fields(rest);
    let _length = fields.u64()?;
    let start = fields.u64().filter(|start| *start > 0)?;
    if *kind != op::FOOTER {
        return None;
    }
    let mut records = Records::from(input, start).ok()?;
    let (mut definitions, mut start_ns) = (Definitions::default(), None);
    while let Some((kind, record)) = records.next().ok()? {
        match kind {
            op::SCHEMA => definitions.schema(record).ok()?,
            op::CHANNEL => definitions.channel(record).ok()?,
            op::STATISTICS => start_ns = first_message(record),
            _ => {}
        }
    }
    Some(Summary {
        channels: definitions.into_channels(),
        start_ns,
    })
}

/// The time of the first message, behind the counts of messages, schemas, channels, attachments, metadata and chunks.
fn first_message(statistics: &[u8]) -> Option<u64> {
    let mut fields = Fields(statistics);
    fields.bytes(8 + 2 + 4 + 4 + 4 + 4)?;
    fields.u64()
}
