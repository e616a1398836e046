//! The 15-state error-state filter: strapdown inertial navigation, corrected by aiding.
//!
//! *Read first:* Wilthil & Brekke, *Compensation of Navigation Uncertainty for Target Tracking on a
//! Moving Platform* (2016), eqs 6-12; `docs/derivations/error_state.md`, whose equation numbers
//! (E..) stand at the lines below.
//!
//! Use it when there is an inertial measurement unit and anything that fixes position and attitude
//! from time to time, and whoever uses the result must know how sure it is. Do not use it over
//! hundreds of kilometres: the reference frame is a local tangent plane.
//!
//! # Model
//!
//! Reference-frame attitude error: `C_true = Exp(dpsi) C`; everything else is additive,
//! `true = estimate + error`. Order of the 15 states: `[dpsi, dv, dp, db_a, db_g]`.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `C` | `state.ned_from_body` | - |
//! | `v`, `p` | `state.velocity`, `state.position` | m/s, m, NED |
//! | `b_a`, `b_g` | biases, body axes | m/s^2, rad/s |
//! | `P` | `state.covariance` | products of the above |
//! | `Phi` | [`ErrorTransition`] | |
//! | `G (I - K H)` | [`ErrorFeedback`](crate::kalman::ErrorFeedback) | |
//!
//! Inertial samples move the state at once; the covariance moves when aiding comes or
//! [`ErrorStateFilter::catch_up`] is called, over all samples since, with one transition. Every
//! update gives back that transition and the feedback, which is what a tracker needs to stay
//! correlated with this filter exactly.
//!
//! Cost: about 160 multiplications an inertial sample, 950 when the covariance follows, 620 an update with three
//! states (`operations.rs` counts them). Limits: attitude errors
//! above some 20 degrees are beyond the linear model; the heading of a body that points straight
//! up or down is undefined.

mod aiding;
mod sparse;

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

pub use aiding::{GnssCompassFix, GnssCompassUpdate};
pub use sparse::{REJECTIONS_BELIEVED, ROW_ELEMENTS, Row, SIDE, SparseMeasurement};

use super::transition::{ErrorTransition, ProcessNoise};
use super::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, STATES, VELOCITY};
use crate::geometry::{rotation, so3};
use crate::kalman::covariance::mirror_upper;
use crate::kalman::feedback::reset_covariance;
use crate::kalman::innovation::check_vector;
use crate::kalman::shear::times;
use crate::kalman::{FollowedNavigation, NavigationPose, OutsideCorrection, SkipReason};
use crate::restorable::{InvalidState, Restorable, covariance, finite, unit};
use crate::scalar::{Scalar, lit};

/// Largest angular rate (rad/s) and specific force (m/s^2) that a sensor can have measured.
const FASTEST_RATE: f64 = 1e3;
const LARGEST_FORCE: f64 = 1e4;
/// Longest inertial interval, s.
const LONGEST_STEP_S: f64 = 10.0;

/// Settings of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct ErrorStateConfig<T> {
    /// White noise of the accelerometer as a density, (m/s^2)/sqrt(Hz); default 0.01. Raising it
    /// makes the filter follow aiding more quickly.
    pub accelerometer_noise_density: T,
    /// White noise of the gyroscope as a density, (rad/s)/sqrt(Hz); default 0.001. Raising it makes
    /// the filter follow the compass more quickly.
    pub gyroscope_noise_density: T,
    /// Random walk of the accelerometer bias, (m/s^2)/sqrt(s); default 0. Raising it lets the bias
    /// move.
    pub accelerometer_bias_random_walk: T,
    /// Random walk of the gyroscope bias, (rad/s)/sqrt(s); default 0. Raising it lets the bias move.
    pub gyroscope_bias_random_walk: T,
    /// Gravity, m/s^2; default 9.80665.
    pub gravity: T,
    /// Whether the attitude covariance is re-centred at the corrected attitude (E12); default true.
    /// Its effect is a fraction of a per cent.
    pub reset_jacobian: bool,
}

impl<T: Scalar> Default for ErrorStateConfig<T> {
    fn default() -> Self {
        Self {
            accelerometer_noise_density: lit(0.01),
            gyroscope_noise_density: lit(0.001),
            accelerometer_bias_random_walk: T::zero(),
            gyroscope_bias_random_walk: T::zero(),
            gravity: lit(9.806_65),
            reset_jacobian: true,
        }
    }
}

