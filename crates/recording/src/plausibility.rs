//! Detects units that cannot be: degrees for radians, g for m/s^2, gauss or tesla for microtesla; and
//! places that cannot be (`plausibility/position.rs`), and a gyroscope with reversed signs (`plausibility/turn_sign.rs`).
//!
//! Streaming, constant memory. The accelerometer and the magnetometers are judged by the median
//! norm of their first two seconds. The gyroscope is judged by what the accelerometer sees of the
//! same motion: over short windows the direction of gravity in body axes must turn as the
//! integrated angular rate says. Two hypotheses compete, "the numbers are rad/s" and "the numbers
//! are deg/s"; only a clear win of the second refuses the recording, so a resting sensor, whose
//! numbers fit both, passes.

mod position;
mod turn_sign;
mod vertical;

use nalgebra::Vector3;
use northing_core::geometry::so3;
use position::PositionCheck;
use turn_sign::TurnSign;

use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::issues::Issues;
use crate::options::OpenOptions;

/// What speaks against a recording: the sensor, the evidence, and what to do.
#[derive(Debug)]
struct Doubt {
    sensor: SensorKind,
    evidence: String,
    hint: &'static str,
}

type Verdict = std::result::Result<(), Doubt>;

impl Doubt {
    fn error(self, file: &str) -> RecordingError {
        RecordingError::ImplausibleUnit {
            file: file.to_owned(),
            sensor: self.sensor.name(),
            evidence: self.evidence,
            hint: self.hint,
        }
    }
}

/// The checks of one recording.
#[derive(Debug, Clone)]
pub struct Plausibility {
    /// Those that are not over.
    norms: Vec<NormCheck>,
    turns: Option<TurnChecks>,
    position: Option<PositionCheck>,
}

impl Plausibility {
    /// All checks, except those of sensors whose unit the user has named.
    #[must_use]
    pub fn new(options: &OpenOptions) -> Self {
        let is_named = [
            (
                SensorKind::Accelerometer,
                options.accelerometer_unit.is_some(),
            ),
            (
                SensorKind::Magnetometer,
                options.magnetometer_unit.is_some(),
            ),
            (
                SensorKind::MagnetometerUncalibrated,
                options.magnetometer_unit.is_some(),
            ),
        ];
        let checked = is_named
            .iter()
            .filter(|(_, named)| options.plausibility && !named);
        let rate = options.plausibility && options.gyroscope_unit.is_none();
        Self {
            norms: checked.map(|(kind, _)| NormCheck::new(*kind)).collect(),
            turns: rate.then(TurnChecks::default),
            position: options.plausibility.then(PositionCheck::default),
        }
    }

    /// All checks, of messages of ROS 2: their field is told in tesla.
    #[must_use]
    pub fn of_ros() -> Self {
        let mut checks = Self::new(&OpenOptions::default());
        for check in &mut checks.norms {
            check.in_tesla = true;
        }
        checks
    }

    /// Looks at one event.
    ///
    /// # Errors
    /// [`RecordingError::ImplausibleUnit`] once the evidence is in.
    pub fn check(&mut self, event: &Event, file: &str) -> Result<()> {
        self.look(event).map_err(|doubt| doubt.error(file))
    }

    /// As [`Self::check`], of a finite vector.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn check_vector(
        &mut self,
        time_ns: i64,
        sensor: SensorKind,
        vector: &Vector3<f64>,
        file: &str,
    ) -> Result<()> {
        self.look_at(time_ns, sensor, vector)
            .map_err(|doubt| doubt.error(file))
    }

    fn look(&mut self, event: &Event) -> Verdict {
        let (time_ns, sample) = (event.time_ns, &event.sample);
        if !sample.is_finite() {
            return Ok(());
        }
        match (sample, &mut self.position) {
            (Sample::GnssPosition(fix), Some(check)) => check.position(time_ns, fix),
            (Sample::GnssVelocity(velocity), Some(check)) => {
                check.velocity(time_ns, velocity);
                Ok(())
            }
            _ => match sample.vector() {
                Some(vector) => self.look_at(time_ns, sample.kind(), &vector),
                None => Ok(()),
            },
        }
    }

    fn look_at(&mut self, time_ns: i64, sensor: SensorKind, vector: &Vector3<f64>) -> Verdict {
        if let Some(at) = self.norms.iter().position(|check| check.sensor == sensor)
            && self.norms[at].norms.add(time_ns, vector.norm())
        {
            self.norms.remove(at).judge()?;
        }
        match (sensor, &mut self.turns) {
            (SensorKind::Gyroscope, Some(check)) => check.turn(time_ns, vector),
            (SensorKind::Accelerometer, Some(check)) => check.see(time_ns, vector),
            _ => Ok(()),
        }
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
        let norms = self.norms.iter_mut().try_for_each(NormCheck::judge);
        let rate = || (self.turns.as_ref()).map_or(Ok(()), |turns| turns.rate.at_end());
        norms
            .and_then(|()| rate())
            .map_err(|doubt| doubt.error(file))
    }
}

