//! The report of GNSS/INS on random worlds: a row a class, and the worst worlds over time.

use super::elements::{self, CONSISTENT, count, good_if, or_dash, percent};
use crate::drawing::axis::Axis;
use crate::drawing::plot::{Figure, Layer, Panel, Sign, key, line_key};
use crate::drawing::rows::{Row, Rows};
use crate::drawing::series::Point;
use crate::page::facts::{Fact, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table::{self, Cell, Table};
use northing_experiments::navigation_worlds::{
    ClassRow, FeatureRow, WorldInstant, WorldRun, WorldsOutcome,
};

/// Room at the left for names of classes, and at the right for numbers.
const MARGINS: [f64; 2] = [190.0, 150.0];
/// Height of a row.
const ROW: f64 = 34.0;
/// Errors outside are drawn at the edge, m.
const DRAWN_M: [f64; 2] = [0.01, 1e5];
/// The least height of an axis of headings, deg.
const LEAST_DEG: f64 = 5.0;

/// What the words of the page mean.
const READING: &str = "Errors are horizontal, of the antenna at the receiver's time, ten times a second from the first estimate on. Lost: beyond five times the \
     stated 95 % ellipse for ten seconds in one piece, or a root mean square beyond three times extrapolation's, or no \
     estimate. Known: without drifts of the receiver and 20 s after them, wrong fixes among the first three, and correlated errors that no fix \
     shows, and without comparing outages with extrapolation. Extrapolation moves the last fix on and is not given outliers.";

/// The report as one HTML page that needs nothing else; `runs` are the worlds that are drawn.
#[must_use]
pub fn render(outcome: &WorldsOutcome, runs: &[WorldRun], command: Option<&str>) -> String {
    let mut page = Page::default();
    page.section("classes", "Classes", &classes(outcome));
    let tables = [
        position_table(outcome),
        uncertainty_table(outcome),
        feature_table(&outcome.features),
    ];
    let tables: String = tables.iter().map(table::table).collect();
    page.section("numbers", "Numbers", &tables);
    page.section("worst", "The worst worlds", &worst(outcome, runs));
    let lead = format!(
        "{} worlds, seed {}, default parameters",
        outcome.worlds.len(),
        outcome.seed
    );
    page.finish(&Frame {
        kicker: elements::KICKER,
        title: "GNSS/INS on random worlds: is it ever lost?",
        lead: &lead,
        summary: &facts(&outcome.total),
        verdicts: &verdicts(&outcome.total),
        recording: "",
        command,
        reading: READING,
    })
}

fn facts(total: &ClassRow) -> Vec<Fact> {
    vec![
        Fact::new("lost", format!("{} of {}", total.lost, total.worlds)),
        Fact::new("lost, known", total.lost_knowably.to_string()),
        Fact::new("worse than extrapolation", total.worse.to_string()),
        Fact::new(
            "RMS over extrapolation's, median",
            or_dash(total.median_ratio, |r| format!("{r:.2}")),
        ),
        Fact::new(
            "coverage, all instants",
            or_dash(total.pooled_coverage, percent),
        ),
        Fact::new(
            "heading inside 3 \u{03c3}",
            or_dash(total.heading_inside_share, percent),
        ),
    ]
}

/// What the experiment answers, sentence by sentence.
fn verdicts(total: &ClassRow) -> Vec<Verdict> {
    let mut verdicts = vec![Verdict::new(
        good_if(total.lost_knowably == 0),
        format!(
            "Lost in {} of {} worlds where its error can be known: {} beyond the ellipse, {} beyond extrapolation, {} without \
                 an estimate.",
            total.lost_knowably,
            total.worlds,
            total.beyond_the_ellipse,
            total.beyond_extrapolation,
            total.without_estimate
        ),
    )];
    if let Some(pooled) = total.pooled_coverage {
        verdicts.push(Verdict::new(
            good_if(CONSISTENT.contains(&pooled)),
            format!(
                "The 95 % ellipse holds {} of the errors of all worlds; below 0.90 are {} of the worlds one by one.",
                percent(pooled),
                percent(total.overconfident_share)
            ),
        ));
    }
    if let Some(inside) = total.heading_inside_share {
        verdicts.push(Verdict::new(
            good_if(inside >= 0.97),
            format!("A heading stated within 8 deg is within three standard deviations for {} of the time.", percent(inside)),
        ));
    }
    verdicts
}

/// Shares of each class: lost, worse, consistent.
fn classes(outcome: &WorldsOutcome) -> String {
    let rows = outcome.classes.iter().map(|row| {
        let share = |n: usize| 100.0 * n as f64 / row.worlds.max(1) as f64;
        Row {
            name: &row.class,
            class: "tick end".to_owned(),
            note: format!("{} lost of {}", row.lost_knowably, row.worlds),
            marks: vec![
                (share(row.lost_knowably), "s1"),
                (share(row.worse), "s4"),
                (100.0 * row.pooled_coverage.unwrap_or(0.0), "s2"),
            ],
        }
    });
    let rows = Rows {
        margins: MARGINS,
        height: ROW,
        label: "Share of the worlds of each class that are lost and worse than extrapolation, and pooled coverage",
        unit: "share of the worlds, of the instants, %",
        axis: Axis::linear(0.0, 100.0, 10),
        rules: &[95.0],
        rows: rows.collect(),
        legend: vec![
            key(Sign::Bar, "bar s1-fill", "lost where it can be known"),
            key(Sign::Bar, "bar s4-fill", "worse than extrapolation"),
            key(
                Sign::Bar,
                "bar s2-fill",
                "coverage of the 95 % ellipse, pooled",
            ),
        ],
    };
    let svg = rows.render(|svg, x, top, marks| {
        let step = (ROW - 6.0) / marks.len() as f64;
        for (k, (value, class)) in marks.iter().enumerate() {
            let corner = [x(0.0), top + 3.0 + k as f64 * step];
            svg.rectangle(
                corner,
                [x(*value) - x(0.0), step - 1.0],
                0.0,
                &format!("bar {class}-fill"),
            );
        }
    });
    html::picture(
        svg,
        "One row for each class.",
        "Coverage over the instants of all worlds should end at the dashed line, 95 %; the other bars should have no length.",
    )
}

fn share(share: Option<f64>) -> Cell {
    elements::share(share, 1)
}

/// A table with a row a class, and one of all.
fn table_of(
    outcome: &WorldsOutcome,
    title: &str,
    caption: &str,
    columns: &[[&str; 2]],
    cells: impl Fn(&ClassRow) -> Vec<Cell>,
) -> Table {
    let row =
        |row: &ClassRow| [vec![Cell::text(&row.class), count(row.worlds)], cells(row)].concat();
    let names = [["class", ""], ["worlds", ""]];
    Table {
        title: title.to_owned(),
        caption: caption.to_owned(),
        columns: elements::columns(names.iter().chain(columns)),
        rows: outcome
            .classes
            .iter()
            .chain([&outcome.total])
            .map(row)
            .collect(),
    }
}

fn position_table(outcome: &WorldsOutcome) -> Table {
    let columns = [
        ["lost", ""],
        ["known", ""],
        ["worse", ""],
        ["RMS over extrapolation's", ""],
        ["in outages", ""],
    ];
    let caption = "Known: lost where an estimator can know its error. Ratios are medians.";
    table_of(outcome, "Position", caption, &columns, |row| {
        vec![
            count(row.lost),
            count(row.lost_knowably),
            count(row.worse),
            Cell::number(row.median_ratio, 2),
            Cell::number(row.median_outage_ratio, 2),
        ]
    })
}

fn uncertainty_table(outcome: &WorldsOutcome) -> Table {
    let columns = [
        ["coverage", "%"],
        ["median", "%"],
        ["0.90 to 0.99", "%"],
        ["heading stated", ""],
        ["after", "s"],
        ["in 3 \u{03c3}", "%"],
    ];
    let caption = "Coverage of the 95 % ellipse over the instants of all worlds, its median over worlds, and the share of worlds between 0.90 and \
                   0.99. Heading: in how many worlds it was stated within 8 deg, how long after the first fix (median), and how much \
                   of it is within three standard deviations.";
    table_of(
        outcome,
        "Stated uncertainty, heading",
        caption,
        &columns,
        |row| {
            vec![
                share(row.pooled_coverage),
                share(row.median_coverage_knowable),
                share(Some(row.consistent_share)),
                count(row.heading_stated),
                Cell::number(row.median_heading_after_s, 1),
                share(row.heading_inside_share),
            ]
        },
    )
}

fn feature_table(rows: &[FeatureRow]) -> Table {
    let row = |row: &FeatureRow| {
        vec![
            Cell::text(&row.feature),
            count(row.worlds),
            count(row.lost),
            count(row.lost_knowably),
            count(row.worse),
            share(Some(row.consistent_share)),
        ]
    };
    Table {
        title: "What worlds have in common".to_owned(),
        caption: "A world stands in every row that it answers to.".to_owned(),
        columns: elements::columns(&[
            ["worlds with", ""],
            ["worlds", ""],
            ["lost", ""],
            ["known", ""],
            ["worse", ""],
            ["consistent", "%"],
        ]),
        rows: rows.iter().map(row).collect(),
    }
}

fn worst(outcome: &WorldsOutcome, runs: &[WorldRun]) -> String {
    let figures = runs.iter().map(|run| {
        let number = run.description.number;
        let what = format!("World {number}, {}.", run.description.class.name());
        let mut look = run.description.features().join("; ");
        look.push('.');
        if run.instants.is_empty() {
            let command = format!(
                "northing experiment navigation-worlds --seed {} --world {number}",
                outcome.seed
            );
            return html::sentences(&[format!("{what} {look} There was no estimate: {command}")]);
        }
        html::figure(figure(run), &what, &look)
    });
    figures.collect()
}

/// A line of something, its points within the axis of errors.
fn errors(run: &WorldRun, of: fn(&WorldInstant) -> Option<f64>) -> Vec<Point> {
    elements::line_within(DRAWN_M, run.instants.iter().map(|i| (i.time_s, of(i))))
}

fn figure(run: &WorldRun) -> Figure {
    let instants = &run.instants;
    let lines = [
        ("s5 thin", errors(run, |i| i.extrapolation_error_m)),
        ("s2", errors(run, |i| Some(i.stated_m))),
        ("s1", errors(run, |i| Some(i.error_m))),
    ];
    let [least, most] = DRAWN_M;
    let [low, high] =
        elements::logarithmic_ends(lines.iter().map(|(_, points)| points), [most, least]);
    let position = lines.map(|(class, points)| Layer::line(points, class, false));
    let heading = instants.iter().map(|i| [i.time_s, i.heading_error_deg]);
    elements::over_time(
        format!("Errors of world {}", run.description.number),
        [instants.first(), instants.last()].map(|i| i.map_or(0.0, |i| i.time_s)),
        vec![
            line_key("s1", "error"),
            line_key("s2", "stated 95 %"),
            line_key("s5 thin", "extrapolation"),
            elements::band_key(),
        ],
        vec![
            Panel::new(
                "horizontal error",
                "m (logarithmic)",
                Axis::logarithmic(low, high),
                position.into(),
            ),
            elements::angle_panel(
                "heading error",
                instants.iter().map(|i| (i.time_s, i.heading_std_deg)),
                vec![("s1", heading.collect())],
                LEAST_DEG,
                true,
            )
            .height(110.0),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::markup_checks::without_scripts;
    use northing_experiments::navigation_worlds::Worlds;

    #[test]
    fn the_page_has_a_row_a_class_and_a_figure_a_world() {
        let worlds = Worlds {
            seed: 1,
            first: 0,
            count: 9,
            class: None,
        };
        let outcome = worlds.run(&|| ());
        let runs: Vec<_> = outcome
            .worst
            .iter()
            .take(3)
            .map(|n| WorldRun::of(1, *n))
            .collect();
        let page = render(&outcome, &runs, Some("northing experiment"));
        for part in [
            "car-smooth",
            "pedestrian",
            "with velocity",
            "is it ever lost?",
            "northing experiment",
        ] {
            assert!(page.contains(part), "{part}");
        }
        let page = without_scripts(&page);
        let estimated = runs.iter().filter(|run| !run.instants.is_empty()).count();
        assert_eq!(page.matches("horizontal error").count(), estimated);
        assert!(!page.contains("NaN") && !page.contains("inf\""));
    }

    #[test]
    fn a_world_without_an_estimate_is_said() {
        let mut run = WorldRun::of(1, 0);
        run.instants.clear();
        let outcome = WorldsOutcome::of(1, vec![run.outcome()]);
        let page = render(&outcome, &[run], None);
        assert!(page.contains("There was no estimate") && page.contains("--seed 1 --world 0"));
        assert!(page.contains("1 of 1"));
    }
}
