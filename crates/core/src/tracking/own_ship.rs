//! The own ship as the tracker sees it: a pose from which detections are measured, its covariance,
//! and how much of its error persists from one scan to the next.
//!
//! Read first: `docs/derivations/association.md`, section 1. The navigation filter behind the pose
//! is a black box here: only pose and covariance are known. What a target's error shares with the
//! own ship's (the cross-covariance `X`) then fades with [`PoseErrorCorrelation`].

use super::FARTHEST;
use super::radar::MOST_BEARING_RAD;
use nalgebra::{Matrix3, Vector3};

use crate::geometry::trigonometry::wrap;
use crate::kalman::covariance::is_covariance;
use crate::parameters::parameters;
use crate::scalar::{Scalar, lit};

/// Pose of the own ship at the time of a scan, with the covariance of its error.
///
/// Order of the components everywhere: north, east, heading.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct OwnShip<T> {
    /// Position north, m.
    pub north_m: T,
    /// Position east, m.
    pub east_m: T,
    /// Heading clockwise from north, rad. Zero for detections that are stated in north-east axes.
    pub heading_rad: T,
    /// Covariance of the error (true minus estimate) of north (m), east (m) and heading (rad).
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix3<T>,
}

parameters! {
    /// Correlation times of the error of the own ship's pose, for a navigation filter that is a black box.
    pub struct PoseErrorCorrelation;

    position_s: T, "s", From(0.0, 1e9), [300.0],
        "correlation time of the position error; 0 for an error that is new at every scan",
        "Raising it makes the tracker average less.";
    heading_s: T, "s", From(0.0, 1e9), [1e4],
        "correlation time of the heading error; 0 as for the position";
}

parameters! {
    /// How fast a ship can move: what is beyond is a jump of its navigation.
    pub struct PoseLimits;

    speed_m_s: T, "m/s", From(1e-4, 1e4), [50.0],
        "fastest own ship";
    turn_rad_s: T, "rad/s", From(1e-6, 1e3), [1.5],
        "fastest turn of the own ship";
    correction_m: T, "m", From(0.0, 1e6), [20.0],
        "largest correction of the own ship's position that is no jump";
}

impl<T: Scalar> PoseLimits<T> {
    /// Whether a ship can come from one pose to the other in `dt` seconds, six standard deviations of
    /// both, the correction of a receiver and half a radian granted.
    pub fn allow(&self, from: &OwnShip<T>, to: &OwnShip<T>, dt: T) -> bool {
        let spread = |i: usize, j: usize| {
            let p = from.covariance + to.covariance;
            lit::<T>(6.0) * (p[(i, i)] + p[(j, j)]).sqrt()
        };
        let (dn, de) = (to.north_m - from.north_m, to.east_m - from.east_m);
        let turned = wrap(to.heading_rad - from.heading_rad).abs();
        (dn * dn + de * de).sqrt() <= self.speed_m_s * dt + spread(0, 1) + self.correction_m
            && turned <= self.turn_rad_s * dt + spread(2, 2) + lit(0.5)
    }
}

impl<T: Scalar> OwnShip<T> {
    /// A pose known exactly.
    pub fn exact(north_m: T, east_m: T, heading_rad: T) -> Self {
        Self {
            north_m,
            east_m,
            heading_rad,
            covariance: Matrix3::zeros(),
        }
    }

    /// The pose with independent errors of these standard deviations (m, m, rad). A negative one makes
    /// a negative variance, which [`Self::is_valid`] refuses.
    #[must_use]
    pub fn with_std(mut self, north: T, east: T, heading: T) -> Self {
        self.covariance =
            Matrix3::from_diagonal(&Vector3::new(north, east, heading).map(|std| std * std.abs()));
        self
    }

    /// Whether the pose is one of this Earth (1e8 m, 1e4 rad), and its covariance one.
    pub fn is_valid(&self) -> bool {
        let (limit, p) = (lit(FARTHEST), &self.covariance);
        let is_near = self.north_m.abs() <= limit && self.east_m.abs() <= limit;
        is_near
            && self.heading_rad.abs() <= lit(MOST_BEARING_RAD)
            && is_covariance(p, lit(1e-6))
            && p.diagonal().max() <= limit * limit
    }
}

impl<T: Scalar> PoseErrorCorrelation<T> {
    /// Share of each pose error that is still there after `dt` seconds: `exp(-dt / tau)`, and not
    /// more than the variance shrank, because a filter that learned has forgotten its old error.
    pub fn factors(&self, before: &Matrix3<T>, after: &Matrix3<T>, dt: T) -> Vector3<T> {
        let times = [self.position_s, self.position_s, self.heading_s];
        Vector3::from_fn(|i, _| {
            if times[i] > T::zero() && before[(i, i)] > T::zero() {
                (-dt / times[i]).exp().min(after[(i, i)] / before[(i, i)])
            } else {
                T::zero()
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_covariance_that_is_none_is_refused() {
        let good = OwnShip::exact(1.0, 2.0, 0.3_f64);
        assert!(good.is_valid() && good.with_std(3.0, 0.0, 0.05).is_valid());
        let mut asymmetric = good.with_std(1.0, 1.0, 1.0);
        asymmetric.covariance[(0, 1)] = 0.5;
        let mut too_correlated = good.with_std(1.0, 1.0, 1.0);
        too_correlated.covariance[(0, 1)] = 1.5;
        too_correlated.covariance[(1, 0)] = 1.5;
        let mut negative = good;
        negative.covariance[(2, 2)] = -1e-9;
        let nan = OwnShip::exact(f64::NAN, 0.0, 0.0);
        let less_than_nothing = good.with_std(1.0, 1.0, -0.1);
        for bad in [asymmetric, too_correlated, negative, nan, less_than_nothing] {
            assert!(!bad.is_valid(), "{bad:?}");
        }
    }

    #[test]
    fn a_ship_moves_and_turns_but_does_not_jump() {
        let limits = PoseLimits::default();
        let from = OwnShip::exact(0.0, 0.0, 3.0_f64);
        assert!(limits.allow(&from, &OwnShip::exact(60.0, 0.0, -3.0), 1.0));
        assert!(!limits.allow(&from, &OwnShip::exact(80.0, 0.0, 3.0), 1.0));
        assert!(!limits.allow(&from, &OwnShip::exact(0.0, 0.0, 0.0), 1.0));
        let unsure = OwnShip::exact(80.0, 0.0, 0.0).with_std(5.0, 5.0, 0.5);
        assert!(limits.allow(&from, &unsure, 1.0));
    }

    #[test]
    fn errors_fade_with_time_and_with_what_navigation_learned() {
        let memory = PoseErrorCorrelation {
            position_s: 100.0,
            heading_s: 1000.0,
        };
        let before = Matrix3::from_diagonal(&Vector3::new(4.0, 0.0, 1.0));
        let after = Matrix3::from_diagonal(&Vector3::new(4.0, 1.0, 0.25));
        let f = memory.factors(&before, &after, 10.0);
        assert_relative_eq!(f.x, f64::exp(-0.1), epsilon = 1e-12);
        assert_relative_eq!(f.y, 0.0, epsilon = 1e-12);
        assert_relative_eq!(f.z, 0.25, epsilon = 1e-12);
        let none = PoseErrorCorrelation {
            position_s: 0.0,
            heading_s: 0.0,
        };
        assert_eq!(none.factors(&before, &after, 0.0), Vector3::zeros());
    }
}