/// The median norm of the first two seconds of a vector sensor.
#[derive(Debug, Clone)]
struct NormCheck {
    sensor: SensorKind,
    norms: Norms,
    /// Whether the field, in microtesla here, was told in tesla.
    in_tesla: bool,
}

impl NormCheck {
    fn new(sensor: SensorKind) -> Self {
        Self {
            sensor,
            norms: Norms::default(),
            in_tesla: false,
        }
    }

    /// A field that is told in tesla, by its norm, microtesla.
    fn judge_tesla(&self, norm_ut: f64) -> Verdict {
        let looks = match norm_ut {
            2.0..5000.0 => return Ok(()),
            ..2.0 => "another unit",
            // The Earth's field is 22 to 67 microtesla, and so many of these times 1e6.
            ..1.2e5 => "millitesla",
            ..3e6 => "gauss",
            ..1.2e8 => "microtesla",
            ..3e9 => "milligauss",
            _ => "nanotesla",
        };
        Err(Doubt {
            sensor: self.sensor,
            evidence: format!(
                "the median norm of its first seconds is {:.3e}, expected 2e-5 to 7e-5 tesla; this looks like {looks}",
                norm_ut * 1e-6
            ),
            hint: "if so, publish it in tesla",
        })
    }

    fn judge(&mut self) -> Verdict {
        let Some(norm) = self.norms.median() else {
            return Ok(());
        };
        if self.in_tesla && self.sensor != SensorKind::Accelerometer {
            return self.judge_tesla(norm);
        }
        let (expected, looks, hint) = match (self.sensor, norm) {
            (SensorKind::Accelerometer, ..0.5) => (
                format!("{norm:.3}, expected about 9.8 m/s^2"),
                "acceleration without gravity, which does not say where up is",
                "if so, record the acceleration with gravity (or use --accelerometer-unit m-per-s2 if the numbers are right)",
            ),
            // At rest, and in a hand, g are near 1.
            (SensorKind::Accelerometer, 0.9..1.1) => (
                format!("{norm:.3}, expected about 9.8 m/s^2"),
                "g",
                "if so, use --accelerometer-unit g (or m-per-s2 if the numbers are right)",
            ),
            // The upper limit is above 1 g for a sensor that is shaken by a runner from the first second on.
            (SensorKind::Accelerometer, 0.5..3.0) => (
                format!("{norm:.3}, expected about 9.8 m/s^2"),
                "g, or like acceleration without gravity",
                "for g use --accelerometer-unit g, otherwise record the acceleration with gravity (or use m-per-s2 if the numbers are \
                 right)",
            ),
            (SensorKind::Accelerometer, _) | (_, 2.0..5000.0) => return Ok(()),
            (_, 5000.0..) => (
                format!("{norm:.0}, expected 20 to 70 microtesla"),
                "nanotesla",
                "if so, use --magnetometer-unit nanotesla (or microtesla if the numbers are right)",
            ),
            // The Earth's field is 0.25 to 0.65 gauss, and 0.025 to 0.065 millitesla.
            (_, 0.13..) => (
                format!("{norm:.3e}, expected 20 to 70 microtesla"),
                "gauss",
                "if so, use --magnetometer-unit gauss (or microtesla if the numbers are right)",
            ),
            (_, 0.01..) => (
                format!("{norm:.3e}, expected 20 to 70 microtesla"),
                "millitesla",
                "if so, use --magnetometer-unit millitesla (or microtesla if the numbers are right)",
            ),
            _ => (
                format!("{norm:.3e}, expected 20 to 70 microtesla"),
                "tesla",
                "if so, use --magnetometer-unit tesla (or microtesla if the numbers are right)",
            ),
        };
        let evidence =
            format!("the median norm of its first seconds is {expected}; this looks like {looks}");
        let sensor = self.sensor;
        Err(Doubt {
            sensor,
            evidence,
            hint,
        })
    }
}

