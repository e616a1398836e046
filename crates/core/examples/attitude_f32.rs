//! Roll of a drone's arm on a microcontroller: single precision, no heap, gyroscope and accelerometer at 100 Hz.
//! `step` is what an interrupt calls: the state lies in memory that outlives a reset, and is checked before use.
#![no_std]
#![allow(clippy::print_stdout, missing_docs, unreachable_pub)]
extern crate std;
use northing_core::attitude::{AttitudeConfig, AttitudeDriver, DriverConfig, Mekf};
use northing_core::geometry::{rotation, so3};
use northing_core::{Restorable, nalgebra::Vector3};

type Driver = AttitudeDriver<f32, Mekf<f32>>;
type Saved = <Driver as Restorable>::State;

fn step(driver: &mut Driver, saved: &mut Saved, k: i64, imu: &[Vector3<f32>; 2]) {
    // What memory cannot hold is refused; the driver then starts anew.
    assert!(driver.restore(*saved).is_ok(), "nothing was reset here");
    driver.gyroscope(k * 10_000_000, &imu[0]);
    driver.accelerometer(k * 10_000_000, &imu[1]);
    *saved = driver.save();
}

pub fn main() {
    let filter = Mekf::new(AttitudeConfig::lab()).expect("valid settings");
    let mut driver = Driver::new(filter, DriverConfig::default());
    let mut saved = driver.save();
    let roll = 20_f32.to_radians();
    let force = so3::exp(&(Vector3::x() * -roll)) * Vector3::new(0.0, 0.0, 9.81);
    for k in 0..3000 {
        step(&mut driver, &mut saved, k, &[Vector3::x() * 0.01, force]);
    }
    let attitude = driver.attitude().expect("started after half a second");
    let covariance = driver.attitude_covariance().expect("a MEKF knows it");
    let [_, pitch, found] = rotation::to_yaw_pitch_roll(&attitude);
    let std = covariance[(0, 0)].sqrt();
    std::println!(
        "roll {:.2} deg, std {:.2} deg",
        found.to_degrees(),
        std.to_degrees()
    );
    assert!((found - roll).abs() < 3.0 * std && pitch.abs() < 0.01 && std < 0.02);
}
