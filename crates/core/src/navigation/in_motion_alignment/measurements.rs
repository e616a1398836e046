//! Measurements of the in-motion alignment: positions, velocities and headings, and where it begins from one.

use nalgebra::Vector3;

use super::bank::{Bank, BankStart};
use super::hypothesis::AttitudePrior;
use super::window::{HeadingSource, Interval, SeenHeading};
use super::{AlignmentUpdate, DOUBTED_FROM, InMotionAlignment, MOST_DISAGREEING};
use crate::kalman::covariance::normalized_square3;
use crate::kalman::innovation::check_vector;
use crate::kalman::{Innovation, SkipReason};
use crate::navigation::preintegration::Preintegration;
use crate::navigation::{ATTITUDE, GnssPosition, GnssVelocity, NavigationState};
use crate::scalar::{Scalar, lit};

/// Where a position may be, m from the origin in each direction.
const FARTHEST_M: f64 = 2e7;
/// A position that states more says nothing, m; a velocity, m/s.
const LARGEST_STD: f64 = 1e3;
/// Speed (m/s) that no fix's distance from the last can have been travelled with.
const FASTEST_M_S: f64 = 1e3;
/// Distance by the time since the last position that was used (m/s) up to which two impossible ones lie together: what is faster waits
/// a little longer.
const TOGETHER_M_S: f64 = 100.0;
/// So many impossible positions in a row are where it begins again.
const IMPOSSIBLE_IN_A_ROW: u32 = 3;
/// ... and so many against fewer than five.
const IMPOSSIBLE_AFTER_FEW: u32 = 2;
const FEW_FIXES: u32 = 5;
/// Among so many first positions a NIS of more says that one of them is wrong.
const EARLY_FIXES: u32 = 5;
const CONTRADICTING_NIS: f64 = 100.0;
/// Each first fix in a row that the second contradicts doubles the speed that is possible, so many times at most.
const MOST_DOUBLINGS: u32 = 3;
/// A tilt less certain than this (rad) is beyond all linearisation: down is better known from the force alone.
const LOST_TILT_STD: f64 = 0.7;
/// NIS of three components beyond which a position disagrees: one in thirty does by chance.
const DISAGREEING_NIS: f64 = 8.7;
/// Least specific force that shows where down is, as a fraction of gravity.
const LEAST_FORCE: f64 = 0.2;
/// How much more uncertain than accepted the heading may become before it counts as unknown again.
const HYSTERESIS: f64 = 1.5;