/// Collects the norms of the first two seconds of a sensor.
#[derive(Debug, Clone, Default)]
struct Norms {
    start_ns: Option<i64>,
    norms: Vec<f64>,
}

impl Norms {
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

/// What an accelerometer says of gravity.
#[derive(Debug, Clone, Copy)]
enum Felt {
    /// Its length is not known yet.
    Nothing,
    /// The force is not gravity alone.
    Shaken,
    /// Its direction, body axes.
    Gravity(Vector3<f64>),
}

/// Tells gravity by its length: the median of the first two seconds, in any unit.
#[derive(Debug, Clone, Default)]
struct CalmForce {
    norms: Norms,
    median: Option<f64>,
}

impl CalmForce {
    /// Comparisons need all specific forces within this fraction of their median: swinging arms
    /// and running turn the specific force with the body and speak for degrees.
    const CALM: f64 = 0.1;

    fn felt(&mut self, time_ns: i64, force: &Vector3<f64>) -> Felt {
        let norm = force.norm();
        let Some(median) = self.median else {
            if self.norms.add(time_ns, norm) {
                self.median = self.norms.median();
                self.norms = Norms::default();
            }
            return Felt::Nothing;
        };
        if (norm - median).abs() > Self::CALM * median {
            Felt::Shaken
        } else {
            Felt::Gravity(force / norm)
        }
    }
}

/// The checks of the gyroscope by turns of gravity.
#[derive(Debug, Clone, Default)]
struct TurnChecks {
    gravity: CalmForce,
    rate: RateCheck,
    sign: TurnSign,
}

impl TurnChecks {
    fn turn(&mut self, time_ns: i64, rate: &Vector3<f64>) -> Verdict {
        self.sign.turn(time_ns, rate);
        self.rate.turn(time_ns, rate)
    }

    fn see(&mut self, time_ns: i64, force: &Vector3<f64>) -> Verdict {
        if self.rate.over && self.sign.is_over() {
            return Ok(());
        }
        let felt = self.gravity.felt(time_ns, force);
        self.sign.see(time_ns, felt)?;
        self.rate.see(time_ns, felt)
    }
}

/// Rates or degrees: the competition of the two hypotheses.
#[derive(Debug, Clone, Default)]
struct RateCheck {
    over: bool,
    last_rate_ns: Option<i64>,
    fast_since_ns: Option<i64>,
    fast_samples: u32,
    window: Option<Window>,
    /// The turns of the gyroscope's samples in it, rad if the numbers are rad/s: only of a window that counts are they put together.
    turns: Vec<Vector3<f64>>,
    calm_windows: u32,
    /// Those of them that count.
    windows: u32,
    /// Sums of squared direction errors of the two hypotheses, rad^2.
    error_rad: f64,
    error_deg: f64,
}

/// One comparison in progress: the direction of the specific force at its start, and how far the body has turned since.
#[derive(Debug, Clone, Copy)]
struct Window {
    start_ns: i64,
    start: Vector3<f64>,
    /// Length of the path in between, rad if the numbers are rad/s.
    turn: f64,
}

impl RateCheck {
    /// Length of a comparison: long enough for a visible turn, short enough that the linear
    /// acceleration and the gyroscope's bias do not matter.
    const WINDOW_NS: i64 = 250_000_000;
    const WINDOW_MOST_NS: i64 = 1_000_000_000;
    const PAUSE_NS: i64 = 100_000_000;
    /// Most samples of the gyroscope in a comparison: none has so many a second, and a file cannot make it remember more.
    const MOST_TURNS: usize = 1 << 15;
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
    fn turn(&mut self, time_ns: i64, rate: &Vector3<f64>) -> Verdict {
        self.sustained(time_ns, rate)?;
        if self.over {
            return Ok(());
        }
        let previous = self.last_rate_ns.replace(time_ns);
        let pause_ns = time_ns.saturating_sub(previous.unwrap_or(time_ns));
        if pause_ns > Self::PAUSE_NS {
            self.window = None;
        }
        if let Some(window) = &mut self.window {
            let turn = rate * (pause_ns as f64 * 1e-9);
            window.turn += turn.norm();
            self.turns.push(turn);
        }
        if self.turns.len() > Self::MOST_TURNS {
            self.window = None;
            self.turns.clear();
        }
        Ok(())
    }

