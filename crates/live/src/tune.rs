//! Q and R of an experiment by maximum likelihood: what `northing tune` does, asked for on the lab page.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use northing_evaluation::EvaluationError;
use northing_evaluation::tune::{TuneOptions, attitude};
use serde::Serialize;
use serde_json::Value;

use crate::experiments::Finished;
use crate::messages::Change;

/// How often a page hears how far a fit is.
pub(crate) const TELL_EVERY: Duration = Duration::from_millis(500);

/// How far a fit is, or what came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Tuned {
    /// The number of the request that it answers.
    #[cfg_attr(test, ts(type = "unknown"))]
    pub request: Value,
    /// The experiment.
    pub id: String,
    /// Runs over the recording so far.
    pub runs: usize,
    /// The outcome; `None` while it goes on.
    pub fit: Option<Fitted>,
}

/// The outcome of a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Fitted {
    /// The estimator.
    pub estimator: String,
    /// What was fitted.
    pub parameters: Vec<FittedParameter>,
    /// Parameters that change no innovation of this recording.
    pub without_effect: Vec<String>,
    /// By how much an innovation of the part that the fit saw is likelier than before, in natural logarithms.
    pub gain_fitted: f64,
    /// The same of the part that was held out; negative where the fit has learnt the recording instead of the sensors.
    pub gain_held_out: f64,
    /// Whether the held-out part got less likely.
    pub over_fits: bool,
    /// RMS error of the attitude before and after, deg, where the truth is known; the fit does not see it.
    pub error_deg: Option<[f64; 2]>,
}

/// A parameter before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct FittedParameter {
    /// Its name.
    pub name: String,
    /// What it was.
    pub before: f64,
    /// What fits best.
    pub after: f64,
    /// Whether that is more than a thousandfold away: the recording then says nothing about it.
    pub ran_off: bool,
}

impl Finished {
    /// Fits `parameters` of the subject, or every noise that makes a difference where none is named, to an experiment with a
    /// change. `go_on` is asked after each run, with their number; `None` where it ended the fit.
    ///
    /// # Errors
    /// A name or value does not fit, or nothing can be judged, in a sentence.
    pub fn tuned(
        &self,
        change: &Change,
        parameters: Vec<String>,
        go_on: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<Option<Fitted>, String> {
        let altered = self.altered(change)?;
        let options = altered.subjects_options();
        let asked = TuneOptions {
            parameters,
            ..TuneOptions::default()
        };
        let runs = AtomicUsize::new(0);
        let counted = || go_on(runs.fetch_add(1, Ordering::Relaxed) + 1);
        let outcome = match attitude::tune(altered.events(), &options, &asked, &counted) {
            Err(EvaluationError::Interrupted) => return Ok(None),
            outcome => outcome.map_err(|error| error.to_string())?,
        };
        let parameters = outcome.parameters.into_iter().map(|p| FittedParameter {
            name: p.name,
            before: p.before,
            after: p.after,
            ran_off: p.ran_off,
        });
        Ok(Some(Fitted {
            estimator: outcome.estimator.to_owned(),
            parameters: parameters.collect(),
            without_effect: outcome.without_effect,
            gain_fitted: outcome.before.fitted - outcome.after.fitted,
            gain_held_out: outcome.before.held_out - outcome.after.held_out,
            over_fits: outcome.over_fits,
            error_deg: outcome.reference_error_deg,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::experiment::Experiment;
    use northing_evaluation::{EstimatorKind, Profile, RunOptions};
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
    use serde_json::json;

    fn finished() -> Finished {
        let phone = VirtualPhone::new(VirtualPhoneConfig {
            seed: 5,
            duration_s: Some(120.0),
            ..VirtualPhoneConfig::default()
        })
        .unwrap();
        Finished {
            id: "e1".to_owned(),
            device: "d".to_owned(),
            device_name: "D".to_owned(),
            at: String::new(),
            experiment: Experiment {
                name: "turns".to_owned(),
                seconds: 120.0,
                events: phone.events().collect(),
                starts: Vec::new(),
                changed: Vec::new(),
            },
            options: RunOptions::new(EstimatorKind::Mekf, Profile::Lab),
            estimators: vec![EstimatorKind::Mekf],
            subject: EstimatorKind::Mekf,
            summaries: Default::default(),
            hash: String::new(),
            originals: Default::default(),
        }
    }

    fn far_off() -> Change {
        serde_json::from_value(json!({
            "settings": {"accelerometer_std": 2.0, "accelerometer_gate_nis": 0.0}
        }))
        .unwrap()
    }

    #[test]
    fn an_r_that_is_far_off_is_found() {
        let wanted = vec!["accelerometer_std".to_owned()];
        let fit = finished().tuned(&far_off(), wanted, &|_| true);
        let fit = fit.unwrap().unwrap();
        let [found] = &fit.parameters[..] else {
            panic!("{fit:?}")
        };
        let truth = VirtualPhoneConfig::default().accelerometer.noise_std_m_s2;
        assert_eq!((found.before, found.ran_off), (2.0, false));
        assert!(found.after < 0.5 && found.after > 0.5 * truth, "{found:?}");
        assert!(fit.gain_held_out > 0.0 && !fit.over_fits, "{fit:?}");
        let [before, after] = fit.error_deg.unwrap();
        assert!(after < before, "{before} {after}");
    }

    #[test]
    fn a_fit_that_nobody_waits_for_ends_and_mistakes_are_told() {
        let finished = finished();
        let ended = finished.tuned(&far_off(), Vec::new(), &|runs| runs < 3);
        assert_eq!(ended, Ok(None));
        let unknown = finished.tuned(&far_off(), vec!["accelerometer_sdt".to_owned()], &|_| true);
        assert!(unknown.unwrap_err().contains("accelerometer_std"));
    }
}
