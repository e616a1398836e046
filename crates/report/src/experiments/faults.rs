//! The report of the fault campaign: which faults which estimators survive, how the default ones recover, and the worst runs over time.

use crate::drawing::axis::Axis;
use crate::drawing::plot::{Figure, Layer, Panel, Sign, key, line_key};
use crate::page::facts::{Fact, Tone, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table::{self, Cell, Column, Table};
use northing_evaluation::registry::Question;
use northing_experiments::faults::{
    CampaignOutcome, DrawnRun, FaultRow, Instant, MOST_COST, Origin, RECOVERED_DEG, RECOVERY_S,
    Track,
};
use northing_simulation::fault_injection::CATALOGUE;

/// Points drawn at most of one line.
const LINE_POINTS: usize = 600;
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
    let shares: String = parts(outcome)
        .map(|(title, rows)| shares(title, &rows))
        .collect();
    page.section("limits", "Who survives what", &shares);
    let details: String = parts(outcome)
        .map(|(title, rows)| details(title, &rows))
        .collect();
    page.section("defaults", "The default estimators", &details);
    page.section("alarms", "False alarms on clean data", &alarms(outcome));
    let worst: String = drawn.iter().map(figure_of).collect();
    page.section("worst", "Runs that miss the limits by most", &worst);
    let lead = format!("{} runs, seed {}", outcome.runs.len(), outcome.seed);
    page.finish(&Frame {
        kicker: "Northing \u{00b7} experiment",
        title: "Faults of sensors: what does each cost, and does an estimator recover?",
        lead: &lead,
        summary: &facts(outcome),
        verdicts: &verdicts(outcome),
        recording: "",
        command,
        reading: READING,
    })
}

/// Rows of each question and origin that has some, with a title.
fn parts(
    outcome: &CampaignOutcome,
) -> impl Iterator<Item = (&'static str, Vec<&FaultRow>)> + use<'_> {
    let parts = [
        (
            "Attitude, simulated worlds",
            Question::Attitude,
            Origin::Simulated,
        ),
        ("Attitude, recordings", Question::Attitude, Origin::Recorded),
        (
            "Navigation, simulated worlds",
            Question::Navigation,
            Origin::Simulated,
        ),
        (
            "Navigation, recordings",
            Question::Navigation,
            Origin::Recorded,
        ),
    ];
    let rows = |(title, question, origin)| (title, outcome.table(question, origin).collect());
    parts
        .into_iter()
        .map(rows)
        .filter(|(_, rows): &(_, Vec<_>)| !rows.is_empty())
}

fn tone(share: f64) -> Tone {
    match share {
        s if s >= GOOD => Tone::Good,
        s if s >= POOR => Tone::Warn,
        _ => Tone::Bad,
    }
}

fn facts(outcome: &CampaignOutcome) -> Vec<Fact> {
    let mut facts = vec![Fact::new("runs", outcome.runs.len().to_string())];
    for (title, rows) in parts(outcome) {
        let first = rows.first().map(|row| row.estimator);
        let of: Vec<_> = rows
            .iter()
            .filter(|row| Some(row.estimator) == first)
            .collect();
        let met = of.iter().filter(|row| row.meets_share >= GOOD).count();
        let name = first.unwrap_or_default();
        facts.push(Fact::new(
            format!("{name}: faults survived ({})", title.to_lowercase()),
            format!("{met} of {}", of.len()),
        ));
    }
    facts
}

/// What the default estimators do, sentence by sentence.
fn verdicts(outcome: &CampaignOutcome) -> Vec<Verdict> {
    let sentence = |(title, rows): (&str, Vec<&FaultRow>)| {
        let first = rows.first().map(|row| row.estimator);
        let of: Vec<_> = rows
            .into_iter()
            .filter(|row| Some(row.estimator) == first)
            .collect();
        let missed: Vec<_> = of.iter().filter(|row| row.meets_share < GOOD).collect();
        let name = first.unwrap_or_default();
        let text = if missed.is_empty() {
            format!(
                "{title}: {name} meets the limits after every fault, in 95 % of the runs or more."
            )
        } else {
            let names: Vec<_> = missed.iter().map(|row| row.fault).collect();
            format!(
                "{title}: {name} misses the limits in more than 5 % of the runs after {}.",
                names.join(", ")
            )
        };
        let share = 1.0 - missed.len() as f64 / of.len().max(1) as f64;
        Verdict::new(tone(share), text)
    };
    parts(outcome).map(sentence).collect()
}

/// A row a fault, a column an estimator, coloured by the share of runs that meet the limits.
fn shares(title: &str, rows: &[&FaultRow]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.estimator) {
            names.push(row.estimator);
        }
    }
    let cell = |fault: &str, name: &str| {
        let mut rows = rows.iter();
        let row = rows.find(|row| row.fault == fault && row.estimator == name);
        row.map_or(Cell::Missing, |row| Cell::Toned {
            value: 100.0 * row.meets_share,
            tone: tone(row.meets_share),
        })
    };
    let faults = CATALOGUE.iter().map(|fault| fault.name);
    let faults = faults.filter(|name| rows.iter().any(|row| row.fault == *name));
    let line = |fault: &str| {
        let cells = names.iter().map(|name| cell(fault, name));
        core::iter::once(Cell::text(fault)).chain(cells).collect()
    };
    table::table(&Table {
        title: title.to_owned(),
        caption: format!(
            "Share of the runs that meet the limits, %; {} runs of each.",
            rows.first().map_or(0, |row| row.runs)
        ),
        columns: core::iter::once("fault")
            .chain(names.iter().copied())
            .map(|name| Column::new(name, "", None))
            .collect(),
        rows: faults.map(line).collect(),
    })
}

