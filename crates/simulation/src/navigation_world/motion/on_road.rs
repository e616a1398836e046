//! Cars on the road, cars that park, bicycles.

use core::f64::consts::PI;

use nalgebra::RealField;

use super::super::WorldClass;
use super::{Planned, Vehicle, moving, turned};
use crate::ground::GRAVITY_M_S2;
use crate::signals::{Draws, Schedule, Waves};

/// How a vehicle meets the sideways force of a turn.
#[derive(Clone, Copy, PartialEq)]
enum Lean {
    /// Outwards on its springs.
    Springs,
    /// Into the turn, so that the force stays in the wheels' plane.
    Balance,
}

/// Something with wheels that roll and do not slip.
pub(super) struct RoadVehicle {
    speed: Schedule,
    turn: Schedule,
    ripple: Waves,
    weave: Waves,
    grade: Waves,
    sway: Waves,
    nod: Waves,
    heave: Waves,
    yaw: f64,
    /// From the axle that does not slip to the unit, m.
    axle_m: f64,
    lean: Lean,
    /// Shaking at rest, and speed at which all of it is there, m/s.
    idle: f64,
    full_shake_m_s: f64,
}

/// Where the speed begins: half of the vehicles move already.
fn begin(draws: &mut Draws, speeds: [f64; 2]) -> Schedule {
    if draws.chance(0.5) {
        return Schedule::starting_at(draws.uniform(speeds[0], speeds[1]));
    }
    let mut speed = Schedule::starting_at(0.0);
    let wait = draws.uniform(1.0, 40.0);
    let first = draws.uniform(speeds[0], speeds[1]);
    speed.then_no_steeper(wait, draws.uniform(0.8, 2.0), first);
    speed
}

/// Turns to either side with straights between.
fn turns(draws: &mut Draws, seconds: f64, rates: [f64; 2], straights_s: [f64; 2]) -> Schedule {
    let mut turn = Schedule::starting_at(0.0);
    while turn.end() < seconds {
        let rate = draws.sign() * draws.uniform(rates[0], rates[1]);
        turn.then(
            draws.uniform(straights_s[0], straights_s[1]),
            draws.uniform(1.0, 2.5),
            rate,
        );
        turn.then(draws.uniform(1.0, 6.0), draws.uniform(1.0, 2.5), 0.0);
    }
    turn
}

/// A car: 4 to 30 m/s, with stops.
pub(super) fn car(class: WorldClass, seconds: f64, draws: &mut Draws) -> RoadVehicle {
    let top = draws.uniform(12.0, 30.0);
    let mut speed = begin(draws, [4.0, top]);
    while speed.end() < seconds {
        let stops = draws.chance(0.15);
        let target = if stops { 0.0 } else { draws.uniform(4.0, top) };
        speed.then_no_steeper(draws.uniform(4.0, 25.0), draws.uniform(0.8, 2.5), target);
        if stops {
            let again = draws.uniform(4.0, top);
            speed.then_no_steeper(draws.uniform(2.0, 20.0), draws.uniform(0.8, 2.5), again);
        }
    }
    // How much the road moves the body: between a new motorway and a track through a forest.
    let rough = match class {
        WorldClass::CarRough => draws.uniform(0.5, 1.0),
        WorldClass::CarPhone => draws.uniform(0.1, 0.5),
        _ => draws.uniform(0.0, 0.1),
    };
    RoadVehicle {
        turn: turns(draws, seconds, [0.05, 0.5], [3.0, 25.0]),
        ripple: Waves::draw(draws, 2, 0.4, [0.02, 0.15]),
        weave: Waves::draw(draws, 2, 0.01, [0.05, 0.3]),
        grade: Waves::draw(draws, 2, 0.02, [0.005, 0.03]),
        sway: Waves::draw(draws, 2, 0.001 + 0.02 * rough, [0.6, 2.0]),
        nod: Waves::draw(draws, 2, 0.001 + 0.02 * rough, [0.8, 2.5]),
        heave: Waves::draw(draws, 2, 0.005 + 0.2 * rough, [0.8, 2.5]),
        yaw: draws.uniform(-PI, PI),
        axle_m: draws.uniform(-0.5, 2.5),
        lean: Lean::Springs,
        idle: draws.uniform(0.05, 0.4),
        full_shake_m_s: 15.0,
        speed,
    }
}

