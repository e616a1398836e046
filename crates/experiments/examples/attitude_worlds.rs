//! One attitude estimator over random worlds, a line a motion and a fault: for the quick look while a filter is changed.
//!
//! `cargo run --release -p northing-experiments --example attitude_worlds -- [WORLDS [ESTIMATOR [NAME=VALUE ...]]]`, by default 270 worlds
//! of `bounded-velocity`.

#![allow(clippy::print_stdout)] // an example's output is its purpose

use northing_evaluation::EstimatorKind;
use northing_experiments::attitude_worlds::{GroupRow, Sensing, Worlds};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let count = arguments.next().map_or(Ok(270), |text| text.parse())?;
    let name = arguments.next();
    let subject: EstimatorKind = name.as_deref().unwrap_or("bounded-velocity").parse()?;
    let worlds = Worlds {
        count,
        estimators: vec![subject],
        settings: arguments.collect(),
        ..Worlds::thousand()
    };
    let outcome = worlds.run(&|| ())?;
    for sensing in Sensing::ALL {
        let Some(of) = outcome.estimator(subject.name(), sensing) else {
            continue;
        };
        println!("{subject}, {}", sensing.name());
        println!(
            "{:22} {:>6} {:>15} {:>15} {:>15} {:>15} {:>17} {:>17}",
            "",
            "worlds",
            "tilt deg",
            "/vqf",
            "heading deg",
            "/vqf",
            "tilt cov. in band",
            "head. cov. in band"
        );
        for row in of.motions.iter().chain(&of.faults).chain([&of.total]) {
            println!("{}", line(row));
        }
        println!();
    }
    Ok(())
}

fn line(row: &GroupRow) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
    let [tilt, heading] = [&row.tilt, &row.heading].map(|stated| {
        stated.as_ref().map_or_else(
            || "-".to_owned(),
            |s| {
                let [pooled, band, expected] =
                    [s.pooled_coverage, s.consistent_share, s.expected_share].map(|v| 100.0 * v);
                format!("{pooled:.1} {band:.0}/{expected:.0}")
            },
        )
    });
    format!(
        "{:22} {:>6} {:>15} {:>15} {:>15} {:>15} {tilt:>17} {heading:>17}",
        row.group,
        row.worlds,
        number(row.tilt_rms_deg),
        number(row.tilt_over_vqf),
        number(row.heading_rms_deg),
        number(row.heading_over_vqf),
    )
}
