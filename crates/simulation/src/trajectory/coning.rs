//! Coning: the motion that is hardest on gyroscope integration, because it turns about an axis that
//! no gyroscope axis follows.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Trajectory, Truth};
use crate::rotation::{exp, sin_cos};
use crate::settings::settings;

settings! {
    /// The body axis z goes round a cone: `q(t) = Exp(a (cos ft, sin ft, 0))` with half angle `a` and
    /// angular frequency `f`. The body rate is `f (-sin a sin ft, sin a cos ft, cos a - 1)`: constant in
    /// size, with a constant part about z although the body never turns about the vertical.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Coning {
        /// Half angle of the cone, rad. Default 0.2.
        half_angle_rad: f64 = 0.2,
        /// How often the axis goes round, Hz. Default 1.
        frequency_hz: f64 = 1.0,
    }
}

impl Trajectory for Coning {
    fn at(&self, t_s: f64) -> Truth {
        let frequency_rad_s = std::f64::consts::TAU * self.frequency_hz;
        let (s, c) = sin_cos(frequency_rad_s * t_s);
        let (sin_half, cos_half) = sin_cos(self.half_angle_rad);
        let theta = Vector3::new(c, s, 0.0) * self.half_angle_rad;
        Truth {
            angular_rate_body: frequency_rad_s
                * Vector3::new(-sin_half * s, sin_half * c, cos_half - 1.0),
            ..Truth::at_rest(exp(&theta))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::tests::assert_derivatives;

    #[test]
    fn the_rate_is_the_derivative_of_the_attitude() {
        assert_derivatives(&Coning::default(), 3.0, &[], 1e-6);
        let wide = Coning {
            half_angle_rad: 2.5,
            frequency_hz: 0.7,
        };
        assert_derivatives(&wide, 3.0, &[], 1e-6);
    }

    #[test]
    fn after_a_round_the_body_is_back_although_the_rate_about_z_did_not_average_out() {
        let motion = Coning::default();
        let (start, end) = (motion.at(0.0), motion.at(1.0));
        assert!(start.world_from_body.angle_to(&end.world_from_body) < 1e-7);
        assert!(start.angular_rate_body.z < -0.12);
        assert!((start.angular_rate_body.z - end.angular_rate_body.z).abs() < 1e-15);
    }
}
