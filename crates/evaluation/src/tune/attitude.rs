//! The fit of an attitude estimator.

use std::convert::Infallible;

use northing_core::parameters::Value;
use northing_recording::{Event, SensorKind};
use rayon::prelude::*;

use super::likelihood::{Likelihood, split_ns};
use super::{Fit, TuneOptions, TuneOutcome};
use crate::attitude::parameters::{self, Row};
use crate::attitude::runner::run;
use crate::attitude::{EstimatorKind, InnovationRecord, RunObserver, RunOptions};
use crate::error::EvaluationError;

/// Runs over a recording with different spans hidden, judged together.
const PHASES: usize = 4;

/// Fits parameters of `options` to a recording's events, without its reference.
///
/// `go_on` is asked after each run.
///
/// # Errors
/// A parameter that the estimator does not have, a run that cannot be made, or [`EvaluationError::Interrupted`].
pub fn tune(
    events: &[Event],
    options: &RunOptions,
    asked: &TuneOptions,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<TuneOutcome, EvaluationError> {
    let split_ns = split_ns(events, asked.fitted_share);
    check_length(events, asked, split_ns)?;
    let blind = Blind::all(events, asked.prediction_s);
    let judge = |values: &[(&str, f64)]| {
        let options = with(options, values)?;
        let judged = |blind: &Blind| {
            let mut observer = Predicted {
                blind: *blind,
                last_ns: Vec::new(),
                likelihood: Likelihood::new(split_ns),
                force_is_measured: options.estimator != EstimatorKind::BoundedVelocity,
            };
            let events = events.iter().filter(|event| !blind.hides(event));
            let events = events.map(|event| Ok::<_, Infallible>(*event));
            run(events, &options, &mut observer)?;
            match go_on() {
                true => Ok(observer.likelihood),
                false => Err(EvaluationError::Interrupted),
            }
        };
        let parts: Vec<Likelihood> = blind.par_iter().map(judged).collect::<Result<_, _>>()?;
        let whole = parts.into_iter().reduce(|all, part| all.with(&part));
        Ok(whole.unwrap_or(Likelihood::new(split_ns)).judgement())
    };
    let valued = |row: Row| Row {
        value: options.config.value(&row.name()).unwrap_or(Value::Absent),
        ..row
    };
    let rows: Vec<Row> = parameters::rows()
        .filter(|row| row.is_read_by(options.estimator))
        .map(valued)
        .collect();
    let fit = Fit {
        estimator: options.estimator.name(),
        rows: &rows,
        judge: &judge,
    };
    let mut outcome = fit.make(asked)?;
    let fitted = outcome.parameters.iter();
    let fitted: Vec<_> = fitted.map(|p| (p.name.as_str(), p.after)).collect();
    let errors = [
        error_deg(events, options),
        error_deg(events, &with(options, &fitted)?),
    ];
    if let [Some(before), Some(after)] = errors {
        outcome.reference_error_deg = Some([before, after]);
    }
    Ok(outcome)
}

/// Refuses predictions of which none ends in the part that is fitted: the first two spans hide nothing, and the first one that
/// does lasts from three to four times its length ([`Blind::covers`]).
fn check_length(
    events: &[Event],
    asked: &TuneOptions,
    split_ns: i64,
) -> Result<(), EvaluationError> {
    let first_ns = events.first().map_or(split_ns, |event| event.time_ns);
    let fitted_s = split_ns.saturating_sub(first_ns) as f64 * 1e-9;
    let prediction_s = asked.prediction_s;
    if prediction_s > 0.0 && 4.0 * prediction_s >= fitted_s {
        return Err(EvaluationError::PredictionTooLong {
            prediction_s,
            fitted_s,
        });
    }
    Ok(())
}

/// The options with other values.
fn with(options: &RunOptions, values: &[(&str, f64)]) -> Result<RunOptions, EvaluationError> {
    let mut options = options.clone();
    for (name, value) in values {
        options.set(&format!("{name}={value:e}"))?;
    }
    Ok(options)
}

/// RMSE of the attitude, where there is a reference that can be scored.
fn error_deg(events: &[Event], options: &RunOptions) -> Option<f64> {
    if !events.iter().any(is_reference) {
        return None;
    }
    let events = events.iter().map(|event| Ok::<_, Infallible>(*event));
    let summary = run(events, options, &mut ()).ok()?;
    summary.error_deg.map(|error| error.total_rmse)
}

fn is_reference(event: &Event) -> bool {
    event.sample.kind() == SensorKind::Reference
}

/// Spans in which the filter is given rates alone, so that what it predicts meanwhile can be judged by the first
/// samples behind them. Errors of a sensor that last shorter than a span cannot be learnt by following them.
#[derive(Debug, Clone, Copy)]
struct Blind {
    first_ns: i64,
    length_ns: i64,
}

impl Blind {
    /// Spans that cover the recording together: half of it each, a quarter of a period apart.
    fn all(events: &[Event], length_s: f64) -> [Self; PHASES] {
        let first_ns = events.first().map_or(0, |event| event.time_ns);
        let length_ns = (length_s * 1e9) as i64;
        let phase = |k: usize| Self {
            first_ns: first_ns.saturating_add(k as i64 * length_ns * 2 / PHASES as i64),
            length_ns,
        };
        std::array::from_fn(phase)
    }

    fn hides(&self, event: &Event) -> bool {
        match event.sample.kind() {
            SensorKind::Reference => true,
            SensorKind::Gyroscope => false,
            _ => self.covers(event.time_ns),
        }
    }

    fn covers(&self, time_ns: i64) -> bool {
        let since = time_ns.saturating_sub(self.first_ns);
        // Nothing is hidden in the first period: the filter aligns itself.
        self.length_ns > 0 && since >= 2 * self.length_ns && (since / self.length_ns) % 2 == 1
    }
}

/// The first innovation of each sensor behind a span of rates alone.
struct Predicted {
    blind: Blind,
    last_ns: Vec<(SensorKind, i64)>,
    likelihood: Likelihood,
    /// Whether the accelerometer is compared with what is expected of it. The bounded-velocity filter integrates it,
    /// and what it compares is an assumption: that the velocity is near zero.
    force_is_measured: bool,
}

impl RunObserver for Predicted {
    fn innovation(&mut self, record: &InnovationRecord) {
        if record.sensor == SensorKind::Accelerometer && !self.force_is_measured {
            return;
        }
        let known = self.last_ns.iter_mut();
        let mut known = known.filter(|(sensor, _)| *sensor == record.sensor);
        let last_ns = match known.next() {
            Some((_, time_ns)) => std::mem::replace(time_ns, record.time_ns),
            None => {
                self.last_ns.push((record.sensor, record.time_ns));
                return;
            }
        };
        if record.time_ns.saturating_sub(last_ns) >= self.blind.length_ns {
            self.likelihood.add(record.time_ns, &record.innovation);
        }
    }
}

#[cfg(test)]
mod tests {
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    use super::*;
    use crate::attitude::Profile;

    fn phone(duration_s: f64) -> Vec<Event> {
        let config = VirtualPhoneConfig {
            seed: 5,
            duration_s: Some(duration_s),
            ..VirtualPhoneConfig::default()
        };
        VirtualPhone::new(config).unwrap().events().collect()
    }

    fn asked(names: &[&str]) -> TuneOptions {
        TuneOptions {
            parameters: names.iter().map(|name| (*name).to_owned()).collect(),
            ..TuneOptions::default()
        }
    }

    #[test]
    fn noise_that_is_set_wrong_by_factors_is_found_and_the_attitude_gains() {
        let truth = VirtualPhoneConfig::default();
        let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        options.set("accelerometer_std=1.0").unwrap();
        options.set("magnetometer_std_ut=0.1").unwrap();
        options.set("magnetometer_gate_nis=0").unwrap();
        options.set("accelerometer_gate_nis=0").unwrap();
        let asked = asked(&["accelerometer_std", "magnetometer_std_ut"]);
        let outcome = tune(&phone(160.0), &options, &asked, &|| true).unwrap();
        let [force, field] = &outcome.parameters[..] else {
            panic!("two parameters: {outcome:?}");
        };
        let expected = truth.accelerometer.noise_std_m_s2;
        assert!((0.8..1.25).contains(&(force.after / expected)), "{force:?}");
        let expected = truth.magnetometer.noise_std_ut;
        assert!((0.8..1.25).contains(&(field.after / expected)), "{field:?}");
        assert!(!outcome.over_fits && outcome.after.held_out < outcome.before.held_out - 1.0);
        let [before, after] = outcome.reference_error_deg.unwrap();
        assert!(after < 0.7 * before, "{before} {after}");
    }

    #[test]
    fn what_changes_no_innovation_is_left_and_named() {
        let options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        let asked = asked(&["compass_std", "accelerometer_std"]);
        let outcome = tune(&phone(75.0), &options, &asked, &|| true).unwrap();
        assert_eq!(outcome.without_effect, ["compass_std"]);
        assert_eq!(outcome.parameters.len(), 1);
        assert_eq!(outcome.parameters[0].name, "accelerometer_std");
    }

    #[test]
    fn a_prediction_longer_than_the_fitted_part_is_refused_as_such() {
        let options = RunOptions::new(EstimatorKind::BoundedVelocity, Profile::HandHeld);
        let tuned = |prediction_s: f64| {
            let asked = TuneOptions {
                prediction_s,
                ..asked(&["bounded_gyroscope_noise_density"])
            };
            tune(&phone(60.0), &options, &asked, &|| true)
        };
        // 36 s are fitted.
        for too_long in [1000.0, 9.1] {
            let message = tuned(too_long).unwrap_err().to_string();
            assert!(
                message.contains(&format!("a prediction of {too_long} s"))
                    && message.contains("less than 9.0 s (--prediction)"),
                "{message}"
            );
        }
        let fitted = tuned(3.0).map(|_| ());
        assert!(fitted.is_ok(), "{fitted:?}");
    }

    #[test]
    fn what_has_no_likelihood_and_what_is_stopped_is_refused() {
        let refused = |kind: EstimatorKind, without_field: bool, go_on: bool| {
            let mut options = RunOptions::new(kind, Profile::HandHeld);
            options.sensors.magnetometer = !without_field;
            tune(&phone(75.0), &options, &asked(&[]), &|| go_on).unwrap_err()
        };
        assert!(matches!(
            refused(EstimatorKind::BoundedVelocity, true, true),
            EvaluationError::NoLikelihood { .. }
        ));
        assert!(matches!(
            refused(EstimatorKind::Complementary, false, true),
            EvaluationError::NothingToFit { .. } | EvaluationError::NoLikelihood { .. }
        ));
        assert!(matches!(
            refused(EstimatorKind::Mekf, false, false),
            EvaluationError::Interrupted
        ));
    }
}
