//! VQF as the baseline (Laidig and Seel 2023), with its default parameters on the same samples.
//!
//! Its sampling time is the nominal one, as its users give it: jitter and bursts of stamps do not reach it. Only a hole is
//! made good: the last rate is held over it.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use northing_recording::{Event, Sample};
use northing_simulation::attitude_world::{AttitudeWorldDescription, HeadingSource};
use vqf_rs::VQF;

use super::Sensing;
use super::score::Moment;

/// Its name in tables.
pub const NAME: &str = "vqf";

/// Stamps further than this behind the nominal time are a hole, s and sampling intervals: no burst is as late.
const HOLE: [f64; 2] = [0.09, 8.5];

/// Whether it knows north there: it takes a magnetometer, no compass.
#[must_use]
pub fn has_north(world: &AttitudeWorldDescription, sensing: Sensing) -> bool {
    sensing == Sensing::All && matches!(world.board.heading, HeadingSource::Magnetometer(_))
}

/// What it estimates at every gyroscope sample.
pub(super) fn estimates(
    world: &AttitudeWorldDescription,
    events: &[Event],
    sensing: Sensing,
    mut take: impl FnMut(Moment),
) {
    let board = &world.board;
    let interval_s = 1.0 / board.gyroscope.rate_hz;
    let with_field = has_north(world, sensing);
    let field_interval_s = match &board.heading {
        HeadingSource::Magnetometer(triad) => Some(1.0 / triad.rate_hz),
        _ => None,
    };
    let accelerometer_interval_s = Some(1.0 / board.accelerometer.rate_hz);
    let mut filter = VQF::new(interval_s, accelerometer_interval_s, field_interval_s, None);
    let mut clock = Clock::default();
    let first_ns = events.first().map_or(0, |event| event.time_ns);
    for event in events {
        let time_s = (event.time_ns - first_ns) as f64 * 1e-9;
        let array = |v: Vector3<f64>| -> [f64; 3] { v.into() };
        match event.sample {
            Sample::AngularRate(rate) => {
                filter.update_gyr_with_ts(array(rate), clock.step(time_s, interval_s));
            }
            Sample::SpecificForce(force) => filter.update_acc(array(force)),
            Sample::MagneticField(field) if with_field => filter.update_mag(array(field)),
            Sample::Reference(reference) => {
                let q = if with_field {
                    filter.quat_9d()
                } else {
                    filter.quat_6d()
                };
                let estimate = Quaternion::new(q.0, q.1, q.2, q.3);
                take(Moment {
                    time_s,
                    estimate: UnitQuaternion::new_normalize(estimate),
                    covariance: None,
                    truth: reference.attitude,
                });
            }
            _ => {}
        }
    }
}

/// The nominal time.
#[derive(Default)]
struct Clock(Option<f64>);

impl Clock {
    /// How long the rate of this sample holds, s.
    fn step(&mut self, stamp_s: f64, interval_s: f64) -> f64 {
        let expected = self.0.map_or(stamp_s, |now| now + interval_s);
        let late = stamp_s - expected;
        let hole = late > HOLE[0].max(HOLE[1] * interval_s);
        let more = if hole { late } else { 0.0 };
        self.0 = Some(expected + more);
        interval_s + more
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bursts_keep_the_nominal_time_and_a_hole_is_made_good() {
        let mut clock = Clock::default();
        let stamps = (0..100).map(|k| 0.01 * f64::from(k / 8 * 8 + 7));
        let steps: Vec<_> = stamps.map(|t| clock.step(t, 0.01)).collect();
        assert!(steps.iter().all(|s| (s - 0.01).abs() < 1e-12));
        assert!((clock.step(2.03, 0.01) - 0.97).abs() < 1e-9);
        assert!((clock.step(2.04, 0.01) - 0.01).abs() < 1e-12);
    }
}
