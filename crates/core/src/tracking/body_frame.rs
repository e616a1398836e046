//! A target in the axes of the own ship's body: the parametrisation the paper leaves for later.
//!
//! State: position ahead and to the right of the own ship (m), and the target's velocity over
//! ground in the same axes (m/s), `[ahead, v_ahead, right, v_right]`. The radar measures this
//! state directly, so no pose is needed; the own ship's motion enters between scans, as the
//! displacement and turn since the last one, with *their* uncertainty. That is small where an
//! absolute heading is poor: what the tracker gives up is the place of the target on the chart.
//!
//! The increments' errors must be independent from scan to scan, as those of an inertial unit are
//! and differences of absolute fixes are not.

use nalgebra::{Matrix2, Matrix3, Matrix4, SMatrix, Vector2, Vector3};

use super::line_of_sight::{LineOfSight, SeenTrack};
use super::linearization::Linearized;
use super::update::{Measured, symmetric2};
use super::{FARTHEST, RadarDetection, TrackEstimate, TrackerConfig, check_step};
use crate::kalman::covariance::is_resolved;
use crate::kalman::{Innovation, SkipReason};
use crate::parameters::ConfigError;
use crate::restorable::restorable;
use crate::scalar::{Scalar, lit};

/// How the own ship moved since the last scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnIncrement<T: Scalar> {
    /// Displacement ahead and to the right, m, in the body axes of the last scan.
    pub displacement: Vector2<T>,
    /// Turn to the right, rad.
    pub turn: T,
    /// Covariance of `[ahead, right, turn]`.
    pub covariance: Matrix3<T>,
}

/// The tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyFrameTracker<T: Scalar> {
    config: TrackerConfig<T>,
    track: SeenTrack<T>,
}

restorable!(BodyFrameTracker<T>, track: SeenTrack<T>);

impl<T: Scalar> BodyFrameTracker<T> {
    /// Starts from a track in body axes.
    ///
    /// # Errors
    /// The first setting outside its permitted range, or `"track"`.
    pub fn new(config: TrackerConfig<T>, track: TrackEstimate<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        let track = SeenTrack::from(track.checked()?);
        Ok(Self { config, track })
    }

    /// The target: `[ahead, v_ahead, right, v_right]`.
    pub fn track(&self) -> TrackEstimate<T> {
        self.track.estimate()
    }

    /// Moves target and own ship on by `dt` seconds (S13): `p <- R (p + v dt - d)`, `v <- R v` with
    /// `R` the turn to the left by the own ship's turn to the right.
    ///
    /// # Errors
    /// Why the step was refused; nothing has changed then.
    pub fn predict(&mut self, dt: T, own: &OwnIncrement<T>) -> Result<(), SkipReason> {
        check_step(dt)?;
        let finite = own.displacement.norm_squared().is_finite()
            && own.turn.is_finite()
            && own.covariance.norm_squared().is_finite();
        if !finite {
            return Err(SkipReason::NotFinite);
        }
        if !is_resolved(&own.covariance) {
            return Err(SkipReason::Numerical);
        }
        let (sin, cos) = (own.turn.sin(), own.turn.cos());
        let r = Matrix2::new(cos, sin, -sin, cos);
        let x = &self.track.tangent.state;
        let position = Vector2::new(x[0] + x[1] * dt, x[2] + x[3] * dt) - own.displacement;
        let (position, velocity) = (r * position, r * Vector2::new(x[1], x[3]));
        let by_state = self.transition(&r, dt);
        let by_own = increment_jacobian(&r, &position, &velocity);
        let moved = TrackEstimate {
            state: [position.x, velocity.x, position.y, velocity.y].into(),
            covariance: by_state * self.track.tangent.covariance * by_state.transpose()
                + by_own * own.covariance * by_own.transpose(),
        };
        if !moved.state.iter().all(|x| x.abs() <= lit(FARTHEST)) {
            return Err(SkipReason::OutOfRange);
        }
        let track = &mut self.track;
        track.tangent = moved;
        // The own ship stays where the axes begin.
        track.sight = (track.sight).map(|_| LineOfSight::new(&Vector3::zeros()));
        // White accelerations have no direction: the same noise in any axes.
        self.config.motion.add_noise(&mut track.tangent, dt);
        track.tangent.hold();
        Ok(())
    }

