//! What the firmware does, without a board: bytes of an IMU and a GNSS receiver in, estimates out.
//!
//! No allocation, no clock, no input or output of its own: a board hands over bytes with the time of
//! its counter and takes sentences; a test does the same, so that a chip, its emulation and a host
//! give the same bytes.
//!
//! | file | what is in it |
//! |---|---|
//! | `application.rs` | the way of a byte from a serial line to an estimate |
//! | `navigator.rs`, `navigator/` | the filters of the two builds, and the start at rest |
//! | `sample_faults.rs` | fault detection in front of them |
//! | `razor.rs`, `nmea.rs` | the sentences of the IMU and the receiver, in integers |
//! | `frame_clock.rs` | how many intervals a frame stands for, from a counter that rolls over |
//! | `local_plane.rs` | latitude and longitude to north, east, down in single precision |
//! | `sentences.rs` | what comes out: `$PNOR..` sentences, with checksums |
//! | `lines.rs`, `number.rs`, `ring.rs` | bytes to lines, digits to integers, interrupt to main loop |
//!
//! Units of integers stand in their names; where filters begin, SI in `f32`. Axes are forward, right,
//! down; north, east, down.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod application;
pub mod frame_clock;
pub mod lines;
pub mod local_plane;
pub mod navigator;
pub mod nmea;
pub mod number;
pub mod razor;
pub mod ring;
pub mod sample_faults;
pub mod sentences;

pub use application::{Application, ResetCause};
pub use navigator::{Inertial, Navigator};
