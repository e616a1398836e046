//! The registry of attitude estimators: the one place where their names live.

use std::str::FromStr;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::bounded_velocity::BoundedVelocity;
use northing_core::attitude::complementary::{Complementary, ComplementaryForm};
use northing_core::attitude::ekf_reconstruction::EkfReconstruction;
use northing_core::attitude::integration::Integration;
use northing_core::attitude::mekf::Mekf;
use northing_core::attitude::mekf3::Mekf3;
use northing_core::attitude::quaternion_ekf::QuaternionEkf;
use northing_core::attitude::usque::Usque;
use northing_core::attitude::{
    AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty,
};
use northing_core::faults::bias_step::{Learnt, Resumed};
use northing_core::kalman::Innovation;
use serde::{Deserialize, Serialize};

use crate::attitude::Parameters;
use crate::attitude::own::{OwnEstimator, OwnKind, Pace, PythonClass, register_python};
use crate::attitude::parameters::parameters_of;
use crate::error::EvaluationError;
use crate::navigation::NavigationKind;

crate::named::estimators! {
    /// An estimator that can be asked for by name.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
    #[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename_all = "kebab-case"))]
    pub enum EstimatorKind for Attitude, "run --estimator", parameters_of, or Own(OwnKind) {
        /// Gyroscope alone.
        Integration = "integration", 0, "gyroscope integration alone, the baseline: drifts with bias and noise",
            "Utrera & Vazquez (2021), section 4", "the baseline";
        /// The paper's filter.
        Mekf3 = "mekf3", 3, "multiplicative EKF of the paper: attitude only, the bias is a constant",
            "Utrera & Vazquez (2021), eqs 18-27", "to repeat the paper";
        /// With gyroscope bias: the default in the laboratory.
        Mekf = "mekf", 6, "multiplicative EKF with gyroscope bias: the default of the lab profile",
            "Markley (2003); Utrera & Vazquez (2021)", "on a bench, in the lab";
        /// With gyroscope bias and scale, bounded velocity, hard iron and field: the default for what
        /// people carry.
        BoundedVelocity = "bounded-velocity", 22,
            "Kalman filter for phones and wearables, the default: a bounded velocity instead of \
                gravity, gyroscope scale, hard iron and field estimated",
            "docs/derivations/bounded_velocity.md", "phones and wearables; the default";
        /// Unscented.
        Usque = "usque", 6, "unscented quaternion estimator with gyroscope bias, for large errors",
            "Crassidis & Markley (2003)", "large initial errors";
        /// Additive, four quaternion components.
        QuaternionEkf = "quaternion-ekf", 7,
            "additive EKF on the four quaternion components and the gyroscope bias",
            "Bar-Itzhack & Oshman (1985)", "to compare with";
        /// Mahony's explicit complementary filter.
        Complementary = "complementary", 0, "explicit complementary filter with gyroscope bias: fixed gains, cheap",
            "Mahony, Hamel & Pflimlin (2008)", "cheapest; no covariance";
        /// Its passive form, against TRIAD.
        ComplementaryPassive = "complementary-passive", 0,
            "passive complementary filter against TRIAD of gravity and field",
            "Mahony, Hamel & Pflimlin (2008)", "to compare with";
        /// Its direct form, against TRIAD.
        ComplementaryDirect = "complementary-direct", 0,
            "direct complementary filter: as passive, the rate carried by TRIAD",
            "Mahony, Hamel & Pflimlin (2008)", "to compare with";
        /// The explicit filter, and the position observer behind it.
        Cascade = "cascade", 0, "explicit complementary filter; where there are positions, an observer of \
                position, velocity and accelerometer bias behind it",
            "Scandaroli & Morin (2011); Mahony, Hamel & Pflimlin (2008)", "with positions: velocity and accelerometer bias, too";
        /// A passive filter behind the additive EKF, and the position observer behind both.
        CascadeEkf = "cascade-ekf", 0, "as cascade, with a passive filter that follows the quaternion EKF",
            "Iporre & Amestegui", "to repeat the paper";
        /// What the device itself reported; no filter runs.
        Device = "device", 0, "the orientation that the device itself reported; nothing is estimated",
            "-", "to compare with";
    }
}

impl EstimatorKind {
    /// Whether it can be smoothed over a whole recording.
    #[must_use]
    pub const fn has_smoother(self) -> bool {
        matches!(self, Self::Mekf | Self::BoundedVelocity)
    }

    /// Whether it uses positions, where a recording has them.
    #[must_use]
    pub const fn uses_positions(self) -> bool {
        matches!(self, Self::Cascade | Self::CascadeEkf)
    }
}

impl FromStr for EstimatorKind {
    type Err = EvaluationError;

