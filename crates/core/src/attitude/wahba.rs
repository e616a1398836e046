//! Attitude from vector directions seen at one instant: TRIAD, Davenport's q-method, levelling.
//!
//! Read first: `docs/derivations/mekf.md`, section on the initial attitude (M18-M20); Black (1964)
//! for TRIAD; Wahba (1965) and Davenport (in Keat 1977) for the q-method; Shuster & Oh (1981) for
//! its covariance.
//!
//! Use [`triad`] when one direction is much better known than the other (gravity against the
//! magnetic field), [`davenport`] when every direction has a stated error or there are more than
//! two, [`level`] when there is only gravity. None of them knows about motion: a filter does.
//!
//! # Model
//!
//! `b_i = q^-1 r_i + noise`, unit vectors `b_i` in the body and `r_i` in the reference frame.
//!
//! ```text
//! t1 = u1, t2 = u1 x u2 / |u1 x u2|, t3 = t1 x t2;   R(q) = [t]_ref [t]_body^T               (M18)
//! minimise 1/2 sum w_i |b_i - R(q)^T r_i|^2, w_i = 1/sigma_i^2:  B = sum w_i b_i r_i^T       (M19)
//! q = eigenvector of the largest eigenvalue of K = [[tr B, z^T], [z, B + B^T - tr B I]]      (M19b)
//! P = (sum sigma_i^-2 (I - b_i b_i^T))^-1, local error in body axes                          (M20)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `b`, `r` | `Observation::body`, `Observation::reference` (any length) | - |
//! | `sigma` | `Observation::std` | rad |
//! | `q` | `ref_from_body` | - |
//! | `P` | `Davenport::covariance` | rad^2 |
//!
//! Cost: TRIAD about 100 multiplications, the q-method about 1000. Limits: directions within five
//! degrees of each other (or of opposite) give no heading. In single precision the q-method bears
//! standard deviations that differ by a factor of 10.

use nalgebra::{Matrix3, Matrix4, Quaternion, SymmetricEigen, UnitQuaternion, Vector3, Vector4};

use crate::geometry::{rotation, so3};
use crate::kalman::covariance::cholesky;
use crate::scalar::{Scalar, lit};

/// `|u1 x u2|` of unit vectors below which two directions count as parallel: sine of 5.2 degrees.
pub const PARALLEL_SINE: f64 = 0.09;

/// Largest standard deviation of an attitude error per axis, rad: beyond it nothing is known.
pub const MAXIMUM_STD: f64 = 1.8;

/// `ref_from_body` of two directions seen in both frames; the first pair is matched exactly, the
/// second gives the angle about it. Lengths do not matter.
///
/// `None` when a vector is zero or not finite, or a pair is within about five degrees of parallel.
///
/// ```
/// use northing_core::{attitude::wahba, nalgebra::Vector3};
/// // A level phone (x right, y forward, z up) whose top edge points north, in east, north, up.
/// let (up, field) = (Vector3::new(0.0, 0.0, 9.81), Vector3::new(0.0, 22.0, -42.0));
/// let q = wahba::triad(&up, &field, &Vector3::z(), &Vector3::y()).unwrap();
/// assert!(q.angle() < 1e-12);
/// ```
pub fn triad<T: Scalar>(
    first_body: &Vector3<T>,
    second_body: &Vector3<T>,
    first_ref: &Vector3<T>,
    second_ref: &Vector3<T>,
) -> Option<UnitQuaternion<T>> {
    let body = triad_axes(first_body, second_body)?;
    let reference = triad_axes(first_ref, second_ref)?;
    Some(positive(rotation::from_matrix(
        &(reference * body.transpose()),
    )))
}

/// The right-handed axes `[t1 t2 t3]` of two directions (M18).
fn triad_axes<T: Scalar>(first: &Vector3<T>, second: &Vector3<T>) -> Option<Matrix3<T>> {
    let t1 = unit(first)?;
    let normal = t1.cross(&unit(second)?);
    if normal.norm() < lit(PARALLEL_SINE) {
        return None;
    }
    let t2 = unit(&normal)?;
    Some(Matrix3::from_columns(&[t1, t2, t1.cross(&t2)]))
}

