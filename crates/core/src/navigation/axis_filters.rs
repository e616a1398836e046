//! Decoupled per-axis Kalman filters for position, velocity and acceleration bias: north, east, down.
//!
//! Read first: `docs/derivations/axis_filters.md`; Romaniuk & Gosiewski (2014), eqs 20-30. With
//! [`crate::attitude::axis_filters`] in front it is the paper's whole system. Use it to make the paper
//! again, or on a chip that holds nothing larger; [`super::ErrorStateFilter`] is better wherever it
//! fits, since it learns the tilt from the positions.
//!
//! # Model
//!
//! ```text
//! per axis  x = [s, v, b],  u = navigation acceleration - b                                  (A6)
//!           s <- s + v T + u T^2/2,  v <- v + u T,  P <- A P A^T + Q
//! noise     Q = s_a^2 [[T^4/4, T^3/2, 0], [T^3/2, T^2, 0], [0, 0, 0]] + diag(0, 0, T s_b^2)  (A7)
//! position  z = s + noise,  R = s_p^2,  once for each fix
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `s_a` | [`PositionAxisConfig::acceleration_std`] | m/s^2 |
//! | `s_b` | [`PositionAxisConfig::bias_random_walk`] | m/s^2/sqrt(s) |
//! | `s_p` | [`PositionAxisConfig::position_std`] | m |
//!
//! Frames: north, east, down. The bias is in navigation axes, so it changes when the vehicle turns; its
//! walk must be wide enough. `s_a` is the effective error of the acceleration, tilt leak included
//! (0.17 m/s^2 a degree), not the sensor's noise. Cost: about 30 multiplications a step for all three, and as many
//! for a fix: north and east have the same settings, so one covariance is that of both.

mod config;
mod covariance;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

pub use config::{PositionAxisConfig, PositionNoise};
use covariance::{AxisCovariance, AxisProcess};

use crate::earth::FrameChange;
use crate::kalman::covariance::resolvable_variance;
use crate::kalman::innovation::check_within;
use crate::kalman::{Innovation, Outcome, SkipReason};
pub use crate::navigation::validity::Validity;
use crate::navigation::validity::ValidityLimits;
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable, covariance, finite, not_negative};
use crate::scalar::{Scalar, lit};

/// Longest interval of a propagation, s.
const LONGEST_STEP_S: f64 = 10.0;
/// The usual interval, s: a first one that is the same needs no new noise.
const USUAL_STEP_S: f64 = 0.02;
/// Outliers in a row after which the state is what is wrong, if the next one could have been travelled to from the last ...
const OUTLIERS_ACCEPTED: u8 = 5;
/// ... and after which it is in any case.
const OUTLIERS_AT_MOST: u8 = 20;
/// Nothing that carries a receiver is faster, m/s: civil receivers give no fix above 515 m/s.
const FASTEST: f64 = 600.0;

/// One axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PositionAxis<T: Scalar> {
    /// Position (m), velocity (m/s), bias of the navigation acceleration (m/s^2).
    pub state: Vector3<T>,
    /// Covariance of the state.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix3<T>,
}

/// The covariance of axes with equal settings, and its noise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Uncertainty<T> {
    covariance: AxisCovariance<T>,
    /// What a step of the last length adds.
    process: AxisProcess<T>,
    /// Variance of the acceleration, and what a second adds to that of the bias.
    process_noise: [T; 2],
    /// Variance of a fix.
    position_noise: T,
}

impl<T: Scalar> Uncertainty<T> {
    fn of(config: &PositionAxisConfig<T>, position_std: T) -> Self {
        let process_noise = config.process(position_std);
        Self {
            covariance: AxisCovariance::starting_at(T::one()),
            process: AxisProcess::of_ones_over(lit(USUAL_STEP_S)).scaled(process_noise),
            process_noise,
            position_noise: config.measurement(position_std),
        }
    }

    /// Variance of a fix, and at least what the precision resolves.
    fn noise(&self) -> T {
        let stated = self.position_noise;
        resolvable_variance(stated, self.covariance.ss).unwrap_or(stated)
    }

