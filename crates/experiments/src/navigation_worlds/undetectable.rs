//! Instants at which no estimator could state its error: drifts of the receiver, wrong fixes before there is a majority, and
//! correlated errors that nothing shows.

use northing_simulation::navigation_world::{FaultKind, NavigationWorld, WorldReceiver};

/// After the end of a drift a filter has so long to find back, s.
const RECOVERY_S: f64 = 20.0;
/// Good fixes that make a majority.
const MAJORITY: usize = 3;

/// A correlated error may be so many times what a receiver states or shows from fix to fix.
const INVISIBLE: f64 = 3.0;

/// Whether a receiver understates an error of which its fixes show nothing: their differences show the uncorrelated part alone.
fn is_invisible(receiver: &WorldReceiver) -> bool {
    let correlated = receiver.correlated_fraction;
    let shown = (1.0 - correlated * correlated).sqrt();
    correlated > INVISIBLE * shown.max(receiver.position_stated)
}

/// Times from and until which nobody can know, s.
pub(super) fn intervals(world: &NavigationWorld) -> Vec<[f64; 2]> {
    let receiver = &world.description.receiver;
    if is_invisible(receiver) {
        return vec![[0.0, f64::INFINITY]];
    }
    let drifts = receiver
        .faults
        .iter()
        .filter(|fault| fault.kind == FaultKind::Drift);
    let mut intervals: Vec<_> = drifts
        .map(|fault| [fault.from_s, fault.until_s + RECOVERY_S])
        .collect();
    let wrong = |kind| matches!(kind, Some(FaultKind::Outlier | FaultKind::Stale));
    let first = world.fixes.iter().take(MAJORITY);
    if first.clone().any(|fix| wrong(fix.fault)) {
        let good = world.fixes.iter().filter(|fix| !wrong(fix.fault));
        let majority = good.map(|fix| fix.stamp_ns as f64 * 1e-9).nth(MAJORITY - 1);
        intervals.push([0.0, majority.unwrap_or(f64::INFINITY)]);
    }
    intervals
}
