//! The records of an MCAP file, those of chunks among them, none of them larger than a recording needs.
//!
//! Read first: <https://mcap.dev/spec>. A file is a magic number and records: kind (one byte), length (`u64`), content.
//! A length counts only as far as the file reaches, a chunk's unpacked size only as far as [`limits`] says; a chunk
//! is unpacked as a whole, after which its checksum is checked before anything in it is used.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use ::mcap::records::op;

use super::definitions::Fields;
use super::file::MAGIC;
use super::shared::Shared;
use crate::error::{RecordingError, Result as ReadResult, shown};
use crate::limits::{self, BLOCK, Limit};

const BUFFER: usize = 1 << 16;
/// Kind and length of a record, bytes.
const HEAD: usize = 1 + 8;

/// Why reading stopped before the end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Stop {
    /// The file is cut or damaged: why.
    Cut(String),
    /// Larger than is read: what, and how large.
    TooLarge(Limit, u64),
    /// The chunks are compressed in a way that is not read.
    Compression(String),
}

impl Stop {
    fn cut(why: &str) -> Self {
        Self::Cut(why.to_owned())
    }

    pub(super) fn in_the_middle() -> Self {
        Self::cut("it ends in the middle: whatever wrote it was stopped")
    }

    pub(super) fn check(limit: Limit, found: u64) -> Result<(), Self> {
        if found > limit.most {
            return Err(Self::TooLarge(limit, found));
        }
        Ok(())
    }
}

/// The records of the data section in the order of the file. Memory does not grow with it.
pub(super) struct Records {
    input: BufReader<Shared>,
    /// Bytes of the file behind what was read.
    left: u64,
    /// The limit of what is unpacked from all chunks together, and how much that was.
    unpacked: (Limit, u64),
    chunk: Vec<u8>,
    /// The next record in the chunk.
    at: usize,
    /// A record that is no chunk, or a packed one.
    record: Vec<u8>,
}

impl Records {
    /// Starts at the beginning of `input`.
    pub(super) fn new(input: Shared, file: &str) -> ReadResult<Self> {
        Self::from(input, 0).map_err(|error| RecordingError::io(file, "read it", error))
    }

    /// Starts at a place in `input`.
    pub(super) fn from(mut input: Shared, start: u64) -> io::Result<Self> {
        let length = input.seek(SeekFrom::End(0))?;
        input.seek(SeekFrom::Start(start))?;
        Ok(Self {
            input: BufReader::with_capacity(BUFFER, input),
            left: length.saturating_sub(start),
            unpacked: (limits::unpacked(length), 0),
            chunk: Vec::new(),
            at: 0,
            record: Vec::new(),
        })
    }

    /// Another reader of the same file, at the beginning.
    pub(super) fn input(&self) -> Shared {
        self.input.get_ref().another()
    }

    /// Reads the magic number.
    pub(super) fn begin(&mut self) -> Result<(), Stop> {
        let mut magic = [0; MAGIC.len()];
        self.fill(&mut magic)?;
        if magic != *MAGIC {
            return Err(Stop::cut("it does not begin as MCAP does"));
        }
        Ok(())
    }

    /// The kind and the content of the next record that is of use; `None` at the end of the section.
    pub(super) fn next(&mut self) -> Result<Option<(u8, &[u8])>, Stop> {
        loop {
            if self.at < self.chunk.len() {
                if let Some((kind, from, to)) = self.next_in_chunk()? {
                    return Ok(Some((kind, &self.chunk[from..to])));
                }
                continue;
            }
            let Some((kind, length)) = self.head()? else {
                return Ok(None);
            };
            match kind {
                op::DATA_END | op::FOOTER => return Ok(None),
                op::CHUNK => self.unpack(length)?,
                _ if is_of_use(kind) => {
                    self.load(length)?;
                    return Ok(Some((kind, &self.record)));
                }
                _ => self.skip(length)?,
            }
        }
    }

    /// Kind and length of the next record of the file; `None` at the end of the file.
    fn head(&mut self) -> Result<Option<(u8, u64)>, Stop> {
        if self.left == 0 {
            return Ok(None);
        }
        let mut kind = [0; 1];
        let mut length = [0; 8];
        self.fill(&mut kind)?;
        self.fill(&mut length)?;
        let length = u64::from_le_bytes(length);
        if length > self.left {
            return Err(Stop::in_the_middle());
        }
        Ok(Some((kind[0], length)))
    }

