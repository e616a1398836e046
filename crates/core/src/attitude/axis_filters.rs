//! Roll, pitch and yaw by three independent Kalman filters of two states each: angle and bias.
//!
//! Read first: `docs/derivations/axis_filters.md`; Romaniuk & Gosiewski (2014), "Kalman filter
//! realization for orientation and position estimation on dedicated processor", eqs 5-19 and 31-37.
//! Use it to make the paper again, or where nothing larger fits: it is the smallest filter there is.
//! Everywhere else [`super::mekf::Mekf`] is better: it knows nothing of poles, and its axes help
//! each other.
//!
//! # Model
//!
//! ```text
//! per axis  x = [angle, bias],  angle <- wrap(angle + (u - bias) T),  P <- A P A^T + Q      (A1)
//!           A = [[1, -T], [0, 1]],  Q = diag(T^2 s_w^2, T s_b^2),  R = s_a^2                (A2)
//! rates     u = (p + sin(roll) tan(pitch) q + cos(roll) tan(pitch) r,
//!                cos(roll) q - sin(roll) r,  (sin(roll) q + cos(roll) r) / cos(pitch))      (A3)
//! angles    roll = atan2(-f_y, -f_z),  pitch = atan2(f_x, sqrt(f_y^2 + f_z^2))              (A4)
//! heading   yaw = atan2(-Y_h, X_h) + declination, X_h and Y_h the levelled field            (A5)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `s_w` | [`AxisFiltersConfig::gyroscope_std`] | rad/s |
//! | `s_b` | [`AxisFiltersConfig::gyroscope_bias_random_walk`] | rad/s/sqrt(s) |
//! | `s_a` | [`AxisFiltersConfig::angle_std`] | rad |
//! | `f`, `p q r` | specific force, angular rate: body axes forward, right, down | m/s^2, rad/s |
//!
//! Frames: navigation is north, east, down; the angles are yaw, pitch, roll of `ned_from_body`.
//! What the paper prints otherwise is kept as an option: [`AxisNoise`], [`AxisAngles`],
//! [`AxisFiltersConfig::euler_rates`]. Cost: about 110 multiplications and nine trigonometric
//! functions a step. Limits: near the poles (pitch of 90 degrees) roll and yaw are held.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::kalman::innovation::check_vector;
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::scalar::{Scalar, lit};

/// Standard gravity, m/s^2: what the accelerometer's gate compares with.
const GRAVITY: f64 = 9.806_65;
/// Below this force (m/s^2) across the pitch axis, a tenth of gravity, roll is not defined.
const LEAST_ACROSS: f64 = 0.980_665;
/// Below this cosine of the pitch roll and yaw are held: three degrees from the pole.
const LEAST_COSINE: f64 = 0.052;
/// Longest interval of a propagation, s.
const LONGEST_STEP_S: f64 = 10.0;
/// Largest variance of an angle, rad^2: beyond 1.8 rad nothing is known anyway.
const LARGEST_VARIANCE: f64 = 3.24;

/// Which noise stands where.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum AxisNoise {
    /// Rates are noisy with `s_w`, the bias walks with `s_b`, angles are off by `s_a` (A2).
    #[default]
    Physical,
    /// The paper's eqs 18 and 19 to the letter: `Q = diag(T^2 s_a^2, s_a^2)`, `R = s_w^2`. The
    /// names of the two deviations are exchanged; it follows the accelerometer within 0.06 s.
    Printed,
    /// The same with the names exchanged back: `Q = diag(T^2 s_w^2, s_w^2)`, `R = s_a^2`.
    PrintedNamesSwapped,
}

/// How angles come out of the specific force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum AxisAngles {
    /// All quadrants, and the pitch by the whole force across it (A4).
    #[default]
    Exact,
    /// The paper's eqs 36 and 37: `roll = -atan(f_y/f_z)`, `pitch = atan(f_x/f_z)`. Both signs
    /// contradict its own rotation matrix; the pitch lacks the cosine of the roll.
    Printed,
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
pub struct AxisFiltersConfig<T> {
    /// Gyroscope noise of each sample, rad/s, default 0.2 deg/s. Raising it trusts the angles of
    /// accelerometer and magnetometer more.
    pub gyroscope_std: T,
    /// Random walk of each bias, rad/s/sqrt(s), default 3e-5. Raising it follows the bias faster.
    pub gyroscope_bias_random_walk: T,
    /// Error of the angles that the sensors give, rad, default 10 deg: accelerations, not sensor
    /// noise (walking 10, driving 30 deg). Raising it smooths longer.
    pub angle_std: T,
    /// Which of them stands where, default `physical`.
    pub noise: AxisNoise,
    /// How the angles come out of the specific force, default `exact`.
    pub angles: AxisAngles,
    /// Whether body rates are turned into rates of the angles (A3), default true; the paper takes
    /// them as they are.
    pub euler_rates: bool,
    /// Raises `R` by `gain (|f| - g)^2`, s^4/m^2, default 4; 0 is the paper. Raising it trusts
    /// accelerated samples less.
    pub norm_gain: T,
    /// Magnetic declination, rad, east positive, default 0: added to the magnetic heading.
    pub declination: T,
}

