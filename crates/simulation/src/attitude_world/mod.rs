//! Random worlds for attitude: boards and motions drawn from one seed, wider than life, each with its true fault.
//!
//! A world is a motion of one [`WorldMotion`], a [`Board`] of sensors on it, the [`Delivery`] of their samples, and at most one
//! dominant [`WorldFault`]. All is drawn from the seed and the world's number alone; motions follow one another, and within a
//! motion the faults that show in it, so that any run of numbers has equal shares. What a world has stands in its
//! [`AttitudeWorldDescription`], for reports; an estimator is given [`AttitudeWorld::events`], of which the references are the
//! truth.
//!
//! | drawn | range |
//! |---|---|
//! | gyroscope | 1e-5 to 1e-2 (rad/s)/sqrt(Hz), bias to 1 deg/s (one sigma), 20 to 500 Hz |
//! | accelerometer | 2e-4 to 0.4 (m/s^2)/sqrt(Hz), bias to 0.1 m/s^2 (one sigma), scale to 4 %, to 3 deg from the gyroscope, its own rate and instants in part |
//! | heading | a magnetometer of 0.05 to 15 microtesla, a compass of 3 to 20 deg that lags, or none |
//! | faults | noise, rounding, holes of 0.1 to 2 s, jitter, bursts, saturation, magnets, hard iron, misalignment, scale, bias jumps |
//!
//! World axes are east, north (magnetic), up. **The body's axes are those of the accelerometer**: gyroscope and magnetometer
//! are turned against it. A board of one chip says nothing else; of two chips one has to choose, and what is level is
//! seen by the accelerometer alone.

mod board;
mod chain;
mod delivery;
mod description;
mod fault;
mod measure;
mod motion;

#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use northing_recording::Event;
use serde::Serialize;

pub use board::{Board, HeadingSource, Triad, WorldCompass};
pub use delivery::{Bursts, Delivery};
pub use fault::WorldFault;

use self::measure::Scene;
use crate::random::run_seed;
use crate::signals::{Draws, Schedule};
use crate::world::magnetic_field_ut;

/// How a board moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WorldMotion {
    /// It lies on a desk.
    Desk,
    /// A hand moves it and puts it down, again and again.
    PutDown,
    /// Somebody walks with it in hand or pocket.
    Walking,
    /// Somebody runs with it.
    Running,
    /// An arm or a cord swings it.
    Swinging,
    /// It lies in a car.
    Driving,
    /// It is on a multirotor.
    Drone,
    /// It is turned slowly, about one axis after another.
    SlowTurns,
    /// It is turned as fast as a hand can, and faster.
    FastTurns,
}

impl WorldMotion {
    /// All, in the order of the worlds' numbers.
    pub const ALL: [Self; 9] = [
        Self::Desk,
        Self::PutDown,
        Self::Walking,
        Self::Running,
        Self::Swinging,
        Self::Driving,
        Self::Drone,
        Self::SlowTurns,
        Self::FastTurns,
    ];

    /// The motion of the world with this number.
    #[must_use]
    pub const fn of(number: u64) -> Self {
        Self::ALL[(number % Self::ALL.len() as u64) as usize]
    }

    /// Its name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Desk => "desk",
            Self::PutDown => "put-down",
            Self::Walking => "walking",
            Self::Running => "running",
            Self::Swinging => "swinging",
            Self::Driving => "driving",
            Self::Drone => "drone",
            Self::SlowTurns => "slow-turns",
            Self::FastTurns => "fast-turns",
        }
    }

    /// The motion of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|motion| motion.name() == name)
    }

    /// All names, for messages.
    #[must_use]
    pub fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    /// Whether a slow sensor would miss half of it.
    const fn is_violent(self) -> bool {
        matches!(
            self,
            Self::Running | Self::Swinging | Self::FastTurns | Self::Drone
        )
    }
}

/// A magnet that comes near.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MagneticDisturbance {
    /// When it comes, s.
    pub from_s: f64,
    /// When it goes, s; none: it stays.
    pub until_s: Option<f64>,
    /// Its field, east, north, up, microtesla.
    pub field_ut: [f64; 3],
}

/// A bias that jumps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BiasJump {
    /// When, s.
    pub time_s: f64,
    /// By how much, rad/s.
    pub gyroscope_rad_s: [f64; 3],
}

/// What a world has.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AttitudeWorldDescription {
    /// Its number.
    pub number: u64,
    /// How it moves.
    pub motion: WorldMotion,
    /// What is not as the model of a filter says.
    pub fault: WorldFault,
    /// How long, s.
    pub duration_s: f64,
    /// Gravity, m/s^2.
    pub gravity_m_s2: f64,
    /// The Earth's field, east, north, up, microtesla.
    pub field_ut: [f64; 3],
    /// Its sensors.
    pub board: Board,
    /// How their samples arrive.
    pub delivery: Delivery,
    /// A magnet that comes near.
    pub disturbance: Option<MagneticDisturbance>,
    /// A jump of the gyroscope's bias.
    pub bias_jump: Option<BiasJump>,
}

