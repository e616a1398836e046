//! The messages of an MCAP file or a bag, one after the other, up to its end or up to where it is cut or damaged.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::sync::Arc;

use ::mcap::records::op;
use ::mcap::{Channel, Message};

use super::bag_file::ZSTD;
use super::definitions::{Definitions, Fields};
use super::nav_sat_fix;
use super::pose_twist::{ODOMETRY, child_frame};
use super::records::{Records, Stop};
use super::ros::{self, IMU, MAGNETIC_FIELD};
use super::ros_1;
use super::shared::Shared;
use super::tf_static::{StaticTransforms, is_mounting};
use super::topics::schema;
use crate::error::{RecordingError, Result, shown};
use crate::issues::Issues;
use crate::limits::{self, BLOCK};

/// What every MCAP file starts and every complete one ends with.
pub(crate) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";

/// The name of the format.
pub(super) const MCAP: &str = "mcap";

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

/// A container of messages: what is particular to MCAP, to a database of ROS 2, to a bag of ROS 1.
pub(super) trait Container: Send {
    /// Its name, as [`crate::Metadata`] has it.
    fn format(&self) -> &'static str;

    /// The next message; `None` at the end of a complete file.
    fn next(&mut self) -> std::result::Result<Option<Message<'static>>, Stop>;

    /// Another reader of the same, at the beginning.
    fn another(&self, file: &str) -> Result<Box<dyn Container>>;
}

/// The messages of a file in the order in which they were written. Memory does not grow with the file.
pub(crate) struct Messages {
    container: Box<dyn Container>,
    /// Bytes of messages that were compressed by themselves, packed and unpacked.
    unpacked: (u64, u64),
    end: Option<End>,
}

impl Messages {
    /// Starts at the beginning of `input`: MCAP, or a bag of ROS 1.
    pub(crate) fn new(input: Box<dyn Input>, file: &str) -> Result<Self> {
        let mut input = Shared::new(input);
        let is_ros_1 = ros_1::recognises(&mut input);
        let is_ros_1 = is_ros_1.map_err(|error| RecordingError::io(file, "read it", error))?;
        Ok(Self::of(if is_ros_1 {
            ros_1::container(input, file)?
        } else {
            Box::new(Mcap::new(input, file)?)
        }))
    }

    pub(super) fn of(container: Box<dyn Container>) -> Self {
        Self {
            container,
            unpacked: (0, 0),
            end: None,
        }
    }

    /// How it ended, once it has.
    pub(crate) fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    /// Tells that the file is cut, once however many read it.
    pub(super) fn report(&self, issues: &mut Issues) {
        if let Some(why) = self.end.as_ref().and_then(End::why) {
            let told = format!("The recording was not finished ({why}); it is read up to there.");
            if !issues.notes.contains(&told) {
                issues.notes.push(told);
            }
        }
    }

    /// Another reader of the same file, at the beginning.
    pub(crate) fn another(&self, file: &str) -> Result<Self> {
        Ok(Self::of(self.container.another(file)?))
    }
}

/// A message as it was before its recorder compressed it by itself (`compression_mode: message`); `bytes` counts all of
/// them, packed and unpacked. No message of ROS begins as zstd does.
fn unpacked(
    mut message: Message<'static>,
    bytes: &mut (u64, u64),
) -> std::result::Result<Message<'static>, Stop> {
    if message.channel.message_encoding != "cdr" || !message.data.starts_with(ZSTD) {
        return Ok(message);
    }
    let mut data = Vec::new();
    let decoder = zstd::Decoder::new(&message.data[..]);
    let read = decoder.and_then(|decoder| decoder.take(BLOCK.most + 1).read_to_end(&mut data));
    read.map_err(|error| Stop::Cut(shown(&error.to_string())))?;
    Stop::check(BLOCK, data.len() as u64)?;
    bytes.0 += message.data.len() as u64;
    bytes.1 += data.len() as u64;
    Stop::check(limits::unpacked(bytes.0), bytes.1)?;
    message.data = Cow::Owned(data);
    Ok(message)
}

