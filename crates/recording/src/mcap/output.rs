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
