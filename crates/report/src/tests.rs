//! Tests of whole reports: what is present and absent, escaping, well-formedness, size.

use northing_core::kalman::{Outcome, SkipReason};

use super::*;
use crate::page::markup_checks::{
    assert_numbers_are_finite, assert_self_contained, assert_well_formed, attributes,
};
use northing_evaluation::Origin;
use northing_evaluation::UsedParameter;
use northing_evaluation::attitude::{InnovationPoint, PositionPoint, Trace, TracePoint};

/// A trace with everything in it: wrapping heading, a gap in the reference, gated updates.
fn full_trace(samples: u64, capacity: usize) -> Trace {
    let mut trace = Trace::new(capacity);
    for k in 0..samples {
        let t = k as f64 * 0.01;
        let heading = (t * 20.0 + 170.0).rem_euclid(360.0) - 180.0;
        let wobble = (t * 3.0).sin();
        trace.points.push(|| TracePoint {
            time_s: t,
            angles_deg: [heading, 10.0 * wobble, -5.0 * wobble],
            angles_std_deg: Some([1.0, 0.5, 0.5]),
            reference_deg: (k % 500 > 50).then_some([heading, 9.0 * wobble, -5.0]),
            device_deg: Some([heading, 9.5 * wobble, -4.0]),
            error_deg: (k % 500 > 50).then_some([1.0 + wobble, wobble, 0.4]),
            error_std_deg: Some([1.3, 1.0, 0.8]),
            bias_deg_s: Some([0.1 * wobble, 0.2, -0.1]),
            bias_std_deg_s: Some([0.05; 3]),
            position_m: (k > 100).then_some([10.0 * wobble, t, 0.1 * t]),
        });
        trace.positions.push(|| PositionPoint {
            time_s: t,
            measured_m: [10.0 * wobble, t, 0.1 * t],
            residual_m: [0.1 * wobble, -0.2, 0.05],
            outcome: match k % 20 {
                0 => Outcome::Gated,
                1 => Outcome::Inflated,
                _ => Outcome::Fused,
            },
        });
        for (_, series) in &mut trace.innovations {
            series.push(|| InnovationPoint {
                time_s: t,
                residual: [wobble, -wobble, 0.1],
                std: [0.5; 3],
                nis: 3.0 + 20.0 * wobble.abs(),
                degrees_of_freedom: 3,
                outcome: match k % 10 {
                    0 => Outcome::Gated,
                    1 => Outcome::Inflated,
                    2 => Outcome::Skipped(SkipReason::ZeroNorm),
                    _ => Outcome::Fused,
                },
            });
        }
    }
    trace
}

fn parameter(name: &str, value: &str) -> UsedParameter {
    UsedParameter {
        name: name.to_owned(),
        unit: "-",
        value: value.into(),
        origin: Origin::Calibration,
        meaning: "",
    }
}

fn full_report(trace: &Trace) -> RunReport<'_> {
    RunReport {
        recording: "lab.csv".to_owned(),
        summary: vec![Fact::new("total error", "1.8 deg")],
        verdicts: vec![Verdict::new(Tone::Warn, "R is too small.")],
        updates: vec![SensorUpdates {
            sensor: "accelerometer".to_owned(),
            fused: 1234,
            ..SensorUpdates::default()
        }],
        final_test: Some(FinalTest {
            calculated_error_deg: Some(1.25),
            nees: Some(f64::NAN),
            ..FinalTest::default()
        }),
        recording_facts: vec![Fact::new("device", "phone")],
        issues: vec!["A gap.".to_owned()],
        settings: vec![parameter("accelerometer_std", "0.3")],
        ..RunReport::new("Lab", trace)
    }
}

