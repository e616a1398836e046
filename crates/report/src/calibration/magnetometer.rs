//! The report of a magnetometer calibration: directions seen, strength before and after.

use std::fmt::Write as _;

use northing_core::calibration::magnetometer::coverage::{SECTORS, SLICES};

use crate::drawing::axis::{Axis, reach};
use crate::drawing::plot::{DOTS, Figure, Layer, Panel, Sign, WIDTH, key};
use crate::drawing::svg::Svg;
use crate::page::facts::{Fact, Source, Tone, Verdict};
use crate::page::html::{self, Frame, Page};
use northing_evaluation::calibration::magnetometer::MagnetometerReport;

/// Room at the left and right of the map of directions, and below it.
const MARGINS: [f64; 3] = [64.0, 14.0, 52.0];
/// Height of the map of directions.
const MAP: f64 = 300.0;

/// The page about a magnetometer calibration.
#[must_use]
pub fn render(report: &MagnetometerReport, source: &Source<'_>) -> String {
    let mut page = Page::default();
    page.section("coverage", "Directions seen", &coverage(report));
    page.section("strength", "Strength of the field", &strength(report));
    page.section("numbers", "Numbers", &numbers(report));
    let c = &report.field.calibration;
    let facts = [
        Fact::new("model", c.model.name()),
        Fact::new("hard iron", format!("{:.1} uT", c.hard_iron().norm())),
        Fact::new(
            "scatter before",
            format!("{:.2} uT", c.uncalibrated_norm_std_ut),
        ),
        Fact::new("scatter after", format!("{:.2} uT", c.residual_std_ut)),
        Fact::new("directions seen", format!("{:.0} %", 100.0 * c.coverage)),
        Fact::new("duration", format!("{:.1} s", report.duration_s)),
    ];
    let verdict = Verdict::new(Tone::Good, report.sentences.join(" "));
    page.finish(&Frame {
        kicker: "Northing \u{00b7} magnetometer calibration",
        title: &format!("Magnetometer of {}", source.recording),
        lead: &format!("stream: {}", report.field.magnetometer.name()),
        summary: &facts,
        verdicts: &[verdict],
        recording: source.recording,
        command: source.command,
        reading: "calibrated = soft iron \u{00b7} (measured \u{2212} hard iron), in the axes of the device; \
                  the strength of the Earth\u{2019}s field is 22 to 67 uT.",
    })
}

/// Where the field came from, as the device saw it: a map of equal areas, azimuth across and the
/// z component upwards.
fn coverage(report: &MagnetometerReport) -> String {
    let [left, right, below] = MARGINS;
    let width = WIDTH - left - right;
    let mut svg = Svg::picture(WIDTH, MAP + below, "Directions of the field that were seen");
    svg.open_window(left, 0.0, width, MAP);
    let cell = [width / SECTORS as f64, MAP / SLICES as f64];
    for (index, count) in report.cells.iter().enumerate() {
        let (slice, sector) = (index / SECTORS, index % SECTORS);
        let corner = [
            sector as f64 * cell[0],
            (SLICES - 1 - slice) as f64 * cell[1],
        ];
        svg.rectangle(corner, cell, 0.0, "frame");
        if *count > 0 {
            svg.rectangle(corner, cell, 0.0, "estimate-fill band");
        }
    }
    let edges = |n: usize, step: f64| (1..n).map(move |k| k as f64 * step);
    let columns = edges(SECTORS, cell[0]).map(|x| vec![[x, 0.0], [x, MAP]]);
    let rows = edges(SLICES, cell[1]).map(|y| vec![[0.0, y], [width, y]]);
    svg.lines(&columns.chain(rows).collect::<Vec<_>>(), "grid");
    let every = report.samples.len().div_ceil(DOTS).max(1);
    let dots = report.samples.iter().step_by(every);
    let dots: Vec<[f64; 2]> = dots
        .filter_map(|(_, field)| {
            let seen = (field - report.field.calibration.hard_iron()).try_normalize(0.0)?;
            let turn = seen.y.atan2(seen.x) / std::f64::consts::TAU + 0.5;
            Some([turn * width, (1.0 - seen.z) * 0.5 * MAP])
        })
        .collect();
    svg.dots(&dots, "dots estimate");
    svg.close();
    for (value, text) in Axis::degrees(-180.0, 180.0, 4).ticks() {
        let x = left + (value / 360.0 + 0.5) * width;
        let class = if value >= 180.0 {
            "tick end"
        } else {
            "tick mid"
        };
        svg.text([x, MAP + 20.0], class, &text);
    }
    for (value, text) in Axis::linear(-1.0, 1.0, 4).ticks() {
        let y = (1.0 - value) * 0.5 * MAP;
        svg.text([left - 9.0, (y + 4.8).clamp(12.0, MAP)], "tick end", &text);
    }
    let middle = [left + width / 2.0, MAP + 42.0];
    svg.text(
        middle,
        "unit mid",
        "azimuth about z, deg; upwards: z component of the direction",
    );
    svg.close();
    html::picture(
        svg.finish(),
        "From where the field came, as the device saw it.",
        "Every cell has the same share of the sphere. Look for large empty areas: what lies there was never \
         measured, and the calibration only guesses it.",
    )
}

