//! What a receiver measures, as a GNSS/INS takes it: position and velocity, each with latency, noise and weight.

use nalgebra::Vector3;

use super::updates::FASTEST_M_S;
use super::{Aid, ERRORS, ErrorListener, GnssIns, ImuSamples};
use crate::kalman::innovation::check_vector;
use crate::kalman::{Innovation, SkipReason};
use crate::navigation::aiding::gnss_position::{self, GnssPosition};
use crate::navigation::aiding::gnss_velocity::{self, GnssVelocity};
use crate::navigation::augmented_states::{GNSS_OFFSET, TIME_OFFSET};
use crate::navigation::error_state::SparseMeasurement;
use crate::scalar::{Scalar, lit, seconds};

/// Positions further than this from the origin (m) are not on this Earth, and with a larger standard deviation (m) no fixes.
const FURTHEST_M: f64 = 2e7;
const LARGEST_STD_M: f64 = 1e6;
/// Largest share of the stated standard deviation.
const LARGEST_SHARE: f64 = 100.0;
/// How much larger the floor of a height is: satellites are seen on one side only.
const VERTICAL_FLOOR: f64 = 2.5;
/// A receiver's velocity (m/s) below which it stands, beside its noise, and for how long after (ns).
const RECEIVER_STANDS_M_S: f64 = 0.1;
const RECEIVER_STANDS_NS: i64 = 700_000_000;

/// What a position told, horizontally and vertically: each has its own weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssPositionUpdate<T> {
    /// North and east, m.
    pub horizontal: Innovation<T>,
    /// Down, m.
    pub vertical: Innovation<T>,
}

