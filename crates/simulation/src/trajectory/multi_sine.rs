//! A rotation vector made of sines: smooth, rich in directions, at rest in the reference pose at
//! both ends.

use nalgebra::Vector3;
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use super::sine::Sine;
use super::{Trajectory, Truth};
use crate::random::Stream;
use crate::rotation::{body_rate, exp};
use crate::settings::settings;

/// Number of sines per axis.
const SINES: usize = 4;

settings! {
    /// How lively a [`MultiSine`] is.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct MultiSineConfig {
        /// Size of the rotation vector per axis, rad. Each sine has an amplitude of 0.2 to 0.5 times
        /// this. Default 1.2, which gives about 0.6 rad RMS per axis.
        amplitude_rad: f64 = 1.2,
        /// Lowest frequency drawn, Hz. Default 0.05.
        frequency_min_hz: f64 = 0.05,
        /// Highest frequency drawn, Hz. Default 0.6; higher means faster turns.
        frequency_max_hz: f64 = 0.6,
        /// Time to fade in from rest and out to rest, s; at most half the duration is used. Default 3.
        ramp_s: f64 = 3.0,
        /// Length of the motion, s. Default 60. Before and after it the body rests in the reference
        /// pose.
        duration_s: f64 = 60.0,
    }
}

/// `q(t) = Exp(w(t) * sum of sines)`, with a smooth window `w` that is zero at both ends.
#[derive(Debug, Clone, PartialEq)]
pub struct MultiSine {
    axes: [[Sine; SINES]; 3],
    ramp_s: f64,
    duration_s: f64,
}

impl MultiSine {
    /// Draws frequencies, amplitudes and phases uniformly from `stream`.
    #[must_use]
    pub fn random(stream: &mut Stream, config: &MultiSineConfig) -> Self {
        let mut axes = [[Sine::default(); SINES]; 3];
        let span_hz = config.frequency_max_hz - config.frequency_min_hz;
        for sine in axes.iter_mut().flatten() {
            let frequency_hz = config.frequency_min_hz + span_hz * stream.random::<f64>();
            let share = 0.4 + 0.6 * stream.random::<f64>();
            *sine = Sine::drawn((0.5 * config.amplitude_rad * share, frequency_hz), stream);
        }
        Self {
            axes,
            // Longer ramps would meet in a kink.
            ramp_s: config.ramp_s.min(0.5 * config.duration_s),
            duration_s: config.duration_s,
        }
    }

    /// Value and derivative of the window: a smoothstep up, one, a smoothstep down.
    fn window(&self, t_s: f64) -> (f64, f64) {
        let to_end = self.duration_s - t_s;
        let (into, sign) = if t_s < to_end {
            (t_s, 1.0)
        } else {
            (to_end, -1.0)
        };
        let x = (into / self.ramp_s).clamp(0.0, 1.0);
        let slope = sign * 6.0 * x * (1.0 - x) / self.ramp_s;
        (x * x * (3.0 - 2.0 * x), slope)
    }
}

impl Trajectory for MultiSine {
    fn at(&self, t_s: f64) -> Truth {
        if t_s <= 0.0 || t_s >= self.duration_s {
            return super::Rest::default().at(t_s);
        }
        let mut sum = Vector3::zeros();
        let mut sum_dot = Vector3::zeros();
        for (axis, sines) in self.axes.iter().enumerate() {
            for sine in sines {
                let [value, slope] = sine.at(t_s);
                sum[axis] += value;
                sum_dot[axis] += slope;
            }
        }
        let (window, window_dot) = self.window(t_s);
        let theta = sum * window;
        let theta_dot = sum_dot * window + sum * window_dot;
        Truth {
            angular_rate_body: body_rate(&theta, &theta_dot),
            ..Truth::at_rest(exp(&theta))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::trajectory::tests::assert_derivatives;
    use nalgebra::UnitQuaternion;

    #[test]
    fn the_rate_is_the_derivative_of_the_attitude() {
        for seed in 0..5 {
            let motion =
                MultiSine::random(&mut stream(seed, "motion"), &MultiSineConfig::default());
            assert_derivatives(&motion, 60.0, &[0.0, 3.0, 57.0, 60.0], 1e-6);
        }
    }

    #[test]
    fn it_starts_and_ends_at_rest_in_the_reference_pose() {
        let motion = MultiSine::random(&mut stream(3, "motion"), &MultiSineConfig::default());
        let rest = Truth::at_rest(UnitQuaternion::identity());
        for t in [-1.0, 0.0, 60.0, 1e6] {
            assert_eq!(motion.at(t), rest);
        }
        // Continuous there, too.
        for t in [1e-6, 60.0 - 1e-6] {
            assert!(motion.at(t).angular_rate_body.norm() < 1e-5);
            assert!(motion.at(t).world_from_body.angle() < 1e-9);
        }
    }

    #[test]
    fn the_motion_turns_as_far_and_as_fast_as_documented() {
        let (mut angle2, mut rate2, mut n) = (0.0, 0.0, 0.0);
        for seed in 0..20 {
            let motion =
                MultiSine::random(&mut stream(seed, "motion"), &MultiSineConfig::default());
            for i in 0..540 {
                let truth = motion.at(3.0 + 0.1 * f64::from(i));
                angle2 += crate::rotation::log(&truth.world_from_body).norm_squared() / 3.0;
                rate2 += truth.angular_rate_body.norm_squared() / 3.0;
                n += 1.0;
            }
        }
        // Four sines of mean square amplitude (0.6 rad)^2 * E[u^2], u uniform on 0.4..1, give
        // sqrt(4 * 0.36 * 0.52 / 2) = 0.61 rad.
        let (angle, rate): (f64, f64) = (angle2 / n, rate2 / n);
        assert!((angle.sqrt() - 0.61).abs() < 0.06, "angle {}", angle.sqrt());
        assert!((0.8..2.0).contains(&rate.sqrt()), "rate {}", rate.sqrt());
    }
}
