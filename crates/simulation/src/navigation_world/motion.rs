//! How the vehicles and persons of the worlds move: velocity, position and attitude at instants half a sample apart.
//!
//! A vehicle plans velocity and angles; acceleration, which tilts a car and a drone, comes from differences of the
//! planned velocity, and position from its sum. So the mean specific force and the mean rate between two instants lead
//! exactly from one to the next.

mod afloat;
mod aloft;
mod on_foot;
mod on_road;

use nalgebra::{ComplexField, RealField, UnitQuaternion, Vector3};

use super::WorldClass;
use crate::ground::GRAVITY_M_S2;
use crate::rotation::exp;
use crate::signals::Draws;

/// Instants of the truth in one inertial interval.
pub(super) const STEPS: usize = 2;
/// Pitch of a car by braking, rad/(m/s^2).
const NOD: f64 = 0.012;

/// The motion, `STEPS` instants an inertial interval apart.
pub(super) struct Path {
    /// Between two instants, s.
    pub(super) step_s: f64,
    pub(super) position: Vec<Vector3<f64>>,
    pub(super) velocity: Vec<Vector3<f64>>,
    pub(super) ned_from_vehicle: Vec<UnitQuaternion<f64>>,
    /// How hard it shakes, from 0 to 1.
    pub(super) shake: Vec<f64>,
}

/// What a vehicle plans for one instant.
#[derive(Default)]
struct Planned {
    /// NED, m/s.
    velocity: Vector3<f64>,
    /// Speed along its own axis, m/s; negative in reverse.
    forward: f64,
    /// rad.
    yaw: f64,
    pitch: f64,
    roll: f64,
    shake: f64,
    /// What carries it: wheels and hulls, or a thrust that also holds against this drag (m/s^2, NED).
    drag: Option<Vector3<f64>>,
}

/// Something that moves.
trait Vehicle {
    /// The plan at the next instant, `step` seconds after the one before.
    fn plan(&mut self, t: f64, step: f64) -> Planned;
}

impl Path {
    /// `samples` inertial samples at `rate_hz`, with half an interval on either side.
    pub(super) fn draw(
        class: WorldClass,
        seconds: f64,
        samples: usize,
        rate_hz: f64,
        draws: &mut Draws,
    ) -> Self {
        let mut vehicle: Box<dyn Vehicle> = match class {
            WorldClass::CarSmooth | WorldClass::CarRough | WorldClass::CarPhone => {
                Box::new(on_road::car(class, seconds, draws))
            }
            WorldClass::CarParking => Box::new(on_road::parking(seconds, draws)),
            WorldClass::Bicycle => Box::new(on_road::bicycle(seconds, draws)),
            WorldClass::DroneSideways => Box::new(aloft::sideways(seconds, draws)),
            WorldClass::DroneHovering => Box::new(aloft::hovering(seconds, draws)),
            WorldClass::Ship => Box::new(afloat::ship(seconds, draws)),
            WorldClass::Pedestrian => Box::new(on_foot::pedestrian(seconds, draws)),
        };
        let start = draws.level_direction() * draws.uniform(0.0, 500.0);
        let step_s = 1.0 / (rate_hz * STEPS as f64);
        let count = (samples + 1) * STEPS + 1;
        let plan = (0..count).map(|k| vehicle.plan(k as f64 * step_s, step_s));
        Self::of(&plan.collect::<Vec<_>>(), start, step_s)
    }

    fn of(plan: &[Planned], start: Vector3<f64>, step_s: f64) -> Self {
        let count = plan.len();
        let mut path = Self {
            step_s,
            position: Vec::with_capacity(count),
            velocity: plan.iter().map(|p| p.velocity).collect(),
            ned_from_vehicle: Vec::with_capacity(count),
            shake: plan.iter().map(|p| p.shake).collect(),
        };
        let mut position = start;
        for (k, now) in plan.iter().enumerate() {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(count - 1));
            let over = (after - before).max(1) as f64 * step_s;
            if k > 0 {
                position += (plan[before].velocity + now.velocity) * (0.5 * step_s);
            }
            path.position.push(position);
            let acceleration = (plan[after].velocity - plan[before].velocity) / over;
            let surge = (plan[after].forward - plan[before].forward) / over;
            path.ned_from_vehicle
                .push(now.attitude(&acceleration, surge));
        }
        path
    }
}

impl Planned {
    fn attitude(&self, acceleration: &Vector3<f64>, surge: f64) -> UnitQuaternion<f64> {
        let about = |axis: Vector3<f64>, angle: f64| exp(&(axis * angle));
        let (tilt, pitch) = match &self.drag {
            Some(drag) => (
                upright_to(&(acceleration - Vector3::z() * GRAVITY_M_S2 + drag)),
                self.pitch,
            ),
            None => (UnitQuaternion::identity(), self.pitch - NOD * surge),
        };
        tilt * about(Vector3::z(), self.yaw)
            * about(Vector3::y(), pitch)
            * about(Vector3::x(), self.roll)
    }
}

/// The shortest turn of the upward axis into this direction.
fn upright_to(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let axis = (-Vector3::z()).cross(direction);
    let sine = axis.norm();
    let angle = RealField::atan2(sine, -direction.z);
    axis.try_normalize(1e-9)
        .map_or_else(UnitQuaternion::identity, |axis| exp(&(axis * angle)))
}

/// A velocity over ground from one along and across a heading, and one downwards.
fn turned(yaw: f64, forward: f64, sideways: f64, sink: f64) -> Vector3<f64> {
    let (sin, cos): (f64, f64) = ComplexField::sin_cos(yaw);
    Vector3::new(
        forward * cos - sideways * sin,
        forward * sin + sideways * cos,
        sink,
    )
}

/// How much something of this speed moves at all: 0 at rest, 1 well above `scale`; smooth.
fn moving(speed: f64, scale: f64) -> f64 {
    let square = speed * speed;
    square / (square + scale * scale)
}
