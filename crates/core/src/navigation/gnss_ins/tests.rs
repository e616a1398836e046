//! The GNSS/INS as a whole, on motions made here: start, late fixes, outages, standstill.

mod bias_steps;
mod faults;
mod limits;
mod magnetometer;
mod models;
mod outages;
mod standing;
mod start_in_motion;
mod without_samples;

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
