//! Dead reckoning of a ship: compass and log through the water, corrected by positions, with the current
//! as a state.
//!
//! Read first: `docs/derivations/dead_reckoning.md`, whose equation numbers (R..) stand at the lines below.
//! Use it where there is no inertial measurement unit but a heading and a speed, or where there are positions
//! alone (then the "current" is the whole velocity, and it is a filter of constant velocity). Do not use it
//! where an inertial measurement unit is at hand: [`super::ErrorStateFilter`] knows the attitude, too.
//!
//! # Model
//!
//! ```text
//! x = [position north, east, current north, east],  w: velocity through the water           (R1)
//! position <- position + (w + current) T,  current walks
//! Q: white velocity error of density s_w, current walk s_c, without a log lambda s_c         (R2, R5)
//! position z = position + noise,  velocity over ground z = w + current + noise               (R3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `s_w` | [`DeadReckoningConfig::water_velocity_noise_density`] | (m/s)/sqrt(Hz) |
//! | `s_c` | [`DeadReckoningConfig::current_random_walk`], without a log [`DeadReckoningConfig::velocity_random_walk`] | (m/s)/sqrt(s) |
//!
//! Frame: local north, east. The errors of log and compass that last (a scale, a deviation) go into the
//! current, which is why it walks; after a turn it is wrong by as much as they changed. Cost: about 60
//! multiplications a step, 40 an update.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector3, Vector4};

use super::{HeldFixes, Validity, ValidityLimits};
use crate::earth::FrameChange;
use crate::kalman::covariance::{cap_variance, symmetrize};
use crate::kalman::gate::CHI_SQUARE;
use crate::kalman::scalar_update::update_one_state;
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::parameters::{ConfigError, parameters};
use crate::restorable::{InvalidState, Restorable, covariance, finite, not_negative};
use crate::scalar::{Scalar, lit};

/// Longest interval of a propagation, s.
const LONGEST_STEP_S: f64 = 10.0;
/// Fastest velocity through the water, m/s.
const FASTEST: f64 = 100.0;
/// So many fixes outside the gate in a row, and the state is what is wrong; after fixes that were told again it is one.
const OUTLIERS_ACCEPTED: u8 = 5;
const OUTLIERS_ACCEPTED_AFTER_COPIES: u8 = 1;
/// Without a log the walk follows the innovations (R5): so fast, one outside the gate by so much at once, and its variance is so many
/// times that of the parameter at most.
const MANOEUVRE_GAIN: f64 = 0.2;
const MANOEUVRE_AT_ONCE: f64 = 100.0;
const MANOEUVRE_MOST: f64 = 1e4;
/// Largest position error that still means something, m.
const FARTHEST: f64 = 1e6;
/// Nothing is measured better than this, m and m/s.
const LEAST_STD: f64 = 1e-4;

parameters! {
    /// Parameters of dead reckoning.
    pub struct DeadReckoningConfig, groups {
        validity: ValidityLimits, [ValidityLimits::log()],
            "when a position is dead reckoning, and when it is invalid";
    };

    water_velocity_noise_density: T, "(m/s)/sqrt(Hz)", From(1e-6, 1e3), [0.3],
        "white error of the velocity through the water",
        "Raising it follows the fixes more.";
    current_random_walk: T, "(m/s)/sqrt(s)", From(1e-6, 1e3), [0.02],
        "random walk of the current",
        "Raising it follows a change of current, or of what log and compass do wrong, faster; an outage grows faster,",
        "too.";
    velocity_random_walk: T, "(m/s)/sqrt(s)", From(1e-6, 1e3), [1.0],
        "least random walk of the velocity while there is no log",
        "What a vessel's or a vehicle's accelerations amount to; where fixes show more, more is learnt. Raising it follows",
        "the fixes more.";
    initial_current_std: T, "m/s", From(1e-4, 1e3), [2.0],
        "standard deviation of the current at the start";
}

/// Everything the filter remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DeadReckoningState<T: Scalar> {
    /// Position north, east (m), current north, east (m/s).
    pub state: Vector4<T>,
    /// Covariance of the state.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix4<T>,
    /// Last velocity through the water, north, east, m/s; zero before the first.
    pub water_velocity: Vector2<T>,
    /// Whether there ever was one.
    pub has_log: bool,
    /// Seconds since the last fix that was used; `None` before the first.
    pub since_fix_s: Option<T>,
    /// Fixes outside the gate in a row.
    pub outliers: u8,
    /// By how much the variance of the velocity's walk is larger than stated, as the innovations show; 1 or more (R5).
    pub manoeuvre: T,
    /// The last fix, north, east, m, used or not.
    pub last_fix: Option<Vector2<T>>,
    /// Whether a table tells it again in every row.
    pub held_fixes: HeldFixes<T>,
    /// Whether a fix had the very digits of the one before it since one was used that had not (R6).
    pub is_copied: bool,
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeadReckoning<T: Scalar> {
    config: DeadReckoningConfig<T>,
    state: DeadReckoningState<T>,
}

