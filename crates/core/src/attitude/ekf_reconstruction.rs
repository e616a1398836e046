//! A passive complementary filter behind a quaternion EKF that reconstructs the rotation.
//!
//! Read first: `docs/derivations/complementary.md`, section 7; Iporre & Améstegui, whose modified
//! cascade this is. Use it to compare: the EKF alone is as good or better, since the filter behind
//! it only adds lag (`docs/results/observers.md`). What the pair has that the EKF has not is the
//! complementary filter's smoothness and bounded bias.
//!
//! # Model
//!
//! ```text
//! R_y  the EKF's attitude: vectors weighed by their covariance                       (O15)
//! e    = vex(P_a(R^T R_y)),  R <- R exp([(w_s - b + k_P e) dt]x),  b <- b - k_I e dt
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `R_y` | [`EkfReconstruction::reconstructed`] (`ref_from_body`) | - |
//! | `R, b` | [`EkfReconstruction::observer`] | -, rad/s |
//! | `k_P, k_I` | [`AttitudeConfig::complementary_attitude_gain`], ..`bias_gain` | 1/s, 1/s^2 |
//!
//! Every other setting is the EKF's. Innovations are the EKF's, with its covariance; the attitude is
//! the observer's, about whose error nothing is said. Both are compared at the same instant, before a
//! gyroscope sample moves them on. Cost: the EKF's, and about a tenth.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::complementary::{Complementary, ComplementaryForm, ComplementaryState};
use super::config::AttitudeConfig;
use super::quaternion_ekf::{QuaternionEkf, QuaternionEkfState};
use super::{AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty};
use crate::kalman::Innovation;
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable};
use crate::scalar::Scalar;

/// The EKF and the observer behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EkfReconstruction<T: Scalar> {
    ekf: QuaternionEkf<T>,
    observer: Complementary<T>,
}

impl<T: Scalar> EkfReconstruction<T> {
    /// The pair, both at the identity and without references.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(config: AttitudeConfig<T>) -> Result<Self, ConfigError> {
        Ok(Self {
            ekf: QuaternionEkf::new(config)?,
            observer: Complementary::new(ComplementaryForm::Passive, config)?,
        })
    }

    /// The reconstructed rotation, `ref_from_body`.
    pub fn reconstructed(&self) -> UnitQuaternion<T> {
        self.ekf.attitude()
    }

    /// The filter that reconstructs it.
    pub fn ekf(&self) -> &QuaternionEkf<T> {
        &self.ekf
    }

    /// The observer that follows it.
    pub fn observer(&self) -> &Complementary<T> {
        &self.observer
    }
}

/// Everything that the pair remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EkfReconstructionState<T: Scalar> {
    /// Of the filter that reconstructs the rotation.
    pub ekf: QuaternionEkfState<T>,
    /// Of the observer that follows it.
    pub observer: ComplementaryState<T>,
}

impl<T: Scalar> Restorable for EkfReconstruction<T> {
    type State = EkfReconstructionState<T>;

    fn save(&self) -> Self::State {
        EkfReconstructionState {
            ekf: self.ekf.save(),
            observer: self.observer.save(),
        }
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        let mut observer = self.observer;
        observer.restore(state.observer)?;
        self.ekf.restore(state.ekf)?;
        self.observer = observer;
        Ok(())
    }
}

impl<T: Scalar> AttitudeEstimator<T> for EkfReconstruction<T> {
    fn initialize(&mut self, initial: &InitialState<T>) {
        self.ekf.initialize(initial);
        self.observer.initialize(initial);
    }

    fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Propagation {
        let measured = self.ekf.attitude();
        let propagation = self.ekf.propagate(angular_rate, dt);
        if propagation == Propagation::Done && dt > T::zero() {
            self.observer.follow(&measured, dt);
            self.observer.propagate(angular_rate, dt);
        }
        propagation
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        self.ekf.update_accelerometer(specific_force)
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        self.ekf.update_magnetometer(magnetic_field)
    }

    fn update_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        self.ekf.update_compass(heading)
    }

    fn add_attitude_variance(&mut self, variance: T) {
        self.ekf.add_attitude_variance(variance);
    }

    fn attitude(&self) -> UnitQuaternion<T> {
        self.observer.attitude()
    }

    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        None
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        None
    }

    fn start_uncertainty(&self) -> StartUncertainty<T> {
        self.ekf.start_uncertainty()
    }

    fn rate_at_rest(&self) -> Vector3<T> {
        self.observer.rate_at_rest()
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_world::{BIAS, drive, start, step_all};
    use super::*;
    use crate::geometry::{rotation, so3};

    fn started(off: &Vector3<f64>) -> EkfReconstruction<f64> {
        let config = AttitudeConfig {
            initial_tilt_std: 0.6,
            accelerometer_gate_nis: 0.0,
            magnetometer_gate_nis: 0.0,
            ..AttitudeConfig::lab()
        };
        let mut pair = EkfReconstruction::new(config).unwrap();
        pair.initialize(&start(&config, so3::exp(off)));
        pair
    }

    /// The EKF finds the attitude at once, the observer behind it takes its time.
    #[test]
    fn the_observer_follows_what_the_ekf_reconstructs() {
        let mut pair = started(&Vector3::new(0.3, -0.2, 0.3));
        let (mut count, mut sums, mut early) = (0_u32, [0.0_f64; 2], [0.0_f64; 2]);
        drive(60, 5, |truth, samples| {
            step_all(&mut pair, &samples);
            count += 1;
            let errors = [pair.reconstructed(), pair.attitude()]
                .map(|q| rotation::angle_between(truth, &q).to_degrees());
            if count == 100 {
                early = errors;
            } else if count > 4000 {
                sums[0] += errors[0].powi(2);
                sums[1] += errors[1].powi(2);
            }
        });
        let rms = sums.map(|s| (s / f64::from(count - 4000)).sqrt());
        assert!(
            early[0] < 1.0 && early[1] > 5.0,
            "after a second: {early:?} deg"
        );
        assert!(rms[0] < 0.2 && rms[1] < 0.5, "{rms:?} deg");
        assert!((pair.rate_at_rest() - BIAS).norm() < 2e-3);
    }

    /// At half a turn the passive error vanishes: the nudge must still work behind an EKF.
    #[test]
    fn half_a_turn_between_the_two_is_left() {
        let mut pair = started(&Vector3::zeros());
        let opposite = so3::exp(&Vector3::new(0.0, 0.0, core::f64::consts::PI));
        let mut other = start(&AttitudeConfig::lab(), opposite);
        other.references.magnetic_field = None;
        pair.observer.initialize(&other);
        drive(60, 6, |_, samples| step_all(&mut pair, &samples));
        let apart = rotation::angle_between(&pair.reconstructed(), &pair.attitude());
        assert!(apart.to_degrees() < 1.0, "{} deg", apart.to_degrees());
    }

    #[test]
    fn samples_that_are_not_finite_change_nothing() {
        let mut pair = started(&Vector3::new(0.1, 0.0, 0.0));
        let before = pair;
        let bad = Vector3::new(f64::NAN, 0.0, 0.0);
        assert!(matches!(
            pair.propagate(&bad, 0.01),
            Propagation::Skipped(_)
        ));
        assert!(matches!(
            pair.propagate(&Vector3::zeros(), f64::NAN),
            Propagation::Skipped(_)
        ));
        pair.update_accelerometer(&bad);
        pair.update_magnetometer(&bad);
        assert_eq!(pair.attitude(), before.attitude());
        assert_eq!(pair.reconstructed(), before.reconstructed());
    }
}
