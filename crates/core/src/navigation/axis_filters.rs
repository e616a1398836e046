//! Position, velocity and acceleration bias by three independent Kalman filters, one an axis.
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
//! (0.17 m/s^2 a degree), not the sensor's noise. Cost: about 60 multiplications a step for all three.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::kalman::innovation::check_vector;
use crate::kalman::{Innovation, Outcome, SkipReason};
pub use crate::navigation::validity::Validity;
use crate::navigation::validity::ValidityLimits;
use crate::scalar::{Scalar, lit};

/// Longest interval of a propagation, s.
const LONGEST_STEP_S: f64 = 10.0;
/// Largest variances: position m^2, velocity m^2/s^2, bias m^2/s^4. Beyond nothing is known.
const LARGEST: [f64; 3] = [1e10, 1e6, 100.0];
/// Outliers in a row after which the state is what is wrong.
const OUTLIERS_BELIEVED: u8 = 5;
/// Which noise stands where.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum PositionNoise {
    /// Acceleration is off by `s_a`, positions by `s_p`, the bias walks (A7).
    #[default]
    Physical,
    /// The paper's eqs 29 and 30 to the letter: `Q` with `s_p^2`, `R = s_a` (not squared), and a bias
    /// that does not walk.
    Printed,
    /// The same with the names exchanged back: `Q` with `s_a^2`, `R = s_p^2`, no walk.
    PrintedNamesSwapped,
}

/// Settings of the three filters.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        default,
        deny_unknown_fields,
        bound(
            serialize = "T: serde::Serialize",
            deserialize = "T: Scalar + serde::Deserialize<'de>"
        )
    )
)]
pub struct PositionAxisConfig<T> {
    /// Effective error of the acceleration, m/s^2, default 1.5 (walking; driving 3). Raising it
    /// follows the fixes more.
    pub acceleration_std: T,
    /// Random walk of the bias, m/s^2/sqrt(s), default 1e-2. Raising it follows turns faster.
    pub bias_random_walk: T,
    /// Error of a fix per horizontal axis, m, default 2.55: 3 m of circular error probable.
    pub position_std: T,
    /// Error of a fix downwards, m, default 6.
    pub vertical_position_std: T,
    /// Which of them stands where, default `physical`.
    pub noise: PositionNoise,
    /// Normalised innovation squared of north and east above which a fix is left out, default 13.8 (99.9 % of two
    /// degrees of freedom); 0, as in the paper, believes every fix. Raising it lets outliers in.
    pub outlier_nis: T,
}

impl<T: Scalar> Default for PositionAxisConfig<T> {
    fn default() -> Self {
        Self {
            acceleration_std: lit(1.5),
            bias_random_walk: lit(1e-2),
            position_std: lit(2.55),
            vertical_position_std: lit(6.0),
            noise: PositionNoise::Physical,
            outlier_nis: lit(13.8),
        }
    }
}

impl<T: Scalar> PositionAxisConfig<T> {
    /// Name of the first setting that makes no sense.
    pub fn senseless(&self) -> Option<&'static str> {
        let positive = |x: T| x > lit(1e-6) && x <= lit(1e4);
        if !positive(self.acceleration_std) {
            Some("acceleration_std")
        } else if !(self.bias_random_walk >= T::zero() && self.bias_random_walk <= lit(1e4)) {
            Some("bias_random_walk")
        } else if !positive(self.position_std) {
            Some("position_std")
        } else if !positive(self.vertical_position_std) {
            Some("vertical_position_std")
        } else if !(self.outlier_nis >= T::zero() && self.outlier_nis <= lit(1e6)) {
            Some("outlier_nis")
        } else {
            None
        }
    }

    /// Variance of the acceleration in `Q`, and what a step of `dt` seconds adds to the bias.
    fn process(&self, axis: usize, dt: T) -> [T; 2] {
        let square = |x: T| x * x;
        match self.noise {
            PositionNoise::Physical => {
                let walk = square(self.bias_random_walk);
                [square(self.acceleration_std), dt * walk]
            }
            PositionNoise::Printed => [square(self.position_std_of(axis)), T::zero()],
            PositionNoise::PrintedNamesSwapped => [square(self.acceleration_std), T::zero()],
        }
    }

    fn measurement(&self, axis: usize) -> T {
        let std = self.position_std_of(axis);
        match self.noise {
            PositionNoise::Printed => self.acceleration_std,
            _ => std * std,
        }
    }

    fn position_std_of(&self, axis: usize) -> T {
        if axis == 2 {
            self.vertical_position_std
        } else {
            self.position_std
        }
    }
}