impl<T: Scalar> ErrorStateConfig<T> {
    /// Name of the first setting that makes no sense: noises must be finite and not negative,
    /// gravity finite.
    pub fn senseless(&self) -> Option<&'static str> {
        let noises = [
            (
                "accelerometer_noise_density",
                self.accelerometer_noise_density,
            ),
            ("gyroscope_noise_density", self.gyroscope_noise_density),
            (
                "accelerometer_bias_random_walk",
                self.accelerometer_bias_random_walk,
            ),
            (
                "gyroscope_bias_random_walk",
                self.gyroscope_bias_random_walk,
            ),
            ("gravity", self.gravity),
        ];
        let bad = noises
            .iter()
            .find(|(_, value)| !(value.is_finite() && *value >= T::zero()));
        bad.map(|(name, _)| *name)
    }
}

/// Everything the filter remembers: save it, restore it, and it continues exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NavigationState<T: Scalar> {
    /// Attitude, `ned_from_body`.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub ned_from_body: UnitQuaternion<T>,
    /// Velocity, m/s, NED.
    pub velocity: Vector3<T>,
    /// Position, m, NED from the origin of the tangent plane.
    pub position: Vector3<T>,
    /// Accelerometer bias, m/s^2, body axes.
    pub accelerometer_bias: Vector3<T>,
    /// Gyroscope bias, rad/s, body axes.
    pub gyroscope_bias: Vector3<T>,
    /// Covariance of `[dpsi, dv, dp, db_a, db_g]` at the last update or
    /// [`ErrorStateFilter::catch_up`].
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: SMatrix<T, STATES, STATES>,
    /// Transition of the errors since then.
    pub pending: ErrorTransition<T>,
    /// Inertial samples and fixes that were refused.
    pub skipped: u32,
}

impl<T: Scalar> NavigationState<T> {
    /// Starts at an attitude (`ned_from_body`), a velocity (m/s, NED) and a position (m, NED), with biases of zero, all
    /// of it exactly known: say how uncertain it is by [`Self::with_std`].
    pub fn new(
        ned_from_body: UnitQuaternion<T>,
        velocity: Vector3<T>,
        position: Vector3<T>,
    ) -> Self {
        Self {
            ned_from_body,
            velocity,
            position,
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance: SMatrix::zeros(),
            pending: ErrorTransition::default(),
            skipped: 0,
        }
    }

    /// The same with independent errors of these standard deviations on each axis: attitude (rad), velocity (m/s),
    /// position (m), accelerometer bias (m/s^2), gyroscope bias (rad/s).
    #[must_use]
    pub fn with_std(mut self, std: [T; 5]) -> Self {
        let variance = |i: usize, _| std[i / 3] * std[i / 3];
        self.covariance = SMatrix::from_diagonal(&SVector::from_fn(variance));
        self
    }

    /// Whether every number is finite and no variance negative.
    pub fn is_usable(&self) -> bool {
        let variances = self.covariance.diagonal();
        let vectors = [
            &self.velocity,
            &self.position,
            &self.accelerometer_bias,
            &self.gyroscope_bias,
        ];
        self.ned_from_body.as_ref().norm_squared().is_finite()
            && vectors.iter().all(|v| v.norm_squared().is_finite())
            && self.covariance.norm_squared().is_finite()
            && variances.iter().all(|v| *v >= T::zero())
    }

    fn check(&self) -> Result<(), InvalidState> {
        unit("attitude", &self.ned_from_body)?;
        finite("velocity", &self.velocity)?;
        finite("position", &self.position)?;
        finite("accelerometer bias", &self.accelerometer_bias)?;
        finite("gyroscope bias", &self.gyroscope_bias)?;
        finite("pending transition", self.pending.numbers())?;
        covariance("covariance", &self.covariance)
    }

    /// The covariance symmetric to the bit, as every step of the filter leaves it; the upper triangle counts.
    fn with_symmetric_covariance(mut self) -> Self {
        mirror_upper(&mut self.covariance);
        self
    }
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorStateFilter<T: Scalar> {
    config: ErrorStateConfig<T>,
    state: NavigationState<T>,
}

impl<T: Scalar> Restorable for ErrorStateFilter<T> {
    type State = NavigationState<T>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        state.check()?;
        self.state = state.with_symmetric_covariance();
        Ok(())
    }
}

impl<T: Scalar> FollowedNavigation<T, STATES> for ErrorStateFilter<T> {
    type Transition = ErrorTransition<T>;

    fn catch_up(&mut self) -> ErrorTransition<T> {
        Self::catch_up(self)
    }

