//! A class of thirty phones at 100 Hz for half a minute: every sample arrives once, estimates go on,
//! frames come in order. How fast is no test's business: `scripts/load` measures that.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

#[path = "support/class.rs"]
mod class;
mod support;

use class::{Class, Watcher};
use support::TestLab;

const CLASS: Class = Class {
    phones: 30,
    rate_hz: 100.0,
    seconds: 30.0,
};

#[test]
fn thirty_phones_at_100_hz_lose_nothing_and_come_in_order() {
    let lab = TestLab::start();
    let watcher = Watcher::open(&lab.lab_host());
    let path = format!("/in/{}", lab.token());
    let sent = CLASS.play(&lab.app_host(), &path);
    let seen = watcher.close();
    assert_eq!(seen.disorder, Vec::<String>::new());
    let status = lab.status();
    let devices = status["devices"].as_array().unwrap();
    assert_eq!(devices.len(), sent.len());
    for phone in &sent {
        let name = &phone.device;
        let device = devices.iter().find(|d| d["id"] == **name).unwrap();
        assert_eq!(device["received"], phone.samples, "{name}");
        assert_eq!(
            phone.samples, 9003,
            "{name}: both ends of 30 s, three sensors"
        );
        for zero in [
            "lost",
            "late",
            "duplicated",
            "duplicated_batches",
            "refused",
        ] {
            assert_eq!(device[zero], 0, "{zero} of {name}");
        }
        assert!(device["estimates"]["mekf"].is_object());
        let (frames, newest_s) = seen.frames[name];
        assert!(frames > 100, "{frames} frames of {name}");
        assert!(newest_s > 29.0, "the page saw {name} up to {newest_s} s");
    }
}
