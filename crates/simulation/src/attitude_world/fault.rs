//! Faults of the worlds: the one thing that is not as the model of a filter says, and what it does to board and delivery.

use nalgebra::Vector3;
use serde::Serialize;

use super::board::{Board, HeadingSource};
use super::chain::Chain;
use super::delivery::{Bursts, Delivery};
use super::measure::Scene;
use super::{BiasJump, MagneticDisturbance, WorldMotion};
use crate::rotation::{exp, log};
use crate::signals::Draws;

/// The dominant fault of a world: the true cause of what a verdict should name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WorldFault {
    /// None: everything is benign.
    None,
    /// The gyroscope's white noise is 3e-3 to 1e-2 (rad/s)/sqrt(Hz).
    GyroscopeNoise,
    /// The accelerometer's white noise is 0.1 to 0.4 (m/s^2)/sqrt(Hz).
    AccelerometerNoise,
    /// The magnetometer's white noise is 5 to 15 microtesla a sample.
    MagnetometerNoise,
    /// Steps of 0.1 to 0.5 m/s^2 and 0.1 to 1 deg/s, larger than the noise.
    Rounding,
    /// One to three holes of 0.1 to 2 s in all sensors, where it turns fastest.
    Hole,
    /// Stamps jitter by a tenth to four tenths of an interval.
    Jitter,
    /// Samples come in bursts of two to eight, with one stamp or with those of their arrival.
    Bursts,
    /// The motion exceeds the full scale of gyroscope or accelerometer.
    Saturation,
    /// A magnet of 10 to 60 microtesla comes, and stays or goes.
    MagneticDisturbance,
    /// The magnetometer has 6 to 25 microtesla of hard iron.
    HardIron,
    /// Gyroscope and accelerometer are 0.5 to 3 degrees apart, on two chips.
    Misalignment,
    /// The accelerometer's axes have scale errors of 1 to 4 %.
    AccelerometerScale,
    /// The gyroscope's bias jumps by 0.3 to 3 deg/s.
    BiasJump,
}

impl WorldFault {
    /// All.
    pub const ALL: [Self; 14] = [
        Self::None,
        Self::GyroscopeNoise,
        Self::AccelerometerNoise,
        Self::MagnetometerNoise,
        Self::Rounding,
        Self::Hole,
        Self::Jitter,
        Self::Bursts,
        Self::Saturation,
        Self::MagneticDisturbance,
        Self::HardIron,
        Self::Misalignment,
        Self::AccelerometerScale,
        Self::BiasJump,
    ];

    /// So many worlds of a motion are without a fault, for each fault that it can have once.
    const WITHOUT: usize = 5;

    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::GyroscopeNoise => "gyroscope-noise",
            Self::AccelerometerNoise => "accelerometer-noise",
            Self::MagnetometerNoise => "magnetometer-noise",
            Self::Rounding => "rounding",
            Self::Hole => "hole",
            Self::Jitter => "jitter",
            Self::Bursts => "bursts",
            Self::Saturation => "saturation",
            Self::MagneticDisturbance => "magnetic-disturbance",
            Self::HardIron => "hard-iron",
            Self::Misalignment => "misalignment",
            Self::AccelerometerScale => "accelerometer-scale",
            Self::BiasJump => "bias-jump",
        }
    }

    /// Whether it shows in this motion: a hole while nothing turns has no effect.
    #[must_use]
    pub const fn shows_in(self, motion: WorldMotion) -> bool {
        use WorldMotion::{Desk, Driving, Drone, FastTurns, Running, SlowTurns, Swinging};
        match self {
            Self::Hole | Self::Jitter | Self::Bursts => {
                !matches!(motion, Desk | SlowTurns | Driving | Drone)
            }
            Self::Saturation => matches!(motion, Running | Swinging | FastTurns),
            Self::HardIron | Self::Misalignment | Self::AccelerometerScale => {
                !matches!(motion, Desk)
            }
            _ => true,
        }
    }

    /// The fault of the world of this motion with this number among its like.
    pub(super) fn of(motion: WorldMotion, number: u64) -> Self {
        let possible: Vec<_> = (Self::ALL.into_iter())
            .filter(|fault| *fault != Self::None && fault.shows_in(motion))
            .collect();
        let slot = (number % (possible.len() + Self::WITHOUT) as u64) as usize;
        slot.checked_sub(Self::WITHOUT)
            .map_or(Self::None, |k| possible[k])
    }

    const fn needs_magnetometer(self) -> bool {
        matches!(
            self,
            Self::MagnetometerNoise | Self::MagneticDisturbance | Self::HardIron
        )
    }

    /// Gives a world the sensor that the fault is of.
    pub(super) fn prepare(self, scene: &mut Scene, draws: &mut Draws) {
        if self.needs_magnetometer() && magnetometer(&mut scene.board).is_none() {
            let field = Board::magnetometer(scene.board.gyroscope.rate_hz, draws);
            scene.board.heading = HeadingSource::Magnetometer(field);
        }
    }

    /// Lays the fault over a benign world.
    pub(super) fn apply(self, scene: &mut Scene, draws: &mut Draws) {
        let (board, seconds) = (&mut scene.board, scene.seconds);
        match self {
            Self::None => {}
            Self::GyroscopeNoise => board.gyroscope.noise_density = draws.log_uniform(3e-3, 1e-2),
            Self::AccelerometerNoise => {
                board.accelerometer.noise_density = draws.log_uniform(0.1, 0.4);
            }
            Self::MagnetometerNoise => {
                let std = draws.log_uniform(5.0, 15.0);
                if let Some(triad) = magnetometer(board) {
                    triad.noise_density = std * triad.window_s().sqrt();
                }
            }
            Self::Rounding => round(board, draws),
            Self::Hole => scene.delivery.holes = holes(&scene.chain, seconds, draws),
            Self::Jitter => scene.delivery.jitter = draws.uniform(0.1, 0.4),
            Self::Bursts => scene.delivery.bursts = Some(Bursts::draw(draws)),
            Self::Saturation => saturate(scene, draws),
            Self::MagneticDisturbance => {
                scene.disturbance = Some(MagneticDisturbance::draw(seconds, draws));
            }
            Self::HardIron => {
                let iron = draws.direction() * draws.log_uniform(6.0, 25.0);
                if let Some(triad) = magnetometer(board) {
                    triad.bias = iron.into();
                }
            }
            Self::Misalignment => {
                let angle = draws.uniform(0.5, 3.0).to_radians();
                let turn = exp(&(draws.direction() * angle));
                board.gyroscope.set_turn(&turn);
            }
            Self::AccelerometerScale => {
                let axes = [(); 3].map(|()| draws.sign() * draws.uniform(0.01, 0.04));
                board.accelerometer.scale_error = axes;
            }
            Self::BiasJump => scene.bias_jump = Some(BiasJump::draw(seconds, draws)),
        }
    }
}

