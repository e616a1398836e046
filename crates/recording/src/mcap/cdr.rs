//! CDR, the bytes of ROS 2 messages, and those of ROS 1: what `Imu`, `MagneticField` and their header need, no more.
//!
//! Read first: OMG DDSI-RTPS, section 10 (encapsulation header), and CORBA's CDR: numbers stand on
//! multiples of their size, counted from behind the 4 bytes of the encapsulation header; a string is
//! its length with the closing zero (`u32`), the bytes, the zero.

/// Plain CDR, little-endian.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];
/// Stands in front of messages of ROS 1, which have no header of their own: as CDR without gaps between the numbers,
/// texts without a closing zero, and a number in front of the stamp.
pub(crate) const ROS_1: [u8; 4] = [b'R', b'1', 0, 0];
const HEADER: usize = 4;
/// Longest string that is read: names of frames are short.
const LONGEST_STRING: usize = 4096;

/// Writes one message.
#[derive(Debug)]
pub(crate) struct CdrWriter {
    bytes: Vec<u8>,
}

impl CdrWriter {
    pub(crate) fn new() -> Self {
        Self {
            bytes: LITTLE_ENDIAN.to_vec(),
        }
    }

    fn align(&mut self, size: usize) {
        while !(self.bytes.len() - HEADER).is_multiple_of(size) {
            self.bytes.push(0);
        }
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn i32(&mut self, value: i32) {
        self.align(4);
        self.bytes.extend_from_slice(&value.to_le_bytes());
    }

    /// A number of one to eight bytes, little-endian.
    pub(crate) fn bytes(&mut self, number: &[u8]) {
        self.align(number.len());
        self.bytes.extend_from_slice(number);
    }

    /// A short text of this program.
    pub(crate) fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    pub(crate) fn f64s(&mut self, values: &[f64]) {
        self.align(8);
        for value in values {
            self.bytes.extend_from_slice(&value.to_le_bytes());
        }
    }

    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

/// Reads one message; every method gives `None` where the bytes do not hold what is asked for.
#[derive(Debug)]
pub(crate) struct CdrReader<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    is_ros_1: bool,
}

impl<'a> CdrReader<'a> {
    /// A reader behind the encapsulation header, plain CDR of either byte order.
    pub(crate) fn new(bytes: &'a [u8]) -> Option<Self> {
        let (header, rest) = bytes.split_first_chunk::<HEADER>()?;
        let is_ros_1 = *header == ROS_1;
        let big_endian = match header[..2] {
            [0, 0] => true,
            [0, 1] => false,
            _ if is_ros_1 => false,
            _ => return None,
        };
        Some(Self {
            bytes: rest,
            at: 0,
            big_endian,
            is_ros_1,
        })
    }

    /// Whether the message is one of ROS 1.
    pub(crate) fn is_ros_1(&self) -> bool {
        self.is_ros_1
    }

    /// A number of `N` bytes, little-endian.
    pub(crate) fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let at = match self.is_ros_1 {
            true => self.at,
            false => self.at.next_multiple_of(N),
        };
        let mut bytes: [u8; N] = self.bytes.get(at..at + N)?.try_into().ok()?;
        self.at = at + N;
        if self.big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }

    pub(crate) fn skip_string(&mut self) -> Option<()> {
        self.string_bytes().map(|_| ())
    }

    /// A text without its closing zero.
    pub(crate) fn string(&mut self) -> Option<&'a str> {
        let bytes = self.string_bytes()?;
        std::str::from_utf8(bytes.strip_suffix(b"\0").unwrap_or(bytes)).ok()
    }

    fn string_bytes(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.u32()?).ok()?;
        if length > LONGEST_STRING {
            return None;
        }
        let bytes = self.bytes.get(self.at..self.at + length)?;
        self.at += length;
        Some(bytes)
    }

    pub(crate) fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.take().map(f64::from_le_bytes)?;
        }
        Some(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_the_one_worked_out_by_hand() {
        let mut writer = CdrWriter::new();
        writer.i32(-2);
        writer.u32(7);
        writer.string("imu");
        writer.f64s(&[1.0, -0.5]);
        // Behind the header: 4 + 4 + 4 (length 4 with the zero) + 4 = 16, a multiple of 8: no padding.
        let by_hand = [
            &[0, 1, 0, 0][..],
            &[0xfe, 0xff, 0xff, 0xff],
            &[7, 0, 0, 0],
            &[4, 0, 0, 0, b'i', b'm', b'u', 0],
            &[0, 0, 0, 0, 0, 0, 0xf0, 0x3f],
            &[0, 0, 0, 0, 0, 0, 0xe0, 0xbf],
        ]
        .concat();
        assert_eq!(writer.into_bytes(), by_hand);
    }

    #[test]
    fn numbers_stand_on_multiples_of_their_size() {
        let mut writer = CdrWriter::new();
        writer.string("a");
        writer.f64s(&[2.0]);
        let bytes = writer.into_bytes();
        // 4 + 2 bytes of string, 2 of padding.
        assert_eq!(bytes[4..12], [2, 0, 0, 0, b'a', 0, 0, 0]);
        assert_eq!(bytes.len(), 4 + 8 + 8);
        let mut reader = CdrReader::new(&bytes).unwrap();
        reader.skip_string().unwrap();
        assert_eq!(
            reader.f64s::<1>().map(|v| v[0].to_bits()),
            Some(2.0_f64.to_bits())
        );
        assert_eq!(reader.f64s::<1>(), None);
    }

    #[test]
    fn the_other_byte_order_is_read_and_what_is_cut_is_not() {
        let bytes = [0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 2, b'x', 0];
        let mut reader = CdrReader::new(&bytes).unwrap();
        assert_eq!(reader.i32(), Some(5));
        assert_eq!(reader.skip_string(), Some(()));
        assert_eq!(reader.u32(), None);
        assert!(CdrReader::new(&[0, 1]).is_none());
        assert!(CdrReader::new(&[9, 9, 0, 0]).is_none());
        let endless = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff];
        assert_eq!(CdrReader::new(&endless).unwrap().skip_string(), None);
    }
}