/// The shortest rotation that turns `up_body` to `up_ref`: right tilt, arbitrary heading.
///
/// It turns about a horizontal axis, so a body that is nearly level keeps its heading: its x axis
/// points, up to the tilt, along the x axis of the reference. Within 2.6 degrees of upside down
/// the shortest rotation is not defined; there it is a half turn about the body axis that is most
/// nearly horizontal, followed by the shortest rotation. A zero or non-finite vector gives the
/// identity.
pub fn level<T: Scalar>(up_body: &Vector3<T>, up_ref: &Vector3<T>) -> UnitQuaternion<T> {
    let (Some(from), Some(to)) = (unit(up_body), unit(up_ref)) else {
        return UnitQuaternion::identity();
    };
    if from.dot(&to) > lit(-0.999) {
        return shortest(&from, &to);
    }
    let mut axis = Vector3::x();
    if from.y.abs() < from.x.abs() {
        axis = Vector3::y();
    }
    if from.z.abs() < from.x.abs().min(from.y.abs()) {
        axis = Vector3::z();
    }
    // A half turn about the horizontal part of that axis turns `from` to `-from`.
    let Some(axis) = unit(&(axis - from * from.dot(&axis))) else {
        return UnitQuaternion::identity();
    };
    let half_turn = UnitQuaternion::new_unchecked(Quaternion::from_imag(axis));
    positive(shortest(&-from, &to) * half_turn)
}

/// The shortest rotation between two unit vectors that are not opposite.
fn shortest<T: Scalar>(from: &Vector3<T>, to: &Vector3<T>) -> UnitQuaternion<T> {
    let q = Quaternion::from_parts(T::one() + from.dot(to), from.cross(to));
    UnitQuaternion::new_normalize(q)
}

/// One direction seen in both frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation<T: Scalar> {
    /// The direction as measured, body axes, any length.
    pub body: Vector3<T>,
    /// The same direction in the reference frame, any length.
    pub reference: Vector3<T>,
    /// Standard deviation (rad) of the *unit* vector per component: the sensor's noise divided by
    /// the length of its vector.
    pub std: T,
}

/// The solution of Wahba's problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Davenport<T: Scalar> {
    /// The attitude.
    pub ref_from_body: UnitQuaternion<T>,
    /// Covariance (rad^2) of its local error, body axes (M20). What the observations leave open
    /// has a standard deviation of [`MAXIMUM_STD`].
    pub covariance: Matrix3<T>,
}

/// The attitude that fits all observations best, each weighed with `1 / std^2` (q-method).
///
/// With one observation, or with all of them within five degrees of parallel, the heading is that
/// of [`level`] and the covariance says that it is unknown. `None` without observations, when a
/// vector is zero or not finite, or a standard deviation is not positive.
pub fn davenport<T: Scalar>(observations: &[Observation<T>]) -> Option<Davenport<T>> {
    let cap = lit::<T>(1.0 / (MAXIMUM_STD * MAXIMUM_STD));
    let mut information = Matrix3::from_diagonal_element(cap);
    let (mut profile, mut total) = (Matrix3::zeros(), T::zero());
    let best = best_observation(observations)?;
    let best_unit = unit(&best.body)?;
    let mut widest = T::zero();
    for observation in observations {
        let (b, r) = (unit(&observation.body)?, unit(&observation.reference)?);
        let weight = T::one() / (observation.std * observation.std);
        profile += b * r.transpose() * weight;
        information += (Matrix3::identity() - b * b.transpose()) * weight;
        total += weight;
        let sine_ref = unit(&best.reference)?.cross(&r).norm();
        widest = widest.max(best_unit.cross(&b).norm().min(sine_ref));
    }
    if widest < lit(PARALLEL_SINE) {
        let weight = T::one() / (best.std * best.std);
        let rank2 = (Matrix3::identity() - best_unit * best_unit.transpose()) * weight;
        let covariance = inverse(&(rank2 + Matrix3::from_diagonal_element(cap)))?;
        return Some(Davenport {
            ref_from_body: level(&best.body, &best.reference),
            covariance,
        });
    }
    let covariance = inverse(&information)?;
    let ref_from_body = polish(q_method(&(profile / total))?, observations, &covariance)?;
    Some(Davenport {
        ref_from_body,
        covariance,
    })
}

