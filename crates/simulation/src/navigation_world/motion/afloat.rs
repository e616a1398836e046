//! Ships in waves that drift with current and wind.

use core::f64::consts::PI;

use nalgebra::Vector3;

use super::{Planned, Vehicle, turned};
use crate::signals::{Draws, Schedule, Waves};

/// A ship.
pub(super) struct Ship {
    speed: Schedule,
    turn: Schedule,
    drift: Vector3<f64>,
    yaw: f64,
    roll: Waves,
    pitch: Waves,
    yawing: Waves,
    heave: Waves,
    surge: Waves,
    sway: Waves,
}

/// A ship of up to 10 m/s through water that drifts up to 1.5 m/s over ground; every fifth only drifts.
pub(super) fn ship(seconds: f64, draws: &mut Draws) -> Ship {
    let top = draws.uniform(2.0, 10.0);
    let drifts = draws.chance(0.2);
    let mut speed = Schedule::starting_at(if drifts { 0.0 } else { draws.uniform(0.0, top) });
    let mut turn = Schedule::starting_at(0.0);
    while !drifts && speed.end() < seconds {
        speed.then_no_steeper(
            draws.uniform(20.0, 90.0),
            draws.uniform(0.05, 0.3),
            draws.uniform(0.5, top),
        );
    }
    while !drifts && turn.end() < seconds {
        let rate = draws.sign() * draws.uniform(0.005, 0.06);
        turn.then(draws.uniform(10.0, 60.0), draws.uniform(4.0, 10.0), rate);
        turn.then(draws.uniform(10.0, 40.0), draws.uniform(4.0, 10.0), 0.0);
    }
    // From a harbour to a gale.
    let sea = draws.log_uniform(0.05, 1.0);
    let mut wave = |rms: f64, hz: [f64; 2]| Waves::draw(draws, 3, rms * sea, hz);
    Ship {
        roll: wave(0.12, [0.08, 0.15]),
        pitch: wave(0.05, [0.1, 0.2]),
        yawing: wave(0.03, [0.05, 0.12]),
        heave: wave(0.6, [0.1, 0.18]),
        surge: wave(0.3, [0.08, 0.15]),
        sway: wave(0.3, [0.08, 0.15]),
        drift: draws.level_direction() * draws.uniform(0.0, 1.5),
        yaw: draws.uniform(-PI, PI),
        speed,
        turn,
    }
}

impl Vehicle for Ship {
    fn plan(&mut self, t: f64, step: f64) -> Planned {
        let forward = self.speed.value(t) + self.surge.value(t);
        self.yaw += self.turn.value(t) * step;
        let yaw = self.yaw + self.yawing.value(t);
        let through_water = turned(yaw, forward, self.sway.value(t), self.heave.value(t));
        Planned {
            velocity: through_water + self.drift,
            forward,
            yaw,
            pitch: self.pitch.value(t),
            roll: self.roll.value(t),
            shake: 1.0,
            drag: None,
        }
    }
}
