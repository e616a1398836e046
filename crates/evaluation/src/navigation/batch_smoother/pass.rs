//! One pass of the batch smoother: the linear Kalman filter about the trajectory so far, and the backward recursion of Bryson and
//! Frazier (E44-E46).
//!
//! *Read first:* Bierman (1973), *Fixed interval smoothing with discrete measurements*. Against the recursion of Rauch, Tung and
//! Striebel nothing is inverted: states that are known exactly, or not at all, are no trouble.

use northing_core::ConfigError;

use super::aids::{Aids, Component};
use super::motion::{History, SlowError, Step, Strapdown};
use super::recorder::Measurement;
use super::state::State;
use super::{ALL, Covariance, Errors};
use northing_core::navigation::STATES;

/// Numbers of a symmetric matrix.
const TRIANGLE: usize = ALL * (ALL + 1) / 2;

/// A measurement at its node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Attached {
    pub(super) node: usize,
    /// How long before its node it was valid, s.
    pub(super) age_s: f64,
    pub(super) measurement: Measurement,
    pub(super) weight: f64,
}

/// What a pass is about.
pub(super) struct Linearization<'a> {
    pub(super) strapdown: &'a Strapdown<'a>,
    pub(super) aids: &'a Aids<'a>,
    pub(super) times_ns: &'a [i64],
    pub(super) states: &'a [State],
    /// In the order of their nodes.
    pub(super) attached: &'a [Attached],
    /// How the receiver's correlated error goes on to the next node.
    pub(super) slow: &'a [SlowError],
    /// Of the first node.
    pub(super) prior: (Errors, Covariance),
}

/// One scalar update.
struct Update {
    /// Which measurement.
    attached: usize,
    component: Component,
    /// Variance of its noise with the weight.
    noise: f64,
    gain: Errors,
    innovation: f64,
    expected: f64,
}

/// A node after its updates.
struct Filtered {
    error: Errors,
    covariance: [f64; TRIANGLE],
    updates: usize,
    step: Option<Step>,
    spin: nalgebra::Vector3<f64>,
}

/// The forward half of a pass.
pub(super) struct Forward {
    nodes: Vec<Filtered>,
    updates: Vec<Update>,
}

#[cfg(test)]
impl Forward {
    /// Mean and covariance of every node after its updates.
    pub(super) fn filtered(&self) -> Vec<(Errors, Covariance)> {
        let nodes = self.nodes.iter();
        nodes
            .map(|node| (node.error, unpacked(&node.covariance)))
            .collect()
    }
}

/// What a pass says about a node.
pub(super) struct Smoothed<'a> {
    pub(super) node: usize,
    pub(super) error: Errors,
    /// `P` and `Lambda` of (E46).
    filtered: Covariance,
    information: &'a Covariance,
    /// Angular rate at the node less its bias, rad/s.
    pub(super) angular_rate: nalgebra::Vector3<f64>,
}

impl Smoothed<'_> {
    /// `rows P^s rows^T` (E46).
    pub(super) fn covariance_of<const M: usize>(
        &self,
        rows: &nalgebra::SMatrix<f64, M, ALL>,
    ) -> nalgebra::SMatrix<f64, M, M> {
        let projected = rows * self.filtered;
        let covariance =
            projected * rows.transpose() - projected * self.information * projected.transpose();
        (covariance + covariance.transpose()) * 0.5
    }
}

