//! Faults: fixes that jump, input that cannot be, gaps, clocks that go back.

use super::*;
use crate::faults::FaultKind;

#[test]
fn fixes_that_jump_are_left_out_and_accepted_when_they_stay() {
    let (mut ins, mut motion) = drive(config(), &Drive::default(), |_, _, _| ());
    assert_eq!(ins.validity(), Validity::Aided);
    let before = ins.state().unwrap().ned_from_body;
    let (mut outcomes, mut statuses) = (std::vec::Vec::new(), std::vec::Vec::new());
    let turned = |ins: &GnssIns<f64, 64>, motion: &Motion| {
        let [yaw, _, _] = rotation::to_yaw_pitch_roll(&ins.state().unwrap().ned_from_body);
        (yaw - motion.heading).sin().abs()
    };
    let mut worst_heading = 0.0_f64;
    for k in 1..=2000_i64 {
        motion.step(60.0 + k as f64 * 0.01, 0.01);
        let time_ns = 60_000_000_000 + k * 10_000_000;
        ins.imu(time_ns, &motion.rate(), &motion.force()).unwrap();
        if k % 100 == 0 {
            let jumped = GnssPosition {
                ned: motion.position + Vector3::new(50.0, 0.0, 0.0),
                std: Vector3::new(0.05, 0.05, 0.1),
                has_height: true,
            };
            outcomes.push(ins.gnss_position(time_ns, &jumped).horizontal.outcome);
            statuses.push(ins.validity());
            let std = ins.state().unwrap().covariance[(2, 2)].sqrt();
            worst_heading = worst_heading.max(turned(&ins, &motion) / std);
        }
    }
    assert_eq!(outcomes[..4], [Outcome::Gated; 4]);
    assert_eq!(statuses[3], Validity::DeadReckoning, "it says so");
    assert!(statuses.contains(&Validity::HeadingUnknown));
    assert_eq!((ins.realignments(), ins.restarts()), (1, 0));
    let off = ins.state().unwrap().position - motion.position - Vector3::x() * 50.0;
    assert!(off.norm() < 0.2, "{off}");
    // The attitude of before has won: only the position was wrong.
    assert!(worst_heading < 3.0, "{worst_heading} standard deviations");
    assert!(turned(&ins, &motion) < 0.03 && before != ins.state().unwrap().ned_from_body);
    assert_eq!(ins.validity(), Validity::Aided);
}

/// Drives for two minutes; `faulty` changes rate and force at an instant (s), a rate that is none is one that does not come. Horizontal errors at each second.
pub(super) fn with_faults(
    faulty: impl FnMut(f64, &mut Vector3<f64>, &mut Vector3<f64>),
) -> (std::vec::Vec<f64>, GnssIns<f64, 64>) {
    with_faults_and_headings(faulty, None)
}

/// The same, with a heading of this standard deviation (rad) beside every fix.
pub(super) fn with_faults_and_headings(
    mut faulty: impl FnMut(f64, &mut Vector3<f64>, &mut Vector3<f64>),
    heading_std: Option<f64>,
) -> (std::vec::Vec<f64>, GnssIns<f64, 64>) {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(11);
    let mut noise =
        |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(rand_distr::StandardNormal));
    let mut ins = GnssIns::<f64, 64>::new(config()).unwrap();
    let mut motion = Motion::start();
    let mut errors = std::vec::Vec::new();
    for k in 1..=12_000_i64 {
        let t = k as f64 * 0.01;
        motion.step(t, 0.01);
        let (mut rate, mut force) = (motion.rate() + noise(2e-3), motion.force() + noise(0.02));
        faulty(t, &mut rate, &mut force);
        let time_ns = k * 10_000_000;
        if rate.x.is_nan() {
            ins.imu_without_rate(time_ns, &force).unwrap();
        } else {
            ins.imu(time_ns, &rate, &force).unwrap();
        }
        if k % 100 == 0 {
            let off = ins.state().map(|state| state.position - motion.position);
            errors.push(off.map_or(f64::NAN, |off| off.xy().norm()));
            if let Some(std) = heading_std {
                ins.heading(time_ns, motion.heading, std);
            }
            let fix = GnssPosition {
                ned: motion.position + noise(0.3),
                std: Vector3::repeat(0.3),
                has_height: true,
            };
            ins.gnss_position(time_ns, &fix);
        }
    }
    (errors, ins)
}

