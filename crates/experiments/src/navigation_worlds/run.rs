//! One world: the filter and the baselines on its samples and fixes, and what they said ten times a second.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use northing_core::geometry::so3;
use northing_core::navigation::NavigationState;
use northing_core::navigation::aiding::gnss_position::GnssPosition;
use northing_core::navigation::aiding::gnss_velocity::GnssVelocity;
use northing_core::navigation::gnss_ins::{GnssIns, GnssInsConfig};
use northing_simulation::navigation_world::{
    NavigationWorld, WorldDescription, WorldFix, WorldSample,
};
use serde::Serialize;

use super::baseline::Baseline;
use super::score::WorldOutcome;
use super::undetectable;
use crate::scoring::EVERY_S;

/// Chi-square with two degrees of freedom, 95 %.
pub(super) const CHI_SQUARE_95: f64 = 5.991;
/// An outage is longer than this, s.
const OUTAGE_S: f64 = 2.0;

/// The filter with room for late fixes at 200 Hz.
type Filter = GnssIns<f64, 128>;

/// What was said at one instant, and its error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldInstant {
    /// s.
    pub time_s: f64,
    /// Horizontal distance to the antenna, m.
    pub error_m: f64,
    /// The stated 95 % ellipse in the direction of the error, m.
    pub stated_m: f64,
    /// Heading error, deg.
    pub heading_error_deg: f64,
    /// Its stated standard deviation, deg.
    pub heading_std_deg: f64,
    /// Error of extrapolation, m; none before the first fix.
    pub extrapolation_error_m: Option<f64>,
    /// Error of the held fix, m.
    pub hold_error_m: Option<f64>,
    /// Solution status.
    pub status: String,
    /// Whether fixes are missing: none for two seconds, and for one and a half of the receiver's intervals.
    pub in_outage: bool,
    /// Whether an estimator could know its error.
    pub can_be_known: bool,
}

/// A world and what was said in it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldRun {
    /// What the world has.
    pub description: WorldDescription,
    /// When the first fix came, s.
    pub first_fix_s: Option<f64>,
    /// Instants from the first estimate on.
    pub instants: Vec<WorldInstant>,
}

impl WorldRun {
    /// Runs the default filter in the world with this number.
    #[must_use]
    pub fn of(seed: u64, number: u64) -> Self {
        Self::in_world(
            NavigationWorld::draw(seed, number),
            GnssInsConfig::default(),
        )
    }

    /// Runs a filter with these parameters in a world.
    #[must_use]
    pub fn in_world(world: NavigationWorld, config: GnssInsConfig<f64>) -> Self {
        let first_fix_s = world.fixes.first().map(|fix| fix.stamp_ns as f64 * 1e-9);
        // Parameters outside their ranges make a filter that never says anything.
        let instants = Filter::new(config).map_or_else(|_| Vec::new(), |ins| run(ins, &world));
        Self {
            description: world.description,
            first_fix_s,
            instants,
        }
    }

    /// How it is judged.
    #[must_use]
    pub fn outcome(&self) -> WorldOutcome {
        WorldOutcome::of(self)
    }
}

/// What a filter and the baselines say in a world.
fn run(mut ins: Filter, world: &NavigationWorld) -> Vec<WorldInstant> {
    let unknown = undetectable::intervals(world);
    let receiver = &world.description.receiver;
    let missing_s = (1.5 / receiver.rate_hz).max(OUTAGE_S);
    let mut instants = Vec::new();
    let mut baseline = Baseline::default();
    let mut fixes = world.fixes.iter().peekable();
    let mut next_s = 0.0;
    for sample in &world.samples {
        while let Some(fix) = fixes.next_if(|fix| fix.stamp_ns < sample.stamp_ns) {
            give(&mut ins, fix);
            baseline.take(fix);
        }
        // What is refused is counted by the filter, and scored here like everything else.
        let _ = ins.imu(
            sample.stamp_ns,
            &sample.angular_rate,
            &sample.specific_force,
        );
        let now = sample.time_s;
        if now + 1e-9 < next_s {
            continue;
        }
        next_s += EVERY_S;
        if let (Some(state), Some(said)) = (ins.state(), ins.antenna_position()) {
            let truth = true_antenna(world, now - receiver.latency_s);
            let mut instant = look(state, &said, &truth, sample, &baseline);
            instant.status = format!("{:?}", ins.validity());
            instant.in_outage = baseline.age_s(now).is_none_or(|age| age > missing_s);
            instant.can_be_known = !unknown
                .iter()
                .any(|[from, until]| (*from..*until).contains(&now));
            instants.push(instant);
        }
    }
    instants
}

