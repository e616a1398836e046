//! How long a what-if takes: ten minutes of a virtual phone at 100 Hz, three estimators.
//!
//! `cargo run --release -p northing-live --example what_if_time`

use std::io::Write as _;
use std::time::Instant;

use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use northing_live::experiments::Finished;
use northing_live::session::experiment::ExperimentRun;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::{Map, Value};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        duration_s: Some(600.0),
        ..VirtualPhoneConfig::default()
    })?;
    let mut run = ExperimentRun::new(600.0, "ten minutes")?;
    run.begin(0, Vec::new());
    for event in phone.events() {
        run.add(&event);
    }
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
    let finished = Finished {
        id: "e1".to_owned(),
        device: "phone".to_owned(),
        device_name: "phone".to_owned(),
        at: String::new(),
        options,
        estimators: vec![EstimatorKind::Mekf, EstimatorKind::Integration],
        subject: EstimatorKind::Mekf,
        summaries: Default::default(),
        hash: String::new(),
        experiment: run.finish(),
    };
    // The device's own orientation is the third.
    let finished = finished.evaluated()?;
    let mut best = f64::INFINITY;
    for _ in 0..9 {
        let asked = Instant::now();
        finished.what_if(&Map::new(), Value::Null)?;
        best = best.min(asked.elapsed().as_secs_f64() * 1e3);
    }
    let (events, estimators) = (finished.experiment.events.len(), finished.estimators.len());
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{events} events, {estimators} estimators: {best:.1} ms, the best of 9"
    )?;
    Ok(())
}
