//! Drives the firmware's images under QEMU, and runs the same application on the host.
//!
//! | file | what is in it |
//! |---|---|
//! | `walk.rs` | a walk as the IMU and the receiver send it, with its truth |
//! | `emulator.rs` | the emulated board: its serial lines, its clock, its watchdog |
//! | `host.rs` | the same board, on the host |
//! | `output.rs` | the sentences, read back |
//! | `errors.rs` | how far printed estimates are from the truth |
//! | `capture.rs` | an output and its truth as a recording for `northing run` |
//! | `images.rs` | where images are, and how large |
//!
//! The tests need the images that `scripts/build-firmware` builds, and `qemu-system-arm`:
//! `./scripts/test firmware` sees to both.
#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

pub mod capture;
pub mod emulator;
pub mod errors;
pub mod host;
pub mod images;
pub mod output;
pub mod walk;

/// What reaches the board in a stretch of time.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tick {
    /// How long the stretch is, ms; what comes, comes at its end.
    pub ms: u8,
    /// Bytes of the IMU.
    pub imu: Vec<u8>,
    /// Bytes of the receiver.
    pub gnss: Vec<u8>,
}

/// A board that a test feeds.
pub trait Board {
    /// Gives it what a stretch brings; what it then sends.
    fn tick(&mut self, tick: &Tick) -> Vec<u8>;

    /// Gives it many, one after the other.
    fn ticks(&mut self, ticks: &[Tick]) -> Vec<u8> {
        ticks.iter().flat_map(|tick| self.tick(tick)).collect()
    }
}
