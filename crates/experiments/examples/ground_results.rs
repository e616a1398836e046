//! Prints one table of the simulated part of `docs/results/navigation.md`.
//!
//! `cargo run --release -p northing-experiments --example ground_results -- walk white`: a motion (`walk`, `drive`) and
//! `white`, `correlated` (receiver errors), `outages` or `consistency`. `./scripts/results docs/results/navigation.md`
//! puts all into the page.

#![allow(clippy::print_stdout)] // a table is its output

use std::error::Error;

use northing_experiments::ground::{
    Consistency, Experiment, OUTAGES_S, OutageScore, TrackingScore,
};
use northing_simulation::ground::{Ground, ReceiverError};

fn tracking(scores: &[TrackingScore]) {
    println!("| scheme | horizontal m | vertical m | velocity m/s | tilt deg | heading deg |");
    println!("|---|---:|---:|---:|---:|---:|");
    let cell = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.2}"));
    for score in scores {
        println!(
            "| {} | {:.2} | {:.2} | {} | {} | {} |",
            score.scheme.name(),
            score.horizontal_m,
            score.vertical_m,
            cell(score.velocity_m_s),
            cell(score.tilt_deg),
            cell(score.heading_deg)
        );
    }
}

fn outages(scores: &[OutageScore]) {
    let head = OUTAGES_S.map(|seconds| format!(" {seconds} s |")).concat();
    println!("| scheme |{head}\n|---|---:|---:|---:|");
    for score in scores {
        let cells = score.median_m.iter().zip(&score.ninety_m);
        let cells: String = cells.map(|(a, b)| format!(" {a:.1} / {b:.1} |")).collect();
        println!("| {} |{cells}", score.scheme.name());
    }
}

fn consistency(consistency: &Consistency) {
    println!("| | |\n|---|---|");
    let nees = consistency.nees.iter().map(|n| format!("{n:.1}"));
    let nees: Vec<String> = nees.collect();
    println!("| mean NEES of the 15 states | {} |", nees.join(", "));
    let states = [
        "attitude",
        "velocity",
        "position",
        "accelerometer bias",
        "gyroscope bias",
    ];
    for (state, axes) in states
        .iter()
        .zip(consistency.squared_over_variance.chunks(3))
    {
        let axes: Vec<String> = axes.iter().map(|share| format!("{share:.2}")).collect();
        println!(
            "| error squared over variance, {state} | {} |",
            axes.join(", ")
        );
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let experiment = Experiment { runs: 100, seed: 1 };
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [motion, table] = &arguments[..] else {
        return Err("expected a motion and a table: ground_results walk white".into());
    };
    let motion = match motion.as_str() {
        "walk" => Ground::Walk,
        "drive" => Ground::Drive,
        _ => return Err("expected walk or drive".into()),
    };
    match table.as_str() {
        "white" => tracking(&experiment.tracking(motion, ReceiverError::White)),
        "correlated" => tracking(&experiment.tracking(motion, ReceiverError::Correlated)),
        "outages" => outages(&experiment.outages(motion)),
        "consistency" => consistency(&experiment.consistency(motion)),
        _ => return Err("expected white, correlated, outages or consistency".into()),
    }
    Ok(())
}
