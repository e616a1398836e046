//! Simulated motion, simulated sensors, known truth: what estimators are tested and shown on.
//!
//! The parts, from the bottom up; each can be used alone:
//!
//! | I look for | file |
//! |---|---|
//! | gravity and the magnetic field | [`world`] |
//! | named, independent random streams | [`random`] |
//! | where a body is and how it moves, as closed forms | [`trajectory`] |
//! | what a sensor makes of the truth: noise, bias, quantisation, disturbances | [`sensors`] |
//! | faults that wrap a sensor | [`faults`] |
//! | faults laid over a clean stream of samples | [`fault_injection`] |
//! | a vessel and its manoeuvres | [`trajectory::vessel`] |
//! | a person and a car with a 1 Hz receiver, for GNSS/INS | [`ground`] |
//! | random boards with gyroscope, accelerometer, magnetometer, from desk to running | [`attitude_world`] |
//! | random vehicles, units and receivers for GNSS/INS, wider than life | [`navigation_world`] |
//! | random scenes for trackers: pedestrians, boats, ships, aircraft, wider than life | [`tracking_world`] |
//! | scenarios as files, and the runs they describe | [`scenario`] |
//! | arrays for Monte Carlo consistency tests of attitude filters | [`monte_carlo`] |
//! | a recording of a phone that never existed | [`virtual_phone`] |
//!
//! Everything is determined by a seed. The world frame is east, north, up; the body frame is
//! whatever the trajectory turns, in the reference pose equal to the world frame. Units are SI and
//! radians; magnetic field is in microtesla.
//!
//! The few rotation formulas needed here are written out in this crate rather than taken from the
//! estimators' geometry, so that the truth shares no code with what is tested against it. They use
//! `libm` through nalgebra, so a seed gives the same numbers on every machine.

pub mod attitude_world;
pub mod fault_injection;
pub mod faults;
pub mod ground;
pub mod monte_carlo;
pub mod navigation_world;
pub mod random;
mod rotation;
pub mod scenario;
pub mod sensors;
mod settings;
mod signals;
pub mod tracking_world;
pub mod trajectory;
pub mod virtual_phone;
pub mod world;

pub use monte_carlo::{AttitudeTrial, AttitudeTrialConfig};
pub use trajectory::{Trajectory, Truth};
pub use virtual_phone::{VirtualPhone, VirtualPhoneConfig};
