//! Plots of what each measurement told the filter: innovations, their NIS, and what the gate did.

use northing_core::kalman::gate::CHI_SQUARE;
use northing_recording::SensorKind;

use crate::drawing::axis::{self, Axis};
use crate::drawing::curves::time_axis;
use crate::drawing::fate::Fate;
use crate::drawing::plot::{DOTS, Figure, Key, Layer, Panel, Sign, key};
use crate::drawing::residuals::{self, Residual};
use crate::drawing::series::{self, Point};
use northing_evaluation::attitude::{InnovationPoint, Trace};

/// Room at the right for the names of bounds.
const RIGHT: f64 = 80.0;
/// Time windows over which a mean NIS or a share of rejections is taken.
const WINDOWS: usize = 120;
/// Lowest NIS shown: smaller ones say nothing more.
const LEAST_NIS: f64 = 0.01;

/// Innovations of one sensor that were looked at, all of the same number of components.
pub(crate) struct Updates<'a> {
    pub(crate) sensor: SensorKind,
    pub(crate) components: u8,
    pub(crate) points: Vec<&'a InnovationPoint>,
    /// Whether the trace kept only some of them.
    pub(crate) thinned: bool,
}

impl Updates<'_> {
    /// Name for headings: the sensor, and that it is a heading if only that was measured.
    pub(crate) fn name(&self) -> String {
        let mut name = self.sensor.name().to_owned();
        if let Some(first) = name.get_mut(..1) {
            first.make_ascii_uppercase();
        }
        if self.components == 1 {
            name.push_str(" (heading only)");
        }
        name
    }

    fn has(&self, fate: Fate) -> bool {
        let mut points = self.points.iter();
        points.any(|p| Fate::of(p.outcome) == Some(fate))
    }

    /// Unit of the residual as drawn, and the factor from the trace's unit.
    fn unit(&self) -> (&'static str, f64) {
        match (self.components, self.sensor) {
            (1, _) => ("deg", 180.0 / std::f64::consts::PI),
            (_, SensorKind::Accelerometer) => ("m/s\u{00b2}", 1.0),
            (_, SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated) => {
                ("\u{00b5}T", 1.0)
            }
            _ => ("", 1.0),
        }
    }

    fn keys(&self) -> Vec<Key> {
        let mut keys = residuals::keys(&self.points.iter().map(|p| p.outcome), Fate::name);
        keys.push(residuals::band_key());
        keys.push(key(Sign::Line, "line bold mean", "mean NIS of a window"));
        keys
    }
}

/// The updates of a trace, sensor by sensor; those with nothing to draw are left out.
pub(crate) fn updates(trace: &Trace) -> Vec<Updates<'_>> {
    let mut found = Vec::new();
    for (sensor, series) in &trace.innovations {
        for components in [3_u8, 2, 1] {
            let drawable = |p: &&InnovationPoint| {
                p.degrees_of_freedom == components
                    && Fate::of(p.outcome).is_some()
                    && p.time_s.is_finite()
            };
            let points: Vec<_> = series.items().iter().filter(drawable).collect();
            if !points.is_empty() {
                found.push(Updates {
                    sensor: *sensor,
                    components,
                    thinned: series.pushed() > series.items().len() as u64 || points.len() > DOTS,
                    points,
                });
            }
        }
    }
    found
}

/// Residual of each component between its bounds, and the NIS below.
pub(crate) fn innovations(trace: &Trace, updates: &Updates<'_>) -> Figure {
    let names: &[&str] = match updates.components {
        1 => &["Heading innovation"],
        _ => &["Innovation x", "Innovation y", "Innovation z"],
    };
    let components = usize::from(updates.components).min(names.len());
    let names = names[..components].iter().enumerate();
    let mut panels: Vec<Panel> = names.map(|(i, n)| residual_panel(updates, i, n)).collect();
    panels.push(nis_panel(updates));
    Figure::new(
        format!(
            "Innovations and NIS of the {} over time",
            updates.sensor.name()
        ),
        time_axis(&[trace]),
        updates.keys(),
        panels,
    )
    .right(RIGHT)
}

