//! The thread that writes: begins the file, flushes, syncs, tells, and ends.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use northing_recording::mcap::LabWriter;
use tokio::sync::broadcast;

use super::{Item, RECORD_BYTES, RecordingState, Shared};
use crate::audience::Told;
use crate::lab::lock;
use crate::private;

/// What was handed over is in the system's hands after so long.
const FLUSH_INTERVAL: Duration = Duration::from_millis(250);
/// And on the disk after so long.
const SYNC_INTERVAL: Duration = Duration::from_secs(5);
/// How often pages are told how long it is.
const TELL_INTERVAL: Duration = Duration::from_secs(1);

/// A file being written.
struct Writing {
    writer: LabWriter<BufWriter<File>>,
    /// The same file, to sync it.
    file: File,
    name: String,
    started: Instant,
    flushed: Instant,
    synced: Instant,
    unflushed: bool,
}

/// Writes what is received until the lab lets go of the other end.
pub(super) fn write(
    folder: &Path,
    items: &Receiver<Item>,
    shared: &Shared,
    pages: &broadcast::Sender<Told>,
) {
    let teller = Teller {
        shared,
        pages,
        folder,
    };
    let mut writing = None;
    let mut told = Instant::now();
    loop {
        let done = match items.recv_timeout(FLUSH_INTERVAL / 2) {
            Ok(item) => {
                let cost = item.bytes.len() + RECORD_BYTES;
                shared.waiting_bytes.fetch_sub(cost, Ordering::Relaxed);
                record(folder, &mut writing, &item)
            }
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => {
                teller.ended(writing);
                return;
            }
        };
        let done = done.and_then(|()| writing.as_mut().map_or(Ok(()), Writing::keep));
        if let Err(error) = done {
            teller.failed(writing, &error);
            // Whoever still hands something over finds nobody; the lab goes on.
            return;
        }
        if let Some(writing) = &writing
            && (told.elapsed() >= TELL_INTERVAL || lock(&shared.status).state != RecordingState::On)
        {
            told = Instant::now();
            teller.on(writing);
        }
    }
}

fn record(folder: &Path, writing: &mut Option<Writing>, item: &Item) -> io::Result<()> {
    let writing = match writing {
        Some(writing) => writing,
        None => writing.insert(Writing::begin(folder, item.arrival_ns)?),
    };
    writing.unflushed = true;
    let written = writing
        .writer
        .write(&item.device, item.kind, item.arrival_ns, &item.bytes);
    written.map_err(refused)
}

fn refused(error: impl std::error::Error + Send + Sync + 'static) -> io::Error {
    // The sentence for people is the system's, which is the innermost.
    let mut inner: &dyn std::error::Error = &error;
    while let Some(source) = inner.source() {
        inner = source;
    }
    io::Error::other(inner.to_string())
}

impl Writing {
    fn begin(folder: &Path, arrival_ns: i64) -> io::Result<Self> {
        private::create_folder(folder)?;
        let (file, name) = create(folder, arrival_ns)?;
        // Whoever recovers files leaves this one alone; a file system without locks has no second lab.
        let _ = file.try_lock();
        let facts = BTreeMap::from([("started".to_owned(), crate::experiments::utc(arrival_ns))]);
        let writer = LabWriter::new(BufWriter::new(file.try_clone()?), &facts).map_err(refused)?;
        let now = Instant::now();
        Ok(Self {
            writer,
            file,
            name,
            started: now,
            flushed: now,
            synced: now,
            unflushed: true,
        })
    }

    /// Flushes and syncs when it is time.
    fn keep(&mut self) -> io::Result<()> {
        if !self.unflushed || self.flushed.elapsed() < FLUSH_INTERVAL {
            return Ok(());
        }
        self.writer.flush().map_err(refused)?;
        self.unflushed = false;
        self.flushed = Instant::now();
        if self.synced.elapsed() >= SYNC_INTERVAL {
            self.file.sync_data()?;
            self.synced = Instant::now();
        }
        Ok(())
    }

    fn finish(self) -> io::Result<u64> {
        let output = self.writer.finish().map_err(refused)?;
        output.into_inner().map_err(|error| error.into_error())?;
        self.file.sync_all()?;
        Ok(self.file.metadata()?.len())
    }

    fn bytes(&self) -> u64 {
        self.file.metadata().map_or(0, |metadata| metadata.len())
    }
}

/// A new file that is named after the time.
fn create(folder: &Path, arrival_ns: i64) -> io::Result<(File, String)> {
    let stem: String = crate::experiments::utc(arrival_ns)
        .trim_end_matches(" UTC")
        .chars()
        .map(|c| {
            if c == ' ' {
                'T'
            } else if c == ':' {
                '-'
            } else {
                c
            }
        })
        .collect();
    for number in 1..1000 {
        let name = match number {
            1 => format!("{stem}Z.mcap"),
            _ => format!("{stem}Z-{number}.mcap"),
        };
        let path: PathBuf = folder.join(&name);
        match private::create_new(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
            Ok(file) => return Ok((file, name)),
        }
    }
    Err(io::Error::from(io::ErrorKind::AlreadyExists))
}

/// Tells people how the recording is.
struct Teller<'a> {
    shared: &'a Shared,
    pages: &'a broadcast::Sender<Told>,
    folder: &'a Path,
}

impl Teller<'_> {
    fn tell(&self, change: impl FnOnce(&mut super::RecordingStatus)) {
        let message = {
            let mut status = lock(&self.shared.status);
            change(&mut status);
            status.message()
        };
        // Without a page nobody listens, and that is fine.
        let _ = self.pages.send(Told::new(&message));
    }

    fn on(&self, writing: &Writing) {
        self.tell(|status| {
            // Given up by the lab in the meantime.
            if status.state == RecordingState::Failed {
                return;
            }
            status.state = RecordingState::On;
            status.file = Some(writing.name.clone());
            status.bytes = writing.bytes();
            status.seconds = writing.started.elapsed().as_secs_f64();
            status.text = format!("Everything is recorded in {}.", writing.name);
        });
    }

    fn failed(&self, writing: Option<Writing>, error: &io::Error) {
        let name = writing.as_ref().map(|writing| writing.name.clone());
        if let Some(writing) = writing {
            // No index: what was flushed stays, and the next start makes it whole.
            drop(writing.writer.abandon().into_parts());
        }
        let place = name
            .clone()
            .unwrap_or_else(|| self.folder.display().to_string());
        self.tell(|status| {
            status.state = RecordingState::Failed;
            status.file = name.clone();
            status.text = format!(
                "The recording stopped: {place}: {error}. The lab goes on without it; what was written so far can be read."
            );
        });
    }

    fn ended(&self, writing: Option<Writing>) {
        let Some(writing) = writing else {
            return;
        };
        let name = writing.name.clone();
        let given_up = lock(&self.shared.status).state == RecordingState::Failed;
        match writing.finish() {
            Ok(bytes) => self.tell(|status| {
                status.bytes = bytes;
                if !given_up {
                    status.state = RecordingState::Off;
                    status.text = format!("The recording is complete: {name}.");
                }
            }),
            Err(error) => self.tell(|status| {
                status.state = RecordingState::Failed;
                status.text = format!("The recording {name} could not be completed: {error}.");
            }),
        }
    }
}
