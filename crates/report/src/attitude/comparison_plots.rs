//! Plots of a comparison: errors and headings over time in one picture, and dots by recording.

use crate::attitude::comparison::{ComparedRun, Distribution};
use crate::drawing::axis::{self, Axis};
use crate::drawing::curves::{angle_axis, curve, is_drawn, short, time_axis};
use crate::drawing::plot::{Figure, Layer, Panel, Sign, key};
use crate::drawing::rows::{Row, Rows};
use crate::drawing::series::{self, Point};
use crate::drawing::style::{SERIES, places, series_class};
use northing_evaluation::attitude::{Trace, TracePoint};
use northing_evaluation::statistics::median;

/// Room at the right for names of lines.
const RIGHT: f64 = 150.0;
/// Windows over which errors are averaged.
const WINDOWS: usize = 100;
/// Axes that reach less far than this factor have ticks between powers of ten.
const FINE_TICKS: f64 = 500.0;
/// Smallest error shown, deg.
const LEAST_ERROR_DEG: f64 = 0.02;

fn time_of(runs: &[ComparedRun<'_>]) -> Axis {
    time_axis(&runs.iter().map(|r| r.trace).collect::<Vec<&Trace>>())
}

/// Total, heading and inclination error of each run; `None` without reference.
pub(crate) fn errors(runs: &[ComparedRun<'_>]) -> Option<Figure> {
    let panels: Vec<Panel> = ["Total error", "Heading error", "Inclination error"]
        .into_iter()
        .enumerate()
        .filter_map(|(component, name)| error_panel(runs, component, name))
        .collect();
    (!panels.is_empty()).then(|| {
        Figure::new(
            "Errors of each estimator over time",
            time_of(runs),
            Vec::new(),
            panels,
        )
        .right(RIGHT)
    })
}

/// The place among the colours of each run.
fn places_of(runs: &[ComparedRun<'_>]) -> Vec<usize> {
    places(&runs.iter().map(|run| run.name).collect::<Vec<_>>())
}

fn error_panel(runs: &[ComparedRun<'_>], component: usize, name: &str) -> Option<Panel> {
    let curves: Vec<Vec<Point>> = runs
        .iter()
        .map(|r| {
            let error = |p: &TracePoint| p.error_deg.map(|e| e[component]);
            let points = r.trace.against_reference(r.heading_offset_deg);
            series::windowed_rms(&curve(&points, error), WINDOWS)
        })
        .collect();
    let sorted = axis::sorted(curves.iter().flatten().map(|p| p[1]));
    let high = *sorted.last()?;
    let low = (axis::quantile(&sorted, 0.02) * 0.7).max(LEAST_ERROR_DEG);
    let mut axis = Axis::logarithmic(low, (high * 1.3).max(low * 10.0));
    if high < FINE_TICKS * low {
        axis = axis.with_fine_ticks();
    }
    let mut tags = Vec::new();
    let mut layers = Vec::new();
    for (i, (run, curve)) in places_of(runs).into_iter().zip(runs.iter().zip(curves)) {
        if let Some(last) = curve.last() {
            tags.push((
                last[1],
                format!("s{}-fill", i % SERIES),
                run.name.to_owned(),
            ));
        }
        layers.push(Layer::line(curve, &series_class(i), false));
    }
    let panel = Panel::new(name, "deg, logarithmic", axis, layers)
        .height(200.0)
        .tags(tags);
    Some(panel)
}

/// Heading of each run over the reference; `None` without estimates.
pub(crate) fn headings(runs: &[ComparedRun<'_>]) -> Option<Figure> {
    let curves: Vec<Vec<Point>> = runs
        .iter()
        .map(|r| curve(r.trace.points.items(), |p| Some(p.angles_deg[0])))
        .collect();
    let reference = runs.iter().map(|r| {
        curve(&r.trace.against_reference(None), |p| {
            p.reference_deg.map(|a| a[0])
        })
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
    for (i, (run, curve)) in places_of(runs).into_iter().zip(runs.iter().zip(curves)) {
        legend.push(key(
            Sign::Line,
            &format!("line bold {}", series_class(i)),
            run.name,
        ));
        layers.push(Layer::line(curve, &series_class(i), true));
    }
    if let Some(reference) = reference {
        legend.push(key(Sign::Line, "line dash reference", "reference"));
        layers.push(Layer::line(reference, "thin dash reference", true));
    }
    let panel = Panel::new("Heading", "deg", axis, layers).height(260.0);
    Some(Figure::new(
        "Heading of each estimator over time",
        time_of(runs),
        legend,
        vec![panel],
    ))
}

/// Room at the left for names of estimators, and at the right for their medians.
const MARGINS: [f64; 2] = [176.0, 130.0];
/// Height of a row of dots.
const ROW: f64 = 46.0;

/// One row of dots for each estimator, with a bar at the median; `None` without errors. Estimators
/// that are also among the runs have the colour they have there.
pub(crate) fn distribution(all: &[Distribution], runs: &[ComparedRun<'_>]) -> Option<String> {
    let mut names: Vec<&str> = runs.iter().map(|r| r.name).collect();
    for one in all {
        if !names.contains(&one.name.as_str()) {
            names.push(&one.name);
        }
    }
    let colours = places(&names);
    let mut rows = Vec::new();
    for one in all {
        let place = names.iter().position(|n| *n == one.name);
        let colour = place.map_or(0, |place| colours[place]);
        let errors = one.errors_deg.iter().copied().filter(|e| *e >= 0.0);
        let errors = axis::sorted(errors);
        if !errors.is_empty() {
            rows.push(Row {
                name: one.name.as_str(),
                class: format!("tag end s{}-fill", colour % SERIES),
                note: format!("median {}", short(median(&errors).unwrap_or(f64::NAN))),
                marks: (colour, errors),
            });
        }
    }
    let ends = || rows.iter().map(|row| &row.marks.1);
    let ends = || ends().flat_map(|errors| [errors[0], errors[errors.len() - 1]]);
    let low = ends().min_by(f64::total_cmp)?.max(LEAST_ERROR_DEG);
    let high = ends().max_by(f64::total_cmp)?;
    let axis = Axis::logarithmic(0.8 * low, 1.25 * high);
    let fine = high < FINE_TICKS * low;
    let rows = Rows {
        label: "Errors of each estimator, by recording",
        unit: "error, deg (logarithmic)",
        axis: if fine { axis.with_fine_ticks() } else { axis },
        margins: MARGINS,
        height: ROW,
        rules: &[],
        legend: Vec::new(),
        rows,
    };
    Some(rows.render(|svg, x, top, (colour, errors)| {
        let y = top + 0.5 * ROW;
        // Neighbours take turns above and below, so that they can be counted.
        let lift = |k: usize| [0.0, -8.0, 8.0, -4.0, 4.0][k % 5];
        let dots = errors.iter().enumerate();
        let dots: Vec<Point> = dots.map(|(k, e)| [x(*e), y + lift(k)]).collect();
        svg.dots(&dots, &format!("dots big soft s{}", colour % SERIES));
        let x = x(median(errors).unwrap_or(f64::NAN));
        svg.lines(&[vec![[x, y - 16.0], [x, y + 16.0]]], "line bold mean");
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, errors_deg: &[f64]) -> Distribution {
        Distribution {
            name: name.to_owned(),
            errors_deg: errors_deg.to_vec(),
        }
    }

    #[test]
    fn estimator_keeps_its_colour_from_plot_to_plot() {
        let trace = Trace::new(10);
        let runs = ["mekf", "device"].map(|name| ComparedRun {
            name,
            trace: &trace,
            heading_offset_deg: None,
        });
        let all = [of("device", &[1.0, 2.0]), of("usque", &[3.0])];
        let svg = distribution(&all, &runs).unwrap_or_default();
        assert!(
            svg.contains("s6-fill\" x=\"164\" y=\"34\">device<"),
            "{svg}"
        );
        assert!(svg.contains("s4-fill\" x=\"164\" y=\"80\">usque<"), "{svg}");
        assert!(svg.contains("median 1.50") && svg.contains("median 3.00"));
    }

    #[test]
    fn there_are_no_dots_without_errors() {
        assert_eq!(distribution(&[of("device", &[f64::NAN])], &[]), None);
    }
}
