//! What the bounded-velocity filter knows beside the attitude: hard iron, quality of the field, rest.

use northing_core::attitude::bounded_velocity::BoundedVelocityState;
use northing_evaluation::Origin;
use northing_evaluation::attitude::first_look::{LEFT_BY_A_CALIBRATION_UT, PRIOR};
use northing_evaluation::attitude::kinds::EstimatorKind;
use northing_recording::SensorKind;
use serde::Serialize;

use super::DeviceSession;

/// Hard iron, field and rest as they are now.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Surroundings {
    /// Hard iron, microtesla, body axes; `None` where it is not estimated.
    pub hard_iron_ut: Option<[f64; 3]>,
    /// Its standard deviation, microtesla.
    pub hard_iron_std_ut: Option<[f64; 3]>,
    /// By how much strength and dip of the last field raised its variance: 1 is the field that is
    /// expected. `None` without a magnetometer.
    pub field_variance_factor: Option<f64>,
    /// Whether the device rests.
    pub is_resting: bool,
}

impl Surroundings {
    /// Of a state.
    #[must_use]
    pub fn of(state: &BoundedVelocityState<f64>) -> Self {
        let std = state.hard_iron_std_ut();
        Self {
            hard_iron_ut: std.is_some().then(|| state.hard_iron_ut.into()),
            hard_iron_std_ut: std.map(Into::into),
            field_variance_factor: state.has_field().then_some(state.field_variance_factor),
            is_resting: state.rest.is_resting(),
        }
    }
}

impl DeviceSession {
    /// Expects the hard iron that the magnetometer leaves, as a stored experiment will; where that has
    /// changed, the filter goes on with it from where it is.
    pub(super) fn expect_hard_iron(&mut self) {
        let before = self.options.config;
        if !self.options.is_explicit(PRIOR) {
            let own = self.options.profile.config().bounded_velocity;
            let prior = &mut self.options.config.bounded_velocity;
            prior.initial_hard_iron_std_ut = own.initial_hard_iron_std_ut;
            self.options.origins.remove(PRIOR);
            if self.magnetometer.is_some() {
                // Its samples are calibrated before anything else sees them.
                prior.initial_hard_iron_std_ut = LEFT_BY_A_CALIBRATION_UT;
                let origins = &mut self.options.origins;
                origins.insert(PRIOR.to_owned(), Origin::Learnt);
            }
        }
        let came = self
            .intake
            .received_of(SensorKind::MagnetometerUncalibrated)
            > 0;
        self.options.expect_hard_iron(came);
        if self.options.config == before {
            return;
        }
        let config = self.config();
        for track in &mut self.tracks {
            if track.kind == EstimatorKind::BoundedVelocity {
                // A larger prior is as valid as the one before.
                let _ = track.retune(&config);
            }
        }
    }
}
