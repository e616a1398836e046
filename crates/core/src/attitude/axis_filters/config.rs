//! Settings of the filters for roll, pitch and yaw. Equation numbers are those of the parent module.

use crate::parameters::{Choice, choices, parameters};
use crate::scalar::Scalar;

choices! {
    /// Which noise stands where.
    pub enum AxisNoise {
        /// Rates are noisy with `s_w`, the bias walks with `s_b`, angles are off by `s_a` (A2).
        #[default]
        Physical = "physical",
        /// The paper's eqs 18 and 19 to the letter: `Q = diag(T^2 s_a^2, s_a^2)`, `R = s_w^2`. The
        /// names of the two deviations are exchanged; it follows the accelerometer within 0.06 s.
        Printed = "printed",
        /// The same with the names exchanged back: `Q = diag(T^2 s_w^2, s_w^2)`, `R = s_a^2`.
        PrintedNamesSwapped = "printed-names-swapped",
    }
}

choices! {
    /// How angles come out of the specific force.
    pub enum AxisAngles {
        /// All quadrants, and the pitch by the whole force across it (A4).
        #[default]
        Exact = "exact",
        /// The paper's eqs 36 and 37: `roll = -atan(f_y/f_z)`, `pitch = atan(f_x/f_z)`. Both signs
        /// contradict its own rotation matrix; the pitch lacks the cosine of the roll.
        Printed = "printed",
    }
}

parameters! {
    /// Parameters of the three filters.
    pub struct AxisFiltersConfig, profiles {
        /// What is right where the paper is misprinted.
        corrected = 0,
        /// The paper as it is printed, misprints included.
        printed = 1,
    };

    gyroscope_std: T, "rad/s", From(1e-8, 1e3), [0.2_f64.to_radians()],
        "gyroscope noise of each sample",
        "0.2 deg/s. Raising it trusts the angles of accelerometer and magnetometer more.";
    gyroscope_bias_random_walk: T, "rad/s/sqrt(s)", From(0.0, 1.0), [3e-5],
        "random walk of each bias",
        "Raising it follows the bias faster.";
    angle_std: T, "rad", From(1e-6, 10.0), [10.0_f64.to_radians()],
        "error of the angles that the sensors give",
        "10 degrees: accelerations, not sensor noise (walking 10, driving 30 deg). Raising it smooths longer.";
    noise: AxisNoise, "-", Words(AxisNoise::WORDS), [AxisNoise::Physical, AxisNoise::Printed],
        "which of them stands where";
    angles: AxisAngles, "-", Words(AxisAngles::WORDS), [AxisAngles::Exact, AxisAngles::Printed],
        "how the angles come out of the specific force";
    euler_rates: bool, "-", Flag, [true, false],
        "whether body rates are turned into rates of the angles (A3)",
        "The paper takes them as they are.";
    norm_gain: T, "s^4/m^2", From(0.0, 1e6), [4.0, 0.0],
        "raises `R` by `gain (|f| - g)^2`; 0 is the paper",
        "Raising it trusts accelerated samples less.";
    declination: T, "rad", From(-6.3, 6.3), [0.0],
        "magnetic declination, east positive: added to the magnetic heading";
}

impl<T: Scalar> AxisFiltersConfig<T> {
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
