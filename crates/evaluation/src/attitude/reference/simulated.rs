//! Recordings made for tests: a device that is turned about, and a reference with a clock and a mounting of its own.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::geometry::{rotation, so3};
use northing_recording::{Event, RecordingError, Reference, Sample};
use northing_simulation::random::{normal_vector, stream};
use rand::RngExt as _;

pub(crate) type Events = Vec<Result<Event, RecordingError>>;

/// What is simulated. Motion, noise and phases follow from the seed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turned {
    pub(crate) seed: u64,
    pub(crate) duration_s: f64,
    pub(crate) imu_hz: f64,
    pub(crate) reference_hz: f64,
    /// Where its instants lie between those of the other sensors, 0 to 1 of its interval.
    pub(crate) reference_phase: f64,
    /// The reference's stamp of an instant, s.
    pub(crate) stamp: fn(f64) -> f64,
    /// `sensor_from_reference_body`.
    pub(crate) mounting: UnitQuaternion<f64>,
    /// Noise of the reference per axis, rad.
    pub(crate) reference_std: f64,
    /// Seed of the motion that the reference shows.
    pub(crate) reference_seed: u64,
    /// Factor of all rates: 0 is rest.
    pub(crate) speed: f64,
    pub(crate) magnetometer: bool,
    /// About how many axes it turns: 1 is a turntable.
    pub(crate) axes: usize,
    /// How the reference's attitude is read from what it is.
    pub(crate) read: fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>,
}

impl Default for Turned {
    fn default() -> Self {
        Self {
            seed: 1,
            duration_s: 60.0,
            imu_hz: 100.0,
            reference_hz: 30.0,
            reference_phase: 0.37,
            stamp: |t| t,
            mounting: UnitQuaternion::identity(),
            reference_std: 1e-3,
            reference_seed: 1,
            speed: 1.0,
            magnetometer: true,
            axes: 3,
            read: |q| q,
        }
    }
}

/// Amplitude (rad), angular frequency (rad/s) and phase of the sines of each angle.
type Sines = [[(f64, f64, f64); 4]; 3];

fn sines(seed: u64, axes: usize) -> Sines {
    let mut random = stream(seed, "motion");
    let mut one = || {
        let frequency = random.random_range(0.1..1.2);
        let amplitude = random.random_range(0.1..0.35);
        let phase = random.random_range(0.0..std::f64::consts::TAU);
        (amplitude, frequency * std::f64::consts::TAU, phase)
    };
    let mut all = std::array::from_fn(|_| std::array::from_fn(|_| one()));
    for still in &mut all[axes..] {
        *still = Default::default();
    }
    all
}

fn attitude(sines: &Sines, t: f64) -> UnitQuaternion<f64> {
    let angle =
        |own: &[(f64, f64, f64); 4]| own.iter().map(|(a, w, p)| a * (w * t + p).sin()).sum();
    rotation::from_yaw_pitch_roll([angle(&sines[0]), angle(&sines[1]), angle(&sines[2])])
}

impl Turned {
    /// Everything in time order.
    pub(crate) fn events(&self) -> Events {
        let mut events = self.measured();
        events.extend(self.references());
        events.sort_by_key(|event| event.time_ns);
        events.into_iter().map(Ok).collect()
    }

    fn measured(&self) -> Vec<Event> {
        let own = sines(self.seed, self.axes);
        let mut random = stream(self.seed, "sensors");
        let mut events = Vec::new();
        for k in 0..(self.duration_s * self.imu_hz) as i64 {
            let t = k as f64 / self.imu_hz;
            let at = |t: f64| attitude(&own, t * self.speed);
            let step = 1e-4;
            let turn = so3::log(&(at(t - step).inverse() * at(t + step)));
            let rate = turn / (2.0 * step) + Vector3::new(0.01, -0.02, 0.005);
            let body = at(t).inverse();
            let mut push = |sample| {
                events.push(Event {
                    time_ns: (t * 1e9).round() as i64,
                    sample,
                });
            };
            push(Sample::AngularRate(
                rate + normal_vector(&mut random, 0.005),
            ));
            let force = body * Vector3::new(0.0, 0.0, 9.81);
            push(Sample::SpecificForce(
                force + normal_vector(&mut random, 0.02),
            ));
            if self.magnetometer {
                let field = body * Vector3::new(0.0, 22.0, -42.0);
                push(Sample::MagneticField(
                    field + normal_vector(&mut random, 0.3),
                ));
            }
        }
        events
    }

    fn references(&self) -> Vec<Event> {
        let shown = sines(self.reference_seed, self.axes);
        let mut random = stream(self.seed, "reference");
        let count = (self.duration_s * self.reference_hz) as i64;
        let samples = (0..count).map(|k| {
            let t = (k as f64 + self.reference_phase) / self.reference_hz;
            let noise = so3::exp(&normal_vector(&mut random, self.reference_std));
            let sensor = attitude(&shown, t * self.speed);
            Event {
                time_ns: ((self.stamp)(t) * 1e9).round() as i64,
                sample: Sample::Reference(Reference {
                    attitude: (self.read)(sensor * self.mounting * noise),
                    scored: true,
                }),
            }
        });
        samples.collect()
    }
}
