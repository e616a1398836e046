//! Runs and scores: errors with fixes, outages, NEES consistency.

use nalgebra::{SMatrix, SVector};
use northing_core::geometry::{rotation, so3};
use northing_core::kalman::covariance::normalized_square;
use northing_core::navigation::gnss_ins::GnssInsConfig;
use northing_simulation::ground::{
    Ground, GroundSample, GroundSensors, RATE_HZ, ReceiverError, simulate,
};
use northing_simulation::random::run_seed;
use rayon::prelude::*;

use super::schemes::{Estimate, Scheme, error_state_config, run_error_state};

/// Lengths of the outages that are scored, s.
pub const OUTAGES_S: [usize; 3] = [10, 30, 60];
/// Scores begin after so many seconds.
const SETTLED_S: f64 = 60.0;
/// Outages begin after so many seconds.
const OUTAGE_FROM_S: f64 = 180.0;

/// How much is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Experiment {
    /// Ways of each motion.
    pub runs: u64,
    /// Seed of the first.
    pub seed: u64,
}

/// Root mean squares of one scheme over all runs from a minute on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingScore {
    /// Which.
    pub scheme: Scheme,
    /// Horizontal position, m.
    pub horizontal_m: f64,
    /// Vertical position, m.
    pub vertical_m: f64,
    /// Horizontal velocity, m/s.
    pub velocity_m_s: Option<f64>,
    /// Roll and pitch together, deg.
    pub tilt_deg: Option<f64>,
    /// Heading, deg.
    pub heading_deg: Option<f64>,
}

/// Horizontal error at the end of outages, m: median and the value that 90 % of the runs stay below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutageScore {
    /// Which.
    pub scheme: Scheme,
    /// For each of [`OUTAGES_S`].
    pub median_m: [f64; 3],
    /// For each of [`OUTAGES_S`].
    pub ninety_m: [f64; 3],
}

/// Whether the error-state filter knows its own error.
#[derive(Debug, Clone, PartialEq)]
pub struct Consistency {
    /// Mean normalised estimation error squared of the 15 states over the runs, at each instant looked at. It is
    /// chi-square with 15 degrees of freedom a run, divided by the runs.
    pub nees: Vec<f64>,
    /// Mean of error squared over variance of each of the 15 states.
    pub squared_over_variance: [f64; 15],
}

/// Sums of squares of a run.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    horizontal: f64,
    vertical: f64,
    velocity: Option<f64>,
    tilt: Option<f64>,
    heading: Option<f64>,
}

impl Sums {
    fn add(&mut self, estimate: &Estimate, truth: &GroundSample) {
        let error = estimate.position - truth.position;
        self.count += 1.0;
        self.horizontal += error.xy().norm_squared();
        self.vertical += error.z * error.z;
        if let Some(velocity) = estimate.velocity {
            *self.velocity.get_or_insert(0.0) += (velocity - truth.velocity).xy().norm_squared();
        }
        if let Some(attitude) = estimate.attitude {
            let angles = rotation::to_yaw_pitch_roll(&attitude);
            let truth = rotation::to_yaw_pitch_roll(&truth.ned_from_body);
            let square = |i: usize| {
                let off = (angles[i] - truth[i]).to_degrees();
                let off = off - 360.0 * (off / 360.0).round();
                off * off
            };
            *self.tilt.get_or_insert(0.0) += square(1) + square(2);
            *self.heading.get_or_insert(0.0) += square(0);
        }
    }

    fn merge(mut self, other: &Self) -> Self {
        let both = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a + b).or(a).or(b);
        self.count += other.count;
        self.horizontal += other.horizontal;
        self.vertical += other.vertical;
        self.velocity = both(self.velocity, other.velocity);
        self.tilt = both(self.tilt, other.tilt);
        self.heading = both(self.heading, other.heading);
        self
    }

    fn score(&self, scheme: Scheme) -> TrackingScore {
        let root = |sum: f64| (sum / self.count.max(1.0)).sqrt();
        TrackingScore {
            scheme,
            horizontal_m: root(self.horizontal),
            vertical_m: root(self.vertical),
            velocity_m_s: self.velocity.map(root),
            tilt_deg: self.tilt.map(root),
            heading_deg: self.heading.map(root),
        }
    }
}

