//! The rotation formulas the truth needs: exponential, logarithm, right Jacobian of SO(3).

use nalgebra::{ComplexField, Quaternion, RealField, UnitQuaternion, Vector3};

/// Below this squared angle (rad^2) the series are used; their error there is under 1e-17.
const SERIES_BELOW: f64 = 1e-8;

/// Sine and cosine, from the same library on every machine.
pub(crate) fn sin_cos(angle_rad: f64) -> (f64, f64) {
    ComplexField::sin_cos(angle_rad)
}

/// The rotation by the rotation vector `r` (axis times angle, rad).
pub(crate) fn exp(r: &Vector3<f64>) -> UnitQuaternion<f64> {
    let n2 = r.norm_squared();
    let (cosine, sine_over_n) = if n2 < SERIES_BELOW {
        (1.0 - n2 / 8.0, 0.5 - n2 / 48.0)
    } else {
        let n = n2.sqrt();
        let (s, c) = sin_cos(0.5 * n);
        (c, s / n)
    };
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cosine, r * sine_over_n))
}

/// The rotation vector of `q`, rad, with an angle of at most pi. Inverse of [`exp`].
pub(crate) fn log(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (mut w, mut v) = (q.w, Vector3::new(q.i, q.j, q.k));
    if w < 0.0 {
        w = -w;
        v = -v;
    }
    let n = v.norm();
    if n < 1e-8 {
        v * (2.0 / w)
    } else {
        v * (2.0 * RealField::atan2(n, w) / n)
    }
}

/// The body rate of `Exp(theta(t))`: the right Jacobian of SO(3) at `theta` times the derivative
/// of `theta`,
/// `J_r = I - (1 - cos n)/n^2 [theta]x + (n - sin n)/n^3 [theta]x^2`.
pub(crate) fn body_rate(theta: &Vector3<f64>, theta_dot: &Vector3<f64>) -> Vector3<f64> {
    let n2 = theta.norm_squared();
    let (first, second) = if n2 < SERIES_BELOW {
        (0.5 - n2 / 24.0, 1.0 / 6.0 - n2 / 120.0)
    } else {
        let n = n2.sqrt();
        let (s, c) = sin_cos(n);
        ((1.0 - c) / n2, (n - s) / (n2 * n))
    };
    let once = theta.cross(theta_dot);
    let twice = theta.cross(&once);
    theta_dot - once * first + twice * second
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_inverts_exp_up_to_half_a_turn() {
        let axis = Vector3::new(0.3, -0.5, 0.8).normalize();
        for angle in [0.0, 1e-12, 1e-5, 0.99e-4, 1.01e-4, 0.3, 2.0, 3.1] {
            let r = axis * angle;
            let q = exp(&r);
            assert!((q.norm() - 1.0).abs() < 1e-15, "angle {angle}");
            assert!((log(&q) - r).norm() < 1e-14, "angle {angle}");
            let negated = UnitQuaternion::new_unchecked(-q.into_inner());
            assert!((log(&negated) - r).norm() < 1e-14, "angle {angle}");
        }
    }

    #[test]
    fn exp_turns_right_handed() {
        let quarter = exp(&Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        assert!((quarter * Vector3::x() - Vector3::y()).norm() < 1e-15);
    }

    #[test]
    fn body_rate_is_the_derivative_of_exp() {
        let rate = Vector3::new(-0.7, 1.1, 0.4);
        let h = 1e-5;
        for angle in [0.0, 0.9e-4, 1.1e-4, 0.1, 1.5, 3.0, 5.0] {
            let theta = Vector3::new(0.6, 0.48, -0.64) * angle;
            let difference = exp(&(theta - rate * h)).inverse() * exp(&(theta + rate * h));
            let numerical = log(&difference) / (2.0 * h);
            let analytic = body_rate(&theta, &rate);
            assert!((numerical - analytic).norm() < 1e-9, "angle {angle}");
        }
    }
}
