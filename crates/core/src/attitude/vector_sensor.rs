//! State of one vector sensor in a filter: its reference, its noise, its gate, its history.
//!
//! Shared by all attitude filters: how a sample is weighed is one idea and has one place. A filter
//! supplies the predicted vector and the covariance of its prediction and gets back the innovation
//! record and the variances to update with.
//!
//! Read first: `docs/derivations/mekf.md`, sections on gates and on correlated errors.

use nalgebra::{Matrix3, Vector3};

use super::config::AttitudeConfig;
use crate::kalman::covariance::normalized_square3;
use crate::kalman::innovation::{check_vector, checked_norm_squared};
use crate::kalman::{Gate, GateDecision, GateState, Innovation, Outcome, SkipReason};
use crate::restorable::{InvalidState, finite, not_negative};
use crate::scalar::{Scalar, lit};

/// A sample this many times longer than its reference was not measured: 50 g, 2.5 millitesla.
pub const LONGEST: f64 = 50.0;

/// Lengths that a reference can have (m/s^2, microtesla).
pub(super) const SHORTEST_REFERENCE: f64 = 1e-6;
pub(super) const LONGEST_REFERENCE: f64 = 1e6;

/// What the vector sensors measure in the reference frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct References<T: Scalar> {
    /// Specific force at rest (m/s^2): gravity's length, pointing up.
    pub specific_force: Vector3<T>,
    /// Magnetic field (microtesla); `None` when there is no magnetometer.
    pub magnetic_field: Option<Vector3<T>>,
}

/// One vector sensor as a filter sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VectorSensor<T: Scalar> {
    reference: Option<Vector3<T>>,
    reference_norm: T,
    variance: T,
    gate: Gate<T>,
    gate_state: GateState<T>,
    correlation_time: T,
    norm_gain: T,
    /// Seconds since the last sample that was fused; negative before the first.
    since_fused: T,
}

/// How a sample that passed may be used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weighed<T: Scalar> {
    /// The record to return.
    pub innovation: Innovation<T>,
    /// Noise variance per component for the update; `None` when the sample is not to be fused.
    pub variance: Option<T>,
}

impl<T: Scalar> VectorSensor<T> {
    /// The accelerometer that `config` describes.
    pub fn accelerometer(config: &AttitudeConfig<T>) -> Self {
        Self::new(
            config.accelerometer_std,
            config.accelerometer_gate(),
            config.accelerometer_correlation_time_s,
            config.accelerometer_norm_gain,
        )
    }

    /// The magnetometer that `config` describes.
    pub fn magnetometer(config: &AttitudeConfig<T>) -> Self {
        Self::new(
            config.magnetometer_std_ut,
            config.magnetometer_gate(),
            config.magnetometer_correlation_time_s,
            config.magnetometer_norm_gain,
        )
    }

    /// The compass that `config` describes: no vector, only noise, gate and history.
    pub fn compass(config: &AttitudeConfig<T>) -> Self {
        Self::new(
            config.compass_std,
            config.compass_gate(),
            config.compass_correlation_time_s,
            T::zero(),
        )
    }

    fn new(std: T, gate: Gate<T>, correlation_time: T, norm_gain: T) -> Self {
        Self {
            reference: None,
            reference_norm: T::zero(),
            variance: std * std,
            gate,
            gate_state: GateState::default(),
            correlation_time,
            norm_gain,
            since_fused: -T::one(),
        }
    }

    /// Sets the reference and forgets gates and history; a zero or non-finite vector counts as none.
    pub fn start(&mut self, reference: Option<Vector3<T>>) {
        let limits = [lit(SHORTEST_REFERENCE), lit(LONGEST_REFERENCE)];
        self.reference = reference.filter(|r| checked_norm_squared(r, limits).is_ok());
        self.reference_norm = self.reference.map_or(T::zero(), |r| r.norm());
        self.gate_state = GateState::default();
        self.since_fused = -T::one();
    }

    /// Whether a saved one can be continued from; `part` names the sensor.
    pub(super) fn check(&self, part: &'static str) -> Result<(), InvalidState> {
        finite(part, self.reference.iter().flatten())?;
        finite(part, [&self.since_fused])?;
        let Gate {
            nis_threshold,
            timeout_s,
        } = &self.gate;
        not_negative(
            part,
            [
                &self.reference_norm,
                &self.variance,
                nis_threshold,
                timeout_s,
                &self.gate_state.rejecting_for_s(),
                &self.correlation_time,
                &self.norm_gain,
            ],
        )
    }

    /// Lets `dt` seconds pass.
    #[inline]
    pub fn advance(&mut self, dt: T) {
        self.gate_state.advance(dt);
        if self.since_fused >= T::zero() {
            self.since_fused += dt;
        }
    }

    /// The reference vector, if `measured` is a vector one can use.
    ///
    /// # Errors
    /// Why the sample is to be skipped.
    #[inline]
    pub fn reference_for(&self, measured: &Vector3<T>) -> Result<Vector3<T>, SkipReason> {
        let reference = self.reference.ok_or(SkipReason::NotInitialized)?;
        let norm = self.reference_norm;
        check_vector(measured, norm * lit(1e-3), norm * lit(LONGEST))?;
        Ok(reference)
    }

    /// Noise variance per component of this very sample, before gates and correlation (M15c).
    #[inline]
    pub fn sample_variance(&self, measured: &Vector3<T>) -> T {
        if self.norm_gain > T::zero() {
            let deviation = measured.norm() - self.reference_norm;
            self.variance + self.norm_gain * deviation * deviation
        } else {
            self.variance
        }
    }