impl<T: Scalar> Default for AxisFiltersConfig<T> {
    fn default() -> Self {
        Self {
            gyroscope_std: lit(0.2_f64.to_radians()),
            gyroscope_bias_random_walk: lit(3e-5),
            angle_std: lit(10.0_f64.to_radians()),
            noise: AxisNoise::Physical,
            angles: AxisAngles::Exact,
            euler_rates: true,
            norm_gain: lit(4.0),
            declination: T::zero(),
        }
    }
}

impl<T: Scalar> AxisFiltersConfig<T> {
    /// The paper as it is printed, misprints included.
    pub fn printed() -> Self {
        Self {
            noise: AxisNoise::Printed,
            angles: AxisAngles::Printed,
            euler_rates: false,
            norm_gain: T::zero(),
            ..Self::default()
        }
    }

    /// Name of the first setting that makes no sense.
    pub fn senseless(&self) -> Option<&'static str> {
        let positive = |x: T| x > T::zero() && x <= lit(1e3);
        let not_negative = |x: T| x >= T::zero() && x <= lit(1e6);
        if !positive(self.gyroscope_std) {
            Some("gyroscope_std")
        } else if !not_negative(self.gyroscope_bias_random_walk) {
            Some("gyroscope_bias_random_walk")
        } else if !positive(self.angle_std) {
            Some("angle_std")
        } else if !not_negative(self.norm_gain) {
            Some("norm_gain")
        } else if !(self.declination.is_finite() && self.declination.abs() < lit(6.3)) {
            Some("declination")
        } else {
            None
        }
    }

    /// `[Q11, Q22, R]` for a step of `dt` seconds.
    fn noise(&self, dt: T) -> [T; 3] {
        let square = |x: T| x * x;
        let (rate, angle) = (square(self.gyroscope_std), square(self.angle_std));
        match self.noise {
            AxisNoise::Physical => {
                let walk = square(self.gyroscope_bias_random_walk);
                [dt * dt * rate, dt * walk, angle]
            }
            AxisNoise::Printed => [dt * dt * angle, angle, rate],
            AxisNoise::PrintedNamesSwapped => [dt * dt * rate, rate, angle],
        }
    }
}

/// One axis: angle (rad), bias (rad/s), and their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngleFilter<T> {
    /// Angle in `[-pi, pi)`, rad.
    pub angle: T,
    /// Bias of the rate, rad/s.
    pub bias: T,
    /// Variance of the angle, covariance, variance of the bias: rad^2, rad^2/s, rad^2/s^2.
    pub covariance: [T; 3],
}

impl<T: Scalar> AngleFilter<T> {
    fn starting_at(angle: T) -> Self {
        Self {
            angle: wrap(angle),
            bias: T::zero(),
            covariance: [lit(0.03), T::zero(), lit(0.003)],
        }
    }

    fn propagate(&mut self, rate: T, dt: T, [q_angle, q_bias]: [T; 2]) {
        self.angle = wrap(self.angle + (rate - self.bias) * dt);
        let [a, b, c] = self.covariance;
        let angle = a + (c * dt - b * lit(2.0)) * dt + q_angle;
        let (cross, bias) = (b - c * dt, c + q_bias);
        let limit: T = lit(LARGEST_VARIANCE);
        // What nothing measures grows until single precision fails: kept, with its correlation.
        self.covariance = if angle > limit {
            [limit, cross * (limit / angle).sqrt(), bias]
        } else {
            [angle, cross, bias]
        };
    }

    /// Corrects with an angle of variance `r`; gives the innovation and its variance.
    fn update(&mut self, measured: T, r: T) -> (T, T) {
        let [a, b, c] = self.covariance;
        let variance = a + r;
        let innovation = wrap(measured - self.angle);
        let (gain_angle, gain_bias) = (a / variance, b / variance);
        self.angle = wrap(self.angle + gain_angle * innovation);
        self.bias += gain_bias * innovation;
        let rest = T::one() - gain_angle;
        self.covariance = [rest * a, rest * b, c - gain_bias * b];
        (innovation, variance)
    }
}

