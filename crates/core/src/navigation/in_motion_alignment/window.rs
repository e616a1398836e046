//! The sliding window: the last intervals with their fixes, and the linear pass of one hypothesis through them.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 3 (W11, W12).

use nalgebra::{UnitQuaternion, Vector3};

use super::estimate::{Estimate, Mean, Triangle, propagate};
use super::robust_update::{Weighted, fuse};
use super::{Covariance, ErrorVector, InMotionAlignmentConfig};
use crate::geometry::so3;
use crate::kalman::{Innovation, SkipReason};
use crate::navigation::aiding::{gnss_position, gnss_velocity, heading, zero_velocity};
use crate::navigation::error_state::SparseMeasurement;
use crate::navigation::history::Instant;
use crate::navigation::preintegration::Preintegration;
use crate::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, GnssPosition, GnssVelocity, VELOCITY,
};
use crate::restorable::{InvalidState, finite, unit};
use crate::scalar::{Scalar, lit};

/// Speed (m/s) beyond which a time offset is not made more of.
const FASTEST_FOR_OFFSET: f64 = 300.0;
/// A velocity of fewer standard deviations may be all error.
const OWN_ERRORS: f64 = 2.0;
/// NIS of three components at which a fix is as bad as any.
const WORST_NIS: f64 = 12.0;

/// A heading that was measured within an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SeenHeading<T: Scalar> {
    /// What the body had turned by since the interval began.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub(super) turned: UnitQuaternion<T>,
    pub(super) source: HeadingSource<T>,
    pub(super) variance: T,
}

/// What measured it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum HeadingSource<T: Scalar> {
    /// A compass: true heading of the forward axis, rad.
    Heading(T),
    /// A magnetometer: field in body axes of any unit, and the declination, rad.
    MagneticField(Vector3<T>, T),
}

/// The inertial samples from one fix to the next, and that next one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Interval<T: Scalar> {
    pub(super) inertial: Preintegration<T>,
    /// As measured at its end.
    pub(super) angular_rate: Vector3<T>,
    pub(super) heading: Option<SeenHeading<T>>,
    /// Mean angular rate while it stood (rad/s) and its variance.
    pub(super) rate_at_rest: Option<(Vector3<T>, T)>,
    pub(super) position: GnssPosition<T>,
    pub(super) velocity: Option<GnssVelocity<T>>,
    /// Standard deviation (m) of what its fix is off by beyond noise, where it is an outlier; zero where it is none.
    pub(super) outlier_std: T,
}

/// The point about which a pass is linear: attitude at the window's beginning, and biases.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Linearization<T: Scalar> {
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub(super) ned_from_body: UnitQuaternion<T>,
    pub(super) accelerometer_bias: Vector3<T>,
    pub(super) gyroscope_bias: Vector3<T>,
}

/// The newest fix as a hypothesis saw it, and how the window fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit<T: Scalar> {
    /// Log evidence of the window.
    pub(super) log_evidence: T,
    /// Mean NIS of the positions for a component, each cut at four.
    pub(super) nis: T,
    /// Mean of what that is above one, each as far as the receiver's noise is what is uncertain.
    pub(super) excess: T,
    /// The newest position, velocity and heading of the window, with their weights.
    pub(super) newest: [(Innovation<T>, T); 3],
}

/// What a pass ends with.
pub(super) struct Pass<T: Scalar> {
    pub(super) fit: Fit<T>,
    pub(super) end: Estimate<T>,
    /// The state after the first interval and the log evidence of that.
    pub(super) second: (Estimate<T>, T),
}

/// What a pass has from the one before.
#[derive(Debug, Clone, Copy)]
pub(super) struct Learnt<T> {
    /// What the receiver's standard deviations are multiplied by.
    pub(super) scale: T,
    /// Sum of the variances of the velocity at the newest fix, (m/s)^2.
    pub(super) velocity_variance: T,
    /// Variance of a component of the acceleration that tilt and biases feign there, (m/s^2)^2.
    pub(super) feigned_acceleration: T,
}

