//! The HTML report of a campaign.

use crate::experiments::campaign::{Figures, TrackerCurves};
use crate::page::facts::{Fact, Tone, Verdict};
use crate::page::html::{Frame, Page};
use crate::page::table::{self, Best, Cell, Column, Table};
use nalgebra::Vector4;
use northing_experiments::radar::experiment::{NavigationRecord, RunWatcher, TrackRecord, run};
use northing_experiments::radar::outcome::TrackerOutcome;
use northing_experiments::radar::{CampaignOutcome, Part};
use northing_simulation::scenario::TrackingWorld;

/// What the words of the page mean.
const READING: &str = "Errors are estimate minus truth in north and east, as root mean square over the runs. NEES is \
     the squared error in units of the stated covariance: 4 on average for a consistent tracker of position and \
     velocity. The band holds the mean of as many consistent runs at 95 % of the scans.";

/// The paths of one run.
#[derive(Default)]
struct Paths {
    own: Vec<[f64; 2]>,
    target: Vec<[f64; 2]>,
    tracks: Vec<Vec<[f64; 2]>>,
}

impl RunWatcher for Paths {
    fn scan(&mut self, _step: usize, navigation: &NavigationRecord, target: &Vector4<f64>) {
        self.own
            .push([navigation.true_pose.y, navigation.true_pose.x]);
        self.target.push([target[2], target[0]]);
    }

    fn tracker(&mut self, _: usize, index: usize, record: &TrackRecord, _: &Vector4<f64>) {
        if let (Some(track), Some(estimate)) = (self.tracks.get_mut(index), record.estimate) {
            track.push([estimate.state[2], estimate.state[0]]);
        }
    }
}

/// A count with its noun: `1 run`, `3 runs`.
#[must_use]
pub fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// The page.
#[must_use]
pub fn render(part: &Part, outcome: &CampaignOutcome) -> String {
    let kinds = &part.sums.kinds;
    let world = TrackingWorld::new(&part.key.scenario);
    let mut paths = Paths {
        tracks: vec![Vec::new(); kinds.len()],
        ..Paths::default()
    };
    run(&world, kinds, part.key.seed, 0, &mut paths);
    let trackers = kinds
        .iter()
        .zip(paths.tracks)
        .filter_map(|(kind, track_m)| {
            let tracker = outcome.trackers.get(kind.name())?;
            if tracker.has_lost_the_target() {
                return None;
            }
            let timed = |values: &[f64]| {
                let pairs = tracker.series.time_s.iter().zip(values);
                pairs.map(|(t, value)| [*t, *value]).collect()
            };
            Some(TrackerCurves {
                name: kind.name().to_owned(),
                position_rmse_m: timed(&tracker.series.position_rmse_m),
                velocity_rmse_m_s: timed(&tracker.series.velocity_rmse_m_s),
                nees: timed(&tracker.series.nees),
                track_m,
            })
        });
    let lost = outcome.trackers.iter();
    let lost = lost.filter(|(_, tracker)| tracker.has_lost_the_target());
    let figures = Figures {
        own_ship_m: paths.own,
        target_m: paths.target,
        nees_bands: bands(part, outcome),
        lost: lost.map(|(name, _)| name.clone()).collect(),
        trackers: trackers.collect(),
    };
    let mut page = Page::default();
    page.section("numbers", "Numbers", &table::table(&numbers(outcome)));
    figures.draw(&mut page);
    let heading = outcome.navigation.heading_rmse_deg;
    let verdicts = outcome.trackers.iter();
    let verdicts = verdicts.map(|(name, tracker)| verdict(name, tracker, outcome));
    page.finish(&Frame {
        kicker: "Monte Carlo",
        title: &format!("{}: {}", outcome.scenario, counted(outcome.runs, "run")),
        lead: "A target tracked by radar from a ship whose own position and heading are uncertain.",
        summary: &[
            Fact::new("runs", outcome.runs.to_string()),
            Fact::new("seed", outcome.seed.to_string()),
            Fact::new("heading error", format!("{heading:.2}\u{b0}")),
        ],
        verdicts: &verdicts.collect::<Vec<_>>(),
        recording: "",
        command: None,
        reading: READING,
    })
}

/// The band of four degrees of freedom; that of the paper's plots where the scenario asks for it.
fn bands(part: &Part, outcome: &CampaignOutcome) -> Vec<(String, [f64; 2])> {
    let mut bands = vec![("four degrees of freedom".to_owned(), outcome.nees_band)];
    if part.key.scenario.nees.interval_paper.is_some() {
        let name = "two, as in the paper's plots".to_owned();
        bands.push((name, outcome.nees_band_2dof));
    }
    bands
}

/// Fewer runs say nothing of a tracker whose mean NEES lies within their band: errors of one run go on from scan to scan, so that few
/// runs are few samples, however many scans they have.
pub const FEWEST_FOR_VERDICT: u64 = 10;

fn verdict(name: &str, tracker: &TrackerOutcome, outcome: &CampaignOutcome) -> Verdict {
    if tracker.has_lost_the_target() {
        return Verdict::new(Tone::Bad, format!("{name} loses the target."));
    }
    let nees = tracker.nees_mean;
    let inside = 100.0 * tracker.nees_inside_band;
    let [low, high] = outcome.nees_band;
    if outcome.runs < FEWEST_FOR_VERDICT && (low..=high).contains(&nees) {
        let text = format!(
            "{}: too few to tell whether {name} is consistent; NEES {nees:.2}, where 4 is.",
            counted(outcome.runs, "run")
        );
        Verdict::new(Tone::Info, text)
    } else if tracker.nees_inside_band >= 0.8 {
        let text = format!(
            "{name} is consistent: its NEES is inside the band at {inside:.0} % of the scans."
        );
        Verdict::new(Tone::Good, text)
    } else if nees < 4.0 {
        let text = format!("{name} is conservative: NEES {nees:.2} where 4 is consistent.");
        Verdict::new(Tone::Warn, text)
    } else {
        let text = format!("{name} is overconfident: NEES {nees:.2} where 4 is consistent.");
        Verdict::new(Tone::Bad, text)
    }
}

fn numbers(outcome: &CampaignOutcome) -> Table {
    let lowest = Some(Best::Lowest);
    let rows = outcome.trackers.iter().map(|(name, tracker)| {
        let kept = !tracker.has_lost_the_target();
        let number = |value: f64, decimals| Cell::number(kept.then_some(value), decimals);
        vec![
            Cell::text(name.clone()),
            number(tracker.position_rmse_m, 2),
            number(tracker.velocity_rmse_m_s, 3),
            number(tracker.steady.position_rmse_m, 2),
            number(tracker.steady.velocity_rmse_m_s, 3),
            number(tracker.nees_mean, 2),
            number(100.0 * tracker.nees_inside_band, 0),
        ]
    });
    Table {
        title: "All trackers".to_owned(),
        caption: "Root mean square errors over runs and scans, and after 60 s. Without numbers: the target was lost.".to_owned(),
        columns: vec![
            Column::new("tracker", "", None),
            Column::new("position", "m", lowest),
            Column::new("velocity", "m/s", lowest),
            Column::new("after 60 s", "m", lowest),
            Column::new("after 60 s", "m/s", lowest),
            Column::new("NEES", "", Some(Best::Nearest(4.0))),
            Column::new("in band", "%", None),
        ],
        rows: rows.collect(),
    }
}
