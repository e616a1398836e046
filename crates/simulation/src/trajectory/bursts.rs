//! Bursts: disturbances that come and go on a schedule, and the shaking that goes with them.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::RngExt as _;

use super::blend::smooth_step;
use super::{Trajectory, Truth};
use crate::random::Stream;
use crate::rotation::sin_cos;

/// When bursts happen: `length_s` seconds from `start_s` on, in every `period_s` seconds, as long as
/// the burst ends by `until_s`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BurstSchedule {
    /// Length of a round, s.
    pub period_s: f64,
    /// Beginning of the burst within the round, s.
    pub start_s: f64,
    /// Length of the burst, s.
    pub length_s: f64,
    /// No burst reaches beyond this, s.
    pub until_s: f64,
}

impl BurstSchedule {
    /// Time since the burst began that is on at `t_s`, s; `None` between bursts. Defined from time
    /// zero on.
    #[must_use]
    pub fn since_start(&self, t_s: f64) -> Option<f64> {
        if t_s < 0.0 || t_s > self.until_s {
            return None;
        }
        let since = t_s % self.period_s - self.start_s;
        let on = (0.0..self.length_s).contains(&since);
        // Compared with a margin: whether a burst fits must not hang on the last bit.
        let fits = t_s - since + self.length_s <= self.until_s + 1e-6;
        (on && fits).then_some(since)
    }
}

/// Shaking along all three world axes: sines that fade in and out, so that velocity and position
/// come back to where they were when the burst is over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccelerationBursts {
    /// When they happen.
    pub schedule: BurstSchedule,
    /// Amplitude of the acceleration along each axis, m/s^2 (while fading up to a third more).
    pub amplitude_m_s2: f64,
    /// How fast it shakes, Hz.
    pub frequency_hz: f64,
    /// Phase of each axis, rad.
    pub phases_rad: [f64; 3],
    /// Time to fade in and to fade out, s.
    pub ramp_s: f64,
}

impl AccelerationBursts {
    /// Shaking at 0.8 Hz from 1 s to 9 s of every 20 s, with phases drawn from `stream` and ramps of
    /// 1 s.
    #[must_use]
    pub fn random(stream: &mut Stream, amplitude_m_s2: f64, until_s: f64) -> Self {
        Self {
            schedule: BurstSchedule {
                period_s: 20.0,
                start_s: 1.0,
                length_s: 8.0,
                until_s,
            },
            amplitude_m_s2,
            frequency_hz: 0.8,
            phases_rad: std::array::from_fn(|_| TAU * stream.random::<f64>()),
            ramp_s: 1.0,
        }
    }

    /// Position (m), velocity (m/s) and acceleration (m/s^2) of the shaking in the world.
    #[must_use]
    pub fn at(&self, t_s: f64) -> [Vector3<f64>; 3] {
        let Some(since) = self.schedule.since_start(t_s) else {
            return [Vector3::zeros(); 3];
        };
        let to_end = self.schedule.length_s - since;
        let (w, mut w1, w2) = smooth_step(since.min(to_end) / self.ramp_s);
        if to_end < since {
            w1 = -w1;
        }
        let (w1, w2) = (w1 / self.ramp_s, w2 / (self.ramp_s * self.ramp_s));

        let f = TAU * self.frequency_hz;
        let (mut sine, mut cosine) = (Vector3::zeros(), Vector3::zeros());
        for (axis, phase) in self.phases_rad.iter().enumerate() {
            (sine[axis], cosine[axis]) = sin_cos(f * since + phase);
        }
        // The position whose second derivative is a sine of the wanted amplitude.
        let p = sine * (-self.amplitude_m_s2 / (f * f));
        let p1 = cosine * (-self.amplitude_m_s2 / f);
        let p2 = sine * self.amplitude_m_s2;
        [p * w, p * w1 + p1 * w, p * w2 + p1 * (2.0 * w1) + p2 * w]
    }
}

/// A motion with shaking on top of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaken<T> {
    /// The motion that is shaken.
    pub motion: T,
    /// The shaking.
    pub bursts: AccelerationBursts,
}

impl<T: Trajectory> Trajectory for Shaken<T> {
    fn at(&self, t_s: f64) -> Truth {
        let mut truth = self.motion.at(t_s);
        let [position, velocity, acceleration] = self.bursts.at(t_s);
        truth.position += position;
        truth.velocity += velocity;
        truth.acceleration_world += acceleration;
        truth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::trajectory::Rest;
    use crate::trajectory::tests::assert_derivatives;

    fn shaken(until_s: f64) -> Shaken<Rest> {
        Shaken {
            motion: Rest::default(),
            bursts: AccelerationBursts::random(&mut stream(1, "disturbance"), 2.0, until_s),
        }
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_the_position() {
        let ends_of_ramps = [1.0, 2.0, 8.0, 9.0, 21.0, 22.0];
        assert_derivatives(&shaken(60.0), 25.0, &ends_of_ramps, 1e-5);
    }

    #[test]
    fn shaking_has_the_amplitude_asked_for_and_ends_where_it_began() {
        let motion = shaken(60.0);
        let mut peak = 0.0_f64;
        for i in 0..600 {
            let truth = motion.at(2.0 + 0.01 * f64::from(i));
            peak = peak.max(truth.acceleration_world.amax());
        }
        assert!((peak - 2.0).abs() < 1e-3, "{peak}");
        for quiet in [0.5, 1.0, 9.0, 15.0, 20.5] {
            assert_eq!(motion.at(quiet), motion.at(0.0));
        }
        for i in 0..900 {
            let fading = motion.at(0.01 * f64::from(i)).acceleration_world.amax();
            assert!(fading < 2.0 * 4.0 / 3.0, "{fading}");
        }
    }

    #[test]
    fn a_burst_that_would_be_cut_off_does_not_begin() {
        assert!(shaken(29.0).at(25.0).acceleration_world.norm() > 0.1);
        assert!(shaken(28.9).at(25.0).acceleration_world.norm() < 1e-12);
        assert!(shaken(28.9).at(5.0).acceleration_world.norm() > 0.1);
    }

    #[test]
    fn the_schedule_is_on_from_start_to_end_of_each_burst() {
        let schedule = BurstSchedule {
            period_s: 20.0,
            start_s: 14.0,
            length_s: 6.0,
            until_s: 60.0,
        };
        for (t, since) in [(14.0, 0.0), (19.5, 5.5), (34.0, 0.0), (57.0, 3.0)] {
            assert_eq!(schedule.since_start(t), Some(since), "{t}");
        }
        for t in [-6.0, -1.0, 0.0, 13.99, 20.0, 33.9, 60.0, 75.0] {
            assert_eq!(schedule.since_start(t), None, "{t}");
        }
    }
}
