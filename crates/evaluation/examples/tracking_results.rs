//! Prints `docs/results/tracking.md`: the claims of Wilthil & Brekke (2016), each with what we measure.
//!
//! `cargo run --release -p northing-evaluation --example tracking_results > docs/results/tracking.md`

#![allow(clippy::print_stdout)] // the page is its output

#[path = "../tests/tracking_expected/mod.rs"]
mod tracking_expected;

use std::error::Error;
use std::time::Instant;

use northing_evaluation::tracking::outcome::{TrackerOutcome, nees_band};
use northing_evaluation::tracking::{Campaign, CampaignOutcome, Part, Shard, TrackerKind as K};
use northing_simulation::scenario::ScenarioFile;

const SCENARIO: &str = include_str!("../../../scenarios/tracking/wilthil_brekke.toml");

struct Experiments {
    each: Vec<CampaignOutcome>,
    pooled: CampaignOutcome,
}

impl Experiments {
    fn run(variant: &str) -> Result<Self, Box<dyn Error>> {
        let scenario =
            ScenarioFile::parse("wilthil_brekke.toml", SCENARIO)?.scenario(Some(variant))?;
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
        .velocity_rmse_mps
        .iter()
        .zip(&b.series.velocity_rmse_mps);
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
        if of(|t| t.nees_mean).abs() > 1e6 || !of(|t| t.nees_mean).is_finite() {
            println!("| `{}` | diverges | | | | | |", kind.name());
            continue;
        }
        println!(
            "| `{}` | {:.2} | {:.3} | {:.2} | {:.3} | {:.2} | {:.0} % |",
            kind.name(),
            of(|t| t.position_rmse_m),
            of(|t| t.velocity_rmse_mps),
            of(|t| t.steady.position_rmse_m),
            of(|t| t.steady.velocity_rmse_mps),
            of(|t| t.nees_mean),
            100.0 * of(|t| t.nees_inside_band),
        );
    }
    println!();
}

fn claims(paper: &Experiments, halved: &Experiments) {
    let (uc, cm, authors, exact) = (
        K::UncompensatedConverted,
        K::Converted,
        K::SchmidtAuthors,
        K::Schmidt,
    );
    let ratio = |a: K, b: K| {
        paper.mean(move |o| {
            let position = |kind| tracker(o, kind).map_or(f64::NAN, |t| t.position_rmse_m);
            position(a) / position(b)
        })
    };
    let late = |a, b| pm(paper.mean(move |o| mean(&velocity_ratios(o, a, b, 201.0, 300.0))));
    let nees = |kind| paper.of(kind, |t| t.nees_mean);
    let dof2 = |kind| 100.0 * paper.of(kind, |t| t.nees_inside_band_2dof);
    let dof4 = |kind| 100.0 * paper.of(kind, |t| t.nees_inside_band);
    let halving = |kind| {
        format!(
            "{:.2} \u{2192} {:.2}",
            nees(kind),
            halved.of(kind, |t| t.nees_mean)
        )
    };
    println!("| claim of the paper | measured | verdict |");
    println!("|---|---|---|");
    println!(
        "| position errors about equal, converted slightly lower | uncompensated / converted {}; exact Schmidt / converted {} | reproduced |",
        pm(ratio(uc, cm)),
        pm(ratio(exact, cm))
    );
    println!(
        "| velocity transient better by a factor of 1.5 | uncompensated / converted, largest of 1-60 s: {}; mean of 5-40 s: {} | reproduced, as a peak |",
        pm(paper.mean(|o| peak(&velocity_ratios(o, uc, cm, 1.0, 60.0)))),
        pm(paper.mean(|o| mean(&velocity_ratios(o, uc, cm, 5.0, 40.0)))),
    );
    println!(
        "| Schmidt-Kalman \"seems to become more erroneous\" in steady state | uncompensated / authors' Schmidt after 200 s: {} (below one: worse than no compensation); / converted {} | reproduced |",
        late(uc, authors),
        late(uc, cm)
    );
    println!(
        "| (explained) | the same with the exact cross-covariance: {}; steady velocity RMSE {:.2} \u{2192} {:.2} m/s | not a property of the method |",
        late(uc, exact),
        paper.of(authors, |t| t.steady.velocity_rmse_mps),
        paper.of(exact, |t| t.steady.velocity_rmse_mps),
    );
    println!(
        "| NEES of true pose and Schmidt mostly in the 95 % band | NEES {:.2} and {:.2}; inside the band of 2 degrees of freedom {:.0} % and {:.0} %, of the right 4: {:.0} % and {:.0} % | only with the band of 2 |",
        nees(K::TruePoseConverted),
        nees(authors),
        dof2(K::TruePoseConverted),
        dof2(authors),
        dof4(K::TruePoseConverted),
        dof4(authors),
    );
    println!(
        "| converted slightly above, uncompensated far above | NEES {:.2} and {:.2}; the band of 2 ends at 2.41 | reproduced |",
        nees(cm),
        nees(uc)
    );
    println!(
        "| halved navigation noise lowers uncompensated much, converted slightly, the others not | {}; {}; true pose {}; authors' Schmidt {} | reproduced |",
        halving(uc),
        halving(cm),
        halving(K::TruePoseConverted),
        halving(authors),
    );
    println!();
}