    /// Stated noise variance per component.
    #[inline]
    pub fn variance(&self) -> T {
        self.variance
    }

    /// Gain on squared deviations of the vector's length.
    #[inline]
    pub fn norm_gain(&self) -> T {
        self.norm_gain
    }

    /// Judges a vector sample: `residual` is measured minus predicted, `predicted_covariance` the
    /// covariance `H P H^T` of the prediction, `sample_variance` the noise per component.
    #[inline]
    pub fn weigh(
        &mut self,
        residual: Vector3<T>,
        predicted_covariance: &Matrix3<T>,
        sample_variance: T,
    ) -> Weighed<T> {
        let mut covariance = *predicted_covariance;
        for i in 0..3 {
            covariance[(i, i)] += sample_variance;
        }
        match normalized_square3(&residual, &covariance) {
            Some(nis) => self.decide(residual, covariance, nis, 3, sample_variance),
            None => Weighed {
                innovation: Innovation::skipped(SkipReason::Numerical),
                variance: None,
            },
        }
    }

    /// As [`Self::weigh`] for one component, such as a heading (rad).
    #[inline]
    pub fn weigh_scalar(
        &mut self,
        residual: T,
        predicted_variance: T,
        sample_variance: T,
    ) -> Weighed<T> {
        let s = predicted_variance + sample_variance;
        let nis = residual * residual / s;
        if !(s > T::zero() && nis.is_finite()) {
            return Weighed {
                innovation: Innovation::skipped(SkipReason::Numerical),
                variance: None,
            };
        }
        let mut covariance = Matrix3::zeros();
        covariance[(0, 0)] = s;
        let residual = Vector3::new(residual, T::zero(), T::zero());
        self.decide(residual, covariance, nis, 1, sample_variance)
    }

    #[inline]
    fn decide(
        &mut self,
        residual: Vector3<T>,
        covariance: Matrix3<T>,
        nis: T,
        degrees_of_freedom: u8,
        sample_variance: T,
    ) -> Weighed<T> {
        let (outcome, factor) = match self.gate.decide(&mut self.gate_state, nis) {
            GateDecision::Accept => (Outcome::Fused, Some(T::one())),
            GateDecision::Inflate(factor) => (Outcome::Inflated, Some(factor)),
            GateDecision::Reject => (Outcome::Gated, None),
        };
        let variance = factor.map(|f| sample_variance * f * self.correlation_inflation());
        if variance.is_some() {
            self.since_fused = T::zero();
        }
        Weighed {
            innovation: Innovation {
                residual,
                covariance,
                nis,
                degrees_of_freedom,
                outcome,
            },
            variance,
        }
    }

    /// Errors correlated over `tau` make a sample that follows the last after `dt` worth only
    /// `dt / tau` of an independent one (M16).
    #[inline]
    fn correlation_inflation(&self) -> T {
        if self.since_fused < T::zero() || self.since_fused >= self.correlation_time {
            return T::one();
        }
        self.correlation_time / self.since_fused.max(lit(1e-4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn sensor(config: &AttitudeConfig<f64>) -> VectorSensor<f64> {
        let mut sensor = VectorSensor::accelerometer(config);
        sensor.start(Some(Vector3::new(0.0, 0.0, 9.81)));
        sensor
    }

    #[test]
    fn unusable_vectors_are_named() {
        let s = sensor(&AttitudeConfig::lab());
        assert_eq!(
            s.reference_for(&Vector3::zeros()),
            Err(SkipReason::ZeroNorm)
        );
        assert_eq!(
            s.reference_for(&Vector3::new(0.0, f64::NAN, 0.0)),
            Err(SkipReason::NotFinite)
        );
        assert_eq!(
            s.reference_for(&Vector3::new(f64::INFINITY, 0.0, 0.0)),
            Err(SkipReason::NotFinite)
        );
        let blank = VectorSensor::magnetometer(&AttitudeConfig::<f64>::lab());
        assert_eq!(
            blank.reference_for(&Vector3::x()),
            Err(SkipReason::NotInitialized)
        );
    }

    #[test]
    fn correlated_errors_share_one_look_per_correlation_time() {
        let config = AttitudeConfig {
            accelerometer_correlation_time_s: 1.0,
            ..AttitudeConfig::lab()
        };
        let mut s = sensor(&config);
        let mut information = 0.0;
        for _ in 0..1000 {
            let weighed = s.weigh(Vector3::zeros(), &Matrix3::zeros(), 0.25);
            information += 1.0 / weighed.variance.unwrap();
            s.advance(0.01);
        }
        // 10 s hold ten independent looks (and the first sample of all).
        assert_relative_eq!(information * 0.25, 10.0 + 1.0, epsilon = 0.02);
    }

    #[test]
    fn a_vector_of_the_wrong_length_is_trusted_less() {
        let config = AttitudeConfig {
            accelerometer_norm_gain: 4.0,
            ..AttitudeConfig::lab()
        };
        let s = sensor(&config);
        assert_relative_eq!(
            s.sample_variance(&Vector3::new(9.81, 0.0, 0.0)),
            0.0025,
            epsilon = 1e-12
        );
        assert_relative_eq!(
            s.sample_variance(&Vector3::new(11.81, 0.0, 0.0)),
            0.0025 + 16.0,
            epsilon = 1e-9
        );
    }
}
