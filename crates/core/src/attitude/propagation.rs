//! Exact discretisation of the local attitude error and gyroscope bias over one interval.
//!
//! Read first: `docs/derivations/mekf.md`, sections on propagation and process noise; Farrenkopf
//! (1978) for the noise.
//!
//! With the rate held at `w` over `dt`, `n = |w|`, `W = [w]x`:
//!
//! ```text
//! Phi11 = exp(-W dt) = I - s1 W + c1 W^2             s1 = sin(n dt)/n
//! Phi12 = -int_0^dt exp(-W s) ds = -(dt I - c1 W + c2 W^2)   c1 = (1 - cos n dt)/n^2, c2 = (n dt - sin n dt)/n^3
//! Q11 = (v dt + u dt^3/3) I,  Q12 = -u dt^2/2 I,  Q22 = u dt I
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `w` | `angular_rate`, bias already removed | rad/s |
//! | `v` | `angle_noise_psd` | (rad/s)^2/Hz |
//! | `u` | `bias_walk_psd` | (rad/s)^2/s |

use nalgebra::{Matrix3, Matrix6, Vector3};

use crate::geometry::so3;
use crate::kalman::SkipReason;
use crate::kalman::covariance::part;
use crate::scalar::{Scalar, lit};

/// The rate (rad/s) that turns the body over `dt`, bias removed; `None` where there is nothing to
/// propagate (`dt <= 0`). Every estimator propagates through this door, so none ever sees an angle
/// or an interval from which a finite covariance could not follow.
///
/// # Errors
/// [`SkipReason::NotFinite`], or [`SkipReason::OutOfRange`] above [`FASTEST_RAD_S`] or
/// [`LONGEST_INTERVAL_S`].
#[inline]
pub fn checked_rate<T: Scalar>(
    angular_rate: &Vector3<T>,
    bias: &Vector3<T>,
    dt: T,
) -> Result<Option<Vector3<T>>, SkipReason> {
    let n2 = angular_rate.norm_squared();
    if !(n2.is_finite() && dt.is_finite()) {
        return Err(SkipReason::NotFinite);
    }
    if n2 > lit(FASTEST_RAD_S * FASTEST_RAD_S) || dt > lit(LONGEST_INTERVAL_S) {
        return Err(SkipReason::OutOfRange);
    }
    Ok((dt > T::zero()).then(|| angular_rate - bias))
}

/// Rates above are no gyroscope's (rad/s).
pub const FASTEST_RAD_S: f64 = 1e4;
/// Intervals above are refused (s): eleven days.
pub const LONGEST_INTERVAL_S: f64 = 1e6;

/// A gyroscope bias beyond is none (rad/s): an update that leads there is refused.
pub const LARGEST_BIAS_RAD_S: f64 = 1e3;

/// Whether a gyroscope can have this bias (rad/s).
#[inline]
pub fn is_possible_bias<T: Scalar>(bias: &Vector3<T>) -> bool {
    bias.norm_squared() <= lit(LARGEST_BIAS_RAD_S * LARGEST_BIAS_RAD_S)
}

/// `Phi11`: the local attitude error turns against the body, `exp(-[w dt]x)`.
#[inline]
pub fn attitude_transition<T: Scalar>(angular_rate: &Vector3<T>, dt: T) -> Matrix3<T> {
    so3::exp_matrix(&(angular_rate * -dt))
}

/// `Phi12`: what a bias error does to the attitude over the interval.
///
/// `-dt Jl(-w dt)`, since `int_0^1 Exp(s r) ds = Jl(r)`.
#[inline]
pub fn bias_transition<T: Scalar>(angular_rate: &Vector3<T>, dt: T) -> Matrix3<T> {
    so3::left_jacobian(&(angular_rate * -dt)) * -dt
}

/// `Phi11` and `Phi12` together, from one set of coefficients.
#[inline]
pub fn transition_blocks<T: Scalar>(angular_rate: &Vector3<T>, dt: T) -> (Matrix3<T>, Matrix3<T>) {
    let r = angular_rate * -dt;
    let c = so3::Coefficients::of_squared_angle(r.norm_squared());
    (c.exp_matrix(&r), c.right_jacobian(&r).transpose() * -dt)
}

/// The whole 6 by 6 transition of `[attitude error, bias error]`.
pub fn transition<T: Scalar>(angular_rate: &Vector3<T>, dt: T) -> Matrix6<T> {
    let mut phi = Matrix6::identity();
    let (phi11, phi12) = transition_blocks(angular_rate, dt);
    phi.fixed_view_mut::<3, 3>(0, 0).copy_from(&phi11);
    phi.fixed_view_mut::<3, 3>(0, 3).copy_from(&phi12);
    phi
}

/// Farrenkopf's process noise over `dt`: the diagonal values of `Q11`, `Q12`, `Q22`.
#[inline]
pub fn process_noise<T: Scalar>(angle_noise_psd: T, bias_walk_psd: T, dt: T) -> [T; 3] {
    let u_dt = bias_walk_psd * dt;
    [
        angle_noise_psd * dt + u_dt * dt * dt * lit(1.0 / 3.0),
        u_dt * dt * lit(-0.5),
        u_dt,
    ]
}

