//! Closest point of approach (CPA): distance, time, and probability of collision.
//!
//! Closest point of approach (CPA) of a target that keeps its velocity and an own ship that keeps
//! its own, with the uncertainty of both *and what they have in common*: a heading error moves the
//! target and not the own ship, a position error moves both. With the cross-covariance of a Schmidt
//! tracker the relative covariance is `P_t - B X^T - X B^T + B P_o B^T` (S14).

use nalgebra::{Matrix4, RowVector4, SMatrix, Vector2, Vector4};

use super::TrackEstimate;
use crate::scalar::{Scalar, lit};

/// Target minus own ship.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeMotion<T: Scalar> {
    /// `[north, v_north, east, v_east]`, m and m/s.
    pub state: Vector4<T>,
    /// Its covariance.
    pub covariance: Matrix4<T>,
}

/// The closest point of approach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestApproach<T> {
    /// Time until then, s; zero when they are moving apart.
    pub time_s: T,
    /// Standard deviation of that time, s; zero when they are moving apart.
    pub time_std_s: T,
    /// Distance then, m.
    pub distance_m: T,
    /// Standard deviation of that distance, m, to first order.
    pub distance_std_m: T,
    /// Probability that they pass within the distance asked about.
    pub probability: T,
}

/// ```
/// use northing_core::nalgebra::{Matrix4, Vector4};
/// use northing_core::tracking::collision::RelativeMotion;
///
/// // 1000 m north, 50 m east, coming south at 5 m/s; standard deviations 10 m and 0.1 m/s.
/// let relative = RelativeMotion {
///     state: Vector4::new(1000.0_f64, -5.0, 50.0, 0.0),
///     covariance: Matrix4::from_diagonal(&Vector4::new(100.0, 0.01, 100.0, 0.01)),
/// };
/// let closest = relative.closest_approach(100.0).unwrap();
/// assert!((closest.time_s - 200.0).abs() < 1e-6);
/// assert!((closest.distance_m - 50.0).abs() < 1e-6);
/// assert!((0.9..1.0).contains(&closest.probability)); // of passing within 100 m
/// ```
impl<T: Scalar> RelativeMotion<T> {
    /// From a track, the own ship's velocity and position (`own`, in the order of the target's
    /// state), the rows `B` that make the error of `own` from the navigation error, that error's
    /// covariance, and the cross-covariance (zero for trackers that keep none).
    pub fn new<const N: usize>(
        track: &TrackEstimate<T>,
        own: &Vector4<T>,
        own_from_error: &SMatrix<T, 4, N>,
        navigation: &SMatrix<T, N, N>,
        cross: &SMatrix<T, N, 4>,
    ) -> Self {
        let b = own_from_error;
        let shared = b * cross;
        Self {
            state: track.state - own,
            covariance: track.covariance - shared - shared.transpose()
                + b * navigation * b.transpose(),
        }
    }

    /// The closest approach, and how likely it is closer than `distance_m`.
    ///
    /// The miss distance is taken as normal about its signed value, linearised; `None` when the
    /// numbers are not finite or a variance is negative.
    pub fn closest_approach(&self, distance_m: T) -> Option<ClosestApproach<T>> {
        let x = &self.state;
        let (r, v) = (Vector2::new(x[0], x[2]), Vector2::new(x[1], x[3]));
        let speed2 = v.norm_squared();
        let closing = r.dot(&v);
        let still = speed2 <= lit(1e-12);
        let (time_s, miss, by_state, by_state_time) = if still || closing >= T::zero() {
            // The closest moment is now: the distance is that of this moment.
            let distance = r.norm();
            let unit = if distance > T::zero() {
                r / distance
            } else {
                Vector2::x()
            };
            let zero = T::zero();
            let row = RowVector4::new(unit.x, zero, unit.y, zero);
            (zero, distance, row, RowVector4::zeros())
        } else {
            approach(&r, &v)
        };
        let std = |row: &RowVector4<T>| {
            let variance = (row * self.covariance * row.transpose())[(0, 0)];
            (variance >= T::zero() && variance.is_finite()).then(|| variance.sqrt())
        };
        let (distance_std_m, time_std_s) = (std(&by_state)?, std(&by_state_time)?);
        let distance = miss.abs();
        if !(distance.is_finite() && time_s.is_finite()) {
            return None;
        }
        Some(ClosestApproach {
            time_s,
            time_std_s,
            distance_m: distance,
            distance_std_m,
            probability: probability_within(distance, distance_std_m, distance_m),
        })
    }
}

/// Time, signed miss distance `(v x r) / |v|`, and their derivatives by the relative state.
fn approach<T: Scalar>(r: &Vector2<T>, v: &Vector2<T>) -> (T, T, RowVector4<T>, RowVector4<T>) {
    let speed2 = v.norm_squared();
    let speed = speed2.sqrt();
    let u = v / speed;
    let time = -r.dot(v) / speed2;
    let miss = u.x * r.y - u.y * r.x;
    // At the closest moment the relative position is `miss` across the velocity; moving the
    // velocity turns it, as seen `time` later.
    let by_state = RowVector4::new(-u.y, -u.y * time, u.x, u.x * time);
    let by_velocity = |ri: T, vi: T| -(ri + vi * time * lit(2.0)) / speed2;
    let by_state_time = RowVector4::new(
        -v.x / speed2,
        by_velocity(r.x, v.x),
        -v.y / speed2,
        by_velocity(r.y, v.y),
    );
    (time, miss, by_state, by_state_time)
}

