//! The fit of a navigation estimator.

use northing_core::kalman::Innovation;
use northing_recording::{Event, Frames, SensorKind};

use super::likelihood::{Likelihood, split_ns};
use super::{Fit, TuneOptions, TuneOutcome};
use crate::error::EvaluationError;
use crate::navigation::NavigationOptions;
use crate::navigation::navigator::AidKind;
use crate::navigation::observer::NavigationObserver;
use crate::navigation::runner::run_navigation;

/// Fits parameters of `options` to a recording's events.
///
/// `go_on` is asked after each run.
///
/// # Errors
/// A parameter that the estimator does not have, a run that cannot be made, or [`EvaluationError::Interrupted`].
pub fn tune(
    events: &[Event],
    frames: impl Into<Frames>,
    options: &NavigationOptions,
    asked: &TuneOptions,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<TuneOutcome, EvaluationError> {
    let frames = frames.into();
    let split_ns = split_ns(events, asked.fitted_share);
    let judge = |values: &[(&str, f64)]| {
        let options = with(options, values)?;
        let mut observer = Measured(Likelihood::new(split_ns));
        let events = events
            .iter()
            .map(|event| Ok::<_, std::convert::Infallible>(*event));
        run_navigation(events, "", frames, &options, &mut observer)?;
        match go_on() {
            true => Ok(observer.0.judgement()),
            false => Err(EvaluationError::Interrupted),
        }
    };
    let fit = Fit {
        estimator: options.estimator.name(),
        rows: &options.parameters.rows(options.estimator),
        judge: &judge,
    };
    let mut outcome = fit.make(asked)?;
    let fitted = outcome.parameters.iter();
    let fitted: Vec<_> = fitted.map(|p| (p.name.as_str(), p.after)).collect();
    let errors = [
        error_m(events, frames, options),
        error_m(events, frames, &with(options, &fitted)?),
    ];
    if let [Some(before), Some(after)] = errors {
        outcome.reference_error_m = Some([before, after]);
    }
    Ok(outcome)
}

/// The options with other values.
fn with(
    options: &NavigationOptions,
    values: &[(&str, f64)],
) -> Result<NavigationOptions, EvaluationError> {
    let mut options = options.clone();
    for (name, value) in values {
        let setting = format!("{name}={value:e}");
        options.parameters.set(options.estimator, &setting)?;
    }
    Ok(options)
}

/// RMSE of the horizontal position, m, where there are reference positions.
fn error_m(events: &[Event], frames: Frames, options: &NavigationOptions) -> Option<f64> {
    let is_reference = |event: &Event| event.sample.kind() == SensorKind::ReferencePosition;
    if !events.iter().any(is_reference) {
        return None;
    }
    let events = events
        .iter()
        .map(|event| Ok::<_, std::convert::Infallible>(*event));
    let summary = run_navigation(events, "", frames, options, &mut ()).ok()?;
    summary.position.map(|score| score.horizontal_rmse_m)
}

/// The innovations of measurements.
struct Measured(Likelihood);

impl NavigationObserver for Measured {
    fn interval_ns(&self) -> i64 {
        i64::MAX
    }

    fn innovation(&mut self, time_ns: i64, aid: AidKind, innovation: &Innovation<f64>) {
        // Constraints that the estimator makes itself are no measurements.
        if !matches!(aid, AidKind::ZeroVelocity | AidKind::NonHolonomic) {
            self.0.add(time_ns, innovation);
        }
    }
}

#[cfg(test)]
mod tests {
    use northing_recording::{GnssPosition, GnssQuality, Sample, WorldFrame};
    use northing_simulation::random::{standard_normal, stream};

    use super::*;
    use crate::navigation::NavigationKind;

    /// A ship on a straight course, positions of 4 m, no log.
    fn events(seed: u64, std_m: f64) -> Vec<Event> {
        let mut random = stream(seed, "tune");
        let at = |k: u32, east: f64, north: f64| Event {
            time_ns: i64::from(k) * 1_000_000_000,
            sample: Sample::GnssPosition(GnssPosition {
                latitude_rad: 0.9 + (5.0 * f64::from(k) + north) / 6.37e6,
                longitude_rad: 0.1 + east / 4e6,
                height_m: Some(0.0),
                std_m: Some([std_m; 3]),
                hdop: None,
                satellites: None,
                quality: GnssQuality::Autonomous,
            }),
        };
        (0..900)
            .map(|k| {
                at(
                    k,
                    4.0 * standard_normal(&mut random),
                    4.0 * standard_normal(&mut random),
                )
            })
            .collect()
    }

    #[test]
    fn a_walk_that_is_set_far_too_large_comes_down_and_the_held_out_part_agrees() {
        let mut options = NavigationOptions {
            estimator: NavigationKind::DeadReckoning,
            ..NavigationOptions::default()
        };
        options.parameters.dead_reckoning.velocity_random_walk = 3.0;
        let asked = TuneOptions {
            parameters: vec!["velocity_random_walk".to_owned()],
            ..TuneOptions::default()
        };
        let outcome = tune(&events(7, 4.0), WorldFrame::Ned, &options, &asked, &|| true).unwrap();
        let [walk] = &outcome.parameters[..] else {
            panic!("one parameter");
        };
        assert!(walk.after < 0.3, "{walk:?}");
        assert!(outcome.after.fitted < outcome.before.fitted - 0.1);
        assert!(outcome.after.held_out < outcome.before.held_out - 0.1);
        assert!(!outcome.over_fits && outcome.runs > 4);
    }

    /// A reference is not fitted to, but what the fit does to the error is told; one that contradicts the fixes says so.
    #[test]
    fn the_error_against_a_reference_is_told_before_and_after() {
        let mut options = NavigationOptions {
            estimator: NavigationKind::DeadReckoning,
            ..NavigationOptions::default()
        };
        options.parameters.dead_reckoning.velocity_random_walk = 3.0;
        let asked = TuneOptions {
            parameters: vec!["velocity_random_walk".to_owned()],
            ..TuneOptions::default()
        };
        let fixes = events(7, 4.0);
        let with = |of: fn(i64, GnssPosition) -> GnssPosition| -> Vec<Event> {
            let both = fixes.iter().flat_map(|event| {
                let Sample::GnssPosition(fix) = event.sample else {
                    return vec![*event];
                };
                let sample = Sample::ReferencePosition(of(event.time_ns, fix));
                vec![*event, Event { sample, ..*event }]
            });
            both.collect()
        };
        let tuned =
            |events: &[Event]| tune(events, WorldFrame::Ned, &options, &asked, &|| true).unwrap();
        assert_eq!(tuned(&fixes).reference_error_m, None);
        // The straight course itself: a smaller walk is nearer to it.
        let course = tuned(&with(|time_ns, fix| GnssPosition {
            latitude_rad: 0.9 + 5.0 * (time_ns as f64 * 1e-9) / 6.37e6,
            longitude_rad: 0.1,
            ..fix
        }));
        let [before, after] = course.reference_error_m.unwrap();
        assert!(
            after < before && !course.is_worse_at_reference(),
            "{before} {after}"
        );
        // The fixes themselves: a larger walk is nearer to them.
        let noise = tuned(&with(|_, fix| fix));
        assert!(noise.after.held_out < noise.before.held_out && noise.is_worse_at_reference());
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        let mut options = NavigationOptions {
            estimator: NavigationKind::DeadReckoning,
            ..NavigationOptions::default()
        };
        let asked = TuneOptions {
            parameters: vec!["colour".to_owned()],
            ..TuneOptions::default()
        };
        let all = events(1, 4.0);
        let tuned = tune(&all, WorldFrame::Ned, &options, &asked, &|| true);
        let message = tuned.unwrap_err().to_string();
        assert!(message.contains("`colour`") && message.contains("current_random_walk"));
        options.estimator = NavigationKind::AxisFilters;
        let asked = TuneOptions {
            parameters: vec!["euler_rates".to_owned()],
            ..TuneOptions::default()
        };
        let tuned = tune(&all, WorldFrame::Ned, &options, &asked, &|| true);
        assert!(
            tuned
                .unwrap_err()
                .to_string()
                .contains("only numbers above 0")
        );
    }
}
