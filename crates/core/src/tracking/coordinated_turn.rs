//! Coordinated-turn motion model: a circle at constant speed, and straight motion in the same five states.
//!
//! Read first: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation* (2001), section 11.7; `docs/derivations/association.md`, section 2.
//!
//! When to use: targets that turn. When not: a target seen so rarely that a turn is over before the
//! next detection; constant velocity with more noise is then as good.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `x` | `[north, north velocity, east, east velocity, turn rate]` | m, m/s, m, m/s, rad/s |
//! | `q` | [`Motion::acceleration_noise_density`] | m/s^2/sqrt(Hz) |
//! | `tau`, `sigma_w` | [`TurnRate`]: first-order Gauss-Markov turn rate, in both models | s, rad/s |
//!
//! The turn rate is a state of the straight model too, where it moves nothing. Models can then be
//! mixed without inventing states, and the turning model gets its own turn rate back.

use nalgebra::{SMatrix, SVector};

use crate::scalar::{Scalar, lit, polynomial};

/// States of a target: north, north velocity, east, east velocity, turn rate.
pub const STATES: usize = 5;
/// A target's state vector.
pub type TargetState<T> = SVector<T, STATES>;
/// A target's covariance.
pub type TargetCovariance<T> = SMatrix<T, STATES, STATES>;

/// How the turn rate of a target varies (first-order Gauss-Markov): `dw = -w / tau dt + noise`, with a fixed stationary
/// standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct TurnRate<T> {
    /// Stationary standard deviation, rad/s: how fast targets turn when they turn.
    pub std_rad_s: T,
    /// How long a turn lasts, s.
    pub time_s: T,
}

/// A motion model.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Motion<T> {
    /// Whether the turn rate bends the path (coordinated turn) or not (constant velocity).
    pub turns: bool,
    /// White acceleration noise on each axis, m/s^2/sqrt(Hz). Raising it follows manoeuvres faster
    /// and smooths less.
    pub acceleration_noise_density: T,
}

/// The four integrals of a turn by `a = w dt` and their derivatives by `w`.
struct Turn<T> {
    cos: T,
    sin: T,
    /// `sin(a) / w`
    along: T,
    /// `(1 - cos(a)) / w`
    across: T,
    along_by_rate: T,
    across_by_rate: T,
}

impl<T: Scalar> Turn<T> {
    fn new(rate: T, dt: T) -> Self {
        let a = rate * dt;
        let (sin, cos) = (a.sin(), a.cos());
        let a2 = a * a;
        if a2 < lit(0.01) {
            // Series: the quotients lose all digits as the path becomes straight.
            Self {
                cos,
                sin,
                along: dt * polynomial(a2, [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0]),
                across: dt * a * polynomial(a2, [0.5, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40_320.0]),
                along_by_rate: dt
                    * dt
                    * a
                    * polynomial(a2, [-1.0 / 3.0, 1.0 / 30.0, -1.0 / 840.0, 1.0 / 45_360.0]),
                across_by_rate: dt
                    * dt
                    * polynomial(a2, [0.5, -1.0 / 8.0, 1.0 / 144.0, -1.0 / 5760.0]),
            }
        } else {
            let versed = T::one() - cos;
            Self {
                cos,
                sin,
                along: sin / rate,
                across: versed / rate,
                along_by_rate: (a * cos - sin) / (rate * rate),
                across_by_rate: (a * sin - versed) / (rate * rate),
            }
        }
    }
}

impl<T: Scalar> Motion<T> {
    /// The state `dt` seconds later without noise, and its Jacobian by the state before.
    pub fn predict(
        &self,
        x: &TargetState<T>,
        turn: &TurnRate<T>,
        dt: T,
    ) -> (TargetState<T>, TargetCovariance<T>) {
        let (vn, ve) = (x[1], x[3]);
        let keep = (-dt / turn.time_s).exp();
        let mut f = TargetCovariance::identity();
        f[(4, 4)] = keep;
        let mut next = *x;
        next[4] = x[4] * keep;
        if self.turns {
            let t = Turn::new(x[4], dt);
            // Bar-Shalom (11.7.1-4), here with heading clockwise from north
            next[0] = x[0] + t.along * vn - t.across * ve;
            next[1] = t.cos * vn - t.sin * ve;
            next[2] = x[2] + t.across * vn + t.along * ve;
            next[3] = t.sin * vn + t.cos * ve;
            f[(0, 1)] = t.along;
            f[(0, 3)] = -t.across;
            f[(2, 1)] = t.across;
            f[(2, 3)] = t.along;
            f[(1, 1)] = t.cos;
            f[(1, 3)] = -t.sin;
            f[(3, 1)] = t.sin;
            f[(3, 3)] = t.cos;
            f[(0, 4)] = t.along_by_rate * vn - t.across_by_rate * ve;
            f[(1, 4)] = -dt * next[3];
            f[(2, 4)] = t.across_by_rate * vn + t.along_by_rate * ve;
            f[(3, 4)] = dt * next[1];
        } else {
            next[0] = x[0] + dt * vn;
            next[2] = x[2] + dt * ve;
            f[(0, 1)] = dt;
            f[(2, 3)] = dt;
        }
        (next, f)
    }

