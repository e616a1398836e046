//! One hypothesis of the heading: an anchor before the window, a point to be linear about, and what the fixes say of it.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, sections 3 to 5.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::estimate::{Estimate, Mean, Triangle};
use super::window::{Fit, Interval, Learnt, Linearization, pass, position_variance};
use super::{ALIGNMENT_ERRORS, CORRELATED, Covariance, InMotionAlignmentConfig, LATE};
use crate::geometry::{rotation, so3};
use crate::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, GnssPosition, GnssVelocity, NavigationState,
    POSITION, STATES, VELOCITY,
};
use crate::restorable::{InvalidState, covariance, finite, unit};
use crate::scalar::{Scalar, lit};

/// Standard deviation of a height that is not measured, m.
const UNKNOWN_HEIGHT_STD: f64 = 100.0;
/// Standard deviation of a hypothesis's heading as a share of half the distance to the next one.
pub(super) const OVERLAP: f64 = 1.15;

/// First of the errors of attitude, accelerometer and gyroscope bias.
const ATTITUDE_AND_BIASES: [usize; 3] = [ATTITUDE, ACCELEROMETER_BIAS, GYROSCOPE_BIAS];
/// What comes to the standard deviations of an attitude from before, rad: tilt, tilt, heading.
const LOOSENED_STD: [f64; 3] = [0.02, 0.02, 0.1];

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
    pub(super) about: Linearization<T>,
    /// Log evidence of what has left the window.
    pub(super) departed: T,
    /// Log evidence of everything.
    pub(super) log_evidence: T,
    /// At the newest fix.
    pub(super) end: Estimate<T>,
    /// Mean NIS of the window for a component.
    pub(super) nis: T,
    /// Which biases have stepped: two bits a step, the newest last.
    pub(super) steps: u8,
}

/// Attitude and biases that a hypothesis begins with.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct AttitudePrior<T: Scalar> {
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub(super) ned_from_body: UnitQuaternion<T>,
    accelerometer_bias: Vector3<T>,
    gyroscope_bias: Vector3<T>,
    /// Of attitude, accelerometer and gyroscope bias.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub(super) covariance: SMatrix<T, 9, 9>,
}

/// The attitude that a mean specific force at rest belongs to, heading zero.
pub(super) fn levelled<T: Scalar>(force: &Vector3<T>) -> UnitQuaternion<T> {
    let roll = (-force.y).atan2(-force.z);
    let across = (force.y * force.y + force.z * force.z).sqrt();
    rotation::from_yaw_pitch_roll([T::zero(), force.x.atan2(across), roll])
}

impl<T: Scalar> AttitudePrior<T> {
    /// Heading number `k` of `count`, evenly around the horizon.
    pub(super) fn heading(
        level: &UnitQuaternion<T>,
        k: usize,
        count: usize,
        config: &InMotionAlignmentConfig<T>,
    ) -> Self {
        let step = T::two_pi() / lit(count.max(1) as f64);
        let heading = Vector3::z() * (step * lit(k as f64));
        let tilt = config.levelling_acceleration_m_s2 / config.gravity;
        let (force, rate) = (config.accelerometer_bias_std, config.gyroscope_bias_std);
        let std = [
            tilt,
            tilt,
            step * lit(0.5 * OVERLAP),
            force,
            force,
            force,
            rate,
            rate,
            rate,
        ];
        let variances = SVector::from(std.map(|s| s * s));
        Self {
            ned_from_body: so3::exp(&heading) * level,
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance: SMatrix::from_diagonal(&variances),
        }
    }

    /// That of a navigation state.
    pub(super) fn of_state(state: &NavigationState<T>) -> Self {
        Self {
            ned_from_body: state.ned_from_body,
            accelerometer_bias: state.accelerometer_bias,
            gyroscope_bias: state.gyroscope_bias,
            covariance: attitude_and_biases(&state.covariance),
        }
    }

    /// Less certain than stated: something was wrong.
    pub(super) fn loosened(mut self) -> Self {
        self.covariance *= lit::<T>(4.0);
        for (i, std) in LOOSENED_STD.into_iter().enumerate() {
            self.covariance[(i, i)] += lit(std * std);
        }
        self
    }

    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("attitude of before", &self.ned_from_body)?;
        let biases = self.accelerometer_bias.iter().chain(&self.gyroscope_bias);
        finite("biases of before", biases)?;
        covariance("covariance of before", &self.covariance)
    }
}

/// Covariance of attitude and biases out of that of all errors.
fn attitude_and_biases<T: Scalar, const N: usize>(p: &SMatrix<T, N, N>) -> SMatrix<T, 9, 9> {
    let place = |i: usize| ATTITUDE_AND_BIASES[i / 3] + i % 3;
    SMatrix::from_fn(|i, j| p[(place(i), place(j))])
}