/// An angle in `[-pi, pi)`.
pub fn wrap<T: Scalar>(angle: T) -> T {
    let turns = (angle / T::two_pi() + lit(0.5)).floor();
    angle - turns * T::two_pi()
}

/// Yaw, pitch and roll (rad) by gravity alone, from the specific force in forward, right, down.
/// `None` for the roll where the device stands on its nose or tail.
pub fn tilt_of<T: Scalar>(specific_force: &Vector3<T>, angles: AxisAngles) -> (Option<T>, T) {
    let f = specific_force;
    match angles {
        AxisAngles::Exact => {
            let across = (f.y * f.y + f.z * f.z).sqrt();
            let roll = (across >= lit(LEAST_ACROSS)).then(|| (-f.y).atan2(-f.z));
            (roll, f.x.atan2(across))
        }
        AxisAngles::Printed => {
            // The quotients of the paper; a z of zero is what it cannot take.
            let usable = f.z.abs() >= lit(1e-6);
            let z = if usable { f.z } else { lit(1e-6) };
            (usable.then(|| -(f.y / z).atan()), (f.x / z).atan())
        }
    }
}

/// Magnetic heading (rad, clockwise from magnetic north) of a body at this roll and pitch, from its
/// field in forward, right, down (A5). `None` for a field without horizontal part.
pub fn tilt_compensated_heading<T: Scalar>(field: &Vector3<T>, roll: T, pitch: T) -> Option<T> {
    let (sin_roll, cos_roll) = (roll.sin(), roll.cos());
    let (sin_pitch, cos_pitch) = (pitch.sin(), pitch.cos());
    let levelled = field.y * sin_roll + field.z * cos_roll;
    let x = field.x * cos_pitch + levelled * sin_pitch;
    let y = field.y * cos_roll - field.z * sin_roll;
    let horizontal = x * x + y * y;
    let defined = horizontal > field.norm_squared() * lit(1e-8);
    defined.then(|| (-y).atan2(x))
}

/// The three filters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisFilters<T> {
    config: AxisFiltersConfig<T>,
    /// Roll, pitch, yaw.
    axes: [AngleFilter<T>; 3],
    /// Interval of the last propagation, s: the printed noises depend on it.
    last_dt: T,
}

