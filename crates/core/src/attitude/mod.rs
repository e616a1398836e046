//! Which way does it point: attitude estimators, and what starts and drives them.
//!
//! Every estimator implements [`AttitudeEstimator`]: propagate with the gyroscope, update with
//! whatever vector sensor is there, in any order and at any rate. [`driver::AttitudeDriver`] adds
//! time: stamps, gaps, mean rates, and the start from the first samples.
//!
//! | estimator | file | error states | when |
//! |---|---|---|---|
//! | [`integration::Integration`] | `integration.rs` | none | the baseline: gyroscope alone |
//! | [`mekf::Mekf`] | `mekf.rs` | attitude, gyroscope bias | the first choice on a bench; in a vehicle without GNSS (`AttitudeConfig::hand_held()`) |
//! | [`mekf3::Mekf3`] | `mekf3.rs` | attitude | the paper's filter, to the letter where asked |
//! | [`bounded_velocity::BoundedVelocity`] | `bounded_velocity.rs` | attitude, velocity, bias, scale, field, hard iron | the first choice: phones and wearables in real use |
//! | [`usque::Usque`] | `usque.rs` | attitude, gyroscope bias | unscented, large errors |
//! | [`quaternion_ekf::QuaternionEkf`] | `quaternion_ekf.rs` | quaternion, gyroscope bias | additive EKF |
//! | [`axis_filters::AxisFilters`] | `axis_filters.rs` | two an axis | decoupled roll, pitch, yaw: the smallest, not of this trait |
//! | [`complementary::Complementary`] | `complementary.rs` | none | fixed gains: cheap, no covariance |
//! | [`ekf_reconstruction::EkfReconstruction`] | `ekf_reconstruction.rs` | none | a passive filter behind the additive EKF |
//!
//! Where there is GNSS, [`crate::navigation::GnssIns`] has the better attitude: it knows the accelerations. The axes of
//! the reference are east, north, up unless [`Prior::frame`] says otherwise.

pub mod alignment;
pub mod axis_filters;
pub mod bounded_velocity;
pub mod complementary;
pub mod config;
pub mod driver;
pub mod ekf_reconstruction;
pub mod heading;
pub mod integration;
pub mod measurement;
pub mod mekf;
pub mod mekf3;
pub mod propagation;
pub mod quaternion_ekf;
pub mod usque;
pub mod vector_sensor;
pub mod wahba;

#[cfg(test)]
mod test_world;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::faults::bias_step::{Learnt, Resumed};
use crate::geometry::rotation::is_unit;
use crate::kalman::covariance::is_covariance;
use crate::kalman::{Innovation, SkipReason};
use crate::scalar::{Scalar, lit};
pub use alignment::Prior;
pub use axis_filters::{AxisFilters, AxisFiltersConfig};
pub use bounded_velocity::{BoundedVelocity, BoundedVelocityConfig};
pub use complementary::{Complementary, ComplementaryForm};
pub use config::{AttitudeConfig, MagnetometerUse, ProcessNoise, QuaternionNorm};
pub use driver::{AttitudeDriver, DriverConfig, DriverState};
pub use ekf_reconstruction::EkfReconstruction;
pub use heading::CompassHeading;
pub use integration::Integration;
pub use mekf::{Mekf, MekfState};
pub use mekf3::Mekf3;
pub use quaternion_ekf::QuaternionEkf;
pub use usque::Usque;
pub use vector_sensor::References;

/// The state an estimator starts from.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InitialState<T: Scalar> {
    /// `ref_from_body` at the start.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub attitude: UnitQuaternion<T>,
    /// Covariance (rad^2) of the local attitude error, in body axes.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub attitude_covariance: Matrix3<T>,
    /// Gyroscope bias (rad/s), body axes.
    pub gyroscope_bias: Vector3<T>,
    /// Standard deviation (rad/s) of each component of that bias.
    pub gyroscope_bias_std: T,
    /// Whether a compass has said where north is; a magnetic reference says so by itself.
    pub north_known: bool,
    /// What the vector sensors measure in the reference frame.
    pub references: References<T>,
}

impl<T: Scalar> InitialState<T> {
    /// Whether the attitude is a rotation, the covariance one of at most 100 rad, and bias and its standard deviation of at
    /// most 1000 rad/s.
    pub fn is_usable(&self) -> bool {
        let p = &self.attitude_covariance;
        let std = self.gyroscope_bias_std;
        is_unit(&self.attitude)
            && is_covariance(p, T::default_epsilon().sqrt())
            && p.diagonal().max() <= lit(1e4)
            && propagation::is_possible_bias(&self.gyroscope_bias)
            && std >= T::zero()
            && std <= lit(propagation::LARGEST_BIAS_RAD_S)
    }
}