/// The observation with the smallest standard deviation; `None` when one is not positive.
fn best_observation<T: Scalar>(observations: &[Observation<T>]) -> Option<&Observation<T>> {
    let mut best = observations.first()?;
    for observation in observations {
        if !(observation.std > T::zero() && observation.std.is_finite()) {
            return None;
        }
        if observation.std < best.std {
            best = observation;
        }
    }
    Some(best)
}

/// (M19b) for the attitude profile matrix `B`, scaled to weights that sum to one.
fn q_method<T: Scalar>(b: &Matrix3<T>) -> Option<UnitQuaternion<T>> {
    let trace = b.trace();
    let z = Vector3::new(
        b[(1, 2)] - b[(2, 1)],
        b[(2, 0)] - b[(0, 2)],
        b[(0, 1)] - b[(1, 0)],
    );
    let mut k = Matrix4::zeros();
    k[(0, 0)] = trace;
    for i in 0..3 {
        k[(0, i + 1)] = z[i];
        k[(i + 1, 0)] = z[i];
        for j in 0..3 {
            k[(i + 1, j + 1)] = b[(i, j)] + b[(j, i)];
        }
        k[(i + 1, i + 1)] -= trace;
    }
    let eigen = SymmetricEigen::try_new(k, T::default_epsilon(), 200)?;
    let largest = eigen.eigenvalues.imax();
    let q: Vector4<T> = eigen.eigenvectors.column(largest).into_owned();
    let q = Quaternion::new(q[0], q[1], q[2], q[3]);
    q.norm_squared()
        .is_finite()
        .then(|| positive(UnitQuaternion::new_normalize(q)))
}

/// One Newton step on Wahba's loss, `a = P sum w_i b_i x v_i` with `v_i = q^-1 r_i`: takes away the
/// rounding that the eigenvector amplifies when weights differ much.
fn polish<T: Scalar>(
    q: UnitQuaternion<T>,
    observations: &[Observation<T>],
    covariance: &Matrix3<T>,
) -> Option<UnitQuaternion<T>> {
    let mut gradient = Vector3::zeros();
    for observation in observations {
        let b = unit(&observation.body)?;
        let v = q.inverse() * unit(&observation.reference)?;
        // b x v, written so that its rounding stays perpendicular to b.
        gradient += b.cross(&(v - b)) / (observation.std * observation.std);
    }
    let step = so3::from_gibbs(&(covariance * gradient));
    Some(positive(rotation::renormalize(&(q * step))))
}

/// Inverse of a symmetric positive definite matrix through its Cholesky factor.
fn inverse<T: Scalar>(m: &Matrix3<T>) -> Option<Matrix3<T>> {
    let l = cholesky(m)?;
    let half = l.solve_lower_triangular(&Matrix3::identity())?;
    Some(half.transpose() * half)
}

/// The vector at length one; `None` when it is zero or not finite.
fn unit<T: Scalar>(v: &Vector3<T>) -> Option<Vector3<T>> {
    let largest = v.amax();
    if !(largest > T::zero() && v.iter().all(|x| x.is_finite())) {
        return None;
    }
    // Scaled first: squares of tiny or huge components neither vanish nor overflow.
    let scaled = v / largest;
    Some(scaled / scaled.norm())
}

/// The same rotation with `w >= 0`.
fn positive<T: Scalar>(q: UnitQuaternion<T>) -> UnitQuaternion<T> {
    if q.w < T::zero() {
        UnitQuaternion::new_unchecked(-q.into_inner())
    } else {
        q
    }
}

#[cfg(test)]
mod tests;
