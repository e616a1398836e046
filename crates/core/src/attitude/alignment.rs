//! Alignment: the state to start from, out of the first half second of samples.
//!
//! The device may move while it happens: every sample is turned back to the attitude of the first
//! instant by integrating the gyroscope, averaged there, and TRIAD on the averages (gravity exact)
//! gives the attitude (`attitude::wahba`). How much the forces scatter says how uncertain it is. Strength
//! and dip of the reference field are those just measured, so a start near a magnet gives a wrong
//! field: better a calibration than a guess.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::vector_sensor::References;
use super::{InitialState, StartUncertainty, wahba};
use crate::geometry::{frames::TangentFrame, rotation};
use crate::kalman::covariance::undrown;
use crate::kalman::innovation::check_vector;
use crate::restorable::{InvalidState, finite, unit};
use crate::scalar::{Scalar, lit};

/// No specific force at a start is stronger (m/s^2): 50 g.
const STRONGEST_FORCE: f64 = 500.0;
/// No field at a start is stronger (microtesla): fifty times the Earth's.
const STRONGEST_FIELD_UT: f64 = 3000.0;

/// What is known beforehand, from a calibration or from a map.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Prior<T: Scalar> {
    /// The frame that the estimate shall refer to.
    pub frame: TangentFrame,
    /// Length of the specific force at rest, m/s^2.
    pub gravity: T,
    /// Horizontal and downward strength of the magnetic field (microtesla), where known.
    pub field_horizontal_down_ut: Option<[T; 2]>,
    /// Gyroscope bias (rad/s), zero where unknown.
    pub gyroscope_bias: Vector3<T>,
    /// Standard deviation of that bias (rad/s); `None` takes the configuration's.
    pub gyroscope_bias_std: Option<T>,
}

impl<T: Scalar> Default for Prior<T> {
    fn default() -> Self {
        Self {
            frame: TangentFrame::Enu,
            gravity: lit(9.806_65),
            field_horizontal_down_ut: None,
            gyroscope_bias: Vector3::zeros(),
            gyroscope_bias_std: None,
        }
    }
}

/// Gathers samples until there is enough to start from.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Alignment<T: Scalar> {
    prior: Prior<T>,
    /// Attitude now, relative to the first instant.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    first_from_now: UnitQuaternion<T>,
    specific_force: Mean<T>,
    magnetic_field: Mean<T>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Mean<T: Scalar> {
    sum: Vector3<T>,
    /// Of their squares.
    square: T,
    count: u32,
}

impl<T: Scalar> Mean<T> {
    fn empty() -> Self {
        Self {
            sum: Vector3::zeros(),
            square: T::zero(),
            count: 0,
        }
    }

    fn add(&mut self, v: Vector3<T>) {
        self.sum += v;
        self.square += v.norm_squared();
        self.count = self.count.saturating_add(1);
    }

    fn value(&self) -> Option<Vector3<T>> {
        let mean = self.sum / lit::<T>(f64::from(self.count.max(1)));
        (self.count > 0 && check_vector(&mean, lit(1e-3), lit(1e6)).is_ok()).then_some(mean)
    }

    /// Mean square of their deviation from the mean.
    fn scatter(&self) -> T {
        let count = lit::<T>(f64::from(self.count.max(1)));
        (self.square / count - (self.sum / count).norm_squared()).max(T::zero())
    }
}

impl<T: Scalar> Alignment<T> {
    /// Starts gathering.
    pub fn new(prior: Prior<T>) -> Self {
        Self {
            prior,
            first_from_now: UnitQuaternion::identity(),
            specific_force: Mean::empty(),
            magnetic_field: Mean::empty(),
        }
    }

    /// One that has gathered these means (m/s^2, microtesla), in axes of which it is known how they lie to the body now.
    pub(super) fn gathered(
        prior: Prior<T>,
        frame_from_body: UnitQuaternion<T>,
        force: Vector3<T>,
        field: Option<Vector3<T>>,
    ) -> Self {
        let mut one = Self::new(prior);
        one.first_from_now = frame_from_body;
        one.specific_force.add(force);
        if let Some(field) = field {
            one.magnetic_field.add(field);
        }
        one
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("alignment", &self.first_from_now)?;
        let sums = self
            .specific_force
            .sum
            .iter()
            .chain(&self.magnetic_field.sum);
        let prior = &self.prior;
        let known = prior.field_horizontal_down_ut.iter().flatten();
        let bias = prior.gyroscope_bias.iter().chain(&prior.gyroscope_bias_std);
        finite(
            "alignment",
            sums.chain(known).chain(bias).chain([&prior.gravity]),
        )
    }

    /// Whether a vector can be a specific force (m/s^2): finite, not zero, not absurdly long.
    pub fn is_force(v: &Vector3<T>) -> bool {
        check_vector(v, lit(1e-3), lit(STRONGEST_FORCE)).is_ok()
    }