    /// Place of the next record in the chunk; `None` for one that is of no use.
    fn next_in_chunk(&mut self) -> Result<Option<(u8, usize, usize)>, Stop> {
        let broken = || Stop::cut("a record reaches beyond its chunk");
        let rest = &self.chunk[self.at..];
        let (head, rest) = rest.split_first_chunk::<HEAD>().ok_or_else(broken)?;
        let [kind, length @ ..] = *head;
        let length = usize::try_from(u64::from_le_bytes(length)).map_err(|_| broken())?;
        if length > rest.len() {
            return Err(broken());
        }
        let from = self.at + HEAD;
        self.at = from + length;
        Ok(is_of_use(kind).then_some((kind, from, self.at)))
    }

    /// Reads a chunk of this length and unpacks it.
    fn unpack(&mut self, length: u64) -> Result<(), Stop> {
        self.load(length)?;
        self.chunk.clear();
        self.at = 0;
        let chunk = Packed::of(&self.record).ok_or_else(|| Stop::cut("a chunk is damaged"))?;
        Stop::check(BLOCK, chunk.size)?;
        let (limit, unpacked) = &mut self.unpacked;
        *unpacked = unpacked.saturating_add(chunk.size);
        Stop::check(*limit, *unpacked)?;
        chunk.unpack(&mut self.chunk)?;
        if chunk.crc32 != 0 && crc32fast::hash(&self.chunk) != chunk.crc32 {
            self.chunk.clear();
            return Err(Stop::cut("the checksum of a chunk is wrong"));
        }
        Ok(())
    }

    /// Reads a record of this length as a whole.
    fn load(&mut self, length: u64) -> Result<(), Stop> {
        Stop::check(BLOCK, length)?;
        self.record.clear();
        // No longer than the file, and than a block.
        self.record.resize(length as usize, 0);
        let mut record = std::mem::take(&mut self.record);
        let filled = self.fill(&mut record);
        self.record = record;
        filled
    }

    fn skip(&mut self, length: u64) -> Result<(), Stop> {
        self.left -= length;
        let mut rest = (&mut self.input).take(length);
        let skipped = io::copy(&mut rest, &mut io::sink());
        if skipped.map_err(|error| refused(&error))? < length {
            return Err(Stop::in_the_middle());
        }
        Ok(())
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), Stop> {
        let length = bytes.len() as u64;
        let left = self.left.checked_sub(length);
        self.left = left.ok_or_else(Stop::in_the_middle)?;
        self.input
            .read_exact(bytes)
            .map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => Stop::in_the_middle(),
                _ => refused(&error),
            })
    }
}

fn refused(error: &io::Error) -> Stop {
    Stop::Cut(shown(&error.to_string()))
}

/// Whether a record is one of those that are handed out.
fn is_of_use(kind: u8) -> bool {
    matches!(
        kind,
        op::SCHEMA | op::CHANNEL | op::MESSAGE | op::STATISTICS
    )
}

/// A chunk as it stands in the file.
struct Packed<'a> {
    /// Bytes of its records when they are unpacked, by its own word.
    size: u64,
    /// Of the unpacked records; 0 without one.
    crc32: u32,
    compression: &'a str,
    data: &'a [u8],
}

impl<'a> Packed<'a> {
    fn of(record: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(record);
        let _start_and_end = (fields.u64()?, fields.u64()?);
        let (size, crc32) = (fields.u64()?, fields.u32()?);
        let compression = fields.text()?;
        let packed = fields.u64()?;
        let data = fields.bytes(usize::try_from(packed).ok()?)?;
        Some(Self {
            size,
            crc32,
            compression,
            data,
        })
    }

    /// Unpacks the records, whose size has been checked.
    fn unpack(&self, records: &mut Vec<u8>) -> Result<(), Stop> {
        match self.compression {
            "" => records.extend_from_slice(self.data),
            "zstd" => {
                records.resize(self.size as usize, 0);
                let length = zstd::bulk::decompress_to_buffer(self.data, records)
                    .map_err(|error| refused(&error));
                // Nothing of what is not whole is used.
                records.truncate(*length.as_ref().unwrap_or(&0));
                length?;
            }
            "lz4" => {
                // One byte more than the chunk says, so that a longer one is found.
                let mut most = lz4_flex::frame::FrameDecoder::new(self.data).take(self.size + 1);
                let read = most.read_to_end(records).map_err(|error| refused(&error));
                if read.is_err() {
                    records.clear();
                }
                read?;
            }
            other => return Err(Stop::Compression(shown(other))),
        }
        if records.len() as u64 != self.size {
            records.clear();
            return Err(Stop::cut("a chunk has another size than it says"));
        }
        Ok(())
    }
}
