//! Plots of estimates over time: angles, errors against the reference, gyroscope bias.

use crate::drawing::axis::{self, Axis};
use crate::drawing::curves::{angle_axis, band, curve, error_limit, is_drawn, time_axis};
use crate::drawing::plot::{Figure, Key, Layer, Panel, Sign, key};
use crate::drawing::series::{BandPoint, Point};
use northing_evaluation::attitude::{Trace, TracePoint};

/// Heading, pitch and roll with their bands, the reference and the device's own; `None` without
/// estimates. The reference is turned by the offset of the heading, where that is arbitrary.
pub(crate) fn angles(trace: &Trace, heading_offset_deg: Option<f64>) -> Option<Figure> {
    let points = trace.points.items();
    let referenced = trace.against_reference(heading_offset_deg);
    if !is_drawn(&curve(points, |p| Some(p.angles_deg[0]))) {
        return None;
    }
    let panels = ["Heading", "Pitch", "Roll"];
    let panels = panels.into_iter().enumerate();
    Some(Figure::new(
        "Estimated heading, pitch and roll over time",
        time_axis(&[trace]),
        angle_keys(points, &referenced),
        panels
            .map(|(i, name)| angle_panel(points, &referenced, i, name))
            .collect(),
    ))
}

fn angle_keys(points: &[TracePoint], referenced: &[TracePoint]) -> Vec<Key> {
    let mut keys = vec![key(Sign::Line, "line estimate", "estimate")];
    if points.iter().any(|p| p.angles_std_deg.is_some()) {
        keys.push(key(
            Sign::Band,
            "band estimate-fill",
            "\u{00b1}3\u{03c3} of the estimate",
        ));
    }
    if referenced.iter().any(|p| p.reference_deg.is_some()) {
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
fn angle_panel(points: &[TracePoint], referenced: &[TracePoint], i: usize, name: &str) -> Panel {
    let estimate = curve(points, |p| Some(p.angles_deg[i]));
    let reference = curve(referenced, |p| p.reference_deg.map(|a| a[i]));
    let device = curve(points, |p| p.device_deg.map(|a| a[i]));
    let axis = angle_axis(&[&estimate, &reference, &device]);
    let bounds = band(points, |p| {
        p.angles_std_deg.map(|s| (p.angles_deg[i], s[i]))
    });
    let layers = vec![
        Layer::band(bounds, true),
        Layer::line(device, "ghost device", true),
        Layer::line(estimate, "estimate", true),
        Layer::line(reference, "thin dash reference", true),
    ];
    Panel::new(name, "deg", axis, layers)
}

/// Total, heading and inclination error, with what the filter predicted; `None` without reference. The offset of an
/// arbitrary heading is taken out, and no band is drawn that contains it.
pub(crate) fn errors(trace: &Trace, heading_offset_deg: Option<f64>) -> Option<Figure> {
    let points = &trace.against_reference(heading_offset_deg)[..];
    let error = |i: usize| curve(points, move |p| p.error_deg.map(|e| e[i]));
    if !is_drawn(&error(0)) {
        return None;
    }
    let predicted = |i: usize| {
        let drawn = i == 2 || heading_offset_deg.is_none();
        band(points, move |p| {
            p.error_std_deg.filter(|_| drawn).map(|s| (0.0, s[i]))
        })
    };
    let mut legend = vec![key(Sign::Line, "line estimate", "error")];
    if points.iter().any(|p| p.error_std_deg.is_some()) {
        legend.push(key(Sign::Band, "band estimate-fill", "predicted 3\u{03c3}"));
    }
    Some(Figure::new(
        "Error of the estimate against the reference over time",
        time_axis(&[trace]),
        legend,
        vec![
            error_panel("Total error", error(0), predicted(0), false),
            error_panel("Heading error", error(1), predicted(1), true),
            error_panel("Inclination error", error(2), predicted(2), false),
        ],
    ))
}

fn error_panel(name: &str, error: Vec<Point>, bounds: Vec<BandPoint>, signed: bool) -> Panel {
    let (limit, note) = error_limit(&error, &bounds, "deg");
    let axis = Axis::linear(if signed { -limit } else { 0.0 }, limit, 5);
    let layers = vec![
        Layer::band(bounds, false),
        Layer::line(error, "estimate thin", signed),
    ];
    Panel::new(name, "deg", axis, layers).note(note)
}

/// Gyroscope bias of each axis with its band; `None` for estimators without bias.
pub(crate) fn bias(trace: &Trace) -> Option<Figure> {
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
    Some(Figure::new(
        "Estimated gyroscope bias over time",
        time_axis(&[trace]),
        legend,
        panels.collect(),
    ))
}

/// The axis holds the curve and the bounds of the later nine tenths: the wide start may leave it.
fn bias_panel(name: &str, value: Vec<Point>, bounds: Vec<BandPoint>) -> Panel {
    let later = &bounds[bounds.len() / 10..];
    let ends = later.iter().flat_map(|b| [b[1], b[2]]);
    let shown = value.iter().map(|p| p[1]).chain(ends);
    let (low, high) = axis::extent(shown);
    let margin = (0.06 * (high - low)).max(1e-6);
    let layers = vec![
        Layer::band(bounds, false),
        Layer::line(value, "estimate", false),
    ];
    let axis = Axis::linear(low - margin, high + margin, 5);
    Panel::new(name, "deg/s", axis, layers).height(120.0)
}