impl Experiment {
    fn seeds(&self) -> Vec<u64> {
        (0..self.runs).map(|run| run_seed(self.seed, run)).collect()
    }

    /// Five minutes with a fix a second, scored at every sample after the first.
    #[must_use]
    pub fn tracking(&self, kind: Ground, receiver: ReceiverError) -> Vec<TrackingScore> {
        let sensors = GroundSensors {
            receiver,
            ..GroundSensors::default()
        };
        let runs: Vec<Vec<Sums>> = self
            .seeds()
            .into_par_iter()
            .map(|seed| {
                let way = simulate(kind, &sensors, 300.0, seed);
                let sums = Scheme::ALL.map(|scheme| {
                    let estimates = scheme.run(kind, &sensors, &way, [usize::MAX; 2]);
                    let mut sums = Sums::default();
                    let pairs = estimates.iter().zip(&way);
                    for (estimate, truth) in pairs.filter(|(_, s)| s.time_s >= SETTLED_S) {
                        sums.add(estimate, truth);
                    }
                    sums
                });
                sums.to_vec()
            })
            .collect();
        let of = |(i, scheme): (usize, &Scheme)| {
            let each = runs.iter().filter_map(|run| run.get(i));
            each.fold(Sums::default(), Sums::merge).score(*scheme)
        };
        Scheme::ALL.iter().enumerate().map(of).collect()
    }

    /// Three minutes with fixes, then a minute without.
    #[must_use]
    pub fn outages(&self, kind: Ground) -> Vec<OutageScore> {
        let sensors = GroundSensors::default();
        let from = (OUTAGE_FROM_S * RATE_HZ) as usize;
        let runs: Vec<Vec<[f64; 3]>> = self
            .seeds()
            .into_par_iter()
            .map(|seed| {
                let way = simulate(kind, &sensors, OUTAGE_FROM_S + 61.0, seed);
                let each = Scheme::ALL.map(|scheme| {
                    let estimates = scheme.run(kind, &sensors, &way, [from, usize::MAX]);
                    OUTAGES_S.map(|length| {
                        let at = from + length * RATE_HZ as usize - 1;
                        let pair = estimates.get(at).zip(way.get(at));
                        pair.map_or(f64::NAN, |(e, s)| (e.position - s.position).xy().norm())
                    })
                });
                each.to_vec()
            })
            .collect();
        let of = |(i, scheme): (usize, &Scheme)| {
            let quantile = |length: usize, share: f64| {
                let errors = runs
                    .iter()
                    .filter_map(|run| run.get(i)?.get(length).copied());
                let mut errors: Vec<f64> = errors.collect();
                errors.sort_by(f64::total_cmp);
                interpolated(&errors, share)
            };
            OutageScore {
                scheme: *scheme,
                median_m: [0, 1, 2].map(|length| quantile(length, 0.5)),
                ninety_m: [0, 1, 2].map(|length| quantile(length, 0.9)),
            }
        };
        Scheme::ALL.iter().enumerate().map(of).collect()
    }

