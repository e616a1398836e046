//! The emulated board: QEMU with a socket for each serial line, and the clock in the test's hand.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::images::{Chip, image};
use crate::{Board, Tick};

/// Longest wait for an answer: a machine under load is slow, a board that hangs never answers.
const PATIENCE: Duration = Duration::from_secs(180);

/// A board under QEMU; it ends with the value.
#[derive(Debug)]
pub struct Emulator {
    qemu: Child,
    out: Receiver<Vec<u8>>,
    /// Output that has come and was not handed out yet.
    waiting: Vec<u8>,
    imu: UnixStream,
    gnss: UnixStream,
    clock: UnixStream,
    /// Bytes sent to the IMU's and the receiver's line since the board started, as it counts them.
    sent: [u16; 2],
    /// Bytes of output read since the board started.
    read: u32,
    _sockets: TempDir,
}

impl Emulator {
    /// Starts an image of the emulated board.
    #[must_use]
    pub fn start(chip: Chip, name: &str) -> Self {
        let sockets = TempDir::new().unwrap();
        let lines = ["out", "imu", "gnss", "clock"];
        let listeners = lines.map(|line| UnixListener::bind(sockets.path().join(line)).unwrap());
        let mut command = Command::new("qemu-system-arm");
        // An instruction takes 128 ns of the board's time, so its watchdog counts instructions.
        command.args(["-M", chip.machine(), "-icount", "shift=7"]);
        command.args(["-display", "none", "-monitor", "none"]);
        command.arg("-kernel").arg(image(chip, name));
        for line in lines {
            let path = sockets.path().join(line);
            let socket = format!("socket,id={line},path={}", path.display());
            command.arg("-chardev").arg(socket);
            command.arg("-serial").arg(format!("chardev:{line}"));
        }
        let qemu = command
            .stdin(Stdio::null())
            .spawn()
            .expect("qemu-system-arm is needed: ./scripts/test firmware installs it");
        let [out, imu, gnss, clock] = listeners.map(|listener| accepted(&listener));
        let mut board = Self {
            qemu,
            out: listening(out),
            waiting: Vec::new(),
            imu,
            gnss,
            clock,
            sent: [0; 2],
            read: 0,
            _sockets: sockets,
        };
        board.started();
        board
    }

    /// Makes the program hang; comes back when the watchdog has reset the board and it has started.
    pub fn hang(&mut self) {
        self.clock.write_all(b"H").unwrap();
        self.started();
    }

    /// Most bytes of stack that have been in use.
    pub fn stack_used(&mut self) -> u32 {
        self.clock.write_all(b"S").unwrap();
        self.answer(b'S')
    }

    fn started(&mut self) {
        let mut said = [0];
        self.clock.read_exact(&mut said).unwrap();
        assert_eq!(said, *b"R");
        self.sent = [0; 2];
        self.read = 0;
    }

    fn answer(&mut self, kind: u8) -> u32 {
        let mut answer = [0; 5];
        self.clock.read_exact(&mut answer).unwrap();
        let [said, value @ ..] = answer;
        assert_eq!(said, kind);
        u32::from_le_bytes(value)
    }
}

impl Board for Emulator {
    fn tick(&mut self, tick: &Tick) -> Vec<u8> {
        self.imu.write_all(&tick.imu).unwrap();
        self.gnss.write_all(&tick.gnss).unwrap();
        let lengths = [tick.imu.len(), tick.gnss.len()];
        for (sent, length) in self.sent.iter_mut().zip(lengths) {
            *sent = sent.wrapping_add(u16::try_from(length).unwrap());
        }
        let [[i, j], [g, h]] = self.sent.map(u16::to_le_bytes);
        self.clock.write_all(&[b'T', tick.ms, i, j, g, h]).unwrap();
        let written = self.answer(b'K');
        let length = written.wrapping_sub(self.read) as usize;
        self.read = written;
        while self.waiting.len() < length {
            self.waiting
                .extend(self.out.recv_timeout(PATIENCE).unwrap());
        }
        let rest = self.waiting.split_off(length);
        std::mem::replace(&mut self.waiting, rest)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

/// Reads a line all the time: QEMU waits for a reader after few bytes.
fn listening(mut line: UnixStream) -> Receiver<Vec<u8>> {
    let (sender, receiver) = channel();
    line.set_read_timeout(None).unwrap();
    spawn(move || {
        let mut piece = [0; 4096];
        while let Ok(length @ 1..) = line.read(&mut piece) {
            if sender.send(piece[..length].to_vec()).is_err() {
                break;
            }
        }
    });
    receiver
}

fn accepted(listener: &UnixListener) -> UnixStream {
    listener.set_nonblocking(true).unwrap();
    let began = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false).unwrap();
                stream.set_read_timeout(Some(PATIENCE)).unwrap();
                return stream;
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                assert!(began.elapsed() < PATIENCE, "QEMU does not connect");
                sleep(Duration::from_millis(5));
            }
            Err(error) => panic!("{error}"),
        }
    }
}
