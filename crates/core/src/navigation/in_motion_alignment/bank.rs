//! The bank: hypotheses beside each other, their evidence, and the mixture that they are.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 5 (W16-W19).

mod division;

use nalgebra::{Matrix3, Vector3};

use super::estimate::{Mean, at_receiver_time, propagate};
use super::hypothesis::{AttitudePrior, Hypothesis};
use super::window::{Fit, Interval};
use super::{AlignmentSolution, Covariance, ErrorVector, InMotionAlignmentConfig};
use crate::geometry::so3;
use crate::navigation::preintegration::Preintegration;
use crate::navigation::{ATTITUDE, GnssPosition, GnssVelocity, VELOCITY};
use crate::restorable::{InvalidState, expect, finite};
use crate::scalar::{Scalar, lit};

/// Fixes after the first before hypotheses are dropped or merged.
const FIXES_BEFORE_PRUNING: u32 = 3;
/// Fixes before the receiver's scale is learnt.
const FIXES_BEFORE_SCALE: u32 = 5;
/// Fixes before the heading can count as known.
const FIXES_BEFORE_END: u32 = 4;
/// Tilt (rad) within which hypotheses are the same, ...
const SAME_TILT: f64 = 0.05;
/// ... and the least and the most that their headings may differ by for that, rad.
const SAME_HEADING: [f64; 2] = [0.03, 0.075];
/// Log odds of an attitude that is known otherwise against one of the others: positions jump more often than attitudes.
const LOG_ODDS_OF_PRIOR: f64 = 8.0;
/// How much of the mean NIS's excess goes into the logarithm of the scale at a fix.
const SCALE_GAIN: f64 = 0.15;

/// The hypotheses; the first `count` are in use, the best one first.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Bank<T: Scalar, const K: usize> {
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))]
    pub(super) hypotheses: [Hypothesis<T>; K],
    pub(super) count: usize,
    /// Where positions inside count from, m, NED.
    pub(super) origin: Vector3<T>,
    /// The first position, relative to it, with its standard deviations as the receiver's scale has made them.
    pub(super) first: GnssPosition<T>,
    /// Positions used after the first.
    pub(super) fixes: u32,
    /// Whether the velocity of its instant was measured.
    has_velocity: bool,
    /// What the stated standard deviations are multiplied by.
    pub(super) scale: T,
}

/// What a bank begins with.
pub(super) struct BankStart<'a, T: Scalar> {
    /// Mean specific force, body axes.
    pub(super) force: &'a Vector3<T>,
    pub(super) fix: &'a GnssPosition<T>,
    /// An attitude that is known otherwise.
    pub(super) prior: Option<&'a AttitudePrior<T>>,
    /// What the receiver's standard deviations are multiplied by.
    pub(super) scale: T,
}

/// How sure the mixture is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread<T> {
    pub(super) heading_std: T,
    pub(super) tilt_std: T,
}

impl<T: Scalar, const K: usize> Bank<T, K> {
    /// One hypothesis for each heading, at a first position; the first may be another one's attitude.
    pub(super) fn new(start: &BankStart<'_, T>, config: &InMotionAlignmentConfig<T>) -> Self {
        let level = super::hypothesis::levelled(start.force);
        let first = GnssPosition {
            ned: Vector3::zeros(),
            std: start.fix.std * start.scale.max(T::one()),
            ..*start.fix
        };
        let known = usize::from(start.prior.is_some());
        let make = |k: usize| {
            let prior = match start.prior {
                Some(prior) if k == 0 => *prior,
                _ => AttitudePrior::heading(&level, k - known, K - known, config),
            };
            let favour = if k < known {
                lit(LOG_ODDS_OF_PRIOR)
            } else {
                T::zero()
            };
            Hypothesis::first(&prior, favour, &first, config)
        };
        Self {
            hypotheses: core::array::from_fn(make),
            count: K,
            origin: start.fix.ned,
            first,
            fixes: 0,
            has_velocity: false,
            scale: start.scale,
        }
    }

    /// Those in use.
    pub(super) fn in_use(&self) -> &[Hypothesis<T>] {
        self.hypotheses.get(..self.count).unwrap_or_default()
    }

    pub(super) fn in_use_mut(&mut self) -> &mut [Hypothesis<T>] {
        self.hypotheses.get_mut(..self.count).unwrap_or_default()
    }

    /// Whether a window holds all fixes behind the first one.
    pub(super) fn is_whole(&self, intervals: &[Interval<T>]) -> bool {
        self.fixes as usize == intervals.len()
    }

    /// The best one.
    pub(super) fn best(&self) -> Option<&Hypothesis<T>> {
        self.in_use().first()
    }

    /// A velocity of the instant of the first position.
    pub(super) fn begin_with_velocity(
        &mut self,
        velocity: &GnssVelocity<T>,
        config: &InMotionAlignmentConfig<T>,
    ) {
        let first = self.first;
        self.has_velocity = true;
        for hypothesis in self.in_use_mut() {
            hypothesis.begin_with_velocity(&first, velocity, config);
        }
    }

