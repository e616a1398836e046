//! The bytes of a Parquet file, without pages that unpack to more than a recording has.
//!
//! The decoder reserves what a page's header promises before it looks at the page. So the header is read on the way:
//! the first three fields of `PageHeader` are kind, unpacked and packed size, each a 32-bit integer in Thrift's compact
//! protocol (<https://parquet.apache.org/docs/file-format/data-pages/>).

use std::io::{self, Read};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use parquet::errors::{ParquetError, Result};
use parquet::file::reader::{ChunkReader, Length};

use crate::limits::{self, BLOCK, Limit};

/// What has been unpacked, and what was refused.
pub(super) struct Budget {
    whole: Limit,
    unpacked: AtomicU64,
    refused: Mutex<Option<(Limit, u64)>>,
}

impl Budget {
    /// The limit that was exceeded, and what was found.
    pub(super) fn refused(&self) -> Option<(Limit, u64)> {
        *self.refused.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a page of this unpacked size.
    fn take(&self, size: u64) -> io::Result<()> {
        let unpacked = self.unpacked.fetch_add(size, Ordering::Relaxed);
        let whole = unpacked.saturating_add(size);
        for (limit, found) in [(BLOCK, size), (self.whole, whole)] {
            if found > limit.most {
                let mut refused = self.refused.lock().unwrap_or_else(PoisonError::into_inner);
                *refused = Some((limit, found));
                return Err(io::Error::other("a page is too large"));
            }
        }
        Ok(())
    }
}

/// A file whose pages are watched once its footer has been read.
pub(super) struct Pages<R> {
    file: R,
    budget: Arc<Budget>,
    is_watched: AtomicBool,
}

impl<R: Length> Pages<R> {
    pub(super) fn new(file: R) -> Arc<Self> {
        let budget = Budget {
            whole: limits::unpacked(file.len()),
            unpacked: AtomicU64::new(0),
            refused: Mutex::new(None),
        };
        Arc::new(Self {
            file,
            budget: Arc::new(budget),
            is_watched: AtomicBool::new(false),
        })
    }

    pub(super) fn budget(&self) -> Arc<Budget> {
        Arc::clone(&self.budget)
    }

    /// From now on what is read begins with the header of a page.
    pub(super) fn watch(&self) {
        self.is_watched.store(true, Ordering::Relaxed);
    }
}

/// What the decoder reads from.
pub(super) struct Watched<R>(pub(super) Arc<Pages<R>>);

impl<R: Length> Length for Watched<R> {
    fn len(&self) -> u64 {
        self.0.file.len()
    }
}

impl<R: ChunkReader> ChunkReader for Watched<R> {
    type T = PageInput<R::T>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        let pages = &self.0;
        let is_watched = pages.is_watched.load(Ordering::Relaxed);
        Ok(PageInput {
            input: pages.file.get_read(start)?,
            head: Vec::new(),
            budget: is_watched.then(|| pages.budget()),
        })
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let end = start.checked_add(length as u64);
        if end.is_none_or(|end| end > self.len()) {
            let problem = "a part of it reaches beyond the end of the file";
            return Err(ParquetError::EOF(problem.to_owned()));
        }
        self.0.file.get_bytes(start, length)
    }
}

/// A page: its header is looked at while it is read.
pub(super) struct PageInput<T> {
    input: T,
    /// The header so far, until its sizes are known.
    head: Vec<u8>,
    /// Until they are known.
    budget: Option<Arc<Budget>>,
}

impl<T: Read> Read for PageInput<T> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.input.read(out)?;
        if let Some(budget) = &self.budget {
            self.head.extend_from_slice(&out[..read]);
            match unpacked_size(&self.head) {
                Size::Unknown => {}
                Size::Known(size) => {
                    budget.take(size)?;
                    self.budget = None;
                }
                Size::NoPage => return Err(io::Error::other("the header of a page is damaged")),
            }
        }
        Ok(read)
    }
}

/// What the beginning of a header says of the page.
#[derive(Debug, PartialEq)]
enum Size {
    /// More of it is needed.
    Unknown,
    Known(u64),
    NoPage,
}

fn unpacked_size(head: &[u8]) -> Size {
    /// The next field, a 32-bit integer.
    const NEXT_I32: u8 = 0x15;
    let (mut bytes, mut size) = (head.iter(), 0);
    for _kind_then_size in 0..2 {
        match bytes.next() {
            None => return Size::Unknown,
            Some(&NEXT_I32) => {}
            Some(_) => return Size::NoPage,
        }
        (size, bytes) = match varint(bytes) {
            Ok(read) => read,
            Err(problem) => return problem,
        };
    }
    // Zigzag: an odd number is negative.
    match size % 2 {
        0 => Size::Known(size / 2),
        _ => Size::NoPage,
    }
}

type Bytewise<'a> = std::slice::Iter<'a, u8>;

fn varint(mut bytes: Bytewise<'_>) -> std::result::Result<(u64, Bytewise<'_>), Size> {
    let mut number = 0;
    for place in 0..5 {
        let byte = *bytes.next().ok_or(Size::Unknown)?;
        number |= u64::from(byte & 0x7f) << (7 * place);
        if byte < 0x80 {
            return Ok((number, bytes));
        }
    }
    Err(Size::NoPage)
}

#[cfg(test)]
mod tests {
    use super::{Size, unpacked_size};

    #[test]
    fn the_size_is_found_as_soon_as_it_is_there() {
        // Kind 0, 300 bytes unpacked, 20 packed.
        let head = [0x15, 0, 0x15, 0xd8, 0x04, 0x15, 0x28];
        for length in 0..5 {
            assert_eq!(unpacked_size(&head[..length]), Size::Unknown, "{length}");
        }
        assert_eq!(unpacked_size(&head[..5]), Size::Known(300));
        assert_eq!(unpacked_size(&head), Size::Known(300));
    }

    #[test]
    fn other_fields_negative_and_endless_numbers_are_no_page() {
        for head in [
            &[0x16, 0][..],
            &[0x15, 0, 0x15, 0x01],
            &[0x15, 0xff, 0xff, 0xff, 0xff, 0xff],
        ] {
            assert_eq!(unpacked_size(head), Size::NoPage, "{head:?}");
        }
    }
}
