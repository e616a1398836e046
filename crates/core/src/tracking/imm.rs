//! Interacting multiple models, with the cross-covariance to the own ship mixed like the rest.
//!
//! Read first: Blom and Bar-Shalom, *The Interacting Multiple Model Algorithm for Systems with
//! Markovian Switching Coefficients*, IEEE TAC 33 (1988); `docs/derivations/association.md`,
//! section 2.
//!
//! When to use: targets that go straight most of the time and turn now and then. When not: one model
//! with the right noise does as well for targets that never turn; `M = 1` is then a Kalman filter.
//!
//! | symbol | here |
//! |---|---|
//! | `mu_m` | [`Mode::probability`] |
//! | `x_m`, `P_m`, `X_m` | [`Mode::state`], [`Mode::covariance`], [`Mode::cross`] |
//! | `p_mn` | probability of switching, from [`Models`] and the time between scans |
//!
//! Cost: `M` Kalman filters and `M^2` small matrix sums a step.

use nalgebra::Vector3;

use super::FARTHEST;
use super::coordinated_turn::{Motion, TargetCovariance, TargetState, TurnRate};
use super::detection::CrossCovariance;
use super::echo::EchoCovariance;
use crate::kalman::covariance::{forget_correlations_unless_resolved, is_resolved, symmetrize};
use crate::scalar::{Scalar, lit};

/// One motion model's belief about a target.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct Mode<T> {
    /// Probability that the target moves like this now.
    pub probability: T,
    /// `[north, north velocity, east, east velocity, turn rate]` in m, m/s, rad/s.
    pub state: TargetState<T>,
    /// Covariance of the state.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: TargetCovariance<T>,
    /// Covariance of the state's error with the own ship's.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub cross: CrossCovariance<T>,
    /// Covariance of the state's error with where on the target its echo comes from, where that stays (`echo.rs`).
    #[cfg_attr(
        feature = "serde",
        serde(default = "EchoCovariance::zeros", with = "crate::serialization::rows")
    )]
    pub echo: EchoCovariance<T>,
}

/// The models and how targets switch between them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct Models<T, const M: usize> {
    /// The motion models.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    pub motions: [Motion<T>; M],
    /// Mean time a target stays in each model, s.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    pub dwell_s: [T; M],
    /// The turn rate of all models.
    pub turn: TurnRate<T>,
}

/// A target under several motion models at once.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct Imm<T, const M: usize> {
    /// One belief a model; the probabilities sum to one.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    pub modes: [Mode<T>; M],
}

impl<T: Scalar, const M: usize> Models<T, M> {
    /// Probability of being in model `to` after `dt`, from model `from`: Poisson switches, equally
    /// likely to every other model.
    fn switching(&self, from: usize, to: usize, dt: T) -> T {
        let stay = (-dt / self.dwell_s[from]).exp();
        let others: T = nalgebra::convert((M.max(2) - 1) as f64);
        match (M, from == to) {
            (1, _) => T::one(),
            (_, true) => stay,
            (_, false) => (T::one() - stay) / others,
        }
    }
}

impl<T: Scalar, const M: usize> Imm<T, M> {
    /// The same belief in every model, with the stationary share of each.
    pub fn new(
        models: &Models<T, M>,
        state: TargetState<T>,
        covariance: TargetCovariance<T>,
        cross: CrossCovariance<T>,
        echo: EchoCovariance<T>,
    ) -> Self {
        let total = models.dwell_s.iter().fold(T::zero(), |a, b| a + *b);
        Self {
            modes: core::array::from_fn(|m| Mode {
                probability: models.dwell_s[m] / total,
                state,
                covariance,
                cross,
                echo,
            }),
        }
    }

