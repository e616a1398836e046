//! Figures of a Monte Carlo campaign on trackers: those of Wilthil & Brekke (2016).

use std::fmt::Write as _;

use crate::drawing::axis::{Axis, extent};
use crate::drawing::plot::{Figure, Layer, Panel, line_key};
use crate::drawing::series::Point;
use crate::drawing::style::series_class;
use crate::page::html::{self, Page};

/// One tracker's lines over time: `[t, value]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct TrackerCurves {
    /// Its name.
    pub(crate) name: String,
    /// Root mean square position error, m.
    pub(crate) position_rmse_m: Vec<[f64; 2]>,
    /// Root mean square velocity error, m/s.
    pub(crate) velocity_rmse_m_s: Vec<[f64; 2]>,
    /// Mean NEES.
    pub(crate) nees: Vec<[f64; 2]>,
    /// Its track in one run: east and north, m.
    pub(crate) track_m: Vec<[f64; 2]>,
}

/// What the figures of a campaign show. Those without data are left out.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Figures {
    /// Path of the own ship: east and north, m.
    pub(crate) own_ship_m: Vec<[f64; 2]>,
    /// Path of the target in one run: east and north, m.
    pub(crate) target_m: Vec<[f64; 2]>,
    /// Bands of the mean NEES, with their names.
    pub(crate) nees_bands: Vec<(String, [f64; 2])>,
    /// The trackers to be drawn.
    pub(crate) trackers: Vec<TrackerCurves>,
    /// Names of those that lost the target: their lines would leave no room for the others.
    pub(crate) lost: Vec<String>,
}

impl Figures {
    /// One section each.
    pub(crate) fn draw(&self, page: &mut Page) {
        page.section("geometry", "Trajectories", &self.geometry());
        page.section(
            "position",
            "Position error",
            &self.errors("Position RMSE", "m", |t| &t.position_rmse_m),
        );
        page.section(
            "velocity",
            "Velocity error",
            &self.errors("Velocity RMSE", "m/s", |t| &t.velocity_rmse_m_s),
        );
        page.section("consistency", "Consistency (NEES)", &self.consistency());
    }

    /// Figure 1 and 2 of the paper: the two paths, and the tracks of one run.
    fn geometry(&self) -> String {
        let paths = || self.own_ship_m.iter().chain(&self.target_m);
        let Some((east, north)) = square(&paths()) else {
            return String::new();
        };
        let mut layers = Vec::new();
        let mut legend = Vec::new();
        let lines = self
            .trackers
            .iter()
            .enumerate()
            .filter(|(_, t)| !t.track_m.is_empty());
        for (i, tracker) in lines {
            layers.push(line(&tracker.track_m, &series_class(i)));
            legend.push(line_key(&series_class(i), &tracker.name));
        }
        let truth = [
            (&self.own_ship_m, "reference", "own ship"),
            (&self.target_m, "reference dash", "target"),
        ];
        for (path, class, name) in truth {
            layers.push(line(path, class));
            legend.push(line_key(class, name));
        }
        let panel = Panel::new("North over east", "m", north, layers).height(640.0);
        let figure = Figure::new(
            "Paths of own ship and target, and the tracks of one run",
            east,
            legend,
            vec![panel],
        )
        .right(20.0)
        .across("east, m");
        html::figure(
            figure,
            "The paths of own ship and target, and what each tracker made of the first run.",
            &self.remark("Axes of equal scale."),
        )
    }

    /// Figures 3 and 4 (and 6): an error of each tracker over time.
    fn errors(
        &self,
        title: &str,
        unit: &str,
        of: impl Fn(&TrackerCurves) -> &Vec<[f64; 2]>,
    ) -> String {
        let errors = self.trackers.iter().flat_map(&of).map(|p| p[1]);
        let (low, high) = extent(errors.filter(|error| *error > 0.0));
        if high <= low {
            return String::new();
        }
        let axis = Axis::logarithmic(low * 0.8, (high * 1.2).min(low * 1e5)).with_fine_ticks();
        let layers = self
            .trackers
            .iter()
            .enumerate()
            .map(|(i, t)| line(of(t), &series_class(i)));
        let panel = Panel::new(title, unit, axis, layers.collect()).height(320.0);
        html::figure(
            self.over_time(title, vec![panel]),
            "Root mean square over the runs, at each scan.",
            &self.remark("Lower is better."),
        )
    }

