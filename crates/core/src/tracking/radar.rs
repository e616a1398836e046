//! The radar: range and bearing of a target from the own ship, its Jacobians, and its conversion to
//! a position.
//!
//! With `d = target - own` (north, east) and `r = |d|`: range `r`, bearing `atan2(d_east, d_north) -
//! heading`, wrapped to half a turn (`docs/derivations/schmidt_kalman.md`, S1-S3). At the own ship
//! itself the bearing is undefined; closer than a metre nothing is linearised.

use nalgebra::{Matrix2, SMatrix, Vector2, Vector3, Vector4};

use crate::geometry::trigonometry::wrap;
use crate::kalman::SkipReason;
use crate::scalar::{Scalar, lit};

/// Closer than this (m) a bearing means nothing.
const CLOSEST_M: f64 = 1.0;
/// Farther than this (m) no radar looks.
const FARTHEST_M: f64 = 1e7;

/// A bearing beyond (rad) is none: its part within a turn would be rounding.
pub(super) const MOST_BEARING_RAD: f64 = 1e4;

/// One detection.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RadarDetection<T> {
    /// Distance, m.
    pub range: T,
    /// Direction, rad, clockwise from the own ship's bow.
    pub bearing: T,
}

/// Noise of a radar.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct RadarNoise<T> {
    /// Standard deviation of the range, m.
    pub range_std: T,
    /// Standard deviation of the bearing, rad.
    pub bearing_std: T,
}

impl<T: Scalar> RadarNoise<T> {
    /// Standard deviations of range (m) and bearing (rad).
    pub fn new(range_std: T, bearing_std: T) -> Self {
        Self {
            range_std,
            bearing_std,
        }
    }

    /// Covariance of range and bearing.
    #[inline]
    pub fn covariance(&self) -> Matrix2<T> {
        let zero = T::zero();
        Matrix2::new(
            self.range_std * self.range_std,
            zero,
            zero,
            self.bearing_std * self.bearing_std,
        )
    }
}

impl<T: Scalar> RadarDetection<T> {
    /// Distance (m) and direction (rad, clockwise from the own ship's bow).
    pub fn new(range: T, bearing: T) -> Self {
        Self { range, bearing }
    }

    /// Refuses what no radar can have seen.
    pub(super) fn check(&self) -> Result<(), SkipReason> {
        if !(self.range.is_finite() && self.bearing.is_finite()) {
            Err(SkipReason::NotFinite)
        } else if self.range <= T::zero()
            || self.range > lit(FARTHEST_M)
            || self.bearing.abs() > lit(MOST_BEARING_RAD)
        {
            Err(SkipReason::OutOfRange)
        } else {
            Ok(())
        }
    }
}

/// What the radar should see, and how that depends on target and own ship.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictedDetection<T: Scalar> {
    /// The predicted detection.
    pub detection: RadarDetection<T>,
    /// `H_t`: its derivative by the target's `[north, v_north, east, v_east]`.
    pub by_target: SMatrix<T, 2, 4>,
    /// `H_3`: its derivative by the own ship's `[north, east, heading]`.
    pub by_pose: SMatrix<T, 2, 3>,
}

impl<T: Scalar> PredictedDetection<T> {
    /// Predicts and linearises (S1, S2).
    ///
    /// # Errors
    /// [`SkipReason::Unobservable`] when target and own ship are closer than a metre.
    pub fn new(target: &Vector4<T>, pose: &Vector3<T>) -> Result<Self, SkipReason> {
        let (north, east) = (target[0] - pose[0], target[2] - pose[1]);
        let r2 = north * north + east * east;
        let closest = lit::<T>(CLOSEST_M);
        if !r2.is_finite() || r2 < closest * closest {
            return Err(SkipReason::Unobservable);
        }
        let r = r2.sqrt();
        let (zero, one) = (T::zero(), T::one());
        let (cos, sin) = (north / r, east / r);
        let (across_north, across_east) = (-sin / r, cos / r);
        Ok(Self {
            detection: RadarDetection {
                range: r,
                bearing: wrap(east.atan2(north) - pose[2]),
            },
            by_target: SMatrix::<T, 2, 4>::new(
                cos,
                zero,
                sin,
                zero,
                across_north,
                zero,
                across_east,
                zero,
            ),
            by_pose: SMatrix::<T, 2, 3>::new(-cos, -sin, zero, -across_north, -across_east, -one),
        })
    }

    /// Measured minus predicted, the bearing wrapped.
    #[inline]
    pub fn residual(&self, measured: &RadarDetection<T>) -> Vector2<T> {
        Vector2::new(
            measured.range - self.detection.range,
            wrap(measured.bearing - self.detection.bearing),
        )
    }
}

/// A detection as a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectedPosition<T: Scalar> {
    /// North and east, m.
    pub position: Vector2<T>,
    /// `G_x`: its derivative by the own ship's pose.
    pub by_pose: SMatrix<T, 2, 3>,
    /// `G_z`: its derivative by range and bearing.
    pub by_detection: Matrix2<T>,
}