/// How uncertain an attitude estimator is at its start, standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StartUncertainty<T> {
    /// Of roll and pitch, rad.
    pub tilt_std: T,
    /// Of the heading, where a magnetometer gave it, rad.
    pub heading_std: T,
    /// Of an attitude about which nothing is known, rad.
    pub unknown_std: T,
    /// Of each component of the gyroscope bias, rad/s, where no calibration says better.
    pub gyroscope_bias_std: T,
    /// Least of a compass heading, rad.
    pub compass_std: T,
}

impl<T: Scalar> StartUncertainty<T> {
    /// What a configuration says of it.
    pub fn of(config: &AttitudeConfig<T>) -> Self {
        Self {
            tilt_std: config.initial_tilt_std,
            heading_std: config.initial_heading_std,
            unknown_std: config.maximum_attitude_std,
            gyroscope_bias_std: config.initial_gyroscope_bias_std,
            compass_std: config.compass_std,
        }
    }
}

/// What a propagation did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Propagation {
    /// The state moved on.
    Done,
    /// The sample was refused and the state is untouched.
    Skipped(SkipReason),
}

impl Propagation {
    /// Whether the state moved on.
    #[inline]
    #[must_use]
    pub const fn is_done(self) -> bool {
        matches!(self, Self::Done)
    }
}

/// What all attitude estimators can do.
///
/// Samples that are not finite leave the state untouched; the return value says so. No method
/// panics, and no state ever holds a non-finite number.
pub trait AttitudeEstimator<T: Scalar> {
    /// Starts, or starts again, from a known state; one that is not
    /// [usable](InitialState::is_usable) changes nothing.
    fn initialize(&mut self, initial: &InitialState<T>);

    /// Starts again from a known attitude after a time in which nobody saw how it turned, and keeps what it has learnt of
    /// the sensors. One that is not [usable](InitialState::is_usable) changes nothing.
    fn restart(&mut self, initial: &InitialState<T>) {
        self.initialize(initial);
    }

    /// What it has learnt of motion and sensors that a wrong gyroscope bias would spoil; [`Self::resume`] gives it back.
    fn learnt(&self) -> Learnt<T> {
        Learnt::nothing()
    }

    /// Goes on from before a step of the gyroscope's bias, with the new bias: `initial` is where it is now, `resumed` how the errors of
    /// attitude and bias hang together and what it had learnt. It keeps what else it has learnt of the sensors. A state that is not
    /// [usable](InitialState::is_usable) changes nothing.
    fn resume(&mut self, initial: &InitialState<T>, _resumed: &Resumed<T>) {
        self.initialize(initial);
    }

    /// What it has learnt of the magnetometer's hard iron, microtesla, body axes; zero where it estimates none.
    fn hard_iron(&self) -> Vector3<T> {
        Vector3::zeros()
    }

    /// Standard deviation of a hard iron that its settings did not expect, and that it estimates since turns of the device showed it,
    /// microtesla, body axes; `None` where it has found none.
    fn unexpected_hard_iron_std(&self) -> Option<Vector3<T>> {
        None
    }

    /// Moves on by `dt` seconds with the angular rate (rad/s, body axes, as the gyroscope gave
    /// it) that held over that interval. `dt <= 0` changes nothing.
    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation;

    /// Updates with specific force (m/s^2, body axes).
    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T>;

    /// Updates with the magnetic field (microtesla, body axes).
    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T>;

    /// Updates with a heading that the device reports.
    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T>;

    /// Adds variance (rad^2 per axis) to the attitude: something unseen happened, such as a gap.
    fn add_attitude_variance(&mut self, variance: T);

    /// Takes what was learnt of the gyroscope's white noise, (rad/s)^2/Hz: an estimator that states its error takes it where it
    /// is more than what it is configured for. Without effect on others.
    fn learn_gyroscope_noise(&mut self, _psd: T) {}

    /// The estimate, `ref_from_body`.
    fn attitude(&self) -> UnitQuaternion<T>;

    /// Covariance (rad^2) of the local attitude error in body axes; `None` for estimators that
    /// make no statement about their error.
    fn attitude_covariance(&self) -> Option<Matrix3<T>>;

    /// Gyroscope bias (rad/s, body axes) and its covariance; `None` when it is not estimated.
    fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)>;

    /// How uncertain a start is by its settings: what a driver aligns with.
    fn start_uncertainty(&self) -> StartUncertainty<T>;

    /// The angular rate (rad/s, as the gyroscope would give it) that means no rotation: the bias
    /// that the estimator removes, estimated or constant.
    fn rate_at_rest(&self) -> Vector3<T>;
}