    /// Variance of an innovation.
    fn of_innovation(&self) -> T {
        self.covariance.ss + self.noise()
    }
}

/// A fix that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Outlier<T: Scalar> {
    /// Position, m.
    position: Vector3<T>,
    /// Seconds since the last fix that was used.
    since_fix: T,
}

/// Everything that the filters remember: save it, restore it, and they continue exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PositionAxesState<T: Scalar> {
    position: Vector3<T>,
    velocity: Vector3<T>,
    /// Of the navigation acceleration.
    bias: Vector3<T>,
    /// Of north and of east: equal settings and common fixes make their covariances equal.
    horizontal: Uncertainty<T>,
    vertical: Uncertainty<T>,
    /// Interval of the last propagation, s.
    last_dt: T,
    /// Seconds since the last fix that was used; `None` before the first.
    since_fix: Option<T>,
    /// Number of the last fix that was looked at.
    last_fix: Option<u64>,
    /// Outliers in a row, and the last of them.
    outliers: u8,
    #[cfg_attr(feature = "serde", serde(default))]
    last_outlier: Option<Outlier<T>>,
}

/// The three filters: north, east, down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionAxisFilters<T: Scalar> {
    config: PositionAxisConfig<T>,
    state: PositionAxesState<T>,
}

impl<T: Scalar> Restorable for PositionAxisFilters<T> {
    type State = PositionAxesState<T>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        finite("position", &state.position)?;
        finite("velocity", &state.velocity)?;
        finite("bias", &state.bias)?;
        for axes in [&state.horizontal, &state.vertical] {
            covariance("covariance", &axes.covariance.matrix())?;
            not_negative("process noise", axes.process.numbers())?;
            let noise = axes.process_noise.iter().chain([&axes.position_noise]);
            not_negative("noise", noise)?;
        }
        let last_dt = [&state.last_dt];
        not_negative("times", state.since_fix.iter().chain(last_dt))?;
        if let Some(outlier) = &state.last_outlier {
            finite("outlier", &outlier.position)?;
            not_negative("times", [&outlier.since_fix])?;
        }
        self.state = state;
        Ok(())
    }
}

