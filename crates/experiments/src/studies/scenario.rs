//! Tracking scenarios in studies: their keys are parameters, and one run is scored over its scans.

use nalgebra::Vector4;
use northing_simulation::scenario::schema::Scenario;
use northing_simulation::scenario::{ScenarioTables as _, TrackingWorld};
use serde_json::Value as Json;

use super::StudyError;
use super::run::Setting;
use crate::radar::TrackerKind;
use crate::radar::experiment::{NavigationRecord, RunWatcher, TrackRecord, run};

/// Degrees of freedom of a target's state.
const FREEDOM: f64 = 4.0;

/// A scenario with values in place of its own; names are those of the file, with points between table and key.
///
/// # Errors
/// There is no such key, or the value does not fit.
pub(super) fn with(base: &Scenario, settings: &[Setting]) -> Result<Scenario, StudyError> {
    let refused = |problem: String| StudyError::Refused(problem);
    let mut all = serde_json::to_value(base).map_err(|error| refused(error.to_string()))?;
    for (name, value) in settings {
        let place = name
            .split('.')
            .try_fold(&mut all, |table, key| table.as_object_mut()?.get_mut(key));
        let Some(place) = place.filter(|place| !place.is_object()) else {
            let names = names(base);
            return Err(refused(format!(
                "unknown parameter `{name}`; {}",
                hint(name, &names)
            )));
        };
        *place = value.clone();
    }
    let scenario: Scenario = serde_json::from_value(all).map_err(|error| {
        let names: Vec<_> = settings.iter().map(|(name, _)| name.as_str()).collect();
        refused(format!("{}: {error}", names.join(", ")))
    })?;
    scenario.check().map_err(refused)?;
    Ok(scenario)
}

fn hint(name: &str, names: &[String]) -> String {
    let near = |known: &String| strsim::jaro_winkler(name, known);
    let best = names.iter().max_by(|a, b| near(a).total_cmp(&near(b)));
    match best.filter(|known| near(known) > 0.8) {
        Some(known) => format!("did you mean `{known}`?"),
        None => format!("expected one of: {}", names.join(", ")),
    }
}

/// Every key that has a value.
fn names(scenario: &Scenario) -> Vec<String> {
    fn walk(prefix: &str, value: &Json, names: &mut Vec<String>) {
        let Json::Object(table) = value else {
            names.push(prefix.to_owned());
            return;
        };
        for (key, value) in table {
            let name = match prefix.is_empty() {
                true => key.clone(),
                false => format!("{prefix}.{key}"),
            };
            walk(&name, value, names);
        }
    }
    let mut all = Vec::new();
    let value = serde_json::to_value(scenario).unwrap_or_default();
    walk("", &value, &mut all);
    all
}

/// Sums of squares over the scans of one run.
#[derive(Default)]
struct Squares {
    sums: [f64; 3],
    scans: u64,
    skipped: u64,
}

impl RunWatcher for Squares {
    fn scan(&mut self, _: usize, _: &NavigationRecord, _: &Vector4<f64>) {}

    fn tracker(&mut self, step: usize, _: usize, record: &TrackRecord, target: &Vector4<f64>) {
        self.skipped += u64::from(record.skipped);
        // Step 0 is the start, which every tracker shares.
        if step == 0 {
            return;
        }
        self.scans += 1;
        let Some(track) = record.estimate else {
            self.sums = [f64::INFINITY; 3];
            return;
        };
        let e = target - track.state;
        let inverse = track.covariance.try_inverse();
        let nees = inverse.map_or(f64::INFINITY, |inverse| e.dot(&(inverse * e)));
        let squares = [e[0] * e[0] + e[2] * e[2], e[1] * e[1] + e[3] * e[3], nees];
        for (sum, square) in self.sums.iter_mut().zip(squares) {
            *sum += square;
        }
    }
}

/// The scores of one run.
pub(super) fn scores(scenario: &Scenario, kind: TrackerKind, seed: u64) -> Vec<f64> {
    let world = TrackingWorld::new(scenario);
    let mut squares = Squares::default();
    run(&world, &[kind], seed, 0, &mut squares);
    let scans = squares.scans as f64;
    let [position, velocity, nees] = squares.sums.map(|sum| sum / scans);
    vec![
        position.sqrt(),
        velocity.sqrt(),
        nees / FREEDOM,
        squares.skipped as f64,
    ]
}
