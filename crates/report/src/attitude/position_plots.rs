//! Plots of a position observer: the track on a map, and what each position told.

use crate::drawing::curves::time_axis;
use crate::drawing::fate::Fate;
use crate::drawing::map::{self, Place, Scale};
use crate::drawing::plot::{DOTS, Figure, Key, Panel, Sign, key};
use crate::drawing::residuals::{self, Residual};
use northing_evaluation::attitude::{PositionPoint, Trace};

/// Room around a track, m.
const ROOM_M: f64 = 1.0;
/// Class of measured positions on the map.
const MEASURED: &str = "dots soft device";

fn place(east_north_up: [f64; 3]) -> Place {
    [east_north_up[1], east_north_up[0]]
}

fn of(trace: &Trace, fate: Fate) -> impl Iterator<Item = &PositionPoint> {
    let points = trace.positions.items().iter();
    points.filter(move |p| Fate::of(p.outcome) == Some(fate))
}

/// Seen from above: the estimated track, and the measured positions as dots; `None` without any.
pub(crate) fn track(trace: &Trace) -> Option<String> {
    let estimates = trace.points.items().iter().filter_map(|p| p.position_m);
    let estimates: Vec<Place> = estimates.map(place).collect();
    let measured =
        |fate: Fate| -> Vec<Place> { of(trace, fate).map(|p| place(p.measured_m)).collect() };
    let used: Vec<Place> = [measured(Fate::Fused), measured(Fate::Inflated)].concat();
    let refused = measured(Fate::Gated);
    if estimates.is_empty() || used.is_empty() {
        return None;
    }
    let scale = Scale::new(&[estimates.as_slice(), &used].concat(), ROOM_M)?;
    let mut keys = vec![
        key(Sign::Line, "line estimate", "estimate"),
        key(Sign::Dot, "dots big soft device", "measured positions used"),
    ];
    if !refused.is_empty() {
        keys.push(key(Sign::Dot, "dots big gated", "refused as outliers"));
    }
    let mut svg = map::open(
        &scale,
        "Map of the track and of the measured positions",
        &keys,
    );
    svg.dots(&scale.dots(&used, DOTS), MEASURED);
    svg.dots(&scale.dots(&refused, DOTS), "dots gated");
    svg.lines(&[scale.path(&estimates)], "line estimate");
    Some(map::close(svg))
}

/// Measured minus estimated over time, axis by axis; `None` without positions.
pub(crate) fn innovations(trace: &Trace) -> Option<Figure> {
    if trace.positions.items().is_empty() {
        return None;
    }
    let panels = ["East", "North", "Up"].into_iter().enumerate();
    Some(Figure::new(
        "Measured minus estimated position over time",
        time_axis(&[trace]),
        keys(trace),
        panels.map(|(i, name)| panel(trace, i, name)).collect(),
    ))
}

fn keys(trace: &Trace) -> Vec<Key> {
    let outcomes = trace.positions.items().iter().map(|p| p.outcome);
    residuals::keys(&outcomes, |fate| match fate {
        Fate::Fused => "used",
        Fate::Inflated => "accepted after several outliers",
        Fate::Gated => "refused as an outlier",
    })
}

fn panel(trace: &Trace, i: usize, name: &str) -> Panel {
    let residual = |p: &PositionPoint| Residual {
        time_s: p.time_s,
        value: p.residual_m[i],
        std: f64::NAN,
        outcome: p.outcome,
    };
    let residuals: Vec<_> = trace.positions.items().iter().map(residual).collect();
    residuals::panel(name, "m", &residuals)
}
