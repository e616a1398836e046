//! Northing core: every estimator, free of allocation, panics, clocks and `unsafe`.
//!
//! The crate answers *which way does a device point, where is it, and where are the others*, each
//! with an uncertainty that can be trusted. The same code runs on a microcontroller, behind the
//! lab and in Monte-Carlo campaigns.
//!
//! # The three questions
//!
//! ```
//! use northing_core::attitude::{AttitudeConfig, AttitudeDriver, DriverConfig, Mekf};
//! use northing_core::nalgebra::Vector3;
//!
//! // Which way does it point: samples with their stamps in, attitude and covariance out.
//! let filter = Mekf::<f64>::new(AttitudeConfig::default())?;
//! let mut driver = AttitudeDriver::new(filter, DriverConfig::default());
//! for time_ns in (0..1_000_000_000).step_by(10_000_000) {
//!     driver.gyroscope(time_ns, &Vector3::zeros());
//!     driver.accelerometer(time_ns, &Vector3::new(0.0, 0.0, 9.81));
//! }
//! let (attitude, covariance) = (driver.attitude(), driver.attitude_covariance());
//! assert!(attitude.unwrap().angle() < 1e-6 && covariance.unwrap().trace() > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Where is it: [`navigation::GnssIns`], as in its [example](navigation::gnss_ins). Where are the others:
//! [`tracking::SchmidtKalman`] beside a [`navigation::ErrorStateFilter`], and [`tracking::MultiTargetTracker`]. Each has a
//! program of at most 40 lines in the folder `examples`: `attitude`, `gnss_ins`, `schmidt_tracking`, and `attitude_f32`
//! for a chip.
//!
//! | folder | what is in it |
//! |---|---|
//! | [`earth`] | WGS-84, local tangent frames, gravity, Earth rate |
//! | [`faults`] | spikes, stuck and clipped values, noise, holes: found before a filter sees them |
//! | [`geometry`] | rotations: exponential and logarithm on SO(3), Jacobians, conversions, frames; trigonometry |
//! | [`kalman`] | the innovation record, NIS gates, in-place scalar updates, covariance hygiene |
//! | [`attitude`] | gyroscope integration, MEKF, bounded velocity, USQUE, quaternion EKF, Wahba's problem, alignment |
//! | [`navigation`] | the 15-state error-state filter: position, velocity and attitude from an IMU and aiding |
//! | [`calibration`] | what a sensor at rest tells: bias, noise, references, and when to refuse |
//! | [`parameters`] | configurations as tables: every parameter with unit, permitted range, defaults and meaning |
//! | [`tracking`] | others: one target or many in clutter, from a platform whose own pose is uncertain |
//!
//! # Conventions
//!
//! Quaternions are Hamilton, unit, body to reference (`v_ref = q v_body q*`), named
//! `ref_from_body`, written **w, x, y, z** at every border. Attitude errors are local (body axes):
//! `q_true = q * Exp(dtheta)`; filters that keep another one inside convert at their border. An
//! accelerometer measures specific force, +9.81 m/s^2 on the axis that points up at rest. SI and radians everywhere; magnetic field in microtesla.
//!
//! # Scalars
//!
//! Everything is generic over [`Scalar`] (`f32`, `f64`, and dual numbers in the tests that check
//! Jacobians). Mathematics comes from nalgebra with `libm`, so hosts and microcontrollers agree to
//! the bit.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod attitude;
pub mod calibration;
pub mod earth;
pub mod faults;
pub mod geometry;
pub mod kalman;
pub mod navigation;
pub mod parameters;
mod restorable;
mod scalar;
#[cfg(feature = "serde")]
mod serialization;
pub mod tracking;

pub use nalgebra;
pub use parameters::ConfigError;
pub use restorable::{InvalidState, Restorable};
pub use scalar::Scalar;

/// The example of the README, so that it compiles and does what it says.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
