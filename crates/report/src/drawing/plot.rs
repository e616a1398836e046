//! Figures: panels stacked over one time axis, each with its bands, lines and dots.

use crate::drawing::axis::Axis;
use crate::drawing::series::{self, BandPoint, Point};
use crate::drawing::svg::Svg;

/// Width of every figure in its own units; the page scales it.
pub(crate) const WIDTH: f64 = 960.0;
/// What most horizontal axes show.
pub(crate) const TIME: &str = "time, s";
/// Points drawn at most of one line.
pub(crate) const LINE_POINTS: usize = 2400;
/// Points drawn at most of one band.
const BAND_POINTS: usize = 1000;
/// Dots drawn at most of one class.
pub(crate) const DOTS: usize = 4000;
const LEFT: f64 = 58.0;
const TITLE: f64 = 30.0;
const GAP: f64 = 16.0;
const FOOT: f64 = 48.0;
const LEGEND_ROW: f64 = 28.0;

/// Something drawn in a panel. Classes are those of the style sheet.
#[derive(Debug, Clone)]
pub(crate) enum Layer {
    /// A translucent area between two curves.
    Band {
        points: Vec<BandPoint>,
        class: String,
        angle: bool,
    },
    /// A curve; as an angle it is cut where it wraps.
    Line {
        points: Vec<Point>,
        class: String,
        angle: bool,
    },
    /// A cloud of dots.
    Dots { points: Vec<Point>, class: String },
    /// Bars from the bottom of the panel: time from, time to, height.
    Bars { bars: Vec<[f64; 3]>, class: String },
    /// A horizontal line at a value, named at its right end.
    Rule {
        value: f64,
        label: String,
        class: &'static str,
    },
}

/// One plot of a figure.
#[derive(Debug, Clone)]
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) unit: String,
    pub(crate) axis: Axis,
    pub(crate) height: f64,
    pub(crate) layers: Vec<Layer>,
    /// A remark at the right of the title.
    pub(crate) note: String,
    /// Names written at the right ends of lines: value there, class of the colour, name.
    pub(crate) tags: Vec<(f64, String, String)>,
}

/// How a legend shows what it names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sign {
    Line,
    Band,
    Dot,
    Bar,
}

/// One entry of a legend: sign, class, name.
pub(crate) type Key = (Sign, String, String);

/// Panels over one time axis.
#[derive(Debug, Clone)]
pub(crate) struct Figure {
    /// Description for those who cannot see it.
    pub(crate) label: String,
    /// Horizontal axis; mostly time, s.
    pub(crate) time: Axis,
    pub(crate) legend: Vec<Key>,
    pub(crate) panels: Vec<Panel>,
    /// Room at the right for names.
    pub(crate) right: f64,
    /// Points drawn at most of one line.
    pub(crate) line_points: usize,
    /// What stands below the horizontal axis, with its unit.
    pub(crate) across: &'static str,
}

/// A key of a legend.
pub(crate) fn key(sign: Sign, class: &str, name: &str) -> Key {
    (sign, class.to_owned(), name.to_owned())
}

/// The key of a [`Layer::line`].
pub(crate) fn line_key(class: &str, name: &str) -> Key {
    key(Sign::Line, &format!("line {class}"), name)
}

impl Panel {
    pub(crate) fn new(title: &str, unit: &str, axis: Axis, layers: Vec<Layer>) -> Self {
        Self {
            title: title.to_owned(),
            unit: unit.to_owned(),
            axis,
            height: 150.0,
            layers,
            note: String::new(),
            tags: Vec::new(),
        }
    }

    pub(crate) fn height(self, height: f64) -> Self {
        Self { height, ..self }
    }

    pub(crate) fn note(self, note: String) -> Self {
        Self { note, ..self }
    }

    pub(crate) fn tags(self, tags: Vec<(f64, String, String)>) -> Self {
        Self { tags, ..self }
    }

    fn y(&self, value: f64) -> f64 {
        // Far outside is as good as just outside, and keeps the numbers short.
        (1.0 - self.axis.position(value).clamp(-3.0, 4.0)) * self.height
    }
}

impl Layer {
    pub(crate) fn line(points: Vec<Point>, class: &str, angle: bool) -> Self {
        let class = format!("line {class}");
        Self::Line {
            points,
            class,
            angle,
        }
    }

    /// The band of an estimate.
    pub(crate) fn band(points: Vec<BandPoint>, angle: bool) -> Self {
        let class = "band estimate-fill".to_owned();
        Self::Band {
            points,
            class,
            angle,
        }
    }

    pub(crate) fn dots(points: Vec<Point>, class: &str) -> Self {
        let class = format!("dots {class}");
        Self::Dots { points, class }
    }

    pub(crate) fn rule(value: f64, label: impl Into<String>) -> Self {
        let (label, class) = (label.into(), "rule");
        Self::Rule {
            value,
            label,
            class,
        }
    }
}