    fn navigation_pose(&self) -> NavigationPose<'_, T, STATES> {
        NavigationPose {
            pose: self.pose(),
            covariance: &self.state.covariance,
            pose_from_error: self.pose_from_error(),
        }
    }
}

impl<T: Scalar> ErrorStateFilter<T> {
    /// A filter that continues from `state`.
    ///
    /// # Errors
    /// The name of a setting that makes no sense, or `"state"` when the state is not
    /// [usable](NavigationState::is_usable).
    pub fn new(
        config: ErrorStateConfig<T>,
        state: NavigationState<T>,
    ) -> Result<Self, &'static str> {
        match config.senseless() {
            Some(name) => Err(name),
            None if !state.is_usable() => Err("state"),
            None => Ok(Self {
                config,
                state: state.with_symmetric_covariance(),
            }),
        }
    }

    /// The settings.
    pub fn config(&self) -> &ErrorStateConfig<T> {
        &self.config
    }

    /// The state, to look at.
    pub fn state(&self) -> &NavigationState<T> {
        &self.state
    }

    /// Starts from a state that was just made; one that is not usable changes nothing and gives `false`.
    #[must_use]
    pub(super) fn start(&mut self, state: NavigationState<T>) -> bool {
        let usable = state.is_usable();
        if usable {
            self.state = state.with_symmetric_covariance();
        }
        usable
    }

    /// Moves on by `dt` seconds with the angular rate (rad/s) and specific force (m/s^2) that held
    /// over that interval, body axes, as the sensors gave them.
    ///
    /// # Errors
    /// Why the sample was refused; the state is then untouched and the refusal counted.
    pub fn propagate(
        &mut self,
        angular_rate: &Vector3<T>,
        specific_force: &Vector3<T>,
        dt: T,
    ) -> Result<(), SkipReason> {
        let checked = check_step(dt)
            .and_then(|()| check_vector(angular_rate, T::zero(), lit(FASTEST_RATE)))
            .and_then(|()| check_vector(specific_force, T::zero(), lit(LARGEST_FORCE)));
        if let Err(reason) = checked {
            self.count_skipped();
            return Err(reason);
        }
        self.integrate(angular_rate, specific_force, dt);
        Ok(())
    }

    /// Strapdown integration with the attitude of mid-sample (E3), and its transition (E6).
    #[inline]
    fn integrate(&mut self, angular_rate: &Vector3<T>, specific_force: &Vector3<T>, dt: T) {
        let half = dt * lit::<T>(0.5);
        let state = &mut self.state;
        let half_turn = so3::exp(&((angular_rate - state.gyroscope_bias) * half));
        let middle = state.ned_from_body * half_turn;
        let axes = rotation::to_matrix(&middle);
        let force = specific_force - state.accelerometer_bias;
        let [[north], [east], [down]] = times(&axes, [[force.x], [force.y], [force.z]]);
        let mut acceleration = Vector3::new(north, east, down);
        state.pending.accumulate(&axes, &acceleration, dt);

        acceleration.z += self.config.gravity;
        let step = acceleration * dt;
        state.position += (state.velocity + step * lit::<T>(0.5)) * dt;
        state.velocity += step;
        state.ned_from_body = rotation::renormalize(&(middle * half_turn));
    }

    /// Brings the covariance up to the last inertial sample, and gives the transition that did so:
    /// whoever carries a cross-covariance with this filter must apply it.
    #[inline]
    pub fn catch_up(&mut self) -> ErrorTransition<T> {
        let transition = core::mem::take(&mut self.state.pending);
        let noise = self.process_noise();
        transition.propagate_covariance(&mut self.state.covariance, &noise);
        transition
    }

    /// Goes on by `duration` (s) without inertial samples: the velocity is held, and attitude and velocity walk at
    /// random by `walks` (rad/sqrt(s) and m/s/sqrt(s)). The covariance must have caught up.
    pub(super) fn hold_velocity(
        &mut self,
        duration: T,
        [attitude, velocity]: [T; 2],
    ) -> ErrorTransition<T> {
        let transition = ErrorTransition::without_samples(duration);
        let noise = ProcessNoise {
            gyroscope: attitude * attitude,
            accelerometer: velocity * velocity,
            ..self.process_noise()
        };
        let state = &mut self.state;
        state.position += state.velocity * duration;
        transition.propagate_covariance(&mut state.covariance, &noise);
        transition
    }

    /// The covariance that `transition` would make of the present one: a look ahead that changes
    /// nothing.
    pub fn predicted_covariance(
        &self,
        transition: &ErrorTransition<T>,
    ) -> SMatrix<T, STATES, STATES> {
        let mut covariance = self.state.covariance;
        transition.propagate_covariance(&mut covariance, &self.process_noise());
        covariance
    }

    /// Takes in what a joint estimator outside has learnt about this filter's error.
    ///
    /// Gives the angle (rad, NED) at which the attitude error was re-centred; the estimator outside
    /// must re-centre its cross-covariance by the same ([`reset_rows`](crate::kalman::feedback::reset_rows)). A correction that is not
    /// finite changes nothing.
    pub fn correct_from_outside(&mut self, outside: &OutsideCorrection<T, STATES>) -> Vector3<T> {
        let d = &outside.correction;
        let gain = &outside.gain;
        let scaled = gain * outside.innovation_covariance;
        if !(d.norm_squared().is_finite() && scaled.norm_squared().is_finite()) {
            self.count_skipped();
            return Vector3::zeros();
        }
        let p = &mut self.state.covariance;
        for j in 0..STATES {
            for i in 0..=j {
                let shrunk =
                    p[(i, j)] - scaled[(i, 0)] * gain[(j, 0)] - scaled[(i, 1)] * gain[(j, 1)];
                p[(i, j)] = shrunk;
                p[(j, i)] = shrunk;
            }
        }
        self.inject(d)
    }

    /// Position north and east (m) and heading (rad, clockwise from north, from -pi to pi).
    #[inline]
    pub fn pose(&self) -> Vector3<T> {
        let position = &self.state.position;
        let forward = rotation::forward(&self.state.ned_from_body);
        Vector3::new(position.x, position.y, forward.y.atan2(forward.x))
    }

    /// The rows that make the error of [`Self::pose`] from the 15 errors: position north and east,
    /// and heading, `dpsi_z + tan(pitch) (cos(heading) dpsi_x + sin(heading) dpsi_y)` (E13).
    pub fn pose_from_error(&self) -> SMatrix<T, 3, STATES> {
        let forward = rotation::forward(&self.state.ned_from_body);
        let horizontal = forward.x * forward.x + forward.y * forward.y;
        let mut rows = SMatrix::zeros();
        rows[(0, POSITION)] = T::one();
        rows[(1, POSITION + 1)] = T::one();
        rows[(2, ATTITUDE + 2)] = T::one();
        // Pointing straight up or down there is no heading to speak of.
        if horizontal > lit(1e-12) {
            rows[(2, ATTITUDE)] = -forward.z * forward.x / horizontal;
            rows[(2, ATTITUDE + 1)] = -forward.z * forward.y / horizontal;
        }
        rows
    }

    #[inline]
    fn process_noise(&self) -> ProcessNoise<T> {
        let square = |x: T| x * x;
        ProcessNoise {
            gyroscope: square(self.config.gyroscope_noise_density),
            accelerometer: square(self.config.accelerometer_noise_density),
            gyroscope_bias: square(self.config.gyroscope_bias_random_walk),
            accelerometer_bias: square(self.config.accelerometer_bias_random_walk),
        }
    }

    /// Moves the correction from the error into the state (E11) and re-centres the covariance
    /// (E12). Gives the angle of the reset.
    #[inline]
    fn inject(&mut self, correction: &nalgebra::SVector<T, STATES>) -> Vector3<T> {
        let part = |first: usize| correction.fixed_rows::<3>(first).into_owned();
        let angle: Vector3<T> = part(ATTITUDE);
        let state = &mut self.state;
        state.ned_from_body = rotation::renormalize(&(so3::exp(&angle) * state.ned_from_body));
        state.velocity += part(VELOCITY);
        state.position += part(POSITION);
        state.accelerometer_bias += part(ACCELEROMETER_BIAS);
        state.gyroscope_bias += part(GYROSCOPE_BIAS);
        if !self.config.reset_jacobian {
            return Vector3::zeros();
        }
        reset_covariance(&mut state.covariance, &angle);
        angle
    }

    fn count_skipped(&mut self) {
        self.state.skipped = self.state.skipped.saturating_add(1);
    }
}

fn check_step<T: Scalar>(dt: T) -> Result<(), SkipReason> {
    if !dt.is_finite() {
        Err(SkipReason::NotFinite)
    } else if dt <= T::zero() {
        Err(SkipReason::NotNewer)
    } else if dt > lit(LONGEST_STEP_S) {
        Err(SkipReason::OutOfRange)
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod operations;
#[cfg(test)]
mod tests;
