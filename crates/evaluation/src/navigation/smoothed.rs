//! Scores of smoothed estimates: what a run scores is kept until the estimates are smoothed.

use nalgebra::{UnitQuaternion, Vector3};

use super::navigator::NavigationEstimate;
use super::score::{ScorePoint, Scorer};
use crate::statistics::seconds_between;

/// Nodes further apart than this have a gap between them, s.
const LONGEST_STEP_S: f64 = 0.6;

/// Something that a run scores.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Scored {
    /// A position.
    Position(ScorePoint),
    /// A velocity, and whether its vertical part is known.
    Velocity(i64, Vector3<f64>, bool),
    /// A course, and how fast the body turned then.
    Course(i64, Vector3<f64>, f64),
    /// An attitude.
    Attitude(i64, UnitQuaternion<f64>),
    /// The estimator got a fix.
    FixUsed,
}

impl Scored {
    /// When it is valid.
    pub(crate) const fn time_ns(&self) -> Option<i64> {
        match self {
            Self::Position(point) => Some(point.time_ns),
            Self::Velocity(time_ns, ..)
            | Self::Course(time_ns, ..)
            | Self::Attitude(time_ns, _) => Some(*time_ns),
            Self::FixUsed => None,
        }
    }

    /// Scores it; gives the error of a position.
    pub(crate) fn score(
        &self,
        scorer: &mut Scorer,
        estimate: Option<&NavigationEstimate>,
    ) -> Option<Vector3<f64>> {
        if matches!(self, Self::FixUsed) {
            scorer.fix_used();
            return None;
        }
        let estimate = estimate?;
        match self {
            Self::Position(point) => return Some(scorer.position(point, estimate)),
            Self::Velocity(time_ns, ned, vertical) => {
                scorer.velocity(*time_ns, ned, *vertical, estimate);
            }
            Self::Course(time_ns, ned, turn_rate) => {
                scorer.course(*time_ns, ned, *turn_rate, estimate);
            }
            Self::Attitude(time_ns, reference) => scorer.attitude(*time_ns, reference, estimate),
            Self::FixUsed => {}
        }
        None
    }
}

/// The estimate at `time_ns` between nodes in time order; `None` outside them and in gaps.
pub(crate) fn at(nodes: &[NavigationEstimate], time_ns: i64) -> Option<NavigationEstimate> {
    let after = nodes.partition_point(|node| node.time_ns < time_ns);
    let b = nodes.get(after)?;
    if b.time_ns == time_ns {
        return Some(*b);
    }
    let a = &nodes.get(after.checked_sub(1)?)?.in_frame(&b.frame);
    let step = seconds_between(a.time_ns, b.time_ns);
    if step > LONGEST_STEP_S {
        return None;
    }
    let s = seconds_between(a.time_ns, time_ns) / step;
    let attitude = a.ned_from_body.zip(b.ned_from_body);
    Some(NavigationEstimate {
        time_ns,
        ned_from_body: attitude.and_then(|(a, b)| a.try_slerp(&b, s, 1e-9)),
        position: hermite(a, b, step, s),
        velocity: a.velocity + (b.velocity - a.velocity) * s,
        position_covariance: a.position_covariance * (1.0 - s) + b.position_covariance * s,
        ..*b
    })
}

/// The cubic between two nodes that has their positions and velocities.
fn hermite(a: &NavigationEstimate, b: &NavigationEstimate, step: f64, s: f64) -> Vector3<f64> {
    let (s2, s3) = (s * s, s * s * s);
    a.position * (2.0 * s3 - 3.0 * s2 + 1.0)
        + a.velocity * (step * (s3 - 2.0 * s2 + s))
        + b.position * (3.0 * s2 - 2.0 * s3)
        + b.velocity * (step * (s3 - s2))
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use northing_core::navigation::Validity;

    use super::*;

    fn node(time_s: f64) -> NavigationEstimate {
        // A constant acceleration of 2 m/s^2 north and a turn of 0.5 rad/s.
        NavigationEstimate {
            time_ns: (time_s * 1e9) as i64,
            frame: crate::navigation::navigator::no_frame(),
            ned_from_body: Some(UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5 * time_s)),
            attitude_covariance: None,
            velocity_covariance: None,
            heading_std: None,
            position: Vector3::new(time_s * time_s, 1.0, 0.0),
            position_covariance: Matrix3::identity(),
            velocity: Vector3::new(2.0 * time_s, 0.0, 0.0),
            validity: Validity::Aided,
        }
    }

    #[test]
    fn between_nodes_accelerations_and_turns_go_on_and_gaps_stay_empty() {
        let nodes = [node(1.0), node(1.4), node(5.0)];
        let middle = at(&nodes, 1_300_000_000).unwrap();
        approx::assert_relative_eq!(middle.position.x, 1.69, epsilon = 1e-9);
        approx::assert_relative_eq!(middle.heading().unwrap(), 0.65, epsilon = 1e-9);
        assert_eq!(at(&nodes, 5_000_000_000), Some(node(5.0)));
        assert_eq!(at(&nodes, 3_000_000_000), None);
        assert_eq!(at(&nodes, 900_000_000), None);
        assert_eq!(at(&nodes, 6_000_000_000), None);
    }
}
