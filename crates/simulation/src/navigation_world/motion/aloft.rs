//! Multirotors that fly sideways, that hover, and the gusts they meet.

use core::f64::consts::PI;

use nalgebra::Vector3;

use super::{Planned, Vehicle};
use crate::signals::{Draws, Schedule, Waves};

/// A multirotor: its thrust points where acceleration, gravity and the air's drag want it; heading is free.
pub(super) struct Multirotor {
    velocity: [Schedule; 3],
    gusts: [Waves; 3],
    yaw: Schedule,
    jitter: [Waves; 2],
    /// 0 on the ground, 1 in the air.
    airborne: Schedule,
    wind: Vector3<f64>,
    /// Drag, 1/s.
    drag: f64,
}

/// One without a plan.
fn multirotor(gust_m_s: f64, draws: &mut Draws) -> Multirotor {
    let airborne = if draws.chance(0.4) {
        let mut airborne = Schedule::starting_at(0.0);
        airborne.then(draws.uniform(1.0, 30.0), 2.0, 1.0);
        airborne
    } else {
        Schedule::starting_at(1.0)
    };
    let wind = draws.level_direction() * draws.uniform(0.0, 8.0);
    let mut gust = |rms: f64| Waves::draw(draws, 4, rms, [0.05, 1.0]);
    Multirotor {
        velocity: [0.0; 3].map(Schedule::starting_at),
        gusts: [gust(gust_m_s), gust(gust_m_s), gust(0.5 * gust_m_s)],
        jitter: [(); 2].map(|()| Waves::draw(draws, 3, 0.01, [1.0, 5.0])),
        yaw: Schedule::starting_at(draws.uniform(-PI, PI)),
        airborne,
        wind,
        drag: draws.uniform(0.1, 0.35),
    }
}

/// Turns of the heading that have nothing to do with the motion.
fn turn_about(craft: &mut Multirotor, seconds: f64, draws: &mut Draws) {
    if draws.chance(0.3) {
        return;
    }
    while craft.yaw.end() < seconds {
        let to = craft.yaw.last() + draws.uniform(-2.5, 2.5);
        let slope = draws.uniform(0.2, 1.2);
        craft
            .yaw
            .then_no_steeper(draws.uniform(2.0, 20.0), slope, to);
    }
}

/// A flight in all directions, up to 12 m/s, whatever the heading; three fifths of them fly already at the first sample.
pub(super) fn sideways(seconds: f64, draws: &mut Draws) -> Multirotor {
    let gust = draws.uniform(0.02, 0.3);
    let mut craft = multirotor(gust, draws);
    let top = draws.uniform(3.0, 12.0);
    let takes_off = craft.airborne.end() + 2.0;
    let already = takes_off < 3.0;
    let first = draws.level_direction()
        * if already {
            draws.uniform(0.0, top)
        } else {
            0.0
        };
    craft.velocity = [first.x, first.y, 0.0].map(Schedule::starting_at);
    let mut from = if already { 0.0 } else { takes_off };
    while from < seconds {
        let hovers = draws.chance(0.2);
        let target = draws.level_direction() * if hovers { 0.0 } else { draws.uniform(1.0, top) };
        let hold = draws.uniform(1.0, 7.0);
        let slope = draws.uniform(1.0, 3.5);
        let sink = draws.uniform(-1.5, 1.5);
        for (axis, value) in craft.velocity.iter_mut().zip([target.x, target.y, sink]) {
            axis.then_no_steeper((from - axis.end()).max(0.0) + hold, slope, value);
        }
        from = craft
            .velocity
            .iter()
            .map(Schedule::end)
            .fold(from, f64::max);
    }
    turn_about(&mut craft, seconds, draws);
    craft
}

/// A craft that keeps its place, pushed by gusts.
pub(super) fn hovering(seconds: f64, draws: &mut Draws) -> Multirotor {
    let gust = draws.log_uniform(0.03, 0.5);
    let mut craft = multirotor(gust, draws);
    let mut from = craft.airborne.end() + draws.uniform(2.0, 10.0);
    // A push, and the way back.
    while from < seconds {
        let push = draws.level_direction() * draws.uniform(0.3, 2.0);
        let (rise, hold) = (draws.uniform(0.5, 1.5), draws.uniform(0.0, 1.0));
        for (axis, value) in craft.velocity.iter_mut().zip([push.x, push.y]) {
            axis.then((from - axis.end()).max(0.0), rise, value);
            axis.then(hold, 2.0 * rise, -value);
            axis.then(hold, rise, 0.0);
        }
        from = craft.velocity[0].end() + draws.uniform(3.0, 25.0);
    }
    turn_about(&mut craft, seconds, draws);
    craft
}

impl Vehicle for Multirotor {
    fn plan(&mut self, t: f64, _: f64) -> Planned {
        let airborne = self.airborne.value(t);
        let along = |i: usize| self.velocity[i].value(t) + self.gusts[i].value(t) * airborne;
        let velocity = Vector3::new(along(0), along(1), along(2));
        let through_air = velocity - self.wind;
        Planned {
            velocity,
            yaw: self.yaw.value(t),
            pitch: self.jitter[0].value(t) * airborne,
            roll: self.jitter[1].value(t) * airborne,
            shake: 0.02 + 0.98 * airborne,
            drag: Some(through_air * (self.drag * airborne)),
            ..Planned::default()
        }
    }
}
