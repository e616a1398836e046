//! The estimator `device`: what the device itself reported, scored like an estimate.
//!
//! Devices report on their own clock. To be comparable with estimates at gyroscope samples their
//! orientation is interpolated between its neighbours (slerp), so each instant waits for the next
//! report. Across a pause longer than a second nothing is said.

use std::collections::VecDeque;

use nalgebra::UnitQuaternion;

use crate::attitude::tally::Tally;
use crate::attitude::{
    EstimateRecord, Instant, InstantSource, RunObserver, RunOptions, RunSummary,
};
use crate::error::EvaluationError;

/// Longest pause between reports that is interpolated across, ns.
const LONGEST_PAUSE_NS: i64 = 1_000_000_000;

/// Scores the device's own orientation.
pub(crate) fn run(
    instants: &mut dyn InstantSource,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<RunSummary, EvaluationError> {
    let mut tally = Tally::new(options);
    let mut interpolation = Interpolation::default();
    let mut instant = Instant::default();
    while instants.read(&mut instant)? {
        tally.read(&instant, None, None);
        if instant
            .angular_rate
            .is_some_and(|rate| rate.norm_squared().is_finite())
        {
            interpolation.wait(instant);
        }
        if let Some(orientation) = instant.device {
            interpolation.report(instant.time_ns, orientation, |waiting, attitude| {
                let record = record(waiting, attitude, tally.time_s(waiting.time_ns));
                tally.estimated(&record, observer);
            });
        }
    }
    Ok(tally.summary(options, false))
}

fn record(instant: &Instant, attitude: UnitQuaternion<f64>, time_s: f64) -> EstimateRecord {
    EstimateRecord {
        time_ns: instant.time_ns,
        time_s,
        attitude,
        attitude_covariance: None,
        gyroscope_bias: None,
        position: None,
        velocity: None,
        reference: instant.reference,
        device: Some(attitude),
    }
}

/// Instants that wait for the next report.
#[derive(Debug, Default)]
struct Interpolation {
    waiting: VecDeque<Instant>,
    last: Option<(i64, UnitQuaternion<f64>)>,
}

impl Interpolation {
    fn wait(&mut self, instant: Instant) {
        let now = instant.time_ns;
        while self
            .waiting
            .front()
            .is_some_and(|i| now.saturating_sub(i.time_ns) > LONGEST_PAUSE_NS)
        {
            self.waiting.pop_front();
        }
        self.waiting.push_back(instant);
    }

    /// Takes a report, and gives each waiting instant its orientation.
    fn report(
        &mut self,
        time_ns: i64,
        orientation: UnitQuaternion<f64>,
        mut give: impl FnMut(&Instant, UnitQuaternion<f64>),
    ) {
        for instant in self.waiting.drain(..) {
            if instant.time_ns == time_ns {
                give(&instant, orientation);
            } else if let Some((last_ns, last)) = self.last
                && time_ns.saturating_sub(last_ns) <= LONGEST_PAUSE_NS
            {
                let share =
                    (instant.time_ns - last_ns) as f64 / time_ns.saturating_sub(last_ns) as f64;
                // Nearly opposite orientations have no shortest way between them: keep the nearer.
                let nearer = if share < 0.5 { last } else { orientation };
                let between = last.try_slerp(&orientation, share, 1e-9).unwrap_or(nearer);
                give(&instant, between);
            }
        }
        self.last = Some((time_ns, orientation));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn turn(angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::z() * angle)
    }

    #[test]
    fn instants_between_reports_are_interpolated_and_pauses_are_not() {
        let mut interpolation = Interpolation::default();
        let mut given = Vec::new();
        let at = |ms: i64| Instant {
            time_ns: ms * 1_000_000,
            ..Instant::default()
        };
        let reports = [(10, 0.1), (30, 0.3), (2000, 0.5)];
        for (ms, angle) in reports {
            for before in [ms - 5, ms] {
                interpolation.wait(at(before));
            }
            interpolation.report(ms * 1_000_000, turn(angle), |instant, attitude| {
                given.push((instant.time_ns / 1_000_000, attitude.angle()));
            });
        }
        let times: Vec<_> = given.iter().map(|g| g.0).collect();
        assert_eq!(
            times,
            [10, 25, 30, 2000],
            "none before the first report, none in the pause"
        );
        approx::assert_relative_eq!(given[1].1, 0.25, epsilon = 1e-12);
    }
}
