//! How fast the virtual phone makes events: `cargo bench -p northing-simulation`.

use northing_simulation::virtual_phone::{Disturbance, Motion};
use northing_simulation::{AttitudeTrial, AttitudeTrialConfig, VirtualPhone, VirtualPhoneConfig};

fn main() {
    divan::main();
}

const EVENTS: usize = 1_000_000;

#[divan::bench(args = [Disturbance::None, Disturbance::Both], sample_count = 5)]
fn virtual_phone_million_events(bencher: divan::Bencher<'_, '_>, disturbance: Disturbance) {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        duration_s: Some(1e6),
        motion: Motion::Brisk,
        disturbance,
        ..VirtualPhoneConfig::default()
    });
    let Ok(phone) = phone else { return };
    bencher
        .counter(divan::counter::ItemsCount::new(EVENTS))
        .bench(|| phone.events().take(EVENTS).map(|e| e.time_ns).max());
}

#[divan::bench(sample_count = 10)]
fn attitude_trial_of_a_minute() -> AttitudeTrial {
    AttitudeTrial::simulate(1, &AttitudeTrialConfig::default())
}
