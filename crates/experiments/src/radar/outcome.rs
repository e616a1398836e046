//! Outcome of a campaign: RMSE, NEES and its bands, from the sums. `montecarlo --json` prints this.

use std::collections::BTreeMap;

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use super::campaign::Part;
use super::sums::{
    HEADING_FACTOR, NEES, NavigationStep, POSE_ERROR, POSE_NEES, POSE_VARIANCE, POSITION,
    TrackerStep, VELOCITY,
};

/// End of the transient, s.
const TRANSIENT_UNTIL_S: f64 = 60.0;
/// From when on the navigation counts as settled, s.
const SETTLED_FROM_S: f64 = 30.0;

/// The outcome of a campaign.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CampaignOutcome {
    /// The scenario, or its variant.
    pub scenario: String,
    /// Runs that went in.
    pub runs: u64,
    /// The seed.
    pub seed: u64,
    /// Time it took, s; of parts, the sum.
    pub elapsed_s: f64,
    /// The 95 % band of the mean NEES, four degrees of freedom.
    pub nees_band: [f64; 2],
    /// The same for two degrees of freedom, as in the paper's plots.
    pub nees_band_2dof: [f64; 2],
    /// Each tracker by name.
    pub trackers: BTreeMap<String, TrackerOutcome>,
    /// The navigation they listened to.
    pub navigation: NavigationOutcome,
}

/// Errors over some stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Errors {
    /// Root mean square position error, m.
    pub position_rmse_m: f64,
    /// Root mean square velocity error, m/s.
    pub velocity_rmse_m_s: f64,
}

/// One tracker.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackerOutcome {
    /// Root mean square position error over all scored steps, m.
    pub position_rmse_m: f64,
    /// Root mean square velocity error over all scored steps, m/s.
    pub velocity_rmse_m_s: f64,
    /// The same up to 60 s.
    pub transient: Errors,
    /// The same after 60 s.
    pub steady: Errors,
    /// Mean NEES; four is consistent.
    pub nees_mean: f64,
    /// Largest mean NEES of a step.
    pub nees_max: f64,
    /// Share of steps whose mean NEES is inside the band.
    pub nees_inside_band: f64,
    /// Share of steps whose mean NEES is above the band: overconfident.
    pub nees_above_band: f64,
    /// Share of steps inside the band of two degrees of freedom.
    pub nees_inside_band_2dof: f64,
    /// Detections that were skipped.
    pub skipped_updates: u64,
    /// Step by step.
    pub series: Series,
}

/// Root mean square errors and mean NEES of each scored step.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Series {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Position, m.
    pub position_rmse_m: Vec<f64>,
    /// Velocity, m/s.
    pub velocity_rmse_m_s: Vec<f64>,
    /// NEES.
    pub nees: Vec<f64>,
}

/// The navigation, once settled (from 30 s on; NEES from the first step).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NavigationOutcome {
    /// What it says of its heading, deg.
    pub heading_std_deg: f64,
    /// What its heading error was, deg.
    pub heading_rmse_deg: f64,
    /// What it says of its position north, m.
    pub position_std_m: f64,
    /// Mean NEES of the pose, three degrees of freedom.
    pub pose_nees_mean: f64,
    /// What its closed loop leaves of a heading error from one scan to the next.
    pub heading_closed_loop_factor: f64,
}

