//! Cuts a byte stream into lines, with a limit on their length.

/// Longest line that is kept, bytes.
const LONGEST: usize = 4096;

/// The unfinished end of a stream of lines.
#[derive(Debug, Clone, Default)]
pub(super) struct Lines {
    partial: Vec<u8>,
    /// The line under way was too long; its rest is skipped.
    skipping: bool,
}

impl Lines {
    /// Calls `line` for each line that `bytes` complete, without its end and never empty; returns
    /// how many lines were too long and were skipped.
    pub(super) fn push(&mut self, bytes: &[u8], mut line: impl FnMut(&[u8])) -> u64 {
        let mut too_long = 0;
        for piece in bytes.split_inclusive(|&byte| byte == b'\n') {
            let ended = piece.ends_with(b"\n");
            let text = if ended {
                &piece[..piece.len() - 1]
            } else {
                piece
            };
            if !self.skipping && self.partial.len() + text.len() > LONGEST {
                too_long += 1;
                self.partial.clear();
                self.skipping = true;
            }
            if !self.skipping {
                self.partial.extend_from_slice(text);
            }
            if ended {
                let whole = self.partial.trim_ascii();
                if !whole.is_empty() {
                    line(whole);
                }
                self.partial.clear();
                self.skipping = false;
            }
        }
        too_long
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_out_whole_however_the_stream_is_cut() {
        let text = b"one\r\n\r\ntwo\nthree\nunfinished";
        for cut in 1..text.len() {
            let mut lines = Lines::default();
            let mut found = Vec::new();
            for piece in text.chunks(cut) {
                let too_long = lines.push(piece, |line| found.push(line.to_vec()));
                assert_eq!(too_long, 0);
            }
            assert_eq!(found, [b"one".to_vec(), b"two".to_vec(), b"three".to_vec()]);
        }
    }

    #[test]
    fn a_line_that_never_ends_is_skipped_in_bounded_memory() {
        let mut lines = Lines::default();
        let mut found = Vec::new();
        let mut too_long = 0;
        for _ in 0..100 {
            too_long += lines.push(&[b'x'; 1000], |line| found.push(line.to_vec()));
            assert!(lines.partial.len() <= LONGEST);
        }
        too_long += lines.push(b"\nnext\n", |line| found.push(line.to_vec()));
        assert_eq!(too_long, 1);
        assert_eq!(found, [b"next".to_vec()]);
    }
}
