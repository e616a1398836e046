//! How fast whatever carries the device moves, from a hand to a vehicle: hypotheses with their own tilt, velocity and bias,
//! weighed by their likelihood (multiple models; B11d to B11h).
//!
//! A filter that takes a vehicle for a hand takes its acceleration for tilt, and is sure of it. It cannot find that out from
//! its own velocity, which it holds near zero. Hypotheses that look at the velocity only every [`LOOK_S`] can: they integrate
//! freely between two looks, so what the wrong one predicts does not happen.

use nalgebra::{Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::config::BoundedVelocityConfig;
use crate::scalar::{Scalar, lit};

/// How many hypotheses there are.
const HYPOTHESES: usize = 4;
/// How much faster each one is than the one before: 0.7, 2.3, 7.6 and 25 m/s.
const FASTER: f64 = 3.3;
/// Time between two looks at the velocity, s.
const LOOK_S: f64 = 2.0;
/// Weight of the slowest before anything is known; the others share the rest.
const SLOWEST_WEIGHT: f64 = 0.7;
/// How long it takes to get out of one and into another, s.
const STAYS_S: f64 = 300.0;
/// What the priors of tilt and bias are widened by: whoever starts in motion, and phones, have tails.
const TILT_FACTOR: f64 = 2.0;
const BIAS_FACTOR: f64 = 3.0;

/// First states of a hypothesis: tilt (rad, about east and north), velocity (m/s, east and north), bias (rad/s, body axes).
const TILT: usize = 0;
const VELOCITY: usize = 2;
const BIAS: usize = 4;
/// How many states a hypothesis has.
const STATES: usize = 7;

/// What came together since the last look.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Interval<T: Scalar> {
    time: T,
    /// `sum f dt`, m/s, level axes.
    force: Vector3<T>,
    /// How far the filter has turned its attitude by corrections, of its bias, too: rad, about east and north.
    turned: Vector2<T>,
    /// `sum f_up turned dt`, m/s.
    pushed: Vector2<T>,
    /// By how much the filter has corrected its bias, rad/s.
    bias: Vector3<T>,
    /// East and north rows of `sum R dt`, s.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    rotation: Matrix2x3<T>,
    /// `sum f_up rotation dt`, m.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    swept: Matrix2x3<T>,
    /// Of the angle's noise, rad^2, and of the velocity's, (m/s)^2.
    variances: [T; 2],
}

impl<T: Scalar> Interval<T> {
    fn new() -> Self {
        Self {
            time: T::zero(),
            force: Vector3::zeros(),
            turned: Vector2::zeros(),
            pushed: Vector2::zeros(),
            bias: Vector3::zeros(),
            rotation: Matrix2x3::zeros(),
            swept: Matrix2x3::zeros(),
            variances: [T::zero(); 2],
        }
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.force.iter().chain(&self.turned).chain(&self.pushed);
        let matrices = self.rotation.iter().chain(&self.swept);
        let rest = self.bias.iter().chain(&self.variances).chain([&self.time]);
        vectors.chain(matrices).chain(rest)
    }
}

/// What is estimated under one hypothesis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Hypothesis<T: Scalar> {
    /// Tilt and bias as differences from the filter's, and the velocity.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub(super) x: SVector<T, STATES>,
    /// Its covariance.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub(super) p: SMatrix<T, STATES, STATES>,
    weight: T,
}

/// The hypotheses.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SpeedHypotheses<T: Scalar> {
    hypotheses: [Hypothesis<T>; HYPOTHESES],
    likeliest: u8,
    interval: Interval<T>,
}

/// Standard deviations of the velocity, m/s.
fn speeds<T: Scalar>(config: &BoundedVelocityConfig<T>) -> [T; HYPOTHESES] {
    let mut next = config.hand_velocity_std;
    core::array::from_fn(|_| {
        let std = next;
        next *= lit(FASTER);
        std
    })
}

/// Before anything is known.
fn prior<T: Scalar>(hypothesis: usize) -> T {
    lit(match hypothesis {
        0 => SLOWEST_WEIGHT,
        _ => (1.0 - SLOWEST_WEIGHT) / (HYPOTHESES as f64 - 1.0),
    })
}

