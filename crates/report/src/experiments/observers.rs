//! The report of the experiment on observers in cascade: errors, gains and costs of each condition.

use super::elements;
use crate::drawing::axis::{Axis, extent};
use crate::drawing::plot::{Sign, key};
use crate::drawing::rows::{Row, Rows};
use crate::page::facts::{Fact, Tone, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table::{self, Best, Cell, Column, Table};
use northing_experiments::observers::experiment::{Comparison, Condition, ExperimentOutcome};

/// Room at the left for names of conditions, and at the right for numbers.
const MARGINS: [f64; 2] = [390.0, 120.0];
/// Height of a row.
const ROW: f64 = 40.0;
/// Smallest error shown, deg.
const LEAST_DEG: f64 = 0.05;
/// Gains below are drawn at the left edge, percent.
const LEAST_GAIN: f64 = -200.0;

/// What the words of the page mean.
const READING: &str = "Original: explicit complementary filter. Modified: passive filter behind a quaternion EKF. \
     EKF: that filter alone. Errors are root mean square over flights, or the mean over recordings, with 95 % \
     intervals from drawing the flights anew; gains compare modified with original.";

/// The report as one HTML page that needs nothing else.
#[must_use]
pub fn render(outcome: &ExperimentOutcome, command: Option<&str>) -> String {
    let mut page = Page::default();
    let conditions = &outcome.conditions;
    page.section("gain", "What the modification gains", &gains(conditions));
    page.section("errors", "Errors", &errors(conditions));
    let tables = [
        comparison_table(
            "Tuned, as the literature prints them",
            "Gains chosen on one half of the flights or recordings, errors of the other half.",
            conditions,
            |c| &c.tuned,
        ),
        comparison_table(
            "At the literature's gains",
            "Attitude gain 1, bias gain 0.3.",
            conditions,
            |c| &c.default,
        ),
        comparison_table(
            "Tuned, in Northing's forms",
            "Each sample is compared with the estimate of its own instant, and the EKF's covariance is projected as its \
             quaternion is normalised.",
            conditions,
            |c| &c.northing,
        ),
        cost_table(outcome),
        settings_table(conditions),
    ];
    let tables: String = tables.iter().map(table::table).collect();
    page.section("numbers", "Numbers", &tables);
    let lead = format!(
        "{} conditions, {} flights scored in each simulated one, seed {}",
        conditions.len(),
        outcome.flights,
        outcome.seed
    );
    page.finish(&Frame {
        kicker: elements::KICKER,
        title: "Observers in cascade: is the modification worth it?",
        lead: &lead,
        summary: &facts(outcome),
        verdicts: &verdicts(outcome),
        recording: "",
        command,
        reading: READING,
    })
}

/// Conditions by the interval of the gain: better, worse, undecided.
#[must_use]
fn count_by_gain(conditions: &[Condition]) -> [usize; 3] {
    let better = conditions.iter().filter(|c| c.tuned.gain_ci95[0] > 0.0);
    let worse = conditions.iter().filter(|c| c.tuned.gain_ci95[1] < 0.0);
    let (better, worse) = (better.count(), worse.count());
    [better, worse, conditions.len() - better - worse]
}

/// What the experiment answers, sentence by sentence.
#[must_use]
pub fn verdicts(outcome: &ExperimentOutcome) -> Vec<Verdict> {
    let conditions = &outcome.conditions;
    let [better, worse, undecided] = count_by_gain(conditions);
    let range = |of: fn(&Condition) -> f64| extent(conditions.iter().map(of));
    let (low, high) = range(|c| c.tuned.gain_percent);
    let cost = &outcome.cost_ns;
    let ekf_as_good = conditions
        .iter()
        .filter(|c| c.tuned.ekf_deg <= 1.05 * c.tuned.modified_deg);
    let answer = if low >= 40.0 {
        "Yes"
    } else if high < 40.0 {
        "No"
    } else {
        "Not in general"
    };
    let times = cost.modified / cost.original;
    let cheap = times <= 1.21;
    vec![
        Verdict::new(
            if worse == 0 { Tone::Good } else { Tone::Warn },
            format!(
                "Is it 40 % better? {answer}: the gain goes from {low:.0} to {high:.0} %. Conditions in which the modification \
                 is better: {better}; worse: {worse}; in which the interval holds zero: {undecided}."
            ),
        ),
        Verdict::new(
            if cheap { Tone::Good } else { Tone::Warn },
            format!(
                "For 21 % more time? {}: a step costs {times:.1} times the original's ({:.0} against {:.0} ns).",
                if cheap { "Yes" } else { "No" },
                cost.modified,
                cost.original
            ),
        ),
        Verdict::new(
            Tone::Good,
            format!(
                "The EKF alone is as good as the modified scheme, within 5 %, or better in {} of {} conditions.",
                ekf_as_good.count(),
                conditions.len()
            ),
        ),
    ]
}

fn facts(outcome: &ExperimentOutcome) -> Vec<Fact> {
    let mut gains: Vec<f64> = outcome
        .conditions
        .iter()
        .map(|c| c.tuned.gain_percent)
        .collect();
    gains.sort_by(f64::total_cmp);
    let median = gains.get(gains.len() / 2).copied().unwrap_or(f64::NAN);
    vec![
        Fact::new("median gain", format!("{median:.0} %")),
        Fact::new(
            "cost of a step",
            format!(
                "{:.1} times",
                outcome.cost_ns.modified / outcome.cost_ns.original
            ),
        ),
        Fact::new("conditions", outcome.conditions.len().to_string()),
    ]
}

/// A mark of an interval plot: value, interval, class of the colour.
type Mark = (f64, [f64; 2], &'static str);

/// Intervals in rows, one row a condition.
fn intervals(rows: &Rows<'_, Vec<Mark>>) -> String {
    rows.render(|svg, x, top, marks| {
        let step = ROW / (marks.len() as f64 + 1.0);
        for (k, (value, [low, high], class)) in marks.iter().enumerate() {
            let y = top + (k as f64 + 1.0) * step;
            let interval = vec![[x(*low), y], [x(*high), y]];
            svg.lines(&[interval], &format!("line bold {class}"));
            svg.dots(&[[x(*value), y]], &format!("dots big {class}"));
        }
    })
}

fn row<'a>(condition: &'a Condition, marks: Vec<Mark>, note: String) -> Row<'a, Vec<Mark>> {
    Row {
        name: &condition.title,
        class: "tick end".to_owned(),
        note,
        marks,
    }
}

