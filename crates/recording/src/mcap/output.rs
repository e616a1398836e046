//! An MCAP file that is being written: its channels, and how many messages each of them has.

use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

use ::mcap::records::{MessageHeader, Metadata};
use ::mcap::{McapError, McapResult, WriteOptions, Writer};

/// The file; `K` tells its channels apart.
pub(crate) struct Output<W: Write + Seek, K> {
    writer: Writer<W>,
    /// Number of the channel and of its newest message.
    channels: BTreeMap<K, (u16, u32)>,
}

/// Of a channel of which nothing more is told.
pub(crate) static NO_FACTS: BTreeMap<String, String> = BTreeMap::new();

/// A topic of ROS 2.
pub(crate) struct RosTopic<'a> {
    pub(crate) name: &'a str,
    /// The name of its messages' schema, and its definition with those of the messages in it.
    pub(crate) schema: &'a str,
    pub(crate) definition: &'a str,
    /// What is told of the channel.
    pub(crate) facts: &'a BTreeMap<String, String>,
}

/// What all files of this program have in common.
pub(crate) fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(None)
        .disable_seeking(true)
        .library(format!("northing {}", env!("CARGO_PKG_VERSION")))
}

/// What an output that refused has said.
pub(crate) fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl<W: Write + Seek, K: Ord> Output<W, K> {
    /// Begins a file with `facts` as its metadata.
    pub(crate) fn new(
        output: W,
        options: WriteOptions,
        facts: BTreeMap<String, String>,
    ) -> McapResult<Self> {
        let mut writer = options.create(output)?;
        writer.write_metadata(&Metadata {
            name: "northing".to_owned(),
            metadata: facts,
        })?;
        Ok(Self {
            writer,
            channels: BTreeMap::new(),
        })
    }

    /// Adds a message of a channel, which `begin` adds to the file before its first one.
    pub(crate) fn message(
        &mut self,
        channel: K,
        time_ns: i64,
        bytes: &[u8],
        begin: impl FnOnce(&mut Writer<W>) -> McapResult<u16>,
    ) -> McapResult<()> {
        let (channel_id, sequence) = match self.channels.get_mut(&channel) {
            Some((id, sequence)) => {
                *sequence = sequence.wrapping_add(1);
                (*id, *sequence)
            }
            None => {
                let id = begin(&mut self.writer)?;
                self.channels.insert(channel, (id, 0));
                (id, 0)
            }
        };
        let time = u64::try_from(time_ns).unwrap_or(0);
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: time,
            publish_time: time,
        };
        self.writer.write_to_known_channel(&header, bytes)
    }

    /// Adds a ROS 2 message to a topic.
    pub(crate) fn ros_message(
        &mut self,
        channel: K,
        time_ns: i64,
        bytes: &[u8],
        topic: &RosTopic<'_>,
    ) -> McapResult<()> {
        self.message(channel, time_ns, bytes, |file| {
            let definition = topic.definition.as_bytes();
            let schema = file.add_schema(topic.schema, "ros2msg", definition)?;
            file.add_channel(schema, topic.name, "cdr", topic.facts)
        })
    }

    /// Ends the chunk under way and hands everything to the output.
    pub(crate) fn flush(&mut self) -> McapResult<()> {
        self.writer.flush()
    }

    /// Writes the index.
    pub(crate) fn finish(&mut self) -> McapResult<()> {
        self.writer.finish().map(drop)
    }

    pub(crate) fn into_inner(self) -> W {
        self.writer.into_inner()
    }
}
