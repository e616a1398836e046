//! Rauch-Tung-Striebel smoother of the bounded-velocity filter.
//!
//! Read first: `docs/derivations/bounded_velocity.md`, section on the smoother. [`Steps`] watches a
//! [`BoundedVelocity`] and keeps every step of its covariance; [`Steps::smooth`] walks back.
//!
//! A node is the state after all updates before a step. Errors are on the left, in level axes, as in
//! the filter. Between two updates the attitude is the filter's, turned by the correction of the node
//! before.
//!
//! Memory grows with the updates, not with the samples: 5 kB for each with all 22 states, so a quarter
//! of a megabyte per second at 50 Hz, and up to twice that where sensors have their own instants.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::bounded_velocity::layout::{
    ATTITUDE, BIAS, CAPACITY, Correction, Covariance, Layout, SCALE, VELOCITY,
};
use northing_core::attitude::bounded_velocity::steps::{Moment, Step, StepObserver};
use northing_core::attitude::bounded_velocity::{
    BoundedVelocity, BoundedVelocityState, ScaleStates,
};
use northing_core::geometry::{rotation, so3};

use super::{Estimate, Smoother};
use crate::statistics::rts_step::Link;

/// What the smoother knows about the time from one node to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothedNode {
    /// How the filter's attitude has to turn, rad, axes of the reference frame.
    pub turn: Vector3<f64>,
    /// Covariance (rad^2) of the attitude error in the axes of the reference frame.
    pub turn_covariance: Matrix3<f64>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<f64>,
    /// Its covariance, (rad/s)^2.
    pub bias_covariance: Matrix3<f64>,
}

impl SmoothedNode {
    /// The smoothed `ref_from_body` for that of the filter at a sample of this node.
    #[must_use]
    pub fn attitude(&self, filtered: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        rotation::renormalize(&(so3::exp(&self.turn) * filtered))
    }

    /// Covariance (rad^2) of the local error of this attitude in body axes (B22).
    #[must_use]
    pub fn attitude_covariance(&self, ref_from_body: &UnitQuaternion<f64>) -> Matrix3<f64> {
        let r = ref_from_body.to_rotation_matrix().into_inner();
        let turned = r.transpose() * self.turn_covariance * r;
        (turned + turned.transpose()) * 0.5
    }
}

/// The estimate, with the values of the states where their errors stand; the attitude's are zero.
#[derive(Debug, Clone, Copy)]
struct Values {
    level_from_body: UnitQuaternion<f64>,
    others: Correction<f64>,
}

impl Values {
    fn of(state: &BoundedVelocityState<f64>) -> Self {
        let mut others = Correction::zeros();
        let mut put = |first: usize, values: &[f64]| {
            for (i, value) in values.iter().enumerate() {
                others[first + i] = *value;
            }
        };
        put(VELOCITY, state.velocity.as_slice());
        put(BIAS, state.gyroscope_bias.as_slice());
        match state.layout.scale() {
            ScaleStates::Off => {}
            ScaleStates::Diagonal => put(SCALE, state.scale.diagonal().as_slice()),
            ScaleStates::Full => put(SCALE, state.scale.transpose().as_slice()),
        }
        if let Some(first) = state.layout.field() {
            put(first, state.field_ut.as_slice());
        }
        if let Some(first) = state.layout.hard_iron() {
            put(first, state.hard_iron_ut.as_slice());
        }
        Self {
            level_from_body: state.level_from_body,
            others,
        }
    }

    /// The error of `base` with respect to this (B1).
    fn minus(&self, base: &Self) -> Correction<f64> {
        let mut d = self.others - base.others;
        let turn = so3::log(&(self.level_from_body * base.level_from_body.inverse()));
        d.fixed_rows_mut::<3>(ATTITUDE).copy_from(&turn);
        d
    }

    /// With a correction of the errors (B21).
    fn plus(&self, x: &Correction<f64>) -> Self {
        let turn = so3::exp(&x.fixed_rows::<3>(ATTITUDE).into_owned());
        let mut others = self.others + x;
        others.fixed_rows_mut::<3>(ATTITUDE).fill(0.0);
        Self {
            level_from_body: rotation::renormalize(&(turn * self.level_from_body)),
            others,
        }
    }
}

/// The lower triangle of the states in use.
#[derive(Debug, Clone)]
struct Packed(Box<[f64]>);

impl Packed {
    fn of(p: &Covariance<f64>, layout: &Layout) -> Self {
        let rows = 0..layout.len().min(CAPACITY);
        Self(rows.flat_map(|i| (0..=i).map(move |j| p[(i, j)])).collect())
    }

    fn unpack(&self) -> Covariance<f64> {
        let mut p = Covariance::zeros();
        let places = (0..CAPACITY).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for ((i, j), value) in places.zip(&self.0) {
            p[(i, j)] = *value;
            p[(j, i)] = *value;
        }
        p
    }
}

/// A state after all updates.
#[derive(Debug, Clone)]
struct Node {
    values: Values,
    covariance: Packed,
    layout: Layout,
    ref_from_level: UnitQuaternion<f64>,
}