impl<T: Scalar> AxisFilters<T> {
    /// Filters that start at roll, pitch and yaw (rad).
    ///
    /// # Errors
    /// The name of the first setting that makes no sense, or `start`.
    pub fn new(config: AxisFiltersConfig<T>, start: [T; 3]) -> Result<Self, &'static str> {
        if let Some(name) = config.senseless() {
            return Err(name);
        }
        if !start.iter().all(|angle| angle.is_finite()) {
            return Err("start");
        }
        Ok(Self {
            config,
            axes: start.map(AngleFilter::starting_at),
            last_dt: lit(0.02),
        })
    }

    /// Roll, pitch and yaw with their biases and covariances.
    pub fn axes(&self) -> &[AngleFilter<T>; 3] {
        &self.axes
    }

    /// The attitude `ned_from_body`.
    pub fn attitude(&self) -> UnitQuaternion<T> {
        let [roll, pitch, yaw] = self.axes.map(|axis| axis.angle);
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    /// Moves on by `dt` seconds with the angular rate (rad/s, forward, right, down).
    ///
    /// # Errors
    /// Why the sample is refused; the state is then untouched.
    pub fn propagate(&mut self, angular_rate: &Vector3<T>, dt: T) -> Result<(), SkipReason> {
        check_vector(angular_rate, T::zero(), lit(1e4))?;
        if !dt.is_finite() {
            return Err(SkipReason::NotFinite);
        }
        if dt > lit(LONGEST_STEP_S) {
            return Err(SkipReason::OutOfRange);
        }
        if dt <= T::zero() {
            return Ok(());
        }
        let [q_angle, q_bias, _] = self.config.noise(dt);
        let rates = self.rates(angular_rate);
        for (axis, rate) in self.axes.iter_mut().zip(rates) {
            match rate {
                Some(rate) => axis.propagate(rate, dt, [q_angle, q_bias]),
                // Held: the bias is what its rate is taken for, so that nothing turns.
                None => axis.propagate(axis.bias, dt, [q_angle, q_bias]),
            }
        }
        self.last_dt = dt;
        Ok(())
    }

    /// Rates of roll, pitch and yaw (A3), or the body's as they are; `None` at the poles.
    fn rates(&self, body: &Vector3<T>) -> [Option<T>; 3] {
        if !self.config.euler_rates {
            return [Some(body.x), Some(body.y), Some(body.z)];
        }
        let [roll, pitch, _] = self.axes.map(|axis| axis.angle);
        let (sin_roll, cos_roll) = (roll.sin(), roll.cos());
        let (sin_pitch, cos_pitch) = (pitch.sin(), pitch.cos());
        let pitch_rate = cos_roll * body.y - sin_roll * body.z;
        if cos_pitch.abs() < lit(LEAST_COSINE) {
            return [None, Some(pitch_rate), None];
        }
        let turning = (sin_roll * body.y + cos_roll * body.z) / cos_pitch;
        [
            Some(body.x + sin_pitch * turning),
            Some(pitch_rate),
            Some(turning),
        ]
    }

    /// Corrects roll and pitch with a specific force (m/s^2, forward, right, down). The record has
    /// the residuals of roll and pitch (rad), or of the pitch alone where the roll is not defined.
    pub fn update_accelerometer(&mut self, specific_force: &Vector3<T>) -> Innovation<T> {
        let g: T = lit(GRAVITY);
        if let Err(reason) = check_vector(specific_force, g * lit(0.1), g * lit(50.0)) {
            return Innovation::skipped(reason);
        }
        let [_, _, r] = self.config.noise(self.last_dt);
        let excess = specific_force.norm() - g;
        let r = r * (T::one() + self.config.norm_gain * excess * excess);
        let (roll, pitch) = tilt_of(specific_force, self.config.angles);
        let [roll_axis, pitch_axis, _] = &mut self.axes;
        let of_pitch = pitch_axis.update(pitch, r);
        match roll {
            Some(roll) => record(&[roll_axis.update(roll, r), of_pitch]),
            None => record(&[of_pitch]),
        }
    }

    /// Corrects the yaw with a magnetic field (any unit, forward, right, down), levelled by the
    /// estimated roll and pitch. The record has its residual (rad).
    pub fn update_magnetometer(&mut self, magnetic_field: &Vector3<T>) -> Innovation<T> {
        if let Err(reason) = check_vector(magnetic_field, lit(1e-6), lit(1e6)) {
            return Innovation::skipped(reason);
        }
        let [_, _, r] = self.config.noise(self.last_dt);
        let [roll, pitch, yaw] = &mut self.axes;
        if pitch.angle.cos().abs() < lit(LEAST_COSINE) {
            return Innovation::skipped(SkipReason::Unobservable);
        }
        match tilt_compensated_heading(magnetic_field, roll.angle, pitch.angle) {
            Some(heading) => record(&[yaw.update(heading + self.config.declination, r)]),
            None => Innovation::skipped(SkipReason::Unobservable),
        }
    }

    /// Corrects the yaw with a heading from true north (rad) that is not a magnetometer's: a course over
    /// ground, a gyrocompass. The record has its residual (rad).
    pub fn update_heading(&mut self, heading: T) -> Innovation<T> {
        if !heading.is_finite() {
            return Innovation::skipped(SkipReason::NotFinite);
        }
        let [_, _, r] = self.config.noise(self.last_dt);
        let [_, pitch, yaw] = &mut self.axes;
        if pitch.angle.cos().abs() < lit(LEAST_COSINE) {
            return Innovation::skipped(SkipReason::Unobservable);
        }
        record(&[yaw.update(heading, r)])
    }
}

/// The record of up to three independent scalar updates: innovation and variance of each.
fn record<T: Scalar>(updates: &[(T, T)]) -> Innovation<T> {
    let mut innovation = Innovation {
        residual: Vector3::zeros(),
        covariance: Matrix3::zeros(),
        nis: T::zero(),
        degrees_of_freedom: 0,
        outcome: Outcome::Fused,
    };
    let slots = innovation.residual.iter_mut().enumerate();
    for ((i, slot), (residual, variance)) in slots.zip(updates) {
        *slot = *residual;
        if let Some(diagonal) = innovation.covariance.get_mut((i, i)) {
            *diagonal = *variance;
        }
        innovation.nis += *residual * *residual / *variance;
        innovation.degrees_of_freedom += 1;
    }
    innovation
}

#[cfg(test)]
mod tests;
