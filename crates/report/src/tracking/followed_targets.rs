//! The report of a tracking run: targets in numbers, the map, errors over time; and what was refused, in words.

use super::map;
use crate::drawing::axis::{self, Axis};
use crate::drawing::plot::{Figure, Layer, Panel, Sign, WIDTH, key};
use crate::drawing::style::SERIES;
use crate::page::facts::{Fact, Tone, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table::{self, Cell, Column, Table};
use northing_evaluation::tracking::matching::{assign, distance};
use northing_evaluation::tracking::outcome::{COVERED, Counts, Learnt};
use northing_evaluation::tracking::{TrackEpoch, TrackSummary};
use northing_recording::tracking::TrackingIssues;

/// Coverage from which a target counts as well followed.
const WELL_COVERED: f64 = 0.75;

/// The page of a run; `command` makes it again.
#[must_use]
pub fn render(summary: &TrackSummary, epochs: &[TrackEpoch], command: &str) -> String {
    let mut page = Page::default();
    let tables: String = targets(summary).iter().map(table::table).collect();
    page.section("targets", "Targets", &tables);
    page.section("map", "Map", &track_map(epochs));
    page.section(
        "errors",
        "Errors over time",
        &errors(epochs, summary.cutoff_m),
    );
    let learnt = learnt(&summary.learnt);
    page.section(
        "learnt",
        "Learnt from the detections",
        &html::sentences(&learnt),
    );
    let issues = left_out(summary);
    page.section("recording", "Recording", &html::sentences(&issues));
    page.finish(&Frame {
        kicker: "Northing \u{00b7} tracking",
        title: &summary.recording,
        lead: "",
        summary: &facts(summary),
        verdicts: &verdicts(summary),
        recording: &summary.recording,
        command: Some(command),
        reading: "North is up. An ellipse holds the true position 95 times of 100 when the tracker's \
                  uncertainty is consistent.",
    })
}

fn track_map(epochs: &[TrackEpoch]) -> String {
    html::picture(
        map::render(epochs),
        "Tracks with their 95 % ellipses, detections, own ship, and the truth (dashed).",
        "Ellipses too large for the map are left out. Look whether each dashed line has one colour along it: a change of \
         colour is a track that was lost and found again. Tracks on quays and shores are \
         echoes that stay.",
    )
}

/// Distance of each target from its track.
fn errors(epochs: &[TrackEpoch], cutoff_m: Option<f64>) -> String {
    let Some(cutoff_m) = cutoff_m else {
        return String::new();
    };
    let mut curves: Vec<(u32, Vec<[f64; 2]>)> = Vec::new();
    for epoch in epochs.iter().filter(|e| !e.truth.is_empty()) {
        let targets: Vec<_> = epoch.truth.iter().map(|(_, place)| *place).collect();
        let tracks: Vec<_> = epoch.tracks.iter().map(|t| t.place).collect();
        let chosen = assign(&targets, &tracks, cutoff_m);
        for ((number, place), track) in epoch.truth.iter().zip(chosen) {
            let error = track.map_or(f64::NAN, |t| distance(*place, tracks[t]));
            let known = curves.iter().position(|(known, _)| known == number);
            let at = known.unwrap_or_else(|| {
                curves.push((*number, Vec::new()));
                curves.len() - 1
            });
            curves[at].1.push([epoch.time_s, error]);
        }
    }
    let all = curves.iter().flat_map(|(_, c)| c.iter().map(|p| p[1]));
    let Some(reach) = axis::reach(all) else {
        return String::new();
    };
    let class = |i: usize| format!("s{}", i % SERIES);
    let legend = curves.iter().enumerate();
    let legend = legend.map(|(i, (n, _))| key(Sign::Line, &class(i), &format!("target {n}")));
    let end = epochs.last().map_or(1.0, |e| e.time_s);
    let panel = Panel::new(
        "Distance of target and track",
        "m",
        Axis::linear(0.0, reach.limit * 1.1, 5),
        Vec::new(),
    )
    .height(220.0);
    let figure = Figure::new(
        "Distance of each target from its track over time",
        Axis::time(0.0, end, 8),
        legend.collect(),
        vec![Panel {
            layers: curves
                .iter()
                .enumerate()
                .map(|(i, (_, c))| Layer::line(c.clone(), &class(i), false))
                .collect(),
            ..panel
        }],
    )
    .right(WIDTH * 0.02);
    html::figure(
        figure,
        "Distance of each target from its track.",
        &format!(
            "Gaps are instants without a track within {}.",
            metres(cutoff_m)
        ),
    )
}

fn facts(summary: &TrackSummary) -> Vec<Fact> {
    let mut facts = vec![
        Fact::new("tracker", summary.tracker.to_owned()),
        Fact::new(
            format!("scans in {:.0} s", summary.duration_s),
            summary.counts.scans.to_string(),
        ),
        Fact::new("tracks confirmed", summary.confirmed_tracks.to_string()),
    ];
    if !summary.targets.is_empty() {
        facts.push(Fact::new("on no target", summary.false_tracks.to_string()));
    }
    if let (Some(gospa), Some(cutoff)) = (summary.gospa_m, summary.cutoff_m) {
        let name = format!("mean GOSPA, cut-off {}", metres(cutoff));
        facts.push(Fact::new(name, metres(gospa)));
    }
    if let Some(tgospa) = tgospa(summary) {
        facts.push(Fact::new("T-GOSPA, changes of track in it", tgospa));
    }
    facts
}

/// T-GOSPA, or where the best assignment is not known the bound below it and what was found.
#[must_use]
pub fn tgospa(summary: &TrackSummary) -> Option<String> {
    let found = summary.tgospa_m?;
    Some(match summary.tgospa_at_least_m {
        Some(least) if found > 1.001 * least => format!("{} to {}", metres(least), metres(found)),
        _ => metres(found),
    })
}

/// A length with three digits.
#[must_use]
pub fn metres(length: f64) -> String {
    format!("{} m", three_digits(length))
}

/// A number with three significant digits.
fn three_digits(number: f64) -> String {
    let decimals = 2.0 - number.abs().max(1e-3).log10().floor();
    format!("{number:.*}", decimals.clamp(0.0, 5.0) as usize)
}

fn verdicts(summary: &TrackSummary) -> Vec<Verdict> {
    let covered = metres(COVERED * summary.cutoff_m.unwrap_or_default());
    let each = summary.targets.iter().map(|target| {
        let share = 100.0 * target.coverage;
        let (tone, words) = if target.lost {
            (Tone::Bad, "is lost")
        } else if target.switches > 0 {
            (Tone::Warn, "is followed with interruptions")
        } else if target.coverage < WELL_COVERED {
            (Tone::Warn, "is followed at a distance or for a part of the time")
        } else {
            (Tone::Good, "is followed")
        };
        Verdict::new(tone, format!(
                "Target {} {words}: a track within {covered} for {share:.0} % of the time, changes of track: {}.",
                target.target, target.switches
            ))
    });
    each.collect()
}

fn targets(summary: &TrackSummary) -> Vec<Table> {
    let Some(cutoff) = summary.cutoff_m else {
        return Vec::new();
    };
    let column = |name: &str, unit: &str| Column::new(name, unit, None);
    let rows = summary.targets.iter().map(|t| {
        vec![
            Cell::text(format!("target {}", t.target)),
            Cell::number(t.rmse_m, 1),
            Cell::number(t.median_error_m, 1),
            Cell::number(Some(t.coverage), 2),
            Cell::number(Some(t.continuity), 2),
            Cell::text(t.switches.to_string()),
            Cell::number(t.found_after_s, 1),
            Cell::number(t.anees, 2),
            Cell::number(t.inside_95, 2),
        ]
    });
    vec![Table {
        caption: format!(
            "Errors while a track is within {}, the cut-off; coverage is the share of the time with a track within half of it; \
             continuity that of the longest stretch with one and the same track; ANEES is 1, and 95 % of the true positions are inside \
             their track's ellipse, when the tracks' covariances are consistent.",
            metres(cutoff)
        ),
        columns: vec![
            column("target", ""),
            column("RMSE", "m"),
            column("median", "m"),
            column("coverage", ""),
            column("continuity", ""),
            column("switches", ""),
            column("found after", "s"),
            column("ANEES", ""),
            column("in the 95 % ellipse", ""),
        ],
        rows: rows.collect(),
        ..Table::default()
    }]
}

/// What the tracker learnt, one sentence each.
#[must_use]
pub fn learnt(learnt: &Learnt) -> Vec<String> {
    let errors = [
        ("position", learnt.position_error_s),
        ("heading", learnt.heading_error_s),
    ];
    let errors = errors.into_iter().filter_map(|(of, time_s)| {
        Some(format!(
            "learnt from targets seen together: a correlation time of {} s is used for the error of the own ship's {of}, not that of the setting",
            three_digits(time_s?)
        ))
    });
    let echoes = learnt.echoes.iter().map(|echo| {
        format!(
            "learnt from looks in a row: an echo's place on its target is taken as correlated by {} from one look to the next, {} s later ({})",
            echo.kept,
            three_digits(echo.interval_s),
            echo.sensors.join(", ")
        )
    });
    let visible = learnt.visible_s.map(|time_s| {
        format!(
            "learnt from tracks: targets are taken to stay visible for {} s on average (existence.visible_s is where that began)",
            three_digits(time_s)
        )
    });
    errors.chain(echoes).chain(visible).collect()
}

/// What the tracker refused or skipped and the reader left out, one sentence each.
#[must_use]
pub fn left_out(summary: &TrackSummary) -> Vec<String> {
    [refusals(&summary.counts), omissions(&summary.left_out)].concat()
}

fn refusals(counts: &Counts) -> Vec<String> {
    let sentences = [
        (
            counts.scans_refused_time,
            "scans refused: time not finite, going back or far ahead",
        ),
        (
            counts.scans_refused_pose,
            "scans refused: own ship's pose not finite, or its covariance not positive",
        ),
        (
            counts.scans_refused_jump,
            "scans refused: own ship's pose jumped",
        ),
        (
            counts.detections_invalid,
            "detections skipped: not finite, or a range that is not positive",
        ),
        (
            counts.bearing_undefined,
            "updates skipped: target at the own ship's position, bearing undefined",
        ),
        (
            counts.numerical,
            "updates skipped: innovation covariance not positive",
        ),
        (
            counts.beyond_capacity,
            "detections or tracks left out for want of room",
        ),
        (
            counts.approximate_clusters,
            "times that targets were too close together for exact association: belief propagation instead",
        ),
    ];
    said(&sentences)
}

fn omissions(issues: &TrackingIssues) -> Vec<String> {
    said(&[
        (
            issues.rows_without_scan,
            "rows of detections or truth whose scan is not in the table of scans",
        ),
        (
            issues.scans_of_unknown_sensors,
            "scans, reports or targets of sensors that the manifest does not describe",
        ),
        (
            issues.out_of_time_order,
            "scans or reports out of time order, put in their place",
        ),
        (
            issues.reports_without_position,
            "AIS reports without a position",
        ),
        (
            issues.sentences_unusable,
            "NMEA lines that are no sentence, fail their checksum, have no time, or are seen from a place that is not known",
        ),
    ])
}

fn said(sentences: &[(u64, &str)]) -> Vec<String> {
    let some = sentences.iter().filter(|(count, _)| *count > 0);
    some.map(|(count, what)| format!("{count} {what}"))
        .collect()
}
