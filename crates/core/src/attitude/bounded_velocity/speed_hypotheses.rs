//! How fast whatever carries the device moves, from a hand to a vehicle: hypotheses with their own tilt, velocity and bias,
//! weighed by their likelihood (multiple models; B11d to B11j).
//!
//! A filter that takes a vehicle for a hand takes its acceleration for tilt, and is sure of it. It cannot find that out from
//! its own velocity, which it holds near zero. Hypotheses that look at the velocity only every two seconds can: they integrate
//! freely between two looks, so what the wrong one predicts does not happen.
//!
//! A gyroscope's bias that steps looks like a vehicle to them: what is known of the bias is known too well to follow. So one more is a hand
//! whose bias drifts; where it is the likeliest, the bias has stepped, and the filter takes it over.

use nalgebra::{Matrix2x3, RowVector3, SMatrix, SVector, Vector2, Vector3};

use super::config::BoundedVelocityConfig;
use super::propagation::Sums;
use crate::scalar::{Scalar, lit};

/// How many hypotheses there are: three speeds, and a hand whose gyroscope's bias drifts.
const HYPOTHESES: usize = 4;
const DRIFTING: usize = 3;
/// How much faster each speed is than the one before: 0.7, 3.5 and 17.5 m/s.
const FASTER: f64 = 5.0;
/// Time between two looks at the velocity, s.
const LOOK_S: f64 = 2.0;
/// The hypotheses have looked, one with each update, by this share of it.
const LOOKING: f64 = 0.25;
/// Weights of the slowest and of each faster one before anything is known, relative to that of the drifting bias.
const SLOWEST_WEIGHT: f64 = 0.7;
const FASTER_WEIGHT: f64 = 0.15;
/// How long it takes to get out of one and into another, s.
const STAYS_S: f64 = 3600.0;
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
    /// `sum f dt`, m/s, east and north.
    force: Vector2<T>,
    /// The same upwards.
    up: T,
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
    /// Of the angle's noise, rad^2.
    angle_variance: T,
    /// Of the velocity's, (m/s)^2.
    velocity_variance: T,
}

impl<T: Scalar> Interval<T> {
    fn new() -> Self {
        Self {
            time: T::zero(),
            force: Vector2::zeros(),
            up: T::zero(),
            turned: Vector2::zeros(),
            pushed: Vector2::zeros(),
            bias: Vector3::zeros(),
            rotation: Matrix2x3::zeros(),
            swept: Matrix2x3::zeros(),
            angle_variance: T::zero(),
            velocity_variance: T::zero(),
        }
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.force.iter().chain(&self.turned).chain(&self.pushed);
        let matrices = self.rotation.iter().chain(&self.swept);
        let scalars = [
            &self.time,
            &self.up,
            &self.angle_variance,
            &self.velocity_variance,
        ];
        vectors.chain(matrices).chain(&self.bias).chain(scalars)
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
    /// Of its last look, the logarithm.
    likelihood: T,
}

/// What the filter should have gone by until now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Likeliest<T: Scalar> {
    /// It is faster than it was.
    Faster(Hypothesis<T>),
    /// The bias of the gyroscope has stepped.
    Stepped(Hypothesis<T>),
}

impl<T: Scalar> Likeliest<T> {
    /// What is estimated under it, brought up to now.
    fn now(mut self, interval: &Interval<T>) -> Self {
        let (Self::Faster(h) | Self::Stepped(h)) = &mut self;
        h.predict(interval);
        self
    }

    /// What is estimated under it without a magnetometer (B11k): its tilt, velocity and level bias, and of the bias about the vertical
    /// `up` (body axes), of which it knows nothing, the filter's estimate with its `variance` ((rad/s)^2). A step there is expected to be
    /// as large as those of the two axes that show theirs.
    pub(super) fn without_vertical_bias(self, up: &Vector3<T>, variance: T) -> Hypothesis<T> {
        let (mut hypothesis, is_step) = match self {
            Self::Faster(h) => (h, false),
            Self::Stepped(h) => (h, true),
        };
        hypothesis.forget_bias_about(up);
        let mut expected = variance;
        if is_step {
            let level = hypothesis.x.fixed_rows::<3>(BIAS).norm_squared();
            expected += level * lit(0.5);
        }
        for i in 0..3 {
            for j in 0..3 {
                hypothesis.p[(BIAS + i, BIAS + j)] += up[i] * up[j] * expected;
            }
        }
        hypothesis
    }

