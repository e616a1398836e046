//! The picture for a README: what a filter with a covariance gives that integration does not.

use crate::drawing::axis::{self, Axis};
use crate::drawing::curves::{angle_axis, band, curve, short, time_axis};
use crate::drawing::plot::{Figure, Layer, Panel, Sign, WIDTH, key};
use crate::drawing::style;
use crate::drawing::svg::Svg;
use northing_evaluation::attitude::{Trace, TracePoint};

/// What the picture shows.
#[derive(Debug, Clone, Copy)]
pub struct HeroPicture<'a> {
    /// Heading above the picture.
    pub title: &'a str,
    /// One line below it.
    pub subtitle: &'a str,
    /// Name and trace of the filter whose band is drawn.
    pub filter: (&'a str, &'a Trace),
    /// Name and trace of what it is compared with, usually gyroscope integration.
    pub drifting: (&'a str, &'a Trace),
    /// One more estimator, e.g. the device's own.
    pub other: Option<(&'a str, &'a Trace)>,
}

/// Height of the title above the plots.
const HEAD: f64 = 84.0;
/// Longest name that fits at the right of a line, characters.
const LONGEST_TAG: usize = 15;
/// Points drawn of a line: the picture should stay small.
const DETAIL: usize = 900;
/// Room at the right for names of lines.
const RIGHT: f64 = 160.0;

/// A standalone SVG, 960 wide: heading with the filter's 3 sigma band and the dashed reference,
/// gyroscope integration drifting away, the errors below. It brings its own light background, so
/// that it reads on light and dark pages alike.
#[must_use]
pub fn hero_svg(picture: &HeroPicture<'_>) -> String {
    let figure = figure(picture);
    // Drawn first to learn the height, which stands in the opening tag.
    let mut plots = Svg::default();
    let bottom = figure.draw_panels(&mut plots, HEAD + 36.0);
    let size = [WIDTH, bottom + 6.0];
    let mut svg = Svg::picture(size[0], size[1], &figure.label);
    svg.raw("<style>\n");
    svg.raw(&style::standalone_css());
    svg.raw(".card{fill:#fff;stroke:#d5dbe1}.head{font-size:25px;font-weight:700;letter-spacing:-.3px}.sub{font-size:16px}\n</style>\n");
    svg.rectangle([0.5, 0.5], [size[0] - 1.0, size[1] - 1.0], 14.0, "card");
    svg.text([28.0, 44.0], "name head", picture.title);
    svg.text([28.0, 70.0], "unit sub", picture.subtitle);
    figure.draw_legend(&mut svg, HEAD);
    svg.raw(&plots.finish());
    svg.close();
    svg.finish()
}

fn figure(picture: &HeroPicture<'_>) -> Figure {
    let (name, filter) = picture.filter;
    let mut legend = vec![
        key(Sign::Line, "line bold estimate", name),
        key(Sign::Band, "band estimate-fill", "its \u{00b1}3\u{03c3}"),
        key(Sign::Line, "line dash reference", "reference"),
        key(Sign::Line, "line bold gated", picture.drifting.0),
    ];
    if let Some((name, _)) = picture.other {
        legend.push(key(Sign::Line, "line ghost device", name));
    }
    let figure = Figure::new(
        format!("{}. {}", picture.title, picture.subtitle),
        time_axis(&[filter, picture.drifting.1]),
        legend,
        vec![heading_panel(picture), error_panel(picture)],
    );
    Figure {
        line_points: DETAIL,
        ..figure.right(RIGHT)
    }
}

fn heading_panel(picture: &HeroPicture<'_>) -> Panel {
    let heading = |t: &Trace| curve(t.points.items(), |p| Some(p.angles_deg[0]));
    let points = picture.filter.1.points.items();
    let reference = curve(&picture.filter.1.against_reference(None), |p| {
        p.reference_deg.map(|a| a[0])
    });
    let estimate = heading(picture.filter.1);
    let drifting = heading(picture.drifting.1);
    let bounds = band(points, |p| Some((p.angles_deg[0], p.angles_std_deg?[0])));
    let axis = angle_axis(&[&estimate, &reference, &drifting]);
    let mut layers = vec![Layer::band(bounds, true)];
    if let Some((_, other)) = picture.other {
        layers.push(Layer::line(heading(other), "ghost device", true));
    }
    layers.extend([
        Layer::line(drifting, "gated", true),
        Layer::line(estimate, "estimate bold", true),
        Layer::line(reference, "thin dash reference", true),
    ]);
    let tags = [picture.filter, picture.drifting]
        .into_iter()
        .zip(["estimate-fill", "gated-fill"])
        .filter(|((name, _), _)| name.chars().count() <= LONGEST_TAG)
        .filter_map(|((name, trace), class)| {
            let end = trace.points.items().last()?.angles_deg[0];
            end.is_finite()
                .then(|| (end, class.to_owned(), name.to_owned()))
        })
        .collect();
    Panel::new("Heading", "deg", axis, layers)
        .height(190.0)
        .tags(tags)
}

/// Errors, on an axis that shows the filter's error and bound well; what drifts leaves it.
fn error_panel(picture: &HeroPicture<'_>) -> Panel {
    let error = |t: &Trace| curve(t.points.items(), |p| p.error_deg.map(|e| e[0]));
    let points = picture.filter.1.points.items();
    let own = error(picture.filter.1);
    let bounds = band(points, |p| Some((0.0, p.error_std_deg?[0])));
    let upper = axis::sorted(bounds.iter().map(|b| b[2]));
    let shown = axis::reach(own.iter().map(|p| p[1])).map_or(1.0, |r| r.limit);
    let limit = 1.35 * shown.max(axis::quantile(&upper, 0.9)).max(1e-3);
    let mut layers: Vec<Layer> = vec![Layer::band(bounds, false)];
    if let Some((_, other)) = picture.other {
        layers.push(Layer::line(error(other), "ghost device", false));
    }
    layers.push(Layer::line(error(picture.drifting.1), "gated", false));
    layers.push(Layer::line(own, "estimate", false));
    let tags = [picture.filter, picture.drifting]
        .into_iter()
        .zip(["estimate-fill", "gated-fill"])
        .filter_map(|((_, trace), class)| {
            let (last, text) = end_error(trace)?;
            Some((last.min(limit), class.to_owned(), text))
        })
        .collect();
    let axis = Axis::linear(0.0, limit, 4);
    Panel::new("Error", "deg", axis, layers).tags(tags)
}

/// Error at the end (mean of the last twentieth), and the words for it.
fn end_error(trace: &Trace) -> Option<(f64, String)> {
    let points: &[TracePoint] = trace.points.items();
    let errors: Vec<f64> = points
        .iter()
        .filter_map(|p| Some(p.error_deg?[0]))
        .collect();
    let last = &errors[errors.len() - errors.len().div_ceil(20)..];
    let mean = last.iter().sum::<f64>() / last.len() as f64;
    mean.is_finite()
        .then(|| (mean, format!("{}° at end", short(mean))))
}