/// The messages of an MCAP file.
struct Mcap {
    records: Records,
    definitions: Definitions,
    complete: bool,
    begun: bool,
}

impl Mcap {
    fn new(mut input: Shared, file: &str) -> Result<Self> {
        let complete = has_end(&mut input);
        let complete = complete.map_err(|error| RecordingError::io(file, "read it", error))?;
        Ok(Self {
            records: Records::new(input, file)?,
            definitions: Definitions::default(),
            complete,
            begun: false,
        })
    }
}

impl Container for Mcap {
    fn format(&self) -> &'static str {
        MCAP
    }

    fn next(&mut self) -> std::result::Result<Option<Message<'static>>, Stop> {
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
        if self.complete {
            return Ok(None);
        }
        Err(Stop::in_the_middle())
    }

    fn another(&self, file: &str) -> Result<Box<dyn Container>> {
        Ok(Box::new(Self::new(self.records.input(), file)?))
    }
}

impl Iterator for Messages {
    type Item = Message<'static>;

    fn next(&mut self) -> Option<Message<'static>> {
        if self.end.is_some() {
            return None;
        }
        let next = self.container.next();
        let next = next.and_then(|message| {
            let unpacked = message.map(|message| unpacked(message, &mut self.unpacked));
            unpacked.transpose()
        });
        self.end = match &next {
            Ok(Some(_)) => None,
            Ok(None) => Some(End::Complete),
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
    pub(crate) format: &'static str,
    pub(crate) channels: Vec<Arc<Channel<'static>>>,
    /// The frame in the first message of each topic of sensors of ROS 2.
    pub(crate) frames: BTreeMap<String, String>,
    /// How they are mounted.
    pub(crate) transforms: StaticTransforms,
    pub(crate) end: End,
}

/// Looks through the whole file for its channels: an unfinished one has no list of them.
///
/// # Errors
/// Something in it is larger than is read.
pub(crate) fn contents(messages: &mut Messages, file: &str) -> Result<Contents> {
    let mut channels: Vec<Arc<Channel<'static>>> = Vec::new();
    let (mut frames, mut transforms) = (BTreeMap::new(), StaticTransforms::default());
    let mut known = vec![false; usize::from(u16::MAX) + 1];
    for message in &mut *messages {
        let seen = &mut known[usize::from(message.channel.id)];
        if !std::mem::replace(seen, true) {
            channels.push(message.channel.clone());
            if let Some(frame) = sensor_frame(&message) {
                frames.insert(message.channel.topic.clone(), frame.to_owned());
            }
        }
        let channel = &message.channel;
        if schema(channel).is_some_and(|kind| is_mounting(&channel.topic, kind)) {
            // What is none says nothing.
            let _ = transforms.take(&message.data);
        }
    }
    let end = messages.end().cloned().unwrap_or(End::Complete);
    end.check(file)?;
    Ok(Contents {
        format: messages.container.format(),
        channels,
        frames,
        transforms,
        end,
    })
}

/// The frame of the sensor, or of the body whose pose it is, in a message of ROS 2.
fn sensor_frame<'a>(message: &'a Message<'static>) -> Option<&'a str> {
    match schema(&message.channel)? {
        IMU | MAGNETIC_FIELD | nav_sat_fix::NAME => ros::frame(&message.data),
        ODOMETRY => child_frame(&message.data),
        _ => None,
    }
}

/// The list of contents at the end of a complete file.
pub(crate) struct Summary {
    pub(crate) channels: Vec<Arc<Channel<'static>>>,
    /// Time of the first message, ns since 1970.
    pub(crate) start_ns: Option<u64>,
}

/// Reads the list of contents; `None` when there is none.
pub(crate) fn summary(input: Box<dyn Input>) -> Option<Summary> {
    /// The footer: kind and length of the record, where the summary and its offsets begin, its checksum.
    const FOOTER: i64 = 9 + 8 + 8 + 4;
    let mut input = Shared::new(input);
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