impl Figure {
    /// Panels over time, as wide as the page.
    pub(crate) fn new(
        label: impl Into<String>,
        time: Axis,
        legend: Vec<Key>,
        panels: Vec<Panel>,
    ) -> Self {
        Self {
            label: label.into(),
            time,
            legend,
            panels,
            right: 14.0,
            line_points: LINE_POINTS,
            across: TIME,
        }
    }

    /// The same with room for names on the right.
    pub(crate) fn right(self, right: f64) -> Self {
        Self { right, ..self }
    }

    /// The same over something else than time.
    pub(crate) fn across(self, across: &'static str) -> Self {
        Self { across, ..self }
    }

    /// The figure as an SVG element.
    pub(crate) fn render(&self) -> String {
        let mut keys = Svg::default();
        let legend = self.draw_legend(&mut keys, 0.0);
        let panels: f64 = self.panels.iter().map(|p| p.height + TITLE).sum();
        let gaps = GAP * self.panels.len().saturating_sub(1) as f64;
        let mut svg = Svg::picture(WIDTH, legend + panels + gaps + FOOT, &self.label);
        svg.raw(&keys.finish());
        self.draw_panels(&mut svg, legend);
        svg.close();
        svg.finish()
    }

    /// Draws the legend from `top` downwards; returns its height.
    pub(crate) fn draw_legend(&self, svg: &mut Svg, top: f64) -> f64 {
        legend(svg, &self.legend, [LEFT, top], WIDTH - 8.0)
    }

    /// Draws panels and time axis from `top` downwards; returns where they end.
    pub(crate) fn draw_panels(&self, svg: &mut Svg, top: f64) -> f64 {
        let mut top = top;
        for panel in &self.panels {
            svg.title([LEFT, top + 19.0], &panel.title, &panel.unit);
            if !panel.note.is_empty() {
                let right = WIDTH - self.right;
                svg.text([right, top + 19.0], "note end", &panel.note);
            }
            top += TITLE;
            self.panel(svg, panel, top);
            top += panel.height + GAP;
        }
        let bottom = top - GAP;
        self.time_axis(svg, bottom);
        bottom + FOOT
    }

    const fn plot_width(&self) -> f64 {
        WIDTH - LEFT - self.right
    }

    fn x(&self, time_s: f64) -> f64 {
        self.time.position(time_s) * self.plot_width()
    }

    fn panel(&self, svg: &mut Svg, panel: &Panel, top: f64) {
        let size = [self.plot_width(), panel.height];
        for (value, text) in panel.axis.ticks() {
            svg.text([LEFT - 9.0, top + panel.y(value) + 4.8], "tick end", &text);
        }
        svg.open_window(LEFT, top, size[0], size[1]);
        svg.rectangle([0.0, 0.0], size, 0.0, "frame");
        let across = |y: f64| vec![[0.0, y], [size[0], y]];
        let ticks = panel.axis.ticks();
        let rows: Vec<_> = ticks.iter().map(|(v, _)| across(panel.y(*v))).collect();
        let columns = self.time.ticks().into_iter().map(|(t, _)| {
            let x = self.x(t);
            vec![[x, 0.0], [x, size[1]]]
        });
        svg.lines(&rows, "grid");
        svg.lines(&columns.collect::<Vec<_>>(), "grid");
        if panel.axis.position(0.0) > 0.0 && panel.axis.position(0.0) < 1.0 {
            svg.lines(&[across(panel.y(0.0))], "zero");
        }
        for layer in &panel.layers {
            self.layer(svg, panel, layer);
        }
        svg.close();
        self.names(svg, panel, top);
    }

    fn layer(&self, svg: &mut Svg, panel: &Panel, layer: &Layer) {
        let at = |p: &Point| [self.x(p[0]), panel.y(p[1])];
        match layer {
            Layer::Band {
                points,
                class,
                angle,
            } => {
                let pieces = series::split(&series::thin_band(points, BAND_POINTS), *angle);
                let outline = |piece: &Vec<BandPoint>| {
                    let upper = piece.iter().map(|p| at(&[p[0], p[2]]));
                    let lower = piece.iter().rev().map(|p| at(&[p[0], p[1]]));
                    upper.chain(lower).collect()
                };
                svg.areas(&pieces.iter().map(outline).collect::<Vec<_>>(), class);
            }
            Layer::Line {
                points,
                class,
                angle,
            } => {
                let pieces = series::split(&series::thin(points, self.line_points), *angle);
                let pieces: Vec<Vec<_>> =
                    pieces.iter().map(|l| l.iter().map(at).collect()).collect();
                svg.lines(&pieces, class);
            }
            Layer::Dots { points, class } => {
                let dots: Vec<_> = series::pick(points, DOTS)
                    .iter()
                    .filter(|p| p[0].is_finite() && p[1].is_finite())
                    .map(at)
                    .collect();
                svg.dots(&dots, class);
            }
            Layer::Bars { bars, class } => {
                let bar = |b: &[f64; 3]| {
                    let (x0, x1, y) = (self.x(b[0]), self.x(b[1]), panel.y(b[2]));
                    vec![[x0, panel.height], [x0, y], [x1, y], [x1, panel.height]]
                };
                svg.areas(&bars.iter().map(bar).collect::<Vec<_>>(), class);
            }
            Layer::Rule { value, class, .. } => {
                let y = panel.y(*value);
                svg.lines(&[vec![[0.0, y], [self.plot_width(), y]]], class);
            }
        }
    }

