//! Bags of ROS 1 (`#ROSBAG V2.0`): the messages of their chunks (none, bz2, lz4), in the order of writing.
//!
//! Read first: <http://wiki.ros.org/Bags/Format/2.0>. A record is a header of fields `name=value` behind its length, and
//! data behind its length; integers are little-endian. The index at the end is not needed. Messages are handed out
//! behind [`ROS_1`], and their types with the names of ROS 2, so that one decoder reads both.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::sync::Arc;

use ::mcap::{Channel, Message, Schema};

use super::cdr::ROS_1;
use super::definitions::Fields;
use super::file::Container;
use super::message_definition::{Stated, name_of};
use super::records::Stop;
use super::shared::Shared;
use crate::error::{RecordingError, Result, shown};
use crate::limits::{self, BLOCK, DEFINITIONS, Limit, TOPICS};

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Kinds of records.
const MESSAGE: u8 = 0x02;
const CHUNK: u8 = 0x05;
const CONNECTION: u8 = 0x07;

/// Whether an input begins as a bag of ROS 1; it stands at its beginning afterwards.
pub(super) fn recognises(input: &mut Shared) -> io::Result<bool> {
    let mut head = Vec::new();
    input.seek(SeekFrom::Start(0))?;
    let most = MAGIC.len() as u64;
    input.by_ref().take(most).read_to_end(&mut head)?;
    input.seek(SeekFrom::Start(0))?;
    Ok(head.starts_with(b"#ROSBAG V"))
}

/// The bag as a container.
pub(super) fn container(input: Shared, file: &str) -> Result<Box<dyn Container>> {
    let failed = |error| RecordingError::io(file, "read it", error);
    let (mut input, mut magic) = (input, Vec::new());
    let length = input.seek(SeekFrom::End(0)).map_err(failed)?;
    input.seek(SeekFrom::Start(0)).map_err(failed)?;
    let mut head = input.by_ref().take(MAGIC.len() as u64);
    head.read_to_end(&mut magic).map_err(failed)?;
    if magic != MAGIC {
        let problem = "it is a bag of ROS of an older version than 2.0; convert it with `rosbag fix`, or with \
            `pip install rosbags` and `rosbags-convert`";
        return Err(RecordingError::unsupported(file, problem));
    }
    Ok(Box::new(Bag {
        input: BufReader::new(input),
        left: length - magic.len() as u64,
        unpacked: (limits::unpacked(length), 0),
        channels: BTreeMap::new(),
        definitions: 0,
        chunk: Vec::new(),
        at: 0,
    }))
}

/// A bag whose records up to some place are read.
struct Bag {
    input: BufReader<Shared>,
    /// Bytes of the file behind what was read.
    left: u64,
    /// The limit of what is unpacked from all chunks together, and how much that was.
    unpacked: (Limit, u64),
    channels: BTreeMap<u32, Arc<Channel<'static>>>,
    /// Bytes of the connections.
    definitions: u64,
    chunk: Vec<u8>,
    /// The next record in the chunk.
    at: usize,
}

impl Container for Bag {
    fn format(&self) -> &'static str {
        "rosbag-ros1"
    }

    fn next(&mut self) -> std::result::Result<Option<Message<'static>>, Stop> {
        loop {
            while self.at < self.chunk.len() {
                let mut fields = Fields(&self.chunk[self.at..]);
                let record = (fields.block(), fields.block());
                let (Some(header), Some(data)) = record else {
                    return Err(Stop::Cut("a record reaches beyond its chunk".to_owned()));
                };
                self.at = self.chunk.len() - fields.0.len();
                let header = header_of(header)?;
                match header.kind {
                    CONNECTION => {
                        let data = header_of(data)?;
                        let count = &mut self.definitions;
                        connection(&mut self.channels, count, &header, &data)?;
                    }
                    MESSAGE => {
                        if let Some(message) = message(&self.channels, &header, data) {
                            return Ok(Some(message));
                        }
                    }
                    _ => {}
                }
            }
            if self.left == 0 {
                return Ok(None);
            }
            self.record()?;
        }
    }

    fn another(&self, file: &str) -> Result<Box<dyn Container>> {
        container(self.input.get_ref().another(), file)
    }
}

impl Bag {
    /// Reads the next record of the file, and unpacks it where it is a chunk.
    fn record(&mut self) -> std::result::Result<(), Stop> {
        let header = self.block(DEFINITIONS)?;
        let header = header_of(&header)?;
        if header.kind != CHUNK {
            let length = self.length()?;
            self.left -= length;
            let skipped = io::copy(&mut self.input.by_ref().take(length), &mut io::sink());
            return match skipped {
                Ok(skipped) if skipped == length => Ok(()),
                _ => Err(Stop::in_the_middle()),
            };
        }
        let packed = self.block(BLOCK)?;
        let size = u64::from(header.size.ok_or_else(damaged)?);
        Stop::check(BLOCK, size)?;
        self.unpacked.1 = self.unpacked.1.saturating_add(size);
        Stop::check(self.unpacked.0, self.unpacked.1)?;
        self.chunk.clear();
        self.at = 0;
        let mut chunk = Vec::new();
        // One byte more than the chunk says, so that a longer one is found.
        let most = size + 1;
        let read = match &header.compression[..] {
            b"none" | b"" => packed.as_slice().take(most).read_to_end(&mut chunk),
            b"lz4" => {
                let decoder = lz4_flex::frame::FrameDecoder::new(packed.as_slice());
                decoder.take(most).read_to_end(&mut chunk)
            }
            b"bz2" => {
                let decoder = bzip2_rs::DecoderReader::new(packed.as_slice());
                decoder.take(most).read_to_end(&mut chunk)
            }
            other => {
                let name = String::from_utf8_lossy(other);
                return Err(Stop::Compression(shown(&name)));
            }
        };
        read.map_err(|error| Stop::Cut(shown(&error.to_string())))?;
        if chunk.len() as u64 != size {
            return Err(Stop::Cut(
                "a chunk has another size than it says".to_owned(),
            ));
        }
        self.chunk = chunk;
        Ok(())
    }