/// An hour ahead, and minutes: neither starts anything anew, and the fault is told.
#[test]
fn a_stamp_ahead_costs_its_sample() {
    let (mut ins, motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let now = ins.time_ns().unwrap();
    let before = *ins.state().unwrap();
    for (k, ahead_s) in [3600, 60].into_iter().enumerate() {
        let next = now + 10_000_000 * (1 + k as i64);
        let refused = ins.imu(
            next + ahead_s * 1_000_000_000,
            &motion.rate(),
            &motion.force(),
        );
        assert_eq!(refused, Err(SkipReason::Suspect));
        ins.imu(next, &motion.rate(), &motion.force()).unwrap();
        let fault = ins.take_fault().unwrap();
        assert_eq!((fault.kind, fault.until_ns), (FaultKind::Stamp, next));
        assert!((fault.size - ahead_s as f64).abs() < 0.1, "{}", fault.size);
    }
    let moved = ins.state().unwrap().position - before.position;
    assert!((moved - before.velocity * 0.02).norm() < 1e-3, "{moved}");
    assert_eq!((ins.gaps(), ins.restarts()), (0, 0));
}

/// While the gyroscope pauses the accelerometer goes on: the position is as good as with one that repeats itself.
#[test]
fn a_pause_of_the_gyroscope_is_gone_through_on_the_accelerometer() {
    let (clean, _) = with_faults(|_, _, _| ());
    let (errors, mut ins) = with_faults(|t, rate, _| {
        if (70.0..73.0).contains(&t) {
            rate.fill(f64::NAN);
        }
    });
    let worst = |errors: &[f64]| errors[83..].iter().fold(0.0_f64, |worst, e| worst.max(*e));
    let (worst, clean) = (worst(&errors), worst(&clean));
    assert!(worst < 2.0 * clean, "{worst} {clean}");
    let (found, over) = (ins.take_fault().unwrap(), ins.take_fault().unwrap());
    assert_eq!((found.kind, over.is_over), (FaultKind::Missing, true));
    assert_eq!(
        (over.from_ns, over.until_ns),
        (69_990_000_000, 73_000_000_000)
    );
    assert_eq!((ins.take_fault(), ins.gaps(), ins.restarts()), (None, 0, 0));
}

#[test]
fn a_false_inertial_sample_costs_nothing_and_is_told() {
    let rms = |errors: &[f64]| {
        let late = &errors[60..];
        (late.iter().map(|e| e * e).sum::<f64>() / late.len() as f64).sqrt()
    };
    let (clean, mut ins) = with_faults(|_, _, _| ());
    assert_eq!(ins.take_fault(), None);
    for accelerometer in [false, true] {
        let (errors, mut ins) = with_faults(|t, rate, force| {
            if (t - 70.0).abs() < 1e-6 {
                if accelerometer {
                    force.x += 160.0;
                } else {
                    rate.z += 34.9;
                }
            }
        });
        assert!(
            rms(&errors) < 1.05 * rms(&clean),
            "{} {}",
            rms(&errors),
            rms(&clean)
        );
        let fault = ins.take_fault().unwrap();
        assert_eq!(
            (fault.kind, fault.until_ns),
            (FaultKind::Spike, 70_010_000_000)
        );
        assert_eq!((ins.take_fault(), ins.realignments()), (None, 0));
    }
}

#[test]
fn a_frozen_gyroscope_is_survived() {
    let (clean, _) = with_faults(|_, _, _| ());
    for zeros in [false, true] {
        let mut held = None;
        let (errors, mut ins) = with_faults(|t, rate, _| {
            if (70.0..73.0).contains(&t) {
                let value = if zeros { Vector3::zeros() } else { *rate };
                *rate = *held.get_or_insert(value);
            }
        });
        let worst = |errors: &[f64]| errors[83..].iter().fold(0.0_f64, |worst, e| worst.max(*e));
        let (worst, clean) = (worst(&errors), worst(&clean));
        assert!(worst < 2.0 * clean, "{worst} {clean}");
        assert_eq!(ins.take_fault().unwrap().kind, FaultKind::Stuck);
        assert!(ins.take_fault().unwrap().is_over);
        assert_eq!(ins.restarts(), 0);
    }
}

/// Samples wait until a fix says where to cut: with the noise that they had.
#[test]
fn what_was_not_seen_while_it_aligns_is_uncertain() {
    use rand::{RngExt, SeedableRng};
    let velocity_std = |frozen: bool| {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let mut noise = |std: f64| {
            Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(rand_distr::StandardNormal))
        };
        let mut ins = GnssIns::<f64, 64>::new(config()).unwrap();
        let (mut motion, mut held) = (Motion::start(), None);
        for k in 1..=2200_i64 {
            motion.step(k as f64 * 0.01, 0.01);
            let (rate, force) = (motion.rate() + noise(2e-3), motion.force() + noise(0.02));
            let force = if frozen && k > 2000 {
                *held.get_or_insert(force)
            } else {
                force
            };
            ins.imu(k * 10_000_000, &rate, &force).unwrap();
            if k % 100 == 0 {
                let fix = GnssPosition {
                    ned: motion.position,
                    std: Vector3::repeat(0.3),
                    has_height: true,
                };
                ins.gnss_position(k * 10_000_000, &fix);
            }
        }
        assert!(ins.memory.aligning);
        ins.state().unwrap().velocity_std().xy().norm()
    };
    let [seen, unseen] = [false, true].map(velocity_std);
    assert!(unseen > 0.8 && seen < 0.5 * unseen, "{seen} {unseen}");
}