    /// Lets `dt` seconds pass: mixes the models, then moves each. `kept` is the share of each own-ship
    /// error that is still there ([`super::own_ship::PoseErrorCorrelation::factors`]), `echo_kept` that of the echo's place.
    pub fn predict(&mut self, models: &Models<T, M>, dt: T, kept: &Vector3<T>, echo_kept: T) {
        self.mix(models, dt);
        for (mode, motion) in self.modes.iter_mut().zip(&models.motions) {
            let (state, f) = motion.predict(&mode.state, &models.turn, dt);
            mode.state = state;
            mode.covariance = f * mode.covariance * f.transpose() + motion.noise(&models.turn, dt);
            symmetrize(&mut mode.covariance);
            mode.cross = f * mode.cross;
            mode.echo = f * mode.echo * echo_kept;
            mode.hold();
            for (i, share) in kept.iter().enumerate() {
                mode.cross.column_mut(i).scale_mut(*share);
            }
        }
    }

    /// Interaction: every model starts from what the models it may have come from accepted.
    fn mix(&mut self, models: &Models<T, M>, dt: T) {
        let before = self.modes;
        for (to, mode) in self.modes.iter_mut().enumerate() {
            let weights: [T; M] = core::array::from_fn(|from| {
                models.switching(from, to, dt) * before[from].probability
            });
            // A model that cannot be reached keeps its own belief, with no probability.
            *mode = merge(&before, &weights).unwrap_or(Mode {
                probability: T::zero(),
                ..before[to]
            });
        }
    }

    /// The single Gaussian with the mean and covariance of the mixture.
    pub fn estimate(&self) -> Mode<T> {
        merge(
            &self.modes,
            &core::array::from_fn(|m| self.modes[m].probability),
        )
        .unwrap_or(self.modes[0])
    }

    /// Whether every number is finite, every state where a target can be (1e8 m, 1e8 m/s), and every covariance one.
    pub fn is_valid(&self) -> bool {
        self.modes.iter().all(|m| {
            m.probability.is_finite()
                && m.state.iter().all(|v| v.abs() <= lit(FARTHEST))
                && m.cross.iter().chain(&m.echo).all(|v| v.is_finite())
                && is_resolved(&m.covariance)
                && m.covariance.diagonal().iter().all(|v| *v > T::zero())
        })
    }
}

impl<T: Scalar> Mode<T> {
    /// Nothing is known: all zeros, with no probability.
    pub(super) fn unknown() -> Self {
        Self {
            probability: T::zero(),
            state: TargetState::zeros(),
            covariance: TargetCovariance::zeros(),
            cross: CrossCovariance::zeros(),
            echo: EchoCovariance::zeros(),
        }
    }

    /// Forgets correlations that rounding has made more than one, with those to the own ship.
    pub(super) fn hold(&mut self) {
        let unknown = TargetState::repeat(lit(FARTHEST * FARTHEST));
        if forget_correlations_unless_resolved(&mut self.covariance, &unknown) {
            self.cross.fill(T::zero());
            self.echo.fill(T::zero());
        }
    }
}

