//! A sine over time.

use std::f64::consts::TAU;

use rand::RngExt as _;

use crate::random::Stream;
use crate::rotation::sin_cos;

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Sine {
    pub(super) amplitude: f64,
    pub(super) angular_frequency_rad_s: f64,
    phase_rad: f64,
}

impl Sine {
    /// With a phase of chance.
    pub(super) fn drawn((amplitude, frequency_hz): (f64, f64), stream: &mut Stream) -> Self {
        Self {
            amplitude,
            angular_frequency_rad_s: TAU * frequency_hz,
            phase_rad: TAU * stream.random::<f64>(),
        }
    }

    /// Value and derivative.
    pub(super) fn at(&self, t_s: f64) -> [f64; 2] {
        let (s, c) = sin_cos(self.angular_frequency_rad_s * t_s + self.phase_rad);
        [
            self.amplitude * s,
            self.amplitude * self.angular_frequency_rad_s * c,
        ]
    }
}
