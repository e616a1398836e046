//! The report of the fault campaign: which faults which estimators survive, how the default ones recover, and the worst runs over time.

use super::elements;
use crate::drawing::axis::Axis;
use crate::drawing::plot::{Figure, Layer, Panel, Sign, key, line_key};
use crate::drawing::series::Point;
use crate::page::facts::{Fact, Tone, Verdict};
use crate::page::html::{self, Frame, Page, capitalised};
use crate::page::table::{self, Cell, Column, Table};
use northing_evaluation::registry::Question;
use northing_experiments::faults::{
    CampaignOutcome, DrawnRun, FaultRow, Instant, MOST_COST, Part, RECOVERED_DEG, RECOVERY_S, Track,
};
use northing_simulation::fault_injection::InjectedFault;

/// Errors outside are drawn at the edge: deg or m.
const DRAWN: [f64; 2] = [0.01, 1e5];
/// Share of the runs that are to meet the limits.
const GOOD: f64 = 0.95;
/// Below it a fault is not survived.
const POOR: f64 = 0.5;

/// What the words of the page mean.
const READING: &str = "One fault at a time is laid over clean samples, around a third of the stream, and every estimator runs without and with it. \
     Limits: one bad sample costs at most 1.2 times the clean RMS error; after any other fault the error is within 5 degrees, or three times the \
     clean RMS of the position, ten seconds after samples are normal again, and stays there for a minute, and the NEES per degree of freedom is \
     below 3 in the minute after those ten seconds. What a clean run has as well is not counted. Detected: found in the right sensor within three \
     seconds. A step of a bias stays, and counts from its beginning.";

/// The report as one HTML page that needs nothing else; `drawn` are runs that are drawn.
#[must_use]
pub fn render(outcome: &CampaignOutcome, drawn: &[DrawnRun], command: Option<&str>) -> String {
    let mut page = Page::default();
    let parts = outcome.parts();
    let shares: String = parts.iter().map(shares).collect();
    page.section("limits", "Who survives what", &shares);
    let details: String = parts.iter().map(details).collect();
    page.section("defaults", "The default estimators", &details);
    page.section("alarms", "False alarms on clean data", &alarms(outcome));
    let worst: String = drawn.iter().map(figure_of).collect();
    page.section("worst", "Runs that miss the limits by most", &worst);
    let lead = format!("{} runs, seed {}", outcome.runs.len(), outcome.seed);
    page.finish(&Frame {
        kicker: elements::KICKER,
        title: "Faults of sensors: what does each cost, and does an estimator recover?",
        lead: &lead,
        summary: &facts(outcome, &parts),
        verdicts: &parts.iter().map(verdict).collect::<Vec<_>>(),
        recording: "",
        command,
        reading: READING,
    })
}

fn tone(share: f64) -> Tone {
    match share {
        s if s >= GOOD => Tone::Good,
        s if s >= POOR => Tone::Warn,
        _ => Tone::Bad,
    }
}

/// A cell of the share of runs that meet the limits, percent.
fn toned(share: f64) -> Cell {
    Cell::Toned {
        value: 100.0 * share,
        tone: tone(share),
    }
}

fn facts(outcome: &CampaignOutcome, parts: &[Part<'_>]) -> Vec<Fact> {
    let of_part = |part: &Part<'_>| {
        let (name, rows) = part.of_default();
        let met = rows.iter().filter(|row| row.meets_share >= GOOD).count();
        let label = format!("{name}: faults survived ({})", part.title);
        Fact::new(label, format!("{met} of {}", rows.len()))
    };
    let runs = Fact::new("runs", outcome.runs.len().to_string());
    core::iter::once(runs)
        .chain(parts.iter().map(of_part))
        .collect()
}

/// What the default estimator does, in a sentence.
fn verdict(part: &Part<'_>) -> Verdict {
    let (name, rows) = part.of_default();
    let title = capitalised(part.title);
    let missed = rows.iter().filter(|row| row.meets_share < GOOD);
    let missed: Vec<_> = missed.map(|row| row.fault).collect();
    let text = if missed.is_empty() {
        format!("{title}: {name} meets the limits after every fault, in 95 % of the runs or more.")
    } else {
        format!(
            "{title}: {name} misses the limits in more than 5 % of the runs after {}.",
            missed.join(", ")
        )
    };
    let share = 1.0 - missed.len() as f64 / rows.len().max(1) as f64;
    Verdict::new(tone(share), text)
}

