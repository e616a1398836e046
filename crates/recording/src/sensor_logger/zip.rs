//! Sensor Logger's zip: each table is unpacked as it is read, so that they can be merged without holding any of them
//! in memory or on the disk.

use std::collections::BTreeMap;
use std::io::{self, BufRead, Read, Seek};

use flate2::bufread::DeflateDecoder;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::csv_tables::CsvTables;
use super::json::Store;
use super::{TABLES, plain};
use crate::error::{RecordingError, Result, join, shown};
use crate::foreign;
use crate::limits::{self, MEMBERS};
use crate::phyphox;
use crate::text::Input;

/// The tables of a zip.
pub(super) struct Zip {
    shown: String,
    store: Store,
    tables: BTreeMap<String, Member>,
}

/// Where a table is, and what it unpacks to.
#[derive(Debug, Clone)]
struct Member {
    name: String,
    start: u64,
    packed: u64,
    size: u64,
    crc32: u32,
    is_stored: bool,
}

impl Zip {
    /// Reads the directory of the archive.
    ///
    /// # Errors
    /// It is no zip, has none of the tables, or unpacks to more than a recording of its size.
    pub(super) fn list(store: Store, input: impl Read + Seek, file: &str) -> Result<Self> {
        let damaged = |error: ZipError| RecordingError::damaged(file, shown(&error.to_string()));
        let length = store
            .length()
            .map_err(|error| RecordingError::io(file, "open it", error))?;
        let mut archive = ZipArchive::new(input).map_err(damaged)?;
        MEMBERS.check(archive.len() as u64, file, "")?;
        let (mut seen, mut tables) = (Vec::new(), BTreeMap::new());
        let mut unpacked = 0_u64;
        for index in 0..archive.len() {
            let entry = archive.by_index_raw(index).map_err(damaged)?;
            let name = entry.name().map_err(damaged)?.into_owned();
            let table = name.rsplit(['/', '\\']).next().unwrap_or_default();
            let stem = table.to_ascii_lowercase().strip_suffix(".csv").map(plain);
            let wanted = |stem: &String| {
                TABLES.contains(&stem.as_str()) || phyphox::TABLES.contains(&stem.as_str())
            };
            if let Some(stem) = stem.filter(wanted)
                && !name.contains("__MACOSX")
            {
                let member = Member {
                    name: table.to_owned(),
                    start: entry.data_start().unwrap_or(u64::MAX),
                    packed: entry.compressed_size(),
                    size: entry.size(),
                    crc32: entry.crc32(),
                    is_stored: is_stored(entry.compression(), entry.encrypted(), &name, file)?,
                };
                unpacked = unpacked.saturating_add(member.size);
                if tables.insert(stem, member).is_some() {
                    return Err(RecordingError::unsupported(
                        file,
                        format!(
                            "it has `{}` twice; zip the folder of one recording alone",
                            shown(table)
                        ),
                    ));
                }
            }
            seen.push(name);
        }
        limits::unpacked(length).check(unpacked, file, "")?;
        let names = seen.iter().map(String::as_str);
        if let Some(problem) = foreign::recognised_zip(names).filter(|_| tables.is_empty()) {
            return Err(RecordingError::unsupported(file, problem));
        }
        if tables.is_empty() {
            return Err(RecordingError::not_a_recording(
                file,
                format!("a zip of {}", join(seen.iter().map(String::as_str))),
            ));
        }
        Ok(Self {
            shown: file.to_owned(),
            store,
            tables,
        })
    }
}

/// Whether a member is stored as it is; otherwise it is deflated.
fn is_stored(method: CompressionMethod, encrypted: bool, name: &str, file: &str) -> Result<bool> {
    let problem = match method {
        _ if encrypted => {
            "is encrypted; unpack it with its password and open the folder".to_owned()
        }
        CompressionMethod::Stored => return Ok(true),
        CompressionMethod::Deflated => return Ok(false),
        other => format!("is packed with {other}; expected Deflate: unpack it and open the folder"),
    };
    let problem = format!("`{}` {problem}", shown(name));
    Err(RecordingError::unsupported(file, problem))
}

impl CsvTables for Zip {
    fn has(&self, table: &str) -> bool {
        self.tables.contains_key(table)
    }

    fn names(&self) -> Vec<String> {
        self.tables.values().map(|m| m.name.clone()).collect()
    }

    fn input(&self, table: &str) -> Result<(String, Input)> {
        let Some(member) = self.tables.get(table) else {
            return Err(RecordingError::unsupported(
                &self.shown,
                format!("there is no table `{table}` in it"),
            ));
        };
        let packed = self
            .store
            .read_from(member.start)
            .map_err(|error| RecordingError::io(&self.shown, "open it", error))?;
        let packed = packed.take(member.packed);
        let unpacked = if member.is_stored {
            Unpacked::Stored(packed)
        } else {
            Unpacked::Deflated(DeflateDecoder::new(packed))
        };
        let input = Checked {
            unpacked,
            left: member.size,
            crc32: member.crc32,
            hasher: crc32fast::Hasher::new(),
        };
        let file = format!("{}/{}", self.shown, member.name);
        Ok((file, Box::new(input)))
    }
}

type Packed = io::Take<Box<dyn BufRead + Send>>;

enum Unpacked {
    Stored(Packed),
    Deflated(DeflateDecoder<Packed>),
}

/// A member as its text, checked against its size and sum.
struct Checked {
    unpacked: Unpacked,
    /// Bytes that are still to come by the directory.
    left: u64,
    crc32: u32,
    hasher: crc32fast::Hasher,
}

impl Read for Checked {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = match &mut self.unpacked {
            Unpacked::Stored(input) => input.read(out),
            Unpacked::Deflated(input) => input.read(out),
        }?;
        let damaged = |what: &str| Err(io::Error::new(io::ErrorKind::InvalidData, what));
        let Some(left) = self.left.checked_sub(read as u64) else {
            return damaged("it unpacks to more than the zip says");
        };
        self.left = left;
        self.hasher.update(&out[..read]);
        if read == 0 && !out.is_empty() {
            if left > 0 {
                return damaged("it unpacks to less than the zip says");
            }
            if self.hasher.clone().finalize() != self.crc32 {
                return damaged("its checksum is wrong");
            }
        }
        Ok(read)
    }
}
