//! The GNSS/INS as a whole, on motions made here: start, late fixes, outages, bad input.

mod magnetometer;
mod models;
mod start_in_motion;

use super::*;
use crate::geometry::rotation;
use crate::kalman::covariance::cholesky;
use crate::kalman::{Outcome, SkipReason};
use crate::navigation::aiding::gnss_position::GnssPosition;
use crate::navigation::aiding::gnss_velocity::GnssVelocity;
use crate::navigation::augmented_states::{MOUNT_PITCH, MOUNT_YAW, TIME_OFFSET};

const GRAVITY: f64 = 9.806_65;
const STILL_S: f64 = 4.0;
const DECLINATION: f64 = 0.2;

/// A vehicle that stands, and then drives on a winding road: heading, speed, position, velocity.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    heading: f64,
    heading_rate: f64,
    speed: f64,
    acceleration: f64,
    pub(super) position: Vector3<f64>,
}

impl Motion {
    pub(super) fn start() -> Self {
        Self {
            heading: 1.0,
            heading_rate: 0.0,
            speed: 0.0,
            acceleration: 0.0,
            position: Vector3::new(20.0, -10.0, 3.0),
        }
    }

    pub(super) fn step(&mut self, t: f64, dt: f64) {
        let driving = t - STILL_S;
        if driving > 0.0 {
            let full = (0.5 * driving).min(1.0);
            self.heading_rate = full * 0.25 * (0.35 * driving).sin();
            self.acceleration =
                full * (1.2 * (0.3 * driving).sin() + if driving < 8.0 { 1.2 } else { 0.0 });
        }
        let (before, heading) = (self.speed, self.heading);
        self.speed += self.acceleration * dt;
        self.heading += self.heading_rate * dt;
        let (v, h) = (0.5 * (before + self.speed), 0.5 * (heading + self.heading));
        self.position += Vector3::new(h.cos(), h.sin(), 0.0) * (v * dt);
    }

    pub(super) fn velocity(&self) -> Vector3<f64> {
        Vector3::new(self.heading.cos(), self.heading.sin(), 0.0) * self.speed
    }

    pub(super) fn rate(&self) -> Vector3<f64> {
        Vector3::z() * self.heading_rate
    }

    pub(super) fn force(&self) -> Vector3<f64> {
        Vector3::new(self.acceleration, self.speed * self.heading_rate, -GRAVITY)
    }
}

/// What a drive is seen by.
#[derive(Clone, Copy)]
struct Drive {
    seconds: usize,
    position_latency: f64,
    velocity_latency: f64,
    velocity: bool,
    /// First and last second without fixes.
    outage: [usize; 2],
    mount: [f64; 2],
    /// What iron the magnetometer carries, ten times a second; `None`: there is no magnetometer.
    iron: Option<Vector3<f64>>,
}

impl Default for Drive {
    fn default() -> Self {
        Self {
            seconds: 60,
            position_latency: 0.0,
            velocity_latency: 0.0,
            velocity: true,
            outage: [usize::MAX; 2],
            mount: [0.0; 2],
            iron: None,
        }
    }
}

/// Declination of 0.2 rad, dip of 62 degrees, microtesla.
fn magnetic_field() -> Vector3<f64> {
    let (dip, declination) = (62_f64.to_radians(), DECLINATION);
    let horizontal = 48.0 * dip.cos();
    let down = 48.0 * dip.sin();
    Vector3::new(
        horizontal * declination.cos(),
        horizontal * declination.sin(),
        down,
    )
}

pub(super) fn config() -> GnssInsConfig<f64> {
    GnssInsConfig {
        imu_samples: ImuSamples::Means,
        ..GnssInsConfig::default()
    }
}

