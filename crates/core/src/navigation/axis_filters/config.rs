//! Settings of the filters for north, east and down. Equation numbers are those of the parent module.

use crate::scalar::{Scalar, lit};

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

    /// Variance of the acceleration in `Q`, and what a second adds to the variance of the bias.
    pub(super) fn process(&self, position_std: T) -> [T; 2] {
        let square = |x: T| x * x;
        match self.noise {
            PositionNoise::Physical => {
                [square(self.acceleration_std), square(self.bias_random_walk)]
            }
            PositionNoise::Printed => [square(position_std), T::zero()],
            PositionNoise::PrintedNamesSwapped => [square(self.acceleration_std), T::zero()],
        }
    }

    /// Variance of a position.
    pub(super) fn measurement(&self, position_std: T) -> T {
        match self.noise {
            PositionNoise::Printed => self.acceleration_std,
            _ => position_std * position_std,
        }
    }
}