/// `P <- Phi P Phi^T + Q` by 3 by 3 blocks, in place; equals the dense form to rounding.
#[inline]
pub fn propagate_covariance<T: Scalar>(
    p: &mut Matrix6<T>,
    angular_rate: &Vector3<T>,
    dt: T,
    angle_noise_psd: T,
    bias_walk_psd: T,
) {
    let (phi11, phi12) = transition_blocks(angular_rate, dt);
    let [q11, q12, q22] = process_noise(angle_noise_psd, bias_walk_psd, dt);
    let p11: Matrix3<T> = part(p, 0, 0);
    let p12: Matrix3<T> = part(p, 0, 3);
    let p22: Matrix3<T> = part(p, 3, 3);

    // Rows of Phi P: [A B] = [Phi11 Phi12] P, then P11 = A Phi11^T + B Phi12^T, P12 = B.
    let a = phi11 * p11 + phi12 * p12.transpose();
    let b = phi11 * p12 + phi12 * p22;
    for j in 0..3 {
        for i in 0..=j {
            let mut value = T::zero();
            for k in 0..3 {
                value += a[(i, k)] * phi11[(j, k)] + b[(i, k)] * phi12[(j, k)];
            }
            if i == j {
                value += q11;
            }
            p[(i, j)] = value;
            p[(j, i)] = value;
        }
        for i in 0..3 {
            let value = if i == j { b[(i, j)] + q12 } else { b[(i, j)] };
            p[(i, j + 3)] = value;
            p[(j + 3, i)] = value;
        }
        p[(j + 3, j + 3)] += q22;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{SMatrix, SVector, Vector6};
    use num_dual::{DualSVec64, jacobian};

    const RATES: [[f64; 3]; 4] = [
        [0.0; 3],
        [1e-7, 0.0, -1e-7],
        [2.0, -1.0, 2.0],
        [-25.0, 11.0, 30.0],
    ];

    /// The true error dynamics: truth turns with rate `w - db`, the estimate with `w`.
    fn error_after(
        w: &Vector3<f64>,
        dt: f64,
        x: &SVector<DualSVec64<6>, 6>,
    ) -> SVector<DualSVec64<6>, 3> {
        let (a, db) = (
            x.fixed_rows::<3>(0).into_owned(),
            x.fixed_rows::<3>(3).into_owned(),
        );
        let w = w.map(DualSVec64::<6>::from);
        let dt = DualSVec64::<6>::from(dt);
        let truth = so3::exp(&a) * so3::exp(&((w - db) * dt));
        so3::log(&(so3::exp(&(w * dt)).inverse() * truth))
    }

    #[test]
    fn transition_equals_dual_numbers_of_the_true_error() {
        for rate in RATES {
            for dt in [0.0035, 0.01, 0.5] {
                let w = Vector3::from(rate);
                if w.norm() * dt > 3.0 {
                    continue;
                }
                let (_, j): (_, SMatrix<f64, 3, 6>) =
                    jacobian(|x| error_after(&w, dt, &x), &Vector6::zeros());
                let phi = transition(&w, dt);
                assert_relative_eq!(j, phi.fixed_rows::<3>(0).into_owned(), epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn block_propagation_equals_the_dense_form() {
        let m = Matrix6::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin());
        let p0 = m * m.transpose() + Matrix6::identity() * 0.1;
        for rate in RATES {
            let (w, dt) = (Vector3::from(rate), 0.01);
            let mut blocks = p0;
            propagate_covariance(&mut blocks, &w, dt, 1e-4, 1e-6);
            let phi = transition(&w, dt);
            let [q11, q12, q22] = process_noise(1e-4, 1e-6, dt);
            let mut dense = phi * p0 * phi.transpose();
            for i in 0..3 {
                dense[(i, i)] += q11;
                dense[(i, i + 3)] += q12;
                dense[(i + 3, i)] += q12;
                dense[(i + 3, i + 3)] += q22;
            }
            assert_relative_eq!(blocks, dense, epsilon = 1e-13);
            assert_relative_eq!(blocks, blocks.transpose());
        }
    }

    /// Van Loan's integral by many small steps, at 3 rad/s and 100 Hz as in the specification.
    #[test]
    fn farrenkopf_noise_is_van_loan_s_to_3e_7() {
        let (w, dt, v, u) = (Vector3::new(1.2, -2.0, 1.9), 0.01, 1e-4, 1e-6);
        let steps = 2000;
        let h = dt / f64::from(steps);
        let mut exact = Matrix6::<f64>::zeros();
        for k in 0..steps {
            let phi = transition(&w, dt - (f64::from(k) + 0.5) * h);
            let g = Matrix6::from_diagonal(&Vector6::new(v, v, v, u, u, u));
            exact += phi * g * phi.transpose() * h;
        }
        let [q11, q12, q22] = process_noise(v, u, dt);
        let mut closed = Matrix6::<f64>::zeros();
        for i in 0..3 {
            closed[(i, i)] = q11;
            closed[(i, i + 3)] = q12;
            closed[(i + 3, i)] = q12;
            closed[(i + 3, i + 3)] = q22;
        }
        assert!((closed - exact).abs().max() / exact.abs().max() < 1e-6);
    }
}