/// Drives; `each` second sees the filter and the truth.
fn drive(
    config: GnssInsConfig<f64>,
    drive: &Drive,
    mut each: impl FnMut(usize, &mut GnssIns<f64, 64>, &Motion),
) -> (GnssIns<f64, 64>, Motion) {
    let mut ins = GnssIns::<f64, 64>::new(config).unwrap();
    let mut motion = Motion::start();
    let mut past = std::vec![motion; 100];
    let body_from_vehicle = rotation::from_yaw_pitch_roll([drive.mount[1], drive.mount[0], 0.0]);
    for k in 1..=drive.seconds * 100 {
        motion.step(k as f64 * 0.01, 0.01);
        past.push(motion);
        let time_ns = k as i64 * 10_000_000;
        let (rate, force) = (
            body_from_vehicle * motion.rate(),
            body_from_vehicle * motion.force(),
        );
        ins.imu(time_ns, &rate, &force).unwrap();
        let second = k / 100;
        if k % 100 == 0 && !(drive.outage[0]..drive.outage[1]).contains(&second) {
            let before = |latency: f64| past[past.len() - 1 - (latency * 100.0).round() as usize];
            ins.gnss_position(
                time_ns,
                &GnssPosition {
                    ned: before(drive.position_latency).position,
                    std: Vector3::new(0.05, 0.05, 0.1),
                    has_height: true,
                },
            );
            if drive.velocity {
                ins.gnss_velocity(
                    time_ns,
                    &GnssVelocity {
                        ned: before(drive.velocity_latency).velocity(),
                        std: Vector3::repeat(0.05),
                        has_vertical: true,
                    },
                );
            }
        }
        if let Some(iron) = drive.iron.filter(|_| k % 10 == 0) {
            let body_from_ned = rotation::from_yaw_pitch_roll([motion.heading, 0.0, 0.0]).inverse();
            ins.magnetometer(time_ns, &(body_from_ned * magnetic_field() + iron));
        }
        if k % 100 == 0 {
            each(second, &mut ins, &motion);
        }
    }
    (ins, motion)
}

fn position_error(ins: &GnssIns<f64, 64>, motion: &Motion) -> f64 {
    (ins.state().unwrap().position - motion.position).norm()
}

#[test]
fn it_starts_by_itself_and_follows() {
    for velocity in [true, false] {
        let seen = Drive {
            velocity,
            ..Drive::default()
        };
        let (ins, motion) = drive(config(), &seen, |_, _, _| ());
        assert_eq!(ins.validity(), Validity::Aided);
        assert!(
            position_error(&ins, &motion) < 0.1,
            "{}",
            position_error(&ins, &motion)
        );
        let state = ins.state().unwrap();
        let [yaw, pitch, roll] = rotation::to_yaw_pitch_roll(&state.ned_from_body);
        let off = (yaw - motion.heading).sin();
        assert!(
            off.abs() < 0.02 && pitch.abs() < 0.01 && roll.abs() < 0.01,
            "{off} {pitch} {roll}"
        );
        assert_eq!(ins.counts(Aid::GnssPosition).gated, 0);
        assert!(ins.counts(Aid::GnssPosition).fused > 40);
    }
}

#[test]
fn late_fixes_are_compared_with_where_the_body_was() {
    let late = Drive {
        position_latency: 0.2,
        velocity_latency: 0.3,
        ..Drive::default()
    };
    let told = GnssInsConfig {
        position_latency_s: 0.2,
        velocity_latency_s: 0.3,
        ..config()
    };
    let worst = |config| {
        let mut worst = 0.0_f64;
        drive(config, &late, |second, ins, motion| {
            if second > 20 {
                worst = worst.max(position_error(ins, motion));
            }
        });
        worst
    };
    let (with, without) = (worst(told), worst(config()));
    // Not told, it learns it, from what it can see.
    assert!(with < 0.1 && without > 10.0 * with, "{with} {without}");
    // Both are 0.2 s later than told: learnt from turns and accelerations.
    let told_wrong = GnssInsConfig {
        velocity_latency_s: 0.1,
        time_offset_std_s: 0.2,
        ..config()
    };
    let longer = Drive {
        seconds: 120,
        ..late
    };
    let (ins, motion) = drive(told_wrong, &longer, |_, _, _| ());
    let std = ins.augmented_states().covariance[(TIME_OFFSET, TIME_OFFSET)].sqrt();
    let offset = ins.augmented_states().values[TIME_OFFSET];
    assert!(
        (offset - 0.2).abs() < 0.02 && std < 0.02,
        "{offset} +- {std}"
    );
    assert!(position_error(&ins, &motion) < 0.3);
}