impl<T: Scalar> SpeedHypotheses<T> {
    /// At a start with these variances of tilt (rad^2) and bias ((rad/s)^2).
    pub(super) fn new(config: &BoundedVelocityConfig<T>, tilt: T, bias: T) -> Self {
        let mut one = Self {
            hypotheses: core::array::from_fn(|k| Hypothesis {
                x: SVector::zeros(),
                p: SMatrix::zeros(),
                weight: prior(k),
            }),
            likeliest: 0,
            interval: Interval::new(),
        };
        let square = |factor: f64| lit::<T>(factor * factor);
        one.agree(
            config,
            tilt * square(TILT_FACTOR),
            bias * square(BIAS_FACTOR),
        );
        one
    }

    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        (self.hypotheses.iter())
            .flat_map(Hypothesis::numbers)
            .chain(self.interval.numbers())
    }

    /// Whether a saved one can be continued from.
    pub(super) fn is_valid(&self) -> bool {
        usize::from(self.likeliest) < HYPOTHESES
    }

    /// Standard deviation of the velocity, m/s, under the likeliest hypothesis.
    pub fn velocity_std(&self, config: &BoundedVelocityConfig<T>) -> T {
        let mut std = config.hand_velocity_std;
        for _ in 0..self.likeliest.min(HYPOTHESES as u8 - 1) {
            std *= lit(FASTER);
        }
        std
    }

    /// Whether the likeliest hypothesis is not the slowest: what does not accelerate may move all the same.
    #[inline]
    pub fn is_vehicle(&self) -> bool {
        self.likeliest > 0
    }

    /// Noise of `velocity is zero` under the likeliest hypothesis where it is not the slowest, m^2/s (B11h).
    #[inline]
    pub(super) fn psd(&self, config: &BoundedVelocityConfig<T>) -> Option<T> {
        (self.likeliest > 0).then(|| {
            let std = self.velocity_std(config);
            std * std * config.velocity_correlation_time_s * lit(2.0)
        })
    }

    /// All agree with the filter about tilt and bias, with these variances; the velocity is unknown. Weights stay.
    pub(super) fn agree(&mut self, config: &BoundedVelocityConfig<T>, tilt: T, bias: T) {
        self.interval = Interval::new();
        for (h, std) in self.hypotheses.iter_mut().zip(speeds(config)) {
            h.x = SVector::zeros();
            h.p = SMatrix::zeros();
            for (first, count, variance) in
                [(TILT, 2, tilt), (VELOCITY, 2, std * std), (BIAS, 3, bias)]
            {
                for i in first..first + count {
                    h.p[(i, i)] = variance;
                }
            }
        }
    }

    /// Nothing is known of the velocity any more.
    pub(super) fn forget_velocity(&mut self, config: &BoundedVelocityConfig<T>) {
        for (h, std) in self.hypotheses.iter_mut().zip(speeds(config)) {
            for i in VELOCITY..VELOCITY + 2 {
                h.x[i] = T::zero();
                h.p.row_mut(i).fill(T::zero());
                h.p.column_mut(i).fill(T::zero());
                h.p[(i, i)] = std * std;
            }
        }
        let interval = &mut self.interval;
        interval.force = Vector3::zeros();
        interval.pushed = Vector2::zeros();
        interval.swept = Matrix2x3::zeros();
        interval.variances[1] = T::zero();
    }

    /// The attitude became less certain by this variance, rad^2.
    pub(super) fn widen(&mut self, variance: T) {
        self.interval.variances[0] += variance;
    }

    /// Over `dt` seconds the attitude was `level_from_body`, and its noise has this variance, rad^2.
    #[inline]
    pub(super) fn rate(&mut self, level_from_body: &Matrix3<T>, dt: T, variance: T) {
        let interval = &mut self.interval;
        interval.time += dt;
        interval.variances[0] += variance;
        let rows = level_from_body.fixed_view::<2, 3>(0, 0) * dt;
        interval.rotation += rows;
        interval.turned -= rows * interval.bias;
    }

    /// Over `dt` seconds the specific force was `level`, level axes, and the velocity's noise has this variance, (m/s)^2.
    #[inline]
    pub(super) fn force(&mut self, level: &Vector3<T>, dt: T, variance: T) {
        let interval = &mut self.interval;
        let up = level.z * dt;
        interval.force += level * dt;
        interval.pushed += interval.turned * up;
        interval.swept += interval.rotation * up;
        interval.variances[1] += variance;
    }

    /// The filter turned its attitude (rad, level axes) and corrected its bias (rad/s).
    #[inline]
    pub(super) fn corrected(&mut self, tilt: &Vector2<T>, bias: &Vector3<T>) {
        self.interval.turned += tilt;
        self.interval.bias += bias;
    }

    /// Whether it is time for a look.
    #[inline]
    pub(super) fn is_due(&self) -> bool {
        self.interval.time >= lit(LOOK_S)
    }

    /// Looks at the velocity (B11d to B11g). Gives the likeliest hypothesis where it is a faster one than before: the filter
    /// was wrong until now. Where a number is not finite, the hypotheses begin again.
    pub(super) fn look(&mut self, config: &BoundedVelocityConfig<T>) -> Option<Hypothesis<T>> {
        let interval = core::mem::replace(&mut self.interval, Interval::new());
        let mut likelihoods = [T::zero(); HYPOTHESES];
        let models = self.hypotheses.iter_mut().zip(speeds(config));
        for (k, ((h, std), log)) in models.zip(&mut likelihoods).enumerate() {
            h.predict(&interval);
            *log = h.log_likelihood(std * std);
            // Looks at a velocity that lasts are no independent ones (B11h); a hand's are.
            let lasts = config.velocity_correlation_time_s * lit(2.0) / interval.time;
            let looks = if k == 0 {
                T::one()
            } else {
                lasts.max(T::one())
            };
            h.update(std * std * looks);
        }
        self.weigh(&likelihoods, interval.time);
        if !self.numbers().all(|n| n.is_finite()) {
            *self = Self::new(
                config,
                config.maximum_attitude_std * config.maximum_attitude_std,
                config.initial_gyroscope_bias_std * config.initial_gyroscope_bias_std,
            );
            return None;
        }
        let before = self.likeliest;
        let mut best = self.hypotheses[0];
        self.likeliest = 0;
        for (k, h) in (1..).zip(self.hypotheses.iter().skip(1)) {
            if h.weight > best.weight {
                best = *h;
                self.likeliest = k;
            }
        }
        (self.likeliest > before).then_some(best)
    }

    /// Weights by Bayes' rule from the logs of the likelihoods, each of which may have changed into any (B11g).
    fn weigh(&mut self, likelihoods: &[T; HYPOTHESES], time: T) {
        let stay = (-time / lit(STAYS_S)).exp();
        let most = likelihoods.iter().fold(likelihoods[0], |a, b| a.max(*b));
        let mut total = T::zero();
        for (k, (h, log)) in self.hypotheses.iter_mut().zip(likelihoods).enumerate() {
            let predicted = stay * h.weight + (T::one() - stay) * prior(k);
            h.weight = predicted * (*log - most).exp();
            total += h.weight;
        }
        for h in &mut self.hypotheses {
            h.weight /= total;
        }
    }
}