impl<T: Scalar> DetectedPosition<T> {
    /// Converts a detection from this pose (S3).
    pub fn new(detection: &RadarDetection<T>, pose: &Vector3<T>) -> Self {
        let direction = detection.bearing + pose[2];
        let (sin, cos) = (direction.sin(), direction.cos());
        let (zero, one) = (T::zero(), T::one());
        let (north, east) = (detection.range * cos, detection.range * sin);
        Self {
            position: Vector2::new(pose[0] + north, pose[1] + east),
            by_pose: SMatrix::<T, 2, 3>::new(one, zero, -east, zero, one, north),
            by_detection: Matrix2::new(cos, -east, sin, north),
        }
    }

    /// Covariance of the position from that of the radar and of the pose.
    pub fn covariance(&self, radar: &Matrix2<T>, pose: &nalgebra::Matrix3<T>) -> Matrix2<T> {
        self.by_detection * radar * self.by_detection.transpose()
            + self.by_pose * pose * self.by_pose.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::SVector;
    use num_dual::{DualSVec64, jacobian};

    type Dual = DualSVec64<7>;
    const POSES: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [120.0, -80.0, 2.9], [5.0, 1.0, -3.1]];
    const TARGETS: [[f64; 4]; 3] = [
        [3000.0, -5.0, 2000.0, -10.0],
        [-40.0, 1.0, 7.0, 2.0],
        [121.0, 0.0, -500.0, 0.0],
    ];

    #[test]
    fn jacobians_equal_dual_numbers() {
        for pose in POSES {
            for target in TARGETS {
                let at =
                    SVector::<f64, 7>::from_fn(|i, _| if i < 4 { target[i] } else { pose[i - 4] });
                let (_, exact): (_, SMatrix<f64, 2, 7>) = jacobian(
                    |x: SVector<Dual, 7>| {
                        let target = x.fixed_rows::<4>(0).into_owned();
                        let pose = x.fixed_rows::<3>(4).into_owned();
                        let predicted = PredictedDetection::new(&target, &pose).unwrap();
                        Vector2::new(predicted.detection.range, predicted.detection.bearing)
                    },
                    &at,
                );
                let predicted =
                    PredictedDetection::new(&Vector4::from(target), &Vector3::from(pose)).unwrap();
                assert_relative_eq!(
                    predicted.by_target,
                    exact.fixed_columns::<4>(0).into_owned(),
                    epsilon = 1e-12
                );
                assert_relative_eq!(
                    predicted.by_pose,
                    exact.fixed_columns::<3>(4).into_owned(),
                    epsilon = 1e-12
                );

                // The conversion is the inverse, and its Jacobians are right too.
                let back = DetectedPosition::new(&predicted.detection, &Vector3::from(pose));
                assert_relative_eq!(
                    back.position,
                    Vector2::new(target[0], target[2]),
                    epsilon = 1e-9
                );
                let z = predicted.detection;
                let at = SVector::<f64, 7>::from([
                    z.range, z.bearing, pose[0], pose[1], pose[2], 0.0, 0.0,
                ]);
                let (_, exact): (_, SMatrix<f64, 2, 7>) = jacobian(
                    |x: SVector<Dual, 7>| {
                        let z = RadarDetection {
                            range: x[0],
                            bearing: x[1],
                        };
                        DetectedPosition::new(&z, &x.fixed_rows::<3>(2).into_owned()).position
                    },
                    &at,
                );
                assert_relative_eq!(
                    back.by_detection,
                    exact.fixed_columns::<2>(0).into_owned(),
                    epsilon = 1e-9
                );
                assert_relative_eq!(
                    back.by_pose,
                    exact.fixed_columns::<3>(2).into_owned(),
                    epsilon = 1e-9
                );
            }
        }
    }

    #[test]
    fn bearings_wrap_and_the_nearest_target_has_none() {
        assert_relative_eq!(wrap(3.2_f64), 3.2 - core::f64::consts::TAU, epsilon = 1e-15);
        assert_relative_eq!(
            wrap(-9.0_f64),
            -9.0 + core::f64::consts::TAU,
            epsilon = 1e-15
        );
        let pose = Vector3::<f64>::new(0.0, 0.0, 3.0);
        let ahead = PredictedDetection::new(&Vector4::new(-100.0, 0.0, -1.0, 0.0), &pose).unwrap();
        assert!(ahead.detection.bearing.abs() < 0.2);
        for near in [0.0_f64, 0.5, f64::NAN] {
            let target = Vector4::new(near, 0.0, 0.0, 0.0);
            let reason = PredictedDetection::new(&target, &pose).unwrap_err();
            assert_eq!(reason, SkipReason::Unobservable);
        }
        for (range, bearing) in [
            (f64::NAN, 0.0),
            (10.0, f64::INFINITY),
            (0.0, 0.0),
            (-5.0, 1.0),
        ] {
            assert!(RadarDetection { range, bearing }.check().is_err());
        }
    }
}