impl<T: Scalar> Hypothesis<T> {
    /// One with the attitude and biases of `prior` at the first position, ahead of others by the log odds `favour`.
    pub(super) fn first(
        prior: &AttitudePrior<T>,
        favour: T,
        fix: &GnssPosition<T>,
        config: &InMotionAlignmentConfig<T>,
    ) -> Self {
        let mean = Mean {
            ned_from_body: prior.ned_from_body,
            velocity: Vector3::zeros(),
            position: Vector3::zeros(),
            accelerometer_bias: prior.accelerometer_bias,
            gyroscope_bias: prior.gyroscope_bias,
            gnss_offset: Vector3::zeros(),
            lateness: config.position_latency_s,
        };
        let estimate = Estimate {
            mean,
            covariance: Triangle::of(&Covariance::<T>::zeros()),
        };
        let mut made = Self {
            anchor: estimate,
            about: Linearization::at(&mean),
            departed: favour,
            log_evidence: favour,
            end: estimate,
            nis: T::zero(),
            steps: 0,
        };
        let speed = Vector3::repeat(config.speed_std_m_s);
        made.begin(fix, &Vector3::zeros(), &speed, &prior.covariance, config);
        made
    }

    /// Sets the anchor (W10): the first position, a velocity with its standard deviations, and the covariance of attitude
    /// and biases.
    fn begin(
        &mut self,
        fix: &GnssPosition<T>,
        velocity: &Vector3<T>,
        velocity_std: &Vector3<T>,
        prior: &SMatrix<T, 9, 9>,
        config: &InMotionAlignmentConfig<T>,
    ) {
        let mean = &mut self.anchor.mean;
        let arm = mean.ned_from_body * Vector3::from(config.lever_arm_m);
        mean.velocity = *velocity;
        mean.position = velocity * mean.lateness - arm;
        let late = config.time_offset_std_s * config.time_offset_std_s;
        let slow = fix.std * config.position_correlated_fraction;
        let white = position_variance(&fix.std, velocity, T::one(), config);
        // The antenna was measured: what the attitude is off by swings the unit about it.
        let swung = so3::skew(&arm) * prior.fixed_rows::<3>(0);
        let own = swung.fixed_columns::<3>(0) * so3::skew(&arm).transpose()
            + velocity * velocity.transpose() * late;

        let mut p = Covariance::<T>::zeros();
        for (i, row) in ATTITUDE_AND_BIASES.into_iter().enumerate() {
            for (j, column) in ATTITUDE_AND_BIASES.into_iter().enumerate() {
                let block = prior.fixed_view::<3, 3>(3 * i, 3 * j);
                p.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
            }
            set(
                &mut p,
                POSITION,
                row,
                &swung.fixed_columns::<3>(3 * i).into_owned(),
            );
        }
        set(&mut p, POSITION, POSITION, &own);
        for i in 0..3 {
            let slow = slow[i] * slow[i];
            p[(VELOCITY + i, VELOCITY + i)] = velocity_std[i] * velocity_std[i];
            p[(POSITION + i, POSITION + i)] += white[i] + slow;
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

    /// Covariance of attitude and biases in the anchor.
    fn prior_covariance(&self) -> SMatrix<T, 9, 9> {
        attitude_and_biases(&self.anchor.covariance.full())
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
        let prior = self.prior_covariance();
        self.begin(fix, &ned, &std, &prior, config);
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
        let prior = self.prior_covariance();
        let speed = Vector3::repeat(config.speed_std_m_s);
        self.begin(first, &velocity, &speed, &prior, config);
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
        let learnt = self.learnt(scale, config);
        let pass = pass(&self.anchor, &self.about, intervals, learnt, config)?;
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

    /// What a pass has from the one before.
    pub(super) fn learnt(&self, scale: T, config: &InMotionAlignmentConfig<T>) -> Learnt<T> {
        Learnt {
            scale,
            velocity_variance: self.velocity_variance(),
            feigned_acceleration: self.end.feigned_acceleration(config.gravity),
        }
    }

    /// Sum of the variances of the velocity at the newest fix, (m/s)^2.
    fn velocity_variance(&self) -> T {
        let variance = |i| self.end.covariance.variance(VELOCITY + i);
        variance(0) + variance(1) + variance(2)
    }

    /// Whether the heading was less certain than `std` (rad) before the window, and still is.
    pub(super) fn is_wider_than(&self, std: T) -> bool {
        let ends = [&self.anchor, &self.end];
        ends.iter()
            .all(|at| at.covariance.variance(ATTITUDE + 2) > std * std)
    }

    /// The same with a heading that is `offset` (rad) further and had the standard deviation `std` before the window, and with
    /// `more` log evidence (W24).
    pub(super) fn with_heading(
        &self,
        [offset, std, more]: [T; 3],
        intervals: &[Interval<T>],
    ) -> Self {
        let [before, now] =
            [&self.anchor, &self.end].map(|at| at.covariance.variance(ATTITUDE + 2));
        let end = self.end.with_heading(offset, std * (now / before).sqrt());
        Self {
            anchor: self.anchor.with_heading(offset, std),
            about: Linearization::carried_back(&end.mean, intervals),
            departed: self.departed + more,
            log_evidence: self.log_evidence + more,
            end,
            nis: self.nis,
            steps: self.steps,
        }
    }

    /// Whether the biases are the same within their standard deviations.
    pub(super) fn has_biases_of(&self, other: &Self) -> bool {
        let (a, b) = (&self.end, &other.end);
        let off = a.mean.less(&b.mean);
        (ACCELEROMETER_BIAS..STATES).all(|i| off[i] * off[i] < b.covariance.variance(i))
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
