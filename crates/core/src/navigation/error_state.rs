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
//! states. Limits: attitude errors
//! above some 20 degrees are beyond the linear model; the heading of a body that points straight
//! up or down is undefined.

mod aiding;
pub(in crate::navigation) mod sparse;
mod state;

use nalgebra::{SMatrix, Vector3};

pub use aiding::{GnssCompassFix, GnssCompassUpdate};
pub use sparse::{
    LEAST_WEIGHT, REJECTIONS_ACCEPTED, ROW_ELEMENTS, Row, SIDE, SparseMeasurement, robust_weight,
};
pub use state::NavigationState;

use super::transition::{ErrorTransition, ProcessNoise};
use super::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, STATES, VELOCITY};
use crate::geometry::{rotation, so3};
use crate::kalman::feedback::reset_covariance;
use crate::kalman::innovation::check_vector;
use crate::kalman::shear::times;
use crate::kalman::{NavigationPose, OutsideCorrection, SkipReason};
use crate::parameters::{ConfigError, Range, parameters};
use crate::restorable::{InvalidState, Restorable};
use crate::scalar::{Scalar, lit};

/// Largest angular rate (rad/s) and specific force (m/s^2) that a sensor can have measured.
const FASTEST_RATE: f64 = 1e3;
const LARGEST_FORCE: f64 = 1e4;
/// Longest inertial interval, s.
const LONGEST_STEP_S: f64 = 10.0;

parameters! {
    /// Parameters of the filter.
    pub struct ErrorStateConfig;

    accelerometer_noise_density: T, "(m/s^2)/sqrt(Hz)", From(0.0, 100.0), [0.01],
        "white noise of the accelerometer",
        "Raising it makes the filter follow aiding more quickly.";
    gyroscope_noise_density: T, "(rad/s)/sqrt(Hz)", From(0.0, 10.0), [0.001],
        "white noise of the gyroscope",
        "Raising it makes the filter follow the compass more quickly.";
    accelerometer_bias_random_walk: T, "(m/s^2)/sqrt(s)", From(0.0, 10.0), [0.0],
        "random walk of the accelerometer bias",
        "Raising it lets the bias move.";
    gyroscope_bias_random_walk: T, "(rad/s)/sqrt(s)", From(0.0, 1.0), [0.0],
        "random walk of the gyroscope bias",
        "Raising it lets the bias move.";
    gravity: T, "m/s^2", From(0.0, 1e4), [9.806_65],
        "gravity";
    reset_jacobian: bool, "-", Flag, [true],
        "whether the attitude covariance is re-centred at the corrected attitude (E12)",
        "Its effect is a fraction of a per cent.";
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

impl<T: Scalar> ErrorStateFilter<T> {
    /// A filter that continues from `state`.
    ///
    /// # Errors
    /// The first parameter outside its range, or `"state"` when the state is not
    /// [usable](NavigationState::is_usable).
    pub fn new(
        config: ErrorStateConfig<T>,
        state: NavigationState<T>,
    ) -> Result<Self, ConfigError> {
        config.validate()?;
        if !state.is_usable() {
            return Err(ConfigError {
                field: "state",
                range: Range::Described("a rotation and finite numbers, with a covariance"),
            });
        }
        Ok(Self {
            config,
            state: state.with_symmetric_covariance(),
        })
    }

    /// The settings.
    pub fn config(&self) -> &ErrorStateConfig<T> {
        &self.config
    }

    /// The state, to look at.
    pub fn state(&self) -> &NavigationState<T> {
        &self.state
    }

    /// Pose of the last inertial sample with the covariance of the errors, as of the last [`Self::catch_up`]: for a tracker.
    pub fn navigation_pose(&self) -> NavigationPose<'_, T, STATES> {
        NavigationPose {
            pose: self.pose(),
            covariance: &self.state.covariance,
            pose_from_error: self.pose_from_error(),
        }
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

    /// Noise densities of gyroscope and accelerometer from now on, (rad/s)/sqrt(Hz) and (m/s^2)/sqrt(Hz).
    pub fn set_noise_densities(&mut self, [gyroscope, accelerometer]: [T; 2]) {
        self.config.gyroscope_noise_density = gyroscope;
        self.config.accelerometer_noise_density = accelerometer;
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
        let transition = self.catch_up_without_limits();
        self.state.hold_covariance();
        transition
    }

    /// The same for who limits the covariance itself, and what is correlated with it.
    #[inline]
    pub(super) fn catch_up_without_limits(&mut self) -> ErrorTransition<T> {
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
mod tests;
