//! Receivers of the worlds, from RTK to metres: white and correlated errors, stated too large or too small, latency, lever arm,
//! outliers, drifts, frozen positions, outages, a stale first fix.

use nalgebra::Vector3;
use serde::Serialize;

use super::WorldClass;
use super::inertial::{InertialUnit, WorldSample};
use super::motion::{Path, STEPS};
use crate::signals::{Draws, exponential, logarithm};

/// How long the correlated part of a position's error lasts, s.
pub const CORRELATION_TIME_S: f64 = 60.0;
/// The vertical error of a receiver, in horizontal ones.
const VERTICAL: f64 = 1.8;

/// What can be wrong with a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// One fix elsewhere.
    Outlier,
    /// Multipath: the position goes away and comes back within a minute.
    Drift,
    /// The same position and velocity again and again.
    Frozen,
    /// No fixes.
    Outage,
    /// The first fix is of another place, from before the receiver was switched off.
    Stale,
}

/// One fault of a receiver.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fault {
    /// What.
    pub kind: FaultKind,
    /// From when, s.
    pub from_s: f64,
    /// Until when, s.
    pub until_s: f64,
    /// How far off, m; 0 where it says nothing.
    pub size_m: f64,
    /// In which direction, north and east.
    pub direction: [f64; 2],
}

/// What a receiver has, and how it errs. Stated standard deviations are the true ones times a factor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldReceiver {
    /// Fixes a second.
    pub rate_hz: f64,
    /// True standard deviation of a horizontal axis, m; of the height 1.8 times that.
    pub position_std_m: f64,
    /// Part of that standard deviation that stays correlated for [`CORRELATION_TIME_S`].
    pub correlated_fraction: f64,
    /// Stated over true standard deviation of the position.
    pub position_stated: f64,
    /// True standard deviation of the velocity, m/s, if there is one.
    pub velocity_std_m_s: Option<f64>,
    /// Stated over true standard deviation of the velocity.
    pub velocity_stated: f64,
    /// How much older a fix is than its stamp, s.
    pub latency_s: f64,
    /// From the unit to the antenna, unit's axes, m.
    pub lever_arm_m: [f64; 3],
    /// Faults, by their beginning.
    pub faults: Vec<Fault>,
}

/// One fix, as the receiver gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldFix {
    /// When it was valid, s.
    pub time_s: f64,
    /// Its stamp, ns.
    pub stamp_ns: i64,
    /// Measured position of the antenna and its stated standard deviations, m, NED.
    pub position: [Vector3<f64>; 2],
    /// The same of the velocity, m/s.
    pub velocity: Option<[Vector3<f64>; 2]>,
    /// What is wrong with it, if anything; nobody but a judge knows.
    pub fault: Option<FaultKind>,
}

impl WorldReceiver {
    /// A receiver for a world of this class.
    pub(super) fn draw(class: WorldClass, seconds: f64, draws: &mut Draws) -> Self {
        let position_std_m = draws.log_uniform(0.02, 5.0);
        // Within ten, most near one.
        let mut stated =
            || exponential((0.8 * draws.normal()).clamp(-logarithm(10.0), logarithm(10.0)));
        let (position_stated, velocity_stated) = (stated(), stated());
        let has_velocity = draws.chance(0.5);
        let velocity_std_m_s = has_velocity.then(|| draws.log_uniform(0.02, 0.4));
        let latency_s = if draws.chance(0.5) {
            draws.uniform(0.0, 0.3)
        } else {
            draws.uniform(0.0, 0.02)
        };
        let longest = match class {
            WorldClass::CarPhone | WorldClass::Pedestrian => 0.1,
            WorldClass::DroneHovering | WorldClass::DroneSideways => 0.5,
            _ => 1.0,
        };
        let arm = if draws.chance(0.2) {
            0.0
        } else {
            draws.uniform(0.0, longest)
        };
        Self {
            rate_hz: draws.one_of(&[0.2, 0.5, 1.0, 1.0, 1.0, 1.0, 2.0, 5.0, 5.0, 10.0]),
            position_std_m,
            correlated_fraction: draws.uniform(0.0, 0.98),
            position_stated,
            velocity_std_m_s,
            velocity_stated,
            latency_s,
            lever_arm_m: (draws.direction() * arm).into(),
            faults: faults(seconds, position_std_m, draws),
        }
    }

    /// The same without faults, latency and lever arm, its errors white and stated as they are, at least once a second.
    pub(super) fn healthy(self) -> Self {
        Self {
            rate_hz: self.rate_hz.max(1.0),
            correlated_fraction: 0.0,
            position_stated: 1.0,
            velocity_stated: 1.0,
            latency_s: 0.0,
            lever_arm_m: [0.0; 3],
            faults: Vec::new(),
            ..self
        }
    }