    /// The error-state filter with the noises that the sensors have, looked at after the fixes of 60, 120, 180 and
    /// 240 s, and every second for the shares of the states.
    #[must_use]
    pub fn consistency(&self, kind: Ground) -> Consistency {
        // A bias that does not move at all is known to a thousandth of g after minutes, and then the errors of second
        // order are what is left; real ones walk.
        let sensors = GroundSensors {
            accelerometer_bias_random_walk: 1e-3,
            ..GroundSensors::default()
        };
        let config = true_noises(&sensors);
        let runs: Vec<(Vec<f64>, [f64; 16])> = self
            .seeds()
            .into_par_iter()
            .map(|seed| look_at_errors(kind, &sensors, config, seed))
            .collect();
        let n = runs.len().max(1) as f64;
        let instants = runs.iter().map(|(nees, _)| nees.len()).min().unwrap_or(0);
        let at = |i: usize| runs.iter().filter_map(|(nees, _)| nees.get(i)).sum::<f64>() / n;
        let share = |i: usize| {
            let sum: f64 = runs.iter().map(|(_, sums)| sums[i]).sum();
            sum / runs.iter().map(|(_, sums)| sums[15]).sum::<f64>()
        };
        Consistency {
            nees: (0..instants).map(at).collect(),
            squared_over_variance: core::array::from_fn(share),
        }
    }
}

/// The settings that say what the simulation does.
fn true_noises(sensors: &GroundSensors) -> GnssInsConfig<f64> {
    let root = (1.0 / RATE_HZ).sqrt();
    let horizontal_field = 48.0 * 62_f64.to_radians().cos();
    GnssInsConfig {
        accelerometer_noise_density: sensors.accelerometer_std * root,
        accelerometer_bias_random_walk: sensors.accelerometer_bias_random_walk,
        gyroscope_bias_random_walk: sensors.gyroscope_bias_random_walk,
        // Evenly up to the bound.
        accelerometer_bias_std: sensors.accelerometer_bias / 3_f64.sqrt(),
        magnetic_heading_std: sensors.magnetometer_std / horizontal_field,
        time_jitter_s: 0.0,
        ..error_state_config(sensors)
    }
}

/// NEES at the instants, and sums of error squared over variance with their number.
fn look_at_errors(
    kind: Ground,
    sensors: &GroundSensors,
    config: GnssInsConfig<f64>,
    seed: u64,
) -> (Vec<f64>, [f64; 16]) {
    let way = simulate(kind, sensors, 245.0, seed);
    let mut nees = Vec::new();
    let mut sums = [0.0; 16];
    let seen = |k: usize| way.get(k)?.fix;
    run_error_state(config, sensors, &way, seen, false, |ins, truth| {
        let (Some(state), Some(_)) = (ins.state(), truth.fix) else {
            return;
        };
        if truth.time_s < SETTLED_S - 0.5 {
            return;
        }
        let mut error = SVector::<f64, 15>::zeros();
        let turn = so3::log(&(truth.ned_from_body * state.ned_from_body.inverse()));
        let [rate_bias, force_bias] = truth.biases;
        error.fixed_rows_mut::<3>(0).copy_from(&turn);
        error
            .fixed_rows_mut::<3>(3)
            .copy_from(&(truth.velocity - state.velocity));
        error
            .fixed_rows_mut::<3>(6)
            .copy_from(&(truth.position - state.position));
        error
            .fixed_rows_mut::<3>(9)
            .copy_from(&(force_bias - state.accelerometer_bias));
        error
            .fixed_rows_mut::<3>(12)
            .copy_from(&(rate_bias - state.gyroscope_bias));
        let p: &SMatrix<f64, 15, 15> = &state.covariance;
        for (i, sum) in sums.iter_mut().enumerate().take(15) {
            *sum += error[i] * error[i] / p[(i, i)];
        }
        sums[15] += 1.0;
        if (truth.time_s + 0.5) % 60.0 < 1.0 {
            nees.push(normalized_square(&error, p).unwrap_or(f64::INFINITY));
        }
    });
    (nees, sums)
}

/// The value that a share of sorted ones stays below.
fn interpolated(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len().max(1) - 1) as f64;
    let (low, rest) = (place.floor() as usize, place.fract());
    let at = |i: usize| sorted.get(i).copied();
    match (at(low), at(low + 1)) {
        (Some(a), Some(b)) => a + (b - a) * rest,
        (Some(a), None) => a,
        _ => f64::NAN,
    }
}
