//! Lets through what of a log is needed, and what is safe to parse.
//!
//! Read first: PX4 Guide, *ULog File Format*. A log is a header of 16 bytes and messages: length (`u16`),
//! kind (one byte), content. Parsers reserve memory for arrays as long as a definition says and follow
//! nested definitions; therefore only the formats of the known topics, flat and short, their
//! subscriptions and their data pass.

use std::collections::BTreeSet;
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::text::read_piece;

const HEADER: usize = 16;
/// Longest array that a field of the known topics has, with room for later versions.
const LONGEST_ARRAY: usize = 64;

/// A log of which only the known topics are left.
pub(super) struct Screen<R> {
    input: R,
    topics: &'static [&'static str],
    /// Topics whose format has passed.
    formats: BTreeSet<String>,
    /// Subscriptions that have passed.
    subscriptions: BTreeSet<u16>,
    /// What has passed and is not read yet.
    passed: Vec<u8>,
    at: usize,
    begun: bool,
    over: bool,
    /// Set when the log ends within a message.
    cut_off: Arc<AtomicBool>,
}

impl<R: Read> Screen<R> {
    pub(super) fn new(input: R, topics: &'static [&'static str], cut_off: Arc<AtomicBool>) -> Self {
        Self {
            input,
            topics,
            formats: BTreeSet::new(),
            subscriptions: BTreeSet::new(),
            passed: Vec::new(),
            at: 0,
            begun: false,
            over: false,
            cut_off,
        }
    }

    /// Reads on until something passes or the log is over.
    fn refill(&mut self) -> std::io::Result<()> {
        self.passed.clear();
        self.at = 0;
        if !self.begun {
            self.begun = true;
            let mut header = [0; HEADER];
            if fill(&mut self.input, &mut header)? < HEADER {
                self.end(true);
            }
            self.passed.extend_from_slice(&header);
            return Ok(());
        }
        while !self.over && self.passed.is_empty() {
            self.message()?;
        }
        Ok(())
    }

    /// Reads one message; it passes or not.
    fn message(&mut self) -> std::io::Result<()> {
        let mut head = [0; 3];
        let read = fill(&mut self.input, &mut head)?;
        if read < head.len() {
            self.end(read > 0);
            return Ok(());
        }
        let [low, high, kind] = head;
        let mut content = vec![0; usize::from(u16::from_le_bytes([low, high]))];
        if fill(&mut self.input, &mut content)? < content.len() {
            self.end(true);
            return Ok(());
        }
        if self.passes(kind, &content) {
            self.passed.extend_from_slice(&head);
            self.passed.extend_from_slice(&content);
        }
        Ok(())
    }

    fn end(&mut self, cut_off: bool) {
        self.over = true;
        if cut_off {
            self.cut_off.store(true, Ordering::Relaxed);
        }
    }

    fn passes(&mut self, kind: u8, content: &[u8]) -> bool {
        match kind {
            b'F' => self.format_passes(content),
            b'A' => self.subscription_passes(content),
            b'D' => {
                let id = content.first_chunk().map(|id| u16::from_le_bytes(*id));
                id.is_some_and(|id| self.subscriptions.contains(&id))
            }
            _ => false,
        }
    }

    /// `name:type field;type[4] field;...`
    fn format_passes(&mut self, content: &[u8]) -> bool {
        let text = std::str::from_utf8(content).unwrap_or_default();
        let Some((name, fields)) = text.split_once(':') else {
            return false;
        };
        let known = self.topics.contains(&name) && !self.formats.contains(name);
        let mut fields = fields.split(';').filter(|field| !field.is_empty());
        if !known || !fields.all(is_flat) {
            return false;
        }
        self.formats.insert(name.to_owned())
    }

    /// The first of several sensors of a kind (`u8`), an id (`u16`), the name of its format.
    fn subscription_passes(&mut self, content: &[u8]) -> bool {
        let Some((&[number, low, high], name)) = content.split_first_chunk::<3>() else {
            return false;
        };
        let name = std::str::from_utf8(name).unwrap_or_default();
        let passes = number == 0 && self.formats.contains(name);
        let id = u16::from_le_bytes([low, high]);
        passes && self.subscriptions.insert(id)
    }
}

/// Whether a field is a number or a short array of numbers, with a name and nothing else: what else a parser
/// finds there (numbers that are too large for it, say) it need not survive.
fn is_flat(field: &str) -> bool {
    let Some((kind, name)) = field.split_once(' ') else {
        return false;
    };
    let is_name = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
    let (base, length) = match kind.strip_suffix(']').and_then(|k| k.split_once('[')) {
        Some((base, length)) => (base, length.parse().unwrap_or(usize::MAX)),
        None => (kind, 1),
    };
    let is_number = matches!(
        base,
        "int8_t"
            | "uint8_t"
            | "int16_t"
            | "uint16_t"
            | "int32_t"
            | "uint32_t"
            | "int64_t"
            | "uint64_t"
            | "float"
            | "double"
            | "bool"
            | "char"
    );
    is_name && is_number && length <= LONGEST_ARRAY
}

/// Reads until the buffer is full or the input ends; how much was read.
fn fill(input: &mut impl Read, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match read_piece(input, &mut buffer[filled..])? {
            0 => break,
            read => filled += read,
        }
    }
    Ok(filled)
}

impl<R: Read> Read for Screen<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.at == self.passed.len() {
            self.refill()?;
        }
        let count = buffer.len().min(self.passed.len() - self.at);
        buffer[..count].copy_from_slice(&self.passed[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}
