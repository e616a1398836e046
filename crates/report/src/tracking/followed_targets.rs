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
use northing_evaluation::tracking::{TargetSummary, TrackEpoch, TrackSummary};
use northing_recording::tracking::TrackingIssues;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, Gamma};

/// Coverage from which a target counts as well followed.
const WELL_COVERED: f64 = 0.75;
/// Share of the time that is most of it.
const MOST: f64 = 0.5;
/// What happens more rarely than this to a consistent tracker is no chance: one page of a thousand is blamed without a reason.
const CHANCE: f64 = 1e-3;
/// Instants that an error of a track lasts: its filter averages over some scans, and neighbouring errors are alike. So many instants count as
/// one independent sample. The targets of one recording share the errors of the own ship, so that together they count no more than one of them.
const LASTING: usize = 10;

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
    let mut verdicts = each_target(summary);
    verdicts.extend(consistency(&summary.targets));
    verdicts.extend(false_tracks(summary));
    verdicts
}

fn each_target(summary: &TrackSummary) -> Vec<Verdict> {
    let cutoff = summary.cutoff_m.unwrap_or_default();
    let covered = metres(COVERED * cutoff);
    let each = summary.targets.iter().map(|target| {
        let share = 100.0 * target.coverage;
        // One and the same track went along with it, at a distance.
        if target.lost && target.continuity > MOST {
            return Verdict::new(
                Tone::Warn,
                format!(
                    "Target {} is followed at a distance: one track within {} for {:.0} % of the time, {} off in the median; within {covered} for {share:.0} %.",
                    target.target,
                    metres(cutoff),
                    100.0 * target.continuity,
                    metres(target.median_error_m.unwrap_or_default()),
                ),
            );
        }
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

/// Whether errors are as large as stated: over all targets, or where all together are, of each one.
fn consistency(targets: &[TargetSummary]) -> Vec<Verdict> {
    let each: Vec<_> = targets
        .iter()
        .filter_map(|t| Some((t.target, t.matched, t.inside_95?, t.anees?)))
        .collect();
    let instants: usize = each.iter().map(|(_, matched, ..)| matched).sum();
    let longest = each.iter().map(|(_, matched, ..)| *matched).max();
    let mean = |sum: f64| sum / instants as f64;
    let inside = mean(
        each.iter()
            .map(|(_, m, inside, _)| *m as f64 * inside)
            .sum(),
    );
    let anees = mean(each.iter().map(|(_, m, _, anees)| *m as f64 * anees).sum());
    let overall = stated("Errors", longest.unwrap_or(0), inside, anees);
    if let Some(overall) = overall {
        return vec![overall];
    }
    let of = |(target, matched, inside, anees): (u32, usize, f64, f64)| {
        stated(
            &format!("Errors of target {target}"),
            matched,
            inside,
            anees,
        )
    };
    each.into_iter().filter_map(of).collect()
}

/// Whether errors are larger or smaller than stated, beyond what chance does in so many instants; few say nothing.
fn stated(whose: &str, instants: usize, inside: f64, anees: f64) -> Option<Verdict> {
    let samples = (instants / LASTING) as u64;
    let inside_of_samples = (inside * samples as f64).floor() as u64;
    let of_those = Binomial::new(0.95, samples).ok()?;
    let percent = 100.0 * inside;
    // A mean of samples each of which is exponential with mean 1: half a chi-square of two degrees of freedom.
    let mean_of = |samples: f64| Gamma::new(samples, samples).ok();
    if of_those.cdf(inside_of_samples) < CHANCE {
        // Even if one and the same error lasted all the time, and there were a single sample.
        let by_no_chance = mean_of(1.0)?.sf(anees) < CHANCE;
        let tone = if by_no_chance { Tone::Bad } else { Tone::Warn };
        return Some(Verdict::new(
            tone,
            format!(
                "{whose} are larger than stated: {percent:.0} % of the true positions lie inside the 95 % ellipse, ANEES {}. A constant error of \
                 heading, bearing or clock may be the reason, or standard deviations that are stated too small.",
                three_digits(anees)
            ),
        ));
    }
    let is_small = inside >= 0.95 && mean_of(samples as f64)?.cdf(anees) < CHANCE;
    is_small.then(|| {
        Verdict::new(
            Tone::Info,
            format!(
                "{whose} are smaller than stated: ANEES {}, where 1 is consistent, with {percent:.0} % of the true positions inside the 95 % ellipse. \
                 Standard deviations are stated too large, or an error that lasts, as of the own ship's heading, is small in this recording.",
                three_digits(anees)
            ),
        )
    })
}

/// How many tracks are on no target. Most are, beyond chance, where so many of so many would be rare if it were a half.
fn false_tracks(summary: &TrackSummary) -> Option<Verdict> {
    let (all, none) = (summary.scored_tracks, summary.false_tracks);
    let below = none.checked_sub(1)?;
    let half = Binomial::new(0.5, all as u64).ok()?;
    let is_most = half.sf(below as u64) < CHANCE;
    let rate = summary.false_tracks_per_hour;
    let rate = rate.map_or(String::new(), |rate| format!(", {rate:.0} an hour"));
    let text = format!(
        "{none} of {all} tracks are on no target ({:.0} %){rate}. What is there without a true position, a quay or a moored boat, counts too; if nothing is, \
         the sensor's clutter may be stated too small.",
        100.0 * none as f64 / all as f64
    );
    let tone = if is_most { Tone::Warn } else { Tone::Info };
    Some(Verdict::new(tone, text))
}

fn targets(summary: &TrackSummary) -> Vec<Table> {
    let Some(cutoff) = summary.cutoff_m else {
        return Vec::new();
    };
    let column = |name: &str, unit: &str| Column::new(name, unit, None);
    let rows = summary.targets.iter().map(|t| {
        vec![
            Cell::text(format!("target\u{a0}{}", t.target)),
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
            "groups of tracks, confirmed or not, that shared detections in more ways than are enumerated: belief propagation instead",
        ),
    ];
    said(&sentences)
}

fn omissions(issues: &TrackingIssues) -> Vec<String> {
    let mut sentences = said(&[
        (
            issues.rows_without_scan,
            "rows of detections or truth whose scan is not in the table of scans",
        ),
        (
            issues.scans_of_unknown_sensors,
            "scans, reports or targets of sensors that the manifest does not describe",
        ),
        (
            issues.scans_without_own_ship,
            "scans left out: a cell of the own ship's pose is empty",
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
    ]);
    sentences.extend(issues.remarks.iter().cloned());
    sentences
}

fn said(sentences: &[(u64, &str)]) -> Vec<String> {
    let some = sentences.iter().filter(|(count, _)| *count > 0);
    some.map(|(count, what)| format!("{count} {what}"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(matched: usize, inside_95: f64, anees: f64) -> TargetSummary {
        TargetSummary {
            target: 1,
            epochs: matched,
            matched,
            rmse_m: Some(50.0),
            median_error_m: Some(48.6),
            coverage: 0.97,
            seen: 0.9,
            lost: false,
            switches: 0,
            inside_95: Some(inside_95),
            anees: Some(anees),
            found_after_s: Some(4.0),
            continuity: 0.97,
        }
    }

    fn summary(targets: Vec<TargetSummary>, [scored, none]: [usize; 2]) -> TrackSummary {
        TrackSummary {
            recording: "bay".to_owned(),
            tracker: "schmidt",
            sensors: vec!["radar".to_owned()],
            duration_s: 298.0,
            elapsed_s: 0.1,
            targets,
            confirmed_tracks: scored + 3,
            scored_tracks: scored,
            false_tracks: none,
            false_track_epochs: none,
            false_tracks_per_hour: Some(12.0 * none as f64),
            cutoff_m: Some(87.4),
            gospa_m: None,
            ospa_m: None,
            tgospa_m: None,
            tgospa_at_least_m: None,
            learnt: Learnt::default(),
            counts: Counts {
                scans: 150,
                scans_refused_time: 0,
                scans_refused_pose: 0,
                scans_refused_jump: 0,
                detections_invalid: 0,
                bearing_undefined: 0,
                numerical: 0,
                beyond_capacity: 0,
                initiated: 0,
                merged: 0,
                approximate_clusters: 2,
            },
            left_out: TrackingIssues {
                scans_without_own_ship: 4,
                remarks: vec!["the clocks differ".to_owned()],
                ..TrackingIssues::default()
            },
            parameters: Vec::new(),
            version: "",
        }
    }

    /// Tone and beginning of the verdict, or nothing.
    fn errors_are(matched: usize, inside: f64, anees: f64) -> Option<(Tone, bool)> {
        let verdicts = consistency(&[target(matched, inside, anees)]);
        assert!(verdicts.len() <= 1, "{verdicts:?}");
        let verdict = verdicts.first()?;
        Some((
            verdict.tone,
            verdict.text.starts_with("Errors are larger than stated"),
        ))
    }

    #[test]
    fn errors_larger_or_smaller_than_stated_beyond_chance() {
        assert_eq!(errors_are(140, 0.95, 1.0), None);
        assert_eq!(errors_are(140, 0.85, 1.4), None);
        assert_eq!(errors_are(140, 0.44, 3.2), Some((Tone::Warn, true)));
        assert_eq!(errors_are(140, 0.02, 7.2), Some((Tone::Bad, true)));
        assert_eq!(errors_are(140, 1.0, 0.5), None);
        assert_eq!(errors_are(140, 1.0, 0.2), Some((Tone::Info, false)));
        // Few instants say nothing, whatever they are; of none there is no number.
        assert_eq!(errors_are(29, 0.0, 7.2), None);
        assert_eq!(errors_are(9, 1.0, 0.0), None);
        assert!(consistency(&[]).is_empty());
    }

    #[test]
    fn one_target_among_many_is_named() {
        let mut targets = vec![target(140, 0.96, 0.9); 8];
        targets[5] = TargetSummary {
            target: 6,
            ..target(140, 0.5, 3.0)
        };
        let verdicts = consistency(&targets);
        assert_eq!(verdicts.len(), 1);
        let text = &verdicts[0].text;
        assert!(
            text.starts_with("Errors of target 6 are larger than stated: 50 %"),
            "{text}"
        );
    }

    #[test]
    fn a_target_with_one_displaced_track_is_not_lost() {
        let displaced = TargetSummary {
            coverage: 0.43,
            continuity: 0.93,
            lost: true,
            ..target(140, 0.0, 7.2)
        };
        let gone = TargetSummary {
            continuity: 0.2,
            ..displaced
        };
        let verdicts = each_target(&summary(vec![displaced, gone], [2, 0]));
        let text = &verdicts[0].text;
        assert!(
            text.contains("one track within 87.4 m for 93 % of the time, 48.6 m off in the median"),
            "{text}"
        );
        assert!(
            !text.contains("lost") && verdicts[0].tone == Tone::Warn,
            "{text}"
        );
        assert!(verdicts[1].text.contains("is lost") && verdicts[1].tone == Tone::Bad);
    }

    #[test]
    fn most_tracks_on_no_target_are_worth_a_look() {
        let of = |all, none| false_tracks(&summary(Vec::new(), [all, none]));
        assert_eq!(of(5, 0), None);
        assert_eq!(of(11, 6).unwrap().tone, Tone::Info);
        let most = of(423, 416).unwrap();
        assert_eq!(most.tone, Tone::Warn);
        assert!(
            most.text
                .starts_with("416 of 423 tracks are on no target (98 %), 4992 an hour."),
            "{}",
            most.text
        );
    }

    #[test]
    fn a_target_keeps_to_one_line_and_remarks_are_told() {
        let one = summary(vec![target(140, 0.95, 1.0)], [1, 0]);
        let page = render(&one, &[], "northing track bay.toml");
        assert!(page.contains("target\u{a0}1"));
        let told = left_out(&one);
        let begins = [
            "2 groups of tracks, confirmed or not",
            "4 scans left out",
            "the clocks differ",
        ];
        assert_eq!(told.len(), begins.len());
        for (told, begins) in told.iter().zip(begins) {
            assert!(told.starts_with(begins), "{told}");
        }
    }
}
