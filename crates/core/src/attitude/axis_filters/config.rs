//! Settings of the filters for roll, pitch and yaw. Equation numbers are those of the parent module.

use crate::scalar::{Scalar, lit};

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
    pub(super) fn noise(&self, dt: T) -> [T; 3] {
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
