//! Random worlds for GNSS/INS: vehicles, inertial units and receivers drawn from one seed, wider than life.
//!
//! A world is a motion of one [`WorldClass`], an [`InertialUnit`] on it, a [`WorldReceiver`], and what goes wrong. All is drawn from
//! the seed and the world's number alone; classes follow one another, so that any run of numbers has equal shares. What a
//! world has stands in its [`WorldDescription`], for reports; an estimator is given [`NavigationWorld::samples`] (their
//! measured half) and [`NavigationWorld::fixes`].
//!
//! | drawn | range |
//! |---|---|
//! | inertial unit | gyroscope 3e-5 to 3e-4 (rad/s)/sqrt(Hz), accelerometer 3e-4 to 4e-3 (m/s^2)/sqrt(Hz), biases to 0.4 deg/s and 0.08 m/s^2 (one sigma), 50 to 200 Hz |
//! | vibration | 0.01 to 5 m/s^2 by class, at 12 to 80 Hz, so that it is aliased, with the motor or with the speed |
//! | receiver | 0.02 to 5 m, part of it correlated for a minute; stated up to ten times too large or too small; 0.2 to 10 Hz |
//! | not told | latency 0 to 0.3 s, lever arm 0 to 1 m, mount |
//! | faults | outliers of 10 m to 2000 km, a minute of drift, frozen positions, outages of 5 to 60 s, a stale first fix, bias jumps, saturation |
//!
//! Axes are those of navigation: north, east, down from an origin near the start; gravity turns and falls with the
//! distance from it. The Earth does not turn.

mod description;
mod inertial;
mod motion;
mod receiver;

#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use serde::Serialize;

pub use inertial::{BiasJump, InertialUnit, WorldSample};
pub use receiver::{CORRELATION_TIME_S, Fault, FaultKind, WorldFix, WorldReceiver};

use self::motion::Path;
use crate::random::run_seed;
use crate::signals::Draws;

/// What moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WorldClass {
    /// A car on a good road.
    CarSmooth,
    /// A car on a bad one.
    CarRough,
    /// A car that parks: forwards, backwards, at a walking pace.
    CarParking,
    /// A phone that lies anyhow in a car.
    CarPhone,
    /// A bicycle that leans into its turns.
    Bicycle,
    /// A multirotor that flies in all directions, whatever its heading.
    DroneSideways,
    /// A multirotor that hovers in gusts.
    DroneHovering,
    /// A ship in waves that drifts.
    Ship,
    /// Somebody on foot with a unit in hand or pocket.
    Pedestrian,
}

impl WorldClass {
    /// All, in the order of the worlds' numbers.
    pub const ALL: [Self; 9] = [
        Self::CarSmooth,
        Self::CarRough,
        Self::CarParking,
        Self::CarPhone,
        Self::Bicycle,
        Self::DroneSideways,
        Self::DroneHovering,
        Self::Ship,
        Self::Pedestrian,
    ];

    /// The class of the world with this number.
    #[must_use]
    pub const fn of(number: u64) -> Self {
        Self::ALL[(number % Self::ALL.len() as u64) as usize]
    }

    /// Its name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::CarSmooth => "car-smooth",
            Self::CarRough => "car-rough",
            Self::CarParking => "car-parking",
            Self::CarPhone => "car-phone",
            Self::Bicycle => "bicycle",
            Self::DroneSideways => "drone-sideways",
            Self::DroneHovering => "drone-hovering",
            Self::Ship => "ship",
            Self::Pedestrian => "pedestrian",
        }
    }

    /// The class of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.name() == name)
    }

    /// All names, for messages.
    #[must_use]
    pub fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }
}

/// What a world has.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldDescription {
    /// Its number.
    pub number: u64,
    /// What moves.
    pub class: WorldClass,
    /// How long, s.
    pub duration_s: f64,
    /// Speed at the first sample, m/s.
    pub first_speed_m_s: f64,
    /// Highest speed, m/s.
    pub top_speed_m_s: f64,
    /// The inertial unit.
    pub inertial: InertialUnit,
    /// The receiver.
    pub receiver: WorldReceiver,
}

/// A world: what its sensors say, and the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct NavigationWorld {
    /// What it has.
    pub description: WorldDescription,
    /// Inertial samples with the truth at their instants, by time.
    pub samples: Vec<WorldSample>,
    /// Fixes, by their stamps.
    pub fixes: Vec<WorldFix>,
}

impl NavigationWorld {
    /// The world with this number under a seed; the same on every machine.
    #[must_use]
    pub fn draw(seed: u64, number: u64) -> Self {
        let seed = run_seed(seed, number);
        let class = WorldClass::of(number);
        let duration_s = Draws::new(seed, "duration").uniform(120.0, 240.0).round();
        let unit = InertialUnit::draw(class, duration_s, &mut Draws::new(seed, "imu/errors"));
        let receiver =
            WorldReceiver::draw(class, duration_s, &mut Draws::new(seed, "receiver/errors"));
        Self::with(seed, number, duration_s, unit, receiver)
    }

    /// A world of the class with this number, so long, whose unit and receiver are healthy: no faults, no lever arm or latency that
    /// nobody tells, errors stated as they are. What faults are injected into.
    #[must_use]
    pub fn draw_healthy(seed: u64, number: u64, seconds: f64) -> Self {
        let seed = run_seed(seed, number);
        let class = WorldClass::of(number);
        let mut unit = InertialUnit::draw(class, seconds, &mut Draws::new(seed, "imu/errors"));
        unit.bias_jumps.clear();
        unit.saturation = None;
        let mut draws = Draws::new(seed, "receiver/errors");
        let receiver = WorldReceiver::draw(class, seconds, &mut draws).healthy();
        Self::with(seed, number, seconds, unit, receiver)
    }

    fn with(
        seed: u64,
        number: u64,
        duration_s: f64,
        mut unit: InertialUnit,
        receiver: WorldReceiver,
    ) -> Self {
        let class = WorldClass::of(number);
        let count = (duration_s * unit.rate_hz) as usize;
        let path = Path::draw(
            class,
            duration_s,
            count,
            unit.rate_hz,
            &mut Draws::new(seed, "motion"),
        );
        let mut samples = unit.truth(&path, &Vector3::from(receiver.lever_arm_m));
        let fixes = receiver.measure(&path, &samples, &unit, seed);
        unit.measure(&mut samples, &path, seed);
        let speeds = || samples.iter().map(|sample| sample.velocity.norm());
        let description = WorldDescription {
            number,
            class,
            duration_s,
            first_speed_m_s: speeds().next().unwrap_or(0.0),
            top_speed_m_s: speeds().fold(0.0, f64::max),
            inertial: unit,
            receiver,
        };
        Self {
            description,
            samples,
            fixes,
        }
    }
}
