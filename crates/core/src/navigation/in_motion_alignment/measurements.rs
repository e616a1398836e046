//! Measurements of the in-motion alignment: positions, velocities and headings, and where it begins from one.

use nalgebra::Vector3;

use super::bank::Bank;
use super::window::{Interval, SeenHeading};
use super::{AlignmentUpdate, DOUBTED_FROM, InMotionAlignment, MOST_DISAGREEING};
use crate::kalman::{Innovation, SkipReason};
use crate::navigation::preintegration::Preintegration;
use crate::navigation::{GnssPosition, GnssVelocity};
use crate::scalar::{Scalar, lit};

/// Where a position may be, m from the origin in each direction.
const FARTHEST_M: f64 = 2e7;
/// A position that states more says nothing, m; a velocity, m/s.
const LARGEST_STD: f64 = 1e3;
/// Speed (m/s) that no fix's distance from the last can have been travelled with.
const FASTEST_M_S: f64 = 1e3;
/// So many impossible positions in a row are where it begins again.
const IMPOSSIBLE_IN_A_ROW: u32 = 3;
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
        if off.norm() > t.max(T::one()) * lit(FASTEST_M_S) {
            self.memory.impossible = self.memory.impossible.saturating_add(1);
            if self.memory.impossible >= IMPOSSIBLE_IN_A_ROW {
                self.begin_again(&fix);
            }
            return AlignmentUpdate::skipped(SkipReason::OutOfRange);
        }
        self.memory.impossible = 0;
        self.use_position(&fix)
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
            position,
            velocity: None,
        });
        let full = memory.window.is_full();
        let fit = bank.run(memory.window.intervals(), full, &self.config);
        let (Some(fit), Some(best)) = (fit, bank.best()) else {
            self.begin_again(fix);
            return AlignmentUpdate::skipped(SkipReason::Numerical);
        };
        let end = &best.end.mean;
        memory.since = Preintegration::new(end.accelerometer_bias, end.gyroscope_bias);
        if full {
            memory.window.drop_first();
        }
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
            heading,
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
        let scale = memory.bank.as_ref().map_or(T::one(), |bank| bank.scale);
        memory.forget_window();
        memory.bank = Some(Bank::new(&memory.force, fix, scale, &self.config));
    }

    fn begin_again(&mut self, fix: &GnssPosition<T>) {
        self.memory.restarts = self.memory.restarts.saturating_add(1);
        self.begin(fix);
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
