//! Which way does a device point? A gyroscope with a bias of 1 deg/s, an accelerometer and a magnetometer, 100 Hz.
//! It turns on a table, 0.3 rad/s about up, in axes east, north, up. Asked for: yaw, pitch and roll after a minute,
//! with standard deviations, and the bias.
#![allow(clippy::print_stdout, missing_docs, unreachable_pub)]
use northing_core::attitude::{AttitudeConfig, AttitudeDriver, DriverConfig, Mekf};
use northing_core::geometry::rotation;
use northing_core::nalgebra::{UnitQuaternion, Vector3};

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let filter = Mekf::<f64>::new(AttitudeConfig::default())?;
    let mut driver = AttitudeDriver::new(filter, DriverConfig::default());
    let (bias, turning) = (Vector3::z() * 0.0175, Vector3::z() * 0.3);
    let mut truth = UnitQuaternion::identity();
    for k in 0..6000_i64 {
        let (time_ns, t) = (k * 10_000_000, k as f64 * 0.01);
        truth = UnitQuaternion::from_scaled_axis(turning * t);
        let noise = Vector3::new((31.0 * t).sin(), (37.0 * t).cos(), (41.0 * t).sin());
        let force = truth.inverse() * Vector3::new(0.0, 0.0, 9.81);
        let field_ut = truth.inverse() * Vector3::new(0.0, 21.0, -43.0);
        driver.gyroscope(time_ns, &(turning + bias + noise * 1e-3));
        driver.accelerometer(time_ns, &(force + noise * 0.03));
        driver.magnetometer(time_ns, &(field_ut + noise * 0.3));
    }
    let attitude = driver.attitude().ok_or("not started")?;
    let (angles, std) = driver.yaw_pitch_roll().ok_or("not started")?;
    let (found, _) = driver.gyroscope_bias().ok_or("not started")?;
    println!("yaw, pitch, roll {:.2?} deg", angles.map(f64::to_degrees));
    println!("standard deviations {:.2?} deg", std.map(f64::to_degrees));
    println!("bias {:.3} deg/s", found.z.to_degrees());
    assert!(rotation::angle_between(&truth, &attitude) < 3.0 * std.iter().sum::<f64>());
    assert!((found - bias).norm() < 2e-3);
    Ok(())
}
