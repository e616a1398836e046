//! Gravity does not turn as the gyroscope says: axes of one of the two are exchanged or have the wrong sign.
//!
//! While the device is turned over, gravity in body axes must turn against the body. Over turns of [`TURN`](TurnSign::TURN) and more the
//! rates as they are compete with all 47 other orders and signs of their axes. An arm that swings has forces of the wrong side as well,
//! but never calm ones that turn so far.

use nalgebra::Vector3;

use super::{Doubt, Felt, Verdict};
use crate::event::SensorKind;
use crate::signed_axes::SignedAxes;

/// Compares turns of gravity with those of the gyroscope.
#[derive(Debug, Clone, Default)]
pub(super) struct TurnSign {
    is_over: bool,
    last_rate_ns: Option<i64>,
    window: Option<Window>,
    /// Rotation vectors of the window's samples, rad: only of a window that counts are they put together.
    path: Vec<Vector3<f64>>,
    turns: u32,
    /// Sums of the squared errors of all hypotheses, rad^2, in the order of [`SignedAxes::all`].
    errors: Vec<f64>,
    windows: u32,
}

/// A turn in progress.
#[derive(Debug, Clone, Copy)]
struct Window {
    start_ns: i64,
    start: Vector3<f64>,
    /// Where gravity should be now, if the rates are right.
    expected: Vector3<f64>,
}

impl TurnSign {
    /// A turn of gravity that counts, rad, and the longest time for it.
    const TURN: f64 = 0.8;
    const LONGEST_NS: i64 = 2_000_000_000;
    /// Gravity must have moved by this, rad: where it stays, axes that make all of it a turn about the vertical fit whatever is wrong.
    const MOVED: f64 = 0.4;
    const PAUSE_NS: i64 = 100_000_000;
    /// Turns that are needed, error of the wrong hypothesis at least and of the right one at most, rad.
    const TURNS: u32 = 6;
    const WRONG: f64 = 0.5;
    const RIGHT: f64 = 0.25;
    /// Most samples of the gyroscope in a turn: none has so many a second, and a file cannot make it remember more.
    const MOST_SAMPLES: usize = 1 << 15;
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
            window.expected = turned(&window.expected, &turn);
            self.path.push(turn);
        }
        if self.path.len() > Self::MOST_SAMPLES {
            self.window = None;
            self.path.clear();
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
            if window.start.dot(&window.expected) > Self::TURN.cos() {
                return Ok(());
            }
            if window.start.angle(&seen) > Self::MOVED {
                self.compare(&window, &seen);
            }
        }
        self.path.clear();
        self.windows += 1;
        self.window = Some(Window {
            start_ns: time_ns,
            start: seen,
            expected: seen,
        });
        self.judge()
    }

    /// Where gravity should be by each hypothesis, and where it is.
    fn compare(&mut self, window: &Window, seen: &Vector3<f64>) {
        self.turns += 1;
        self.errors.resize(48, 0.0);
        for (error, axes) in self.errors.iter_mut().zip(SignedAxes::all()) {
            let along = |at: Vector3<f64>, turn: &Vector3<f64>| turned(&at, &axes.of(turn));
            let expected = self.path.iter().fold(window.start, along);
            *error += seen.angle(&expected).powi(2);
        }
    }

    fn judge(&mut self) -> Verdict {
        let turns = f64::from(self.turns);
        let rms = self.errors.iter().map(|error| (error / turns).sqrt());
        let all: Vec<(f64, SignedAxes)> = rms.zip(SignedAxes::all()).collect();
        // Of turns about one axis several fit: all signs reversed is the likeliest mistake.
        let reversed = all
            .iter()
            .find(|(rms, axes)| *axes == SignedAxes::REVERSED && *rms <= Self::RIGHT);
        let best = reversed.or_else(|| all.iter().min_by(|(a, _), (b, _)| a.total_cmp(b)));
        let (Some((as_is, _)), Some((least, axes))) = (all.first(), best) else {
            return Ok(());
        };
        if self.turns < Self::TURNS || *as_is < Self::WRONG || *least > Self::RIGHT {
            self.is_over = self.turns >= Self::SETTLED || self.windows >= Self::SETTLED_WINDOWS;
            return Ok(());
        }
        // Turns about one axis alone say nothing of the others.
        let others = all.iter().filter(|(rms, _)| *rms < Self::RIGHT).count() - 1;
        let (off, least) = (as_is.to_degrees(), least.to_degrees());
        let evidence = if *axes == SignedAxes::REVERSED {
            format!(
                "in {turns} turns gravity turns the other way (rms {off:.0} deg off, {least:.0} deg with the opposite signs); its signs \
                 look reversed, or the axes of gyroscope and accelerometer left-handed"
            )
        } else if others == 0 {
            format!(
                "in {turns} turns gravity does not turn as it says (rms {off:.0} deg off, {least:.0} deg with the axes {axes} of the \
                 gyroscope); axes of gyroscope or accelerometer look exchanged, or of the wrong sign"
            )
        } else {
            format!(
                "in {turns} turns gravity does not turn as it says (rms {off:.0} deg off, {least:.0} deg with other axes); axes of \
                 gyroscope or accelerometer look exchanged, or of the wrong sign"
            )
        };
        Err(Doubt {
            sensor: SensorKind::Gyroscope,
            evidence,
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