/// Goes on for so many seconds; samples come in the seconds that `has_samples`, fixes in all.
fn go_on(
    ins: &mut GnssIns<f64, 64>,
    motion: &mut Motion,
    from_s: f64,
    seconds: usize,
    has_samples: impl Fn(usize) -> bool,
) -> std::vec::Vec<(f64, Outcome)> {
    let start_ns = (from_s * 1e9) as i64;
    let mut seen = std::vec::Vec::new();
    for k in 1..=100 * seconds {
        motion.step(from_s + k as f64 * 0.01, 0.01);
        let time_ns = start_ns + k as i64 * 10_000_000;
        if has_samples((k - 1) / 100) {
            let _ = ins.imu(time_ns, &motion.rate(), &motion.force());
        }
        if k % 100 == 0 {
            let fix = GnssPosition {
                ned: motion.position,
                std: Vector3::new(0.05, 0.05, 0.1),
                has_height: true,
            };
            let outcome = ins.gnss_position(time_ns, &fix).horizontal.outcome;
            seen.push((position_error(ins, motion), outcome));
        }
    }
    seen
}

/// From the second fix in a gap on, that there is one is known, and the position goes on with the fixes.
#[test]
fn fixes_in_a_gap_of_the_inertial_samples_are_used() {
    let (mut ins, mut motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let seen = go_on(&mut ins, &mut motion, 60.0, 20, |second| {
        !(3..8).contains(&second)
    });
    for (second, (error, outcome)) in seen.iter().enumerate().skip(4) {
        let limit = if second < 8 { 1.0 } else { 0.3 };
        assert!(
            outcome.is_fused() && *error < limit,
            "{second}: {error} {outcome:?}"
        );
    }
    assert_eq!((ins.gaps(), ins.restarts(), ins.realignments()), (1, 0, 0));
    // Neither does the first sample behind the gap, which comes just after a fix of a later stamp, make it none.
    let now = ins.time_ns().unwrap();
    for second in [1, 2] {
        let fix = GnssPosition {
            ned: motion.position,
            std: Vector3::repeat(5.0),
            has_height: true,
        };
        ins.gnss_position(now + second * 1_000_000_000, &fix);
    }
    let straggler = ins.imu(now + 1_990_000_000, &motion.rate(), &motion.force());
    assert_eq!(straggler, Err(SkipReason::NotNewer));
    assert!(!ins.memory.samples_come_late);
}

/// A unit that delivers its samples many at once, after the fixes of their time: told once, and then no gap is taken for one.
#[test]
fn samples_that_come_late_are_no_gap() {
    let (mut ins, mut motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let mut batches = std::vec::Vec::new();
    let (mut skipped, mut worst) = (0, 0.0_f64);
    for k in 1..=2400_i64 {
        motion.step(60.0 + k as f64 * 0.01, 0.01);
        let time_ns = 60_000_000_000 + k * 10_000_000;
        batches.push((time_ns, motion));
        if k % 20 == 0 {
            let fix = GnssPosition {
                ned: motion.position,
                std: Vector3::new(0.05, 0.05, 0.1),
                has_height: true,
            };
            ins.gnss_position(time_ns, &fix);
        }
        if k % 90 == 0 {
            for (time_ns, motion) in batches.drain(..) {
                let refused = ins.imu(time_ns, &motion.rate(), &motion.force()).is_err();
                skipped += u32::from(refused);
            }
            worst = worst.max(position_error(&ins, &motion));
        }
    }
    assert!(ins.memory.samples_come_late);
    assert!(
        (1..=90).contains(&skipped),
        "of the first batch only: {skipped}"
    );
    assert!(worst < 2.0, "{worst}");
}

#[test]
fn bad_input_is_counted_and_changes_nothing() {
    let (mut ins, motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let now = ins.time_ns().unwrap();
    let before = *ins.state().unwrap();
    let nan = Vector3::repeat(f64::NAN);
    let (rate, force) = (motion.rate(), motion.force());
    assert_eq!(ins.imu(now, &rate, &force), Err(SkipReason::NotNewer));
    assert_eq!(ins.imu(now + 1, &nan, &force), Err(SkipReason::NotFinite));
    assert_eq!(
        ins.imu(now + 1, &rate, &(force * 1e4)),
        Err(SkipReason::OutOfRange)
    );
    assert_eq!(ins.imu_skipped(), 3);
    let good = GnssPosition {
        ned: motion.position,
        std: Vector3::repeat(1.0),
        has_height: true,
    };
    let skipped = |ins: &mut GnssIns<f64, 64>, time_ns, fix: &GnssPosition<f64>| match ins
        .gnss_position(time_ns, fix)
        .horizontal
        .outcome
    {
        Outcome::Skipped(reason) => reason,
        other => panic!("{other:?}"),
    };
    let later = now + 5_000_000;
    assert_eq!(
        skipped(&mut ins, later, &GnssPosition { ned: nan, ..good }),
        SkipReason::NotFinite
    );
    assert_eq!(
        skipped(
            &mut ins,
            later,
            &GnssPosition {
                std: -good.std,
                ..good
            }
        ),
        SkipReason::OutOfRange
    );
    let swapped = GnssPosition {
        ned: good.ned * 1e5,
        ..good
    };
    assert_eq!(skipped(&mut ins, later, &swapped), SkipReason::OutOfRange);
    assert_eq!(
        skipped(&mut ins, now, &good),
        SkipReason::NotNewer,
        "the last fix had this stamp"
    );
    assert_eq!(
        skipped(&mut ins, now + 5_000_000_000, &good),
        SkipReason::TooLate
    );
    // That one does not make the others old, and one of long ago is called so.
    let mut other = ins;
    let next = GnssPosition {
        ned: good.ned + Vector3::repeat(0.1),
        ..good
    };
    let next = other.gnss_position(later, &next).horizontal.outcome;
    assert!(next.is_fused(), "{next:?}");
    assert_eq!(
        skipped(&mut ins, now - 120_000_000_000, &good),
        SkipReason::NotNewer
    );
    assert!(!ins.heading(later, f64::NAN, 0.1).outcome.is_fused());
    assert!(!ins.barometer(later, f64::INFINITY).outcome.is_fused());
    assert!(
        !ins.magnetometer(later, &Vector3::zeros())
            .outcome
            .is_fused()
    );
    assert!(!ins.speed(later, 1.0, 0.0).outcome.is_fused());
    assert_eq!(*ins.state().unwrap(), before);
    assert_eq!(
        ins.counts(Aid::GnssPosition).skipped as usize,
        6 + before_start(&ins)
    );
    let broken = GnssInsConfig {
        gravity: f64::NAN,
        ..config()
    };
    assert_eq!(GnssIns::<f64>::new(broken).unwrap_err().field, "gravity");
}

#[test]
fn gaps_are_bridged_and_a_long_one_starts_again() {
    let (mut ins, motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let now = ins.time_ns().unwrap();
    let before = *ins.state().unwrap();
    ins.imu(now + 2_000_000_000, &motion.rate(), &motion.force())
        .unwrap();
    let bridged = *ins.state().unwrap();
    let moved = bridged.position - before.position;
    assert!((moved - before.velocity * 2.0).norm() < 0.1, "{moved}");
    assert!(bridged.covariance[(3, 3)] > before.covariance[(3, 3)] + 7.0);
    assert_eq!((ins.gaps(), ins.restarts()), (1, 0));
    // One stamp may be false: the second one goes on from it.
    let [first, second] = [0, 10_000_000].map(|later| {
        ins.imu(
            now + 30_000_000_000 + later,
            &motion.rate(),
            &motion.force(),
        )
    });
    assert_eq!((first, second), (Err(SkipReason::Suspect), Ok(())));
    assert_eq!(
        (ins.validity(), ins.gaps(), ins.restarts()),
        (Validity::Aligning, 2, 1)
    );
}

#[test]
fn a_clock_that_goes_back_is_followed_and_stray_stamps_are_not() {
    let (mut ins, motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let now = ins.time_ns().unwrap();
    let (rate, force) = (motion.rate(), motion.force());
    // Stragglers, and a few strays.
    for back in [10, 20, 400, 30_000, 40_000, 50_000] {
        let refused = ins.imu(now - back * 1_000_000, &rate, &force);
        assert_eq!(refused, Err(SkipReason::NotNewer));
    }
    assert_eq!((ins.validity(), ins.restarts()), (Validity::Aided, 0));
    ins.imu(now + 10_000_000, &rate, &force).unwrap();
    // The unit restarts: its counter begins anew.
    let refused = |ins: &mut GnssIns<f64, 64>| {
        let samples = (1..=3000_i64).map(|k| ins.imu(k * 10_000_000, &Vector3::zeros(), &force));
        samples.filter(Result::is_err).count()
    };
    assert_eq!(refused(&mut ins), 8);
    assert_eq!((ins.validity(), ins.restarts()), (Validity::Aligning, 1));
    assert_eq!(ins.time_ns(), Some(30_000_000_000));
    let fix = GnssPosition {
        ned: motion.position,
        std: Vector3::repeat(0.05),
        has_height: true,
    };
    let told = ins.gnss_position(30_000_000_000, &fix).horizontal.outcome;
    assert_eq!(told, Outcome::Skipped(SkipReason::NotInitialized));
}

#[test]
fn a_rate_at_rest_that_is_refused_is_let_in_after_a_while() {
    let standing = GnssInsConfig {
        zero_velocity: true,
        initial_heading: Some([0.0, 0.02]),
        ..config()
    };
    let mut ins = GnssIns::<f64, 64>::new(standing).unwrap();
    let force = Vector3::new(0.0, 0.0, -GRAVITY);
    // The bias jumps by 2 degrees a second, about the axis that gravity says nothing of.
    let jump = 0.035;
    for k in 1..=12_000_i64 {
        let time_ns = k * 10_000_000;
        let rate = Vector3::z() * if k > 9000 { jump } else { 0.0 };
        ins.imu(time_ns, &rate, &force).unwrap();
        if k % 100 == 0 {
            let std = Vector3::repeat(0.5);
            let (ned, has_height) = (Vector3::zeros(), true);
            ins.gnss_position(
                time_ns,
                &GnssPosition {
                    ned,
                    std,
                    has_height,
                },
            );
            let (std, has_vertical) = (Vector3::repeat(0.05), true);
            ins.gnss_velocity(
                time_ns,
                &GnssVelocity {
                    ned,
                    std,
                    has_vertical,
                },
            );
        }
    }
    let bias = ins.state().unwrap().gyroscope_bias.z;
    assert!((bias - jump).abs() < 0.2 * jump, "{bias}");
}

/// GIVEN a table that tells the last fix again in each of its rows WHEN a vehicle drives THEN each fix is used once, and its copies are
/// counted as the same numbers again.
#[test]
fn a_fix_that_a_table_tells_again_is_used_once() {
    let mut ins = GnssIns::<f64, 64>::new(config()).unwrap();
    let (mut motion, mut fix) = (Motion::start(), Vector3::zeros());
    for k in 1..=4000_i64 {
        motion.step(k as f64 * 0.01, 0.01);
        let time_ns = k * 10_000_000;
        ins.imu(time_ns, &motion.rate(), &motion.force()).unwrap();
        let is_new = k % 20 == 0;
        if is_new {
            let wobble = Vector3::new((k as f64).sin(), (k as f64).cos(), 0.0);
            fix = motion.position + wobble * 0.5;
        }
        let update = ins.gnss_position(time_ns, &GnssPosition::new(fix, Vector3::repeat(0.5)));
        // How often a new one comes is known from the second on.
        if k > 40 {
            let is_held = update.horizontal.outcome == Outcome::Skipped(SkipReason::Repeated);
            assert_eq!(is_held, !is_new, "{k}");
        }
    }
    let off = (ins.state().unwrap().position - motion.position).norm();
    assert!(off < 1.0, "{off}");
}

/// GIVEN a receiver at standstill whose fixes have the same digits WHEN a table tells each again in its rows THEN it is heard all the time, two
/// times in three; WHEN they come without copies THEN always, and also when the copies have ended.
#[test]
fn a_receiver_that_stands_is_heard_though_a_table_holds_its_fixes() {
    let used_in_10_s = |held: fn(i64) -> bool| {
        let mut ins = GnssIns::<f64, 64>::new(config()).unwrap();
        let (at_rest, gravity) = (Vector3::zeros(), Vector3::new(0.0, 0.0, -9.81));
        let mut used = 0;
        for k in 1..=6000_i64 {
            let time_ns = k * 10_000_000;
            ins.imu(time_ns, &at_rest, &gravity).unwrap();
            // It moves its last digit until 20 s, and stands from there on.
            let north = (k.min(2000) / 20) as f64 * 1e-3;
            let fix = GnssPosition::new(Vector3::new(north, 0.0, 0.0), Vector3::repeat(0.5));
            if k % 20 == 0 || held(k) {
                let update = ins.gnss_position(time_ns, &fix);
                let is_used = update.horizontal.outcome != Outcome::Skipped(SkipReason::Repeated);
                used += usize::from(is_used && k > 5000);
            }
        }
        used
    };
    assert_eq!(used_in_10_s(|_| false), 50);
    assert_eq!(used_in_10_s(|_| true), 33);
    assert_eq!(used_in_10_s(|k| k < 3000), 50);
}