fn gains(conditions: &[Condition]) -> String {
    if conditions.is_empty() {
        return String::new();
    }
    let bounds = |c: &Condition| c.tuned.gain_ci95.map(|b| b.max(LEAST_GAIN));
    let low = conditions
        .iter()
        .map(|c| bounds(c)[0])
        .fold(-20.0, f64::min);
    let rows = conditions.iter().map(|c| {
        let gain = c.tuned.gain_percent.max(LEAST_GAIN);
        let note = format!("{:+.0} %", c.tuned.gain_percent);
        row(c, vec![(gain, bounds(c), "s0")], note)
    });
    let svg = intervals(&Rows {
        margins: MARGINS,
        height: ROW,
        label: "Gain of the modified scheme over the original in each condition",
        unit: "smaller error of the modified scheme, % (both tuned)",
        axis: Axis::linear(low, 100.0, 7),
        rules: &[0.0, 40.0],
        rows: rows.collect(),
        legend: Vec::new(),
    });
    html::picture(
        svg,
        "One row for each condition.",
        "Dashed: no gain, and the 40 % that were claimed. A bar that reaches over zero says that other flights might decide otherwise; right of it the modified \
         scheme is better, left of it worse.",
    )
}

fn errors(conditions: &[Condition]) -> String {
    let all = || {
        let marks = |c: &Condition| [c.tuned.original_deg, c.tuned.modified_deg, c.tuned.ekf_deg];
        conditions.iter().flat_map(marks).filter(|e| e.is_finite())
    };
    let Some(high) = all().max_by(f64::total_cmp) else {
        return String::new();
    };
    let low = all().fold(high, f64::min).max(LEAST_DEG);
    let rows = conditions.iter().map(|c| {
        let t = &c.tuned;
        let marks = vec![
            (t.original_deg, t.original_ci95, "s0"),
            (t.modified_deg, t.modified_ci95, "s1"),
            (t.ekf_deg, t.ekf_ci95, "s2"),
        ];
        let note = format!(
            "{:.1} {:.1} {:.1}",
            t.original_deg, t.modified_deg, t.ekf_deg
        );
        row(c, marks, note)
    });
    let svg = intervals(&Rows {
        margins: MARGINS,
        height: ROW,
        label: "Errors of original, modified and EKF in each condition",
        unit: "error, deg (logarithmic)",
        axis: Axis::logarithmic(0.7 * low, 1.4 * high).with_fine_ticks(),
        rules: &[],
        rows: rows.collect(),
        legend: vec![
            key(Sign::Line, "line bold s0", "original"),
            key(Sign::Line, "line bold s1", "modified"),
            key(Sign::Line, "line bold s2", "EKF alone"),
        ],
    });
    html::picture(
        svg,
        "Error of the three schemes, each tuned.",
        "Where only the accelerometer is used it is the inclination that counts: without a magnetometer nobody knows the \
         heading.",
    )
}