/// A car that parks: forwards and backwards at a walking pace, with stops and full steering.
pub(super) fn parking(seconds: f64, draws: &mut Draws) -> RoadVehicle {
    let mut speed = begin(draws, [1.0, 5.0]);
    while speed.end() < seconds {
        let target = if speed.last() > 0.0 {
            -draws.uniform(0.6, 2.5)
        } else {
            draws.uniform(0.8, 5.0)
        };
        speed.then_no_steeper(draws.uniform(2.0, 10.0), draws.uniform(0.5, 1.5), 0.0);
        speed.then_no_steeper(draws.uniform(0.5, 6.0), draws.uniform(0.5, 1.5), target);
    }
    RoadVehicle {
        speed,
        turn: turns(draws, seconds, [0.2, 0.8], [0.5, 8.0]),
        ..car(WorldClass::CarSmooth, seconds, draws)
    }
}

/// A bicycle: 2 to 9 m/s, leaning into its turns and swaying with the pedals.
pub(super) fn bicycle(seconds: f64, draws: &mut Draws) -> RoadVehicle {
    let top = draws.uniform(4.0, 9.0);
    let mut speed = begin(draws, [2.0, top]);
    while speed.end() < seconds {
        let target = if draws.chance(0.08) {
            0.0
        } else {
            draws.uniform(2.0, top)
        };
        speed.then_no_steeper(draws.uniform(4.0, 20.0), draws.uniform(0.4, 1.5), target);
    }
    let pedals = draws.uniform(0.8, 1.5);
    RoadVehicle {
        speed,
        turn: turns(draws, seconds, [0.1, 0.6], [2.0, 15.0]),
        ripple: Waves::draw(draws, 2, 0.2, [0.03, 0.2]),
        weave: Waves::draw(draws, 2, 0.04, [0.2, pedals]),
        grade: Waves::draw(draws, 2, 0.02, [0.01, 0.05]),
        sway: Waves::draw(draws, 2, 0.04, [0.5 * pedals, pedals]),
        nod: Waves::draw(draws, 1, 0.01, [pedals, 2.0 * pedals]),
        heave: Waves::draw(draws, 2, 0.05, [pedals, 4.0]),
        yaw: draws.uniform(-PI, PI),
        axle_m: draws.uniform(0.0, 1.2),
        lean: Lean::Balance,
        idle: 0.02,
        full_shake_m_s: 6.0,
    }
}

impl Vehicle for RoadVehicle {
    fn plan(&mut self, t: f64, step: f64) -> Planned {
        let planned = self.speed.value(t);
        let moves = moving(planned, 1.0);
        let forward = planned + self.ripple.value(t) * moves;
        // Steering turns a vehicle as far as it rolls, and a driver keeps to 3 m/s^2.
        let wanted = self.turn.value(t) + self.weave.value(t);
        let rolls = forward / (forward * forward + 9.0).sqrt();
        let grip = wanted * forward / 3.0;
        let rate = wanted * rolls / (1.0 + grip * grip).sqrt();
        self.yaw += rate * step;
        let grade = self.grade.value(t);
        let sink = -forward * grade + self.heave.value(t) * moves;
        let sideways_force = forward * rate;
        let lean = match self.lean {
            Lean::Springs => -0.02 * sideways_force,
            Lean::Balance => RealField::atan2(sideways_force, GRAVITY_M_S2),
        };
        let shake = (forward.abs() / self.full_shake_m_s).min(1.0);
        Planned {
            velocity: turned(self.yaw, forward, rate * self.axle_m, sink),
            forward,
            yaw: self.yaw,
            pitch: grade + self.nod.value(t) * moves,
            roll: lean + self.sway.value(t) * moves,
            shake: self.idle + (1.0 - self.idle) * shake,
            drag: None,
        }
    }
}