const fn magnetometer(board: &mut Board) -> Option<&mut super::board::Triad> {
    match &mut board.heading {
        HeadingSource::Magnetometer(triad) => Some(triad),
        _ => None,
    }
}

/// Steps that are larger than the noise, so that values stay for many samples or toggle.
fn round(board: &mut Board, draws: &mut Draws) {
    let quiet = |triad: &mut super::board::Triad, step: f64| {
        triad.step = step;
        let most = 0.25 * step * triad.window_s().sqrt();
        triad.noise_density = triad.noise_density.min(most);
    };
    quiet(&mut board.accelerometer, draws.log_uniform(0.1, 0.5));
    let step = draws.log_uniform(0.1, 1.0).to_radians();
    quiet(&mut board.gyroscope, step);
}

/// Holes around the fastest of a few dozen instants, in order and apart.
fn holes(chain: &Chain, seconds: f64, draws: &mut Draws) -> Vec<[f64; 2]> {
    let mut holes: Vec<[f64; 2]> = Vec::new();
    for _ in 0..draws.one_of(&[1, 2, 3]) {
        let length = draws.log_uniform(0.1, 2.0);
        let mut best = (0.0, [0.0; 2]);
        for _ in 0..40 {
            let from = draws.uniform(8.0, seconds - 5.0);
            let hole = [from, from + length];
            let turned = chain.at(from).enu_from_body.inverse() * chain.at(hole[1]).enu_from_body;
            let angle = log(&turned).norm();
            let apart = |other: &[f64; 2]| hole[0] > other[1] + 2.0 || hole[1] + 2.0 < other[0];
            if angle > best.0 && holes.iter().all(apart) {
                best = (angle, hole);
            }
        }
        if best.0 > 0.0 {
            holes.push(best.1);
        }
    }
    holes.sort_by(|a, b| a[0].total_cmp(&b[0]));
    holes
}

/// Full scale at a half to nine tenths of what the motion reaches, of the gyroscope or of the accelerometer.
fn saturate(scene: &mut Scene, draws: &mut Draws) {
    let share = draws.uniform(0.5, 0.9);
    let gyroscope = draws.chance(0.6);
    let (mut rate, mut force) = (0.0_f64, 0.0_f64);
    for k in 0..(100.0 * scene.seconds) as u32 {
        let state = scene.chain.at(0.01 * f64::from(k));
        let up = Vector3::z() * scene.gravity_m_s2;
        let felt = state.enu_from_body.inverse() * (state.acceleration + up);
        rate = rate.max(state.angular_rate.amax());
        force = force.max(felt.amax());
    }
    // Gravity alone does not saturate an accelerometer.
    if gyroscope || share * force < 1.1 * scene.gravity_m_s2 {
        scene.board.gyroscope.full_scale = share * rate;
    } else {
        scene.board.accelerometer.full_scale = share * force;
    }
}

impl Delivery {
    /// Whether an instant lies in a hole.
    pub(super) fn is_missing(&self, time_s: f64) -> bool {
        let within = |[from, until]: &[f64; 2]| (*from..*until).contains(&time_s);
        self.holes.iter().any(within)
    }
}
