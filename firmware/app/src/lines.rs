//! Cuts bytes into lines of bounded length.

/// Collects a line of up to `N` bytes.
#[derive(Debug, Clone)]
pub struct Lines<const N: usize> {
    bytes: [u8; N],
    length: usize,
    /// The line under way was too long; its rest is skipped.
    skipping: bool,
    /// Lines that were left out because they did not end, wrapping.
    pub too_long: u32,
}

impl<const N: usize> Lines<N> {
    /// Nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [0; N],
            length: 0,
            skipping: false,
            too_long: 0,
        }
    }

    /// Takes a byte; the line it completes, without its end, unless that is empty.
    pub fn push(&mut self, byte: u8) -> Option<&[u8]> {
        if byte == b'\n' || byte == b'\r' {
            let length = core::mem::take(&mut self.length);
            let skipped = core::mem::take(&mut self.skipping);
            return self
                .bytes
                .get(..length)
                .filter(|line| !skipped && !line.is_empty());
        }
        if self.skipping {
            return None;
        }
        if let Some(slot) = self.bytes.get_mut(self.length) {
            *slot = byte;
            self.length += 1;
        } else {
            self.skipping = true;
            self.too_long = self.too_long.wrapping_add(1);
        }
        None
    }
}

impl<const N: usize> Default for Lines<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::vec::Vec;

    fn lines(text: &[u8]) -> (Vec<Vec<u8>>, u32) {
        let mut lines = Lines::<8>::new();
        let mut found = Vec::new();
        for byte in text {
            if let Some(line) = lines.push(*byte) {
                found.push(line.to_vec());
            }
        }
        (found, lines.too_long)
    }

    #[test]
    fn lines_end_with_any_of_the_usual_ends() {
        let (found, too_long) = lines(b"one\r\n\r\ntwo\nthree\rrest");
        assert_eq!(found, [&b"one"[..], b"two", b"three"]);
        assert_eq!(too_long, 0);
    }

    #[test]
    fn a_line_that_does_not_end_is_left_out_once() {
        let (found, too_long) = lines(b"12345678\n123456789\n1234567890abcdef\nnext\n");
        assert_eq!(found, [&b"12345678"[..], b"next"]);
        assert_eq!(too_long, 2);
    }
}