fn strength(report: &MagnetometerReport) -> String {
    let c = &report.field.calibration;
    let scale = c.radius_ut / c.field_strength_ut;
    let raw = report.samples.iter().map(|(t, field)| [*t, field.norm()]);
    let mended = report
        .samples
        .iter()
        .map(|(t, field)| [*t, c.residual(field) * scale]);
    let (raw, mended): (Vec<[f64; 2]>, Vec<[f64; 2]>) = (raw.collect(), mended.collect());
    let finite = |points: &[[f64; 2]]| {
        points
            .iter()
            .map(|p| p[1])
            .filter(|v| v.is_finite())
            .fold(0.0, f64::max)
    };
    let limit = reach(mended.iter().map(|p| p[1])).map_or(1.0, |r| r.limit);
    let rule = |value: f64, label: &str| Layer::Rule {
        value,
        label: label.to_owned(),
        class: "line rule",
    };
    let sigma = 3.0 * c.residual_std_ut;
    let (low, high) = (0.0, 1.05 * finite(&raw));
    let end = report.samples.last().map_or(1.0, |(t, _)| *t);
    let start = report.samples.first().map_or(0.0, |(t, _)| *t);
    let before = Panel::new(
        "As measured",
        "uT",
        Axis::linear(low, high, 5),
        vec![Layer::dots(raw, "gated"), rule(c.radius_ut, "fitted")],
    );
    let after = Panel::new(
        "Calibrated, minus the field\u{2019}s strength",
        "uT",
        Axis::linear(-1.1 * limit, 1.1 * limit, 5),
        vec![
            Layer::dots(mended, "estimate"),
            rule(sigma, "3\u{03c3}"),
            rule(-sigma, "\u{2212}3\u{03c3}"),
        ],
    );
    let figure = Figure::new(
        "Strength of the field before and after the calibration",
        Axis::time(start, end, 10),
        vec![
            key(Sign::Dot, "dots gated", "as measured"),
            key(Sign::Dot, "dots estimate", "calibrated"),
        ],
        vec![before, after],
    )
    .right(60.0);
    html::figure(
        figure,
        "The strength of the field while the device was turned.",
        "A good magnetometer shows the same strength in every direction. Look for slow waves that are left \
         after the calibration: iron or a magnet nearby, which no calibration takes away.",
    )
}

fn numbers(report: &MagnetometerReport) -> String {
    let c = &report.field.calibration;
    let three = |v: &[f64; 3]| v.map(|x| format!("{x:.3}")).join(", ");
    let mut facts = vec![
        Fact::new(
            "hard iron x, y, z",
            format!("{} uT", three(&c.hard_iron_ut)),
        ),
        Fact::new(
            "its standard deviation",
            format!("{} uT", three(&c.hard_iron_std_ut)),
        ),
    ];
    for (axis, row) in ["x", "y", "z"].iter().zip(&c.soft_iron) {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write!(text, "{:.5}, {:.5}, {:.5}", row[0], row[1], row[2]);
        facts.push(Fact::new(format!("soft iron, row {axis}"), text));
    }
    facts.extend([
        Fact::new(
            "length of a calibrated sample",
            format!("{:.2} uT", c.field_strength_ut),
        ),
        Fact::new("samples used", c.samples.to_string()),
        Fact::new("left out as outliers", c.rejected_samples.to_string()),
        Fact::new("repeated or no measurement", c.ignored_samples.to_string()),
        Fact::new(
            "condition number (3.2 is a full ellipsoid)",
            format!("{:.1}", c.condition_number),
        ),
    ]);
    html::fact_table(&facts)
}