/// Mean and covariance of weighted beliefs; the weights need not sum to one, their sum is the
/// probability of the result. `None` when no belief has weight.
fn merge<T: Scalar, const M: usize>(modes: &[Mode<T>; M], weights: &[T; M]) -> Option<Mode<T>> {
    let total = weights.iter().fold(T::zero(), |a, b| a + *b);
    if !(total > T::zero() && total.is_finite()) {
        return None;
    }
    let mut out = Mode {
        probability: total,
        ..Mode::unknown()
    };
    for (mode, w) in modes.iter().zip(weights) {
        let share = *w / total;
        out.state += mode.state * share;
        out.cross += mode.cross * share;
        out.echo += mode.echo * share;
    }
    for (mode, w) in modes.iter().zip(weights) {
        let d = mode.state - out.state;
        out.covariance += (mode.covariance + d * d.transpose()) * (*w / total);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const TURN: TurnRate<f64> = TurnRate {
        std_rad_s: 0.1,
        time_s: 20.0,
    };
    const STRAIGHT: Motion<f64> = Motion {
        turns: false,
        acceleration_noise_density: 0.2,
    };
    const TURNING: Motion<f64> = Motion {
        turns: true,
        acceleration_noise_density: 0.4,
    };

    fn belief(
        shift: f64,
    ) -> (
        TargetState<f64>,
        TargetCovariance<f64>,
        CrossCovariance<f64>,
    ) {
        let state = TargetState::from([10.0 + shift, 2.0, -5.0, 3.0 - shift, 0.05]);
        let p = TargetCovariance::from_diagonal(&TargetState::from([4.0, 1.0, 5.0, 1.0, 0.01]));
        let x = CrossCovariance::from_fn(|i, j| 0.1 * (i as f64) - 0.05 * (j as f64) + shift);
        (state, p, x)
    }

    #[test]
    fn one_model_is_a_kalman_prediction() {
        let models = Models {
            motions: [TURNING],
            dwell_s: [10.0],
            turn: TURN,
        };
        let (x, p, cross) = belief(0.0);
        let echo = EchoCovariance::from_fn(|i, j| 0.02 * (i as f64) - 0.03 * (j as f64));
        let mut imm = Imm::new(&models, x, p, cross, echo);
        imm.predict(&models, 1.5, &Vector3::new(0.9, 0.8, 0.7), 0.6);
        let (next, f) = TURNING.predict(&x, &TURN, 1.5);
        let mode = imm.estimate();
        assert_relative_eq!(mode.probability, 1.0, epsilon = 1e-12);
        assert_relative_eq!(mode.state, next, epsilon = 1e-12);
        let expected = f * p * f.transpose() + TURNING.noise(&TURN, 1.5);
        assert_relative_eq!(mode.covariance, expected, epsilon = 1e-12);
        let faded = nalgebra::Matrix3::from_diagonal(&Vector3::new(0.9, 0.8, 0.7));
        assert_relative_eq!(mode.cross, f * cross * faded, epsilon = 1e-12);
        assert_relative_eq!(mode.echo, f * echo * 0.6, epsilon = 1e-12);
    }

    #[test]
    fn mixing_keeps_the_moments_and_the_total_probability() {
        let models = Models {
            motions: [STRAIGHT, TURNING],
            dwell_s: [30.0, 10.0],
            turn: TURN,
        };
        let (xa, pa, ca) = belief(0.0);
        let (xb, pb, cb) = belief(1.0);
        let echo = EchoCovariance::from_fn(|i, j| 0.1 * (i as f64) - 0.05 * (j as f64));
        let mut imm = Imm::new(&models, xa, pa, ca, echo);
        imm.modes[1] = Mode {
            probability: 0.25,
            state: xb,
            covariance: pb,
            cross: cb,
            echo: echo * 3.0,
        };
        imm.modes[0].probability = 0.75;
        let before = imm.estimate();
        assert_relative_eq!(before.state, xa * 0.75 + xb * 0.25, epsilon = 1e-12);
        assert_relative_eq!(before.cross, ca * 0.75 + cb * 0.25, epsilon = 1e-12);
        assert_relative_eq!(before.echo, echo * 1.5, epsilon = 1e-12);
        imm.mix(&models, 2.0);
        let after = imm.estimate();
        assert_relative_eq!(after.probability, 1.0, epsilon = 1e-12);
        assert_relative_eq!(after.state, before.state, epsilon = 1e-12);
        assert_relative_eq!(after.covariance, before.covariance, epsilon = 1e-12);
        assert_relative_eq!(after.cross, before.cross, epsilon = 1e-12);
        assert_relative_eq!(after.echo, before.echo, epsilon = 1e-12);
        let stays = 0.75 * f64::exp(-2.0 / 30.0) + 0.25 * (1.0 - f64::exp(-2.0 / 10.0));
        assert_relative_eq!(imm.modes[0].probability, stays, epsilon = 1e-12);
    }

    #[test]
    fn a_model_without_probability_keeps_its_belief() {
        let models = Models {
            motions: [STRAIGHT, TURNING],
            dwell_s: [f64::INFINITY, f64::INFINITY],
            turn: TURN,
        };
        let (x, p, cross) = belief(0.0);
        let mut imm = Imm::new(&models, x, p, cross, EchoCovariance::zeros());
        imm.modes[0].probability = 1.0;
        imm.modes[1].probability = 0.0;
        imm.predict(&models, 1.0, &Vector3::repeat(1.0), 0.0);
        assert!(imm.is_valid());
        assert_relative_eq!(imm.modes[1].probability, 0.0);
    }
}
