//! The causes behind a filter's innovations, named before its stated noise is: what a user should mend first.
//!
//! A [`Diagnosis`] watches the samples and the innovations of one run of one estimator, in constant memory. Where the
//! innovations leave their bounds it notes what went before: a hole of the gyroscope, a sensor at the end of its
//! range, an accelerated body, a field that is not the Earth's. What such an excursion explains is kept out of the
//! verdict on R ([`consistency`](super::consistency)), which is made of all other samples. [`Diagnosis::findings`]
//! states the causes in the order in which one should act, each with its number and a confidence.
//!
//! | I look for | file |
//! |---|---|
//! | holes, jitter and bursts of stamps | [`timing`] |
//! | an axis at the end of its range | [`saturation`] |
//! | values on a coarse grid | [`resolution`] |
//! | white noise | [`noise`] |
//! | a bias that changed from rest to rest | [`rests`] |
//! | vectors that the gyroscope carries from moment to moment | [`pairs`] |
//! | two chips' axes, scale and bias of an accelerometer | [`axes`] |
//! | hard iron, a field that changes, the magnetometer's noise | [`iron`] |
//! | a bias that jumped, without rests | [`bias`] |
//! | excursions of the innovations, and what began them | [`excursions`] |
//! | the sentences | [`findings`] |

pub mod axes;
pub mod bias;
pub mod excursions;
pub mod findings;
pub mod iron;
pub mod noise;
pub mod pairs;
mod prediction;
pub mod resolution;
pub mod rests;
pub mod saturation;
pub mod timing;

#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use northing_core::kalman::Innovation;
use northing_recording::{GnssPosition, GnssVelocity, Sample, SensorKind};

use self::axes::Axes;
use self::excursions::{Condition, Excursions};
use self::iron::Iron;
use self::noise::WhiteNoise;
use self::resolution::Resolution;
use self::rests::Rests;
use self::saturation::Saturation;
use self::timing::{Hole, Timing};
use crate::statistics::ground_motion::GroundMotion;
use crate::statistics::nis::NisStatistics;

/// An axis of an accelerometer at rest shows up to all of gravity, one of a magnetometer up to all of the field: ranges end
/// beyond that by so much.
const BEYOND_GRAVITY: f64 = 1.2;
const BEYOND_FIELD: f64 = 1.5;

/// What watches the samples of one sensor.
#[derive(Debug, Clone, Default)]
struct Channel {
    timing: Timing,
    saturation: Saturation,
    resolution: Resolution,
    noise: WhiteNoise,
    last: Option<Vector3<f64>>,
    samples: u64,
    /// Samples that are the one before to the last digit.
    repeated: u64,
}

/// What watches the innovations of one sensor.
#[derive(Debug, Clone, Default)]
struct Updates {
    excursions: Excursions,
    /// Of the samples that no condition explains.
    unexplained: NisStatistics,
    /// Sum of the expected standard deviations, and how many.
    std: (f64, u64),
}

/// A hole of the gyroscope, and how far the device may have turned in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurningHole {
    /// When and how long.
    pub hole: Hole,
    /// Mean of the rates before and after, rad/s.
    pub rate_rad_s: f64,
}

impl TurningHole {
    /// The turn that was not measured, if the rates before and after went on, rad.
    #[must_use]
    pub fn angle_rad(&self) -> f64 {
        self.rate_rad_s * self.hole.seconds
    }
}

/// What a configuration states of white noise; none where an estimator has no such parameter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stated {
    /// Of the gyroscope, (rad/s)/sqrt(Hz).
    pub gyroscope_noise_density: Option<f64>,
    /// Of the accelerometer, (m/s^2)/sqrt(Hz).
    pub accelerometer_noise_density: Option<f64>,
    /// Of a sample of the accelerometer, m/s^2.
    pub accelerometer_std: Option<f64>,
    /// Of a sample of the magnetometer, microtesla.
    pub magnetometer_std_ut: Option<f64>,
    /// Over so long the filter takes the mean of the magnetometer's samples, and then states it of that, s.
    pub magnetometer_mean_s: Option<f64>,
    /// Of hard iron that the filter estimates, per axis, microtesla.
    pub hard_iron_std_ut: Option<f64>,
}

/// Watches one run. See the [module](self).
#[derive(Debug, Clone, Default)]
pub struct Diagnosis {
    first_ns: Option<i64>,
    gyroscope: Channel,
    accelerometer: Channel,
    magnetometer: Channel,
    by_accelerometer: Updates,
    by_magnetometer: Updates,
    by_compass: Updates,
    rests: Rests,
    /// Whether a receiver says that it moves.
    motion: GroundMotion,
    axes: Axes,
    iron: Iron,
    stated: Stated,
    /// The hole with the largest angle.
    worst_hole: Option<TurningHole>,
    /// Stamp of the gyroscope's last sample, and the mean of the rates on both sides of its last pause, rad/s.
    rate_ns: i64,
    around_pause_rad_s: f64,
    /// When a condition was last met, ns.
    met: excursions::Met,
    /// How far the device has turned in all, rad.
    turned_rad: f64,
    /// Mean length of the specific force, m/s^2.
    gravity: Length,
    /// Mean strength of the field, microtesla.
    strength: Length,
}

