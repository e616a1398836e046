//! The bytes of a Parquet file, without pages that unpack to more than a recording has.
//!
//! The decoder reserves what a page's header promises before it looks at the page. So the header is read on the way:
//! the first three fields of `PageHeader` are kind, unpacked and packed size, each a 32-bit integer in Thrift's compact
//! protocol (<https://parquet.apache.org/docs/file-format/data-pages/>).

//!
//! Of all decoders that are built in, gzip's alone does not stop at that size: its pages are unpacked here before, into
//! nothing.

use std::io::{self, Read};
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use bytes::Bytes;
use flate2::read::MultiGzDecoder;
use parquet::errors::{ParquetError, Result};
use parquet::file::reader::{ChunkReader, Length};

use crate::limits::{self, BLOCK, Limit};

/// What is said of gzip in pages of version 2.
pub(super) const GZIP_VERSION_2: &str = "gzip in data pages of version 2 is not read";

/// What has been unpacked, and what was refused.
pub(super) struct Budget {
    whole: Limit,
    unpacked: AtomicU64,
    refused: Mutex<Option<(Limit, u64)>>,
    /// What the next page unpacks to by its own word if it is of gzip, else [`NOT_GZIP`].
    gzip_size: AtomicU64,
}

const NOT_GZIP: u64 = u64::MAX;

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
    /// Where in the file the columns of gzip stand; set once it is watched.
    gzip: OnceLock<Vec<Range<u64>>>,
}

impl<R: Length> Pages<R> {
    pub(super) fn new(file: R) -> Arc<Self> {
        let budget = Budget {
            whole: limits::unpacked(file.len()),
            unpacked: AtomicU64::new(0),
            refused: Mutex::new(None),
            gzip_size: AtomicU64::new(NOT_GZIP),
        };
        Arc::new(Self {
            file,
            budget: Arc::new(budget),
            gzip: OnceLock::new(),
        })
    }

    pub(super) fn budget(&self) -> Arc<Budget> {
        Arc::clone(&self.budget)
    }

    /// From now on what is read begins with the header of a page; `gzip` are the places of columns of gzip.
    pub(super) fn watch(&self, gzip: Vec<Range<u64>>) {
        self.gzip.get_or_init(|| gzip);
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
        let gzip = pages.gzip.get();
        Ok(PageInput {
            input: pages.file.get_read(start)?,
            head: Vec::new(),
            budget: gzip.map(|_| pages.budget()),
            is_gzip: gzip.is_some_and(|places| places.iter().any(|place| place.contains(&start))),
        })
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let end = start.checked_add(length as u64);
        if end.is_none_or(|end| end > self.len()) {
            let problem = "a part of it reaches beyond the end of the file";
            return Err(ParquetError::EOF(problem.to_owned()));
        }
        let page = self.0.file.get_bytes(start, length)?;
        match self.0.budget.gzip_size.swap(NOT_GZIP, Ordering::Relaxed) {
            NOT_GZIP => {}
            size => check_gzip(&page, size)?,
        }
        Ok(page)
    }
}

/// Refuses a page of gzip that unpacks to more than `size` bytes.
fn check_gzip(page: &[u8], size: u64) -> Result<()> {
    let mut unpacked = MultiGzDecoder::new(page).take(size + 1);
    if io::copy(&mut unpacked, &mut io::sink())? > size {
        let problem = "a page unpacks to more than it says";
        return Err(ParquetError::General(problem.to_owned()));
    }
    Ok(())
}

/// A page: its header is looked at while it is read.
pub(super) struct PageInput<T> {
    input: T,
    /// The header so far, until its sizes are known.
    head: Vec<u8>,
    /// Until they are known.
    budget: Option<Arc<Budget>>,
    is_gzip: bool,
}

impl<T: Read> Read for PageInput<T> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        /// The kind of a page of version 2, in which bytes that are not packed stand before those that are.
        const VERSION_2: u8 = 6;
        let read = self.input.read(out)?;
        if let Some(budget) = &self.budget {
            self.head.extend_from_slice(&out[..read]);
            match unpacked_size(&self.head) {
                Size::Unknown => {}
                Size::Known(size) => {
                    budget.take(size)?;
                    if self.is_gzip && self.head.get(1) == Some(&VERSION_2) {
                        return Err(io::Error::other(GZIP_VERSION_2));
                    }
                    if self.is_gzip {
                        budget.gzip_size.store(size, Ordering::Relaxed);
                    }
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
    use super::{Size, check_gzip, unpacked_size};
    use flate2::{Compression, read::GzEncoder};
    use std::io::Read;

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

    #[test]
    fn a_page_of_gzip_is_refused_where_it_is_larger_than_it_says() {
        let mut page = Vec::new();
        let mut encoder = GzEncoder::new(&[0; 1_000_000][..], Compression::default());
        encoder.read_to_end(&mut page).unwrap();
        assert!(check_gzip(&page, 1_000_000).is_ok());
        assert!(check_gzip(&page, 999_999).is_err());
        assert!(check_gzip(&page[..page.len() / 2], 1_000_000).is_err());
        // A second stream behind the first counts too.
        assert!(check_gzip(&[&page[..], &page].concat(), 1_000_000).is_err());
    }
}
