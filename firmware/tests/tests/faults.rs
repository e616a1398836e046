//! Bytes lost, damaged and late, silent sensors, a program that hangs: the board goes on, the same way
//! as the host, and says what happened.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use northing_firmware::ResetCause;
use northing_firmware::navigator::AxisNavigator;
use northing_firmware_tests::emulator::Emulator;
use northing_firmware_tests::host::Host;
use northing_firmware_tests::images::Chip;
use northing_firmware_tests::output::{Sentence, of_kind, sentences};
use northing_firmware_tests::walk::Walk;
use northing_firmware_tests::{Board, Tick};

const IMAGE: &str = "emulated-axis-filters";

/// What chip and host say alike.
fn said(ticks: &[Tick]) -> Vec<Sentence> {
    let on_host = Host::<AxisNavigator>::start(ResetCause::Power).ticks(ticks);
    let on_chip = Emulator::start(Chip::CortexM3, IMAGE).ticks(ticks);
    let said = sentences(&on_host);
    assert_eq!(sentences(&on_chip), said);
    said
}

/// Counts of the last status: starts, frames, missing, damaged and overrun bytes of the IMU; fixes,
/// refused, damaged and overrun bytes of the receiver.
fn counts(said: &[Sentence]) -> [u32; 9] {
    let last = of_kind(said, 'S').last().unwrap();
    std::array::from_fn(|i| last.number(i + 1))
}

/// Largest difference of roll and pitch from the truth, degrees.
fn worst_tilt_deg(said: &[Sentence], walk: &Walk) -> f64 {
    let errors = of_kind(said, 'E').map(|estimate| {
        let ms: usize = estimate.number(0);
        let (roll, pitch, _) = walk.truth[ms / 20].attitude.euler_angles();
        let [r, p, _] = estimate.vector(1, 1e-3);
        (r - roll.to_degrees())
            .abs()
            .max((p - pitch.to_degrees()).abs())
    });
    errors.fold(0.0, f64::max)
}

#[test]
fn damaged_lines_cost_their_sensor_a_step_and_no_more() {
    let mut walk = Walk::new(11, 20.0);
    let mut damaged = 0;
    for (at, tick) in walk.ticks.iter_mut().enumerate().skip(100) {
        // One byte of each seventh frame is lost; one of each eleventh is another one.
        if at % 7 == 0 {
            tick.imu.remove(at % tick.imu.len());
        } else if at % 11 == 0 {
            let place = at * 5 % tick.imu.len();
            tick.imu[place] ^= 0x40;
        }
        if !tick.gnss.is_empty() && at % 3 == 0 {
            let place = at % tick.gnss.len();
            tick.gnss[place] ^= 0x01;
            damaged += 1;
        }
    }
    let said = said(&walk.ticks);
    let [
        starts,
        frames,
        missing,
        imu_damaged,
        _,
        fixes,
        _,
        gnss_damaged,
        _,
    ] = counts(&said);
    assert_eq!(starts, 1);
    // What was lost as a frame is counted, so no time is lost.
    assert!(
        frames > 850 && frames + missing == 1000,
        "{frames} {missing}"
    );
    assert!(imu_damaged > 50, "{imu_damaged}");
    assert!(
        damaged > 3 && gnss_damaged >= damaged / 2,
        "{damaged} {gnss_damaged}"
    );
    assert!(fixes >= 12, "{fixes}");
    let last = of_kind(&said, 'E').last().unwrap();
    assert!(last.number::<u32>(0) >= 19_900);
    let worst = worst_tilt_deg(&said, &walk);
    assert!(worst < 6.0, "{worst}");
}

#[test]
fn late_frames_are_late_and_lost_ones_are_lost() {
    let walk = Walk::new(12, 6.0);
    let mut ticks = walk.ticks.clone();
    // One 10 ms late and the next in time; three frames lost altogether.
    ticks[150].ms = 30;
    ticks[151].ms = 10;
    for tick in &mut ticks[200..203] {
        tick.imu.clear();
    }
    let said = said(&ticks);
    let steps: Vec<u32> = of_kind(&said, 'I')
        .skip(1)
        .map(|frame| frame.number(1))
        .collect();
    assert_eq!(steps.len(), 296);
    assert_eq!(steps.iter().sum::<u32>(), 299 * 20);
    assert_eq!(
        steps.iter().filter(|ms| **ms != 20).collect::<Vec<_>>(),
        [&80]
    );
    let [starts, _, missing, ..] = counts(&said);
    assert_eq!((starts, missing), (1, 3));
}

