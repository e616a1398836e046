//! A class of thirty phones at 100 Hz: every sample arrives.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod support;

use std::thread;
use std::time::{Duration, Instant};

use northing_recording::{Event, Sample};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use support::{TestLab, batch};

const PHONES: u64 = 30;
const SECONDS: f64 = 4.0;

#[test]
fn thirty_phones_at_100_hz_lose_nothing() {
    let lab = TestLab::start();
    let mut expected = Vec::new();
    thread::scope(|scope| {
        for phone in 0..PHONES {
            let events = events(phone);
            expected.push(events.len());
            let lab = &lab;
            scope.spawn(move || send(lab, phone, &events));
        }
    });
    let status = lab.status();
    let devices = status["devices"].as_array().unwrap();
    assert_eq!(devices.len(), expected.len());
    for (phone, expected) in expected.iter().enumerate() {
        let device = lab.device(&format!("phone-{phone}"));
        assert_eq!(device["received"], *expected);
        for zero in ["lost", "late", "duplicated", "refused"] {
            assert_eq!(device[zero], 0, "{zero} of phone {phone}");
        }
        assert!(device["estimates"]["mekf"].is_object());
    }
}

fn events(phone: u64) -> Vec<Event> {
    let simulated = VirtualPhone::new(VirtualPhoneConfig {
        seed: phone,
        duration_s: Some(SECONDS),
        ..VirtualPhoneConfig::default()
    });
    let sent = |event: &Event| {
        matches!(
            event.sample,
            Sample::AngularRate(_) | Sample::SpecificForce(_) | Sample::MagneticField(_)
        )
    };
    simulated.unwrap().events().filter(sent).collect()
}

/// A batch each 100 ms, as a phone does; a phone that is asked to wait sends again.
fn send(lab: &TestLab, phone: u64, events: &[Event]) {
    let start = Instant::now();
    let name = format!("phone-{phone}");
    let in_batch = |event: &Event| event.time_ns / 100_000_000;
    for (seq, chunk) in (0..).zip(events.chunk_by(|a, b| in_batch(a) == in_batch(b))) {
        let due = Duration::from_millis(100) * seq as u32;
        thread::sleep(due.saturating_sub(start.elapsed()));
        let body = batch(&name, "s", seq, chunk);
        while lab.upload(&body).status != 200 {
            thread::sleep(Duration::from_millis(50));
        }
    }
}