    fn sustained(&mut self, time_ns: i64, rate: &Vector3<f64>) -> Verdict {
        if rate.norm_squared() <= Self::TOO_FAST * Self::TOO_FAST {
            self.fast_since_ns = None;
            return Ok(());
        }
        let since = *self.fast_since_ns.get_or_insert_with(|| {
            self.fast_samples = 0;
            time_ns
        });
        self.fast_samples = self.fast_samples.saturating_add(1);
        let long = time_ns.saturating_sub(since) >= Self::TOO_FAST_NS;
        if !long || self.fast_samples < Self::TOO_FAST_SAMPLES {
            return Ok(());
        }
        Self::degrees(format!(
            "the angular rate stays above 60 rad/s (now {:.0}); this looks like deg/s",
            rate.norm()
        ))
    }

    fn degrees(evidence: String) -> Verdict {
        Err(Doubt {
            sensor: SensorKind::Gyroscope,
            evidence,
            hint: "if so, use --gyroscope-unit deg-per-s (or rad-per-s if the numbers are right)",
        })
    }

    /// What the accelerometer says at a stamp.
    fn see(&mut self, time_ns: i64, felt: Felt) -> Verdict {
        let direction = match felt {
            _ if self.over => return Ok(()),
            Felt::Nothing => return Ok(()),
            Felt::Shaken => {
                self.window = None;
                return Ok(());
            }
            Felt::Gravity(direction) => direction,
        };
        match &self.window {
            Some(window) if time_ns.saturating_sub(window.start_ns) < Self::WINDOW_NS => {
                return Ok(());
            }
            Some(window) if time_ns.saturating_sub(window.start_ns) <= Self::WINDOW_MOST_NS => {
                let window = *window;
                self.calm_windows += 1;
                self.weigh(&window, &direction);
            }
            _ => {}
        }
        self.window = Some(Window {
            start_ns: time_ns,
            start: direction,
            turn: 0.0,
        });
        self.turns.clear();
        let verdict = self.judge(Self::WINDOWS);
        self.over = self.calm_windows >= Self::SETTLED;
        verdict
    }

    fn weigh(&mut self, window: &Window, seen: &Vector3<f64>) {
        if window.turn < Self::TURN {
            return;
        }
        // Where the direction should be now in body axes under either hypothesis.
        let turns = self.turns.iter();
        let if_rad = turns.fold(window.start, |direction, turn| turned(&direction, turn));
        if window.start.angle(&if_rad) < Self::VISIBLE_TURN {
            return;
        }
        let turns = self.turns.iter().map(|turn| turn * 1_f64.to_radians());
        let if_deg = turns.fold(window.start, |direction, turn| turned(&direction, &turn));
        self.windows += 1;
        self.error_rad += seen.angle(&if_rad).powi(2);
        self.error_deg += seen.angle(&if_deg).powi(2);
    }

    fn at_end(&self) -> Verdict {
        if self.over {
            return Ok(());
        }
        self.judge(Self::WINDOWS_AT_END)
    }

    fn judge(&self, windows_needed: u32) -> Verdict {
        let windows = f64::from(self.windows);
        let is_degrees = self.windows >= windows_needed
            && self.error_rad > Self::RATIO * self.error_deg
            && self.error_rad > Self::LEAST_ERROR * windows;
        if !is_degrees {
            return Ok(());
        }
        let [rad, deg] =
            [self.error_rad, self.error_deg].map(|e| (e / windows).sqrt().to_degrees());
        Self::degrees(format!(
            "the accelerometer contradicts it in {windows} turns (rms {rad:.0} deg off if the numbers are rad/s, \
             {deg:.0} deg if they are deg/s)"
        ))
    }
}

/// A direction fixed in the world, in body axes, after the body has turned by the rotation vector
/// `turn` (rad).
fn turned(direction: &Vector3<f64>, turn: &Vector3<f64>) -> Vector3<f64> {
    so3::exp(&-turn) * direction
}