#[test]
fn an_outage_is_flagged_and_its_variance_grows_until_the_fixes_return() {
    let gone = Drive {
        seconds: 90,
        outage: [40, 80],
        ..Drive::default()
    };
    let mut said = std::vec::Vec::new();
    let (ins, _) = drive(config(), &gone, |second, ins, _| {
        let p = ins.state().map_or(0.0, |s| s.covariance[(6, 6)]);
        said.push((second, ins.validity(), p.sqrt()));
    });
    let at = |second: usize| said[second - 1];
    assert_eq!(at(2).1, Validity::HeadingUnknown, "it stands");
    assert_eq!(at(39).1, Validity::Aided);
    assert_eq!(at(41).1, Validity::Aided);
    assert_eq!(at(43).1, Validity::DeadReckoning);
    assert_eq!(at(79).1, Validity::Invalid, "more than 30 s");
    assert_eq!(at(80).1, Validity::Aided);
    assert!(at(45).2 < at(50).2 && at(50).2 < at(60).2 && at(60).2 < at(79).2);
    assert!(at(85).2 < 0.2);
    assert_eq!(ins.restarts(), 0);
}

#[test]
fn a_mount_that_is_not_straight_is_learnt() {
    let mount = [0.1, -0.06];
    let crooked = Drive {
        seconds: 90,
        outage: [60, 85],
        mount,
        ..Drive::default()
    };
    let held = GnssInsConfig {
        non_holonomic: true,
        ..config()
    };
    let (ins, _) = drive(held, &crooked, |second, ins, _| {
        if second == 59 {
            let values = ins.augmented_states().values;
            assert!((values[MOUNT_PITCH] - mount[0]).abs() < 0.01, "{values}");
            assert!((values[MOUNT_YAW] - mount[1]).abs() < 0.02, "{values}");
        }
    });
    assert!(ins.counts(Aid::NonHolonomic).fused > 200);
    assert_eq!(ins.counts(Aid::NonHolonomic).gated, 0);
}

#[test]
fn a_standstill_is_found_only_when_it_is_one() {
    let stop = GnssInsConfig {
        zero_velocity: true,
        ..config()
    };
    let mut ins = GnssIns::<f64>::new(stop).unwrap();
    let fix = |ned: Vector3<f64>| GnssPosition {
        ned,
        std: Vector3::repeat(1.0),
        has_height: true,
    };
    // Stands for 5 s, drives off to 10 m/s, rolls smoothly for 10 s without fixes, brakes and stands.
    let mut position = Vector3::zeros();
    let mut speed = 0.0;
    let mut rolling = 0;
    for k in 1..=5000_i64 {
        let t = k as f64 * 0.01;
        let acceleration = match t {
            t if t < 5.0 => 0.0,
            t if t < 10.0 => 2.0,
            t if t < 30.0 => 0.0,
            t if t < 35.0 => -2.0,
            _ => 0.0,
        };
        speed += acceleration * 0.01;
        position.x += speed * 0.01;
        let shake = if speed > 0.1 { 0.15 } else { 0.02 } * if k % 2 == 0 { 1.0 } else { -1.0 };
        let force = Vector3::new(acceleration + shake, shake, -GRAVITY + shake);
        ins.imu(k * 10_000_000, &(Vector3::repeat(shake) * 0.02), &force)
            .unwrap();
        if k % 100 == 0 && t < 20.5 {
            ins.gnss_position(k * 10_000_000, &fix(position));
            let (ned, std) = (Vector3::x() * speed, Vector3::repeat(0.05));
            ins.gnss_velocity(
                k * 10_000_000,
                &GnssVelocity {
                    ned,
                    std,
                    has_vertical: true,
                },
            );
        }
        if (11.0..30.0).contains(&t) && ins.is_still() {
            rolling += 1;
        }
    }
    assert_eq!(rolling, 0, "rolling was taken for standing");
    assert!(ins.is_still());
    let counts = ins.counts(Aid::ZeroVelocity);
    assert!(counts.fused >= 20, "{counts:?}");
    let state = ins.state().unwrap();
    assert!(state.velocity.norm() < 0.01 && state.covariance[(3, 3)].sqrt() < 0.05);
}

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
        5 + before_start(&ins)
    );
    let broken = GnssInsConfig {
        gravity: f64::NAN,
        ..config()
    };
    assert_eq!(GnssIns::<f64>::new(broken).unwrap_err().field, "gravity");
}

