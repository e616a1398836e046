//! Causes: what was wrong with the data of a world, and what the verdicts of a run name.

use northing_evaluation::attitude::RunOptions;
use northing_evaluation::statistics::consistency::NoiseVerdict;
use northing_evaluation::statistics::verdict::findings;
use northing_evaluation::{EstimatorKind, RunSummary};
use northing_recording::{Event, Sample, SensorKind};
use northing_simulation::attitude_world::{AttitudeWorldDescription, WorldFault};
use serde::{Serialize, Serializer};

use super::Sensing;
use nalgebra::Vector3;

/// `R` fits while the true deviation of the samples is within this factor of it, either way.
const FITS: f64 = 2.0;

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

/// Root mean square of the true deviations of a sensor's samples, per axis: measured less what gravity or field alone would
/// show at the true attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Deviations {
    /// m/s^2.
    accelerometer: Option<f64>,
    /// microtesla.
    magnetometer: Option<f64>,
}

impl Deviations {
    /// Of the samples of a world.
    pub(super) fn of(world: &AttitudeWorldDescription, events: &[Event]) -> Self {
        let gravity = Vector3::z() * world.gravity_m_s2;
        let field = Vector3::from(world.field_ut);
        let mut sums = [(0.0, 0.0); 2];
        let mut truth = None;
        for event in events {
            let (k, off) = match (event.sample, truth) {
                (Sample::Reference(reference), _) => {
                    truth = Some(reference.attitude.inverse());
                    continue;
                }
                (Sample::SpecificForce(force), Some(body)) => (0, force - body * gravity),
                (Sample::MagneticField(measured), Some(body)) => (1, measured - body * field),
                _ => continue,
            };
            sums[k].0 += off.norm_squared() / 3.0;
            sums[k].1 += 1.0;
        }
        let [accelerometer, magnetometer] =
            sums.map(|(sum, count): (f64, f64)| (count > 0.0).then(|| (sum / count).sqrt()));
        Self {
            accelerometer,
            magnetometer,
        }
    }
}

/// What a verdict may rightly name for this estimator, the main one first.
#[must_use]
pub(super) fn true_causes(
    world: &AttitudeWorldDescription,
    deviations: &Deviations,
    options: &RunOptions,
    sensing: Sensing,
) -> Vec<Cause> {
    let magnetic = matches!(
        world.fault,
        WorldFault::MagnetometerNoise | WorldFault::MagneticDisturbance | WorldFault::HardIron
    );
    if world.fault != WorldFault::None && !(magnetic && sensing == Sensing::Inertial) {
        return vec![Cause::Fault(world.fault)];
    }
    let mut causes = Vec::new();
    let mut compare = |deviation: Option<f64>, std: Option<f64>, small: &[Cause], large| {
        if let (Some(deviation), Some(std)) = (deviation, std) {
            if deviation > FITS * std {
                causes.extend(small);
            } else if deviation * FITS < std {
                causes.push(large);
            }
        }
    };
    let [accelerometer, magnetometer] = stated_std(options);
    compare(
        deviations.accelerometer,
        accelerometer,
        // Without a fault of its noise it is the motion.
        &[
            Cause::Acceleration,
            Cause::Fault(WorldFault::AccelerometerNoise),
        ],
        Cause::AccelerometerRTooLarge,
    );
    if sensing == Sensing::All {
        compare(
            deviations.magnetometer,
            magnetometer,
            &[Cause::Fault(WorldFault::MagnetometerNoise)],
            Cause::MagnetometerRTooLarge,
        );
    }
    if causes.is_empty() {
        causes.push(Cause::NONE);
    }
    causes
}

/// Standard deviations that an estimator states for accelerometer and magnetometer samples, where it has an `R` for them.
fn stated_std(options: &RunOptions) -> [Option<f64>; 2] {
    let own = &options.config.attitude;
    match options.estimator {
        // A bounded velocity is no noise of the accelerometer.
        EstimatorKind::BoundedVelocity => [
            None,
            Some(options.config.bounded_velocity.magnetometer_std_ut),
        ],
        // It follows a filter that has both.
        EstimatorKind::CascadeEkf => [Some(own.accelerometer_std), Some(own.magnetometer_std_ut)],
        kind if kind.info().has_covariance => {
            [Some(own.accelerometer_std), Some(own.magnetometer_std_ut)]
        }
        _ => [None, None],
    }
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
        findings::Cause::Stuck => Cause::Stuck,
        findings::Cause::Hole => Cause::Fault(WorldFault::Hole),
        findings::Cause::Saturation => Cause::Fault(WorldFault::Saturation),
        findings::Cause::Bursts => Cause::Fault(WorldFault::Bursts),
        findings::Cause::BiasChange => Cause::Fault(WorldFault::BiasJump),
        findings::Cause::Misalignment => Cause::Fault(WorldFault::Misalignment),
        findings::Cause::Scale => Cause::Fault(WorldFault::AccelerometerScale),
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