    /// Names at the right end of rules and lines, pushed apart where they would overlap.
    fn names(&self, svg: &mut Svg, panel: &Panel, top: f64) {
        let mut names: Vec<(f64, String, &str)> = Vec::new();
        for layer in &panel.layers {
            if let Layer::Rule { value, label, .. } = layer
                && panel.axis.contains(*value)
            {
                names.push((panel.y(*value), "note".to_owned(), label));
            }
        }
        for (value, class, name) in &panel.tags {
            let y = panel.y(*value).clamp(6.0, panel.height - 6.0);
            names.push((y, format!("tag {class}"), name));
        }
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (y, (_, class, name)) in spread(&names, 17.0, panel.height).iter().zip(&names) {
            svg.text([WIDTH - self.right + 8.0, top + y + 4.8], class, name);
        }
    }

    fn time_axis(&self, svg: &mut Svg, bottom: f64) {
        let width = self.plot_width();
        for (time_s, text) in self.time.ticks() {
            let x = LEFT + self.x(time_s);
            svg.text([x, bottom + 20.0], "tick mid", &text);
        }
        svg.text([LEFT + width / 2.0, bottom + 41.0], "unit mid", self.across);
    }
}

/// Moves sorted heights at least `distance` apart, and keeps them within `0..height` if they fit.
fn spread(names: &[(f64, String, &str)], distance: f64, height: f64) -> Vec<f64> {
    let mut heights: Vec<f64> = names.iter().map(|n| n.0).collect();
    for i in 1..heights.len() {
        heights[i] = heights[i].max(heights[i - 1] + distance);
    }
    let mut below = height - 2.0;
    for h in heights.iter_mut().rev() {
        *h = h.min(below);
        below = *h - distance;
    }
    heights
}

/// Writes a legend from `corner`, in rows up to `right`; returns its height.
pub(crate) fn legend(svg: &mut Svg, keys: &[Key], corner: [f64; 2], right: f64) -> f64 {
    let [left, top] = corner;
    let (mut x, mut y) = (left, top + 15.0);
    for (sign, class, name) in keys {
        let width = 38.0 + text_width(name, 14.5) + 24.0;
        if x + width > right && x > left {
            (x, y) = (left, y + LEGEND_ROW);
        }
        match sign {
            Sign::Line => svg.lines(&[vec![[x, y], [x + 28.0, y]]], class),
            Sign::Band | Sign::Bar => {
                svg.rectangle([x, y - 7.0], [28.0, 14.0], 2.0, class);
            }
            Sign::Dot => svg.dots(&[[x + 8.0, y], [x + 20.0, y]], class),
        }
        svg.text([x + 36.0, y + 5.0], "key", name);
        x += width;
    }
    if keys.is_empty() { 0.0 } else { y + 17.0 - top }
}

/// Width of text in a common sans-serif face, roughly and rather too wide.
fn text_width(text: &str, size: f64) -> f64 {
    let width = |c: char| match c {
        'i' | 'j' | 'l' | 't' | 'f' | 'r' | ' ' | '.' | ',' | '(' | ')' | '-' => 0.38,
        'm' | 'w' | 'M' | 'W' => 0.95,
        _ => 0.62,
    };
    text.chars().map(width).sum::<f64>() * size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_at_line_ends_do_not_overlap_and_stay_in_the_panel() {
        let at = |y: f64| (y, String::new(), "");
        let heights = spread(&[at(10.0), at(11.0), at(95.0), at(99.0)], 17.0, 100.0);
        assert!(
            heights.windows(2).all(|w| w[1] - w[0] > 16.9),
            "{heights:?}"
        );
        assert!(heights.iter().all(|h| (0.0..=100.0).contains(h)));
    }

    #[test]
    fn legend_wraps_into_rows() {
        let keys: Vec<Key> = (0..12)
            .map(|i| key(Sign::Line, "s0", &format!("estimator {i}")))
            .collect();
        let rows = |keys: &[Key]| legend(&mut Svg::default(), keys, [60.0, 5.0], 900.0);
        assert!(rows(&[]).abs() < 1e-12);
        assert!(rows(&keys) > rows(&keys[..2]) + LEGEND_ROW - 1.0);
    }
}