/// A world: what its sensors say, and the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct AttitudeWorld {
    /// What it has.
    pub description: AttitudeWorldDescription,
    /// Samples in the order of their stamps; beside each of the gyroscope the true attitude when it was taken.
    pub events: Vec<Event>,
}

impl AttitudeWorld {
    /// The world with this number under a seed; the same on every machine.
    #[must_use]
    pub fn draw(seed: u64, number: u64) -> Self {
        Self::drawn(seed, number, true)
    }

    /// The same world with the same motion, sensors and noise, but without its fault: what the fault costs is the difference.
    #[must_use]
    pub fn draw_without_fault(seed: u64, number: u64) -> Self {
        Self::drawn(seed, number, false)
    }

    /// A world of this motion, so long, without a fault and with a magnetometer: what faults are injected into.
    #[must_use]
    pub fn draw_healthy(seed: u64, number: u64, motion: WorldMotion, seconds: f64) -> Self {
        let seed = run_seed(seed, number);
        let mut scene = Scene::lasting(motion, Some(seconds), seed);
        // It gives the board a magnetometer, and is not applied.
        WorldFault::HardIron.prepare(&mut scene, &mut Draws::new(seed, "fault"));
        Self {
            events: scene.events(seed),
            description: scene.description(number, WorldFault::None),
        }
    }

    fn drawn(seed: u64, number: u64, with_fault: bool) -> Self {
        let motion = WorldMotion::of(number);
        let fault = WorldFault::of(motion, number / WorldMotion::ALL.len() as u64);
        let seed = run_seed(seed, number);
        let scene = Scene::with(motion, fault, with_fault, seed);
        let has = if with_fault { fault } else { WorldFault::None };
        Self {
            events: scene.events(seed),
            description: scene.description(number, has),
        }
    }
}

impl Scene {
    /// With the sensor that a fault is of, and with that fault or without it.
    fn with(motion: WorldMotion, fault: WorldFault, applied: bool, seed: u64) -> Self {
        let mut scene = Self::draw(motion, seed);
        let mut draws = Draws::new(seed, "fault");
        fault.prepare(&mut scene, &mut draws);
        if applied {
            fault.apply(&mut scene, &mut draws);
        }
        scene
    }

    fn draw(motion: WorldMotion, seed: u64) -> Self {
        Self::lasting(motion, None, seed)
    }

    /// One that lasts so long, s, or as long as is drawn.
    fn lasting(motion: WorldMotion, seconds: Option<f64>, seed: u64) -> Self {
        let stream = |name: &str| Draws::new(seed, name);
        let mut place = stream("place");
        let drawn = place.uniform(60.0, 120.0).round();
        let seconds = seconds.unwrap_or(drawn);
        Self {
            motion,
            seconds,
            chain: motion::draw(motion, seconds, &mut stream("motion")),
            board: Board::draw(motion, &mut stream("board")),
            delivery: Delivery::draw(&mut stream("delivery")),
            gravity_m_s2: place.uniform(9.78, 9.83),
            field_ut: magnetic_field_ut(place.uniform(28.0, 62.0), place.uniform(-65.0, 72.0)),
            disturbance: None,
            bias_jump: None,
        }
    }

    fn description(self, number: u64, fault: WorldFault) -> AttitudeWorldDescription {
        AttitudeWorldDescription {
            number,
            motion: self.motion,
            fault,
            duration_s: self.seconds,
            gravity_m_s2: self.gravity_m_s2,
            field_ut: self.field_ut.into(),
            board: self.board,
            delivery: self.delivery,
            disturbance: self.disturbance,
            bias_jump: self.bias_jump,
        }
    }
}

impl MagneticDisturbance {
    /// One that comes in the middle of a world; half of them stay.
    fn draw(seconds: f64, draws: &mut Draws) -> Self {
        let from_s = draws.uniform(10.0, 0.6 * seconds);
        Self {
            from_s,
            until_s: draws
                .chance(0.5)
                .then(|| draws.uniform(from_s + 5.0, seconds)),
            field_ut: (draws.direction() * draws.log_uniform(10.0, 60.0)).into(),
        }
    }

    /// Its field at an instant: it comes and goes in a second.
    #[must_use]
    pub fn field_at(&self, time_s: f64) -> Vector3<f64> {
        let mut strength = Schedule::starting_at(0.0);
        strength.then(self.from_s, 1.0, 1.0);
        if let Some(until_s) = self.until_s {
            strength.then(until_s - strength.end(), 1.0, 0.0);
        }
        Vector3::from(self.field_ut) * strength.value(time_s)
    }
}

impl BiasJump {
    fn draw(seconds: f64, draws: &mut Draws) -> Self {
        Self {
            time_s: draws.uniform(15.0, seconds - 15.0),
            gyroscope_rad_s: (draws.direction() * draws.log_uniform(5e-3, 0.05)).into(),
        }
    }
}
