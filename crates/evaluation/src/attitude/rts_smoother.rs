//! Rauch-Tung-Striebel (RTS) smoothers: estimates from the whole recording. Here that of the six-state MEKF.
//!
//! | idea | file |
//! |---|---|
//! | the smoother of the bounded-velocity filter | `rts_smoother/bounded_velocity.rs` |
//!
//! Read first: Rauch, Tung & Striebel (1965); `docs/derivations/mekf.md`, section on the smoother.
//! A [`Recorder`] runs a [`Mekf`] and keeps what each propagation did; [`Smoother::smooth`] then
//! walks back. It needs the whole recording and about a kilobyte for each propagation. Use it for
//! records and for judging an estimator, not on a device.
//!
//! # Model
//!
//! Node `k` is the state after all updates before propagation `k`; the errors are local and small:
//!
//! ```text
//! G_k = P_k^+ Phi_k^T (P_{k+1}^-)^-1
//! d   = [log((q_{k+1}^-)^-1 q_{k+1}^s), b_{k+1}^s - b_{k+1}^-],   x = G_k d
//! q_k^s = q_k^+ Exp(x_a),   b_k^s = b_k^+ + x_b
//! P_k^s = P_k^+ + G_k (P_{k+1}^s - P_{k+1}^-) G_k^T
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `q^+, b^+, P^+` | `Step::filtered` | -, rad/s, rad^2 ... |
//! | `q^-, b^-, P^-` | `Step::predicted` | |
//! | `Phi` | `Step::transition` | |
//!
//! A new start of the filter ends the chain: nothing is carried back across it.

pub mod bounded_velocity;

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};
use northing_core::ConfigError;
use northing_core::attitude::mekf::Mekf;
use northing_core::attitude::{
    AttitudeConfig, AttitudeEstimator, CompassHeading, InitialState, Propagation, StartUncertainty,
};
use northing_core::geometry::{rotation, so3};
use northing_core::kalman::Innovation;

use crate::statistics::rts_step::Link;

/// A filter that remembers what it did, and can be smoothed.
pub trait Smoother: AttitudeEstimator<f64> {
    /// What the smoother says about the samples of one node.
    type Node;

    /// The node at which the filter is: its place in what [`Smoother::smooth`] returns.
    fn node(&self) -> usize;

    /// Every smoothed node, the first to the last. The last is the filter's own.
    fn smooth(&self) -> Vec<Self::Node>;

    /// The smoothed estimate at a sample of `node` where the filter had the attitude `filtered`
    /// (`ref_from_body`).
    fn smoothed_estimate(node: &Self::Node, filtered: &UnitQuaternion<f64>) -> Estimate;
}

/// What a smoother says about one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// `ref_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Covariance (rad^2) of its local error, body axes.
    pub attitude_covariance: Matrix3<f64>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<f64>,
    /// Its covariance, (rad/s)^2.
    pub bias_covariance: Matrix3<f64>,
}

/// Attitude, bias and covariance at one node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothedState {
    /// `ref_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<f64>,
    /// Covariance of `[attitude error (rad, body axes), bias error (rad/s)]`.
    pub covariance: Matrix6<f64>,
}

impl SmoothedState {
    fn of(mekf: &Mekf<f64>) -> Self {
        let state = mekf.state();
        Self {
            attitude: state.attitude,
            gyroscope_bias: state.gyroscope_bias,
            covariance: state.covariance,
        }
    }

    /// Covariance (rad^2) of the local attitude error, body axes.
    #[must_use]
    pub fn attitude_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// Covariance ((rad/s)^2) of the bias.
    #[must_use]
    pub fn bias_covariance(&self) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(3, 3).into_owned()
    }
}

/// From one node to the next.
#[derive(Debug, Clone)]
struct Step {
    /// The state before.
    filtered: SmoothedState,
    /// How its error moves on.
    transition: Matrix6<f64>,
    /// The state after, before any update.
    predicted: SmoothedState,
    /// Whether it was a propagation. A new start carries nothing back.
    propagated: bool,
}

/// A [`Mekf`] that remembers.
#[derive(Debug, Clone)]
pub struct Recorder {
    mekf: Mekf<f64>,
    steps: Vec<Step>,
}

impl Recorder {
    /// A filter with these settings and nothing to remember yet.
    ///
    /// # Errors
    /// [`ConfigError`] names the first parameter outside its permitted range.
    pub fn new(config: AttitudeConfig<f64>) -> Result<Self, ConfigError> {
        Ok(Self {
            mekf: Mekf::new(config)?,
            steps: Vec::new(),
        })
    }

