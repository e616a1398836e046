//! Corrections along the arc about the own ship, in place of the tangent.
//!
//! *Read first:* `docs/derivations/schmidt_kalman.md`, section 11 (S19 to S22); Aidala & Hammel, *Utilization of modified
//! polar coordinates for bearings-only tracking* (1983), for the coordinates.
//!
//! A radar measures a range far better than the place across the line of sight, and a heading error turns everything that it
//! sees about the own ship. So where a target may be is an arc, not an ellipse: 3 degrees at 36 km are 1,900 m across, and
//! that arc bends by 50 m. A step along the tangent moves the target off its range by as much; after a few scans the filter
//! is hundreds of standard deviations wrong. Here the step is taken in range and direction, where both measurements are linear;
//! the velocity turns with it. Covariances stay in north and east: they are those of range and direction
//! at the estimate, carried over by the Jacobian, and so only have to be turned when the estimate moves.
//!
//! Where the step is small against the range it is the ordinary one, to second order of its angle. It is taken always, without
//! a limit above which curvature counts.

use nalgebra::{Matrix4, SMatrix, Vector3, Vector4};

use super::TrackEstimate;
use crate::kalman::covariance::symmetrize;
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, expect};
use crate::scalar::{Scalar, lit};

/// From where a target was seen: the centre of its arc.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct LineOfSight<T: Scalar> {
    /// Own ship's north and east, m.
    position: [T; 2],
}

/// A target and from where it was seen last: what a tracker remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SeenTrack<T: Scalar> {
    /// State, and the covariance of its errors along the line of sight and on the arc across it.
    pub tangent: TrackEstimate<T>,
    /// From where it was seen last; `None` where it was not seen yet.
    pub sight: Option<LineOfSight<T>>,
}

/// A track that this own ship has not seen yet.
impl<T: Scalar> From<TrackEstimate<T>> for SeenTrack<T> {
    fn from(tangent: TrackEstimate<T>) -> Self {
        Self {
            tangent,
            sight: None,
        }
    }
}

impl<T: Scalar> SeenTrack<T> {
    /// The target, with its mean square error in north and east (S22).
    pub fn estimate(&self) -> TrackEstimate<T> {
        self.sight
            .map_or(self.tangent, |sight| sight.with_arc(&self.tangent))
    }

    /// Moves the target along its arc (S19); gives what that does to its errors.
    #[inline]
    pub(super) fn step(&mut self, step: &Vector4<T>) -> Option<Turn<T>> {
        let track = &mut self.tangent;
        let Some(sight) = &self.sight else {
            track.state += step;
            return None;
        };
        let (state, turn) = sight.step(&track.state, step);
        track.state = state;
        if let Some(turn) = &turn {
            track.covariance = turn.both(&track.covariance);
            symmetrize(&mut track.covariance);
        }
        turn
    }

    /// Refuses one that is not [usable](TrackEstimate::is_usable), as an argument.
    pub(super) fn checked(self) -> Result<Self, ConfigError> {
        self.tangent.checked()?;
        Ok(self)
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        self.tangent.check()?;
        let sight = self.sight.is_none_or(|sight| sight.is_finite());
        expect("line of sight", sight, "finite")
    }
}

/// What a step along the arc does to errors of the target: `G` of (S20).
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn<T> {
    /// Unit vector of the line of sight before the step, and its length, m.
    sight: [T; 2],
    range: T,
    /// Velocity before the step, m/s.
    velocity: [T; 2],
    /// Cosine and sine of the angle of the step.
    rotation: [T; 2],
    /// Length and velocity after the step.
    range_after: T,
    velocity_after: [T; 2],
}

/// Turns a vector of north and east clockwise, as headings count.
#[inline]
fn turn<T: Scalar>([cos, sin]: [T; 2], [north, east]: [T; 2]) -> [T; 2] {
    [north * cos - east * sin, north * sin + east * cos]
}

impl<T: Scalar> LineOfSight<T> {
    /// From an own ship with this pose: `[north, east, heading]`.
    pub(super) fn new(pose: &Vector3<T>) -> Self {
        Self {
            position: [pose[0], pose[1]],
        }
    }

    /// Whether it is finite.
    pub(super) fn is_finite(&self) -> bool {
        self.position.iter().all(|x| x.is_finite())
    }

    /// From the own ship to the target, north and east.
    #[inline]
    fn to(&self, state: &Vector4<T>) -> [T; 2] {
        [state[0] - self.position[0], state[2] - self.position[1]]
    }