impl<T: Scalar> Hypothesis<T> {
    fn numbers(&self) -> impl Iterator<Item = &T> {
        self.x.iter().chain(&self.p).chain([&self.weight])
    }

    /// Over an interval between two looks (B11d, B11e).
    fn predict(&mut self, interval: &Interval<T>) {
        let up = interval.force.z;
        let mut phi = SMatrix::<T, STATES, STATES>::identity();
        // An error about north moves the velocity east, one about east moves it south.
        for (tilt, velocity, sign) in [(1, 0, T::one()), (0, 1, -T::one())] {
            phi[(VELOCITY + velocity, TILT + tilt)] = up * sign;
            for c in 0..3 {
                phi[(TILT + tilt, BIAS + c)] = -interval.rotation[(tilt, c)];
                phi[(VELOCITY + velocity, BIAS + c)] = -interval.swept[(tilt, c)] * sign;
            }
        }
        self.x = phi * self.x;
        self.p = phi * self.p * phi.transpose();
        let [angle, velocity_noise] = interval.variances;
        for (tilt, velocity, sign) in [(1, 0, T::one()), (0, 1, -T::one())] {
            let (t, v) = (TILT + tilt, VELOCITY + velocity);
            self.x[t] -= interval.turned[tilt];
            self.x[v] += interval.force[velocity] - interval.pushed[tilt] * sign;
            self.p[(t, t)] += angle;
            self.p[(v, v)] += velocity_noise + up * up * angle / lit(3.0);
            let both = up * angle * sign * lit(0.5);
            self.p[(t, v)] += both;
            self.p[(v, t)] += both;
        }
        for c in 0..3 {
            self.x[BIAS + c] -= interval.bias[c];
        }
    }

    /// Log of the likelihood of the velocity, whose components have this variance (B11f).
    fn log_likelihood(&self, variance: T) -> T {
        let mut log = T::zero();
        for i in VELOCITY..VELOCITY + 2 {
            let s = self.p[(i, i)] + variance;
            log -= (self.x[i] * self.x[i] / s + s.ln()) * lit(0.5);
        }
        log
    }

