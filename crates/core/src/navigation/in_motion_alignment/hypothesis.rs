//! One hypothesis of the heading: an anchor before the window, a point to be linear about, and what the fixes say of it.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, sections 3 to 5.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::estimate::{Estimate, Mean, Triangle};
use super::window::{Fit, Interval, Linearization, pass, position_variance};
use super::{ALIGNMENT_ERRORS, CORRELATED, Covariance, InMotionAlignmentConfig, LATE};
use crate::geometry::{rotation, so3};
use crate::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, GnssPosition, GnssVelocity, POSITION, VELOCITY,
};
use crate::restorable::{InvalidState, finite};
use crate::scalar::{Scalar, lit};

/// Standard deviation of a height that is not measured, m.
const UNKNOWN_HEIGHT_STD: f64 = 100.0;
/// Standard deviation of a hypothesis's heading as a share of half the distance to the next one.
const OVERLAP: f64 = 1.15;

/// A hypothesis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Hypothesis<T: Scalar> {
    /// Before the window, with all that has left it.
    pub(super) anchor: Estimate<T>,
    about: Linearization<T>,
    /// Log evidence of what has left the window.
    pub(super) departed: T,
    /// Log evidence of everything.
    pub(super) log_evidence: T,
    /// At the newest fix.
    pub(super) end: Estimate<T>,
    /// Mean NIS of the window for a component.
    pub(super) nis: T,
}

/// The attitude that a mean specific force at rest belongs to, heading zero.
pub(super) fn levelled<T: Scalar>(force: &Vector3<T>) -> UnitQuaternion<T> {
    let roll = (-force.y).atan2(-force.z);
    let across = (force.y * force.y + force.z * force.z).sqrt();
    rotation::from_yaw_pitch_roll([T::zero(), force.x.atan2(across), roll])
}