/// Fixes that came before the start.
fn before_start(ins: &GnssIns<f64, 64>) -> usize {
    60 - (ins.counts(Aid::GnssPosition).fused as usize)
}

#[test]
fn without_any_receiver_it_never_claims_a_position() {
    let mut ins = GnssIns::<f32>::new(GnssInsConfig::default()).unwrap();
    for k in 1..=2000_i64 {
        let force = Vector3::new(0.0, 0.0, -9.8);
        ins.imu(k * 10_000_000, &Vector3::zeros(), &force).unwrap();
        ins.heading(k * 10_000_000, 0.3, 0.05);
        assert_eq!((ins.validity(), ins.state()), (Validity::Aligning, None));
    }
}

#[test]
fn a_start_in_motion_is_levelled_by_the_fixes() {
    // At 10 m/s and accelerating from the first sample on.
    let mut ins = GnssIns::<f64>::new(config()).unwrap();
    let (mut speed, mut x) = (10.0, 0.0);
    for k in 1..=6000_i64 {
        let acceleration = 1.0 * (0.2 * k as f64 * 0.01).sin() + 0.1;
        let rate = 0.1 * (0.3 * k as f64 * 0.01).cos();
        speed += acceleration * 0.01;
        x += speed * 0.01;
        let roll = (rate * 0.05, 0.0, 0.0);
        let force = Vector3::new(acceleration, 0.0, -GRAVITY);
        ins.imu(k * 10_000_000, &Vector3::new(roll.1, roll.2, 0.0), &force)
            .unwrap();
        if k % 100 == 0 {
            let (ned, std) = (Vector3::x() * x, Vector3::repeat(2.0));
            ins.gnss_position(
                k * 10_000_000,
                &GnssPosition {
                    ned,
                    std,
                    has_height: true,
                },
            );
            let (ned, std) = (Vector3::x() * speed, Vector3::repeat(0.1));
            ins.gnss_velocity(
                k * 10_000_000,
                &GnssVelocity {
                    ned,
                    std,
                    has_vertical: false,
                },
            );
        }
    }
    let state = ins.state().unwrap();
    assert_eq!(ins.validity(), Validity::Aided);
    let [_, pitch, roll] = rotation::to_yaw_pitch_roll(&state.ned_from_body);
    assert!(pitch.abs() < 0.02 && roll.abs() < 0.03, "{pitch} {roll}");
    assert!((state.velocity.x - speed).abs() < 0.2);
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
    ins.imu(now + 30_000_000_000, &motion.rate(), &motion.force())
        .unwrap();
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
fn without_samples_an_unmeasured_velocity_is_damped_and_a_clock_that_goes_back_is_followed() {
    let speed_after = |damping_speed_m_s: f64| {
        let ship = GnssInsConfig {
            imu_samples: ImuSamples::None,
            gap_velocity_random_walk: 0.1,
            damping_speed_m_s,
            ..GnssInsConfig::<f64>::default()
        };
        let mut ins = GnssIns::<f64>::new(ship).unwrap();
        for k in 1..=600_i64 {
            let time_ns = k * 200_000_000;
            ins.heading(time_ns, 0.0, 0.01);
            if k % 5 == 0 && k <= 300 {
                let ned = Vector3::new(k as f64, 0.0, 0.0);
                let std = Vector3::repeat(0.5);
                ins.gnss_position(
                    time_ns,
                    &GnssPosition {
                        ned,
                        std,
                        has_height: true,
                    },
                );
            }
        }
        (ins.state().unwrap().velocity.x, ins)
    };
    let (free, _) = speed_after(0.0);
    let (damped, mut ins) = speed_after(1.0);
    // 5 m/s were seen; a prior of 1 m/s takes some of them away in a minute without fixes.
    assert!(
        (free - 5.0).abs() < 0.1 && (0.5..4.5).contains(&damped),
        "{free} {damped}"
    );
    assert_eq!((ins.validity(), ins.restarts()), (Validity::Invalid, 0));
    for k in 1..=20_i64 {
        ins.heading(k * 200_000_000, 0.0, 0.01);
    }
    assert_eq!((ins.validity(), ins.restarts()), (Validity::Aligning, 1));
    assert_eq!(ins.time_ns(), Some(4_000_000_000));
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

#[test]
fn a_ship_without_an_inertial_unit_is_carried_by_gyrocompass_and_log() {
    let ship = GnssInsConfig {
        imu_samples: ImuSamples::None,
        gap_attitude_random_walk: 0.02,
        gap_velocity_random_walk: 0.1,
        non_holonomic: true,
        ..GnssInsConfig::<f64>::default()
    };
    let mut ins = GnssIns::<f64>::new(ship).unwrap();
    assert_eq!(
        ins.imu(1, &Vector3::zeros(), &Vector3::zeros()),
        Err(SkipReason::NotUsed)
    );
    let mut position = Vector3::zeros();
    let mut worst = 0.0_f64;
    for k in 1..=1500_i64 {
        let t = k as f64 * 0.2;
        let heading = 0.5 + 0.01 * t;
        position += Vector3::new(heading.cos(), heading.sin(), 0.0) * (5.0 * 0.2);
        let time_ns = k * 200_000_000;
        ins.heading(time_ns, heading, 0.01);
        ins.speed(time_ns, 5.0, 0.2);
        if k % 5 == 0 && !(150.0..180.0).contains(&t) {
            let std = Vector3::repeat(2.0);
            ins.gnss_position(
                time_ns,
                &GnssPosition {
                    ned: position,
                    std,
                    has_height: true,
                },
            );
        }
        if (150.0..180.0).contains(&t) {
            worst = worst.max((ins.state().unwrap().position - position).norm());
        }
    }
    assert!(worst < 8.0, "150 m of dead reckoning: {worst}");
    assert_eq!(ins.validity(), Validity::Aided);
}

#[test]
fn without_an_inertial_unit_fixes_that_jump_for_good_are_followed() {
    let ship = GnssInsConfig {
        imu_samples: ImuSamples::None,
        gap_velocity_random_walk: 0.1,
        initial_heading: Some([0.0, 0.02]),
        ..GnssInsConfig::<f64>::default()
    };
    let mut ins = GnssIns::<f64>::new(ship).unwrap();
    let mut off = 0.0;
    for k in 1..=120_i64 {
        let time_ns = k * 1_000_000_000;
        let jumped = if k > 60 { 2000.0 } else { 0.0 };
        let ned = Vector3::new(5.0 * k as f64 + jumped, 0.0, 0.0);
        ins.heading(time_ns, 0.0, 0.01);
        ins.gnss_position(time_ns, &GnssPosition::new(ned, Vector3::repeat(1.0)));
        off = (ins.state().unwrap().position - ned).norm();
    }
    assert!(off < 10.0, "{off}");
    assert_eq!((ins.validity(), ins.realignments()), (Validity::Aided, 0));
}

#[test]
fn single_precision_follows_double() {
    let (mut double, motion) = drive(config(), &Drive::default(), |_, _, _| ());
    let mut single = GnssIns::<f32, 64>::new(GnssInsConfig {
        imu_samples: ImuSamples::Means,
        ..GnssInsConfig::default()
    })
    .unwrap();
    let mut truth = Motion::start();
    for k in 1..=6000_i64 {
        truth.step(k as f64 * 0.01, 0.01);
        let time_ns = k * 10_000_000;
        let (rate, force) = (
            truth.rate().map(|x| x as f32),
            truth.force().map(|x| x as f32),
        );
        single.imu(time_ns, &rate, &force).unwrap();
        if k % 100 == 0 {
            let ned = truth.position.map(|x| x as f32);
            let std = Vector3::new(0.05, 0.05, 0.1);
            single.gnss_position(
                time_ns,
                &GnssPosition {
                    ned,
                    std,
                    has_height: true,
                },
            );
            let (ned, std) = (truth.velocity().map(|x| x as f32), Vector3::repeat(0.05));
            single.gnss_velocity(
                time_ns,
                &GnssVelocity {
                    ned,
                    std,
                    has_vertical: true,
                },
            );
        }
    }
    assert!((truth.position - motion.position).norm() < 1e-9);
    let (d, s) = (double.state().unwrap(), single.state().unwrap());
    assert!((d.position - s.position.map(f64::from)).norm() < 0.02);
    assert!((d.velocity - s.velocity.map(f64::from)).norm() < 0.01);
    for i in 0..15 {
        let ratio = f64::from(s.covariance[(i, i)]) / d.covariance[(i, i)];
        assert!((ratio - 1.0).abs() < 0.05, "{i}: {ratio}");
    }
    // A saved copy goes on exactly.
    let mut copy = double;
    let next = double.time_ns().unwrap() + 10_000_000;
    for ins in [&mut double, &mut copy] {
        ins.imu(next, &truth.rate(), &truth.force()).unwrap();
    }
    assert_eq!(double, copy);
}

#[test]
fn the_covariance_is_one_after_a_day_in_single_precision() {
    // Stands, is seen once a minute, has samples at 2 Hz: 86,400 s cheaply, with every kind of step in it.
    let mut ins = GnssIns::<f32>::new(GnssInsConfig {
        zero_velocity: true,
        non_holonomic: true,
        time_offset_std_s: 0.05,
        initial_heading: Some([0.3, 0.1]),
        ..GnssInsConfig::default()
    })
    .unwrap();
    let force = Vector3::new(0.1, -0.2, -9.79);
    let mut noise = 1_u32;
    for k in 1..=172_800_i64 {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let n = (noise >> 16) as f32 / 65_536.0 - 0.5;
        let time_ns = k * 500_000_000;
        let (rate, force) = (
            Vector3::new(n, -n, n) * 0.002,
            force + Vector3::new(-n, n, n) * 0.05,
        );
        ins.imu(time_ns, &rate, &force).unwrap();
        if k % 20 == 2 {
            ins.barometer(time_ns, 400.0 + n);
        }
        if k % 120 == 2 || k < 40 {
            let (ned, std) = (Vector3::new(n, -n, 2.0 * n), Vector3::repeat(2.0));
            ins.gnss_position(
                time_ns,
                &GnssPosition {
                    ned,
                    std,
                    has_height: true,
                },
            );
        }
    }
    assert_eq!(ins.restarts(), 0);
    let p = ins.state().unwrap().covariance.map(f64::from);
    let d = p.diagonal().map(|v| 1.0 / v.sqrt());
    let scale = nalgebra::SMatrix::<f64, 15, 15>::from_diagonal(&d);
    assert!(cholesky(&(scale * p * scale)).is_some(), "{}", p.diagonal());
    let position = ins.state().unwrap().position.map(f64::from);
    for i in 0..3 {
        assert!(
            position[i].abs() < 4.0 * p[(6 + i, 6 + i)].sqrt(),
            "{position}"
        );
    }
}

#[test]
fn a_chip_holds_it_in_what_is_said() {
    let bytes = size_of::<GnssIns<f32, 0>>();
    assert!(
        (24_000..25_000).contains(&bytes),
        "{bytes} bytes without history"
    );
}
