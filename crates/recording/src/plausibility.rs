//! Detects units that cannot be: degrees for radians, g for m/s^2, gauss or tesla for microtesla; and
//! places that cannot be (`plausibility/position.rs`).
//!
//! Streaming, constant memory. The accelerometer and the magnetometers are judged by the median
//! norm of their first two seconds. The gyroscope is judged by what the accelerometer sees of the
//! same motion: over short windows the direction of gravity in body axes must turn as the
//! integrated angular rate says. Two hypotheses compete, "the numbers are rad/s" and "the numbers
//! are deg/s"; only a clear win of the second refuses the recording, so a resting sensor, whose
//! numbers fit both, passes.

mod position;

use nalgebra::Vector3;
use position::PositionCheck;

use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample};
use crate::issues::Issues;
use crate::options::OpenOptions;

/// The checks of one recording.
#[derive(Debug, Clone)]
pub struct Plausibility {
    force: Option<NormCheck>,
    field: Option<NormCheck>,
    field_uncalibrated: Option<NormCheck>,
    rate: Option<RateCheck>,
    position: Option<PositionCheck>,
}

impl Plausibility {
    /// All checks, except those of sensors whose unit the user has named.
    #[must_use]
    pub fn new(options: &OpenOptions) -> Self {
        let field =
            (options.plausibility && options.magnetometer_unit.is_none()).then(NormCheck::default);
        Self {
            force: (options.plausibility && options.accelerometer_unit.is_none())
                .then(NormCheck::default),
            field_uncalibrated: field.clone(),
            field,
            rate: (options.plausibility && options.gyroscope_unit.is_none())
                .then(RateCheck::default),
            position: options.plausibility.then(PositionCheck::default),
        }
    }