/// One axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionAxis<T: Scalar> {
    /// Position (m), velocity (m/s), bias of the navigation acceleration (m/s^2).
    pub state: Vector3<T>,
    /// Covariance of the state.
    pub covariance: Matrix3<T>,
}

impl<T: Scalar> PositionAxis<T> {
    fn starting_at(position: T, variance: T) -> Self {
        Self {
            state: Vector3::new(position, T::zero(), T::zero()),
            covariance: Matrix3::from_diagonal(&Vector3::new(variance, T::one(), lit(0.1))),
        }
    }

    fn propagate(&mut self, acceleration: T, dt: T, [variance, walk]: [T; 2]) {
        let half = dt * dt * lit(0.5);
        let u = acceleration - self.state.z;
        let moved = self.state.y * dt + u * half;
        self.state.x += moved;
        self.state.y += u * dt;
        let zero = T::zero();
        let one = T::one();
        let a = Matrix3::new(one, dt, -half, zero, one, -dt, zero, zero, one);
        // The acceleration's error, held over the step, enters as [T^2/2, T, 0].
        let input = Vector3::new(half, dt, zero);
        let mut p = a * self.covariance * a.transpose() + input * input.transpose() * variance;
        p.m33 += walk;
        self.covariance = capped(&p);
    }

    /// Innovation and its variance of a position of variance `r`.
    fn innovation(&self, position: T, r: T) -> (T, T) {
        (position - self.state.x, self.covariance.m11 + r)
    }

    fn update(&mut self, innovation: T, variance: T) {
        let column = self.covariance.column(0).into_owned();
        self.state += column * (innovation / variance);
        let p = self.covariance - column * column.transpose() / variance;
        self.covariance = (p + p.transpose()) * lit::<T>(0.5);
    }
}

/// A symmetric covariance whose variances stay where numbers still mean something.
fn capped<T: Scalar>(p: &Matrix3<T>) -> Matrix3<T> {
    let limits = LARGEST.map(lit::<T>);
    let mut scale = Vector3::repeat(T::one());
    for ((s, variance), limit) in scale.iter_mut().zip(p.diagonal().iter()).zip(limits) {
        if *variance > limit {
            *s = (limit / *variance).sqrt();
        }
    }
    let scaled = p.component_mul(&(scale * scale.transpose()));
    (scaled + scaled.transpose()) * lit::<T>(0.5)
}

/// The three filters: north, east, down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionAxisFilters<T: Scalar> {
    config: PositionAxisConfig<T>,
    axes: [PositionAxis<T>; 3],
    /// Seconds since the last fix that was used; `None` before the first.
    since_fix: Option<T>,
    /// Number of the last fix that was looked at.
    last_fix: Option<u64>,
    outliers: u8,
}

