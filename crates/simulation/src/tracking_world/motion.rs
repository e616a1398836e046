//! How the targets of a scene move: at rest, straight, turning, changing speed; alone or in pairs.

use std::f64::consts::{PI, TAU};

use nalgebra::{ComplexField, RealField};

use super::{SceneClass, SceneSensor};
use crate::rotation::sin_cos;
use crate::signals::Draws;

/// North and east, m.
pub(super) type Place = [f64; 2];

/// Distance from the origin, m.
pub(super) fn length([north, east]: Place) -> f64 {
    ComplexField::hypot(north, east)
}

/// Angle clockwise from north, rad.
pub(super) fn bearing([north, east]: Place) -> f64 {
    RealField::atan2(east, north)
}

/// So far in this direction.
pub(super) fn polar(length_m: f64, angle_rad: f64) -> Place {
    let (sin, cos) = sin_cos(angle_rad);
    [length_m * cos, length_m * sin]
}

/// Steps of motion in a scan.
const STEPS: usize = 10;

/// How fast targets of a class are.
struct Bounds {
    speed_m_s: [f64; 2],
    acceleration_m_s2: f64,
    standing: f64,
}

impl Bounds {
    const fn of(class: SceneClass) -> Self {
        let (speed_m_s, acceleration_m_s2, standing) = match class {
            SceneClass::Pedestrians => ([0.3, 2.2], 1.0, 0.15),
            SceneClass::Boats => ([1.0, 15.0], 0.8, 0.15),
            SceneClass::Ships => ([2.0, 18.0], 0.15, 0.1),
            SceneClass::Aircraft => ([50.0, 260.0], 6.0, 0.0),
        };
        Self {
            speed_m_s,
            acceleration_m_s2,
            standing,
        }
    }
}

/// Fastest of a class, m/s.
pub(super) const fn top_speed_m_s(class: SceneClass) -> f64 {
    Bounds::of(class).speed_m_s[1]
}

/// The targets of a scene.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fleet {
    pub(super) targets: Vec<Target>,
    pub(super) pairs: bool,
}

/// Where a target is at each scan of its life.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Target {
    first: usize,
    places: Vec<Place>,
    /// From which scan until which it cannot be seen.
    hidden: Option<[usize; 2]>,
}

impl Target {
    /// Its place at a scan, if it is there.
    pub(super) fn place(&self, scan: usize) -> Option<Place> {
        self.places.get(scan.checked_sub(self.first)?).copied()
    }

    pub(super) fn is_hidden(&self, scan: usize) -> bool {
        self.hidden
            .is_some_and(|[from, until]| (from..until).contains(&scan))
    }

    fn draw(class: SceneClass, sensor: &SceneSensor, scans: usize, draws: &mut Draws) -> Self {
        let at = |share: f64| (share * scans as f64) as usize;
        let first = if draws.chance(0.35) {
            at(draws.uniform(0.1, 0.6))
        } else {
            0
        };
        let last = if draws.chance(0.25) {
            at(draws.uniform(0.65, 0.95))
        } else {
            scans
        };
        let hidden = draws.chance(0.15).then(|| {
            let from = at(draws.uniform(0.2, 0.8));
            [from, from + draws.uniform(5.0, 25.0) as usize]
        });
        let places = Path::draw(class, sensor, draws).places(last - first, draws);
        Self {
            first,
            places,
            hidden,
        }
    }

    /// Another one beside it, which keeps its distance, or crosses from one side to the other.
    fn companion(&self, sensor: &SceneSensor, draws: &mut Draws) -> Self {
        let last = self.places.last().copied().unwrap_or_default();
        let range = length(last);
        let spread = sensor.place_variance(range * range, None).sqrt();
        let apart = spread * draws.uniform(2.0, 8.0);
        let angle = draws.uniform(-PI, PI);
        let crossing = draws.chance(0.5);
        let count = self.places.len().max(1) as f64;
        let beside = |(k, place): (usize, &Place)| {
            let share = if crossing {
                1.0 - 2.0 * k as f64 / count
            } else {
                1.0
            };
            let [north, east] = polar(apart * share, angle);
            [place[0] + north, place[1] + east]
        };
        Self {
            first: self.first,
            places: self.places.iter().enumerate().map(beside).collect(),
            hidden: None,
        }
    }
}