fn comparison_table(
    title: &str,
    text: &str,
    conditions: &[Condition],
    of: impl Fn(&Condition) -> &Comparison,
) -> Table {
    let best = Some(Best::LowestOfRow);
    let rows = conditions.iter().map(|condition| {
        let c = of(condition);
        let [low, high] = c.gain_ci95;
        vec![
            Cell::text(&condition.title),
            Cell::number(Some(c.original_deg), 2),
            Cell::number(Some(c.modified_deg), 2),
            Cell::number(Some(c.ekf_deg), 2),
            Cell::number(Some(c.gain_percent), 0),
            Cell::text(format!("{low:.0} to {high:.0}")),
            Cell::number(c.position_gain_percent, 0),
            Cell::number(c.velocity_gain_percent, 0),
        ]
    });
    Table {
        title: title.to_owned(),
        caption: text.to_owned(),
        columns: vec![
            Column::new("condition", "", None),
            Column::new("original", "deg", best),
            Column::new("modified", "deg", best),
            Column::new("EKF", "deg", best),
            Column::new("gain", "%", None),
            Column::new("95 %", "%", None),
            Column::new("in position", "%", None),
            Column::new("in velocity", "%", None),
        ],
        rows: rows.collect(),
    }
}

fn cost_table(outcome: &ExperimentOutcome) -> Table {
    let cost = &outcome.cost_ns;
    let row = |name: &str, ns: Option<f64>| {
        vec![
            Cell::text(name),
            Cell::number(ns, 0),
            Cell::number(ns.map(|ns| ns / cost.original), 1),
        ]
    };
    Table {
        title: "Cost of a step".to_owned(),
        caption: format!(
            "One gyroscope sample with the other sensors of {}, on this machine; only ratios travel.",
            outcome.cost_of
        ),
        columns: elements::columns(&[["scheme", ""], ["time", "ns"], ["times the original", ""]]),
        rows: vec![
            row("original", Some(cost.original)),
            row("modified", Some(cost.modified)),
            row("EKF alone", Some(cost.ekf)),
            row("original with position observer (cascade)", cost.cascade),
            row(
                "modified with position observer (cascade-ekf)",
                cost.cascade_ekf,
            ),
        ],
    }
}

fn settings_table(conditions: &[Condition]) -> Table {
    let gains = |g: &northing_experiments::observers::Gains| {
        format!("{} / {}", g.attitude_gain, g.bias_gain)
    };
    let rows = conditions.iter().map(|c| {
        let ekf = |g: &northing_experiments::observers::Gains| {
            format!("{:.2} / {}", g.linear_acceleration_std, g.field_std)
        };
        vec![
            Cell::text(&c.title),
            Cell::text(gains(&c.gains.original)),
            Cell::text(gains(&c.gains.modified)),
            Cell::text(ekf(&c.gains.modified)),
            Cell::text(ekf(&c.gains.ekf)),
            Cell::number(Some(c.original_weighted_deg), 2),
            Cell::text(c.original_weighted_gains.accelerometer_weight.to_string()),
        ]
    });
    Table {
        title: "What tuning chose".to_owned(),
        caption: "Attitude gain (1/s) / bias gain (1/s^2); for the EKF the acceleration it expects (m/s^2) / the error of the \
                  field (uT). Re-weighted: the original with the weight of its accelerometer tuned too."
            .to_owned(),
        columns: elements::columns(&[
            ["condition", ""],
            ["original", ""],
            ["modified", ""],
            ["its EKF", ""],
            ["EKF alone", ""],
            ["re-weighted original", "deg"],
            ["with weight", ""],
        ]),
        rows: rows.collect(),
    }
}
