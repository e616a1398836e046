//! try
#![allow(clippy::print_stdout, missing_docs)]
use northing_core::attitude::complementary::ComplementaryForm as F;
use northing_evaluation::observers::experiment::{
    SCENARIO, SCENARIO_NAME, default_gains, read_all,
};
use northing_evaluation::observers::{Experiment, Form, Gains, schemes};
use northing_simulation::scenario::FlightScenarioFile;
fn main() {
    let file = FlightScenarioFile::parse(SCENARIO_NAME, SCENARIO).unwrap();
    let only = std::env::args().nth(1);
    let e = Experiment {
        flights: 30,
        seed: 1,
    };
    if only.as_deref() != Some("broad") {
        for v in file.variants() {
            let t = std::time::Instant::now();
            let c = e.simulated(&file.scenario(Some(v)).unwrap()).unwrap();
            println!(
                "{v}: default {:.2} {:.2} {:.2} gain {:.0} | tuned {:.2} {:.2} {:.2} gain {:.0} {:.0?} | weighted {:.2} | pos {:.0?} vel {:.0?} noterm {:.2?} | northing {:.2?} | settle {:?} cost {:.0?} {:.1} s",
                c.default.original_deg,
                c.default.modified_deg,
                c.default.ekf_deg,
                c.default.gain_percent,
                c.tuned.original_deg,
                c.tuned.modified_deg,
                c.tuned.ekf_deg,
                c.tuned.gain_percent,
                c.tuned.gain_ci95,
                c.original_weighted_deg,
                c.default.position_gain_percent,
                c.default.velocity_gain_percent,
                c.position_without_rate_term_m,
                [
                    c.northing.original_deg,
                    c.northing.modified_deg,
                    c.northing.ekf_deg
                ],
                c.default.scores.map(|s| s.settled_s),
                [c.cost_ns.original, c.cost_ns.modified, c.cost_ns.ekf],
                t.elapsed().as_secs_f64()
            );
        }
    }
    let mut paths: Vec<_> = std::fs::read_dir("/work/shared/data/attitude/broad")
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|x| x == "parquet"))
        .collect();
    paths.sort();
    let data = read_all(&paths, &Default::default()).unwrap();
    println!("{} trials", data.len());
    let g = |kp: f64, ki: f64, ka: f64, al: f64, sm: f64| Gains {
        attitude_gain: kp,
        bias_gain: ki,
        accelerometer_weight: ka,
        linear_acceleration_std: al,
        field_std: sm,
    };
    let blind: Vec<_> = data.iter().map(|d| d.without_magnetometer()).collect();
    if only.as_deref() == Some("sim") {
        return;
    }
    for form in [Form::Printed] {
        println!("{form:?}");
        let row = |name: &str,
                   data: &[northing_evaluation::observers::ObserverData],
                   f: &dyn Fn(
            &northing_evaluation::observers::ObserverData,
        ) -> Vec<schemes::Estimate>| {
            let s: Vec<_> = data
                .iter()
                .map(|d| schemes::score(d, &f(d)).unwrap())
                .collect();
            let m = |x: fn(&schemes::Score) -> f64| s.iter().map(x).sum::<f64>() / s.len() as f64;
            println!(
                "{name}: {:.2} {:.2} {:.2}   {:.1?}",
                m(|s| s.total_deg),
                m(|s| s.inclination_deg),
                m(|s| s.heading_deg),
                s.iter().map(|s| s.total_deg).collect::<Vec<_>>()
            );
        };
        row("O default 34.5 9.65 33", &data, &|d| {
            schemes::original(d, F::Explicit, &g(1., 0.3, 1., 0.5, 2.), form).unwrap()
        });
        row("O tuned 7.92 4.10 6.65", &data, &|d| {
            schemes::original(d, F::Explicit, &g(0.8, 0., 1., 0.5, 2.), form).unwrap()
        });
        row("O ka 9.24 3.54 8.36", &data, &|d| {
            schemes::original(d, F::Explicit, &g(0.3, 0., 3., 0.5, 2.), form).unwrap()
        });
        row("TRIAD 20.3 13.5 14.5", &data, &|d| {
            schemes::original(d, F::Passive, &g(1., 0.3, 1., 0.5, 2.), form).unwrap()
        });
        row("M default 4.76 2.46 3.96", &data, &|d| {
            schemes::modified(
                d,
                &schemes::ekf(d, &default_gains(0.5, 2.), form).unwrap(),
                &g(1., 0.3, 1., 0.5, 2.),
                form,
            )
            .unwrap()
        });
        row("M tuned 4.51 2.17 3.88", &data, &|d| {
            schemes::modified(
                d,
                &schemes::ekf(d, &default_gains(1., 4.), form).unwrap(),
                &g(4., 0.3, 1., 0.5, 2.),
                form,
            )
            .unwrap()
        });
        row("E default 4.51 2.07 3.93", &data, &|d| {
            schemes::ekf(d, &default_gains(0.5, 2.), form).unwrap()
        });
        row("E tuned 4.45 2.06 3.87", &data, &|d| {
            schemes::ekf(d, &default_gains(1., 4.), form).unwrap()
        });
        row("O acc 2.28", &blind, &|d| {
            schemes::original(d, F::Explicit, &g(0.2, 0., 1., 0.5, 2.), form).unwrap()
        });
        row("M acc 2.33", &blind, &|d| {
            schemes::modified(
                d,
                &schemes::ekf(d, &default_gains(8., 2.), form).unwrap(),
                &g(4., 0.3, 1., 0.5, 2.),
                form,
            )
            .unwrap()
        });
    }
}