impl Node {
    fn of(state: &BoundedVelocityState<f64>) -> Self {
        Self {
            values: Values::of(state),
            covariance: Packed::of(&state.covariance, &state.layout),
            layout: state.layout,
            ref_from_level: state.ref_from_level,
        }
    }

    /// This node, known to be `values` with this covariance.
    fn smoothed(&self, values: &Values, covariance: &Covariance<f64>) -> SmoothedNode {
        let turn = values
            .minus(&self.values)
            .fixed_rows::<3>(ATTITUDE)
            .into_owned();
        let block = |first: usize| covariance.fixed_view::<3, 3>(first, first).into_owned();
        let r = self.ref_from_level.to_rotation_matrix().into_inner();
        SmoothedNode {
            turn: r * turn,
            turn_covariance: r * block(ATTITUDE) * r.transpose(),
            gyroscope_bias: values.others.fixed_rows::<3>(BIAS).into_owned(),
            bias_covariance: block(BIAS),
        }
    }
}

/// From one node to the next.
#[derive(Debug, Clone)]
struct Recorded {
    node: Node,
    /// How its error moves, and where to: estimate and covariance before any update. A new start
    /// carries nothing back.
    step: Option<(Step<f64>, Values, Packed)>,
}

/// The steps of a filter.
#[derive(Debug, Clone, Default)]
pub struct Steps {
    recorded: Vec<Recorded>,
    /// The node at which the filter is.
    now: Option<Node>,
    /// The step that the filter is taking.
    leaving: Option<Step<f64>>,
}

impl Steps {
    /// The node at which the filter is: its place in what [`Steps::smooth`] returns.
    #[must_use]
    pub fn node(&self) -> usize {
        self.recorded.len()
    }

    /// Every smoothed node, the first to the last. The last is the filter's own.
    #[must_use]
    pub fn smooth(&self) -> Vec<SmoothedNode> {
        let Some(last) = &self.now else {
            return Vec::new();
        };
        let mut smoothed = Vec::with_capacity(self.recorded.len() + 1);
        let (mut values, mut covariance) = (last.values, last.covariance.unpack());
        smoothed.push(last.smoothed(&values, &covariance));
        for recorded in self.recorded.iter().rev() {
            (values, covariance) = recorded.back(&values, &covariance);
            smoothed.push(recorded.node.smoothed(&values, &covariance));
        }
        smoothed.reverse();
        smoothed
    }

    fn arrive(
        &mut self,
        state: &BoundedVelocityState<f64>,
        step: Option<(Step<f64>, Values, Packed)>,
    ) {
        if let Some(node) = self.now.replace(Node::of(state)) {
            self.recorded.push(Recorded { node, step });
        }
    }
}

impl Recorded {
    /// One step back (B23 to B26); the filtered node where nothing comes back.
    fn back(&self, next: &Values, next_covariance: &Covariance<f64>) -> (Values, Covariance<f64>) {
        let filtered = self.node.covariance.unpack();
        let back = self.step.as_ref().and_then(|(step, values, predicted)| {
            let link = Link {
                filtered: &filtered,
                transition: &step.transition(&self.node.layout),
                predicted: &predicted.unpack(),
            };
            link.back(&next.minus(values), next_covariance)
        });
        match back {
            Some((x, covariance)) => (self.node.values.plus(&x), covariance),
            None => (self.node.values, filtered),
        }
    }
}

impl StepObserver<f64> for Steps {
    fn observe(&mut self, moment: Moment<'_, f64>, state: &BoundedVelocityState<f64>) {
        match moment {
            Moment::Started => {
                self.leaving = None;
                self.arrive(state, None);
            }
            Moment::Leaving(step) => self.leaving = Some(*step),
            Moment::Predicted => {
                let predicted = Packed::of(&state.covariance, &state.layout);
                let step = self.leaving.take();
                self.arrive(state, step.map(|step| (step, Values::of(state), predicted)));
            }
            Moment::Corrected => {
                if let Some(now) = &mut self.now {
                    *now = Node::of(state);
                }
            }
        }
    }
}

impl Smoother for BoundedVelocity<f64, Steps> {
    type Node = SmoothedNode;

    fn node(&self) -> usize {
        self.observer().node()
    }

    fn smooth(&self) -> Vec<SmoothedNode> {
        let r = self
            .state()
            .ref_from_level
            .to_rotation_matrix()
            .into_inner();
        let unseen = r * self.unseen_tilt() * r.transpose();
        let mut nodes = self.observer().smooth();
        for node in &mut nodes {
            node.turn_covariance += unseen;
        }
        nodes
    }

    fn smoothed_estimate(node: &SmoothedNode, filtered: &UnitQuaternion<f64>) -> Estimate {
        let attitude = node.attitude(filtered);
        Estimate {
            attitude,
            attitude_covariance: node.attitude_covariance(&attitude),
            gyroscope_bias: node.gyroscope_bias,
            bias_covariance: node.bias_covariance,
        }
    }
}

#[cfg(test)]
mod tests;
