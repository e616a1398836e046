//! The reference beside a run: scored at its instants, its rates compared with the gyroscope's, and both in words.

use nalgebra::Vector3;

use crate::attitude::reference::{LONGEST_WATCH_S, Rates, ReferenceProblem, Scorer, find};
use crate::attitude::{EstimateRecord, Instant, ReferenceSummary, RunOptions, ScoredRecord};

/// Mean cosine of the angle between the two verticals below which one is upside down: they are opposite to about 25 deg.
const OPPOSITE: f64 = -0.9;

/// Follows the reference of a recording.
#[derive(Debug, Clone, Default)]
pub(crate) struct ReferenceWatch {
    scorer: Scorer,
    rates: Rates,
    verticals: Verticals,
}

/// The estimate's up beside the reference's: rates say nothing of a world that is turned.
#[derive(Debug, Clone, Copy, Default)]
struct Verticals {
    samples: u64,
    cosines: f64,
}

impl Verticals {
    /// A heading, which may be arbitrary, does not move what a body says of up.
    fn add(&mut self, scored: &ScoredRecord) {
        if !scored.reference.scored {
            return;
        }
        let up = Vector3::z();
        let [of_estimate, of_reference] =
            [scored.attitude, scored.reference.attitude].map(|q| q.inverse() * up);
        self.samples += 1;
        self.cosines += of_estimate.dot(&of_reference);
    }

    fn problem(self, turns: bool) -> Option<ReferenceProblem> {
        let samples = self.samples;
        (self.cosines < OPPOSITE * samples as f64)
            .then_some(ReferenceProblem::UpsideDown { samples, turns })
    }
}

impl ReferenceWatch {
    pub(crate) fn new(options: &RunOptions) -> Self {
        Self {
            scorer: Scorer::new(options.driver.gap_limit_s, options.smooth),
            rates: Rates::new(LONGEST_WATCH_S),
            verticals: Verticals::default(),
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
    pub(crate) fn estimated(
        &mut self,
        record: &EstimateRecord,
        mut give: impl FnMut(&ScoredRecord),
    ) {
        let verticals = &mut self.verticals;
        self.scorer.estimate(record, |scored| {
            verticals.add(scored);
            give(scored);
        });
    }

    /// What became of the reference; `None` without one.
    pub(crate) fn summary(
        &self,
        samples: u64,
        scored: u64,
        options: &RunOptions,
    ) -> Option<ReferenceSummary> {
        let found = (samples > 0).then(|| find(&self.rates.series()))?;
        let found = found.and_then(|found| match self.verticals.problem(found.is_some()) {
            Some(problem) => Err(problem),
            None => Ok(found),
        });
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
