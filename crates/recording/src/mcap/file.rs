//! The messages of an MCAP file, one after the other, up to its end or up to where it is cut or damaged.

use std::io::{BufReader, Read, Seek, SeekFrom};
use std::sync::Arc;

use ::mcap::io::MessageReader;
use ::mcap::sans_io::LinearReaderOptions;
use ::mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use ::mcap::{Channel, McapError, Message};

use crate::error::{RecordingError, Result};
use crate::issues::Issues;

/// What every MCAP file starts and every complete one ends with.
pub(crate) const MAGIC: &[u8] = &[0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n'];
/// A record or chunk that claims to be longer is damage, bytes.
const LONGEST_RECORD: usize = 64 << 20;
const BUFFER: usize = 1 << 16;

/// A file or bytes in memory.
pub(crate) trait Input: Read + Seek + Send {}
impl<T: Read + Seek + Send> Input for T {}

/// How a file ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum End {
    /// As it was closed.
    Complete,
    /// Its writer was stopped, or something is damaged: what the rest is worth is not known.
    Cut(String),
}

/// The messages of a file in the order in which they were written. Memory does not grow with the file.
pub(crate) struct Messages {
    reader: MessageReader<BufReader<Box<dyn Input>>>,
    complete: bool,
    end: Option<End>,
}

impl Messages {
    /// Starts at the beginning of `input`.
    pub(crate) fn new(mut input: Box<dyn Input>, file: &str) -> Result<Self> {
        let failed = |error| RecordingError::io(file, "read it", error);
        let complete = has_end(&mut input).map_err(failed)?;
        input.rewind().map_err(failed)?;
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        let input = BufReader::with_capacity(BUFFER, input);
        Ok(Self {
            reader: MessageReader::new_with_options(input, options),
            complete,
            end: None,
        })
    }

    /// How it ended, once it has.
    pub(crate) fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    /// Tells that the file is cut, and how many messages could not be decoded.
    pub(super) fn report(&self, unreadable: u64, issues: &mut Issues) {
        if let Some(End::Cut(why)) = &self.end {
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
        Self::new(self.reader.into_inner().into_inner(), file)
    }

    fn ended(&self, error: Option<&McapError>) -> End {
        match error {
            None if self.complete => End::Complete,
            None | Some(McapError::UnexpectedEof | McapError::UnexpectedEoc) => {
                End::Cut("it ends in the middle: whatever wrote it was stopped".to_owned())
            }
            Some(error) => End::Cut(crate::error::shown(&error.to_string())),
        }
    }
}

impl Iterator for Messages {
    type Item = Message<'static>;

    fn next(&mut self) -> Option<Message<'static>> {
        if self.end.is_some() {
            return None;
        }
        let next = self.reader.next().transpose();
        if !matches!(next, Ok(Some(_))) {
            self.end = Some(self.ended(next.as_ref().err()));
        }
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
    Ok(last == MAGIC)
}

/// The channels of a file, each once, and how the file ended.
pub(crate) struct Contents {
    pub(crate) channels: Vec<Arc<Channel<'static>>>,
    pub(crate) end: End,
}

/// Looks through the whole file for its channels: an unfinished one has no list of them.
pub(crate) fn contents(messages: &mut Messages) -> Contents {
    let mut channels: Vec<Arc<Channel<'static>>> = Vec::new();
    let mut known = vec![false; usize::from(u16::MAX) + 1];
    for message in &mut *messages {
        let seen = &mut known[usize::from(message.channel.id)];
        if !std::mem::replace(seen, true) {
            channels.push(message.channel.clone());
        }
    }
    let end = messages.end().cloned().unwrap_or(End::Complete);
    Contents { channels, end }
}

/// The list of contents at the end of a complete file; `None` when there is none.
pub(crate) fn summary(input: &mut (impl Read + Seek)) -> Option<::mcap::Summary> {
    let options = SummaryReaderOptions::default().with_record_length_limit(LONGEST_RECORD);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(input.seek(to).ok()?),
            SummaryReadEvent::ReadRequest(bytes) => {
                let read = input.read(reader.insert(bytes)).ok()?;
                reader.notify_read(read);
            }
        }
    }
    reader.finish()
}