    /// All its fixes, in the order of their stamps.
    pub(super) fn measure(
        &self,
        path: &Path,
        samples: &[WorldSample],
        unit: &InertialUnit,
        seed: u64,
    ) -> Vec<WorldFix> {
        let mut draws = Draws::new(seed, "receiver");
        let mut slow = draws.normals();
        let kept = exponential(-1.0 / (self.rate_hz * CORRELATION_TIME_S));
        let every = unit.rate_hz / self.rate_hz;
        let begin = draws.uniform(0.0, every);
        let count = ((samples.len() as f64 - begin) / every).floor().max(0.0) as usize;
        let mut fixes: Vec<WorldFix> = Vec::with_capacity(count);
        let mut last_good = None;
        for k in 0..count {
            let at = ((begin + k as f64 * every) as usize).min(samples.len() - 1);
            if k > 0 {
                slow = slow * kept + draws.normals() * (1.0 - kept * kept).sqrt();
            }
            let now = &samples[at];
            let fix = self.fix(
                now,
                &self.antenna_velocity(path, samples, at),
                &slow,
                &mut draws,
            );
            let Some(fix) = self.with_faults(fix, k == 0, last_good) else {
                continue;
            };
            if fix.fault.is_none() {
                last_good = Some(fix);
            }
            fixes.push(fix);
        }
        fixes
    }

    /// Velocity of the antenna: the unit's, and what turning adds.
    fn antenna_velocity(&self, path: &Path, samples: &[WorldSample], at: usize) -> Vector3<f64> {
        let arm = Vector3::from(self.lever_arm_m);
        let (before, after) = (at.saturating_sub(1), (at + 1).min(samples.len() - 1));
        let over = (after - before).max(1) as f64 * STEPS as f64 * path.step_s;
        let swing = samples[after].ned_from_unit * arm - samples[before].ned_from_unit * arm;
        samples[at].velocity + swing / over
    }

    fn fix(
        &self,
        now: &WorldSample,
        velocity: &Vector3<f64>,
        slow: &Vector3<f64>,
        draws: &mut Draws,
    ) -> WorldFix {
        let std = Vector3::new(1.0, 1.0, VERTICAL) * self.position_std_m;
        let share = self.correlated_fraction;
        let unit = slow * share + draws.normals() * (1.0 - share * share).sqrt();
        let noise = draws.normals();
        let velocity = self.velocity_std_m_s.map(|std| {
            let stated = Vector3::repeat(std * self.velocity_stated);
            [velocity + noise * std, stated]
        });
        WorldFix {
            time_s: now.time_s,
            stamp_ns: ((now.time_s + self.latency_s) * 1e9).round() as i64,
            position: [
                now.antenna + unit.component_mul(&std),
                std * self.position_stated,
            ],
            velocity,
            fault: None,
        }
    }

    /// What the faults make of a fix; `None` in an outage.
    fn with_faults(
        &self,
        mut fix: WorldFix,
        first: bool,
        last: Option<WorldFix>,
    ) -> Option<WorldFix> {
        let period = 1.0 / self.rate_hz;
        for fault in &self.faults {
            let [from, until] = [fault.from_s, fault.until_s];
            let during = (from..until).contains(&fix.time_s);
            // A single fault meets the first fix after its time.
            let once = (from..from + period).contains(&fix.time_s);
            let offset =
                |size: f64| Vector3::new(fault.direction[0], fault.direction[1], 0.0) * size;
            match fault.kind {
                FaultKind::Outage if during => return None,
                FaultKind::Outlier if once => fix.position[0] += offset(fault.size_m),
                FaultKind::Stale if first => fix.position[0] += offset(fault.size_m),
                FaultKind::Drift if during => {
                    let phase = core::f64::consts::PI * (fix.time_s - from) / (until - from);
                    let sine = crate::rotation::sin_cos(phase).0;
                    fix.position[0] += offset(fault.size_m * sine * sine);
                }
                FaultKind::Frozen if during => {
                    if let Some(last) = last {
                        fix.position = last.position;
                        fix.velocity = last.velocity;
                    }
                }
                _ => continue,
            }
            fix.fault = Some(fault.kind);
        }
        Some(fix)
    }
}

/// What goes wrong with a receiver in this time.
fn faults(seconds: f64, position_std_m: f64, draws: &mut Draws) -> Vec<Fault> {
    let mut faults = Vec::new();
    let mut add = |draws: &mut Draws, kind, [from_s, until_s]: [f64; 2], size_m: f64| {
        let direction = draws.level_direction();
        let direction = [direction.x, direction.y];
        faults.push(Fault {
            kind,
            from_s,
            until_s,
            size_m,
            direction,
        });
    };
    if draws.chance(0.25) {
        for _ in 0..draws.one_of(&[1, 1, 2, 4]) {
            let at = draws.uniform(2.0, seconds - 5.0);
            let size = draws.log_uniform(10.0, 2e6);
            add(draws, FaultKind::Outlier, [at, at], size);
        }
    }
    if draws.chance(0.3) {
        for _ in 0..draws.one_of(&[1, 1, 2]) {
            let from = draws.uniform(30.0, seconds - 15.0);
            let until = from + draws.log_uniform(5.0, 60.0);
            add(draws, FaultKind::Outage, [from, until], 0.0);
        }
    }
    if draws.chance(0.12) {
        let from = draws.uniform(30.0, seconds - 70.0);
        let size = draws.log_uniform(3.0, 20.0) + 2.0 * position_std_m;
        add(draws, FaultKind::Drift, [from, from + 60.0], size);
    }
    if draws.chance(0.1) {
        let from = draws.uniform(20.0, seconds - 30.0);
        let until = from + draws.uniform(3.0, 20.0);
        add(draws, FaultKind::Frozen, [from, until], 0.0);
    }
    if draws.chance(0.05) {
        let size = draws.log_uniform(1e3, 2e6);
        add(draws, FaultKind::Stale, [0.0, 0.0], size);
    }
    faults.sort_by(|a: &Fault, b| a.from_s.total_cmp(&b.from_s));
    faults
}
