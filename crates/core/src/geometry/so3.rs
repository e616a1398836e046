//! SO(3): exponential, logarithm and their Jacobians, exact near zero and near a half turn.
//!
//! Read first: Solà, Deray, Atchuthan, *A micro Lie theory for state estimation in robotics*
//! (2018), appendix B, for the closed forms; `docs/derivations/mekf.md` for how filters use them.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `r` | rotation vector | rad |
//! | `n = abs(r)` | angle | rad |
//! | `[r]x` | [`skew`] | rad |
//! | `Exp(r)` | [`exp`], [`exp_matrix`] | - |
//! | `Log(q)` | [`log`] | rad |
//! | `Jr(r)` | [`right_jacobian`]: `Exp(r + d) = Exp(r) Exp(Jr(r) d)` | - |
//!
//! Below [`SERIES_LIMIT`] the trigonometric coefficients come from their Taylor series with as
//! many terms as `f64` resolves; that is not an approximation, it avoids cancellation, and it
//! keeps trigonometry out of the sample-by-sample path on chips without FPU.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::trigonometry::sin_cos;
use crate::scalar::{Scalar, lit, polynomial};

/// Angle squared (rad^2) below which coefficients come from their series: 0.25 rad, where six
/// terms leave a remainder below 1e-17.
pub const SERIES_LIMIT: f64 = 0.0625;

/// Half angle squared (rad^2) below which four terms of a quaternion's series leave less than 3e-17: a
/// turn of 0.06 rad, more than a sample at 100 Hz brings at 6 rad/s.
const SHORT_SERIES_LIMIT: f64 = 1e-3;

/// The matrix that implements the vector product: `skew(a) * b == a.cross(&b)`.
#[inline]
pub fn skew<T: Scalar>(v: &Vector3<T>) -> Matrix3<T> {
    let zero = T::zero();
    Matrix3::new(zero, -v.z, v.y, v.z, zero, -v.x, -v.y, v.x, zero)
}

/// The three coefficients that every closed form of SO(3) is made of, for angle `n`:
/// `sin n / n`, `(1 - cos n) / n^2`, `(n - sin n) / n^3`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients<T> {
    /// `sin n / n`
    pub sine: T,
    /// `(1 - cos n) / n^2`
    pub cosine: T,
    /// `(n - sin n) / n^3`
    pub cubic: T,
}

impl<T: Scalar> Coefficients<T> {
    /// For the angle whose square is `n2` (rad^2, not negative).
    #[inline]
    pub fn of_squared_angle(n2: T) -> Self {
        if n2 < lit(SERIES_LIMIT) {
            Self {
                sine: polynomial(
                    n2,
                    [
                        1.0,
                        -1.0 / 6.0,
                        1.0 / 120.0,
                        -1.0 / 5_040.0,
                        1.0 / 362_880.0,
                        -1.0 / 39_916_800.0,
                    ],
                ),
                cosine: polynomial(
                    n2,
                    [
                        0.5,
                        -1.0 / 24.0,
                        1.0 / 720.0,
                        -1.0 / 40_320.0,
                        1.0 / 3_628_800.0,
                        -1.0 / 479_001_600.0,
                    ],
                ),
                cubic: polynomial(
                    n2,
                    [
                        1.0 / 6.0,
                        -1.0 / 120.0,
                        1.0 / 5_040.0,
                        -1.0 / 362_880.0,
                        1.0 / 39_916_800.0,
                        -1.0 / 6_227_020_800.0,
                    ],
                ),
            }
        } else {
            let n = n2.sqrt();
            let (sin, cos) = (n.sin(), n.cos());
            Self {
                sine: sin / n,
                cosine: (T::one() - cos) / n2,
                cubic: (n - sin) / (n2 * n),
            }
        }
    }
}

impl<T: Scalar> Coefficients<T> {
    /// [`exp_matrix`] of `r`, whose coefficients these are.
    #[inline]
    pub fn exp_matrix(&self, r: &Vector3<T>) -> Matrix3<T> {
        second_order(r, self.sine, self.cosine)
    }

    /// [`right_jacobian`] of `r`, whose coefficients these are.
    #[inline]
    pub fn right_jacobian(&self, r: &Vector3<T>) -> Matrix3<T> {
        second_order(r, -self.cosine, self.cubic)
    }
}

/// The rotation by the rotation vector `r` (rad) as a unit quaternion.
///
/// ```
/// use northing_core::{geometry::so3, nalgebra::Vector3};
/// let quarter_turn = so3::exp(&Vector3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2));
/// assert!((quarter_turn * Vector3::x() - Vector3::y()).norm() < 1e-15);
/// ```
#[inline]
pub fn exp<T: Scalar>(r: &Vector3<T>) -> UnitQuaternion<T> {
    let quarter = lit::<T>(0.25);
    let h2 = r.norm_squared() * quarter;
    let (cos_half, half_sinc) = if h2 < lit(SHORT_SERIES_LIMIT) {
        (
            polynomial(h2, [1.0, -0.5, 1.0 / 24.0, -1.0 / 720.0]),
            polynomial(h2, [0.5, -1.0 / 12.0, 1.0 / 240.0, -1.0 / 10_080.0]),
        )
    } else if h2 < lit(SERIES_LIMIT) {
        (
            polynomial(
                h2,
                [
                    1.0,
                    -0.5,
                    1.0 / 24.0,
                    -1.0 / 720.0,
                    1.0 / 40_320.0,
                    -1.0 / 3_628_800.0,
                    1.0 / 479_001_600.0,
                ],
            ),
            polynomial(
                h2,
                [
                    0.5,
                    -1.0 / 12.0,
                    1.0 / 240.0,
                    -1.0 / 10_080.0,
                    1.0 / 725_760.0,
                    -1.0 / 79_833_600.0,
                ],
            ),
        )
    } else {
        let h = h2.sqrt();
        let (sin, cos) = sin_cos(h);
        (cos, lit::<T>(0.5) * sin / h)
    };
    let v = r * half_sinc;
    UnitQuaternion::new_unchecked(Quaternion::new(cos_half, v.x, v.y, v.z))
}

