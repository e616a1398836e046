//! Prints the simulated part of `docs/results/navigation.md`.
//!
//! `cargo run --release -p northing-experiments --example ground_results`

#![allow(clippy::print_stdout)]

use northing_experiments::ground::{Experiment, markdown};
use northing_simulation::ground::Ground;

fn main() {
    let experiment = Experiment { runs: 100, seed: 1 };
    println!("{}", markdown(&experiment));
    for (kind, name) in [(Ground::Walk, "on foot"), (Ground::Drive, "by car")] {
        let c = experiment.consistency(kind);
        let nees: Vec<String> = c.nees.iter().map(|n| format!("{n:.1}")).collect();
        let shares = c
            .squared_over_variance
            .map(|s| format!("{s:.2}"))
            .join(", ");
        println!(
            "Consistency {name}: mean NEES of the 15 states {}; error squared over variance, state by state: \
             {shares}.",
            nees.join(", ")
        );
    }
}
