//! Everything the bounded-velocity filter remembers, and how it starts.

use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};

use super::bias_prior::BiasPrior;
use super::config::{BoundedVelocityConfig, ScaleStates};
use super::field_mean::FieldMean;
use super::hard_iron::{HardIronWatch, Offset};
use super::layout::{ATTITUDE, BIAS, Correction, Covariance, Layout, SCALE, VELOCITY};
use super::propagation::Sums;
use super::rest::RestDetector;
use super::speed_hypotheses::{Likeliest, SpeedHypotheses};
use super::velocity_noise::VelocityNoise;
use crate::attitude::InitialState;
use crate::attitude::propagation::LARGEST_BIAS_RAD_S;
use crate::attitude::vector_sensor::{References, VectorSensor};
use crate::faults::bias_step::{Learnt, Resumed};
use crate::geometry::rotation;
use crate::kalman::covariance::{cap_variance, part, undrown};
use crate::kalman::innovation::check_vector;
use crate::restorable::{InvalidState, covariance, expect, finite, not_negative, unit};
use crate::scalar::{Scalar, lit};

/// The square of the acceleration that is taken for the mean before there is one, (m/s^2)^2.
const INITIAL_SQUARE_ACCELERATION: f64 = 1.0;

/// Largest error of scale and alignment, largest velocity, and largest field and hard iron: beyond them nothing was measured.
const LARGEST_SCALE: f64 = 10.0;
const LARGEST_VELOCITY_M_S: f64 = 1e4;
const LARGEST_FIELD_UT: f64 = 1e6;

/// Of a field that points straight down this share is horizontal at least, as far as an offset in it goes.
const LEAST_HORIZONTAL: f64 = 0.1;

/// Where the states of a hypothesis of the speed are among the filter's.
const PLACES: [usize; 7] = [
    ATTITUDE,
    ATTITUDE + 1,
    VELOCITY,
    VELOCITY + 1,
    BIAS,
    BIAS + 1,
    BIAS + 2,
];

/// Save it, restore it, and the filter continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BoundedVelocityState<T: Scalar> {
    /// Attitude in level axes: east, (magnetic) north, up.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub level_from_body: UnitQuaternion<T>,
    /// The reference frame in level axes: a constant of the start.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub ref_from_level: UnitQuaternion<T>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<T>,
    /// Errors of the gyroscope's scale and alignment, `w = w_m + M w_m - b`.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub scale: Matrix3<T>,
    /// Horizontal velocity, m/s, east and north: what is left of the bounded motion.
    pub velocity: Vector2<T>,
    /// Reference field, microtesla: horizontally (northward) and downward.
    pub field_ut: Vector2<T>,
    /// Hard iron, microtesla, body axes.
    pub hard_iron_ut: Vector3<T>,
    /// Covariance of the error states that [`Self::layout`] places.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Covariance<T>,
    /// Which error states there are.
    pub layout: Layout,
    /// Whether the device rests.
    pub rest: RestDetector<T>,
    /// Mean square of the acceleration, (m/s^2)^2.
    pub mean_square_acceleration: T,
    /// White noise that the gyroscope's samples show, (rad/s)^2/Hz; zero before it is known.
    pub gyroscope_noise_psd: T,
    /// What is known of the velocity of whatever carries the device.
    pub velocity_noise: VelocityNoise<T>,
    /// How fast that is.
    pub speed_hypotheses: SpeedHypotheses<T>,
    pub(super) bias_prior: BiasPrior<T>,
    pub(super) hard_iron_watch: HardIronWatch<T>,
    /// By how much the last field's strength and dip raised its variance: one is perfect.
    pub field_variance_factor: T,
    /// Weight of the last field under Student's t: one fits.
    pub field_weight: T,
    pub(super) angular_rate: Vector3<T>,
    pub(super) initial_bias: Vector3<T>,
    pub(super) sums: Sums<T>,
    /// Integral of the measured rate since the last update of the velocity, rad.
    pub(super) rate_sum: Vector3<T>,
    pub(super) since_force: T,
    pub(super) since_velocity_update: T,
    pub(super) field_mean: FieldMean<T>,
    pub(super) since_field: T,
    pub(super) since_field_update: T,
    pub(super) compass: VectorSensor<T>,
    /// Length of the specific force at rest, m/s^2; zero before the start.
    pub(super) gravity: T,
    pub(super) has_field: bool,
    pub(super) initial_field_strength_ut: T,
}