    /// What is estimated under it.
    pub(super) const fn hypothesis(self) -> Hypothesis<T> {
        let (Self::Faster(h) | Self::Stepped(h)) = self;
        h
    }
}

/// The hypotheses.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SpeedHypotheses<T: Scalar> {
    hypotheses: [Hypothesis<T>; HYPOTHESES],
    likeliest: u8,
    interval: Interval<T>,
    /// The interval at whose end they look at the velocity, one with each update of the filter: a chip has little time.
    looked_over: Interval<T>,
    /// How many have looked; all of them, if none is on its way.
    looked: u8,
}

/// Standard deviations of the velocity, m/s.
fn speeds<T: Scalar>(config: &BoundedVelocityConfig<T>) -> [T; HYPOTHESES] {
    let hand = config.hand_velocity_std;
    let faster = hand * lit(FASTER);
    [hand, faster, faster * lit(FASTER), hand]
}

/// The weight before anything is known.
fn prior<T: Scalar>(config: &BoundedVelocityConfig<T>, hypothesis: usize) -> T {
    match hypothesis {
        0 => lit(SLOWEST_WEIGHT),
        DRIFTING => config.drifting_bias_weight,
        _ => lit(FASTER_WEIGHT),
    }
}

impl<T: Scalar> SpeedHypotheses<T> {
    /// At a start with these variances of tilt (rad^2) and bias ((rad/s)^2).
    pub(super) fn new(config: &BoundedVelocityConfig<T>, tilt: T, bias: T) -> Self {
        let mut one = Self {
            hypotheses: core::array::from_fn(|k| Hypothesis {
                x: SVector::zeros(),
                p: SMatrix::zeros(),
                weight: prior(config, k),
                likelihood: T::zero(),
            }),
            likeliest: 0,
            interval: Interval::new(),
            looked_over: Interval::new(),
            looked: HYPOTHESES as u8,
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
            .chain(self.looked_over.numbers())
    }

    /// Whether a saved one can be continued from.
    pub(super) fn is_valid(&self) -> bool {
        usize::from(self.likeliest) < DRIFTING && usize::from(self.looked) <= HYPOTHESES
    }

    /// Standard deviation of the velocity, m/s, under the likeliest hypothesis.
    pub fn velocity_std(&self, config: &BoundedVelocityConfig<T>) -> T {
        let speed = speeds(config).into_iter().nth(self.likeliest.into());
        speed.unwrap_or(config.hand_velocity_std)
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
        self.looked = HYPOTHESES as u8;
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

    /// How likely each is; [`Self::set_weights`] gives it back.
    pub(super) fn weights(&self) -> [T; HYPOTHESES] {
        self.hypotheses.map(|h| h.weight)
    }

    pub(super) fn set_weights(&mut self, weights: [T; HYPOTHESES]) {
        for (h, weight) in self.hypotheses.iter_mut().zip(weights) {
            h.weight = weight;
        }
    }

    /// Nothing is known of the velocity any more.
    pub(super) fn forget_velocity(&mut self, config: &BoundedVelocityConfig<T>) {
        while self.is_looking() {
            self.look_once(config);
        }
        for (h, std) in self.hypotheses.iter_mut().zip(speeds(config)) {
            for i in VELOCITY..VELOCITY + 2 {
                h.x[i] = T::zero();
                h.p.row_mut(i).fill(T::zero());
                h.p.column_mut(i).fill(T::zero());
                h.p[(i, i)] = std * std;
            }
        }
        let interval = &mut self.interval;
        interval.force = Vector2::zeros();
        interval.up = T::zero();
        interval.pushed = Vector2::zeros();
        interval.swept = Matrix2x3::zeros();
        interval.velocity_variance = T::zero();
    }

    /// The attitude became less certain by this variance, rad^2.
    pub(super) fn widen(&mut self, variance: T) {
        self.interval.angle_variance += variance;
    }

    /// A specific force (m/s^2, level axes) pushed for `dt` seconds; the rest of it is in [`Self::advance`].
    #[inline]
    pub(super) fn force(&mut self, level: &Vector3<T>, dt: T) {
        self.interval.force += level.xy() * dt;
    }

    /// What the filter has summed since its covariance last took a step.
    #[inline]
    pub(super) fn advance(&mut self, sums: &Sums<T>) {
        let interval = &mut self.interval;
        let rows = sums.rotation.fixed_view::<2, 3>(0, 0);
        let up = sums.velocity.z;
        interval.pushed += interval.turned * up;
        interval.swept += (interval.rotation + rows * lit::<T>(0.5)) * up;
        interval.rotation += rows;
        interval.turned -= rows * interval.bias;
        interval.up += up;
        interval.time += sums.time;
        interval.angle_variance += sums.angle_variance;
        interval.velocity_variance += sums.velocity_variance;
    }

    /// The filter turned its attitude (rad, level axes) and corrected its bias (rad/s).
    #[inline]
    pub(super) fn corrected(&mut self, tilt: &Vector2<T>, bias: &Vector3<T>) {
        self.interval.turned += tilt;
        self.interval.bias += bias;
    }

    /// Whether some have looked at the velocity, and others not yet.
    #[inline]
    fn is_looking(&self) -> bool {
        self.looked < HYPOTHESES as u8
    }

    /// Whether it is time for a look.
    #[inline]
    pub(super) fn is_due(&self) -> bool {
        self.is_looking() || self.interval.time >= lit(LOOK_S)
    }

    /// Whether some look about now: a chip has no time for more.
    #[inline]
    pub(super) fn is_busy(&self) -> bool {
        self.is_due() || self.interval.time < lit(LOOK_S * LOOKING)
    }

    /// The next hypothesis looks at the velocity (B11d to B11j). Gives the likeliest, as it is now, when all have and it is a
    /// faster one than before, or the bias has stepped: the filter was wrong until now. Where a number is not finite, they begin again.
    pub(super) fn look(&mut self, config: &BoundedVelocityConfig<T>) -> Option<Likeliest<T>> {
        if !self.is_looking() {
            self.looked_over = core::mem::replace(&mut self.interval, Interval::new());
            self.looked = 0;
        }
        self.look_once(config);
        if self.is_looking() {
            return None;
        }
        if !self.weigh(config) {
            *self = Self::new(
                config,
                config.maximum_attitude_std * config.maximum_attitude_std,
                config.initial_gyroscope_bias_std * config.initial_gyroscope_bias_std,
            );
            return None;
        }
        self.another(config)
            .map(|likeliest| likeliest.now(&self.interval))
    }

    /// The next one looks.
    fn look_once(&mut self, config: &BoundedVelocityConfig<T>) {
        let (next, over) = (usize::from(self.looked), &self.looked_over);
        let looks = dependent_looks(config, over.time);
        let speeds = speeds(config);
        let mut models = self.hypotheses.iter_mut().zip(speeds).skip(next);
        if let Some((h, std)) = models.next() {
            h.predict(over);
            if next == DRIFTING {
                h.drift(config, over.time);
                h.likelihood = h.log_likelihood([std].iter());
                h.update(std * std);
            } else {
                h.likelihood = h.log_likelihood(speeds.iter().take(next + 1));
                // A hand's looks are independent ones (B11h).
                let looks = if next == 0 { T::one() } else { looks };
                h.update(std * std * looks);
            }
        }
        self.looked = self.looked.saturating_add(1);
    }

    /// Chooses the likeliest; gives it where it is faster than the one before, or where the bias has stepped: it is the hand then.
    fn another(&mut self, config: &BoundedVelocityConfig<T>) -> Option<Likeliest<T>> {
        let (mut best, mut number) = (self.hypotheses[0], 0);
        for (k, h) in (1..).zip(self.hypotheses.iter().skip(1)) {
            if h.weight > best.weight {
                (best, number) = (*h, k);
            }
        }
        if usize::from(number) == DRIFTING {
            // It begins anew from there, and the vehicles go on.
            self.hypotheses[0] = best;
            self.hypotheses[DRIFTING].weight =
                best.weight * prior(config, DRIFTING) * (T::one() - stays(self.looked_over.time));
            self.likeliest = 0;
            return Some(Likeliest::Stepped(best));
        }
        let before = core::mem::replace(&mut self.likeliest, number);
        (number > before).then_some(Likeliest::Faster(best))
    }

    /// Weights by Bayes' rule; each may have changed into any meanwhile (B11g). Gives whether all numbers are finite.
    fn weigh(&mut self, config: &BoundedVelocityConfig<T>) -> bool {
        let stay = stays(self.looked_over.time);
        let lasting = config.velocity_correlation_time_s / self.looked_over.time;
        self.temper(lasting.max(T::one()));
        let first = self.hypotheses[0].likelihood;
        let most = (self.hypotheses.iter()).fold(first, |most, h| most.max(h.likelihood));
        let mut total = T::zero();
        for (k, h) in self.hypotheses.iter_mut().enumerate() {
            let predicted = stay * h.weight + (T::one() - stay) * prior(config, k);
            h.weight = predicted * (h.likelihood - most).exp();
            total += h.weight;
        }
        let mut sum = T::zero();
        for h in &mut self.hypotheses {
            h.weight /= total;
            // One that is not finite makes the sum so.
            sum += h.x.sum() + h.p.sum() + h.weight;
        }
        sum.is_finite()
    }

    /// A vehicle that is slow in one look is slow for about so many `looks`: what speaks against it is one look in so many (B11i).
    fn temper(&mut self, looks: T) {
        let [hand, faster @ .., drifting] = &mut self.hypotheses;
        let mut slow = hand.likelihood;
        if drifting.weight > T::zero() {
            slow = slow.max(drifting.likelihood);
        }
        for h in faster {
            if h.likelihood < slow {
                h.likelihood = slow + (h.likelihood - slow) / looks;
            }
        }
    }
}

/// The chance that a hypothesis is still the right one after so long, s.
fn stays<T: Scalar>(time: T) -> T {
    (-time / lit(STAYS_S)).exp()
}

/// So many looks, `time` apart, at a velocity that lasts are worth one (B11h).
fn dependent_looks<T: Scalar>(config: &BoundedVelocityConfig<T>, time: T) -> T {
    let looks = config.velocity_correlation_time_s * lit(2.0) / time;
    looks.max(T::one())
}

impl<T: Scalar> Hypothesis<T> {
    fn numbers(&self) -> impl Iterator<Item = &T> {
        let scalars = [&self.weight, &self.likelihood];
        self.x.iter().chain(&self.p).chain(scalars)
    }

    /// Takes the bias about an axis (unit vector, body axes) for zero, and for known.
    fn forget_bias_about(&mut self, axis: &Vector3<T>) {
        let along = axis.dot(&self.x.fixed_rows::<3>(BIAS));
        for i in 0..3 {
            self.x[BIAS + i] -= axis[i] * along;
        }
        for c in 0..STATES {
            let along = axis.dot(&self.p.fixed_view::<3, 1>(BIAS, c));
            for i in 0..3 {
                self.p[(BIAS + i, c)] -= axis[i] * along;
            }
        }
        for r in 0..STATES {
            let along = (0..3).fold(T::zero(), |sum, i| sum + axis[i] * self.p[(r, BIAS + i)]);
            for i in 0..3 {
                self.p[(r, BIAS + i)] -= axis[i] * along;
            }
        }
    }

    /// Over an interval between two looks (B11d, B11e).
    fn predict(&mut self, interval: &Interval<T>) {
        // An error about north moves the velocity east, one about east moves it south.
        let pairs = [
            (TILT + 1, VELOCITY, T::one()),
            (TILT, VELOCITY + 1, -T::one()),
        ];
        // The velocity first: it takes the tilt from before.
        for (t, v, sign) in pairs {
            let swept = interval.swept.row(t) * -sign;
            self.add_states(v, interval.up * sign, t, &swept);
        }
        for (t, ..) in pairs {
            self.add_states(t, T::zero(), t, &-interval.rotation.row(t));
        }
        let (up, angle) = (interval.up, interval.angle_variance);
        for (t, v, sign) in pairs {
            self.x[t] -= interval.turned[t];
            self.x[v] += interval.force[v - VELOCITY] - interval.pushed[t] * sign;
            self.p[(t, t)] += angle;
            self.p[(v, v)] += interval.velocity_variance + up * up * angle / lit(3.0);
            let both = up * angle * sign * lit(0.5);
            self.p[(t, v)] += both;
            self.p[(v, t)] += both;
        }
        for c in 0..3 {
            self.x[BIAS + c] -= interval.bias[c];
        }
    }

    /// The bias may have changed meanwhile (B11j).
    fn drift(&mut self, config: &BoundedVelocityConfig<T>, time: T) {
        let variance = config.initial_gyroscope_bias_std * config.initial_gyroscope_bias_std;
        let walk = variance * time / config.drifting_bias_time_s;
        let most = variance * lit(BIAS_FACTOR * BIAS_FACTOR);
        for i in BIAS..STATES {
            let own = self.p[(i, i)];
            self.p[(i, i)] = (own + walk).min(own.max(most));
        }
    }

    /// Adds to state `i` so much of state `other` and of the bias: an elementary step of the transition.
    fn add_states(&mut self, i: usize, factor: T, other: usize, of_bias: &RowVector3<T>) {
        let (x, p) = (&mut self.x, &mut self.p);
        let mut moved = factor * x[other];
        let mut row = p.row(other) * factor;
        for c in 0..3 {
            moved += of_bias[c] * x[BIAS + c];
            row += p.row(BIAS + c) * of_bias[c];
        }
        x[i] += moved;
        // What is added has this variance, and this covariance with each state.
        let mut variance = row[other] * factor;
        for c in 0..3 {
            variance += row[BIAS + c] * of_bias[c];
        }
        let own = p[(i, i)] + row[i] + row[i] + variance;
        for j in 0..STATES {
            let value = p[(i, j)] + row[j];
            p[(i, j)] = value;
            p[(j, i)] = value;
        }
        p[(i, i)] = own;
    }

    /// Log of the likelihood of the velocity, which has one of these standard deviations: who can be fast is often slow (B11f).
    fn log_likelihood<'a>(&self, stds: impl Iterator<Item = &'a T> + Clone) -> T {
        let log = |std: &T| {
            let mut log = T::zero();
            for i in VELOCITY..VELOCITY + 2 {
                let s = self.p[(i, i)] + *std * *std;
                log -= (self.x[i] * self.x[i] / s + s.ln()) * lit(0.5);
            }
            log
        };
        let (mut most, mut count) = (T::min_value().unwrap_or_else(T::zero), T::zero());
        for std in stds.clone() {
            most = most.max(log(std));
            count += T::one();
        }
        let mut sum = T::zero();
        for std in stds {
            sum += (log(std) - most).exp();
        }
        most + (sum / count).ln()
    }

    /// `v = 0` with this variance of each component.
    fn update(&mut self, variance: T) {
        for i in VELOCITY..VELOCITY + 2 {
            let column = self.p.column(i).into_owned();
            let inverse = T::one() / (column[i] + variance);
            self.x -= column * (self.x[i] * inverse);
            for c in 0..STATES {
                let gain = column[c] * inverse;
                for r in 0..=c {
                    let value = self.p[(r, c)] - column[r] * gain;
                    self.p[(r, c)] = value;
                    self.p[(c, r)] = value;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
