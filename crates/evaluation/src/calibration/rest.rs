//! Calibration from a span of a recording, or from the rest at its beginning.

use northing_core::calibration::{RestCalibration, RestCalibrator, RestLimits};
use northing_core::nalgebra::Vector3;
use northing_recording::{Event, RecordingError, Sample};

use super::magnetometer::MagnetometerSource;
use crate::error::EvaluationError;
use crate::statistics::seconds_between;

/// Length of the pieces in which stillness is judged, s.
const PIECE_S: f64 = 0.5;
/// Shortest rest that is taken for one, s.
const SHORTEST_REST_S: f64 = 5.0;
/// A piece whose mean rate differs by more from the first one's is motion, rad/s.
const STILL_RATE: f64 = 0.02;
/// A piece whose mean specific force differs by more is motion, m/s^2.
const STILL_FORCE: f64 = 0.2;

/// The samples to calibrate from, in seconds since the first sample. Without an end it is the
/// recording's, without both ends the rest at its beginning.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Span {
    /// Start, s.
    pub from_s: Option<f64>,
    /// End, s.
    pub to_s: Option<f64>,
}

/// A calibration and the samples it is from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibrated {
    /// What was found.
    pub calibration: RestCalibration<f64>,
    /// Start and end, s since the recording's first sample.
    pub span_s: [f64; 2],
}

/// Calibrates from a span of a recording; `magnetometer` says which of its magnetometers
/// counts, if any.
///
/// # Errors
/// The recording cannot be read, or the device did not rest; with the reason.
pub fn calibrate(
    events: impl Iterator<Item = Result<Event, RecordingError>>,
    span: Span,
    magnetometer: Option<MagnetometerSource>,
) -> Result<Calibrated, EvaluationError> {
    match (span.from_s, span.to_s) {
        (None, None) => rest_at_the_beginning(events, magnetometer),
        (from_s, to_s) => exact_span(
            events,
            [from_s.unwrap_or(0.0), to_s.unwrap_or(f64::INFINITY)],
            magnetometer,
        ),
    }
}

fn exact_span(
    events: impl Iterator<Item = Result<Event, RecordingError>>,
    [from_s, to_s]: [f64; 2],
    magnetometer: Option<MagnetometerSource>,
) -> Result<Calibrated, EvaluationError> {
    let mut feed = Feed::new(magnetometer);
    let mut last_s = 0.0;
    for event in events {
        let event = event.map_err(|error| EvaluationError::Recording(Box::new(error)))?;
        last_s = feed.seconds(&event);
        if last_s > to_s {
            break;
        }
        if last_s >= from_s {
            feed.add(&event);
        }
    }
    if last_s < from_s {
        return Err(EvaluationError::RestCalibration(format!(
            "the recording is {last_s:.1} s long; --from {from_s} lies behind its end"
        )));
    }
    let calibration = finished(&feed.calibrator)?;
    Ok(Calibrated {
        calibration,
        span_s: [from_s, to_s.min(last_s)],
    })
}

/// Takes pieces of half a second for as long as they look like the first one. The last of them is
/// left out: the motion may have begun in it.
fn rest_at_the_beginning(
    events: impl Iterator<Item = Result<Event, RecordingError>>,
    magnetometer: Option<MagnetometerSource>,
) -> Result<Calibrated, EvaluationError> {
    let limits = RestLimits::default();
    let mut feed = Feed::new(magnetometer);
    let mut piece = Piece::default();
    let mut first: Option<Piece> = None;
    // The calibrator at the end of the last still piece, and of the one before it.
    let mut still = [(feed.calibrator, 0.0); 2];
    let mut moved_at_s = None;
    let mut last_s = 0.0;
    for event in events {
        let event = event.map_err(|error| EvaluationError::Recording(Box::new(error)))?;
        let now_s = feed.seconds(&event);
        if now_s >= still[1].1 + PIECE_S {
            let pattern = *first.get_or_insert(piece);
            if !piece.is_like(&pattern, &limits) {
                moved_at_s = Some(still[1].1);
                break;
            }
            still = [still[1], (feed.calibrator, now_s)];
            piece = Piece::default();
        }
        last_s = now_s;
        feed.add(&event);
        piece.add(&event.sample);
    }
    let Some(moved_at_s) = moved_at_s else {
        // It rests to the end.
        let calibration = finished(&feed.calibrator)?;
        return Ok(Calibrated {
            calibration,
            span_s: [0.0, last_s],
        });
    };
    let [(calibrator, end_s), _] = still;
    if end_s < SHORTEST_REST_S {
        return Err(EvaluationError::RestCalibration(format!(
            "the device moves {moved_at_s:.1} s after the recording begins; a calibration needs \
             {SHORTEST_REST_S:.0} s of rest: name a span with --from and --to, or record again"
        )));
    }
    let calibration = finished(&calibrator)?;
    Ok(Calibrated {
        calibration,
        span_s: [0.0, end_s],
    })
}

/// What a calibrator makes of its samples.
fn finished(calibrator: &RestCalibrator<f64>) -> Result<RestCalibration<f64>, EvaluationError> {
    calibrator
        .finish(&RestLimits::default())
        .map_err(|reason| EvaluationError::RestCalibration(reason.to_string()))
}

/// Gives samples to a calibrator with the times between them.
struct Feed {
    calibrator: RestCalibrator<f64>,
    magnetometer: Option<MagnetometerSource>,
    first_ns: Option<i64>,
    last_ns: [Option<i64>; 3],
}

impl Feed {
    fn new(magnetometer: Option<MagnetometerSource>) -> Self {
        Self {
            calibrator: RestCalibrator::new(),
            magnetometer,
            first_ns: None,
            last_ns: [None; 3],
        }
    }

