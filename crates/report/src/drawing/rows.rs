//! Plots of rows: a name at the left, marks along one axis, a note at the right.

use crate::drawing::axis::Axis;
use crate::drawing::plot::{Key, WIDTH, legend};
use crate::drawing::svg::Svg;

/// Rows over one axis.
pub(crate) struct Rows<'a, M> {
    pub(crate) label: &'a str,
    pub(crate) unit: &'a str,
    pub(crate) axis: Axis,
    /// Room at the left for names and at the right for notes.
    pub(crate) margins: [f64; 2],
    /// Height of a row.
    pub(crate) height: f64,
    /// Vertical lines at values.
    pub(crate) rules: &'a [f64],
    pub(crate) legend: Vec<Key>,
    pub(crate) rows: Vec<Row<'a, M>>,
}

/// One of them. The marks are what the caller draws.
pub(crate) struct Row<'a, M> {
    pub(crate) name: &'a str,
    /// Class of the name.
    pub(crate) class: String,
    pub(crate) note: String,
    pub(crate) marks: M,
}

impl<M> Rows<'_, M> {
    /// The picture; `draw` is given the scale of the axis, the upper edge of the row, and its marks.
    pub(crate) fn render(&self, draw: impl Fn(&mut Svg, &dyn Fn(f64) -> f64, f64, &M)) -> String {
        let [left, right] = self.margins;
        let width = WIDTH - left - right;
        let height = self.height * self.rows.len() as f64;
        let scale = |value: f64| self.axis.position(value).clamp(0.0, 1.0) * width;
        let mut keys = Svg::default();
        let top = 6.0 + legend(&mut keys, &self.legend, [left, 0.0], WIDTH - 8.0);
        let mut svg = Svg::picture(WIDTH, top + height + 54.0, self.label);
        svg.raw(&keys.finish());
        svg.open_window(left, top, width, height);
        svg.rectangle([0.0, 0.0], [width, height], 0.0, "frame");
        let upright = |value: f64| vec![[scale(value), 0.0], [scale(value), height]];
        let ticks = self.axis.ticks();
        let columns: Vec<_> = ticks.iter().map(|(v, _)| upright(*v)).collect();
        svg.lines(&columns, "grid");
        for rule in self.rules {
            svg.lines(&[upright(*rule)], "line dash reference");
        }
        for (i, row) in self.rows.iter().enumerate() {
            draw(&mut svg, &scale, i as f64 * self.height, &row.marks);
        }
        svg.close();
        for (i, row) in self.rows.iter().enumerate() {
            let y = top + (i as f64 + 0.5) * self.height + 5.0;
            svg.text([left - 12.0, y], &row.class, row.name);
            svg.text([left + width + 10.0, y], "note", &row.note);
        }
        for (value, text) in &ticks {
            let x = left + scale(*value);
            svg.text([x, top + height + 20.0], "tick mid", text);
        }
        let middle = [left + width / 2.0, top + height + 44.0];
        svg.text(middle, "unit mid", self.unit);
        svg.close();
        svg.finish()
    }
}