/// The state of a pass.
struct Running<'a, T: Scalar> {
    config: &'a InMotionAlignmentConfig<T>,
    learnt: Learnt<T>,
    mean: Mean<T>,
    error: ErrorVector<T>,
    covariance: Covariance<T>,
    log_evidence: T,
}

impl<T: Scalar> Linearization<T> {
    pub(super) fn at(mean: &Mean<T>) -> Self {
        Self {
            ned_from_body: mean.ned_from_body,
            accelerometer_bias: mean.accelerometer_bias,
            gyroscope_bias: mean.gyroscope_bias,
        }
    }

    /// The end of the window carried back by the gyroscope with the bias found there (W12).
    pub(super) fn carried_back(end: &Mean<T>, intervals: &[Interval<T>]) -> Self {
        let mut turned = UnitQuaternion::identity();
        for interval in intervals {
            let inertial = &interval.inertial;
            let increment = inertial.corrected(&end.accelerometer_bias, &end.gyroscope_bias);
            turned *= increment.rotation;
        }
        Self {
            ned_from_body: end.ned_from_body * turned.inverse(),
            ..Self::at(end)
        }
    }

    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("linearisation", &self.ned_from_body)?;
        let biases = self.accelerometer_bias.iter().chain(&self.gyroscope_bias);
        finite("linearisation", biases)
    }
}

impl<T: Scalar> Interval<T> {
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        self.inertial.check()?;
        if let Some(seen) = &self.heading {
            seen.check()?;
        }
        let rest = self.rate_at_rest.iter();
        let rest = rest.flat_map(|(rate, variance)| rate.iter().chain([variance]));
        finite("rate at rest", rest)?;
        let velocity = self.velocity.iter();
        let velocity = velocity.flat_map(|v| v.ned.iter().chain(&v.std));
        let position = self.position.ned.iter().chain(&self.position.std);
        let numbers = position.chain(&self.angular_rate).chain(velocity);
        let numbers = numbers.chain([&self.outlier_std]);
        finite("fixes", numbers)
    }
}

impl<T: Scalar> SeenHeading<T> {
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("heading", &self.turned)?;
        let [angle, field] = match &self.source {
            HeadingSource::Heading(heading) => [*heading, T::zero()],
            HeadingSource::MagneticField(field, declination) => {
                [*declination, field.norm_squared()]
            }
        };
        finite("heading", [&angle, &field, &self.variance])
    }
}

/// One hypothesis through the window: linear about the trajectory that starts at `about`, from `anchor` (W10, W11).
/// `None`: the numbers have failed.
// Not inlined: on a chip its memory is then free again for what follows.
#[inline(never)]
pub(super) fn pass<T: Scalar>(
    anchor: &Estimate<T>,
    about: &Linearization<T>,
    intervals: &[Interval<T>],
    learnt: Learnt<T>,
    config: &InMotionAlignmentConfig<T>,
) -> Option<Pass<T>> {
    let mut running = Running::begin(anchor, about, learnt, config);
    let nothing = (Innovation::skipped(SkipReason::NotUsed), T::zero());
    let mut fit = Fit {
        log_evidence: T::zero(),
        nis: T::zero(),
        excess: T::zero(),
        newest: [nothing; 3],
    };
    let mut second = None;
    for interval in intervals {
        let heading = running.heading(interval)?;
        running.propagate(interval);
        running.rate_at_rest(interval)?;
        let position = running.position(interval)?;
        let velocity = running.velocity(interval)?;
        fit.see(&position);
        for (newest, seen) in fit
            .newest
            .iter_mut()
            .zip([Some(position), velocity, heading])
        {
            *newest = seen.map_or(*newest, |w| (w.innovation, w.weight));
        }
        if second.is_none() {
            second = Some((running.estimate()?, running.log_evidence));
        }
    }
    fit.log_evidence = running.log_evidence;
    let count = lit::<T>(intervals.len().max(1) as f64);
    fit.nis /= count;
    fit.excess /= count;
    Some(Pass {
        fit,
        end: running.estimate()?,
        second: second?,
    })
}

