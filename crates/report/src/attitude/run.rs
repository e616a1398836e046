//! The report of one run: its sections, in the order in which a reader asks.

use std::fmt::Write as _;

use super::angle_plots;
use crate::attitude::innovation_plots::{self, Updates};
use crate::attitude::position_plots;
use crate::attitude::run_report::{FinalTest, RunReport, SensorUpdates};
use crate::drawing::curves::short;
use crate::drawing::svg::escape;
use crate::page::facts::Fact;
use crate::page::html::{self, Frame, Page};
use crate::page::setup::OPENS;
use crate::page::table::{self, Cell, Column, Table};

impl RunReport<'_> {
    /// The report as one HTML page that needs nothing else, usually below 1 MB.
    #[must_use]
    pub fn render(&self) -> String {
        render(self)
    }
}

fn render(report: &RunReport<'_>) -> String {
    let mut page = Page::default();
    let updates = innovation_plots::updates(report.trace);
    page.section("attitude", "Attitude", &attitude(report));
    page.section("errors", "Errors", &errors(report));
    page.section("position", "Position", &position(report));
    page.section("innovations", "Innovations", &innovations(report, &updates));
    page.section("gates", "Gates", &gates(report, &updates));
    page.section("bias", "Gyroscope bias", &bias(report));
    if let Some(test) = &report.final_test {
        page.section("final-test", "Final test", &final_test(test));
    }
    page.section("recording", "Recording", &recording(report));
    page.section("settings", "Settings", &html::settings(&report.settings));
    page.section("again", "Run it again", &again(report));
    let lead: Vec<&str> = [report.recording.as_str(), report.estimator.as_str()]
        .into_iter()
        .filter(|text| !text.is_empty())
        .collect();
    page.finish(&Frame {
        kicker: "Northing \u{00b7} report of a run",
        title: &report.title,
        lead: &lead.join(" \u{00b7} "),
        summary: &report.summary,
        verdicts: &report.verdicts,
        recording: &report.recording,
        command: report.command.as_deref(),
        reading: html::ATTITUDE_READING,
    })
}

fn attitude(report: &RunReport<'_>) -> String {
    let Some(figure) = angle_plots::angles(report.trace, report.heading_offset_deg) else {
        return "<p>The run gave no estimate, so there is nothing to draw.</p>\n".to_owned();
    };
    html::figure(
        figure,
        "Which way it pointed, and how sure the filter is.",
        "Look whether the dashed reference stays inside the band; where no band can be seen, it \
         is narrower than the line. Lines stop at \u{00b1}180 deg and go on at the other side.",
    )
}

fn errors(report: &RunReport<'_>) -> String {
    let look = "Look whether the error fills the band without leaving it: leaving it means that the \
                filter is overconfident, staying far inside that it is conservative.";
    let offset = report.heading_offset_deg.map(|offset| {
        format!(
            " Nothing said where north is, so the heading counts from an arbitrary direction: the constant part of its \
             error, {offset:.1} deg, is taken out, and the band is that of the inclination alone."
        )
    });
    html::figure(
        angle_plots::errors(report.trace, report.heading_offset_deg),
        "The error, and the error that the filter predicted.",
        &format!("{look}{}", offset.unwrap_or_default()),
    )
}

fn position(report: &RunReport<'_>) -> String {
    let map = html::picture(
        position_plots::track(report.trace),
        "Where it was, seen from above.",
        "Look whether the line runs through the middle of the dots: a line that cuts corners or \
             swings past them says that the pole is too slow or too fast for these positions.",
    );
    let innovations = html::figure(
        position_plots::innovations(report.trace),
        "Measured minus estimated position.",
        "Innovations should scatter around zero without pattern, by about the error of the \
             positions. Waves mean that the attitude is off, or that the positions come late.",
    );
    map + &innovations
}

fn innovations(report: &RunReport<'_>, updates: &[Updates<'_>]) -> String {
    let mut content = String::new();
    for sensor in updates {
        let _ = writeln!(content, "<h3>{}</h3>", escape(&sensor.name()));
        let mut look = "Innovations should scatter around zero without pattern, nearly all inside \
                        the band, and the mean NIS should run along its expected value: above it \
                        the stated noise R is too small, below it too large."
            .to_owned();
        if sensor.thinned {
            look.push_str(" The recording is long: evenly picked measurements are drawn.");
        }
        content.push_str(&html::figure(
            innovation_plots::innovations(report.trace, sensor),
            "Measured minus predicted, against what the filter expected.",
            &look,
        ));
    }
    content
}