    /// Figure 5 (and 6): mean NEES and its bands.
    fn consistency(&self) -> String {
        let consistent = self.nees_bands.first().map_or(4.0, |(_, [_, high])| *high);
        let nees = self.trackers.iter().flat_map(|t| &t.nees);
        let (_, high) = extent(nees.map(|p| p[1]));
        if !high.is_finite() {
            return String::new();
        }
        // A tracker that has lost its senses must not hide the others.
        let axis = Axis::linear(0.0, high.clamp(1.2 * consistent, 4.0 * consistent), 6);
        let mut layers: Vec<Layer> = Vec::new();
        let mut bands = String::new();
        for (name, band) in &self.nees_bands {
            for value in band {
                layers.push(Layer::rule(*value, format!("{value:.2}")));
            }
            let [low, high] = band;
            let _ = write!(bands, " {low:.2} to {high:.2} for {name}.");
        }
        let lines = self.trackers.iter().enumerate();
        layers.extend(lines.map(|(i, t)| line(&t.nees, &series_class(i))));
        let panel = Panel::new("Mean NEES", "", axis, layers).height(320.0);
        html::figure(
            self.over_time("Mean NEES", vec![panel]),
            "Mean over the runs of the squared error in units of the stated covariance.",
            &self.remark(&format!(
                "Inside the band of four degrees of freedom a tracker is consistent; above, overconfident. \
                 Dotted, the bands of 95 %:{bands}"
            )),
        )
    }

    /// A remark below a figure, and who is missing in it.
    fn remark(&self, text: &str) -> String {
        if self.lost.is_empty() {
            return text.to_owned();
        }
        let lost = self.lost.join(", ");
        format!("{text} Not drawn, because they lost the target: {lost}.")
    }

    fn over_time(&self, label: &str, panels: Vec<Panel>) -> Figure {
        let end = self
            .trackers
            .iter()
            .filter_map(|t| t.nees.last())
            .map(|p| p[0]);
        let end = end.fold(1.0, f64::max);
        let legend = self.trackers.iter().enumerate();
        Figure::new(
            format!("{label} of each tracker over time"),
            Axis::time(0.0, end, 8),
            legend
                .map(|(i, t)| line_key(&series_class(i), &t.name))
                .collect(),
            panels,
        )
        .right(48.0)
    }
}

fn line(points: &[[f64; 2]], class: &str) -> Layer {
    let drawn: Vec<Point> = points
        .iter()
        .copied()
        .filter(|p| p[1].is_finite())
        .collect();
    Layer::line(drawn, class, false)
}

/// Axes of equal length that hold all points: east, north.
fn square<'a>(points: &(impl Iterator<Item = &'a [f64; 2]> + Clone)) -> Option<(Axis, Axis)> {
    points
        .clone()
        .find(|p| p[0].is_finite() && p[1].is_finite())?;
    let span = |i: usize| {
        let (low, high) = extent(points.clone().map(|p| p[i]));
        (0.5 * (low + high), high - low)
    };
    let ((east, width), (north, height)) = (span(0), span(1));
    // The panel is wider than high: 880 by 640.
    let half_height = 0.55 * height.max(width * 640.0 / 880.0).max(1.0);
    let half_width = half_height * 880.0 / 640.0;
    Some((
        Axis::linear(east - half_width, east + half_width, 8),
        Axis::linear(north - half_height, north + half_height, 8),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::html::Frame;
    use crate::page::markup_checks::{
        assert_numbers_are_finite, assert_self_contained, assert_well_formed,
    };

    fn page_of(figures: &Figures) -> String {
        let mut page = Page::default();
        figures.draw(&mut page);
        page.finish(&Frame {
            kicker: "Monte Carlo",
            title: "paper <1>",
            lead: "",
            summary: &[],
            verdicts: &[],
            recording: "",
            command: None,
            reading: "",
        })
    }

    #[test]
    fn a_report_is_well_formed_even_with_a_tracker_that_diverges() {
        let curve = |scale: f64| {
            (1..50)
                .map(|t| [f64::from(t), scale * f64::from(60 - t)])
                .collect()
        };
        let tracker = |name: &str, scale: f64| TrackerCurves {
            name: name.to_owned(),
            position_rmse_m: curve(scale),
            velocity_rmse_m_s: curve(0.1 * scale),
            nees: curve(0.05 * scale),
            track_m: curve(10.0),
        };
        let mut lost = tracker("schmidt-literal", 1e12);
        lost.nees.push([50.0, f64::INFINITY]);
        let figures = Figures {
            nees_bands: vec![("4 degrees of freedom".to_owned(), [3.5, 4.6])],
            own_ship_m: vec![[0.0, 0.0], [100.0, 900.0]],
            target_m: vec![[500.0, 900.0], [300.0, 100.0]],
            trackers: vec![tracker("schmidt", 1.0), lost],
            ..Figures::default()
        };
        let html = page_of(&figures);
        assert_well_formed(&html);
        assert_self_contained(&html);
        assert_numbers_are_finite(&html);
        assert!(html.contains("paper &lt;1&gt;") && html.matches("<figure>").count() == 4);
        // Nothing to show is no figure.
        assert_eq!(page_of(&Figures::default()).matches("<figure>").count(), 0);
    }
}
