//! A long recording streams through a run in memory that does not grow with its length.
//!
//! Alone in its file: the peak memory of a process is that of everything that runs in it.

#![allow(clippy::unwrap_used)]

use northing_evaluation::{EstimatorKind, Profile, RunOptions, TraceObserver, run};
use northing_recording::{RecordingError, WorldFrame};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

/// Peak resident memory of this process, kB; `None` where the system does not say.
fn peak_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches(" kB").parse().ok()
}

fn samples_of_a_run(duration_s: f64) -> u64 {
    let config = VirtualPhoneConfig {
        duration_s: Some(duration_s),
        ..Default::default()
    };
    let phone = VirtualPhone::new(config).unwrap();
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld);
    let mut trace = TraceObserver::new(2000, WorldFrame::Enu);
    let events = phone.events().map(Ok::<_, RecordingError>);
    let summary = run(events, &options, &mut trace).unwrap();
    assert!(trace.trace().points.items().len() <= 2000);
    summary.samples
}

#[test]
fn a_million_samples_need_no_more_memory_than_a_third_of_them() {
    // The rates of the first ten minutes are kept, for the clock of a reference.
    let few = samples_of_a_run(1200.0);
    let before = peak_kb();
    let many = samples_of_a_run(3600.0);
    assert!(few < 500_000 && many > 1_000_000, "{few} {many}");
    if let (Some(before), Some(after)) = (before, peak_kb()) {
        // A million samples of 100 bytes would be 100 MB.
        assert!(after - before < 2_000, "{before} kB, then {after} kB");
    }
}