    /// Whether a vector can be a magnetic field (microtesla).
    pub fn is_field(v: &Vector3<T>) -> bool {
        check_vector(v, lit(1e-3), lit(STRONGEST_FIELD_UT)).is_ok()
    }

    /// Whether it has a specific force.
    pub(super) fn has_force(&self) -> bool {
        self.specific_force.count > 0
    }

    /// Whether it has a magnetic field.
    pub(super) fn has_field(&self) -> bool {
        self.magnetic_field.count > 0
    }

    /// Takes note of a rotation: the rate (rad/s, as measured) over `dt` seconds.
    pub fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) {
        let turn = (angular_rate - self.prior.gyroscope_bias) * dt;
        if dt > T::zero() && turn.norm_squared().is_finite() {
            self.first_from_now = rotation::turned(&self.first_from_now, &turn);
        }
    }

    /// Adds a specific force (m/s^2, body axes now). Returns whether it was usable.
    pub fn add_specific_force(&mut self, v: &Vector3<T>) -> bool {
        let usable = Self::is_force(v);
        if usable {
            self.specific_force.add(self.first_from_now * v);
        }
        usable
    }

    /// Adds a magnetic field (microtesla, body axes now). Returns whether it was usable.
    pub fn add_magnetic_field(&mut self, v: &Vector3<T>) -> bool {
        let usable = Self::is_field(v);
        if usable {
            self.magnetic_field.add(self.first_from_now * v);
        }
        usable
    }

    /// The state to start from.
    ///
    /// Without a magnetometer the reference frame's heading is a matter of choice: it is the start's,
    /// so the start knows it as well as its tilt, and what grows from there is the drift. (An unknown
    /// heading would have to be stated as a huge variance, which leaks through the linearisation into
    /// invented headings.) Without an accelerometer the whole attitude is unknown.
    pub fn finish(&self, start: &StartUncertainty<T>) -> InitialState<T> {
        let frame = self.prior.frame;
        let force = self.specific_force.value();
        let field = self.magnetic_field.value();
        let unknown = start.unknown_std;
        let gravity_up = frame.specific_force_at_rest(self.prior.gravity);
        let (tilt, heading) = self.level_std(start);
        let (ref_from_first, tilt_std, heading_std) = match (force, field) {
            (Some(f), Some(m)) => match wahba::triad(&f, &m, &frame.up(), &frame.north()) {
                Some(q) => (q, tilt, heading),
                None => (wahba::level(&f, &frame.up()), tilt, tilt),
            },
            (Some(f), None) => (wahba::level(&f, &frame.up()), tilt, tilt),
            (None, _) => (UnitQuaternion::identity(), unknown, unknown),
        };
        let measured_field = field
            .map(|m| ref_from_first * m)
            .filter(|_| force.is_some());
        let magnetic_field = self.reference_field(measured_field);
        let attitude = rotation::renormalize(&(ref_from_first * self.first_from_now));
        InitialState {
            attitude,
            attitude_covariance: level_covariance(&attitude, &frame.up(), tilt_std, heading_std),
            gyroscope_bias: self.prior.gyroscope_bias,
            gyroscope_bias_std: self
                .prior
                .gyroscope_bias_std
                .unwrap_or(start.gyroscope_bias_std),
            north_known: false,
            references: References {
                specific_force: gravity_up,
                magnetic_field,
            },
        }
    }

    /// Standard deviations of tilt and heading, rad: those of a quiet start, and what motion adds. A mean of forces that
    /// scatter, or that is longer than gravity, is that far from being gravity.
    fn level_std(&self, start: &StartUncertainty<T>) -> (T, T) {
        let gravity = self.prior.gravity;
        let force = self.specific_force.value();
        let longer = force.map_or(T::zero(), |f| f.norm() - gravity);
        let moved2 = (self.specific_force.scatter() + longer * longer) / (gravity * gravity);
        let with = |std: T| (std * std + moved2).sqrt().min(start.unknown_std);
        (with(start.tilt_std), with(start.heading_std))
    }

    /// The field known beforehand, else the one just measured with its horizontal part north.
    fn reference_field(&self, measured: Option<Vector3<T>>) -> Option<Vector3<T>> {
        let frame = self.prior.frame;
        if let Some([horizontal, down]) = self.prior.field_horizontal_down_ut {
            return Some(frame.magnetic_field(horizontal, down));
        }
        let field = measured?;
        let upward = field.dot(&frame.up());
        let horizontal = (field - frame.up() * upward).norm();
        Some(frame.magnetic_field(horizontal, -upward))
    }
}

