//! The report of attitude on random worlds: accuracy, coverage, verdicts, and the worst worlds over time.

use super::elements::{self, CONSISTENT, good_if, or_dash, percent};
use crate::drawing::plot::{Figure, Panel, line_key};
use crate::drawing::series::Point;
use crate::page::facts::{Fact, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table::{self, Cell, Column, Table};
use northing_experiments::attitude_worlds::{
    Cause, Confusion, EstimatorOutcome, EstimatorRun, GroupRow, Sensing, StatedRow, WorldInstant,
    WorldRun, WorldsOutcome, baseline,
};

/// The least height of an axis of errors, deg.
const LEAST_DEG: f64 = 1.0;
/// Share of the worlds in which a true cause is to be named.
const RIGHT: f64 = 0.90;

/// What the words of the page mean.
const READING: &str = "Errors ten times a second from five seconds on: the tilt is the angle between estimated and true up, the heading the rest, \
     from north or, where nothing says where north is, from the first scored instant. Coverage: share inside the stated 95 %, of the instants \
     of all worlds; in band: share of the worlds with coverage between 0.90 and 0.99, and the share that a consistent estimator \
     would have whose errors last as long. Ratios to VQF on the same samples are medians over worlds. Green: the verdicts name \
     nothing.";

/// The report as one HTML page that needs nothing else; `runs` are the worlds that are drawn.
#[must_use]
pub fn render(outcome: &WorldsOutcome, runs: &[WorldRun], command: Option<&str>) -> String {
    let mut page = Page::default();
    let subject = outcome.subject();
    let of = |sensing| outcome.estimator(subject, sensing);
    let sensings = || Sensing::ALL.into_iter();
    let tables: String = sensings().map(|s| estimator_table(outcome, s)).collect();
    page.section("estimators", "Estimators", &tables);
    let groups = |rows: fn(&EstimatorOutcome) -> &[GroupRow], kind: &str| -> String {
        let table = |of: &EstimatorOutcome| group_table(of, rows(of), kind);
        sensings().filter_map(of).map(table).collect()
    };
    page.section("motions", "By motion", &groups(|of| &of.motions, "motion"));
    page.section("faults", "By fault", &groups(|of| &of.faults, "fault"));
    let verdicts: String = sensings()
        .filter_map(of)
        .filter_map(confusion_table)
        .collect();
    page.section("verdicts", "Named causes", &verdicts);
    let worst: String = runs.iter().map(|run| drawn(run, subject)).collect();
    page.section("worst", "The worst worlds", &worst);
    let first = outcome.estimators.first();
    let lead = format!(
        "{} worlds, seed {}; details of {subject}",
        outcome.worlds.len(),
        outcome.seed
    );
    page.finish(&Frame {
        kicker: elements::KICKER,
        title: "Attitude on random worlds: is it right, and does it state its error?",
        lead: &lead,
        summary: &first.map_or_else(Vec::new, facts),
        verdicts: &first.map_or_else(Vec::new, verdicts_of),
        recording: "",
        command,
        reading: READING,
    })
}

fn facts(of: &EstimatorOutcome) -> Vec<Fact> {
    let total = &of.total;
    let coverage = |row: &Option<StatedRow>| row.as_ref().map(|stated| stated.pooled_coverage);
    vec![
        Fact::new("estimator", of.estimator.to_owned()),
        Fact::new(
            "tilt, median RMS",
            or_dash(total.tilt_rms_deg, |d| format!("{d:.2}\u{00b0}")),
        ),
        Fact::new(
            "heading, median RMS",
            or_dash(total.heading_rms_deg, |d| format!("{d:.2}\u{00b0}")),
        ),
        Fact::new(
            "total over VQF's",
            or_dash(total.total_over_vqf, |r| format!("{r:.2}")),
        ),
        Fact::new(
            "coverage of the tilt",
            or_dash(coverage(&total.tilt), percent),
        ),
        Fact::new("true cause named", or_dash(total.right_share, percent)),
        Fact::new("false cause named", or_dash(total.false_share, percent)),
    ]
}

/// What the experiment answers, sentence by sentence.
fn verdicts_of(of: &EstimatorOutcome) -> Vec<Verdict> {
    let total = &of.total;
    let mut verdicts = Vec::new();
    for (name, stated) in [("tilt", &total.tilt), ("heading", &total.heading)] {
        if let Some(stated) = stated {
            verdicts.push(Verdict::new(
                good_if(CONSISTENT.contains(&stated.pooled_coverage)),
                format!(
                    "The stated 95 % of the {name} hold {} of the errors; {} of the worlds are in the band, of a consistent \
                     estimator {} would be.",
                    percent(stated.pooled_coverage),
                    percent(stated.consistent_share),
                    percent(stated.expected_share)
                ),
            ));
        }
    }
    if let Some(right) = total.right_share {
        verdicts.push(Verdict::new(
            good_if(right >= RIGHT),
            format!(
                "The verdicts name a true cause in {} of the worlds.",
                percent(right)
            ),
        ));
        verdicts.push(Verdict::new(
            good_if(total.green_beyond_five == 0 && total.blamed_inside_the_band == 0),
            format!(
                "Green beyond five standard deviations: {} worlds; blamed inside the band of the mean NIS: {}.",
                total.green_beyond_five, total.blamed_inside_the_band
            ),
        ));
    }
    verdicts
}

const COLUMNS: [[&str; 2]; 15] = [
    ["worlds", ""],
    ["none", ""],
    ["tilt", "deg"],
    ["over VQF", ""],
    ["heading", "deg"],
    ["over VQF", ""],
    ["total over VQF", ""],
    ["tilt coverage", "%"],
    ["in band", "%"],
    ["expected", "%"],
    ["heading coverage", "%"],
    ["in band", "%"],
    ["expected", "%"],
    ["right cause", "%"],
    ["false cause", "%"],
];

fn cells(name: &str, row: &GroupRow) -> Vec<Cell> {
    let share = |share| elements::share(share, 1);
    let mut cells = vec![
        Cell::text(name),
        elements::count(row.worlds),
        elements::count(row.without_estimate),
        Cell::number(row.tilt_rms_deg, 2),
        Cell::number(row.tilt_over_vqf, 2),
        Cell::number(row.heading_rms_deg, 2),
        Cell::number(row.heading_over_vqf, 2),
        Cell::number(row.total_over_vqf, 2),
    ];
    for stated in [&row.tilt, &row.heading] {
        cells.push(share(stated.as_ref().map(|s| s.pooled_coverage)));
        cells.push(share(stated.as_ref().map(|s| s.consistent_share)));
        cells.push(share(stated.as_ref().map(|s| s.expected_share)));
    }
    cells.extend([row.right_share, row.false_share].map(share));
    cells
}

fn columns(first: &str) -> Vec<Column> {
    elements::columns([&[first, ""]].into_iter().chain(&COLUMNS))
}

fn estimator_table(outcome: &WorldsOutcome, sensing: Sensing) -> String {
    let of_sensing = outcome.estimators.iter().filter(|of| of.sensing == sensing);
    let rows: Vec<_> = of_sensing
        .map(|of| cells(of.estimator, &of.total))
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    table::table(&Table {
        title: format!("With {}", sensing.name()),
        caption: "None: worlds without an estimate. Errors are medians over worlds of the root mean square.".to_owned(),
        columns: columns("estimator"),
        rows,
    })
}

fn group_table(of: &EstimatorOutcome, rows: &[GroupRow], kind: &str) -> String {
    let rows = rows.iter().chain([&of.total]);
    table::table(&Table {
        title: format!("{} with {}", of.estimator, of.sensing.name()),
        caption: String::new(),
        columns: columns(kind),
        rows: rows.map(|row| cells(&row.group, row)).collect(),
    })
}

fn confusion_table(of: &EstimatorOutcome) -> Option<String> {
    let Confusion { named, rows } = of.confusion.as_ref()?;
    let names = named
        .iter()
        .map(|cause| Column::new(cause.name(), "", None));
    let row = |(cause, counts): &(Cause, Vec<usize>)| {
        let counts = counts.iter().map(|n| elements::count(*n));
        core::iter::once(Cell::text(cause.name()))
            .chain(counts)
            .collect()
    };
    Some(table::table(&Table {
        title: format!("{} with {}", of.estimator, of.sensing.name()),
        caption: "Rows: the true cause; columns: what the verdicts name first; worlds.".to_owned(),
        columns: core::iter::once(Column::new("true cause", "", None))
            .chain(names)
            .collect(),
        rows: rows.iter().map(row).collect(),
    }))
}

/// The figure of a world: the subject's errors with their bands, and VQF's.
fn drawn(run: &WorldRun, subject: &str) -> String {
    let description = &run.description;
    let of = |name: &str| run.runs.iter().find(|of| of.score.estimator == name);
    let what = format!(
        "World {}, {}.",
        description.number,
        description.motion.name()
    );
    let look = format!(
        "{}; {}.",
        description.fault_in_words(),
        description.board.heading.name()
    );
    match of(subject).filter(|of| !of.instants.is_empty()) {
        Some(own) => html::figure(
            figure(description.number, own, of(baseline::NAME)),
            &what,
            &look,
        ),
        None => html::sentences(&[format!("{what} {look} There was no estimate.")]),
    }
}

/// The errors of the subject over its band, before those of VQF.
fn panel(
    title: &str,
    own: &EstimatorRun,
    vqf: Option<&EstimatorRun>,
    error: fn(&WorldInstant) -> f64,
    std: fn(&WorldInstant) -> Option<f64>,
    signed: bool,
) -> Panel {
    let line = |run: &EstimatorRun| -> Vec<Point> {
        run.instants.iter().map(|i| [i.time_s, error(i)]).collect()
    };
    let stated = |i: &WorldInstant| std(i).map(|std| (i.time_s, std));
    let lines = vqf.map(|vqf| ("s5 thin", line(vqf)));
    let lines = lines.into_iter().chain([("s1", line(own))]).collect();
    let stds = own.instants.iter().filter_map(stated);
    elements::angle_panel(title, stds, lines, LEAST_DEG, signed).height(130.0)
}

fn figure(number: u64, own: &EstimatorRun, vqf: Option<&EstimatorRun>) -> Figure {
    elements::over_time(
        format!("Errors of world {number}"),
        [own.instants.first(), own.instants.last()].map(|i| i.map_or(0.0, |i| i.time_s)),
        vec![
            line_key("s1", own.score.estimator),
            line_key("s5 thin", "VQF"),
            elements::band_key(),
        ],
        vec![
            panel(
                "tilt error",
                own,
                vqf,
                |i| i.tilt_error_deg,
                |i| i.tilt_std_deg,
                false,
            ),
            panel(
                "heading error",
                own,
                vqf,
                |i| i.heading_error_deg,
                |i| i.heading_std_deg,
                true,
            ),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::EstimatorKind;
    use northing_experiments::attitude_worlds::Worlds;

    #[test]
    fn the_page_has_a_row_a_motion_and_a_figure_a_world() {
        let worlds = Worlds {
            count: 9,
            estimators: vec![EstimatorKind::Mekf, EstimatorKind::Complementary],
            ..Worlds::thousand()
        };
        let outcome = worlds.run(&|| ()).unwrap();
        let options = worlds.options().unwrap();
        let worst = &outcome.estimators[0].worst;
        let runs: Vec<_> = (worst.iter().take(3))
            .map(|number| WorldRun::of(1, *number, &options))
            .collect();
        let page = render(&outcome, &runs, Some("northing experiment"));
        for part in [
            "fast-turns",
            "vqf",
            "complementary",
            "true cause",
            "does it state its error?",
            "northing experiment",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert_eq!(page.matches("Errors of world").count() % 3, 0);
        assert!(page.contains(&format!("World {}, ", worst[0])));
        assert!(!page.contains("NaN") && !page.contains("inf\""));
    }
}
