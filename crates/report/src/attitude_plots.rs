//! Plots of estimates over time: angles, errors against the reference, gyroscope bias.

use super::axis::{self, Axis};
use super::plot::{Figure, Key, LINE_POINTS, Layer, Panel, Sign, TIME, key};
use super::series::{BandPoint, Point};
use crate::trace::{Trace, TracePoint};

/// Room at the right of figures without names there.
const RIGHT: f64 = 14.0;
/// Half width of every band, standard deviations.
const SIGMAS: f64 = 3.0;
/// No axis of a shown angle is narrower, deg: noise must not look like motion.
const LEAST_ANGLE_DEG: f64 = 4.0;

/// The time axis of a trace: from its first to its last entry, s.
pub(super) fn time_axis(traces: &[&Trace]) -> Axis {
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
pub(super) fn curve(
    points: &[TracePoint],
    value: impl Fn(&TracePoint) -> Option<f64>,
) -> Vec<Point> {
    let at = |p: &TracePoint| [p.time_s, value(p).unwrap_or(f64::NAN)];
    points.iter().map(at).collect()
}

/// The band of three standard deviations around a centre.
pub(super) fn band(
    points: &[TracePoint],
    centre_and_std: impl Fn(&TracePoint) -> Option<(f64, f64)>,
) -> Vec<BandPoint> {
    let at = |p: &TracePoint| match centre_and_std(p) {
        Some((centre, std)) => [p.time_s, centre - SIGMAS * std, centre + SIGMAS * std],
        None => [p.time_s, f64::NAN, f64::NAN],
    };
    points.iter().map(at).collect()
}

pub(super) fn line(points: Vec<Point>, class: &str, angle: bool) -> Layer {
    Layer::Line {
        points,
        class: format!("line {class}"),
        angle,
    }
}

pub(super) fn band_layer(points: Vec<BandPoint>, angle: bool) -> Layer {
    Layer::Band {
        points,
        class: "band estimate-fill".to_owned(),
        angle,
    }
}

/// Whether any value of a curve can be drawn.
pub(super) fn is_drawn(points: &[Point]) -> bool {
    points.iter().any(|p| p[0].is_finite() && p[1].is_finite())
}

/// Heading, pitch and roll with their bands, the reference and the device's own; `None` without
/// estimates.
pub(super) fn angles(trace: &Trace) -> Option<Figure> {
    let points = trace.points.items();
    if !is_drawn(&curve(points, |p| Some(p.angles_deg[0]))) {
        return None;
    }
    let panels = ["Heading", "Pitch", "Roll"];
    let panels = panels.into_iter().enumerate();
    Some(Figure {
        label: "Estimated heading, pitch and roll over time".to_owned(),
        time: time_axis(&[trace]),
        legend: angle_keys(points),
        panels: panels
            .map(|(i, name)| angle_panel(points, i, name))
            .collect(),
        right: RIGHT,
        line_points: LINE_POINTS,
        across: TIME,
    })
}

fn angle_keys(points: &[TracePoint]) -> Vec<Key> {
    let mut keys = vec![key(Sign::Line, "line estimate", "estimate")];
    if points.iter().any(|p| p.angles_std_deg.is_some()) {
        keys.push(key(
            Sign::Band,
            "band estimate-fill",
            "\u{00b1}3\u{03c3} of the estimate",
        ));
    }
    if points.iter().any(|p| p.reference_deg.is_some()) {
        keys.push(key(Sign::Line, "line dash reference", "reference"));
    }
    if points.iter().any(|p| p.device_deg.is_some()) {
        keys.push(key(
            Sign::Line,
            "line ghost device",
            "the device\u{2019}s own",
        ));
    }
    keys
}

/// One angle: band, the device's own, the estimate, and the dashed reference on top.
fn angle_panel(points: &[TracePoint], i: usize, name: &str) -> Panel {
    let estimate = curve(points, |p| Some(p.angles_deg[i]));
    let reference = curve(points, |p| p.reference_deg.map(|a| a[i]));
    let device = curve(points, |p| p.device_deg.map(|a| a[i]));
    let axis = angle_axis(&[&estimate, &reference, &device]);
    let bounds = band(points, |p| {
        p.angles_std_deg.map(|s| (p.angles_deg[i], s[i]))
    });
    let layers = vec![
        band_layer(bounds, true),
        line(device, "ghost device", true),
        line(estimate, "estimate", true),
        line(reference, "thin dash reference", true),
    ];
    Panel::new(name, "deg", axis, layers)
}

/// The whole circle for angles that wrap or nearly fill it, else what the curves need.
pub(super) fn angle_axis(curves: &[&[Point]]) -> Axis {
    let values = || {
        let all = curves.iter().flat_map(|c| c.iter().map(|p| p[1]));
        all.filter(|v| v.is_finite())
    };
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    if high - low > 220.0 {
        return Axis::degrees(-180.0, 180.0, 5);
    }
    let centre = 0.5 * (low + high);
    let half = (0.56 * (high - low)).max(0.5 * LEAST_ANGLE_DEG);
    Axis::degrees(centre - half, centre + half, 5)
}

/// Total, heading and inclination error, with what the filter predicted; `None` without reference.
pub(super) fn errors(trace: &Trace) -> Option<Figure> {
    let points = trace.points.items();
    let error = |i: usize| curve(points, move |p| p.error_deg.map(|e| e[i]));
    if !is_drawn(&error(0)) {
        return None;
    }
    let total = band(points, |p| p.error_std_deg.map(|s| (0.0, s[0])));
    let heading = band(points, |p| p.error_std_deg.map(|s| (0.0, s[1])));
    let mut legend = vec![key(Sign::Line, "line estimate", "error")];
    if points.iter().any(|p| p.error_std_deg.is_some()) {
        legend.push(key(Sign::Band, "band estimate-fill", "predicted 3\u{03c3}"));
    }
    Some(Figure {
        label: "Error of the estimate against the reference over time".to_owned(),
        time: time_axis(&[trace]),
        legend,
        panels: vec![
            error_panel("Total error", error(0), total, false),
            error_panel("Heading error", error(1), heading, true),
            error_panel("Inclination error", error(2), Vec::new(), false),
        ],
        right: RIGHT,
        line_points: LINE_POINTS,
        across: TIME,
    })
}

fn error_panel(name: &str, error: Vec<Point>, bounds: Vec<BandPoint>, signed: bool) -> Panel {
    let (limit, note) = error_limit(&error, &bounds, "deg");
    let axis = Axis::linear(if signed { -limit } else { 0.0 }, limit, 5);
    let layers = vec![
        band_layer(bounds, false),
        line(error, "estimate thin", signed),
    ];
    let mut panel = Panel::new(name, "deg", axis, layers);
    panel.note = note;
    panel
}

/// How far an axis of errors reaches: all of the error unless its start towers over the rest, and
/// the bounds as far as they do not flatten the error. The remark tells what is off the axis.
pub(super) fn error_limit(error: &[Point], bounds: &[BandPoint], unit: &str) -> (f64, String) {
    let Some(reach) = axis::reach(error.iter().map(|p| p[1])) else {
        return (1.0, String::new());
    };
    let mut half: Vec<f64> = bounds.iter().map(|b| 0.5 * (b[2] - b[1])).collect();
    half.retain(|h| h.is_finite());
    half.sort_by(f64::total_cmp);
    let wanted = axis::quantile(&half, 0.98).min(4.0 * reach.limit);
    let limit = (1.08 * reach.limit.max(wanted)).max(1e-6);
    let note = match reach.beyond {
        Some(peak) if peak > limit => format!("peak {} {unit}, off the axis", short(peak)),
        _ => String::new(),
    };
    (limit, note)
}

/// A number with about three digits.
pub(super) fn short(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 || v <= 0.0 => 2,
        v => ((-v.log10()).ceil() as usize + 2).min(9),
    };
    format!("{value:.decimals$}")
}