    /// One step of every hypothesis, with a new fix in the window, and what the best one made of it. With `full` the
    /// window's first interval is then part of the anchors. `None`: no hypothesis is left.
    pub(super) fn run(
        &mut self,
        intervals: &[Interval<T>],
        full: bool,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Fit<T>> {
        self.fixes = self.fixes.saturating_add(1);
        if let (1, false, Some(second)) = (self.fixes, self.has_velocity, intervals.first()) {
            let first = self.first;
            for hypothesis in self.in_use_mut() {
                hypothesis.begin_with_second(&first, second, config);
            }
        }
        let scale = self.scale;
        let mut best: Option<(T, Fit<T>)> = None;
        let mut kept = 0;
        for i in 0..self.count {
            let Some(hypothesis) = self.hypotheses.get_mut(i) else {
                break;
            };
            let Some(fit) = hypothesis.step(intervals, full, scale, config) else {
                continue;
            };
            let evidence = hypothesis.log_evidence;
            if best.as_ref().is_none_or(|(most, _)| evidence > *most) {
                best = Some((evidence, fit));
            }
            self.hypotheses.swap(kept, i);
            kept += 1;
        }
        self.count = kept;
        let (_, fit) = best?;
        self.order();
        if self.fixes >= FIXES_BEFORE_PRUNING {
            self.prune(config);
            let ahead = intervals.get(usize::from(full)..).unwrap_or_default();
            self.divide(ahead, config);
        }
        self.count_evidence_from_the_best();
        if self.fixes >= FIXES_BEFORE_SCALE {
            let scale = self.scale * (fit.excess.min(lit(2.0)) * lit(SCALE_GAIN)).exp();
            self.scale = scale
                .max(config.least_noise_scale)
                .min(config.largest_noise_scale);
        }
        Some(fit)
    }

    /// Best first.
    pub(super) fn order(&mut self) {
        let all = self.in_use_mut();
        for i in 1..all.len() {
            let mut j = i;
            while j > 0 && all[j].log_evidence > all[j - 1].log_evidence {
                all.swap(j, j - 1);
                j -= 1;
            }
        }
    }

    /// Drops the hypotheses far behind the best, and those that have become the same as a better one.
    fn prune(&mut self, config: &InMotionAlignmentConfig<T>) {
        let Some(least) = self.best().map(|best| best.log_evidence) else {
            return;
        };
        let least = least - config.drop_log_evidence;
        let mut kept = 0;
        for i in 0..self.count {
            let (before, rest) = self.hypotheses.split_at(kept.min(K));
            let Some(this) = rest.get(i - kept) else {
                break;
            };
            if this.log_evidence > least && !before.iter().any(|other| is_same(this, other)) {
                self.hypotheses.swap(kept, i);
                kept += 1;
            }
        }
        self.count = kept;
    }

    /// Only differences count: the sums must not grow for ever.
    fn count_evidence_from_the_best(&mut self) {
        let Some(departed) = self.best().map(|best| best.departed) else {
            return;
        };
        for hypothesis in self.in_use_mut() {
            hypothesis.departed -= departed;
            hypothesis.log_evidence -= departed;
        }
    }

    /// Weight of a hypothesis against the best (W17).
    fn weight(&self, hypothesis: &Hypothesis<T>, config: &InMotionAlignmentConfig<T>) -> T {
        let best = self
            .best()
            .map_or(hypothesis.log_evidence, |b| b.log_evidence);
        ((hypothesis.log_evidence - best) * config.evidence_power).exp()
    }

    /// Standard deviations of heading and tilt of the mixture about the best hypothesis (W18).
    fn spread(&self, config: &InMotionAlignmentConfig<T>) -> Option<Spread<T>> {
        let best = self.best()?.end.mean.ned_from_body.inverse();
        let (mut total, mut heading, mut tilt) = (T::zero(), T::zero(), T::zero());
        for hypothesis in self.in_use() {
            let weight = self.weight(hypothesis, config);
            let end = &hypothesis.end;
            let variance = |i: usize| end.covariance.variance(ATTITUDE + i);
            let off = so3::log(&(end.mean.ned_from_body * best));
            total += weight;
            heading += weight * (variance(2) + off.z * off.z);
            let level = variance(0).max(variance(1));
            tilt += weight * (level + off.x * off.x + off.y * off.y);
        }
        Some(Spread {
            heading_std: (heading / total).sqrt(),
            tilt_std: (tilt / total).sqrt(),
        })
    }

    /// Whether the heading is known (W19), `loose` times as uncertain as it may be for that.
    pub(super) fn is_aligned(&self, loose: T, config: &InMotionAlignmentConfig<T>) -> bool {
        let (Some(spread), Some(best)) = (self.spread(config), self.best()) else {
            return false;
        };
        self.fixes >= FIXES_BEFORE_END
            && spread.heading_std < config.accepted_heading_std * loose
            && spread.tilt_std < config.accepted_tilt_std * loose
            && best.nis < config.accepted_nis * loose
    }

    /// The mixture (W18), moved on by the samples since the newest fix.
    pub(super) fn solution(
        &self,
        since: &Preintegration<T>,
        slow: &Vector3<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<AlignmentSolution<T>> {
        let spread = self.spread(config)?;
        let mut sum = Moments::zeros();
        let mut attitude = None;
        for hypothesis in self.in_use() {
            let weight = self.weight(hypothesis, config);
            let mut mean = hypothesis.end.mean;
            let mut p = hypothesis.end.covariance.full();
            if since.duration_s() > T::zero() {
                let none = &mut ErrorVector::<T>::zeros();
                propagate(&mut mean, none, &mut p, since, slow, T::zero(), config);
            }
            let (position, covariance) = at_receiver_time(&mean, &p, config.position_latency_s);
            let of_velocity = p.fixed_view::<3, 3>(VELOCITY, VELOCITY).into_owned();
            sum.add(weight, [position, mean.velocity], [covariance, of_velocity]);
            attitude = attitude.or(Some(mean.ned_from_body));
        }
        let [
            (position, position_covariance),
            (velocity, velocity_covariance),
        ] = sum.moments();
        Some(AlignmentSolution {
            ned_from_body: attitude?,
            velocity,
            position: position + self.origin,
            position_covariance,
            velocity_covariance,
            heading_std: spread.heading_std,
            tilt_std: spread.tilt_std,
        })
    }

    /// Mean and covariance of the mixture in all states (W21), moved on likewise; the attitude is that of the best
    /// hypothesis, since headings all around have no mean.
    pub(super) fn moments(
        &self,
        since: &Preintegration<T>,
        slow: &Vector3<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<(Mean<T>, Covariance<T>)> {
        let best = self.best()?.end.mean;
        let (mut total, mut sum) = (T::zero(), ErrorVector::<T>::zeros());
        let mut p = Covariance::<T>::zeros();
        for hypothesis in self.in_use() {
            let weight = self.weight(hypothesis, config);
            let end = &hypothesis.end;
            let off = end.mean.less(&best);
            total += weight;
            sum += off * weight;
            p += (end.covariance.full() + off * off.transpose()) * weight;
        }
        let mut off = sum / total;
        off.fixed_rows_mut::<3>(ATTITUDE).fill(T::zero());
        let mut p = p / total;
        // About the mean: what the attitude is off by on average stays part of its variance.
        p -= off * (sum / total).transpose() + (sum / total) * off.transpose()
            - off * off.transpose();
        let mut mean = best.corrected(&off);
        if since.duration_s() > T::zero() {
            let none = &mut ErrorVector::<T>::zeros();
            propagate(&mut mean, none, &mut p, since, slow, T::zero(), config);
        }
        mean.position += self.origin;
        Some((mean, p))
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        expect(
            "hypotheses",
            (1..=K).contains(&self.count),
            "at least one and no more than there is room for",
        )?;
        self.hypotheses.iter().try_for_each(Hypothesis::check)?;
        let first = self.first.ned.iter().chain(&self.first.std);
        finite("bank", first.chain(&self.origin).chain([&self.scale]))
    }
}

/// Whether two hypotheses have become the same.
fn is_same<T: Scalar>(one: &Hypothesis<T>, other: &Hypothesis<T>) -> bool {
    let [least, most] = SAME_HEADING.map(lit::<T>);
    if one.steps != other.steps && !one.has_biases_of(other) {
        return false;
    }
    let (one, other) = (&one.end, &other.end);
    let off = so3::log(&(one.mean.ned_from_body * other.mean.ned_from_body.inverse()));
    let std = other.covariance.variance(ATTITUDE + 2).sqrt();
    let tilt = lit::<T>(SAME_TILT);
    off.z.abs() < (std * lit(0.5)).min(most).max(least)
        && off.x * off.x + off.y * off.y < tilt * tilt
}

/// Weighted sums of position and velocity, counted from the first that is added.
struct Moments<T: Scalar> {
    weight: T,
    from: Option<[Vector3<T>; 2]>,
    first: [Vector3<T>; 2],
    second: [Matrix3<T>; 2],
}

impl<T: Scalar> Moments<T> {
    fn zeros() -> Self {
        Self {
            weight: T::zero(),
            from: None,
            first: [Vector3::zeros(); 2],
            second: [Matrix3::zeros(); 2],
        }
    }

    fn add(&mut self, weight: T, values: [Vector3<T>; 2], covariances: [Matrix3<T>; 2]) {
        let from = *self.from.get_or_insert(values);
        self.weight += weight;
        for i in 0..2 {
            let off = values[i] - from[i];
            self.first[i] += off * weight;
            self.second[i] += (covariances[i] + off * off.transpose()) * weight;
        }
    }

    /// Means and covariances.
    fn moments(&self) -> [(Vector3<T>, Matrix3<T>); 2] {
        let from = self.from.unwrap_or([Vector3::zeros(); 2]);
        core::array::from_fn(|i| {
            let off = self.first[i] / self.weight;
            let covariance = self.second[i] / self.weight - off * off.transpose();
            (from[i] + off, covariance)
        })
    }
}
