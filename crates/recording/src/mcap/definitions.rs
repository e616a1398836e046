//! Schemas and channels of an MCAP file, and the fields of its records.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use ::mcap::{Channel, Message, Schema};

use super::message_definition::{HASH, Stated, name_of};
use super::records::Stop;
use crate::limits::DEFINITIONS;

/// The fields of a record that are still to be read: integers little-endian, texts behind their length.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes behind their length.
    pub(super) fn block(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.bytes(usize::try_from(length).ok()?)
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.block()?).ok()
    }

    fn pairs(&mut self) -> Option<BTreeMap<String, String>> {
        let mut pairs = BTreeMap::new();
        let mut fields = Self(self.block()?);
        while !fields.0.is_empty() {
            pairs.insert(fields.text()?.to_owned(), fields.text()?.to_owned());
        }
        Some(pairs)
    }
}

/// The schemas and channels so far.
#[derive(Default)]
pub(super) struct Definitions {
    schemas: BTreeMap<u16, Arc<Schema<'static>>>,
    channels: BTreeMap<u16, Arc<Channel<'static>>>,
    /// Bytes of all of them.
    bytes: u64,
}

impl Definitions {
    /// The channels, by their numbers.
    pub(super) fn into_channels(self) -> Vec<Arc<Channel<'static>>> {
        self.channels.into_values().collect()
    }

    /// Takes a schema; it may be repeated, but not changed.
    pub(super) fn schema(&mut self, record: &[u8]) -> Result<(), Stop> {
        Stop::check(DEFINITIONS, record.len() as u64)?;
        let schema = schema(record).ok_or_else(|| damaged("a schema"))?;
        if let Some(known) = self.schemas.get(&schema.id) {
            return same(**known == schema, "schema", schema.id);
        }
        self.count(record)?;
        self.schemas.insert(schema.id, Arc::new(schema));
        Ok(())
    }

    /// Takes a channel; it may be repeated, but not changed.
    pub(super) fn channel(&mut self, record: &[u8]) -> Result<(), Stop> {
        Stop::check(DEFINITIONS, record.len() as u64)?;
        let channel = self
            .channel_of(record)
            .ok_or_else(|| damaged("a channel"))?;
        if let Some(known) = self.channels.get(&channel.id) {
            return same(**known == channel, "channel", channel.id);
        }
        self.count(record)?;
        self.channels.insert(channel.id, Arc::new(channel));
        Ok(())
    }

    fn channel_of(&self, record: &[u8]) -> Option<Channel<'static>> {
        let mut fields = Fields(record);
        let id = fields.u16()?;
        let schema = match fields.u16()? {
            0 => None,
            id => Some(Arc::clone(self.schemas.get(&id)?)),
        };
        let mut channel = Channel {
            id,
            schema,
            topic: fields.text()?.to_owned(),
            message_encoding: fields.text()?.to_owned(),
            metadata: fields.pairs()?,
        };
        if let Some(schema) = &mut channel.schema {
            let stated = Stated {
                encoding: &schema.encoding,
                definition: std::str::from_utf8(&schema.data).unwrap_or_default(),
                hash: channel.metadata.get(HASH).map_or("", String::as_str),
            };
            let name = name_of(&schema.name, stated);
            if name != schema.name {
                Arc::make_mut(schema).name = name;
            }
        }
        Some(channel)
    }

    /// A message, with its channel.
    pub(super) fn message(&self, record: &[u8]) -> Result<Message<'static>, Stop> {
        let mut fields = Fields(record);
        let mut read = || {
            let channel = Arc::clone(self.channels.get(&fields.u16()?)?);
            let (sequence, log_time) = (fields.u32()?, fields.u64()?);
            Some(Message {
                channel,
                sequence,
                log_time,
                publish_time: fields.u64()?,
                data: Cow::Owned(fields.0.to_vec()),
            })
        };
        read().ok_or_else(|| damaged("a message, or its channel,"))
    }

    fn count(&mut self, record: &[u8]) -> Result<(), Stop> {
        self.bytes = self.bytes.saturating_add(record.len() as u64);
        Stop::check(DEFINITIONS, self.bytes)
    }
}

fn schema(record: &[u8]) -> Option<Schema<'static>> {
    let mut fields = Fields(record);
    Some(Schema {
        id: fields.u16().filter(|id| *id != 0)?,
        name: fields.text()?.to_owned(),
        encoding: fields.text()?.to_owned(),
        data: Cow::Owned(fields.block()?.to_vec()),
    })
}

fn same(is_same: bool, what: &str, id: u16) -> Result<(), Stop> {
    if is_same {
        return Ok(());
    }
    Err(Stop::Cut(format!("{what} {id} is defined in two ways")))
}

fn damaged(what: &str) -> Stop {
    Stop::Cut(format!("{what} is damaged"))
}
