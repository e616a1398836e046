//! The emulated chips give the bytes that the host gives, and estimates that are true.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use std::thread;

use northing_firmware::navigator::{AxisNavigator, ErrorStateNavigator};
use northing_firmware::{Navigator, ResetCause};
use northing_firmware_tests::Board;
use northing_firmware_tests::emulator::Emulator;
use northing_firmware_tests::errors::{Errors, errors};
use northing_firmware_tests::host::Host;
use northing_firmware_tests::images::Chip;
use northing_firmware_tests::output::{Sentence, of_kind, sentences};
use northing_firmware_tests::walk::{SEED, Walk};

/// Frames that the second chip gets.
const PREFIX: usize = 500;

/// Over this walk the chip of the paper and the host print the same bytes; over its first seconds, with a
/// floating point unit, another one does too. Each estimate carries a hash of all numbers of the filters'
/// states, so that these are equal to the bit. The counter rolls over after 30 seconds, and nothing shows.
fn chips_and_host_agree<N: Navigator>(image: &'static str, walk: &Walk) -> Vec<Sentence> {
    let ticks = &walk.ticks;
    thread::scope(|scope| {
        for (chip, ticks) in [
            (Chip::CortexM3, &ticks[..]),
            (Chip::CortexM4F, &ticks[..PREFIX]),
        ] {
            scope.spawn(move || {
                let on_host = Host::<N>::start(ResetCause::Power).ticks(ticks);
                let on_chip = Emulator::start(chip, image).ticks(ticks);
                let (host, chip_said) = (sentences(&on_host), sentences(&on_chip));
                for (at, (h, c)) in host.iter().zip(&chip_said).enumerate() {
                    assert_eq!(c, h, "sentence {at} on {}", chip.name());
                }
                assert!(on_host == on_chip, "{}: one stopped early", chip.name());
            });
        }
    });
    let said = sentences(&Host::<N>::start(ResetCause::Power).ticks(ticks));
    let steps: Vec<&str> = of_kind(&said, 'I').map(|frame| &*frame.fields[1]).collect();
    assert_eq!(steps[0], "");
    assert!(steps[1..].iter().all(|ms| *ms == "20"));
    said
}

#[test]
fn axis_filters_on_a_chip_are_those_of_the_host_and_near_the_truth() {
    let walk = Walk::new(SEED, 50.0);
    let said = chips_and_host_agree::<AxisNavigator>("emulated-axis-filters", &walk);
    assert_eq!(of_kind(&said, 'I').count(), walk.ticks.len());
    // A second at rest, then an estimate each frame.
    assert_eq!(of_kind(&said, 'E').count(), walk.ticks.len() - 50);
    let fixes = walk
        .ticks
        .iter()
        .filter(|tick| !tick.gnss.is_empty())
        .count();
    // The one that came in that second is used as it ends.
    assert_eq!(of_kind(&said, 'G').count(), fixes);
    let Errors {
        position_m,
        tilt,
        heading,
    } = errors(&said, &walk.truth);
    // The fixes themselves are off by 3.5 m.
    assert!(position_m < 4.5, "{position_m}");
    assert!(tilt < 0.05 && heading < 0.1, "{tilt} {heading}");
}

#[test]
fn the_error_state_filter_on_a_chip_is_that_of_the_host_and_nearer_the_truth() {
    let walk = Walk::new(SEED, 50.0);
    let said = chips_and_host_agree::<ErrorStateNavigator>("emulated-error-state", &walk);
    assert_eq!(of_kind(&said, 'E').count(), walk.ticks.len() - 50);
    let Errors {
        position_m,
        tilt,
        heading,
    } = errors(&said, &walk.truth);
    println!("position {position_m:.2} m, tilt {tilt:.4} rad, heading {heading:.4} rad");
    assert!(position_m < 2.0, "{position_m}");
    assert!(tilt < 0.02 && heading < 0.08, "{tilt} {heading}");
}