    /// One by its name; a class in a file, `mine.py:Mine`, is registered first.
    fn from_str(name: &str) -> Result<Self, EvaluationError> {
        let known = Self::named(name);
        if known.is_none() && PythonClass::is_meant_by(name) {
            return register_python(name);
        }
        known.ok_or_else(|| {
            let (name, valid) = (name.to_owned(), Self::names());
            match NavigationKind::named(&name) {
                Some(_) => EvaluationError::EstimatorOfPositions { name, valid },
                None => EvaluationError::UnknownEstimator { name, valid },
            }
        })
    }
}

/// Its name: one that is brought along can be read where it is registered.
impl Serialize for EstimatorKind {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for EstimatorKind {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let unknown = || {
            let valid = Self::names();
            serde::de::Error::custom(EvaluationError::UnknownEstimator {
                name: name.clone(),
                valid,
            })
        };
        Self::named(&name).ok_or_else(unknown)
    }
}

/// Any estimator that runs on sensor samples.
#[derive(Debug)]
pub enum AnyEstimator {
    /// `integration`
    Integration(Integration<f64>),
    /// `mekf3`
    Mekf3(Mekf3<f64>),
    /// `mekf`
    Mekf(Mekf<f64>),
    /// `bounded-velocity`
    BoundedVelocity(Box<BoundedVelocity<f64>>),
    /// `usque`
    Usque(Usque<f64>),
    /// `quaternion-ekf`
    QuaternionEkf(QuaternionEkf<f64>),
    /// `complementary` and its relatives, `cascade` among them
    Complementary(Complementary<f64>),
    /// `cascade-ekf`
    EkfReconstruction(Box<EkfReconstruction<f64>>),
    /// One that somebody brought along.
    Own(Box<dyn OwnEstimator>),
}

impl AnyEstimator {
    /// The estimator of this kind; `None` for [`EstimatorKind::Device`], which is no estimator but
    /// a column of the recording.
    ///
    /// # Errors
    /// [`EvaluationError::Config`] when a setting is invalid.
    pub fn new(
        kind: EstimatorKind,
        parameters: &Parameters,
    ) -> Result<Option<Self>, EvaluationError> {
        Self::at_pace(kind, parameters, Pace::Waits)
    }

    /// As [`Self::new`], for samples as they come: they do not wait for one that somebody brought along.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn live(
        kind: EstimatorKind,
        parameters: &Parameters,
    ) -> Result<Option<Self>, EvaluationError> {
        Self::at_pace(kind, parameters, Pace::Live)
    }

    fn at_pace(
        kind: EstimatorKind,
        parameters: &Parameters,
        pace: Pace,
    ) -> Result<Option<Self>, EvaluationError> {
        parameters.validate()?;
        let config = &parameters.attitude;
        let complementary = |form| Complementary::new(form, *config).map(Self::Complementary);
        Ok(Some(match kind {
            EstimatorKind::Integration => {
                Self::Integration(Integration::new(StartUncertainty::of(config)))
            }
            EstimatorKind::Mekf3 => Self::Mekf3(Mekf3::new(*config)?),
            EstimatorKind::Mekf => Self::Mekf(Mekf::new(*config)?),
            EstimatorKind::BoundedVelocity => {
                Self::BoundedVelocity(Box::new(BoundedVelocity::new(parameters.bounded_velocity)?))
            }
            EstimatorKind::Usque => Self::Usque(Usque::new(*config)?),
            EstimatorKind::QuaternionEkf => Self::QuaternionEkf(QuaternionEkf::new(*config)?),
            EstimatorKind::Complementary | EstimatorKind::Cascade => {
                complementary(ComplementaryForm::Explicit)?
            }
            EstimatorKind::ComplementaryPassive => complementary(ComplementaryForm::Passive)?,
            EstimatorKind::ComplementaryDirect => complementary(ComplementaryForm::Direct)?,
            EstimatorKind::CascadeEkf => {
                Self::EkfReconstruction(Box::new(EkfReconstruction::new(*config)?))
            }
            EstimatorKind::Own(own) => Self::Own(own.make(parameters, pace)?),
            EstimatorKind::Device => return Ok(None),
        }))
    }

    /// Why it has failed; only one that somebody brought along can.
    #[must_use]
    pub fn failure(&self) -> Option<String> {
        match self {
            Self::Own(own) => own.failure(),
            _ => None,
        }
    }

    /// The rotation that an EKF reconstructs for the estimator to follow, `ref_from_body`; the
    /// estimate itself where there is none.
    #[must_use]
    pub fn reconstructed(&self) -> UnitQuaternion<f64> {
        match self {
            Self::EkfReconstruction(pair) => pair.reconstructed(),
            other => other.attitude(),
        }
    }
}

