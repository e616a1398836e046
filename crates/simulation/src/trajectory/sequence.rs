//! Motions one after another, and motions over and over: the steps of a laboratory script.

use nalgebra::{UnitQuaternion, Vector3};

use super::{Rest, Trajectory, Truth};

/// Motions in time, each carried to the pose in which the one before it ended, so that position and
/// attitude never jump. The first starts in the reference pose at the origin. Rates and velocities
/// are those of the motions: for smooth joints each must start and end at rest.
///
/// ```
/// use northing_simulation::trajectory::{Coning, Sequence, Trajectory};
///
/// let script = Sequence::new()
///     .rest(10.0)
///     .then(33.3, Coning::default())
///     .rest(5.0);
/// assert_eq!(script.at(47.0), script.at(48.0));
/// ```
#[derive(Debug, Default)]
pub struct Sequence {
    segments: Vec<Segment>,
    duration_s: f64,
}

#[derive(Debug)]
struct Segment {
    start_s: f64,
    duration_s: f64,
    motion: Box<dyn Trajectory>,
    /// Turns the motion's own world into the world of the sequence.
    turn: UnitQuaternion<f64>,
    /// Where the motion's own origin lies in the world of the sequence, m.
    origin: Vector3<f64>,
}

impl Segment {
    fn at(&self, local_s: f64) -> Truth {
        let own = self.motion.at(local_s);
        Truth {
            world_from_body: self.turn * own.world_from_body,
            angular_rate_body: own.angular_rate_body,
            position: self.origin + self.turn * own.position,
            velocity: self.turn * own.velocity,
            acceleration_world: self.turn * own.acceleration_world,
        }
    }
}

impl Sequence {
    /// An empty sequence: rest in the reference pose.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Total length, s. Before zero and after this the body rests in the first and the last pose.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Appends `duration_s` seconds of rest.
    #[must_use]
    pub fn rest(self, duration_s: f64) -> Self {
        self.then(duration_s, Rest::default())
    }

    /// Appends the first `duration_s` seconds of `motion`, turned and moved as a whole so that it
    /// starts in the pose reached so far. A duration of zero or less appends nothing.
    #[must_use]
    pub fn then(mut self, duration_s: f64, motion: impl Trajectory + 'static) -> Self {
        if duration_s > 0.0 {
            let reached = self.end_pose();
            let own = motion.at(0.0);
            let turn = reached.world_from_body * own.world_from_body.inverse();
            self.segments.push(Segment {
                start_s: self.duration_s,
                duration_s,
                motion: Box::new(motion),
                turn,
                origin: reached.position - turn * own.position,
            });
            self.duration_s += duration_s;
        }
        self
    }

    fn start_pose(&self) -> Truth {
        let first = self.segments.first();
        first.map_or_else(Truth::default, |first| {
            at_rest_in_the_pose_of(&first.at(0.0))
        })
    }

    fn end_pose(&self) -> Truth {
        let last = self.segments.last();
        last.map_or_else(Truth::default, |last| {
            at_rest_in_the_pose_of(&last.at(last.duration_s))
        })
    }
}

fn at_rest_in_the_pose_of(truth: &Truth) -> Truth {
    Truth {
        position: truth.position,
        ..Truth::at_rest(truth.world_from_body)
    }
}

impl Trajectory for Sequence {
    fn at(&self, t_s: f64) -> Truth {
        if t_s >= self.duration_s {
            return self.end_pose();
        }
        let next = self.segments.partition_point(|s| s.start_s <= t_s);
        match next.checked_sub(1) {
            Some(now) => self.segments[now].at(t_s - self.segments[now].start_s),
            // Before the beginning.
            None => self.start_pose(),
        }
    }
}

/// A motion that starts again every `period_s` seconds. For no jump, it must be back in its first
/// pose at the end of the period.
#[derive(Debug)]
pub struct Repeated<T> {
    /// What is repeated.
    pub motion: T,
    /// After how long it starts again, s.
    pub period_s: f64,
}

impl<T: Trajectory> Trajectory for Repeated<T> {
    fn at(&self, t_s: f64) -> Truth {
        // What lies before the first beginning is the motion's own affair.
        let wrapped = if t_s < self.period_s {
            t_s
        } else {
            t_s % self.period_s
        };
        self.motion.at(wrapped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::rotation::log;
    use crate::trajectory::tests::assert_derivatives;
    use crate::trajectory::{AccelerationBursts, Coning, MultiSine, MultiSineConfig, Shaken};

    fn moved() -> Shaken<Coning> {
        // Ends far from home, turned and shifted.
        let bursts = AccelerationBursts::random(&mut stream(1, "disturbance"), 2.0, 60.0);
        Shaken {
            motion: Coning::default(),
            bursts,
        }
    }

    #[test]
    fn an_empty_sequence_is_rest() {
        let rest = Truth::at_rest(UnitQuaternion::identity());
        assert_eq!(Sequence::new().at(-1.0), rest);
        assert_eq!(Sequence::new().at(1.0), rest);
        assert_eq!(Sequence::new().rest(0.0).at(0.0), rest);
    }

    #[test]
    fn joints_do_not_jump_and_the_end_stays() {
        let script = Sequence::new().rest(2.0).then(4.3, moved()).rest(1.0);
        assert!((script.duration_s() - 7.3).abs() < 1e-12);
        for joint in [0.0, 2.0, 6.3, 7.3] {
            let (before, after) = (script.at(joint - 1e-7), script.at(joint + 1e-7));
            assert!((before.position - after.position).norm() < 1e-6, "{joint}");
            let turned = log(&(before.world_from_body.inverse() * after.world_from_body));
            assert!(turned.norm() < 1e-6, "{joint}");
        }
        let rest = Truth::at_rest(UnitQuaternion::identity());
        assert!(script.at(3.7).world_from_body.angle() > 0.05);
        for t in [-1.0, 0.0, 1.0] {
            assert_eq!(script.at(t), rest, "{t}");
        }
        assert_eq!(script.at(7.3), script.at(100.0));
        // At 3 s and 4 s the shaking begins to fade in and has done so.
        assert_derivatives(&script, 7.3, &[2.0, 3.0, 4.0, 6.3], 1e-5);
    }

    #[test]
    fn repeating_starts_again_without_a_jump() {
        let config = MultiSineConfig {
            duration_s: 10.0,
            ..MultiSineConfig::default()
        };
        let motion = MultiSine::random(&mut stream(2, "motion"), &config);
        let once = Sequence::new().rest(2.0).then(10.0, motion.clone());
        let repeated = Repeated {
            motion: Sequence::new().rest(2.0).then(10.0, motion),
            period_s: 12.0,
        };
        // 12 s is exact in binary, so whole periods wrap exactly.
        assert_eq!(repeated.at(7.0 + 12.0 * 1e6), once.at(7.0));
        assert_eq!(repeated.at(-3.0), once.at(-3.0));
        assert!(repeated.mean_rate(12.0 - 1e-4, 12.0 + 1e-4).norm() < 1e-3);
    }
}
