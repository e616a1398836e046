//! The reference beside a run: scored at its instants, its rates compared with the gyroscope's, and both in words.

use crate::attitude::reference::{LONGEST_WATCH_S, Rates, Scorer, find};
use crate::attitude::{EstimateRecord, Instant, ReferenceSummary, RunOptions, ScoredRecord};

/// Follows the reference of a recording.
#[derive(Debug, Clone, Default)]
pub(crate) struct ReferenceWatch {
    scorer: Scorer,
    rates: Rates,
}

impl ReferenceWatch {
    pub(crate) fn new(options: &RunOptions) -> Self {
        Self {
            scorer: Scorer::new(options.driver.gap_limit_s, options.smooth),
            rates: Rates::new(LONGEST_WATCH_S),
        }
    }

    /// Takes what was read at one instant.
    pub(crate) fn read(&mut self, instant: &Instant) {
        self.rates.add(instant);
        if let Some(reference) = instant.reference {
            self.scorer.reference(instant.time_ns, reference);
        }
    }

    /// Takes an estimate, and gives that of each reference up to its instant.
    pub(crate) fn estimated(&mut self, record: &EstimateRecord, give: impl FnMut(&ScoredRecord)) {
        self.scorer.estimate(record, give);
    }

    /// What became of the reference; `None` without one.
    pub(crate) fn summary(
        &self,
        samples: u64,
        scored: u64,
        options: &RunOptions,
    ) -> Option<ReferenceSummary> {
        let found = (samples > 0).then(|| find(&self.rates.series()))?;
        Some(ReferenceSummary {
            samples,
            scored,
            in_gaps: self.scorer.in_gaps(),
            alignment: options.reference.alignment().copied(),
            problem: found.err(),
            found: found.ok().flatten(),
        })
    }
}

impl ReferenceSummary {
    /// What became of its samples, and what was taken out of it, or matters for its score.
    pub(crate) fn sentences(&self, skip_s: f64, apart: Option<String>) -> Vec<String> {
        let samples = self.samples;
        let unscored = if let (0, Some(apart)) = (self.scored, apart) {
            Some(format!(
                "The reference was not scored: none of its {samples} samples is of a time of the gyroscope's. {apart}"
            ))
        } else if self.scored == 0 {
            Some(format!(
                "The reference was not scored: none of its {samples} samples counts, lies between two estimates without \
                 a gap, and comes {skip_s} s or more after the first sample."
            ))
        } else {
            (self.in_gaps > 0).then(|| {
                format!(
                    "{} of the {samples} reference samples are not scored: they lie in gaps of the gyroscope, where \
                     nothing says how the device turned.",
                    self.in_gaps
                )
            })
        };
        let clock = match &self.alignment {
            Some(taken_out) => Some(format!(
                "The reference was aligned by its angular rates: {}.",
                taken_out.in_words()
            )),
            None => self.found.as_ref().and_then(|found| found.remark()),
        };
        unscored.into_iter().chain(clock).collect()
    }
}