/// Evaluates an expression with whichever estimator it is.
macro_rules! each {
    ($self:ident, $e:ident => $body:expr) => {
        match $self {
            Self::Integration($e) => $body,
            Self::Mekf3($e) => $body,
            Self::Mekf($e) => $body,
            Self::BoundedVelocity($e) => $body,
            Self::Usque($e) => $body,
            Self::QuaternionEkf($e) => $body,
            Self::Complementary($e) => $body,
            Self::EkfReconstruction($e) => $body,
            Self::Own($e) => $body,
        }
    };
}

impl AttitudeEstimator<f64> for AnyEstimator {
    fn initialize(&mut self, initial: &InitialState<f64>) {
        each!(self, e => e.initialize(initial));
    }

    fn propagate(&mut self, angular_rate: &Vector3<f64>, dt: f64) -> Propagation {
        each!(self, e => e.propagate(angular_rate, dt))
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<f64>) -> Innovation<f64> {
        each!(self, e => e.update_accelerometer(specific_force))
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<f64>) -> Innovation<f64> {
        each!(self, e => e.update_magnetometer(magnetic_field))
    }

    fn update_compass(&mut self, heading: &CompassHeading<f64>) -> Innovation<f64> {
        each!(self, e => e.update_compass(heading))
    }

    fn add_attitude_variance(&mut self, variance: f64) {
        each!(self, e => e.add_attitude_variance(variance));
    }

    fn learn_gyroscope_noise(&mut self, psd: f64) {
        each!(self, e => e.learn_gyroscope_noise(psd));
    }

    fn attitude(&self) -> UnitQuaternion<f64> {
        each!(self, e => e.attitude())
    }

    fn attitude_covariance(&self) -> Option<Matrix3<f64>> {
        each!(self, e => e.attitude_covariance())
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        each!(self, e => e.gyroscope_bias())
    }

    fn start_uncertainty(&self) -> StartUncertainty<f64> {
        each!(self, e => e.start_uncertainty())
    }

    fn restart(&mut self, initial: &InitialState<f64>) {
        each!(self, e => e.restart(initial));
    }

    fn learnt(&self) -> Learnt<f64> {
        each!(self, e => e.learnt())
    }

    fn resume(&mut self, initial: &InitialState<f64>, resumed: &Resumed<f64>) {
        each!(self, e => e.resume(initial, resumed));
    }

    fn hard_iron(&self) -> Vector3<f64> {
        each!(self, e => e.hard_iron())
    }

    fn unexpected_hard_iron_std(&self) -> Option<Vector3<f64>> {
        each!(self, e => e.unexpected_hard_iron_std())
    }

    fn rate_at_rest(&self) -> Vector3<f64> {
        each!(self, e => e.rate_at_rest())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_estimator_and_unknown_ones_list_them() {
        for kind in EstimatorKind::ALL {
            assert_eq!(kind.name().parse::<EstimatorKind>().unwrap(), kind);
            let json = serde_json::to_string(&kind).unwrap();
            assert_eq!(json, format!("\"{}\"", kind.name()));
        }
        let error = "kalman".parse::<EstimatorKind>().unwrap_err().to_string();
        assert_eq!(
            error,
            "unknown estimator `kalman`; expected one of: \
             integration, mekf3, mekf, bounded-velocity, usque, quaternion-ekf, complementary, \
             complementary-passive, complementary-direct, cascade, cascade-ekf, device"
        );
    }

    #[test]
    fn every_estimator_but_the_device_runs_and_keeps_its_word_about_covariance() {
        let config = Parameters::default();
        for kind in EstimatorKind::ALL {
            let estimator = AnyEstimator::new(kind, &config).unwrap();
            let Some(mut estimator) = estimator else {
                assert_eq!(kind, EstimatorKind::Device);
                continue;
            };
            let rate = Vector3::new(0.1, 0.0, 0.0);
            assert_eq!(estimator.propagate(&rate, 0.01), Propagation::Done);
            let covariance = estimator.attitude_covariance();
            assert_eq!(covariance.is_some(), kind.info().has_covariance, "{kind}");
            assert_eq!(
                estimator.gyroscope_bias().is_some(),
                kind.info().error_states > 3
            );
        }
    }

    #[test]
    fn a_configuration_outside_its_range_is_refused() {
        let mut config = Parameters::default();
        config.attitude.accelerometer_std = -1.0;
        let error = AnyEstimator::new(EstimatorKind::Mekf, &config).unwrap_err();
        let text = error.to_string();
        assert!(
            text.starts_with("configuration: accelerometer_std must be from 1e-6 to 10000"),
            "{text}"
        );
    }
}
