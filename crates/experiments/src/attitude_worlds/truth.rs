//! True causes: what was wrong with the data of a world or with an estimator's parameters, and whether that is felt.
//!
//! A cause is what makes an estimate worse, and what is mended makes it better. So a fault that was drawn is a true cause where the
//! same world **without it** (same motion, sensors and noise) gives errors that are smaller by a tenth. An `R` is wrong where it is
//! more than [twice](FITS) off the true deviations of the samples, and a true cause where the right one gives errors smaller by a tenth.
//! Where nothing is felt, nothing is right to name, and so is what is there all the same: the fault, or the `R`. A board that was drawn without a fault may still have an
//! offset that nobody would sell ([`OFFSETS`]): naming it is right, too.

use nalgebra::Vector3;
use northing_evaluation::EstimatorKind;
use northing_evaluation::attitude::RunOptions;
use northing_recording::Sample;
use northing_simulation::attitude_world::{
    AttitudeWorld, AttitudeWorldDescription, HeadingSource, WorldFault,
};

use super::Sensing;
use super::cause::Cause;

/// `R` fits while the true deviation of the samples is within this factor of it, either way.
const FITS: f64 = 2.0;
/// One vector of noise in a hundred is longer than so many standard deviations of a component.
const BOUND: f64 = 3.368;
const CHANCE: f64 = 0.01;
/// Offsets of a magnetometer (microtesla) and of an accelerometer (m/s^2) beyond what a calibrated device has.
const OFFSETS: [f64; 2] = [5.0, 0.3];

/// What is true of a world.
pub(super) struct Truth<'a> {
    world: &'a AttitudeWorld,
    /// The same without its fault, if it has one.
    mended: Option<&'a AttitudeWorld>,
    deviations: Deviations,
}

impl<'a> Truth<'a> {
    pub(super) fn of(world: &'a AttitudeWorld, mended: Option<&'a AttitudeWorld>) -> Self {
        Self {
            world,
            mended,
            deviations: Deviations::of(world),
        }
    }

    /// What a verdict may rightly name for an estimator, the main cause first; `costs` says whether a run is better in a world with
    /// options.
    pub(super) fn causes(
        &self,
        options: &RunOptions,
        sensing: Sensing,
        costs: impl Fn(&AttitudeWorld, &RunOptions) -> bool,
    ) -> Vec<Cause> {
        let world = &self.world.description;
        let magnetic = matches!(
            world.fault,
            WorldFault::MagnetometerNoise | WorldFault::MagneticDisturbance | WorldFault::HardIron
        );
        let is_seen = !(magnetic && sensing == Sensing::Inertial);
        let mended = self.mended.filter(|_| is_seen);
        let fault = mended.map(|_| Cause::Fault(world.fault));
        let fault_is_felt = mended.is_some_and(|mended| costs(mended, options));
        let mut wrong = self.wrong_r(options, sensing);
        // The deviations of a fault's samples are the fault's.
        wrong.retain(|(cause, _)| fault.is_none() || is_too_large(*cause));
        let felt: Vec<_> = (wrong.iter())
            .filter(|(_, right)| costs(self.world, right))
            .map(|(cause, _)| *cause)
            .collect();
        if fault_is_felt {
            return fault.into_iter().chain(felt).collect();
        }
        if self.is_accelerated(options) {
            wrong.push((Cause::Acceleration, options.clone()));
        }
        let none = felt.is_empty().then_some(Cause::NONE);
        let wrong = wrong.into_iter().map(|(cause, _)| cause);
        let causes = fault.into_iter().chain(wrong).chain(none);
        causes.chain(offsets(world, sensing)).collect()
    }

    /// Whether accelerations are beyond what an estimator's `R` allows, more often than chance lets them: no mending shows
    /// what they cost.
    fn is_accelerated(&self, options: &RunOptions) -> bool {
        let Some(std) = stated(options, Which::Accelerometer) else {
            return false;
        };
        let beyond = |norm: &&f64| **norm > BOUND * std;
        let count = self.deviations.forces.iter().filter(beyond).count();
        count as f64 > 2.0 * CHANCE * self.deviations.forces.len() as f64
    }

    /// What is wrong with an estimator's `R`, with the options that mend it.
    fn wrong_r(&self, options: &RunOptions, sensing: Sensing) -> Vec<(Cause, RunOptions)> {
        let mut wrong = Vec::new();
        let mut compare = |which: Which, small: &[Cause], large: Option<Cause>| {
            let (Some(true_std), Some(mut std)) =
                (self.deviations.of_kind(which), stated(options, which))
            else {
                return;
            };
            if which == Which::Compass {
                std = std.max(self.deviations.compass_states);
            }
            let with = || which.mended(options, true_std);
            if true_std > FITS * std {
                wrong.extend(small.iter().map(|cause| (*cause, with())));
            } else if true_std * FITS < std {
                wrong.extend(large.map(|cause| (cause, with())));
            }
        };
        compare(
            Which::Accelerometer,
            // Without a fault of its noise it is the motion.
            &[
                Cause::Acceleration,
                Cause::Fault(WorldFault::AccelerometerNoise),
            ],
            Some(Cause::AccelerometerRTooLarge),
        );
        if sensing == Sensing::All {
            compare(
                Which::Magnetometer,
                &[Cause::Fault(WorldFault::MagnetometerNoise)],
                Some(Cause::MagnetometerRTooLarge),
            );
            // Errors of a compass last: no innovation shows that they are smaller.
            compare(Which::Compass, &[Cause::CompassR], None);
        }
        wrong
    }
}