#[test]
fn an_imu_that_pauses_is_a_new_start_at_rest() {
    let walk = Walk::new(13, 8.0);
    let mut ticks = walk.ticks.clone();
    for tick in &mut ticks[200..260] {
        tick.imu.clear();
    }
    let said = said(&ticks);
    assert_eq!(
        of_kind(&said, 'I')
            .filter(|frame| frame.fields[1].is_empty())
            .count(),
        2
    );
    // Twice a second at rest without estimates.
    assert_eq!(of_kind(&said, 'E').count(), 400 - 60 - 2 * 50);
    assert_eq!(counts(&said)[0], 2);
}

#[test]
fn bytes_that_nobody_can_fetch_are_counted_and_soon_forgotten() {
    let walk = Walk::new(14, 6.0);
    let mut ticks = walk.ticks.clone();
    ticks[150].imu = [ticks[150].imu.clone(), vec![b'x'; 600]].concat();
    ticks[170].gnss = vec![0xff; 900];
    let said = said(&ticks);
    let [
        starts,
        frames,
        _,
        imu_damaged,
        imu_lost,
        _,
        _,
        gnss_damaged,
        gnss_lost,
    ] = counts(&said);
    assert_eq!(starts, 1);
    assert!(frames >= 297, "{frames}");
    assert!(
        imu_lost > 300 && gnss_lost == 900 - 512,
        "{imu_lost} {gnss_lost}"
    );
    assert_eq!((imu_damaged, gnss_damaged), (1, 1));
}

#[test]
fn a_silent_receiver_is_dead_reckoning_then_invalid_and_a_good_fix_ends_it() {
    let walk = Walk::new(15, 85.0);
    let mut ticks = walk.ticks.clone();
    // The fixes of a minute are missing: 11 s to 70 s.
    for tick in &mut ticks[520..3520] {
        tick.gnss.clear();
    }
    let said = said(&ticks);
    let validity_at = |ms: u32| {
        let mut estimates = of_kind(&said, 'E');
        let then = estimates
            .find(|estimate| estimate.number::<u32>(0) >= ms)
            .unwrap();
        then.number::<u32>(7)
    };
    assert_eq!(validity_at(9_000), 1);
    assert_eq!(validity_at(11_500), 1);
    assert_eq!(validity_at(12_500), 2);
    assert_eq!(validity_at(50_000), 3);
    assert_eq!(validity_at(69_000), 3);
    // Fixes that jump are left out five times, then accepted.
    assert_eq!(validity_at(79_000), 1);
    let last = of_kind(&said, 'E').last().unwrap();
    let [north, east, _] = last.vector(8, 1e-3);
    let truth = walk.truth.last().unwrap().position;
    let off = (north - truth.x).hypot(east - truth.y);
    assert!(off < 15.0, "{off}");
}

#[test]
fn the_watchdog_ends_a_program_that_hangs_and_nothing_of_it_survives() {
    let walk = Walk::new(16, 10.0);
    let mut board = Emulator::start(Chip::CortexM3, IMAGE);
    let before = sentences(&board.ticks(&walk.ticks[..300]));
    assert_eq!(before[0].fields, ["1", "axis-filters", "power"]);
    assert!(of_kind(&before, 'E').count() > 200);
    board.hang();
    // From here it is a board that has just started, but for the cause that it names.
    let after = board.ticks(&walk.ticks[300..]);
    let fresh = Host::<AxisNavigator>::start(ResetCause::Watchdog).ticks(&walk.ticks[300..]);
    assert_eq!(sentences(&after), sentences(&fresh));
    assert_eq!(
        sentences(&after)[0].fields,
        ["1", "axis-filters", "watchdog"]
    );
}
