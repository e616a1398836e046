//! The GNSS/INS with a Schmidt-Kalman tracker that listens to its errors.

use nalgebra::{RealField, SMatrix};
use northing_core::kalman::covariance::is_covariance;
use northing_core::navigation::gnss_ins::ErrorShares;
use northing_core::navigation::{ERRORS, GnssIns, GnssPosition, GnssVelocity, NavigationState};
use northing_core::tracking::SchmidtKalman;

use super::garbage::{Garbage, number};
use super::harness::{Check, continuable, covariance, record, run, unit};
use super::tracking::{coupling, detection, settings, track};

type Tracker<T> = SchmidtKalman<T, ERRORS>;
type Ins<T> = GnssIns<T, 32, Tracker<T>>;

struct Sequence<T: RealField + Copy> {
    ins: Ins<T>,
    clock_ns: i64,
    force: [f64; 3],
}

fn make<T: RealField + Copy>(g: &mut Garbage) -> Sequence<T> {
    let tracker = Tracker::new(settings(g), coupling(g), track(g), SMatrix::zeros()).unwrap();
    let ins = Ins::listened_to(g.settings(), tracker).unwrap();
    let mut sequence = Sequence {
        ins,
        clock_ns: 0,
        force: [0.0, 0.0, -9.81],
    };
    if g.chance(0.7) {
        start(&mut sequence, g);
    }
    sequence
}

fn start<T: RealField + Copy>(sequence: &mut Sequence<T>, g: &mut Garbage) {
    let state = NavigationState::new(g.rotation(3.0), g.vector(20.0), g.vector(1000.0));
    let usual = [0.05, 0.5, 3.0, 0.1, 0.01];
    let state = state.with_std(usual.map(|std| g.std(std)));
    let _ = sequence.ins.start_at(sequence.clock_ns, &state);
}

fn operate<T: RealField + Copy>(sequence: &mut Sequence<T>, g: &mut Garbage) -> Check {
    let usual_ns = if g.chance(0.1) {
        100_000_000
    } else {
        10_000_000
    };
    let ns = g.stamp(&mut sequence.clock_ns, usual_ns);
    let ins = &mut sequence.ins;
    match g.below(40) {
        0 => {
            start(sequence, g);
            Ok(())
        }
        1..5 => {
            let fix = GnssPosition {
                ned: g.vector(30.0),
                std: g.stds(3.0),
                has_height: g.chance(0.8),
            };
            let update = if g.chance(0.2) {
                let shares = ErrorShares {
                    white: g.std(0.8),
                    slow: g.std(0.7),
                };
                ins.gnss_position_with(ns, &fix, shares)
            } else {
                ins.gnss_position(ns, &fix)
            };
            record("horizontal position", &update.horizontal)?;
            record("height", &update.vertical)
        }
        5..8 => {
            let fix = GnssVelocity {
                ned: g.vector(3.0),
                std: g.stds(0.1),
                has_vertical: g.chance(0.8),
            };
            record("velocity", &ins.gnss_velocity(ns, &fix))
        }
        8 => record("heading", &ins.heading(ns, g.near(4.0), g.std(0.1))),
        9 | 10 => {
            let field = g.around([18.0, 0.0, 42.0], 10.0);
            record("magnetometer", &ins.magnetometer(ns, &field))
        }
        11 | 12 => record("barometer", &ins.barometer(ns, g.near(30.0))),
        13 | 14 => record("speed", &ins.speed(ns, g.near(3.0), g.std(0.1))),
        15 => {
            ins.set_declination(g.near(1.0));
            Ok(())
        }
        16 => {
            ins.settle();
            Ok(())
        }
        17 | 18 => see(ins, g),
        _ => {
            if g.chance(0.1) {
                sequence.force = [0.5, -0.3, -9.81];
            }
            let rate = g.vector(0.02);
            let _ = ins.imu(ns, &rate, &g.around(sequence.force, 0.2));
            Ok(())
        }
    }
}

/// The tracker moves on and takes a detection from the pose of now.
fn see<T: RealField + Copy>(ins: &mut Ins<T>, g: &mut Garbage) -> Check {
    let Some((pose, tracker)) = ins.pose_and_listener() else {
        return Ok(());
    };
    let _ = tracker.predict(g.interval(1.0));
    let innovation = tracker.update(&detection(g), &pose.navigation_pose());
    record("detection", &innovation)
}

fn check<T: RealField + Copy>(sequence: &Sequence<T>) -> Check {
    let ins = &sequence.ins;
    continuable(ins)?;
    covariance("target", &ins.listener().track().covariance)?;
    continuable(ins.listener())?;
    let Some(state) = ins.state() else {
        return Ok(());
    };
    unit("attitude", &state.ned_from_body)?;
    covariance("covariance", &state.covariance)?;
    let mut other = *ins;
    if let Some((pose, _)) = other.pose_and_listener() {
        covariance("joint covariance", &pose.covariance)?;
    }
    if let Some((place, p)) = ins.antenna_position()
        && !(place.iter().all(|x| x.is_finite()) && is_covariance(&p, number(1e-2)))
    {
        return Err(format!("antenna at {place} with {p}"));
    }
    Ok(())
}

#[test]
fn single() {
    run("GNSS/INS, f32", make::<f32>, operate, check);
}

#[test]
fn double() {
    run("GNSS/INS, f64", make::<f64>, operate, check);
}