    /// The target after the correction `step` (S19), and what that does to its errors. A step that starts at the own ship, or leads over it,
    /// is straight.
    #[inline]
    pub(super) fn step(
        &self,
        state: &Vector4<T>,
        step: &Vector4<T>,
    ) -> (Vector4<T>, Option<Turn<T>>) {
        let [north, east] = self.to(state);
        let velocity = [state[1], state[3]];
        let range = north.hypot(east);
        let straight = state + step;
        if range <= T::zero() {
            return (straight, None);
        }
        let sight = [north / range, east / range];
        let unturned = Turn {
            sight,
            range,
            velocity,
            rotation: [T::one(), T::zero()],
            range_after: range,
            velocity_after: velocity,
        };
        let [angle, along, by_north, by_east] =
            unturned.in_range_and_direction([step[0], step[1], step[2], step[3]]);
        let range_after = range + along;
        if !(range_after > T::zero() && angle.abs() < T::pi()) {
            return (straight, None);
        }
        let rotation = [angle.cos(), angle.sin()];
        let [north, east] = turn(rotation, sight);
        let velocity_after = turn(rotation, [velocity[0] + by_north, velocity[1] + by_east]);
        let after = Vector4::new(
            self.position[0] + north * range_after,
            velocity_after[0],
            self.position[1] + east * range_after,
            velocity_after[1],
        );
        let turned = Turn {
            rotation,
            range_after,
            velocity_after,
            ..unturned
        };
        (after, Some(turned))
    }

    /// The mean square error in north and east of an estimate whose errors are normal in range and direction (S22): what the arc
    /// departs from its tangent by is added.
    pub(super) fn with_arc(&self, track: &TrackEstimate<T>) -> TrackEstimate<T> {
        let [north, east] = self.to(&track.state);
        let [v_north, v_east] = [track.state[1], track.state[3]];
        let squared = north * north + east * east;
        let mut out = *track;
        if squared <= T::zero() {
            return out;
        }
        let p = track.position_covariance();
        let across = east * east * p[(0, 0)] - north * east * (p[(0, 1)] + p[(1, 0)])
            + north * north * p[(1, 1)];
        // The variance of the direction; beyond half a turn it says nothing more.
        let variance = (across / (squared * squared)).clamp(T::zero(), T::pi() * T::pi());
        let departure =
            Vector4::new(north, v_north, east, v_east) * (variance * lit::<T>(0.75).sqrt());
        out.covariance += departure * departure.transpose();
        out
    }
}

impl<T: Scalar> Turn<T> {
    /// Errors `[north, v_north, east, v_east]` as those of direction, range, and velocity in axes that turn with the direction.
    #[inline]
    fn in_range_and_direction(&self, [north, v_north, east, v_east]: [T; 4]) -> [T; 4] {
        let [n, e] = self.sight;
        let angle = (east * n - north * e) / self.range;
        [
            angle,
            north * n + east * e,
            v_north + angle * self.velocity[1],
            v_east - angle * self.velocity[0],
        ]
    }

    /// The errors of the target (rows) after the step: `G m` (S20).
    #[inline]
    pub(super) fn rows<const C: usize>(&self, m: &SMatrix<T, 4, C>) -> SMatrix<T, 4, C> {
        let mut out = *m;
        let [n, e] = turn(self.rotation, self.sight);
        for c in 0..C {
            let [angle, along, by_north, by_east] =
                self.in_range_and_direction([m[(0, c)], m[(1, c)], m[(2, c)], m[(3, c)]]);
            let across = angle * self.range_after;
            let [v_north, v_east] = turn(self.rotation, [by_north, by_east]);
            out[(0, c)] = n * along - e * across;
            out[(1, c)] = v_north - angle * self.velocity_after[1];
            out[(2, c)] = e * along + n * across;
            out[(3, c)] = v_east + angle * self.velocity_after[0];
        }
        out
    }

    /// `m G^T`, for a cross-covariance with a column for each of the target's states.
    #[inline]
    pub(super) fn columns<const N: usize>(&self, m: &SMatrix<T, N, 4>) -> SMatrix<T, N, 4> {
        self.rows(&m.transpose()).transpose()
    }

