//! Persons who walk, stand, turn, with the gait in every axis.

use core::f64::consts::{PI, TAU};

use super::{Planned, Vehicle, moving, turned};
use crate::rotation::sin_cos;
use crate::signals::{Draws, Schedule, Waves};

/// Somebody who walks with a unit in hand or pocket.
pub(super) struct Pedestrian {
    speed: Schedule,
    turn: Schedule,
    sway: Waves,
    yaw: f64,
    gait_hz: f64,
    phase: f64,
    /// Swing of the pocket, rad.
    swing: f64,
    /// Bounce at full pace, m.
    bounce_m: f64,
}

/// A walk of up to 2 m/s; half of them begin standing.
pub(super) fn pedestrian(seconds: f64, draws: &mut Draws) -> Pedestrian {
    let pace = draws.uniform(1.0, 1.8);
    let mut speed = Schedule::starting_at(if draws.chance(0.5) { pace } else { 0.0 });
    while speed.end() < seconds {
        let stands = draws.chance(0.2) && speed.last() > 0.0;
        let target = if stands {
            0.0
        } else {
            pace * draws.uniform(0.6, 1.1)
        };
        speed.then(draws.uniform(3.0, 30.0), draws.uniform(1.0, 3.0), target);
    }
    let mut turn = Schedule::starting_at(0.0);
    while turn.end() < seconds {
        let rate = draws.sign() * draws.uniform(0.2, 1.2);
        turn.then(draws.uniform(2.0, 20.0), draws.uniform(0.5, 1.5), rate);
        turn.then(draws.uniform(0.3, 2.0), draws.uniform(0.5, 1.5), 0.0);
    }
    Pedestrian {
        speed,
        turn,
        sway: Waves::draw(draws, 3, 0.03, [0.1, 0.8]),
        yaw: draws.uniform(-PI, PI),
        gait_hz: draws.uniform(1.6, 2.2),
        phase: draws.uniform(0.0, TAU),
        swing: draws.uniform(0.03, 0.35),
        bounce_m: draws.uniform(0.01, 0.03),
    }
}

impl Vehicle for Pedestrian {
    fn plan(&mut self, t: f64, step: f64) -> Planned {
        let speed = self.speed.value(t);
        let pace = moving(speed, 0.5);
        self.yaw += self.turn.value(t) * pace * step;
        let omega = TAU * self.gait_hz;
        let at = |harmonic: f64, shift: f64| sin_cos(harmonic * (omega * t + self.phase) + shift).0;
        let bounce = self.bounce_m * omega * (at(1.0, 0.0) + 0.4 * at(2.0, 1.0)) * pace;
        let surge = 0.15 * at(1.0, 0.7) * pace;
        let sideways = 0.1 * at(0.5, 0.0) * pace;
        Planned {
            velocity: turned(self.yaw, speed + surge, sideways, bounce),
            forward: speed + surge,
            yaw: self.yaw + 0.08 * at(0.5, 0.3) * pace + self.sway.value(t),
            pitch: self.swing * at(0.5, 1.1) * pace + self.sway.value(t + 100.0),
            roll: 0.07 * at(0.5, 2.0) * pace + self.sway.value(t + 200.0),
            shake: 0.05 + 0.95 * pace,
            drag: None,
        }
    }
}