    fn transition(&self, r: &Matrix2<T>, dt: T) -> Matrix4<T> {
        let mut f = Matrix4::zeros();
        for i in 0..2 {
            for j in 0..2 {
                f[(2 * i, 2 * j)] = r[(i, j)];
                f[(2 * i, 2 * j + 1)] = r[(i, j)] * dt;
                f[(2 * i + 1, 2 * j + 1)] = r[(i, j)];
            }
        }
        f
    }

    /// Fuses a detection; no pose is needed.
    pub fn update(&mut self, detection: &RadarDetection<T>) -> Innovation<T> {
        let (track, noise, own) = (&mut self.track, &self.config.radar, Vector3::zeros());
        if let Err(reason) = detection.check() {
            return Innovation::skipped(reason);
        }
        let seen = Linearized::new(detection, &track.tangent, &own, noise);
        let h = &seen.by_target;
        let target = track.tangent.covariance * h.transpose();
        let measured = Measured {
            residual: seen.residual,
            covariance: symmetric2(&(h * target + noise.covariance())),
            target,
        };
        measured.fuse(track, self.config.gate_nis, seen.sight).0
    }
}

/// Derivative of the new state by `[ahead, right, turn]`.
fn increment_jacobian<T: Scalar>(
    r: &Matrix2<T>,
    position: &Vector2<T>,
    velocity: &Vector2<T>,
) -> SMatrix<T, 4, 3> {
    let zero = T::zero();
    SMatrix::<T, 4, 3>::new(
        -r[(0, 0)],
        -r[(0, 1)],
        position.y,
        zero,
        zero,
        velocity.y,
        -r[(1, 0)],
        -r[(1, 1)],
        -position.x,
        zero,
        zero,
        -velocity.x,
    )
}

#[cfg(test)]
mod tests {
    use super::super::test_scene::Scene;
    use super::super::{ConstantVelocity, PoseAsKnown, RadarNoise};
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{SVector, Vector4};
    use num_dual::{DualSVec64, jacobian};

    fn config() -> TrackerConfig<f64> {
        TrackerConfig::new(
            ConstantVelocity {
                acceleration_std: 0.05,
            },
            RadarNoise {
                range_std: 20.0,
                bearing_std: 0.02,
            },
        )
    }

    /// World to body axes of a pose, for a whole target state.
    fn to_body(world: &Vector4<f64>, pose: &Vector3<f64>) -> (Vector4<f64>, Matrix4<f64>) {
        let (sin, cos) = pose.z.sin_cos();
        let mut t = Matrix4::zeros();
        for k in 0..2 {
            t[(k, k)] = cos;
            t[(k, k + 2)] = sin;
            t[(k + 2, k)] = -sin;
            t[(k + 2, k + 2)] = cos;
        }
        let relative = world - Vector4::new(pose.x, 0.0, pose.y, 0.0);
        (t * relative, t)
    }