impl<T: Scalar> Fit<T> {
    fn see(&mut self, position: &Weighted<T>) {
        let record = &position.innovation;
        let components = lit::<T>(f64::from(record.degrees_of_freedom.max(1)));
        let worst = lit::<T>(WORST_NIS / 3.0);
        let nis = (record.nis / components).min(worst);
        self.nis += nis;
        self.excess += (nis - T::one()) * position.noise_share;
    }
}

impl<'a, T: Scalar> Running<'a, T> {
    fn begin(
        anchor: &Estimate<T>,
        about: &Linearization<T>,
        learnt: Learnt<T>,
        config: &'a InMotionAlignmentConfig<T>,
    ) -> Self {
        let from = &anchor.mean;
        let mean = Mean {
            ned_from_body: about.ned_from_body,
            accelerometer_bias: about.accelerometer_bias,
            gyroscope_bias: about.gyroscope_bias,
            ..*from
        };
        let mut error = ErrorVector::<T>::zeros();
        let turn = so3::log(&(from.ned_from_body * about.ned_from_body.inverse()));
        let force = from.accelerometer_bias - about.accelerometer_bias;
        let rate = from.gyroscope_bias - about.gyroscope_bias;
        for (first, part) in [
            (ATTITUDE, turn),
            (ACCELEROMETER_BIAS, force),
            (GYROSCOPE_BIAS, rate),
        ] {
            error.fixed_rows_mut::<3>(first).copy_from(&part);
        }
        Self {
            config,
            learnt,
            mean,
            error,
            covariance: anchor.covariance.full(),
            log_evidence: T::zero(),
        }
    }

    fn estimate(&self) -> Option<Estimate<T>> {
        let estimate = Estimate {
            mean: self.mean.corrected(&self.error),
            covariance: Triangle::of(&self.covariance),
        };
        estimate.is_usable().then_some(estimate)
    }

    fn propagate(&mut self, interval: &Interval<T>) {
        let scale = self.learnt.scale.max(T::one());
        let slow = interval.position.std * (scale * self.config.position_correlated_fraction);
        let Self {
            mean,
            error,
            covariance,
            config,
            learnt,
            ..
        } = self;
        let feigned = learnt.feigned_acceleration;
        propagate(
            mean,
            error,
            covariance,
            &interval.inertial,
            &slow,
            feigned,
            config,
        );
    }

    /// Fuses a measurement; those of a receiver have gross errors, too.
    fn fuse<const M: usize>(
        &mut self,
        measurement: &SparseMeasurement<T, M>,
        is_of_receiver: bool,
    ) -> Option<Weighted<T>> {
        let dof = self.config.student_dof;
        let (covariance, error) = (&mut self.covariance, &mut self.error);
        let seen = fuse(covariance, error, measurement, dof, is_of_receiver)?;
        self.log_evidence += seen.log_likelihood;
        Some(seen)
    }

    /// The instant of the fix at the end of an interval, as the aids of navigation want it.
    fn instant(&self, interval: &Interval<T>) -> Instant<T> {
        let mean = &self.mean;
        let fastest = lit::<T>(FASTEST_FOR_OFFSET);
        let corrected = mean.velocity + self.error.fixed_rows::<3>(VELOCITY);
        let corrected = corrected * reliability(&corrected, self.learnt.velocity_variance);
        let t = interval.inertial.duration_s();
        let increment = interval.inertial.increment();
        let force = mean.ned_from_body * (increment.rotation.inverse() * increment.velocity) / t;
        Instant {
            ned_from_body: mean.ned_from_body,
            velocity: corrected.map(|v| v.max(-fastest).min(fastest)),
            position: mean.position - mean.velocity * mean.lateness,
            angular_rate: interval.angular_rate - mean.gyroscope_bias,
            acceleration: force + Vector3::z() * self.config.gravity,
            age_s: mean.lateness,
            force_integral: Vector3::zeros(),
        }
    }