#[test]
fn full_report_has_every_section_and_is_a_well_formed_page() {
    let trace = full_trace(3000, 4000);
    let html = full_report(&trace).render();
    for id in [
        "attitude",
        "errors",
        "position",
        "innovations",
        "gates",
        "bias",
        "final-test",
        "recording",
        "settings",
    ] {
        assert!(
            html.contains(&format!("<section id=\"{id}\"")),
            "{id} is missing"
        );
        assert!(
            html.contains(&format!("href=\"#{id}\"")),
            "{id} is not in the contents"
        );
    }
    for text in [
        "Heading",
        "Pitch",
        "Roll",
        "NIS",
        "refused by the gate",
        "north upwards, m",
        "measured positions used",
        "refused as outliers",
        "accepted after several outliers",
        "time, s",
        "lab.csv",
        "1\u{202f}234",
    ] {
        assert!(html.contains(text), "{text} is missing");
    }
    assert_eq!(
        html.matches("<figcaption>").count(),
        html.matches("<figure>").count()
    );
    assert!(html.contains(concat!("northing ", env!("CARGO_PKG_VERSION"))));
    assert_well_formed(&html);
    assert_self_contained(&html);
    assert_numbers_are_finite(&html);
}

#[test]
fn empty_trace_says_so_and_leaves_the_plots_out() {
    let trace = Trace::new(100);
    let html = RunReport::new("Nothing", &trace).render();
    assert!(html.contains("gave no estimate"));
    for id in [
        "errors",
        "innovations",
        "gates",
        "bias",
        "final-test",
        "recording",
        "settings",
    ] {
        assert!(
            !html.contains(&format!("<section id=\"{id}\"")),
            "{id} is there"
        );
    }
    assert!(!html.contains("<svg"));
    assert_well_formed(&html);
}

#[test]
fn run_without_reference_or_covariance_shows_its_angles_alone() {
    let mut trace = Trace::new(100);
    for k in 0..50_u32 {
        trace.points.push(|| TracePoint {
            time_s: f64::from(k),
            ..TracePoint::default()
        });
    }
    let html = RunReport::new("Integration", &trace).render();
    assert!(html.contains("id=\"attitude\"") && !html.contains("id=\"errors\""));
    assert!(!html.contains("class=\"band") && !html.contains("dash reference\" "));
    assert_well_formed(&html);
}

#[test]
fn values_that_are_not_finite_draw_nothing_and_break_nothing() {
    let mut trace = full_trace(400, 1000);
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    trace.points.push(|| TracePoint {
        time_s: f64::NAN,
        angles_deg: bad,
        angles_std_deg: Some(bad),
        reference_deg: Some(bad),
        error_deg: Some(bad),
        error_std_deg: Some([f64::INFINITY; 3]),
        bias_deg_s: Some(bad),
        bias_std_deg_s: Some(bad),
        ..TracePoint::default()
    });
    trace.innovations[0].1.push(|| InnovationPoint {
        time_s: 4.0,
        residual: bad,
        std: bad,
        nis: f64::NAN,
        degrees_of_freedom: 3,
        outcome: Outcome::Fused,
    });
    let html = full_report(&trace).render();
    assert_numbers_are_finite(&html);
    assert!(!html.contains("NaN"));
    assert_well_formed(&html);
}

#[test]
fn text_of_the_user_cannot_become_markup() {
    let trace = full_trace(100, 100);
    let evil = "<b onload=\"x\">&'";
    let report = RunReport {
        title: evil.to_owned(),
        estimator: evil.to_owned(),
        recording: evil.to_owned(),
        command: Some(evil.to_owned()),
        summary: vec![Fact::new(evil, evil)],
        verdicts: vec![Verdict::new(Tone::Bad, evil)],
        issues: vec![evil.to_owned()],
        recording_facts: vec![Fact::new(evil, evil)],
        settings: vec![UsedParameter {
            unit: evil,
            meaning: evil,
            ..parameter(evil, evil)
        }],
        ..full_report(&trace)
    };
    let comparison = ComparisonReport {
        title: evil.to_owned(),
        tables: vec![Table {
            title: evil.to_owned(),
            caption: evil.to_owned(),
            columns: vec![Column::new(evil, evil, None)],
            rows: vec![vec![Cell::text(evil)]],
        }],
        distributions: vec![Distribution {
            name: evil.to_owned(),
            errors_deg: vec![1.0],
        }],
        runs: vec![ComparedRun {
            name: evil,
            trace: &trace,
            heading_offset_deg: None,
        }],
        ..ComparisonReport::default()
    };
    for html in [report.render(), comparison.render()] {
        assert!(!html.contains("<b onload"));
        assert!(html.contains("&lt;b onload=&quot;x&quot;&gt;&amp;&#39;"));
        assert_well_formed(&html);
    }
}