/// The length of a vector that should keep it.
#[derive(Debug, Clone, Copy, Default)]
struct Length {
    mean: f64,
    count: u64,
    /// Sum of the squared differences from the mean.
    spread: f64,
    newest: f64,
    products: f64,
    squares: f64,
}

impl Length {
    /// Fewer lengths have no mean.
    const FEWEST: u64 = 30;
    /// A length is off by so many of the standard deviations expected.
    const SIGMAS: f64 = 3.0;
    /// What makes a length wrong lasts from one sample to the next; noise does not.
    const LASTS: f64 = 0.5;
    /// Weight of the newest sample in what tells the two apart.
    const NEWEST: f64 = 0.05;

    fn add(&mut self, length: f64) {
        let before = self.newest - self.mean;
        self.newest = length;
        self.count += 1;
        let off = length - self.mean;
        self.mean += off / self.count as f64;
        self.spread += off * (length - self.mean);
        if self.count > Self::FEWEST {
            let now = length - self.mean;
            let square = 0.5 * (now * now + before * before);
            self.products += (now * before - self.products) * Self::NEWEST;
            self.squares += (square - self.squares) * Self::NEWEST;
        }
    }

    /// Its standard deviation over the run.
    fn std(&self) -> f64 {
        (self.spread / self.count.max(1) as f64).sqrt()
    }

    /// Whether it is off just now, by more than noise makes it.
    fn is_off(&self, std: f64) -> bool {
        self.count > Self::FEWEST
            && (self.newest - self.mean).abs() > Self::SIGMAS * std
            && self.products > Self::LASTS * self.squares
    }
}

/// Whether a residual is the sensor's vector, in its unit: that of a heading is an angle, that of a bounded velocity a velocity.
fn is_of_the_vector(innovation: &Innovation<f64>) -> bool {
    innovation.degrees_of_freedom == 3
}

impl Diagnosis {
    /// What the configuration of the run states.
    pub const fn configured(&mut self, stated: Stated) {
        self.stated = stated;
    }

    /// Takes so many samples of the gyroscope that had the very stamp of the one before and were not used.
    pub const fn same_stamp(&mut self, samples: u64) {
        self.gyroscope.timing.add_same(samples);
    }

    /// Takes a sample as the sensor delivered it, with the time when it was taken and how much later (ns) its stamp is; other kinds
    /// than those of gyroscope, accelerometer and magnetometer are left out.
    pub fn sample(&mut self, time_ns: i64, late_ns: i64, sample: &Sample) {
        if !sample.is_finite() {
            return;
        }
        self.first_ns.get_or_insert(time_ns);
        match sample {
            Sample::AngularRate(rate) => self.rate((time_ns, late_ns), rate, sample),
            Sample::SpecificForce(force) => {
                self.rests.force(force);
                self.gravity.add(force.norm());
                let saturated = self
                    .accelerometer
                    .add(time_ns, force, sample, BEYOND_GRAVITY * self.gravity.mean)
                    .0;
                self.axes.force(time_ns, force, saturated);
                self.met
                    .note(Condition::AccelerometerSaturated, saturated, time_ns);
            }
            Sample::MagneticField(field) | Sample::MagneticFieldUncalibrated(field) => {
                self.strength.add(field.norm());
                let saturated = self
                    .magnetometer
                    .add(time_ns, field, sample, BEYOND_FIELD * self.strength.mean)
                    .0;
                self.iron.field(time_ns, field);
                self.met
                    .note(Condition::MagnetometerSaturated, saturated, time_ns);
            }
            _ => {}
        }
    }

    /// Takes what a satellite receiver says of an instant.
    pub fn over_ground(
        &mut self,
        time_ns: i64,
        fix: Option<&GnssPosition>,
        velocity: Option<&GnssVelocity>,
    ) {
        if let Some(fix) = fix {
            self.motion.position(time_ns, fix);
        }
        if let Some(velocity) = velocity {
            self.motion.velocity(time_ns, velocity);
        }
    }