impl<T: Scalar> Restorable for DeadReckoning<T> {
    type State = DeadReckoningState<T>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        finite("position and current", &state.state)?;
        covariance("covariance", &state.covariance)?;
        finite("velocity through the water", &state.water_velocity)?;
        not_negative("time since the last fix", &state.since_fix_s)?;
        not_negative("size of manoeuvres", &Some(state.manoeuvre))?;
        if let Some(fix) = &state.last_fix {
            finite("last fix", fix)?;
        }
        state.held_fixes.check()?;
        self.state = state;
        Ok(())
    }
}

impl<T: Scalar> DeadReckoning<T> {
    /// A filter that waits for its first fix.
    ///
    /// # Errors
    /// The first parameter outside its permitted range.
    pub fn new(config: DeadReckoningConfig<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self {
            config,
            state: DeadReckoningState {
                state: Vector4::zeros(),
                covariance: Matrix4::identity(),
                water_velocity: Vector2::zeros(),
                has_log: false,
                since_fix_s: None,
                outliers: 0,
                manoeuvre: T::one(),
                last_fix: None,
                held_fixes: HeldFixes::default(),
                is_copied: false,
            },
        })
    }

    /// The state, to look at.
    pub fn state(&self) -> &DeadReckoningState<T> {
        &self.state
    }

    /// Position north, east, m.
    pub fn position(&self) -> Vector2<T> {
        self.state.state.fixed_rows::<2>(0).into_owned()
    }

    /// Velocity over ground north, east, m/s.
    pub fn velocity(&self) -> Vector2<T> {
        self.state.water_velocity + self.current()
    }

    /// The current north, east, m/s: what log and compass do not explain.
    pub fn current(&self) -> Vector2<T> {
        self.state.state.fixed_rows::<2>(2).into_owned()
    }

    /// Covariance of the position, m^2.
    pub fn position_covariance(&self) -> Matrix2<T> {
        self.state.covariance.fixed_view::<2, 2>(0, 0).into_owned()
    }

    /// What the position is worth.
    pub fn validity(&self) -> Validity {
        let variance = self.state.covariance.m11.max(self.state.covariance.m22);
        let since = self.state.since_fix_s;
        self.config.validity.judge(since, variance)
    }

    /// Goes on in another local frame; the ship is at `down` metres below the plane of the old one. Gives how far it is below
    /// that of the new one.
    pub fn move_origin(&mut self, change: &FrameChange<T>, down: T) -> T {
        let state = &mut self.state;
        let place = Vector3::new(state.state.x, state.state.y, down);
        let place = change.position(&place);
        if !place.norm_squared().is_finite() {
            return down;
        }
        let (sin, cos) = change.heading().sin_cos();
        let turned = Matrix2::new(cos, -sin, sin, cos);
        let mut turn = Matrix4::zeros();
        for first in [0, 2] {
            turn.fixed_view_mut::<2, 2>(first, first).copy_from(&turned);
        }
        state.state = turn * state.state;
        (state.state.x, state.state.y) = (place.x, place.y);
        state.water_velocity = turned * state.water_velocity;
        // Its digits are others in the new frame.
        state.last_fix = None;
        state.covariance = turn * state.covariance * turn.transpose();
        symmetrize(&mut state.covariance);
        place.z
    }

    /// Takes a velocity through the water (m/s, north, east); it holds until the next.
    ///
    /// # Errors
    /// Why it is refused; the one before then holds on.
    pub fn water_velocity(&mut self, velocity: &Vector2<T>) -> Result<(), SkipReason> {
        check2(velocity, FASTEST)?;
        if !self.state.has_log && self.state.since_fix_s.is_some() {
            self.begin_with_log(velocity);
        }
        self.state.water_velocity = *velocity;
        self.state.has_log = true;
        Ok(())
    }

    /// The current was the whole velocity until now: what the log says is taken out of it, or it begins where that was not known.
    fn begin_with_log(&mut self, water: &Vector2<T>) {
        let prior = self.config.initial_current_std.powi(2);
        for axis in 0..2 {
            let current = axis + 2;
            self.state.state[current] -= water[axis];
            if self.state.covariance[(current, current)] > prior {
                self.forget(current, T::zero(), prior);
            }
        }
    }

    /// A state begins anew, with this value and variance, correlated with nothing.
    fn forget(&mut self, index: usize, value: T, variance: T) {
        self.state.state[index] = value;
        self.state.covariance.row_mut(index).fill(T::zero());
        self.state.covariance.column_mut(index).fill(T::zero());
        self.state.covariance[(index, index)] = variance;
    }

    /// Moves on by `dt` seconds (R1, R2). Before the first fix, and for `dt <= 0`, it does nothing.
    ///
    /// # Errors
    /// Why the step is refused; the state is then untouched.
    pub fn propagate(&mut self, dt: T) -> Result<(), SkipReason> {
        if !dt.is_finite() {
            return Err(SkipReason::NotFinite);
        }
        if dt > lit(LONGEST_STEP_S) {
            return Err(SkipReason::OutOfRange);
        }
        self.state.held_fixes.advance(dt);
        let Some(since) = self.state.since_fix_s.filter(|_| dt > T::zero()) else {
            return Ok(());
        };
        let moved = self.velocity() * dt;
        self.state.state.x += moved.x;
        self.state.state.y += moved.y;
        let square = |x: T| x * x;
        let white = square(self.config.water_velocity_noise_density) * dt;
        let walk = if self.state.has_log {
            square(self.config.current_random_walk)
        } else {
            square(self.config.velocity_random_walk) * self.state.manoeuvre
        };
        let walk = walk * dt;
        // What the walk adds to the position within the step; a current is too slow for that.
        let [across, within] = match self.state.has_log {
            true => [T::zero(); 2],
            false => [walk * dt * lit(0.5), walk * dt * dt / lit(3.0)],
        };
        let p = &mut self.state.covariance;
        for axis in 0..2 {
            let rows = p.row(axis) + p.row(axis + 2) * dt;
            p.set_row(axis, &rows);
            let columns = p.column(axis) + p.column(axis + 2) * dt;
            p.set_column(axis, &columns);
        }
        for axis in 0..2 {
            p[(axis, axis)] += white + within;
            p[(axis, axis + 2)] += across;
            p[(axis + 2, axis)] += across;
            p[(axis + 2, axis + 2)] += walk;
            cap_variance(p, axis, square(lit(FARTHEST)));
            cap_variance(p, axis + 2, lit(FASTEST * FASTEST));
        }
        self.state.since_fix_s = Some((since + dt).min(lit(1e6)));
        Ok(())
    }

    /// Corrects with a position (m, north, east) and its standard deviation per axis. The first one starts
    /// the filter; one that jumps too far is left out, five times in a row, and then the position starts again
    /// there, with the current kept; without a log the velocity starts again as well. One with the very digits of
    /// the last is not used where a table tells every fix again, nor where the ship has gone on (R6).
    pub fn update_position(&mut self, position: &Vector2<T>, std: T) -> Innovation<T> {
        if let Err(reason) = check2(position, 1e8).and_then(|()| check_std(std)) {
            return Innovation::skipped(reason);
        }
        let variance = square_of(std);
        let is_copy = self.state.last_fix.replace(*position) == Some(*position);
        self.state.is_copied |= is_copy;
        if self.state.held_fixes.is_told_again(is_copy) {
            return Innovation::skipped(SkipReason::Repeated);
        }
        if self.state.since_fix_s.is_none() {
            // Of the velocity of a vehicle without a log nothing is known.
            let std = match self.state.has_log {
                true => self.config.initial_current_std,
                false => lit(FASTEST),
            };
            self.state.covariance.m33 = std.powi(2);
            self.state.covariance.m44 = std.powi(2);
            self.start(position, variance);
            return self.record(&Vector2::zeros(), 0, variance, Outcome::Fused);
        }
        let residual = position - self.position();
        let record = self.record(&residual, 0, variance, Outcome::Fused);
        let is_outlier = record.nis > outlier_nis();
        if is_copy && is_outlier && self.is_moving() {
            return Innovation::skipped(SkipReason::Repeated);
        }
        self.learn_manoeuvres(record.nis);
        if is_outlier {
            return self.outlier(position, variance, record);
        }
        self.state.outliers = 0;
        self.state.is_copied &= is_copy;
        self.fuse(0, &residual, variance);
        self.state.since_fix_s = Some(T::zero());
        record
    }

    /// Corrects with a velocity over ground (m/s, north, east) and its standard deviation per axis.
    pub fn update_velocity(&mut self, velocity: &Vector2<T>, std: T) -> Innovation<T> {
        if let Err(reason) = check2(velocity, FASTEST).and_then(|()| check_std(std)) {
            return Innovation::skipped(reason);
        }
        if self.state.since_fix_s.is_none() {
            return Innovation::skipped(SkipReason::NotInitialized);
        }
        let residual = velocity - self.velocity();
        // The log's own noise, over the second that it is averaged for, is in the difference, too.
        let log = if self.state.has_log {
            self.config.water_velocity_noise_density
        } else {
            T::zero()
        };
        let variance = square_of(std) + log * log;
        let record = self.record(&residual, 2, variance, Outcome::Fused);
        self.learn_manoeuvres(record.nis);
        if record.nis > outlier_nis() {
            return Innovation {
                outcome: Outcome::Gated,
                ..record
            };
        }
        self.fuse(2, &residual, variance);
        record
    }

    /// Whether the velocity over ground is none of a ship that lies still, as surely as an outlier is none of the noise.
    fn is_moving(&self) -> bool {
        let standing = self.record(&self.velocity(), 2, T::zero(), Outcome::Fused);
        standing.nis > outlier_nis()
    }

    /// Where innovations of two components are larger than their variance, the velocity walks faster than stated (R5).
    fn learn_manoeuvres(&mut self, nis: T) {
        if self.state.has_log || !nis.is_finite() {
            return;
        }
        let ratio = nis * lit(0.5);
        let factor = if nis > outlier_nis() {
            ratio.min(lit(MANOEUVRE_AT_ONCE))
        } else {
            (lit::<T>(MANOEUVRE_GAIN) * (ratio - T::one())).exp()
        };
        let learnt = self.state.manoeuvre * factor;
        self.state.manoeuvre = learnt.clamp(T::one(), lit(MANOEUVRE_MOST));
    }

    fn outlier(
        &mut self,
        position: &Vector2<T>,
        variance: T,
        record: Innovation<T>,
    ) -> Innovation<T> {
        let most = match self.state.is_copied {
            true => OUTLIERS_ACCEPTED_AFTER_COPIES,
            false => OUTLIERS_ACCEPTED,
        };
        let accepted = self.state.outliers >= most;
        if accepted {
            self.state.is_copied = false;
            if !self.state.has_log {
                for velocity in 2..4 {
                    self.forget(velocity, self.state.state[velocity], lit(FASTEST * FASTEST));
                }
            }
            self.start(position, variance);
            self.state.outliers = 0;
        } else {
            self.state.outliers += 1;
        }
        let outcome = if accepted {
            Outcome::Inflated
        } else {
            Outcome::Gated
        };
        Innovation { outcome, ..record }
    }

    /// Puts the position where the fix is; it is no longer correlated with the current.
    fn start(&mut self, position: &Vector2<T>, variance: T) {
        for axis in 0..2 {
            self.forget(axis, position[axis], variance);
        }
        self.state.since_fix_s = Some(T::zero());
    }

    /// Two scalar measurements of the states `first` and `first + 1` (R3).
    fn fuse(&mut self, first: usize, residual: &Vector2<T>, variance: T) {
        let mut correction = Vector4::zeros();
        let p = &mut self.state.covariance;
        for axis in 0..2 {
            // A variance that is not positive changes nothing.
            let _ = update_one_state(p, &mut correction, first + axis, residual[axis], variance);
        }
        self.state.state += correction;
    }

    fn record(
        &self,
        residual: &Vector2<T>,
        first: usize,
        variance: T,
        outcome: Outcome,
    ) -> Innovation<T> {
        let block = self.state.covariance.fixed_view::<2, 2>(first, first);
        let s = block + Matrix2::identity() * variance;
        let determinant = s.m11 * s.m22 - s.m12 * s.m21;
        let [x, y] = [residual.x, residual.y];
        let nis = (x * x * s.m22 - x * y * (s.m12 + s.m21) + y * y * s.m11) / determinant;
        let mut covariance = nalgebra::Matrix3::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&s);
        Innovation {
            residual: Vector3::new(x, y, T::zero()),
            covariance,
            nis,
            degrees_of_freedom: 2,
            outcome,
        }
    }
}

/// 99.9 % of two degrees of freedom.
fn outlier_nis<T: Scalar>() -> T {
    let [_, (_, [_, _, quantile]), _] = CHI_SQUARE;
    lit(quantile)
}

fn check2<T: Scalar>(v: &Vector2<T>, longest: f64) -> Result<(), SkipReason> {
    let longest: T = lit(longest);
    let squared = v.norm_squared();
    if !squared.is_finite() {
        Err(SkipReason::NotFinite)
    } else if squared > longest * longest {
        Err(SkipReason::OutOfRange)
    } else {
        Ok(())
    }
}

/// The variance of a fix, and at least that of [`LEAST_STD`].
fn square_of<T: Scalar>(std: T) -> T {
    let std = std.max(lit(LEAST_STD));
    std * std
}

fn check_std<T: Scalar>(std: T) -> Result<(), SkipReason> {
    if !std.is_finite() {
        Err(SkipReason::NotFinite)
    } else if std > T::zero() && std <= lit(FARTHEST) {
        Ok(())
    } else {
        Err(SkipReason::OutOfRange)
    }
}

#[cfg(test)]
mod tests;
