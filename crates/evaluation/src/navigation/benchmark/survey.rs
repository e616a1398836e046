//! What the navigation benchmark must know of a recording before it runs: how often there are fixes, and for how long.

use std::path::Path;

use northing_recording::{OpenOptions, Sample, open};

use super::{FIRST_OUTAGE_S, OUTAGE_EVERY_S, OUTAGE_S};
use crate::error::EvaluationError;
use crate::navigation::options::Outage;
use crate::navigation::runner::receiver::unusable;
use crate::statistics::{median, seconds_between};

/// A first look at the whole recording.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Survey {
    /// Fixes, the unusable ones among them.
    pub(super) fixes: u64,
    pub(super) usable_fixes: u64,
    /// From the first usable fix to the last, s.
    duration_s: f64,
    /// Median interval between usable fixes, s.
    interval_s: Option<f64>,
    has_reference: bool,
}

impl Survey {
    pub(super) fn of(path: &Path, options: &OpenOptions) -> Result<Self, EvaluationError> {
        let failed = |error| EvaluationError::Recording(Box::new(error));
        let mut survey = Self::default();
        let (mut first, mut last, mut intervals) = (None, None, Vec::new());
        for event in open(path, options).map_err(failed)? {
            let event = event.map_err(failed)?;
            match event.sample {
                Sample::GnssPosition(fix) => {
                    survey.fixes += 1;
                    if unusable(&fix).is_some() {
                        continue;
                    }
                    survey.usable_fixes += 1;
                    let at = event.time_ns;
                    let since = last.replace(at).map(|last| seconds_between(last, at));
                    intervals.extend(since.filter(|s| *s > 0.0));
                    survey.duration_s = seconds_between(*first.get_or_insert(at), at);
                }
                Sample::ReferencePosition(place) => survey.has_reference |= place.is_usable(),
                _ => {}
            }
        }
        intervals.sort_by(f64::total_cmp);
        survey.interval_s = median(&intervals);
        Ok(survey)
    }

    /// One a second, and without a reference at most one of two.
    pub(super) fn gnss_every(&self) -> u32 {
        let a_second = self.interval_s.map_or(1.0, |interval| 1.0 / interval);
        let least = if self.has_reference { 1 } else { 2 };
        (a_second.round().clamp(1.0, 1e4) as u32).max(least)
    }

    /// Those that end before the last fix.
    pub(super) fn outages(&self) -> Vec<Outage> {
        let outage = |k: u32| Outage {
            start_s: FIRST_OUTAGE_S + OUTAGE_EVERY_S * f64::from(k),
            duration_s: OUTAGE_S,
        };
        let within = |outage: &Outage| outage.start_s + outage.duration_s <= self.duration_s;
        (0..).map(outage).take_while(within).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_and_outages_follow_the_rate_and_the_length() {
        let survey = |interval_s: f64, duration_s: f64, has_reference: bool| Survey {
            duration_s,
            interval_s: Some(interval_s),
            has_reference,
            ..Survey::default()
        };
        assert_eq!(survey(1.0, 60.0, true).gnss_every(), 1);
        assert_eq!(survey(1.0, 60.0, false).gnss_every(), 2);
        assert_eq!(survey(0.25, 60.0, false).gnss_every(), 4);
        assert_eq!(survey(0.1, 60.0, true).gnss_every(), 10);
        assert_eq!(survey(60.0, 60.0, true).gnss_every(), 1);
        assert_eq!(survey(1.0, 29.0, true).outages(), []);
        let outages = survey(1.0, 150.0, true).outages();
        let starts: Vec<f64> = outages.iter().map(|outage| outage.start_s).collect();
        assert_eq!(starts, [20.0, 80.0, 140.0]);
    }
}