fn give(ins: &mut Filter, fix: &WorldFix) {
    let [ned, std] = fix.position;
    let position = GnssPosition {
        ned,
        std,
        has_height: true,
    };
    ins.gnss_position(fix.stamp_ns, &position);
    if let Some([ned, std]) = fix.velocity {
        let velocity = GnssVelocity {
            ned,
            std,
            has_vertical: true,
        };
        ins.gnss_velocity(fix.stamp_ns, &velocity);
    }
}

/// Where the antenna was at a time: between two samples on the straight way.
fn true_antenna(world: &NavigationWorld, time_s: f64) -> Vector2<f64> {
    let after = world
        .samples
        .partition_point(|sample| sample.time_s < time_s);
    let before = world.samples[after.saturating_sub(1)];
    let after = world.samples[after.min(world.samples.len() - 1)];
    let span = after.time_s - before.time_s;
    let share = if span > 0.0 {
        (time_s - before.time_s) / span
    } else {
        0.0
    };
    before.antenna.xy().lerp(&after.antenna.xy(), share)
}

fn look(
    state: &NavigationState<f64>,
    (position, covariance): &(Vector3<f64>, Matrix3<f64>),
    truth: &Vector2<f64>,
    sample: &WorldSample,
    baseline: &Baseline,
) -> WorldInstant {
    let error = position.xy() - truth;
    let covariance: Matrix2<f64> = covariance.fixed_view::<2, 2>(0, 0).into_owned();
    let turn = so3::log(&(state.ned_from_body * sample.ned_from_unit.inverse()));
    let off = |position: Option<Vector2<f64>>| position.map(|position| (position - truth).norm());
    WorldInstant {
        time_s: sample.time_s,
        error_m: error.norm(),
        stated_m: stated_95(&error, &covariance),
        heading_error_deg: turn.z.to_degrees(),
        heading_std_deg: state.covariance[(2, 2)].max(0.0).sqrt().to_degrees(),
        extrapolation_error_m: off(baseline.extrapolated(sample.stamp_ns as f64 * 1e-9)),
        hold_error_m: off(baseline.held()),
        status: String::new(),
        in_outage: false,
        can_be_known: true,
    }
}

/// How far the 95 % ellipse reaches in the direction of an error; 0 where the covariance is none.
fn stated_95(error: &Vector2<f64>, covariance: &Matrix2<f64>) -> f64 {
    let direction = error.try_normalize(1e-12).unwrap_or_else(Vector2::x);
    let squared = covariance
        .try_inverse()
        .map(|inverse| direction.dot(&(inverse * direction)));
    match squared {
        Some(squared) if squared > 0.0 && squared.is_finite() => (CHI_SQUARE_95 / squared).sqrt(),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ellipse_reaches_its_axes() {
        let covariance = Matrix2::new(4.0, 0.0, 0.0, 0.25);
        let root = CHI_SQUARE_95.sqrt();
        assert!((stated_95(&Vector2::new(3.0, 0.0), &covariance) - 2.0 * root).abs() < 1e-12);
        assert!((stated_95(&Vector2::new(0.0, -1.0), &covariance) - 0.5 * root).abs() < 1e-12);
        assert!(stated_95(&Vector2::new(1.0, 1.0), &Matrix2::zeros()).abs() < 1e-300);
    }
}
