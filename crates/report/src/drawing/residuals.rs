//! Residuals of measurements over time, coloured by what became of each.

use northing_core::kalman::Outcome;

use crate::drawing::axis::Axis;
use crate::drawing::curves::error_limit;
use crate::drawing::fate::Fate;
use crate::drawing::plot::{Key, Layer, Panel, Sign, key};
use crate::drawing::series::{BandPoint, Point};

/// One component of a residual as it is drawn. Without a standard deviation (NaN) there is no band.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual {
    pub(crate) time_s: f64,
    pub(crate) value: f64,
    pub(crate) std: f64,
    pub(crate) outcome: Outcome,
}

/// The residuals over the band in which they are expected.
pub(crate) fn panel(name: &str, unit: &str, residuals: &[Residual]) -> Panel {
    let band = |r: &Residual| [r.time_s, -3.0 * r.std, 3.0 * r.std];
    let bounds: Vec<BandPoint> = residuals.iter().map(band).collect();
    let points = residuals.iter().map(|r| (r.outcome, [r.time_s, r.value]));
    let all: Vec<Point> = points.clone().map(|(_, point)| point).collect();
    let (limit, note) = error_limit(&all, &bounds, unit);
    let mut layers = vec![Layer::band(bounds, false)];
    layers.extend(dots(&points));
    Panel::new(name, unit, Axis::linear(-limit, limit, 5), layers)
        .height(118.0)
        .note(note)
}

/// Dots, those refused on top.
pub(crate) fn dots(points: &(impl Iterator<Item = (Outcome, Point)> + Clone)) -> [Layer; 3] {
    Fate::ALL.map(|fate| {
        let of = points.clone().filter(|(o, _)| Fate::of(*o) == Some(fate));
        Layer::dots(of.map(|(_, point)| point).collect(), fate.class())
    })
}

/// Keys of the fates that there are.
pub(crate) fn keys(
    outcomes: &(impl Iterator<Item = Outcome> + Clone),
    name: fn(Fate) -> &'static str,
) -> Vec<Key> {
    let shown = |fate: &Fate| outcomes.clone().any(|o| Fate::of(o) == Some(*fate));
    let shown = Fate::ALL.into_iter().filter(shown);
    shown
        .map(|fate| key(Sign::Dot, &format!("dots big {}", fate.class()), name(fate)))
        .collect()
}

/// Key of the band.
pub(crate) fn band_key() -> Key {
    let name = "\u{00b1}3\u{03c3} expected";
    key(Sign::Band, "band estimate-fill", name)
}