/// Gyroscope bias of each axis with its band; `None` for estimators without bias.
pub(super) fn bias(trace: &Trace) -> Option<Figure> {
    let points = trace.points.items();
    let value = |i: usize| curve(points, move |p| p.bias_deg_s.map(|b| b[i]));
    if !is_drawn(&value(0)) {
        return None;
    }
    let panels = ["x", "y", "z"].into_iter().enumerate().map(|(i, name)| {
        let std = |p: &TracePoint| Some((p.bias_deg_s?[i], p.bias_std_deg_s?[i]));
        bias_panel(&format!("Bias {name}"), value(i), band(points, std))
    });
    let mut legend = vec![key(Sign::Line, "line estimate", "gyroscope bias")];
    if points.iter().any(|p| p.bias_std_deg_s.is_some()) {
        legend.push(key(Sign::Band, "band estimate-fill", "\u{00b1}3\u{03c3}"));
    }
    Some(Figure {
        label: "Estimated gyroscope bias over time".to_owned(),
        time: time_axis(&[trace]),
        legend,
        panels: panels.collect(),
        right: RIGHT,
        line_points: LINE_POINTS,
        across: TIME,
    })
}

/// The axis holds the curve and the bounds of the later nine tenths: the wide start may leave it.
fn bias_panel(name: &str, value: Vec<Point>, bounds: Vec<BandPoint>) -> Panel {
    let later = &bounds[bounds.len() / 10..];
    let ends = later.iter().flat_map(|b| [b[1], b[2]]);
    let shown = value.iter().map(|p| p[1]).chain(ends);
    let shown: Vec<f64> = shown.filter(|v| v.is_finite()).collect();
    let low = shown.iter().copied().fold(f64::INFINITY, f64::min);
    let high = shown.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let margin = (0.06 * (high - low)).max(1e-6);
    let layers = vec![band_layer(bounds, false), line(value, "estimate", false)];
    let axis = Axis::linear(low - margin, high + margin, 5);
    let mut panel = Panel::new(name, "deg/s", axis, layers);
    panel.height = 120.0;
    panel
}