    /// Looks at one event.
    ///
    /// # Errors
    /// [`RecordingError::ImplausibleUnit`] once the evidence is in.
    pub fn check(&mut self, event: &Event, file: &str) -> Result<()> {
        let (time_ns, sample) = (event.time_ns, &event.sample);
        if !sample.is_finite() {
            return Ok(());
        }
        match sample {
            Sample::AngularRate(rate) => {
                let check = self.rate.as_mut();
                rate_verdict(check.and_then(|check| check.turn(time_ns, rate)), file)?;
            }
            Sample::SpecificForce(force) => {
                advance(&mut self.force, time_ns, force, |norm| {
                    force_verdict(norm, file)
                })?;
                let check = self.rate.as_mut();
                rate_verdict(check.and_then(|check| check.see(time_ns, force)), file)?;
            }
            Sample::MagneticField(field) => {
                advance(&mut self.field, time_ns, field, |norm| {
                    field_verdict(norm, "magnetometer", file)
                })?;
            }
            Sample::MagneticFieldUncalibrated(field) => {
                advance(&mut self.field_uncalibrated, time_ns, field, |norm| {
                    field_verdict(norm, "magnetometer-uncalibrated", file)
                })?;
            }
            Sample::GnssPosition(fix) => {
                if let Some(check) = &mut self.position {
                    check.position(time_ns, fix, file)?;
                }
            }
            Sample::GnssVelocity(velocity) => {
                if let Some(check) = &mut self.position {
                    check.velocity(time_ns, velocity);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Tells what was odd and is no reason to refuse the recording.
    pub(crate) fn tell(&self, issues: &mut Issues) {
        if let Some(check) = &self.position {
            check.tell(issues);
        }
    }

    /// The verdict on recordings too short for the running checks.
    ///
    /// # Errors
    /// [`RecordingError::ImplausibleUnit`] as above.
    pub fn finish(&mut self, file: &str) -> Result<()> {
        let median = |check: &mut Option<NormCheck>| check.as_mut().and_then(NormCheck::median);
        median(&mut self.force).map_or(Ok(()), |norm| force_verdict(norm, file))?;
        median(&mut self.field).map_or(Ok(()), |norm| field_verdict(norm, "magnetometer", file))?;
        median(&mut self.field_uncalibrated).map_or(Ok(()), |norm| {
            field_verdict(norm, "magnetometer-uncalibrated", file)
        })?;
        rate_verdict(self.rate.as_ref().and_then(RateCheck::at_end), file)
    }
}

fn rate_verdict(verdict: Option<RateVerdict>, file: &str) -> Result<()> {
    verdict.map_or(Ok(()), |verdict| Err(verdict.error(file)))
}

/// Feeds a norm check and, when its window is full, judges and retires it.
fn advance(
    check: &mut Option<NormCheck>,
    time_ns: i64,
    v: &Vector3<f64>,
    judge: impl FnOnce(f64) -> Result<()>,
) -> Result<()> {
    let Some(running) = check else { return Ok(()) };
    if !running.add(time_ns, v.norm()) {
        return Ok(());
    }
    let median = running.median();
    *check = None;
    median.map_or(Ok(()), judge)
}

fn force_verdict(median_norm: f64, file: &str) -> Result<()> {
    // The upper limit is above 1 g for a sensor that is shaken by a runner from the first second on.
    if !(0.5..3.0).contains(&median_norm) {
        return Ok(());
    }
    Err(RecordingError::ImplausibleUnit {
        file: file.to_owned(),
        sensor: "accelerometer",
        evidence: format!(
            "the median norm of its first seconds is {median_norm:.3}, expected about 9.8 m/s^2; this looks like g"
        ),
        hint: "if so, use --accelerometer-unit g (or m-per-s2 if the numbers are right)",
    })
}

fn field_verdict(median_norm: f64, sensor: &'static str, file: &str) -> Result<()> {
    let (unit, hint) = match median_norm {
        n if n >= 2.0 => return Ok(()),
        n if n >= 0.01 => (
            "gauss",
            "if so, use --magnetometer-unit gauss (or microtesla if the numbers are right)",
        ),
        _ => (
            "tesla",
            "if so, use --magnetometer-unit tesla (or microtesla if the numbers are right)",
        ),
    };
    Err(RecordingError::ImplausibleUnit {
        file: file.to_owned(),
        sensor,
        evidence: format!(
            "the median norm of its first seconds is {median_norm:.3e}, expected 20 to 70 microtesla; this looks like {unit}"
        ),
        hint,
    })
}

/// Collects the norms of the first two seconds of a sensor.
#[derive(Debug, Clone, Default)]
struct NormCheck {
    start_ns: Option<i64>,
    norms: Vec<f64>,
}

impl NormCheck {
    const SPAN_NS: i64 = 2_000_000_000;
    const MOST: usize = 4096;

    /// Takes a norm (zeros say nothing about a unit); true when enough is known.
    fn add(&mut self, time_ns: i64, norm: f64) -> bool {
        if norm > 0.0 {
            self.norms.push(norm);
        }
        let start = *self.start_ns.get_or_insert(time_ns);
        time_ns.saturating_sub(start) >= Self::SPAN_NS || self.norms.len() >= Self::MOST
    }

    fn median(&mut self) -> Option<f64> {
        let middle = self.norms.len() / 2;
        let norms = &mut self.norms[..];
        (!norms.is_empty()).then(|| *norms.select_nth_unstable_by(middle, f64::total_cmp).1)
    }
}

/// Rates or degrees: the competition of the two hypotheses.
#[derive(Debug, Clone, Default)]
struct RateCheck {
    over: bool,
    norms: NormCheck,
    median_force: Option<f64>,
    last_rate_ns: Option<i64>,
    fast_since_ns: Option<i64>,
    fast_samples: u32,
    window: Option<Window>,
    calm_windows: u32,
    /// Those of them that count.
    windows: u32,
    /// Sums of squared direction errors of the two hypotheses, rad^2.
    error_rad: f64,
    error_deg: f64,
}

/// One comparison in progress: the direction of the specific force at its start, and where it
/// should be now in body axes under either hypothesis.
#[derive(Debug, Clone)]
struct Window {
    start_ns: i64,
    start: Vector3<f64>,
    if_rad: Vector3<f64>,
    if_deg: Vector3<f64>,
    /// Length of the path in between, rad if the numbers are rad/s.
    turn: f64,
}

#[derive(Debug)]
enum RateVerdict {
    TooFast { rate: f64 },
    Degrees { windows: u32, rad: f64, deg: f64 },
}

impl RateCheck {
    /// Length of a comparison: long enough for a visible turn, short enough that the linear
    /// acceleration and the gyroscope's bias do not matter.
    const WINDOW_NS: i64 = 250_000_000;
    const WINDOW_MOST_NS: i64 = 1_000_000_000;
    /// A comparison needs all specific forces within this fraction of their median: swinging arms
    /// and running turn the specific force with the body and speak for degrees.
    const CALM: f64 = 0.1;
    const PAUSE_NS: i64 = 100_000_000;
    /// A comparison counts when the radian hypothesis says that the body has turned along a path of
    /// at least `TURN` and that its direction has visibly moved, rad. Real motion rarely turns so
    /// much without the specific force leaving the calm band.
    const TURN: f64 = 2.0;
    const VISIBLE_TURN: f64 = 0.3;
    /// Rates which no hand, vehicle or common sensor sustains, rad/s.
    const TOO_FAST: f64 = 60.0;
    const TOO_FAST_NS: i64 = 250_000_000;
    const TOO_FAST_SAMPLES: u32 = 20;
    /// Evidence: number of windows, ratio of the squared errors, and the mean squared error that
    /// the radian hypothesis must at least have (rad^2): degrees predict directions at random,
    /// which gives 2.9.
    const WINDOWS: u32 = 6;
    const WINDOWS_AT_END: u32 = 3;
    const RATIO: f64 = 4.0;
    const LEAST_ERROR: f64 = 0.75;
    /// After this many calm windows, half an hour of them, the question is settled and costs
    /// nothing any more.
    const SETTLED: u32 = 7200;

    /// A gyroscope sample, rad/s if all is well.
    fn turn(&mut self, time_ns: i64, rate: &Vector3<f64>) -> Option<RateVerdict> {
        if let Some(verdict) = self.sustained(time_ns, rate.norm()) {
            return Some(verdict);
        }
        if self.over {
            return None;
        }
        let previous = self.last_rate_ns.replace(time_ns);
        let pause_ns = time_ns.saturating_sub(previous.unwrap_or(time_ns));
        if pause_ns > Self::PAUSE_NS {
            self.window = None;
        }
        if let Some(window) = &mut self.window {
            let turn = rate * (pause_ns as f64 * 1e-9);
            window.turn += turn.norm();
            window.if_rad = turned(&window.if_rad, &turn);
            window.if_deg = turned(&window.if_deg, &(turn * 1_f64.to_radians()));
        }
        None
    }

    fn sustained(&mut self, time_ns: i64, rate: f64) -> Option<RateVerdict> {
        if rate <= Self::TOO_FAST {
            self.fast_since_ns = None;
            return None;
        }
        let since = *self.fast_since_ns.get_or_insert_with(|| {
            self.fast_samples = 0;
            time_ns
        });
        self.fast_samples = self.fast_samples.saturating_add(1);
        let long = time_ns.saturating_sub(since) >= Self::TOO_FAST_NS;
        (long && self.fast_samples >= Self::TOO_FAST_SAMPLES)
            .then_some(RateVerdict::TooFast { rate })
    }

    /// An accelerometer sample, in any unit: only directions and ratios of norms matter.
    fn see(&mut self, time_ns: i64, force: &Vector3<f64>) -> Option<RateVerdict> {
        if self.over {
            return None;
        }
        let norm = force.norm();
        let Some(median) = self.median_force else {
            if self.norms.add(time_ns, norm) {
                self.median_force = self.norms.median();
                self.norms = NormCheck::default();
            }
            return None;
        };
        if (norm - median).abs() > Self::CALM * median {
            self.window = None;
            return None;
        }
        let direction = force / norm;
        match &self.window {
            Some(window) if time_ns.saturating_sub(window.start_ns) < Self::WINDOW_NS => {
                return None;
            }
            Some(window) if time_ns.saturating_sub(window.start_ns) <= Self::WINDOW_MOST_NS => {
                let window = window.clone();
                self.calm_windows += 1;
                self.weigh(&window, &direction);
            }
            _ => {}
        }
        self.window = Some(Window {
            start_ns: time_ns,
            start: direction,
            if_rad: direction,
            if_deg: direction,
            turn: 0.0,
        });
        let verdict = self.judge(Self::WINDOWS);
        self.over = self.calm_windows >= Self::SETTLED;
        verdict
    }

    fn weigh(&mut self, window: &Window, seen: &Vector3<f64>) {
        if window.turn < Self::TURN || window.start.angle(&window.if_rad) < Self::VISIBLE_TURN {
            return;
        }
        self.windows += 1;
        self.error_rad += seen.angle(&window.if_rad).powi(2);
        self.error_deg += seen.angle(&window.if_deg).powi(2);
    }

    fn at_end(&self) -> Option<RateVerdict> {
        (!self.over)
            .then(|| self.judge(Self::WINDOWS_AT_END))
            .flatten()
    }

    fn judge(&self, windows_needed: u32) -> Option<RateVerdict> {
        let windows = f64::from(self.windows);
        let degrees = self.windows >= windows_needed
            && self.error_rad > Self::RATIO * self.error_deg
            && self.error_rad > Self::LEAST_ERROR * windows;
        degrees.then(|| RateVerdict::Degrees {
            windows: self.windows,
            rad: (self.error_rad / windows).sqrt(),
            deg: (self.error_deg / windows).sqrt(),
        })
    }
}

/// A direction fixed in the world, in body axes, after the body has turned by the rotation vector
/// `turn` (rad).
fn turned(direction: &Vector3<f64>, turn: &Vector3<f64>) -> Vector3<f64> {
    let angle = turn.norm();
    if angle <= 0.0 {
        return *direction;
    }
    let axis = turn / angle;
    let (sin, cos) = angle.sin_cos();
    // Rodrigues' formula for the rotation by -angle.
    direction * cos - axis.cross(direction) * sin + axis * (axis.dot(direction) * (1.0 - cos))
}

impl RateVerdict {
    fn error(self, file: &str) -> RecordingError {
        let evidence = match self {
            Self::TooFast { rate } => {
                format!(
                    "the angular rate stays above 60 rad/s (now {rate:.0}); this looks like deg/s"
                )
            }
            Self::Degrees { windows, rad, deg } => format!(
                "the accelerometer contradicts it in {windows} turns (rms {:.0} deg off if the numbers are rad/s, \
                 {:.0} deg if they are deg/s)",
                rad.to_degrees(),
                deg.to_degrees(),
            ),
        };
        RecordingError::ImplausibleUnit {
            file: file.to_owned(),
            sensor: "gyroscope",
            evidence,
            hint: "if so, use --gyroscope-unit deg-per-s (or rad-per-s if the numbers are right)",
        }
    }
}