    /// `G P G^T`.
    #[inline]
    pub(super) fn both(&self, p: &Matrix4<T>) -> Matrix4<T> {
        self.rows(&self.rows(p).transpose())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::Rotation2;

    const OWN: Vector3<f64> = Vector3::new(100.0, -50.0, 0.3);

    /// A target 5 km off, known to 2 m in range and to 8 degrees in direction, its velocity correlated with both.
    fn track() -> TrackEstimate<f64> {
        let sight = Rotation2::new(2.1);
        let (p, v) = (
            sight * nalgebra::Vector2::new(5000.0, 0.0),
            sight * nalgebra::Vector2::new(-4.0, 9.0),
        );
        let root = Matrix4::new(
            2.0, 0.0, 0.0, 0.0, //
            0.3, 1.5, 0.0, 0.0, //
            40.0, 5.0, 700.0, 0.0, //
            0.2, -0.4, 1.0, 2.0,
        );
        let mut turn = Matrix4::zeros();
        for i in 0..2 {
            for j in 0..2 {
                turn[(2 * i, 2 * j)] = sight[(i, j)];
                turn[(2 * i + 1, 2 * j + 1)] = sight[(i, j)];
            }
        }
        TrackEstimate {
            state: Vector4::new(OWN.x + p.x, v.x, OWN.y + p.y, v.y),
            covariance: turn * root * root.transpose() * turn.transpose(),
        }
    }

    #[test]
    fn a_step_across_keeps_the_range_and_turns_the_velocity() {
        let (sight, track) = (LineOfSight::new(&OWN), track());
        let [north, east] = sight.to(&track.state);
        // 400 m across, and as much turn of the velocity as that is of direction: 0.08 rad, and nothing else
        let angle = 0.08;
        let step = Vector4::new(-east, -track.state[3], north, track.state[1]) * angle;
        let (after, turn) = sight.step(&track.state, &step);
        let [n, e] = sight.to(&after);
        assert_relative_eq!(n.hypot(e), 5000.0, epsilon = 1e-9);
        assert_relative_eq!(n.atan2(e), north.atan2(east) - angle, epsilon = 1e-12);
        assert_relative_eq!(after[1].hypot(after[3]), 97_f64.sqrt(), epsilon = 1e-12);
        // What is narrow along the line of sight stays so: the whole covariance has turned.
        let covariance = turn.unwrap().both(&track.covariance);
        let along = |p: &Matrix4<f64>, [n, e]: [f64; 2]| {
            (n * n * p[(0, 0)] + 2.0 * n * e * p[(0, 2)] + e * e * p[(2, 2)]) / (n * n + e * e)
        };
        assert_relative_eq!(
            along(&covariance, [n, e]),
            along(&track.covariance, [north, east]),
            epsilon = 1e-6
        );
        assert_relative_eq!(
            covariance.trace(),
            track.covariance.trace(),
            max_relative = 1e-9
        );
    }

    #[test]
    fn a_short_step_is_the_straight_one_and_a_step_over_the_own_ship_too() {
        let (sight, track) = (LineOfSight::new(&OWN), track());
        let step = Vector4::new(1e-3, 1e-5, -2e-3, 3e-5);
        let (after, turn) = sight.step(&track.state, &step);
        assert_relative_eq!(after, track.state + step, epsilon = 1e-8);
        assert_relative_eq!(
            turn.unwrap().both(&track.covariance),
            track.covariance,
            max_relative = 1e-5,
            epsilon = 0.2
        );
        let [north, east] = sight.to(&track.state);
        let over = Vector4::new(-1.5 * north, 0.0, -1.5 * east, 0.0);
        assert!(sight.step(&track.state, &over).1.is_none());
        let at = Vector4::new(OWN.x, 1.0, OWN.y, 1.0);
        let (after, turn) = sight.step(&at, &step);
        assert!(turn.is_none() && after == at + step);
        assert_eq!(
            sight
                .with_arc(&TrackEstimate {
                    state: at,
                    covariance: track.covariance
                })
                .covariance,
            track.covariance
        );
    }

    /// Draws that are normal in range and direction have the mean square error that is stated.
    #[test]
    fn the_mean_square_error_on_the_arc_is_that_of_a_draw() {
        use rand::{RngExt as _, SeedableRng as _};
        let (sight, track) = (LineOfSight::new(&OWN), track());
        let stated = sight.with_arc(&track);
        assert!(stated.covariance.trace() > track.covariance.trace() + 500.0);
        let root = track.covariance.cholesky().unwrap().l();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(4);
        let mut sum = Matrix4::zeros();
        let n = 40_000;
        for _ in 0..n {
            let step = root * Vector4::from_fn(|_, _| rng.sample(rand_distr::StandardNormal));
            let error = sight.step(&track.state, &step).0 - track.state;
            sum += error * error.transpose() / f64::from(n);
        }
        // NEES of four, where the tangent alone has
        let nees = |p: &Matrix4<f64>| (p.try_inverse().unwrap() * sum).trace();
        assert_relative_eq!(nees(&stated.covariance), 4.0, epsilon = 0.12);
        assert!(nees(&track.covariance) > 50.0);
    }
}
