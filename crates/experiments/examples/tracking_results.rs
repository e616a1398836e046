//! Prints one table of `docs/results/tracking.md`: the claims of Wilthil & Brekke (2016), each with what we measure, and
//! what every tracker does beyond them.
//!
//! `cargo run --release -p northing-experiments --example tracking_results -- claims`, or `consistency`,
//! `trackers VARIANT`, `agreement`, `ranges RUNS`. `./scripts/results docs/results/tracking.md` puts all into the page.

#![allow(clippy::print_stdout)] // a table is its output

#[path = "../tests/integration/tracking_expected/mod.rs"]
mod tracking_expected;
#[path = "../tests/integration/tracking_ranges/mod.rs"]
mod tracking_ranges;

use std::error::Error;

use northing_experiments::radar::outcome::{TrackerOutcome, nees_band};
use northing_experiments::radar::{Campaign, CampaignOutcome, Part, Shard, TrackerKind as K};
use northing_simulation::scenario::ScenarioFile;

const SCENARIO: &str = include_str!("../../../scenarios/tracking/wilthil_brekke.toml");

struct Experiments {
    each: Vec<CampaignOutcome>,
    pooled: CampaignOutcome,
}

impl Experiments {
    fn run(variant: &str) -> Result<Self, Box<dyn Error>> {
        let file = ScenarioFile::parse("wilthil_brekke.toml", SCENARIO)?;
        let scenario = file.scenario((variant != "consistent").then_some(variant))?;
        let mut parts: Vec<Part> = Vec::new();
        for seed in 1..=8 {
            parts.push(Campaign::new(&scenario, &[], seed, 100)?.run(Shard::WHOLE, &|| ())?);
        }
        let each = parts.iter().map(CampaignOutcome::of).collect();
        let mut parts = parts.into_iter();
        let mut pooled = parts.next().ok_or("no experiments")?;
        for part in parts {
            pooled.sums = pooled.sums.merged(&part.sums);
        }
        Ok(Self {
            each,
            pooled: CampaignOutcome::of(&pooled),
        })
    }

    /// Mean over the experiments, and its scatter from one to the next.
    fn mean(&self, of: impl Fn(&CampaignOutcome) -> f64) -> (f64, f64) {
        let values: Vec<f64> = self.each.iter().map(of).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        (mean, (square / (n - 1.0).max(1.0)).sqrt())
    }

    fn of(&self, kind: K, number: impl Fn(&TrackerOutcome) -> f64) -> f64 {
        self.mean(|o| o.trackers.get(kind.name()).map_or(f64::NAN, &number))
            .0
    }
}

fn tracker(outcome: &CampaignOutcome, kind: K) -> Option<&TrackerOutcome> {
    outcome.trackers.get(kind.name())
}

