//! The stream of events of a virtual phone: one clock per sensor, merged in time.

use nalgebra::Vector3;
use northing_recording::{Event, Reference, Sample, SensorKind};

use super::compass::Compass;
use super::device_orientation::DeviceOrientation;
use super::{MAGNETIC_BURST_UT, VirtualPhone};
use crate::sensors::{ErrorModel, SampleClock, Sampling, SensorErrors, Tick};
use crate::trajectory::{BurstSchedule, Trajectory, Truth, mean_rate};

/// Rate of the truth track when the gyroscope is switched off, Hz.
const REFERENCE_RATE_WITHOUT_GYROSCOPE_HZ: f64 = 100.0;

/// The events of a [`VirtualPhone`], in time order; made by [`VirtualPhone::events`].
#[derive(Debug)]
pub struct VirtualPhoneEvents {
    world: World,
    channels: Vec<Channel>,
    gyroscope: Gyroscope,
    accelerometer: SensorErrors,
    magnetometer: SensorErrors,
    device_orientation: DeviceOrientation,
    compass: Compass,
    start_time_ns: i64,
    scored_from_s: f64,
    end_ns: i64,
}

/// A clock and the tick it is at.
#[derive(Debug)]
struct Channel {
    kind: SensorKind,
    clock: SampleClock,
    tick: Tick,
    /// Stamp of the tick since the start of the recording.
    stamp_ns: i64,
}

impl Channel {
    fn new(kind: SensorKind, mut clock: SampleClock) -> Self {
        let tick = clock.tick();
        Self {
            kind,
            clock,
            stamp_ns: to_ns(tick.stamp_s),
            tick,
        }
    }

    /// Hands out the current tick and goes to the next.
    fn advance(&mut self) -> (SensorKind, Tick, i64) {
        let now = (self.kind, self.tick, self.stamp_ns);
        self.tick = self.clock.tick();
        self.stamp_ns = to_ns(self.tick.stamp_s);
        now
    }
}

fn to_ns(t_s: f64) -> i64 {
    (t_s * 1e9).round() as i64
}

/// The truth, remembered for the sensors that sample at the same instant.
#[derive(Debug)]
struct World {
    trajectory: Box<dyn Trajectory>,
    last: (f64, Truth),
    field_ut: Vector3<f64>,
    magnetic_bursts: Option<BurstSchedule>,
    script_s: f64,
    rest_before_s: f64,
}

impl World {
    fn new(phone: &VirtualPhone) -> Self {
        let config = phone.config();
        let trajectory = phone.trajectory();
        Self {
            last: (0.0, trajectory.at(0.0)),
            trajectory,
            field_ut: phone.magnetic_field_world_ut(),
            magnetic_bursts: config.disturbance.is_magnetic().then_some(BurstSchedule {
                period_s: 20.0,
                start_s: 14.0,
                length_s: 6.0,
                until_s: config.motion_s,
            }),
            script_s: config.script_s(),
            rest_before_s: config.rest_before_s,
        }
    }

    fn at(&mut self, t_s: f64) -> &Truth {
        if self.last.0.to_bits() != t_s.to_bits() {
            self.last = (t_s, self.trajectory.at(t_s));
        }
        &self.last.1
    }

    fn magnetic_field_ut(&self, t_s: f64) -> Vector3<f64> {
        let motion_s = t_s % self.script_s - self.rest_before_s;
        let burst = self.magnetic_bursts.and_then(|b| b.since_start(motion_s));
        match burst {
            Some(_) => self.field_ut + Vector3::new(MAGNETIC_BURST_UT, 0.0, 0.0),
            None => self.field_ut,
        }
    }
}

/// The gyroscope remembers where it last sampled, to report the mean rate since.
#[derive(Debug)]
struct Gyroscope {
    errors: SensorErrors,
    averages: bool,
    last: (f64, nalgebra::UnitQuaternion<f64>),
}

impl Gyroscope {
    fn measure(&mut self, truth: &Truth, t_s: f64) -> Vector3<f64> {
        let rate = if self.averages {
            mean_rate(&self.last.1, &truth.world_from_body, t_s - self.last.0)
        } else {
            truth.angular_rate_body
        };
        self.last = (t_s, truth.world_from_body);
        self.errors.measure(&rate)
    }
}

