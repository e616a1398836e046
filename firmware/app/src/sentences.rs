//! What comes out: sentences in the form of NMEA 0183, checksummed, of integers, readable by eye.
//!
//! Read first: `docs/wire_formats.md`, section "Northing boards". Each is `$PNORx,fields*hh` and a line
//! end; `hh` is the exclusive or of the bytes between `$` and `*`. A field that is empty is unknown.

/// Takes bytes, in order.
pub trait Sink {
    /// Takes a byte.
    fn put(&mut self, byte: u8);
}

impl<F: FnMut(u8)> Sink for F {
    fn put(&mut self, byte: u8) {
        self(byte);
    }
}

/// A sentence being written.
#[derive(Debug)]
pub struct Sentence<'a, S: Sink> {
    sink: &'a mut S,
    sum: u8,
}

impl<'a, S: Sink> Sentence<'a, S> {
    /// Begins `$PNORx`.
    pub fn new(sink: &'a mut S, kind: u8) -> Self {
        sink.put(b'$');
        let mut sentence = Self { sink, sum: 0 };
        sentence.bytes(b"PNOR");
        sentence.byte(kind);
        sentence
    }

    /// A field of text, which must be free of `,`, `*` and control characters.
    pub fn text(mut self, text: &[u8]) -> Self {
        self.byte(b',');
        self.bytes(text);
        self
    }

    /// An empty field.
    pub fn empty(self) -> Self {
        self.text(b"")
    }

    /// A number.
    pub fn integer(mut self, value: i32) -> Self {
        self.byte(b',');
        if value < 0 {
            self.byte(b'-');
        }
        self.digits(value.unsigned_abs());
        self
    }

    /// A number without sign.
    pub fn unsigned(mut self, value: u32) -> Self {
        self.byte(b',');
        self.digits(value);
        self
    }

    /// Three numbers, or three empty fields.
    pub fn vector(self, value: Option<[i32; 3]>) -> Self {
        match value {
            Some([x, y, z]) => self.integer(x).integer(y).integer(z),
            None => self.empty().empty().empty(),
        }
    }

    /// Eight hexadecimal digits.
    pub fn bits(mut self, value: u32) -> Self {
        self.byte(b',');
        for shift in (0..8).rev() {
            self.byte(hex_digit(value >> (shift * 4)));
        }
        self
    }

    /// Ends the sentence.
    pub fn end(self) {
        let sum = u32::from(self.sum);
        for byte in [b'*', hex_digit(sum >> 4), hex_digit(sum), b'\r', b'\n'] {
            self.sink.put(byte);
        }
    }

    fn digits(&mut self, value: u32) {
        let mut reversed = [0; 10];
        let mut rest = value;
        let mut length = 0;
        for slot in &mut reversed {
            *slot = b'0' + (rest % 10) as u8;
            rest /= 10;
            length += 1;
            if rest == 0 {
                break;
            }
        }
        for byte in reversed.iter().take(length).rev() {
            self.byte(*byte);
        }
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.byte(*byte);
        }
    }

    fn byte(&mut self, byte: u8) {
        self.sum ^= byte;
        self.sink.put(byte);
    }
}

/// The lowest four bits as a digit.
fn hex_digit(value: u32) -> u8 {
    let low = (value & 0xf) as u8;
    if low < 10 {
        b'0' + low
    } else {
        b'A' + low - 10
    }
}

/// `value * scale` as the nearest integer; what does not fit is the largest there is, and what is no
/// number is 0.
#[must_use]
pub fn fixed(value: f32, scale: f32) -> i32 {
    let scaled = value * scale;
    let half = if scaled < 0.0 { -0.5 } else { 0.5 };
    (scaled + half) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::string::String;

    fn written(write: impl FnOnce(&mut dyn FnMut(u8))) -> String {
        let mut text = String::new();
        write(&mut |byte| text.push(char::from(byte)));
        text
    }

    #[test]
    fn fields_are_written_and_summed() {
        let text = written(|mut out| {
            let sentence = Sentence::new(&mut out, b'X')
                .integer(-120)
                .unsigned(u32::MAX);
            sentence
                .vector(None)
                .integer(0)
                .bits(0x1234_ABCD)
                .text(b"a")
                .end();
        });
        assert_eq!(text, "$PNORX,-120,4294967295,,,,0,1234ABCD,a*19\r\n");
        let body = text
            .trim_end()
            .trim_start_matches('$')
            .split('*')
            .next()
            .unwrap();
        assert_eq!(body.bytes().fold(0, |sum, byte| sum ^ byte), 0x19);
        let text = written(|mut out| Sentence::new(&mut out, b'X').integer(i32::MIN).end());
        assert!(text.contains("-2147483648*"));
    }

    #[test]
    fn numbers_are_rounded_and_held_within_what_fits() {
        assert_eq!(fixed(1.2346, 1000.0), 1235);
        assert_eq!(fixed(-1.2346, 1000.0), -1235);
        assert_eq!(fixed(1e12, 1000.0), i32::MAX);
        assert_eq!(fixed(f32::NAN, 1.0), 0);
    }
}
