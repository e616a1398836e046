//! A detection linearised where it is straightest: in range and direction, or in the plane.
//!
//! *Read first:* `docs/derivations/schmidt_kalman.md`, section 11 (S23, S24).
//!
//! Far off, what is known of a target bends the plane: it lies on an arc, and its range and direction are linear in both
//! measurements. Near the own ship it is the other way about: where the range is uncertain by a good part of itself, the direction of
//! the target is not linear in the position, and the detection is best taken as a place. Both errors can be told before
//! the update, each against the noise of the radar, so the smaller one is taken.

use nalgebra::{Matrix2, SMatrix, Vector2, Vector3};

use super::line_of_sight::LineOfSight;
use super::radar::PredictedDetection;
use super::{RadarDetection, RadarNoise, TrackEstimate};
use crate::scalar::{Scalar, lit};

/// Residual of a detection and its derivatives; the noise is that of the radar (m, rad) in both forms.
#[derive(Debug, Clone, Copy)]
pub(super) struct Linearized<T: Scalar> {
    /// Measured minus predicted: range, m, and direction, rad.
    pub(super) residual: Vector2<T>,
    /// By the target's `[north, v_north, east, v_east]`.
    pub(super) by_target: SMatrix<T, 2, 4>,
    /// By the own ship's `[north, east, heading]`.
    pub(super) by_pose: SMatrix<T, 2, 3>,
    /// From where, when the correction goes along the arc; `None` for the plane.
    pub(super) sight: Option<LineOfSight<T>>,
}

impl<T: Scalar> Linearized<T> {
    /// Of a detection that has been checked, at a track seen from this pose.
    pub(super) fn new(
        detection: &RadarDetection<T>,
        track: &TrackEstimate<T>,
        pose: &Vector3<T>,
        noise: &RadarNoise<T>,
    ) -> Self {
        let position = track.position_covariance();
        match PredictedDetection::new(&track.state, pose) {
            Ok(predicted) if !is_flat(&predicted, &position, noise) => Self {
                residual: predicted.residual(detection),
                by_target: predicted.by_target,
                by_pose: predicted.by_pose,
                sight: Some(LineOfSight::new(pose)),
            },
            _ => Self::in_plane(detection, track, pose, noise),
        }
    }

    /// As a place: along the measured direction and across it, the latter as an angle at the distance that it probably has
    /// (S23).
    fn in_plane(
        detection: &RadarDetection<T>,
        track: &TrackEstimate<T>,
        pose: &Vector3<T>,
        noise: &RadarNoise<T>,
    ) -> Self {
        let direction = detection.bearing + pose[2];
        let (n, e) = (direction.cos(), direction.sin());
        let (north, east) = (track.state[0] - pose[0], track.state[2] - pose[1]);
        let (along, across) = (n * north + e * east, n * east - e * north);
        let [variance, _] = along_and_across(&track.position_covariance(), n, e);
        let measured = noise.range_std * noise.range_std;
        let share = variance / (variance + measured);
        let probable = along + (detection.range - along) * share;
        let r = (probable * probable + share * measured).sqrt();
        let (zero, r) = (T::zero(), T::one() / r);
        Self {
            residual: Vector2::new(detection.range - along, -across * r),
            by_target: SMatrix::<T, 2, 4>::new(n, zero, e, zero, -e * r, zero, n * r, zero),
            by_pose: SMatrix::<T, 2, 3>::new(-n, -e, zero, e * r, -n * r, -detection.range * r),
            sight: None,
        }
    }
}

/// Variances of a place along the direction `(n, e)` and across it.
fn along_and_across<T: Scalar>(p: &Matrix2<T>, n: T, e: T) -> [T; 2] {
    let cross = n * e * (p[(0, 1)] + p[(1, 0)]);
    [
        n * n * p[(0, 0)] + cross + e * e * p[(1, 1)],
        e * e * p[(0, 0)] - cross + n * n * p[(1, 1)],
    ]
}

