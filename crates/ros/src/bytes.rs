//! Messages as they are on the wire: the bytes of CDR, which `northing_recording::mcap` reads and writes.

use serde::de::{DeserializeSeed, Deserializer, SeqAccess, Visitor};
use serde::ser::{Serialize, SerializeTuple, Serializer};

/// The encapsulation header that the middleware keeps to itself: plain CDR, little-endian, as every machine that ROS 2 runs
/// on writes it.
const HEADER: [u8; 4] = [0, 1, 0, 0];
/// More than any message that is read here has: an `Odometry` has some 700 bytes.
const MOST: usize = 1 << 16;

/// A message behind its four bytes of encapsulation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Bytes(pub(crate) Vec<u8>);

/// Written number by number: a tuple of bytes has neither a length nor gaps in CDR.
impl Serialize for Bytes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let body = self.0.get(HEADER.len()..).unwrap_or_default();
        let mut tuple = serializer.serialize_tuple(body.len())?;
        for byte in body {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}

/// Reads whatever bytes there are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AnyBytes;

impl<'de> DeserializeSeed<'de> for AnyBytes {
    type Value = Bytes;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Bytes, D::Error> {
        deserializer.deserialize_tuple(MOST, self)
    }
}

impl<'de> Visitor<'de> for AnyBytes {
    type Value = Bytes;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the bytes of a message")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut bytes: A) -> Result<Bytes, A::Error> {
        let mut read = HEADER.to_vec();
        // The end of the message is an error to the deserializer, which expects as many as there can be.
        while let Ok(Some(byte)) = bytes.next_element() {
            read.push(byte);
        }
        Ok(Bytes(read))
    }
}