    #[test]
    fn with_exact_own_motion_it_equals_the_world_fixed_filter() {
        let mut scene = Scene::new(7);
        let noise = config().radar;
        let start = TrackEstimate {
            state: Vector4::new(2950.0, -4.0, 2010.0, -9.0),
            covariance: Matrix4::from_diagonal(&Vector4::new(900.0, 25.0, 2500.0, 30.0)),
        };
        let mut pose = Vector3::new(0.0, 0.0, 0.3);
        let (state, t) = to_body(&start.state, &pose);
        let body = TrackEstimate {
            state,
            covariance: t * start.covariance * t.transpose(),
        };
        let mut world = PoseAsKnown::new(config(), start).unwrap();
        let mut body = BodyFrameTracker::new(config(), body).unwrap();
        for k in 1..=60 {
            let before = pose;
            pose = Vector3::new(before.x + 9.0, before.y + 3.0, before.z + 0.03);
            let target = Vector4::new(
                3000.0 - 5.0 * f64::from(k),
                -5.0,
                2000.0 - 10.0 * f64::from(k),
                -10.0,
            );
            let detection = scene.detect(&target, &pose, &noise);
            let (sin, cos) = before.z.sin_cos();
            let step = Vector2::new(9.0, 3.0);
            let increment = OwnIncrement {
                displacement: Matrix2::new(cos, sin, -sin, cos) * step,
                turn: 0.03,
                covariance: Matrix3::zeros(),
            };
            world.predict(1.0).unwrap();
            body.predict(1.0, &increment).unwrap();
            let (a, b) = (world.update(&detection, &pose), body.update(&detection));
            assert_relative_eq!(a.nis, b.nis, epsilon = 1e-8);
            let (expected, t) = to_body(&world.track().state, &pose);
            assert_relative_eq!(body.track().state, expected, epsilon = 1e-7);
            let covariance = t * world.track().covariance * t.transpose();
            assert_relative_eq!(body.track().covariance, covariance, epsilon = 1e-7);
        }
    }

    #[test]
    fn jacobians_equal_dual_numbers() {
        let x0 = [500.0, -3.0, 120.0, 7.0, 9.0, -1.0, 0.2];
        let (new, exact): (_, SMatrix<f64, 4, 7>) = jacobian(
            |x: SVector<DualSVec64<7>, 7>| {
                let (sin, cos) = (
                    nalgebra::ComplexField::sin(x[6]),
                    nalgebra::ComplexField::cos(x[6]),
                );
                let dt = DualSVec64::<7>::from(2.0);
                let ahead = x[0] + x[1] * dt - x[4];
                let right = x[2] + x[3] * dt - x[5];
                Vector4::new(
                    cos * ahead + sin * right,
                    cos * x[1] + sin * x[3],
                    cos * right - sin * ahead,
                    cos * x[3] - sin * x[1],
                )
            },
            &SVector::from(x0),
        );
        let mut tracker = BodyFrameTracker::new(
            config(),
            TrackEstimate {
                state: Vector4::new(x0[0], x0[1], x0[2], x0[3]),
                covariance: Matrix4::zeros(),
            },
        )
        .unwrap();
        let own = Matrix3::new(0.4, 0.1, 0.0, 0.1, 0.3, 0.001, 0.0, 0.001, 1e-4);
        let increment = OwnIncrement {
            displacement: Vector2::new(9.0, -1.0),
            turn: 0.2,
            covariance: own,
        };
        tracker.predict(2.0, &increment).unwrap();
        assert_relative_eq!(tracker.track().state, new, epsilon = 1e-10);
        let by_own = exact.fixed_columns::<3>(4).into_owned();
        let mut expected = TrackEstimate {
            state: new,
            covariance: by_own * own * by_own.transpose(),
        };
        config().motion.add_noise(&mut expected, 2.0);
        assert_relative_eq!(
            tracker.track.tangent.covariance,
            expected.covariance,
            epsilon = 1e-10
        );
        let (sin, cos) = 0.2_f64.sin_cos();
        let f = tracker.transition(&Matrix2::new(cos, sin, -sin, cos), 2.0);
        assert_relative_eq!(f, exact.fixed_columns::<4>(0).into_owned(), epsilon = 1e-12);
        let bad = OwnIncrement {
            turn: f64::NAN,
            ..increment
        };
        assert_eq!(tracker.predict(1.0, &bad), Err(SkipReason::NotFinite));
    }
}
