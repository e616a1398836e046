//! The summary of a run.

use super::Session;
use crate::error::EvaluationError;
use crate::navigation::kinds::NavigationKind;
use crate::navigation::outcome::{AidSummary, NavigationSummary, Origin};
use crate::statistics::nis::{NisStatistics, UpdateCounts};
use crate::statistics::seconds_between;
use crate::used_parameters::VERSION;

impl Session<'_> {
    pub(super) fn finish(self, name: &str) -> Result<NavigationSummary, EvaluationError> {
        let counts = self.counts;
        let Some(frame) = self.frame else {
            return Err(EvaluationError::NoFix {
                fixes: counts.fixes,
            });
        };
        let kind = self.options.estimator;
        if kind == NavigationKind::Device {
            if self.device_estimates == 0 {
                return Err(EvaluationError::NoDeviceNavigation);
            }
        } else if counts.inertial == 0 && kind != NavigationKind::DeadReckoning {
            return Err(EvaluationError::NoInertialSamples {
                estimator: self.options.estimator.name(),
            });
        }
        let first = counts.first_ns.unwrap_or(counts.last_ns);
        let position = self.scorer.position_score();
        let outages = self.scorer.outage_scores();
        let scored = position.is_some() || outages.iter().any(|o| o.horizontal_error_m.is_some());
        let against = if counts.scored_at_reference {
            "reference"
        } else {
            "held-out fixes"
        };
        let heading = self.scorer.heading_score();
        let mut issues = self.navigator.issues();
        if position.is_none() && self.scorer.too_early() > 0 {
            issues.push(format!(
                "{} points could be scored, all in the first {:.0} s after the first fix: --score-from 10 counts \
                 those after 10 s.",
                self.scorer.too_early(),
                self.options.score_from_s
            ));
        }
        let own = self.navigator.own_counts().into_iter();
        let own = own.map(|(kind, updates)| (kind, (updates, NisStatistics::default())));
        let summarized = |(updates, nis): (UpdateCounts, NisStatistics)| AidSummary {
            updates,
            nis: nis.summary(),
        };
        Ok(NavigationSummary {
            estimator: self.options.estimator,
            recording: name.to_owned(),
            smoothed: self.options.smooth,
            duration_s: seconds_between(first, counts.last_ns),
            inertial_samples: counts.inertial,
            fixes: counts.fixes,
            fixes_used: counts.used,
            fixes_unusable: counts.unusable,
            origin: Some(Origin::from(frame.origin())),
            scored_against: scored.then_some(against),
            position,
            velocity_rmse_m_s: self.scorer.velocity_rmse(),
            heading_rmse_deg: heading.map(|h| h.rmse_deg),
            tilt_rmse_deg: self.scorer.tilt_rmse_deg(),
            heading,
            outages,
            aids: counts
                .aids
                .into_iter()
                .chain(own)
                .map(|(kind, aid)| (kind, summarized(aid)))
                .collect(),
            validity: counts.validity,
            issues,
            parameters: self.parameters,
            version: VERSION,
        })
    }
}