fn gates(report: &RunReport<'_>, updates: &[Updates<'_>]) -> String {
    let figure = html::figure(
        innovation_plots::gates(report.trace, updates),
        "When the gates refused measurements.",
        "Short bursts are disturbances kept out, as they should be; long stretches near \
             100 % mean that the filter and the sensor no longer agree.",
    );
    figure + &update_table(&report.updates)
}

fn update_table(updates: &[SensorUpdates]) -> String {
    let optional = |v: Option<f64>| v.filter(|v| v.is_finite()).map_or("\u{2013}".into(), short);
    let row = |u: &SensorUpdates| {
        let seen = (u.fused + u.gated).max(1);
        let share = 100.0 * u.gated as f64 / seen as f64;
        let cells = [
            u.sensor.clone(),
            grouped(u.fused),
            grouped(u.gated),
            format!("{share:.1} %"),
            grouped(u.skipped),
            optional(u.nis_mean),
            optional(u.nis_expected),
        ];
        cells.map(Cell::Text).into()
    };
    let columns = [
        "Sensor",
        "Used",
        "Refused",
        "Refused of those seen",
        "Skipped",
        "Mean NIS",
        "Expected",
    ];
    table::table(&Table {
        columns: columns.map(|name| Column::new(name, "", None)).into(),
        rows: updates.iter().map(row).collect(),
        ..Table::default()
    })
}

/// A count with thin spaces between groups of three digits.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

fn bias(report: &RunReport<'_>) -> String {
    html::figure(
        angle_plots::bias(report.trace),
        "What the filter thinks the gyroscope reads at rest.",
        "Look for a curve that settles while its band narrows; a bias that drifts outside of its \
         earlier band says that the bias random walk is set too small.",
    )
}

fn final_test(test: &FinalTest) -> String {
    let degrees = |v: Option<f64>| {
        v.filter(|v| v.is_finite())
            .map(|v| format!("{} deg", short(v)))
    };
    let mut facts = Vec::new();
    let mut add = |label: &str, value: Option<String>| {
        facts.extend(value.map(|value| Fact::new(label, value)));
    };
    add(
        "calculated error (angle of the error quaternion)",
        degrees(test.calculated_error_deg),
    );
    add(
        "estimated error (root of the trace of P at both ends)",
        degrees(test.estimated_error_deg),
    );
    let axes = test
        .axis_std_deg
        .filter(|s| s.iter().all(|v| v.is_finite()));
    add(
        "standard deviation about x, y, z",
        axes.map(|s| format!("{}, {}, {} deg", short(s[0]), short(s[1]), short(s[2]))),
    );
    if let Some([calculated, estimated]) = test.tilt_deg {
        add("calculated tilt error", degrees(Some(calculated)));
        add("estimated tilt error", degrees(Some(estimated)));
    }
    let nees = test.nees.filter(|v| v.is_finite());
    let label = match test.tilt_deg {
        Some(_) => "NEES of the tilt (0.051 to 7.38 in 95 % of cases)",
        None => "NEES (0.22 to 9.35 in 95 % of cases)",
    };
    add(label, nees.map(short));
    let verdict: Vec<_> = test.verdict.iter().cloned().collect();
    format!(
        "<p>The device is put back where it started. What the estimate then says it turned by is \
         the calculated error; what the filter believes is the estimated one.</p>\n{}{}\
         <p class=\"small\">Putting a device back by hand is good to 0.5 to 1 deg, often far more \
         than the filter\u{2019}s own standard deviation: a calculated error of that size is the \
         hand\u{2019}s, not the filter\u{2019}s.</p>\n",
        html::verdicts(&verdict),
        html::fact_table(&facts)
    )
}

fn recording(report: &RunReport<'_>) -> String {
    let mut content = html::fact_table(&report.recording_facts);
    if !report.issues.is_empty() {
        content.push_str("<h3>What was odd about it</h3>\n");
        content.push_str(&html::sentences(&report.issues));
    }
    content
}

/// How somebody else gets the same digits.
fn again(report: &RunReport<'_>) -> String {
    let (Some(setup), Some(command)) = (&report.setup, &report.command) else {
        return String::new();
    };
    format!(
        "<p>With this page and the recording anybody gets the same digits:</p>\n\
         <p><code>{}</code></p>\n\
         <details><summary>Everything the run depends on beside the recording</summary>\n\
         {OPENS}{}</pre>\n</details>\n",
        escape(command),
        // Lines stay lines, which escaping by itself would not keep.
        setup.lines().map(escape).collect::<Vec<_>>().join("\n")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_grouped_by_three() {
        let written = [0, 999, 1000, 12_345_678].map(grouped);
        assert_eq!(
            written,
            ["0", "999", "1\u{202f}000", "12\u{202f}345\u{202f}678"]
        );
    }
}