impl<T: Scalar, const HYPOTHESES: usize, const WINDOW: usize>
    InMotionAlignment<T, HYPOTHESES, WINDOW>
{
    /// Uses a position of this instant. The first one, once level is known, begins the bank and is skipped as not
    /// initialised; one sooner after the last than [`shortest_interval_s`](super::InMotionAlignmentConfig::shortest_interval_s) is skipped as not due.
    pub fn gnss_position(&mut self, fix: &GnssPosition<T>) -> AlignmentUpdate<T> {
        let fix = match self.checked_position(fix) {
            Ok(fix) => fix,
            Err(reason) => return AlignmentUpdate::skipped(reason),
        };
        let Some(bank) = &self.memory.bank else {
            self.begin(&fix);
            return AlignmentUpdate::skipped(SkipReason::NotInitialized);
        };
        let t = self.memory.since.duration_s();
        if t < self.config.shortest_interval_s || t <= T::zero() {
            return AlignmentUpdate::skipped(SkipReason::NotDue);
        }
        // Nothing can have travelled there: no noise, another place. Student's weight would do, but for the first fix.
        let from = bank
            .best()
            .map_or(bank.origin, |best| best.end.mean.position + bank.origin);
        let off = if fix.has_height {
            fix.ned - from
        } else {
            (fix.ned - from).xy().push(T::zero())
        };
        let fixes = bank.fixes;
        let impossible = off.norm() > t.max(T::one()) * lit(FASTEST_M_S);
        if impossible || (fixes < EARLY_FIXES && self.contradicts(&fix)) {
            let memory = &mut self.memory;
            // Whenever it began again so far, it was for this.
            let is_first = fixes == 0 && memory.restarts == memory.impossible;
            if is_first {
                // One of two is wrong, and a receiver that wakes up tells first where it was.
                let times = memory.impossible.saturating_add(1);
                self.begin_again(&fix);
                self.memory.impossible = times;
                return AlignmentUpdate::skipped(SkipReason::OutOfRange);
            }
            // Gross errors do not lie together, fixes of another place do.
            let apart = (fix.ned - memory.impossible_ned).xy().norm();
            if apart > t.max(T::one()) * lit(TOGETHER_M_S) {
                memory.impossible = 0;
            }
            memory.impossible_ned = fix.ned;
            memory.impossible = memory.impossible.saturating_add(1);
            let needed = if fixes < FEW_FIXES {
                IMPOSSIBLE_AFTER_FEW
            } else {
                IMPOSSIBLE_IN_A_ROW
            };
            if self.memory.impossible >= needed {
                self.begin_again(&fix);
            }
            return AlignmentUpdate::skipped(SkipReason::OutOfRange);
        }
        self.memory.impossible = 0;
        self.use_position(&fix)
    }

    /// Whether a position is beyond all noise: of the first few one can be wrong, and too few are there to outvote it.
    fn contradicts(&self, fix: &GnssPosition<T>) -> bool {
        let Some(solution) = self.solution() else {
            return false;
        };
        let mut expected = solution.position_covariance;
        let mut off = fix.ned - solution.position;
        for i in 0..3 {
            expected[(i, i)] += fix.std[i] * fix.std[i];
        }
        if !fix.has_height {
            off.z = T::zero();
        }
        // What moves so fast contradicts its first fix again and again.
        let is_second = self
            .memory
            .bank
            .as_ref()
            .is_some_and(|bank| bank.fixes == 0);
        let doublings = if is_second {
            self.memory.impossible.min(MOST_DOUBLINGS)
        } else {
            0
        };
        let limit = lit::<T>(CONTRADICTING_NIS) * lit(f64::from(1_u32 << (2 * doublings)));
        normalized_square3(&off, &expected).is_none_or(|nis| nis > limit)
    }

    /// The position with its standard deviations held to the floor, and without what was not measured.
    fn checked_position(&self, fix: &GnssPosition<T>) -> Result<GnssPosition<T>, SkipReason> {
        let mut made = *fix;
        if !fix.has_height {
            made.ned.z = T::zero();
            made.std.z = T::one();
        }
        check_measured(&made.ned, &made.std, lit(FARTHEST_M))?;
        let floor = self.config.position_std_floor_m;
        made.std = made.std.map(|s| s.max(floor));
        Ok(made)
    }

    fn use_position(&mut self, fix: &GnssPosition<T>) -> AlignmentUpdate<T> {
        let memory = &mut self.memory;
        let Some(bank) = &mut memory.bank else {
            return AlignmentUpdate::skipped(SkipReason::NotInitialized);
        };
        let mut position = *fix;
        position.ned -= bank.origin;
        if !fix.has_height {
            position.ned.z = T::zero();
        }
        memory.window.push(Interval {
            inertial: memory.since,
            angular_rate: memory.angular_rate,
            heading: memory.heading.take(),
            rate_at_rest: memory.rate_at_rest.take(),
            position,
            velocity: None,
            outlier_std: T::zero(),
        });
        let full = memory.window.is_full();
        let fit = bank.run(memory.window.intervals(), full, &self.config);
        let Some(fit) = fit else {
            self.begin_again(fix);
            return AlignmentUpdate::skipped(SkipReason::Numerical);
        };
        if full {
            memory.window.drop_first(1);
        }
        memory.explain(&fit, &self.config);
        let Some(bank) = &mut memory.bank else {
            return AlignmentUpdate::skipped(SkipReason::NotInitialized);
        };
        let Some(best) = bank.best() else {
            return AlignmentUpdate::skipped(SkipReason::Numerical);
        };
        let end = &best.end.mean;
        let [roll, pitch] = [0, 1].map(|i| best.end.covariance.variance(ATTITUDE + i));
        let tilt = roll.max(pitch).sqrt();
        if end.velocity.norm() > lit(FASTEST_M_S) || tilt > lit(LOST_TILT_STD) {
            self.begin_again(fix);
            return AlignmentUpdate::skipped(SkipReason::NotInitialized);
        }
        memory.since = Preintegration::new(end.accelerometer_bias, end.gyroscope_bias);
        let loose = if memory.is_aligned {
            lit(HYSTERESIS)
        } else {
            T::one()
        };
        memory.is_aligned = bank.is_aligned(loose, &self.config);
        let [(position, p), (velocity, v), (heading, h)] = fit.newest;
        let components = lit::<T>(f64::from(position.degrees_of_freedom) / 3.0);
        memory.disagreeing = if position.nis > components * lit(DISAGREEING_NIS) {
            memory.disagreeing.saturating_add(1)
        } else {
            memory.disagreeing.saturating_sub(1)
        };
        memory.is_aligned &= memory.disagreeing < DOUBTED_FROM;
        if memory.disagreeing >= MOST_DISAGREEING {
            self.begin_again(fix);
        }
        AlignmentUpdate {
            position,
            velocity,
            heading,
            weights: [p, v, h],
        }
    }

    /// Uses a velocity of this instant: it is fused with the position of the same instant, and is refused as not due
    /// where there is none. Give it after the position. A latency of its own is not made up for.
    pub fn gnss_velocity(&mut self, fix: &GnssVelocity<T>) -> Innovation<T> {
        let mut fix = *fix;
        if !fix.has_vertical {
            fix.ned.z = T::zero();
            fix.std.z = T::one();
        }
        if let Err(reason) = check_measured(&fix.ned, &fix.std, lit(FASTEST_M_S)) {
            return Innovation::skipped(reason);
        }
        let floor = self.config.velocity_std_floor_m_s;
        fix.std = fix.std.map(|s| s.max(floor));
        let memory = &mut self.memory;
        let Some(bank) = &mut memory.bank else {
            return Innovation::skipped(SkipReason::NotInitialized);
        };
        if memory.since.duration_s() > T::zero() {
            return Innovation::skipped(SkipReason::NotDue);
        }
        if bank.fixes == 0 {
            bank.begin_with_velocity(&fix, &self.config);
        } else if let Some(newest) = memory.window.newest_mut() {
            newest.velocity = Some(fix);
        }
        Innovation::skipped(SkipReason::Accumulated)
    }

    /// Uses a true heading (rad, clockwise from north) of the body's forward axis, of this instant, with its standard
    /// deviation: one more measurement of every hypothesis, that takes effect with the next position. Of several in an
    /// interval the last counts.
    pub fn heading(&mut self, heading: T, std: T) -> Innovation<T> {
        let known = Vector3::new(heading, T::zero(), T::zero());
        if let Err(reason) = check_measured(&known, &Vector3::repeat(std), lit(10.0)) {
            return Innovation::skipped(reason);
        }
        self.see_heading(HeadingSource::Heading(heading), std)
    }

    /// Uses a magnetic field (body axes, of any unit) as a heading, likewise: `declination` (rad, east positive) is that
    /// of the place, `std` (rad) the heading's standard deviation with all that iron does.
    pub fn magnetic_field(&mut self, field: &Vector3<T>, declination: T, std: T) -> Innovation<T> {
        let known = Vector3::new(declination, T::zero(), T::zero());
        let checked = check_measured(&known, &Vector3::repeat(std), lit(10.0))
            .and_then(|()| check_vector(field, lit(1e-6), lit(1e6)));
        match checked {
            Ok(()) => self.see_heading(HeadingSource::MagneticField(*field, declination), std),
            Err(reason) => Innovation::skipped(reason),
        }
    }

    /// Uses a mean angular rate (rad/s, as measured) of a time in which the body stood, with its variance, as the
    /// gyroscope's bias: one more measurement, that takes effect with the next position. Of several in an interval the last
    /// counts.
    pub fn rate_at_rest(&mut self, mean_rate: &Vector3<T>, variance: T) -> Innovation<T> {
        let checked = check_measured(mean_rate, &Vector3::repeat(variance), lit(10.0));
        if let Err(reason) = checked {
            return Innovation::skipped(reason);
        }
        if self.memory.bank.is_none() {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        if variance <= T::zero() {
            return Innovation::skipped(SkipReason::OutOfRange);
        }
        self.memory.rate_at_rest = Some((*mean_rate, variance));
        Innovation::skipped(SkipReason::Accumulated)
    }

    fn see_heading(&mut self, source: HeadingSource<T>, std: T) -> Innovation<T> {
        let memory = &mut self.memory;
        if memory.bank.is_none() {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        if std <= T::zero() {
            return Innovation::skipped(SkipReason::OutOfRange);
        }
        // What the bias is off by has turned it since the interval began.
        let turned = memory.since.duration_s() * self.config.gyroscope_bias_std;
        memory.heading = Some(SeenHeading {
            turned: memory.since.increment().rotation,
            source,
            variance: std * std + turned * turned,
        });
        Innovation::skipped(SkipReason::Accumulated)
    }

    /// Begins a bank at a position, if level is known; what has been learnt of the receiver's noise stays.
    fn begin(&mut self, fix: &GnssPosition<T>) {
        let memory = &mut self.memory;
        let force = memory.force.norm();
        if memory.levelled_s < self.config.levelling_time_s
            || force <= self.config.gravity * lit(LEAST_FORCE)
        {
            memory.forget_window();
            return;
        }
        let scale = memory.bank.as_ref().map_or(memory.scale, |bank| bank.scale);
        let prior = memory.prior.take();
        memory.forget_window();
        let start = BankStart {
            force: &memory.force,
            fix,
            prior: prior.as_ref(),
            scale,
        };
        memory.bank = Some(Bank::new(&start, &self.config));
    }

    fn begin_again(&mut self, fix: &GnssPosition<T>) {
        // Its own attitude is no prior: the fixes that disagree have bent it.
        self.memory.restarts = self.memory.restarts.saturating_add(1);
        self.begin(fix);
    }

    /// Begins anew with the next position. The attitude and the biases of `state`, less certain than stated, are one more
    /// hypothesis: it wins where the position alone was wrong. What is known of the level stays.
    pub(in crate::navigation) fn begin_from(&mut self, state: &NavigationState<T>, scale: T) {
        let memory = &mut self.memory;
        memory.forget_window();
        memory.restarts = memory.restarts.saturating_add(1);
        memory.scale = scale;
        memory.prior = Some(AttitudePrior::of_state(state).loosened());
    }
}

/// Refuses what cannot have been measured.
fn check_measured<T: Scalar>(
    value: &Vector3<T>,
    std: &Vector3<T>,
    largest: T,
) -> Result<(), SkipReason> {
    if !value.iter().chain(std).all(|x| x.is_finite()) {
        return Err(SkipReason::NotFinite);
    }
    let possible = value.iter().all(|x| x.abs() <= largest)
        && std
            .iter()
            .all(|s| *s >= T::zero() && *s <= lit(LARGEST_STD));
    possible.then_some(()).ok_or(SkipReason::OutOfRange)
}