/// Whether what is known of a target bends the plane less than range and direction (S24).
fn is_flat<T: Scalar>(
    predicted: &PredictedDetection<T>,
    position: &Matrix2<T>,
    noise: &RadarNoise<T>,
) -> bool {
    let (n, e) = (predicted.by_target[(0, 0)], predicted.by_target[(0, 2)]);
    let [along, across] = along_and_across(position, n, e);
    let r = predicted.detection.range;
    let angle = noise.bearing_std * noise.bearing_std + across / (r * r);
    let in_plane = r * angle / (noise.range_std * lit(2.0));
    let in_direction = (along * across).max(T::zero()).sqrt() / (r * r * noise.bearing_std);
    in_plane < in_direction
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Matrix4, SVector, Vector4};
    use num_dual::{DualNum as _, DualSVec64, jacobian};

    const POSE: Vector3<f64> = Vector3::new(12.0, -7.0, 0.4);
    const RADAR: RadarNoise<f64> = RadarNoise {
        range_std: 5.0,
        bearing_std: 0.02,
    };

    fn track(north: f64, east: f64, std: f64) -> TrackEstimate<f64> {
        TrackEstimate {
            state: Vector4::new(POSE.x + north, 3.0, POSE.y + east, -2.0),
            covariance: Matrix4::from_diagonal(&Vector4::new(std * std, 4.0, std * std, 4.0)),
        }
    }

    #[test]
    fn the_plane_is_for_what_is_near_and_the_arc_for_what_is_far() {
        let seen = |distance: f64, std: f64| {
            let detection = RadarDetection::new(distance, 0.9);
            let track = track(distance * 1.3_f64.cos(), distance * 1.3_f64.sin(), std);
            Linearized::new(&detection, &track, &POSE, &RADAR)
        };
        assert!(seen(15.0, 4.0).sight.is_none());
        assert!(seen(2000.0, 4.0).sight.is_some());
        // Whatever the unit of length: everything ten times as long is the same.
        for (distance, std) in [(30.0, 2.0), (80.0, 4.0), (300.0, 8.0), (900.0, 3.0)] {
            let radar = RadarNoise::new(10.0 * RADAR.range_std, RADAR.bearing_std);
            let detection = RadarDetection::new(10.0 * distance, 0.9);
            let far = track(
                10.0 * distance * 1.3_f64.cos(),
                10.0 * distance * 1.3_f64.sin(),
                10.0 * std,
            );
            let long = Linearized::new(&detection, &far, &POSE, &radar);
            assert_eq!(long.sight.is_some(), seen(distance, std).sight.is_some());
        }
    }

    /// The rows of the plane are the derivatives of the detected place, seen along the measured direction.
    #[test]
    fn rows_in_the_plane_equal_dual_numbers() {
        let (detection, track) = (RadarDetection::new(21.0, 0.7), track(9.0, 14.0, 4.0));
        let seen = Linearized::in_plane(&detection, &track, &POSE, &RADAR);
        let direction = detection.bearing + POSE.z;
        let (n, e) = (direction.cos(), direction.sin());
        let at = SVector::<f64, 5>::from([track.state[0], track.state[2], POSE.x, POSE.y, POSE.z]);
        // Less the detected place, along and across.
        let (off, exact) = jacobian(
            |x: SVector<DualSVec64<5>, 5>| {
                let turned = x[4] + detection.bearing;
                let north = x[0] - x[2] - turned.cos() * detection.range;
                let east = x[1] - x[3] - turned.sin() * detection.range;
                SVector::from([north * n + east * e, east * n - north * e])
            },
            &at,
        );
        let unit = 1.0 / (seen.by_target[(1, 0)].hypot(seen.by_target[(1, 2)]));
        assert_relative_eq!(
            seen.residual,
            Vector2::new(-off[0], -off[1] / unit),
            epsilon = 1e-12
        );
        for (row, scale) in [(0, 1.0), (1, 1.0 / unit)] {
            for (column, place) in [(0, 0), (2, 1)] {
                assert_relative_eq!(
                    seen.by_target[(row, column)],
                    exact[(row, place)] * scale,
                    epsilon = 1e-12
                );
            }
            for column in 0..3 {
                let derivative = exact[(row, 2 + column)] * scale;
                assert_relative_eq!(seen.by_pose[(row, column)], derivative, epsilon = 1e-12);
            }
        }
        // At a distance between what was predicted and what was measured.
        assert!((16.6..21.5).contains(&unit), "{unit}");
    }
}