fn targets(consistent: &Experiments) {
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
    println!();
}

/// Beside the expected values of an independent reproduction.
fn agreements(variants: &[(&str, &Experiments)]) {
    println!("## Beside an independent reproduction\n");
    println!(
        "An implementation in another language, written for the same scenario, gave the numbers of"
    );
    println!(
        "[`wilthil_brekke_expected.csv`](../../scenarios/tracking/wilthil_brekke_expected.csv): errors, NEES, shares of scans"
    );
    println!("and ratios, each with a tolerance. Means of our experiments beside it:\n");
    println!("| variant | rows | within the tolerance | only within the errors of both | off |");
    println!("|---|---|---|---|---|");
    for (name, experiments) in variants {
        let found = tracking_expected::agreement(name, &experiments.each);
        println!(
            "| `{name}` | {} | {} | {} | {} |",
            found.rows,
            found.within_tolerance,
            found.within_errors,
            found.off.len()
        );
    }
    println!(
        "\nA tolerance is a multiple of the scatter of the reproduction's experiments. For `mems` and `perstep` these were"
    );
    println!(
        "two, which tells little of a scatter; there a row may also agree within four standard errors of the"
    );
    println!("difference, by the scatter of our eight.");
}

fn main() -> Result<(), Box<dyn Error>> {
    let started = Instant::now();
    let consistent = Experiments::run("base")?;
    let paper = Experiments::run("paper")?;
    let halved = Experiments::run("paper_halved")?;
    println!("# Tracking with an uncertain own position: results\n");
    println!("Made by `cargo run --release -p northing-evaluation --example tracking_results`, on");
    println!(
        "[`scenarios/tracking/wilthil_brekke.toml`](../../scenarios/tracking/wilthil_brekke.toml). Experiments of 100 runs;"
    );
    println!("mean \u{b1} scatter from one experiment to the next. Letters and equations:");
    println!("[schmidt_kalman](../derivations/schmidt_kalman.md).\n");
    println!("## The paper's claims, in the paper's setting\n");
    println!(
        "Two models of this setting are wrong on purpose, as in the authors' simulation: the navigation filter"
    );
    println!(
        "takes a standard deviation of each sample for a density, and the trackers assume 1 m/s\u{b2} for a target that"
    );
    println!("goes straight. {} experiments.\n", paper.each.len());
    claims(&paper, &halved);
    table(&paper);
    println!("## Models equal to the truth\n");
    println!("NEES 4 is honest. {} experiments.\n", consistent.each.len());
    targets(&consistent);
    table(&consistent);
    println!(
        "`schmidt-literal` follows the printed recursion; it is not a recursion of a covariance (section 4 of the derivation).\n"
    );
    let mems = Experiments::run("mems")?;
    let perstep = Experiments::run("perstep")?;
    for (name, experiments) in [("mems", &mems), ("perstep", &perstep)] {
        println!("## Variant `{name}`\n");
        table(experiments);
    }
    agreements(&[
        ("consistent", &consistent),
        ("paper", &paper),
        ("paper_halved", &halved),
        ("mems", &mems),
        ("perstep", &perstep),
    ]);
    eprintln!("{:.1} s", started.elapsed().as_secs_f64());
    Ok(())
}
