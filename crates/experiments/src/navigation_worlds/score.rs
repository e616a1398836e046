//! How one world is judged: lost, worse than extrapolation, coverage of the 95 % ellipse, heading.

use northing_simulation::navigation_world::WorldDescription;
use serde::Serialize;

use super::run::{WorldInstant, WorldRun};
use crate::scoring::{EVERY_S, rms};

/// Beyond so many times the 95 % ellipse an error is no chance.
const FAR: f64 = 5.0;
/// For so long in one piece, s.
const LONG_S: f64 = 10.0;
/// An error so many times extrapolation's is a loss.
const LOST_RATIO: f64 = 3.0;
/// Below this standard deviation a heading counts as stated, deg.
const STATED_DEG: f64 = 8.0;

/// Numbers over the instants of a world, all or those that can be known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// How many instants.
    pub instants: usize,
    /// Whether the error lay beyond five times the 95 % ellipse for ten seconds in one piece.
    pub beyond_the_ellipse: bool,
    /// Whether the root mean square is more than three times extrapolation's.
    pub beyond_extrapolation: bool,
    /// Whether it is above extrapolation's.
    pub worse: bool,
    /// Share of the instants inside the 95 % ellipse; none without instants.
    pub coverage: Option<f64>,
    /// Root mean square of the horizontal error, m.
    pub rms_m: Option<f64>,
    /// The same of extrapolation, over the same instants.
    pub extrapolation_rms_m: Option<f64>,
    /// Root mean square over that of extrapolation, where both are compared.
    pub ratio: Option<f64>,
    /// Root mean square of the held fix, m.
    pub hold_rms_m: Option<f64>,
    /// Instants at which the heading is stated within 8 deg.
    pub heading_instants: usize,
    /// Those of them at which its error is within three standard deviations.
    pub heading_inside: usize,
}

/// A world and its judgement.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldOutcome {
    /// What the world has.
    pub description: WorldDescription,
    /// When the first estimate came, s; none: never.
    pub first_estimate_s: Option<f64>,
    /// From the first fix until the heading was stated within 8 deg, s; none: never.
    pub heading_after_s: Option<f64>,
    /// Root mean square over that of extrapolation while fixes are missing.
    pub outage_ratio: Option<f64>,
    /// Over all instants.
    pub all: Score,
    /// Over those at which an estimator could know its error.
    pub can_be_known: Score,
}

impl Score {
    /// Over these instants; those `compared` are compared with extrapolation.
    fn of<'a>(
        instants: impl Iterator<Item = &'a WorldInstant> + Clone,
        compared: fn(&WorldInstant) -> bool,
    ) -> Self {
        let count = instants.clone().count();
        let share = |n: usize| (count > 0).then(|| n as f64 / count as f64);
        let inside = instants.clone().filter(|i| i.error_m <= i.stated_m).count();
        let ratio = ratio(instants.clone().filter(|i| compared(i)));
        let beyond = |times: f64| ratio.is_some_and(|ratio| ratio.is_nan() || ratio > times);
        let stated = instants.clone().filter(|i| i.heading_std_deg < STATED_DEG);
        let sound = |i: &&WorldInstant| i.heading_error_deg.abs() <= 3.0 * i.heading_std_deg;
        Self {
            instants: count,
            beyond_the_ellipse: is_far_for_long(instants.clone()),
            beyond_extrapolation: beyond(LOST_RATIO),
            worse: beyond(1.0),
            coverage: share(inside),
            rms_m: rms(instants.clone().map(|i| i.error_m)),
            extrapolation_rms_m: rms(instants.clone().filter_map(|i| i.extrapolation_error_m)),
            ratio,
            hold_rms_m: rms(instants.filter_map(|i| i.hold_error_m)),
            heading_instants: stated.clone().count(),
            heading_inside: stated.filter(sound).count(),
        }
    }

    /// Lost, by the ellipse or by extrapolation.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.beyond_the_ellipse || self.beyond_extrapolation
    }
}

/// Whether errors lie far beyond what is stated for long, without a break. Instants that follow one another are `EVERY_S`
/// apart; a larger step is a break.
fn is_far_for_long<'a>(instants: impl Iterator<Item = &'a WorldInstant>) -> bool {
    let mut piece: Option<[f64; 2]> = None;
    for instant in instants {
        // What is not a number is far.
        let far = instant.error_m.is_nan() || instant.error_m > FAR * instant.stated_m;
        let t = instant.time_s;
        piece = match piece {
            _ if !far => None,
            Some([from, last]) if t - last < 2.5 * EVERY_S => Some([from, t]),
            _ => Some([t, t]),
        };
        if piece.is_some_and(|[from, last]| last - from >= LONG_S) {
            return true;
        }
    }
    false
}

/// Root mean square of the error over that of extrapolation, over the instants that have both.
fn ratio<'a>(instants: impl Iterator<Item = &'a WorldInstant> + Clone) -> Option<f64> {
    let both = instants.filter(|i| i.extrapolation_error_m.is_some());
    let own = rms(both.clone().map(|i| i.error_m))?;
    rms(both.filter_map(|i| i.extrapolation_error_m)).map(|other| own / other)
}

