//! What pages of experiments share: shares in words and in cells, columns, and figures of a run over time.

use crate::drawing::axis::Axis;
use crate::drawing::plot::{Figure, Key, Layer, Panel, Sign, key};
use crate::drawing::series::{BandPoint, Point};
use crate::page::facts::Tone;
use crate::page::table::{Cell, Column};

/// What stands above the title.
pub(super) const KICKER: &str = "Northing \u{00b7} experiment";
/// Coverage of a stated 95 % over the instants of all worlds that is called consistent.
pub(super) const CONSISTENT: core::ops::RangeInclusive<f64> = 0.90..=0.99;
/// Points drawn at most of one line: ten pictures stand on a page.
const LINE_POINTS: usize = 600;
/// No angle is larger, deg.
const HALF_TURN_DEG: f64 = 180.0;

/// A share in words.
pub(super) fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// A value in words, or a dash.
pub(super) fn or_dash(value: Option<f64>, words: fn(f64) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), words)
}

/// Good, or bad.
pub(super) const fn good_if(good: bool) -> Tone {
    if good { Tone::Good } else { Tone::Bad }
}

/// A count in a cell.
pub(super) fn count(n: usize) -> Cell {
    Cell::number(Some(n as f64), 0)
}

/// A share in a cell, percent.
pub(super) fn share(share: Option<f64>, decimals: usize) -> Cell {
    Cell::number(share.map(|share| 100.0 * share), decimals)
}

/// Columns by name and unit, none of which marks its best number.
pub(super) fn columns<'a>(columns: impl IntoIterator<Item = &'a [&'a str; 2]>) -> Vec<Column> {
    let column = |[name, unit]: &[&str; 2]| Column::new(*name, *unit, None);
    columns.into_iter().map(column).collect()
}

/// A line whose values are drawn at the edge where they lie beyond; what is missing is a gap.
pub(super) fn line_within(
    [low, high]: [f64; 2],
    points: impl Iterator<Item = (f64, Option<f64>)>,
) -> Vec<Point> {
    let shown = |value: f64| value.clamp(low, high);
    points
        .map(|(time_s, value)| [time_s, value.map_or(f64::NAN, shown)])
        .collect()
}

/// The ends of a logarithmic axis with all these lines on it, and with all from `least` to `most`.
pub(super) fn logarithmic_ends<'a>(
    lines: impl IntoIterator<Item = &'a Vec<Point>>,
    [least, most]: [f64; 2],
) -> [f64; 2] {
    let values = lines.into_iter().flatten().map(|point| point[1]);
    let finite = values.filter(|value| value.is_finite());
    let [low, high] = finite.fold([least, most], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    [0.8 * low, 1.2 * high]
}

/// A panel of errors of an angle (deg) over the band of three standard deviations (time, standard deviation); the axis shows
/// at least `least_deg`. Signed errors may lie on both sides of zero.
pub(super) fn angle_panel(
    title: &str,
    stds: impl Iterator<Item = (f64, f64)>,
    lines: Vec<(&str, Vec<Point>)>,
    least_deg: f64,
    signed: bool,
) -> Panel {
    let reach = |(time_s, std): (f64, f64)| (time_s, (3.0 * std).min(HALF_TURN_DEG));
    let band: Vec<BandPoint> = stds
        .map(reach)
        .map(|(time_s, reach)| [time_s, if signed { -reach } else { 0.0 }, reach])
        .collect();
    let errors = lines.iter().flat_map(|(_, points)| points);
    let sizes = errors.map(|point| point[1].abs());
    let widest = band.iter().map(|b| b[2]).chain(sizes);
    let widest = widest.fold(least_deg, f64::max).min(HALF_TURN_DEG);
    let mut layers = vec![Layer::band(band, false)];
    let line = |(class, points)| Layer::line(points, class, signed);
    layers.extend(lines.into_iter().map(line));
    let axis = Axis::degrees(if signed { -widest } else { 0.0 }, widest, 6);
    Panel::new(title, "deg", axis, layers)
}

/// The entry of that band in a legend.
pub(super) fn band_key() -> Key {
    key(Sign::Band, "band estimate-fill", "\u{00b1}3\u{03c3}")
}

/// Panels over the time of a run.
pub(super) fn over_time(
    title: String,
    [from_s, until_s]: [f64; 2],
    legend: Vec<Key>,
    panels: Vec<Panel>,
) -> Figure {
    Figure {
        line_points: LINE_POINTS,
        ..Figure::new(title, Axis::time(from_s, until_s, 10), legend, panels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_on_its_axis_and_has_gaps() {
        let values = [(0.0, Some(1e9)), (1.0, None), (2.0, Some(0.0))];
        let line = line_within([0.01, 1e5], values.into_iter());
        assert_eq!((line[0], line[2]), ([0.0, 1e5], [2.0, 0.01]));
        assert!(line[1][1].is_nan());
        let are = |ends: [f64; 2], expected: [f64; 2]| {
            ends.iter()
                .zip(expected)
                .all(|(a, b)| (a / b - 1.0).abs() < 1e-12)
        };
        assert!(are(logarithmic_ends([&line], [1.0, 10.0]), [0.008, 1.2e5]));
        assert!(are(logarithmic_ends([], [1.0, 10.0]), [0.8, 12.0]));
    }

    #[test]
    fn the_axis_of_an_angle_ends_at_half_a_turn() {
        let goes = |[low, high]: [f64; 2], error: f64, std: f64, signed: bool| {
            let lines = vec![("s1", vec![[0.0, error]])];
            let panel = angle_panel("heading", [(0.0, std)].into_iter(), lines, 1.0, signed);
            let [first, last] = [low, high].map(|value| panel.axis.position(value));
            first.abs() < 1e-12 && (last - 1.0).abs() < 1e-12
        };
        assert!(goes([-1.0, 1.0], 0.1, 0.1, true), "the least");
        assert!(goes([0.0, 7.0], -7.0, 2.0, false), "the error");
        assert!(goes([-12.0, 12.0], 7.0, 4.0, true), "the band");
        assert!(goes([-180.0, 180.0], 7.0, 400.0, true), "half a turn");
    }
}
