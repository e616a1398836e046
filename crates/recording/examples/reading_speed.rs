//! How fast a recording is read, e.g. a manifest of text files, repeated:
//!
//!     cargo run --release -p northing-recording --example reading_speed -- MANIFEST [DATA_FOLDER]
#![allow(clippy::print_stdout)] // it prints what it measures

use std::path::Path;
use std::time::Instant;

use northing_recording::{OpenOptions, RecordingError, SensorKind, open};

/// How often the recording is read.
const TIMES: u32 = 10;

fn main() -> Result<(), RecordingError> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_default();
    let options = OpenOptions {
        data: arguments.next().map(Into::into),
        ..OpenOptions::default()
    };
    let mut best_s = f64::INFINITY;
    let (mut rows, mut events) = (0_u64, 0_u64);
    for _ in 0..TIMES {
        let start = Instant::now();
        (rows, events) = (0, 0);
        for event in open(Path::new(&path), &options)? {
            events += 1;
            rows += u64::from(event?.sample.kind() == SensorKind::Gyroscope);
        }
        best_s = best_s.min(start.elapsed().as_secs_f64());
    }
    let (row_rate, event_rate) = (rows as f64 / best_s, events as f64 / best_s);
    println!(
        "{rows} rows of the gyroscope and {events} events in {best_s:.4} s, the best of {TIMES}"
    );
    println!("{row_rate:.0} rows/s, {event_rate:.0} events/s");
    Ok(())
}