    fn rate(&mut self, (time_ns, late_ns): (i64, i64), rate: &Vector3<f64>, sample: &Sample) {
        if self.motion.is_moving(time_ns) {
            self.rests.interrupt();
        }
        self.rests.rate(time_ns, rate);
        if let Some(last) = self.gyroscope.last {
            let interval_s = time_ns.saturating_sub(self.rate_ns) as f64 * 1e-9;
            // A hole is known only later, when samples come regularly again.
            if interval_s > 2.0 * self.gyroscope.timing.summary().interval_s {
                self.around_pause_rad_s = 0.5 * (last.norm() + rate.norm());
            }
        }
        self.rate_ns = time_ns;
        if rate.norm() > rests::SLOWEST_RAD_S {
            // Less may be the bias of a device that rests.
            self.turned_rad += rate.norm() * self.gyroscope.timing.summary().interval_s;
        }
        let arrived_ns = time_ns.saturating_add(late_ns);
        let (saturated, hole) = self.gyroscope.add(arrived_ns, rate, sample, 0.0);
        self.gyroscope.timing.add_restored(late_ns != 0);
        self.axes.rate(time_ns, rate, saturated);
        self.iron.rate(time_ns, rate, saturated);
        self.met
            .note(Condition::GyroscopeSaturated, saturated, time_ns);
        let Some(hole) = hole else {
            return;
        };
        self.met.note(Condition::Hole, true, time_ns);
        let found = TurningHole {
            hole,
            rate_rad_s: self.around_pause_rad_s,
        };
        let worst = self.worst_hole.map_or(0.0, |worst| worst.angle_rad());
        if self.worst_hole.is_none() || found.angle_rad() > worst {
            self.worst_hole = Some(found);
        }
    }

    /// Takes an innovation of a sensor.
    pub fn innovation(&mut self, time_ns: i64, sensor: SensorKind, innovation: &Innovation<f64>) {
        let conditions = self.conditions(sensor, innovation);
        let (met, updates) = match sensor {
            SensorKind::Accelerometer => (&self.met, &mut self.by_accelerometer),
            SensorKind::CompassHeading => (&self.met, &mut self.by_compass),
            _ => (&self.met, &mut self.by_magnetometer),
        };
        if innovation.degrees_of_freedom == 0 {
            return;
        }
        if is_of_the_vector(innovation) {
            updates.std.0 += innovation.residual_std().mean();
            updates.std.1 += 1;
        }
        let explained = updates.excursions.add(time_ns, innovation, met, conditions);
        if !explained {
            updates.unexplained.add(innovation);
        }
    }

    /// What the newest sample itself says of the moment.
    fn conditions(&self, sensor: SensorKind, innovation: &Innovation<f64>) -> Option<Condition> {
        if !is_of_the_vector(innovation) {
            return None;
        }
        let std = innovation.residual_std().amax();
        match sensor {
            SensorKind::Accelerometer if self.gravity.is_off(std) => Some(Condition::Accelerated),
            SensorKind::Magnetometer if self.strength.is_off(std) => Some(Condition::Disturbed),
            _ => None,
        }
    }

    /// NIS of a sensor's samples that no condition explains.
    #[must_use]
    pub fn unexplained(&self, sensor: SensorKind) -> &NisStatistics {
        match sensor {
            SensorKind::Accelerometer => &self.by_accelerometer.unexplained,
            SensorKind::CompassHeading => &self.by_compass.unexplained,
            _ => &self.by_magnetometer.unexplained,
        }
    }

    /// The step of the grid on which a sensor's values lie, where it is larger than what the filter expects of a
    /// residual: NIS then has no chi-square distribution, and its median says nothing. With what is expected, the standard
    /// deviation of a component.
    #[must_use]
    pub fn coarse_step(&self, sensor: SensorKind) -> Option<(f64, f64)> {
        let (channel, updates) = self.of(sensor).filter(|(_, updates)| updates.std.1 > 0)?;
        let std = updates.std.0 / updates.std.1 as f64;
        let step = channel.resolution.step(sensor)?;
        (step > std).then_some((step, std))
    }

    /// Whether a sensor's values hide its noise: they lie on a coarse grid, or mostly repeat to the last digit.
    #[must_use]
    pub fn is_coarse(&self, sensor: SensorKind) -> bool {
        let repeats = |(channel, _): (&Channel, _)| 2 * channel.repeated > channel.samples;
        self.coarse_step(sensor).is_some() || self.of(sensor).is_some_and(repeats)
    }

    fn of(&self, sensor: SensorKind) -> Option<(&Channel, &Updates)> {
        match sensor {
            SensorKind::Accelerometer => Some((&self.accelerometer, &self.by_accelerometer)),
            SensorKind::Magnetometer => Some((&self.magnetometer, &self.by_magnetometer)),
            _ => None,
        }
    }

    fn time_s(&self, time_ns: i64) -> f64 {
        crate::statistics::seconds_between(self.first_ns.unwrap_or(time_ns), time_ns)
    }
}

impl Channel {
    /// Takes a sample; whether it is saturated, at `least` or beyond, and the hole before it.
    fn add(
        &mut self,
        time_ns: i64,
        v: &Vector3<f64>,
        sample: &Sample,
        least: f64,
    ) -> (bool, Option<Hole>) {
        self.resolution.add(sample);
        let hole = self.timing.add(time_ns);
        self.noise.add(v, hole.is_some());
        self.samples += 1;
        self.repeated += u64::from(self.last == Some(*v));
        self.last = Some(*v);
        (self.saturation.add(v, least), hole)
    }
}