fn residual_panel(updates: &Updates<'_>, i: usize, name: &str) -> Panel {
    let (unit, factor) = updates.unit();
    let residual = |p: &&InnovationPoint| Residual {
        time_s: p.time_s,
        value: p.residual[i] * factor,
        std: p.std[i] * factor,
        outcome: p.outcome,
    };
    let residuals: Vec<_> = updates.points.iter().map(residual).collect();
    residuals::panel(name, unit, &residuals)
}

fn nis_panel(updates: &Updates<'_>) -> Panel {
    let nis = |p: &&InnovationPoint| (p.outcome, [p.time_s, p.nis.max(LEAST_NIS)]);
    let sorted = axis::sorted(updates.points.iter().map(|p| p.nis));
    let high = (axis::quantile(&sorted, 0.9995) * 1.6).clamp(100.0, 1e6);
    let mut layers: Vec<Layer> = residuals::dots(&updates.points.iter().map(nis)).into();
    for (value, label) in bounds(updates.components) {
        layers.push(Layer::rule(value, label));
    }
    let roots: Vec<Point> = updates
        .points
        .iter()
        .map(|p| [p.time_s, p.nis.max(0.0).sqrt()])
        .collect();
    let mean = series::windowed_rms(&roots, WINDOWS / 2);
    let mean = mean.iter().map(|p| [p[0], p[1] * p[1]]).collect();
    layers.push(Layer::line(mean, "bold mean", false));
    let axis = Axis::logarithmic(LEAST_NIS, high);
    Panel::new("NIS", "no unit, logarithmic", axis, layers).height(190.0)
}

/// Expected mean, 95 % and 99 % bound of a NIS.
fn bounds(components: u8) -> Vec<(f64, &'static str)> {
    let mut bounds = vec![(f64::from(components), "expected")];
    if let Some((_, [p95, p99, _])) = CHI_SQUARE.iter().find(|(n, _)| *n == components) {
        bounds.extend([(*p95, "95 %"), (*p99, "99 %")]);
    }
    bounds
}

/// Share of measurements refused or inflated, sensor by sensor; `None` without measurements.
pub(crate) fn gates(trace: &Trace, all: &[Updates<'_>]) -> Option<Figure> {
    if all.is_empty() {
        return None;
    }
    let mut legend = vec![key(Sign::Bar, "gated-fill", Fate::Gated.name())];
    if all.iter().any(|u| u.has(Fate::Inflated)) {
        legend.push(key(Sign::Bar, "inflated-fill", Fate::Inflated.name()));
    }
    Some(
        Figure::new(
            "Share of measurements refused by the gates over time",
            time_axis(&[trace]),
            legend,
            all.iter().map(gate_panel).collect(),
        )
        .right(RIGHT),
    )
}

fn gate_panel(updates: &Updates<'_>) -> Panel {
    let share = |p: &InnovationPoint, fates: &[Fate]| {
        let one_of = Fate::of(p.outcome).is_some_and(|f| fates.contains(&f));
        [p.time_s, f64::from(u8::from(one_of))]
    };
    // The mean square of zeros and ones is the share of ones.
    let bars = |fates: &[Fate], class: &str| {
        let ones: Vec<Point> = updates.points.iter().map(|p| share(p, fates)).collect();
        let windows = series::windowed_rms(&ones, WINDOWS);
        let half = 0.5 * (ones[ones.len() - 1][0] - ones[0][0]).max(0.0) / WINDOWS as f64;
        let bar = |p: &Point| [p[0] - half, p[0] + half, 100.0 * p[1] * p[1]];
        Layer::Bars {
            bars: windows.iter().filter(|p| p[1] > 0.0).map(bar).collect(),
            class: class.to_owned(),
        }
    };
    let layers = vec![
        bars(&[Fate::Gated, Fate::Inflated], "bar inflated-fill"),
        bars(&[Fate::Gated], "bar gated-fill"),
    ];
    let name = updates.name();
    Panel::new(&name, "% refused", Axis::linear(0.0, 100.0, 2), layers).height(74.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_those_of_the_chi_square_distribution() {
        let of = |n| bounds(n).iter().map(|b| b.0).collect::<Vec<_>>();
        assert_eq!(of(3), [3.0, 7.814_728, 11.344_867]);
        assert_eq!(of(1), [1.0, 3.841_459, 6.634_897]);
    }
}