impl<T: Scalar> PositionAxisFilters<T> {
    /// Filters that wait for their first fix.
    ///
    /// # Errors
    /// The name of the first setting that makes no sense.
    pub fn new(config: PositionAxisConfig<T>) -> Result<Self, &'static str> {
        if let Some(name) = config.senseless() {
            return Err(name);
        }
        Ok(Self {
            config,
            axes: [PositionAxis::starting_at(T::zero(), T::one()); 3],
            since_fix: None,
            last_fix: None,
            outliers: 0,
        })
    }

    /// North, east and down, each with its covariance; meaningless while [`Validity::Aligning`].
    pub fn axes(&self) -> &[PositionAxis<T>; 3] {
        &self.axes
    }

    /// Position, m.
    pub fn position(&self) -> Vector3<T> {
        Vector3::from(self.axes.map(|axis| axis.state.x))
    }

    /// Velocity, m/s.
    pub fn velocity(&self) -> Vector3<T> {
        Vector3::from(self.axes.map(|axis| axis.state.y))
    }

    /// What the position is worth.
    pub fn validity(&self) -> Validity {
        let [north, east, _] = self.axes.map(|axis| axis.covariance.m11);
        let variance = north.max(east);
        ValidityLimits::default().judge(self.since_fix, variance)
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
        check_vector(specific_force, T::zero(), lit(1e4))?;
        let norm = ned_from_body.as_ref().norm_squared();
        if !(dt.is_finite() && gravity.is_finite() && (norm - T::one()).abs() < lit(1e-3)) {
            return Err(SkipReason::NotFinite);
        }
        if dt > lit(LONGEST_STEP_S) {
            return Err(SkipReason::OutOfRange);
        }
        let Some(since) = self.since_fix.filter(|_| dt > T::zero()) else {
            return Ok(());
        };
        let mut acceleration = ned_from_body * specific_force;
        acceleration.z += gravity;
        for (i, (axis, a)) in self.axes.iter_mut().zip(acceleration.iter()).enumerate() {
            axis.propagate(*a, dt, self.config.process(i, dt));
        }
        self.since_fix = Some((since + dt).min(lit(1e6)));
        Ok(())
    }

    /// Corrects with a fix (m, north, east, down). `number` counts the fixes of the receiver: one that is
    /// not above the last is held, not new, and refused. The first one starts the filters; one that jumps
    /// too far is left out, five times in a row, and then the filters start again there.
    pub fn update_position(&mut self, number: u64, position: &Vector3<T>) -> Innovation<T> {
        if let Err(reason) = check_vector(position, T::zero(), lit(1e8)) {
            return Innovation::skipped(reason);
        }
        if self.last_fix.is_some_and(|last| number <= last) {
            return Innovation::skipped(SkipReason::NotNewer);
        }
        self.last_fix = Some(number);
        if self.since_fix.is_none() {
            self.start(position);
            return self.record(Vector3::zeros(), Outcome::Fused);
        }
        let mut residual = Vector3::zeros();
        let mut variances = [T::one(); 3];
        for (i, (axis, z)) in self.axes.iter().zip(position.iter()).enumerate() {
            let (innovation, variance) = axis.innovation(*z, self.config.measurement(i));
            if let (Some(r), Some(v)) = (residual.get_mut(i), variances.get_mut(i)) {
                (*r, *v) = (innovation, variance);
            }
        }
        let [north, east, _] = variances;
        let jump = residual.x * residual.x / north + residual.y * residual.y / east;
        let limit = self.config.outlier_nis;
        if limit > T::zero() && jump > limit {
            return self.outlier(position, residual);
        }
        self.outliers = 0;
        let record = self.record(residual, Outcome::Fused);
        let pairs = residual.iter().zip(variances);
        for (axis, (innovation, variance)) in self.axes.iter_mut().zip(pairs) {
            axis.update(*innovation, variance);
        }
        self.since_fix = Some(T::zero());
        record
    }

    fn outlier(&mut self, position: &Vector3<T>, residual: Vector3<T>) -> Innovation<T> {
        let believed = self.outliers >= OUTLIERS_BELIEVED;
        let outcome = if believed {
            Outcome::Inflated
        } else {
            Outcome::Gated
        };
        let record = self.record(residual, outcome);
        if believed {
            self.start(position);
        } else {
            self.outliers += 1;
        }
        record
    }

    fn start(&mut self, position: &Vector3<T>) {
        for (i, (axis, z)) in self.axes.iter_mut().zip(position.iter()).enumerate() {
            *axis = PositionAxis::starting_at(*z, self.config.measurement(i));
        }
        self.since_fix = Some(T::zero());
        self.outliers = 0;
    }

    fn record(&self, residual: Vector3<T>, outcome: Outcome) -> Innovation<T> {
        let mut variances = Vector3::zeros();
        for (i, (v, axis)) in variances.iter_mut().zip(&self.axes).enumerate() {
            *v = axis.covariance.m11 + self.config.measurement(i);
        }
        Innovation {
            residual,
            covariance: Matrix3::from_diagonal(&variances),
            nis: residual
                .component_mul(&residual)
                .component_div(&variances)
                .sum(),
            degrees_of_freedom: 3,
            outcome,
        }
    }
}

#[cfg(test)]
mod tests;