/// The 95 % band of the mean of `runs` chi-square variables of `dof` degrees of freedom.
#[must_use]
pub fn nees_band(runs: u64, dof: u32) -> [f64; 2] {
    let total = runs as f64 * f64::from(dof);
    let bound =
        |p: f64| ChiSquared::new(total).map_or(f64::NAN, |sum| sum.inverse_cdf(p)) / runs as f64;
    [bound(0.025), bound(0.975)]
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn share(values: &[f64], inside: impl Fn(f64) -> bool) -> f64 {
    values.iter().filter(|value| inside(**value)).count() as f64 / values.len() as f64
}

impl CampaignOutcome {
    /// Works it out.
    #[must_use]
    pub fn of(part: &Part) -> Self {
        let scenario = &part.key.scenario;
        let runs = part.sums.runs;
        let bands = [nees_band(runs, 4), nees_band(runs, 2)];
        let scan_s = 1.0 / scenario.radar.rate_hz;
        let first = scenario.track_init.first_scored_step as usize;
        let trackers = part.sums.kinds.iter().zip(&part.sums.trackers);
        let trackers = trackers
            .zip(&part.sums.skipped)
            .map(|((kind, steps), skipped)| {
                let series = Series::of(steps, first, scan_s, runs);
                let outcome = TrackerOutcome::of(series, *skipped, bands);
                (kind.name().to_owned(), outcome)
            });
        Self {
            scenario: scenario.meta.name.clone(),
            runs,
            seed: part.key.seed,
            elapsed_s: part.elapsed_s,
            nees_band: bands[0],
            nees_band_2dof: bands[1],
            trackers: trackers.collect(),
            navigation: NavigationOutcome::of(&part.sums.navigation, scan_s, runs),
        }
    }
}

impl Series {
    fn of(steps: &[TrackerStep], first: usize, scan_s: f64, runs: u64) -> Self {
        let mut series = Self::default();
        for (step, sums) in steps.iter().enumerate().skip(first) {
            series.time_s.push(step as f64 * scan_s);
            series
                .position_rmse_m
                .push(sums[POSITION].mean(runs).sqrt());
            series
                .velocity_rmse_m_s
                .push(sums[VELOCITY].mean(runs).sqrt());
            series.nees.push(sums[NEES].mean(runs));
        }
        series
    }

    /// Root of the mean squares of the steps for which `wanted` holds.
    pub fn errors(&self, wanted: impl Fn(f64) -> bool) -> Errors {
        let rms = |values: &[f64]| {
            let chosen = self.time_s.iter().zip(values).filter(|(t, _)| wanted(**t));
            let squares: Vec<f64> = chosen.map(|(_, value)| value * value).collect();
            mean(&squares).sqrt()
        };
        Errors {
            position_rmse_m: rms(&self.position_rmse_m),
            velocity_rmse_m_s: rms(&self.velocity_rmse_m_s),
        }
    }
}

/// Position error beyond which no radar sees a target where the tracker looks for it, m.
const LOST_M: f64 = 10_000.0;

impl TrackerOutcome {
    /// Whether it has lost the target for good: farther off than a radar looks, or with a matrix that
    /// is no covariance any more (a mean NEES that is negative or not finite).
    #[must_use]
    pub fn has_lost_the_target(&self) -> bool {
        let sound = self.nees_mean >= 0.0 && self.nees_mean.is_finite();
        !(sound && self.position_rmse_m < LOST_M)
    }

    fn of(series: Series, skipped_updates: u64, [band, band_2dof]: [[f64; 2]; 2]) -> Self {
        let all = series.errors(|_| true);
        let nees = &series.nees;
        let within = |[low, high]: [f64; 2]| move |value: f64| (low..=high).contains(&value);
        Self {
            position_rmse_m: all.position_rmse_m,
            velocity_rmse_m_s: all.velocity_rmse_m_s,
            transient: series.errors(|t| t <= TRANSIENT_UNTIL_S),
            steady: series.errors(|t| t > TRANSIENT_UNTIL_S),
            nees_mean: mean(nees),
            nees_max: nees.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            nees_inside_band: share(nees, within(band)),
            nees_above_band: share(nees, |value| value > band[1]),
            nees_inside_band_2dof: share(nees, within(band_2dof)),
            skipped_updates,
            series,
        }
    }
}

impl NavigationOutcome {
    fn of(steps: &[NavigationStep], scan_s: f64, runs: u64) -> Self {
        let scored = || steps.iter().enumerate().skip(1);
        let settled = |index: usize| {
            let late = scored().filter(|(step, _)| *step as f64 * scan_s >= SETTLED_FROM_S);
            let values: Vec<f64> = late.map(|(_, sums)| sums[index].mean(runs)).collect();
            mean(&values)
        };
        let nees: Vec<f64> = scored()
            .map(|(_, sums)| sums[POSE_NEES].mean(runs))
            .collect();
        Self {
            heading_std_deg: settled(POSE_VARIANCE + 2).sqrt().to_degrees(),
            heading_rmse_deg: settled(POSE_ERROR + 2).sqrt().to_degrees(),
            position_std_m: settled(POSE_VARIANCE).sqrt(),
            pose_nees_mean: mean(&nees),
            heading_closed_loop_factor: settled(HEADING_FACTOR),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Series, TrackerOutcome, nees_band};

    #[test]
    fn a_tracker_is_lost_when_it_is_far_off_or_its_covariance_is_none() {
        let lost = |error_m: f64, nees: f64| {
            let series = Series {
                time_s: vec![30.0, 90.0],
                position_rmse_m: vec![error_m; 2],
                velocity_rmse_m_s: vec![1.0; 2],
                nees: vec![nees; 2],
            };
            TrackerOutcome::of(series, 0, [[3.0, 5.0]; 2]).has_lost_the_target()
        };
        assert!(!lost(20.0, 4.0) && !lost(300.0, 80.0));
        assert!(lost(2e4, 4.0) && lost(20.0, -1.0) && lost(f64::INFINITY, f64::INFINITY));
    }

    #[test]
    fn the_bands_are_those_of_the_tables() {
        let close =
            |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-3 && (b - d).abs() < 1e-3;
        assert!(close(nees_band(100, 4), [3.465, 4.573]));
        assert!(close(nees_band(100, 2), [1.627, 2.411]));
        assert!(close(nees_band(800, 4), [3.806, 4.198]));
        let [low, high] = nees_band(100_000, 4);
        // 4 +- 1.96 sqrt(8 / n)
        assert!(
            (low - 3.98247).abs() < 1e-3 && (high - 4.01753).abs() < 1e-3,
            "{low} {high}"
        );
    }
}