/// Velocity RMSE of one tracker over that of another, between two times.
fn velocity_ratios(outcome: &CampaignOutcome, a: K, b: K, from: f64, to: f64) -> Vec<f64> {
    let (Some(a), Some(b)) = (tracker(outcome, a), tracker(outcome, b)) else {
        return Vec::new();
    };
    let pairs = a
        .series
        .velocity_rmse_m_s
        .iter()
        .zip(&b.series.velocity_rmse_m_s);
    let timed = a.series.time_s.iter().zip(pairs);
    timed
        .filter(|(t, _)| (from..=to).contains(*t))
        .map(|(_, (a, b))| a / b)
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn peak(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn pm((mean, std): (f64, f64)) -> String {
    format!("{mean:.3} \u{b1} {std:.3}")
}

fn table(experiments: &Experiments) {
    println!(
        "| tracker | position m | velocity m/s | steady position m | steady velocity m/s | NEES | in band (100 runs) |"
    );
    println!("|---|---|---|---|---|---|---|");
    for kind in K::ALL {
        let of = |number: fn(&TrackerOutcome) -> f64| experiments.of(kind, number);
        let lost =
            |o: &CampaignOutcome| tracker(o, kind).is_none_or(TrackerOutcome::has_lost_the_target);
        if experiments.each.iter().any(lost) {
            println!("| `{}` | loses the target | | | | | |", kind.name());
            continue;
        }
        println!(
            "| `{}` | {:.2} | {:.3} | {:.2} | {:.3} | {:.2} | {:.0} % |",
            kind.name(),
            of(|t| t.position_rmse_m),
            of(|t| t.velocity_rmse_m_s),
            of(|t| t.steady.position_rmse_m),
            of(|t| t.steady.velocity_rmse_m_s),
            of(|t| t.nees_mean),
            100.0 * of(|t| t.nees_inside_band),
        );
    }
}

/// The trackers that the paper compares.
const UNCOMPENSATED: K = K::UncompensatedConverted;
const AUTHORS: K = K::SchmidtAuthors;

/// One claim: what is said, what we measure, and what follows where that is as expected.
fn claim(said: &str, measured: &str, holds: bool, verdict: &str) {
    let verdict = if holds { verdict } else { "**not reproduced**" };
    println!("| {said} | {measured} | {verdict} |");
}

fn claims_about_position(paper: &Experiments) {
    let ratio = |a: K, b: K, until: f64| {
        let rmse = move |o: &CampaignOutcome, kind| {
            tracker(o, kind).map_or(f64::NAN, |t| {
                t.series.errors(|t| t <= until).position_rmse_m
            })
        };
        paper.mean(move |o| rmse(o, a) / rmse(o, b))
    };
    let all = f64::INFINITY;
    let (whole, transient) = (
        ratio(UNCOMPENSATED, K::Converted, all),
        ratio(UNCOMPENSATED, K::Converted, 60.0),
    );
    let schmidt = ratio(K::Schmidt, K::Converted, all);
    claim(
        "position errors about equal, converted slightly lower in the transient",
        &format!(
            "uncompensated / converted {}, up to 60 s {}; exact Schmidt / converted {}",
            pm(whole),
            pm(transient),
            pm(schmidt)
        ),
        whole.0 < 1.1 && transient.0 > whole.0 && (schmidt.0 - 1.0).abs() < 0.05,
        "reproduced",
    );
    let closest = |kind| {
        paper.of(kind, |t| {
            let passing = t.series.errors(|t| (190.0..=210.0).contains(&t));
            passing.position_rmse_m
        })
    };
    let (converted, told) = (closest(K::Converted), closest(K::TruePoseConverted));
    claim(
        "comparable to ground truth at the closest point",
        &format!("190-210 s: converted {converted:.1} m, true pose {told:.1} m"),
        converted < 1.5 * told,
        "reproduced",
    );
}

fn claims_about_velocity(paper: &Experiments) {
    let between = |a, b, from, to, of: fn(&[f64]) -> f64| {
        paper.mean(move |o| of(&velocity_ratios(o, a, b, from, to)))
    };
    let highest = between(UNCOMPENSATED, K::Converted, 1.0, 60.0, peak);
    claim(
        "velocity transient better by a factor of 1.5",
        &format!(
            "uncompensated / converted, largest of 1-60 s: {}; mean of 5-40 s: {}",
            pm(highest),
            pm(between(UNCOMPENSATED, K::Converted, 5.0, 40.0, mean)),
        ),
        (1.35..1.65).contains(&highest.0),
        "reproduced, as a peak",
    );
    let late = |b| between(UNCOMPENSATED, b, 201.0, 300.0, mean);
    claim(
        "Schmidt-Kalman \"seems to become more erroneous\" in steady state",
        &format!(
            "after 200 s uncompensated / authors' Schmidt {} (below one: worse than no compensation), / converted {}",
            pm(late(AUTHORS)),
            pm(late(K::Converted))
        ),
        late(AUTHORS).0 < 1.0 && late(K::Converted).0 > 1.0,
        "reproduced",
    );
    let steady = |kind| paper.of(kind, |t| t.steady.velocity_rmse_m_s);
    claim(
        "(the same, exact cross-covariance)",
        &format!(
            "uncompensated / exact Schmidt {}; velocity RMSE after 60 s {:.2} \u{2192} {:.2} m/s",
            pm(late(K::Schmidt)),
            steady(AUTHORS),
            steady(K::Schmidt),
        ),
        late(K::Schmidt).0 >= 1.12 && steady(K::Schmidt) <= 0.85 * steady(AUTHORS),
        "explained: not a property of the method",
    );
}

fn claims_about_consistency(paper: &Experiments, halved: &Experiments) {
    let nees = |kind| paper.of(kind, |t| t.nees_mean);
    let inside = |of: fn(&TrackerOutcome) -> f64| {
        [K::TruePoseConverted, AUTHORS].map(|kind| 100.0 * paper.of(kind, of))
    };
    let [two, right] = [
        inside(|t| t.nees_inside_band_2dof),
        inside(|t| t.nees_inside_band),
    ];
    claim(
        "NEES of true pose and Schmidt mostly in the 95 % band",
        &format!(
            "NEES {:.2} and {:.2}; inside the band of 2 degrees of freedom {:.0} % and {:.0} %, of the right 4: {:.0} % and {:.0} %",
            nees(K::TruePoseConverted),
            nees(AUTHORS),
            two[0],
            two[1],
            right[0],
            right[1],
        ),
        two.iter().all(|share| *share > 50.0) && right.iter().all(|share| *share < 1.0),
        "only with the band of 2",
    );
    let end = paper.each.first().map_or(f64::NAN, |o| o.nees_band_2dof[1]);
    claim(
        "converted slightly above, uncompensated far above",
        &format!(
            "NEES {:.2} and {:.2}; the band of 2 ends at {end:.2}",
            nees(K::Converted),
            nees(UNCOMPENSATED)
        ),
        nees(K::Converted) > end && nees(UNCOMPENSATED) > nees(K::Converted) + 1.0,
        "reproduced",
    );
    let to = |kind| halved.of(kind, |t| t.nees_mean);
    let halving = |kind| format!("{:.2} \u{2192} {:.2}", nees(kind), to(kind));
    let drop = |kind| nees(kind) - to(kind);
    claim(
        "halved navigation noise lowers uncompensated much, converted slightly, the others not",
        &format!(
            "{}; {}; true pose {}; authors' Schmidt {}",
            halving(UNCOMPENSATED),
            halving(K::Converted),
            halving(K::TruePoseConverted),
            halving(AUTHORS),
        ),
        drop(UNCOMPENSATED) > 2.0 * drop(K::Converted)
            && drop(K::Converted) > 2.0 * drop(AUTHORS)
            && drop(K::TruePoseConverted).abs() < 0.05,
        "reproduced",
    );
}

/// Whether the exact trackers are consistent where the models are those of the simulation.
fn consistency(consistent: &Experiments) {
    let [low, high] = nees_band(consistent.pooled.runs, 4);
    println!("| beyond the paper, models equal to the truth | measured |");
    println!("|---|---|");
    for kind in [K::Schmidt, K::SchmidtFeedForward, K::Converted] {
        let Some(pooled) = tracker(&consistent.pooled, kind) else {
            continue;
        };
        let late: Vec<f64> = pooled
            .series
            .time_s
            .iter()
            .zip(&pooled.series.nees)
            .filter(|(t, _)| **t >= 20.0)
            .map(|(_, nees)| f64::from(u8::from((low..=high).contains(nees))))
            .collect();
        println!(
            "| `{}`: share of scans from 20 s on with the NEES of all {} runs in {low:.2}-{high:.2} | {:.0} % |",
            kind.name(),
            consistent.pooled.runs,
            100.0 * mean(&late)
        );
    }
    let position = |kind| tracker(&consistent.pooled, kind).map_or(f64::NAN, |t| t.position_rmse_m);
    let forward = position(K::SchmidtFeedForward);
    println!(
        "| position RMSE, feed-forward / converted | {:.3} |",
        forward / position(K::Converted)
    );
    println!(
        "| position RMSE, feed-forward / joint | {:.3} |",
        forward / position(K::Joint)
    );
}

/// Beside the expected values of an independent reproduction.
fn agreement() -> Result<(), Box<dyn Error>> {
    println!(
        "| variant | rows | within the tolerance | only within the errors of both | only with the arc's 1 % | off |"
    );
    println!("|---|---|---|---|---|---|");
    for name in ["consistent", "paper", "paper_halved", "mems", "perstep"] {
        let experiments = Experiments::run(name)?;
        let found = tracking_expected::agreement(name, &experiments.each);
        println!(
            "| `{name}` | {} | {} | {} | {} | {} |",
            found.rows,
            found.within_tolerance,
            found.within_errors,
            found.within_arc,
            found.off.len()
        );
    }
    Ok(())
}

/// Mean NEES over range, precision and compass: a row a range and a radar, a column a compass and a tracker.
fn ranges(runs: u64) -> Result<(), Box<dyn Error>> {
    let trackers = [
        K::TruePose,
        K::Converted,
        K::Schmidt,
        K::SchmidtFeedForward,
        K::Joint,
    ];
    let names = trackers
        .map(|kind| format!("`{}`", kind.name()))
        .join(" | ");
    println!("| range | radar | compass | {names} |");
    println!("|---|---|---|{}", "---|".repeat(trackers.len()));
    for cell in tracking_ranges::Cell::all() {
        let outcome = cell.outcome(&trackers, runs)?;
        let numbers = trackers.map(|kind| {
            tracker(&outcome, kind).map_or_else(String::new, |t| format!("{:.2}", t.nees_mean))
        });
        println!(
            "| {} km | {} m, {}\u{b0} | {}\u{b0} | {} |",
            cell.range_m / 1e3,
            cell.range_std_m,
            cell.bearing_std_deg,
            cell.compass_std_deg,
            numbers.join(" | ")
        );
    }
    Ok(())
}

fn claims(paper: &Experiments, halved: &Experiments) {
    println!("| claim of the paper | measured | verdict |");
    println!("|---|---|---|");
    claims_about_position(paper);
    claims_about_velocity(paper);
    claims_about_consistency(paper, halved);
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["claims"] => claims(
            &Experiments::run("paper")?,
            &Experiments::run("paper_halved")?,
        ),
        ["consistency"] => consistency(&Experiments::run("consistent")?),
        ["trackers", variant] => table(&Experiments::run(variant)?),
        ["agreement"] => agreement()?,
        ["ranges", runs] => ranges(runs.parse()?)?,
        _ => {
            let expected =
                "expected claims, consistency, trackers VARIANT, agreement or ranges RUNS";
            return Err(expected.into());
        }
    }
    Ok(())
}