const fn is_too_large(cause: Cause) -> bool {
    matches!(
        cause,
        Cause::AccelerometerRTooLarge | Cause::MagnetometerRTooLarge
    )
}

/// Offsets that are right to name.
fn offsets(world: &AttitudeWorldDescription, sensing: Sensing) -> Vec<Cause> {
    let size = |offset: [f64; 3]| Vector3::from(offset).norm();
    let [most_iron, most_bias] = OFFSETS;
    let mut found = Vec::new();
    if let (HeadingSource::Magnetometer(triad), Sensing::All) = (&world.board.heading, sensing)
        && size(triad.bias) > most_iron
    {
        found.push(Cause::Fault(WorldFault::HardIron));
    }
    if size(world.board.accelerometer.bias) > most_bias {
        found.push(Cause::Fault(WorldFault::AccelerometerScale));
    }
    found
}

/// A sensor that has an `R`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Which {
    Accelerometer,
    Magnetometer,
    Compass,
}

impl Which {
    /// The options with another standard deviation of its samples.
    fn mended(self, options: &RunOptions, std: f64) -> RunOptions {
        let mut right = options.clone();
        let config = &mut right.config;
        match self {
            Self::Accelerometer => config.attitude.accelerometer_std = std,
            Self::Magnetometer => {
                config.attitude.magnetometer_std_ut = std;
                config.bounded_velocity.magnetometer_std_ut = std;
            }
            Self::Compass => {
                config.attitude.compass_std = std;
                config.bounded_velocity.compass_std = std;
            }
        }
        right
    }
}

/// Standard deviation that an estimator states for samples of a sensor, where it has an `R` for them.
fn stated(options: &RunOptions, which: Which) -> Option<f64> {
    let own = &options.config.attitude;
    let bounded = options.estimator == EstimatorKind::BoundedVelocity;
    // The cascade follows a filter that has both.
    let has_r = bounded
        || options.estimator == EstimatorKind::CascadeEkf
        || options.estimator.info().has_covariance;
    match which {
        _ if !has_r => None,
        // A bounded velocity is no noise of the accelerometer.
        Which::Accelerometer if bounded => None,
        Which::Accelerometer => Some(own.accelerometer_std),
        Which::Magnetometer if bounded => Some(options.config.bounded_velocity.magnetometer_std_ut),
        Which::Magnetometer => Some(own.magnetometer_std_ut),
        // At least so much; what the device states counts where it is larger.
        Which::Compass if bounded => Some(options.config.bounded_velocity.compass_std),
        Which::Compass => Some(own.compass_std),
    }
}

/// Root mean square of the true deviations of a sensor's samples, per axis: measured less what gravity, field or heading alone
/// would show at the true attitude.
#[derive(Debug, Clone, PartialEq)]
struct Deviations {
    /// m/s^2, microtesla, and rad.
    std: [Option<f64>; 3],
    /// Mean of what the compass states, rad.
    compass_states: f64,
    /// Lengths of the accelerometer's, m/s^2.
    forces: Vec<f64>,
}

impl Deviations {
    fn of_kind(&self, which: Which) -> Option<f64> {
        self.std[which as usize]
    }

    /// Of the samples of a world.
    fn of(world: &AttitudeWorld) -> Self {
        let third = |off: Vector3<f64>| off.norm_squared() / 3.0;
        let gravity = Vector3::z() * world.description.gravity_m_s2;
        let field = Vector3::from(world.description.field_ut);
        let mut sums = [(0.0, 0.0); 3];
        let (mut states, mut forces) = (0.0, Vec::new());
        let mut truth = None;
        for event in &world.events {
            let (k, square) = match (event.sample, truth) {
                (Sample::Reference(reference), _) => {
                    truth = Some(reference.attitude.inverse());
                    continue;
                }
                (Sample::SpecificForce(force), Some(body)) => {
                    let off = force - body * gravity;
                    forces.push(off.norm());
                    (0, third(off))
                }
                (Sample::MagneticField(measured), Some(body)) => {
                    (1, third(measured - body * field))
                }
                (Sample::CompassHeading(compass), Some(body)) => {
                    let top = body.inverse() * Vector3::y();
                    let off = compass.heading_rad - top.x.atan2(top.y);
                    states += compass.std_rad;
                    (2, off.sin().atan2(off.cos()).powi(2))
                }
                _ => continue,
            };
            sums[k].0 += square;
            sums[k].1 += 1.0;
        }
        let rms = |(sum, count): (f64, f64)| (count > 0.0).then(|| (sum / count).sqrt());
        Self {
            std: sums.map(rms),
            compass_states: states / f64::max(sums[2].1, 1.0),
            forces,
        }
    }
}