impl<T: Scalar> BoundedVelocityState<T> {
    /// Whether it started with a magnetic field.
    pub fn has_field(&self) -> bool {
        self.has_field
    }

    /// Standard deviation of the hard iron, microtesla, body axes; `None` where it is not estimated.
    pub fn hard_iron_std_ut(&self) -> Option<Vector3<T>> {
        let first = self.layout.hard_iron()?;
        let variance = |i: usize| self.covariance.get((first + i, first + i)).copied();
        let std = |i: usize| variance(i).map(|v| v.max(T::zero()).sqrt());
        Some(Vector3::new(std(0)?, std(1)?, std(2)?))
    }

    /// Whether it can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("level_from_body", &self.level_from_body)?;
        unit("ref_from_level", &self.ref_from_level)?;
        covariance("covariance", &self.covariance)?;
        expect("layout", self.layout.is_valid(), "that of its blocks")?;
        self.compass.check("compass")?;
        let vectors = [
            &self.gyroscope_bias,
            &self.hard_iron_ut,
            &self.angular_rate,
            &self.initial_bias,
            &self.rate_sum,
        ];
        finite("vectors", vectors.into_iter().flatten())?;
        finite(
            "velocity and field",
            self.velocity.iter().chain(&self.field_ut),
        )?;
        finite("scale", &self.scale)?;
        finite("sums", self.sums.numbers())?;
        finite("rest", self.rest.numbers())?;
        finite("field_mean", self.field_mean.numbers())?;
        finite("hard_iron_watch", self.hard_iron_watch.numbers())?;
        finite("velocity_noise", self.velocity_noise.numbers())?;
        not_negative("bias_prior", self.bias_prior.numbers())?;
        finite("speed_hypotheses", self.speed_hypotheses.numbers())?;
        let valid = self.speed_hypotheses.is_valid();
        expect("speed_hypotheses", valid, "the number of a hypothesis")?;
        not_negative(
            "times and sizes",
            [
                &self.mean_square_acceleration,
                &self.gyroscope_noise_psd,
                &self.field_variance_factor,
                &self.field_weight,
                &self.since_force,
                &self.since_velocity_update,
                &self.since_field,
                &self.since_field_update,
                &self.gravity,
                &self.initial_field_strength_ut,
            ],
        )
    }

    /// Before the start: the identity, as uncertain as it gets, and no references.
    pub(super) fn blank(config: &BoundedVelocityConfig<T>) -> Self {
        let layout = Layout::new(config, false);
        let zero = T::zero();
        let mut state = Self {
            level_from_body: UnitQuaternion::identity(),
            ref_from_level: UnitQuaternion::identity(),
            gyroscope_bias: Vector3::zeros(),
            scale: Matrix3::zeros(),
            velocity: Vector2::zeros(),
            field_ut: Vector2::zeros(),
            hard_iron_ut: Vector3::zeros(),
            covariance: Covariance::zeros(),
            layout,
            rest: RestDetector::default(),
            mean_square_acceleration: lit(INITIAL_SQUARE_ACCELERATION),
            gyroscope_noise_psd: zero,
            velocity_noise: VelocityNoise::new(config),
            speed_hypotheses: SpeedHypotheses::new(config, zero, zero),
            bias_prior: BiasPrior::none(),
            hard_iron_watch: HardIronWatch::default(),
            field_variance_factor: T::one(),
            field_weight: T::one(),
            angular_rate: Vector3::zeros(),
            initial_bias: Vector3::zeros(),
            sums: Sums::default(),
            rate_sum: Vector3::zeros(),
            since_force: zero,
            since_velocity_update: zero,
            field_mean: FieldMean::default(),
            since_field: zero,
            since_field_update: zero,
            compass: VectorSensor::compass(&config.alignment_settings()),
            gravity: zero,
            has_field: false,
            initial_field_strength_ut: zero,
        };
        let unknown = config.maximum_attitude_std * config.maximum_attitude_std;
        state.set_variance(ATTITUDE, 3, unknown);
        state.set_other_variances(config, config.initial_gyroscope_bias_std);
        state
    }

    /// The state to start from; `None` where the references say nothing about up.
    pub(super) fn start(
        config: &BoundedVelocityConfig<T>,
        initial: &InitialState<T>,
    ) -> Option<Self> {
        let references = &initial.references;
        let force = &references.specific_force;
        check_vector(force, lit(1e-3), lit(1e6)).ok()?;
        let mut state = Self::blank(config);
        state.gravity = force.norm();
        let usable = |field: &Vector3<T>| check_vector(field, lit(1e-3), lit(1e6)).is_ok();
        let references = References {
            specific_force: *force,
            magnetic_field: references.magnetic_field.filter(usable),
        };
        state.ref_from_level = ref_from_level(&references);
        let level_from_ref = state.ref_from_level.inverse();
        let turned = level_from_ref * initial.attitude;
        state.level_from_body = rotation::renormalize(&turned);
        state.gyroscope_bias = initial.gyroscope_bias;
        state.initial_bias = initial.gyroscope_bias;
        let field = references
            .magnetic_field
            .map(|field| level_from_ref * field);
        let assumed = match field {
            Some(level) => {
                state.has_field = true;
                state.initial_field_strength_ut = level.norm();
                state.field_ut = Vector2::new(level.xy().norm(), -level.z);
                config.initial_gyroscope_bias_std
            }
            None => config.initial_gyroscope_bias_without_magnetometer_std,
        };
        let mut bias_std = initial.gyroscope_bias_std;
        if !state.has_field {
            bias_std = bias_std.min(assumed);
        }
        // Otherwise a rest measured it, or it was learnt before this start.
        if bias_std >= assumed && initial.gyroscope_bias == Vector3::zeros() {
            state.bias_prior = BiasPrior::assumed(bias_std * bias_std);
        }
        state.layout = Layout::new(config, state.has_field);
        state.covariance = Covariance::zeros();
        state.set_attitude_covariance(&initial.attitude_covariance);
        state.set_other_variances(config, bias_std);
        let (tilt, bias) = state.tilt_and_bias_variance();
        state.speed_hypotheses = SpeedHypotheses::new(config, tilt, bias);
        Some(state)
    }

    /// Takes over an attitude and its covariance; the velocity is unknown, and all else stays.
    pub(super) fn turn_to(&mut self, config: &BoundedVelocityConfig<T>, initial: &InitialState<T>) {
        let turned = self.ref_from_level.inverse() * initial.attitude;
        self.level_from_body = rotation::renormalize(&turned);
        self.velocity = Vector2::zeros();
        self.hard_iron_watch.interrupt();
        for i in ATTITUDE..BIAS {
            self.covariance.row_mut(i).fill(T::zero());
            self.covariance.column_mut(i).fill(T::zero());
        }
        self.set_attitude_covariance(&initial.attitude_covariance);
        let velocity = config.initial_velocity_std;
        self.set_variance(VELOCITY, 2, velocity * velocity);
        self.agree_about_the_speed(config);
    }

    /// Mean variances of the tilt about a level axis, rad^2, and of the gyroscope bias of an axis, (rad/s)^2.
    fn tilt_and_bias_variance(&self) -> (T, T) {
        let p = &self.covariance;
        let tilt = p.fixed_view::<2, 2>(ATTITUDE, ATTITUDE).trace() / lit(2.0);
        let bias = p.fixed_view::<3, 3>(BIAS, BIAS).trace() / lit(3.0);
        (tilt, bias)
    }

    /// The hypotheses of how fast it moves agree about the tilt and the bias: with this state.
    pub(super) fn agree_about_the_speed(&mut self, config: &BoundedVelocityConfig<T>) {
        let (tilt, bias) = self.tilt_and_bias_variance();
        self.speed_hypotheses.agree(config, tilt, bias);
    }

    /// Takes the covariance of a hypothesis; its tilt, velocity and bias are independent of all else from now on. Gives the
    /// correction that is its estimate.
    pub(super) fn take_covariance(&mut self, likeliest: Likeliest<T>) -> Correction<T> {
        let hypothesis = if self.has_field {
            likeliest.hypothesis()
        } else {
            let up = self.level_from_body.inverse() * Vector3::z();
            let bias: Matrix3<T> = part(&self.covariance, BIAS, BIAS);
            likeliest.without_vertical_bias(&up, up.dot(&(bias * up)))
        };
        let mut correction = Correction::zeros();
        for (i, value) in PLACES.iter().zip(hypothesis.x.iter()) {
            self.covariance.row_mut(*i).fill(T::zero());
            self.covariance.column_mut(*i).fill(T::zero());
            correction[*i] = *value;
        }
        for (i, column) in PLACES.iter().zip(hypothesis.p.column_iter()) {
            for (j, value) in PLACES.iter().zip(column.iter()) {
                self.covariance[(*i, *j)] = *value;
            }
        }
        correction[VELOCITY] -= self.velocity.x;
        correction[VELOCITY + 1] -= self.velocity.y;
        correction
    }

    /// What a wrong gyroscope bias would spoil: noise of the velocity, speed, field and hard iron.
    pub(super) fn learnt(&self) -> Learnt<T> {
        let [seen, expected] = self.velocity_noise.densities();
        let [a, b, c, d] = self.speed_hypotheses.weights();
        let [north, down] = self.field_ut.into();
        let [x, y, z] = self.hard_iron_ut.into();
        Learnt([seen, expected, a, b, c, d, north, down, x, y, z])
    }

    fn learn_again(&mut self, learnt: &Learnt<T>) {
        let [seen, expected, a, b, c, d, north, down, x, y, z] = learnt.0;
        self.velocity_noise.set_densities([seen, expected]);
        self.speed_hypotheses.set_weights([a, b, c, d]);
        self.field_ut = Vector2::new(north, down);
        // One that was found meanwhile is not forgotten.
        let iron = Vector3::new(x, y, z);
        if iron != Vector3::zeros() {
            self.hard_iron_ut = iron;
        }
    }

    /// Goes on from before a step of the bias: with what it had learnt then, and errors of attitude and bias that hang together.
    pub(super) fn resume(
        &mut self,
        config: &BoundedVelocityConfig<T>,
        initial: &InitialState<T>,
        resumed: &Resumed<T>,
    ) {
        self.learn_again(&resumed.learnt);
        self.bias_prior = BiasPrior::none();
        self.gyroscope_bias = initial.gyroscope_bias;
        self.initial_bias = initial.gyroscope_bias;
        for i in BIAS..BIAS + 3 {
            self.covariance.row_mut(i).fill(T::zero());
            self.covariance.column_mut(i).fill(T::zero());
        }
        self.set_block(BIAS, BIAS, &resumed.bias_covariance);
        self.turn_to(config, initial);
        let axes = self.level_from_body.to_rotation_matrix();
        let cross = axes * resumed.cross_covariance();
        self.set_block(ATTITUDE, BIAS, &cross);
        self.set_block(BIAS, ATTITUDE, &cross.transpose());
    }

    fn set_block(&mut self, row: usize, column: usize, block: &Matrix3<T>) {
        let mut place = self.covariance.fixed_view_mut::<3, 3>(row, column);
        place.copy_from(block);
    }

    /// Adds the variance of a bias that may be off by `step` (rad/s) in one direction or the other, and has turned the attitude unseen
    /// for `time` s.
    pub(super) fn doubt_bias(&mut self, step: &Vector3<T>, time: T) {
        self.bias_prior = BiasPrior::none();
        let turned = self.level_from_body * step * -time;
        let both = turned * step.transpose();
        let p = &mut self.covariance;
        let mut add = |row, column, block: Matrix3<T>| {
            let mut place = p.fixed_view_mut::<3, 3>(row, column);
            place += block;
        };
        add(ATTITUDE, ATTITUDE, turned * turned.transpose());
        add(ATTITUDE, BIAS, both);
        add(BIAS, ATTITUDE, both.transpose());
        add(BIAS, BIAS, step * step.transpose());
    }

    /// Estimates hard iron from now on (B19d). Heading and reference field were learnt with it in them.
    pub(super) fn take_hard_iron(&mut self, found: &Offset<T>) {
        self.layout = self.layout.with_hard_iron();
        let Some(first) = self.layout.hard_iron() else {
            return;
        };
        self.hard_iron_ut = found.offset;
        for i in 0..3 {
            for j in 0..3 {
                if let Some(value) = self.covariance.get_mut((first + i, first + j)) {
                    *value = found.covariance[(i, j)];
                }
            }
        }
        let size2 = found.offset.norm_squared();
        let horizontal = (self.field_ut.x).max(self.field_ut.norm() * lit(LEAST_HORIZONTAL));
        self.covariance[(ATTITUDE + 2, ATTITUDE + 2)] += size2 / (horizontal * horizontal);
        let fields = (self.layout.field()).map_or(0..0, |first| first..first + 2);
        for i in fields {
            if let Some(value) = self.covariance.get_mut((i, i)) {
                *value += size2;
            }
        }
    }

    /// From body axes, where the attitude is.
    fn set_attitude_covariance(&mut self, body: &Matrix3<T>) {
        let r = self.level_from_body.to_rotation_matrix().into_inner();
        let level = r * body * r.transpose();
        let mut symmetric = (level + level.transpose()) * lit::<T>(0.5);
        undrown(&mut symmetric);
        self.covariance
            .fixed_view_mut::<3, 3>(ATTITUDE, ATTITUDE)
            .copy_from(&symmetric);
    }

    fn set_other_variances(&mut self, config: &BoundedVelocityConfig<T>, bias_std: T) {
        let square = |std: T| std * std;
        self.set_variance(VELOCITY, 2, square(config.initial_velocity_std));
        self.set_variance(BIAS, 3, square(bias_std));
        let diagonal = square(config.initial_scale_std);
        match self.layout.scale() {
            ScaleStates::Off => {}
            ScaleStates::Diagonal => self.set_variance(SCALE, 3, diagonal),
            ScaleStates::Full => {
                let misalignment = if self.has_field {
                    config.initial_misalignment_std
                } else {
                    config.initial_misalignment_without_magnetometer_std
                };
                self.set_variance(SCALE, 9, square(misalignment));
                for i in [0, 4, 8] {
                    self.set_variance(SCALE + i, 1, diagonal);
                }
            }
        }
        if let Some(first) = self.layout.field() {
            self.set_variance(first, 2, square(config.initial_field_std_ut));
        }
        if let Some(first) = self.layout.hard_iron() {
            self.set_variance(first, 3, square(config.initial_hard_iron_std_ut));
        }
    }

    /// Holds gyroscope bias, scale, velocity, field and hard iron where sensors and their carriers are.
    #[inline]
    pub(super) fn hold_within_limits(&mut self) {
        let hold = |values: &mut [T], limit: f64| {
            let limit = lit::<T>(limit);
            for value in values {
                if value.abs() > limit {
                    *value = limit.copysign(*value);
                }
            }
        };
        hold(self.gyroscope_bias.as_mut_slice(), LARGEST_BIAS_RAD_S);
        hold(self.scale.as_mut_slice(), LARGEST_SCALE);
        hold(self.velocity.as_mut_slice(), LARGEST_VELOCITY_M_S);
        hold(self.field_ut.as_mut_slice(), LARGEST_FIELD_UT);
        hold(self.hard_iron_ut.as_mut_slice(), LARGEST_FIELD_UT);
    }

    /// Keeps variances where numbers still mean something, correlations as they are; `attitude` is the largest of its three.
    #[inline]
    pub(super) fn cap_variances(&mut self, attitude: T) {
        let square = |limit: f64| lit::<T>(limit * limit);
        let p = &mut self.covariance;
        let mut cap = |first: usize, count: usize, limit: T| {
            for i in first..first + count {
                cap_variance(p, i, limit);
            }
        };
        cap(ATTITUDE, 3, attitude);
        cap(VELOCITY, 2, square(LARGEST_VELOCITY_M_S));
        cap(BIAS, 3, square(LARGEST_BIAS_RAD_S));
        if let Some(first) = self.layout.field() {
            cap(first, 2, square(LARGEST_FIELD_UT));
        }
        if let Some(first) = self.layout.hard_iron() {
            cap(first, 3, square(LARGEST_FIELD_UT));
        }
    }

    fn set_variance(&mut self, first: usize, size: usize, variance: T) {
        for i in first..first + size {
            if let Some(value) = self.covariance.get_mut((i, i)) {
                *value = variance;
            }
        }
    }

    /// Adds the scale block of a correction.
    #[inline]
    pub(super) fn add_scale(&mut self, x: &Correction<T>) {
        match self.layout.scale() {
            ScaleStates::Off => {}
            ScaleStates::Diagonal => {
                for i in 0..3 {
                    self.scale[(i, i)] += x[SCALE + i];
                }
            }
            ScaleStates::Full => {
                for row in 0..3 {
                    for column in 0..3 {
                        self.scale[(row, column)] += x[SCALE + 3 * row + column];
                    }
                }
            }
        }
    }
}

