//! A map: north up, equal scales, a grid at round distances. What is on it comes from elsewhere.

use crate::drawing::axis::{Axis, quantile, sorted};
use crate::drawing::plot::{Key, WIDTH, legend};
use crate::drawing::series;
use crate::drawing::svg::Svg;

/// Height of a map and room for its legend and ticks, in units of the picture.
const HEIGHT: f64 = 760.0;
const TOP: f64 = 36.0;
const LEFT: f64 = 64.0;
const FOOT: f64 = 46.0;
/// Height of the whole picture.
pub(crate) const TALL: f64 = HEIGHT + TOP;
/// Points drawn at most of one path.
const PATH: usize = 800;

/// A place: north, east, m.
pub(crate) type Place = [f64; 2];

/// Picture coordinates of places.
pub(crate) struct Scale {
    pub(crate) west: f64,
    pub(crate) north: f64,
    pub(crate) units_per_m: f64,
}

impl Scale {
    /// A window around these places, with equal scales and at least `room_m` on each side; far-off
    /// single ones do not count.
    pub(crate) fn new(places: &[Place], room_m: f64) -> Option<Self> {
        let range = |axis: usize| {
            let values = sorted(places.iter().map(|p| p[axis]));
            let (first, last) = (values.first()?, values.last()?);
            let inner = [quantile(&values, 0.01), quantile(&values, 0.99)];
            let room = 0.15 * (inner[1] - inner[0]) + room_m;
            Some([
                (inner[0] - room).max(first - room_m),
                (inner[1] + room).min(last + room_m),
            ])
        };
        let ([south, north], [west, east]) = (range(0)?, range(1)?);
        let (width, height) = (WIDTH - LEFT, HEIGHT - FOOT);
        let units_per_m = (width / (east - west)).min(height / (north - south));
        let middle = [0.5 * (south + north), 0.5 * (west + east)];
        Some(Self {
            west: middle[1] - 0.5 * width / units_per_m,
            north: middle[0] + 0.5 * height / units_per_m,
            units_per_m,
        })
    }

    /// Where a place is on the picture.
    pub(crate) fn at(&self, place: Place) -> [f64; 2] {
        [
            (place[1] - self.west) * self.units_per_m,
            (self.north - place[0]) * self.units_per_m,
        ]
    }

    /// A path, with as many points as one can see, the last among them.
    pub(crate) fn path(&self, places: &[Place]) -> Vec<[f64; 2]> {
        let mut picked = series::pick(places, PATH);
        picked.extend(places.last());
        picked.iter().map(|place| self.at(*place)).collect()
    }

    /// The outline of an ellipse of `size` standard deviations about a place, through the Cholesky factor of
    /// the covariance (north, north and east, east).
    pub(crate) fn ellipse(
        &self,
        [north, east]: Place,
        [nn, ne, ee]: [f64; 3],
        size: f64,
        corners: usize,
    ) -> Vec<[f64; 2]> {
        let root = nn.max(0.0).sqrt();
        let along = if root > 0.0 { ne / root } else { 0.0 };
        let across = (ee - along * along).max(0.0).sqrt();
        let corner = |k: usize| {
            let (s, c) = (std::f64::consts::TAU * k as f64 / corners as f64).sin_cos();
            self.at([
                north + size * root * c,
                east + size * (along * c + across * s),
            ])
        };
        (0..=corners).map(corner).collect()
    }

    /// Dots at places, not too many of them.
    pub(crate) fn dots(&self, places: &[Place], most: usize) -> Vec<[f64; 2]> {
        let picked = series::pick(places, most);
        picked.iter().map(|place| self.at(*place)).collect()
    }
}

/// A map with its legend and grid, and a window open to draw in; [`close`] ends it.
pub(crate) fn open(scale: &Scale, label: &str, keys: &[Key]) -> Svg {
    let mut svg = Svg::picture(WIDTH, TALL, label);
    legend(&mut svg, keys, [LEFT, 0.0], WIDTH);
    svg.rectangle([LEFT, TOP], [WIDTH - LEFT, HEIGHT - FOOT], 6.0, "frame");
    grid(&mut svg, scale);
    svg.open_window(LEFT, TOP, WIDTH - LEFT, HEIGHT - FOOT);
    svg
}

/// The map as text.
pub(crate) fn close(mut svg: Svg) -> String {
    svg.close();
    svg.close();
    svg.finish()
}

/// Lines at round distances, with their numbers.
fn grid(svg: &mut Svg, scale: &Scale) {
    let (width, height) = (WIDTH - LEFT, HEIGHT - FOOT);
    let east = Axis::linear(scale.west, scale.west + width / scale.units_per_m, 9);
    let north = Axis::linear(scale.north - height / scale.units_per_m, scale.north, 7);
    for (value, label) in east.ticks() {
        let x = LEFT + east.position(value) * width;
        svg.lines(&[vec![[x, TOP], [x, TOP + height]]], "grid");
        svg.text([x, TOP + height + 18.0], "tick mid", &label);
    }
    for (value, label) in north.ticks() {
        let y = TOP + (1.0 - north.position(value)) * height;
        svg.lines(&[vec![[LEFT, y], [WIDTH, y]]], "grid");
        svg.text([LEFT - 8.0, y + 4.0], "tick end", &label);
    }
    svg.text([WIDTH - 4.0, TOP + HEIGHT - 8.0], "unit end", "east, m");
    svg.text([LEFT, TOP + HEIGHT - 8.0], "unit", "north upwards, m");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn north_is_up_and_both_axes_have_one_scale() {
        let scale = Scale::new(&[[0.0, 0.0], [100.0, 300.0]], 10.0).unwrap();
        let (origin, north, east) = (
            scale.at([0.0, 0.0]),
            scale.at([10.0, 0.0]),
            scale.at([0.0, 10.0]),
        );
        assert!(north[1] < origin[1] && east[0] > origin[0]);
        approx::assert_relative_eq!(origin[1] - north[1], east[0] - origin[0], epsilon = 1e-9);
    }
}
