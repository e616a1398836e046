//! Measurement updates of each sensor: residuals, rows, variances.
//!
//! Read first: `docs/derivations/bounded_velocity.md`, B10 to B21. Rows are few elements of a long
//! row; corrections are collected and injected once for each update.

use nalgebra::{Matrix2, Matrix3, Vector1, Vector2, Vector3};

use super::field_mean::FieldMean;
use super::layout::{ATTITUDE, BIAS, Correction, VELOCITY};
use super::schmidt::consider_bias_about;
use super::steps::{Moment, Step, StepObserver};
use super::{BoundedVelocity, BoundedVelocityConfig, BoundedVelocityState, field_quality};
use crate::attitude::CompassHeading;
use crate::attitude::vector_sensor::{LONGEST, Weighed};
use crate::geometry::{rotation, so3};
use crate::kalman::covariance::{normalized_square3, part};
use crate::kalman::innovation::check_vector;
use crate::kalman::sparse_update::{Projection, SparseRow};
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::scalar::{Scalar, lesser, lit};

/// After a longer pause of the accelerometer nothing is known about the velocity, s.
pub const LONGEST_FORCE_INTERVAL_S: f64 = 0.5;
/// One field sample never stands for longer than this, s.
pub const LONGEST_FIELD_INTERVAL_S: f64 = 0.2;

/// A field measurement in level axes, linearised (B15, B16).
#[derive(Debug, Clone, Copy)]
pub(super) struct FieldMeasurement<T: Scalar> {
    pub(super) residual: Vector3<T>,
    pub(super) rows: [SparseRow<T>; 3],
    /// Of a single look, before what does not fit is weighed down (B17).
    pub(super) variance: T,
}