    /// At rest the gyroscope shows its bias.
    fn rate_at_rest(&mut self, interval: &Interval<T>) -> Option<()> {
        if let Some((rate, variance)) = &interval.rate_at_rest {
            let bias = self.mean.gyroscope_bias;
            self.fuse(&zero_velocity::rate(rate, &bias, *variance), false)?;
        }
        Some(())
    }

    /// A heading within the interval, at its beginning.
    fn heading(&mut self, interval: &Interval<T>) -> Option<Option<Weighted<T>>> {
        let Some(seen) = interval.heading else {
            return Some(None);
        };
        let mut then = self.instant(interval);
        then.ned_from_body = self.mean.ned_from_body * seen.turned;
        let made = match &seen.source {
            HeadingSource::Heading(heading) => heading::measurement(&then, *heading, seen.variance),
            HeadingSource::MagneticField(field, declination) => {
                heading::magnetic(&then, field, *declination, seen.variance)
            }
        };
        match made {
            Ok(measurement) => self.fuse(&measurement, false).map(Some),
            Err(_) => Some(None),
        }
    }

    fn position(&mut self, interval: &Interval<T>) -> Option<Weighted<T>> {
        let then = self.instant(interval);
        let c = self.config;
        let fix = &interval.position;
        let variance = position_variance(&fix.std, &then.velocity, self.learnt.scale, c)
            .add_scalar(interval.outlier_std * interval.outlier_std);
        let arm = Vector3::from(c.lever_arm_m);
        let offset = self.mean.gnss_offset;
        if fix.has_height {
            let m =
                gnss_position::measurement(&then, &offset, &arm, &fix.ned, &variance, [0, 1, 2]);
            self.fuse(&m, true)
        } else {
            let m = gnss_position::measurement(&then, &offset, &arm, &fix.ned, &variance, [0, 1]);
            self.fuse(&m, true)
        }
    }

    fn velocity(&mut self, interval: &Interval<T>) -> Option<Option<Weighted<T>>> {
        let Some(fix) = &interval.velocity else {
            return Some(None);
        };
        // As late as the position; the acceleration is the interval's mean, and half of it may be of another moment.
        let late = self.instant(interval);
        let moved = late.acceleration * late.age_s;
        let then = Instant {
            velocity: self.mean.velocity - moved,
            ..late
        };
        let variance =
            fix.std.component_mul(&fix.std) + moved.component_mul(&moved) * lit::<T>(0.25);
        let arm = Vector3::from(self.config.lever_arm_m);
        let seen = if fix.has_vertical {
            let m = gnss_velocity::measurement(&then, &arm, &fix.ned, &variance, [0, 1, 2]);
            self.fuse(&m, true)
        } else {
            let m = gnss_velocity::measurement(&then, &arm, &fix.ned, &variance, [0, 1]);
            self.fuse(&m, true)
        };
        seen.map(Some)
    }
}

/// Share of a velocity that is one, and not its own error (W23): only that shows a time offset.
fn reliability<T: Scalar>(velocity: &Vector3<T>, variance: T) -> T {
    let (squared, feigned) = (
        velocity.norm_squared(),
        variance * lit(OWN_ERRORS * OWN_ERRORS),
    );
    if squared > feigned {
        T::one() - feigned / squared
    } else {
        T::zero()
    }
}

/// Variance of what changes from fix to fix (section 3 of the derivation).
pub(super) fn position_variance<T: Scalar>(
    std: &Vector3<T>,
    velocity: &Vector3<T>,
    scale: T,
    config: &InMotionAlignmentConfig<T>,
) -> Vector3<T> {
    let white = scale * config.position_uncorrelated_fraction;
    let along = config.time_jitter_s * config.time_jitter_s * velocity.norm_squared();
    let added = config.lever_arm_std_m * config.lever_arm_std_m + along;
    std.map(|s| s * s * white * white + added)
}
