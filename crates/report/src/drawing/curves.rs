//! Curves, bands and axes that plots over time share.

use northing_evaluation::attitude::{Trace, TracePoint};

use super::axis::{self, Axis};
use super::series::{BandPoint, Point};

/// Half width of every band, standard deviations.
const SIGMAS: f64 = 3.0;
/// No axis of a shown angle is narrower, deg: noise must not look like motion.
const LEAST_ANGLE_DEG: f64 = 4.0;

/// The time axis of a trace: from its first to its last entry, s.
pub(crate) fn time_axis(traces: &[&Trace]) -> Axis {
    let mut range: Option<(f64, f64)> = None;
    for trace in traces {
        let estimates = trace.points.items().iter().map(|p| p.time_s);
        let updates = trace.innovations.iter();
        let updates = updates.flat_map(|(_, i)| i.items().iter().map(|p| p.time_s));
        for time_s in estimates.chain(updates).filter(|t| t.is_finite()) {
            let (low, high) = range.unwrap_or((time_s, time_s));
            range = Some((low.min(time_s), high.max(time_s)));
        }
    }
    let (low, high) = range.unwrap_or((0.0, 1.0));
    Axis::time(low, high, 10)
}

/// A value of each point over time; what is missing lifts the pen.
pub(crate) fn curve(
    points: &[TracePoint],
    value: impl Fn(&TracePoint) -> Option<f64>,
) -> Vec<Point> {
    let at = |p: &TracePoint| [p.time_s, value(p).unwrap_or(f64::NAN)];
    points.iter().map(at).collect()
}

/// The band of three standard deviations around a centre.
pub(crate) fn band(
    points: &[TracePoint],
    centre_and_std: impl Fn(&TracePoint) -> Option<(f64, f64)>,
) -> Vec<BandPoint> {
    let at = |p: &TracePoint| match centre_and_std(p) {
        Some((centre, std)) => [p.time_s, centre - SIGMAS * std, centre + SIGMAS * std],
        None => [p.time_s, f64::NAN, f64::NAN],
    };
    points.iter().map(at).collect()
}

/// Whether any value of a curve can be drawn.
pub(crate) fn is_drawn(points: &[Point]) -> bool {
    points.iter().any(|p| p[0].is_finite() && p[1].is_finite())
}

/// The whole circle for angles that wrap or nearly fill it, else what the curves need.
pub(crate) fn angle_axis(curves: &[&[Point]]) -> Axis {
    let (low, high) = axis::extent(curves.iter().flat_map(|c| c.iter().map(|p| p[1])));
    if high - low > 220.0 {
        return Axis::degrees(-180.0, 180.0, 5);
    }
    let centre = 0.5 * (low + high);
    let half = (0.56 * (high - low)).max(0.5 * LEAST_ANGLE_DEG);
    Axis::degrees(centre - half, centre + half, 5)
}

/// How far an axis of errors reaches: all of the error unless its start towers over the rest, and
/// the bounds as far as they do not flatten the error. The remark tells what is off the axis.
pub(crate) fn error_limit(error: &[Point], bounds: &[BandPoint], unit: &str) -> (f64, String) {
    let Some(reach) = axis::reach(error.iter().map(|p| p[1])) else {
        return (1.0, String::new());
    };
    let half = axis::sorted(bounds.iter().map(|b| 0.5 * (b[2] - b[1])));
    let wanted = axis::quantile(&half, 0.98).min(4.0 * reach.limit);
    let limit = (1.08 * reach.limit.max(wanted)).max(1e-6);
    let note = match reach.beyond {
        Some(peak) if peak > limit => format!("peak {} {unit}, off the axis", short(peak)),
        _ => String::new(),
    };
    (limit, note)
}

/// A number with about three digits.
pub(crate) fn short(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 || v <= 0.0 => 2,
        v => ((-v.log10()).ceil() as usize + 2).min(9),
    };
    format!("{value:.decimals$}")
}
