//! A file or bytes that several readers read, each at a place of its own.

use std::io::{self, Read, Seek, SeekFrom};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::file::Input;

/// One reader; a clone begins where it stands.
#[derive(Clone)]
pub(super) struct Shared {
    input: Arc<Mutex<Box<dyn Input>>>,
    at: u64,
}

impl Shared {
    /// A reader at the beginning.
    pub(super) fn new(input: Box<dyn Input>) -> Self {
        Self {
            input: Arc::new(Mutex::new(input)),
            at: 0,
        }
    }

    /// Another reader, at the beginning.
    pub(super) fn another(&self) -> Self {
        Self {
            input: Arc::clone(&self.input),
            at: 0,
        }
    }

    fn input(&self) -> MutexGuard<'_, Box<dyn Input>> {
        self.input.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Read for Shared {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut input = self.input();
        input.seek(SeekFrom::Start(self.at))?;
        let read = input.read(bytes)?;
        drop(input);
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for Shared {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let mut input = self.input();
        input.seek(SeekFrom::Start(self.at))?;
        let at = input.seek(to)?;
        drop(input);
        self.at = at;
        Ok(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    #[test]
    fn readers_do_not_move_each_other() {
        let mut one = Shared::new(Box::new(Cursor::new(b"0123456789".to_vec())));
        let mut bytes = [0; 3];
        one.read_exact(&mut bytes).unwrap();
        let mut other = one.another();
        other.seek(SeekFrom::End(-4)).unwrap();
        one.read_exact(&mut bytes).unwrap();
        assert_eq!(&bytes, b"345");
        other.read_exact(&mut bytes).unwrap();
        assert_eq!(&bytes, b"678");
        let mut third = one.another();
        third.read_exact(&mut bytes).unwrap();
        assert_eq!(&bytes, b"012");
    }
}
