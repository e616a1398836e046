//! Gravity turns against the gyroscope: its signs are reversed, or the axes of both are left-handed.
//!
//! While the device is turned over, gravity in body axes must turn against the body. Two hypotheses compete over turns of
//! [`TURN`](TurnSign::TURN) and more: the rates as they are, and with the opposite sign. An arm that swings has forces of the wrong side
//! as well, but never calm ones that turn so far.

use nalgebra::Vector3;

use super::{Doubt, Norms, Verdict, turned};
use crate::event::SensorKind;

/// Compares turns of gravity with those of the gyroscope.
#[derive(Debug, Clone, Default)]
pub(super) struct TurnSign {
    is_over: bool,
    norms: Norms,
    median_force: Option<f64>,
    last_rate_ns: Option<i64>,
    window: Option<Window>,
    turns: u32,
    /// Sums of the squared errors of both hypotheses, rad^2.
    errors: [f64; 2],
    windows: u32,
}

/// A turn in progress.
#[derive(Debug, Clone, Copy)]
struct Window {
    start_ns: i64,
    start: Vector3<f64>,
    /// Where gravity should be now, if the rates are right and if they are reversed.
    expected: [Vector3<f64>; 2],
}

impl TurnSign {
    /// A turn of gravity that counts, rad, and the longest time for it.
    const TURN: f64 = 0.8;
    const LONGEST_NS: i64 = 2_000_000_000;
    /// Forces within this share of their median are gravity.
    const CALM: f64 = 0.1;
    const PAUSE_NS: i64 = 100_000_000;
    /// Turns that are needed, error of the wrong hypothesis at least and of the right one at most, rad.
    const TURNS: u32 = 6;
    const WRONG: f64 = 0.8;
    const RIGHT: f64 = 0.25;
    /// After so many turns, or windows without any, the question is settled.
    const SETTLED: u32 = 20;
    const SETTLED_WINDOWS: u32 = 2000;

    /// A sample of the gyroscope, rad/s.
    pub(super) fn turn(&mut self, time_ns: i64, rate: &Vector3<f64>) {
        if self.is_over {
            return;
        }
        let last = self.last_rate_ns.replace(time_ns);
        let passed_ns = time_ns.saturating_sub(last.unwrap_or(time_ns));
        if passed_ns > Self::PAUSE_NS {
            self.window = None;
        }
        if let Some(window) = &mut self.window {
            let turn = rate * (passed_ns as f64 * 1e-9);
            window.expected[0] = turned(&window.expected[0], &turn);
            window.expected[1] = turned(&window.expected[1], &-turn);
        }
    }

    /// A sample of the accelerometer, in any unit.
    ///
    /// # Errors
    /// [`RecordingError::ImplausibleUnit`](crate::RecordingError::ImplausibleUnit) once the evidence is in.
    pub(super) fn see(&mut self, time_ns: i64, force: &Vector3<f64>) -> Verdict {
        if self.is_over {
            return Ok(());
        }
        let norm = force.norm();
        let Some(median) = self.median_force else {
            if self.norms.add(time_ns, norm) {
                self.median_force = self.norms.median();
                self.norms = Norms::default();
            }
            return Ok(());
        };
        if norm <= 0.0 || (norm - median).abs() > Self::CALM * median {
            self.window = None;
            return Ok(());
        }
        let seen = force / norm;
        if let Some(window) = self.window
            && time_ns.saturating_sub(window.start_ns) <= Self::LONGEST_NS
        {
            if window.start.angle(&window.expected[0]) < Self::TURN {
                return Ok(());
            }
            self.turns += 1;
            for (error, expected) in self.errors.iter_mut().zip(&window.expected) {
                *error += seen.angle(expected).powi(2);
            }
        }
        self.windows += 1;
        self.window = Some(Window {
            start_ns: time_ns,
            start: seen,
            expected: [seen; 2],
        });
        self.judge()
    }

    fn judge(&mut self) -> Verdict {
        let turns = f64::from(self.turns);
        let [as_is, reversed] = self.errors.map(|error| (error / turns).sqrt());
        if self.turns < Self::TURNS || as_is < Self::WRONG || reversed > Self::RIGHT {
            self.is_over = self.turns >= Self::SETTLED || self.windows >= Self::SETTLED_WINDOWS;
            return Ok(());
        }
        Err(Doubt {
            sensor: SensorKind::Gyroscope,
            evidence: format!(
                "in {turns} turns gravity turns the other way (rms {:.0} deg off, {:.0} deg with the opposite signs); its signs look \
                 reversed, or the axes of gyroscope and accelerometer left-handed",
                as_is.to_degrees(),
                reversed.to_degrees()
            ),
            hint: "if so, put it right with `axes` in a manifest (or use --gyroscope-unit rad-per-s to read the numbers as they are)",
        })
    }
}