/// How the stated standard deviation of a position divides: what changes from fix to fix, and what goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorShares<T> {
    /// Share that changes from fix to fix.
    pub white: T,
    /// Share that goes on, as errors of orbits, clocks and the air do.
    pub slow: T,
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Takes a position.
    pub fn gnss_position(&mut self, time_ns: i64, fix: &GnssPosition<T>) -> GnssPositionUpdate<T> {
        let shares = ErrorShares {
            white: self.config.position_uncorrelated_fraction,
            slow: self.config.position_correlated_fraction,
        };
        self.gnss_position_with(time_ns, fix, shares)
    }

    /// Takes a position whose error has other shares than those of the settings.
    pub fn gnss_position_with(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
    ) -> GnssPositionUpdate<T> {
        let checked = check_fix(&fix.ned, &fix.std, [FURTHEST_M, LARGEST_STD_M])
            .and_then(|()| shares.check())
            .and_then(|()| self.accept(Aid::GnssPosition, time_ns));
        let update = match checked.and_then(|()| self.use_position(time_ns, fix, shares)) {
            Ok(update) => update,
            Err(reason) => GnssPositionUpdate {
                horizontal: Innovation::skipped(reason),
                vertical: Innovation::skipped(reason),
            },
        };
        self.memory.counts[Aid::GnssPosition as usize].count(&update.horizontal);
        self.memory.counts[Aid::GnssHeight as usize].count(&update.vertical);
        if update.horizontal.outcome.is_fused() {
            self.memory.since_velocity = T::zero();
            self.note_speed(time_ns);
            self.memory.last_fix_ns = Some(time_ns);
        }
        update
    }

    fn use_position(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
    ) -> Result<GnssPositionUpdate<T>, SkipReason> {
        let has_imu = self.config.imu_samples != ImuSamples::None;
        // The very same digits again: a receiver that stands, or one that is frozen.
        let repeated = self.is_repeated(fix);
        self.memory.frozen = repeated && (self.memory.frozen || self.is_frozen());
        if has_imu && (self.memory.frozen || self.is_told_again(time_ns, repeated)) {
            return Err(SkipReason::Repeated);
        }
        if self.memory.aligning && has_imu {
            return Ok(self.align_with_position(time_ns, fix, shares));
        }
        if self.memory.aligning {
            let course_std = self.config.course_std;
            self.memory.level.position(time_ns, fix, course_std);
            self.try_to_start_level();
        }
        self.make_ready()?;
        let update = self.fuse_position(time_ns, fix, shares, repeated);
        if has_imu && !repeated && self.judge(time_ns, &update) {
            self.align_again(time_ns, fix, shares);
        }
        Ok(update)
    }

    /// Whether a position is the last one, which a table tells in every row until the next comes.
    fn is_told_again(&mut self, time_ns: i64, repeated: bool) -> bool {
        let last_ns = self.memory.last_position_ns.replace(time_ns);
        let held = &mut self.memory.held_fixes;
        held.advance(last_ns.map_or_else(T::zero, |last_ns| seconds(last_ns, time_ns)));
        held.is_told_again(repeated)
    }

    pub(super) fn fuse_position(
        &mut self,
        time_ns: i64,
        fix: &GnssPosition<T>,
        shares: ErrorShares<T>,
        repeated: bool,
    ) -> GnssPositionUpdate<T> {
        let floor = self.config.position_std_floor_m;
        let floor = Vector3::new(floor, floor, floor * lit(VERTICAL_FLOOR));
        let [flat, high, _] = self.memory.noise_scale;
        let scale = Vector3::new(flat, flat, high);
        let std = fix.std.zip_map(&floor, |stated, floor| stated.max(floor));
        // What is correlated does not show from fix to fix: it may be larger than stated, never smaller.
        let slow = std.component_mul(&scale.map(|s| s.max(T::one()))) * shares.slow;
        self.follow_slow_error(&slow);
        let white = std.component_mul(&scale) * shares.white;
        let variance = self.uncorrelated_variance(&white);
        let horizontal = {
            let m = self.position_rows(time_ns, &fix.ned, &variance, [0, 1]);
            self.fuse_weighted(&m, Aid::GnssPosition, repeated)
        };
        let vertical = if fix.has_height {
            let m = self.position_rows(time_ns, &fix.ned, &variance, [2]);
            self.fuse_weighted(&m, Aid::GnssHeight, repeated)
        } else {
            Innovation::skipped(SkipReason::NotUsed)
        };
        GnssPositionUpdate {
            horizontal,
            vertical,
        }
    }

    fn position_rows<const M: usize>(
        &self,
        time_ns: i64,
        ned: &Vector3<T>,
        variance: &Vector3<T>,
        components: [usize; M],
    ) -> SparseMeasurement<T, M> {
        let latency = self.config.position_latency_s + self.memory.side.values[TIME_OFFSET];
        let then = self.instant(time_ns, latency);
        let arm = Vector3::from(self.config.lever_arm_m);
        let offset = self.memory.side.values.fixed_rows::<3>(GNSS_OFFSET);
        gnss_position::measurement(&then, &offset.into(), &arm, ned, variance, components)
    }

    /// Holds the receiver's slow error to the standard deviation that it states now. When that falls by half
    /// (a float solution that is fixed), the error of before is over.
    fn follow_slow_error(&mut self, slow_std: &Vector3<T>) {
        for i in 0..3 {
            let (variance, before) = (slow_std[i] * slow_std[i], self.memory.slow_variance[i]);
            // The first fix after a start from a known state, or an error that is over.
            let is_new = before <= T::zero() && variance > T::zero();
            if is_new || variance < before * lit(0.25) {
                self.start_side(GNSS_OFFSET + i, T::zero(), variance);
            } else if variance > before {
                self.memory.side.covariance[(GNSS_OFFSET + i, GNSS_OFFSET + i)] +=
                    variance - before;
            }
            self.memory.slow_variance[i] = variance;
        }
    }

    /// Takes a velocity.
    pub fn gnss_velocity(&mut self, time_ns: i64, fix: &GnssVelocity<T>) -> Innovation<T> {
        let checked = check_fix(&fix.ned, &fix.std, [FASTEST_M_S; 2])
            .and_then(|()| self.accept(Aid::GnssVelocity, time_ns));
        if checked.is_ok() {
            let slow = lit::<T>(RECEIVER_STANDS_M_S) + fix.std.max();
            let stands = fix.ned.norm() < slow;
            self.memory.stands_until_ns =
                stands.then(|| time_ns.saturating_add(RECEIVER_STANDS_NS));
        }
        let innovation = match checked.and_then(|()| self.use_velocity(time_ns, fix)) {
            Ok(innovation) => innovation,
            Err(reason) => Innovation::skipped(reason),
        };
        self.memory.counts[Aid::GnssVelocity as usize].count(&innovation);
        if innovation.outcome.is_fused() {
            self.memory.since_velocity = T::zero();
        }
        innovation
    }

    fn use_velocity(
        &mut self,
        time_ns: i64,
        fix: &GnssVelocity<T>,
    ) -> Result<Innovation<T>, SkipReason> {
        let has_imu = self.config.imu_samples != ImuSamples::None;
        let repeated = self.memory.last_velocity.replace(fix.ned) == Some(fix.ned);
        if repeated && has_imu && fix.ned.norm_squared() > T::zero() {
            return Err(SkipReason::Repeated);
        }
        if self.memory.aligning && has_imu {
            return Ok(self.align_with_velocity(time_ns, fix));
        }
        if self.memory.aligning {
            let course_std = self.config.course_std;
            self.memory.level.velocity(time_ns, fix, course_std);
        }
        self.make_ready()?;
        Ok(self.fuse_velocity(time_ns, fix))
    }

    pub(super) fn fuse_velocity(&mut self, time_ns: i64, fix: &GnssVelocity<T>) -> Innovation<T> {
        let latency = self.config.velocity_latency_s + self.memory.side.values[TIME_OFFSET];
        let then = self.instant(time_ns, latency);
        let arm = Vector3::from(self.config.lever_arm_m);
        let floor = self.config.velocity_std_floor_m_s;
        let [.., scale] = self.memory.noise_scale;
        let std = fix.std.map(|s| s.max(floor)) * scale;
        let variance = std.component_mul(&std);
        if fix.has_vertical {
            let m = gnss_velocity::measurement(&then, &arm, &fix.ned, &variance, [0, 1, 2]);
            self.fuse_weighted(&m, Aid::GnssVelocity, false)
        } else {
            let m = gnss_velocity::measurement(&then, &arm, &fix.ned, &variance, [0, 1]);
            self.fuse_weighted(&m, Aid::GnssVelocity, false)
        }
    }
}

impl<T: Scalar> ErrorShares<T> {
    /// Both from 0 to [`LARGEST_SHARE`], and the first above 0.
    fn check(&self) -> Result<(), SkipReason> {
        let most = lit(LARGEST_SHARE);
        if !(self.white.is_finite() && self.slow.is_finite()) {
            Err(SkipReason::NotFinite)
        } else if self.white > T::zero()
            && self.white <= most
            && self.slow >= T::zero()
            && self.slow <= most
        {
            Ok(())
        } else {
            Err(SkipReason::OutOfRange)
        }
    }
}

fn check_fix<T: Scalar>(
    ned: &Vector3<T>,
    std: &Vector3<T>,
    [furthest, largest]: [f64; 2],
) -> Result<(), SkipReason> {
    check_vector(ned, T::zero(), lit(furthest))?;
    check_vector(std, T::zero(), lit(largest))?;
    let positive = std.iter().all(|s| *s > T::zero());
    positive.then_some(()).ok_or(SkipReason::OutOfRange)
}