#[test]
fn long_run_stays_small() {
    let trace = full_trace(40_000, 20_000);
    let html = full_report(&trace).render();
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    let longest = attributes(&html, " d=\"")
        .map(|d| d.matches(['M', 'L']).count())
        .max();
    assert!(longest <= Some(4000), "{longest:?} points in one path");
    // Spikes survive thinning, so there must be plenty of points as well.
    assert!(longest >= Some(1500), "{longest:?}");
}

#[test]
fn heading_is_not_drawn_across_the_wrap() {
    let trace = full_trace(3600, 4000);
    let html = full_report(&trace).render();
    let figure = html.split("id=\"errors\"").next().unwrap_or("");
    let estimate = figure
        .split("class=\"line estimate\" d=\"")
        .nth(2)
        .unwrap_or("");
    let path = estimate.split('"').next().unwrap_or("");
    assert_eq!(
        path.matches('M').count(),
        3,
        "two wraps cut the line in three"
    );
}

#[test]
fn comparison_shows_tables_dots_and_lines() {
    let trace = full_trace(2000, 4000);
    let names = [
        "mekf",
        "usque",
        "device",
        "integration",
        "a",
        "b",
        "c",
        "d",
        "e",
        "f",
        "g",
        "h",
        "i",
        "j",
    ];
    let report = ComparisonReport {
        title: "All".to_owned(),
        tables: vec![Table {
            columns: vec![
                Column::new("Estimator", "", None),
                Column::new("Total", "deg", Some(Best::Lowest)),
            ],
            rows: vec![
                vec![Cell::text("mekf"), Cell::number(Some(1.0), 2)],
                vec![Cell::text("usque"), Cell::number(None, 2)],
                vec![Cell::text("device"), Cell::number(Some(2.0), 2)],
            ],
            ..Table::default()
        }],
        distributions: vec![
            Distribution {
                name: "mekf".to_owned(),
                errors_deg: vec![1.0, 2.0, f64::NAN, 0.0],
            },
            Distribution {
                name: "nothing".to_owned(),
                errors_deg: Vec::new(),
            },
        ],
        runs: names
            .iter()
            .map(|name| ComparedRun {
                name,
                trace: &trace,
                heading_offset_deg: None,
            })
            .collect(),
        settings: vec![(
            "mekf".to_owned(),
            vec![parameter("accelerometer_std", "0.3")],
        )],
        ..ComparisonReport::default()
    };
    let html = report.render();
    for id in ["results", "distribution", "errors", "heading", "settings"] {
        assert!(
            html.contains(&format!("<section id=\"{id}\"")),
            "{id} is missing"
        );
    }
    assert!(html.contains("<td class=\"num best\">1.00</td>"));
    assert!(
        html.contains("s0 dash"),
        "a line beyond the thirteen colours is dashed"
    );
    assert_well_formed(&html);
    assert_self_contained(&html);
    assert_numbers_are_finite(&html);
}

#[test]
fn empty_comparison_is_a_page_too() {
    let html = ComparisonReport::default().render();
    assert!(!html.contains("<section") && !html.contains("<nav"));
    assert_well_formed(&html);
}

#[test]
fn readme_picture_stands_alone_and_is_small() {
    let (filter, empty) = (full_trace(9000, 4000), Trace::new(10));
    for drifting in [&filter, &empty] {
        let svg = hero_svg(&HeroPicture {
            title: "A & B",
            subtitle: "",
            filter: ("mekf", &filter),
            drifting: ("gyroscope", drifting),
            other: Some(("device", &filter)),
        });
        assert!(
            svg.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\"")
                && svg.contains("width=\"960\"")
        );
        assert!(
            svg.contains("A &amp; B") && !svg.contains("var(") && svg.len() < 200_000,
            "{}",
            svg.len()
        );
        assert_well_formed(&svg);
        assert_self_contained(&svg);
        assert_numbers_are_finite(&svg);
    }
    let nothing = HeroPicture {
        title: "",
        subtitle: "",
        filter: ("mekf", &empty),
        drifting: ("gyroscope", &empty),
        other: None,
    };
    assert_well_formed(&hero_svg(&nothing));
}
