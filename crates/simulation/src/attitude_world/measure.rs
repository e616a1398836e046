//! What the sensors of a board make of a motion: events with errors and stamps, and the truth beside each gyroscope sample.

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{CompassHeading, Event, Reference, Sample};

use super::board::{Board, HeadingSource, Triad, WorldCompass, digitised};
use super::chain::{Chain, State};
use super::delivery::Delivery;
use super::{BiasJump, MagneticDisturbance, WorldMotion};
use crate::rotation::{exp, log};
use crate::signals::{Draws, exponential};

/// A world before it is measured.
pub(super) struct Scene {
    pub(super) motion: WorldMotion,
    pub(super) seconds: f64,
    pub(super) chain: Chain,
    pub(super) board: Board,
    pub(super) delivery: Delivery,
    pub(super) gravity_m_s2: f64,
    /// East, north, up, microtesla.
    pub(super) field_ut: Vector3<f64>,
    pub(super) disturbance: Option<MagneticDisturbance>,
    pub(super) bias_jump: Option<BiasJump>,
}

impl Scene {
    /// Everything that is delivered, by stamp, and with each gyroscope sample the attitude at the instant it was taken.
    pub(super) fn events(&self, seed: u64) -> Vec<Event> {
        let mut events = self.inertial(seed);
        match &self.board.heading {
            HeadingSource::Magnetometer(triad) => events.extend(self.magnetometer(triad, seed)),
            HeadingSource::Compass(compass) => events.extend(self.compass(compass, seed)),
            HeadingSource::None => {}
        }
        // Stable: samples of one sensor with one stamp stay in order.
        events.sort_by_key(Event::place);
        events
    }

    /// Instants and stamps of a sensor.
    fn schedule(&self, rate_hz: f64, first_s: f64, timing: &mut Draws) -> Vec<(f64, i64)> {
        let interval_s = 1.0 / rate_hz;
        let count = ((self.seconds - first_s) * rate_hz).max(0.0) as u32;
        let times = (0..count).map(|k| first_s + f64::from(k) * interval_s);
        let times: Vec<_> = times.filter(|t| !self.delivery.is_missing(*t)).collect();
        let stamps = self.delivery.stamps(&times, interval_s, timing);
        times.into_iter().zip(stamps).collect()
    }

    /// Rate and specific force as a mean over a window around an instant, which ideal sensors with a delay show.
    fn means(&self, time_s: f64, window_s: f64) -> [Vector3<f64>; 2] {
        let middle = time_s - self.board.group_delay_s;
        let [before, after]: [State; 2] = [-0.5, 0.5].map(|x| self.chain.at(middle + x * window_s));
        let turn = log(&(before.enu_from_body.inverse() * after.enu_from_body));
        let attitude = before.enu_from_body * exp(&(turn * 0.5));
        let acceleration = (after.velocity - before.velocity) / window_s;
        let up = Vector3::z() * self.gravity_m_s2;
        [turn / window_s, attitude.inverse() * (acceleration + up)]
    }

    /// Gyroscope and accelerometer, with the truth beside the gyroscope. Their means are shared where both sample at the same
    /// instants, which most do.
    fn inertial(&self, seed: u64) -> Vec<Event> {
        let (gyroscope, accelerometer) = (&self.board.gyroscope, &self.board.accelerometer);
        let mut rates = Errors::new(gyroscope, seed, "gyroscope");
        let mut forces = Errors::new(accelerometer, seed, "accelerometer");
        let schedule = self.schedule(gyroscope.rate_hz, gyroscope.first_s, &mut rates.timing);
        let mut seen = Vec::with_capacity(schedule.len());
        let mut events = Vec::with_capacity(3 * schedule.len());
        for (time_s, time_ns) in schedule {
            let [rate, force] = self.means(time_s, gyroscope.window_s());
            seen.push((time_s, force));
            let jumped = self.bias_jump.filter(|jump| jump.time_s <= time_s);
            let jump = jumped.map_or_else(Vector3::zeros, |j| j.gyroscope_rad_s.into());
            let reference = Reference {
                attitude: self.chain.at(time_s).enu_from_body,
                scored: true,
            };
            let samples = [
                Sample::AngularRate(rates.measure(&rate, &jump)),
                Sample::Reference(reference),
            ];
            events.extend(samples.map(|sample| Event { time_ns, sample }));
        }
        let (rate_hz, first_s) = (accelerometer.rate_hz, accelerometer.first_s);
        let schedule = self.schedule(rate_hz, first_s, &mut forces.timing);
        let same = rate_hz.to_bits() == gyroscope.rate_hz.to_bits();
        for (k, (time_s, time_ns)) in schedule.into_iter().enumerate() {
            let shared = seen
                .get(k)
                .filter(|(t, _)| same && t.to_bits() == time_s.to_bits());
            let force = shared.map_or_else(
                || self.means(time_s, accelerometer.window_s())[1],
                |(_, force)| *force,
            );
            let sample = Sample::SpecificForce(forces.measure(&force, &Vector3::zeros()));
            events.push(Event { time_ns, sample });
        }
        events
    }