/// A row a fault, a column an estimator, coloured by the share of runs that meet the limits.
fn shares(part: &Part<'_>) -> String {
    let names = part.estimators();
    let line = |fault: &str| {
        let cell = |name: &&str| {
            let row = part.row(fault, name);
            row.map_or(Cell::Missing, |row| toned(row.meets_share))
        };
        core::iter::once(Cell::text(fault))
            .chain(names.iter().map(cell))
            .collect()
    };
    table::table(&Table {
        title: capitalised(part.title),
        caption: format!(
            "Share of the runs that meet the limits, %; {} runs of each.",
            part.rows.first().map_or(0, |row| row.runs)
        ),
        columns: core::iter::once("fault")
            .chain(names.iter().copied())
            .map(|name| Column::new(name, "", None))
            .collect(),
        rows: part.faults().map(line).collect(),
    })
}

/// A row a fault of the default estimator.
fn details(part: &Part<'_>) -> String {
    let (name, rows) = part.of_default();
    let unit = match rows.first().map(|row| row.question) {
        Some(Question::Attitude) => "deg",
        _ => "m",
    };
    let columns = [
        ["fault", ""],
        ["runs", ""],
        ["clean RMS", unit],
        ["RMS over clean", ""],
        ["95th percentile", ""],
        ["largest error", unit],
        ["recovery", "s"],
        ["within 10 s", "%"],
        ["NEES/dof", ""],
        ["below 3", "%"],
        ["clean below 3", "%"],
        ["detected", "%"],
        ["meets", "%"],
    ];
    let percent = |share| elements::share(share, 0);
    let line = |row: &&FaultRow| {
        vec![
            Cell::text(row.fault),
            elements::count(row.runs),
            Cell::number(row.clean_rms, 2),
            Cell::number(row.cost, 2),
            Cell::number(row.cost_95, 2),
            Cell::number(row.largest, 1),
            Cell::number(row.recovery_s, 1),
            percent(Some(row.recovered_share)),
            Cell::number(row.nees, 1),
            percent(row.nees_share),
            percent(row.clean_nees_share),
            percent(row.detected_share),
            toned(row.meets_share),
        ]
    };
    table::table(&Table {
        title: format!("{name}: {}", part.title),
        caption: "Medians over runs; the NEES is a mean. Without a recovery: half of the runs or more are not back within the minute.".to_owned(),
        columns: elements::columns(&columns),
        rows: rows.iter().map(line).collect(),
    })
}

fn alarms(outcome: &CampaignOutcome) -> String {
    let columns = [
        ["estimator", ""],
        ["data", "h"],
        ["alarms", ""],
        ["alarms an hour", ""],
    ];
    table::table(&Table {
        columns: elements::columns(&columns),
        rows: (outcome.alarms.iter())
            .map(|row| {
                vec![
                    Cell::text(format!("{}, {}", row.estimator, row.origin.name())),
                    Cell::number(Some(row.hours), 2),
                    elements::count(row.alarms),
                    Cell::number(Some(row.per_hour), 1),
                ]
            })
            .collect(),
        ..Table::default()
    })
}

/// The figure of a run: the error without and with the fault, which is marked, and the NEES.
fn figure_of(run: &DrawnRun) -> String {
    let judgement = &run.judgement;
    let what = format!(
        "{}: {}, {}.",
        judgement.fault, judgement.estimator, judgement.stream
    );
    let cost = judgement.cost.filter(|cost| cost.is_finite());
    let cost = cost.map(|cost| format!("{cost:.1} times the clean RMS"));
    let fault = InjectedFault::named(judgement.fault);
    let sentence = if fault.is_some_and(InjectedFault::is_one_sample) {
        let cost = cost.unwrap_or_else(|| "No estimate afterwards".to_owned());
        format!("{cost} (at most {MOST_COST}).")
    } else {
        let recovery = match judgement.recovery_s {
            Some(time) => {
                format!("Within the limit after {time:.1} s (at most {RECOVERY_S:.0} s).")
            }
            None => "Not within the limit in the minute after.".to_owned(),
        };
        cost.map_or_else(|| recovery.clone(), |cost| format!("{cost}. {recovery}"))
    };
    html::figure(figure(run), &what, &sentence)
}