impl<T: Scalar> Hypothesis<T> {
    /// The one of number `k` of `count`, evenly around the horizon, at the first position.
    pub(super) fn first(
        level: &UnitQuaternion<T>,
        k: usize,
        count: usize,
        fix: &GnssPosition<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Self {
        let step = T::two_pi() / lit(count.max(1) as f64);
        let heading = Vector3::z() * (step * lit(k as f64));
        let mean = Mean {
            ned_from_body: so3::exp(&heading) * level,
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            gnss_offset: Vector3::zeros(),
            lateness: config.position_latency_s,
        };
        let heading_std = step * lit(0.5 * OVERLAP);
        let none = Covariance::<T>::zeros();
        let estimate = Estimate {
            mean,
            covariance: Triangle::of(&none),
        };
        let mut made = Self {
            anchor: estimate,
            about: Linearization::at(&mean),
            departed: T::zero(),
            log_evidence: T::zero(),
            end: estimate,
            nis: T::zero(),
        };
        let speed = Vector3::repeat(config.speed_std_m_s);
        made.begin(fix, &Vector3::zeros(), &speed, heading_std, config);
        made
    }

    /// Sets the anchor (W10): the first position, and a velocity with its standard deviations.
    fn begin(
        &mut self,
        fix: &GnssPosition<T>,
        velocity: &Vector3<T>,
        velocity_std: &Vector3<T>,
        heading_std: T,
        config: &InMotionAlignmentConfig<T>,
    ) {
        let mean = &mut self.anchor.mean;
        let arm = mean.ned_from_body * Vector3::from(config.lever_arm_m);
        mean.velocity = *velocity;
        mean.position = velocity * mean.lateness - arm;
        let tilt = config.levelling_acceleration_m_s2 / config.gravity;
        let attitude = Vector3::new(tilt, tilt, heading_std).map(|s| s * s);
        let swung = so3::skew(&arm) * Matrix3::from_diagonal(&attitude);
        let late = config.time_offset_std_s * config.time_offset_std_s;
        let slow = fix.std * config.position_correlated_fraction;
        let white = position_variance(&fix.std, velocity, T::one(), config);
        let position = swung * so3::skew(&arm).transpose() + velocity * velocity.transpose() * late;

        let mut p = Covariance::<T>::zeros();
        set(&mut p, POSITION, ATTITUDE, &swung);
        set(&mut p, POSITION, POSITION, &position);
        for i in 0..3 {
            let slow = slow[i] * slow[i];
            p[(ATTITUDE + i, ATTITUDE + i)] = attitude[i];
            p[(VELOCITY + i, VELOCITY + i)] = velocity_std[i] * velocity_std[i];
            p[(POSITION + i, POSITION + i)] += white[i] + slow;
            p[(ACCELEROMETER_BIAS + i, ACCELEROMETER_BIAS + i)] =
                config.accelerometer_bias_std * config.accelerometer_bias_std;
            p[(GYROSCOPE_BIAS + i, GYROSCOPE_BIAS + i)] =
                config.gyroscope_bias_std * config.gyroscope_bias_std;
            p[(CORRELATED + i, CORRELATED + i)] = slow;
            p[(POSITION + i, CORRELATED + i)] = -slow;
            p[(CORRELATED + i, POSITION + i)] = -slow;
            p[(POSITION + i, LATE)] = velocity[i] * late;
            p[(LATE, POSITION + i)] = velocity[i] * late;
        }
        p[(LATE, LATE)] = late;
        if !fix.has_height {
            p[(POSITION + 2, POSITION + 2)] += lit(UNKNOWN_HEIGHT_STD * UNKNOWN_HEIGHT_STD);
        }
        self.anchor.covariance = Triangle::of(&p);
        self.end = self.anchor;
    }

    /// Sets the anchor again with a velocity of the first instant.
    pub(super) fn begin_with_velocity(
        &mut self,
        fix: &GnssPosition<T>,
        velocity: &GnssVelocity<T>,
        config: &InMotionAlignmentConfig<T>,
    ) {
        let mut std = velocity.std;
        let mut ned = velocity.ned;
        if !velocity.has_vertical {
            (ned.z, std.z) = (T::zero(), config.speed_std_m_s);
        }
        let heading_std = self.heading_variance().sqrt();
        self.begin(fix, &ned, &std, heading_std, config);
    }

    /// Sets the anchor again with the velocity that the first two positions and the samples between them have.
    pub(super) fn begin_with_second(
        &mut self,
        first: &GnssPosition<T>,
        second: &Interval<T>,
        config: &InMotionAlignmentConfig<T>,
    ) {
        let t = second.inertial.duration_s();
        let mean = &self.anchor.mean;
        let increment = second
            .inertial
            .corrected(&mean.accelerometer_bias, &mean.gyroscope_bias);
        let arm = Vector3::from(config.lever_arm_m);
        let swing = mean.ned_from_body * (increment.rotation * arm - arm);
        let driven = mean.ned_from_body * increment.position
            + Vector3::z() * (config.gravity * t * t * lit(0.5));
        let mut velocity = (second.position.ned - first.ned - swing - driven) / t;
        if !(first.has_height && second.position.has_height) {
            velocity.z = T::zero();
        }
        let heading_std = self.heading_variance().sqrt();
        let speed = Vector3::repeat(config.speed_std_m_s);
        self.begin(first, &velocity, &speed, heading_std, config);
    }

    fn heading_variance(&self) -> T {
        self.anchor.covariance.variance(ATTITUDE + 2)
    }

    /// One Gauss-Newton step over the window (W11, W12); with `full` its first interval is then part of the anchor.
    /// `None`: the numbers have failed.
    pub(super) fn step(
        &mut self,
        intervals: &[Interval<T>],
        full: bool,
        scale: T,
        config: &InMotionAlignmentConfig<T>,
    ) -> Option<Fit<T>> {
        let pass = pass(&self.anchor, &self.about, intervals, scale, config)?;
        self.end = pass.end;
        self.log_evidence = self.departed + pass.fit.log_evidence;
        self.nis = pass.fit.nis;
        let mut ahead = intervals;
        if full {
            let (anchor, evidence) = pass.second;
            self.anchor = anchor;
            self.departed += evidence;
            ahead = intervals.get(1..).unwrap_or_default();
        }
        self.about = Linearization::carried_back(&self.end.mean, ahead);
        Some(pass.fit)
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        self.anchor.check()?;
        self.end.check()?;
        self.about.check()?;
        finite("evidence", [&self.departed, &self.log_evidence, &self.nis])
    }
}

/// Sets a block and its mirror image.
fn set<T: Scalar>(p: &mut Covariance<T>, row: usize, column: usize, block: &Matrix3<T>) {
    const { assert!(ALIGNMENT_ERRORS > 18) };
    for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
        p[(row + i, column + j)] = block[(i, j)];
        p[(column + j, row + i)] = block[(i, j)];
    }
}