    /// Bytes behind their length.
    fn block(&mut self, limit: Limit) -> std::result::Result<Vec<u8>, Stop> {
        let length = self.length()?;
        Stop::check(limit, length)?;
        self.left -= length;
        // No longer than the file, and than the limit.
        let mut bytes = vec![0; length as usize];
        let read = self.input.read_exact(&mut bytes);
        read.map_err(|_| Stop::in_the_middle())?;
        Ok(bytes)
    }

    /// A length, which reaches no further than the file.
    fn length(&mut self) -> std::result::Result<u64, Stop> {
        let mut length = [0; 4];
        let left = self.left.checked_sub(length.len() as u64);
        self.left = left.ok_or_else(Stop::in_the_middle)?;
        let read = self.input.read_exact(&mut length);
        read.map_err(|_| Stop::in_the_middle())?;
        let length = u64::from(u32::from_le_bytes(length));
        if length > self.left {
            return Err(Stop::in_the_middle());
        }
        Ok(length)
    }
}

/// The fields of a header that are used.
#[derive(Default)]
struct Header<'a> {
    kind: u8,
    connection: Option<u32>,
    size: Option<u32>,
    /// Nanoseconds.
    time: Option<u64>,
    compression: Cow<'a, [u8]>,
    topic: &'a [u8],
    name: &'a [u8],
    definition: &'a [u8],
}

fn header_of(bytes: &[u8]) -> std::result::Result<Header<'_>, Stop> {
    let (mut header, mut fields) = (Header::default(), Fields(bytes));
    while !fields.0.is_empty() {
        let field = fields.block().ok_or_else(damaged)?;
        let equals = field.iter().position(|byte| *byte == b'=');
        let (name, value) = field.split_at(equals.ok_or_else(damaged)?);
        let value = &value[1..];
        let number = || value.try_into().ok().map(u32::from_le_bytes);
        match name {
            b"op" => header.kind = value.first().copied().unwrap_or_default(),
            b"conn" => header.connection = number(),
            b"size" => header.size = number(),
            b"time" => {
                let mut fields = Fields(value);
                let (s, ns) = (fields.u32(), fields.u32());
                header.time = s
                    .zip(ns)
                    .map(|(s, ns)| u64::from(s) * 1_000_000_000 + u64::from(ns));
            }
            b"compression" => header.compression = Cow::Borrowed(value),
            b"topic" => header.topic = value,
            b"type" => header.name = value,
            b"message_definition" => header.definition = value,
            _ => {}
        }
    }
    Ok(header)
}

fn damaged() -> Stop {
    Stop::Cut("the header of a record is damaged".to_owned())
}

/// Takes a connection; it may be repeated.
fn connection(
    channels: &mut BTreeMap<u32, Arc<Channel<'static>>>,
    bytes: &mut u64,
    header: &Header<'_>,
    data: &Header<'_>,
) -> std::result::Result<(), Stop> {
    let id = header.connection.ok_or_else(damaged)?;
    if channels.contains_key(&id) {
        return Ok(());
    }
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let topic = text(header.topic);
    // `sensor_msgs/Imu` is `sensor_msgs/msg/Imu` in ROS 2.
    let name = text(data.name).replacen('/', "/msg/", 1);
    let stated = Stated {
        encoding: "ros1msg",
        definition: std::str::from_utf8(data.definition).unwrap_or_default(),
        ..Stated::default()
    };
    let name = name_of(&name, stated);
    *bytes += (topic.len() + name.len() + 64) as u64;
    Stop::check(DEFINITIONS, *bytes)?;
    let number = u16::try_from(channels.len())
        .map_err(|_| Stop::TooLarge(TOPICS, channels.len() as u64 + 1))?;
    let schema = Schema {
        id: number.saturating_add(1),
        name,
        encoding: "ros1msg".to_owned(),
        data: Cow::Borrowed(b""),
    };
    let channel = Channel {
        id: number,
        topic,
        schema: Some(Arc::new(schema)),
        message_encoding: "cdr".to_owned(),
        metadata: BTreeMap::new(),
    };
    channels.insert(id, Arc::new(channel));
    Ok(())
}

/// A message of a connection that is known.
fn message(
    channels: &BTreeMap<u32, Arc<Channel<'static>>>,
    header: &Header<'_>,
    data: &[u8],
) -> Option<Message<'static>> {
    let channel = Arc::clone(channels.get(&header.connection?)?);
    let log_time = header.time?;
    Some(Message {
        channel,
        sequence: 0,
        log_time,
        publish_time: log_time,
        data: Cow::Owned([&ROS_1[..], data].concat()),
    })
}