impl WorldOutcome {
    pub(super) fn of(run: &WorldRun) -> Self {
        let instants = &run.instants;
        let converged = instants.iter().find(|i| i.heading_std_deg < STATED_DEG);
        let since = converged
            .zip(run.first_fix_s)
            .map(|(i, fix)| (i.time_s - fix).max(0.0));
        let all = Score::of(instants.iter(), |_| true);
        let known = instants.iter().filter(|i| i.can_be_known);
        let mut can_be_known = Score::of(known, |i| !i.in_outage);
        // What can be known excuses and never accuses: without its outages a world may well compare worse.
        can_be_known.beyond_extrapolation &= all.beyond_extrapolation;
        Self {
            description: run.description.clone(),
            first_estimate_s: instants.first().map(|i| i.time_s),
            heading_after_s: since,
            outage_ratio: ratio(instants.iter().filter(|i| i.in_outage)),
            all,
            can_be_known,
        }
    }

    /// Lost: an error without excuse, or no estimate at all.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.first_estimate_s.is_none() || self.all.is_lost()
    }

    /// The same, judged where an estimator could know its error.
    #[must_use]
    pub const fn is_lost_knowably(&self) -> bool {
        self.first_estimate_s.is_none() || self.can_be_known.is_lost()
    }

    /// How bad it is, for a list of the worst: the larger the worse.
    #[must_use]
    pub fn badness(&self) -> f64 {
        let lost = f64::from(u8::from(self.is_lost_knowably())) * 2.0
            + f64::from(u8::from(self.is_lost()));
        let ratio = self.can_be_known.ratio.or(self.all.ratio);
        // A filter that says nothing is just lost; one that says nothing finite is worse than any other.
        let ratio = ratio.map_or(
            LOST_RATIO,
            |ratio| if ratio.is_finite() { ratio } else { 1e12 },
        );
        lost * 1e15 + ratio
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instant(k: u32, error_m: f64) -> WorldInstant {
        WorldInstant {
            time_s: f64::from(k) * EVERY_S,
            error_m,
            stated_m: 1.0,
            heading_error_deg: 4.0,
            heading_std_deg: if k < 50 { 20.0 } else { 1.0 + f64::from(k % 2) },
            extrapolation_error_m: (k > 0).then_some(2.0),
            hold_error_m: Some(3.0),
            status: "Aided".to_owned(),
            in_outage: (200..250).contains(&k),
            can_be_known: true,
        }
    }

    #[test]
    fn far_for_ten_seconds_in_one_piece_is_lost() {
        let errors = |far: std::ops::Range<u32>, gap: std::ops::Range<u32>| -> Vec<WorldInstant> {
            let numbers = (0..300).filter(move |k| !gap.contains(k));
            numbers
                .map(|k| instant(k, if far.contains(&k) { 5.1 } else { 0.5 }))
                .collect()
        };
        let judged =
            |instants: &[WorldInstant]| Score::of(instants.iter(), |_| true).beyond_the_ellipse;
        assert!(judged(&errors(100..202, 0..0)));
        assert!(!judged(&errors(100..199, 0..0)), "less than ten seconds");
        assert!(!judged(&errors(100..202, 150..160)), "two pieces");
        let mut broken = errors(100..202, 0..0);
        broken[150].error_m = f64::NAN;
        assert!(judged(&broken), "what is not a number is no excuse");
        broken[150].error_m = 4.9;
        assert!(!judged(&broken));
    }

    #[test]
    fn in_outages_only_the_ellipse_judges_what_can_be_known() {
        let instants =
            (0..300).map(|k| instant(k, if (200..250).contains(&k) { 60.0 } else { 0.5 }));
        let instants: Vec<_> = instants.collect();
        let everywhere = Score::of(instants.iter(), |_| true);
        let with_fixes = Score::of(instants.iter(), |i| !i.in_outage);
        assert!(everywhere.beyond_extrapolation && !with_fixes.beyond_extrapolation);
        assert!((with_fixes.ratio.unwrap() - 0.25).abs() < 1e-12);
        assert!((ratio(instants.iter().filter(|i| i.in_outage)).unwrap() - 30.0).abs() < 1e-12);
        assert_eq!(everywhere.rms_m, with_fixes.rms_m);
    }

    #[test]
    fn shares_and_ratios_are_those_of_the_instants() {
        let instants: Vec<_> = (0..100)
            .map(|k| instant(k, if k < 10 { 3.0 } else { 0.5 }))
            .collect();
        let score = Score::of(instants.iter(), |_| true);
        assert_eq!((score.instants, score.coverage), (100, Some(0.9)));
        assert!((score.extrapolation_rms_m.unwrap() - 2.0).abs() < 1e-12);
        assert!((score.hold_rms_m.unwrap() - 3.0).abs() < 1e-12);
        assert!((score.rms_m.unwrap() - (0.9_f64 + 0.225).sqrt()).abs() < 1e-12);
        assert!(!score.worse && !score.is_lost());
        // Of 4 deg with 1 and 2 deg stated, the half.
        assert_eq!((score.heading_instants, score.heading_inside), (50, 25));
        let far: Vec<_> = (0..100).map(|k| instant(k, 6.1)).collect();
        let score = Score::of(far.iter(), |_| true);
        assert!(score.worse && score.beyond_extrapolation && score.is_lost());
        let none = Score::of([].iter(), |_| true);
        assert!(none.coverage.is_none() && none.ratio.is_none() && !none.worse);
    }
}
