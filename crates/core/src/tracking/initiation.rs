//! One-point initiation: a track from a single detection, with its cross-covariance.
//!
//! The position is the converted detection, the velocity is zero with the standard deviation of
//! what targets do. The error of that position contains the own ship's pose error, so a new track is
//! correlated with the navigation from the first moment (S4): `X_0 = [G_x; 0] T P_o`. Leaving this
//! out makes a tracker overconfident for as long as the heading error lasts.

use nalgebra::{Matrix4, SMatrix, Vector4};

use super::line_of_sight::{LineOfSight, SeenTrack};
use super::radar::DetectedPosition;
use super::{NavigationPose, RadarDetection, RadarNoise, TrackEstimate};
use crate::kalman::SkipReason;
use crate::scalar::Scalar;

/// A new track, and its covariance with the navigation error: one row for each of the own ship's
/// error states, one column for each of the target's.
///
/// # Errors
/// Why the detection, the own ship's pose or the velocity's standard deviation is refused.
pub fn one_point<T: Scalar, const N: usize>(
    detection: &RadarDetection<T>,
    noise: &RadarNoise<T>,
    velocity_std: T,
    own: &NavigationPose<'_, T, N>,
) -> Result<(SeenTrack<T>, SMatrix<T, N, 4>), SkipReason> {
    detection.check()?;
    own.check()?;
    if !(velocity_std > T::zero() && velocity_std.is_finite()) {
        return Err(SkipReason::OutOfRange);
    }
    let seen = DetectedPosition::new(detection, &own.pose);
    let position = seen.covariance(&noise.covariance(), &own.pose_covariance());
    let variance = velocity_std * velocity_std;
    let mut covariance = Matrix4::from_diagonal(&Vector4::repeat(variance));
    for (i, row) in [0, 2].into_iter().enumerate() {
        for (j, column) in [0, 2].into_iter().enumerate() {
            covariance[(row, column)] = position[(i, j)];
        }
    }
    let zero = T::zero();
    let state = Vector4::new(seen.position.x, zero, seen.position.y, zero);
    let with_position = own.covariance * own.pose_from_error.transpose() * seen.by_pose.transpose();
    let mut cross = SMatrix::<T, N, 4>::zeros();
    cross.set_column(0, &with_position.column(0));
    cross.set_column(2, &with_position.column(1));
    let track = SeenTrack {
        tangent: TrackEstimate { state, covariance },
        sight: Some(LineOfSight::new(&own.pose)),
    };
    Ok((track, cross))
}

#[cfg(test)]
mod tests {
    use super::super::test_scene::Scene;
    use super::*;
    use nalgebra::Vector3;

    /// Draws of the own error and of the noise: the moments are those that were said.
    #[test]
    fn the_moments_are_those_of_a_monte_carlo_draw() {
        let mut scene = Scene::new(5);
        let noise = RadarNoise {
            range_std: 2.0,
            bearing_std: 0.002,
        };
        let target = Vector4::new(900.0, 3.0, 700.0, -2.0);
        let mut sums = (Matrix4::<f64>::zeros(), SMatrix::<f64, 3, 4>::zeros());
        let covariance = scene.covariance;
        let n = 40_000;
        for _ in 0..n {
            let error = scene.draw_error();
            let true_pose = Vector3::new(10.0, -20.0, 0.4);
            let detection = scene.detect(&target, &true_pose, &noise);
            let own = NavigationPose {
                pose: true_pose - error,
                covariance: &covariance,
                pose_from_error: SMatrix::identity(),
            };
            let (track, _) = one_point(&detection, &noise, 3.0, &own).unwrap();
            let track = track.tangent;
            let off = target - track.state;
            sums.0 += off * off.transpose() / f64::from(n);
            sums.1 += error * off.transpose() / f64::from(n);
        }
        let own = NavigationPose {
            pose: Vector3::new(10.0, -20.0, 0.4),
            covariance: &covariance,
            pose_from_error: SMatrix::identity(),
        };
        let detection = scene.detect_exactly(&target, &own.pose);
        let (track, cross) = one_point(&detection, &noise, 3.0, &own).unwrap();
        let track = track.tangent;
        for i in [0, 2] {
            for j in [0, 2] {
                let off = sums.0[(i, j)] - track.covariance[(i, j)];
                assert!(off.abs() < 0.03 * track.covariance[(i, i)], "{i} {j} {off}");
            }
            for k in 0..3 {
                let size = (covariance[(k, k)] * track.covariance[(i, i)]).sqrt();
                assert!(
                    (sums.1[(k, i)] - cross[(k, i)]).abs() < 0.03 * size,
                    "{k} {i}"
                );
            }
        }
        assert_eq!((cross.column(1).norm(), cross.column(3).norm()), (0.0, 0.0));
    }

    #[test]
    fn bad_input_starts_no_track() {
        let noise = RadarNoise {
            range_std: 2.0,
            bearing_std: 0.002,
        };
        let good = RadarDetection {
            range: 100.0,
            bearing: 0.1,
        };
        let covariance = nalgebra::Matrix3::<f64>::identity();
        let rows = nalgebra::Matrix3::identity();
        let own = NavigationPose {
            pose: Vector3::zeros(),
            covariance: &covariance,
            pose_from_error: rows,
        };
        let bad = RadarDetection {
            range: f64::NAN,
            ..good
        };
        assert_eq!(
            one_point(&bad, &noise, 1.0, &own).unwrap_err(),
            SkipReason::NotFinite
        );
        assert_eq!(
            one_point(&good, &noise, 0.0, &own).unwrap_err(),
            SkipReason::OutOfRange
        );
        let negative = -covariance;
        let own = NavigationPose {
            covariance: &negative,
            ..own
        };
        assert_eq!(
            one_point(&good, &noise, 1.0, &own).unwrap_err(),
            SkipReason::Numerical
        );
    }
}