/// Body-axis covariance of an attitude whose tilt and heading errors have these deviations.
pub fn level_covariance<T: Scalar>(
    attitude: &UnitQuaternion<T>,
    up: &Vector3<T>,
    tilt_std: T,
    heading_std: T,
) -> Matrix3<T> {
    let up_body = attitude.inverse() * up;
    let tilt = tilt_std * tilt_std;
    let excess = heading_std * heading_std - tilt;
    let mut covariance = Matrix3::identity() * tilt + up_body * up_body.transpose() * excess;
    undrown(&mut covariance);
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::AttitudeConfig;
    use crate::geometry::so3;
    use approx::assert_relative_eq;

    fn config() -> StartUncertainty<f64> {
        StartUncertainty::of(&AttitudeConfig::lab())
    }

    /// GIVEN a device that turns while it is aligned WHEN samples are exact THEN so is the start.
    #[test]
    fn alignment_in_motion_is_exact_in_both_frames() {
        for frame in [TangentFrame::Enu, TangentFrame::Ned] {
            let mut alignment = Alignment::new(Prior {
                frame,
                ..Prior::default()
            });
            let field = frame.magnetic_field(22.0, 42.0);
            let (rate, dt) = (Vector3::new(0.7, -1.1, 0.4), 0.01);
            let mut truth = so3::exp(&Vector3::new(0.2, 2.0, -0.9));
            for _ in 0..50 {
                alignment.propagate(&rate, dt);
                truth *= so3::exp(&(rate * dt));
                assert!(alignment.add_specific_force(
                    &(truth.inverse() * frame.specific_force_at_rest(9.806_65))
                ));
                assert!(alignment.add_magnetic_field(&(truth.inverse() * field)));
            }
            let start = alignment.finish(&config());
            assert!(rotation::angle_between(&truth, &start.attitude) < 1e-12);
            assert_relative_eq!(
                start.references.magnetic_field.unwrap(),
                field,
                epsilon = 1e-10
            );
        }
    }

    #[test]
    fn without_a_magnetometer_the_start_defines_the_heading() {
        let mut alignment = Alignment::new(Prior::<f64>::default());
        let truth = so3::exp(&Vector3::new(0.4, -0.3, 0.0));
        let at_rest = Vector3::new(0.0, 0.0, 9.806_65);
        assert!(alignment.add_specific_force(&(truth.inverse() * at_rest)));
        let start = alignment.finish(&config());
        assert_relative_eq!(
            start.attitude.inverse() * Vector3::z(),
            truth.inverse() * Vector3::z(),
            epsilon = 1e-12
        );
        assert!(start.references.magnetic_field.is_none());
        let up = start.attitude.inverse() * Vector3::z();
        assert_relative_eq!(
            up.dot(&(start.attitude_covariance * up)),
            0.1 * 0.1,
            epsilon = 1e-12
        );
    }

    /// GIVEN somebody who runs while it is aligned WHEN it starts THEN the tilt is as uncertain as the force says, and it is
    /// within three of that; at rest it is what is configured.
    #[test]
    fn a_start_in_motion_is_less_certain() {
        let tilt = |strides_hz: f64, shake: f64, phase: f64| {
            let mut alignment = Alignment::new(Prior::<f64>::default());
            for k in 0..50 {
                let t = f64::from(k) * 0.01 * core::f64::consts::TAU * strides_hz + phase;
                let force = Vector3::new(shake * t.sin(), 0.5 * shake * t.cos(), 9.806_65);
                assert!(alignment.add_specific_force(&force));
            }
            let start = alignment.finish(&config());
            let up = start.attitude.inverse() * Vector3::z();
            let std = start.attitude_covariance[(0, 0)].sqrt();
            (up.angle(&Vector3::z()), std)
        };
        let (_, at_rest) = tilt(2.5, 0.0, 0.0);
        assert_relative_eq!(at_rest, 0.1, epsilon = 1e-9);
        for phase in [0.0, 0.7, 1.5, 2.2, 3.0] {
            for strides_hz in [0.5, 1.0, 2.5] {
                let (error, std) = tilt(strides_hz, 12.0, phase);
                assert!(error < 3.0 * std && std > 0.3, "{error} {std}");
            }
        }
    }

    #[test]
    fn nothing_at_all_is_the_identity_with_the_largest_uncertainty() {
        let start = Alignment::new(Prior::<f64>::default()).finish(&config());
        assert_eq!(start.attitude, UnitQuaternion::identity());
        assert_relative_eq!(
            start.attitude_covariance,
            Matrix3::identity() * (1.8 * 1.8),
            epsilon = 1e-12
        );
    }

    #[test]
    fn unusable_samples_do_not_count() {
        let mut alignment = Alignment::new(Prior::<f64>::default());
        assert!(!alignment.add_specific_force(&Vector3::zeros()));
        assert!(!alignment.add_magnetic_field(&Vector3::new(f64::NAN, 0.0, 0.0)));
        alignment.propagate(&Vector3::new(f64::INFINITY, 0.0, 0.0), 0.01);
        assert_eq!(alignment, Alignment::new(Prior::default()));
    }
}