    fn remember(&mut self, filtered: SmoothedState, transition: Matrix6<f64>, propagated: bool) {
        let predicted = SmoothedState::of(&self.mekf);
        self.steps.push(Step {
            filtered,
            transition,
            predicted,
            propagated,
        });
    }
}

impl Smoother for Recorder {
    type Node = SmoothedState;

    fn node(&self) -> usize {
        self.steps.len()
    }

    fn smooth(&self) -> Vec<SmoothedState> {
        let mut smoothed = Vec::with_capacity(self.steps.len() + 1);
        let mut next = SmoothedState::of(&self.mekf);
        smoothed.push(next);
        for step in self.steps.iter().rev() {
            next = if step.propagated {
                step_back(step, &next)
            } else {
                step.filtered
            };
            smoothed.push(next);
        }
        smoothed.reverse();
        smoothed
    }

    fn smoothed_estimate(node: &SmoothedState, _: &UnitQuaternion<f64>) -> Estimate {
        Estimate {
            attitude: node.attitude,
            attitude_covariance: node.attitude_covariance(),
            gyroscope_bias: node.gyroscope_bias,
            bias_covariance: node.bias_covariance(),
        }
    }
}

/// One step back; the filtered state where the prediction cannot be inverted.
fn step_back(step: &Step, next: &SmoothedState) -> SmoothedState {
    let Step {
        filtered,
        transition,
        predicted,
        ..
    } = step;
    let mut d = Vector6::zeros();
    let turn = so3::log(&(predicted.attitude.inverse() * next.attitude));
    d.fixed_rows_mut::<3>(0).copy_from(&turn);
    d.fixed_rows_mut::<3>(3)
        .copy_from(&(next.gyroscope_bias - predicted.gyroscope_bias));
    let link = Link {
        filtered: &filtered.covariance,
        transition,
        predicted: &predicted.covariance,
    };
    let Some((x, covariance)) = link.back(&d, &next.covariance) else {
        return *filtered;
    };
    // (M22b)
    let (a, b): (Vector3<f64>, Vector3<f64>) = (
        x.fixed_rows::<3>(0).into_owned(),
        x.fixed_rows::<3>(3).into_owned(),
    );
    SmoothedState {
        attitude: rotation::renormalize(&(filtered.attitude * so3::exp(&a))),
        gyroscope_bias: filtered.gyroscope_bias + b,
        covariance,
    }
}

impl AttitudeEstimator<f64> for Recorder {
    fn initialize(&mut self, initial: &InitialState<f64>) {
        let filtered = SmoothedState::of(&self.mekf);
        self.mekf.initialize(initial);
        self.remember(filtered, Matrix6::identity(), false);
    }

    fn propagate(&mut self, angular_rate: &Vector3<f64>, dt: f64) -> Propagation {
        let filtered = SmoothedState::of(&self.mekf);
        let transition = self.mekf.transition(angular_rate, dt);
        let propagation = self.mekf.propagate(angular_rate, dt);
        if propagation == Propagation::Done && dt > 0.0 {
            self.remember(filtered, transition, true);
        }
        propagation
    }

    fn update_accelerometer(&mut self, specific_force: &Vector3<f64>) -> Innovation<f64> {
        self.mekf.update_accelerometer(specific_force)
    }

    fn update_magnetometer(&mut self, magnetic_field: &Vector3<f64>) -> Innovation<f64> {
        self.mekf.update_magnetometer(magnetic_field)
    }

    fn update_compass(&mut self, heading: &CompassHeading<f64>) -> Innovation<f64> {
        self.mekf.update_compass(heading)
    }

    fn add_attitude_variance(&mut self, variance: f64) {
        let filtered = SmoothedState::of(&self.mekf);
        self.mekf.add_attitude_variance(variance);
        self.remember(filtered, Matrix6::identity(), true);
    }

    fn attitude(&self) -> UnitQuaternion<f64> {
        self.mekf.attitude()
    }

    fn attitude_covariance(&self) -> Option<Matrix3<f64>> {
        self.mekf.attitude_covariance()
    }

    fn gyroscope_bias(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        self.mekf.gyroscope_bias()
    }

    fn start_uncertainty(&self) -> StartUncertainty<f64> {
        self.mekf.start_uncertainty()
    }

    fn rate_at_rest(&self) -> Vector3<f64> {
        self.mekf.rate_at_rest()
    }
}

#[cfg(test)]
mod tests;
