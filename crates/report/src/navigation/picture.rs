//! One picture of a navigation run: figures 3 to 6 of the microcontroller paper, for a README.

use super::page::{NavigationReport, estimator_words, metres};
use crate::drawing::map;
use crate::drawing::plot::{Figure, WIDTH};
use crate::drawing::style;
use crate::drawing::svg::Svg;
use crate::navigation::plots;
use crate::page::html::capitalised;

/// Height of the title above the plots, and of the heading above each.
const HEAD: f64 = 92.0;
const HEADING: f64 = 40.0;
/// Height of a panel, lower than in a report: there are nine of them.
const PANEL: f64 = 104.0;
/// Points drawn of a line: the picture should stay small.
const DETAIL: usize = 900;
/// Room around everything.
const MARGIN: f64 = 24.0;

/// What stands on the picture.
enum Part {
    Plots(Figure),
    Map(String),
}

impl NavigationReport<'_> {
    /// A standalone SVG: orientation and position over time, each with the measurements that the estimator had, a
    /// few seconds of both, and the track. It brings its own light background. `None` without estimates.
    #[must_use]
    pub fn picture(&self) -> Option<String> {
        let kind = self.summary.estimator;
        let parts = [
            (
                "Orientation, a few seconds",
                plots::close_orientation(self.trace, kind).map(Part::Plots),
            ),
            (
                "Position",
                plots::position(self.trace, kind).map(Part::Plots),
            ),
            (
                "Between the fixes, a few seconds",
                plots::close_look(self.trace, kind).map(Part::Plots),
            ),
            ("Track", plots::track(self.trace, kind).map(Part::Map)),
        ];
        let parts = parts
            .into_iter()
            .filter_map(|(name, part)| Some((name, part?)));
        // Drawn first to learn the height, which stands in the opening tag.
        let mut drawn = Svg::default();
        let mut bottom = HEAD;
        for (name, part) in parts {
            drawn.text([0.0, bottom + 24.0], "name part", name);
            bottom = draw(&mut drawn, part, bottom + HEADING) + 14.0;
        }
        (bottom > HEAD).then(|| self.framed(&drawn.finish(), bottom))
    }

    fn framed(&self, drawn: &str, bottom: f64) -> String {
        let size = [WIDTH + 2.0 * MARGIN, bottom + MARGIN];
        let mut svg = Svg::picture(size[0], size[1], &format!("{}: {}", self.name, self.told()));
        svg.raw("<style>\n");
        svg.raw(&style::standalone_css());
        svg.raw(
            ".card{fill:#fff;stroke:#d5dbe1}.head{font-size:25px;font-weight:700;letter-spacing:-.3px}.sub{font-size:16px}\
             .part{font-size:19px}\n</style>\n",
        );
        svg.rectangle([0.5, 0.5], [size[0] - 1.0, size[1] - 1.0], 14.0, "card");
        svg.open_window(MARGIN, 0.0, WIDTH, size[1]);
        svg.text([0.0, 46.0], "name head", &capitalised(&self.name));
        svg.text([0.0, 72.0], "unit sub", &self.told());
        svg.raw(drawn);
        svg.close();
        svg.close();
        svg.finish()
    }

    /// What the picture shows, in a line.
    fn told(&self) -> String {
        let what = capitalised(estimator_words(self.summary.estimator));
        match &self.summary.position {
            Some(position) => format!(
                "{what}: {} m horizontally, root mean square of {} points",
                metres(position.horizontal_rmse_m),
                position.scored_fixes
            ),
            None => what,
        }
    }
}

/// Draws a part from `top` downwards; where it ends.
fn draw(svg: &mut Svg, part: Part, top: f64) -> f64 {
    match part {
        Part::Plots(mut figure) => {
            figure.line_points = DETAIL;
            for panel in &mut figure.panels {
                panel.height = PANEL;
            }
            let legend = figure.draw_legend(svg, top);
            figure.draw_panels(svg, top + legend)
        }
        Part::Map(map) => {
            svg.open_window(0.0, top, WIDTH, map::TALL);
            svg.raw(&map);
            svg.close();
            top + map::TALL
        }
    }
}
