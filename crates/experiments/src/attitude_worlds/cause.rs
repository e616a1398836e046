//! Causes: what the verdicts of a run name, and when something wrong is felt. What was wrong is in `truth.rs`.

use northing_evaluation::RunSummary;
use northing_evaluation::statistics::consistency::NoiseVerdict;
use northing_evaluation::statistics::verdict::findings;
use northing_recording::SensorKind;
use northing_simulation::attitude_world::WorldFault;
use serde::{Serialize, Serializer};

use super::score::EstimatorScore;

/// What is wrong with data or parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Cause {
    /// A fault of the world, or none; noise of a sensor is also an `R` that is too small for it.
    Fault(WorldFault),
    /// The accelerometer's `R` is too large.
    AccelerometerRTooLarge,
    /// The magnetometer's `R` is too large.
    MagnetometerRTooLarge,
    /// The compass's stated uncertainty is too small or too large.
    CompassR,
    /// The device is accelerated by more than the accelerometer's `R` allows.
    Acceleration,
    /// Residuals are alike from one sample to the next.
    LastingErrors,
    /// A sensor shows one value.
    Stuck,
}

impl Cause {
    /// Nothing.
    pub const NONE: Self = Self::Fault(WorldFault::None);

    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fault(fault) => fault.name(),
            Self::AccelerometerRTooLarge => "accelerometer-r-large",
            Self::MagnetometerRTooLarge => "magnetometer-r-large",
            Self::CompassR => "compass-r",
            Self::Acceleration => "acceleration",
            Self::LastingErrors => "lasting-errors",
            Self::Stuck => "stuck",
        }
    }
}

impl Serialize for Cause {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// An error is felt where mending its cause makes tilt or heading this much better.
const FELT: f64 = 1.1;

/// Whether the errors of a run are larger than those of the same run with something mended.
pub(super) fn is_felt(run: &EstimatorScore, mended: &EstimatorScore) -> bool {
    let errors = |score: &EstimatorScore| [score.tilt_rms_deg, score.heading_rms_deg];
    let pairs = errors(run).into_iter().zip(errors(mended));
    // What ends an estimator is felt; what begins one is not.
    pairs.into_iter().any(|pair| match pair {
        (Some(run), Some(mended)) => run > FELT * mended,
        (None, Some(_)) => true,
        (_, None) => false,
    })
}

/// What a run names first.
///
/// The one place that reads findings and verdicts.
#[must_use]
pub fn named_cause(summary: &RunSummary) -> Cause {
    let Some(first) = summary.findings.first() else {
        return Cause::NONE;
    };
    match first.cause {
        // The lab's alone: of worlds the units are known.
        findings::Cause::Unit => Cause::NONE,
        findings::Cause::Stuck => Cause::Stuck,
        findings::Cause::Hole => Cause::Fault(WorldFault::Hole),
        findings::Cause::Saturation => Cause::Fault(WorldFault::Saturation),
        findings::Cause::Bursts => Cause::Fault(WorldFault::Bursts),
        findings::Cause::BiasChange => Cause::Fault(WorldFault::BiasJump),
        findings::Cause::Misalignment => Cause::Fault(WorldFault::Misalignment),
        findings::Cause::Scale => Cause::Fault(WorldFault::AccelerometerScale),
        findings::Cause::HardIron => Cause::Fault(WorldFault::HardIron),
        findings::Cause::MagneticDisturbance => Cause::Fault(WorldFault::MagneticDisturbance),
        findings::Cause::Acceleration => Cause::Acceleration,
        findings::Cause::Rounding => Cause::Fault(WorldFault::Rounding),
        findings::Cause::Jitter => Cause::Fault(WorldFault::Jitter),
        findings::Cause::LastingErrors => Cause::LastingErrors,
        findings::Cause::Noise => noise(summary, first.sensor),
    }
}

/// Which way the `R` of a sensor is off.
fn noise(summary: &RunSummary, sensor: SensorKind) -> Cause {
    let mut verdicts = summary.verdicts.iter();
    let verdict = verdicts.find(|v| v.sensor == sensor).map(|v| v.verdict);
    match (sensor, verdict) {
        (SensorKind::CompassHeading, _) => Cause::CompassR,
        (SensorKind::Gyroscope, _) => Cause::Fault(WorldFault::GyroscopeNoise),
        (SensorKind::Accelerometer, Some(NoiseVerdict::TooLarge)) => Cause::AccelerometerRTooLarge,
        (SensorKind::Accelerometer, _) => Cause::Fault(WorldFault::AccelerometerNoise),
        (_, Some(NoiseVerdict::TooLarge)) => Cause::MagnetometerRTooLarge,
        _ => Cause::Fault(WorldFault::MagnetometerNoise),
    }
}

/// Whether a run has verdicts at all: an observer without covariance is never green.
#[must_use]
pub fn has_verdicts(summary: &RunSummary) -> bool {
    summary.estimator.info().has_covariance || !summary.verdicts.is_empty()
}

/// Whether a sensor is blamed while its mean NIS is in its band.
#[must_use]
pub fn blamed_inside_the_band(summary: &RunSummary) -> bool {
    summary.verdicts.iter().any(|verdict| {
        let nis = match verdict.sensor {
            SensorKind::Accelerometer => summary.nis.accelerometer,
            SensorKind::CompassHeading => summary.nis.compass,
            _ => summary.nis.magnetometer,
        };
        let blamed = matches!(
            verdict.verdict,
            NoiseVerdict::TooSmall | NoiseVerdict::TooLarge | NoiseVerdict::Outliers
        );
        let [low, high] = verdict.mean_nis_band;
        blamed && nis.is_some_and(|nis| (low..=high).contains(&nis.mean))
    })
}
