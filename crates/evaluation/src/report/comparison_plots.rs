//! Plots of a comparison: errors and headings over time in one picture, and dots by recording.

use super::attitude_plots::{angle_axis, curve, is_drawn, line, short, time_axis};
use super::axis::{self, Axis};
use super::comparison::{ComparedRun, Distribution};
use super::plot::{Figure, Panel, Sign, WIDTH, key};
use super::series::{self, Point};
use super::style::SERIES;
use super::svg::Svg;
use crate::trace::{Trace, TracePoint};

/// Room at the right for names of lines.
const RIGHT: f64 = 150.0;
/// Windows over which errors are averaged.
const WINDOWS: usize = 160;
/// Smallest error shown, deg.
const LEAST_ERROR_DEG: f64 = 0.02;

/// Class of the n-th line: a colour, dashed once the colours are used up.
fn class(i: usize) -> String {
    let dash = if i < SERIES { "" } else { " dash" };
    format!("s{}{dash}", i % SERIES)
}

fn time_of(runs: &[ComparedRun<'_>]) -> Axis {
    time_axis(&runs.iter().map(|r| r.trace).collect::<Vec<&Trace>>())
}

/// Total, heading and inclination error of each run; `None` without reference.
pub(super) fn errors(runs: &[ComparedRun<'_>]) -> Option<Figure> {
    let panels: Vec<Panel> = ["Total error", "Heading error", "Inclination error"]
        .into_iter()
        .enumerate()
        .filter_map(|(component, name)| error_panel(runs, component, name))
        .collect();
    (!panels.is_empty()).then(|| Figure {
        label: "Errors of each estimator over time".to_owned(),
        time: time_of(runs),
        legend: Vec::new(),
        panels,
        right: RIGHT,
    })
}

fn error_panel(runs: &[ComparedRun<'_>], component: usize, name: &str) -> Option<Panel> {
    let curves: Vec<Vec<Point>> = runs
        .iter()
        .map(|r| {
            let error = |p: &TracePoint| p.error_deg.map(|e| e[component]);
            series::windowed_rms(&curve(r.trace.points.items(), error), WINDOWS)
        })
        .collect();
    let mut sorted: Vec<f64> = curves.iter().flatten().map(|p| p[1]).collect();
    sorted.sort_by(f64::total_cmp);
    let high = *sorted.last()?;
    let low = (axis::quantile(&sorted, 0.02) * 0.7).max(LEAST_ERROR_DEG);
    let axis = Axis::logarithmic(low, (high * 1.3).max(low * 10.0));
    let mut tags = Vec::new();
    let mut layers = Vec::new();
    for (i, (run, curve)) in runs.iter().zip(curves).enumerate() {
        if let Some(last) = curve.last() {
            tags.push((last[1], format!("s{}-fill", i % SERIES), run.name.to_owned()));
        }
        layers.push(line(curve, &class(i), false));
    }
    let mut panel = Panel::new(name, "deg, logarithmic", axis, layers);
    panel.height = 200.0;
    panel.tags = tags;
    Some(panel)
}

/// Heading of each run over the reference; `None` without estimates.
pub(super) fn headings(runs: &[ComparedRun<'_>]) -> Option<Figure> {
    let curves: Vec<Vec<Point>> = runs
        .iter()
        .map(|r| curve(r.trace.points.items(), |p| Some(p.angles_deg[0])))
        .collect();
    let reference = runs.iter().map(|r| {
        curve(r.trace.points.items(), |p| p.reference_deg.map(|a| a[0]))
    });
    let reference = reference.into_iter().find(|c| is_drawn(c));
    if !curves.iter().any(|c| is_drawn(c)) {
        return None;
    }
    let mut shown: Vec<&[Point]> = curves.iter().map(Vec::as_slice).collect();
    shown.extend(reference.as_deref());
    let axis = angle_axis(&shown);
    let mut legend = Vec::new();
    let mut layers = Vec::new();
    for (i, (run, curve)) in runs.iter().zip(curves).enumerate() {
        legend.push(key(Sign::Line, &format!("line bold {}", class(i)), run.name));
        layers.push(line(curve, &class(i), true));
    }
    if let Some(reference) = reference {
        legend.push(key(Sign::Line, "line dash reference", "reference"));
        layers.push(line(reference, "thin dash reference", true));
    }
    let mut panel = Panel::new("Heading", "deg", axis, layers);
    panel.height = 260.0;
    Some(Figure {
        label: "Heading of each estimator over time".to_owned(),
        time: time_of(runs),
        legend,
        panels: vec![panel],
        right: 14.0,
    })
}

/// One row of dots for each estimator, with a bar at the median; `None` without errors.
pub(super) fn distribution(all: &[Distribution]) -> Option<String> {
    const LEFT: f64 = 176.0;
    const ROW: f64 = 46.0;
    let sorted = |d: &Distribution| {
        let mut errors = d.errors_deg.clone();
        errors.retain(|e| e.is_finite() && *e >= 0.0);
        errors.sort_by(f64::total_cmp);
        errors
    };
    let rows: Vec<(&str, Vec<f64>)> = all
        .iter()
        .map(|d| (d.name.as_str(), sorted(d)))
        .filter(|(_, errors)| !errors.is_empty())
        .collect();
    let errors = || rows.iter().flat_map(|(_, e)| e.iter().copied());
    let low = errors().fold(f64::INFINITY, f64::min).max(LEAST_ERROR_DEG);
    let high = errors().fold(f64::NEG_INFINITY, f64::max);
    if rows.is_empty() {
        return None;
    }
    let axis = Axis::logarithmic(0.8 * low, 1.25 * high);
    let width = WIDTH - LEFT - 130.0;
    let height = ROW * rows.len() as f64;
    let x = |v: f64| axis.position(v).clamp(0.0, 1.0) * width;
    let mut svg = Svg::picture(WIDTH, height + 60.0, "Errors of each estimator, by recording");
    svg.open_window(LEFT, 6.0, width, height);
    svg.rectangle([0.0, 0.0], [width, height], 0.0, "frame");
    for v in fine_ticks(&axis) {
        svg.lines(&[vec![[x(v), 0.0], [x(v), height]]], "grid");
    }
    for (i, (_, errors)) in rows.iter().enumerate() {
        let y = (i as f64 + 0.5) * ROW;
        let dots: Vec<Point> = errors
            .iter()
            .enumerate()
            // Neighbours take turns above and below, so that they can be counted.
            .map(|(k, e)| [x(*e), y + [0.0, -8.0, 8.0, -4.0, 4.0][k % 5]])
            .collect();
        svg.dots(&dots, &format!("dots big soft s{}", i % SERIES));
        let median = x(axis::quantile(errors, 0.5));
        svg.lines(&[vec![[median, y - 16.0], [median, y + 16.0]]], "line bold mean");
    }
    svg.close();
    for (i, (name, errors)) in rows.iter().enumerate() {
        let y = 6.0 + (i as f64 + 0.5) * ROW + 5.0;
        svg.text([LEFT - 12.0, y], &format!("tag end s{}-fill", i % SERIES), name);
        let median = format!("median {}", short(axis::quantile(errors, 0.5)));
        svg.text([LEFT + width + 10.0, y], "note", &median);
    }
    for v in fine_ticks(&axis) {
        svg.text([LEFT + x(v), height + 26.0], "tick mid", &format!("{v}"));
    }
    svg.text([LEFT + width / 2.0, height + 50.0], "unit mid", "error, deg (logarithmic)");
    svg.close();
    Some(svg.finish())
}

/// 1, 2 and 5 times each power of ten on an axis.
fn fine_ticks(axis: &Axis) -> Vec<f64> {
    let decades = (-2..4).map(|e| 10_f64.powi(e));
    let steps = decades.flat_map(|d| [d, 2.0 * d, 5.0 * d].map(|v| (v * 1e3).round() / 1e3));
    steps.filter(|v| axis.contains(*v)).collect()
}
