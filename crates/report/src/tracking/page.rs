//! The report of a tracking run: targets in numbers, the map, errors over time.

use super::map;
use crate::drawing::axis::{self, Axis};
use crate::drawing::plot::{Figure, Layer, Panel, Sign, WIDTH, key};
use crate::drawing::style::SERIES;
use crate::page::facts::{Fact, Verdict};
use crate::page::html::{self, Frame, Page};
use crate::page::table::{self, Table};
use northing_evaluation::tracking::TrackEpoch;
use northing_evaluation::tracking::matching::{assign, distance};
use northing_evaluation::tracking::outcome::MATCH_M;

/// What the report of a tracking run shows.
#[derive(Debug, Clone, Default)]
pub struct TrackingReport<'a> {
    /// Name of the recording.
    pub recording: String,
    /// The command that makes it again.
    pub command: Option<String>,
    /// Large numbers at the top.
    pub summary: Vec<Fact>,
    /// Judgements in words.
    pub verdicts: Vec<Verdict>,
    /// Tables of results.
    pub tables: Vec<Table>,
    /// Every instant with a scan.
    pub epochs: &'a [TrackEpoch],
    /// What was skipped or refused.
    pub issues: Vec<String>,
}

impl TrackingReport<'_> {
    /// The report as one HTML page that needs nothing else.
    #[must_use]
    pub fn render(&self) -> String {
        let mut page = Page::default();
        let tables: String = self.tables.iter().map(table::table).collect();
        page.section("targets", "Targets", &tables);
        page.section("map", "Map", &self.map());
        page.section("errors", "Errors over time", &self.errors());
        page.section("recording", "Recording", &html::sentences(&self.issues));
        page.finish(&Frame {
            kicker: "Northing \u{00b7} tracking",
            title: &self.recording,
            lead: "",
            summary: &self.summary,
            verdicts: &self.verdicts,
            recording: &self.recording,
            command: self.command.as_deref(),
            reading: "North is up. An ellipse holds the true position 95 times of 100 when the tracker's \
                   uncertainty is consistent.",
        })
    }

    fn map(&self) -> String {
        html::picture(
            map::render(self.epochs),
            "Tracks with their 95 % ellipses, detections, own ship, and the truth (dashed).",
            "Ellipses too large for the map are left out. Look whether each dashed line has one colour along it: a change of \
             colour is a track that was lost and found again. Tracks on quays and shores are \
             echoes that stay.",
        )
    }

    /// Distance of each target from its track.
    fn errors(&self) -> String {
        let mut curves: Vec<(u32, Vec<[f64; 2]>)> = Vec::new();
        for epoch in self.epochs.iter().filter(|e| !e.truth.is_empty()) {
            let targets: Vec<_> = epoch.truth.iter().map(|(_, place)| *place).collect();
            let tracks: Vec<_> = epoch.tracks.iter().map(|t| t.place).collect();
            let chosen = assign(&targets, &tracks, MATCH_M);
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
        let end = self.epochs.last().map_or(1.0, |e| e.time_s);
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
            "Gaps are instants without a track within 40 m.",
        )
    }
}