impl Linearization<'_> {
    /// The filter forward; `None` where the numbers have failed.
    ///
    /// # Errors
    /// The settings are invalid.
    pub(super) fn forward(&self) -> Result<Option<Forward>, ConfigError> {
        let (mut error, mut covariance) = self.prior;
        let mut forward = Forward {
            nodes: Vec::with_capacity(self.states.len()),
            updates: Vec::new(),
        };
        let mut history = History::default();
        let mut attached = self.attached.iter().enumerate().peekable();
        for (k, state) in self.states.iter().enumerate() {
            while let Some((index, one)) = attached.next_if(|(_, one)| one.node == k) {
                let seen =
                    self.aids
                        .components(&one.measurement.measured, state, &history, one.age_s);
                for component in seen.into_iter().flatten() {
                    let noise = component.variance / one.weight;
                    let Some(update) = update(&mut error, &mut covariance, component, noise) else {
                        return Ok(None);
                    };
                    forward.updates.push(Update {
                        attached: index,
                        ..update
                    });
                }
            }
            let spin = history.at(&state.navigation(), 0.0, 0.0).angular_rate;
            let mut node = Filtered {
                error,
                covariance: packed(&covariance),
                updates: forward.updates.len(),
                step: None,
                spin,
            };
            if let (Some(next), Some([from, to])) =
                (self.states.get(k + 1), self.times_ns.get(k..k + 2))
            {
                let motion =
                    self.strapdown
                        .advance(state, [*from, *to], &self.slow[k], &mut history)?;
                motion.step.map(&mut error);
                error += motion.end.minus(next);
                motion.step.map(&mut covariance);
                covariance.transpose_mut();
                motion.step.map(&mut covariance);
                let mut errors = covariance.fixed_view_mut::<STATES, STATES>(0, 0);
                errors += motion.noise;
                for i in 0..ALL {
                    covariance[(i, i)] += motion.added[i];
                }
                covariance.fill_lower_triangle_with_upper_triangle();
                node.step = Some(motion.step);
            }
            forward.nodes.push(node);
        }
        Ok(error.iter().all(|x| x.is_finite()).then_some(forward))
    }

    /// Back over what `forward` did: each node, the last first, goes to `see`. Gives the mean square of each measurement's noise,
    /// over its variance without weight, summed over its components, and how many these are.
    pub(super) fn backward(
        &self,
        forward: Forward,
        mut see: impl FnMut(&Smoothed<'_>),
    ) -> Vec<(f64, u8)> {
        let mut squares = vec![(0.0, 0); self.attached.len()];
        let Forward {
            mut nodes,
            mut updates,
        } = forward;
        let mut lambda = Errors::zeros();
        let mut information = Covariance::zeros();
        while let Some(node) = nodes.pop() {
            if let Some(step) = &node.step {
                step.map_transposed(&mut lambda);
                step.map_transposed(&mut information);
                information.transpose_mut();
                step.map_transposed(&mut information);
                information.fill_lower_triangle_with_upper_triangle();
            }
            let filtered = unpacked(&node.covariance);
            see(&Smoothed {
                node: nodes.len(),
                error: node.error - filtered * lambda,
                filtered,
                information: &information,
                angular_rate: node.spin,
            });
            let before = nodes.last().map_or(0, |before| before.updates);
            for update in updates.drain(before..).rev() {
                let square = update.undo(&mut lambda, &mut information);
                if let Some((sum, count)) = squares.get_mut(update.attached) {
                    *sum += square;
                    *count += 1;
                }
            }
        }
        squares
    }
}

/// A scalar update (E16); `None` where the numbers have failed.
fn update(
    error: &mut Errors,
    covariance: &mut Covariance,
    component: Component,
    noise: f64,
) -> Option<Update> {
    let projected = *covariance * component.row;
    let expected = component.row.dot(&projected) + noise;
    if !(expected > 0.0 && expected.is_finite()) {
        return None;
    }
    let gain = projected / expected;
    let innovation = component.residual - component.row.dot(error);
    *error += gain * innovation;
    covariance.ger(-1.0, &gain, &projected, 1.0);
    covariance.fill_lower_triangle_with_upper_triangle();
    Some(Update {
        attached: 0,
        component,
        noise,
        gain,
        innovation,
        expected,
    })
}

impl Update {
    /// Back over the update (E45). Gives the mean square of its noise over its variance.
    fn undo(&self, lambda: &mut Errors, information: &mut Covariance) -> f64 {
        let h = &self.component.row;
        let u = self.innovation / self.expected + self.gain.dot(lambda);
        let moved = *information * self.gain;
        let d = self.expected.recip() + self.gain.dot(&moved);
        *lambda -= h * u;
        // (I - K h^T)^T N (I - K h^T) + h h^T / s
        information.ger(-1.0, h, &moved, 1.0);
        information.ger(-1.0, &moved, h, 1.0);
        information.ger(d, h, h, 1.0);
        let mean = self.noise * u;
        let variance = (self.noise - self.noise * self.noise * d).max(0.0);
        (mean * mean + variance) / self.component.variance
    }
}

fn packed(m: &Covariance) -> [f64; TRIANGLE] {
    let mut packed = [0.0; TRIANGLE];
    let columns = (0..ALL).flat_map(|j| (0..=j).map(move |i| (i, j)));
    for (place, at) in packed.iter_mut().zip(columns) {
        *place = m[at];
    }
    packed
}

fn unpacked(packed: &[f64; TRIANGLE]) -> Covariance {
    let mut m = Covariance::zeros();
    let columns = (0..ALL).flat_map(|j| (0..=j).map(move |i| (i, j)));
    for (value, (i, j)) in packed.iter().zip(columns) {
        m[(i, j)] = *value;
        m[(j, i)] = *value;
    }
    m
}