    /// Seconds of an event since the first one.
    fn seconds(&mut self, event: &Event) -> f64 {
        let first_ns = *self.first_ns.get_or_insert(event.time_ns);
        seconds_between(first_ns, event.time_ns)
    }

    fn add(&mut self, event: &Event) {
        match event.sample {
            Sample::AngularRate(v) => {
                let dt = self.interval(0, event.time_ns);
                self.calibrator.add_gyroscope(&v, dt);
            }
            Sample::SpecificForce(v) => {
                let dt = self.interval(1, event.time_ns);
                self.calibrator.add_accelerometer(&v, dt);
            }
            Sample::MagneticField(v) if self.magnetometer == Some(MagnetometerSource::Device) => {
                self.add_magnetometer(&v, event.time_ns);
            }
            Sample::MagneticFieldUncalibrated(v)
                if self.magnetometer == Some(MagnetometerSource::Uncalibrated) =>
            {
                self.add_magnetometer(&v, event.time_ns);
            }
            _ => {}
        }
    }

    fn add_magnetometer(&mut self, v: &Vector3<f64>, time_ns: i64) {
        let dt = self.interval(2, time_ns);
        self.calibrator.add_magnetometer(v, dt);
    }

    fn interval(&mut self, sensor: usize, time_ns: i64) -> Option<f64> {
        let last_ns = self.last_ns[sensor].replace(time_ns)?;
        Some(seconds_between(last_ns, time_ns))
    }
}

/// Mean and spread of a short piece.
#[derive(Debug, Clone, Copy, Default)]
struct Piece {
    rate: Moments,
    force: Moments,
}

#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: f64,
    sum: Vector3<f64>,
    squares: Vector3<f64>,
}

impl Moments {
    fn add(&mut self, v: &Vector3<f64>) {
        if v.norm_squared().is_finite() {
            self.count += 1.0;
            self.sum += v;
            self.squares += v.component_mul(v);
        }
    }

    fn mean(&self) -> Vector3<f64> {
        self.sum / self.count.max(1.0)
    }

    /// Standard deviation of the worst axis.
    fn std(&self) -> f64 {
        let mean = self.mean();
        let variance = self.squares / self.count.max(1.0) - mean.component_mul(&mean);
        variance.max().max(0.0).sqrt()
    }

    fn is_like(&self, other: &Self, mean_limit: f64, std_limit: f64) -> bool {
        self.count < 1.0
            || other.count < 1.0
            || ((self.mean() - other.mean()).norm() <= mean_limit && self.std() <= std_limit)
    }
}

impl Piece {
    fn add(&mut self, sample: &Sample) {
        match sample {
            Sample::AngularRate(v) => self.rate.add(v),
            Sample::SpecificForce(v) => self.force.add(v),
            _ => {}
        }
    }

    fn is_like(&self, first: &Self, limits: &RestLimits<f64>) -> bool {
        self.rate
            .is_like(&first.rate, STILL_RATE, limits.gyroscope_std_rad_s)
            && self
                .force
                .is_like(&first.force, STILL_FORCE, limits.accelerometer_std_m_s2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_simulation::virtual_phone::Motion;
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    fn events(config: VirtualPhoneConfig) -> impl Iterator<Item = Result<Event, RecordingError>> {
        VirtualPhone::new(config).unwrap().events().map(Ok)
    }

    fn lab() -> VirtualPhoneConfig {
        VirtualPhoneConfig::default()
    }

    #[test]
    fn the_rest_at_the_beginning_is_found() {
        let found = calibrate(
            events(lab()),
            Span::default(),
            Some(MagnetometerSource::Device),
        )
        .unwrap();
        let [from_s, to_s] = found.span_s;
        assert!(from_s < 1e-9 && (8.4..=10.0).contains(&to_s), "{to_s}");
    }

    #[test]
    fn a_recording_at_rest_is_used_whole() {
        let config = VirtualPhoneConfig {
            motion: Motion::Rest,
            ..lab()
        };
        let found = calibrate(
            events(config),
            Span::default(),
            Some(MagnetometerSource::Device),
        )
        .unwrap();
        assert!((found.span_s[1] - 75.0).abs() < 0.1, "{:?}", found.span_s);
    }

    #[test]
    fn motion_from_the_start_is_refused() {
        let config = VirtualPhoneConfig {
            rest_before_s: 1.0,
            ..lab()
        };
        let error = calibrate(
            events(config),
            Span::default(),
            Some(MagnetometerSource::Device),
        )
        .unwrap_err();
        assert!(
            error
                .to_string()
                .contains("a calibration needs 5 s of rest"),
            "{error}"
        );
    }

    #[test]
    fn a_named_span_is_taken_as_it_is_and_refused_when_it_moves() {
        let at_rest = Span {
            from_s: Some(1.0),
            to_s: Some(9.0),
        };
        let found = calibrate(events(lab()), at_rest, Some(MagnetometerSource::Device)).unwrap();
        assert_eq!(found.calibration.gyroscope_samples, 801);
        let moving = Span {
            from_s: Some(20.0),
            to_s: Some(30.0),
        };
        let error = calibrate(events(lab()), moving, Some(MagnetometerSource::Device)).unwrap_err();
        assert!(error.to_string().contains("the device moved"), "{error}");
        let behind = Span {
            from_s: Some(200.0),
            to_s: None,
        };
        let error = calibrate(events(lab()), behind, Some(MagnetometerSource::Device)).unwrap_err();
        assert!(error.to_string().contains("behind its end"), "{error}");
    }
}
