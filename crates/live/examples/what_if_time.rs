//! How long a what-if takes: ten minutes of a virtual phone at 100 Hz, three estimators.
//!
//! `cargo run --release -p northing-live --example what_if_time`

use std::io::Write as _;
use std::time::Instant;

use northing_evaluation::attitude::alterations::{Alterations, Pulse};
use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use northing_live::experiments::Finished;
use northing_live::messages::Change;
use northing_live::session::experiment::ExperimentRun;
use northing_recording::SensorKind;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::Value;

/// Ten minutes; a phone of flesh and blood comes without the truth, which costs the comparison of two clocks a run.
fn experiment(with_truth: bool) -> Result<Finished, Box<dyn std::error::Error>> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        duration_s: Some(600.0),
        ..VirtualPhoneConfig::default()
    })?;
    let mut run = ExperimentRun::new(600.0, "ten minutes")?;
    run.begin(0, Vec::new());
    for event in phone.events() {
        if with_truth || event.sample.kind() != SensorKind::Reference {
            run.add(&event);
        }
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
        originals: Default::default(),
        experiment: run.finish(),
    };
    // The device's own orientation is the third.
    Ok(finished.evaluated()?)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let altered = Alterations {
        gyroscope_step_deg_s: Some(0.1),
        accelerometer_step_m_s2: Some(0.1),
        delay_s: Some(0.05),
        lost_share: Some(0.05),
        bump: Some(Pulse {
            at_s: 300.0,
            duration_s: 0.5,
            size: 5.0,
        }),
        magnet: Some(Pulse {
            at_s: 400.0,
            duration_s: 5.0,
            size: 30.0,
        }),
        rate_hz: None,
    };
    let mut out = std::io::stdout().lock();
    for (whose, with_truth) in [("a phone", false), ("a virtual phone with its truth", true)] {
        let finished = experiment(with_truth)?;
        let (events, estimators) = (finished.experiment.events.len(), finished.estimators.len());
        writeln!(out, "{whose}: {events} events, {estimators} estimators")?;
        for (what, alterations) in [
            ("as measured", Alterations::default()),
            ("worse samples", altered),
        ] {
            let change = Change {
                alterations,
                ..Change::default()
            };
            let (mut best, mut worst) = (f64::INFINITY, 0.0_f64);
            for _ in 0..9 {
                let asked = Instant::now();
                finished.what_if(&change, Value::Null)?;
                let took = asked.elapsed().as_secs_f64() * 1e3;
                (best, worst) = (best.min(took), worst.max(took));
            }
            writeln!(
                out,
                "  {what}: {best:.1} ms, the best of 9; {worst:.1} ms, the worst"
            )?;
        }
    }
    Ok(())
}
