//! A board on a serial line, a Razor 9DOF or one with our own firmware: read on a thread of its own, because serial lines block.

use std::io::{ErrorKind, Read, Write};
use std::thread;
use std::time::Duration;

use axum::body::Bytes;
use tokio::sync::mpsc;
use tokio::time::timeout;

use super::link::{Ended, Feed, LineCutter, Link};
use super::spec::Address;
use super::{InputKind, InputState};

/// How long one read waits.
const READ_TIMEOUT: Duration = Duration::from_millis(200);
/// Silence after which it is said.
const SILENCE: Duration = Duration::from_secs(3);
/// Bytes read at once.
const CHUNK: usize = 4096;
/// Chunks that may wait: beyond, the thread waits and the system's buffer fills.
const QUEUE: usize = 16;
/// Tells a Razor's firmware to send text of the calibrated sensors, continuously.
const START: &[u8] = b"#osct#o1";

/// Reads the line until it breaks off.
pub(super) async fn open(link: &Link, feed: &mut Feed, delivered: &mut bool) -> Ended {
    link.connecting("opening");
    let (sender, mut chunks) = mpsc::channel(QUEUE);
    let address = link.address().clone();
    let start = if link.kind() == InputKind::Razor {
        START
    } else {
        b""
    };
    let spawned = thread::Builder::new()
        .name("serial line".to_owned())
        .spawn(move || read(&address, start, &sender));
    spawned.map_err(|error| error.to_string())?;
    let mut cutter = LineCutter::default();
    loop {
        let chunk = match timeout(SILENCE, chunks.recv()).await {
            Ok(chunk) => chunk.ok_or("the line is closed")??,
            Err(_) => {
                let text =
                    "the line is open, but nothing comes: is the board on, and is the speed right?";
                link.say(InputState::Connected, text);
                continue;
            }
        };
        let lines: Bytes = cutter.push(&chunk);
        if !lines.is_empty() {
            feed.give(lines).await?;
            *delivered = true;
        }
        if let Some(text) = feed.news() {
            link.say(InputState::Connected, text);
        } else if cutter.left_out > 0 && !*delivered {
            let text = "what comes are no lines: is the speed right?";
            link.say(InputState::Connected, text);
        }
    }
}

/// Reads until the line breaks or nobody listens.
fn read(address: &Address, start: &[u8], sender: &mpsc::Sender<Result<Vec<u8>, String>>) {
    if let Err(why) = read_to_end(address, start, sender) {
        // Whoever listened may be gone.
        let _ = sender.blocking_send(Err(why));
    }
}

fn read_to_end(
    address: &Address,
    start: &[u8],
    sender: &mpsc::Sender<Result<Vec<u8>, String>>,
) -> Result<(), String> {
    let Address::Serial { path, baud } = address else {
        return Err("this kind of input reads a serial line".to_owned());
    };
    let opened = serialport::new(path.as_str(), *baud)
        .timeout(READ_TIMEOUT)
        .open();
    let mut port = opened.map_err(|error| {
        format!(
            "{path} cannot be opened: {error}; is the board plugged in, and may you use the line?"
        )
    })?;
    // A board that sends by itself needs no telling, and a line that cannot be written can be read.
    let _ = port.write_all(start);
    let mut chunk = vec![0; CHUNK];
    while !sender.is_closed() {
        match port.read(&mut chunk) {
            Ok(0) => return Err(format!("{path} is closed")),
            Ok(length) => {
                if sender.blocking_send(Ok(chunk[..length].to_vec())).is_err() {
                    return Ok(());
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(error) => return Err(format!("{path} broke off: {error}")),
        }
    }
    Ok(())
}