    /// `v = 0` with this variance of each component.
    fn update(&mut self, variance: T) {
        for i in VELOCITY..VELOCITY + 2 {
            let column = self.p.column(i).into_owned();
            let s = column[i] + variance;
            self.x -= column * (self.x[i] / s);
            self.p -= column * (column / s).transpose();
        }
        let transposed = self.p.transpose();
        self.p = (self.p + transposed) * lit::<T>(0.5);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const GRAVITY: f64 = 9.81;

    /// Feeds `seconds` of a level device that is carried with this acceleration eastwards, by a filter that takes the share
    /// `believed` of it for a tilt within a second; which hypothesis is the likeliest at each look.
    fn carried(
        hypotheses: &mut SpeedHypotheses<f64>,
        seconds: f64,
        acceleration: impl Fn(f64) -> f64,
        bias: f64,
    ) -> Vec<u8> {
        let config = BoundedVelocityConfig::<f64>::lab();
        let (dt, mut likeliest, mut tilted) = (0.01, Vec::new(), 0.0_f64);
        for k in 0..(seconds / dt) as u32 {
            let a = acceleration(f64::from(k) * dt);
            // A bias about north tilts what the filter thinks is level.
            tilted += bias * dt;
            let level = Vector3::new(a - GRAVITY * tilted, 0.0, GRAVITY);
            hypotheses.rate(&Matrix3::identity(), dt, 1e-6 * dt);
            hypotheses.force(&level, dt, 1e-4 * dt);
            if hypotheses.is_due() {
                hypotheses.look(&config);
                likeliest.push(hypotheses.likeliest);
            }
        }
        likeliest
    }

    fn fresh() -> SpeedHypotheses<f64> {
        let config = BoundedVelocityConfig::<f64>::lab();
        SpeedHypotheses::new(&config, 0.03_f64.powi(2), 0.005_f64.powi(2))
    }

    #[test]
    fn a_hand_is_a_hand_and_a_car_is_none() {
        let mut h = fresh();
        let hand = carried(&mut h, 20.0, |t| 3.0 * (5.0 * t).sin(), 0.0);
        assert!(hand.iter().all(|k| *k == 0), "{hand:?}");
        // From there into a car that gets to 20 m/s in 10 s and stays at it.
        let speed = carried(&mut h, 30.0, |t| if t < 10.0 { 2.0 } else { 0.0 }, 0.0);
        assert!(speed.iter().skip(3).all(|k| *k >= 1), "{speed:?}");
    }

    #[test]
    fn a_bias_is_learnt_and_is_no_vehicle() {
        let mut h = fresh();
        let sway = |t: f64| 2.0 * (4.0 * t).sin();
        let likeliest = carried(&mut h, 30.0, sway, 0.01);
        let last = &likeliest[5..];
        assert!(last.iter().all(|k| *k == 0), "{likeliest:?}");
        let learnt = h.hypotheses[0].x[BIAS + 1];
        assert!((learnt + 0.01).abs() < 1e-3, "{learnt}");
    }

    #[test]
    fn what_the_filter_corrects_is_not_seen_twice() {
        let config = BoundedVelocityConfig::<f64>::lab();
        let (mut free, mut held) = (fresh(), fresh());
        // A tilt about north of 0.02: free, and with a filter that finds it after half a second.
        let tilt = 0.02;
        for k in 0..200 {
            let level = |tilt: f64| Vector3::new(-GRAVITY * tilt, 0.0, GRAVITY);
            let found = k >= 50;
            if k == 50 {
                held.corrected(&Vector2::new(0.0, tilt), &Vector3::zeros());
            }
            for (h, tilt) in [
                (&mut free, tilt),
                (&mut held, if found { 0.0 } else { tilt }),
            ] {
                h.rate(&Matrix3::identity(), 0.01, 1e-8);
                h.force(&level(tilt), 0.01, 1e-6);
            }
        }
        free.look(&config);
        held.look(&config);
        for (a, b) in free.hypotheses.iter().zip(&held.hypotheses) {
            assert!((a.x[VELOCITY] - b.x[VELOCITY]).abs() < 1e-9);
            assert!((a.x[TILT + 1] - tilt - b.x[TILT + 1]).abs() < 1e-9);
            assert!((a.p - b.p).amax() < 1e-12);
        }
    }
}