    fn magnetometer(&self, triad: &Triad, seed: u64) -> Vec<Event> {
        let mut errors = Errors::new(triad, seed, "magnetometer");
        let schedule = self.schedule(triad.rate_hz, triad.first_s, &mut errors.timing);
        let event = |(time_s, time_ns): (f64, i64)| {
            let near = self.disturbance.map(|magnet| magnet.field_at(time_s));
            let field = self.field_ut + near.unwrap_or_default();
            let body = self.chain.at(time_s).enu_from_body.inverse() * field;
            let sample = Sample::MagneticField(errors.measure(&body, &Vector3::zeros()));
            Event { time_ns, sample }
        };
        schedule.into_iter().map(event).collect()
    }

    fn compass(&self, compass: &WorldCompass, seed: u64) -> Vec<Event> {
        let mut noise = Draws::new(seed, "compass");
        let mut timing = Draws::new(seed, "compass/timing");
        let kept = exponential(-1.0 / (compass.rate_hz * compass.correlation_time_s));
        let fresh = (1.0 - kept * kept).sqrt();
        let mut error = noise.normal();
        let schedule = self.schedule(compass.rate_hz, 0.5 / compass.rate_hz, &mut timing);
        let event = |(time_s, time_ns): (f64, i64)| {
            error = kept * error + fresh * noise.normal();
            let truth = self.chain.at(time_s - compass.lag_s).enu_from_body;
            let heading = heading_of(&truth) + error * compass.std_rad;
            let sample = Sample::CompassHeading(CompassHeading {
                heading_rad: heading.rem_euclid(core::f64::consts::TAU),
                std_rad: compass.stated_std_rad,
            });
            Event { time_ns, sample }
        };
        schedule.into_iter().map(event).collect()
    }
}

/// Where the body's y axis points, clockwise from north, rad.
fn heading_of(enu_from_body: &UnitQuaternion<f64>) -> f64 {
    let top = enu_from_body * Vector3::y();
    nalgebra::RealField::atan2(top.x, top.y)
}

/// The errors of a sensor on their way through a world.
struct Errors<'a> {
    triad: &'a Triad,
    turn: UnitQuaternion<f64>,
    bias: Vector3<f64>,
    /// Of one sample: noise, and step of the bias.
    std: [f64; 2],
    noise: Draws,
    walk: Draws,
    timing: Draws,
}

impl<'a> Errors<'a> {
    fn new(triad: &'a Triad, seed: u64, name: &str) -> Self {
        Self {
            triad,
            turn: triad.turn(),
            bias: triad.bias.into(),
            std: [
                triad.noise_std(),
                triad.bias_random_walk / triad.rate_hz.sqrt(),
            ],
            noise: Draws::new(seed, name),
            walk: Draws::new(seed, &format!("{name}/bias")),
            timing: Draws::new(seed, &format!("{name}/timing")),
        }
    }

    fn measure(&mut self, truth: &Vector3<f64>, more: &Vector3<f64>) -> Vector3<f64> {
        self.bias += self.walk.normals() * self.std[1];
        let scale = Vector3::from(self.triad.scale_error).add_scalar(1.0);
        let scaled = (self.turn * truth).component_mul(&scale);
        let noise = self.noise.normals() * self.std[0];
        digitised(&(scaled + self.bias + more + noise), self.triad)
    }
}
