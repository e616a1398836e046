//! The states of the batch smoother at a node, and what an error is (E1).

use nalgebra::{SVector, UnitQuaternion, Vector3};
use northing_core::earth::FrameChange;
use northing_core::geometry::{rotation, so3};
use northing_core::navigation::augmented_states::{AUGMENTED_STATES, GNSS_OFFSET};
use northing_core::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, NavigationState, POSITION, STATES, VELOCITY,
};

use super::{BIAS_AT_REST, Errors, LEVER_ARM, SPEED_SCALE, VELOCITY_OFFSET};

/// All states at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct State {
    pub(super) ned_from_body: UnitQuaternion<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) position: Vector3<f64>,
    pub(super) accelerometer_bias: Vector3<f64>,
    pub(super) gyroscope_bias: Vector3<f64>,
    /// The filter's augmented states.
    pub(super) side: SVector<f64, AUGMENTED_STATES>,
    /// What the biases of accelerometer and gyroscope relax to.
    pub(super) bias_at_rest: [Vector3<f64>; 2],
    pub(super) lever_arm: Vector3<f64>,
    /// By what share a wheel speed is too high.
    pub(super) speed_scale: f64,
    /// How much later than its positions the receiver's velocities are, beyond both latencies, s.
    pub(super) velocity_offset_s: f64,
}

impl State {
    /// That of the filter, with biases at rest.
    pub(super) fn of_filter(
        state: &NavigationState<f64>,
        side: &SVector<f64, AUGMENTED_STATES>,
    ) -> Self {
        Self {
            ned_from_body: state.ned_from_body,
            velocity: state.velocity,
            position: state.position,
            accelerometer_bias: state.accelerometer_bias,
            gyroscope_bias: state.gyroscope_bias,
            side: *side,
            bias_at_rest: [state.accelerometer_bias, state.gyroscope_bias],
            lever_arm: Vector3::zeros(),
            speed_scale: 0.0,
            velocity_offset_s: 0.0,
        }
    }

    /// The same in another local frame.
    pub(super) fn moved(mut self, change: &FrameChange<f64>) -> Self {
        self.ned_from_body = change.attitude(&self.ned_from_body);
        self.velocity = change.vector(&self.velocity);
        self.position = change.position(&self.position);
        let offset = self.side.fixed_rows::<3>(GNSS_OFFSET).into_owned();
        let mut place = self.side.fixed_rows_mut::<3>(GNSS_OFFSET);
        place.copy_from(&change.vector(&offset));
        self
    }

    /// As the filter has it, exactly known.
    pub(super) fn navigation(&self) -> NavigationState<f64> {
        let mut state = NavigationState::new(self.ned_from_body, self.velocity, self.position);
        state.accelerometer_bias = self.accelerometer_bias;
        state.gyroscope_bias = self.gyroscope_bias;
        state
    }

    /// The state that is off from this one by `x`.
    pub(super) fn corrected(&self, x: &Errors) -> Self {
        let part = |i: usize| x.fixed_rows::<3>(i).into_owned();
        let [force, rate] = self.bias_at_rest;
        let turned = so3::exp(&part(ATTITUDE)) * self.ned_from_body;
        Self {
            ned_from_body: rotation::renormalize(&turned),
            velocity: self.velocity + part(VELOCITY),
            position: self.position + part(POSITION),
            accelerometer_bias: self.accelerometer_bias + part(ACCELEROMETER_BIAS),
            gyroscope_bias: self.gyroscope_bias + part(GYROSCOPE_BIAS),
            side: self.side + x.fixed_rows::<AUGMENTED_STATES>(STATES),
            bias_at_rest: [force + part(BIAS_AT_REST), rate + part(BIAS_AT_REST + 3)],
            lever_arm: self.lever_arm + part(LEVER_ARM),
            speed_scale: self.speed_scale + x[SPEED_SCALE],
            velocity_offset_s: self.velocity_offset_s + x[VELOCITY_OFFSET],
        }
    }

    /// What this state is off from `other` by.
    pub(super) fn minus(&self, other: &Self) -> Errors {
        let turn = so3::log(&(self.ned_from_body * other.ned_from_body.inverse()));
        let parts = [
            (ATTITUDE, turn),
            (VELOCITY, self.velocity - other.velocity),
            (POSITION, self.position - other.position),
            (
                ACCELEROMETER_BIAS,
                self.accelerometer_bias - other.accelerometer_bias,
            ),
            (GYROSCOPE_BIAS, self.gyroscope_bias - other.gyroscope_bias),
            (BIAS_AT_REST, self.bias_at_rest[0] - other.bias_at_rest[0]),
            (
                BIAS_AT_REST + 3,
                self.bias_at_rest[1] - other.bias_at_rest[1],
            ),
            (LEVER_ARM, self.lever_arm - other.lever_arm),
        ];
        let mut x = Errors::zeros();
        for (first, part) in parts {
            x.fixed_rows_mut::<3>(first).copy_from(&part);
        }
        x[SPEED_SCALE] = self.speed_scale - other.speed_scale;
        x[VELOCITY_OFFSET] = self.velocity_offset_s - other.velocity_offset_s;
        x.fixed_rows_mut::<AUGMENTED_STATES>(STATES)
            .copy_from(&(self.side - other.side));
        x
    }
}
