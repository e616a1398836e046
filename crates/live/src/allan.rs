//! The Allan deviation of an experiment at rest: curve, words, and what it would put into Q.

use northing_evaluation::calibration::allan::{AllanConfig, RestSamples, analyze};
use northing_recording::SensorKind;
use serde_json::{Map, Value, json};

use crate::experiments::Finished;
use crate::to_page::{Allan, AllanState, Fill};

/// What Q consists of.
const PARAMETERS: [&str; 2] = ["gyroscope_noise_density", "gyroscope_bias_random_walk"];

/// Analyses one sensor of an experiment; a record that does not allow it is an answer as well.
#[must_use]
pub fn analysis(finished: &Finished, sensor: SensorKind, request: Value) -> Allan {
    let mut samples = RestSamples::new(sensor);
    for event in &finished.experiment.events {
        samples.add_event(event);
    }
    let config = AllanConfig {
        sensor,
        ..AllanConfig::default()
    };
    let answer = Allan {
        request,
        id: finished.id.clone(),
        sensor,
        state: AllanState::Refused,
        text: None,
        report: None,
        fill: None,
    };
    let report = match analyze(&samples, &config) {
        Ok(report) => report,
        Err(error) => {
            return Allan {
                text: Some(error.to_string()),
                ..answer
            };
        }
    };
    let present = finished.settings().attitude;
    let mut filled = present;
    let said = report.fill(&mut filled);
    let settings = changed(&json!(present), &json!(filled));
    Allan {
        state: AllanState::Done,
        report: Some(report),
        fill: Some(Fill { settings, said }),
        ..answer
    }
}

/// The parameters of Q that differ.
fn changed(before: &Value, after: &Value) -> Map<String, Value> {
    let differs = PARAMETERS
        .iter()
        .filter(|name| before[**name] != after[**name]);
    differs
        .map(|name| ((*name).to_owned(), after[*name].clone()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::experiment::Experiment;
    use northing_evaluation::{EstimatorKind, Profile, RunOptions};
    use northing_simulation::virtual_phone::Motion;
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    /// Ten minutes of a phone at rest whose gyroscope's noise is known.
    fn rest(seconds: f64) -> Finished {
        let phone = VirtualPhone::new(VirtualPhoneConfig {
            motion: Motion::Rest,
            duration_s: Some(seconds),
            ..VirtualPhoneConfig::default()
        })
        .unwrap();
        let options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        Finished {
            id: "e1".to_owned(),
            device: "d".to_owned(),
            device_name: "D".to_owned(),
            at: String::new(),
            experiment: Experiment {
                name: "rest".to_owned(),
                seconds,
                events: phone.events().collect(),
                starts: Vec::new(),
                changed: Vec::new(),
            },
            options,
            estimators: vec![EstimatorKind::Mekf],
            subject: EstimatorKind::Mekf,
            summaries: Default::default(),
            hash: String::new(),
            originals: Default::default(),
        }
    }

    #[test]
    fn q_is_filled_with_the_noise_of_the_phone() {
        let finished = rest(600.0);
        let answer = json!(analysis(&finished, SensorKind::Gyroscope, Value::Null));
        assert_eq!(answer["state"], "done", "{answer}");
        let gyroscope = VirtualPhoneConfig::default().gyroscope;
        let density = gyroscope.noise_std_rad_s / gyroscope.sampling.rate_hz.sqrt();
        let expected = density.hypot(gyroscope.noise_density_rad_s_sqrt_hz);
        let found = answer["fill"]["settings"]["gyroscope_noise_density"].as_f64();
        let found = found.unwrap();
        assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
        assert!(answer["report"]["curve"].as_array().unwrap().len() > 20);
        assert!(!answer["fill"]["said"].as_array().unwrap().is_empty());
    }

    #[test]
    fn other_sensors_fill_nothing() {
        let answer = json!(analysis(
            &rest(90.0),
            SensorKind::Accelerometer,
            Value::Null
        ));
        assert_eq!(answer["fill"]["settings"], json!({}));
        assert_eq!(answer["report"]["unit"], "m/s^2");
    }
}