impl Fleet {
    pub(super) fn draw(
        class: SceneClass,
        sensor: &SceneSensor,
        scans: usize,
        draws: &mut Draws,
    ) -> Self {
        let count = draws.log_uniform(1.0, 16.99) as usize;
        let pairs = count > 1 && draws.chance(0.3);
        let mut targets: Vec<Target> = Vec::with_capacity(count);
        while targets.len() < count {
            let target = Target::draw(class, sensor, scans, draws);
            if pairs && targets.len() + 1 < count && draws.chance(0.5) {
                targets.push(target.companion(sensor, draws));
            }
            targets.push(target);
        }
        Self { targets, pairs }
    }
}

/// A target on its way.
struct Path {
    place: Place,
    speed: f64,
    course: f64,
    bounds: Bounds,
    interval_s: f64,
    range_m: f64,
}

/// What it does for a while.
enum Manoeuvre {
    Straight,
    /// rad/s.
    Turn(f64),
    /// To this speed, m/s.
    Speed(f64),
}

impl Path {
    fn draw(class: SceneClass, sensor: &SceneSensor, draws: &mut Draws) -> Self {
        let bounds = Bounds::of(class);
        let range = sensor.range_m * draws.uniform(0.0025, 0.81).sqrt();
        let angle = draws.uniform(-PI, PI);
        let [low, high] = bounds.speed_m_s;
        let speed = if draws.chance(bounds.standing) {
            0.0
        } else {
            draws.uniform(low, high)
        };
        Self {
            place: polar(range, angle),
            speed,
            course: draws.uniform(-PI, PI),
            bounds,
            interval_s: sensor.scan_interval_s,
            range_m: sensor.range_m,
        }
    }

    /// Its places at so many scans.
    fn places(mut self, scans: usize, draws: &mut Draws) -> Vec<Place> {
        let stands = self.speed == 0.0;
        let mut places = Vec::with_capacity(scans);
        let (mut manoeuvre, mut left) = (Manoeuvre::Straight, draws.uniform(5.0, 40.0) as usize);
        for _ in 0..scans {
            places.push(self.place);
            if stands {
                continue;
            }
            if left == 0 {
                left = draws.uniform(10.0, 60.0) as usize;
                manoeuvre = self.next(left, draws);
            }
            left -= 1;
            for _ in 0..STEPS {
                self.step(&manoeuvre);
            }
        }
        places
    }

    fn next(&self, scans: usize, draws: &mut Draws) -> Manoeuvre {
        let [low, high] = self.bounds.speed_m_s;
        let kind = draws.uniform(0.0, 1.0);
        if kind < 0.5 {
            return Manoeuvre::Straight;
        }
        if kind < 0.7 {
            return Manoeuvre::Speed(draws.uniform(low, high));
        }
        // No turn of more than half a circle, nor one that throws people off.
        let whole = PI / (scans as f64 * self.interval_s);
        let hardest = self.bounds.acceleration_m_s2 / self.speed.max(low);
        Manoeuvre::Turn(draws.sign() * draws.uniform(0.2, 1.0) * whole.min(hardest))
    }

    fn step(&mut self, manoeuvre: &Manoeuvre) {
        let dt = self.interval_s / STEPS as f64;
        let hardest = self.bounds.acceleration_m_s2;
        let outside = length(self.place) > 0.9 * self.range_m;
        let home = bearing(self.place.map(|m| -m)) - self.course;
        let home = (home + PI).rem_euclid(TAU) - PI;
        if outside && home.abs() > 0.1 {
            self.course += home.signum() * 0.5 * hardest / self.speed.max(1e-3) * dt;
        } else {
            match *manoeuvre {
                Manoeuvre::Straight => {}
                Manoeuvre::Turn(rate) => self.course += rate * dt,
                Manoeuvre::Speed(speed) => {
                    let most = 0.5 * hardest * dt;
                    self.speed += (speed - self.speed).clamp(-most, most);
                }
            }
        }
        let [north, east] = polar(self.speed * dt, self.course);
        self.place = [self.place[0] + north, self.place[1] + east];
    }
}