impl VirtualPhoneEvents {
    pub(super) fn new(phone: &VirtualPhone) -> Self {
        let config = phone.config();
        let seed = config.seed;
        let mut world = World::new(phone);
        let errors = |name: &str, model: &ErrorModel, sampling: &Sampling| {
            SensorErrors::new(seed, name, model, sampling.rate_hz)
        };
        let (gyroscope, accelerometer, magnetometer) = (
            &config.gyroscope,
            &config.accelerometer,
            &config.magnetometer,
        );
        let channels = channels(phone);
        // The first gyroscope sample is the mean over one interval, too.
        let before_first_s = channels
            .iter()
            .find(|channel| channel.kind == SensorKind::Gyroscope)
            .map_or(0.0, |channel| {
                channel.tick.measured_s - gyroscope.sampling.interval_s()
            });
        Self {
            gyroscope: Gyroscope {
                errors: phone.gyroscope_errors(),
                averages: gyroscope.averages,
                last: (before_first_s, world.at(before_first_s).world_from_body),
            },
            accelerometer: errors(
                "accelerometer",
                &accelerometer.error_model(),
                &accelerometer.sampling,
            ),
            magnetometer: errors(
                "magnetometer",
                &magnetometer.error_model(),
                &magnetometer.sampling,
            ),
            device_orientation: DeviceOrientation::new(seed, &config.device_orientation),
            compass: Compass::new(seed, &config.compass),
            world,
            channels,
            start_time_ns: config.start_time_ns,
            scored_from_s: config.rest_before_s,
            end_ns: to_ns(config.duration_s()),
        }
    }

    /// The true gyroscope bias that the next gyroscope sample will carry, rad/s.
    #[must_use]
    pub fn gyroscope_bias(&self) -> Vector3<f64> {
        self.gyroscope.errors.bias()
    }

    /// The sample of a tick; `kind` is that of a channel.
    fn sample(&mut self, kind: SensorKind, tick: &Tick) -> Sample {
        let is_reference = kind == SensorKind::Reference;
        let t_s = if is_reference {
            tick.stamp_s
        } else {
            tick.measured_s
        };
        let field = self.world.magnetic_field_ut(t_s);
        let truth = *self.world.at(t_s);
        let attitude = truth.world_from_body;
        match kind {
            SensorKind::Gyroscope => Sample::AngularRate(self.gyroscope.measure(&truth, t_s)),
            SensorKind::Accelerometer => {
                Sample::SpecificForce(self.accelerometer.measure(&truth.specific_force_body()))
            }
            SensorKind::Magnetometer => {
                let seen = attitude.inverse_transform_vector(&field);
                Sample::MagneticField(self.magnetometer.measure(&seen))
            }
            SensorKind::DeviceOrientation => {
                Sample::DeviceOrientation(self.device_orientation.report(&attitude))
            }
            SensorKind::CompassHeading => Sample::CompassHeading(self.compass.report(&attitude)),
            _ => Sample::Reference(Reference {
                attitude,
                scored: t_s >= self.scored_from_s,
            }),
        }
    }
}

/// The clocks of the sensors that are on, in the order of delivery. The truth ticks with the
/// gyroscope, and is never lost.
fn channels(phone: &VirtualPhone) -> Vec<Channel> {
    let config = phone.config();
    let gyroscope = config.gyroscope.sampling;
    let reference = if !config.reference.recorded {
        Sampling::at_rate(0.0)
    } else if gyroscope.rate_hz > 0.0 {
        Sampling {
            dropout_probability: 0.0,
            ..gyroscope
        }
    } else {
        Sampling::at_rate(REFERENCE_RATE_WITHOUT_GYROSCOPE_HZ)
    };
    [
        (SensorKind::Gyroscope, "gyroscope", gyroscope),
        (
            SensorKind::Accelerometer,
            "accelerometer",
            config.accelerometer.sampling,
        ),
        (
            SensorKind::Magnetometer,
            "magnetometer",
            config.magnetometer.sampling,
        ),
        (
            SensorKind::DeviceOrientation,
            "device-orientation",
            config.device_orientation.sampling,
        ),
        (
            SensorKind::CompassHeading,
            "compass",
            config.compass.sampling,
        ),
        (SensorKind::Reference, "gyroscope", reference),
    ]
    .into_iter()
    .filter(|(_, _, sampling)| sampling.rate_hz > 0.0)
    .map(|(kind, name, sampling)| {
        Channel::new(kind, SampleClock::new(config.seed, name, &sampling))
    })
    .collect()
}

impl Iterator for VirtualPhoneEvents {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        loop {
            // The first of equals: at one instant the order of the channels holds.
            let next = self.channels.iter_mut().min_by_key(|c| c.stamp_ns)?;
            if next.stamp_ns > self.end_ns {
                return None;
            }
            let (kind, tick, stamp_ns) = next.advance();
            let sample = self.sample(kind, &tick);
            // A lost sample is made all the same: the others must not notice.
            if !tick.dropped {
                return Some(Event {
                    time_ns: self.start_time_ns + stamp_ns,
                    sample,
                });
            }
        }
    }
}
