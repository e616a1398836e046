//! Gravity turns against the gyroscope: its signs are reversed, or the axes of both are left-handed.
//!
//! While the device is turned over, gravity in body axes must turn against the body. Two hypotheses compete over turns of
//! [`TURN`](TurnSign::TURN) and more: the rates as they are, and with the opposite sign. An arm that swings has forces of the wrong side
//! as well, but never calm ones that turn so far.

use nalgebra::Vector3;

use super::{Doubt, Felt, Verdict};
use crate::event::SensorKind;

/// Compares turns of gravity with those of the gyroscope.
#[derive(Debug, Clone, Default)]
pub(super) struct TurnSign {
    is_over: bool,
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
    const PAUSE_NS: i64 = 100_000_000;
    /// Turns that are needed, error of the wrong hypothesis at least and of the right one at most, rad.
    const TURNS: u32 = 6;
    const WRONG: f64 = 0.8;
    const RIGHT: f64 = 0.25;
    /// After so many turns, or windows without any, half an hour of them, the question is settled and costs nothing any more.
    const SETTLED: u32 = 20;
    const SETTLED_WINDOWS: u32 = 900;

    pub(super) fn is_over(&self) -> bool {
        self.is_over
    }

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

    /// What the accelerometer says at a stamp.
    ///
    /// # Errors
    /// [`RecordingError::ImplausibleUnit`](crate::RecordingError::ImplausibleUnit) once the evidence is in.
    pub(super) fn see(&mut self, time_ns: i64, felt: Felt) -> Verdict {
        let seen = match felt {
            _ if self.is_over => return Ok(()),
            Felt::Nothing => return Ok(()),
            Felt::Shaken => {
                self.window = None;
                return Ok(());
            }
            Felt::Gravity(direction) => direction,
        };
        if let Some(window) = self.window
            && time_ns.saturating_sub(window.start_ns) <= Self::LONGEST_NS
        {
            if window.start.dot(&window.expected[0]) > Self::TURN.cos() {
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

/// A direction fixed in the world, in body axes, after the body has turned by a small rotation vector (rad): to second order, since it
/// runs for every sample.
fn turned(direction: &Vector3<f64>, turn: &Vector3<f64>) -> Vector3<f64> {
    let first = turn.cross(direction);
    direction - first + turn.cross(&first) * 0.5
}
