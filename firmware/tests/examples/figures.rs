//! Streams the whole walk through both builds of the emulated board and writes recordings of it, from which
//! `northing run` draws figures 3 to 6 of the paper: `scripts/firmware-figures` does all of it.

#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use northing_firmware_tests::Board;
use northing_firmware_tests::capture;
use northing_firmware_tests::emulator::Emulator;
use northing_firmware_tests::images::Chip;
use northing_firmware_tests::walk::{ONCE_ROUND_S, SEED, Walk};

fn main() {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let folder = folder.expect("expected the folder to write into");
    let walk = Walk::new(SEED, ONCE_ROUND_S);
    for name in ["axis-filters", "error-state"] {
        let mut board = Emulator::start(Chip::CortexM3, &format!("emulated-{name}"));
        let printed = board.ticks(&walk.ticks);
        let manifest = capture::write(&folder, name, &printed, &walk.truth);
        println!("{}", manifest.display());
    }
}