impl<T: Scalar, O: StepObserver<T>> BoundedVelocity<T, O> {
    /// Integrates a specific force that stood for the time since the last one (B4), and, when an
    /// update is due, says that the velocity is near zero, and what a rest says.
    #[inline]
    pub(super) fn take_force(&mut self, measured: &Vector3<T>) -> Innovation<T> {
        let gravity = self.state.gravity;
        if gravity <= T::zero() {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        if let Err(reason) = check_vector(measured, gravity * lit(1e-3), gravity * lit(LONGEST)) {
            return Innovation::skipped(reason);
        }
        let dt = self.state.since_force;
        self.state.since_force = T::zero();
        if dt > lit(LONGEST_FORCE_INTERVAL_S) {
            self.forget_velocity();
            return Innovation::skipped(SkipReason::TooLate);
        }
        let level = self.state.level_from_body * measured;
        let state = &mut self.state;
        state.velocity += level.xy() * dt;
        let acceleration2 = (level - Vector3::z() * gravity).norm_squared();
        let share = lesser(dt / self.config.acceleration_average_s, T::one());
        state.mean_square_acceleration += (acceleration2 - state.mean_square_acceleration) * share;
        let psd = self.config.velocity_noise_psd(acceleration2, measured);
        let felt = tilt_force(&level, state.has_field);
        state.sums.add_force(&felt, dt, psd);
        state.speed_hypotheses.force(&level, dt);
        state.rest.force(&self.config, measured, dt);
        let half = dt * lit(0.5);
        if dt <= T::zero() || state.since_velocity_update + half < self.config.update_interval_s {
            return Innovation::skipped(SkipReason::Accumulated);
        }
        self.update_velocity()
    }

    /// Nothing is known about the velocity: as at the start.
    fn forget_velocity(&mut self) {
        self.propagate_covariance();
        self.tell(Moment::Leaving(&Step::VelocityForgotten));
        let state = &mut self.state;
        let variance = self.config.initial_velocity_std * self.config.initial_velocity_std;
        state.velocity.fill(T::zero());
        for i in VELOCITY..VELOCITY + 2 {
            state.covariance.row_mut(i).fill(T::zero());
            state.covariance.column_mut(i).fill(T::zero());
            state.covariance[(i, i)] = variance;
        }
        state.rest.wake();
        state.speed_hypotheses.forget_velocity(&self.config);
        state.since_velocity_update = T::zero();
        state.rate_sum = Vector3::zeros();
        self.tell(Moment::Predicted);
    }

    /// `v = 0` with the variance that a bounded motion allows (B10 to B12), and at rest `rate = bias`
    /// (B13).
    fn update_velocity(&mut self) -> Innovation<T> {
        self.propagate_covariance();
        let looks = self.state.speed_hypotheses.is_due();
        self.look_at_the_speed();
        let slow = (self.state.rest.is_resting())
            .then(|| (self.state.rest).slow_motion_psd(&self.config, self.state.gravity));
        let density = self.config.rest_rate_noise_density;
        let white = (density * density).max(self.state.gyroscope_noise_psd);
        // A vehicle that does not accelerate may move.
        let stands = slow.filter(|_| !self.state.speed_hypotheses.is_vehicle());
        if let Some((turn_psd, _)) = stands {
            self.doubt_at_rest(white + turn_psd);
        }
        let config = &self.config;
        let state = &mut self.state;
        let time = state.since_velocity_update;
        let psd = Self::velocity_psd(config, state, stands.map(|(_, motion)| motion));
        let lasts = psd > Self::psd_of_hand(config, state);
        let variance = psd / time;
        let residual = -state.velocity;
        let (active, p) = (state.layout.len(), &mut state.covariance);
        let mut x = Correction::zeros();
        let rows = [VELOCITY, VELOCITY + 1].map(SparseRow::of_state);
        let projection = Projection::new(p, active, rows);
        let innovation = velocity_innovation(&residual, &projection.predicted, variance);
        let bias_covariance = part(p, BIAS, BIAS);
        let mut done = projection.fuse(p, &mut x, &residual, variance);
        if lasts && !state.has_field {
            let up = state.level_from_body.inverse() * Vector3::z();
            consider_bias_about(&up, &bias_covariance, p, &mut x);
        }
        if let Some((turn_psd, _)) = slow {
            let still = state.rate_sum / time - state.gyroscope_bias;
            let rows = [BIAS, BIAS + 1, BIAS + 2].map(SparseRow::of_state);
            let projection = Projection::new(p, active, rows);
            done = projection.fuse(p, &mut x, &still, (white + turn_psd) / time) && done;
        }
        if !looks {
            let known = part(p, BIAS, BIAS);
            let bias = &state.gyroscope_bias;
            if let Some(zero) = state.bias_prior.narrow(config, bias, &known, time) {
                let row = SparseRow::of_state(BIAS + zero.axis);
                let residual = Vector1::new(zero.residual);
                done = Projection::new(p, active, [row]).fuse(p, &mut x, &residual, zero.variance)
                    && done;
            }
        }
        state.since_velocity_update = T::zero();
        state.rate_sum = Vector3::zeros();
        self.inject(&x);
        if done {
            innovation
        } else {
            Innovation::skipped(SkipReason::Numerical)
        }
    }

    /// Doubts the bias where a rest shows a rate that it does not explain, about an axis that is not upright: a turn about that would
    /// show in the specific force (B14d).
    fn doubt_at_rest(&mut self, noise_psd: T) {
        let state = &self.state;
        let Some((rate, [time, unseen])) = state.rest.mean_rate(&self.config) else {
            return;
        };
        let off = rate - state.gyroscope_bias;
        let up = state.level_from_body.inverse() * Vector3::z();
        let tilting = off - up * up.dot(&off);
        let p = state.covariance.fixed_view::<3, 3>(BIAS, BIAS);
        // The variance along it, times its square.
        let size2 = tilting.norm_squared();
        let expected = tilting.dot(&(p * tilting)) + size2 * noise_psd / time;
        let doubt = self.config.rest_bias_doubt;
        if doubt > T::zero() && size2 * size2 > expected * doubt * doubt {
            self.tell(Moment::Leaving(&Step::Widening));
            self.state.doubt_bias(&off, unseen);
            self.tell(Moment::Predicted);
        }
    }

    /// Weighs how fast the device is carried, and where it is faster than the filter thought, or its bias has stepped, takes over what
    /// is estimated under that hypothesis (B11h): its own tilt is wrong and overconfident. At a rest of a hand all agree with the filter.
    fn look_at_the_speed(&mut self) {
        if !self.state.speed_hypotheses.is_due() {
            return;
        }
        if let Some(likeliest) = self.state.speed_hypotheses.look(&self.config) {
            let correction = self.state.take_covariance(likeliest);
            self.apply(&correction);
            self.tell(Moment::Started);
        }
        let (state, hypotheses) = (&self.state, &self.state.speed_hypotheses);
        if state.rest.is_resting() && !hypotheses.is_vehicle() && !hypotheses.is_due() {
            self.state.agree_about_the_speed(&self.config);
        }
    }

    /// Noise of `velocity is zero` of a hand (B11).
    #[inline]
    fn psd_of_hand(config: &BoundedVelocityConfig<T>, state: &BoundedVelocityState<T>) -> T {
        config.velocity_psd + config.velocity_psd_gain * state.mean_square_acceleration
    }

    /// Noise of `velocity is zero` (B11 to B11c), at rest with what may move all the same (B14).
    #[inline]
    fn velocity_psd(
        config: &BoundedVelocityConfig<T>,
        state: &mut BoundedVelocityState<T>,
        at_rest: Option<T>,
    ) -> T {
        let of_hand = Self::psd_of_hand(config, state);
        if let Some(motion) = at_rest {
            state.velocity_noise.rest();
            let psd = of_hand.max(state.velocity_noise.psd());
            return psd.min(config.rest_velocity_psd + motion);
        }
        let covariance = part(&state.covariance, VELOCITY, VELOCITY);
        let (velocity, time) = (state.velocity, state.since_velocity_update);
        (state.velocity_noise).learn(config, &velocity, &covariance, time);
        let psd = of_hand.max(state.velocity_noise.psd());
        (state.speed_hypotheses.psd(config)).map_or(psd, |of_vehicle| psd.max(of_vehicle))
    }

    /// The field, where an update is due.
    #[inline]
    pub(super) fn take_field(&mut self, measured: &Vector3<T>) -> Innovation<T> {
        if !self.state.has_field {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        let strength = self.state.initial_field_strength_ut;
        if let Err(reason) = check_vector(measured, strength * lit(1e-3), strength * lit(LONGEST)) {
            return Innovation::skipped(reason);
        }
        let state = &mut self.state;
        let since_sample = state.since_field;
        state.since_field = T::zero();
        if since_sample <= T::zero() {
            return Innovation::skipped(SkipReason::NotDue);
        }
        if since_sample > lit(LONGEST_FIELD_INTERVAL_S) {
            state.field_mean = FieldMean::default();
        }
        let level = state.level_from_body * (measured - state.hard_iron_ut);
        state.field_mean.add(&level);
        let since_update = state.since_field_update;
        if since_update + since_sample * lit(0.5) < self.config.update_interval_s {
            return Innovation::skipped(SkipReason::Accumulated);
        }
        let level = self.state.field_mean.take();
        self.update_field(&level, since_update)
    }

    /// Whether a magnetometer that is said to have no hard iron has some, microtesla, body axes: then it is estimated from now on
    /// (B19b to B19d).
    #[inline]
    fn watch_for_hard_iron(&mut self, level: &Vector3<T>, since: T) -> Option<Vector3<T>> {
        let (config, state) = (&self.config, &mut self.state);
        if state.layout.hard_iron().is_some() || config.unexpected_hard_iron <= T::zero() {
            return None;
        }
        let (attitude, rate) = (&state.level_from_body, state.angular_rate.norm());
        let least = config.magnetometer_std_ut * config.unexpected_hard_iron;
        let busy = state.speed_hypotheses.is_busy();
        let measured = &(attitude.inverse() * level);
        let watch = &mut state.hard_iron_watch;
        let found = watch.field(attitude, measured, rate, since, least, busy)?;
        self.tell(Moment::Leaving(&Step::Widening));
        self.state.take_hard_iron(&found);
        self.tell(Moment::Predicted);
        Some(self.state.hard_iron_ut)
    }

    /// The field (microtesla, level axes, without hard iron) against the reference field, its variance by its quality (B15 to
    /// B19); it comes `since` seconds after the last one.
    fn update_field(&mut self, level: &Vector3<T>, since: T) -> Innovation<T> {
        self.propagate_covariance();
        let found = self.watch_for_hard_iron(level, since);
        let level = found.map_or(*level, |iron| level - self.state.level_from_body * iron);
        // What it stands for.
        let time = since.min(lit(LONGEST_FIELD_INTERVAL_S));
        let m = self.field_measurement(&level);
        let state = &mut self.state;
        let p = &mut state.covariance;
        let projection = Projection::new(p, state.layout.len(), m.rows);
        let mut covariance = projection.predicted;
        for i in 0..3 {
            covariance[(i, i)] += m.variance;
        }
        let Some(nis) = normalized_square3(&m.residual, &covariance) else {
            return Innovation::skipped(SkipReason::Numerical);
        };
        let weight = field_quality::student_weight(self.config.magnetometer_student_freedom, nis);
        let looks = (self.config.magnetometer_correlation_time_s / time).max(T::one());
        let variance = m.variance / weight * looks;
        let mut x = Correction::zeros();
        let done = projection.fuse(p, &mut x, &m.residual, variance);
        state.since_field_update = T::zero();
        state.field_variance_factor =
            m.variance / (self.config.magnetometer_std_ut * self.config.magnetometer_std_ut);
        state.field_weight = weight;
        self.inject(&x);
        if !done {
            return Innovation::skipped(SkipReason::Numerical);
        }
        Innovation {
            residual: m.residual,
            covariance,
            nis,
            degrees_of_freedom: 3,
            outcome: Outcome::Fused,
        }
    }

    /// Residual and rows of a field in level axes (B15, B16), and the variance of a single look at it (B17).
    #[inline]
    pub(super) fn field_measurement(&self, level: &Vector3<T>) -> FieldMeasurement<T> {
        let state = &self.state;
        let level_from_body = state.level_from_body.to_rotation_matrix().into_inner();
        let [north, down] = [state.field_ut.x, state.field_ut.y];
        let one = T::one();
        let (east, ahead, up) = (ATTITUDE, ATTITUDE + 1, ATTITUDE + 2);
        let mut rows = [
            SparseRow::default().with(ahead, down).with(up, north),
            SparseRow::default().with(east, -down),
            SparseRow::default().with(east, -north),
        ];
        if let Some(first) = state.layout.hard_iron() {
            for (i, row) in rows.iter_mut().enumerate() {
                for c in 0..3 {
                    *row = row.with(first + c, level_from_body[(i, c)]);
                }
            }
        }
        if let Some(first) = state.layout.field() {
            rows[1] = rows[1].with(first, one);
            rows[2] = rows[2].with(first + 1, -one);
        }
        let std = self.config.magnetometer_std_ut;
        let factor = field_quality::variance_factor(&self.config, level, &state.field_ut);
        FieldMeasurement {
            residual: level - Vector3::new(T::zero(), north, -down),
            rows,
            variance: std * std * factor,
        }
    }

    /// A heading that the device reports; its row is turned from body into level axes (B20).
    #[inline]
    pub(super) fn take_compass(&mut self, heading: &CompassHeading<T>) -> Innovation<T> {
        let measured = match heading.measure(&self.attitude_in_reference()) {
            Ok(measured) => measured,
            Err(reason) => return Innovation::skipped(reason),
        };
        self.propagate_covariance();
        let state = &mut self.state;
        let h = state.level_from_body * measured.row;
        let row = SparseRow::default()
            .with(ATTITUDE, h.x)
            .with(ATTITUDE + 1, h.y)
            .with(ATTITUDE + 2, h.z);
        let p = &mut state.covariance;
        let projection = Projection::new(p, state.layout.len(), [row]);
        let variance = measured.variance.max(state.compass.variance());
        let predicted = projection.predicted[(0, 0)];
        let Weighed {
            innovation,
            variance,
        } = state
            .compass
            .weigh_scalar(measured.residual, predicted, variance);
        let Some(variance) = variance else {
            return innovation;
        };
        let mut x = Correction::zeros();
        if !projection.fuse(p, &mut x, &Vector1::new(measured.residual), variance) {
            return Innovation::skipped(SkipReason::Numerical);
        }
        self.inject(&x);
        innovation
    }

    /// Takes the corrections into the state (B21). They are small: the covariance is not turned. What is not finite is not
    /// taken, and no state leaves what its sensor can have.
    #[inline]
    pub(super) fn inject(&mut self, x: &Correction<T>) {
        if x.norm_squared().is_finite() {
            self.apply(x);
            self.tell(Moment::Corrected);
        }
    }

    /// The same, of what is finite, without telling anybody.
    #[inline]
    fn apply(&mut self, x: &Correction<T>) {
        let state = &mut self.state;
        let bias = Vector3::new(x[BIAS], x[BIAS + 1], x[BIAS + 2]);
        let tilt = Vector2::new(x[ATTITUDE], x[ATTITUDE + 1]);
        state.speed_hypotheses.corrected(&tilt, &bias);
        let turn = so3::exp(&Vector3::new(x[0], x[1], x[2]));
        state.level_from_body = rotation::renormalize(&(turn * state.level_from_body));
        state.hard_iron_watch.corrected(&turn);
        state.field_mean.corrected(&turn);
        state.velocity.x += x[VELOCITY];
        state.velocity.y += x[VELOCITY + 1];
        state.gyroscope_bias += bias;
        state.add_scale(x);
        let tail = |first: usize, i: usize| x.as_slice().get(first + i).copied();
        if let Some(first) = state.layout.field() {
            for i in 0..2 {
                state.field_ut[i] += tail(first, i).unwrap_or_else(T::zero);
            }
        }
        if let Some(first) = state.layout.hard_iron() {
            for i in 0..3 {
                state.hard_iron_ut[i] += tail(first, i).unwrap_or_else(T::zero);
            }
        }
        state.hold_within_limits();
    }
}

/// The force that moves the velocity with an attitude error (B8). A heading error turns the velocity and does not
/// lengthen it: "near zero" tells nothing of the heading. The model would think so, taking every velocity that is left
/// for an error; only a magnetometer makes that harmless (B8c).
#[inline]
fn tilt_force<T: Scalar>(level: &Vector3<T>, has_field: bool) -> Vector3<T> {
    if has_field {
        *level
    } else {
        Vector3::new(T::zero(), T::zero(), level.z)
    }
}

/// The record of the velocity: two components, m/s, east and north.
fn velocity_innovation<T: Scalar>(
    residual: &Vector2<T>,
    predicted: &Matrix2<T>,
    variance: T,
) -> Innovation<T> {
    let zero = T::zero();
    let residual = Vector3::new(residual.x, residual.y, zero);
    // A third component that is what was expected changes nothing.
    let mut covariance = Matrix3::identity();
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(predicted);
    covariance[(0, 0)] += variance;
    covariance[(1, 1)] += variance;
    let Some(nis) = normalized_square3(&residual, &covariance) else {
        return Innovation::skipped(SkipReason::Numerical);
    };
    covariance[(2, 2)] = zero;
    Innovation {
        residual,
        covariance,
        nis,
        degrees_of_freedom: 2,
        outcome: Outcome::Fused,
    }
}