    /// Covariance of the noise that `dt` seconds add: integrated white acceleration on both axes,
    /// and the turn rate's return to its stationary variance.
    pub fn noise(&self, turn: &TurnRate<T>, dt: T) -> TargetCovariance<T> {
        let q = self.acceleration_noise_density * self.acceleration_noise_density;
        let mut noise = TargetCovariance::zeros();
        let (dt2, dt3) = (dt * dt, dt * dt * dt);
        for i in [0, 2] {
            noise[(i, i)] = q * dt3 * lit(1.0 / 3.0);
            noise[(i, i + 1)] = q * dt2 * lit(0.5);
            noise[(i + 1, i)] = noise[(i, i + 1)];
            noise[(i + 1, i + 1)] = q * dt;
        }
        let keep = (-dt / turn.time_s).exp();
        noise[(4, 4)] = turn.std_rad_s * turn.std_rad_s * (T::one() - keep * keep);
        noise
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use num_dual::jacobian;
    use proptest::prelude::*;

    const TURN: TurnRate<f64> = TurnRate {
        std_rad_s: 0.1,
        time_s: 20.0,
    };

    fn lift<D: Scalar>(turns: bool) -> (Motion<D>, TurnRate<D>) {
        let motion = Motion {
            turns,
            acceleration_noise_density: lit(0.1),
        };
        let turn = TurnRate {
            std_rad_s: lit(0.1),
            time_s: lit(20.0),
        };
        (motion, turn)
    }

    proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(26), ..ProptestConfig::default() })]
            #[test]
            fn jacobian_equals_dual_numbers(
                x in prop::array::uniform5(-20.0..20.0f64), scale in prop::sample::select(std::vec![1e-6, 1e-3, 0.003, 0.05]),
                dt in 0.01..5.0f64, turns in any::<bool>(),
            ) {
                let mut x = TargetState::from(x);
                x[4] *= scale;
                let (_, expected) = jacobian(
                    |y| {
                        let (motion, turn) = lift(turns);
                        motion.predict(&y, &turn, lit(dt)).0
                    },
                    &x,
                );
                let (motion, turn) = lift(turns);
                let (_, f) = motion.predict(&x, &turn, dt);
                prop_assert!((f - expected).abs().max() < 1e-8, "{}", f - expected);
            }
        }

    #[test]
    fn a_quarter_turn_ends_a_radius_ahead_and_a_radius_to_the_side() {
        let (motion, _) = lift::<f64>(true);
        let turn = TurnRate {
            std_rad_s: 0.1,
            time_s: 1e12,
        };
        let rate = core::f64::consts::FRAC_PI_2 / 10.0;
        let radius = 5.0 / rate;
        let x = TargetState::from([0.0, 5.0, 0.0, 0.0, rate]);
        let (next, _) = motion.predict(&x, &turn, 10.0);
        let expected = TargetState::from([radius, 0.0, radius, 5.0, rate]);
        assert_relative_eq!(next, expected, epsilon = 1e-9);
    }

    #[test]
    fn noise_of_two_half_steps_equals_one_step() {
        for turns in [false, true] {
            let (motion, _) = lift::<f64>(turns);
            let (_, f) = motion.predict(&TargetState::zeros(), &TURN, 1.0);
            let half = motion.noise(&TURN, 1.0);
            let whole = motion.noise(&TURN, 2.0);
            assert_relative_eq!(f * half * f.transpose() + half, whole, epsilon = 1e-12);
        }
    }
}