/// A row a fault of the first estimator.
fn details(title: &str, rows: &[&FaultRow]) -> String {
    let Some(name) = rows.first().map(|row| row.estimator) else {
        return String::new();
    };
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
    let percent = |share: Option<f64>| Cell::number(share.map(|share| 100.0 * share), 0);
    let line = |row: &&&FaultRow| {
        vec![
            Cell::text(row.fault),
            Cell::number(Some(row.runs as f64), 0),
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
            Cell::Toned {
                value: 100.0 * row.meets_share,
                tone: tone(row.meets_share),
            },
        ]
    };
    table::table(&Table {
        title: format!("{name}: {}", title.to_lowercase()),
        caption: "Medians over runs; the NEES is a mean. Without a recovery: half of the runs or more are not back within the minute.".to_owned(),
        columns: columns.iter().map(|[name, unit]| Column::new(*name, *unit, None)).collect(),
        rows: rows.iter().filter(|row| row.estimator == name).map(|row| line(&row)).collect(),
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
        columns: columns
            .iter()
            .map(|[name, unit]| Column::new(*name, *unit, None))
            .collect(),
        rows: (outcome.alarms.iter())
            .map(|row| {
                let origin = match row.origin {
                    Origin::Simulated => "simulated worlds",
                    Origin::Recorded => "recordings",
                };
                vec![
                    Cell::text(format!("{}, {origin}", row.estimator)),
                    Cell::number(Some(row.hours), 2),
                    Cell::number(Some(row.alarms as f64), 0),
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
    let cost = cost.map_or_else(String::new, |cost| {
        format!("{cost:.1} times the clean RMS (at most {MOST_COST} after one bad sample). ")
    });
    let recovery = match judgement.recovery_s {
        Some(time) => format!("Within the limit after {time:.1} s (at most {RECOVERY_S:.0} s)."),
        None => "Not within the limit in the minute after.".to_owned(),
    };
    html::figure(figure(run), &what, &format!("{cost}{recovery}"))
}

type Line = Vec<[f64; 2]>;

fn line(track: &Track, of: impl Fn(&Instant) -> Option<f64>) -> Line {
    let shown = |value: f64| value.clamp(DRAWN[0], DRAWN[1]);
    let point = |i: &Instant| [i.time_s, of(i).map_or(f64::NAN, shown)];
    track.instants.iter().map(point).collect()
}

fn panel(run: &DrawnRun, title: &str, unit: &str, of: fn(&Instant) -> Option<f64>) -> Panel {
    let [clean, faulty] = [&run.clean, &run.faulty].map(|track| line(track, of));
    let values = || {
        clean
            .iter()
            .chain(&faulty)
            .map(|p| p[1])
            .filter(|v| v.is_finite())
    };
    let low = values().fold(1.0, f64::min);
    let high = values().fold(10.0, f64::max);
    let [from, until] = [run.judgement.from_s, run.judgement.until_s];
    // One sample has no width of its own.
    let span = [from, until.max(from + 0.5)].map(|t| [t, 0.8 * low, 1.2 * high]);
    let layers = vec![
        Layer::band(span.into(), false),
        Layer::line(clean, "s5 thin", false),
        Layer::line(faulty, "s1", false),
    ];
    Panel::new(
        title,
        unit,
        Axis::logarithmic(0.8 * low, 1.2 * high),
        layers,
    )
    .height(130.0)
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
        error.layers.push(Layer::rule(RECOVERED_DEG, "limit"));
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
    let figure = Figure::new(
        format!("{} of {}", run.judgement.fault, run.judgement.estimator),
        Axis::time(ends[0].min(ends[1]), ends[1], 10),
        vec![
            line_key("s1", "with the fault"),
            line_key("s5 thin", "without it"),
            key(Sign::Band, "band estimate-fill", "the fault"),
        ],
        panels,
    );
    Figure {
        line_points: LINE_POINTS,
        ..figure
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::EstimatorKind;
    use northing_experiments::faults::{Campaign, Subject};
    use northing_simulation::fault_injection::InjectedFault;

    #[test]
    fn the_page_has_a_table_a_colour_and_a_picture() {
        let campaign = Campaign {
            subjects: vec![Subject::Attitude(EstimatorKind::Integration)],
            faults: vec![InjectedFault::named("gyroscope-bias-0.1").unwrap()],
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
            "gyroscope-bias-0.1 of integration",
            "does an estimator recover?",
            "misses the limits",
            "northing experiment faults",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("NaN") && !page.contains("inf\""));
    }
}