/// The axes east, north and up in the reference frame. North is where the reference field points
/// horizontally; without one, the reference's y axis, or its x axis where its third axis points down.
fn ref_from_level<T: Scalar>(references: &References<T>) -> UnitQuaternion<T> {
    let up = references.specific_force.normalize();
    let level = |v: Vector3<T>| v - up * v.dot(&up);
    let of_field = references
        .magnetic_field
        .and_then(|field| level(field).try_normalize(field.norm() * lit(1e-2)));
    let axis = if up.z >= T::zero() {
        Vector3::y()
    } else {
        Vector3::x()
    };
    let north = of_field
        .or_else(|| level(axis).try_normalize(lit(1e-3)))
        // Up lies along that axis: the third one is level.
        .or_else(|| level(Vector3::z()).try_normalize(lit(1e-3)))
        .unwrap_or_else(Vector3::y);
    rotation::from_matrix(&Matrix3::from_columns(&[north.cross(&up), north, up]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::frames::TangentFrame;
    use crate::geometry::so3;
    use approx::assert_relative_eq;

    #[test]
    fn level_axes_follow_up_and_the_field_of_any_reference() {
        let turn = so3::exp(&Vector3::new(0.4, 1.9, -0.7));
        for (frame, turn) in [
            (TangentFrame::Enu, UnitQuaternion::identity()),
            (TangentFrame::Ned, UnitQuaternion::identity()),
            (TangentFrame::Enu, turn),
        ] {
            let field = turn * frame.magnetic_field(20.0_f64, 40.0);
            let references = References {
                specific_force: turn * frame.specific_force_at_rest(9.81),
                magnetic_field: Some(field),
            };
            let level_from_ref = ref_from_level(&references).inverse();
            let expected = Vector3::new(0.0, 20.0, -40.0);
            assert_relative_eq!(level_from_ref * field, expected, epsilon = 1e-12);
            let blind = References {
                magnetic_field: None,
                ..references
            };
            let up = ref_from_level(&blind).inverse() * references.specific_force;
            assert_relative_eq!(up, Vector3::z() * 9.81, epsilon = 1e-12);
        }
        let enu = References {
            specific_force: Vector3::new(0.0, 0.0, 9.81),
            magnetic_field: None,
        };
        assert_eq!(ref_from_level::<f64>(&enu), UnitQuaternion::identity());
    }
}
