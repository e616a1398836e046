//! Settings of the filters for north, east and down. Equation numbers are those of the parent module.

use crate::parameters::{Choice, choices, parameters};
use crate::scalar::Scalar;

choices! {
    /// Which noise stands where.
    pub enum PositionNoise {
        /// Acceleration is off by `s_a`, positions by `s_p`, the bias walks (A7).
        #[default]
        Physical = "physical",
        /// The paper's eqs 29 and 30 to the letter: `Q` with `s_p^2`, `R = s_a` (not squared), and a bias
        /// that does not walk.
        Printed = "printed",
        /// The same with the names exchanged back: `Q` with `s_a^2`, `R = s_p^2`, no walk.
        PrintedNamesSwapped = "printed-names-swapped",
    }
}

parameters! {
    /// Parameters of the three filters.
    pub struct PositionAxisConfig;

    acceleration_std: T, "m/s^2", Above(1e-6, 1e4), [1.5],
        "effective error of the acceleration",
        "Walking 1.5, driving 3. Raising it follows the fixes more.";
    bias_random_walk: T, "m/s^2/sqrt(s)", From(0.0, 1e4), [1e-2],
        "random walk of the bias",
        "Raising it follows turns faster.";
    position_std: T, "m", Above(1e-6, 1e4), [2.55],
        "error of a fix per horizontal axis",
        "3 m of circular error probable.";
    vertical_position_std: T, "m", Above(1e-6, 1e4), [6.0],
        "error of a fix downwards";
    noise: PositionNoise, "-", Words(PositionNoise::WORDS), [PositionNoise::Physical],
        "which of them stands where";
    outlier_nis: T, "-", From(0.0, 1e6), [13.8],
        "normalised innovation squared of north and east above which a fix is left out; 0: none is",
        "99.9 % of two degrees of freedom; 0 is the paper. Raising it lets outliers in.";
}

impl<T: Scalar> PositionAxisConfig<T> {
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
