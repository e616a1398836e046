//! The summary of a run.

use northing_core::kalman::SkipReason;

use super::Session;
use crate::error::EvaluationError;
use crate::navigation::batch_smoother::SmoothingSummary;
use crate::navigation::kinds::NavigationKind;
use crate::navigation::navigator::AidKind;
use crate::navigation::outcome::{AidSummary, NavigationSummary, Origin};
use crate::statistics::nis::{NisStatistics, UpdateCounts};
use crate::statistics::seconds_between;
use crate::used_parameters::VERSION;

/// Inertial samples and fixes with so long a time between them have none in common, s.
const NO_COMMON_TIME_S: f64 = 10.0;

/// What is wrong with what the smoother said.
fn not_smoothed(summary: Option<&SmoothingSummary>) -> Option<String> {
    match summary {
        None => Some(
            "Nothing was smoothed: the filter never started, or there are no inertial samples."
                .to_owned(),
        ),
        Some(summary) if !summary.converged => Some(format!(
            "The smoother has not converged after {} passes: its estimates and covariances are not those of the whole recording.",
            summary.iterations
        )),
        Some(_) => None,
    }
}

impl Session<'_> {
    /// What stands in the way of a summary.
    fn check(&mut self) -> Result<(), EvaluationError> {
        let counts = &self.counts;
        if self.frame.is_none() {
            return Err(EvaluationError::NoFix {
                fixes: counts.fixes,
                because: self.unusable_in_words(),
            });
        }
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
        if matches!(
            kind,
            NavigationKind::ErrorState | NavigationKind::AxisFilters
        ) && let Some(error) = self.without_common_time()
        {
            return Err(error);
        }
        let never = counts.given > 0 && counts.used == 0 && self.navigator.estimate().is_none();
        if never && kind != NavigationKind::Device {
            return Err(EvaluationError::NoFixUsed {
                given: self.counts.given,
                because: self.why_none_was_used(),
            });
        }
        Ok(())
    }

    /// Why fixes are not usable, to stand behind their number.
    fn unusable_in_words(&self) -> String {
        let reasons = self.counts.unusable.iter();
        let reasons: Vec<String> = reasons.map(|(why, n)| format!("{n}: {why}")).collect();
        if reasons.is_empty() {
            return String::new();
        }
        format!("; {}", reasons.join("; "))
    }

    /// Clocks, units, signs or axes that the turns, and the accelerations, show to be wrong.
    fn wrong_axes(&self) -> Option<String> {
        self.turns.issue().or_else(|| self.axes.issue())
    }

    fn why_none_was_used(&self) -> String {
        if let Some(issue) = self.wrong_axes() {
            return issue.trim_end_matches('.').to_owned();
        }
        let aid = self.counts.aids.get(&AidKind::GnssPosition);
        let reasons = aid.map(|(updates, _)| &updates.skipped_because);
        let most = reasons.and_then(|reasons| reasons.iter().max_by_key(|(_, count)| **count));
        match most {
            Some((why, _)) if *why == SkipReason::NotInitialized.description() => {
                let mut reasons = vec!["it had not aligned".to_owned()];
                reasons.extend(self.navigator.issues());
                reasons.join("; ").trim_end_matches('.').to_owned()
            }
            Some((why, count)) if *why == SkipReason::OutOfRange.description() => {
                let stated = self.counts.stated_std_m.map_or(String::new(), |[least, most]| {
                    format!("; the standard deviations that they state are {least:.3} to {most:.3} m: check their unit if that is more than the receiver's")
                });
                format!("{count}: {why}{stated}")
            }
            Some((why, count)) => format!("{count}: {why}"),
            None => "all were refused".to_owned(),
        }
    }

    /// That inertial samples and fixes are of different times: nothing carries a position on.
    fn without_common_time(&self) -> Option<EvaluationError> {
        let (inertial, fixes) = (self.counts.inertial_ns.0?, self.counts.fixes_ns.0?);
        let gap =
            seconds_between(inertial[1], fixes[0]).max(seconds_between(fixes[1], inertial[0]));
        let start = self.counts.first_ns?;
        let since_start = |span: [i64; 2]| span.map(|at| seconds_between(start, at));
        (gap > NO_COMMON_TIME_S).then(|| EvaluationError::NoCommonTime {
            inertial_s: since_start(inertial),
            fixes_s: since_start(fixes),
            apart_s: seconds_between(fixes[0], inertial[0]).abs(),
        })
    }

    pub(super) fn finish(mut self, name: &str) -> Result<NavigationSummary, EvaluationError> {
        self.check()?;
        let wrong_axes = self.wrong_axes();
        if let Some(declination) = self.declination
            && self.counts.aids.contains_key(&AidKind::Magnetometer)
        {
            self.learnt("declination", declination);
        }
        let counts = self.counts;
        let kind = self.options.estimator;
        let origin = self.frame.map(|frame| Origin::from(frame.first().origin()));
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
        let mut issues = Vec::new();
        issues.extend(self.consensus.left_out().map(|fixes| fixes.sentence(first)));
        // An attitude from wrong axes says nothing of them.
        let travel = wrong_axes.is_none().then_some(self.travel);
        issues.extend(wrong_axes);
        issues.extend(travel.and_then(|travel| travel.issue(self.frames.body)));
        if counts.zero_std > 0 {
            issues.push(format!(
                "{} fixes state a standard deviation of 0 or below: taken as not stated.",
                counts.zero_std
            ));
        }
        issues.extend(counts.faults.sentences());
        issues.extend(self.navigator.issues());
        if self.options.smooth {
            issues.extend(not_smoothed(self.smoothing.as_ref()));
        }
        if position.is_none() && self.scorer.too_early() > 0 {
            issues.push(format!(
                "{} points could be scored, all in the first {:.0} s after the first fix: --score-from 0 counts from the first fix on.",
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
            smoothing: self.smoothing,
            duration_s: seconds_between(first, counts.last_ns),
            inertial_samples: counts.inertial,
            fixes: counts.fixes,
            fixes_given: counts.given,
            // Nothing was kept from a device, and it does not say what it used.
            fixes_used: if kind == NavigationKind::Device {
                counts.given
            } else {
                counts.used
            },
            fixes_unusable: counts.unusable,
            origin,
            scored_against: scored.then_some(against),
            position,
            velocity_rmse_m_s: self.scorer.velocity_rmse(),
            heading_rmse_deg: heading.map(|h| h.rmse_deg),
            tilt_rmse_deg: self.scorer.tilt_rmse_deg(),
            heading,
            travel: travel.and_then(|travel| travel.direction()),
            outages,
            aids: counts
                .aids
                .into_iter()
                .chain(own)
                .map(|(kind, aid)| (kind, summarized(aid)))
                .collect(),
            validity: counts.validity,
            faults: counts.faults.records(),
            issues,
            parameters: self.parameters,
            version: VERSION,
        })
    }
}