impl<T: Scalar> PositionAxisFilters<T> {
    /// Filters that wait for their first fix.
    ///
    /// # Errors
    /// The first parameter outside its permitted range.
    pub fn new(config: PositionAxisConfig<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self {
            config,
            state: PositionAxesState {
                position: Vector3::zeros(),
                velocity: Vector3::zeros(),
                bias: Vector3::zeros(),
                horizontal: Uncertainty::of(&config, config.position_std),
                vertical: Uncertainty::of(&config, config.vertical_position_std),
                last_dt: lit(USUAL_STEP_S),
                since_fix: None,
                last_fix: None,
                outliers: 0,
                last_outlier: None,
            },
        })
    }

    /// North, east and down, each with its covariance; meaningless while [`Validity::Aligning`].
    pub fn axes(&self) -> [PositionAxis<T>; 3] {
        let (s, v, b) = (&self.state.position, &self.state.velocity, &self.state.bias);
        let across = self.state.horizontal.covariance.matrix();
        let axis = |s: T, v: T, b: T, covariance: Matrix3<T>| PositionAxis {
            state: Vector3::new(s, v, b),
            covariance,
        };
        [
            axis(s.x, v.x, b.x, across),
            axis(s.y, v.y, b.y, across),
            axis(s.z, v.z, b.z, self.state.vertical.covariance.matrix()),
        ]
    }

    /// Position, m.
    pub fn position(&self) -> Vector3<T> {
        self.state.position
    }

    /// Velocity, m/s.
    pub fn velocity(&self) -> Vector3<T> {
        self.state.velocity
    }

    /// What the position is worth.
    pub fn validity(&self) -> Validity {
        ValidityLimits::default().judge(self.state.since_fix, self.state.horizontal.covariance.ss)
    }

    /// Goes on in another local frame. Axes that turn by some milliradians leave the variances as they are.
    pub fn move_origin(&mut self, change: &FrameChange<T>) {
        if !change.is_finite() {
            return;
        }
        let state = &mut self.state;
        state.position = change.position(&state.position);
        state.velocity = change.vector(&state.velocity);
        state.bias = change.vector(&state.bias);
        if let Some(outlier) = &mut state.last_outlier {
            outlier.position = change.position(&outlier.position);
        }
    }

    /// Moves on by `dt` seconds with the specific force (m/s^2, body axes forward, right, down) at the
    /// attitude `ned_from_body`; `gravity` (m/s^2) is that of the place. Before the first fix, and for
    /// `dt <= 0`, it does nothing.
    ///
    /// # Errors
    /// Why the sample is refused; the state is then untouched.
    pub fn propagate(
        &mut self,
        ned_from_body: &UnitQuaternion<T>,
        specific_force: &Vector3<T>,
        gravity: T,
        dt: T,
    ) -> Result<(), SkipReason> {
        // What is not finite stays so when it is turned.
        let norm = ned_from_body.as_ref().norm_squared();
        if (norm - T::one()).abs() < lit(1e-3) {
            self.propagate_in_ned(&(ned_from_body * specific_force), gravity, dt)
        } else {
            Err(SkipReason::NotFinite)
        }
    }

    /// [`Self::propagate`] with a specific force (m/s^2) that has been turned to north, east, down.
    ///
    /// # Errors
    /// Why the sample is refused; the state is then untouched.
    pub fn propagate_in_ned(
        &mut self,
        specific_force: &Vector3<T>,
        gravity: T,
        dt: T,
    ) -> Result<(), SkipReason> {
        check_within(specific_force, lit(1e4))?;
        if !gravity.is_finite() {
            return Err(SkipReason::NotFinite);
        }
        if gravity.abs() > lit(100.0) {
            return Err(SkipReason::OutOfRange);
        }
        // One that was good for the last step is good for this one.
        if dt != self.state.last_dt {
            if !dt.is_finite() {
                return Err(SkipReason::NotFinite);
            }
            if dt > lit(LONGEST_STEP_S) {
                return Err(SkipReason::OutOfRange);
            }
            if dt <= T::zero() {
                return Ok(());
            }
            self.state.last_dt = dt;
            let ones = AxisProcess::of_ones_over(dt);
            for axes in [&mut self.state.horizontal, &mut self.state.vertical] {
                axes.process = ones.scaled(axes.process_noise);
            }
        }
        let Some(since) = self.state.since_fix else {
            return Ok(());
        };
        let mut acceleration = *specific_force;
        acceleration.z += gravity;
        self.move_on(&acceleration, dt);
        self.state.since_fix = Some((since + dt).min(lit(1e6)));
        Ok(())
    }

    /// (A6) and (A7).
    fn move_on(&mut self, acceleration: &Vector3<T>, dt: T) {
        let half = dt * lit(0.5);
        let before = self.state.velocity;
        self.state.velocity += (acceleration - self.state.bias) * dt;
        // With the mean velocity, v T + u T^2/2.
        self.state.position += (before + self.state.velocity) * half;
        for axes in [&mut self.state.horizontal, &mut self.state.vertical] {
            axes.covariance.propagate(dt, &axes.process);
        }
    }

    /// Corrects with a fix (m, north, east, down). `number` counts the fixes of the receiver: one that is
    /// not above the last is held, not new, and refused. The first one starts the filters; one that jumps
    /// too far is left out, five times in a row, and then the filters start again at one that could have been
    /// travelled to from the one before, so that not one wild fix alone is followed; after twenty at any.
    pub fn update_position(&mut self, number: u64, position: &Vector3<T>) -> Innovation<T> {
        if let Err(reason) = check_within(position, lit(1e8)) {
            return Innovation::skipped(reason);
        }
        if self.state.last_fix.is_some_and(|last| number <= last) {
            return Innovation::skipped(SkipReason::NotNewer);
        }
        self.state.last_fix = Some(number);
        if self.state.since_fix.is_none() {
            self.start(position);
            return self.look_at(position).record(Outcome::Fused);
        }
        let fix = self.look_at(position);
        let limit = self.config.outlier_nis;
        if limit > T::zero() && fix.jump > limit {
            return self.outlier(position, &fix);
        }
        self.state.outliers = 0;
        self.state.last_outlier = None;
        self.correct(&fix);
        fix.record(Outcome::Fused)
    }

    fn look_at(&self, position: &Vector3<T>) -> FixInnovation<T> {
        let residual = position - self.state.position;
        let variances =
            [&self.state.horizontal, &self.state.vertical].map(Uncertainty::of_innovation);
        let inverses = variances.map(|variance| T::one() / variance);
        let [across, _] = inverses;
        FixInnovation {
            residual,
            variances,
            inverses,
            jump: (residual.x * residual.x + residual.y * residual.y) * across,
        }
    }

    fn correct(&mut self, fix: &FixInnovation<T>) {
        let [across, down] = fix.inverses;
        let (horizontal, vertical) = (&mut self.state.horizontal, &mut self.state.vertical);
        let r = horizontal.noise();
        let r_down = vertical.noise();
        let across = horizontal.covariance.update(r, across);
        let down = vertical.covariance.update(r_down, down);
        let (x, y, z) = (fix.residual.x, fix.residual.y, fix.residual.z);
        let by = |across: T, down: T| Vector3::new(across * x, across * y, down * z);
        self.state.position += by(across.x, down.x);
        self.state.velocity += by(across.y, down.y);
        self.state.bias += by(across.z, down.z);
        self.state.since_fix = Some(T::zero());
    }

    fn outlier(&mut self, position: &Vector3<T>, fix: &FixInnovation<T>) -> Innovation<T> {
        let count = self.state.outliers;
        let insists = count >= OUTLIERS_ACCEPTED && self.follows_the_last_outlier(position);
        if insists || count >= OUTLIERS_AT_MOST {
            self.start(position);
            return fix.record(Outcome::Inflated);
        }
        self.state.outliers += 1;
        self.state.last_outlier = self.state.since_fix.map(|since_fix| Outlier {
            position: *position,
            since_fix,
        });
        fix.record(Outcome::Gated)
    }

    /// Whether a receiver can have been here and at the outlier before.
    fn follows_the_last_outlier(&self, position: &Vector3<T>) -> bool {
        let (Some(last), Some(since_fix)) = (&self.state.last_outlier, self.state.since_fix) else {
            return false;
        };
        let way = (since_fix - last.since_fix) * lit(FASTEST);
        // Three standard deviations of each.
        let reach = way + self.config.position_std * lit(6.0);
        let (x, y) = (position.x - last.position.x, position.y - last.position.y);
        x * x + y * y <= reach * reach
    }

    fn start(&mut self, position: &Vector3<T>) {
        self.state.position = *position;
        self.state.velocity = Vector3::zeros();
        self.state.bias = Vector3::zeros();
        for axes in [&mut self.state.horizontal, &mut self.state.vertical] {
            axes.covariance = AxisCovariance::starting_at(axes.position_noise);
        }
        self.state.since_fix = Some(T::zero());
        self.state.outliers = 0;
        self.state.last_outlier = None;
    }
}

/// What a fix says against the state.
#[derive(Debug, Clone, Copy)]
struct FixInnovation<T> {
    residual: Vector3<T>,
    /// Of a residual across and of one down, and one over each.
    variances: [T; 2],
    inverses: [T; 2],
    /// Normalised squared residual of north and east.
    jump: T,
}

impl<T: Scalar> FixInnovation<T> {
    /// In line, so that a chip that does not look at it does not make it.
    #[inline(always)]
    fn record(&self, outcome: Outcome) -> Innovation<T> {
        let ([across, down], [_, inverse]) = (self.variances, self.inverses);
        let z = self.residual.z;
        Innovation {
            residual: self.residual,
            covariance: Matrix3::from_diagonal(&Vector3::new(across, across, down)),
            nis: self.jump + z * z * inverse,
            degrees_of_freedom: 3,
            outcome,
        }
    }
}

#[cfg(test)]
mod tests;