/// Probability that a normal variable with this mean and standard deviation is within `limit` of
/// zero.
fn probability_within<T: Scalar>(mean: T, std: T, limit: T) -> T {
    let zero = T::zero();
    if limit.is_finite() && limit <= zero {
        return zero;
    }
    if std <= zero {
        return if mean <= limit { T::one() } else { zero };
    }
    let upper_tail = |x: T| {
        let z: f64 = x.to_subset_unchecked();
        lit::<T>(0.5 * libm::erfc(z * core::f64::consts::FRAC_1_SQRT_2))
    };
    // P(-limit < m < limit) = Q((-limit - mean) / std) - Q((limit - mean) / std)
    upper_tail((-limit - mean) / std) - upper_tail((limit - mean) / std)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{SVector, Vector1};
    use num_dual::{DualSVec64, jacobian};
    use rand::{RngExt as _, SeedableRng as _};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    fn motion(state: [f64; 4], covariance: Matrix4<f64>) -> RelativeMotion<f64> {
        RelativeMotion {
            state: Vector4::from(state),
            covariance,
        }
    }

    #[test]
    fn the_distance_and_time_of_a_crossing_in_closed_form() {
        // 1000 m ahead, 200 m to the right, coming straight down at 10 m/s.
        let crossing = motion([1000.0, -10.0, 200.0, 0.0], Matrix4::identity());
        let cpa = crossing.closest_approach(250.0).unwrap();
        assert_relative_eq!(cpa.time_s, 100.0, epsilon = 1e-9);
        assert_relative_eq!(cpa.distance_m, 200.0, epsilon = 1e-9);
        // Position east 1 m, velocity east 1 m/s over 100 s.
        assert_relative_eq!(cpa.distance_std_m, (1.0_f64 + 1e4).sqrt(), epsilon = 1e-9);
        let apart = motion([1000.0, 10.0, 200.0, 0.0], Matrix4::identity());
        let now = apart.closest_approach(100.0).unwrap();
        assert!(now.time_s.abs() < 1e-15);
        assert_relative_eq!(now.distance_m, 1000.0_f64.hypot(200.0), epsilon = 1e-9);
    }

    #[test]
    fn derivatives_equal_dual_numbers() {
        type Dual = DualSVec64<4>;
        let at = SVector::from([800.0, -7.0, -300.0, 4.0]);
        let pick = |miss: bool| {
            move |x: SVector<Dual, 4>| {
                let (r, v) = (Vector2::new(x[0], x[2]), Vector2::new(x[1], x[3]));
                let s2 = v.norm_squared();
                let m = (v.x * r.y - v.y * r.x) / nalgebra::ComplexField::sqrt(s2);
                Vector1::new(if miss { m } else { -r.dot(&v) / s2 })
            }
        };
        let (m, by_m): (_, SMatrix<f64, 1, 4>) = jacobian(pick(true), &at);
        let (t, by_t): (_, SMatrix<f64, 1, 4>) = jacobian(pick(false), &at);
        let (time, miss, row, row_t) =
            approach(&Vector2::new(at[0], at[2]), &Vector2::new(at[1], at[3]));
        assert_relative_eq!(time, t[0], epsilon = 1e-12);
        assert_relative_eq!(miss, m[0], epsilon = 1e-12);
        assert_relative_eq!(row, by_m, epsilon = 1e-10);
        assert_relative_eq!(row_t, by_t, epsilon = 1e-12);
    }

    #[test]
    fn the_probability_is_that_of_a_monte_carlo_draw() {
        let root = Matrix4::new(
            20.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.0, 0.0, 5.0, 0.0, 30.0, 0.0, 0.0, 0.05, 0.1, 0.3,
        );
        let relative = motion([1500.0, -8.0, 100.0, -0.3], root * root.transpose());
        let cpa = relative.closest_approach(60.0).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(9);
        let n = 100_000;
        let close = (0..n).filter(|_| {
            let white = Vector4::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let drawn = RelativeMotion {
                state: relative.state + root * white,
                ..relative
            };
            drawn
                .closest_approach(60.0)
                .is_some_and(|cpa| cpa.distance_m < 60.0)
        });
        let share = close.count() as f64 / f64::from(n);
        assert!(
            (share - cpa.probability).abs() < 0.01,
            "{share} {}",
            cpa.probability
        );
        assert!((0.2..0.8).contains(&cpa.probability));
    }

    #[test]
    fn a_shared_position_error_cancels() {
        // Both are off by the same metres: the relative position is exact.
        let own = nalgebra::Matrix4::from_diagonal(&Vector4::new(25.0, 0.0, 25.0, 0.0));
        let track = TrackEstimate {
            state: Vector4::new(500.0, -5.0, 0.0, 0.0),
            covariance: own,
        };
        let b = Matrix4::identity();
        let relative = RelativeMotion::new(&track, &Vector4::zeros(), &b, &own, &own);
        assert!(relative.covariance.norm() < 1e-12);
        let alone = RelativeMotion::new(&track, &Vector4::zeros(), &b, &own, &Matrix4::zeros());
        assert_relative_eq!(alone.covariance, own * 2.0);
        let negative = motion([1000.0, -10.0, 0.0, 0.0], -Matrix4::identity());
        assert!(negative.closest_approach(10.0).is_none());
    }
}