fn line(track: &Track, of: fn(&Instant) -> Option<f64>) -> Vec<Point> {
    elements::line_within(DRAWN, track.instants.iter().map(|i| (i.time_s, of(i))))
}

fn panel(run: &DrawnRun, title: &str, unit: &str, of: fn(&Instant) -> Option<f64>) -> Panel {
    let lines = [&run.clean, &run.faulty].map(|track| line(track, of));
    let [low, high] = elements::logarithmic_ends(&lines, [1.0, 10.0]);
    let [from, mut until] = [run.judgement.from_s, run.judgement.until_s];
    if InjectedFault::named(run.judgement.fault).is_some_and(InjectedFault::stays) {
        let last = run.faulty.instants.last();
        until = last.map_or(until, |last| last.time_s);
    }
    // One sample has no width of its own.
    let span = [from, until.max(from + 0.5)].map(|t| [t, low, high]);
    let [clean, faulty] = lines;
    let layers = vec![
        Layer::band(span.into(), false),
        Layer::line(clean, "s5 thin", false),
        Layer::line(faulty, "s1", false),
    ];
    Panel::new(title, unit, Axis::logarithmic(low, high), layers).height(130.0)
}

fn figure(run: &DrawnRun) -> Figure {
    let attitude = run.judgement.question == Question::Attitude;
    let (title, unit) = if attitude {
        ("attitude error", "deg (logarithmic)")
    } else {
        ("horizontal error", "m (logarithmic)")
    };
    let mut error = panel(run, title, unit, |i| Some(i.error));
    if attitude {
        error.layers.push(Layer::rule(
            RECOVERED_DEG,
            format!("{RECOVERED_DEG:.0}\u{00b0}"),
        ));
    }
    let instants = || run.clean.instants.iter().chain(&run.faulty.instants);
    let ends = instants().fold([f64::MAX, 0.0_f64], |[a, b], i| {
        [a.min(i.time_s), b.max(i.time_s)]
    });
    let mut panels = vec![error];
    if instants().any(|i| i.nees.is_some()) {
        panels.push(panel(
            run,
            "NEES per degree of freedom",
            "logarithmic",
            |i| i.nees,
        ));
    }
    elements::over_time(
        format!("{} of {}", run.judgement.fault, run.judgement.estimator),
        [ends[0].min(ends[1]), ends[1]],
        vec![
            line_key("s1", "with the fault"),
            line_key("s5 thin", "without it"),
            key(Sign::Band, "band estimate-fill", "the fault"),
        ],
        panels,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::EstimatorKind;
    use northing_experiments::faults::{Campaign, Subject};

    #[test]
    fn the_page_has_a_table_a_colour_and_a_picture() {
        let campaign = Campaign {
            subjects: vec![Subject::Attitude(EstimatorKind::Mekf3)],
            faults: vec![InjectedFault::named("gyroscope-bias-0.05").unwrap()],
            ..Campaign::of_worlds(1, 1)
        };
        let outcome = campaign.run(&|| ());
        let drawn: Vec<_> = outcome
            .worst
            .iter()
            .filter_map(|j| campaign.again(j))
            .collect();
        assert_eq!(drawn.len(), 1);
        assert_eq!(drawn[0].judgement, outcome.worst[0]);
        let page = render(&outcome, &drawn, Some("northing experiment faults"));
        for part in [
            "num toned bad",
            "gyroscope-bias-0.05 of mekf3",
            "does an estimator recover?",
            "misses the limits",
            "northing experiment faults",
        ] {
            assert!(page.contains(part), "{part}");
        }
        // The limit of one bad sample is none of a fault that lasts.
        assert!(!page.contains("(at most 1.2)") && page.contains("Not within the limit"));
        assert!(!page.contains("NaN") && !page.contains("inf\""));
    }
}