/// The rotation vector (rad) of a unit quaternion, with length in `[0, pi]`; inverse of [`exp`].
#[inline]
pub fn log<T: Scalar>(q: &UnitQuaternion<T>) -> Vector3<T> {
    let (w, v) = if q.w < T::zero() {
        (-q.w, -q.imag())
    } else {
        (q.w, q.imag())
    };
    let s2 = v.norm_squared();
    if s2 < lit(1e-8) {
        // 2 asin(s)/s = 2 (1 + s^2/6 + 3 s^4/40): w is close to one here, s carries the angle.
        return v * (lit::<T>(2.0) * polynomial(s2, [1.0, 1.0 / 6.0, 3.0 / 40.0]));
    }
    let s = s2.sqrt();
    v * (lit::<T>(2.0) * s.atan2(w) / s)
}

/// The rotation matrix `Exp([r]x)` (Rodrigues).
#[inline]
pub fn exp_matrix<T: Scalar>(r: &Vector3<T>) -> Matrix3<T> {
    Coefficients::of_squared_angle(r.norm_squared()).exp_matrix(r)
}

/// The right Jacobian: `Exp(r + d) = Exp(r) Exp(Jr(r) d)` to first order in `d`.
#[inline]
pub fn right_jacobian<T: Scalar>(r: &Vector3<T>) -> Matrix3<T> {
    Coefficients::of_squared_angle(r.norm_squared()).right_jacobian(r)
}

/// The left Jacobian, `Jl(r) = Jr(-r) = Jr(r)^T`.
#[inline]
pub fn left_jacobian<T: Scalar>(r: &Vector3<T>) -> Matrix3<T> {
    right_jacobian(r).transpose()
}

/// The inverse of [`right_jacobian`], for angles below a full turn.
#[inline]
pub fn right_jacobian_inverse<T: Scalar>(r: &Vector3<T>) -> Matrix3<T> {
    let n2 = r.norm_squared();
    let half = lit::<T>(0.5);
    let second = if n2 < lit(SERIES_LIMIT) {
        polynomial(
            n2,
            [
                1.0 / 12.0,
                1.0 / 720.0,
                1.0 / 30_240.0,
                1.0 / 1_209_600.0,
                1.0 / 47_900_160.0,
                5.284_190_138_687_49e-10,
            ],
        )
    } else {
        let n = n2.sqrt();
        // (1 + cos n)/sin n = cot(n/2), finite up to and including a half turn.
        let h = half * n;
        T::one() / n2 - half * h.cos() / (n * h.sin())
    };
    second_order(r, half, second)
}

/// `I + first [r]x + second [r]x^2`, using `[r]x^2 = r r^T - n^2 I`.
#[inline]
fn second_order<T: Scalar>(r: &Vector3<T>, first: T, second: T) -> Matrix3<T> {
    let (x, y, z) = (r.x, r.y, r.z);
    let (xx, yy, zz) = (second * x * x, second * y * y, second * z * z);
    let (xy, xz, yz) = (second * x * y, second * x * z, second * y * z);
    let (ax, ay, az) = (first * x, first * y, first * z);
    let one = T::one();
    Matrix3::new(
        one - yy - zz,
        xy - az,
        xz + ay,
        xy + az,
        one - xx - zz,
        yz - ax,
        xz - ay,
        yz + ax,
        one - xx - yy,
    )
}

/// The unit quaternion of twice the Gibbs vector `a`: `(2, a) / sqrt(4 + |a|^2)`
/// (Utrera & Vazquez 2021, eq 18; Markley 2003). For small `a` it is the rotation vector in rad.
#[inline]
pub fn from_gibbs<T: Scalar>(a: &Vector3<T>) -> UnitQuaternion<T> {
    let two = lit::<T>(2.0);
    let n = T::one() / (lit::<T>(4.0) + a.norm_squared()).sqrt();
    UnitQuaternion::new_unchecked(Quaternion::new(two * n, a.x * n, a.y * n, a.z * n))
}

/// Twice the Gibbs vector, `2 vec / scalar`: inverse of [`from_gibbs`], infinite at a half turn.
#[inline]
pub fn to_gibbs<T: Scalar>(q: &UnitQuaternion<T>) -> Vector3<T> {
    q.imag() * (lit::<T>(2.0) / q.w)
}

/// Jacobian of re-centring a Gibbs-vector error at the correction `a` that was just applied:
/// `G = (I - [a]x/2) / (1 + |a|^2/4)`, exact (`docs/derivations/mekf.md`, eq M14).
#[inline]
pub fn gibbs_reset_jacobian<T: Scalar>(a: &Vector3<T>) -> Matrix3<T> {
    let scale = T::one() / (T::one() + lit::<T>(0.25) * a.norm_squared());
    let h = a * (lit::<T>(-0.5) * scale);
    let mut g = skew(&h);
    g[(0, 0)] = scale;
    g[(1, 1)] = scale;
    g[(2, 2)] = scale;
    g
}

#[cfg(test)]
mod tests;
